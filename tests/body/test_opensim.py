"""OpenSim models against OpenSim in a process of its own: poses, inertia, momentum, coupled coordinates, faults."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.body.engines.formats import format_of
from shapephase.errors import IgnoredElementWarning, MissingExtraError, ModelFileError
from support import opensim_oracle, osim_models
from support.osim_models import ARM, TRUNK, TWO, axes, axis, body, coordinate, coupler, joint, line, model, points

# Never imported here: its wheel has another CasADi.
needs_opensim = pytest.mark.skipif(find_spec("opensim") is None, reason="needs opensim")
EPS = np.finfo(float).eps
DRIVEN = {
    "hip_flexion_r": 0.4, "hip_adduction_r": -0.2, "hip_rotation_r": 0.3, "knee_angle_r": -0.9, "ankle_angle_r": 0.2,
    "hip_x_l": -0.3, "hip_y_l": 0.5, "hip_z_l": 0.1, "knee_angle_l": -0.7, "lumbar_bending": 0.2,
    "lumbar_extension": -0.4, "arm_flex_r": 0.8, "arm_add_r": -0.3, "reach": 0.12,
}  # fmt: skip


@pytest.fixture(scope="module")
def gait(tmp_path_factory):
    file = tmp_path_factory.mktemp("opensim") / "gait.osim"
    file.write_text(osim_models.gait(), encoding="utf-8")
    return sp.load_body(file)


def test_the_format_is_told_by_content():
    assert format_of(osim_models.gait().encode()) == "opensim"
    assert format_of(b'<robot name="OpenSimDocument"/>') is None


@pytest.mark.skipif(find_spec("opensim") is not None, reason="opensim is installed")
def test_without_opensim_it_is_said_what_to_install(tmp_path):
    (tmp_path / "gait.osim").write_text(osim_models.gait(), encoding="utf-8")
    with pytest.raises(MissingExtraError, match="shapephase"):
        sp.load_body(tmp_path / "gait.osim")


@needs_opensim
def test_coordinates_are_the_joints_that_move_by_themselves(gait):
    """The base's, the locked and the coupled coordinate are none of them; limits are those of clamped ones."""
    assert set(gait.joint_names) == set(DRIVEN)
    assert gait.joint_limits[gait.joint_index("knee_angle_r")].tolist() == [-2.0944, 0.1745]
    assert np.isinf(gait.joint_limits[gait.joint_index("hip_y_l")]).all()
    assert gait.joint_units[gait.joint_index("reach")] == "m"
    assert set(gait.link_names) == {part.split('"')[1] for part in osim_models.gait().split("<Body ")[1:]}
    assert gait.couplings["knee_angle_r_beta"].drivers == ("knee_angle_r",)
    assert gait.couplings["walker_knee_r_translation2"].drivers == ("knee_angle_r",)


@needs_opensim
def test_poses_inertia_and_momentum_are_opensims(gait, rng):
    """Beyond the ends of splines, too; of the coupled coordinate as OpenSim assembles it, to its own accuracy."""
    shapes = [DRIVEN | {"knee_angle_r": angle} for angle in (-2.0, -1.3, -0.2, 0.03, 0.17)]
    shapes += [{name: float(value) for name, value in zip(DRIVEN, rng.uniform(-0.7, 0.0, 14), strict=True)}]
    rates = [dict(zip(DRIVEN, rng.normal(size=14).tolist(), strict=True)) for _ in shapes]
    for shape, rate, found in zip(shapes, rates, opensim_oracle.asked(gait.file, "pelvis", shapes, rates), strict=True):
        r, v = gait.shape(shape), gait.shape(rate)
        assert abs(gait.mass - found["mass"]) < 16.0 * EPS * gait.mass
        for name, pose in found["poses"].items():
            np.testing.assert_allclose(gait.link_pose(r, name), pose, rtol=0, atol=2e-14, err_msg=name)
        np.testing.assert_allclose(gait.locked_inertia(r), found["inertia"], rtol=0, atol=1e-12 * 20.0)
        np.testing.assert_allclose(gait.internal_momentum(r, v), found["momentum"], rtol=0, atol=1e-12 * 20.0)
        beta = gait.couplings["knee_angle_r_beta"].at(shape)
        assert abs(beta - found["dependent"]["knee_angle_r_beta"]) < 8.0 * EPS
        assert abs(beta - found["assembled"]["knee_angle_r_beta"]) < 1e-6


@pytest.fixture(scope="module")
def acrobat(tmp_path_factory):
    file = tmp_path_factory.mktemp("opensim") / "acrobat.osim"
    file.write_text(osim_models.acrobat(), encoding="utf-8")
    return sp.load_body(file)


