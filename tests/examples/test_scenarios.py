"""Named motions: their known answers, the files beside the bodies, the plausibility of the bodies."""

from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.body.catalog import robots_folder
from shapephase.errors import ShapeError, TrajectoryError, UnknownNameError
from shapephase.examples import (
    MOTIONS,
    cat_righting,
    cat_righting_twist,
    diver_twist,
    full_dive,
    kane_scher,
    named_motion,
)

# What is computed is the same with and without machine code, which is quicker.

FILES = {
    "cat_righting": 400,
    "astronaut_arm_circles": 100,
    "astronaut_leg_swing": 100,
    "antenna_deployment": 120,
}


def turned(name, path=None):
    """The rotation of a named motion at zero momentum."""
    body = sp.load_body(MOTIONS[name].body)
    return sp.reconstruct(sp.articulated(body, path or named_motion(name)), np.zeros(3), tolerance=1e-11).final_attitude


# Found by DOP853 on Pinocchio's ccrba and (all but the last) by fourth-order Magnus steps on kinematics in NumPy.
KNOWN = {
    "cat_righting": np.diag([1.0, -1.0, -1.0]),
    "cat_righting_twist": np.diag([1.0, -1.0, -1.0]),
    "astronaut_arm_circles": so3.exp(np.array([0.0, 0.206386036527, 0.0])),
    "astronaut_leg_swing": so3.exp(np.array([0.0, 0.215596595975, 0.0])),
    "antenna_deployment": so3.exp(np.array([-0.003736510923, -0.085913209531, 0.048278938397])),
    "satellite_sweep": so3.exp(np.array([-0.011417273673, 0.007584277655, -0.093342749251])),
}


@pytest.mark.parametrize("name", KNOWN)
def test_named_motions_turn_as_known(name):
    assert so3.angle(turned(name).T @ KNOWN[name]) < 1e-11


@pytest.mark.parametrize("name", MOTIONS)
def test_rates_are_the_derivatives_of_the_shapes(name):
    path = named_motion(name)
    t = np.random.default_rng(0).uniform(0.02, 0.98, 40) * path.duration
    h = 1e-4 * path.duration
    # Differences of the sixth order are those of one smooth piece.
    t = t[np.abs(t[:, None] - path.breaks).min(axis=1) > 3.0 * h]
    ahead, behind = ([path.shape(t + s * k * h) for k in (1, 2, 3)] for s in (1, -1))
    slope = sum(w * (a - b) for w, a, b in zip((0.75, -0.15, 1 / 60), ahead, behind, strict=True)) / h
    np.testing.assert_allclose(path.rate(t), slope, atol=1e-8 * (1.0 + np.abs(slope).max()), rtol=0)


@pytest.mark.parametrize("name", MOTIONS)
def test_joints_stay_within_their_limits(name):
    path, body = named_motion(name), sp.load_body(MOTIONS[name].body)
    shapes = path.matched(body.joint_names, body.name).shape(np.linspace(0.0, path.duration, 501))
    assert np.all(shapes >= body.joint_limits[:, 0] - 1e-12)
    assert np.all(shapes <= body.joint_limits[:, 1] + 1e-12)


@pytest.mark.parametrize("name", MOTIONS)
def test_joints_keep_the_rates_and_efforts_of_their_files(name):
    """Limits by the URDF's own text, rates by differences of shapes; at the momentum that the motion is made for."""
    path, body = named_motion(name), sp.load_body(MOTIONS[name].body)
    tree = ElementTree.parse(robots_folder() / f"{MOTIONS[name].body}.urdf")
    limits = {joint.get("name"): joint.find("limit") for joint in tree.iter("joint")}
    stated = [limits[joint].attrib if limits.get(joint) is not None else {} for joint in path.joint_names]
    most = np.array([float(limit.get("velocity", 0.0)) or np.inf for limit in stated])
    times = np.linspace(0.0, path.duration, 4001)
    rates = np.abs(np.diff(path.shape(times), axis=0)).max(axis=0) / times[1]
    assert np.all(rates <= most), dict(zip(path.joint_names, rates / most, strict=True))
    summary = sp.path_summary(body, path)
    assert (summary.joints_beyond_limits, summary.joints_beyond_rates) == ((), ())
    # The last words of a dive's description are its momentum.
    momentum = [float(word) for word in MOTIONS[name].about.split()[-3:]] if body.name == "diver" else np.zeros(3)
    loads = sp.joint_torques(sp.reconstruct(sp.articulated(body, path), momentum, tolerance=1e-6)).loads
    efforts = [
        float(limits[joint].get("effort", 0.0)) or np.inf if joint in limits else np.inf for joint in loads.joint_names
    ]
    assert np.all(loads.peak_torque <= efforts)


