"""The innermost loops of `reconstruct` in machine code."""

from __future__ import annotations

from pathlib import Path

from . import _error_propagator as error_propagator
from . import _step_loop as step_loop
from . import casadi_calls
from ._spectral_error import inverse_channels
from .compilation import compile_functions, compiled_or_interpreted


def compile_steps() -> list[Path]:
    """Compile the innermost loops of `reconstruct` with this machine's C compiler, once for all.

    They are kept in $XDG_CACHE_HOME/shapephase (or ~/.cache/shapephase), where this and every later process finds
    them; deleting the folder undoes it. Results stay the same to the last bit, and to rounding for more than 24 momenta
    at once.

    Returns
    -------
    The files written.

    Raises
    ------
    CompilerError
        If there is no C compiler (`cc`, or what $CC names), it fails, its code gives other numbers, or the folder
        cannot be written to.
    """
    written = compile_functions(
        [
            step_loop.momentum_step_function(True),
            step_loop.momentum_step_function(False),
            step_loop.rest_step_function(),
            error_propagator.slope_step_function(),
            error_propagator.derivative_step_function(2),
            casadi_calls.row_function(error_propagator.largest_amplification, 9 * error_propagator.CHECKPOINTS),
            casadi_calls.row_function(inverse_channels, 12),
        ]
    )
    forget_functions()
    return written


def forget_functions() -> None:
    """Search for compiled functions again when they are next needed."""
    compiled_or_interpreted.cache_clear()
    for module in (casadi_calls, step_loop, error_propagator):
        module.forget_functions()
