from .coalitions import shapley_interactions, shapley_values
from .direct_shares import DirectShares
from .limb_contributions import Contributions, contributions
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