@needs_opensim
@pytest.mark.parametrize(("name", "base", "free"), [
    ("gait", "pelvis", osim_models.PELVIS), ("acrobat", "trunk", osim_models.ACROBAT_FREE)
])  # fmt: skip
def test_momentum_of_floating_motions_is_opensims(name, base, free, request, rng):
    """The base moves and turns, too, as coordinates of its own joint; every kind of joint and function is there."""
    file_body = request.getfixturevalue(name)
    low, high = np.clip(file_body.joint_limits, -1.0, 1.0).T
    shapes = rng.uniform(low, high, (3, file_body.n_shape))
    rates = rng.normal(size=shapes.shape)
    values, speeds = rng.uniform(-1.0, 1.0, (3, 6)), rng.normal(size=(3, 6))
    named = [
        [dict(zip((*file_body.joint_names, *free), row.tolist(), strict=True)) for row in np.hstack(pair)]
        for pair in ((shapes, values), (rates, speeds))
    ]
    for shape, rate, found in zip(shapes, rates, opensim_oracle.asked(file_body.file, base, *named), strict=True):
        inertia = file_body.locked_inertia(shape)
        momentum = inertia @ found["omega"] + file_body.internal_momentum(shape, rate)
        extent = np.abs(inertia).max()
        assert abs(file_body.mass - found["mass"]) < 16.0 * EPS * file_body.mass
        np.testing.assert_allclose(file_body.centre_of_mass(shape), found["centre"], rtol=0, atol=1e-14)
        np.testing.assert_allclose(inertia, found["inertia"], rtol=0, atol=1e-12 * extent)
        fast = np.linalg.norm(found["omega"]) + np.abs(rate).max()
        np.testing.assert_allclose(momentum, found["momentum"], rtol=0, atol=1e-12 * extent * fast)


@needs_opensim
@pytest.mark.full
@pytest.mark.parametrize(("name", "base", "free", "turns"), [
    ("gait", "pelvis", osim_models.PELVIS, osim_models.PELVIS[:3]),
    ("acrobat", "trunk", osim_models.ACROBAT_FREE, ()),
])  # fmt: skip
def test_a_floating_motion_is_that_of_opensim(name, base, free, turns, request, rng):
    """OpenSim integrates its own equations, with constraints for what is prescribed and what follows.

    Of the gait model, with a knee that it accelerates wrongly, its momentum is kept.
    """
    file_body = request.getfixturevalue(name)
    low, high = np.clip(file_body.joint_limits, -1.0, 1.0).T
    middle, size, phase = 0.5 * (low + high), 0.3 * (high - low), rng.uniform(0.0, 6.0, file_body.n_shape)
    harmonic = rng.integers(1, 3, file_body.n_shape)
    cosines, sines = np.zeros((2, file_body.n_shape, 2))
    rows = np.arange(file_body.n_shape)
    cosines[rows, harmonic - 1], sines[rows, harmonic - 1] = size * np.sin(phase), size * np.cos(phase)
    path = sp.ShapePath.fourier(middle, cosines, sines, 2.0, joint_names=file_body.joint_names)
    times = [0.0, 0.5, 1.0]
    waves = np.stack([middle, size, np.pi * harmonic, phase], axis=1).tolist()
    start = dict(zip(free, np.stack([rng.uniform(-0.3, 0.3, 6), rng.normal(size=6)], axis=1).tolist(), strict=True))
    found = opensim_oracle.flown(
        file_body.file, base, dict(zip(file_body.joint_names, waves, strict=True)), start, times, turns
    )
    expected = np.array([one["attitude"] for one in found])
    motion = sp.reconstruct(sp.articulated(file_body, path), found[0]["momentum"], expected[0], tolerance=1e-11)
    assert sp.so3.angle(expected[0].T @ expected[-1]) > 0.3, "a motion that turns nothing shows nothing"
    np.testing.assert_allclose(motion.attitude(np.array(times)), expected, rtol=0, atol=1e-8)


MOT = """motion
version=1
nRows={rows}
nColumns={columns}
inDegrees=yes
endheader
time\t{names}
{lines}
"""


