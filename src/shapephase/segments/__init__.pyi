from .coalitions import shapley_interactions, shapley_values
from .contributions import Contributions, contributions
from .direct_shares import DirectShares
from .limbs import JointGroups, joint_groups
from .momentum import FlightMomentum, Normalisation, SegmentMomentum, segment_momentum

__all__ = [
    "Contributions",
    "DirectShares",
    "FlightMomentum",
    "JointGroups",
    "Normalisation",
    "SegmentMomentum",
    "contributions",
    "joint_groups",
    "segment_momentum",
    "shapley_interactions",
    "shapley_values",
]
