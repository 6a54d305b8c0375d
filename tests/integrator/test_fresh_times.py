"""Interpolants that do not give the body raise, whatever their own estimates show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import shapephase as sp
from shapephase.integrator.panels.panel_sampling import PanelSampler
from shapephase.integrator.recorded import knot_sampling
from shapephase.integrator.sampling import LoopSampler
from support.places import DATA

MOMENTUM = [0.14171062249092722, 0.016446481221561917, -0.1400893070516673]


def recording(body: sp.Body) -> sp.ShapePath:
    return sp.read_shape_path(DATA / "smooth_recording.csv", body)


def box(_: sp.Body) -> sp.ShapePath:
    speeds = np.array([3.0, 5.0, 7.0])
    return sp.ShapePath.function(
        lambda t: (0.5 * np.sin(t[:, None] * speeds), 0.5 * speeds * np.cos(t[:, None] * speeds)), 20.0
    )


def loop(_: sp.Body) -> sp.ShapePath:
    return sp.ShapePath.fourier(np.zeros(3), np.zeros((3, 2)), [[0.5, 0.2], [0.1, 0.7], [0.3, 0.0]], 2.0)


def swapped(interpolant, first: int, second: int):
    series = np.array(interpolant.coefficients)
    series[[first, second]] = series[[second, first]]
    return replace(interpolant, coefficients=series)


@pytest.mark.parametrize("places", [(0, 1), (-2, -1), (0, -1)])
@pytest.mark.parametrize("momentum", [MOMENTUM, [0.0, 0.0, 0.0]])
@pytest.mark.parametrize(
    ("path_of", "sampler"),
    [(recording, knot_sampling.KnotSampler), (box, PanelSampler), (loop, LoopSampler)],
)
def test_two_series_that_change_places_raise(path_of, sampler, momentum, places, monkeypatch: pytest.MonkeyPatch):
    body = sp.load_body("cat_two_halves")
    deformation = sp.articulated(body, path_of(body))
    assert sp.reconstruct(deformation, momentum).error_estimate < 1e-9
    right = sampler.interpolant
    monkeypatch.setattr(sampler, "interpolant", lambda self: swapped(right(self), *places))
    with pytest.raises(sp.errors.AccuracyNotReached, match="method="):
        sp.reconstruct(sp.articulated(body, path_of(body)), momentum)


def test_panels_in_the_order_of_sampling_raise(monkeypatch: pytest.MonkeyPatch):
    """Without the sorting of panels, series stand beside edges that are not theirs."""
    body = sp.load_body("cat_two_halves")
    unsorted = knot_sampling._order_and_places
    monkeypatch.setattr(knot_sampling, "_order_and_places", lambda left: (unsorted(left)[0], np.arange(len(left))))
    with pytest.raises(sp.errors.AccuracyNotReached, match="method="):
        sp.reconstruct(sp.articulated(body, recording(body)), MOMENTUM)


def test_a_function_that_changes_from_call_to_call_is_refused():
    """The same times give other joint angles later: no motion can be stated."""
    body, calls = sp.load_body("cat_two_halves"), np.zeros(1)

    def drifting(t: np.ndarray) -> np.ndarray:
        calls[0] += 1.0
        size, speeds = 0.5 + 1e-4 * calls[0], np.array([3.0, 5.0, 7.0])
        return size * np.sin(t[:, None] * speeds), size * speeds * np.cos(t[:, None] * speeds)

    with pytest.raises(sp.errors.ShapePhaseError):
        sp.reconstruct(sp.articulated(body, sp.ShapePath.function(drifting, 2.0)), MOMENTUM)
