"""All that the values of a study depend on: versions, numbers of bodies, samples of motions, code of functions."""

from __future__ import annotations

import contextlib
import dis
import hashlib
import importlib
import inspect
import io
import os
import pickle
import platform
import sys
import sysconfig
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache, partial
from pathlib import Path
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from ..body.body import Body
from ..errors import StudyError
from ..integrator.machine_code import is_used
from ..letters import value_text
from ..provenance import provenance
from ..shape_space.shape_path import ShapePath

_SAMPLES = 33  # times at which a path that a function makes is compared
_LIBRARY_FOLDERS = tuple(sysconfig.get_paths()[name] for name in ("stdlib", "platstdlib", "purelib", "platlib"))


@lru_cache(maxsize=1)
def processor_text() -> str:
    """Return processor and host, for example "x86_64, AMD EPYC 9B14, machine code, node7"."""
    name = platform.processor()
    with contextlib.suppress(OSError, StopIteration):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        name = next(line.partition(":")[2].strip() for line in lines if line.lower().startswith("model name"))
    code = "machine code" if is_used() else "interpreted"
    return ", ".join(text for text in (platform.machine(), name, code, platform.node()) if text)


def computing_versions() -> dict[str, Any]:
    """Return the versions on which the bits of results depend, and whether machine code is used."""
    # Interpreted motions sample with Pinocchio, which rounds differently.
    return {**provenance()["versions"], "machine code": is_used()}


def version_differences(begun: Mapping[str, Any], here: Mapping[str, Any]) -> str:
    """Return what differs, for example "numpy 2.4.6 in the study and 2.4.5 here"; empty where nothing does."""
    pairs = {name: (begun.get(name), version) for name, version in here.items()}
    return ", ".join(f"{name} {old} in the study and {new} here" for name, (old, new) in pairs.items() if old != new)


def body_digest(body: Body) -> str:
    """Return SHA-256 of the numbers of links and joints, whatever files they came from."""
    chain = {field.name: getattr(body.chain, field.name) for field in fields(body.chain)}
    return _Inputs("body").digest((chain, body.moving_parts, dict(body.couplings), body.joint_names), "it")


def path_digest(path: ShapePath) -> str:
    """Return SHA-256 of duration, breaks and samples, in single precision: other processors differ less than that."""
    samples = path.shape(np.linspace(0.0, path.duration, _SAMPLES))
    numbers = np.concatenate([[path.duration], path.breaks, np.ravel(samples)]).astype(np.float32)
    return hashlib.sha256(numbers.tobytes()).hexdigest()


def file_digest(path: str | os.PathLike[str]) -> str:
    """Return SHA-256 of a file."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def function_digests(name: str, function: Callable[..., Any]) -> dict[str, str]:
    """Return SHA-256 of a function and of all that it refers to, by name.

    These are its code, defaults, closure, arguments of `functools.partial`, the globals that it names and the files of
    the user's modules that it comes from or calls; packages that are installed are known by their versions.

    Raises StudyError for an object without comparable content, such as an open file.
    """
    inputs = _Inputs(name)
    return {name: inputs.digest(function, "it"), **inputs.digests}


class _Inputs:
    """Collects SHA-256 of the parts of a function, by name."""

    def __init__(self, name: str) -> None:
        self._name = name
        self.digests: dict[str, str] = {}
        self.labels: dict[int, str] = {}
        # Ids stay those of these objects as long as they live.
        self._labelled: list[Any] = []

    def digest(self, value: Any, part: str) -> str:
        """Return SHA-256 of a value; `part` is what holds it, for messages."""
        content = io.BytesIO()
        pickler = _Pickler(content, self)
        try:
            pickler.dump(value)
        except StudyError:
            raise
        except Exception:
            raise StudyError(
                f"{self._name}: {part} holds {value_text(pickler.last)}, whose content cannot be compared when the "
                'study is resumed; make it from numbers and texts inside the function, or give version="1", a text '
                'that you change with your functions (version = "1" in a study file)'
            ) from None
        return hashlib.sha256(content.getvalue()).hexdigest()

    def put(self, part: str, value: Any) -> None:
        """Add a part."""
        name, digest = f"{self._name}, {part}", self.digest(value, part)
        if self.digests.get(name, digest) != digest:
            # Two objects of one name, such as two partials of a function.
            digest = self.digest((self.digests[name], digest), part)
        self.digests[name] = digest

    def function(self, function: FunctionType) -> str:
        """Add the parts of a function of the user, and return its label."""
        label = self._label(function)
        code = function.__code__
        for parameter in inspect.signature(function, follow_wrapped=False).parameters.values():
            if parameter.default is not parameter.empty:
                self.put(f"default {parameter.name} of {label}", parameter.default)
        for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
            # A cell is empty until its name is bound.
            self.put(f"closure {name} of {label}", cell.cell_contents if cell != CellType() else None)
        self.module(function.__module__)
        used, imports = _names_of(code)
        modules = []
        for name in used:
            if name in function.__globals__ and name != function.__name__:
                self._global(name, function.__globals__[name], function.__module__)
                modules.append(function.__globals__[name])
        for name, level in imports:
            # Whether it can be imported is the cases' affair.
            with contextlib.suppress(Exception):
                modules.append(importlib.import_module("." * level + name, function.__globals__.get("__package__")))
        for module in modules:
            if isinstance(module, ModuleType) and not _is_library(module.__name__):
                self.module(module.__name__)
                for name in used:
                    if name in vars(module):
                        # Its value may have been set since the import.
                        self._global(name, vars(module)[name], module.__name__)
        self.put(f"code of {label}", code)
        return label

    def kind(self, kind: type) -> str:
        """Add the parts of a class of the user, and return its label."""
        label = self._label(kind)
        for base in kind.__bases__:
            self.put(f"base {_label(base)} of {label}", base)
        self.module(kind.__module__)
        for name, value in vars(kind).items():
            inner = getattr(value, "__func__", getattr(value, "fget", getattr(value, "func", value)))
            if isinstance(inner, FunctionType) or not name.startswith(("__", "_abc_")):
                self.put(f"{name} of {label}", inner)
        return label

    def module(self, name: str) -> None:
        """Add the text of a module of the user, and of those that it has imported; of a script only what is named."""
        module = sys.modules.get(name)
        file = getattr(module, "__file__", None)
        part = f"{self._name}, module {name}"
        if part in self.digests or name == "__main__" or file is None or _is_library(name) or not os.path.isfile(file):
            return
        self.digests[part] = file_digest(file)
        text = Path(file).read_bytes()
        for own, value in list(vars(module).items()):
            # Others are parts of a package that somebody else has imported.
            if own.encode() in text:
                self.module(
                    value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None) or ""
                )

    def _label(self, value: Any) -> str:
        label = _label(value)
        while label in self.labels.values():
            label += "'"
        self.labels[id(value)] = label
        self._labelled.append(value)
        return label

    def _global(self, name: str, value: Any, module: str) -> None:
        """Add a global of a module; what fills up while functions run, such as a cache, counts as the module's text."""
        if module == "__main__" or not isinstance(value, dict | list | set):
            self.put(f"{name} of {module}", value)


