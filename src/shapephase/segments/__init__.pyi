from .coalitions import shapley_interactions, shapley_values
from .contributions import Contributions, contributions
from .direct_shares import DirectShares
from .limbs import JointGroups, joint_groups

__all__ = [
    "Contributions",
    "DirectShares",
    "JointGroups",
    "contributions",
    "joint_groups",
    "shapley_interactions",
    "shapley_values",
]
