"""What is said of words on the command line that do not fit: what is wanted there, what came, an example."""

from __future__ import annotations

import difflib
import inspect
import re
from collections.abc import Iterable

from cyclopts import App, CoercionError, CycloptsError, MissingArgumentError, UnknownCommandError, UnknownOptionError
from cyclopts.exceptions import ConsumeMultipleError, UnusedCliTokensError

from ..terminal import one_line

_KINDS = {float: "a number", int: "a whole number"}
_LONGEST_SHOWN = 80
"""Characters of a word that are repeated."""
# What people type who look for help, and what there is.
_QUESTIONS = {"help": "--help", "man": "--help", "usage": "--help", "version": "--version", "list": "robots"}


def usage_message(error: CycloptsError, app: App) -> str:
    """One line on words of the command line that do not fit."""
    if isinstance(error, UnknownCommandError):
        return _unknown_command((error.unused_tokens or [""])[0], app)
    command = " ".join(error.command_chain or ())
    if isinstance(error, UnusedCliTokensError) and command:
        listed = ", ".join(repr(word[:_LONGEST_SHOWN]) for word in error.unused_tokens or ())
        return f"{command}: too many words: {listed}; it is `{_form(error, command)}`"
    if isinstance(error, UnknownOptionError):
        return _unknown_option(error)
    if isinstance(error, CoercionError) and error.msg is None and error.target_type in _KINDS and error.token:
        kind, came = _KINDS[error.target_type], str(error.token.value)[:_LONGEST_SHOWN]
        return f"{_name(error)}: {kind} is needed, got {came!r}{_such_as(error)}"
    if isinstance(error, MissingArgumentError) and not isinstance(error, ConsumeMultipleError):
        return _missing(error, command)
    return _with_help(error)


def _with_help(error: CycloptsError) -> str:
    command = " ".join(("shapephase", *(error.command_chain or ())))
    return f"{one_line(error)} Type {command} --help for its options"


def _missing(error: MissingArgumentError, command: str) -> str:
    assert error.argument is not None
    count, _ = error.argument.token_count()
    name = error.keyword or _name(error)
    if not name.startswith("-"):
        return f"{command}: {name} is missing; it is `{_form(error, command)}`"
    if not any(word.split("=", 1)[0] in error.argument.names for word in error.root_input_tokens or ()):
        return f"{command}: {name} is needed{_such_as(error)}"
    if count < 2:
        return f"{name}: a value is missing after it{_such_as(error)}"
    came = " ".join(error.tokens_so_far)[:_LONGEST_SHOWN]
    return f"{name}: {count} values with spaces between them are needed, got {came!r}{_such_as(error)}"


def _unknown_option(error: UnknownOptionError) -> str:
    word = error.token.keyword or error.token.value
    options = [name for argument in error.argument_collection for name in argument.names if name.startswith("--")]
    if re.match(r"-[A-Za-z]{2}", word):
        near = _near("-" + word.split("=", 1)[0], options)
        hint = f"; did you mean {near}?" if near else ""
        return f"there is no option {word[:_LONGEST_SHOWN]}: options of more than a letter begin with two hyphens{hint}"
    return _with_help(error)


def _unknown_command(word: str, app: App) -> str:
    commands = [name for name in app if not name.startswith("-") and app[name].show]
    if word.startswith("-"):
        near = _near(word, ("--help", "--version", "--install-completion"))
        return f"there is no option {word[:_LONGEST_SHOWN]!r} before a command" + (
            f"; did you mean {near}?" if near else ""
        )
    listed = ", ".join(commands)
    if word.lower() in _QUESTIONS:
        return (
            f"there is no command {word!r}; see `shapephase {_QUESTIONS[word.lower()]}`, or "
            f"`shapephase COMMAND --help` of one of {listed}"
        )
    near = _near(word.lower(), commands)
    hint = f" Did you mean {near!r}?" if near else ""
    return (
        f"there is no command {word[:_LONGEST_SHOWN]!r}.{hint} The command comes first, as in "
        f"`shapephase split cat cat_righting`; there are {listed}"
    )


def _near(word: str, known: Iterable[str]) -> str | None:
    return next(iter(difflib.get_close_matches(word, list(known), n=1)), None)


def _form(error: CycloptsError, command: str) -> str:
    """How a command is written, such as `shapephase split BODY MOTION [OPTIONS]`."""
    found = inspect.signature(error.target).parameters.values() if error.target else ()
    words = [
        one.name.upper() if one.default is one.empty else f"[{one.name.upper()}]"
        for one in found
        if one.kind is one.POSITIONAL_ONLY
    ]
    return " ".join(["shapephase", command, *words, "[OPTIONS]"])


def _name(error: CycloptsError) -> str:
    token = error.token if isinstance(error, CoercionError) else None
    if token is not None and token.keyword:
        return token.keyword
    return error.argument.name if error.argument is not None else "an argument"


def _such_as(error: CycloptsError) -> str:
    """The example of its help."""
    if error.argument is None:
        return ""
    said = f"{error.argument.parameter.help or ''} {getattr(error.target, '__doc__', '') or ''}"
    found = re.search(rf"example\s+`({re.escape(error.argument.name)} [^`]*)`", said)
    return f"; for example `{' '.join(found[1].split())}`" if found else ""
