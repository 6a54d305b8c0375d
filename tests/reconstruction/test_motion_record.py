"""Motions in files: saved and loaded whole, written as a table; damaged files are named."""

from __future__ import annotations

import csv
import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import InputFileNotFoundError, ResultFileError, ShapeError, TrajectoryError
from support.bodies import random_loop as random_path
from support.independent import BODIES, apart, body_of, random_loop, random_rotation, random_vector

TIMES = np.linspace(0.0, 2.0, 101)


def motion_of(name: str, *, seed: int = 1, size: float = 1.0, **options) -> sp.Motion:
    body = body_of(name)
    deformation = sp.articulated(body, random_loop(seed, body.n_shape).path)
    return sp.reconstruct(deformation, random_vector(seed, size * BODIES[name]), random_rotation(seed), **options)


def spline_motion() -> sp.Motion:
    body, random = body_of("cat"), np.random.default_rng(3)
    path = sp.ShapePath.spline(np.linspace(0.0, 2.0, 12), random.uniform(-0.5, 0.5, (12, body.n_shape)))
    return sp.reconstruct(sp.articulated(body, path), random_vector(3, 0.05))


def batch_motion() -> sp.Motion:
    momenta = np.stack([np.zeros(3), random_vector(1, 5.0)])
    deformation = sp.articulated(body_of("satellite"), random_loop(1, 10).path)
    return sp.reconstruct(deformation, momenta[:, None], np.stack([random_rotation(k) for k in range(3)]))


def turning_particles() -> sp.Motion:
    def positions(t):
        points = np.zeros((len(t), 3, 3))
        points[:, 0, 0], points[:, 0, 1] = np.cos(t), np.sin(t)
        points[:, 1, 0], points[:, 1, 1] = -np.sin(t), np.cos(t)
        points[:, 2] = -points[:, 0] - points[:, 1]
        return points, points @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])

    return sp.reconstruct(sp.particles([1.0, 2.0, 1.5], positions, 2.0), [0.1, 0.4, 1.0], random_rotation(2))


MOTIONS = {
    "human": lambda: motion_of("example:human"),
    "satellite": lambda: motion_of("satellite"),
    "many swings": lambda: sp.reconstruct(
        sp.articulated(body_of("cat"), random_loop(4, 23, harmonics=8, size=0.6).path), [0.01, 0.02, 0.03]
    ),
    "spline": spline_motion,
    "zero momentum": lambda: motion_of("cat", size=0.0),
    "batch": batch_motion,
    "dop853": lambda: motion_of("cat_two_halves", method="dop853"),
    "rigid": lambda: sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 2.0), [0.1, 1.0, 0.2]),
    "particles that end turned": turning_particles,
    "horizontal gauge": lambda: sp.reconstruct(
        sp.horizontal_gauge(sp.articulated(body_of("diver"), random_loop(2, 2).path)), [1.0, 2.0, 3.0]
    ),
}


@pytest.fixture(params=MOTIONS)
def pair(request, tmp_path) -> tuple[sp.Motion, sp.Motion]:
    """A motion, and the same one from its file."""
    motion = MOTIONS[request.param]()
    motion.save(tmp_path / "motion.npz")
    return motion, sp.load_motion(tmp_path / "motion.npz")


def test_a_loaded_motion_is_the_saved_one(pair):
    motion, loaded = pair
    np.testing.assert_array_equal(loaded.momentum, motion.momentum)
    np.testing.assert_array_equal(loaded.deformation.breaks, motion.deformation.breaks)
    assert loaded.batch == motion.batch
    for field in ("duration", "tolerance", "method", "evaluations"):
        assert getattr(loaded, field) == getattr(motion, field)
    # A motion by another method is kept at its steps, so its estimate is that of both.
    slack = 1e-9 if motion.method == "dop853" else 1e-14
    assert apart(loaded.attitude(TIMES), motion.attitude(TIMES)) < slack
    np.testing.assert_allclose(loaded.error_estimate, motion.error_estimate, rtol=0.5, atol=1e-12)
    scale = np.abs(motion.angular_velocity(TIMES)).max()
    speeds = loaded.angular_velocity(TIMES), motion.angular_velocity(TIMES)
    np.testing.assert_allclose(*speeds, rtol=0, atol=1e-8 * scale)
    assert np.all(loaded.equation_residual < 1e-7)


