"""Samples that cannot be as dense as a further round wants them: what there was before is whole, and may do."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.cases import as_function, numbered_case

import shapephase as sp
from shapephase.errors import AccuracyNotReached
from shapephase.integrator._refinement import Refinement
from shapephase.integrator.integrate import Integration
from shapephase.integrator.panels.panel_sampling import PanelSampler
from shapephase.integrator.recorded import knot_sampling
from support.both_engines import both


def box() -> sp.Deformation:
    case = numbered_case(2)
    return sp.articulated(case.body, as_function(case.path))


def recording() -> sp.Deformation:
    case = numbered_case(2)
    times = np.linspace(0.0, case.path.duration, 201)
    return sp.articulated(case.body, sp.ShapePath.spline(times, case.path.shape(times), periodic=True))


def cannot_be_finer(*_: object) -> None:
    raise AccuracyNotReached("the shape motion is rough")


@pytest.mark.usefixtures("fast")
@pytest.mark.parametrize("made", [box, recording])
def test_what_there_was_before_is_whole(made, monkeypatch: pytest.MonkeyPatch):
    """Panels are not made finer for this; then samples stay as they are, beside the deformation itself."""
    momentum = np.array([[0.1, 0.2, 0.05]])

    def run() -> tuple[float, float]:
        deformation = made()
        sampler = deformation.sampler()
        sampler.refine(0.25, 1e-6)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(PanelSampler, "_check_halves", cannot_be_finer)
            patch.setattr(knot_sampling, "_LEAST_WIDTH", 10.0)
            patch.setattr(knot_sampling, "_HIGHEST_DEGREE", 0)
            refinement = Refinement(1e-13, 1.0, 2.0)
            attempt = Integration(sampler, momentum, 1e-6, ceiling=0.25, refinement=refinement).attempt()
            with pytest.raises(AccuracyNotReached, match="rough"):
                Integration(sampler, momentum, 1e-13, ceiling=0.25).attempt()
        times = np.linspace(0.01, 0.99, 300) * deformation.duration
        inverse, _ = attempt.rotation.interpolant.inverse_and_drift(times)
        gap = np.abs(inverse @ deformation.inertia(times) - np.eye(3)).max()
        return float(gap), float(attempt.errors.estimate[0])

    for gap, estimate in both(monkeypatch, run):
        assert gap < 1e-4
        assert estimate < 1e-6
