"""Motions under a torque that are written to a file and read again."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import InputFileNotFoundError, ResultFileError

_TIMES = np.linspace(0.0, 1.0, 41)


def stir(state: sp.TorqueState) -> list[float]:
    """Changes with everything there is, and jumps."""
    jump = 0.001 * (state.time < 0.4)
    return [0.002 * np.cos(3.0 * state.time) * state.shape[0], 0.001 + jump, -0.01 * state.rate[2]]


@pytest.fixture(scope="module", params=["body", "space"])
def motion(request) -> sp.ForcedMotion:
    deformation = sp.articulated(sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 1.0))
    law = sp.ExternalTorque(stir, axes=request.param, breaks=[0.4])
    return sp.reconstruct(deformation, [0.004, -0.002, 0.005], torque=law)


@pytest.fixture
def loaded(motion, tmp_path) -> sp.ForcedMotion:
    motion.save(tmp_path / "motion.npz")
    return sp.ForcedMotion.load(tmp_path / "motion.npz")


def test_a_loaded_motion_is_the_saved_one(motion: sp.ForcedMotion, loaded: sp.ForcedMotion):
    np.testing.assert_allclose(loaded.attitude(_TIMES), motion.attitude(_TIMES), rtol=0, atol=1e-12)
    for name in ("momentum", "angular_velocity", "torque", "work", "body_momentum"):
        known = getattr(motion, name)(_TIMES)
        np.testing.assert_allclose(getattr(loaded, name)(_TIMES), known, rtol=0, atol=1e-9 * np.abs(known).max())
    assert loaded.error_estimate == motion.error_estimate
    assert loaded.momentum_error == motion.momentum_error
    np.testing.assert_array_equal(loaded.error_in_time(_TIMES), motion.error_in_time(_TIMES))
    assert (loaded.tolerance, loaded.evaluations) == (motion.tolerance, motion.evaluations)
    np.testing.assert_array_equal(loaded.breaks, motion.breaks)
    assert loaded.torque_law.axes == motion.torque_law.axes
    assert loaded.deformation.label == motion.deformation.label


def test_a_loaded_motion_is_split_alike_and_saved_again(motion: sp.ForcedMotion, loaded: sp.ForcedMotion, tmp_path):
    first, second = sp.split(motion), sp.split(loaded)
    assert second.phase == pytest.approx(first.phase, abs=1e-8)
    np.testing.assert_allclose(second.holonomy, first.holonomy, rtol=0, atol=1e-8)
    loaded.save(tmp_path / "again.npz")
    again = sp.ForcedMotion.load(tmp_path / "again.npz")
    np.testing.assert_allclose(again.attitude(_TIMES), loaded.attitude(_TIMES), rtol=0, atol=1e-12)


def test_a_loaded_torque_gives_the_same_motion_once_more(motion: sp.ForcedMotion, loaded: sp.ForcedMotion):
    anew = sp.reconstruct(motion.deformation, motion.initial_momentum, torque=loaded.torque_law)
    assert sp.so3.angle(anew.final_attitude.T @ motion.final_attitude) < 1e-8


def test_files_of_both_kinds_name_their_readers(motion: sp.ForcedMotion, tmp_path):
    motion.save(tmp_path / "forced.npz")
    sp.reconstruct(motion.deformation, np.zeros(3)).save(tmp_path / "free.npz")
    with pytest.raises(ResultFileError, match=r"ForcedMotion\.load"):
        sp.load_motion(tmp_path / "forced.npz")
    with pytest.raises(ResultFileError, match="load_motion"):
        sp.ForcedMotion.load(tmp_path / "free.npz")
    with pytest.raises(InputFileNotFoundError):
        sp.ForcedMotion.load(tmp_path / "none.npz")


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("step_states", lambda a: 1.01 * a),
        ("step_times", lambda a: a[::-1]),
        ("step_torques", None),
        ("centre", None),
    ],
)
def test_arrays_that_no_motion_has(motion: sp.ForcedMotion, tmp_path, name: str, change):
    motion.save(tmp_path / "motion.npz")
    with np.load(tmp_path / "motion.npz") as stored:
        arrays = dict(stored)
    changed = {} if change is None else {name: change(arrays[name])}
    np.savez(tmp_path / "odd.npz", **{key: value for key, value in arrays.items() if key != name} | changed)
    with pytest.raises(ResultFileError, match=r"odd\.npz"):
        sp.ForcedMotion.load(tmp_path / "odd.npz")
