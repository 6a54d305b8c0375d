"""Motions of one body in which some groups of joints follow the motion, and all others a baseline."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, Mask, finite_array
from ..body.body import Body
from ..deformation.deformation import Deformation, deformation_along
from ..deformation.rotors import Rotor, rotors_argument
from ..errors import ShapeError, WrongObjectError, unknown_name
from ..integrator.machine_code import expect_work
from ..letters import value_text
from ..reconstruction.reconstruction import Motion, reconstruct
from ..shape_space.curves import Curve, Swings, most_swings, swings_of
from ..shape_space.shape_path import ShapePath
from .direct_shares import articulated_parts, rotors_of
from .limbs import WHEELS

MIRRORED = "mirrored"
POSTURES = ("first", "neutral")
BASELINES = (*POSTURES, MIRRORED)
_SAME = 1e-9  # relative difference of two trials that counts as none: files are written with ten digits or more
_FRACTIONS = np.linspace(0.0, 1.0, 257)  # of the duration, at which joints and wheels of two trials are compared


@dataclass(frozen=True, eq=False)
class _Still:
    """Curve of a body that rests in one shape."""

    shape: Array

    swings = Swings(0.0, smooth_loop=True)

    def __call__(self, times: Array) -> tuple[Array, Array]:
        shapes = np.broadcast_to(self.shape, (len(times), len(self.shape)))
        return shapes, np.zeros_like(shapes)


@dataclass(frozen=True, eq=False)
class _Mixed:
    """Curve whose columns are those of one curve where `own` is True, else those of another."""

    first: Curve
    second: Curve
    own: Mask

    @property
    def swings(self) -> Swings:
        both = swings_of(self.first), swings_of(self.second)
        return Swings(most_swings([one.most for one in both]), all(one.smooth_loop for one in both))

    def __call__(self, times: Array) -> tuple[Array, Array]:
        (shapes, rates), (others, slopes) = self.first(times), self.second(times)
        return np.where(self.own, shapes, others), np.where(self.own, rates, slopes)


class HeldMotions:
    """The motion, and what it would be with groups held.

    motion : along a path of joints
    columns : of the shape, by name of the group
    baseline : "first" or "neutral" posture, a shape, or another motion
    conditions : those of `limbs.CONDITIONS` that are groups as well; None: all that differ from the other motion
    rest : names of joints in no group
    """

    def __init__(
        self,
        motion: Motion,
        columns: Mapping[str, tuple[int, ...]],
        baseline: str | ArrayLike | Motion,
        conditions: Iterable[str] | None,
        rest: Iterable[str],
    ) -> None:
        self.motion, self._other = motion, motion
        self.at_first_posture = isinstance(baseline, str) and baseline == "first"
        self.body, path = articulated_parts(motion.deformation)
        self._paths = path, _still_path(self.body, path, baseline)
        wheels = rotors_of(motion.deformation)
        self._rotors = wheels, tuple(replace(wheel, value=0.0) for wheel in wheels)
        self._shared: list[int] = [*set(range(self.body.n_shape)) - {c for own in columns.values() for c in own}]
        if isinstance(baseline, Motion):
            self._other = baseline
            differing = self._differing(conditions, tuple(rest))
        else:
            differing = self._wheels_alone(conditions)
        self.columns, self.conditions = dict(columns), differing
        self.names = (*columns, *differing)

    def _wheels_alone(self, conditions: Iterable[str] | None) -> tuple[str, ...]:
        """The group of wheels against a posture, where they store nothing. Raises ShapeError for other conditions."""
        if conditions is None:
            return (WHEELS,) if self.motion.deformation.has_wheels else ()
        other = [name for name in conditions if name != WHEELS]
        if other:
            raise ShapeError(
                f"groups: {', '.join(other)} can be groups where another motion is the baseline; give it: "
                "baseline=motion (--baseline FILE)"
            )
        return tuple(conditions)

    def _differing(self, conditions: Iterable[str] | None, rest: tuple[str, ...]) -> tuple[str, ...]:
        """Conditions that are groups. Raises ShapeError where something else differs."""
        first, second = self.motion, self._other
        other_body, other_path = articulated_parts(second.deformation)
        if second.batch:
            raise ShapeError(f"baseline: one motion is needed, this is a batch of {second.batch}")
        if other_body.joint_names != self.body.joint_names:
            raise WrongObjectError(
                f"baseline: a Motion of the same joints is needed: {self.body.name} has "
                f"{', '.join(self.body.joint_names)}, {other_body.name} has {', '.join(other_body.joint_names)}"
            )  # fmt: skip
        own, others = self.body.chain, other_body.chain
        self._rotors = self._rotors[0], _same_wheels(self._rotors[0], rotors_of(second.deformation))
        differences = {
            "momentum": _apart(first.momentum, second.momentum),
            "attitude": _apart(first.initial_attitude, second.initial_attitude),
            "duration": _apart(np.array(first.duration), np.array(second.duration)),
            WHEELS: any(
                _apart(wheel.at(_FRACTIONS * first.duration)[0], other.at(_FRACTIONS * second.duration)[0])
                for wheel, other in zip(*self._rotors, strict=True)
            ),
            "body": len(own.masses) != len(others.masses)
            or any(
                _apart(getattr(own, name), getattr(others, name))
                for name in ("turns", "places", "axes", "slides", "masses", "centres", "inertias")
            ),
        }
        if conditions is None:
            chosen = tuple(name for name, apart in differences.items() if apart)
        else:
            chosen = tuple(conditions)
            left = [name for name, apart in differences.items() if apart and name not in chosen]
            if left:
                raise ShapeError(
                    f"the motions differ in {', '.join(left)}, in no group; make each one a group: "
                    f"groups={{..., {left[0]!r}: ()}} (--groups ... {left[0]})"
                )
        shapes = self._paths[0].shape(_FRACTIONS * first.duration)
        gaps = np.abs(shapes - other_path.shape(_FRACTIONS * second.duration)).max(axis=0)
        apart = [self.body.joint_names[column] for column in self._shared if gaps[column] > _SAME]
        if apart:
            raise ShapeError(
                f"the motions differ in joints that are in no group: {', '.join(apart)} (in no group are "
                f"{', '.join(rest)}); put them in a group"
            )
        return chosen

    @property
    def compares_posture(self) -> bool:
        """True where the baseline is no other motion."""
        return self._other is self.motion

    @property
    def whole(self) -> int:
        """Subset of all groups, as bits."""
        return (1 << len(self.names)) - 1

    def motions(self, subsets: Set[int]) -> dict[int, Motion]:
        """Motions in which the groups of each subset, as bits, follow the motion and the others the baseline.

        Raises like `reconstruct`.
        """
        expect_work(momenta=len(subsets))
        return {
            mask: reconstruct(
                self._deformation(mask),
                self._source("momentum", mask).momentum,
                self._source("attitude", mask).initial_attitude,
                tolerance=self.motion.tolerance,
            )
            for mask in sorted(subsets)
        }

    def own_columns(self, subset: int) -> Mask:
        """True for columns of the shape that follow the motion in a subset, not the baseline: (n,)."""
        own = np.zeros(self.body.n_shape, dtype=bool)
        own[self._shared] = True
        for place, columns in enumerate(self.columns.values()):
            own[list(columns)] |= bool(subset >> place & 1)
        return own

    def _source(self, name: str, subset: int) -> Motion:
        """The motion that has a condition in a subset: this one, or the baseline."""
        is_own = name not in self.conditions or bool(subset >> self.names.index(name) & 1)
        return self.motion if is_own else self._other

    def _deformation(self, mask: int) -> Deformation:
        """The deformation along the path whose groups in the subset move and whose others follow the baseline."""
        moving, baseline = self._paths
        body, breaks, loops = self.body, moving.breaks, moving.loops
        if not self.compares_posture:
            body, _ = articulated_parts(self._source("body", mask).deformation)
            _, baseline = articulated_parts(self._other.deformation)
            duration = self._source("duration", mask).duration
            moving, baseline = (
                path if path.duration == duration else path.stretched(duration / path.duration)
                for path in (moving, baseline)
            )
            # Both ends of the breaks are the same number.
            breaks, loops = np.union1d(moving.breaks, np.append(baseline.breaks[:-1], moving.duration)), 1
        curve = _Mixed(moving.curve, baseline.curve, self.own_columns(mask))
        path = replace(moving, curve=curve, breaks=breaks, loops=loops, origin=None)
        has_own_wheels = WHEELS not in self.conditions or bool(mask >> self.names.index(WHEELS) & 1)
        return deformation_along(body, path, _wheels_of(body, self._rotors[not has_own_wheels], path.duration))


def _same_wheels(wheels: tuple[Rotor, ...], others: tuple[Rotor, ...]) -> tuple[Rotor, ...]:
    """Another motion's wheels in the order of the first. Raises WrongObjectError where they are not those."""
    known = {(other.joint, other.is_momentum): other for other in others}
    kinds = [(wheel.joint, wheel.is_momentum) for wheel in wheels]
    if {*known} != {*kinds}:
        raise WrongObjectError(
            "baseline: a Motion with the same wheels is needed, by momentum or by speed alike: the motion has "
            f"{_wheel_names(wheels)}, the baseline {_wheel_names(others)}"
        )
    return tuple(known[kind] for kind in kinds)


