from .compilation import code_folder
from .compiled_steps import compile_steps
from .dop853 import dop853_rotation
from .integrate import SteppedRotation, stepped_rotation
from .interpolant import Interpolant, chebyshev, inside, unit_nodes, values_to_coefficients
from .sampling import Sampler, sampler

__all__ = [
    "Interpolant",
    "Sampler",
    "SteppedRotation",
    "chebyshev",
    "code_folder",
    "compile_steps",
    "dop853_rotation",
    "inside",
    "sampler",
    "stepped_rotation",
    "unit_nodes",
    "values_to_coefficients",
]
