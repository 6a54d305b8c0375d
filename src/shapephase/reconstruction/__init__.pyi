from ._solvers import Solution
from .reconstruction import Motion, Sensitivity, load_motion, momentum_from_rate, reconstruct
from .recorded_base import BaseDifference, base_difference

__all__ = [
    "BaseDifference",
    "Motion",
    "Sensitivity",
    "Solution",
    "base_difference",
    "load_motion",
    "momentum_from_rate",
    "reconstruct",
]
