from .closed_form import RigidRotation, rigid_rotation
from .motion_record import MotionRecord, read_motion_record, write_motion_record, write_table
from .reconstruction import Motion, Sensitivity, Solution, load_motion, momentum_from_rate, reconstruct
from .recorded_base import BaseDifference, base_difference

__all__ = [
    "BaseDifference",
    "Motion",
    "MotionRecord",
    "RigidRotation",
    "Sensitivity",
    "Solution",
    "base_difference",
    "load_motion",
    "momentum_from_rate",
    "read_motion_record",
    "reconstruct",
    "rigid_rotation",
    "write_motion_record",
    "write_table",
]
