"""Frames that a body has of itself: its links, its mean frame, and the energy seen from them all.

The truth is Pinocchio with the floating base where the frame would be at rest, point masses, SciPy's fit of one cloud
of points to another, and a body's tree hung up by hand at another link.
"""

from __future__ import annotations

# Pinocchio fills its namespace at import time, where a type checker cannot look.
# pyright: reportAttributeAccessIssue=false
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.deformation import link_gauge, mean_body_gauge
from shapephase.errors import AccuracyNotReached, GaugeError, ShapeError, UnknownNameError
from support.bodies import joint, link, random_loop, random_shapes, urdf
from support.independent import BODIES, apart, body_of, random_rotation, random_vector, urdf_file
from support.long_runs import full_but

Array = NDArray[np.float64]
LENGTH = 3.0
T = np.linspace(0.0, LENGTH, 11)
INNER = np.linspace(0.2, LENGTH - 0.2, 9)


def transposed(matrices):
    return np.swapaxes(matrices, -1, -2)


def applied(matrices, vectors):
    return np.einsum("...ij,...j->...i", matrices, vectors)


def closure_of(deformation: sp.Deformation) -> Array:
    assert deformation.closure is not None
    return deformation.closure


def close(got, want, tolerance):
    """Relative to the largest entry."""
    np.testing.assert_allclose(got, want, rtol=0.0, atol=tolerance * max(np.abs(want).max(), 1e-300))