def test_a_loaded_motion_knows_where_its_base_is(pair):
    motion, loaded = pair
    there, here = motion.base_position(TIMES, gravity=[0, 0, -9.81]), loaded.base_position(TIMES, gravity=[0, 0, -9.81])
    np.testing.assert_allclose(here, there, rtol=0, atol=1e-9)


@pytest.mark.parametrize("gauge", ["horizontal", "base"])
def test_a_loaded_motion_is_split_alike(pair, gauge: str):
    motion, loaded = pair
    ours, theirs = sp.split(motion, gauge), sp.split(loaded, gauge)
    for field in ("total_rotation", "holonomy", "dynamical_rotation", "closing_tilt"):
        assert apart(getattr(theirs, field), getattr(ours, field)) < 1e-9
    for field in ("montgomery_phase", "dynamic_phase", "solid_angle", "momentum_gap"):
        np.testing.assert_allclose(getattr(theirs, field), getattr(ours, field), rtol=0, atol=1e-9)
    np.testing.assert_array_equal(theirs.has_phase, ours.has_phase)
    assert theirs.is_loop == ours.is_loop
    assert theirs.shape_gap == ours.shape_gap


def test_a_loaded_open_path_is_open(tmp_path):
    path = sp.ShapePath.waypoints([0.0, 1.0], np.stack([np.zeros(23), 0.3 * np.ones(23)]))
    motion = sp.reconstruct(sp.articulated(body_of("cat"), path), [0.0, 0.0, 0.05])
    motion.save(tmp_path / "open.npz")
    loaded = sp.load_motion(tmp_path / "open.npz")
    assert loaded.deformation.closure is None
    assert not sp.split(loaded).is_loop
    assert sp.split(loaded).shape_gap == pytest.approx(0.3)


def test_a_loaded_motion_can_be_computed_anew_with_another_momentum(tmp_path):
    motion = motion_of("cat")
    motion.save(tmp_path / "m.npz")
    loaded = sp.load_motion(tmp_path / "m.npz")
    other = random_vector(5, 0.03)
    again = sp.reconstruct(loaded.deformation, other, tolerance=1e-8)
    truth = sp.reconstruct(motion.deformation, other, tolerance=1e-8)
    assert apart(again.attitude(TIMES), truth.attitude(TIMES)) < 2e-8


def test_the_file_is_written_where_it_was_asked_and_says_what_it_is(tmp_path):
    motion = motion_of("cat_two_halves")
    motion.save(tmp_path / "motion.anything")
    motion.save(str(tmp_path / "motion.anything"))
    assert [p.name for p in tmp_path.iterdir()] == ["motion.anything"]
    with np.load(tmp_path / "motion.anything", allow_pickle=False) as stored:
        header = json.loads(str(stored["header"]))
    assert header["shapephase"] == sp.__version__
    assert "SI" in header["units"]


# ---- Damaged files -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def saved(tmp_path_factory) -> Path:
    where = tmp_path_factory.mktemp("saved") / "motion.npz"
    motion_of("cat_two_halves").save(where)
    return where