@needs_opensim
def test_a_motion_of_opensim_runs(gait, tmp_path):
    """The columns that inverse kinematics writes: the base's angles, coupled and locked coordinates among them."""
    names = [*osim_models.PELVIS, *DRIVEN, "knee_angle_r_beta", "subtalar_angle_r"]
    times = np.linspace(0.0, 1.0, 31)
    swings = np.sin(2.0 * np.pi * (times + 0.1 * np.arange(14)[:, None]))
    columns = {name: 20.0 * value * swing for (name, value), swing in zip(DRIVEN.items(), swings, strict=True)}
    columns["knee_angle_r"] = -60.0 + 55.0 * np.cos(2.0 * np.pi * times)
    columns["knee_angle_l"] = -40.0 + 20.0 * np.sin(2.0 * np.pi * times)
    columns["reach"] = 0.1 + 0.05 * np.sin(2.0 * np.pi * times)
    follows = gait.couplings["knee_angle_r_beta"]
    columns["knee_angle_r_beta"] = np.degrees(
        [follows.at({"knee_angle_r": angle}) for angle in np.radians(columns["knee_angle_r"])]
    )
    columns["subtalar_angle_r"] = np.full_like(times, np.degrees(0.1))
    columns |= {name: np.full_like(times, 5.0) for name in osim_models.PELVIS}
    rows = np.column_stack([times, *(columns[name] for name in names)])
    lines = "\n".join("\t".join(f"{value:.12g}" for value in row) for row in rows)
    file = tmp_path / "walk.mot"
    file.write_text(MOT.format(rows=31, columns=len(names) + 1, names="\t".join(names), lines=lines))
    path = sp.read_shape_path(file, gait)
    motion = sp.reconstruct(sp.articulated(gait, path), [1.0, 0.5, -2.0], tolerance=1e-9)
    assert len(motion.deformation.breaks) > len(path.breaks)
    # Nothing that the body follows by is given in advance: the equation of the attitude alone.
    end = 0.12
    place = solve_ivp(
        lambda t, q: _rate(gait, path, t, q), (0.0, end), [0.0, 0.0, 0.0, 1.0], method="DOP853", rtol=1e-10, atol=1e-12
    ).y[:, -1]  # fmt: skip
    assert sp.so3.angle(motion.attitude(end).T @ sp.so3.matrix_from_quat(place / np.linalg.norm(place))) < 1e-7


def _rate(gait, path, t, q):
    """Of a quaternion x y z w, from I w + L_o = R^T mu."""
    shape, rate = path.shape(t), path.rate(t)
    turn = sp.so3.matrix_from_quat(q / np.linalg.norm(q))
    pi = turn.T @ [1.0, 0.5, -2.0] - gait.internal_momentum(shape, rate)
    w = np.linalg.solve(gait.locked_inertia(shape), pi)
    return 0.5 * np.append(q[3] * w + np.cross(q[:3], w), -q[:3] @ w)


@needs_opensim
def test_a_recorded_base_is_in_the_axes_of_the_pelvis(gait, tmp_path):
    """Angles about the pelvis' own axes, in the order of the joint to the ground."""
    assert gait.base_angles == (osim_models.PELVIS[:3], "zxy")
    names = [*osim_models.PELVIS, *DRIVEN]
    rows = [[t, 20.0 * t, -30.0 * t, 50.0 * t, t, 1.0, 0.0, *([0.0] * 14)] for t in (0.0, 0.5, 1.0)]
    lines = "\n".join("\t".join(map(str, row)) for row in rows)
    file = tmp_path / "turn.mot"
    file.write_text(MOT.format(rows=3, columns=len(names) + 1, names="\t".join(names), lines=lines))
    found = sp.read_recorded_motion(file, gait).base_attitude
    expected = Rotation.from_euler("ZXY", [[20.0 * t, -30.0 * t, 50.0 * t] for t in (0.0, 0.5, 1.0)], degrees=True)
    np.testing.assert_allclose(found, expected.as_matrix(), rtol=0, atol=1e-14)


@needs_opensim
def test_nothing_is_written_where_it_is_read(gait):
    assert [entry.name for entry in gait.file.parent.iterdir()] == ["gait.osim"]


TWICE = points("SimmSpline", (0.0, 0.0, 1.0), (1.0, 2.0, 3.0))


@needs_opensim
@pytest.mark.full
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (model(TWO, [TRUNK, ARM.replace("PinJoint", "BallJoint").replace("</Coordinate>", "</Coordinate>", 1)]),
         "joint 'elbow' is a BallJoint; .* are supported"),
        (model(TWO, [TRUNK, joint("PinJoint", "elbow", "ground", "arm", [coordinate("bend")])]),
         "one joint to the ground is needed, .* got 'ground_pelvis', 'elbow'"),
        (model(TWO, [TRUNK, joint("CustomJoint", "elbow", "trunk", "arm", [coordinate("bend")],
                                  transform=axes(axis(0, "1 0 0", '<StepFunction name="function"/>', "bend")))]),
         "'elbow': a StepFunction cannot be taken over exactly"),
        (model(TWO, [TRUNK, ARM], [coupler("c", "bend", "pelvis_tilt", line(1.0, 0.0))]),
         "coordinate 'bend' follows 'pelvis_tilt', which is the base's or unknown"),
        (model(TWO, [TRUNK, joint("CustomJoint", "elbow", "trunk", "arm", [coordinate("bend")],
                                  transform=axes(axis(0, "1 0 0", TWICE, "bend")))]),
         "knots must ascend|OpenSim does not accept it"),
        (model(TWO, [TRUNK, ARM])[:-300], "OpenSim does not accept it"),
        (model(TWO, [TRUNK, ARM, joint("PinJoint", "again", "trunk", "arm", [coordinate("twist")])]),
         "body 'arm' hangs on two joints, 'elbow' and 'again'"),
        (model(TWO, [TRUNK, joint("UniversalJoint", "elbow", "trunk", "arm", [coordinate("a"), coordinate("b")])],
               [coupler("c", "a", "b", line(1.0, 0.1)), coupler("d", "b", "a", line(1.0, 0.1))]),
         "coordinate 'a' follows itself, by way of others"),
        (model(TWO, [TRUNK, ARM]).replace("<mass>1.0<", "<mass>nan<"), "OpenSim does not accept it: .*invalid mass"),
        (model(TWO, [TRUNK]), "arm"),
    ],
)  # fmt: skip
def test_what_cannot_be_a_body_is_refused(text, said, tmp_path):
    (tmp_path / "two.osim").write_text(text, encoding="utf-8")
    with pytest.raises(ModelFileError, match=said):
        sp.load_body(tmp_path / "two.osim")


