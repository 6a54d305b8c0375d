from .holonomy_algebra import OrderReach, PairTurn, Reach, reachable
from .perturbation_frames import MinimumPerturbation, minimum_perturbation
from .smallest_loops import AxisLoop

__all__ = [
    "AxisLoop",
    "MinimumPerturbation",
    "OrderReach",
    "PairTurn",
    "Reach",
    "minimum_perturbation",
    "reachable",
]