def rewritten(saved: Path, target: Path, **changes) -> Path:
    """The same archive with other arrays; None leaves one out."""
    with np.load(saved, allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    arrays = {name: value for name, value in {**arrays, **changes}.items() if value is not None}
    np.savez(target, **arrays)
    return target


def test_there_is_no_such_file(tmp_path):
    for missing in (tmp_path / "none.npz", tmp_path):
        with pytest.raises(InputFileNotFoundError, match="file"):
            sp.load_motion(missing)
    with pytest.raises(FileNotFoundError):
        sp.load_motion(str(tmp_path / "none.npz"))


@pytest.mark.parametrize("content", [b"", b"time,qx\n0,1\n", b"PK\x03\x04", b"\x93NUMPY\x01\x00", b"{}" * 1000])
def test_a_file_that_is_no_archive(tmp_path, content: bytes):
    where = tmp_path / "motion.npz"
    where.write_bytes(content)
    with pytest.raises(ResultFileError, match=r"motion\.npz"):
        sp.load_motion(where)


def test_a_single_array_is_no_motion(tmp_path):
    where = tmp_path / "motion.npz"
    with where.open("wb") as stream:
        np.save(stream, np.eye(3))
    with pytest.raises(ResultFileError, match=r"motion\.npz"):
        sp.load_motion(where)


def test_a_pickle_is_not_opened(tmp_path):
    where = tmp_path / "motion.npz"
    np.savez(where, header=np.array([{"format": "shapephase motion 3"}], dtype=object))
    with pytest.raises(ResultFileError, match=r"motion\.npz"):
        sp.load_motion(where)


def test_any_damaged_byte_is_noticed_or_harmless(saved: Path, tmp_path):
    content, random = saved.read_bytes(), np.random.default_rng(1)
    truth = sp.load_motion(saved).attitude(TIMES)
    where = tmp_path / "bad.npz"
    directory = content.rindex(b"PK\x01\x02") - 1500
    places = [*random.integers(0, len(content), 75), *random.integers(directory, len(content), 75)]
    noticed = 0
    for place in places:
        damaged = bytearray(content)
        damaged[place] ^= 1 << int(random.integers(8))
        where.write_bytes(damaged)
        try:
            loaded = sp.load_motion(where)
        except ResultFileError:
            noticed += 1
        else:
            assert apart(loaded.attitude(TIMES), truth) < 1e-15
    assert noticed > 75


def test_another_format(saved: Path, tmp_path):
    header = {"format": "shapephase motion 99"}
    where = rewritten(saved, tmp_path / "new.npz", header=np.array(json.dumps(header)))
    with pytest.raises(ResultFileError, match="motion"):
        sp.load_motion(where)


@pytest.mark.parametrize("header", ["[]", "3", '"text"', "null", "{", "{}", '{"format": "shapephase motion 3"}'])
def test_a_header_that_says_nothing(saved: Path, tmp_path, header: str):
    where = rewritten(saved, tmp_path / "odd.npz", header=np.array(header))
    with pytest.raises(ResultFileError, match=r"odd\.npz"):
        sp.load_motion(where)


def test_every_array_is_needed(saved: Path, tmp_path):
    with zipfile.ZipFile(saved) as archive:
        names = [name.removesuffix(".npy") for name in archive.namelist()]
    for name in names:
        where = rewritten(saved, tmp_path / "less.npz", **{name: None})
        if name in ("time", "shapes", "joint_names", "base_quat_xyzw"):  # those of the recording
            with pytest.raises(TrajectoryError, match=r"less\.npz.*path of its joints"):
                sp.read_recorded_motion(where, body_of("cat_two_halves"))
        with pytest.raises(ResultFileError, match=r"less\.npz"):
            sp.load_motion(where)


@pytest.mark.parametrize("size", [0.0, 1.0])
@pytest.mark.parametrize("name", ["cat", "satellite"])
def test_a_stored_motion_is_a_recording(name: str, size: float, tmp_path):
    """The joints come back to 1e-9 rad, the momentum exactly, so that the motion is the stored one."""
    body, where = body_of(name), tmp_path / "motion.npz"
    path = random_path(body, np.random.default_rng(1), duration=2.0)
    motion = sp.reconstruct(sp.articulated(body, path), random_vector(1, size * BODIES[name]), random_rotation(1))
    motion.save(where)
    recorded = sp.read_recorded_motion(where, body)
    assert np.abs(recorded.path.shape(TIMES) - path.shape(TIMES)).max() < 2e-9
    assert apart(recorded.base_attitude[-1], motion.final_attitude) < 1e-14
    again = sp.motion_from_recording(body, recorded).motion
    assert np.array_equal(again.momentum, motion.momentum)
    assert apart(again.final_attitude, motion.final_attitude) < 1e-8


def test_a_batch_is_no_recording(tmp_path):
    batch_motion().save(tmp_path / "batch.npz")
    with pytest.raises(TrajectoryError, match=r"batch\.npz.*a batch"):
        sp.read_recorded_motion(tmp_path / "batch.npz", body_of("satellite"))


@pytest.mark.parametrize("name", ["spatial_momentum", "closure", "coefficients", "step_quaternions", "hidden"])
def test_a_changed_number_is_noticed(saved: Path, tmp_path, name: str):
    """The last bit of one number."""
    with np.load(saved) as stored:
        array = stored[name]
    array.flat[0] = np.nextafter(array.flat[0], np.inf)
    where = rewritten(saved, tmp_path / "odd.npz", **{name: array})
    with pytest.raises(ResultFileError, match=r"odd\.npz: the motion is damaged"):
        sp.load_motion(where)


def test_a_file_of_an_earlier_version_has_no_digest(saved: Path, tmp_path):
    with np.load(saved) as stored:
        header = json.loads(str(stored["header"]))
    del header["digest"]
    where = rewritten(saved, tmp_path / "old.npz", header=np.array(json.dumps(header)))
    assert np.array_equal(sp.load_motion(where).attitude(TIMES), sp.load_motion(saved).attitude(TIMES))


@pytest.mark.parametrize(
    ("name", "value"),
    [("loops", 1e400), ("loops", 0), ("loops", 10**9), ("tolerance", float("nan")), ("shape_gap", -1), ("sha256", [])],
)
def test_a_header_that_no_motion_has(saved: Path, tmp_path, name: str, value):
    with np.load(saved) as stored:
        header = json.loads(str(stored["header"])) | {name: value}
    where = rewritten(saved, tmp_path / "odd.npz", header=np.array(json.dumps(header)))
    with pytest.raises(ResultFileError, match="motion"):
        sp.load_motion(where)


# ---- The table -----------------------------------------------------------------------------------------------------


def table(where: Path) -> tuple[list[str], np.ndarray]:
    rows = list(csv.reader(io.StringIO(where.read_text(encoding="utf-8"))))
    return rows[0], np.array(rows[1:], dtype=float)


def test_the_table_holds_attitude_rate_and_position(tmp_path):
    motion = motion_of("satellite")
    motion.write_csv(tmp_path / "motion.csv")
    header, rows = table(tmp_path / "motion.csv")
    assert header == [
        "time",
        *("qx", "qy", "qz", "qw"),
        *("omega_x_rad_s", "omega_y_rad_s", "omega_z_rad_s"),
        *("base_x_m", "base_y_m", "base_z_m"),
    ]
    assert rows.shape == (201, 11)
    times = np.linspace(0.0, 2.0, 201)
    np.testing.assert_array_equal(rows[:, 0], times)
    x, y, z, w = rows[:, 1:5].T
    # Written to the last digit: four squares of components each right to a unit of rounding or two.
    np.testing.assert_allclose(x * x + y * y + z * z + w * w, 1.0, rtol=0, atol=8.0 * np.finfo(float).eps)
    columns = np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=-1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=-1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=-1),
        ],
        axis=1,
    )
    assert apart(columns, motion.attitude(times)) < 1e-14
    np.testing.assert_array_equal(rows[:, 5:8], motion.angular_velocity(times))
    np.testing.assert_array_equal(rows[:, 8:11], motion.base_position(times))


