from ._recipes import RigidBody
from .case import Case
from .connection import connected
from .distributions import Choice, Directions, LogNormal, Normal, Rotations, Uniform
from .export import export_study
from .figures import plot_study
from .outputs import OUTPUTS, Output
from .progress import StudyProgress
from .store import STATUS, StudyStore, open_study
from .study import Study
from .study_file import read_study

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
    "connected",
    "export_study",
    "open_study",
    "plot_study",
    "read_study",
]
