from .limbs import JointGroups, joint_groups

__all__ = [
    "JointGroups",
    "joint_groups",
]
