"""Shares of limbs: sums along the motion, motions with held limbs, and Shapley values against brute force."""

from __future__ import annotations

import json
import warnings
import xml.etree.ElementTree as ET
from functools import cache
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.cli.main import main
from shapephase.errors import ChartPoleError, IgnoredElementWarning, ShapeError, UnknownNameError, WrongObjectError
from shapephase.segments import shapley_interactions, shapley_values
from support.ball_bodies import BALLS
from support.bodies import joint, link, random_loop, urdf
from support.coupled_bodies import LEG, TURN, couplings
from support.long_runs import full_but
from support.places import ROBOTS
from support.random_chains import random_chain

FLIGHTS = ROBOTS / "trampoline"
AXES = {"lateral": "y", "longitudinal": "z", "somersault": "y", "up": "z"}
TURNS = 2.0 * np.pi


def loaded(tmp_path, text):
    file = tmp_path / "body.urdf"
    file.write_text(text)
    return sp.load_body(file)


def of_fourier(mean, cosines, sines, names, duration=1.0):
    return sp.ShapePath.fourier(mean, cosines, sines, duration, joint_names=names)


# The published somersault: the numbers were computed by a script of its own, one reconstruction after another.
HELD = {
    ("BrasD", "BrasG"): (1.488, 11.9, 0.163),
    ("BrasD",): (1.546, 52.9, 5.948),
    ("BrasG",): (1.548, 10.4, 0.135),
    ("Thorax",): (1.575, 12.6, 0.017),
    ("CuisseM",): (1.676, 21.8, -0.904),
    ("BrasD", "BrasG", "Thorax", "CuisseM"): (1.373, 2.3, -0.155),
}


