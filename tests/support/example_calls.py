"""Calls that the examples of the documentation make, with what they give for each argument; and the same with another.

An example has right arguments for a function, whatever it needs; each of them is then exchanged for something wrong.
"""

from __future__ import annotations

import contextlib
import dataclasses
import doctest
import inspect
import io
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from types import CodeType, FrameType, FunctionType
from typing import Any

import numpy as np

import shapephase as sp
from shapephase.errors import ShapePhaseError
from shapephase.examples.scenarios import kane_scher

SOURCE = str(Path(sp.__file__).parent)
# Where what wraps a function keeps it.
WRAPPED = ("__wrapped__", "__func__", "fget", "func")
# Functions of arrays that check nothing, since the library itself calls them within its loops; and the integrator,
# which gets what was checked.
TRUSTING = ("so3", "sphere", "elliptic", "inertia_tensor", "chebyshev", "roots", "refinement", "errors",
            "integrator")  # fmt: skip
# The same of single arguments.
TRUSTED = ("Array", "Integers", "Mask", "Evaluate")


@dataclasses.dataclass(frozen=True, kw_only=True)
class ExampleCall:
    """What an example calls.

    Attributes
    ----------
    place : module and name
    function : as it is called, of a class the class itself
    arguments : by their names, `self` among them
    annotations : of the arguments
    positional : names of those that cannot be given by name
    """

    place: str
    function: Callable[..., Any]
    arguments: Mapping[str, Any]
    annotations: Mapping[str, str]
    positional: tuple[str, ...]

    def with_another(self, name: str, value: object) -> Any:
        """What comes of it with another value for one argument."""
        given = {**self.arguments, name: value}
        first = [given.pop(one) for one in ("self", *self.positional) if one in given]
        with contextlib.redirect_stdout(io.StringIO()):
            return self.function(*first, **given)


@lru_cache(maxsize=1)
def wrong_things() -> dict[str, Any]:
    """Objects of ours of many kinds, and what else is given for one by mistake, by the names of their kinds."""
    body, path = sp.load_body("cat_two_halves"), kane_scher(0.3, 1.0)
    deformation = sp.articulated(body, path)
    motion = sp.reconstruct(deformation, [0.01, 0.02, 0.03])
    top, goal = sp.EulerTop.principal((1.0, 2.0, 3.0), (0.7, 0.2, 1.5)), sp.optimal_control.Goal(rotation=np.eye(3))
    ours = (body, path, deformation, motion, sp.split(motion), top, goal, sp.horizontal_lift(body, path),
            sp.body_summary(body))  # fmt: skip
    others = ("cat", None, np.eye(3), sp.Body, len, 1.5)
    return {type(thing).__name__: thing for thing in (*ours, *others)}


def example_calls(name: str, thing: Any) -> Iterator[ExampleCall]:
    """The calls of functions of ours that the example in a docstring makes itself, each function once."""
    steps = doctest.DocTestParser().get_examples(inspect.getdoc(thing) or "")
    seen: dict[CodeType, tuple[dict[str, Any], dict[str, Any]]] = {}

    def look(frame: FrameType, event: str, _: object) -> None:
        code, caller = frame.f_code, frame.f_back
        ours = code.co_filename.startswith(SOURCE) or code.co_name == "__init__"
        if event == "call" and ours and caller is not None and caller.f_code.co_filename.startswith("<doctest"):
            names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
            seen.setdefault(code, (frame.f_globals, {one: frame.f_locals[one] for one in names}))

    test = doctest.DocTest(steps, {"np": np, "sp": sp}, name, None, None, None)
    before = sys.getprofile()
    sys.setprofile(look)
    try:
        doctest.DocTestRunner(verbose=False).run(test, out=lambda _: None, clear_globs=False)
    finally:
        sys.setprofile(before)
    for code, (names, arguments) in seen.items():
        found = _function(code, names, arguments)
        if found is None or code.co_name in ("<lambda>", "__exit__", "__enter__"):
            continue
        function: Callable[..., Any] = found
        module = function.__module__
        if not module.startswith("shapephase."):
            continue
        signature = inspect.signature(function).parameters
        positional = tuple(p.name for p in signature.values() if p.kind is p.POSITIONAL_ONLY)
        place = f"{module.removeprefix('shapephase.')}.{code.co_qualname}"
        if code.co_name == "__init__":
            kind = type(arguments.pop("self"))
            function, place = kind, f"{kind.__module__.removeprefix('shapephase.')}.{kind.__qualname__}"
        annotations = {p.name: str(p.annotation) for p in signature.values() if p.name in arguments}
        yield ExampleCall(
            place=place,
            function=function,
            arguments=arguments,
            annotations={one: said for one, said in annotations.items() if one not in ("self", "cls")},
            positional=tuple(one for one in positional if one not in ("self", "cls")),
        )


def _function(code: CodeType, names: Mapping[str, Any], arguments: Mapping[str, Any]) -> FunctionType | None:
    """The function of a code, by its name in its module, in whatever it is wrapped; None for one within another."""
    if code.co_name == "__init__":
        return type(arguments["self"]).__init__
    found: Any = names
    for part in code.co_qualname.split("."):
        found = (found if isinstance(found, Mapping) else vars(found)).get(part)
        if found is None:
            return None
    while getattr(found, "__code__", None) is not code:
        found = next((getattr(found, name) for name in WRAPPED if hasattr(found, name)), None)
        if found is None:
            return None
    return found


def works(call: ExampleCall) -> bool:
    """Whether a call does what the example does; some show an error."""
    try:
        name = next(iter(call.annotations), "")
        call.with_another(name, call.arguments[name]) if name else None
    except ShapePhaseError:
        return False
    return True


def trusts(call: ExampleCall, argument: str) -> bool:
    """Whether an argument is one that is not looked at."""
    return call.place.startswith(TRUSTING) or call.annotations[argument].split(" | ")[0] in TRUSTED


def fault_of(call: ExampleCall, argument: str, value: object) -> str:
    """What is wrong with what a function says of a wrong argument; "" where it says a sentence, or takes it."""
    try:
        call.with_another(argument, value)
    except ShapePhaseError as error:
        said, kind = str(error), type(value).__name__
        if "\n" in said or len(said) > 700:
            return f"a long message: {said[:300]!r}"
        # Where nothing is the right value, a sentence says why nothing may be given.
        ours = type(value).__module__.startswith("shapephase") and call.arguments[argument] is not None
        return f"does not name what came: {said[:300]}" if ours and kind not in said else ""
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""
