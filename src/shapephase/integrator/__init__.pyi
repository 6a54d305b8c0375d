from .integrate import stepped_rotation
from .interpolant import Interpolant
from .kept_code import code_folder
from .machine_code import compile_steps
from .sampling import Sampler
from .smoothness import Smoothness
from .stepped import SteppedRotation

__all__ = [
    "Interpolant",
    "Sampler",
    "Smoothness",
    "SteppedRotation",
    "code_folder",
    "compile_steps",
    "stepped_rotation",
]
