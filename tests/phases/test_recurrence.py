"""Returns of the momentum curve: closed forms and constructed curves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

import shapephase as sp
from shapephase.errors import AccuracyNotReached, ShapeError
from shapephase.phases import momentum_returns
from support.independent import (
    BODIES,
    body_of,
    random_loop,
    random_rotation,
    wrapped,
)
from support.long_runs import full_but

Array = NDArray[np.float64]
Plane = Callable[[Array], tuple[Array, Array, Array, Array]]
SIZE = 1.3
INERTIA = np.array([[2.0, 0.2, -0.1], [0.2, 1.5, 0.3], [-0.1, 0.3, 1.1]])


def motion_along(plane: Plane, duration: float, breaks: tuple[float, ...] = ()) -> sp.Motion:
    """A motion whose Pi/|Pi| is (x, y, 1), normalised, for a plane curve x, y with rates: L_o is chosen to make it so.

    With omega = u' x u is u' = u x omega, and L_o = Pi - I omega.
    """

    def internal(times: Array) -> Array:
        x, y, dx, dy = plane(times)
        place, rate = np.stack([x, y, np.ones_like(x)], -1), np.stack([dx, dy, np.zeros_like(x)], -1)
        length = np.linalg.norm(place, axis=-1, keepdims=True)
        u = place / length
        u_rate = rate / length - u * np.sum(u * rate, axis=-1, keepdims=True) / length
        return SIZE * u - np.cross(u_rate, u) @ INERTIA

    x, y, _, _ = plane(np.zeros(1))
    start = np.array([x[0], y[0], 1.0])
    deformation = sp.prescribed(lambda t: np.broadcast_to(INERTIA, (len(t), 3, 3)), internal, duration, breaks)
    return sp.reconstruct(deformation, SIZE * start / np.linalg.norm(start), tolerance=1e-11)


def lissajous(a: int, b: int, alpha: float, beta: float) -> Plane:
    def curve(t: Array) -> tuple[Array, Array, Array, Array]:
        first, second = a * t + alpha, b * t + beta
        return 0.6 * np.cos(first), 0.6 * np.cos(second), -0.6 * a * np.sin(first), -0.6 * b * np.sin(second)

    return curve


def polhode(moments: tuple[float, float, float], size: float, a: float) -> Array:
    first, _, third = moments
    along = np.sqrt(1.0 - (first - a) * third / ((first - third) * a))
    return size * np.array([along, 0.0, np.sqrt(1.0 - along**2)])


# ---- Returns -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("moments", "size", "a", "period", "tolerance"),
    [
        ((3.0, 2.0, 1.0), 1.7, 1.3, 8.305738787261774, 1e-11),
        ((3.0, 2.0, 1.0), 1.7, 1.999, 36.61739254324993, 1e-9),
        ((3.0, 2.5, 1.2), 1.0, 1.25, 14.010844764544798, 1e-11),
    ],
)
def test_the_first_return_of_a_rigid_body_is_its_period(moments, size, a, period, tolerance):
    """theory.md section 6."""
    attitude = random_rotation(5)
    deformation = sp.rigid(np.diag(moments), 2.3 * period)
    motion = sp.reconstruct(deformation, attitude @ polhode(moments, size, a), attitude, tolerance=tolerance)
    found = momentum_returns(motion)
    assert len(found.times) == 2
    # At a distance from the error estimate: an error of the attitude is one of the time over the curve's speed.
    speed = np.linalg.norm(np.cross(motion.body_momentum(0.0) / size, motion.angular_velocity(0.0)))
    np.testing.assert_allclose(found.times, [period, 2.0 * period], rtol=0, atol=2.0 * tolerance / speed)
    assert found.gaps.max() < 2.0 * tolerance


def test_returns_are_the_minima_of_the_angle():
    """Of a known curve: roots of the closed form's derivative, bracketed on a fine grid."""
    plane = lissajous(3, 2, 0.4, 1.1)
    motion = motion_along(plane, 20.0)
    start = np.array([0.6 * np.cos(0.4), 0.6 * np.cos(1.1), 1.0])

    def nearing(t: ArrayLike) -> Array:
        x, y, dx, dy = plane(np.atleast_1d(t))
        place, rate = np.stack([x, y, np.ones_like(x)]), np.stack([dx, dy, np.zeros_like(x)])
        return (start @ rate) * np.sum(place * place, axis=0) - (start @ place) * np.sum(place * rate, axis=0)

    def angle(t: float) -> float:
        x, y, _, _ = plane(np.array([t]))
        place = np.array([x[0], y[0], 1.0])
        return float(np.arctan2(np.linalg.norm(np.cross(place, start)), place @ start))

    grid = np.linspace(1e-3, 20.0, 8000)
    slopes = nearing(grid)
    places = np.flatnonzero((slopes[:-1] > 0.0) & (slopes[1:] <= 0.0))
    times = np.array([brentq(lambda t: nearing(t)[0], grid[k], grid[k + 1], xtol=1e-14) for k in places])
    counts = []
    for gap in (0.01, 0.1, np.pi):
        expected = [t for t in times if angle(t) < gap]
        if nearing(20.0)[0] > 0.0 and angle(20.0) < gap:
            expected.append(20.0)
        found = momentum_returns(motion, gap)
        np.testing.assert_allclose(found.times, expected, rtol=0, atol=1e-10)
        np.testing.assert_allclose(found.gaps, [angle(t) for t in expected], rtol=0, atol=1e-10)
        counts.append(len(expected))
    assert 0 < counts[0] < counts[1] < counts[2]