@cache
def somersault():
    """Motion of the published somersault, with the mean of its recorded momentum."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IgnoredElementWarning)
        body = sp.load_body(FLIGHTS / "Model_JeCh_15DoFs.bioMod")
    run = sp.read_trajectory(FLIGHTS / "free_floating.npz", body)
    path = sp.ShapePath.spline(run.times - run.times[0], run.shapes, periodic=False, joint_names=body.joint_names)
    momentum = [85.2905763, -0.0660766631, 0.700046244]
    return sp.reconstruct(sp.articulated(body, path), momentum, np.asarray(run.attitude)[0])


ATHLETE = {"lateral": "x", "longitudinal": "z", "somersault": "x", "up": "z"}


def largest_tilt(motion):
    """In degrees, at as many times as the script took."""
    return float(
        np.degrees(np.abs(motion.somersault_tilt_twist(np.linspace(0.0, motion.duration, 300), **ATHLETE)[1]).max())
    )


@pytest.mark.full
def test_the_published_somersault_with_limbs_held():
    motion = somersault()
    results = [sp.contributions(motion, of, **ATHLETE) for of in ("somersault", largest_tilt, "twist")]
    units = np.array([TURNS, 1.0, TURNS])
    digits = (5e-4, 0.05, 5e-4)
    names = {("BrasD", "BrasG"): "arms", ("CuisseM",): "legs"}
    for held, known in {(): (1.896, 32.4, 3.016), **HELD}.items():
        if len(held) in (0, 4):
            found = [shares.none if held else shares.whole for shares in results]
        else:
            place = results[0].held_names.index(names.get(held, held[0]))
            found = [shares.without[place] for shares in results]
        assert (np.abs(np.array(found) / units - known) <= digits).all(), (held, np.array(found) / units)


def test_shapley_values_of_the_published_somersault():
    twist = sp.contributions(somersault(), **ATHLETE)
    shares = dict(zip(twist.groups, twist.shared / TURNS, strict=True))
    known = {"BrasD": -1.868, "BrasG": 2.097, "Thorax": 1.420, "legs": 1.522}
    assert shares == pytest.approx(known, abs=5e-4)
    assert twist.shared.sum() == pytest.approx(twist.whole - twist.none, abs=1e-12)


def test_direct_shares_of_the_published_somersault():
    for of, momentum, joints in (("twist", 2.9850, 0.0311), ("somersault", 1.7100, 0.1855)):
        direct = sp.contributions(somersault(), of, groups={"all": "*"}, **ATHLETE).direct
        assert direct.total[0] / TURNS == pytest.approx(momentum, abs=5e-5)
        # By the trapezoid rule, from digits that were cut off.
        assert direct.total[1:].sum() / TURNS == pytest.approx(joints, abs=1e-4)


def random_bodies(tmp_path):
    """Bodies with hinges, slides, ball joints and joints that follow others."""
    bodies = [sp.load_body(name) for name in ("cat", "diver", "satellite", "astronaut")]
    bodies += [loaded(tmp_path, random_chain(seed).urdf) for seed in range(4)]
    return [*bodies, loaded(tmp_path, BALLS), loaded(tmp_path, LEG).with_couplings(couplings(TURN["smooth"][0]))]


def random_path(body, rng):
    """A loop of the joints; quaternions of ball joints wander around the identity."""
    if not body.ball_joints:
        return random_loop(body, rng, amplitude=0.6)
    mean = np.array([float(name.endswith(".w")) for name in body.joint_names])
    return of_fourier(mean, *(rng.uniform(-0.2, 0.2, (2, body.n_shape, 2))), body.joint_names, 1.5)


@pytest.mark.parametrize("motions", full_but([40, 200], 40))
def test_direct_shares_sum_to_the_angle_on_random_motions(motions, tmp_path):
    rng = np.random.default_rng(56)
    bodies, count, worst = random_bodies(tmp_path), 0, 0.0
    for number in range(2 * motions):
        if count == motions:
            break
        body = bodies[number % len(bodies)]
        path = random_path(body, rng)
        size = float(np.trace(body.locked_inertia(path.shape(0.0)))) if number % 2 else 0.0
        motion = sp.reconstruct(sp.articulated(body, path), size * rng.uniform(-0.5, 0.5, 3))
        of = ("twist", "tilt", "somersault")[number % 3]
        at = 1.0 if of == "tilt" else "mid-twist"
        try:
            direct = sp.contributions(
                motion, of, groups={"all": "*"}, at=at, link=body.link_names[0], times=[0.4, 1.0, 1.5], **AXES
            ).direct
        except ChartPoleError:
            continue
        instants = np.append(0.0, direct.times)
        angle = motion.somersault_tilt_twist(instants, **AXES)[("somersault", "tilt", "twist").index(of)]
        gap = np.abs(direct.shares.sum(axis=1) - (angle[1:] - angle[0]))
        assert (gap <= direct.error).all(), (body.name, of, gap, direct.error)
        assert direct.error.max() < 1e-5
        assert direct.total == pytest.approx(direct.shares[1 if of == "tilt" else 2], abs=1e-12)
        worst, count = max(worst, gap.max()), count + 1
    assert count == motions
    assert worst < 1e-8


def test_a_joint_that_rests_has_a_share_of_exactly_zero():
    cat = sp.load_body("cat")
    shapes = np.zeros((5, 23))
    shapes[1:4, cat.joint_index("waist_yaw")] = 0.3, 0.5, 0.2
    shapes[1:4, cat.joint_index("tail_2_yaw")] = 0.2, -0.4, 0.6
    path = sp.ShapePath.spline(np.linspace(0.0, 1.0, 5), shapes, joint_names=cat.joint_names)
    motion = sp.reconstruct(sp.articulated(cat, path), [0.01, 0.02, -0.01])
    shares = sp.contributions(motion, "twist", groups={"head": "neck*", "waist": "waist*", "tail": "tail*"}, **AXES)
    moving = {"momentum", "waist", "tail_2"}
    for source, share in zip(shares.direct.sources, shares.direct.shares.T, strict=True):
        assert share.any() == (source in moving)
    assert shares.shared[0] == 0.0
    assert shares.rest[0] == "front_left_shoulder_pitch"


def rerooted(text, root):
    """The same body with another link as its root: joints on the way turn the other way round."""
    robot = ET.fromstring(text)
    above = {joint_.find("child").get("link"): joint_ for joint_ in robot.findall("joint")}
    while root in above:
        old, link_ = above[root], root
        parent = old.find("parent").get("link")
        origin = old.find("origin")
        place = np.array([float(x) for x in (origin.get("xyz", "0 0 0") if origin is not None else "0 0 0").split()])
        rpy = np.array([float(x) for x in (origin.get("rpy", "0 0 0") if origin is not None else "0 0 0").split()])
        back = Rotation.from_euler("xyz", rpy).inv()
        step = f"{link_}_turned"
        robot.append(ET.fromstring(f'<link name="{step}"/>'))
        axis = -np.array([float(x) for x in old.find("axis").get("xyz").split()])
        hinge = joint(old.get("name"), old.get("type"), link_, step, axis)
        fixed = joint(f"{step}_joint", "fixed", step, parent, xyz=back.apply(-place), rpy=back.as_euler("xyz"))
        robot.remove(old)
        robot.append(ET.fromstring(hinge))
        robot.append(ET.fromstring(fixed))
        root = parent
    return ET.tostring(robot, encoding="unicode")


@pytest.mark.filterwarnings("ignore::shapephase.ImplausibleBodyWarning")
@pytest.mark.parametrize("every", full_but([1, 5], 5))
def test_shares_of_a_link_do_not_depend_on_the_root(every, tmp_path):
    """The angular velocity of the base itself differs; shares of the angles of the front half do not."""
    text = Path("robots/cat.urdf").read_text()
    cat = sp.load_body("cat")
    path, momentum = sp.examples.cat_righting(), np.array([0.01, 0.03, -0.02])
    axes = {"lateral": [0.0, 1.0, 0.0], "longitudinal": [1.0, 0.0, 0.0], "somersault": "y", "up": "z"}
    known = None
    for root in [part.links[0] for part in cat.moving_parts if part.mass > 0.0][::every]:
        body = loaded(tmp_path, rerooted(text, root))
        assert body.link_names[0] == root
        start = cat.link_pose(path.shape(0.0), root)[:3, :3]
        motion = sp.reconstruct(sp.articulated(body, path), momentum, start, tolerance=1e-12)
        direct = sp.contributions(
            motion, "twist", groups={"all": "*"}, link="trunk_front", times=[0.7, 1.3, 2.0], **axes
        ).direct
        shares = dict(zip(direct.sources, direct.shares.T, strict=True))
        known = known or shares
        assert shares.keys() == known.keys()
        for source, share in shares.items():
            assert share == pytest.approx(known[source], abs=1e-12), (root, source)


def random_game(seed, count=6):
    return np.random.default_rng(seed).normal(size=1 << count)


def by_brute_force(values, count):
    """Average over all orders of what each member adds, and of what each pair adds beyond both alone."""
    shares, pairs = np.zeros(count), np.zeros((count, count))
    orders = list(permutations(range(count)))
    for order in orders:
        before = 0
        place = {member: k for k, member in enumerate(order)}
        prefixes = [sum(1 << member for member in order[:k]) for k in range(count)]
        for member in order:
            shares[member] += values[before | 1 << member] - values[before]
            before |= 1 << member
        for i in range(count):
            for j in range(i):
                base = prefixes[min(place[i], place[j])]
                pairs[i, j] += (
                    values[base | 1 << i | 1 << j] - values[base | 1 << i] - values[base | 1 << j] + values[base]
                )
    return shares / len(orders), (pairs + pairs.T) / len(orders)


def test_shapley_values_and_interactions_equal_brute_force_over_all_orders():
    game = random_game(1)
    shares, pairs = by_brute_force(game, 6)
    assert shapley_values(game) == pytest.approx(shares, abs=1e-13)
    interactions = shapley_interactions(game)
    off = ~np.eye(6, dtype=bool)
    assert interactions[off] == pytest.approx(pairs[off], abs=1e-13)
    assert np.diag(interactions) == pytest.approx([game[1 << k] - game[0] for k in range(6)], abs=0.0)


@pytest.mark.parametrize("seed", range(20))
def test_the_axioms_of_shapley(seed):
    count = 1 + seed % 7
    first, second = random_game(seed, count), random_game(seed + 100, count)
    values = shapley_values(first)
    assert values.sum() == pytest.approx(first[-1] - first[0], abs=1e-12)
    assert np.triu(shapley_interactions(first)).sum() == pytest.approx(first[-1] - first[0], abs=1e-12)
    assert shapley_values(2.0 * first - 3.0 * second) == pytest.approx(2.0 * values - 3.0 * shapley_values(second))
    masks = np.arange(1 << count)
    if count > 1:
        # Where the first two members change places, so do their shares.
        swapped = (masks & ~3) | (masks & 1) << 1 | (masks >> 1 & 1)
        assert shapley_values(first[swapped]) == pytest.approx(values[[1, 0, *range(2, count)]], abs=1e-12)
        assert shapley_values(first + first[swapped])[:2].std() == pytest.approx(0.0, abs=1e-12)
    null = shapley_values(first[masks & ~1])
    assert null[0] == pytest.approx(0.0, abs=1e-14)
    assert shapley_interactions(first[masks & ~1])[0] == pytest.approx(np.zeros(count), abs=1e-14)


def test_a_number_of_values_that_is_no_power_of_two_is_refused():
    with pytest.raises(ShapeError, match=r"2\^k"):
        shapley_values([0.0, 1.0, 2.0])


def rotor_dive(tmp_path):
    """Closed form of a diver with a wheel, and the same as a body with a joint: the wheel turns while it is on."""
    dive = sp.rigid_body.rotor_dive([12.0, 11.5, 1.0], 70.0, 50.0, 0.12, somersaults=1.5, twists=1)
    wheel = 0.5
    body = loaded(
        tmp_path,
        urdf(
            link("trunk", 60.0, dive.moments - [wheel, 0.3, 0.3]),
            link("wheel", 4.0, [wheel, 0.3, 0.3]),
            joint("rotor", "continuous", "trunk", "wheel", (1.0, 0.0, 0.0)),
        ),
    )
    edges = dive.times
    speeds = np.array([dive.rotor_momentum(t)[0] for t in 0.5 * (edges[1:] + edges[:-1])]) / wheel
    turned = np.append(0.0, np.cumsum(speeds * np.diff(edges)))

    def rotor(times):
        stage = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, 4)
        return (turned[stage] + speeds[stage] * (times - edges[stage]))[:, None], speeds[stage][:, None]

    path = sp.ShapePath.function(rotor, dive.duration, edges[1:-1], joint_names=["rotor"])
    return dive, sp.reconstruct(sp.articulated(body, path), [0.0, dive.momentum, 0.0])


def test_the_tilt_of_a_dive_with_a_rotor_is_that_of_the_rotor(tmp_path):
    dive, motion = rotor_dive(tmp_path)
    middle = 0.5 * dive.duration
    shares = sp.contributions(motion, "tilt", **AXES)
    assert shares.at == pytest.approx(middle, abs=1e-6)
    assert abs(shares.whole) == pytest.approx(abs(dive.tilt), abs=1e-8)
    # Held, the body somersaults alone: the rotor has all of the tilt.
    assert shares.none == pytest.approx(0.0, abs=1e-10)
    assert shares.shared[0] == pytest.approx(shares.whole, abs=1e-9)
    # Along the motion its torque turns the body about x, of which the cosine of the twist is tilt.
    start, end = dive.times[1:3]
    direct, _ = quad(lambda t: -dive.rotor / dive.moments[0] * np.cos(dive.twist(t)), start, end, epsabs=1e-12)
    assert dict(zip(shares.direct.sources, shares.direct.total, strict=True))["rotor"] == pytest.approx(
        direct, abs=1e-8
    )
    assert 0.5 < direct / shares.whole < 0.999


def test_mirrored_arms_have_equal_shares_of_somersault_and_opposite_ones_of_tilt_and_twist():
    diver = sp.load_body("diver")
    moved = np.array([[2.5, -2.5], [2.4, -2.4], [0.4, -0.4], [0.3, -0.3]])
    path = sp.ShapePath.spline([0.0, 0.2, 0.8, 1.2], moved, joint_names=diver.joint_names)
    motion = sp.reconstruct(sp.articulated(diver, path), [0.0, 60.0, 0.0])
    turned, tilted, twisted = (sp.contributions(motion, of, **AXES, **more) for of, more in (
        ("somersault", {}), ("tilt", {"at": 0.7}), ("twist", {})))  # fmt: skip
    assert twisted.held_names == ("left arm", "right arm", "arms")
    assert turned.shared[0] == pytest.approx(turned.shared[1], abs=1e-9)
    for shares in (tilted, twisted):
        assert shares.shared[0] == pytest.approx(-shares.shared[1], abs=1e-8)
        assert shares.without[0] == pytest.approx(-shares.without[1], abs=1e-8)
        assert abs(shares.without[0]) > 0.05
    assert tilted.direct.total[1] == pytest.approx(-tilted.direct.total[2], abs=1e-9)


def test_the_cat_of_kane_and_scher_turns_by_the_pair():
    cat = sp.load_body("cat_untwisted")
    path = sp.examples.kane_scher(np.radians(20.0), np.radians(61.8), body="cat_untwisted")
    motion = sp.reconstruct(sp.articulated(cat, path), np.zeros(3))
    shares = sp.contributions(motion, "rotation", about=[1.0, 0.0, 0.0])
    assert list(shares.groups) == ["waist_pitch", "waist_yaw"]
    assert abs(shares.whole) > 1.0
    # One coordinate that goes to and fro turns nothing, so that each has one half of what the pair does.
    assert shares.alone == pytest.approx(0.0, abs=1e-8)
    assert shares.interactions[0, 1] == pytest.approx(shares.whole, abs=1e-7)
    assert shares.shared == pytest.approx(np.full(2, 0.5 * shares.whole), abs=1e-7)


def test_interactions_of_small_loops_tend_to_curvature_times_area(tmp_path):
    body = loaded(tmp_path, random_chain(5).urdf)
    rng = np.random.default_rng(7)
    mean = rng.uniform(-0.3, 0.3, body.n_shape)
    cosines, sines = rng.uniform(-1.0, 1.0, (2, body.n_shape, 2))
    gaps, strokes = [], (0.02, 0.04, 0.08)
    for stroke in strokes:
        path = of_fourier(mean, stroke * cosines, stroke * sines, body.joint_names)
        motion = sp.reconstruct(sp.articulated(body, path), np.zeros(3), tolerance=1e-13)
        shares = sp.contributions(motion, "twist", groups="joints", **AXES)
        off = np.triu(np.ones(shares.interactions.shape, dtype=bool), 1)
        gaps.append(np.abs((shares.interactions - shares.small_loop)[off]).max())
        assert gaps[-1] < 0.5 * np.abs(shares.small_loop[off]).max()
    slopes = np.diff(np.log(gaps)) / np.diff(np.log(strokes))
    assert (slopes >= 2.9).all(), slopes


def test_a_held_motion_is_that_of_the_path_with_the_limb_at_rest():
    cat, path = sp.load_body("cat"), sp.examples.cat_righting()
    momentum = np.array([0.002, 0.01, -0.003])
    motion = sp.reconstruct(sp.articulated(cat, path), momentum)
    shares = sp.contributions(motion, lambda made: float(made.final_attitude[0, 1]), groups={"waist": "waist_*"})
    columns = cat.joint_columns(["waist_pitch", "waist_yaw", "waist_roll"])

    def held(times):
        shapes, rates = (values.copy() for values in path.curve(times))
        shapes[:, columns], rates[:, columns] = path.shape(0.0)[columns], 0.0
        return shapes, rates

    still = sp.ShapePath.function(held, path.duration, joint_names=cat.joint_names)
    known = sp.reconstruct(sp.articulated(cat, still), momentum).final_attitude[0, 1]
    assert shares.without[0] == pytest.approx(known, abs=1e-8)
    assert shares.of == "<lambda>"
    assert shares.direct is None


def two_trials(stretch=1.0):
    diver = sp.load_body("diver")
    good, bad = (
        sp.ShapePath.waypoints([0.0, 0.3, 0.9, 1.2], [[2.5, -2.5], [left, -2.5], [left, -2.5], [2.5, -2.5]],
                               joint_names=diver.joint_names)
        for left in (0.5, 1.9)
    )  # fmt: skip
    return (
        sp.reconstruct(sp.articulated(diver, good), [0.0, 62.0, 0.0]),
        sp.reconstruct(sp.articulated(diver, bad.stretched(stretch)), [0.0, 55.0, 0.0]),
    )


def test_the_difference_of_two_trials_is_shared_among_limbs_momentum_and_duration():
    good, bad = two_trials(1.25)
    shares = sp.contributions(good, baseline=bad, **AXES)
    assert list(shares.groups) == ["left arm", "right arm", "momentum", "duration"]
    twists = [np.ptp(motion.somersault_tilt_twist([0.0, motion.duration], **AXES)[2]) for motion in (good, bad)]
    assert abs(shares.whole) == pytest.approx(twists[0], abs=1e-8)
    assert abs(shares.none) == pytest.approx(twists[1], abs=1e-8)
    assert shares.shared.sum() == pytest.approx(shares.whole - shares.none, abs=1e-12)
    assert shares.shared[1] == pytest.approx(0.0, abs=1e-8)
    assert abs(shares.shared[0]) > 0.5


@pytest.mark.parametrize("name", ["diver", "astronaut", "cat"])
def test_the_mirrored_motion_twists_the_other_way(name):
    """Seen in a mirror, a motion has the same somersault and the opposite twist: the momentum is across the mirror."""
    body = sp.load_body(name)
    rng = np.random.default_rng(11)
    cosines, sines = 0.2 * rng.uniform(-1.0, 1.0, (2, body.n_shape, 1))
    path = sp.ShapePath.fourier(np.zeros(body.n_shape), cosines, sines, 1.0, joint_names=body.joint_names)
    momentum = np.array([0.0, 0.05 if name == "cat" else 40.0, 0.0])
    motion = sp.reconstruct(sp.articulated(body, path), momentum)
    axes = {"lateral": "y", "longitudinal": "x" if name == "cat" else "z"}
    twist, somersault = (sp.contributions(motion, of, groups={"all": "*"}, baseline="mirrored", **axes)
                         for of in ("twist", "somersault"))  # fmt: skip
    assert abs(twist.whole) > 0.01
    assert twist.none == pytest.approx(-twist.whole, abs=1e-6)
    assert somersault.none == pytest.approx(somersault.whole, abs=1e-6)
    assert "as in the mirrored motion" in str(twist)


def test_a_body_of_one_side_has_no_mirrored_motion():
    satellite = sp.load_body("satellite")
    motion = sp.reconstruct(sp.articulated(satellite, sp.examples.satellite_sweep()), np.zeros(3))
    with pytest.raises(ShapeError, match="joint arm_1 of satellite has no mirror image"):
        sp.contributions(motion, baseline="mirrored", lateral="y", longitudinal="z")


def test_phases_that_jump_are_named():
    """Between 1.1 and 1.2 times the momentum its end passes the point opposite its start."""
    dive = sp.articulated(sp.load_body("diver"), sp.examples.MOTIONS["diver_twist"].path())
    motions = [sp.reconstruct(dive, [0.0, factor * 61.558831, 0.0]) for factor in (1.0, 1.1, 1.2)]
    for first, second, jumps in ((0, 1, False), (1, 2, True)):
        shares = sp.contributions(motions[first], "phase", groups={"momentum": ()}, baseline=motions[second])
        assert ("jumps" in str(shares)) == ("jumps" in str(shares.notes())) == jumps


def test_two_joints_with_one_mirror_image_are_refused(tmp_path):
    """Two parallel hinges on the left, less than 5 % of the body apart, and one on the right."""
    file = tmp_path / "lopsided.urdf"
    limbs = [link(name, 0.2, [0.002, 0.002, 0.001], (0.0, 0.0, -0.2)) for name in ("left_a", "left_b", "right_a")]
    joints = [
        joint(f"{name}_hip", "revolute", "trunk", name, (1.0, 0.0, 0.0), (0.0, y, 0.0))
        for name, y in (("left_a", 0.2), ("left_b", 0.201), ("right_a", -0.2))
    ]
    file.write_text(urdf(link("trunk", 20.0, [2.0, 2.0, 1.0]), *limbs, *joints))
    body = sp.load_body(file)
    path = sp.ShapePath.fourier(np.zeros(3), np.zeros((3, 1)), [[0.3], [0.2], [0.1]], 1.0)
    motion = sp.reconstruct(sp.articulated(body, path), [0.0, 5.0, 0.0])
    with pytest.raises(ShapeError, match="right_a_hip"):
        sp.contributions(motion, baseline="mirrored", lateral="y", longitudinal="z")


def test_other_masses_are_a_group_of_their_own():
    good, bad = two_trials()
    diver = sp.load_body("diver")
    heavy = diver.with_inertias(masses={"left_arm": 4.0, "right_arm": 4.0})
    other = sp.reconstruct(sp.articulated(heavy, bad.deformation.description.path), bad.momentum)
    shares = sp.contributions(good, "somersault", baseline=other, **AXES)
    assert list(shares.groups)[2:] == ["momentum", "body"]
    with_masses = sp.reconstruct(sp.articulated(heavy, good.deformation.description.path), good.momentum)
    known = np.ptp(with_masses.somersault_tilt_twist([0.0, 1.2], **AXES)[0])
    assert shares.without[3] == pytest.approx(known, abs=1e-8)


def test_what_differs_and_is_in_no_group_is_named():
    good, bad = two_trials()
    with pytest.raises(ShapeError, match=r"differ in momentum, in no group"):
        sp.contributions(good, baseline=bad, groups={"arms": ["*arm*", "*shoulder*"][1]}, **AXES)
    with pytest.raises(ShapeError, match=r"joints that are in no group: left_shoulder_abduction"):
        sp.contributions(good, baseline=bad, groups={"right": "right_*", "momentum": ()}, **AXES)
    with pytest.raises(ShapeError, match="another motion is the baseline"):
        sp.contributions(good, groups={"right": "right_*", "momentum": ()}, **AXES)


def test_more_than_ten_groups_take_random_orders():
    cat = sp.load_body("cat")
    motion = sp.reconstruct(sp.articulated(cat, sp.examples.cat_righting()), np.zeros(3))
    shares = sp.contributions(motion, groups="joints", orders=8, longitudinal="x", lateral="y", somersault="y")
    assert len(shares.groups) == 13
    assert shares.interactions is None
    assert shares.shared.sum() == pytest.approx(shares.whole - shares.none, abs=1e-12)
    place = list(shares.groups).index("tail_2")
    assert shares.shared[place] == pytest.approx(0.0, abs=1e-9)
    assert shares.errors[list(shares.groups).index("waist")] > 1e-4


def test_the_montgomery_phase_and_a_posture_as_baseline():
    motion = somersault()
    shares = sp.contributions(motion, "phase", baseline="neutral")
    assert shares.whole == pytest.approx(float(sp.split(motion).montgomery_phase), abs=1e-12)
    assert shares.shared.sum() == pytest.approx(shares.whole - shares.none, abs=1e-9)
    body = motion.deformation.description.body
    again = sp.contributions(motion, "phase", baseline=body.shape())
    assert again.none == shares.none


def test_what_cannot_be_explained_is_refused():
    cat = sp.load_body("cat_two_halves")
    motion = sp.reconstruct(sp.articulated(cat, sp.examples.kane_scher(0.3, 0.6)), np.zeros(3))
    rigid = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0), [0.0, 0.0, 1.0])
    with pytest.raises(WrongObjectError, match="shares are those of joints"):
        sp.contributions(rigid)
    with pytest.raises(UnknownNameError, match="unknown result 'twists'"):
        sp.contributions(motion, "twists")
    with pytest.raises(WrongObjectError, match="no Montgomery phase"):
        sp.contributions(motion, "phase")
    with pytest.raises(ShapeError, match="no momentum to turn about"):
        sp.contributions(motion, "rotation")
    with pytest.raises(UnknownNameError, match="unknown baseline 'second'"):
        sp.contributions(motion, baseline="second", **AXES)
    with pytest.raises(ShapeError, match="finite number"):
        sp.contributions(motion, lambda made: made.final_attitude)
    with pytest.raises(UnknownNameError, match="link"):
        sp.contributions(motion, link="middle", **AXES)


def test_beyond_85_degrees_of_tilt_there_are_no_shares_of_a_count():
    diver = sp.load_body("diver")
    path = sp.ShapePath.waypoints([0.0, 1.0], [[0.1, -0.1], [0.2, -0.2]], joint_names=diver.joint_names)
    motion = sp.reconstruct(sp.articulated(diver, path), [30.0, 0.0, 0.0])
    with pytest.raises(ChartPoleError, match=r"tilt of trunk reaches 8[5-9]|tilt of trunk reaches 90"):
        sp.contributions(motion, **AXES)
    assert sp.contributions(motion, "rotation", **AXES).whole > 1.0


def test_table_json_and_csv(tmp_path):
    good, _ = two_trials()
    shares = sp.contributions(good, **AXES)
    text = str(shares)
    assert "twist of trunk [turns]" in text
    assert "left arm" in text
    assert shares.to_dict()["unit"] == "rad"  # the table is in turns, plain data in radians
    assert shares.to_dict()["pairs"] == {"arms": ["left arm", "right arm"]}
    shares.write_csv(tmp_path / "shares.csv")
    table = np.genfromtxt(tmp_path / "shares.csv", delimiter=",", names=True)
    assert table["angle_rad"] == pytest.approx(shares.direct.shares.sum(axis=1), abs=1e-7)
    with pytest.raises(WrongObjectError, match="no direct shares"):
        sp.contributions(good, "phase").write_csv(tmp_path / "none.csv")


DIVE = ("diver", "diver_twist", "--momentum", "0", "61.558831", "0")


def command(capsys, *words):
    main(["contributions", *words])
    return capsys.readouterr().out


def test_the_command_prints_what_the_function_finds(capsys, tmp_path):
    data = json.loads(command(capsys, *DIVE, "--json", "--out", str(tmp_path / "s.csv")))
    path = sp.examples.MOTIONS["diver_twist"].path()
    shares = sp.contributions(sp.reconstruct(sp.articulated(sp.load_body("diver"), path), [0.0, 61.558831, 0.0]))
    assert data["whole"] == pytest.approx(shares.whole, abs=1e-9)
    assert data["shared"] == pytest.approx(shares.shared, abs=1e-8)
    assert (tmp_path / "s.csv").read_text().startswith("time_s,angle_rad,momentum_rad,left_shoulder_abduction_rad")
    chosen = command(capsys, *DIVE, "--groups", "left=left_*", "--of", "tilt", "--at", "0.75", "--baseline", "neutral")
    assert "tilt at 0.75 s of trunk [deg]" in chosen
    assert "in no group, moving in all motions: right_shoulder_abduction" in chosen


def test_the_command_explains_the_difference_of_two_motions(capsys):
    text = command(capsys, *DIVE, "--baseline", "five_stage_dive", "--groups", "arms=*shoulder*", "duration")
    assert "as in the baseline" in text
    assert "\nduration" in text


def test_axes_that_no_names_of_links_give_are_given_to_the_command(capsys):
    with pytest.raises(SystemExit):
        main(["contributions", "cat_two_halves", "kane_scher"])
    assert "lateral" in capsys.readouterr().err
    text = command(capsys, "cat_two_halves", "kane_scher", "--lateral", "y", "--longitudinal", "x")
    assert "waist_pitch with waist_yaw" in text


@pytest.mark.parametrize("words", [["arms"], ["a=x*", "a=y*"], ["=x"]])
def test_groups_that_are_no_patterns_end_the_command(words, capsys):
    with pytest.raises(SystemExit):
        main(["contributions", *DIVE, "--groups", *words])
    assert "words such as arms=left_*,right_*" in capsys.readouterr().err


def test_bars_and_areas_show_the_numbers(capsys, tmp_path):
    good, _ = two_trials()
    shares = sp.contributions(good, **AXES)
    bars, areas = sp.plots.contributions_figure(shares).figure.axes
    widths = [bar.get_width() for bar in bars.patches]
    assert widths[:2] == pytest.approx(shares.shared / TURNS)
    assert widths[2:] == pytest.approx((shares.whole - shares.without[:2]) / TURNS)
    assert areas.lines[0].get_ydata()[-1] == pytest.approx(shares.whole / TURNS)
    phase = sp.contributions(good, "phase")
    assert len(sp.plots.contributions_figure(phase).figure.axes) == 1
    with pytest.raises(WrongObjectError, match="no direct shares"):
        sp.plots.plot_direct_shares(sp.plots.column_axes(), phase)
    command(capsys, *DIVE, "--figure", str(tmp_path / "s.svg"))
    assert (tmp_path / "s.svg").read_text().startswith("<?xml")


@pytest.mark.parametrize(
    ("of", "given", "message"),
    [
        ("twist", {"at": 0.5}, "a time is that of a tilt, not of twist"),
        ("twist", {"about": [1.0, 0.0, 0.0]}, "an axis is that of a rotation, not of twist"),
        ("rotation", {"about": [0.0, 0.0, 0.0]}, "--about 1 0 0"),
        ("twist", {"groups": {}}, "one group at least"),
        ("twist", {"groups": {"a": 3}}, "got 'a': 3"),
        ("twist", {"groups": {3: "left_*"}}, "got 3: 'left_"),
        ("twist", {"orders": 1}, "orders: a whole number"),
        ("twist", {"seed": "x"}, "seed: a whole number"),
        ("twist", {"lateral": "x", "longitudinal": "x"}, "an axis across the lateral one"),
    ],
)
def test_arguments_without_meaning_are_refused(of, given, message):
    path = sp.examples.MOTIONS["diver_twist"].path()
    motion = sp.reconstruct(sp.articulated(sp.load_body("diver"), path), [0.0, 61.558831, 0.0])
    with pytest.raises(ShapeError, match=message):
        sp.contributions(motion, of, **given)


def test_a_baseline_that_does_not_exist_is_named_with_the_nearest(capsys):
    with pytest.raises(SystemExit):
        main(["contributions", *DIVE, "--baseline", "frist"])
    assert "unknown baseline (no such file either) 'frist'. Did you mean 'first'?" in capsys.readouterr().err


def noisy_dive(samples, momentum=(4.0, 60.0, 6.0), start=(0.3, 0.2, 0.1), **others):
    """A second of a diver whose arms go through samples (13, 2)."""
    path = sp.ShapePath.spline(np.linspace(0.0, 1.0, 13), samples, periodic=False)
    deformation = sp.articulated("diver", path, **others)
    return sp.reconstruct(deformation, momentum, Rotation.from_rotvec(start).as_matrix(), tolerance=1e-10)


def arm_samples(size=1.0):
    times = np.linspace(0.0, 1.0, 13)
    return np.stack([1.2 + size * np.sin(TURNS * times), 1.0 + size * np.cos(5.0 * times)], axis=1)


def of_bars(shares):
    """What has a bar, in the order of its fields."""
    lost, change = shares.whole - shares.without, shares.whole - shares.none
    by_name = dict(zip(shares.groups, shares.shared, strict=True))
    shared = [by_name[name] if name in by_name else sum(by_name.values()) for name in shares.held_names]
    return np.hstack([shares.whole, shares.none, change, shares.without, shares.alone, lost, shared])


def bars_of(shares):
    names = ("whole", "none", "change", "without", "alone", "lost", "shared")
    return np.hstack([getattr(shares.bars, name) for name in names])


@pytest.mark.parametrize(
    ("of", "link", "baseline"),
    [("twist", None, "first"), *(full_but([("tilt", "left_arm", "first"), ("somersault", None, "neutral")]))],
)
def test_bars_of_shares_are_slopes_of_shares_of_other_samples_and_momenta(of, link, baseline):
    """Central differences, of one number at a time with variance one, its first sample included."""
    size, start = (0.05, (0.0, 0.0, 0.0)) if link else (1.0, (0.3, 0.2, 0.1))
    samples, step = arm_samples(size), 1e-4
    motion = noisy_dive(samples, start=start)
    how = {"of": of, "link": link, "baseline": baseline, "at": 0.6 if of == "tilt" else "mid-twist"}
    axes = motion.athlete_axes()
    how |= AXES if link else {name: getattr(axes, name) for name in ("lateral", "longitudinal", "somersault", "up")}
    for number in (1, 8, 25):
        moved = samples.ravel().copy()[None] + step * np.outer([1.0, -1.0], np.arange(26) == number)
        ahead, behind = (of_bars(sp.contributions(noisy_dive(row.reshape(13, 2), start=start), **how)) for row in moved)
        alone = np.diag((np.arange(26) == number).astype(float))
        expected = np.abs(ahead - behind) / (2.0 * step)
        np.testing.assert_allclose(bars_of(sp.contributions(motion, joints=alone, **how)), expected, atol=1e-6)
    ahead, behind = (
        of_bars(sp.contributions(noisy_dive(samples, (4.0, 60.0 + change, 6.0), start), **how))
        for change in (step, -step)
    )
    of_momentum = np.diag([0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    expected = np.abs(ahead - behind) / (2.0 * step)
    np.testing.assert_allclose(bars_of(sp.contributions(motion, start=of_momentum, **how)), expected, atol=1e-6)


@pytest.mark.full
def test_shares_of_recordings_scatter_as_far_as_their_bars():
    """120 recordings with noise of arms, momentum and start together: bars of any are those of the truth."""
    rng, draws, noise = np.random.default_rng(4), 120, 0.004
    spread = np.array([0.003, 0.004, 0.002, 0.05, 0.2, 0.1])
    truth = noisy_dive(arm_samples())
    axes = truth.athlete_axes()
    how = {name: getattr(axes, name) for name in ("lateral", "longitudinal", "somersault", "up")}
    shares = sp.contributions(truth, joints=noise, start=np.diag(spread**2), **how)
    drawn = []
    for _ in range(draws):
        change = spread * rng.normal(size=6)
        start = Rotation.from_rotvec([0.3, 0.2, 0.1]) * Rotation.from_rotvec(change[:3])
        samples = arm_samples() + noise * rng.normal(size=(13, 2))
        moved = noisy_dive(samples, np.array([4.0, 60.0, 6.0]) + change[3:], start.as_rotvec())
        drawn.append(of_bars(sp.contributions(moved, **how)))
    np.testing.assert_allclose(np.std(drawn, axis=0, ddof=1), bars_of(shares), rtol=4.0 / np.sqrt(2.0 * draws))


def test_shares_of_random_orders_and_with_wheels_have_bars(monkeypatch):
    """Many random orders tend to all of them, and their shares add up alike; a wheel that stores nothing and weighs
    little changes no bar."""
    motion = noisy_dive(arm_samples())
    exact = sp.contributions(motion, joints=0.01)
    wheel = sp.load_body("diver").with_wheel([0.0, 0.0, 1.0], 1e-4)
    (name,) = set(wheel.joint_names) - set(sp.load_body("diver").joint_names)
    with_wheel = sp.reconstruct(
        sp.articulated(wheel, motion.deformation.description.path, rotors={name: 0.0}),
        motion.momentum,
        motion.initial_attitude,
        tolerance=1e-10,
    )
    found = sp.contributions(with_wheel, joints=0.01, groups={"left arm": "left_*", "right arm": "right_*"})
    plain = sp.contributions(motion, joints=0.01, groups={"left arm": "left_*", "right arm": "right_*"})
    np.testing.assert_allclose(bars_of(found), bars_of(plain), rtol=1e-3)
    monkeypatch.setattr("shapephase.segments.limb_contributions.MOST_EXACT", 1)
    sampled = sp.contributions(motion, joints=0.01, orders=2000, seed=3)
    assert sampled.interactions is None
    assert sampled.bars.shared[-1] == pytest.approx(exact.bars.change, rel=1e-9)
    np.testing.assert_allclose(sampled.bars.shared, exact.bars.shared, rtol=0.1)


@pytest.mark.full
def test_bars_that_are_shown_hold_what_random_orders_leave_open(monkeypatch):
    """Beside noise that is next to none: shares of 24 seeds scatter as far."""
    monkeypatch.setattr("shapephase.segments.limb_contributions.MOST_EXACT", 1)
    motion = noisy_dive(arm_samples())
    drawn = [sp.contributions(motion, joints=1e-9, orders=40, seed=seed) for seed in range(24)]
    scatter = np.std([shares.shared for shares in drawn], axis=0, ddof=1)
    shown = np.mean([shares.shared_bars[:2] for shares in drawn], axis=0)
    np.testing.assert_allclose(scatter, shown, rtol=4.0 / np.sqrt(2.0 * len(drawn)))
    assert any("random orders" in note for note in drawn[0].notes())


def test_a_given_posture_has_the_bars_of_the_same_one_by_name():
    motion = noisy_dive(arm_samples())
    by_name, given = (sp.contributions(motion, joints=0.01, baseline=at) for at in ("neutral", np.zeros(2)))
    np.testing.assert_allclose(bars_of(given), bars_of(by_name), rtol=1e-9)


def test_the_command_prints_bars_of_a_recording_in_table_json_and_page(tmp_path, capfd):
    file, page = ROBOTS / "diver_dive.mot", tmp_path / "shares.html"
    command = ["contributions", "diver", str(file), "--flight", "auto", "--joint-noise", "0.3deg"]
    main([*command, "--json", "--html", str(page)])
    data = json.loads(capfd.readouterr().out)
    recording = sp.read_recorded_motion(file, "diver", flight="auto")
    found = sp.motion_from_recording("diver", recording, joints="0.3deg")
    shares = sp.contributions(found.motion, joints="0.3deg", start=found.fitted, up="y")
    for name in ("whole", "shared", "without"):
        np.testing.assert_allclose(data["bars"][name], getattr(shares.bars, name), rtol=1e-6)
    (row,) = (row for row in shares.rows() if row[0] == "left arm")
    assert all(" ± " in text for text in row[1:])
    assert row[3] in page.read_text(encoding="utf-8")
    assert row[3] in str(shares)
    main([*command[:5], "--of", "rotation", "--json"])
    assert json.loads(capfd.readouterr().out)["bars"] is None


def test_errors_beside_results_without_bars_are_refused():
    motion = noisy_dive(arm_samples())
    for given in ({"of": "rotation"}, {"of": "phase"}, {"baseline": "mirrored"}, {"of": lambda flown: flown.duration}):
        with pytest.raises(WrongObjectError, match="error bars"):
            sp.contributions(motion, joints=0.01, **given)
