"""Logs of satellites: the path of the joints that are no wheels, and the speeds of wheels by their columns."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

import shapephase as sp
from shapephase.errors import ShapeError, TrajectoryError, UnknownNameError
from shapephase.shape_space.path_samples import path_samples
from support.independent import apart

SATELLITE = sp.load_body("satellite")
ARM = [name for name in SATELLITE.joint_names if name != "wheel_spin"]
TIMES = np.linspace(0.0, 4.0, 201)
RPM = 600.0 + 200.0 * np.sin(2.0 * np.pi * TIMES / 4.0)
IN_RAD = np.pi / 30.0


def angles(joint):
    """A loop that begins and ends at rest."""
    return 0.1 * (1 + joint) * (1.0 - np.cos(2.0 * np.pi * TIMES / 4.0))


def log(tmp_path, columns, rows=TIMES):
    file = tmp_path / "log.csv"
    names, values = ["time", *columns], [rows, *columns.values()]
    np.savetxt(file, np.column_stack(values), delimiter=",", header=",".join(names), comments="", fmt="%.17g")
    return file


def joints(**more):
    return {name: angles(k) for k, name in enumerate(ARM)} | more


@pytest.mark.parametrize("extra", [{}, {"wheel_spin": 50.0 * TIMES}, {"wheel_spin [rpm]": RPM}])
def test_the_path_without_a_wheel_ignores_its_columns(tmp_path, extra):
    path = sp.read_shape_path(log(tmp_path, joints(**extra)), SATELLITE, without=["wheel_spin"])
    assert path.joint_names == tuple(ARM)
    np.testing.assert_allclose(path.shape(TIMES), np.column_stack([angles(k) for k in range(len(ARM))]), atol=1e-12)
    assert path.record["without"] == ["wheel_spin"]
    assert path.sha256 is not None
    sp.articulated(SATELLITE, path, rotors={"wheel_spin": 1.0})


@pytest.mark.parametrize(
    ("label", "asked", "size"),
    [
        ("wheel_spin [rpm]", "wheel_spin [rpm]", 1.0),
        ("wheel_spin [rpm]", "wheel_spin", 1.0),
        ("tacho_rpm", "tacho", 1.0),
        ("tacho (rad/s)", "tacho (rad/s)", IN_RAD),
        ("tacho [deg/s]", "tacho", 6.0),
        ("tacho", "tacho:rpm", 1.0),
        ("a:b", "a:b:rpm", 1.0),
    ],
)
def test_a_column_of_speeds_becomes_the_wheel_by_its_unit(tmp_path, label, asked, size):
    recorded = sp.read_recorded_motion(
        log(tmp_path, joints(**{label: size * RPM})), SATELLITE, wheel_speeds={"wheel_spin": asked}
    )
    speed = recorded.wheel_speeds["wheel_spin"]
    np.testing.assert_allclose(speed.shape(TIMES)[:, 0], IN_RAD * RPM, rtol=1e-12)
    deformation = sp.articulated(SATELLITE, recorded.path, rotor_speeds=recorded.wheel_speeds)
    given = sp.articulated(SATELLITE, recorded.path, rotor_speeds={"wheel_spin": (TIMES, IN_RAD * RPM)})
    ends = [sp.reconstruct(one, [0.0, 0.1, 0.0]).final_attitude for one in (deformation, given)]
    assert apart(*ends) < 1e-9


def test_speeds_are_filtered_cut_bridged_and_resampled_with_the_joints(tmp_path):
    noisy = RPM + np.random.default_rng(1).normal(0.0, 3.0, len(RPM))
    file = log(tmp_path, joints(**{"wheel_spin [rpm]": noisy}))
    wheel = {"wheel_spin": "wheel_spin"}
    low = sp.read_recorded_motion(file, SATELLITE, wheel_speeds=wheel, lowpass=4.0).wheel_speeds["wheel_spin"]
    # Both passes of SciPy's own filter; MATLAB's and ours differ in how a record is continued at its ends.
    filtered = sosfiltfilt(butter(2, 4.0 / 0.8022, fs=50.0, output="sos"), noisy) * IN_RAD
    inner = slice(40, -40)
    np.testing.assert_allclose(low.shape(TIMES)[inner, 0], filtered[inner], rtol=0, atol=0.05)
    assert np.abs(low.shape(TIMES)[inner, 0] - noisy[inner] * IN_RAD).max() > 0.3
    smooth = sp.read_recorded_motion(
        file, SATELLITE, wheel_speeds=wheel, smooth={"wheel_spin": 3.0 * IN_RAD}
    ).wheel_speeds["wheel_spin"]
    off = smooth.shape(TIMES)[:, 0] - IN_RAD * RPM
    assert np.sqrt(np.mean(off**2)) < 0.5 * 3.0 * IN_RAD
    cut = sp.read_recorded_motion(file, SATELLITE, wheel_speeds=wheel, trim=(1.0, 3.0))
    np.testing.assert_allclose(cut.wheel_speeds["wheel_spin"].shape(0.0), IN_RAD * noisy[50], rtol=1e-12)
    assert cut.wheel_speeds["wheel_spin"].duration == cut.path.duration
    even = sp.read_recorded_motion(file, SATELLITE, wheel_speeds=wheel, resample=10.0)
    assert len(even.wheel_speeds["wheel_spin"].breaks) == len(even.path.breaks) == 41
    holed = RPM.copy()
    holed[100:103] = np.nan
    file = log(tmp_path, joints(**{"wheel_spin [rpm]": holed}))
    with pytest.raises(TrajectoryError, match="wheel_spin"):
        sp.read_recorded_motion(file, SATELLITE, wheel_speeds=wheel)
    filled = sp.read_recorded_motion(file, SATELLITE, wheel_speeds=wheel, fill=0.2).wheel_speeds["wheel_spin"]
    np.testing.assert_allclose(filled.shape(TIMES)[:, 0], IN_RAD * RPM, rtol=1e-5)


@pytest.mark.parametrize("how", [{"lowpass": 4.0}, {"smooth": 0.01}, {"resample": 20.0}, {"close": 0.1}])
def test_the_path_without_a_wheel_remembers_the_samples_of_its_joints(tmp_path, how):
    """Derivatives by samples, which error bars are made of, against the same steps with other samples."""
    rng = np.random.default_rng(2)
    columns = joints(wheel_spin=0.2 * TIMES) if "close" not in how else joints(wheel_spin=angles(3))
    noisy = {name: 0.1 + values + rng.normal(0.0, 0.01, len(TIMES)) for name, values in columns.items()}
    recorded = sp.read_recorded_motion(log(tmp_path, noisy), SATELLITE, without=["arm_2"], **how)
    names = [name for name in SATELLITE.joint_names if name != "arm_2"]
    samples = path_samples(recorded.path)
    change = rng.normal(size=samples.values.shape)
    moved = samples.path_through(samples.values + 1e-4 * change).matched(names, "the rest")
    # One row a joint: its shape at one time.
    by_shape = np.eye(len(names))[None]
    slopes = samples.derivative(np.array([1.234]), by_shape, 0.0 * by_shape) @ change.ravel()
    np.testing.assert_allclose((moved.shape(1.234) - recorded.path.shape(1.234)) / 1e-4, slopes, rtol=0, atol=1e-8)
    assert np.abs(slopes).max() > 0.05
    if recorded.smoothing is not None:
        assert recorded.smoothing.noise.shape == (len(names),)


def test_errors_name_what_lacks_and_what_to_type(tmp_path):
    lacking = {name: values for name, values in joints(odd=TIMES).items() if name != "arm_3"}
    with pytest.raises(TrajectoryError, match=r"no column for arm_3;") as refused:
        sp.read_shape_path(log(tmp_path, lacking), SATELLITE, without=["wheel_spin"], ignore_extra=True)
    assert "wheel_spin;" not in str(refused.value)
    with pytest.raises(TrajectoryError, match=r"wheel_spin \[rpm\].*--rotor-speed wheel_spin=.*--rotor wheel_spin="):
        sp.read_shape_path(log(tmp_path, joints(**{"wheel_spin [rpm]": RPM})), SATELLITE)
    with pytest.raises(TrajectoryError, match=r"degrees.*--rotor-speed wheel_spin=.*--rotor wheel_spin="):
        sp.read_shape_path(log(tmp_path, joints(wheel_spin=50.0 * TIMES)), SATELLITE)
    whole = sp.read_shape_path(log(tmp_path, joints(wheel_spin=0.5 * TIMES)), SATELLITE)
    with pytest.raises(TrajectoryError, match="without="):
        sp.articulated(SATELLITE, whole, rotors={"wheel_spin": 1.0})
    file = log(tmp_path, joints(tacho=RPM))
    for options, words, kind in (
        ({"without": ["weel_spin"]}, "weel_spin", UnknownNameError),
        ({"without": "wheel_spin"}, "without", ShapeError),
        ({"wheel_spin": "tacho"}, "wheel_spin", TypeError),
        ({"wheel_speeds": ["tacho"]}, "wheel_speeds", ShapeError),
        ({"wheel_speeds": {"wheel_spin": 3}}, "wheel_speeds", ShapeError),
        ({"wheel_speeds": {"wheel_spin": "taco"}}, "taco", UnknownNameError),
        ({"wheel_speeds": {"wheel_spin": "tacho"}}, "states no unit of speed", TrajectoryError),
    ):
        with pytest.raises(kind, match=words):
            sp.read_shape_path(file, SATELLITE, **options)
    clash = log(tmp_path, joints(**{"tacho [rpm]": RPM}))
    with pytest.raises(TrajectoryError, match="is in rpm, and rad/s was given"):
        sp.read_shape_path(clash, SATELLITE, wheel_speeds={"wheel_spin": "tacho:rad/s"})
