"""Guesses of many strokes, for bodies that one loop of the joints turns by far too little."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from ... import so3
from ...arrays import Array
from ...errors import ShapeError
from ...shape_space.connection import connection_slopes, curvature, mechanical_connection
from ..task import FARTHEST, Reorientation
from .loops import ridged, start_metric
from .stroke_program import PIECES_OF_WAY, Layout

_POINTS = 8  # control points of a stroke, a periodic cubic spline: a loop with two harmonics
_STEPS = 32  # round a stroke: it turns the body by little, so midpoints are good to 1e-3
_STARTS = 4  # random loops from which the best stroke about an axis is searched
_ITERATIONS = 30  # of each search: it makes a guess
_SMALL = 1e-4  # [rad], turn below which quotients of its Jacobian have no digits left
_FARTHEST = np.pi  # [rad or m] from the start, of strokes of joints without limits
_TRIES = 48  # starts of Newton's method for the turns of three legs, for each three strokes
_NEWTON_STEPS = 40  # of it: those that come to a goal take ten
_DAMPING = 1e-3  # of it, relative to the turn: small enough to end at rounding
_STEERED = 1e-6  # [rad], miss of three legs that counts as none: far below one stroke
_IDLE = 1e-6  # [rad per length], turn below which a stroke is left out
PIECES_OF_STROKE = 6  # of the shortest stroke; longer ones have more, so that all go at about one pace
MOST_PIECES = 2000  # in all, as of `Search`
_CELLS = 24  # a side of the plane of two coordinates over which curvature is summed: a rough bound
_RIDGE = 1e-3  # on the metric, share of its mean eigenvalue, so that every motion has a cost


@dataclass(frozen=True, eq=False)
class Stroke:
    """A loop of the joints that turns the body far for its length.

    curve : (S + 1, m) its shapes, the last equal to the first
    turn : (3,) rotation vector of the body, base axes at its start [rad]
    length : length in the metric of the task
    """

    curve: Array
    turn: Array
    length: float

    def begun_near(self, coordinates: Array, metric: Array) -> Stroke:
        """Return the loop begun at its shape nearest to some coordinates."""
        gaps = self.curve[:-1] - coordinates
        first = int(np.argmin(np.sum((gaps @ metric) * gaps, axis=1)))
        curve = np.concatenate([self.curve[first:-1], self.curve[: first + 1]])
        return Stroke(curve=curve, turn=self.turn, length=self.length)


@dataclass(frozen=True, eq=False)
class _Leg:
    """Number of rounds of a stroke, whole or not; backwards below zero."""

    stroke: Stroke
    rounds: float

    @property
    def whole(self) -> int:
        """Number of whole rounds, one at least, that turn as far when each is made smaller."""
        return max(int(np.ceil(abs(self.rounds))), 1)

    def at(self, phases: Array) -> Array:
        """Shapes at shares of a round: (N,) -> (N, m)."""
        curve = self.stroke.curve
        middle = curve[:-1].mean(axis=0)
        # A small loop turns the body by its area.
        smaller = middle + np.sqrt(abs(self.rounds) / self.whole) * (curve - middle)
        places = np.linspace(0.0, 1.0, len(curve))
        phases = phases if self.rounds >= 0.0 else 1.0 - phases
        return np.stack([np.interp(phases, places, column) for column in smaller.T], axis=1)


def most_of_a_loop(task: Reorientation) -> float:
    """Upper bound of the turn by a loop that goes round once [rad]; infinite where no bound is known.

    By Stokes' theorem the turn is at most the integral of the curvature's length over the area that the loop encloses:
    for two coordinates, at most the whole range of their limits.

    Source: theory.md B6; Montgomery 1990.
    """
    moves = np.flatnonzero(task.movable)
    reach = np.stack([task.lower, task.upper], axis=1)[moves]
    closed = task.end is not None and np.array_equal(task.end, task.start)
    if len(moves) != 2 or not closed or task.momentum.any() or np.ptp(reach, axis=1).max() >= FARTHEST:
        return np.inf
    shares = (np.arange(_CELLS) + 0.5) / _CELLS
    first, second = (low + shares * (high - low) for low, high in reach)
    coordinates = np.tile(task.start, (_CELLS**2, 1))
    coordinates[:, moves] = np.stack(np.meshgrid(first, second), axis=-1).reshape(-1, 2)
    try:
        field = curvature(task.body, task.shapes(coordinates))
    except ShapeError:
        return np.inf  # places that a user's function does not have everywhere within the limits
    curvatures = np.einsum("kija,i,j->ka", field, *task.coupling[:, moves].T)
    area = float(np.prod(reach[:, 1] - reach[:, 0]))
    return float(np.linalg.norm(curvatures, axis=1).mean() * area)


def guess_of_strokes(task: Reorientation, seed: int, pieces: int | None = None) -> tuple[Layout, Array] | None:
    """Return a motion of many strokes that comes near the goal, and its control points; None where there is none.

    Its spline has at most `pieces` pieces. Each stroke turns the body furthest for its length about some axis, within
    the limits. Three legs, each some rounds of one of the strokes, make any rotation if their axes differ enough, like
    Euler's angles; the shortest that reach the goal are taken.
    """
    if task.momentum.any() or task.windings is not None or np.count_nonzero(task.movable) < 2:
        return None
    least = 3 * PIECES_OF_STROKE + 4 * PIECES_OF_WAY
    if task.via or task.body.follows.balls or (pieces is not None and pieces < least):
        return None
    metric = _metric(task)
    strokes = [stroke.begun_near(task.start, metric) for stroke in best_strokes(task, metric, seed)]
    legs = _steered(strokes, so3.exp(task.turn_to_goal()), seed)
    if legs is None:
        return None
    shortest = min(leg.stroke.length for leg in legs)
    layout = Layout(tuple((int(np.rint(PIECES_OF_STROKE * leg.stroke.length / shortest)), leg.whole) for leg in legs))
    if layout.basis.pieces > (pieces or MOST_PIECES):
        return None
    return layout, layout.basis.through(_joined(task, layout, legs))


def _joined(task: Reorientation, layout: Layout, legs: list[_Leg]) -> Array:
    """Coordinates at the ends of the pieces, start, legs and end joined by straight ways: (pieces + 1, m)."""
    values, place = np.tile(task.start, (layout.basis.pieces + 1, 1)), 0
    for leg, first, (pieces, rounds) in zip(legs, layout.firsts, layout.strokes, strict=True):
        last = first + pieces * rounds
        values[first : last + 1] = leg.at(np.arange(pieces * rounds + 1) % pieces / pieces)
        values[place : first + 1] = np.linspace(values[place], values[first], first - place + 1)
        place = last
    end = task.start if task.end is None else task.end
    values[place:] = np.linspace(values[place], end, len(values) - place)
    return values


def best_strokes(task: Reorientation, metric: Array, seed: int) -> list[Stroke]:
    """Return the strokes that turn the body furthest for their length about the goal's and the loops' main axes.

    Length is the root of the energy over the same time, so that strokes are evenly paced.
    """
    rng = np.random.default_rng(seed)
    reach = _reach(task)
    first = [_random_loop(task, reach, rng) for _ in range(_STARTS)]
    turns = so3.log(_turned(task, np.stack([_curve(loop) for loop in first])))
    axes = [*np.linalg.svd(turns)[2], so3.normalised(task.turn_to_goal())]
    strokes = []
    for axis in axes:
        tried = [_improved(task, metric, reach, loop, axis) for loop in first]
        best = max(tried, key=lambda stroke: abs(stroke.turn @ axis) / stroke.length)
        if abs(best.turn @ axis) > _IDLE * best.length:
            strokes.append(best)
    return strokes


def _metric(task: Reorientation) -> Array:
    """Metric of lengths: (m, m), the cost's own where the cost is the integral of a metric."""
    if task.cost == "time":
        return np.diag(task.rate_limit**-2.0)
    metric = start_metric(task) if task.cost in ("kinetic", "metric") else task.coupling.T @ task.coupling
    return ridged(metric, _RIDGE)


