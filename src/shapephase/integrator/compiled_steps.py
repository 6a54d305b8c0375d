"""The innermost loops of `reconstruct` in machine code."""

from __future__ import annotations

from pathlib import Path

from . import casadi_calls, error_propagator, step_loop
from .compilation import compile_functions, compiled_or_interpreted
from .spectral_error import inverted


def compile_steps() -> list[Path]:
    """Compile the innermost loops of `reconstruct` with this machine's C compiler, once and for all.

    They are kept in $XDG_CACHE_HOME/shapephase (or ~/.cache/shapephase), where this and every later session finds
    them; deleting the folder undoes it. Results stay the same to the last bit; of more than 24 momenta at once, to
    rounding.

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
            casadi_calls.row_function(error_propagator.largest_growth, 9 * error_propagator.CHECKPOINTS),
            casadi_calls.row_function(inverted, 12),
        ]
    )
    forget_functions()
    return written


def forget_functions() -> None:
    """Look for compiled functions anew when they are next needed."""
    compiled_or_interpreted.cache_clear()
    for module in (casadi_calls, step_loop, error_propagator):
        module.forget_functions()
