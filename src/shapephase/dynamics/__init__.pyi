from .loads import JointLoads
from .swinging import FreeHinges, free_hinges
from .torques import JointTorques, joint_torques
from .wheels import wheel_speeds

__all__ = ["FreeHinges", "JointLoads", "JointTorques", "free_hinges", "joint_torques", "wheel_speeds"]