@pytest.mark.parametrize("name", [name for name in MOTIONS if MOTIONS[name].body.startswith("cat")])
def test_cats_begin_on_their_backs_and_end_on_their_feet(name):
    """Where the legs' centre of mass is from the trunk's; of the cat without legs, where both halves' bellies are."""
    path, body = named_motion(name), sp.load_body(MOTIONS[name].body)
    start = Rotation.from_quat(MOTIONS[name].attitude).as_matrix()
    motion = sp.reconstruct(sp.articulated(body, path), np.zeros(3), start)
    heights = []
    for t in (0.0, path.duration):
        shape = path.matched(body.joint_names, body.name).shape(t)
        if body.name == "cat_two_halves":
            bellies = [motion.attitude(t) @ -body.link_pose(shape, half)[:3, 2] for half in ("front", "rear")]
            np.testing.assert_allclose(bellies[0][2], bellies[1][2], atol=1e-6, rtol=0)
            heights.append(bellies[0][2])
            continue
        sums = {"leg": np.zeros(4), "trunk": np.zeros(4)}
        for part in sp.body_summary(body).parts:
            pose = body.link_pose(shape, part.links[0])
            kind = next((kind for kind in sums if kind in part.links[0]), None)
            if kind is not None:
                sums[kind] += part.mass * np.append(pose[:3, :3] @ part.centre_of_mass + pose[:3, 3], 1.0)
        legs, trunk = (total[:3] / total[3] for total in (sums["leg"], sums["trunk"]))
        away = motion.attitude(t) @ (legs - trunk)
        heights.append(away[2] / np.linalg.norm(away))
    assert heights == pytest.approx([-heights[1], heights[1]], abs=1e-6)
    assert heights[0] > 0.7


def test_the_cat_rights_itself_from_rest_to_rest():
    path = cat_righting(0.7)
    assert path.duration == 0.7
    ends = path.rate([0.0, 0.7])
    np.testing.assert_allclose(ends, 0.0, atol=1e-12, rtol=0)
    np.testing.assert_allclose(path.shape([0.0, 0.7]), 0.0, atol=1e-12, rtol=0)
    assert so3.angle(turned("cat_righting", path) @ np.diag([1.0, -1.0, -1.0])) < 1e-10


def test_the_cat_that_twists_bends_less_and_rights_itself_too():
    """From rest to rest, by DOP853; the waist's largest bend is the angle between the halves' long axes."""
    body, paths = sp.load_body("cat"), [cat_righting(), cat_righting_twist()]
    bends = []
    for path in paths:
        poses = np.array(
            [body.link_pose(shape, "trunk_rear") for shape in path.shape(np.linspace(0.0, path.duration, 101))]
        )
        bends.append(np.degrees(np.arccos(poses[:, 0, 0])).max())
        np.testing.assert_allclose(path.rate([0.0, path.duration]), 0.0, atol=1e-12, rtol=0)
    np.testing.assert_allclose(bends, [100.77, 91.10], atol=0.01)
    moving = sp.articulated(body, paths[1])
    end = sp.reconstruct(moving, np.zeros(3), method="dop853", tolerance=1e-10).final_attitude
    assert so3.angle(end @ np.diag([1.0, -1.0, -1.0])) < 1e-9


