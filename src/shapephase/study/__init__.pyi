from ._evaluate import STATUS
from ._recipes import RigidBody
from .cases import Case
from .dask_client import connected
from .distributions import Choice, Directions, LogNormal, Normal, Rotations, Uniform
from .export import export_study
from .figures import plot_study
from .outputs import OUTPUTS, Output
from .store import StudyStore, open_study
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
    "StudyStore",
    "Uniform",
    "connected",
    "export_study",
    "open_study",
    "plot_study",
    "read_study",
]
