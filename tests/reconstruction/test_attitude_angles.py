"""Angles of attitudes in time, continued along the motion, and the axes by which an athlete's turns are counted."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.errors import ShapeError, UnknownNameError, WrongObjectError
from shapephase.reconstruction.attitude_angles import (
    EulerAngles,
    RotationVectors,
    continued_angles,
    euler_angles,
    followed,
)

TURN = 2.0 * np.pi
SEQUENCES = ["".join(three) for three in product("XYZ", repeat=3) if three[0] != three[1] != three[2]]
RIGID = sp.rigid(np.diag([4.0, 3.9, 0.5]), 1.0)


def along(attitude, times, chart, count: int = 40):
    """Numbers of a curve of rotations that is a function of time in [0, 1]."""

    def quaternions(some):
        return attitude(some).as_quat()[None]

    curve = followed(quaternions, np.linspace(0.0, 1.0, count), chart, 0.0)
    return continued_angles(quaternions, curve, np.asarray(times, dtype=float), chart, 0.0)[0]


@pytest.mark.parametrize("sequence", [*SEQUENCES, *map(str.lower, SEQUENCES)])
def test_euler_angles_of_all_sequences_are_those_of_scipy(sequence):
    """Of 40 random attitudes, and as attitudes again of such within 1e-8 rad of a pole, where SciPy's lock."""
    attitudes = Rotation.random(40, rng=np.random.default_rng(5))
    found = np.array([euler_angles(one[None], sequence)[0] for one in attitudes.as_matrix()])
    np.testing.assert_allclose(found, attitudes.as_euler(sequence), rtol=0, atol=1e-13)
    pole = 0.0 if sequence[0] == sequence[2] else 0.5 * np.pi
    near = Rotation.from_euler(sequence, [0.3, pole + 1e-8, 0.5])
    again = Rotation.from_euler(sequence, euler_angles(near.as_matrix()[None], sequence)[0])
    assert (again * near.inv()).magnitude() < 1e-14


def test_rotation_vectors_go_on_past_half_turns():
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    times = np.linspace(0.0, 1.0, 23)
    for turns in (lambda t: 11.0 * np.pi * t, lambda t: 7.0 * np.pi * np.sin(np.pi * t)):
        expected = turns(times)[:, None] * axis
        found = along(lambda t, f=turns: Rotation.from_rotvec(f(t)[:, None] * axis), times, RotationVectors(), 100)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("distance", [2e-3, 1e-5, -1e-5, 1e-8, -1e-8])