@pytest.mark.parametrize("duration", [1.5, 2.0])
def test_the_diver_makes_one_and_a_half_somersaults_and_a_twist(duration):
    """The end, 2.7531041e-4 rad about x from half a turn about y, was found by DOP853 on Pinocchio's ccrba, too."""
    path, body = diver_twist(duration), sp.load_body("diver")
    motion = sp.reconstruct(sp.articulated(body, path), [0.0, 92.33824672424812 / duration, 0.0], tolerance=1e-10)
    end = so3.exp(np.array([2.7531041e-4, 0.0, 0.0])) @ np.diag([-1.0, 1.0, -1.0])
    assert so3.angle(motion.final_attitude.T @ end) < 1e-9
    attitudes = motion.attitude(np.linspace(0.0, duration, 300))
    # The long axis goes round the momentum, and the momentum round the long axis.
    somersault = np.unwrap(np.arctan2(attitudes[:, 0, 2], attitudes[:, 2, 2]))
    twist = np.unwrap(np.arctan2(-attitudes[:, 1, 0], attitudes[:, 1, 1]))
    np.testing.assert_allclose([somersault[-1], twist[-1]], [3.0 * np.pi, 2.0 * np.pi], atol=1e-6)
    assert so3.angle(turned("diver_twist", path)) < 1e-11


@pytest.mark.parametrize("duration", [1.5, 2.3])
def test_the_dive_of_five_stages_lands_f10(duration):
    """With the stated somersaults and twist to 1e-9; by DOP853 too, and the pieces of the phase add up."""
    dive = full_dive(duration)
    motion = sp.reconstruct(dive.deformation, dive.momentum, tolerance=1e-10)
    landing = so3.exp(np.array([0.0, 3.0 * np.pi, 0.0]))
    assert so3.angle(motion.final_attitude.T @ landing) < 1e-9
    attitudes = motion.attitude(np.linspace(0.0, duration, 300))
    somersault = np.unwrap(np.arctan2(attitudes[:, 0, 2], attitudes[:, 2, 2]))
    twist = np.unwrap(np.arctan2(-attitudes[:, 1, 0], attitudes[:, 1, 1]))
    np.testing.assert_allclose([somersault[-1], twist[-1]], [3.0 * np.pi, 2.0 * np.pi], atol=1e-9, rtol=0)
    # First and last nothing but a somersault about the momentum.
    breaks = dive.deformation.description.path.breaks
    for time in (breaks[1], breaks[4]):
        alone = so3.exp(np.array([0.0, dive.momentum[1] / dive.deformation.inertia(0.0)[1, 1] * breaks[1], 0.0]))
        expected = alone if time == breaks[1] else landing @ alone.T
        assert so3.angle(motion.attitude(time).T @ expected) < 1e-9
    other = sp.reconstruct(dive.deformation, dive.momentum, method="dop853", tolerance=1e-10)
    assert so3.angle(other.final_attitude.T @ landing) < 1e-9
    split = sp.split(motion, "base")
    assert so3.wrap(split.montgomery_phase - dive.phase) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.full
def test_a_plan_makes_the_dive_of_five_stages_too_f10():
    """With the momentum of the dive, counted in somersaults and twists, and for less than its cost."""
    dive, body = full_dive(1.5), sp.load_body("diver")
    path = dive.deformation.description.path
    goal = sp.optimal_control.Goal(somersaults=1.5, half_twists=2)
    plan = sp.plan_reorientation(body, goal, momentum=dive.momentum, duration=1.5, start=path.shape(0.0), cost="rate")
    attitudes = plan.motion.attitude(np.linspace(0.0, 1.5, 600))
    somersault = np.unwrap(np.arctan2(attitudes[:, 0, 2], attitudes[:, 2, 2]))
    twist = np.unwrap(np.arctan2(attitudes[:, 1, 0], attitudes[:, 1, 1]))
    assert somersault[-1] == pytest.approx(3.0 * np.pi, abs=1e-8)
    assert abs(twist[-1] - twist[0]) == pytest.approx(2.0 * np.pi, abs=1e-8)
    times = np.linspace(0.0, 1.5, 20001)
    rates = path.curve(times)[1]
    assert plan.cost < 0.2 * np.trapezoid(np.sum(rates**2, axis=1), times)