def slope_of(function, t, step=5e-3):
    """Nine-point differences."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    return sum(w * (function(t + k * step) - function(t - k * step)) for k, w in weights.items()) / step


def rates_of(frame, t, step=5e-3):
    """Body rates of U from differences."""
    spin = transposed(frame(t)) @ slope_of(frame, t, step)
    return np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)


def swaying(t):
    """U about two axes, not the identity at 0, with its body rates."""
    first, second = np.array([0.6, 0.0, 0.8]), np.array([0.0, 1.0, 0.0])
    inner = Rotation.from_rotvec((0.3 * t)[:, None] * second)
    turns = Rotation.from_rotvec((0.4 + np.sin(t))[:, None] * first) * inner
    return turns.as_matrix(), np.cos(t)[:, None] * inner.inv().apply(first) + 0.3 * second


# ---- Bodies, and Pinocchio's floating base for them -----------------------------------------------------------------

# A joint of every kind: a slide, a wheel, a follower, links fixed to others with mass and without.
LINKS = (
    link("torso", 3.0, [[0.3, 0.02, -0.01], [0.02, 0.4, 0.03], [-0.01, 0.03, 0.25]], com=(0.02, -0.03, 0.1)),
    link("arm", 0.8, (0.02, 0.03, 0.015), com=(0.2, 0.0, 0.05)),
    link("rod", 0.5, (0.004, 0.01, 0.011), com=(0.1, 0.02, 0.0)),
    link("forearm", 0.4, (0.003, 0.006, 0.005), com=(0.0, 0.1, 0.0)),
    link("camera", 0.2, (0.001, 0.0011, 0.0009), com=(0.03, 0.0, 0.0)),
    link("wheel", 0.7, (0.01, 0.012, 0.02), com=(0.0, 0.01, 0.0)),
    '<link name="tag"/>',
)
JOINTS = (
    joint("shoulder", "revolute", "torso", "arm", (0.36, 0.48, 0.8), (0.1, 0.2, 0.3), (0.3, -0.2, 0.5)),
    joint("slide", "prismatic", "arm", "rod", (0.6, 0.0, 0.8), (0.3, 0.0, 0.1), (-0.4, 0.1, 0.2)),
    joint("elbow", "revolute", "arm", "forearm", (0.0, 1.0, 0.0), (0.4, 0.0, 0.0), (0.0, 0.7, 0.1), "{mimic}"),
    joint("mount", "fixed", "forearm", "camera", (0.0, 0.0, 1.0), (0.0, 0.2, 0.0), (0.5, 0.4, -0.3)),
    joint("axle", "continuous", "torso", "wheel", (0.0, 0.6, 0.8), (-0.2, 0.0, 0.1), (0.1, 0.2, 0.3)),
    joint("glue", "fixed", "wheel", "tag", (0.0, 0.0, 1.0), (0.0, 0.0, 0.1), (1.0, -0.5, 0.2)),
)
MIMIC = '<mimic joint="shoulder" multiplier="-0.5" offset="0.2"/>'
CONTRAPTION = urdf(*LINKS, *JOINTS, name="contraption").replace("{mimic}", MIMIC)


@dataclass(frozen=True)
class Case:
    """A body in motion, and the same in a Pinocchio model of its own."""

    body: sp.Body
    path: sp.ShapePath
    model: pin.Model
    followers: tuple[tuple[str, str, float, float], ...]
    momentum: float

    @property
    def deformation(self) -> sp.Deformation:
        return sp.articulated(self.body, self.path)

    def state(self, t: float) -> tuple[Array, Array]:
        """Configuration and velocity at the time, base at the identity and at rest."""
        shape, rate = self.path.shape(t), self.path.rate(t)
        coordinates = dict(zip(self.body.joint_names, zip(shape, rate, strict=True), strict=True))
        for follower, leader, factor, offset in self.followers:
            value, speed = coordinates[leader]
            coordinates[follower] = (factor * value + offset, factor * speed)
        q, v = pin.neutral(self.model), np.zeros(self.model.nv)
        for name, (value, speed) in coordinates.items():
            kind = self.model.joints[self.model.getJointId(name)]
            q[kind.idx_q : kind.idx_q + kind.nq] = [np.cos(value), np.sin(value)] if kind.nq == 2 else value
            v[kind.idx_v] = speed
        return q, v

    def link(self, t: float, name: str) -> tuple[Array, Array]:
        """Orientation and angular velocity of a link, base axes."""
        data = self.model.createData()
        pin.forwardKinematics(self.model, data, *self.state(t))
        frame = self.model.getFrameId(name, pin.FrameType.BODY)
        turned = pin.updateFramePlacement(self.model, data, frame).rotation
        return turned.copy(), turned @ pin.getFrameVelocity(self.model, data, frame, pin.LOCAL).angular

    def seen(self, t: float, attitude: Array, omega: Array) -> tuple[Array, Array, float]:
        """With the base turned and turning (base axes): inertia and momentum about the centre of mass in world axes,
        and the energy without that of the centre of mass."""
        q, v = self.state(t)
        q[3:7] = Rotation.from_matrix(attitude).as_quat()
        v[3:6] = omega
        v[:3] = random_vector(3, 0.7)  # which must not matter
        data = self.model.createData()
        pin.ccrba(self.model, data, q, v)
        inertia, momentum = data.Ig.inertia.copy(), data.hg.angular.copy()
        drift = 0.5 * data.hg.linear @ data.hg.linear / pin.computeTotalMass(self.model)
        return inertia, momentum, pin.computeKineticEnergy(self.model, data, q, v) - drift

    def points(self, t: float) -> tuple[Array, Array, Array]:
        """Six point masses for each link, with its mass, centre and second moments: masses, places and speeds.

        Both from the centre of mass, base axes, the base at rest.
        """
        data = self.model.createData()
        pin.forwardKinematics(self.model, data, *self.state(t))
        masses, places, speeds = [], [], []
        for number in range(1, self.model.njoints):
            inertia, place, motion = self.model.inertias[number], data.oMi[number], data.v[number]
            if inertia.mass == 0.0:
                continue
            spread, axes = np.linalg.eigh(0.5 * np.trace(inertia.inertia) * np.eye(3) - inertia.inertia)
            arms = (axes * np.sqrt(3.0 * np.maximum(spread, 0.0) / inertia.mass)).T
            for arm in (*arms, *-arms):
                local = inertia.lever + arm
                masses.append(inertia.mass / 6.0)
                places.append(place.act(local))
                speeds.append(place.rotation @ (motion.linear + np.cross(motion.angular, local)))
        weights, points, rates = np.array(masses), np.array(places), np.array(speeds)
        centre = weights / weights.sum()
        return weights, points - centre @ points, rates - centre @ rates


@lru_cache(maxsize=8)
def case_of(name: str) -> Case:
    rng = np.random.default_rng(7)
    if name != "contraption":
        body = body_of(name)
        model = pin.buildModelFromUrdf(str(urdf_file(name)), pin.JointModelFreeFlyer())
        return Case(body, random_loop(body, rng, duration=LENGTH, amplitude=0.5), model, (), 0.4 * BODIES[name])
    body = loaded(CONTRAPTION)
    model = pin.buildModelFromXML(CONTRAPTION, pin.JointModelFreeFlyer())
    swing, wheel = random_loop(body, rng, duration=LENGTH, amplitude=0.5), body.joint_index("axle")

    def path(t):
        shapes, rates = swing.shape(t), swing.rate(t)
        shapes[:, wheel] += 2.0 * np.pi / LENGTH * t
        rates[:, wheel] += 2.0 * np.pi / LENGTH
        return shapes, rates

    joints = sp.ShapePath.function(path, LENGTH, joint_names=body.joint_names)
    return Case(body, joints, model, (("elbow", "shoulder", -0.5, 0.2),), 1.0)


def loaded(text: str) -> sp.Body:
    with TemporaryDirectory() as folder:
        file = Path(folder) / "body.urdf"
        file.write_text(text, encoding="utf-8")
        return sp.load_body(file)


CASES = ("contraption", "satellite", "cat", "example:human")
ANY_LINK = (
    *product(["contraption"], ["arm", "rod", "forearm", "camera", "wheel", "tag"]),
    *product(["satellite"], ["boom", "dish", "wheel", "arm_link_6"]),
    ("cat", "head"),
    ("example:human", "left_foot"),
)


@pytest.fixture(params=CASES)
def case(request):
    return case_of(request.param)


@pytest.fixture(params=ANY_LINK, ids="-".join)
def linked(request):
    """A body in motion and one of its links."""
    name, link_name = request.param
    return case_of(name), link_name


# ---- A link's frame -------------------------------------------------------------------------------------------------


def test_a_link_stands_still_in_its_own_frame(linked):
    """U = R_base_link^T; inertia and momentum are those with the link along the world's axes, and at rest."""
    case, name = linked
    there = link_gauge(case.deformation, name)
    inertia, momentum, frame = there.inertia(T), there.internal_momentum(T), there.frame(T)
    for row, t in enumerate(T):
        turned, omega = case.link(t, name)
        np.testing.assert_allclose(frame[row], turned.T, atol=1e-14, rtol=0)
        want, carried, _ = case.seen(t, turned.T, -omega)
        close(inertia[row], want, 1e-13)
        np.testing.assert_allclose(momentum[row], carried, atol=1e-13 * np.abs(momentum).max(), rtol=0)
        np.testing.assert_allclose(
            there.centre_of_mass(t), turned.T @ case.deformation.centre_of_mass(t), atol=1e-13, rtol=0
        )


