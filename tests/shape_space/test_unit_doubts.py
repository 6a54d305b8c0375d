"""Angles in degrees where radians are meant, and quaternions with w first where w is last: they are asked about."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.errors import TrajectoryError, TrajectoryWarning
from shapephase.examples.scenarios import cat_righting, kane_scher

TIMES = np.linspace(0.0, 1.0, 21)


def bending(turn: float) -> np.ndarray:
    """Of the waist of the cat of two halves, whose limits are half a turn or less: (21, 3) [rad]."""
    swing = np.sin(2.0 * np.pi * TIMES)
    return turn * np.stack([0.8 * swing, 0.5 * swing**2, 0.2 * swing], axis=-1)


def paths_of(factor: float) -> dict[str, sp.ShapePath]:
    """One motion in a unit, made in every way."""
    shapes = factor * bending(1.0)

    def swing(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        phase = 2.0 * np.pi * times[:, None]
        return factor * np.sin(phase) * [0.8, 0.5, 0.2], factor * 2.0 * np.pi * np.cos(phase) * [0.8, 0.5, 0.2]

    spline = sp.ShapePath.spline(TIMES, shapes)
    sines = factor * np.array([[0.8], [0.5], [0.2]])
    return {
        "spline": spline,
        "waypoints": sp.ShapePath.waypoints(TIMES, shapes),
        "fourier": sp.ShapePath.fourier(np.zeros(3), 0.0 * sines, sines, 1.0),
        "function": sp.ShapePath.function(swing, 1.0),
        "reversed": spline.reversed(),
        "joined": spline.then(spline),
    }


@pytest.mark.parametrize("kind", list(paths_of(1.0)))
def test_degrees_are_asked_about_and_radians_are_not(kind):
    """The warning names the joint, its value and its limits, and what makes radians of degrees."""
    cat = sp.load_body("cat_two_halves")
    sp.articulated(cat, paths_of(1.0)[kind])
    in_degrees = paths_of(180.0 / np.pi)[kind]
    with pytest.warns(TrajectoryWarning) as said:
        sp.articulated(cat, in_degrees)
    (words,) = {str(one.message) for one in said}
    assert words.startswith("joint waist_pitch of cat_two_halves is at ")
    size = np.degrees(np.abs(bending(1.0)[:, 0]).max())
    lower, upper = cat.joint_limits[0]
    value = float(words.split(" is at ")[1].split(" rad")[0])
    assert abs(value) == pytest.approx(size, rel=0.02)
    assert f"its limits {lower:.4g} to {upper:.4g} rad, and within them in degrees" in words
    assert "np.radians(angles)" in words


def test_every_way_to_a_result_asks():
    cat, path = sp.load_body("cat_two_halves"), paths_of(180.0 / np.pi)["fourier"]
    for use in (sp.articulated, sp.holonomy, sp.horizontal_lift, sp.path_summary):
        with pytest.warns(TrajectoryWarning, match="degrees"):
            use(cat, path)
    with pytest.warns(TrajectoryWarning, match="degrees"):
        sp.articulated(cat.with_inertias(masses=np.array([[1.0, 0.0, 0.0, 1.0]] * 2)), path)


def test_what_is_no_question_is_not_asked():
    """Motions of the library, joints that go a little beyond their limits, wheels, and radians far beyond limits."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for body, path in (("cat", cat_righting()), ("cat_two_halves", kane_scher(0.3, 1.0)),
                           ("satellite", sp.examples.named_motion("satellite_sweep"))):  # fmt: skip
            sp.articulated(sp.load_body(body), path)
        cat = sp.load_body("cat_two_halves")
        sp.articulated(cat, sp.ShapePath.spline(TIMES, bending(4.0)))
        sp.articulated(cat, sp.ShapePath.spline(TIMES, bending(400.0)))
        satellite = sp.load_body("satellite")
        wheel = np.zeros((len(TIMES), satellite.n_shape))
        wheel[:, satellite.joint_index("wheel_spin")] = 500.0 * TIMES
        sp.articulated(satellite, sp.ShapePath.spline(TIMES, wheel))


