"""The command line: `shapephase split`, `plan`, `check`, `orbits`, `conjugate`, `view`, `plot`, `robots`, `compile`.

Here the commands are named, and errors, warnings and results become text, JSON and exit codes. The modules of the
commands import what they compute with when they are called, so that `shapephase --help` does not wait for it.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Sequence
from importlib.metadata import version
from typing import NoReturn

from cyclopts import App, CycloptsError

from ..errors import ShapePhaseError
from .check import check_command
from .conjugate import conjugate_command
from .exit_codes import ExitCode, exit_code_of
from .library import compile_command, robots_command
from .orbits import orbits_command
from .outcome import Outcome
from .pictures import plot_command, view_command
from .plan import plan_command
from .split import split_command

app = App(
    name="shapephase",
    help="A free body changes its shape in a known way; how does it turn?",
    result_action="return_value",
)
app.command(split_command, name="split")
app.command(view_command, name="view")
app.command(plot_command, name="plot")
app.command(plan_command, name="plan")
app.command(conjugate_command, name="conjugate")
app.command(check_command, name="check")
app.command(orbits_command, name="orbits")
app.command(robots_command, name="robots")
app.command(compile_command, name="compile")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0, or with one line on stderr 2 usage, 3 body, 4 trajectory, 5 numerics.

    Warnings are lines on stderr too, and a list in what `--json` prints. Ctrl-C ends with 130.
    """
    tokens = sys.argv[1:] if arguments is None else list(arguments)
    as_json = "--json" in tokens
    outcome, failure = None, None
    with warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always")
        try:
            outcome = app(tokens, exit_on_error=False, print_error=False)
        except CycloptsError as error:
            failure = (_one_line(error), ExitCode.USAGE, as_json, "usage")
        except ShapePhaseError as error:
            failure = (_one_line(error), exit_code_of(error), as_json, type(error).__name__)
        except KeyboardInterrupt:
            raise SystemExit(ExitCode.STOPPED) from None
    messages = list(dict.fromkeys(_one_line(warning.message) for warning in raised))
    for message in messages:
        print(f"shapephase: warning: {message}", file=sys.stderr)
    if failure:
        _fail(*failure)
    if isinstance(outcome, Outcome):
        data, text = {"shapephase": version("shapephase"), **outcome.data, "warnings": messages}, outcome.text
        if outcome.with_verdict:
            many = "1 warning" if len(messages) == 1 else f"{len(messages)} warnings"
            verdict = f"usable, with {many}" if messages else "no fault found"
            listed = "".join(f"\nwarning: {message}" for message in messages)
            data, text = data | {"verdict": verdict}, f"{text}\n{listed}\nverdict: {verdict}"
        print(json.dumps(data, indent=2) if as_json else text)
        if outcome.code:
            raise SystemExit(outcome.code)


def _one_line(error: Warning | Exception | str) -> str:
    return " ".join(str(error).split())


def _fail(message: str, code: ExitCode, as_json: bool, kind: str) -> NoReturn:
    if as_json:
        print(json.dumps({"error": {"type": kind, "message": message, "exit_code": code}}))
    print(f"shapephase: {message}", file=sys.stderr)
    raise SystemExit(code)