def test_a_direction_still_nearing_its_start_at_the_end_counts():
    plane = lissajous(3, 2, 0.4, 1.1)
    found = momentum_returns(motion_along(plane, 2.0 * np.pi - 0.01))
    assert found.times[-1] == 2.0 * np.pi - 0.01
    assert 1e-3 < found.gaps[-1] < 0.1
    later = momentum_returns(motion_along(plane, 2.0 * np.pi + 0.01))
    assert later.times[-1] == pytest.approx(2.0 * np.pi, abs=1e-10)
    assert later.gaps[-1] < 1e-10
    assert not np.any(momentum_returns(motion_along(plane, 2.0 * np.pi - 0.01), 1e-3).gaps > 1e-3)


@pytest.mark.parametrize("name", full_but(["cat", "satellite"], "satellite"))
def test_a_closed_orbit_returns_at_its_end(name: str):
    body = body_of(name)
    deformation = sp.articulated(body, random_loop(1, body.n_shape).path)
    motion = sp.closed_orbits(deformation, BODIES[name])[0]
    found = momentum_returns(motion, 1e-6)
    assert found.times[-1] == pytest.approx(motion.duration, abs=1e-9)
    assert found.gaps[-1] < 1e-10


@pytest.mark.parametrize("seed", full_but([None, 1, 2], 1))
def test_a_steady_turn_does_not_leave_and_so_does_not_return(seed: int | None):
    axes = np.eye(3) if seed is None else random_rotation(seed)
    motion = sp.reconstruct(sp.rigid(axes @ np.diag([1.0, 2.0, 3.0]) @ axes.T, 40.0), 2.4 * axes[:, 2])
    assert len(momentum_returns(motion).times) == 0


def test_a_direction_that_has_come_back_and_rests_returns_once():
    def plane(t: Array) -> tuple[Array, Array, Array, Array]:
        s = np.where(t < 1.0, np.sin(np.pi * t) ** 2, 0.0)
        ds = np.where(t < 1.0, np.pi * np.sin(2.0 * np.pi * t), 0.0)
        return 0.4 * s + 0.1, 0.3 * s**2, 0.4 * ds, 0.6 * s * ds

    found = momentum_returns(motion_along(plane, 3.0, (1.0,)))
    assert len(found.times) == 1
    assert found.times[0] > 0.99
    assert found.gaps[0] < 1e-7


def test_other_engines_return_at_the_same_times():
    body = polhode((3.0, 2.0, 1.0), 1.7, 1.3)
    motion = sp.reconstruct(sp.rigid(np.diag([3.0, 2.0, 1.0]), 20.0), body, tolerance=1e-9, method="dop853")
    np.testing.assert_allclose(
        momentum_returns(motion).times, np.array([1.0, 2.0]) * 8.305738787261774, rtol=0, atol=1e-8
    )


def test_the_solid_angle_of_a_figure_of_eight_is_that_of_its_two_loops():
    """Between the two passages of a crossing the curve closes: both loops' areas make up the whole (theory.md D8)."""
    motion = motion_along(lissajous(1, 2, 0.3, 0.2), 2.0 * np.pi)
    whole = motion.solid_angle(2.0 * np.pi)
    # Both coordinates are the same where t - s = pi and the first is a cosine of a quarter turn.
    early, late = 0.5 * np.pi - 0.3, 1.5 * np.pi - 0.3
    assert np.linalg.norm(motion.body_momentum(early) - motion.body_momentum(late)) < 1e-9
    fine = np.linspace(early, late, 4001)
    u = motion.body_momentum(fine) / SIZE
    centre = np.array([0.0, 0.0, 1.0])
    a, b = u[:-1], u[1:]
    excess = np.sum(centre * np.cross(a, b), axis=1) / (1.0 + np.sum(a * b, axis=1) + a @ centre + b @ centre)
    inner = 2.0 * np.sum(np.arctan(excess))
    rest = np.concatenate([np.linspace(late, 2.0 * np.pi, 2001), np.linspace(0.0, early, 2001)])
    u = motion.body_momentum(rest) / SIZE
    a, b = u, np.roll(u, -1, axis=0)
    excess = np.sum(centre * np.cross(a, b), axis=1) / (1.0 + np.sum(a * b, axis=1) + a @ centre + b @ centre)
    outer = 2.0 * np.sum(np.arctan(excess))
    assert inner * outer < 0.0, "the two loops go round opposite ways"
    assert abs(wrapped(inner + outer - whole)) < 1e-5


def test_a_curve_of_too_many_pieces_is_refused(monkeypatch: pytest.MonkeyPatch):
    motion = motion_along(lissajous(3, 2, 0.4, 1.1), 2.0 * np.pi)
    monkeypatch.setattr("shapephase.phases.recurrence._LONGEST", 1e-3)
    monkeypatch.setattr("shapephase.phases.recurrence._MOST_PIECES", 1000)
    with pytest.raises(AccuracyNotReached, match="pieces"):
        momentum_returns(motion)


# ---- Arguments -----------------------------------------------------------------------------------------------------


def test_one_motion_with_momentum_is_needed():
    deformation = sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0)
    with pytest.raises(ShapeError, match="angular"):
        momentum_returns(sp.reconstruct(deformation, np.zeros(3)))
    with pytest.raises(ShapeError, match="batch"):
        momentum_returns(sp.reconstruct(deformation, np.eye(3)[:2]))


@pytest.mark.parametrize("gap", [0.0, -1.0, 4.0, np.nan, [0.1, 0.2], "wide"])
def test_a_gap_is_an_angle(gap):
    with pytest.raises(ShapeError, match="gap"):
        momentum_returns(sp.reconstruct(sp.rigid(np.eye(3), 1.0), [0.0, 0.0, 1.0]), gap)
