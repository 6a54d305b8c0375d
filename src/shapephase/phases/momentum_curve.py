"""The curve of the body momentum on its sphere, seen from a gauge, and integrals along it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .. import so3, sphere
from ..arrays import Array, Integers, Mask
from ..deformation.frames import GAUGES, Frames, frames_argument, named_frames
from ..errors import GaugeError, ShapeError
from ..integrator.closing import areas_back, far_references, jumps_between
from ..integrator.curve_integrals import CurveIntegrals, curve_integrals
from ..integrator.lift import Lift
from ..integrator.stepped import SteppedRotation
from ..letters import value_text
from ..reconstruction.reconstruction import Motion

_MOST_STEPS = 20_000  # added to those of the motion, for memory and time: a frame that needs more is refused
_HALVINGS = 30  # of a step that passes by the point opposite the reference, down to the resolution of times
_SHARE = 0.2  # of the motion's error estimate: error allowed for integrals over its steps, which estimates include
_SHARE_AT_TIMES = 5e-3  # of it, for phases in time
_ROUNDING = 1e-14  # [rad] that error where the motion is as good as exact
_HALVINGS_AT_START = 8  # of pieces near the point opposite the start, where the area swings by nature
_MOST_HALVINGS = 3  # of steps whose integrals add more; each divides the added error by four thousand
_LONGEST_PIECE = 0.5  # [rad] longer pieces are halved: the area between arc and chord may hide whole turns
_TINY = 1e-300  # keeps the decay of terms defined where all are zero

# Weighted values at the nodes of a piece -> its Legendre terms, (8, 8).
_NODES = sphere.gauss_nodes(np.zeros(1), np.ones(1))[0][0]
_TERMS = np.polynomial.legendre.legvander(2.0 * _NODES - 1.0, len(_NODES) - 1) * (2.0 * np.arange(len(_NODES)) + 1.0)

Gauge = str | Callable[[Array], ArrayLike | tuple[ArrayLike, ArrayLike]]


class Displacements(NamedTuple):
    """Changes since the start, at the edges of a curve: (..., B, K + 1) each."""

    area: Array  # of the swept area [sr]
    phase: Array  # of the Montgomery phase along the displaced curve [rad]
    along: Array  # the turn about the momentum [rad]


@dataclass(frozen=True, eq=False)
class CurvePieces:
    """Integrals along the curves of a batch of motions, piece by piece.

    edges : (K + 1,) times between which the curve bends little and its integrals are right to rounding
    dynamic : (B, K) integral of omega . Pi/|Pi| over each piece [rad]
    slivers : (B, K) signed area between each piece's arc and its chord [sr]
    corners : (B, K + 1, 3) directions at the edges
    error : (B,) estimate of the error of both sums by the integration along the curve [rad]
    slopes : (B, K + 1, 3) rates of the directions at the edges, in the gauge but body axes [rad/s]
    by_momentum : (B, K + 1, 3) the part of them that is due to I^-1 Pi [rad/s]
    body_directions : (B, K + 1, 3) directions at the edges in body axes
    """

    edges: Array
    dynamic: Array
    slivers: Array
    corners: Array
    error: Array
    slopes: Array
    by_momentum: Array
    body_directions: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class MomentumCurve(CurvePieces):
    """The directions of the body momentum of a batch of motions, seen from a gauge's frame.

    motion : whose momentum it is
    lift : of the horizontal gauge, else None
    frames : U(t) and its rates of another gauge; None too: the deformation's own frame
    has_phase : (B,) which motions of the batch have momentum
    axis : (B, 3) unit vector of the momentum, inertial axes; any where there is none
    references : (B, 3) for each curve the direction whose opposite is farthest from it
    """

    motion: Motion
    lift: Lift | None
    frames: Frames | None
    has_phase: Mask
    axis: Array
    references: Array

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

    def closing(self, times: Array) -> tuple[Array, Integers]:
        """Area by the great circle back to the start at each of these edges, and its jumps so far.

        (N,) -> (B, N) [sr], (B, N): the sum with what is `swept` grows continuously but for 4 pi, so many times, where
        the great circle passes the point opposite the reference.
        """
        corners, references = self.corners, self.references[:, None]
        start = corners[:, :1]
        back = areas_back(references, corners, start)
        back[:, 0] = 0.0
        first, second = corners[:, :-1], corners[:, 1:]
        grown = sphere.triangle_area(references, first, second) + np.diff(back, axis=1)
        spheres = jumps_between(start, first, second, grown)
        jumps = np.concatenate([np.zeros((len(corners), 1), dtype=np.int64), np.cumsum(spheres, axis=1)], axis=1)
        place, moving = np.searchsorted(self.edges, times), self.has_phase[:, None]
        return np.where(moving, back[:, place], 0.0), np.where(moving, jumps[:, place], 0)

    def directions(self, times: Array) -> Array:
        """Directions at these edges: (N,) -> (B, N, 3)."""
        return self.corners[:, np.searchsorted(self.edges, times)]

    def attitudes(self, times: Array) -> Array:
        """Attitudes of the gauge's frame: (N,) -> (B, N, 3, 3)."""
        attitudes = self.motion.initial_attitude.reshape(-1, 1, 3, 3) @ self.motion.solution.rotation(times)
        frame = self.frame(times)
        return attitudes if frame is None else attitudes @ so3.transpose(frame)

    def frame(self, times: Array) -> Array | None:
        """The gauge's frame U(t) in the deformation's own: (N,) -> (N, 3, 3); None where they are the same."""
        if self.lift is not None:
            return self.lift.rotation.rotation(times)[0]
        return None if self.frames is None else self.frames(times)[0]

    def frame_at(self, place: Integers) -> Array | None:
        """Frames at edges with these indices: (N,) -> (N, 3, 3)."""
        if self.lift is not None and len(self.edges) == len(self.lift.ends):
            return self.lift.at_ends(place)
        return self.frame(self.edges[place])

    def displaced(self, turns: Array) -> Displacements:
        """Displacements of the curve by small turns of the gauge's frame at the edges (..., B, K + 1, 3), body axes."""
        # The area changes by the boundary's displacement across itself; and with omega the rate of turning, omega . Pi
        # changes by the displacements of the direction along omega and along I^-1 Pi.
        parts = np.stack([self.slopes, self.by_momentum, self.body_directions])
        rates = np.einsum("...bki,pbki->p...bk", turns, parts)
        grown = np.zeros((2, *rates.shape[1:]))
        np.cumsum(-0.5 * (rates[:2, ..., 1:] + rates[:2, ..., :-1]) * np.diff(self.edges), axis=-1, out=grown[..., 1:])
        return Displacements(grown[0], grown[1], rates[2])

    @property
    def end_attitudes(self) -> tuple[Array, Array, Array]:
        """Attitudes of the own frame at the end, and of the gauge's at the start and at the end: (B, 3, 3) each."""
        start, solution = self.motion.initial_attitude.reshape(-1, 3, 3), self.motion.solution
        stepped = isinstance(solution, SteppedRotation)
        end = start @ (solution.end if stepped else solution.rotation(self.edges[-1:])[:, 0])
        if self.lift is not None:
            return end, start, end @ so3.transpose(self.lift.end)
        if self.frames is None:
            return end, start, end
        frames = so3.transpose(self.frames(self.edges[[0, -1]])[0])
        return end, start @ frames[0], end @ frames[1]


