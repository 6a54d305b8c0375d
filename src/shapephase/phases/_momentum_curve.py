"""The curve of the body momentum on its sphere, seen from a gauge, and what is integrated along it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import so3, sphere
from ..arrays import Array
from ..deformation.frames import Frames, frames_argument, named_frames
from ..errors import GaugeError
from ..integrator.curve_integrals import curve_integrals
from ..integrator.stepped import SteppedRotation
from ..reconstruction.reconstruction import Motion

# Memory and time: a frame that needs more steps along the motion is refused.
_MOST_STEPS = 20_000
# Halvings of a step that passes by the point opposite the reference: then it is as short as times can tell apart.
_HALVINGS = 30
# Of the motion's error estimate [rad]: what the integrals over its steps may add to phases.
_SHARE = 5e-3
# [rad] the same where the motion is as good as exact.
_ROUNDING = 1e-14

Gauge = str | Callable[[Array], ArrayLike | tuple[ArrayLike, ArrayLike]]


@dataclass(frozen=True, eq=False)
class MomentumCurve:
    """The directions of the body momentum of a batch of motions, seen from a gauge's frame.

    Attributes
    ----------
    motion : whose momentum it is
    lift : of the horizontal gauge, else None
    frames : U(t) and its rates of another gauge; None too: the deformation's own frame
    axis : (B, 3) unit vector of the momentum, inertial axes; any where there is none
    edges : (K + 1,) times between which the curve bends little and its integrals are found to rounding
    dynamic : (B, K) integral of omega . Pi/|Pi| over each step [rad]
    slivers : (B, K) signed area between each step's arc and its chord [sr]
    corners : (B, K + 1, 3) directions at the edges
    references : (B, 3) for each curve the direction whose opposite is farthest from it
    """

    motion: Motion
    lift: SteppedRotation | None
    frames: Frames | None
    axis: Array
    edges: Array
    dynamic: Array
    slivers: Array
    corners: Array
    references: Array

    @property
    def has_phase(self) -> Array:
        """Which motions of the batch have momentum: (B,)."""
        return np.linalg.norm(self.motion.momentum.reshape(-1, 3), axis=-1) > 0.0

    def swept(self, times: Array) -> tuple[Array, Array]:
        """Dynamic phase and area swept from the start to each of these edges: (N,) -> (B, N), (B, N).

        The area is the integral of the area form of the reference, along the curve only; `times` must be edges.
        """
        place = np.searchsorted(self.edges, times)
        steps = self.slivers + sphere.triangle_area(self.references[:, None], self.corners[:, :-1], self.corners[:, 1:])
        zero = np.zeros((len(self.axis), 1))
        dynamic = np.concatenate([zero, np.cumsum(self.dynamic, axis=1)], axis=1)
        area = np.concatenate([zero, np.cumsum(steps, axis=1)], axis=1)
        moving = self.has_phase[:, None]
        return np.where(moving, dynamic[:, place], 0.0), np.where(moving, area[:, place], 0.0)

    def directions(self, times: Array) -> Array:
        """At these edges: (N,) -> (B, N, 3)."""
        return self.corners[:, np.searchsorted(self.edges, times)]

    def attitudes(self, times: Array) -> Array:
        """Of the gauge's frame: (N,) -> (B, N, 3, 3)."""
        own, frame = self._own_attitudes(times), self.frame(times)
        return own if frame is None else own @ so3.transpose(frame)

    def frame(self, times: Array) -> Array | None:
        """The gauge's frame U(t) in the deformation's own: (N,) -> (N, 3, 3); None where they are the same."""
        if self.lift is not None:
            return self.lift.rotation(times)[0]
        return None if self.frames is None else self.frames(times)[0]

    @property
    def end_attitudes(self) -> tuple[Array, Array]:
        """Of the deformation's own frame and of the gauge's at both ends: (B, 2, 3, 3), (B, 2, 3, 3)."""
        ends = self.edges[[0, -1]]
        own = self._own_attitudes(ends)
        if self.lift is not None:
            return own, own @ so3.transpose(np.stack([np.eye(3), self.lift.end[0]]))
        return own, own if self.frames is None else own @ so3.transpose(self.frames(ends)[0])

    def _own_attitudes(self, times: Array) -> Array:
        return self.motion.initial_attitude.reshape(-1, 1, 3, 3) @ self.motion.solution.rotation(times)


