from . import (
    auditing,
    body,
    bounds,
    deformation,
    dynamics,
    elliptic,
    error_bars,
    errors,
    examples,
    exports,
    inertia_tensor,
    integrator,
    inverse_design,
    optimal_control,
    phases,
    planar,
    plots,
    reconstruction,
    rigid_body,
    segments,
    shape_space,
    so3,
    sphere,
    study,
)
from .auditing.audit_result import Audit
from .auditing.floating_trajectory import FloatingTrajectory
from .auditing.reading import read_trajectory
from .auditing.trajectory_audit import audit
from .body.body import Body
from .body.catalog import robot_names
from .body.family import BodyFamily
from .body.loading import load_body
from .body.particles.point_masses import ParticleBody, particle_body
from .deformation.deformation import Deformation, DeformationFamily, articulated, particles, prescribed, rigid
from .deformation.gauge import horizontal_gauge, in_gauge, link_gauge, mean_body_gauge, principal_gauge
from .dynamics.loads import JointLoads
from .dynamics.swinging import FreeHinges, free_hinges
from .dynamics.torque_noise import TorqueErrors, torque_errors
from .dynamics.torques import JointTorques, joint_torques
from .error_bars.covariance import Uncertainty, sampled_uncertainty, uncertainty
from .error_bars.error_sources import InertiaErrors
from .error_bars.forced_covariance import ForcedUncertainty
from .error_bars.recorded_flight import RecordedFlight, motion_from_recording
from .error_bars.recorded_momentum import RecordedMomentum, momentum_from_recording
from .error_bars.result_derivatives import Derivatives, ResultDerivative, derivatives
from .errors import (
    CompiledCodeWarning,
    IgnoredElementWarning,
    ImplausibleBodyWarning,
    ShapePhaseError,
    TrajectoryWarning,
    UnphysicalInertiaWarning,
)
from .exports.tables import export_motion
from .integrator.machine_code import compile_steps
from .inverse_design.designing import Design, design
from .optimal_control.planning import plan_reorientation
from .phases.continuation import OrbitBranch, continued_orbits
from .phases.forced_split import ForcedSplit
from .phases.phase_split import PhaseSplit
from .phases.phases import (
    ArcPhases,
    RunningPhases,
    arc_phases,
    dynamic_phase_from_energy,
    parallel_transport,
    running_phases,
    split,
)
from .phases.recurrence import Returns, momentum_returns
from .phases.return_map import FixedPoints, ReturnMap, closed_orbits, fixed_points, stroboscopic_map
from .phases.whole_turns import TurnCounts, turn_counts
from .plots.pages.viewer import view
from .reconstruction.external_torque import ExternalTorque, TorqueState
from .reconstruction.forced_motion import ForcedMotion
from .reconstruction.reconstruction import (
    Motion,
    MotionFamily,
    Sensitivity,
    load_motion,
    momentum_from_rate,
    reconstruct,
)
from .reconstruction.recorded_base import BaseDifference, base_difference
from .rigid_body import geodesics
from .rigid_body.euler_top import EulerTop
from .rigid_body.gyrostat import Gyrostat
from .segments.limb_contributions import Contributions, contributions
from .segments.momentum import SegmentMomentum, segment_momentum
from .shape_space.closest_approach import clearance
from .shape_space.connection import (
    HorizontalLift,
    curvature,
    holonomy,
    holonomy_derivative,
    horizontal_lift,
    mechanical_connection,
)
from .shape_space.curvature_field import curvature_on_plane, is_flat, stokes_holonomy
from .shape_space.files.read import RecordedMotion, read_recorded_motion, read_shape_path
from .shape_space.files.write import write_shape_path
from .shape_space.path_noise import PathErrors, path_errors
from .shape_space.reach.holonomy_algebra import Reach, reachable
from .shape_space.reach.manipulators import dynamic_manipulability, generalised_jacobian, reaction_null_space
from .shape_space.reach.perturbation_frames import MinimumPerturbation, minimum_perturbation
from .shape_space.shape_path import ShapePath
from .shape_space.summaries import BodySummary, PathSummary, body_summary, path_summary

__version__: str
__all__ = [
    "ArcPhases",
    "Audit",
    "BaseDifference",
    "Body",
    "BodyFamily",
    "BodySummary",
    "CompiledCodeWarning",
    "Contributions",
    "Deformation",
    "DeformationFamily",
    "Derivatives",
    "Design",
    "EulerTop",
    "ExternalTorque",
    "FixedPoints",
    "FloatingTrajectory",
    "ForcedMotion",
    "ForcedSplit",
    "ForcedUncertainty",
    "FreeHinges",
    "Gyrostat",
    "HorizontalLift",
    "IgnoredElementWarning",
    "ImplausibleBodyWarning",
    "InertiaErrors",
    "JointLoads",
    "JointTorques",
    "MinimumPerturbation",
    "Motion",
    "MotionFamily",
    "OrbitBranch",
    "ParticleBody",
    "PathErrors",
    "PathSummary",
    "PhaseSplit",
    "Reach",
    "RecordedFlight",
    "RecordedMomentum",
    "RecordedMotion",
    "ResultDerivative",
    "ReturnMap",
    "Returns",
    "RunningPhases",
    "SegmentMomentum",
    "Sensitivity",
    "ShapePath",
    "ShapePhaseError",
    "TorqueErrors",
    "TorqueState",
    "TrajectoryWarning",
    "TurnCounts",
    "Uncertainty",
    "UnphysicalInertiaWarning",
    "arc_phases",
    "articulated",
    "audit",
    "auditing",
    "base_difference",
    "body",
    "body_summary",
    "bounds",
    "clearance",
    "closed_orbits",
    "compile_steps",
    "continued_orbits",
    "contributions",
    "curvature",
    "curvature_on_plane",
    "deformation",
    "derivatives",
    "design",
    "dynamic_manipulability",
    "dynamic_phase_from_energy",
    "dynamics",
    "elliptic",
    "error_bars",
    "errors",
    "examples",
    "export_motion",
    "exports",
    "fixed_points",
    "free_hinges",
    "generalised_jacobian",
    "geodesics",
    "holonomy",
    "holonomy_derivative",
    "horizontal_gauge",
    "horizontal_lift",
    "in_gauge",
    "inertia_tensor",
    "integrator",
    "inverse_design",
    "is_flat",
    "joint_torques",
    "link_gauge",
    "load_body",
    "load_motion",
    "mean_body_gauge",
    "mechanical_connection",
    "minimum_perturbation",
    "momentum_from_rate",
    "momentum_from_recording",
    "momentum_returns",
    "motion_from_recording",
    "optimal_control",
    "parallel_transport",
    "particle_body",
    "particles",
    "path_errors",
    "path_summary",
    "phases",
    "plan_reorientation",
    "planar",
    "plots",
    "prescribed",
    "principal_gauge",
    "reachable",
    "reaction_null_space",
    "read_recorded_motion",
    "read_shape_path",
    "read_trajectory",
    "reconstruct",
    "reconstruction",
    "rigid",
    "rigid_body",
    "robot_names",
    "running_phases",
    "sampled_uncertainty",
    "segment_momentum",
    "segments",
    "shape_space",
    "so3",
    "sphere",
    "split",
    "stokes_holonomy",
    "stroboscopic_map",
    "study",
    "torque_errors",
    "turn_counts",
    "uncertainty",
    "view",
    "write_shape_path",
]
