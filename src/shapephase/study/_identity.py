"""What the values of a study depend on, by SHA-256: numbers of bodies, samples of motions, code of functions."""

from __future__ import annotations

import copyreg
import dis
import hashlib
import importlib
import os
import sys
import sysconfig
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from types import BuiltinFunctionType, CellType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from ..body.body import Body
from ..errors import StudyError
from ..letters import what_came
from ..shape_space.shape_path import ShapePath

_SAMPLES = 33
"""Times at which a path that a function makes is compared."""
_LIBRARY_FOLDERS = tuple(sysconfig.get_paths()[name] for name in ("stdlib", "platstdlib", "purelib", "platlib"))
_LITERAL = str | bytes | bool | int | float | complex | type(None) | type(Ellipsis)


def body_digest(body: Body) -> str:
    """SHA-256 of the numbers of links and joints, whatever files they came from."""
    chain = {one.name: getattr(body.chain, one.name) for one in fields(body.chain)}
    return _Contents("body").digest((chain, body.moving_parts, dict(body.couplings), body.joint_names))


def path_digest(path: ShapePath) -> str:
    """SHA-256 of a path's duration, breaks and samples, rounded to single precision: other processors differ less."""
    samples = path.shape(np.linspace(0.0, path.duration, _SAMPLES))
    numbers = np.concatenate([[path.duration], path.breaks, np.ravel(samples)]).astype(np.float32)
    return hashlib.sha256(numbers.tobytes()).hexdigest()


