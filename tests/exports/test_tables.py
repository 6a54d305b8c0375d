"""Tables and data sets, read back by their own libraries and by our readers: every digit is there."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import MissingExtraError, ShapeError, UnknownNameError
from support.independent import body_of, random_loop

TIMES = np.sort(np.random.default_rng(71).uniform(0.0, 2.0, 50))
FALL = {"start": [0.5, -0.2, 3.0], "velocity": [1.0, 0.3, 2.0], "gravity": [0.0, 0.0, -9.81]}
ENDINGS = (".csv", ".parquet", ".mat", ".h5")


@pytest.fixture(scope="module")
def motion():
    """Of the satellite: joints in radians and in metres."""
    body = body_of("satellite")
    loop = random_loop(72, body.n_shape)
    middle = np.where(np.array(body.joint_units) == "m", 0.9, loop.mean)
    return sp.reconstruct(sp.articulated(body, replace(loop, mean=middle).path), [3.0, -1.0, 2.0])


@pytest.fixture(scope="module")
def expected(motion):
    found = sp.exports.mujoco_arrays(motion, TIMES, **FALL)
    # MuJoCo's arrays have the joints in its own order.
    joints = np.array([found.joint_names.index(name) for name in body_of("satellite").joint_names])
    return {
        "time": TIMES,
        "shapes": found.qpos[:, 7 + joints],
        "shape_rates": found.qvel[:, 6 + joints],
        "base_position": found.qpos[:, :3],
        "base_velocity": found.qvel[:, :3],
        "base_quat_xyzw": found.qpos[:, [4, 5, 6, 3]],
        "angular_velocity": found.qvel[:, 3:6],
    }


def by_netcdf(file):
    import xarray

    with xarray.open_dataset(file, engine="scipy") as found:
        found.load()
    return {name: found[name].values for name in found.variables}, found.attrs


def by_matlab(file):
    from scipy.io import loadmat

    found = loadmat(file, squeeze_me=True)
    return found, found


def by_hdf5(file):
    import h5py

    with h5py.File(file) as found:
        return {name: found[name][()] for name in found}, dict(found.attrs)


@pytest.mark.parametrize(("ending", "read"), [(".nc", by_netcdf), (".mat", by_matlab), (".h5", by_hdf5)])
def test_arrays_come_back_bit_by_bit(motion, expected, tmp_path, ending, read):
    sp.export_motion(motion, tmp_path / f"motion{ending}", TIMES, **FALL)
    found, about = read(tmp_path / f"motion{ending}")
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)
    names = found["joint_names"] if "joint_names" in found else found["joint"]
    assert (
        tuple(one.decode() if isinstance(one, bytes) else str(one) for one in names) == body_of("satellite").joint_names
    )
    np.testing.assert_array_equal(about["momentum"], motion.momentum)
    assert float(about["error_estimate"]) == float(motion.error_estimate)
    assert json.loads(str(about["provenance"]))["versions"]["shapephase"] == sp.__version__


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_tables_come_back_bit_by_bit(motion, expected, tmp_path, ending):
    pandas = pytest.importorskip("pandas")
    sp.export_motion(motion, tmp_path / f"motion{ending}", TIMES, **FALL)
    file = tmp_path / f"motion{ending}"
    if ending == ".parquet":
        read = pandas.read_parquet(file)
        labels, found = list(read.columns), read.to_numpy()
    else:
        labels, found = file.read_text().splitlines()[0].split(","), np.loadtxt(file, delimiter=",", skiprows=1)
    parts = ("time", "base_quat_xyzw", "angular_velocity", "base_position", "base_velocity", "shapes")
    own = np.column_stack([expected[name] for name in parts])
    np.testing.assert_array_equal(found[:, : own.shape[1]], own)
    # Its wings are named left and right, so that somersaults are counted.
    turns = [f"{turn}{error}_rad" for error in ("", "_error") for turn in ("somersault", "tilt", "twist")]
    assert labels[own.shape[1] :] == turns
    np.testing.assert_array_equal(found[:, -6:-3], np.transpose(motion.somersault_tilt_twist(TIMES)))
    np.testing.assert_array_equal(found[:, -3:], np.transpose(motion.somersault_errors(TIMES)))
    boom = "boom_extension" if ending == ".parquet" else "boom_extension [m]"
    assert boom in labels
    if ending == ".parquet":
        from pyarrow.parquet import read_schema

        assert read_schema(file).field("boom_extension").metadata == {b"unit": b"m"}


def test_momenta_of_links_are_a_column_set_that_readers_leave_out(motion, expected, tmp_path):
    pandas = pytest.importorskip("pandas")
    sp.export_motion(motion, tmp_path / "motion.csv", TIMES, links=True, **FALL)
    found, momentum = pandas.read_csv(tmp_path / "motion.csv"), sp.segment_momentum(motion, times=TIMES)
    for k, link in enumerate(momentum.links):
        columns = [f"{link}_momentum_{axis}_kg_m2_s" for axis in "xyz"]
        np.testing.assert_array_equal(found[columns].to_numpy(), momentum.by_link[:, k])
    again = sp.read_recorded_motion(tmp_path / "motion.csv", body_of("satellite"), close=False)
    np.testing.assert_allclose(again.path.shape(again.times), expected["shapes"], rtol=0, atol=1e-12)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.usefixtures("warm_readers")
def test_our_readers_find_joints_and_base(motion, expected, tmp_path, ending):
    sp.export_motion(motion, tmp_path / f"motion{ending}", TIMES, **FALL)
    found = sp.read_recorded_motion(tmp_path / f"motion{ending}", body_of("satellite"), close=False)
    np.testing.assert_allclose(found.times, TIMES - TIMES[0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.path.shape(found.times), expected["shapes"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.base_position, expected["base_position"], rtol=0, atol=1e-14)
    assert np.max(sp.so3.angle(sp.so3.transpose(motion.attitude(TIMES)) @ found.base_attitude)) < 1e-14


def test_the_data_set_has_units_and_is_a_table_of_joints_for_our_reader(motion, expected):
    found = motion.to_xarray(TIMES, **FALL)
    assert dict(found.sizes) == {"time": 50, "quaternion": 4, "axis": 3, "joint": 10, "turn": 3}
    assert found.base_velocity.units == "m/s"
    assert found.joint_unit.sel(joint="boom_extension").item() == "m"
    boom = body_of("satellite").joint_index("boom_extension")
    np.testing.assert_array_equal(found.shapes.sel(joint="boom_extension"), expected["shapes"][:, boom])
    again = sp.read_shape_path(found[["shapes"]], body_of("satellite"), close=False)
    np.testing.assert_allclose(again.shape(TIMES - TIMES[0]), expected["shapes"], rtol=0, atol=1e-12)


@pytest.mark.parametrize("ending", [*ENDINGS, ".nc"])
def test_a_body_without_joints_has_its_base(tmp_path, ending):
    """A rigid body and a motion from a file; in closed form it turns by 2 rad/s."""
    made = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 2.0), [0.0, 0.0, 5.0])
    made.save(tmp_path / "motion.npz")
    for motion in (made, sp.load_motion(tmp_path / "motion.npz")):
        sp.export_motion(motion, tmp_path / f"motion{ending}", [0.0, 1.0])
        found = motion.to_xarray([0.0, 1.0])
        np.testing.assert_allclose(found.angular_velocity, [[0, 0, 2.0], [0, 0, 2.0]], rtol=0, atol=1e-9)
        np.testing.assert_allclose(found.base_quat_xyzw[1], [0, 0, np.sin(1.0), np.cos(1.0)], rtol=0, atol=1e-9)
        assert "shapes" not in found


def test_what_cannot_be_written_is_refused(motion, tmp_path, monkeypatch):
    with pytest.raises(UnknownNameError, match=r"\.parquet"):
        sp.export_motion(motion, tmp_path / "motion.docx")
    with pytest.raises(ShapeError, match="batch"):
        sp.reconstruct(motion.deformation, np.zeros((2, 3))).to_xarray()
    with pytest.raises(ShapeError, match="row"):
        sp.export_motion(motion, tmp_path / "motion.csv", [[0.0, 1.0]])
    import sys

    for ending, package in ((".nc", "xarray"), (".parquet", "pyarrow"), (".h5", "h5py")):
        with monkeypatch.context() as without:
            without.setitem(sys.modules, package, None)
            with pytest.raises(MissingExtraError, match="pip"):
                sp.export_motion(motion, tmp_path / f"motion{ending}")
    assert list(tmp_path.iterdir()) == []


def test_modified_rodrigues_parameters_stand_instead_of_quaternions_and_are_read(motion, tmp_path):
    sp.export_motion(motion, tmp_path / "motion.csv", TIMES, mrp=True)
    header = (tmp_path / "motion.csv").read_text().splitlines()[0].split(",")
    assert header[1:4] == ["base_mrp_1", "base_mrp_2", "base_mrp_3"]
    assert "qw" not in header
    columns = np.loadtxt(tmp_path / "motion.csv", delimiter=",", skiprows=1)
    found = Rotation.from_mrp(columns[:, 1:4]).as_matrix()
    np.testing.assert_allclose(found, motion.attitude(TIMES), rtol=0, atol=1e-14)
    recorded = sp.read_recorded_motion(tmp_path / "motion.csv", body_of("satellite"))
    np.testing.assert_allclose(recorded.base_attitude, motion.attitude(TIMES), rtol=0, atol=1e-14)


def test_a_bag_has_joints_pose_and_transform_at_whole_nanoseconds(motion, tmp_path):
    """Read by rosbags; our reader takes its joints."""
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    file, store = tmp_path / "motion.mcap", get_typestore(Stores.ROS2_HUMBLE)
    sp.export_motion(motion, file, TIMES, **FALL)
    whole = np.round(TIMES * 1e9) / 1e9
    expected = sp.exports.pinocchio_arrays(motion, whole, **FALL)
    shapes = motion.deformation.description.path.curve(whole)
    found = {"/base_pose": [], "/tf": [], "/joint_states": []}
    with Reader(file) as bag:
        for connection, stamp, data in bag.messages():
            found[connection.topic].append((stamp, store.deserialize_cdr(data, connection.msgtype)))
    for topic, messages in found.items():
        assert [stamp for stamp, _ in messages] == np.round(TIMES * 1e9).astype(int).tolist(), topic
    for row, (_, message) in enumerate(found["/base_pose"]):
        turned, place = message.pose.orientation, message.pose.position
        pose = [place.x, place.y, place.z, turned.x, turned.y, turned.z, turned.w]
        np.testing.assert_allclose(pose, expected.q[row, :7], rtol=0, atol=1e-14)
        (frame,) = found["/tf"][row][1].transforms
        assert (frame.header.frame_id, frame.child_frame_id) == ("world", body_of("satellite").link_names[0])
        assert (frame.transform.rotation.w, frame.transform.translation.z) == (turned.w, place.z)
        state = found["/joint_states"][row][1]
        assert tuple(state.name) == body_of("satellite").joint_names
        np.testing.assert_allclose(state.position, shapes[0][row], rtol=0, atol=1e-15)
        np.testing.assert_allclose(state.velocity, shapes[1][row], rtol=0, atol=1e-14)
    read = sp.read_shape_path(file, body_of("satellite"))
    np.testing.assert_allclose(read.shape(whole - whole[0]), shapes[0], rtol=0, atol=1e-9)
    with pytest.raises(ShapeError, match="quaternions"):
        sp.export_motion(motion, file, TIMES, mrp=True)
