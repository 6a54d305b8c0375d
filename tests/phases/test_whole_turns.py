"""Whole turns beside the angle of a rotation, of a dive that was solved for them and of bodies that spin."""

from __future__ import annotations

import json

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from shapephase.errors import ChartPoleError

DIVE = sp.examples.full_dive()


def test_a_dive_is_counted_in_somersaults_and_twists():
    """The dive that lands: one and a half somersaults and one twist exactly, which leave a half turn as angle."""
    motion = sp.reconstruct(DIVE.deformation, DIVE.momentum)
    parts = sp.split(motion)
    found = sp.turn_counts(motion, parts)
    numbers = found.to_dict()
    assert abs(numbers["somersaults"] - 1.5) < 1e-9
    assert abs(abs(numbers["twists"]) - 1.0) < 1e-9
    assert np.degrees(numbers["largest_tilt_rad"]) < 12.0
    assert abs(np.degrees(sp.so3.angle(parts.total_rotation)) - 180.0) < 1e-6
    assert found.about_momentum == pytest.approx(float(parts.montgomery_phase) / (2.0 * np.pi))
    said = str(found)
    for words in (
        "does not count whole turns",
        "1.5000 somersaults",
        "horizontal part of the momentum",
        "least inertia",
    ):
        assert words in said
    assert numbers["somersault_axes"]["up"]["by"] == "z, by default"


def test_a_rigid_body_is_counted_about_its_momentum_only():
    """Spin about a principal axis: its rate times its duration; nobody's sides are known."""
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.0, 0.0, 3.0 * 2.75 * np.pi])
    found = sp.turn_counts(motion, sp.split(motion))
    assert abs(found.about_momentum - 5.5) < 1e-9
    assert found.somersaults is None
    assert "somersaults" not in str(found)
    still = sp.reconstruct(sp.rigid(np.eye(3), 1.0), np.zeros(3))
    assert str(sp.turn_counts(still, sp.split(still))) == ""


@pytest.mark.full
def test_the_command_says_turns_beside_the_angle(capsys):
    command = ["split", "diver", "diver_twist", "--momentum", "0", "61.558831", "0"]
    main(command)
    table = " ".join(capsys.readouterr().out.split())
    assert "The angle of a rotation does not count whole turns" in table
    assert "1.5000 somersaults and -1.0000 twists" in table
    main([*command, "--json"])
    data = json.loads(capsys.readouterr().out)
    assert data["somersaults"] == pytest.approx(1.5, abs=1e-4)
    assert "closing_tilt" in data
    assert "tilt" not in data


def test_rates_are_slopes_and_errors_grow_towards_the_pole():
    motion = sp.reconstruct(DIVE.deformation, DIVE.momentum)
    times, step = np.linspace(0.05, 0.95, 9) * motion.duration, 1e-4
    ahead, behind = (motion.somersault_tilt_twist(times + sign * step) for sign in (1.0, -1.0))
    for rate, later, earlier in zip(motion.somersault_rates(times), ahead, behind, strict=True):
        np.testing.assert_allclose(rate, (later - earlier) / (2.0 * step), rtol=0, atol=2e-6)
    tilt = motion.somersault_tilt_twist(times)[1]
    outer, middle, twisting = motion.somersault_errors(times)
    np.testing.assert_allclose(middle, float(motion.error_estimate))
    np.testing.assert_allclose(outer * np.cos(tilt), middle, rtol=1e-12)
    np.testing.assert_array_equal(twisting, outer)


def test_an_athlete_has_halves_rates_and_the_time_of_the_tilt():
    motion = sp.reconstruct(DIVE.deformation, DIVE.momentum)
    found = sp.phases.athlete_turns(motion)
    assert found.halves == (1.5, -1.0)
    times = np.linspace(0.0, motion.duration, 4001)
    _, tilt, _ = motion.somersault_tilt_twist(times)
    np.testing.assert_allclose(found.largest_tilt, np.abs(tilt).max(), rtol=0, atol=1e-6)
    assert abs(found.tilt_time - times[np.argmax(np.abs(tilt))]) < 2e-3
    somersault, _, twist = motion.somersault_rates(times)
    np.testing.assert_allclose(
        (found.somersault_rate, found.twist_rate), (np.abs(somersault).max(), np.abs(twist).max()), rtol=1e-3
    )
    data = sp.turn_counts(motion, sp.split(motion)).to_dict()
    assert (data["somersaults_to_halves"], data["largest_tilt_time_s"]) == (1.5, found.tilt_time)
    assert 0.0 < found.error < 1e-9


def test_a_pole_has_no_rates():
    """Turned over its frontal axis: at a quarter turn somersault and twist are about one axis."""
    spin = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), [0.5 * np.pi, 0.0, 0.0])
    axes = {"lateral": "y", "longitudinal": "z", "somersault": "y"}
    with pytest.raises(ChartPoleError, match="90 degrees"):
        spin.somersault_rates(1.0, **axes)
    turns = sp.phases.athlete_turns(spin, spin.athlete_axes(**axes))
    assert turns.somersault_rate is None
    np.testing.assert_allclose(turns.largest_tilt, 0.5 * np.pi, rtol=0, atol=1e-9)


def test_a_motion_in_a_plane_has_a_rotation_number():
    """Without momentum, too: a rotor that carries 3 kg m^2/s turns a body of 4 kg m^2 backwards by 0.75 rad/s."""
    spin = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.0, 0.0, 3.0 * 2.75 * np.pi])
    found = sp.turn_counts(spin, sp.split(spin))
    np.testing.assert_allclose(found.rotation_number, 5.5, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.rotation_axis, [0.0, 0.0, 1.0], rtol=0, atol=1e-12)
    beanie = sp.prescribed(
        lambda t: np.broadcast_to(np.diag([1.0, 2.0, 4.0]), (len(t), 3, 3)),
        lambda t: np.outer(3.0 * np.ones_like(t), [0.0, 0.0, 1.0]),
        7.0,
    )
    motion = sp.reconstruct(beanie, np.zeros(3))
    counts = sp.turn_counts(motion, sp.split(motion))
    np.testing.assert_allclose(counts.rotation_number, -0.75 * 7.0 / (2.0 * np.pi), rtol=1e-9)
    assert "rotation number -0.8356" in str(counts)
    assert counts.to_dict()["rotation_axis"] == counts.rotation_axis.tolist()
    tumbling = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    assert sp.turn_counts(tumbling, sp.split(tumbling)).rotation_number is None


def test_a_study_has_the_counts_of_an_athlete():
    outputs = [sp.study.OUTPUTS[name] for name in ("somersaults", "twists", "largest_tilt", "tilt_time", "twist_rate")]
    motion = sp.reconstruct(DIVE.deformation, DIVE.momentum)
    found = sp.phases.athlete_turns(motion)
    for output in outputs:
        assert float(output.of(motion, None)) == getattr(found, output.name)