@needs_opensim
def test_a_joint_to_the_ground_with_few_coordinates_floats(tmp_path):
    root = joint("PinJoint", "axle", "ground", "trunk", [coordinate("turn")], places=("0 1 0", "0 0.2 0"))
    bar = (
        '<PointConstraint name="bar"><isEnforced>true</isEnforced><socket_body_1>/bodyset/arm</socket_body_1>'
        "<socket_body_2>/ground</socket_body_2></PointConstraint>"
    )
    (tmp_path / "two.osim").write_text(model(TWO, [root, ARM]).replace("<objects>\n</objects></ConstraintSet>",
                                       f"<objects>{bar}</objects></ConstraintSet>"), encoding="utf-8")  # fmt: skip
    with pytest.warns(IgnoredElementWarning, match="'axle'"):
        found = sp.load_body(tmp_path / "two.osim")
    assert found.joint_names == ("bend",)


@needs_opensim
@pytest.mark.full
def test_one_of_several_trees_is_named_and_speeds_of_the_file_do_not_count(tmp_path):
    """A ball beside the body is left out; the base's speed in the file has no part in the momentum of the joints."""
    ball = body("ball", 0.4, "0 0 0", "0.001 0.001 0.001 0 0 0")
    free = joint("FreeJoint", "flight", "ground", "ball", [coordinate(f"ball_{k}", clamped=False) for k in range(6)])
    text = model([ball, *TWO], [free, TRUNK, ARM]).replace(
        '<Coordinate name="pelvis_tilt">', '<Coordinate name="pelvis_tilt"><default_speed_value>2</default_speed_value>'
    )
    (tmp_path / "three.osim").write_text(text, encoding="utf-8")
    with pytest.raises(ModelFileError, match="'flight'"):
        sp.load_body(tmp_path / "three.osim")
    with pytest.raises(ModelFileError, match="'arm'"):
        sp.load_body(tmp_path / "three.osim", root_body="arm")
    with pytest.warns(IgnoredElementWarning, match="elsewhere"):
        found = sp.load_body(tmp_path / "three.osim", root_body="trunk")
    assert (found.joint_names, found.mass) == (("bend",), 3.0)


@needs_opensim
@pytest.mark.filterwarnings("ignore::shapephase.errors.IgnoredElementWarning")
def test_the_coordinates_of_a_planar_root_are_the_recorded_base(tmp_path):
    """Along x and y of the ground, and about its z (`PlanarJoint`)."""
    moves = [coordinate(name) for name in ("tilt", "tx", "ty")]
    joints = [
        joint("PlanarJoint", "root", "ground", "trunk", moves),
        ARM,
    ]
    (tmp_path / "flat.osim").write_text(model(TWO, joints), encoding="utf-8")
    body = sp.load_body(tmp_path / "flat.osim")
    times = np.linspace(0.0, 1.0, 21)
    rows = np.column_stack([times, 0.4 * times, 0.1 * times, np.cos(times), np.sin(times)])
    np.savetxt(tmp_path / "m.csv", rows, delimiter=",", header="time,tilt,tx,ty,bend", comments="", fmt="%.17g")
    recorded = sp.read_recorded_motion(tmp_path / "m.csv", body)
    want = Rotation.from_euler("z", 0.4 * times[:, None]).as_matrix()
    np.testing.assert_allclose(recorded.base_attitude, want, rtol=0, atol=1e-15)
    places = np.column_stack([0.1 * times, np.cos(times), 0.0 * times])
    np.testing.assert_allclose(recorded.base_position, places, rtol=0, atol=1e-15)
    assert body.joint_names == ("bend",)
