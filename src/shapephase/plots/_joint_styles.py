"""Joints in figures: names, styles, lines; a left joint and its right one have the same colour and marker."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..arrays import Array, Integers
from ..errors import unknown_name
from ..letters import printable
from .plot_style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SERIES, VERMILION

_COLOURS = (BLUE, ORANGE, BLACK, GREEN, VERMILION, PURPLE)  # neighbours differ in grey, too
_MARKERS = ("o", "s", "^", "D", "v", "P")
# Sides in names of joints: whole words, or letters set off by the end of the name or an underline.
_SIDES = {"left": "right", "right": "left", "l": "r", "r": "l"}
_SIDE = re.compile(
    r"(?<![A-Za-z])(left|right|l|r)(?![A-Za-z])|(?<![a-z])(left|right)(?=[A-Z])|(?<=[a-z])(left|right)\b", re.IGNORECASE
)
_PALE = 0.5  # share of white in the broad line of the left side
_MARKS = 6  # along a curve
MAX_NAMED = 6  # joints with a style and a name: more are not distinguishable
_MAX_BESIDE = 26  # letters of a name in a legend of two columns
_MAX_LETTERS = 32  # of a name in a figure: more would leave no room for the curves


def plain_text(name: str) -> str:
    """Return a name as Matplotlib draws it letter by letter: no formulas; long ones are shortened in the middle."""
    letters = printable(name)
    if len(letters) > _MAX_LETTERS:
        half = _MAX_LETTERS // 2
        letters = f"{letters[:half]}…{letters[-half:]}"
    # An underscore at the start would leave it out of legends; a hair space before it is not seen.
    return ("\u200a" if letters.startswith("_") else "") + letters.replace("$", r"\$")


def other_side(name: str) -> str | None:
    """The name of the same joint on the other side; None for a name without a side."""
    found = _SIDE.search(name)
    if found is None:
        return None
    word = found[0]
    other = _SIDES[word.lower()]
    other = other.upper() if word.isupper() else other.capitalize() if word[0].isupper() else other
    return name[: found.start()] + other + name[found.end() :]


def both_sides(names: Sequence[str]) -> bool:
    """True where a left joint and its right one are among the names."""
    return any(other_side(name) in names for name in names)


def joint_styles(names: Sequence[str]) -> list[dict[str, Any]]:
    """Line styles of at most six joints: `SERIES`, or for both sides of a joint one colour and marker."""
    if not both_sides(names):
        return list(SERIES[: len(names)])
    groups: dict[str, int] = {}
    looks = []
    for name in names:
        other = other_side(name)
        group = groups.setdefault(min(name, other) if other else name, len(groups))
        colour = _COLOURS[group]
        marks = {"marker": _MARKERS[group], "markersize": 3.2, "markevery": ((0.5 + group) / _MARKS**2, 1.0 / _MARKS)}
        if other is None:
            look = {"color": colour, "linestyle": (0, (6, 1.5, 1, 1.5)), "linewidth": 1.5, "zorder": 2.1}
        elif _is_left(name):
            look = {"color": _paler(colour), "linestyle": "-", "linewidth": 3.0, "zorder": 1.9}
        else:
            look = {"color": colour, "linestyle": (0, (4, 2)), "linewidth": 1.3, "zorder": 2.2}
        looks.append({**look, **marks, "markerfacecolor": colour, "markeredgecolor": colour})
    return looks


def joint_place(joint: str | int, names: Sequence[str]) -> int:
    """The index of a joint that is given by its name or its index. Raises UnknownNameError."""
    if isinstance(joint, str) and joint in names:
        return list(names).index(joint)
    if isinstance(joint, (int, np.integer)) and not isinstance(joint, bool) and 0 <= joint < len(names):
        return int(joint)
    raise unknown_name("joint", str(joint), names)


def named_joints(joints: Sequence[int], units: Sequence[str]) -> list[int]:
    """Those that a figure names: the first joint of each unit, and of the others the first, six in all."""
    leaders = {units[k]: k for k in reversed(joints)}.values()
    rest = [k for k in joints if k not in leaders]
    return sorted([*leaders, *rest][:MAX_NAMED], key=list(joints).index)


def plot_joints(
    places: dict[str, Any],
    times: Array,
    values: Array,
    joints: Integers,
    names: Sequence[str],
    units: Sequence[str],
    shown_units: dict[str, str],
) -> dict[str, Any]:
    """Draw columns of joints in time on the axes of their units: six by name, the others in grey.

    Those are the first six, or fewer of them where a unit has its first joint later.

    Returns handles, labels and ncols of a legend, where units are shown if there are several.
    """
    handles: list[Any] = []
    texts: list[str] = []
    rows: list[int] = joints.tolist()
    named = named_joints(rows, units)
    others = [k for k in rows if k not in named]
    for k, look in zip(named, joint_styles([names[k] for k in named]), strict=True):
        handles += places[units[k]].plot(times, values[:, k], **look)
        texts.append(plain_text(names[k]) + ("" if len(places) == 1 else f" [{shown_units[units[k]]}]"))
    ncols = 1 if max(map(len, texts), default=0) > _MAX_BESIDE else 2
    for k in others:
        line = places[units[k]].plot(times, values[:, k], color=GREY, linewidth=0.6, zorder=1.5)
        handles += line if len(handles) == MAX_NAMED else []
    texts += [f"{len(others)} other{'s' * (len(others) > 1)}"] if others else []
    return {"handles": handles, "labels": texts, "ncols": ncols}


def _is_left(name: str) -> bool:
    found = _SIDE.search(name)
    return found is not None and found[0].lower().startswith("l")


def _paler(colour: str) -> tuple[float, ...]:
    from matplotlib.colors import to_rgb

    return tuple(_PALE + (1.0 - _PALE) * channel for channel in to_rgb(colour))
