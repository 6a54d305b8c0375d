from .compilation import code_folder, compile_functions, compiled_or_interpreted, same_numbers
from .compiled_steps import compile_steps
from .integrate import SteppedRotation, dop853_rotation, stepped_rotation
from .interpolant import Interpolant, chebyshev, inside, unit_nodes, values_to_coefficients
from .sampling import LoopSampler, Sampler, sampler

__all__ = [
    "Interpolant",
    "LoopSampler",
    "Sampler",
    "SteppedRotation",
    "chebyshev",
    "code_folder",
    "compile_functions",
    "compile_steps",
    "compiled_or_interpreted",
    "dop853_rotation",
    "inside",
    "same_numbers",
    "sampler",
    "stepped_rotation",
    "unit_nodes",
    "values_to_coefficients",
]
