"""Interpolants that do not give the body raise, whatever their own estimates show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import shapephase as sp
from shapephase.arrays import Integers
from shapephase.integrator.samples import Samples
from shapephase.integrator.sampling import _Sampling
from support.independent import apart, pinocchio_motion
from support.places import DATA

MOMENTUM = [0.14171062249092722, 0.016446481221561917, -0.1400893070516673]
BODY = "cat_two_halves"


def recording() -> sp.ShapePath:
    return sp.read_shape_path(DATA / "smooth_recording.csv", sp.load_body(BODY))


def box() -> sp.ShapePath:
    speeds = np.array([3.0, 5.0, 7.0])
    return sp.ShapePath.function(
        lambda t: (0.5 * np.sin(t[:, None] * speeds), 0.5 * speeds * np.cos(t[:, None] * speeds)), 20.0
    )


def loop() -> sp.ShapePath:
    return sp.ShapePath.fourier(np.zeros(3), np.zeros((3, 6)), [[0.5, 0.2] * 3, [0.1, 0.7] * 3, [0.3, 0.0] * 3], 2.0)


def reordered(monkeypatch: pytest.MonkeyPatch, order_of: Callable[[Samples], Integers]) -> None:
    """Samplers put their series beside edges that are not theirs: at each place that of another."""
    whole = _Sampling._whole

    def wrong(self: _Sampling, *given):
        samples = whole(self, *given)
        series = samples.interpolant.coefficients[order_of(samples)]
        return replace(samples, interpolant=replace(samples.interpolant, coefficients=series))

    monkeypatch.setattr(_Sampling, "_whole", wrong)


def swapped(first: int, second: int):
    def order(samples: Samples) -> Integers:
        places = np.arange(len(samples.panels.degrees))
        places[[first, second]] = places[[second, first]]
        return places

    return order


@pytest.mark.parametrize("places", [(0, 1), (-2, -1), (0, -1)])
@pytest.mark.parametrize("momentum", [MOMENTUM, [0.0, 0.0, 0.0]])
@pytest.mark.parametrize("path_of", [recording, box, loop])
def test_two_series_that_change_places_raise(path_of, momentum, places, monkeypatch: pytest.MonkeyPatch):
    body = sp.load_body(BODY)
    if places == (0, 1):
        right = sp.reconstruct(sp.articulated(body, path_of()), momentum)
        assert right.error_estimate < 1e-9
        assert len(right.interpolant.coefficients) > 1
    reordered(monkeypatch, swapped(*places))
    with pytest.raises(sp.errors.AccuracyNotReached, match="method="):
        sp.reconstruct(sp.articulated(body, path_of()), momentum)


@pytest.mark.parametrize(
    "order_of",
    [
        lambda samples: np.argsort(samples.panels.degrees, kind="stable"),  # in which they are done
        lambda samples: np.arange(len(samples.panels.degrees))[::-1],
        lambda samples: np.roll(np.arange(len(samples.panels.degrees)), 1),
    ],
)
def test_panels_in_another_order_raise(order_of, monkeypatch: pytest.MonkeyPatch):
    """Long and short intervals between knots, whose panels have different degrees."""
    times = np.array([0.0, 0.1, 0.15, 0.7, 0.8, 1.5, 1.6, 2.0])
    path = sp.ShapePath.spline(times, np.random.default_rng(1).uniform(-0.4, 0.4, (8, 3)))
    deformation = sp.articulated(sp.load_body(BODY), path)
    degrees = deformation.sampler().samples(0.2, 1e-6).panels.degrees
    assert np.any(np.diff(degrees) < 0)
    reordered(monkeypatch, order_of)
    with pytest.raises(sp.errors.AccuracyNotReached, match="method="):
        sp.reconstruct(deformation, MOMENTUM, tolerance=1e-6)


def test_panels_sampled_in_another_order_give_the_attitude():
    """The panels of these 80 rows end in several groups, some of them sampled before their neighbours on the left."""
    path, body = recording(), sp.load_body(BODY)
    times = np.linspace(0.0, path.duration, 9)[1:]
    truth = pinocchio_motion(BODY, body.joint_names, path, MOMENTUM, None, times, path.breaks[1:-1])
    motion = sp.reconstruct(sp.articulated(body, path), MOMENTUM)
    # SciPy's steps at rtol 1e-12, some twenty between two of 80 knots.
    assert apart(motion.attitude(times), truth.attitude) < 1e-10


def test_a_function_that_changes_from_call_to_call_is_refused():
    """The same times give other joint angles later: no motion can be stated."""
    body, calls = sp.load_body(BODY), np.zeros(1)

    def drifting(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        calls[0] += 1.0
        size, speeds = 0.5 + 1e-4 * calls[0], np.array([3.0, 5.0, 7.0])
        return size * np.sin(t[:, None] * speeds), size * speeds * np.cos(t[:, None] * speeds)

    with pytest.raises(sp.errors.ShapePhaseError):
        sp.reconstruct(sp.articulated(body, sp.ShapePath.function(drifting, 2.0)), MOMENTUM)