def file_digest(path: str | os.PathLike[str]) -> str:
    """SHA-256 of a file."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def function_digests(name: str, function: Callable[..., Any]) -> dict[str, str]:
    """SHA-256 of a function and of all that it refers to.

    These are its code, defaults, closure, arguments of `functools.partial`, the globals that it names and the files of
    the user's modules that it comes from or calls; packages that are installed are known by their versions.

    Raises
    ------
    StudyError
        For an object without comparable content, such as an open file.
    """
    contents = _Contents(name)
    whole = contents.digest(function)
    return {name: whole, **contents.parts}


class _Contents:
    """Collects the parts of one input of a study by name."""

    def __init__(self, name: str) -> None:
        self._name = name
        self.parts: dict[str, str] = {}
        self._labels: dict[int, str] = {}
        # Also keeps the objects alive: their ids stay theirs.
        self._open: dict[int, Any] = {}

    def digest(self, value: Any, part: str = "it") -> str:
        """SHA-256 of a value."""
        return hashlib.sha256(repr(self._plain(value, part)).encode()).hexdigest()

    def _put(self, part: str, value: Any) -> None:
        name, digest = f"{self._name}, {part}", self.digest(value, part)
        if self.parts.get(name, digest) != digest:
            # Two objects of one name, such as two partials of a function.
            digest = self.digest((self.parts[name], digest))
        self.parts[name] = digest

    def _plain(self, value: Any, part: str) -> Any:
        """Literals in tuples, equal for equal contents. `part` is what holds the value, for messages."""
        if isinstance(value, _LITERAL) and type(value).__module__ == "builtins":
            return (type(value).__name__, repr(value))
        if id(value) in self._labels:
            return self._labels[id(value)]
        if id(value) in self._open:
            return ("again", list(self._open).index(id(value)))
        self._open[id(value)] = value
        try:
            return self._inside(value, part)
        finally:
            if id(value) not in self._labels:
                del self._open[id(value)]

    def _inside(self, value: Any, part: str) -> Any:
        if isinstance(value, FunctionType):
            return self._function(value)
        if isinstance(value, ModuleType):
            return self._module(value.__name__)
        if isinstance(value, type):
            return self._class(value)
        if isinstance(value, CodeType):
            return self._code(value, part)
        if isinstance(value, partial):
            inner = self._plain(value.func, part)
            for name, argument in (*enumerate(value.args), *value.keywords.items()):
                self._put(f"argument {name} of partial {_label(value.func)}", argument)
            return ("partial", inner, len(value.args), sorted(value.keywords))
        if type(value) is np.ndarray and not value.dtype.hasobject:
            return (value.dtype.str, value.shape, hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest())
        if isinstance(value, Mapping) and type(value).__module__ in ("builtins", "types"):
            return [(self._plain(key, part), self._plain(one, part)) for key, one in value.items()]
        if isinstance(value, tuple | list) and type(value).__module__ == "builtins":
            return (type(value).__name__, [self._plain(one, part) for one in value])
        if isinstance(value, set | frozenset):
            return ("set", sorted(repr(self._plain(one, part)) for one in value))
        if isinstance(value, MethodType):
            return (self._plain(value.__self__, part), self._plain(value.__func__, part))
        if isinstance(value, BuiltinFunctionType):
            owner = value.__self__
            return (value.__qualname__, None if owner is None else self._plain(owner, part))
        inner = getattr(value, "py_func", None) or getattr(value, "__wrapped__", None)
        if isinstance(inner, FunctionType):
            # Compiled or cached: what it computes is that of the function inside.
            return (type(value).__qualname__, self._plain(inner, part))
        if is_dataclass(value) and _is_library(type(value).__module__):
            # Values that were computed on the way are kept beside the fields.
            own = [(one.name, self._plain(getattr(value, one.name), part)) for one in fields(value) if one.init]
            return (self._plain(type(value), part), own)
        return self._reduced(value, part)

    def _reduced(self, value: Any, part: str) -> Any:
        """Any other object, by what a copy would be made of."""
        try:
            registered = copyreg.dispatch_table.get(type(value))
            reduced = registered(value) if registered else value.__reduce_ex__(4)
            if isinstance(reduced, str):
                return (type(value).__qualname__, reduced)
            items = [list(one) if isinstance(one, Iterator) else one for one in reduced]
        except Exception:
            raise StudyError(
                f"{self._name}: {part} holds {what_came(value)}, whose content cannot be compared when the study is "
                'resumed; make it from numbers and texts inside the function, or give version="1", a text that you '
                'change with your functions (version = "1" in a study file)'
            ) from None
        return [self._plain(one, part) for one in items]

    def _function(self, function: FunctionType) -> Any:
        label = _label(function)
        if _is_library(function.__module__):
            return (label, _version(function.__module__))
        while label in self._labels.values():
            label += "'"
        self._labels[id(function)] = label
        names = function.__code__.co_varnames[: function.__code__.co_argcount]
        defaults = function.__defaults__ or ()
        for name, value in (
            *zip(names[len(names) - len(defaults) :], defaults, strict=True),
            *(function.__kwdefaults__ or {}).items(),
        ):
            self._put(f"default {name} of {label}", value)
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
            # A cell is empty until its name is bound.
            content = cell.cell_contents if cell != CellType() else None
            self._put(f"closure {name} of {label}", content)
        self._module(function.__module__)
        used, imports = _names_of(function.__code__)
        for name in used:
            if name in function.__globals__ and name != function.__name__:
                value = function.__globals__[name]
                self._global(name, value, function.__module__)
                if isinstance(value, ModuleType) and not _is_library(value.__name__):
                    self._attributes(value, used)
        for name in imports:
            self._imported(name, function, used)
        self._put(f"code of {label}", function.__code__)
        return label

    def _imported(self, name: tuple[str, int], function: FunctionType, used: list[str]) -> None:
        """A module that is imported while the function runs."""
        package = function.__globals__.get("__package__")
        try:
            module = importlib.import_module("." * name[1] + name[0], package)
        except Exception:
            # Whether it can be imported is the cases' affair.
            return
        if not _is_library(module.__name__):
            self._module(module.__name__)
            self._attributes(module, used)

    def _attributes(self, module: ModuleType, used: list[str]) -> None:
        """What a function may read of a module of the user's, with values that were set since its import."""
        for name in used:
            if name in vars(module):
                self._global(name, vars(module)[name], module.__name__)

    def _global(self, name: str, value: Any, module: str) -> None:
        """A global of a module; what fills up while functions run, such as a cache, counts as the module's text."""
        if module == "__main__" or not isinstance(value, dict | list | set):
            self._put(f"{name} of {module}", value)

    def _class(self, kind: type) -> Any:
        label = _label(kind)
        if _is_library(kind.__module__):
            return (label, _version(kind.__module__))
        self._labels[id(kind)] = label
        for base in kind.__bases__:
            self._put(f"base {_label(base)} of {label}", base)
        self._module(kind.__module__)
        for name, value in vars(kind).items():
            inner = getattr(value, "__func__", getattr(value, "fget", getattr(value, "func", value)))
            if isinstance(inner, FunctionType) or not name.startswith(("__", "_abc_")):
                self._put(f"{name} of {label}", inner)
        return label

    def _module(self, name: str | None) -> Any:
        """The text of a module of the user's, and of those that it has imported; of a script only what is named."""
        module = sys.modules.get(name or "")
        if module is None or _is_library(module.__name__):
            return ("module", name, _version(name))
        part = f"{self._name}, module {module.__name__}"
        file = getattr(module, "__file__", None)
        if part not in self.parts and name != "__main__" and file is not None and os.path.isfile(file):
            self.parts[part] = file_digest(file)
            text = Path(file).read_bytes()
            for own, value in list(vars(module).items()):
                if own.encode() not in text:
                    # A part of a package that somebody else has imported.
                    continue
                self._module(value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None))
        return ("module", name)

    def _code(self, code: CodeType, part: str) -> Any:
        constants = [self._plain(one, part) for one in code.co_consts]
        names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
        counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags)
        return (code.co_code, constants, names, counts, code.co_exceptiontable)


def _names_of(code: CodeType) -> tuple[list[str], list[tuple[str, int]]]:
    """Names of globals and attributes that code reads, inner functions included; and the modules that it imports."""
    used, imports = list(code.co_names), []
    steps = list(dis.get_instructions(code))
    for number, step in enumerate(steps):
        if step.opname == "IMPORT_NAME":
            # Before it the level of a relative import is loaded, and the names that are taken.
            level = steps[number - 2].argval
            imports.append((str(step.argval), level if isinstance(level, int) else 0))
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            more, others = _names_of(constant)
            used, imports = used + more, imports + others
    return list(dict.fromkeys(used)), imports


def _label(value: Any) -> str:
    return f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', type(value).__qualname__)}"


def _is_library(name: str | None) -> bool:
    """Whether a module belongs to Python, to an installed package or to this one, which are known by their versions."""
    top = (name or "").partition(".")[0]
    if top in (__name__.partition(".")[0], "") or top in sys.builtin_module_names:
        return True
    file = getattr(sys.modules.get(name or ""), "__file__", None)
    if file is None:
        return top != "__main__" and top in sys.stdlib_module_names
    return (
        "site-packages" in Path(file).parts or "dist-packages" in Path(file).parts or file.startswith(_LIBRARY_FOLDERS)
    )


def _version(name: str | None) -> str:
    return str(getattr(sys.modules.get((name or "").partition(".")[0]), "__version__", ""))
