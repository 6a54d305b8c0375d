"""Motions of one body in which some groups of joints follow the motion and all others a baseline, many in one batch."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arrays import Array, Integers, Mask, finite_array
from ..body.body import Body
from ..deformation.deformation import Deformation, deformation_along
from ..deformation.rotors import Rotor, rotors_argument
from ..error_bars.wheels_along import WheelsAlong
from ..errors import ShapeError, WrongObjectError, unknown_name
from ..integrator.families import many_inverted, rotations_of_variants
from ..integrator.machine_code import expect_work
from ..integrator.sampling import Sampler
from ..integrator.smoothness import Smoothness
from ..letters import value_text
from ..reconstruction.reconstruction import Motion
from ..shape_space.body_path import channels_at
from ..shape_space.curves import Curve, Swings, most_swings, swings_of
from ..shape_space.shape_path import ShapePath
from .direct_shares import articulated_parts, reduced_body, rotors_of
from .limbs import WHEELS

MIRRORED = "mirrored"
BASELINES = ("first", "neutral", MIRRORED)
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


@dataclass(frozen=True, eq=False)
class _MixedVariants:
    """Paths of one body for the integrator, each mixed from two; planned by the one that follows the first alone."""

    body: Body
    path: ShapePath
    baseline: ShapePath
    own: Mask
    rotors: tuple[Rotor, ...]

    def __len__(self) -> int:
        return len(self.own)

    @cached_property
    def smoothness(self) -> Smoothness | None:
        """Smoothness of every mixture; None where a path is a function, whose mixtures are scanned one by one, and with
        wheels, whose momentum may change in time."""
        if self.rotors:
            return None
        if isinstance(self.baseline.curve, _Still):
            return self.path.smoothness
        most = most_swings([self.path.swings.most, self.baseline.swings.most])
        return None if most is None else Smoothness(np.union1d(self.path.breaks, self.baseline.breaks), most)

    @property
    def model(self) -> Sampler:
        return self._sampler(np.ones_like(self.own[0]))

    def alone(self, row: int) -> Sampler:
        return self._sampler(self.own[row])

    def mixed_path(self, own: Mask) -> ShapePath:
        """The path whose marked columns move and whose others follow the baseline."""
        still = isinstance(self.baseline.curve, _Still)
        breaks = self.path.breaks if still else np.union1d(self.path.breaks, self.baseline.breaks)
        curve, loops = _Mixed(self.path.curve, self.baseline.curve, own), self.path.loops if still else 1
        return replace(self.path, curve=curve, breaks=breaks, loops=loops, scanner=None, origin=None)

    def channels(self, rows: Integers, times: Array) -> tuple[Array, Mask]:
        shapes, rates = self._mixtures(self.own[rows], times)
        flat = shapes.reshape(-1, shapes.shape[-1]), rates.reshape(-1, shapes.shape[-1])
        values = None if self.rotors else channels_at(self.body, *flat)
        if values is not None:
            return values.reshape(len(rows), len(times), 9), np.ones(len(rows), dtype=bool)
        inertia, momentum = self._reduced.sample(*flat)
        if self.rotors:
            momentum = momentum + WheelsAlong(self.body, self.rotors, np.tile(times, len(rows)), *flat).stored
        batch = (len(rows), len(times))
        return many_inverted(inertia.reshape(*batch, 3, 3), momentum.reshape(*batch, 3), times)

    @cached_property
    def _reduced(self) -> Body:
        return reduced_body(self.body, self.rotors)

    def deformation(self, own: Mask) -> Deformation:
        """The deformation along the mixed path, with the wheels."""
        return deformation_along(self.body, self.mixed_path(own), self.rotors)

    def _mixtures(self, own: Mask, times: Array) -> tuple[Array, Array]:
        (shapes, rates), (others, slopes) = self.path.at_samples(times), self.baseline.at_samples(times)
        marked = own[:, None]
        return np.where(marked, shapes, others), np.where(marked, rates, slopes)

    def _sampler(self, own: Mask) -> Sampler:
        if self.smoothness is None:
            return self.deformation(own).sampler()

        def mixed(times: Array) -> tuple[Array, Array]:
            shapes, rates = self._mixtures(own[None], times)
            return shapes[0], rates[0]

        return Sampler(
            lambda times: self.body.sample(*mixed(times)),
            self.smoothness,
            lambda times: channels_at(self.body, *mixed(times)),
        )


class HeldMotions:
    """The motion, and what it would be with groups held.

    Parameters
    ----------
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

        Raises as `reconstruct`, with the number of the motion.
        """
        made: dict[int, Motion] = {}

        def alike(subset: int) -> tuple[bool, ...]:
            return tuple(self._follows(name, subset) for name in ("body", "duration", WHEELS))

        expect_work(momenta=len(subsets))
        for (own_body, own_duration, own_wheels), some in groupby(sorted(subsets, key=alike), key=alike):
            masks = list(some)
            variants = self._variants(masks, own_body=own_body, own_duration=own_duration, own_wheels=own_wheels)
            sources = [
                [self.motion if self._follows(name, mask) else self._other for mask in masks]
                for name in ("momentum", "attitude")
            ]
            momenta = np.array([source.momentum for source in sources[0]])
            starts = np.array([source.initial_attitude for source in sources[1]])
            at_start = so3.apply(so3.transpose(starts), momenta)
            rotations = rotations_of_variants(variants, at_start, self.motion.tolerance)
            for row, mask in enumerate(masks):
                made[mask] = Motion(
                    deformation=variants.deformation(variants.own[row]),
                    momentum=momenta[row],
                    initial_attitude=starts[row],
                    tolerance=self.motion.tolerance,
                    method="spectral",
                    evaluations=int(rotations.evaluations[row]),
                    solution=rotations[row],
                )
        return made

    def _follows(self, name: str, subset: int) -> bool:
        return name not in self.conditions or bool(subset >> self.names.index(name) & 1)

    def _variants(self, masks: list[int], *, own_body: bool, own_duration: bool, own_wheels: bool) -> _MixedVariants:
        moving, baseline = self._paths
        body, rotors = self.body, self._rotors[0 if own_wheels else 1]
        if not self.compares_posture:
            other_body, baseline = articulated_parts(self._other.deformation)
            body = body if own_body else other_body
            duration = self.motion.duration if own_duration else self._other.duration
            moving, baseline = (
                path if path.duration == duration else path.stretched(duration / path.duration)
                for path in (moving, baseline)
            )
            # Both ends of the breaks are the same number.
            baseline = replace(
                baseline, duration=moving.duration, breaks=np.append(baseline.breaks[:-1], moving.duration)
            )
        own = np.zeros((len(masks), body.n_shape), dtype=bool)
        own[:, self._shared] = True
        for place, columns in enumerate(self.columns.values()):
            own[:, list(columns)] |= (np.array([mask >> place & 1 for mask in masks]) > 0)[:, None]
        return _MixedVariants(body, moving, baseline, own, _wheels_of(body, rotors, moving.duration))


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