def test_quaternions_of_the_table_keep_one_sign(tmp_path):
    """Four turns: the components run on without jumps, from w >= 0 at the start."""
    momentum = [0.0, 0.0, 2.4]
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 1.0, 3.0]), 10.0 * np.pi), momentum)
    motion.write_csv(tmp_path / "motion.csv")
    _, rows = table(tmp_path / "motion.csv")
    half = 0.5 * 0.8 * rows[:, 0]
    expected = np.stack([0.0 * half, 0.0 * half, np.sin(half), np.cos(half)], axis=-1)
    np.testing.assert_allclose(rows[:, 1:5], expected, rtol=0, atol=1e-8)
    assert rows[0, 4] >= 0.0
    assert rows[:, 4].min() < -0.9


def test_times_and_fall_of_the_table(tmp_path):
    motion = motion_of("cat")
    times = [0.0, 0.1, 1.7]
    fall = {"start": [0.0, 0.0, 2.0], "velocity": [1.0, 0.0, 0.0], "gravity": [0.0, 0.0, -9.81]}
    motion.write_csv(tmp_path / "motion.csv", times, **fall)
    _, rows = table(tmp_path / "motion.csv")
    np.testing.assert_array_equal(rows[:, 0], times)
    np.testing.assert_array_equal(rows[:, 8:], motion.base_position(times, **fall))


def test_a_table_holds_one_motion(tmp_path):
    with pytest.raises(ShapeError, match="batch"):
        batch_motion().write_csv(tmp_path / "motion.csv")
    assert not list(tmp_path.iterdir())