def test_the_base_link_is_the_base(case):
    """The root link's frame is the one that the joint path is described in."""
    loop = case.deformation
    there = link_gauge(loop, case.body.link_names[0])
    np.testing.assert_array_equal(there.frame(T), np.stack([np.eye(3)] * len(T)))
    close(there.inertia(T), loop.inertia(T), 1e-15)
    close(there.internal_momentum(T), loop.internal_momentum(T), 1e-15)
    np.testing.assert_allclose(closure_of(there), np.eye(3), atol=1e-15, rtol=0)


def test_a_link_is_the_same_frame_from_wherever_it_is_asked_for(linked):
    """The frame of a link does not depend on the frame that the body was described in before."""
    case, name = linked
    loop = case.deformation
    direct = link_gauge(loop, name)
    for before in (sp.in_gauge(loop, swaying), link_gauge(loop, case.body.link_names[-1]), mean_body_gauge(loop, 1.0)):
        there = link_gauge(before, name)
        np.testing.assert_allclose(there.frame(T), direct.frame(T), atol=1e-13, rtol=0)
        close(there.inertia(T), direct.inertia(T), 1e-13)
        np.testing.assert_allclose(
            there.internal_momentum(T),
            direct.internal_momentum(T),
            atol=1e-13 * max(np.abs(seen.internal_momentum(T)).max() for seen in (before, direct)),
            rtol=0,
        )
        np.testing.assert_allclose(closure_of(there), closure_of(direct), atol=1e-13, rtol=0)
        np.testing.assert_allclose(there.centre_of_mass(T), direct.centre_of_mass(T), atol=1e-13, rtol=0)


def test_an_unknown_link_is_answered_with_the_links():
    deformation = case_of("contraption").deformation
    for seen in (deformation, sp.in_gauge(deformation, swaying)):
        with pytest.raises(UnknownNameError, match="link"):
            link_gauge(seen, "camara")
    with pytest.raises(UnknownNameError, match="shoulder"):
        link_gauge(deformation, "shoulder")  # a joint


def test_what_has_no_links_is_refused(tmp_path):
    for deformation in without_links(tmp_path):
        with pytest.raises(GaugeError, match="link"):
            link_gauge(deformation, "torso")


def without_links(folder):
    """Particles, a rigid body, a prescribed inertia, and a motion read from a file."""
    file = folder / "motion.npz"
    sp.reconstruct(case_of("contraption").deformation, [0.1, 0.2, 0.3]).save(file)
    return (
        sp.particles(MASSES, moving, LENGTH),
        sp.rigid(np.diag([1.0, 2.0, 2.5]), LENGTH),
        sp.prescribed(lambda t: np.stack([np.diag([1.0, 2.0, 2.5])] * len(t)), None, LENGTH),
        sp.load_motion(file).deformation,
    )


# ---- A tree hung up at another link ---------------------------------------------------------------------------------

CHAIN_LINKS = (
    link("head", 2.0, [[0.2, 0.01, 0.02], [0.01, 0.3, -0.02], [0.02, -0.02, 0.25]], com=(0.1, -0.05, 0.2)),
    link("middle", 1.1, [[0.05, 0.004, 0.0], [0.004, 0.04, 0.003], [0.0, 0.003, 0.06]], com=(-0.1, 0.1, 0.05)),
    link("tail", 0.7, [[0.02, 0.0, 0.002], [0.0, 0.03, 0.001], [0.002, 0.001, 0.025]], com=(0.2, 0.03, 0.0)),
)
CHAIN_JOINTS = (
    ("bend", "revolute", "head", "middle", (0.36, 0.48, 0.8), (0.3, -0.1, 0.2), (0.4, -0.3, 0.7)),
    ("push", "prismatic", "middle", "tail", (0.6, 0.0, 0.8), (-0.2, 0.1, 0.4), (-0.6, 0.5, 0.2)),
)


