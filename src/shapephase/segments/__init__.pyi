from .coalitions import shapley_interactions, shapley_values
from .direct_shares import DirectShares
from .limb_contributions import Contributions, contributions
from .limbs import JointGroups, joint_groups
from .momentum import FlightMomentum, Normalisation, SegmentMomentum, segment_momentum
from .share_bars import ShareBars

__all__ = [
    "Contributions",
    "DirectShares",
    "FlightMomentum",
    "JointGroups",
    "Normalisation",
    "SegmentMomentum",
    "ShareBars",
    "contributions",
    "joint_groups",
    "segment_momentum",
    "shapley_interactions",
    "shapley_values",
]
