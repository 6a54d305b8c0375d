"""Display of results: a few lines of text, and cards of HTML with a small picture.

A card has a title and rows of a name and a value with its unit; `repr` prints it as text and notebooks show it as HTML.
Results without a card of their own print their fields by `short_repr`. Neither is ever longer than nine lines.
"""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, Protocol, TypeVar, dataclass_transform, overload

import numpy as np

from .arrays import Array, lock_arrays
from .letters import printable, shortened

MOST_LINES = 9  # of a `repr`
_WIDTH = 100  # characters of a line
_LONGEST_VALUE = 60  # characters of a value, a name, a title
_FEW = 4  # entries of an array or a tuple that are shown one by one
_STYLE = (
    "display:inline-flex;flex-wrap:wrap;gap:1em;align-items:center;font-size:90%;border:1px solid #8886;"
    "border-radius:6px;padding:0.5em 0.8em"
)


@dataclass(frozen=True)
class Card:
    """Summary of an object.

    title : what it is, with its name
    rows : names and values with their units
    picture : SVG, or nothing
    """

    title: str
    rows: Sequence[tuple[str, str]]
    picture: str = ""

    def text(self) -> str:
        """Return title and rows as lines."""
        shown = [(name, shortened(printable(value), _LONGEST_VALUE)) for name, value in self.rows[: MOST_LINES - 1]]
        width = max((len(name) for name, _ in shown), default=0)
        return "\n".join([_title(self.title), *(f"  {name:<{width}}  {value}" for name, value in shown)])

    def html(self) -> str:
        """Return title, rows and picture as HTML; names are escaped."""
        left = 'style="text-align:left"'
        cells = "".join(
            f"<tr><th {left}>{_escaped(name)}</th><td {left}>{_escaped(value)}</td></tr>" for name, value in self.rows
        )
        table = f'<table style="border-collapse:collapse">{cells}</table>'
        words = f"<div><strong>{html.escape(_title(self.title))}</strong>{table}</div>"
        return f'<div class="shapephase-card" style="{_STYLE}">{words}{self.picture}</div>'


class HasCard(Protocol):
    """An object with a card."""

    def _card(self) -> Card: ...


def card_text(self: HasCard) -> str:
    """Return the `repr` of an object with a card."""
    return self._card().text()


def card_html(self: HasCard) -> str:
    """Return the HTML of an object with a card, for notebooks."""
    return self._card().html()


def short_repr(self: Any) -> str:
    """Return the fields of a dataclass in a few lines: arrays by shape, other objects by class."""
    parts = [f"{field.name}={_value(getattr(self, field.name))}" for field in fields(self) if field.repr]
    name = type(self).__name__
    whole = f"{name}({', '.join(parts)})"
    if len(whole) <= _WIDTH:
        return whole
    lines = [f"{name}("]
    for part in parts:
        if len(lines) > 1 and len(lines[-1]) + len(part) + 2 <= _WIDTH:
            lines[-1] += f" {part},"
        else:
            lines.append(f"    {part},")
    if len(lines) >= MOST_LINES:
        lines = [*lines[: MOST_LINES - 2], "    …"]
    return "\n".join([*lines, ")"])


_Kind = TypeVar("_Kind")


@overload
def frozen(kind: type[_Kind]) -> type[_Kind]: ...


@overload
def frozen(*, kw_only: bool) -> Callable[[type[_Kind]], type[_Kind]]: ...


@dataclass_transform(eq_default=False, frozen_default=True, field_specifiers=(field,))
def frozen(kind: Any = None, *, kw_only: bool = False) -> Any:
    """Decorate a class whose objects nobody changes: a frozen dataclass, each equal to itself alone.

    Objects show their arrays as read-only views and print by `short_repr`, unless the class has methods of its own.
    """

    def made(kind: Any) -> Any:
        for name, method in (("__repr__", short_repr), ("__post_init__", lock_arrays)):
            if name not in vars(kind):
                setattr(kind, name, method)
        return dataclass(frozen=True, eq=False, repr=False, kw_only=kw_only)(kind)

    return made if kind is None else made(kind)