@pytest.mark.parametrize("sequence", ["XYZ", "YXZ", "ZXZ", "zyx"])
def test_a_motion_that_passes_near_a_pole_has_the_same_angles_whichever_times_are_asked(sequence, distance):
    """The outer angles go round by half a turn each within a time as short as the distance, one way or the other.

    The middle angle comes to a pole, which the body's last axis misses by the distance, and goes back.
    """
    pole = 0.0 if sequence[0] == sequence[2] else 0.5 * np.pi
    outer, middle = (
        np.eye(3)["xyz".index(axis)] for axis in (sequence if sequence.isupper() else sequence[::-1]).lower()[:2]
    )

    def attitude(times):
        passing = Rotation.from_rotvec((pole - 0.4 + 0.8 * times)[:, None] * middle)
        return Rotation.from_rotvec(distance * np.cross(outer, middle)) * passing

    asked = np.array([0.0, 0.21, 0.49, 0.51, 1.0])
    few = along(attitude, asked, EulerAngles(sequence))
    (last,) = along(attitude, [1.0], EulerAngles(sequence))
    many = along(attitude, np.union1d(asked, np.linspace(0.0, 1.0, 2001)), EulerAngles(sequence))
    np.testing.assert_allclose(last, few[-1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(many[-1], few[-1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.abs(few[-1] - few[0])[::2], np.pi, atol=6.0 * abs(distance))
    if abs(distance) > 1e-6:
        # SciPy's angles, each the nearest to those before, at times as near as the motion comes.
        steps = np.logspace(np.log10(abs(distance)) - 3.0, np.log10(0.5), 3000)
        known = np.unwrap(attitude(np.concatenate([0.5 - steps[::-1], 0.5 + steps])).as_euler(sequence), axis=0)
        np.testing.assert_allclose(few[-1] - few[0], known[-1] - known[0], rtol=0, atol=1e-9)
    assert (Rotation.from_euler(sequence, few) * attitude(asked).inv()).magnitude().max() < 1e-13


def test_a_motion_through_a_pole_goes_straight_on():
    """A cartwheel of three turns is all tilt; at rest at a pole the last angle is zero."""
    times = np.linspace(0.0, 1.0, 11)
    found = along(
        lambda t: Rotation.from_rotvec(3.0 * TURN * t[:, None] * [1.0, 0.0, 0.0]), times, EulerAngles("YXZ"), 50
    )
    np.testing.assert_allclose(found, np.outer(times, [0.0, 3.0 * TURN, 0.0]), rtol=0, atol=1e-9)
    spin = along(
        lambda t: Rotation.from_rotvec(3.0 * TURN * t[:, None] * [0.0, 0.0, 1.0]), times, EulerAngles("ZXZ"), 50
    )
    np.testing.assert_allclose(spin[:, 0] + spin[:, 2], 3.0 * TURN * times, rtol=0, atol=1e-12)
    np.testing.assert_allclose(spin[:, 1:], 0.0, atol=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_a_body_that_tumbles_near_the_pole_of_the_chart_has_one_count(seed):
    """Cartwheels within 0.12 degrees of the pole, through which the tilt passes: any times asked for give the same."""
    rng = np.random.default_rng(seed)
    lean = 10.0 ** rng.uniform(-5.0, -2.7)
    momentum = 8.0 * np.pi * rng.uniform(0.6, 3.0) * np.array([1.0, *(lean * rng.normal(size=2))])
    motion = sp.reconstruct(sp.rigid(np.diag([4.0, 4.2, 4.1]), 1.0), momentum, so3.exp(lean * rng.normal(size=3)))
    turned = []
    for count in (0, 3, 50, 3000):
        angles = motion.euler_angles(np.union1d([0.0, 1.0], rng.random(count)), "YXZ")
        turned.append(angles[-1] - angles[0])
    np.testing.assert_allclose(turned, np.tile(turned[:1], (4, 1)), rtol=0, atol=1e-12)


# ---- The axes of an athlete ----------------------------------------------------------------------------------------


def dive(attitude=None, momentum=(0.0, 60.0, 0.0)):
    """A diver whose left arm swings, with a momentum, seen from a laboratory that is turned."""
    body = sp.load_body("diver")
    times = np.linspace(0.0, 1.5, 31)
    shapes = np.stack([1.5 - 1.3 * np.sin(np.pi * times / 1.5) ** 2, np.full_like(times, -1.5)], axis=1)
    path = sp.ShapePath.spline(times, shapes, periodic=False, joint_names=body.joint_names)
    turned = np.eye(3) if attitude is None else attitude
    return sp.reconstruct(sp.articulated(body, path), turned @ np.asarray(momentum), attitude=turned)


def counts(motion, **options):
    found = np.array(motion.somersault_tilt_twist([0.0, 0.4, motion.duration], **options))
    return found - found[:, :1] * [[1.0], [0.0], [1.0]]


@pytest.mark.parametrize("momentum", [(0.0, 60.0, 0.0), (3.0, -60.0, 10.0), (2.0, 1.0, 12.0), (0.0, 0.0, 0.0)])
def test_a_flight_has_the_same_counts_in_all_laboratories(momentum):
    """Ten laboratories turned about the vertical, and such with y up: to 1e-9; also without momentum."""
    known = counts(dive(momentum=momentum))
    y_up = so3.exp(np.array([-0.5 * np.pi, 0.0, 0.0]))
    for yaw in np.random.default_rng(4).uniform(-np.pi, np.pi, 5):
        turned = so3.exp(np.array([0.0, 0.0, yaw]))
        np.testing.assert_allclose(counts(dive(turned, momentum)), known, rtol=0, atol=1e-9)
        np.testing.assert_allclose(counts(dive(y_up @ turned, momentum), up="y"), known, rtol=0, atol=1e-9)


def test_a_dive_of_given_somersault_tilt_and_twist_is_counted_as_it_was_made():
    """Yeadon's angles of a rigid body by SciPy: 1.07 somersaults about y, 1.26 twists about z, 10 degrees of tilt."""
    times = np.linspace(0.0, 1.0, 21)
    somersault, tilt, twist = 1.07 * TURN * times, np.radians(10.0) * np.sin(np.pi * times), -1.26 * TURN * times

    def curve(some):
        angles = [1.07 * TURN * some, np.radians(10.0) * np.sin(np.pi * some), -1.26 * TURN * some]
        return Rotation.from_euler("YXZ", np.stack(angles, axis=-1))

    found = along(curve, times, EulerAngles("YXZ"), 200)
    np.testing.assert_allclose(found, np.stack([somersault, tilt, twist], axis=-1), rtol=0, atol=1e-12)


def test_the_long_axis_is_that_of_the_whole_body_and_the_lateral_one_goes_from_right_to_left():
    """Of people that ship: z is up, y to the left; both arms hang, so the body is as symmetric as its file."""
    for name in ("astronaut", "astronaut_female", "diver"):
        body = sp.load_body(name)
        path = sp.ShapePath.spline([0.0, 1.0], [body.shape(), body.shape()], joint_names=body.joint_names)
        axes = sp.reconstruct(sp.articulated(body, path), [0.0, 3.0, 0.0]).athlete_axes()
        assert so3.angle_between(axes.longitudinal, np.array([0.0, 0.0, 1.0])) < np.radians(3.0)
        assert so3.angle_between(axes.lateral, np.array([0.0, 1.0, 0.0])) < np.radians(3.0)
        inertia = sp.articulated(body, path).inertia(0.0)
        assert np.isclose(axes.longitudinal @ inertia @ axes.longitudinal, np.linalg.eigvalsh(inertia)[0], rtol=1e-12)


def test_a_backward_somersault_counts_down_and_a_twisting_jump_is_no_somersault():
    spin = 2.0 * TURN
    forward, backward = (
        sp.reconstruct(RIGID, [0.0, sign * 3.9 * spin, 0.0]).somersault_tilt_twist([0.0, 1.0], lateral="y")
        for sign in (1.0, -1.0)
    )
    np.testing.assert_allclose(np.diff(forward)[:, 0], [spin, 0.0, 0.0], atol=1e-8)
    np.testing.assert_allclose(np.diff(backward)[:, 0], [-spin, 0.0, 0.0], atol=1e-8)
    jump = sp.reconstruct(RIGID, [0.0, 0.01, 0.5 * spin])
    axes = jump.athlete_axes(lateral="y")
    assert "made horizontal" in axes.reasons["somersault"]
    somersault, tilt, twist = np.diff(jump.somersault_tilt_twist([0.0, 1.0], lateral="y"))[:, 0]
    assert abs(somersault) < 0.02
    assert abs(tilt) < 0.02
    np.testing.assert_allclose(twist, spin, atol=1e-3)


def test_axes_may_be_given_and_are_said():
    motion = sp.reconstruct(RIGID, [4.0, 0.0, 0.0])
    axes = motion.athlete_axes(lateral=[1.0, 0.0, 0.2], longitudinal="z", somersault="-y", up=[0.0, 0.0, 2.0])
    np.testing.assert_allclose([axes.lateral, axes.longitudinal, axes.somersault, axes.up], np.array(
        [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]), atol=1e-15)  # fmt: skip
    assert "as given" in str(axes)
    own = str(motion.athlete_axes())
    for said in ("horizontal part of the momentum (1.000 0.000 0.000", "least inertia", "up is z"):
        assert said in own


def test_axes_that_cannot_be_found_have_to_be_given():
    resting = sp.reconstruct(RIGID, np.zeros(3))
    with pytest.raises(WrongObjectError, match="lateral='y'"):
        resting.athlete_axes()
    round_body = sp.reconstruct(sp.rigid(np.diag([1.0, 1.0, 2.0]), 1.0), [1.0, 0.0, 0.0])
    with pytest.raises(WrongObjectError, match="longitudinal='z'"):
        round_body.athlete_axes()
    lying = sp.reconstruct(RIGID, np.zeros(3), attitude=so3.exp(np.array([0.5 * np.pi, 0.0, 0.0])))
    with pytest.raises(ShapeError, match="somersault='x'"):
        lying.athlete_axes(lateral="y")
    with pytest.raises(ShapeError, match="axis"):
        resting.athlete_axes(lateral="y", somersault="z")
    with pytest.raises(UnknownNameError, match="up"):
        resting.athlete_axes(lateral="y", up="north")


def test_batches_have_axes_of_their_own():
    """A somersault, and a twisting jump, in one batch, as each alone."""
    momenta = np.array([[0.0, 20.0, 1.0], [0.1, 0.3, 5.0]])
    together = np.array(sp.reconstruct(RIGID, momenta).somersault_tilt_twist([0.0, 0.7, 1.0], lateral="y"))
    for row, momentum in enumerate(momenta):
        alone = np.array(sp.reconstruct(RIGID, momentum).somersault_tilt_twist([0.0, 0.7, 1.0], lateral="y"))
        np.testing.assert_allclose(together[:, row], alone, rtol=0, atol=1e-8)