def hung_up_at(root: str) -> sp.Body:
    """The chain with another root: a joint gone through backwards turns about minus its axis, in the child's frame."""
    order = ["head", "middle", "tail"]
    elements = list(CHAIN_LINKS)
    for name, kind, parent, child, axis, xyz, rpy in CHAIN_JOINTS:
        if order.index(root) < order.index(child):
            elements.append(joint(name, kind, parent, child, axis, xyz, rpy))
            continue
        back = Rotation.from_euler("xyz", rpy).inv()
        hinge = f"{parent}_hinge"
        elements += [
            f'<link name="{hinge}"/>',
            joint(name, kind, child, hinge, -np.asarray(axis)),
            joint(f"{name}_back", "fixed", hinge, parent, xyz=-back.apply(xyz), rpy=back.as_euler("xyz")),
        ]
    return loaded(urdf(*elements, name=f"chain_from_{root}"))


@pytest.mark.parametrize("root", ["middle", "tail"])
def test_a_link_gauge_is_another_root_of_the_tree(root):
    """The same body hung up by hand at the link: same inertia, same internal momentum, same motion."""
    first, second = hung_up_at("head"), hung_up_at(root)
    assert second.link_names[0] == root
    path = random_loop(first, np.random.default_rng(3), duration=LENGTH, amplitude=0.8)
    there, other = link_gauge(sp.articulated(first, path), root), sp.articulated(second, path)
    close(there.inertia(T), other.inertia(T), 1e-12)
    close(there.internal_momentum(T), other.internal_momentum(T), 1e-12)
    close(there.inertia_rate(T), other.inertia_rate(T), 1e-12)
    close(there.kinetic_energy(T, [0.3, -0.2, 0.5]), other.kinetic_energy(T, [0.3, -0.2, 0.5]), 1e-12)
    np.testing.assert_allclose(closure_of(there), closure_of(other), atol=1e-13, rtol=0)
    # And back: the root of the first as a link of the second.
    back, at_first = link_gauge(other, "head"), sp.articulated(first, path)
    close(back.inertia(T), at_first.inertia(T), 1e-12)
    close(back.internal_momentum(T), at_first.internal_momentum(T), 1e-12)
    mean, again = (mean_body_gauge(d, 1.0) for d in (there, other))
    np.testing.assert_allclose(mean.frame(T) @ transposed(there.frame(T)), again.frame(T), atol=1e-12, rtol=0)
    mu = np.array([0.2, -0.1, 0.3])
    seen, direct = (sp.reconstruct(d, mu, tolerance=1e-11).attitude(T) for d in (there, other))
    np.testing.assert_allclose(seen, direct, atol=1e-10, rtol=0)


# ---- The mean frame of the body -------------------------------------------------------------------------------------

MASSES = np.array([1.0, 0.7, 1.3, 0.4, 0.9])
REST = np.array([[0.5, 0.1, -0.2], [-0.4, 0.6, 0.1], [0.2, -0.5, 0.7], [0.1, 0.3, -0.9], [-0.6, -0.2, 0.1]])
WAVES = np.random.default_rng(12).normal(scale=0.2, size=(2, 5, 3))
PULSE = 2.0 * np.pi / LENGTH


def moving(t):
    """Particles that wander, swing and turn as a whole, back where they were after LENGTH."""
    phase = PULSE * t[:, None, None]
    places = REST + WAVES[0] * np.sin(phase) + WAVES[1] * (1.0 - np.cos(2.0 * phase))
    speeds = PULSE * (WAVES[0] * np.cos(phase) + 2.0 * WAVES[1] * np.sin(2.0 * phase))
    angle, rate = 1.2 * np.sin(PULSE * t), 1.2 * PULSE * np.cos(PULSE * t)
    axis = np.array([0.48, 0.6, 0.64])
    turns = Rotation.from_rotvec(angle[:, None] * axis).as_matrix()
    speeds = speeds + np.cross(rate[:, None, None] * axis, places)
    return places @ transposed(turns), speeds @ transposed(turns)


def centred(places, masses=MASSES):
    return places - (masses @ places / masses.sum())[..., None, :]


@pytest.mark.parametrize("reference", [0.0, 1.1, LENGTH])
def test_the_mean_frame_of_particles_is_the_best_fit(reference):
    """SciPy's fit of the masses to where they were; Eckart's condition; the identity at the reference."""
    there = mean_body_gauge(sp.particles(MASSES, moving, LENGTH), reference)
    still = centred(moving(np.array([reference]))[0])[0]
    turned = []
    for t in T:
        now = centred(moving(np.array([t]))[0])[0]
        frame = there.frame(t)
        best = Rotation.align_vectors(still, now, weights=MASSES)[0]
        np.testing.assert_allclose(frame, best.as_matrix(), atol=1e-12, rtol=0)
        # A polar factor is right for a correlation within some units of rounding of the given one, and that is how far
        # the product may be from symmetric; 64 units allow for the decomposition, the quaternion and the sum here.
        correlation = MASSES @ (np.linalg.norm(still, axis=1) * np.linalg.norm(now, axis=1))
        lack = np.einsum("m,mi->i", MASSES, np.cross(still, now @ frame.T))
        np.testing.assert_allclose(lack, 0.0, atol=64.0 * np.finfo(float).eps * correlation, rtol=0)
        turned.append(apart(frame, np.eye(3)))
    assert max(turned) > 0.5
    np.testing.assert_allclose(there.frame(reference), np.eye(3), atol=1e-14, rtol=0)
    np.testing.assert_allclose(closure_of(there), np.eye(3), atol=1e-13, rtol=0)