# ---- Quaternions ----------------------------------------------------------------------------------------------------


def somersault() -> sp.Motion:
    """A diver who turns and twists, so that no order of the numbers of a quaternion can stand for another."""
    body = sp.load_body("diver")
    arms = np.stack([1.2 + np.sin(2.0 * np.pi * TIMES), 1.0 + np.cos(5.0 * TIMES)], axis=1)
    deformation = sp.articulated(body, sp.ShapePath.spline(TIMES, arms, periodic=False))
    return sp.reconstruct(deformation, [4.0, -6.0, 40.0], so3.exp(np.array([0.3, 0.2, 0.1])))


def with_w_first(attitudes: np.ndarray) -> np.ndarray:
    """What one reads who takes the numbers w x y z for x y z w."""
    return so3.matrix_from_quat(np.roll(so3.quat_from_matrix(attitudes), 1, axis=-1))


def table(motion: sp.Motion, quaternions: np.ndarray, times: np.ndarray) -> dict[str, np.ndarray]:
    rates, joints = motion.angular_velocity(times).T, motion.deformation.description.path
    columns = dict(zip(("qx", "qy", "qz", "qw"), quaternions.T, strict=True))
    columns |= dict(zip(("omega_x_rad_s", "omega_y_rad_s", "omega_z_rad_s"), rates, strict=True))
    names = motion.deformation.description.body.joint_names
    return {"time": times, **dict(zip(names, joints.shape(times).T, strict=True)), **columns}


def test_rates_beside_a_quaternion_say_which_number_is_w():
    pandas = pytest.importorskip("pandas")
    motion, times = somersault(), np.linspace(0.0, 1.0, 101)
    body, right = sp.load_body("diver"), motion.quat_xyzw(times)
    read = sp.read_recorded_motion(pandas.DataFrame(table(motion, right, times)), body)
    np.testing.assert_allclose(read.base_attitude, motion.attitude(times), atol=1e-12)
    with pytest.raises(TrajectoryError, match="w x y z"):
        sp.read_recorded_motion(pandas.DataFrame(table(motion, np.roll(right, 1, axis=1), times)), body)
    # Rates in inertial axes show it, too; those that agree with neither order have to be left out.
    turned = so3.apply(motion.attitude(times), motion.angular_velocity(times)).T
    names = ("omega_x_rad_s", "omega_y_rad_s", "omega_z_rad_s")
    other = table(motion, np.roll(right, 1, axis=1), times) | dict(zip(names, turned, strict=True))
    with pytest.raises(TrajectoryError, match="w x y z"):
        sp.read_recorded_motion(pandas.DataFrame(other), body)
    wrong = pandas.DataFrame(table(motion, right, times) | dict(zip(names, -turned[::-1], strict=True)))
    with pytest.raises(TrajectoryError, match=r"contradict the recorded attitudes .*--names 'omega_x_rad_s=' "):
        sp.read_recorded_motion(wrong, body)
    left_out = sp.read_recorded_motion(wrong, body, names=dict.fromkeys(names))
    assert left_out.base_rates is None


def test_a_recorded_base_with_w_first_is_named():
    motion, times = somersault(), np.linspace(0.0, 1.0, 41)
    right = motion.attitude(times)
    sp.base_difference(motion, times, right)
    with pytest.warns(TrajectoryWarning, match="w first"):
        sp.base_difference(motion, times, with_w_first(right))
    with pytest.raises(TrajectoryError, match="w x y z"):
        sp.momentum_from_recording(motion.deformation, times, with_w_first(right))
    turned = right @ so3.exp(np.outer(times, [0.0, 1.0, 2.0]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert sp.base_difference(motion, times, turned).angle.max() > 1.0