def _reach(task: Reorientation) -> Array:
    """Bounds of strokes: (m, 2)."""
    return np.stack(task.reach(_FARTHEST), axis=1)


def _random_loop(task: Reorientation, reach: Array, rng: np.random.Generator) -> Array:
    """Control points (K, m) of an ellipse somewhere within reach."""
    width = reach[:, 1] - reach[:, 0]
    middle = rng.uniform(reach[:, 0] + 0.25 * width, reach[:, 1] - 0.25 * width)
    phase = 2.0 * np.pi * np.arange(_POINTS)[:, None] / _POINTS
    cosine, sine = rng.normal(size=(2, task.dimension)) * 0.25 * width
    return np.clip(middle + np.cos(phase) * cosine + np.sin(phase) * sine, *reach.T)


def _curve(control: Array) -> Array:
    """Shapes round loops, the last equal to the first: control points (..., K, m) -> (..., S + 1, m)."""
    return _ROUND @ control


def _round() -> Array:
    """Periodic splines at equal steps: (S + 1, K)."""
    from scipy.interpolate import BSpline

    knots = np.arange(-3, _POINTS + 4) / _POINTS
    values = np.asarray(BSpline(knots, np.eye(_POINTS + 3), 3)(np.arange(_STEPS) / _STEPS))
    values[:, :3] += values[:, _POINTS:]
    return np.concatenate([values[:, :_POINTS], values[:1, :_POINTS]])