def test_the_pace_of_a_named_motion_does_not_matter():
    slow = turned("kane_scher", kane_scher(np.radians(20.0), np.radians(61.813873), 3.0))
    assert so3.angle(slow.T @ turned("kane_scher")) < 1e-11


@pytest.mark.parametrize(("alpha", "beta"), [(0.5, 0.4), (-0.1, 0.5), (0.3, 1.6)])
def test_bends_that_no_waist_has_are_refused(alpha, beta):
    with pytest.raises(TrajectoryError, match="alpha"):
        kane_scher(alpha, beta)


def test_a_lean_that_is_no_number_is_refused():
    with pytest.raises(ShapeError, match="alpha"):
        kane_scher(np.nan, 1.0)


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, np.inf])
def test_durations_must_be_times(duration):
    with pytest.raises(ValueError, match="duration"):
        cat_righting(duration)


def test_unknown_motions_are_named():
    with pytest.raises(UnknownNameError, match="cat_righting"):
        named_motion("cat_right")


@pytest.mark.parametrize("name", FILES)
def test_the_files_beside_the_bodies_hold_the_same_motions(name):
    body = sp.load_body(MOTIONS[name].body)
    read, made = sp.read_shape_path(robots_folder() / f"{name}.csv", body), named_motion(name)
    times = np.linspace(0.0, made.duration, FILES[name] + 1)
    np.testing.assert_allclose(read.shape(times), made.shape(times), atol=1e-14, rtol=0)
    assert so3.angle(turned(name, read).T @ KNOWN[name]) < 1e-7


# Standing men of 78.7, 66.8 and 92.1 kg: moments about front-back, left-right and long axes [lb in s^2], as printed.
MEASURED = np.array([[132.0, 119.0, 13.1], [95.6, 81.9, 10.3], [144.0, 129.0, 14.2]]) * 0.11298
MEAN_ABOUT_THE_LONG_AXIS = np.array([10.5, 11.5]) * 0.11298
"""11 lb in s^2, printed with two digits, of 66 men [kg m^2]."""


def test_the_astronaut_beside_measured_people():
    """Santschi, DuBois and Omoto 1963. His arms hang straight down, theirs beside the hips: so he has less about z."""
    body = sp.load_body("astronaut")
    assert body.mass == pytest.approx(82.2, abs=1e-3)
    assert body.n_shape >= 20
    least, largest = MEASURED.min(axis=0), MEASURED.max(axis=0)
    moments = np.diag(body.locked_inertia(np.zeros(body.n_shape)))
    assert np.all((moments > least)[:2])
    assert np.all(moments < largest)
    assert moments[2] == pytest.approx(1.089, abs=5e-4)
    assert moments[2] < least[2] == pytest.approx(1.16, abs=5e-3)
    out = [
        np.diag(body.locked_inertia(body.shape({"left_shoulder_abduction": x, "right_shoulder_abduction": -x})))
        for x in (0.1, 0.14, 0.2)
    ]
    assert all(np.all((least < about) & (about < largest)) for about in out)
    assert MEAN_ABOUT_THE_LONG_AXIS[0] < out[1][2] < MEAN_ABOUT_THE_LONG_AXIS[1]


def test_left_and_right_are_mirror_images():
    """A mirrored posture has the mirrored inertia."""
    mirror = np.diag([1.0, -1.0, 1.0])
    rng = np.random.default_rng(3)
    for name in ("cat", "astronaut", "astronaut_female", "astronaut_suited", "diver"):
        body = sp.load_body(name)
        shape = rng.uniform(-0.6, 0.6, body.n_shape)
        image = np.empty_like(shape)
        for joint, value in zip(body.joint_names, shape, strict=True):
            other = joint.replace("left", "\0").replace("right", "left").replace("\0", "right")
            about_y = any(word in joint for word in ("pitch", "flexion", "elbow", "knee", "wrist", "ankle"))
            image[body.joint_index(other)] = value if about_y else -value
        inertia = body.locked_inertia(shape)
        np.testing.assert_allclose(body.locked_inertia(image), mirror @ inertia @ mirror, atol=1e-12, rtol=0)
