"""Error estimates of phases, and results of a batch of motions: deferred, and joined from its parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from functools import cached_property, partial
from typing import Any, Generic, TypeVar

import numpy as np

from ..arrays import Array
from ..display import short_repr
from ..integrator.many_rotations import assembled
from ..reconstruction.reconstruction import Motion

Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class SplitErrors:
    """Error estimates of a `PhaseSplit`, under the names of its fields, with the motion's batch axes.

    Made by `split`.

    Near the point opposite its start, a small displacement of the end of the momentum's curve turns the closing great
    circle by any angle, so the tilt of the closing may be wrong by up to pi and phases by up to 2 pi.

    Attributes
    ----------
    total_rotation, holonomy, dynamical_rotation, wheel_rotation, momentum_rotation, closing_tilt : angle from the true
        rotation [rad]
    montgomery_phase, dynamic_phase, geometric_phase, closing_phase : modulo 4 pi [rad]
    montgomery_angle : modulo 2 pi [rad]
    solid_angle : modulo 4 pi [sr]
    momentum_gap : [rad]
    """

    total_rotation: Array
    holonomy: Array
    dynamical_rotation: Array
    wheel_rotation: Array
    momentum_rotation: Array
    montgomery_phase: Array
    montgomery_angle: Array
    dynamic_phase: Array
    geometric_phase: Array
    solid_angle: Array
    closing_tilt: Array
    momentum_gap: Array
    closing_phase: Array

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class RunningErrors:
    """Error estimates of `RunningPhases`, modulo 4 pi; fields are batch + t.shape [rad]. Made by `running_phases`."""

    dynamic_phase: Array
    geometric_phase: Array
    montgomery_phase: Array
    solid_angle: Array

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class ArcErrors:
    """Error estimates of `ArcPhases`, with its names and shapes, modulo 4 pi; angles of rotations [rad].

    Made by `arc_phases`.
    """

    dynamic_phase: Array
    geometric_phase: Array
    montgomery_phase: Array
    solid_angle: Array
    closing_tilt: Array
    momentum_gap: Array
    polygon_angle: Array
    total_phase: Array
    total_closing_tilt: Array

    __repr__ = short_repr


class Deferred(Generic[Result]):
    """A result to be computed at its first use; a pickled copy has it already."""

    def __init__(self, compute: Callable[[], Result]) -> None:
        self._compute = compute

    @cached_property
    def value(self) -> Result:
        """The result."""
        return self._compute()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the result: its inputs may not be picklable."""
        return Deferred, (partial(_known, self.value),)


def _known(value: Result) -> Result:
    return value


def by_parts(motion: Motion, compute: Callable[[Motion], Result], shared: tuple[str, ...] = ()) -> Result:
    """Result of a function of a motion, computed for every part of it.

    `compute` takes a motion of a batch (n,) to an array, or a dataclass whose arrays, also those of dataclasses in it,
    have that axis in front, but for its `shared` fields.
    """
    return _joined(motion, [(rows, compute(part)) for rows, part in motion.parts], shared)


def _joined(motion: Motion, parts: list[Any], shared: tuple[str, ...] = ()) -> Any:
    first: Any = parts[0][1]
    if isinstance(first, np.ndarray):
        whole = assembled(parts)
        return whole.reshape(*motion.batch, *whole.shape[1:])
    if isinstance(first, Deferred):
        return Deferred(lambda: _joined(motion, [(rows, deferred.value) for rows, deferred in parts]))
    if not is_dataclass(first):
        return first
    names = [field.name for field in fields(first) if field.name not in shared]
    joined = {name: _joined(motion, [(rows, getattr(result, name)) for rows, result in parts]) for name in names}
    return type(first)(**vars(first) | joined)
