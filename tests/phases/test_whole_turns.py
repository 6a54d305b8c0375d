"""Whole turns beside the angle of a rotation, of a dive that was solved for them and of bodies that spin."""

from __future__ import annotations

import json

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main

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
    for words in ("does not count whole turns", "1.5000 somersaults", "horizontal part of the momentum", "least inertia"):
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
