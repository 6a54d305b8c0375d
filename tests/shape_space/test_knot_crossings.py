"""Motions through the knots of couplings: attitudes against every joint driven by hand, and the times of crossings."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.body import Coupling
from shapephase.errors import ShapeError
from support.coupled_bodies import KNOTS, LEG, TURN, TURNS, bounded, by_hand, couplings
from support.long_runs import full_but

MOMENTUM = [0.3, -0.1, 0.5]
LINE = Coupling.piecewise_linear("knee", KNOTS, TURNS)


def line(q):
    """Straight between the points and on beyond them, by NumPy: values and slopes."""
    slopes = np.diff(TURNS) / np.diff(KNOTS)
    piece = np.clip(np.searchsorted(KNOTS, q, side="right") - 1, 0, len(slopes) - 1)
    return TURNS[piece] + slopes[piece] * (q - KNOTS[piece]), slopes[piece]


TURNING = {
    "smooth": (TURN["smooth"][0], bounded(TURN["smooth"][1], None)),
    "spline": (TURN["spline"][0], bounded(TURN["spline"][1], KNOTS)),
    "line": (LINE, line),
}


def paths():
    """Of every kind, hip and knee; through all knots and beyond them."""
    wave = sp.ShapePath.fourier([0.1, 0.0], [[0.3, 0.1], [0.2, 0.1]], [[0.2, -0.1], [0.7, -0.2]], 2.0)
    few, many = np.linspace(0.0, 2.0, 9), np.linspace(0.0, 2.0, 121)
    there = np.array([[0.0, 0.0], [0.4, 0.8], [-0.3, -0.7], [0.1, 0.15]])
    return {
        "a Fourier loop": wave,
        "a loop repeated": wave.repeated(2),
        "a spline": sp.ShapePath.spline(few, wave.shape(few)),
        "a recording": sp.ShapePath.spline(many, wave.shape(many)),
        "a recording backwards": sp.ShapePath.spline(many, wave.shape(many)).reversed().stretched(1.3),
        "waypoints": sp.ShapePath.waypoints([0.0, 0.5, 1.2, 2.0], there),
        "a function": sp.ShapePath.function(wave.curve, 2.0),
        "one after the other": sp.ShapePath.spline(few, wave.shape(few)).then(wave),
    }  # fmt: skip


PATHS = paths()


@pytest.mark.parametrize("turn", full_but(TURNING, "spline", "line"))
@pytest.mark.parametrize("kind", PATHS)
def test_motions_are_those_of_joints_driven_by_hand(kind, turn, load_urdf):
    """Breaks of the driven motion are where a knee that is looked at at many times goes through knots.

    Whatever the knots are, either motion keeps its estimate.
    """
    coupling, function = TURNING[turn]
    free, path = load_urdf(LEG), PATHS[kind]
    body = free.with_couplings(couplings(coupling))
    joints = by_hand(function, free.joint_names)
    breaks = np.union1d(path.breaks, looked_for(path))
    driven = sp.ShapePath.function(
        lambda t: joints(*path.curve(t)), path.duration, breaks[1:-1], joint_names=free.joint_names
    )
    found = sp.reconstruct(sp.articulated(body, path), MOMENTUM, tolerance=1e-10)
    expected = sp.reconstruct(sp.articulated(free, driven), MOMENTUM, tolerance=1e-10)
    apart = sp.so3.angle(found.final_attitude.T @ expected.final_attitude)
    assert apart < found.error_estimate + expected.error_estimate
    assert apart < 1e-11


def looked_for(path):
    """Times at which the knee goes through a knot, from a sign that changes, and bisection: (C,)."""
    times = np.linspace(0.0, path.duration, 4001)
    found = []
    for knot in KNOTS:
        above = path.shape(times)[:, 1] > knot
        for k in np.flatnonzero(above[1:] != above[:-1]):
            low, high = times[k], times[k + 1]
            for _ in range(60):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if (path.shape(middle)[1] > knot) == above[k] else (low, middle)
            found.append(0.5 * (low + high))
    return np.array(found)


@pytest.mark.parametrize("kind", PATHS)
def test_crossings_are_found(kind, load_urdf):
    """As many as signs that change, at the same times."""
    body = load_urdf(LEG).with_couplings(couplings(TURN["spline"][0]))
    path = PATHS[kind]
    breaks, expected = sp.horizontal_lift(body, path, 1e-4).path.breaks, looked_for(path)
    apart = np.abs(breaks[:, None] - expected).min(axis=0)
    assert apart.max() < 1e-13 * path.duration
    known = np.union1d(path.breaks, path.duration / path.loops * np.arange(path.loops + 1))
    assert len(breaks) == len(known) + len(expected)


def test_a_knot_that_is_only_touched(load_urdf):
    """A double zero: found or not, the motion is the same."""
    free = load_urdf(LEG)
    body = free.with_couplings(couplings(TURN["spline"][0]))
    top = KNOTS[3]
    path = sp.ShapePath.fourier([0.0, top - 0.2], [[0.3], [0.2]], [[0.2], [0.0]], 1.0)
    joints = by_hand(TURNING["spline"][1], free.joint_names)
    breaks = looked_for(path)
    driven = sp.ShapePath.function(
        lambda t: joints(*path.curve(t)), 1.0, breaks[(breaks > 1e-6) & (breaks < 1.0 - 1e-6)],
        joint_names=free.joint_names,
    )  # fmt: skip
    found, expected = (
        sp.reconstruct(sp.articulated(*pair), MOMENTUM, tolerance=1e-10).final_attitude
        for pair in ((body, path), (free, driven))
    )
    assert sp.so3.angle(found.T @ expected) < 1e-10


def test_a_slow_joint_through_a_kink(load_urdf):
    """Rounding hides on which side it is; the line's slope jumps there."""
    free = load_urdf(LEG)
    body = free.with_couplings(couplings(LINE))
    for span in (1e-3, 1e-6):
        path = sp.ShapePath.waypoints([0.0, 1.0], [[0.0, KNOTS[3] - span], [0.4, KNOTS[3] + 0.6 * span]])
        joints = by_hand(line, free.joint_names)
        driven = sp.ShapePath.function(
            lambda t, path=path, joints=joints: joints(*path.curve(t)), 1.0, looked_for(path),
            joint_names=free.joint_names,
        )  # fmt: skip
        found, expected = (
            sp.reconstruct(sp.articulated(*pair), MOMENTUM, tolerance=1e-11).final_attitude
            for pair in ((body, path), (free, driven))
        )
        assert sp.so3.angle(found.T @ expected) < 1e-12


