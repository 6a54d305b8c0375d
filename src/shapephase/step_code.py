"""The innermost loops of `reconstruct` in machine code."""

from __future__ import annotations

from pathlib import Path

from . import compiled, growth, march
from .machine_code import compile_functions, in_machine_code
from .spectrum import inverted


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
            march.momentum_step_function(True),
            march.momentum_step_function(False),
            march.rest_step_function(),
            growth.slope_step_function(),
            growth.derivative_step_function(2),
            compiled.row_function(growth.largest_growth, 9 * growth.CHECKPOINTS),
            compiled.row_function(inverted, 12),
        ]
    )
    forget_functions()
    return written


def forget_functions() -> None:
    """Look for compiled functions anew when they are next needed."""
    in_machine_code.cache_clear()
    for module in (compiled, march, growth):
        module.forget_functions()