def _turned(task: Reorientation, curves: Array) -> Array:
    """Rotations of the body along curves, by midpoints: (L, N + 1, m) -> (L, 3, 3)."""
    steps = np.diff(curves, axis=1)
    shapes = task.shapes(0.5 * (curves[:, 1:] + curves[:, :-1]))
    connection = mechanical_connection(task.body, shapes.reshape(-1, shapes.shape[-1])).reshape(
        *shapes.shape[:2], 3, -1
    )
    turns = so3.exp(-so3.apply(connection @ task.coupling, steps))
    # Products of neighbours, halving their number each time.
    while turns.shape[1] > 1:
        odd = turns[:, -1:] if turns.shape[1] % 2 else turns[:, :0]
        turns = np.concatenate([turns[:, 0:-1:2] @ turns[:, 1::2], odd], axis=1)
    return turns[:, 0]


def _improved(task: Reorientation, metric: Array, reach: Array, loop: Array, axis: Array) -> Stroke:
    """Return the stroke next to a loop that turns the body furthest about an axis for its length."""
    from scipy.optimize import minimize

    first, _ = _turn_for_length(task, metric, loop, axis)
    # The optimiser's tolerances are absolute.
    scale = -np.copysign(1.0, first) / max(abs(first), _IDLE)

    def missing(values: Array) -> tuple[float, Array]:
        rate, slope = _turn_for_length(task, metric, values.reshape(loop.shape), axis)
        return scale * rate, scale * (slope * task.movable).ravel()

    bounds = np.tile(reach, (_POINTS, 1))
    result = minimize(
        missing, loop.ravel(), jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": _ITERATIONS}
    )
    curve = _curve(result.x.reshape(loop.shape))
    return Stroke(
        curve=curve,
        turn=so3.log(_turned(task, curve[None]))[0],
        length=float(_length(curve[None], metric)[0]),
    )