@pytest.mark.parametrize("reference", [0.0, 1.7])
def test_the_mean_frame_of_links_is_that_of_their_point_masses(case, reference):
    """Each link in the place of six points with its mass, centre and second moments."""
    there = mean_body_gauge(case.deformation, reference)
    masses, still, _ = case.points(reference)
    size = np.sum(masses * np.sum(still**2, axis=-1))
    for t, frame in zip(T, there.frame(T), strict=True):
        _, now, _ = case.points(t)
        best = Rotation.align_vectors(still, now, weights=masses)[0]
        np.testing.assert_allclose(frame, best.as_matrix(), atol=1e-11, rtol=0)
        eckart = np.einsum("m,mi->i", masses, np.cross(still, now @ frame.T))
        np.testing.assert_allclose(eckart, 0.0, atol=1e-13 * size, rtol=0)


def test_the_correlation_of_masses_is_a_sum_over_points(case):
    """C = sum m r r_reference^T and its rate; at the reference shape the second moment of the locked body."""
    masses, still, _ = case.points(0.7)
    correlation, slope = case.body.mass_correlation(case.path.shape(T), case.path.rate(T), case.path.shape(0.7))
    sums = [np.einsum("m,kmi,mj->kij", masses, np.stack(case.points(t)[1:]), still) for t in T]
    close(correlation, [both[0] for both in sums], 1e-13)
    close(slope, [both[1] for both in sums], 1e-12)
    shape = case.path.shape(0.7)
    moment, _ = case.body.mass_correlation(shape, 0.0 * shape, shape)
    close(np.trace(moment) * np.eye(3) - moment, case.body.locked_inertia(shape), 1e-13)


def everything():
    return {
        **{name: case_of(name).deformation for name in CASES},
        "particles": sp.particles(MASSES, moving, LENGTH),
    }


@pytest.mark.parametrize("name", [*CASES, "particles"])
def test_rates_of_the_mean_frame_against_differences(name):
    """The law B4 with U differentiated here."""
    loop = everything()[name]
    there = mean_body_gauge(loop, 0.9)
    frame, omega = there.frame(INNER), rates_of(there.frame, INNER)
    want = applied(frame, applied(loop.inertia(INNER), omega) + loop.internal_momentum(INNER))
    size = np.abs(loop.internal_momentum(INNER)).max()
    np.testing.assert_allclose(there.internal_momentum(INNER), want, atol=1e-10 * size, rtol=0)
    close(there.inertia(INNER), frame @ loop.inertia(INNER) @ transposed(frame), 1e-14)
    close(there.inertia_rate(INNER), slope_of(there.inertia, INNER), 1e-10)


def test_the_mean_frame_depends_on_the_shape_alone(case):
    """There and back at another speed, and round again: the same shape has the same frame; a loop closes."""
    loop = sp.articulated(case.body, case.path)
    once = mean_body_gauge(loop)
    np.testing.assert_allclose(closure_of(once), np.eye(3), atol=1e-13, rtol=0)
    back = mean_body_gauge(sp.articulated(case.body, case.path.reversed().stretched(2.0)), 2.0 * LENGTH)
    np.testing.assert_allclose(back.frame(2.0 * (LENGTH - T)), once.frame(T), atol=1e-12, rtol=0)
    twice = mean_body_gauge(sp.articulated(case.body, case.path.repeated(2)))
    np.testing.assert_allclose(twice.frame(LENGTH + T[:-1]), once.frame(T[:-1]), atol=1e-12, rtol=0)
    np.testing.assert_allclose(closure_of(twice), np.eye(3), atol=1e-13, rtol=0)


def test_the_mean_frame_of_a_body_already_seen_from_elsewhere(case):
    """U_mean,here U = U(reference) U_mean: the same mean frame, along the axes that U has at the reference."""
    loop, reference = case.deformation, 1.4
    once = mean_body_gauge(loop, reference)
    turns = swaying(np.array([reference]))[0][0]
    there = mean_body_gauge(sp.in_gauge(loop, swaying), reference)
    np.testing.assert_allclose(there.frame(T), turns @ once.frame(T), atol=1e-13, rtol=0)
    close(there.inertia(T), turns @ once.inertia(T) @ turns.T, 1e-13)
    size = np.abs(loop.internal_momentum(T)).max()
    want = once.internal_momentum(T) @ turns.T
    np.testing.assert_allclose(there.internal_momentum(T), want, atol=1e-12 * size, rtol=0)
    np.testing.assert_allclose(closure_of(there), np.eye(3), atol=1e-13, rtol=0)
    twice = mean_body_gauge(once, reference)
    np.testing.assert_allclose(twice.frame(T), once.frame(T), atol=1e-13, rtol=0)