def numbers(values: Any, unit: str = "") -> str:
    """Return a few numbers in brackets, a single one without, with their unit."""
    entries = np.atleast_1d(values)
    shown = " ".join(f"{value + 0.0:.6g}" for value in entries.ravel())
    return f"{shown if np.ndim(values) == 0 else f'({shown})'}{f' {unit}' if unit else ''}"


def angle_text(angle: Any) -> str:
    """Return an angle in degrees and radians; for a batch the range in degrees."""
    if np.ndim(angle):
        spread = np.degrees([np.min(angle), np.max(angle)]) if np.size(angle) else np.zeros(2)
        return f"{spread[0]:.4f} to {spread[1]:.4f} deg"
    return f"{np.degrees(angle) + 0.0:.6f} deg ({float(angle) + 0.0:.6f} rad)"


def error_text(error: Any) -> str:
    """Return an error estimate; for a batch the largest."""
    most = float(np.max(error)) if np.size(error) else 0.0
    return f"{most:.1e} rad{' at most' if np.ndim(error) else ''}"


def number_with_bar(value: float, bar: float) -> str:
    """Return a number and its error bar with two digits; both end at the same digit.

    Examples
    --------
    >>> sp.display.number_with_bar(12.3456, 0.123)
    '12.35 ± 0.12'
    """
    if not bar > 0.0:
        return f"{value:.4g} ± 0"
    if not 1e-4 <= bar < 1e6:
        return f"{value:.4g} ± {bar:.2g}"
    digits = max(1 - math.floor(math.log10(bar)), 0)
    return f"{value:.{digits}f} ± {bar:.{digits}f}"


def momentum_text(momentum: Array) -> str:
    """Return an angular momentum; for a batch the number and the range of magnitudes."""
    if momentum.ndim == 1:
        return numbers(momentum, "kg m^2/s")
    sizes = np.linalg.norm(momentum, axis=-1)
    spread = f", {sizes.min():.4g} to {sizes.max():.4g} kg m^2/s" if sizes.size else ""
    return f"a batch {momentum.shape[:-1]}{spread}"


def _title(title: str) -> str:
    return shortened(printable(title), _WIDTH)


def _escaped(text: str) -> str:
    return html.escape(printable(text))


def _value(value: Any) -> str:
    """Text of an entry of a `short_repr`."""
    if isinstance(value, np.ndarray) and value.ndim:
        if value.ndim == 1 and value.size <= _FEW and value.dtype.kind in "fiub":
            return f"[{', '.join(_number(entry) for entry in value)}]"
        return f"array{value.shape}"
    if isinstance(value, np.ndarray | np.generic):
        return _number(np.asarray(value).item())
    if isinstance(value, bool | int | float):
        return _number(value)
    if value is None:
        return "None"
    if isinstance(value, str):
        return repr(shortened(value, _LONGEST_VALUE))
    if isinstance(value, Mapping):
        return f"{{{len(value)} entries}}" if value else "{}"
    if isinstance(value, tuple | list):
        if len(value) <= _FEW and all(isinstance(entry, str | bool | int | float | np.generic) for entry in value):
            shown = ", ".join(map(_value, value))
            if len(shown) <= _LONGEST_VALUE:
                return f"({shown})"
        return f"({len(value)} entries)"
    if is_dataclass(value) or not callable(value):
        return f"{type(value).__name__}(…)"
    return getattr(value, "__name__", type(value).__name__)


def _number(value: Any) -> str:
    if isinstance(value, bool | np.bool_ | int | np.integer):
        return str(value)[:_LONGEST_VALUE]
    return f"{value:.6g}" if isinstance(value, float | np.floating) else str(value)[:_LONGEST_VALUE]
