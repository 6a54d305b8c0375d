from ._athlete_axes import AthleteAxes
from ._solvers import Solution
from .external_torque import ExternalTorque, TorqueState
from .forced_motion import ForcedMotion
from .reconstruction import Motion, MotionFamily, Sensitivity, load_motion, momentum_from_rate, reconstruct
from .recorded_base import BaseDifference, base_difference

__all__ = [
    "AthleteAxes",
    "BaseDifference",
    "ExternalTorque",
    "ForcedMotion",
    "Motion",
    "MotionFamily",
    "Sensitivity",
    "Solution",
    "TorqueState",
    "base_difference",
    "load_motion",
    "momentum_from_rate",
    "reconstruct",
]