def test_a_rigid_body_is_its_own_mean():
    """Also when described from a turning frame: the mean frame undoes the turn.

    The frame is a polar factor of a correlation whose condition, its norm over the sum of its two least singular values
    (the least moment), is near one: rounding units come out as they went in. Some eight of them without a turn, where
    the decomposition is that of a symmetric matrix; with it three products of rotations more, and a general matrix.
    """
    eps = np.finfo(float).eps
    rigid = sp.rigid([[2.0, 0.1, 0.0], [0.1, 2.5, 0.2], [0.0, 0.2, 3.0]], LENGTH)
    here = mean_body_gauge(rigid).frame(T)
    np.testing.assert_allclose(here, np.stack([np.eye(3)] * len(T)), atol=8.0 * eps, rtol=0)
    there = mean_body_gauge(sp.in_gauge(rigid, swaying))
    start = swaying(np.zeros(1))[0][0]
    np.testing.assert_allclose(there.frame(T), np.stack([start] * len(T)), atol=64.0 * eps, rtol=0)
    np.testing.assert_allclose(there.internal_momentum(T), 0.0, atol=1e-13, rtol=0)


def test_a_thin_rod_has_no_mean_frame():
    """All its mass on a line: how it is turned about the line is not in the masses (but it has a momentum there)."""
    with pytest.raises(GaugeError, match="body"):
        mean_body_gauge(sp.rigid(np.diag([1e-8, 1.0, 1.0]), LENGTH))
    plate = mean_body_gauge(sp.rigid(np.diag([1.0, 2.0, 3.0]), LENGTH))
    np.testing.assert_allclose(plate.frame(T), np.stack([np.eye(3)] * len(T)), atol=1e-15, rtol=0)


def test_a_flat_body_has_a_mean_frame():
    """Three masses in a plane: C is of rank two, and the turn in the plane is the best fit."""
    masses = np.array([1.0, 2.0, 1.5])
    rest = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, -0.5, 0.0]])

    def flat(t):
        angle = 0.9 * np.sin(t)
        turns = Rotation.from_rotvec(angle[:, None] * [0.0, 0.0, 1.0]).as_matrix()
        places = rest * (1.0 + 0.2 * np.sin(t))[:, None, None]
        speeds = rest * (0.2 * np.cos(t))[:, None, None] + np.cross(
            (0.9 * np.cos(t))[:, None, None] * [0.0, 0.0, 1.0], places
        )
        return places @ transposed(turns), speeds @ transposed(turns)

    there = mean_body_gauge(sp.particles(masses, flat, LENGTH))
    want = Rotation.from_rotvec(-0.9 * np.sin(T)[:, None] * [0.0, 0.0, 1.0]).as_matrix()
    np.testing.assert_allclose(there.frame(T), want, atol=1e-14, rtol=0)
    np.testing.assert_allclose(there.internal_momentum(T), 0.0, atol=1e-14, rtol=0)


# Three pairs of masses on the axes of a cross; the pair on the longest arm goes through the middle to the other side.
ARMS = np.array([0.7, 0.9, 1.3])


def turning_inside_out(t, tilt=0.0, arms=ARMS):
    """The last pair at +-arms[2] cos t, and a little aside of its axis by `tilt`."""
    ahead, across = np.zeros((len(t), 3, 3)), np.zeros((len(t), 3, 3))
    ahead[:, [0, 1], [0, 1]] = arms[:2]
    ahead[:, 2, 2], across[:, 2, 2] = arms[2] * np.cos(t), -arms[2] * np.sin(t)
    ahead[:, 2, 0], across[:, 2, 0] = tilt * np.sin(t), tilt * np.cos(t)
    return np.concatenate([ahead, -ahead], axis=1), np.concatenate([across, -across], axis=1)


def test_where_two_orientations_are_equally_near_there_is_no_mean_frame():
    """C = 2 diag(0.7^2, 0.9^2, 1.3^2 cos t): two are as near where -1.3^2 cos t = 0.7^2, at the end or a break."""
    meeting = np.arccos(-((ARMS[0] / ARMS[2]) ** 2))
    for deformation in (
        sp.particles(np.ones(6), turning_inside_out, meeting),
        sp.particles(np.ones(6), turning_inside_out, np.pi, breaks=[meeting]),
    ):
        with pytest.raises(GaugeError, match=rf"t = {meeting:.6f}.* choose another reference time"):
            mean_body_gauge(deformation)
    # The mirror image of a body with two equal arms.
    mirrored = sp.particles(np.ones(6), lambda t: turning_inside_out(t, arms=ARMS[[0, 0, 2]]), np.pi)
    with pytest.raises(GaugeError, match="body"):
        mean_body_gauge(mirrored)


