from .loads import JointLoads
from .torques import JointTorques, joint_torques

__all__ = ["JointLoads", "JointTorques", "joint_torques"]
