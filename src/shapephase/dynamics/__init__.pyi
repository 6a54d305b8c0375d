from .loads import JointLoads
from .swinging import FreeHinges, free_hinges
from .torque_noise import LoadErrors, TorqueErrors, load_errors, torque_errors
from .torques import JointTorques, joint_torques
from .wheels import wheel_speeds

__all__ = [
    "FreeHinges",
    "JointLoads",
    "JointTorques",
    "LoadErrors",
    "TorqueErrors",
    "free_hinges",
    "joint_torques",
    "load_errors",
    "torque_errors",
    "wheel_speeds",
]