@pytest.mark.parametrize("duration", [2.0, 3.0, np.pi])
def test_past_the_mirror_image_nothing_is_wrong_in_silence(duration):
    """The nearest orientation changes by a half turn at t = 1.865, where inertia and momentum show nothing of it."""
    deformation = sp.particles(np.ones(6), turning_inside_out, duration)
    mu, start = np.array([0.4, -0.8, 1.1]), np.eye(3)
    with pytest.raises((GaugeError, AccuracyNotReached)):
        sp.reconstruct(mean_body_gauge(deformation), mu, start)


def test_short_of_the_mirror_image_the_mean_frame_is_right():
    """Near the place where it ceases to be unique the frame turns fast, and is still the best fit."""
    deformation = sp.particles(np.ones(6), lambda t: turning_inside_out(t, 0.05), 1.86)
    there = mean_body_gauge(deformation)
    still = turning_inside_out(np.zeros(1), 0.05)[0][0]
    t = np.linspace(0.0, 1.86, 40)
    for time, frame in zip(t, there.frame(t), strict=True):
        now = turning_inside_out(np.array([time]), 0.05)[0][0]
        best = Rotation.align_vectors(still, now)[0]
        np.testing.assert_allclose(frame, best.as_matrix(), atol=1e-10, rtol=0)
    mu = np.array([0.4, -0.8, 1.1])
    plain, seen = (sp.reconstruct(d, mu, tolerance=1e-10) for d in (deformation, there))
    np.testing.assert_allclose(seen.attitude(t) @ there.frame(t), plain.attitude(t), atol=1e-9, rtol=0)


def test_without_masses_there_is_no_mean_frame_and_no_energy(tmp_path):
    *_, prescribed, read = without_links(tmp_path)
    for deformation in (prescribed, read, sp.in_gauge(read, swaying)):
        with pytest.raises(GaugeError, match="inertia"):
            mean_body_gauge(deformation)
        with pytest.raises(GaugeError, match="inertia"):
            deformation.kinetic_energy(0.5)


def test_a_reference_is_one_time_of_the_motion():
    deformation = sp.particles(MASSES, moving, LENGTH)
    for wrong in (-0.1, LENGTH + 0.1, np.nan, "start", [0.1, 0.2]):
        with pytest.raises(sp.ShapePhaseError):
            mean_body_gauge(deformation, wrong)  # type: ignore[arg-type]
    cat = body_of("cat")
    shapes = random_shapes(cat, np.random.default_rng(1), 2)
    with pytest.raises(ShapeError, match="reference"):
        cat.mass_correlation(shapes, shapes, shapes)


# ---- Kinetic energy -------------------------------------------------------------------------------------------------


def test_the_energy_against_a_floating_base(case):
    """At any attitude and any speed of the base: Pinocchio's energy without that of the centre of mass (Konig)."""
    rng = np.random.default_rng(8)
    omegas = rng.normal(size=(len(T), 3))
    energies = case.deformation.kinetic_energy(T, omegas)
    at_rest = case.deformation.kinetic_energy(T)
    assert energies.shape == at_rest.shape == T.shape
    for row, t in enumerate(T):
        turned = random_rotation(row)
        _, _, want = case.seen(t, turned, omegas[row])
        assert energies[row] == pytest.approx(want, rel=1e-12)
        masses, places, speeds = case.points(t)
        total = np.cross(omegas[row], places) + speeds
        assert energies[row] == pytest.approx(0.5 * masses @ np.sum(total**2, axis=-1), rel=1e-11)
        assert at_rest[row] == pytest.approx(0.5 * masses @ np.sum(speeds**2, axis=-1), rel=1e-11)
        shape, rate = case.path.shape(t), case.path.rate(t)
        assert case.body.kinetic_energy(shape, rate, omegas[row]) == pytest.approx(want, rel=1e-12)


def test_the_energy_of_particles_is_their_sum():
    rng = np.random.default_rng(8)
    omegas = rng.normal(size=(len(T), 3))
    deformation = sp.particles(MASSES, lambda t: shifted(*moving(t)), LENGTH)
    energies, at_rest = deformation.kinetic_energy(T, omegas), deformation.kinetic_energy(T)
    for row, t in enumerate(T):
        places, speeds = (centred(part)[0] for part in moving(np.array([t])))
        total = np.cross(omegas[row], places) + speeds
        assert energies[row] == pytest.approx(0.5 * MASSES @ np.sum(total**2, axis=-1), rel=1e-13)
        assert at_rest[row] == pytest.approx(0.5 * MASSES @ np.sum(speeds**2, axis=-1), rel=1e-13)


def shifted(places, speeds):
    """All of them elsewhere and on the way: what is about the centre of mass must not notice."""
    return places + np.array([3.0, -2.0, 5.0]), speeds + np.array([-1.0, 4.0, 2.0])


