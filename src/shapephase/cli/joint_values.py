"""Joints and values on the command line, `hip=30deg knee=0.1`: one parser for every option that takes them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..errors import ShapeError, TrajectoryError

if TYPE_CHECKING:
    from ..body.body import Body

_PER_SECOND = ("", "/s", "/s^2", "/s^3")
_MAX_SHOWN = 60  # characters of a word that an error repeats


def joint_values(body: Body, words: Sequence[str], option: str, *, order: int = 0) -> dict[str, float]:
    """Return the joints named in words and their values [rad or m, per second to the power of `order`].

    Raises
    ------
    UnknownNameError
        For a joint that the body does not have.
    ShapeError
        For a word that is not JOINT=VALUE, a joint given twice, or a unit that does not fit the joint.
    """
    values: dict[str, float] = {}
    for pair in (pair for word in words for pair in word.split(",")):
        name, equals, value = (text.strip() for text in pair.rpartition("="))
        if not (name and equals and value):
            example = f"{body.joint_names[0]}=0.1{_PER_SECOND[order]}" if body.joint_names else "JOINT=0.1"
            raise ShapeError(
                f"{option}: JOINT=VALUE is needed, as in {option} {example}, got {pair.strip()!r:.{_MAX_SHOWN}}"
            )
        if name in values:
            raise ShapeError(f"{option}: joint {name!r:.{_MAX_SHOWN}} stands twice")
        unit = body.joint_units[body.joint_index(name)]
        values[name] = value_in_si(value, unit, f"{option}: {name}", order)
    return values


def value_in_si(text: str, unit: str, what: str, order: int = 0) -> float:
    """Return a value such as `30deg`, or of order 1 `200deg/s`, for a joint in rad or m.

    Raises ShapeError, which begins with `what`.
    """
    from ..shape_space.files.labels import quantity

    per_second = _PER_SECOND[order]
    amount = text.removesuffix(per_second).strip()
    if per_second and amount == text and re.search(r"[a-df-z°]", text, re.IGNORECASE):
        raise ShapeError(
            f"{what}: a value per second is needed, as 2 or 100deg{per_second}, got {text!r:.{_MAX_SHOWN}}"
        )
    try:
        return quantity(amount, unit, what)
    except TrajectoryError as error:
        raise ShapeError(str(error)) from None
