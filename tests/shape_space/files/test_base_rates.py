"""Gyros and star trackers in recordings: units, axes and direction; SciPy's rotations are the oracle."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.errors import ShapeError, TrajectoryError
from support.motion_writers import write_delimited

DIVER = sp.load_body("diver")
TIMES = np.linspace(0.0, 1.0, 81)
ARMS = np.stack([1.2 + np.sin(2.0 * np.pi * TIMES), 1.0 + np.cos(5.0 * TIMES)], axis=1)
MOTION = sp.reconstruct(
    sp.articulated(DIVER, sp.ShapePath.spline(TIMES, ARMS, periodic=False)), [4.0, 8.0, 5.0], so3.exp([0.3, -2.0, 0.9])
)
TURNS = Rotation.from_matrix(MOTION.attitude(TIMES))
RATES = MOTION.angular_velocity(TIMES)
QUATERNION = ("base_qx", "base_qy", "base_qz", "base_qw")
GYRO = ("gyro_x", "gyro_y", "gyro_z")


def log(file, *columns: tuple[tuple[str, ...], np.ndarray]):
    names = [name for labels, _ in columns for name in labels]
    values = np.column_stack([values for _, values in columns])
    write_delimited(file, [*names, *DIVER.joint_names], TIMES, np.column_stack([values, ARMS]))
    return file


def axes(form: str, parts: str = "xyz") -> tuple[str, ...]:
    return tuple(form.replace("*", part) for part in parts)


# Labels of the three components and the size of their unit [rad/s].
SPELLINGS = {
    "brackets": (axes("omega_* [rad/s]"), 1.0),
    "of a gyro": (axes("gyro_* [deg/s]"), np.pi / 180.0),
    "round brackets": (axes("AngVel_* (deg/s)"), np.pi / 180.0),
    "behind": (axes("gyro_*_dps"), np.pi / 180.0),
    "short": (axes("w*"), 1.0),
    "as write_csv": (axes("omega_*_rad_s"), 1.0),
    "ROS": (axes("/imu/angular_velocity/*"), 1.0),
    "bag in CSV": (axes("field.angular_velocity.*"), 1.0),
    "frames": (axes("omega_BN_B_*", "123"), 1.0),
    "degree": (axes("base_omega_* [°/s]"), np.pi / 180.0),
}


@pytest.mark.parametrize("case", SPELLINGS)
def test_rates_in_every_spelling(case: str, tmp_path):
    names, size = SPELLINGS[case]
    recorded = sp.read_recorded_motion(log(tmp_path / "m.csv", (names, RATES / size)), DIVER)
    np.testing.assert_allclose(recorded.base_rates, RATES, rtol=1e-12)
    assert recorded.base_attitude is None
    assert recorded.record["base"]["rates"] == list(names)


def test_a_row_of_units_states_theirs(tmp_path):
    file = log(tmp_path / "m.csv", (GYRO, np.degrees(RATES)))
    head, *rows = file.read_text().splitlines()
    units = ["s", *["deg/s"] * 3, *["rad"] * DIVER.n_shape]
    file.write_text("\n".join([head, ",".join(units), *rows]))
    np.testing.assert_allclose(sp.read_recorded_motion(file, DIVER).base_rates, RATES, rtol=1e-12)


def test_what_is_no_rate_of_the_base_stays_what_it_was(tmp_path):
    """Speeds of wheels, and two components only."""
    wheels = axes("omega_* [rpm]", "123")
    recorded = sp.read_recorded_motion(log(tmp_path / "m.csv", (wheels, RATES)), DIVER)
    assert recorded.base_rates is None
    assert set(recorded.record["left_out"]) == {*wheels}
    two = sp.read_recorded_motion(log(tmp_path / "m.csv", (axes("omega_* [rad/s]", "xy"), RATES[:, :2])), DIVER)
    assert two.base_rates is None


@pytest.mark.parametrize("inertial", [False, True])
@pytest.mark.parametrize("inverse", [False, True])
def test_rates_decide_axes_and_direction(inertial: bool, inverse: bool, tmp_path):
    """As SciPy inverts; without rates the argument says it."""
    quaternions = (TURNS.inv() if inverse else TURNS).as_quat()
    rates = TURNS.apply(RATES) if inertial else RATES
    file = log(tmp_path / "m.csv", (QUATERNION, quaternions), (GYRO, rates))
    recorded = sp.read_recorded_motion(file, DIVER)
    np.testing.assert_allclose(recorded.base_attitude, TURNS.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(recorded.base_rates, RATES, atol=1e-11)
    assert recorded.record["base"].get("inverse", False) is inverse
    assert recorded.record["base"]["rate_axes"] == ("inertial" if inertial else "base")
    alone = sp.read_recorded_motion(log(tmp_path / "a.csv", (QUATERNION, quaternions)), DIVER, base_inverse=inverse)
    np.testing.assert_allclose(alone.base_attitude, TURNS.as_matrix(), atol=1e-12)
    with pytest.raises(TrajectoryError, match=f"they agree: base_inverse={inverse}"):
        sp.read_recorded_motion(file, DIVER, base_inverse=not inverse)


@pytest.mark.parametrize("seed", range(6))
def test_noise_and_bias_do_not_mislead_the_decision(seed: int, tmp_path):
    """Half a degree of attitude and two degrees a second of rates, and a bias of two."""
    rng = np.random.default_rng(seed)
    turns = TURNS * Rotation.from_rotvec(np.radians(0.5) * rng.normal(size=(len(TIMES), 3)))
    rates = RATES + np.radians(2.0) * (rng.normal(size=RATES.shape) + np.array([1.0, -0.6, 0.4]))
    for inverse in (False, True):
        quaternions = (turns.inv() if inverse else turns).as_quat()
        recorded = sp.read_recorded_motion(log(tmp_path / "m.csv", (QUATERNION, quaternions), (GYRO, rates)), DIVER)
        np.testing.assert_allclose(recorded.base_attitude, turns.as_matrix(), atol=1e-12)
        np.testing.assert_allclose(recorded.base_rates, rates, atol=1e-12)


def test_base_axes_turn_attitudes_and_rates(tmp_path):
    """A sensor that is turned on the base: what it measures is about its own axes."""
    mount = Rotation.from_matrix(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]))
    columns = (QUATERNION, (TURNS * mount.inv()).as_quat()), (GYRO, mount.apply(RATES))
    recorded = sp.read_recorded_motion(log(tmp_path / "m.csv", *columns), DIVER, base_axes="x,-z,y")
    np.testing.assert_allclose(recorded.base_attitude, TURNS.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(recorded.base_rates, RATES, atol=1e-12)
    alone = sp.read_recorded_motion(log(tmp_path / "r.csv", columns[1]), DIVER, base_axes="x,-z,y")
    np.testing.assert_allclose(alone.base_rates, RATES, atol=1e-12)


def test_gaps_of_rates_are_bridged(tmp_path):
    file = log(tmp_path / "m.csv", (GYRO, np.where(np.arange(len(TIMES))[:, None] == 30, np.nan, RATES)))
    with pytest.raises(TrajectoryError, match="no number in columns 'gyro_x'"):
        sp.read_recorded_motion(file, DIVER)
    recorded = sp.read_recorded_motion(file, DIVER, fill=0.1)
    np.testing.assert_allclose(recorded.base_rates, RATES, atol=1e-2)


@pytest.mark.parametrize("options", [{"lowpass": 15.0}, {"lowpass": 15.0, "resample": 70.0}])
def test_rates_are_filtered_as_attitudes_are(options, tmp_path):
    recorded = sp.read_recorded_motion(
        log(tmp_path / "m.csv", (QUATERNION, TURNS.as_quat()), (GYRO, RATES)), DIVER, **options
    )
    inside = slice(8, -8)
    truth = MOTION.angular_velocity(recorded.times)
    np.testing.assert_allclose(recorded.base_rates[inside], truth[inside], atol=0.02 * np.abs(truth).max())


# Labels, values, options and the words of the message.
QUESTIONS = {
    "degrees without a unit": (
        GYRO,
        np.degrees(RATES),
        {},
        r"are 57.3 times faster .* deg/s, .*--names 'gyro_x=gyro_x \[",
    ),
    "degrees as radians": (axes("gyro_* [rad/s]"), np.degrees(RATES), {}, r"read in rad/s; --names 'gyro_x \[rad/s\]="),
    "radians as degrees": (axes("gyro_* [deg/s]"), RATES, {}, "57.3 times slower"),
    "another sensor": (GYRO, np.roll(RATES, 1, axis=1) * [1.0, -1.0, 1.0], {}, "contradict the recorded attitudes"),
    "a length": (GYRO, RATES, {"names": {"gyro_x": "gyro_x [m]"}}, "give them one unit"),
    "one alone": (("a",), RATES[:, :1], {"names": {"a": "base_omega_x"}}, "without base_omega_y, base_omega_z; add"),
    "two units": (("gyro_x", "gyro_y", "gyro_z [deg/s]"), RATES, {}, "give them one unit"),
    "twice": ((*GYRO, *axes("w*")), np.c_[RATES, RATES], {}, "'gyro_x' and 'wx' are both base_omega_x; keep one"),
}


@pytest.mark.parametrize("case", QUESTIONS)
def test_what_is_doubtful_is_asked(case: str, tmp_path):
    names, values, options, words = QUESTIONS[case]
    file = log(tmp_path / "m.csv", (QUATERNION, TURNS.as_quat()), (names, values))
    with pytest.raises((TrajectoryError, ShapeError), match=words):
        sp.read_recorded_motion(file, DIVER, **options)


def test_units_by_names_are_what_the_message_types(tmp_path):
    file = log(tmp_path / "m.csv", (QUATERNION, TURNS.as_quat()), (GYRO, np.degrees(RATES)))
    recorded = sp.read_recorded_motion(file, DIVER, names={name: f"{name} [deg/s]" for name in GYRO})
    np.testing.assert_allclose(recorded.base_rates, RATES, rtol=1e-12)
    left_out = sp.read_recorded_motion(file, DIVER, names=dict.fromkeys(GYRO))
    assert left_out.base_rates is None


def test_rates_alone_beyond_a_gyro_s_range_need_a_unit(tmp_path):
    with pytest.raises(TrajectoryError, match=r"beyond the range of gyros: deg/s\?.*--names 'gyro_x=gyro_x \[deg/s\]'"):
        sp.read_recorded_motion(log(tmp_path / "m.csv", (GYRO, np.degrees(RATES))), DIVER)
    with pytest.raises(TrajectoryError, match="base_inverse is for recorded attitudes"):
        sp.read_recorded_motion(log(tmp_path / "m.csv", (GYRO, RATES)), DIVER, base_inverse=True)


@pytest.mark.parametrize("inverse", [False, True])
def test_modified_rodrigues_parameters_jump_to_their_shadows(inverse: bool, tmp_path):
    """SciPy's are never longer than one: across half a turn they jump, and the attitude does not, nor between gaps."""
    parameters = (TURNS.inv() if inverse else TURNS).as_mrp()
    steps = np.linalg.norm(np.diff(parameters, axis=0), axis=1)
    assert steps.max() > 1.5
    names = axes("sigma_*", "123")
    file = log(tmp_path / "m.csv", (names, parameters))
    recorded = sp.read_recorded_motion(file, DIVER, base_inverse=inverse)
    np.testing.assert_allclose(recorded.base_attitude, TURNS.as_matrix(), atol=1e-12)
    # The samples on both sides of the jump are missing.
    jump = int(np.argmax(steps))
    lacking = parameters.copy()
    lacking[jump : jump + 2] = np.nan
    bridged = sp.read_recorded_motion(log(tmp_path / "g.csv", (names, lacking)), DIVER, base_inverse=inverse, fill=0.1)
    off = (TURNS.inv() * Rotation.from_matrix(bridged.base_attitude)).magnitude()
    assert off.max() < 0.01
    smooth = sp.read_recorded_motion(file, DIVER, base_inverse=inverse, lowpass=20.0)
    assert (TURNS.inv() * Rotation.from_matrix(smooth.base_attitude)).magnitude()[8:-8].max() < 0.05