class _Pickler(pickle.Pickler):
    """Writes equal bytes for equal contents; functions, classes and modules are known by their parts."""

    def __init__(self, content: io.BytesIO, inputs: _Inputs) -> None:
        super().__init__(content, protocol=4)
        # Without a memo: which equal texts are one object differs from process to process.
        self.fast = True
        self._inputs = inputs
        self.last: Any = None

    def persistent_id(self, value: Any) -> Any:
        """Return what stands for an object in the bytes; None for others than those above."""
        self.last = value
        if isinstance(value, FunctionType | type):
            if id(value) in self._inputs.labels:
                return self._inputs.labels[id(value)]
            if _is_library(value.__module__):
                return (_label(value), _version(value.__module__))
            return self._inputs.kind(value) if isinstance(value, type) else self._inputs.function(value)
        if isinstance(value, ModuleType):
            self._inputs.module(value.__name__)
            return (value.__name__, _version(value.__name__) if _is_library(value.__name__) else "")
        if isinstance(value, CodeType):
            counts = (value.co_argcount, value.co_posonlyargcount, value.co_kwonlyargcount, value.co_flags)
            names = (value.co_names, value.co_varnames, value.co_freevars, value.co_cellvars)
            return (value.co_code, value.co_consts, names, counts, value.co_exceptiontable)
        if isinstance(value, partial):
            for name, argument in (*enumerate(value.args), *value.keywords.items()):
                self._inputs.put(f"argument {name} of partial {_label(value.func)}", argument)
            return ("partial", value.func, len(value.args), sorted(value.keywords))
        if isinstance(value, set | frozenset):
            return ("set", sorted(self._inputs.digest(entry, "a set") for entry in value))
        inner = getattr(value, "py_func", None) or getattr(value, "__wrapped__", None)
        if isinstance(inner, FunctionType):
            # Compiled or cached: it computes what the function inside does.
            return (type(value).__qualname__, inner)
        if is_dataclass(value) and _is_library(type(value).__module__):
            # Values that were computed on the way are kept beside the fields.
            return (
                _label(type(value)),
                [(field.name, getattr(value, field.name)) for field in fields(value) if field.init],
            )
        return None


def _names_of(code: CodeType) -> tuple[list[str], list[tuple[str, int]]]:
    """Return globals and attributes that code reads, inner functions included; and modules that it imports."""
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
    """Return True for modules of Python, installed packages and this one, which are known by their versions."""
    top = (name or "").partition(".")[0]
    if top == __name__.partition(".")[0] or top in sys.builtin_module_names:
        return True
    file = getattr(sys.modules.get(name or ""), "__file__", None)
    if file is None:
        return top in sys.stdlib_module_names
    installed = {"site-packages", "dist-packages"} & {*Path(file).parts}
    return bool(installed) or file.startswith(_LIBRARY_FOLDERS)


def _version(name: str) -> str:
    return str(getattr(sys.modules.get(name.partition(".")[0]), "__version__", ""))