def momentum_curve(
    motion: Motion, gauge: Gauge, times: Array | None = None, *, clear_of_start: bool = False
) -> MomentumCurve:
    """The curve of a motion in a gauge, cut at the integrator's steps and at `times` too.

    With `clear_of_start` arcs that pass by the point opposite the start are cut finely, too. Raises UnknownNameError,
    GaugeError and ShapeError for an unknown or impossible gauge.
    """
    if not isinstance(gauge, str) and (not callable(gauge) or isinstance(gauge, type)):
        raise ShapeError(
            f"gauge: one of {', '.join(GAUGES)}, link:NAME or a function of times is needed, got {value_text(gauge)}"
        )
    lift = motion.lift_with_errors if gauge == "horizontal" else None
    # The integrator's steps are short enough for the base's frame and for the lift, which is stepped alike.
    follows = lift is not None or gauge == "base"
    frames, edges = (None, motion.solution.times) if follows else _frames(motion, gauge)
    spatial = motion.momentum.reshape(-1, 3)
    magnitude = np.linalg.norm(spatial, axis=-1)
    has_phase = magnitude > 0.0
    # Without momentum any axis serves: what depends on it is set to zero.
    axis = np.where(has_phase[:, None], spatial, [0.0, 0.0, 1.0]) / np.where(has_phase, magnitude, 1.0)[:, None]
    goal = np.maximum((_SHARE if times is None else _SHARE_AT_TIMES) * motion.solution.error_estimate, _ROUNDING)
    integrals = _integrals_of(motion, lift, frames, axis, goal, at_rest=not has_phase.any())
    pieces = integrals(edges if times is None else np.union1d(edges, times))
    # Areas are counted from one region, whatever the times.
    if times is not None and follows and isinstance(motion.solution, SteppedRotation):
        ends = pieces.corners[:, np.searchsorted(pieces.edges, edges)]
    else:
        ends = pieces.corners if times is None else integrals(edges).corners
    references = far_references(ends)
    if times is not None:
        pieces = _clear(integrals, pieces, references, _HALVINGS)
    if clear_of_start:
        pieces = _clear(integrals, pieces, pieces.corners[:, 0], _HALVINGS_AT_START)
    return MomentumCurve(
        motion=motion,
        lift=lift,
        frames=frames,
        has_phase=has_phase,
        axis=axis,
        references=references,
        **vars(pieces),
    )