def _wheel_names(wheels: tuple[Rotor, ...]) -> str:
    named = (f"{wheel.joint} by its {'momentum' if wheel.is_momentum else 'speed'}" for wheel in wheels)
    return ", ".join(named) or "none"


def _wheels_of(body: Body, rotors: tuple[Rotor, ...], duration: float) -> tuple[Rotor, ...]:
    """Wheels of a body, with the values of given ones, which last as long as the path."""
    momenta: dict[str, float | ShapePath] = {}
    speeds: dict[str, float | ShapePath] = {}
    for rotor in rotors:
        value = rotor.value
        if isinstance(value, ShapePath) and value.duration != duration:
            value = value.stretched(duration / value.duration)
        (momenta if rotor.is_momentum else speeds)[rotor.joint] = value
    return rotors_argument(body, momenta, speeds, duration)


def _apart(first: Array, second: Array) -> bool:
    scale = max(float(np.abs(first).max(initial=0.0)), float(np.abs(second).max(initial=0.0)))
    return bool(np.abs(first - second).max(initial=0.0) > _SAME * scale)


def _still_path(body: Body, path: ShapePath, baseline: str | ArrayLike | Motion) -> ShapePath:
    """Path of a body that rests in the baseline's posture, for another motion in the first one."""
    if isinstance(baseline, str) and baseline not in BASELINES:
        raise unknown_name("baseline", baseline, BASELINES)
    if isinstance(baseline, str | Motion):
        shape = body.shape() if baseline == "neutral" else path.shape(0.0)
    else:
        shape = finite_array(baseline, "baseline", (body.n_shape,))
        if shape.ndim != 1:
            raise ShapeError(f"baseline: one shape ({body.n_shape},) or a Motion is needed, got {value_text(baseline)}")
    return ShapePath(_Still(shape), path.duration, path.breaks[[0, -1]], body.n_shape, path.joint_names)