def momentum_curve(motion: Motion, gauge: Gauge, times: Array | None = None) -> MomentumCurve:
    """The curve of a motion in a gauge, cut at the integrator's steps and at `times` too.

    Parameters
    ----------
    gauge : a name of `GAUGES`, "link:NAME", or a function as for `in_gauge`

    Raises
    ------
    UnknownNameError, GaugeError, ShapeError
        For a gauge that does not exist.
    """
    interpolant, solution = motion.interpolant, motion.solution
    lift = motion.horizontal_lift if gauge == "horizontal" else None
    # The integrator's steps are short enough for the base's frame and for the lift, which is stepped alike.
    follows = lift is not None or gauge == "base"
    frames, edges = (None, solution.times) if follows else _frames(motion, gauge)
    spatial = motion.momentum.reshape(-1, 3)
    magnitude = np.linalg.norm(spatial, axis=-1)
    without = magnitude == 0.0
    # Without momentum any axis serves: what depends on it is set to zero.
    axis = np.where(without[:, None], [0.0, 0.0, 1.0], spatial) / np.where(without, 1.0, magnitude)[:, None]
    start = so3.apply(so3.transpose(motion.initial_attitude.reshape(-1, 3, 3)), axis)[:, None]

    def curve(at: Array) -> tuple[Array, Array]:
        """Unit momentum and angular velocity in the gauge."""
        inverse, drift = interpolant.inverse_and_drift(at)
        attitude = solution.rotation(at)
        turn = None
        if lift is not None:
            # The horizontal frame turns at minus the drift: relative to it the body turns at I^-1 Pi.
            turn, drift = lift.rotation(at)[0], np.zeros(3)
        elif frames is not None:
            turn, spin = frames(at)
            drift = drift + spin
        direction = so3.apply(so3.transpose(attitude), start)
        rate = so3.apply(inverse, magnitude[:, None, None] * direction) - drift
        return (direction, rate) if turn is None else (so3.apply(turn, direction), so3.apply(turn, rate))

    found = None
    if times is None and without.all():
        still = np.zeros((len(spatial), len(edges) - 1))
        found = still, still, np.repeat(start, len(edges), axis=1)
    elif times is None and follows and isinstance(solution, SteppedRotation):
        found = _from_steps(solution, lift)
    if found is None:
        found = _by_step(curve, edges)
    if not (follows or without.all()):
        edges, found = _refined(curve, edges, found)
    references = np.array(list(map(sphere.far_reference, found[2])))
    if times is not None:
        edges = np.union1d(edges, times)
        edges, found = _clear(curve, edges, references)
    dynamic, slivers, corners = found
    return MomentumCurve(
        motion=motion,
        lift=lift,
        frames=frames,
        axis=axis,
        edges=edges,
        dynamic=dynamic,
        slivers=slivers,
        corners=corners,
        references=references,
    )


def _frames(motion: Motion, gauge: Gauge) -> tuple[Frames, Array]:
    """The gauge's frames, and the ends of steps that are short enough to see all of what a user's gauge does."""
    if isinstance(gauge, str):
        return named_frames(motion.deformation, gauge), motion.solution.times
    given = frames_argument(gauge, motion.deformation.breaks)
    return given.frames, np.union1d(motion.solution.times, given.panel_ends)


def _from_steps(solution: SteppedRotation, lift: SteppedRotation | None) -> tuple[Array, Array, Array] | None:
    """As `_by_step`, from the ends of the steps alone, where that adds but little to the motion's error."""
    found = curve_integrals(solution, lift)
    if np.any(found.error > np.maximum(_SHARE * solution.error_estimate, _ROUNDING)):
        return None
    return found.dynamic, found.slivers, found.corners