def _turn_for_length(task: Reorientation, metric: Array, control: Array, axis: Array) -> tuple[float, Array]:
    """Ratio of turn about an axis to length, of a loop of control points (K, m), and its exact slope (K, m).

    The body turns by the product of exp(phi_k), phi_k = -A(r_k) d_k, r_k the middle of a step d_k.
    """
    curve = _curve(control)
    steps, middles = np.diff(curve, axis=0), 0.5 * (curve[1:] + curve[:-1])
    columns, slopes = connection_slopes(task.body, task.shapes(middles))
    columns = np.einsum("kja,jm->kma", columns, task.coupling)
    slopes = np.einsum("kija,im,jn->kmna", slopes, task.coupling, task.coupling)
    turns = -np.einsum("kma,km->ka", columns, steps)
    rotations = so3.exp(turns)
    before = np.empty_like(rotations)
    whole = np.eye(3)
    for number, rotation in enumerate(rotations):
        before[number], whole = whole, whole @ rotation
    turn = so3.log(whole)
    # A change of the product by a rotation vector changes its logarithm by the inverse of `left_jacobian`; that of a
    # small step changes its exponential by nearly 1 + hat(phi)/2.
    covector = np.asarray(np.linalg.solve(_left_jacobian(turn).T, axis), float)
    by_turn = so3.apply(so3.transpose(before), np.broadcast_to(covector, turns.shape))
    by_turn = by_turn - 0.5 * so3.cross(turns, by_turn)
    by_middle = -np.einsum("kmna,kn,ka->km", slopes, steps, by_turn)
    by_step = -np.einsum("kma,ka->km", columns, by_turn)
    length = float(_length(curve[None], metric)[0])
    by_step = by_step / length - (axis @ turn) * len(steps) * (steps @ metric) / length**3
    by_middle = by_middle / length
    on_curve = np.zeros_like(curve)
    on_curve[1:] += by_step + 0.5 * by_middle
    on_curve[:-1] += 0.5 * by_middle - by_step
    return float(axis @ turn) / length, _ROUND.T @ on_curve


def _left_jacobian(turn: Array) -> Array:
    """Matrix J with exp(turn + d) = exp(J d) exp(turn) to first order: (3,) -> (3, 3)."""
    angle = float(np.linalg.norm(turn))
    spin = so3.hat(turn)
    if angle < _SMALL:
        return np.eye(3) + 0.5 * spin
    return np.eye(3) + (1.0 - np.cos(angle)) / angle**2 * spin + (angle - np.sin(angle)) / angle**3 * spin @ spin


def _length(curves: Array, metric: Array) -> Array:
    steps = np.diff(curves, axis=1)
    return np.sqrt(steps.shape[1] * np.sum((steps @ metric) * steps, axis=(1, 2)))


def _steered(strokes: list[Stroke], goal: Array, seed: int) -> list[_Leg] | None:
    """Return the shortest three legs, each of a stroke, that turn the body to the goal; None where none do."""
    if not strokes:
        return None
    sizes = np.array([np.linalg.norm(stroke.turn) for stroke in strokes])
    axes = np.array([stroke.turn for stroke in strokes]) / sizes[:, None]
    prices = np.array([stroke.length for stroke in strokes]) / sizes
    chosen = np.repeat(list(product(range(len(strokes)), repeat=3)), _TRIES, axis=0)
    angles = np.random.default_rng(seed).uniform(-np.pi, np.pi, size=(len(chosen), 3))
    missing = np.full_like(angles, np.inf)
    for _ in range(_NEWTON_STEPS):
        first, second, third = (so3.exp(angles[:, [k]] * axes[chosen[:, k]]) for k in range(3))
        missing = so3.log(so3.transpose(first @ second @ third) @ goal)
        back = so3.transpose(third)
        columns = [so3.apply(back @ so3.transpose(second), axes[chosen[:, 0]]), so3.apply(back, axes[chosen[:, 1]])]
        slopes = np.stack([*columns, axes[chosen[:, 2]]], axis=-1)
        damped = so3.transpose(slopes) @ slopes + _DAMPING * np.sum(missing**2, axis=1)[:, None, None] * np.eye(3)
        damped = damped + np.finfo(float).eps * np.eye(3)
        angles = angles + so3.apply(np.linalg.inv(damped), so3.apply(so3.transpose(slopes), missing))
    angles = np.remainder(angles + np.pi, 2.0 * np.pi) - np.pi
    costs = np.where(
        np.linalg.norm(missing, axis=1) < _STEERED, np.sum(np.abs(angles) * prices[chosen], axis=1), np.inf
    )
    best = int(np.argmin(costs))
    if not np.isfinite(costs[best]):
        return None
    return [_Leg(strokes[k], float(angle / sizes[k])) for k, angle in zip(chosen[best], angles[best], strict=True)]


_ROUND = _round()
