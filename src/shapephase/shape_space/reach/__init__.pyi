from .holonomy_algebra import OrderReach, PairTurn, Reach, reachable
from .manipulators import dynamic_manipulability, generalised_jacobian, reaction_null_space
from .perturbation_frames import MinimumPerturbation, minimum_perturbation
from .smallest_loops import AxisLoop

__all__ = [
    "AxisLoop",
    "MinimumPerturbation",
    "OrderReach",
    "PairTurn",
    "Reach",
    "dynamic_manipulability",
    "generalised_jacobian",
    "minimum_perturbation",
    "reachable",
    "reaction_null_space",
]
