"""Flights that others have optimised with the equations of biorbd: reconstructed from their joint angles alone."""

from __future__ import annotations

import warnings

import biorbd
import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import IgnoredElementWarning
from support.places import ROBOTS

# What is computed is the same with and without machine code, which is quicker.
pytestmark = pytest.mark.usefixtures("kept_locale")
FLIGHTS = ROBOTS / "trampoline"
MODEL = FLIGHTS / "Model_JeCh_15DoFs.bioMod"
BASE = ("TransX", "TransY", "TransZ", "RotX", "RotY", "RotZ")


@pytest.fixture(scope="module")
def acrobat():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IgnoredElementWarning)
        return sp.load_body(MODEL)


def momenta(name, folder):
    """Angular momentum about the centre of mass by biorbd, at every node: (151, 3)."""
    bare = folder / "bare.bioMod"
    lines = MODEL.read_text(encoding="utf-8").splitlines()
    bare.write_text("\n".join(line for line in lines if "meshfile" not in line), encoding="utf-8")
    model = biorbd.Model(str(bare))
    with np.load(FLIGHTS / f"{name}.npz") as kept:
        pairs = list(zip(kept["Q"], kept["Qdot"], strict=True))
    return np.array([model.angularMomentum(q, v).to_array() for q, v in pairs])


def recorded(name, body, folder, every=1):
    with np.load(FLIGHTS / f"{name}.npz") as kept:
        rows = np.column_stack([kept["time"], kept["Q"]])[::every]
    names = ["time", *(f"Pelvis_{one}" for one in BASE), *body.joint_names]
    np.savetxt(folder / "flight.csv", rows, delimiter=",", header=",".join(names), comments="", fmt="%.17g")
    return sp.read_recorded_motion(folder / "flight.csv", body, degrees=False, flight="auto")


def fitted_to(body, motion):
    return sp.momentum_from_recording(sp.articulated(body, motion.path), motion.path.sample_times, motion.base_attitude)


def test_the_body_names_what_moves_its_base(acrobat):
    assert acrobat.base_angles == (("Pelvis_RotX", "Pelvis_RotY", "Pelvis_RotZ"), "xyz")
    assert acrobat.base_slides == ("Pelvis_TransX", "Pelvis_TransY", "Pelvis_TransZ")


@pytest.mark.parametrize("name", ["explicit", "free_floating"])
def test_a_published_somersault_is_reconstructed(name, acrobat, tmp_path):
    """Nearly two somersaults with their twist, from angles of joints 12 ms apart, between which the torque is constant.

    A spline through samples h apart is off by jumps of the joints' accelerations times h^2 / 32 at most, and the base
    by no more. The momentum is what biorbd computes from their own rates, to what these let it drift.
    """
    motion = recorded(name, acrobat, tmp_path)
    fitted = fitted_to(acrobat, motion)
    by_biorbd = momenta(name, tmp_path)
    drift = np.abs(by_biorbd - by_biorbd[0]).max()
    assert drift < 1e-3
    np.testing.assert_allclose(fitted.momentum, by_biorbd.mean(axis=0), rtol=0, atol=drift + 5e-4)
    with np.load(FLIGHTS / f"{name}.npz") as kept:
        step = kept["time"][1]
        jumps = np.abs(np.diff(kept["Qdot"][:, 6:], 2, axis=0)).max() / step
    assert fitted.angles.max() < jumps * step**2 / 32


def test_a_published_somersault_that_no_free_body_does(acrobat, tmp_path):
    """Dynamics imposed at the nodes only: half of the momentum comes and goes, by biorbd too, and no momentum fits."""
    by_biorbd = momenta("implicit", tmp_path)
    assert np.ptp(by_biorbd, axis=0).max() > 40.0
    motion = recorded("implicit", acrobat, tmp_path, every=5)
    with pytest.raises(sp.errors.AccuracyNotReached, match="flight"):
        fitted_to(acrobat, motion)
