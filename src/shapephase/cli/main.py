"""The command line: `shapephase split`, `plan`, `check`, `orbits`, `conjugate`, `view`, `plot`, `robots`, ...

Here the commands are named, and errors, warnings and results become text, JSON and exit codes. The modules of the
commands import what they compute with when they are called, so that `shapephase --help` does not wait for it.
"""

from __future__ import annotations

import json
import re
import sys
import traceback
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

from cyclopts import App, CycloptsError, UnknownOptionError
from cyclopts.help import format_usage

from .. import __version__
from ..errors import OutputFileError, ShapePhaseError
from ..integrator.machine_code import as_command
from ..provenance import command_line, provenance
from .audit import audit_command
from .check import check_command
from .contributions import contributions_command
from .ctrl_c import forget, was_pressed
from .export import export_command
from .installation import compile_command, doctor_command, robots_command
from .loop import loop_command
from .momentum import momentum_command
from .options import HELP_ALL, SHOWS_ALL
from .orbits import orbits_command
from .outcome import ExitCode, Outcome, exit_code_of
from .pictures import explore_command, plot_command, view_command
from .plans.plan import plan_command
from .reach import reach_command
from .rigid_body.conjugate import conjugate_command
from .rigid_body.rigid import rigid_command
from .split import split_command
from .sweep import plot_study_command, sweep_app
from .terminal import Verbosity, abandon, one_line, put, say, verbosity, verbosity_from
from .torques import torques_command

_EXIT_CODES = "\n".join(["Exit codes:", "", *(f"- {code.value}: {code.meaning}" for code in ExitCode)])
_WHERE_EXIT_CODES = "Exit codes: `shapephase --help`"
app = App(
    name="shapephase",
    help="A free body changes its shape in a known way; how does it turn?",
    help_epilogue=_EXIT_CODES,
    help_format="markdown",
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)
plot_app = App(name="plot", help_epilogue=_WHERE_EXIT_CODES)
plot_app.default(plot_command)
plot_app.command(plot_study_command, name="sweep")
sweep_app.help_epilogue = _WHERE_EXIT_CODES
for _name, _command in {
    "split": split_command,
    "contributions": contributions_command,
    "momentum": momentum_command,
    "torques": torques_command,
    "export": export_command,
    "view": view_command,
    "plot": plot_app,
    "explore": explore_command,
    "plan": plan_command,
    "conjugate": conjugate_command,
    "reach": reach_command,
    "loop": loop_command,
    "rigid": rigid_command,
    "check": check_command,
    "audit": audit_command,
    "orbits": orbits_command,
    "sweep": sweep_app,
    "robots": robots_command,
    "compile": compile_command,
    "doctor": doctor_command,
}.items():
    if isinstance(_command, App):
        app.command(_command)
    else:
        app.command(_command, name=_name, help_epilogue=_WHERE_EXIT_CODES)
app.register_install_completion_command(
    help="Let the shell complete commands and options with the tabulator key; for bash, zsh and fish."
)