def _integrals_of(
    motion: Motion, lift: Lift | None, frames: Frames | None, axis: Array, goal: Array, *, at_rest: bool
) -> Callable[[Array], CurvePieces]:
    """The integrals between any edges (K + 1,), the ends of the motion's steps among them."""
    solution = motion.solution
    by_kernel = frames is None and (lift is None or lift.is_without_wheels)
    if not at_rest and by_kernel and isinstance(solution, SteppedRotation):
        return lambda edges: _from_steps(solution, lift, edges, goal)
    start = so3.apply(so3.transpose(motion.initial_attitude.reshape(-1, 3, 3)), axis)
    if at_rest:

        def still_curve(edges: Array) -> CurvePieces:
            still, nothing = np.zeros((len(start), len(edges) - 1)), np.zeros((len(start), len(edges), 3))
            corners = np.repeat(start[:, None], len(edges), axis=1)
            return CurvePieces(edges, still, still, corners, still[:, 0], nothing, nothing, corners)

        return still_curve
    curve = _curve(motion, lift, frames, start)
    return lambda edges: _by_quadrature(curve, edges, goal)


_Curve = Callable[[Array], tuple[Array, ...]]


def _curve(motion: Motion, lift: Lift | None, frames: Frames | None, start: Array) -> _Curve:
    """Unit momentum and angular velocity in the gauge; in body axes the former's rate, its part by I^-1 Pi, and itself.

    (N,) -> (B, N, 3) each.
    """
    interpolant, solution = motion.interpolant, motion.solution
    magnitude = np.linalg.norm(motion.momentum.reshape(-1, 3), axis=-1)[:, None, None]

    def curve(at: Array) -> tuple[Array, ...]:
        inverse, drift = interpolant.inverse_and_drift(at)
        turn = None
        if lift is not None:
            # The horizontal frame turns at minus the shape's drift: relative to it the body turns at I^-1 (Pi - h).
            turn, drift = lift.rotation.rotation(at)[0], lift.drift_of_wheels(at)
        elif frames is not None:
            turn, spin = frames(at)
            drift = drift + spin
        direction = so3.apply(so3.transpose(solution.rotation(at)), start[:, None])
        whole = so3.apply(inverse, magnitude * direction)
        rate = whole - drift
        in_body = so3.cross(direction, rate), so3.cross(direction, whole), direction
        if turn is None:
            return direction, rate, *in_body
        return so3.apply(turn, direction), so3.apply(turn, rate), *in_body

    return curve


def _frames(motion: Motion, gauge: Gauge) -> tuple[Frames, Array]:
    """The gauge's frames, and the ends of steps that are short enough for a user's gauge."""
    if isinstance(gauge, str):
        return named_frames(motion.deformation, gauge), motion.solution.times
    given = frames_argument(gauge, motion.deformation.breaks)
    return given.frames, np.union1d(motion.solution.times, given.panel_ends)


def _from_steps(solution: SteppedRotation, lift: Lift | None, edges: Array, goal: Array) -> CurvePieces:
    """Integrals by the kernel, in shorter pieces where they would add more than a little to the motion's error."""
    # Where all edges are ends of steps nothing between them is needed.
    integrals = curve_integrals(solution, lift, None if len(edges) == solution.quaternions.shape[1] else edges)
    finer = edges
    for halvings in range(1, _MOST_HALVINGS + 1):
        if np.all(integrals.error <= goal):
            break
        finer = np.append(np.stack([finer[:-1], 0.5 * (finer[:-1] + finer[1:])], axis=-1).ravel(), finer[-1])
        last, integrals = integrals, curve_integrals(solution, lift, finer)
        for _ in range(halvings):
            integrals = _joined(integrals)
        # An error that does not fall is rounding.
        if np.all(integrals.error > 0.5 * last.error):
            break
    return CurvePieces(edges, *integrals)


