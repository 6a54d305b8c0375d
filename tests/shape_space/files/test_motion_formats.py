"""Every kind of motion file tells the same motion; faults are named; bytes at random never do worse than an error."""

import hashlib
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays as drawn

import shapephase as sp
from shapephase.errors import ShapePhaseError, TrajectoryError, TrajectoryWarning, UnknownNameError
from shapephase.shape_space.files import read_recorded_motion, read_shape_path, write_shape_path
from support.independent import mujoco_model
from support.motion_writers import (
    NANO,
    Sample,
    states,
    trajectory,
    write_bag,
    write_delimited,
    write_opensim,
    yaml_states,
    yaml_trajectory,
)

SATELLITE, DIVER = sp.load_body("satellite"), sp.load_body("diver")
LEFT, RIGHT = DIVER.joint_names


def csv_of_late_start(file, s):
    write_delimited(file, s.names, s.ns / NANO + 100.0, s.shapes)


def csv_of_semicolons(file, s):
    write_delimited(file, s.names, s.ns / NANO, s.shapes, ";")


def tsv_in_degrees(file, s):
    write_delimited(file, s.labels, s.ns / NANO, s.degrees, "\t")


def npz(file, s):
    np.savez(file, time=s.ns / NANO, shapes=s.shapes, joint_names=s.names)


def mot_in_degrees(file, s):
    write_opensim(file, s.names, s.ns / NANO, s.degrees, True)


def sto_in_radians(file, s):
    paths = [f"/jointset/some/{name}/value" for name in s.names]
    speeds = [f"/jointset/some/{name}/speed" for name in s.names]
    both = np.concatenate([s.shapes, 7.0 * s.shapes], axis=1)
    write_opensim(file, paths + speeds, s.ns / NANO, both, False, separator="   ", DataType="double")


def yaml_in_nanoseconds(file, s):
    file.write_text(yaml_trajectory(s.names, s.ns, s.shapes, "secs"))


def yaml_goal_in_seconds(file, s):
    file.write_text("goal:\n  trajectory:\n" + yaml_trajectory(s.names, s.ns, s.shapes, "float", "    "))


def yaml_echo(file, s):
    file.write_text(yaml_states(s.names, s.ns + 1_700_000_000_123_456_789, s.shapes))


def rosbag1_states(file, s):
    write_bag(file, {"/joint_states": states(s.names, s.ns + 1_700_000_000_123_456_789, s.shapes)}, "rosbag1")


def rosbag1_trajectory(file, s):
    write_bag(file, {"/command": trajectory(s.names, s.ns, s.shapes)}, "rosbag1")


def rosbag2_states_by_recording_time(file, s):
    topics = {"/joint_states": states(s.names, s.ns, s.shapes, stamped=False)}
    write_bag(file, topics, "sqlite3", recorded=s.ns + 1_700_000_000_987_654_321)


def mcap_trajectory(file, s):
    write_bag(file, {"/command": trajectory(s.names, s.ns, s.shapes)}, "mcap")


def mcap_states_of_two_publishers(file, s):
    arm, rest = slice(0, 4), slice(4, None)
    write_bag(
        file,
        {
            "/joint_states": (
                states([], [], [])[0],
                lambda m: [
                    m.state(int(t) + NANO, s.names[part], row[part])
                    for t, row in zip(s.ns, s.shapes, strict=True)
                    for part in (rest, arm)
                ],
            )
        },
        "mcap",
    )


def qpos_with_free_joint(file, s):
    # MuJoCo's free joint: position, then the quaternion with its scalar first.
    base = np.concatenate([s.positions, s.quaternions[:, 3:], s.quaternions[:, :3]], axis=1)
    qpos = np.concatenate([base, s.shapes], axis=1)
    np.savez(file, qpos=qpos, time=s.ns / NANO + 3.0, joint_names=s.names)


