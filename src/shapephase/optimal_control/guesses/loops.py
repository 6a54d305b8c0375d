"""Starting points of the search for a plan: loops in the plane of shapes in which the body turns most."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ... import so3
from ...arrays import Array
from ...errors import PlanNotFound, ShapePhaseError
from ...reconstruction.reconstruction import Motion
from ...shape_space.body_path import route_along
from ...shape_space.connection import curvature, mechanical_connection
from ...shape_space.shape_path import ShapePath
from .._spline_basis import SplineBasis
from .._via_points import bent_through, nearest_places
from ..small_loops import widest_plane
from ..symbolic import symbolic_body
from ..task import Reorientation, motion_along

PLACES = np.linspace(0.0, 1.0, 101)  # samples of a guess: dense enough for two rounds on any spline
_RADIUS_FACTORS = (0.4, 0.6, 0.8, 1.0, 1.3, 1.7)  # of the radius that a constant curvature would need
_DIRECTIONS = 6  # in which a circle leaves the start: 60 degrees apart
_ROUNDS = (1, 2)  # two small circles may stay within limits that one large one would exceed
_STRAIGHT_FACTORS = (0.5, 1.0)  # of the way to a free end that turns far enough to first order
_ATTEMPTS = 10  # random loops for each one that is needed: some cannot be reconstructed
_RECONSTRUCTION_TOLERANCE = 1e-6  # [rad]: guesses are off by far more
_LEAST_SHARE = 1e-3  # of the way that a guess counts as turning, so that its price is finite
_RIDGE = 1e-9  # on the metric, share of its mean eigenvalue: motions without energy get a finite length
_RANK = 1e-8  # share of the largest singular value below which the connection does not turn
_SAME = 1e-6  # [rad or m] between guesses that clipping to limits has made equal


@dataclass(frozen=True, eq=False)
class Guess:
    """Motion of the joints from which a search starts.

    control : (k, m) control points
    motion : its rough reconstruction
    goal_error : angle between its attitude at the end and the goal [rad]
    price : its cost in the metric of the start, divided by the squared share of the turn that it makes; ranks guesses
    via_places : (v,) approximate places of the waypoints
    """

    control: Array
    motion: Motion
    goal_error: float
    price: float
    via_places: Array

    def quaternions(self, places: Array, turn: Array) -> Array:
        """Attitudes at places of [0, 1], the missing `turn` added steadily: (N,) -> (N, 4), continuous."""
        attitude = self.motion.attitude(places * self.motion.duration)
        quats = so3.quat_from_matrix(so3.exp(places[:, None] * turn) @ attitude)
        flips = np.where(np.sum(quats[1:] * quats[:-1], axis=1) < 0.0, -1.0, 1.0)
        quats[1:] *= np.cumprod(flips)[:, None]
        return quats


def guesses(task: Reorientation, basis: SplineBasis, seed: int, count: int) -> list[Guess]:
    """Return guesses, the best first: circles through the start in the planes of largest curvature, then random loops.

    The curvature F of the mechanical connection along the axis of the turn, in the kinetic metric, is an antisymmetric
    form; its largest singular value sigma belongs to the plane of shapes in which a small loop turns the body most for
    its length: a circle of radius rho turns it by pi rho^2 sigma. Circles of several sizes, in several directions from
    the start, once or twice round, are tried by the integrator; for each direction and number of rounds the size is
    taken that comes near the goal at the least cost, and the cheapest come first.

    Source: Montgomery 1990, isoholonomic problem; theory.md B6.

    Raises PlanNotFound if no guess can be reconstructed.
    """
    families = [*_circles(task), *([curve] for curve in _straight(task))]
    rng = np.random.default_rng(seed)
    tried: list[Guess] = []
    for family in families:
        of_family = [guess for curve in family if (guess := guess_of(task, basis, curve)) is not None]
        if of_family:
            tried.append(min(of_family, key=lambda guess: guess.price))
    tried.sort(key=lambda guess: guess.price)
    # Every second start is random: circles are all alike where the optimum is not.
    chosen = _different(tried)[: count - count // 2]
    for _ in range(_ATTEMPTS * count):
        if len(chosen) == count:
            break
        guess = guess_of(task, basis, _random(task, rng))
        if guess is not None:
            chosen.append(guess)
    if not chosen:
        raise PlanNotFound(
            f"no guess of a motion of {task.body.name} could be reconstructed; change the start or the limits"
        )
    return chosen


def _circles(task: Reorientation) -> list[list[Array]]:
    """Loops (N, m) over `PLACES` through the start; those of a list differ by their radius only."""
    families = []
    turn = task.turn_to_goal()
    angle = float(np.linalg.norm(turn))
    if angle == 0.0 or np.count_nonzero(task.movable) < 2:
        return []
    # At the start, which may be special, and half way to the middle of the limits.
    middle = 0.5 * sum(task.reach(np.pi))
    for centre in (task.start, 0.5 * (task.start + middle)):
        plane = _plane(task, centre, turn / angle)
        if plane is None:
            continue
        first, second, sigma = plane
        for rounds in _ROUNDS:
            radii = np.array(_RADIUS_FACTORS) * np.sqrt(angle / (np.pi * sigma * rounds))
            phase = 2.0 * np.pi * rounds * PLACES
            for lean in 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS:
                across = np.cos(phase + lean) - np.cos(lean)
                along = np.sin(phase + lean) - np.sin(lean)
                circle = across[:, None] * first + along[:, None] * second
                families.append([task.start + radius * circle for radius in radii])
    return families


def _plane(task: Reorientation, coordinates: Array, axis: Array) -> tuple[Array, Array, float] | None:
    """Two orthonormal directions in the metric, and sigma; loops turn by +axis."""
    shape = task.shapes(coordinates)
    moves = np.flatnonzero(task.movable)
    form = task.coupling.T @ (curvature(task.body, shape) @ axis) @ task.coupling
    plane = widest_plane(form[np.ix_(moves, moves)], ridged(_metric(task, coordinates)[np.ix_(moves, moves)], _RIDGE))
    if plane is None:
        return None
    first, second = np.zeros((2, task.dimension))
    first[moves], second[moves] = plane
    return first, second, float(-first @ form @ second)


def _straight(task: Reorientation) -> list[Array]:
    """Straight ways: to a free end, those that turn the body best to first order; else to a different end."""
    ramp = PLACES[:, None]
    if task.end is not None:
        moves = np.any(task.end != task.start) or task.via
        return [task.start + ramp * (task.end - task.start)] if moves else []
    connection = mechanical_connection(task.body, task.shapes(task.start)) @ task.coupling
    turning = task.constrained_directions() @ (task.pointed_turn(task.start) - connection)
    cheap = np.linalg.solve(ridged(start_metric(task), _RIDGE), turning.T)
    missing = task.constrained_directions() @ task.turn_to_goal()
    direction = cheap @ np.linalg.lstsq(turning @ cheap, missing, rcond=_RANK)[0]
    return [task.start + factor * ramp * direction for factor in _STRAIGHT_FACTORS]


def _random(task: Reorientation, rng: np.random.Generator) -> Array:
    """Loop of two random harmonics through the start, of the size of half the limits or one radian."""
    reach = np.minimum(0.5 * (task.upper - task.lower), 1.0)
    phase = 2.0 * np.pi * PLACES[:, None]
    curve = np.zeros((len(PLACES), task.dimension))
    for harmonic in (1, 2):
        cosine, sine = rng.normal(size=(2, task.dimension)) * reach / harmonic
        curve += cosine * (np.cos(harmonic * phase) - 1.0) + sine * np.sin(harmonic * phase)
    return task.start + curve


def guess_of(task: Reorientation, basis: SplineBasis, curve: Array) -> Guess | None:
    """Return the guess of a curve (101, m) over `PLACES`, put within limits and ends; None where it has no motion."""
    if task.end is not None:
        curve = curve + PLACES[:, None] * (task.end - curve[-1])
    at = nearest_places(task, curve, PLACES)
    curve = bent_through(task, curve, PLACES, at)
    return guess_of_control(task, basis, basis.fitted(np.clip(curve, task.lower, task.upper), PLACES), at)


def guess_of_path(task: Reorientation, basis: SplineBasis, path: ShapePath) -> Guess | None:
    """Return the guess of a path, at the pace of the task; None as `guess_of`, and for a body with ball joints."""
    route = route_along(task.body, path)
    if task.body.ball_joints:
        return None
    away = route.shape(PLACES * route.duration) - task.offset
    curve = np.asarray(np.linalg.lstsq(task.coupling, away.T, rcond=None)[0].T, dtype=np.float64)
    return guess_of(task, basis, curve)


def guess_of_control(
    task: Reorientation, basis: SplineBasis, control: Array, via_places: Array | None = None
) -> Guess | None:
    """Return the guess of control points, put within limits and at rest at the ends; None where it has no motion."""
    control, equal = control.copy(), task.equal_points
    control[:equal], control[-equal:] = control[0], control[-1]
    if task.rates_at_ends == "periodic":
        half = 0.5 * (control[1] - control[0] + control[-1] - control[-2])
        control[1], control[-2] = control[0] + half, control[-1] - half
    control = np.clip(control, task.lower, task.upper)
    path = basis.path(task.shapes(control), task.duration, task.body.joint_names)
    try:
        motion = motion_along(task, path, _RECONSTRUCTION_TOLERANCE)
    except ShapePhaseError:
        return None
    goal_error = task.goal_error(motion.final_attitude, control[-1])
    steps = np.diff(basis.matrix(PLACES) @ control, axis=0)
    length = np.sum((steps @ start_metric(task)) * steps)
    whole = float(np.linalg.norm(task.turn_to_goal()))
    share = max(whole - goal_error, _LEAST_SHARE * whole) / whole if whole else 1.0
    return Guess(
        control=control,
        motion=motion,
        goal_error=goal_error,
        price=float(length / share**2),
        via_places=np.zeros(0) if via_places is None else via_places,
    )


def start_metric(task: Reorientation) -> Array:
    """Metric of the coordinates at the start: (m, m)."""
    return _metric(task, task.start)


def _metric(task: Reorientation, coordinates: Array) -> Array:
    """Given metric of the cost, else the kinetic one, at coordinates (m,): (m, m)."""
    given = task.metric.metric if task.metric and task.cost == "metric" else symbolic_body(task.body).shape_metric
    return task.coupling.T @ given(task.shapes(coordinates)).full() @ task.coupling


def ridged(metric: Array, share: float) -> Array:
    """Return a metric in which every motion has a length, at least a share of the mean eigenvalue."""
    return metric + share * np.trace(metric) / len(metric) * np.eye(len(metric))


def _different(tried: list[Guess]) -> list[Guess]:
    """Guesses without those that clipping made equal."""
    kept: list[Guess] = []
    for guess in tried:
        if all(np.abs(guess.control - other.control).max() > _SAME for other in kept):
            kept.append(guess)
    return kept