def _by_step(curve: sphere.Curve, edges: Array) -> tuple[Array, Array, Array]:
    """Dynamic phase and area between arc and chord for each step (B, K), directions at the edges (B, K + 1, 3)."""
    nodes, weights = sphere.gauss_nodes(edges[:-1], edges[1:])
    # One evaluation for both: the edges are but an eighth as many as the nodes.
    directions, rates = curve(np.concatenate([edges, nodes.ravel()]))
    corners = directions[:, : len(edges)]
    direction, rate = (part[:, len(edges) :].reshape(-1, *nodes.shape, 3) for part in (directions, rates))
    return *_of_steps(direction, rate, weights, corners[:, :-1]), corners


def _integrals(curve: sphere.Curve, left: Array, right: Array, start: Array) -> tuple[Array, Array]:
    """Dynamic phase and area between arc and chord for steps that begin in the directions `start`: (B, K) each."""
    nodes, weights = sphere.gauss_nodes(left, right)
    direction, rate = (part.reshape(*part.shape[:-2], *nodes.shape, 3) for part in curve(nodes.ravel()))
    return _of_steps(direction, rate, weights, start)


def _of_steps(direction: Array, rate: Array, weights: Array, start: Array) -> tuple[Array, Array]:
    """The same integrals from directions and rates at the nodes of each step (B, K, n, 3)."""
    dynamic = (np.sum(direction * rate, axis=-1) * weights).sum(axis=-1)
    slivers = sphere.area_rate(start[:, :, None], direction, np.cross(direction, rate))
    return dynamic, (slivers * weights).sum(axis=-1)


def _refined(
    curve: sphere.Curve, edges: Array, found: tuple[Array, Array, Array]
) -> tuple[Array, tuple[Array, Array, Array]]:
    """Shorter steps where the gauge's own frame turns faster than those of the integrator: halved until that tells
    nothing new."""
    dynamic, slivers, corners = found
    left, right, start, end = edges[:-1], edges[1:], corners[:, :-1], corners[:, 1:]
    scale = max(1.0, float(np.abs(dynamic).sum(axis=1).max()))
    done: list[tuple[Array, ...]] = []
    count = len(left)
    while len(left):
        middle = 0.5 * (left + right)
        between, _ = curve(middle)
        first, early = _integrals(curve, left, middle, start)
        second, late = _integrals(curve, middle, right, between)
        cut = early + late + sphere.triangle_area(start, between, end)
        change = np.maximum(np.abs(first + second - dynamic), np.abs(cut - slivers)).max(axis=0)
        bend = np.linalg.norm(end - start, axis=-1).max(axis=0)
        rough = (change > 1e-13 * scale / count) | (bend > 0.5)
        done.append((left[~rough], dynamic[:, ~rough], slivers[:, ~rough], start[:, ~rough]))
        count += int(rough.sum())
        if count > _MOST_STEPS:
            raise GaugeError(f"the gauge's frame turns too fast to be followed near t = {left[rough][0]:.9g} s")
        left, right = (np.concatenate(pair) for pair in ((left[rough], middle[rough]), (middle[rough], right[rough])))
        dynamic, slivers, start, end = (
            np.concatenate([one[:, rough], other[:, rough]], axis=1)
            for one, other in ((first, second), (early, late), (start, between), (between, end))
        )
    times = np.concatenate([part[0] for part in done])
    dynamic, slivers, start = (np.concatenate([part[k] for part in done], axis=1) for k in (1, 2, 3))
    order = np.argsort(times)
    corners = np.concatenate([start[:, order], corners[:, -1:]], axis=1)
    return np.append(times[order], edges[-1]), (dynamic[:, order], slivers[:, order], corners)


def _clear(curve: sphere.Curve, edges: Array, references: Array) -> tuple[Array, tuple[Array, Array, Array]]:
    """Steps so short that the point opposite the reference is never between an arc and its chord."""
    found = _by_step(curve, edges)
    for _ in range(_HALVINGS):
        corners = found[2]
        away = np.linalg.norm(corners[:, :-1] + references[:, None], axis=-1)
        close = np.any(away < 2.0 * np.linalg.norm(np.diff(corners, axis=1), axis=-1), axis=0)
        if not close.any():
            break
        edges = np.sort(np.concatenate([edges, 0.5 * (edges[:-1] + edges[1:])[close]]))
        found = _by_step(curve, edges)
    return edges, found
