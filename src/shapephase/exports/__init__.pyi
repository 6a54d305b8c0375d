from .simulator_arrays import MujocoArrays, PinocchioArrays, mujoco_arrays, pinocchio_arrays
from .tables import export_motion, motion_dataset

__all__ = [
    "MujocoArrays",
    "PinocchioArrays",
    "export_motion",
    "motion_dataset",
    "mujoco_arrays",
    "pinocchio_arrays",
]
