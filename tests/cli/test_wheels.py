"""Wheels on the command line: their options, a log with a column of speeds, and what is printed of them."""

from __future__ import annotations

import json

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from support.independent import apart

SATELLITE = sp.load_body("satellite")
ARM = [name for name in SATELLITE.joint_names if name != "wheel_spin"]
TIMES = np.linspace(0.0, 10.0, 101)
RPM = 600.0 + 200.0 * np.sin(2.0 * np.pi * TIMES / 10.0)


def log(tmp_path, **columns):
    """A loop of three joints, and other columns."""
    swing = 0.6 * (1.0 - np.cos(2.0 * np.pi * TIMES / 10.0))
    other = 0.4 * np.sin(2.0 * np.pi * TIMES / 10.0)
    moved = {name: {0: swing, 1: swing + other, 2: swing, 3: other}.get(k, 0.0 * TIMES) for k, name in enumerate(ARM)}
    table = {"time": TIMES} | moved | columns
    file = tmp_path / "log.csv"
    rows, header = np.column_stack([*table.values()]), ",".join(table)
    np.savetxt(file, rows, delimiter=",", header=header, comments="", fmt="%.17g")
    return file


def data(capsys, *words):
    main([*map(str, words), "--json"])
    return json.loads(capsys.readouterr().out)


def error(capsys, *words):
    with pytest.raises(SystemExit):
        main([*map(str, words)])
    return " ".join(capsys.readouterr().err.split())


def expected(file, **wheels):
    path = sp.read_shape_path(file, SATELLITE, without=["wheel_spin"])
    return sp.split(sp.reconstruct(sp.articulated(SATELLITE, path, **wheels), np.zeros(3)))


def test_wheels_of_a_log_are_those_of_python(tmp_path, capsys):
    file = log(tmp_path, **{"wheel_spin [rpm]": RPM})
    for words, wheels, printed in (
        (["--rotor", "wheel_spin=1.5"], {"rotors": {"wheel_spin": 1.5}}, "1.5 kg m^2/s along its axle in space, kept"),
        (
            ["--rotor-speed", "wheel_spin=600rpm"],
            {"rotor_speeds": {"wheel_spin": 20.0 * np.pi}},
            "wheel_spin: 600 rpm on its axle, held by its motor",
        ),
        (
            ["--rotor-speed", "wheel_spin=wheel_spin"],
            {"rotor_speeds": {"wheel_spin": (TIMES, RPM * np.pi / 30.0)}},
            "wheel_spin: 400 to 800 rpm on its axle, given in time",
        ),
    ):
        found, wanted = data(capsys, "split", "satellite", file, *words), expected(file, **wheels)
        for name in ("total_rotation", "holonomy", "wheel_rotation"):
            assert apart(np.array(found[name]), getattr(wanted, name)) < 1e-9
        assert "wheel_spin" in found["provenance"]["wheels"]
        main(["split", "satellite", str(file), *words])
        assert printed in capsys.readouterr().out


def test_a_wheel_without_a_joint_is_taken_out_of_the_base(tmp_path, capsys):
    file = log(tmp_path, wheel_spin=0.0 * TIMES)
    found = data(
        capsys, "split", "satellite", file, "--wheel", "0 0 1", "0.5", "--wheel", "0", "1", "0", "0.5",
        "--rotor", "wheel_1=0.3", "wheel_2=-0.2",
    )  # fmt: skip
    body = SATELLITE.with_wheel([0, 0, 1], 0.5).with_wheel([0, 1, 0], 0.5, name="wheel_2")
    path = sp.read_shape_path(file, SATELLITE)
    deformation = sp.articulated(body, path, rotors={"wheel_1": 0.3, "wheel_2": -0.2})
    wanted = sp.split(sp.reconstruct(deformation, np.zeros(3)))
    assert apart(np.array(found["total_rotation"]), wanted.total_rotation) < 1e-9


@pytest.mark.parametrize("command", ["view", "plot", "check", "orbits"])
def test_all_commands_with_a_motion_know_wheels(tmp_path, capsys, command):
    file = log(tmp_path, **{"wheel_spin [rpm]": RPM})
    first = {"plot": ["plot", "attitude"]}.get(command, [command])
    after = {
        "view": ["--html", tmp_path / "v.html"],
        "plot": ["--out", tmp_path / "a.svg"],
        "orbits": [0.3, "--tolerance", "1e-6"],
    }.get(command, [])
    main([*map(str, [*first, "satellite", file, *after, "--rotor-speed", "wheel_spin=wheel_spin"])])
    assert "wheel_spin: 400 to 800 rpm on its axle, given in time" in capsys.readouterr().out


def test_errors_say_what_to_type(tmp_path, capsys):
    file = log(tmp_path, **{"wheel_spin [rpm]": RPM})
    both = error(capsys, "split", "satellite", file)
    assert "--rotor-speed wheel_spin=" in both
    assert "--rotor wheel_spin=" in both
    for words, needed in (
        (["--rotor", "wheel_spin"], "as in --rotor rw1=1.5"),
        (["--rotor", "weel_spin=1"], "weel_spin"),
        (["--rotor", "wheel_spin=fast"], "a momentum in kg m^2/s is needed"),
        (["--rotor", "wheel_spin=nan"], "a momentum in kg m^2/s is needed"),
        (["--rotor-speed", "wheel_spin=600rmp"], "is no unit of speed; these are: rad/s, deg/s, rpm"),
        (["--rotor-speed", "wheel_spin=tacho"], "column of speeds of wheel_spin"),
        (["--rotor-speed", "wheel_spin=1", "--rotor", "wheel_spin=1"], "given twice"),
        (["--rotor", "arm_1=1", "wheel_spin=1"], "nothing that hangs on it"),
        (["--wheel", "0 0 1", "0.05"], "--rotor wheel_1=1.5"),
        (["--wheel", "0 0 1"], 'as in --wheel "0 0 1" 0.05'),
        (["--wheel", "0 0 z", "0.05"], 'as in --wheel "0 0 1" 0.05'),
        (["--wheel", "0 0 1", "1e6", "--rotor", "wheel_1=1"], "can hold; up to"),
    ):
        assert needed in error(capsys, "split", "satellite", file, *words), words
    named = ["split", "satellite", "satellite_sweep", "--rotor-speed", "wheel_spin=tacho"]
    assert "columns are those of recorded motions" in error(capsys, *named)
