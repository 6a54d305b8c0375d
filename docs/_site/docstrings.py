"""What this library's docstrings and signatures mean, said in reStructuredText."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from itertools import cycle
from typing import Any

_LITERAL = re.compile(r"(``.+?``|`[^`]+`)", re.DOTALL)
_EXAMPLE = re.compile(r"^ *>>> .*(?:\n(?! *$).*)*", re.MULTILINE)
_DOT_PRODUCT = re.compile(r"(?<=\S) \. (?=\S)")
_DENSE_PRODUCT = re.compile(r"((?<![\w./])(?:Pi|Omega|omega|Gamma|L_o|mu|F_[qp]|K|[unwp])|\))\.(?=\(|[A-Z]|[a-z]+'?\b)")
_ENTRY = re.compile(r"([\w*, ]+) : (.*)")
# What Sphinx shows in place of names: the members of NumPy's union, its arrays, and defaults that dataclasses make.
_PREFIX = r"~?(?:[a-z_]\w*\.)*"
_SPELT_OUT = (
    (rf"{_PREFIX}_Buffer \| .*?\| {_PREFIX}_NestedSequence\[complex \| bytes \| str\]", "ArrayLike"),
    (rf"{_PREFIX}ndarray\[tuple\[{_PREFIX}Any, \.\.\.\], {_PREFIX}dtype\[{_PREFIX}float64\]\]", "Array"),
    (rf"{_PREFIX}ndarray\[tuple\[{_PREFIX}Any, \.\.\.\], {_PREFIX}dtype\[{_PREFIX}int64\]\]", "Integers"),
    ("<factory>", "..."),
)
_CONSTANT = re.compile(r"(?<== )_?[A-Z][A-Z0-9_]{2,}\b")
_TYPE_ALONE = re.compile(r"[\w.]+\n    ")
_WITH_ENTRIES = ("Parameters", "Attributes", "Other Parameters")


def formulas_are_text(text: str) -> str:
    """`|Pi|` is a norm, `a . b` a product that ends no sentence, and the two signs of an arrow stay together."""
    return outside_examples(text, lambda prose: "".join(map(_formula, _LITERAL.split(prose), cycle((True, False)))))


def _formula(part: str, prose: bool) -> str:
    for written, shown in (("|", "\\|"), ("...", "…"), ("->", "→")) if prose else ():
        part = part.replace(written, shown)
    return _DENSE_PRODUCT.sub(r"\1 · ", _DOT_PRODUCT.sub(" · ", part)) if prose else part


def outside_examples(text: str, change: Callable[[str], str]) -> str:
    """The text with its parts between examples changed."""
    parts, end = [], 0
    for example in _EXAMPLE.finditer(text):
        parts += [change(text[end : example.start()]), example[0]]
        end = example.end()
    return "".join([*parts, change(text[end:])])


def entries_are_descriptions(text: str) -> str:
    """`motion : of an articulated body` describes the parameter: its type stands in the signature."""
    section, kept, lines = "", [], text.split("\n")
    for line, below in zip(lines, [*lines[1:], ""]):
        if line and below and set(below) == {"-"}:
            section = line
        entry = _ENTRY.match(line)
        kept += [entry[1], f"    {entry[2]}"] if section in _WITH_ENTRIES and entry else [line]
    return "\n".join(kept)


def types_by_name(signature: str) -> str:
    """A signature, or the type that it returns, with the names of types that were spelt out."""
    for spelt_out, name in _SPELT_OUT:
        signature = re.sub(spelt_out, name, signature)
    return signature


def returned_values_are_descriptions(text: str, returned: str) -> str:
    """`edges : (..., 3) [m]`, or a description alone, which belongs to the type that is returned."""
    head, rule, section = text.partition("\nReturns\n-------\n")
    values, gap, rest = section.partition("\n\n")
    if not rule or _TYPE_ALONE.match(values):
        return text
    entries = values.split("\n")
    if any(map(_ENTRY.match, entries)):
        lines = [f"{entry[1]}\n    {entry[2]}" if (entry := _ENTRY.match(line)) else line for line in entries]
    else:
        lines = [returned, *(f"    {line.strip()}" for line in entries)] if returned else entries
    return "\n".join([head + rule.rstrip("\n"), *lines]) + gap + rest


def returned_type(found: Any) -> str:
    """The annotation of what a function returns, or nothing."""
    annotation = getattr(found, "__annotations__", {}).get("return", "")
    return annotation if isinstance(annotation, str) else ""


def public_parameters(signature: str) -> str:
    """A signature without the parameters that begin with an underscore: the library alone gives them."""
    parts, depth = [""], 0
    for letter in signature[1:-1]:
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and not depth:
            parts.append("")
        else:
            parts[-1] += letter
    return f"({','.join(part for part in parts if not part.lstrip().startswith('_')).lstrip()})"


def defaults_by_value(signature: str, found: Any) -> str:
    """A signature with numbers in place of the constants of the function's module; private objects are left out."""
    constants = getattr(inspect.unwrap(found), "__globals__", {})

    def value(name: re.Match[str]) -> str:
        if isinstance(constants.get(name[0]), int | float | tuple):
            return repr(constants[name[0]])
        return "..." if name[0].startswith("_") else name[0]

    return _CONSTANT.sub(value, signature)


def own_names(found: Any) -> set[str]:
    """Parameters of a function, or members of a class and parameters of its constructor."""
    classes = inspect.getmro(found) if inspect.isclass(found) else ()
    members = [name for found in classes for name in (*vars(found), *vars(found).get("__annotations__", ()))]
    names = {name for name in members if not name.startswith("_")}
    try:
        return names | {*inspect.signature(found).parameters}
    except (TypeError, ValueError):
        return names
