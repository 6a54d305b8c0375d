from .dop853 import dop853_rotation
from .fast.cache_folder import code_folder
from .fast.engine import compile_steps
from .integrate import stepped_rotation
from .interpolant import Interpolant
from .sampling import Sampler, sampler
from .stepped import SteppedRotation

__all__ = [
    "Interpolant",
    "Sampler",
    "SteppedRotation",
    "code_folder",
    "compile_steps",
    "dop853_rotation",
    "sampler",
    "stepped_rotation",
]
