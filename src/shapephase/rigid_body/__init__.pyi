from . import geodesics, lie
from ._andoyer_pendulum import AndoyerPendulum, andoyer_pendulum
from ._flow import flow
from ._half_twist import HalfTwist, half_twist, half_twist_from_tilt, racket_twist, twist_defect
from ._momentum_orbit import (
    MomentumOrbit,
    WeierstrassForm,
    momentum_orbit,
    separatrix_solid_angle,
    weierstrass_form,
)
from ._nutation import Nutation, nutation
from .euler_angles import ZXZ, ZYZ, EulerChart, canonical_bracket, precession_rate
from .euler_top import EulerTop
from .gyrostat import (
    DualSpinTurn,
    Gyrostat,
    GyrostatEquilibrium,
    bifurcation_rotors,
    dual_spin_turn,
    gyrostat_equilibria,
)
from .heavy_top import HeavyTop, HeavyTopMotion, casimirs, semidirect_bracket
from .lagrange_top import (
    LagrangeTop,
    SleepingTop,
    StabilityChart,
    characteristic_polynomial,
    e_quadratic,
    second_variation,
    sleeping_matrix,
    sleeping_spectrum,
    sleeping_top,
    spectrally_stable,
    stability_chart,
    upright_potential,
)
from .pendulum import PendulumEquilibrium, PendulumMotion, RigidBodyPendulum, rigid_body_pendulum
from .poinsot import Closure, Cones, Poinsot, cones
from .portrait import Equilibrium, equilibria, heteroclinics, inverse_difference, polhodes
from .pseudo_rigid import PseudoRigidBody, PseudoRigidMotion, PseudoRigidSpin, pseudo_rigid_spin
from .stability import SpinInSpace, SteadyRotation, spin_in_space, steady_rotation, steady_rotations
from .top_phase import HeavyTopPhase, heavy_top_phase
from .twisting_somersault import RotorDive, rotor_dive, rotor_dive_lasting, tilt_of_ratio

__all__ = [
    "ZXZ",
    "ZYZ",
    "AndoyerPendulum",
    "Closure",
    "Cones",
    "DualSpinTurn",
    "Equilibrium",
    "EulerChart",
    "EulerTop",
    "Gyrostat",
    "GyrostatEquilibrium",
    "HalfTwist",
    "HeavyTop",
    "HeavyTopMotion",
    "HeavyTopPhase",
    "LagrangeTop",
    "MomentumOrbit",
    "Nutation",
    "PendulumEquilibrium",
    "PendulumMotion",
    "Poinsot",
    "PseudoRigidBody",
    "PseudoRigidMotion",
    "PseudoRigidSpin",
    "RigidBodyPendulum",
    "RotorDive",
    "SleepingTop",
    "SpinInSpace",
    "StabilityChart",
    "SteadyRotation",
    "WeierstrassForm",
    "andoyer_pendulum",
    "bifurcation_rotors",
    "canonical_bracket",
    "casimirs",
    "characteristic_polynomial",
    "cones",
    "dual_spin_turn",
    "e_quadratic",
    "equilibria",
    "flow",
    "geodesics",
    "gyrostat_equilibria",
    "half_twist",
    "half_twist_from_tilt",
    "heavy_top_phase",
    "heteroclinics",
    "inverse_difference",
    "lie",
    "momentum_orbit",
    "nutation",
    "polhodes",
    "precession_rate",
    "pseudo_rigid_spin",
    "racket_twist",
    "rigid_body_pendulum",
    "rotor_dive",
    "rotor_dive_lasting",
    "second_variation",
    "semidirect_bracket",
    "separatrix_solid_angle",
    "sleeping_matrix",
    "sleeping_spectrum",
    "sleeping_top",
    "spectrally_stable",
    "spin_in_space",
    "stability_chart",
    "steady_rotation",
    "steady_rotations",
    "tilt_of_ratio",
    "twist_defect",
    "upright_potential",
    "weierstrass_form",
]