@dataclass(frozen=True, kw_only=True)
class _Failure:
    """Failure of a command: message, exit code, kind."""

    message: str
    code: ExitCode
    kind: str


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; an error ends it with one line on stderr and one of `ExitCode`.

    Warnings are lines on stderr too, and a list in what `--json` prints.
    """
    tokens = sys.argv[1:] if arguments is None else list(arguments)
    SHOWS_ALL.set(HELP_ALL in tokens)
    # A vector in quotes that begins with a minus, as "-0.1 0 1", is no option.
    tokens = ["--help" if token == HELP_ALL else re.sub(r"^(?=-[\d.]+[\s,])", " ", token) for token in tokens]
    with verbosity_from(tokens), command_line(tokens), as_command():
        try:
            code = _ran(tokens, as_json="--json" in tokens)
        except BrokenPipeError:
            # The reader closed the pipe.
            for stream in (sys.stdout, sys.stderr):
                abandon(stream)
            code = ExitCode.BROKEN_PIPE
        except KeyboardInterrupt:
            forget()
            say("shapephase: stopped", Verbosity.QUIET)
            code = ExitCode.STOPPED
    if code:
        raise SystemExit(code)


def _ran(tokens: list[str], *, as_json: bool) -> int:
    """Run a command, print its result, and return the exit code."""
    with warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always")
        outcome = _outcome(tokens)
    messages = list(dict.fromkeys(one_line(warning.message) for warning in raised))
    for message in messages:
        say(f"shapephase: warning: {message}")
    if isinstance(outcome, _Failure):
        return _reported(outcome, as_json=as_json)
    if not isinstance(outcome, Outcome):
        return ExitCode.DONE
    # The recording is part of the result already.
    made_from = {name: value for name, value in outcome.made_from.items() if name != "recording"}
    data, text = {"shapephase": __version__, **outcome.data, "warnings": messages}, outcome.text
    data["provenance"] = provenance(made_from)
    if outcome.with_verdict:
        many = "1 warning" if len(messages) == 1 else f"{len(messages)} warnings"
        verdict = f"OK, {many}" if messages else "OK"
        listed = "".join(f"\nwarning: {message}" for message in messages)
        data, text = data | {"verdict": verdict}, f"{text}\n{listed}\nverdict: {verdict}"
    try:
        if as_json or text:
            put(json.dumps(data, indent=2) if as_json else text, aside=outcome.aside)
    except OutputFileError as error:
        return _reported(_failure(error), as_json=False)
    return outcome.code


def _outcome(tokens: list[str]) -> Outcome | _Failure | None:
    """Return the result of a command, or its failure."""
    try:
        return app(tokens, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        return _Failure(message=_usage_message(error), code=ExitCode.USAGE, kind="usage")
    except ShapePhaseError as error:
        # Such an import may also have become a missing extra.
        if was_pressed():
            raise KeyboardInterrupt from error
        return _failure(error)
    except MemoryError:
        return _Failure(message="there is not enough memory for this", code=ExitCode.NUMERICS, kind="MemoryError")
    except BrokenPipeError:
        raise
    except Exception as error:
        if was_pressed():
            raise KeyboardInterrupt from error
        if verbosity() is Verbosity.VERBOSE:
            traceback.print_exc()
        place = traceback.extract_tb(error.__traceback__)[-1]
        message = f"{type(error).__name__}: {one_line(error)} ({place.filename}:{place.lineno})"
        hint = "this is a bug of shapephase, please report it"
        return _Failure(message=f"{hint}: {message}", code=ExitCode.INTERNAL, kind=type(error).__name__)


def _usage_message(error: CycloptsError) -> str:
    """Return one line on words that do not fit: the message of Cyclopts, an example of the option, and the usage."""
    chain, apps, _ = app.parse_commands(error.command_chain or ())
    usage = format_usage(app, chain, execution_path=apps).plain.strip()
    words = [one_line(error)]
    if error.argument is not None:
        option = error.argument.name
        described = {
            own.name: own.parameter.help for own in apps[-1].assemble_argument_collection(parse_docstring=True)
        }
        example = re.search(rf"example\s+`({re.escape(option)}\s[^`]*)`", str(described.get(option)))
        words += [f"For example `{' '.join(example[1].split())}`."] if example else []
    elif not chain and not isinstance(error, UnknownOptionError):
        words.append("The command comes first, as in `shapephase split cat cat_righting`.")
    return f"{' '.join(words)} Usage: {usage}; see {' '.join(('shapephase', *chain))} --help"


def _failure(error: ShapePhaseError) -> _Failure:
    return _Failure(message=one_line(error), code=exit_code_of(error), kind=type(error).__name__)


def _reported(failure: _Failure, *, as_json: bool) -> ExitCode:
    if as_json:
        described = {"type": failure.kind, "message": failure.message, "exit_code": failure.code}
        try:
            put(json.dumps({"error": described}))
        except OutputFileError as error:
            say(f"shapephase: {one_line(error)}", Verbosity.QUIET)
    say(f"shapephase: {failure.message}", Verbosity.QUIET)
    return failure.code