def frames_of(loop):
    """The same body seen from many frames."""
    seen = {
        "given": sp.in_gauge(loop, swaying),
        "alone": sp.in_gauge(loop, lambda t: swaying(t)[0]),
        "rates": sp.in_gauge(loop, rates=lambda t: swaying(t)[1]),
        "horizontal": sp.horizontal_gauge(loop),
        "mean": mean_body_gauge(loop, 0.8),
        "two": mean_body_gauge(sp.in_gauge(loop, swaying), 0.8),
    }
    if loop.label != "5 particles":
        names = loop.description.body.link_names
        seen["link"] = link_gauge(loop, names[-1])
        seen["link of the mean"] = link_gauge(seen["mean"], names[len(names) // 2])
    return seen


@pytest.mark.parametrize("name", full_but([*CASES, "particles"], "satellite", "contraption", "particles"))
def test_the_energy_is_quadratic_in_the_rate(name):
    """T = w.Iw/2 + L_o.w + T_0 (Cabrera's equation 4, the half restored), in every frame; least where L vanishes."""
    loop = everything()[name]
    omegas = np.random.default_rng(2).normal(size=(len(T), 3))
    for seen in (loop, *frames_of(loop).values()):
        inertia, internal, still = seen.inertia(T), seen.internal_momentum(T), seen.kinetic_energy(T)
        spin = 0.5 * np.einsum("ni,nij,nj->n", omegas, inertia, omegas)
        np.testing.assert_allclose(
            seen.kinetic_energy(T, omegas), spin + np.sum(internal * omegas, axis=-1) + still, rtol=1e-12
        )
        least = -np.linalg.solve(inertia, internal[..., None])[..., 0]
        lowest = still - 0.5 * np.einsum("ni,nij,nj->n", least, inertia, least)
        np.testing.assert_allclose(seen.kinetic_energy(T, least), lowest, atol=1e-12 * still.max(), rtol=0)
        np.testing.assert_allclose(
            sp.horizontal_gauge(loop).kinetic_energy(T), lowest, atol=1e-10 * still.max(), rtol=0
        )


@pytest.mark.parametrize("name", full_but([*CASES, "particles"], "satellite", "contraption", "particles"))
def test_the_energy_is_the_same_from_every_frame(name):
    """omega_here = U (omega - omega_U), U differentiated here: one body, one energy."""
    loop = everything()[name]
    omegas = np.random.default_rng(3).normal(size=(len(INNER), 3))
    want = loop.kinetic_energy(INNER, omegas)
    for kind, seen in frames_of(loop).items():
        here = applied(seen.frame(INNER), omegas - rates_of(seen.frame, INNER))
        np.testing.assert_allclose(seen.kinetic_energy(INNER, here), want, rtol=1e-10, err_msg=kind)


def test_leading_axes_of_the_new_functions(rng):
    """Shapes, rates and angular velocities broadcast; each row as alone."""
    cat = body_of("cat")
    shapes, rates = random_shapes(cat, rng, 6).reshape(2, 3, -1), rng.normal(size=(3, cat.n_shape))
    omegas = rng.normal(size=(2, 3, 3))
    energy = cat.kinetic_energy(shapes, rates, omegas)
    turning = cat.link_angular_velocity(shapes, rates, "head")
    correlation, slope = cat.mass_correlation(shapes, rates, shapes[0, 0])
    assert (energy.shape, turning.shape, correlation.shape) == ((2, 3), (2, 3, 3), (2, 3, 3, 3))
    for i, j in np.ndindex(2, 3):
        assert energy[i, j] == cat.kinetic_energy(shapes[i, j], rates[j], omegas[i, j])
        np.testing.assert_array_equal(turning[i, j], cat.link_angular_velocity(shapes[i, j], rates[j], "head"))
        alone = cat.mass_correlation(shapes[i, j], rates[j], shapes[0, 0])
        close(correlation[i, j], alone[0], 1e-14)
        close(slope[i, j], alone[1], 1e-14)
    several = cat.kinetic_energy(shapes[0, 0], rates[0], omegas)
    assert several.shape == (2, 3)
    assert several[1, 2] == pytest.approx(cat.kinetic_energy(shapes[0, 0], rates[0], omegas[1, 2]), rel=1e-14)
    deformation = case_of("cat").deformation
    assert np.shape(deformation.kinetic_energy(0.5)) == ()
    assert deformation.kinetic_energy(T.reshape(1, 11), [0.1, 0.2, 0.3]).shape == (1, 11)


def test_what_is_no_angular_velocity_is_refused():
    deformation = case_of("cat").deformation
    for wrong in (np.zeros(2), np.zeros((4, 3)), [np.nan, 0.0, 0.0], "fast"):
        with pytest.raises(ShapeError, match="angular_velocity"):
            deformation.kinetic_energy(T, wrong)  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="angular_velocity"):
        deformation.kinetic_energy(0.5, np.zeros((4, 3)))
