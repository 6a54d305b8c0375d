from .bvh import write_bvh
from .ccsds import AttitudeMessage, write_aem
from .opensim import write_opensim_motion
from .simulator_arrays import MujocoArrays, PinocchioArrays, mujoco_arrays, pinocchio_arrays
from .spice import SpiceKernels, write_spice_ck
from .tables import export_motion, motion_dataset

__all__ = [
    "AttitudeMessage",
    "MujocoArrays",
    "PinocchioArrays",
    "SpiceKernels",
    "export_motion",
    "motion_dataset",
    "mujoco_arrays",
    "pinocchio_arrays",
    "write_aem",
    "write_bvh",
    "write_opensim_motion",
    "write_spice_ck",
]
