from ._recipes import RigidBody
from .case import Case
from .distributions import Choice, Directions, LogNormal, Normal, Rotations, Uniform
from .outputs import OUTPUTS, Output
from .progress import StudyProgress
from .store import STATUS, StudyStore, open_study
from .study import Study

__all__ = [
    "OUTPUTS",
    "STATUS",
    "Case",
    "Choice",
    "Directions",
    "LogNormal",
    "Normal",
    "Output",
    "RigidBody",
    "Rotations",
    "Study",
    "StudyProgress",
    "StudyStore",
    "Uniform",
    "open_study",
]
