from .compilation import code_folder
from .compiled_steps import compile_steps
from .dop853 import dop853_rotation
from .integrate import SteppedRotation, stepped_rotation
from .interpolant import Interpolant
from .sampling import Sampler, sampler

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