def in_mujocos_order(s):
    """The columns in the order in which MuJoCo itself compiles the satellite's file."""
    model = mujoco_model("satellite")
    names = [model.joint(k).name for k in range(model.njnt) if model.joint(k).name in SATELLITE.joint_names]
    return s.in_body_order[:, [SATELLITE.joint_names.index(name) for name in names]]


def qpos_without_names(file, s):
    np.savez(file, qpos=in_mujocos_order(s), time=s.ns / NANO)


WRITERS = {
    "a.csv": csv_of_late_start,
    "b.csv": csv_of_semicolons,
    "c.tsv": tsv_in_degrees,
    "d.npz": npz,
    "e.mot": mot_in_degrees,
    "f.sto": sto_in_radians,
    "g.yaml": yaml_in_nanoseconds,
    "h.yml": yaml_goal_in_seconds,
    "i.yaml": yaml_echo,
    "j.bag": rosbag1_states,
    "k.bag": rosbag1_trajectory,
    "l": rosbag2_states_by_recording_time,
    "m": mcap_trajectory,
    "n": mcap_states_of_two_publishers,
    "o.npz": qpos_with_free_joint,
    "p.npz": qpos_without_names,
}


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("file", WRITERS)
def test_all_kinds_of_file_give_the_same_path(tmp_path, file, closed):
    sample = Sample.random(SATELLITE, closed=closed)
    WRITERS[file](tmp_path / file, sample)
    motion = read_recorded_motion(tmp_path / file, SATELLITE)
    truth = sp.ShapePath.spline(sample.ns / NANO, sample.in_body_order, joint_names=SATELLITE.joint_names)
    t = np.linspace(0.0, truth.duration, 997)
    np.testing.assert_allclose(motion.path.shape(t), truth.shape(t), rtol=0.0, atol=2e-12)
    np.testing.assert_allclose(motion.path.rate(t), truth.rate(t), rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(motion.times, sample.ns / NANO, rtol=0.0, atol=1e-13)
    np.testing.assert_array_equal(motion.residual, np.zeros(SATELLITE.n_shape))
    assert motion.path.joint_names == SATELLITE.joint_names
    np.testing.assert_array_equal(read_shape_path(tmp_path / file, SATELLITE).shape(t), motion.path.shape(t))
    if "qpos_with" not in WRITERS[file].__name__:
        assert motion.base_attitude is None
        assert motion.base_position is None


@pytest.mark.parametrize(("folder", "part"), [("l", "l.db3"), ("m", "m.mcap")])
def test_the_file_inside_a_rosbag2_folder_is_read_alone(tmp_path, folder, part):
    sample = Sample.random(SATELLITE)
    WRITERS[folder](tmp_path / folder, sample)
    path = read_shape_path(tmp_path / folder / part, SATELLITE)
    assert path.sha256 == hashlib.sha256((tmp_path / folder / part).read_bytes()).hexdigest()
    listed = [f"{hashlib.sha256(f.read_bytes()).hexdigest()}  {f.name}\n" for f in (tmp_path / folder).iterdir()]
    whole = hashlib.sha256("".join(sorted(listed, key=lambda line: line[64:])).encode()).hexdigest()
    assert read_shape_path(tmp_path / folder, SATELLITE).sha256 == whole
    np.testing.assert_allclose(path.shape(path.breaks), sample.in_body_order, rtol=0.0, atol=1e-15)


def test_qpos_as_a_bare_array_takes_its_step_from_the_caller(tmp_path):
    sample = Sample.random(SATELLITE)
    np.save(tmp_path / "q.npy", in_mujocos_order(sample))
    path = read_shape_path(tmp_path / "q.npy", SATELLITE, timestep=0.002)
    np.testing.assert_allclose(path.breaks, 0.002 * np.arange(len(sample.ns)), atol=1e-16, rtol=0)
    np.savez(tmp_path / "q.npz", qpos=in_mujocos_order(sample), timestep=0.002)
    np.testing.assert_array_equal(read_shape_path(tmp_path / "q.npz", SATELLITE).breaks, path.breaks)
    with pytest.raises(TrajectoryError, match="times"):
        read_shape_path(tmp_path / "q.npy", SATELLITE)


def rotated(quaternion, vector):
    """A vector turned by a quaternion x y z w: q v q*, by Hamilton's product."""
    imaginary, real = quaternion[..., :3], quaternion[..., 3:]
    return vector + 2.0 * np.cross(imaginary, np.cross(imaginary, vector) + real * vector)


def with_base(sample, prefix="", extra=()):
    labels = [f"{prefix}q{axis}" for axis in "xyzw"] + ["base_x_m", "base_y_m", "base_z_m"]
    values = np.concatenate([sample.quaternions, sample.positions, *extra, sample.shapes], axis=1)
    return labels, values


@pytest.mark.parametrize("kind", ["csv", "alias", "table", "npz", "qpos"])
def test_the_motion_of_the_base_is_read_too(tmp_path, kind):
    sample = Sample.random(SATELLITE)
    file = tmp_path / ("m.csv" if kind in ("csv", "alias", "table") else "m.npz")
    if kind == "qpos":
        qpos_with_free_joint(file, sample)
    elif kind == "npz":
        base = {"base_quat_xyzw": sample.quaternions, "base_position": sample.positions}
        np.savez(file, time=sample.ns / NANO, shapes=sample.shapes, joint_names=sample.names, **base)
    else:
        labels, values = with_base(sample, "base_" if kind == "alias" else "")
        write_delimited(file, [*labels, *sample.names], sample.ns / NANO, values)
    motion = read_recorded_motion(file, SATELLITE)
    vectors = np.random.default_rng(1).normal(size=(len(sample.ns), 3))
    turned = (motion.base_attitude @ vectors[..., None])[..., 0]
    np.testing.assert_allclose(turned, rotated(sample.quaternions, vectors), atol=1e-14, rtol=0)
    np.testing.assert_array_equal(motion.base_position, sample.positions)
    np.testing.assert_allclose(motion.path.shape(motion.times), sample.in_body_order, atol=1e-14, rtol=0)


def test_the_table_of_a_reconstructed_motion_gives_its_attitude_back(tmp_path):
    path = sp.ShapePath.fourier([0.1, 0.2], [[0.3], [0.2]], [[0.1], [0.3]], 2.0, joint_names=DIVER.joint_names)
    motion = sp.reconstruct(sp.articulated(DIVER, path), [1.0, 20.0, 3.0])
    motion.write_csv(tmp_path / "motion.csv")
    lines = (tmp_path / "motion.csv").read_text().splitlines()
    t = np.array([float(line.split(",")[0]) for line in lines[1:]])
    joints = [",".join(DIVER.joint_names), *(",".join(map(repr, map(float, row))) for row in path.shape(t))]
    (tmp_path / "both.csv").write_text("\n".join(f"{a},{b}" for a, b in zip(lines, joints, strict=True)))
    back = read_recorded_motion(tmp_path / "both.csv", DIVER)
    np.testing.assert_allclose(back.base_attitude, motion.attitude(t), atol=1e-14, rtol=0)
    np.testing.assert_allclose(back.base_position, motion.base_position(t), atol=1e-15, rtol=0)
    with pytest.raises(TrajectoryError, match="right_shoulder_abduction"):
        read_recorded_motion(tmp_path / "motion.csv", DIVER)


def test_quaternions_a_little_off_are_normalised_and_others_refused(tmp_path):
    sample = Sample.random(SATELLITE)
    for scale in (1.0 + 9e-4, 1.0 - 9e-4):
        off = Sample(**(vars(sample) | {"quaternions": sample.quaternions * scale}))
        labels, values = with_base(off)
        write_delimited(tmp_path / "m.csv", [*labels, *sample.names], sample.ns / NANO, values)
        attitude = read_recorded_motion(tmp_path / "m.csv", SATELLITE).base_attitude
        np.testing.assert_allclose(
            attitude @ np.swapaxes(attitude, -1, -2), np.tile(np.eye(3), (12, 1, 1)), atol=1e-14, rtol=0
        )
    sample.quaternions[4] *= 1.0011
    labels, values = with_base(sample)
    write_delimited(tmp_path / "m.csv", [*labels, *sample.names], sample.ns / NANO, values)
    with pytest.raises(TrajectoryError, match="quaternion"):
        read_recorded_motion(tmp_path / "m.csv", SATELLITE)


# Names and units


def three(file, header, rows=((0.0, 0.1, 0.2), (0.5, 0.3, 0.1), (1.0, 0.2, 0.4))):
    file.write_text("\n".join([header, *(",".join(repr(float(v)) for v in row) for row in rows)]) + "\n")
    return file


def test_degrees_by_argument_are_for_turning_joints_only(tmp_path):
    sample = Sample.random(SATELLITE)
    write_delimited(tmp_path / "m.csv", sample.names, sample.ns / NANO, sample.degrees)
    path = read_shape_path(tmp_path / "m.csv", SATELLITE, degrees=True)
    np.testing.assert_allclose(path.shape(path.breaks), sample.in_body_order, atol=1e-14, rtol=0)
    write_opensim(tmp_path / "m.mot", sample.names, sample.ns / NANO, sample.degrees, False)
    path = read_shape_path(tmp_path / "m.mot", SATELLITE, degrees=True)
    np.testing.assert_allclose(path.shape(path.breaks), sample.in_body_order, atol=1e-14, rtol=0)


def test_a_header_without_units_is_asked_about(tmp_path):
    sample = Sample.random(SATELLITE)
    write_opensim(tmp_path / "m.mot", sample.names, sample.ns / NANO, sample.shapes, False, inDegrees=None)
    with pytest.raises(TrajectoryError, match="inDegrees"):
        read_shape_path(tmp_path / "m.mot", SATELLITE)
    path = read_shape_path(tmp_path / "m.mot", SATELLITE, degrees=False)
    np.testing.assert_allclose(path.shape(path.breaks), sample.in_body_order, atol=1e-15, rtol=0)


def test_what_closes_is_a_loop_unless_one_says_no(tmp_path):
    file = three(tmp_path / "m.csv", f"time,{LEFT},{RIGHT}", tuple((k / 8, *np.sin([k, 2 * k])) for k in range(8)))
    with pytest.raises(TrajectoryError, match="--close"):
        read_shape_path(file, DIVER, close=0.0)
    rows = [(k / 8, np.sin(np.pi * k / 4) + k**2 * (8 - k) / 500, 0.2) for k in range(8)] + [(1.0, 0.0, 0.2)]
    file = three(tmp_path / "m.csv", f"time,{LEFT},{RIGHT}", rows)
    ends = [read_shape_path(file, DIVER, close=c).rate([0.0, 1.0])[:, 0] for c in (None, False)]
    assert ends[0][0] == pytest.approx(ends[0][1], abs=1e-12)
    assert abs(ends[1][0] - ends[1][1]) > 1e-6


def test_smoothing_by_the_reader_reports_what_is_left(tmp_path):
    rng = np.random.default_rng(8)
    t = np.linspace(0.0, 4.0, 401)
    clean = np.stack([np.sin(t), 0.4 * np.cos(2.0 * t)], axis=1)
    write_delimited(tmp_path / "m.csv", DIVER.joint_names, t, clean + 0.01 * rng.normal(size=clean.shape))
    motion = read_recorded_motion(tmp_path / "m.csv", DIVER, smooth={RIGHT: 0.01})
    assert motion.residual[0] < 1e-14
    assert 0.009 < motion.residual[1] < 0.01
    both = read_recorded_motion(tmp_path / "m.csv", DIVER, smooth="0.01rad")
    np.testing.assert_allclose(both.residual, both.smoothing.residual, rtol=1e-12)
    # What is left of the noise has a share of the degrees of freedom in its squares, and the bias next to none.
    expected = 0.01 * np.sqrt(1.0 - both.smoothing.degrees_of_freedom / 401.0)
    np.testing.assert_allclose(both.residual, expected, rtol=0.05)
    assert motion.smoothing.noise.tolist() == [0.0, 0.01]
    assert both.record["smoothing"]["penalty_s5"] == dict(
        zip(DIVER.joint_names, both.smoothing.penalty.tolist(), strict=True)
    )
    given = read_recorded_motion(tmp_path / "m.csv", DIVER, smooth=0.01, smooth_penalty=1e-4)
    assert given.smoothing.penalty.tolist() == [1e-4, 1e-4]
    assert np.sqrt(np.mean((both.path.shape(t) - clean) ** 2)) < 0.004
    with pytest.raises(UnknownNameError, match="diver"):
        read_recorded_motion(tmp_path / "m.csv", DIVER, smooth={"elbow": 0.01})
    for level in (-0.1, np.nan, "much", [0.1, 0.2]):
        with pytest.raises(TrajectoryError, match="smooth"):
            read_recorded_motion(tmp_path / "m.csv", DIVER, smooth=level)


# Laws


@settings(max_examples=40, derandomize=True, deadline=None)
@given(
    drawn(np.float64, (6, 2), elements=st.floats(-3.1, 3.1)),
    drawn(np.int64, 6, elements=st.integers(10**4, 9 * 10**5)),
    st.sampled_from(["m.csv", "m.tsv", "m.npz"]),
)
def test_what_is_written_is_read_bit_by_bit(tmp_path_factory, shapes, steps, file):
    times = np.concatenate([[0.0], np.cumsum(steps)[:-1] / 1e6])
    path = sp.ShapePath.spline(times, shapes, joint_names=DIVER.joint_names)
    target = tmp_path_factory.mktemp("law") / file
    write_shape_path(path, target)
    with warnings.catch_warnings():
        # Splines through anything have any steps and leave the limits.
        warnings.simplefilter("ignore", TrajectoryWarning)
        back = read_recorded_motion(target, DIVER)
    np.testing.assert_array_equal(back.times, times)
    np.testing.assert_array_equal(back.path.breaks, path.breaks)
    # The samples of a spline are its knots' values, its last one to rounding.
    np.testing.assert_allclose(back.path.shape(times), path.shape(times), rtol=1e-12, atol=1e-12)


@pytest.mark.filterwarnings("ignore:.*is the first .* a pose that is no part of the motion")
@settings(max_examples=25, derandomize=True, deadline=None)
@given(drawn(np.float64, (7, 2), elements=st.floats(-179.0, 179.0)), st.floats(-1e5, 1e5), st.permutations([0, 1]))
def test_units_start_and_order_do_not_matter(tmp_path_factory, degrees, start, order):
    folder = tmp_path_factory.mktemp("law")
    times = np.arange(7) / 64.0
    names = [DIVER.joint_names[k] for k in order]
    write_delimited(folder / "a.csv", DIVER.joint_names, times, np.radians(degrees))
    write_delimited(folder / "b.csv", [f"{n}_deg" for n in names], times + np.round(start), degrees[:, order])
    write_opensim(folder / "c.mot", names, times + np.round(start), degrees[:, order], True)
    (folder / "d.yaml").write_text(yaml_trajectory(names, (times * NANO).astype(int), np.radians(degrees)[:, order]))
    t = np.linspace(0.0, times[-1], 50)
    first = read_shape_path(folder / "a.csv", DIVER).shape(t)
    for file in ("b.csv", "c.mot", "d.yaml"):
        np.testing.assert_allclose(read_shape_path(folder / file, DIVER).shape(t), first, rtol=0.0, atol=1e-12)


# ROS


def test_of_several_topics_one_is_chosen_by_name(tmp_path):
    sample, other = Sample.random(DIVER), Sample.random(DIVER, seed=9)
    topics = {
        "/a": states(sample.names, sample.ns, sample.shapes),
        "/b": trajectory(other.names, other.ns, other.shapes),
    }
    write_bag(tmp_path / "two.bag", topics, "rosbag1")
    with pytest.raises(TrajectoryError, match="/b"):
        read_shape_path(tmp_path / "two.bag", DIVER)
    with pytest.raises(UnknownNameError, match="/a, /b"):
        read_shape_path(tmp_path / "two.bag", DIVER, topic="/c")
    for topic, kept in (("/a", sample), ("/b", other)):
        path = read_shape_path(tmp_path / "two.bag", DIVER, topic=topic)
        np.testing.assert_allclose(path.shape(path.breaks), kept.in_body_order, atol=1e-14, rtol=0)


def test_trajectories_follow_each_other_by_their_headers(tmp_path):
    sample = Sample.random(DIVER)
    half, start = 6, int(sample.ns[6])
    first = (sample.names, sample.ns[:half], sample.shapes[:half])
    second = (sample.names[::-1], sample.ns[half:] - start, sample.shapes[half:, ::-1])
    kind, _ = trajectory(*first)

    def both(m):
        return [m.trajectory(NANO, *plain(first)), m.trajectory(NANO + start, *plain(second))]

    def plain(part):
        return part[0], [int(t) for t in part[1]], part[2]

    write_bag(tmp_path / "two", {"/command": (kind, both)}, "mcap")
    stamp = "header:\n  stamp: {{sec: {}, nanosec: {}}}\n"
    documents = [
        stamp.format((NANO + late) // NANO, (NANO + late) % NANO) + yaml_trajectory(*part)
        for late, part in ((0, first), (start, second))
    ]
    (tmp_path / "two.yaml").write_text("---\n".join(documents) + "---\n")
    for file in ("two", "two.yaml"):
        path = read_shape_path(tmp_path / file, DIVER)
        np.testing.assert_allclose(path.breaks, sample.ns / NANO, atol=1e-15, rtol=0)
        np.testing.assert_allclose(path.shape(path.breaks), sample.in_body_order, atol=1e-14, rtol=0)


# Bytes at random


@pytest.mark.parametrize("count", [15, pytest.param(2000, marks=pytest.mark.full)], ids=["few", "many"])
@pytest.mark.parametrize("file", [name for name in WRITERS if "." in name] + ["l.db3", "m.mcap"])
def test_a_damaged_file_is_an_error_or_a_finite_path(tmp_path, file, count):
    sample = Sample.random(SATELLITE)
    name = file.split(".")[0]
    written = tmp_path / (file if file in WRITERS else name)
    WRITERS[written.name](written, sample)
    good = bytearray((written if written.is_file() else written / file).read_bytes())
    rng = np.random.default_rng(17)
    errors = 0
    for _ in range(count):
        bad = bytearray(good)
        for _ in range(rng.integers(1, 6)):
            place, kind = int(rng.integers(len(bad))), rng.integers(4)
            if kind == 0:
                bad[place] = int(rng.integers(256))
            elif kind == 1:
                del bad[place : place + int(rng.integers(1, 40))]
            elif kind == 2:
                bad[place:place] = bad[place : place + int(rng.integers(1, 40))]
            else:
                bad[place:place] = bytes(rng.choice([b"-", b"9", b"e", b",", b"\n", b"\t", b":", b"nan", b"\xff"]))
            bad = bad or bytearray(b"\n")
        target = tmp_path / f"bad.{file.split('.')[1]}"
        target.write_bytes(bytes(bad))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", TrajectoryWarning)
            message, path = None, None
            try:
                path = read_shape_path(target, SATELLITE)
            except ShapePhaseError as error:
                message = str(error)
        if path is not None:
            assert np.isfinite(path.shape(np.linspace(0.0, path.duration, 50))).all()
        else:
            assert "bad." in (message or "")
            errors += 1
    assert errors > 0
