"""A recorded cycle that nearly closes becomes a loop, in two ways, and what that changes is told."""

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.errors import OpenPathError, ShapePhaseError, TrajectoryError, UnknownNameError
from shapephase.examples.scenarios import cat_righting
from shapephase.shape_space.files import read_recorded_motion, smoothed_path

DIVER = sp.load_body("diver")
T = np.arange(61) / 60.0
LOOP = np.stack([0.4 * np.sin(2 * np.pi * T) ** 2, 0.3 * np.cos(2 * np.pi * T)], axis=1)
GAP = np.array([0.02, -0.03])


def take(shapes, times=T, body=DIVER):
    import pandas

    return pandas.DataFrame(shapes, columns=body.joint_names, index=pandas.Index(times, name="time [s]"))


def test_a_drift_is_taken_off_as_it_came():
    found = read_recorded_motion(take(LOOP + T[:, None] * GAP), DIVER, close=0.05)
    truth = sp.ShapePath.spline(T, np.vstack([LOOP[:-1], LOOP[:1]]), True)
    t = np.linspace(0.0, 1.0, 201)
    np.testing.assert_allclose(found.path.shape(t), truth.shape(t), rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(found.path.rate(t), truth.rate(t), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found.closing.gap, GAP, rtol=0.0, atol=1e-15)
    assert found.closing.by == "drift"
    assert found.record["closing"]["gap"] == pytest.approx(dict(zip(DIVER.joint_names, GAP, strict=True)))
    np.testing.assert_allclose(found.residual, np.abs(GAP) * np.sqrt(np.mean(T**2)), rtol=1e-6)
    assert sp.holonomy(DIVER, found.path).shape == (3, 3)


def test_noise_is_closed_by_a_periodic_smoother():
    rng = np.random.default_rng(5)
    samples = LOOP + np.radians(0.3) * rng.normal(size=LOOP.shape)
    noise = np.full(2, np.radians(0.3))
    found = read_recorded_motion(take(samples), DIVER, smooth=np.radians(0.3), close="3deg")
    expected, _ = smoothed_path(T, samples, noise, True, DIVER.joint_names)
    t = np.linspace(0.0, 1.0, 101)
    np.testing.assert_allclose(found.path.shape(t), expected.shape(t), rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(found.path.rate(0.0), found.path.rate(1.0), rtol=0.0, atol=1e-10)
    assert found.closing.by == "smooth"
    apart = read_recorded_motion(take(samples), DIVER, smooth=np.radians(0.3))
    with pytest.raises(OpenPathError):
        sp.holonomy(DIVER, apart.path)


@pytest.mark.parametrize("by", ["drift", "smooth"])
def test_what_closing_does_to_the_holonomy_is_told(by):
    body = sp.load_body("cat")
    righting = cat_righting().matched(body.joint_names, "cat")
    times = np.linspace(0.0, righting.duration, 61)
    drift = 0.01 * np.random.default_rng(6).uniform(-1.0, 1.0, body.n_shape)
    lower, upper = body.joint_limits.T
    reached = righting.shape(times)
    drift[(reached + np.abs(drift) > upper).any(axis=0) | (reached - np.abs(drift) < lower).any(axis=0)] = 0.0
    samples = reached + (times / righting.duration)[:, None] * drift
    moving = np.std(reached, axis=0) > 0.05
    samples[:, ~moving] = reached[:, ~moving]
    levels = {name: 0.005 for name, moves in zip(body.joint_names, moving, strict=True) if moves}
    noise = {"smooth": levels} if by == "smooth" else {}
    found = read_recorded_motion(take(samples, times, body), body, close=0.02, close_by=by, **noise)
    lift = sp.horizontal_lift(body, found.closing.opened).end
    loop = sp.holonomy(body, found.path)
    np.testing.assert_allclose(lift @ so3.exp(found.closing.holonomy_change), loop, rtol=0.0, atol=1e-12)
    # The connection is of order one: a gap of 0.01 in each of 23 joints turns the base by a few hundredths at most.
    assert 1e-6 < np.linalg.norm(found.closing.holonomy_change) < 0.1
    if by == "drift":
        # The righting itself is found again to what 61 samples resolve.
        assert so3.angle(so3.transpose(sp.holonomy(body, righting)) @ loop) < 2e-3


def test_a_wheel_closes_after_whole_turns():
    body = sp.load_body("satellite")
    wheel = int(np.flatnonzero(body.continuous)[0])
    shapes = np.tile(0.2, (61, body.n_shape)) + 0.1 * np.sin(2 * np.pi * T)[:, None]
    shapes[:, wheel] = 2.0 * np.pi * T + 0.1 * np.sin(2 * np.pi * T) + 0.01 * T
    for by in ("drift", "smooth"):
        noise = {"smooth": 0.003} if by == "smooth" else {}
        found = read_recorded_motion(take(shapes, body=body), body, close=0.02, close_by=by, degrees=False, **noise)
        assert found.path.gap[wheel] == pytest.approx(2.0 * np.pi, abs=1e-13)
        assert found.closing.gap[wheel] == pytest.approx(0.01, abs=1e-13)
        assert sp.articulated(body, found.path).closure is not None
        np.testing.assert_allclose(found.path.rate(0.0), found.path.rate(1.0), rtol=0.0, atol=1e-8)


def test_what_cannot_be_closed_is_named():
    source = take(LOOP + T[:, None] * GAP)
    right = DIVER.joint_names[1]
    for options, error, words in (
        (
            {"close": 0.025},
            TrajectoryError,
            rf"joint {right} ends -1\.719 deg from its start, and .* 0\.025 rad",
        ),
        ({"close": "1deg"}, TrajectoryError, rf"joint {right} ends .*--flight.*--close"),
        ({"close": "5mm"}, TrajectoryError, "gaps up to 0 rad"),
        ({"close": True}, TrajectoryError, "how large a gap"),
        ({"close": "much"}, TrajectoryError, "close: a number is needed"),
        ({"close": -0.1}, TrajectoryError, "close: zero or more"),
        ({"close": "1deg,2deg"}, TrajectoryError, "two amounts of one kind"),
        ({"close": 0.05, "close_by": "glue"}, UnknownNameError, "smooth, drift"),
        ({"close_by": "drift"}, TrajectoryError, "Give close"),
        ({"close": 0.05, "close_by": "smooth"}, TrajectoryError, "no noise is given"),
        ({"close": 0.05, "close_by": "smooth", "smooth": 0.001}, TrajectoryError, "close it by drift"),
    ):
        with pytest.raises(ShapePhaseError, match=words) as caught:
            read_recorded_motion(source, DIVER, **options)
        assert type(caught.value) is error


def test_a_loop_stays_what_it_is():
    closed = np.vstack([LOOP[:-1], LOOP[:1]])
    plain = read_recorded_motion(take(closed), DIVER)
    found = read_recorded_motion(take(closed), DIVER, close=0.01)
    t = np.linspace(0.0, 1.0, 57)
    np.testing.assert_allclose(found.path.shape(t), plain.path.shape(t), rtol=0.0, atol=1e-15)
    assert plain.closing is None
    assert plain.record["closing"] is None