def _joined(fine: CurveIntegrals) -> CurveIntegrals:
    """Integrals over pairs of pieces."""
    corners = fine.corners
    between = sphere.triangle_area(corners[:, :-2:2], corners[:, 1::2], corners[:, 2::2])
    dynamic, slivers = (pieces[:, ::2] + pieces[:, 1::2] for pieces in (fine.dynamic, fine.slivers))
    return CurveIntegrals(dynamic, slivers + between, corners[:, ::2], fine.error, *(ends[:, ::2] for ends in fine[4:]))


def _by_quadrature(curve: _Curve, edges: Array, goal: Array) -> CurvePieces:
    """Integrals by Gauss's rule, in shorter pieces where the gauge's frame turns faster than the steps follow."""
    left, right = edges[:-1], edges[1:]
    count = len(left)
    done: list[tuple[Array, ...]] = []
    at_end: tuple[Array, ...] = ()
    while len(left):
        ends = np.union1d(left, right)
        dynamic, slivers, corners, missed, length, in_body = _by_piece(curve, left, right, ends)
        first = np.searchsorted(ends, left)
        start = corners[:, first]
        rough = np.any((missed > goal[:, None] / count) | (length > _LONGEST_PIECE), axis=0)
        parts = (dynamic, slivers, missed, start, *(part[:, first] for part in in_body))
        done.append((left[~rough], *(part[:, ~rough] for part in parts)))
        count += int(rough.sum())
        if rough.any() and count > len(edges) + _MOST_STEPS:
            raise GaugeError(f"the gauge's frame turns too fast to be followed near t = {left[rough][0]:.9g} s")
        at_end = at_end or tuple(part[:, -1:] for part in (corners, *in_body))
        left, middle, right = left[rough], 0.5 * (left + right)[rough], right[rough]
        left, right = (np.stack(pair, axis=-1).ravel() for pair in ((left, middle), (middle, right)))
    times = np.concatenate([part[0] for part in done])
    order = np.argsort(times)
    dynamic, slivers, missed, *starts = (
        np.concatenate([part[k] for part in done], axis=1)[:, order] for k in range(1, len(done[0]))
    )
    corners, *in_body = (np.concatenate(pair, axis=1) for pair in zip(starts, at_end, strict=True))
    edges = np.append(times[order], edges[-1])
    return CurvePieces(edges, dynamic, slivers, corners, missed.sum(axis=1), *in_body)


def _by_piece(
    curve: _Curve, left: Array, right: Array, ends: Array
) -> tuple[Array, Array, Array, Array, Array, tuple[Array, ...]]:
    """Integrals over pieces (B, K) and values at `ends`.

    In this order: dynamic phase, area, directions at `ends`, errors, lengths, vectors in body axes at `ends`.
    """
    nodes, weights = sphere.gauss_nodes(left, right)
    # One evaluation for both: the ends are but an eighth as many as the nodes.
    directions, rates, *in_body = curve(np.concatenate([ends, nodes.ravel()]))
    corners = directions[:, : len(ends)]
    direction, rate = (part[:, len(ends) :].reshape(-1, *nodes.shape, 3) for part in (directions, rates))
    along = np.sum(direction * rate, axis=-1)
    start, moving = corners[:, np.searchsorted(ends, left), None], np.cross(direction, rate)
    length = (np.sqrt(np.einsum("...i,...i", moving, moving)) * weights).sum(axis=-1)
    weighted = np.stack([along, sphere.area_rate(start, direction, moving)]) * weights
    # The two terms before the last two, and the last two.
    early, late = (np.abs(weighted @ terms).max(axis=-1) for terms in (_TERMS[:, -4:-2], _TERMS[:, -2:]))
    # The rule is exact to twice as many degrees as its nodes resolve: four times two more than the last terms.
    missed = late * np.minimum(late / (early + _TINY), 1.0) ** 4
    in_body = [part[:, : len(ends)] for part in in_body]
    return *weighted.sum(axis=-1), corners, missed.max(axis=0), length, tuple(in_body)


def _clear(
    integrals: Callable[[Array], CurvePieces], pieces: CurvePieces, references: Array, halvings: int
) -> CurvePieces:
    """Pieces so short that the point opposite the reference is never between an arc and its chord."""
    for _ in range(halvings):
        edges, corners = pieces.edges, pieces.corners
        away = np.linalg.norm(corners[:, :-1] + references[:, None], axis=-1)
        close = np.any(away < 2.0 * np.linalg.norm(np.diff(corners, axis=1), axis=-1), axis=0)
        if not close.any():
            break
        pieces = integrals(np.sort(np.concatenate([edges, 0.5 * (edges[:-1] + edges[1:])[close]])))
    return pieces