def test_a_joint_that_rests_at_a_knot_crosses_none(load_urdf):
    body = load_urdf(LEG).with_couplings(couplings(LINE))
    path = sp.ShapePath.fourier([0.1, KNOTS[1]], [[0.3], [0.0]], [[0.2], [0.0]], 1.0)
    assert sp.horizontal_lift(body, path, 1e-4).path.breaks.tolist() == [0.0, 1.0]


def test_a_loop_that_winds_is_no_loop_of_what_follows(load_urdf):
    """The knee goes on by whole turns; what follows it is elsewhere in the second loop."""
    free = load_urdf(LEG)
    body = free.with_couplings({"knee_slide": Coupling.polynomial("knee", [0.0, 0.0, 0.002])})
    once = sp.ShapePath.spline(
        [0.0, 0.4, 1.0], [[0.0] * 5, [0.1, 2.0, 0.0, 0.1, 0.0], [0.0, 2.0 * np.pi, 0.0, 0.0, 0.0]]
    )
    names = tuple(name for name in free.joint_names if name != "knee_slide")
    order = [names.index(name) for name in ("hip", "knee", "patella_turn", "patella_slide", "shoulder")]
    columns = np.argsort(order)
    path = sp.ShapePath.spline(once.breaks, once.shape(once.breaks)[:, columns], joint_names=body.joint_names).repeated(
        2
    )
    knee = body.joint_index("knee")

    def all_joints(t):
        shapes, rates = path.curve(t)
        slide, speed = 0.002 * shapes[:, knee] ** 2, 0.004 * shapes[:, knee] * rates[:, knee]
        place = free.joint_index("knee_slide")
        return np.insert(shapes, place, slide, axis=1), np.insert(rates, place, speed, axis=1)

    driven = sp.ShapePath.function(all_joints, 2.0, path.breaks[1:-1], joint_names=free.joint_names)
    found, expected = (
        sp.reconstruct(sp.articulated(*pair), MOMENTUM, tolerance=1e-10).final_attitude
        for pair in ((body, path), (free, driven))
    )
    assert sp.so3.angle(found.T @ expected) < 1e-10


def test_lift_holonomy_and_their_derivative_go_through_knots(load_urdf):
    """The derivative by a parameter against differences of order four."""
    body = load_urdf(LEG).with_couplings(couplings(LINE))

    def loop(scale):
        return sp.ShapePath.fourier(
            [0.1, 0.05], scale * np.array([[0.3], [0.2]]), scale * np.array([[0.2], [0.6]]), 2.0
        )

    path = loop(1.0)
    mean = np.array([0.1, 0.05])
    turn, slope = sp.holonomy_derivative(body, path, lambda t: (path.shape(t) - mean)[:, None], 1e-11)
    step, found = 1e-3, np.zeros(3)
    for steps, weight in ((1, 2.0 / 3.0), (2, -1.0 / 12.0)):
        for side in (1.0, -1.0):
            there = sp.holonomy(body, loop(1.0 + side * steps * step), 1e-12)
            found += side * weight / step * sp.so3.log(there @ turn.T)
    np.testing.assert_allclose(slope[0], found, rtol=0, atol=1e-8)
    np.testing.assert_allclose(sp.horizontal_lift(body, path, 1e-12).end, turn, rtol=0, atol=1e-11)


def test_what_needs_smooth_couplings_says_so(load_urdf):
    free = load_urdf(LEG)
    rough, spline = (free.with_couplings(couplings(TURNING[name][0])) for name in ("line", "spline"))
    path = PATHS["a spline"]
    with pytest.raises(ShapeError, match="'knee_slide'"):
        sp.stokes_holonomy(spline, PATHS["a Fourier loop"])
    with pytest.raises(ShapeError, match="extremals"):
        sp.optimal_control.wong_residual(spline, path)
    with pytest.raises(ShapeError, match="'patella_turn'"):
        sp.plan_reorientation(rough, sp.so3.exp([0.1, 0.0, 0.0]))
