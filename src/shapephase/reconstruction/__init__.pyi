from ._solvers import Solution
from .motion_family import MotionFamily
from .reconstruction import Motion, Sensitivity, load_motion, momentum_from_rate, reconstruct
from .recorded_base import BaseDifference, base_difference

__all__ = [
    "BaseDifference",
    "Motion",
    "MotionFamily",
    "Sensitivity",
    "Solution",
    "base_difference",
    "load_motion",
    "momentum_from_rate",
    "reconstruct",
]
