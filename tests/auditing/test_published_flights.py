"""Public trajectories with a flight: three somersaults that others have optimised (robots/trampoline)."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import IgnoredElementWarning
from support.places import ROBOTS

pytestmark = pytest.mark.usefixtures("kept_locale")
FLIGHTS = ROBOTS / "trampoline"


@pytest.fixture(scope="module")
def acrobat():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IgnoredElementWarning)
        return sp.load_body(FLIGHTS / "Model_JeCh_15DoFs.bioMod")


def audited(body: sp.Body, name: str) -> sp.auditing.Audit:
    return sp.audit(body, sp.read_trajectory(FLIGHTS / f"{name}.npz", body))


@pytest.mark.parametrize("name", ["explicit", "free_floating"])
def test_steps_of_fourth_order_are_right_in_flight(name: str, acrobat: sp.Body):
    """The shooting of their authors took Runge and Kutta's steps of fourth order with dynamics that hold everywhere."""
    found = audited(acrobat, name)
    run = found.runs[0]
    assert found.right, found.table()
    assert run.momentum_drift < 1e-5 * run.momentum_scale
    assert run.fall_off is not None
    assert run.fall_off < 1e-6
    assert run.attitude_error is not None
    # Splines through joints 12 ms apart, as `test_published_flights` of the bodies bounds them.
    assert run.attitude_error.max() < 2e-4


@pytest.mark.full
def test_dynamics_at_the_nodes_alone_are_no_flight(acrobat: sp.Body):
    """`test_published_flights` of the bodies has biorbd's own momentum of it, half of which comes and goes."""
    found = audited(acrobat, "implicit")
    run = found.runs[0]
    assert not found.right
    assert run.momentum_drift > 0.1 * run.momentum_scale
    assert np.ptp(run.momentum, axis=0).max() > 40.0
