"""Recordings of a body without joints: every command turns it by Euler's equations, however many samples there are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.cli.main import main

HANDLE = str(Path(__file__).parents[1] / "cases" / "handle.urdf")
MOMENTS = np.array([4e-4, 7e-4, 1e-3])
MOMENTUM = np.array([0.002, 0.004, 0.001])
GIVEN = ["--momentum", *map(str, MOMENTUM)]


def slope(_, quaternion):
    """q' = q omega / 2 with omega = I^-1 R^T L."""
    x, y, z, w = quaternion
    p, q, r = Rotation.from_quat(quaternion).inv().apply(MOMENTUM) / MOMENTS
    return 0.5 * np.array([w * p + y * r - z * q, w * q + z * p - x * r, w * r + x * q - y * p, -x * p - y * q - z * r])


def recording(folder, count, start=(0.0, 0.0, 0.0, 1.0)):
    """A file of the free motion, in the air, and the attitude at its end."""
    times = np.linspace(0.0, 1.0, count)
    turned = solve_ivp(slope, (0.0, 1.0), start, "DOP853", times, rtol=1e-12, atol=1e-13).y.T
    turned /= np.linalg.norm(turned, axis=1)[:, None]
    height = 1.0 + 5.0 * times - 0.5 * 9.81 * times**2
    table = np.column_stack([times, 0.0 * times, 0.0 * times, height, turned])
    header = "time,base_x,base_y,base_z,base_qx,base_qy,base_qz,base_qw"
    np.savetxt(folder / "spin.csv", table, delimiter=",", header=header, comments="")
    return str(folder / "spin.csv"), Rotation.from_quat(turned[-1])


@pytest.mark.parametrize("count", [64, 65, 300])
def test_it_turns_as_a_rigid_body(count, tmp_path):
    """Samples on both sides of where a path has so many knots that it is sampled otherwise."""
    file, last = recording(tmp_path, count)
    body = sp.load_body(HANDLE)
    recorded = sp.read_recorded_motion(file, body, flight="all")
    motion = sp.reconstruct(sp.articulated(body, recorded.path), MOMENTUM)
    assert (Rotation.from_matrix(motion.attitude(1.0)) * last.inv()).magnitude() < 1e-9
    fitted = sp.momentum_from_recording(motion.deformation, recorded.times, recorded.base_attitude)
    np.testing.assert_allclose(fitted.momentum, MOMENTUM, rtol=1e-9)
    np.testing.assert_allclose(sp.split(motion).total_rotation, last.as_matrix(), atol=1e-9)


@pytest.mark.parametrize("command", ["check", "audit"])
def test_it_is_read(command, tmp_path):
    main([command, HANDLE, recording(tmp_path, 65)[0]])


@pytest.mark.full
def test_it_is_drawn(tmp_path):
    file, _ = recording(tmp_path, 65)
    main(["view", HANDLE, file, *GIVEN, "--html", str(tmp_path / "view.html")])
    main(["split", HANDLE, file, *GIVEN, "--html", str(tmp_path / "report.html")])
    assert "The body is rigid and turns for 1 s" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["torques"], "handle has no joints, and so no torques of joints"),
        (["plot", "torques"], "handle has no joints, and so no torques of joints"),
        (["plot", "shape"], "the body has no joints to draw"),
    ],
)
def test_what_joints_do_is_refused_by_name(command, said, tmp_path, capsys):
    file, _ = recording(tmp_path, 65)
    out = ["--out", str(tmp_path / "a.svg")] if command[0] == "plot" else []
    with pytest.raises(SystemExit) as ended:
        main([*command, HANDLE, file, *GIVEN, *out])
    assert ended.value.code == 2
    assert said in capsys.readouterr().err
