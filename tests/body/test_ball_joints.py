"""Ball joints: against three hinges, against Pinocchio's own quaternions, and by what a turn is."""

from __future__ import annotations

import pickle

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.body import Coupling
from shapephase.body._cross_check import inertia_and_momentum
from shapephase.body.formats.urdf import urdf_tree
from shapephase.body.formats.xml_text import xml_tree
from shapephase.body.inertial_regressor import link_motions
from shapephase.body.momentum_gradients import by_shape_and_rate
from shapephase.errors import IgnoredElementWarning, ModelFileError, ShapeError, UnknownNameError
from support.ball_bodies import BALLS, LINKS, ORDER, THREE_HINGES, shapes_of_both
from support.bodies import joint, urdf
from support.near import by_differences, near

EPS = np.finfo(float).eps


@pytest.fixture
def round_body(load_urdf):
    return load_urdf(BALLS)


@pytest.fixture
def both(round_body, load_urdf):
    return round_body, load_urdf(THREE_HINGES)


def test_names_and_numbers_of_a_shape(round_body):
    assert round_body.joint_names == ORDER
    assert round_body.rate_names == (
        *(f"{ball}.{part}" for ball in ("shoulder", "neck") for part in ("wx", "wy", "wz")), "elbow",
    )  # fmt: skip
    assert (round_body.n_shape, round_body.n_rates, round_body.ball_joints) == (9, 7, ("shoulder", "neck"))
    assert round_body.joint_units == ("1",) * 8 + ("rad",)
    assert np.isinf(round_body.joint_limits).all()
    assert not round_body.continuous[:8].any()
    assert round_body.shape().tolist() == [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    bent = round_body.shape({"neck": [0.0, 3.0, 0.0, 4.0], "elbow": 0.5})
    near(bent, [0.0, 0.0, 0.0, 1.0, 0.0, 0.6, 0.0, 0.8, 0.5], 4.0)
    for wrong, message in (([0.0] * 4, "quaternion x, y, z, w"), (0.3, "quaternion"), ([1.0, 2.0], "quaternion")):
        with pytest.raises(ShapeError, match=f"ball joint neck: .*{message}"):
            round_body.shape({"neck": wrong})
    with pytest.raises(ShapeError, match="shoulder"):
        round_body.locked_inertia(np.zeros(9))
    assert pickle.loads(pickle.dumps(round_body)).ball_joints == round_body.ball_joints
    assert "3 joints" in repr(round_body)
    assert "shoulder" in round_body._repr_html_()


def test_inertia_momentum_and_connection_are_those_of_three_hinges(both, rng):
    body, hinged = both
    shapes, angles, rates, slopes = shapes_of_both(hinged, rng, 20)
    near(body.locked_inertia(shapes), hinged.locked_inertia(angles))
    near(body.centre_of_mass(shapes), hinged.centre_of_mass(angles))
    near(body.momentum_matrix(shapes) @ slopes, hinged.momentum_matrix(angles))
    # In the rates of the joints, which differ in number from the coordinates.
    frame = body.rate_frame(shapes)
    connection = sp.mechanical_connection(body, shapes) @ frame
    near(connection @ rates, sp.mechanical_connection(hinged, angles))
    speeds = rng.normal(size=(20, 7))
    motion = (slopes @ speeds[..., None])[..., 0]
    near(body.joint_rates(shapes, motion), (rates @ speeds[..., None])[..., 0])
    near((frame @ body.joint_rates(shapes, motion)[..., None])[..., 0], motion)
    near(body.internal_momentum(shapes, motion), hinged.internal_momentum(angles, speeds))
    near(body.kinetic_energy(shapes, motion, [0.1, 0.2, 0.3]), hinged.kinetic_energy(angles, speeds, [0.1, 0.2, 0.3]))
    for link in ("arm", "hand", "head"):
        near(body.link_pose(shapes, link), hinged.link_pose(angles, link))
        near(body.link_angular_velocity(shapes, motion, link), hinged.link_angular_velocity(angles, speeds, link))
    found = body.mass_correlation(shapes, motion, shapes[0])
    for one, other in zip(found, hinged.mass_correlation(angles, speeds, angles[0]), strict=True):
        near(one, other)


def test_the_length_of_the_four_numbers_means_nothing(round_body, rng):
    shapes, motion = rng.normal(size=(2, 6, 9))
    longer = shapes * np.concatenate([np.full(4, -3.0), np.full(4, 0.25), [1.0]])
    stretched = motion * np.concatenate([np.full(4, -3.0), np.full(4, 0.25), [1.0]])
    near(round_body.locked_inertia(longer), round_body.locked_inertia(shapes))
    near(round_body.internal_momentum(longer, stretched), round_body.internal_momentum(shapes, motion))
    # Along themselves they move nothing, and a two-form does not see them either.
    along = np.concatenate([shapes[:, :4], np.zeros((6, 5))], axis=1)
    connection, curved = sp.mechanical_connection(round_body, shapes), sp.curvature(round_body, shapes)
    assert np.abs(connection @ along[..., None]).max() < 100.0 * EPS * np.abs(connection).max()
    assert np.abs(np.einsum("nija,nj->nia", curved, along)).max() < 500.0 * EPS * np.abs(curved).max()


def test_derivatives(round_body, rng):
    """By differences of order six in the four numbers; and by sums over links without Pinocchio."""
    shapes, motion = rng.normal(size=(2, 6, 9))
    spins = rng.normal(size=(6, 3))

    def momentum(r):
        return so3.apply(round_body.locked_inertia(r), spins[:, None] if r.ndim == 3 else spins) + (
            round_body.internal_momentum(r, motion)
        )

    for name, found, expected in (
        ("I", round_body.inertia_gradient(shapes), by_differences(round_body.locked_inertia, shapes)),
        ("J", round_body.momentum_matrix_gradient(shapes), by_differences(round_body.momentum_matrix, shapes)),
        ("I w + J rate", round_body.angular_momentum_gradient(shapes, motion, spins), by_differences(momentum, shapes)),
    ):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max(), err_msg=name)
    along = np.einsum("nk,nkij->nij", motion, round_body.inertia_gradient(shapes))
    near(round_body.inertia_rate(shapes, motion), along)
    *_, inertia_rate, matrix_rate = round_body.sample_rates(shapes, motion)
    near(inertia_rate, along)
    near(matrix_rate, np.einsum("nk,nkij->nij", motion, round_body.momentum_matrix_gradient(shapes)))
    rows, links = rng.normal(size=(6, 1, 3, 3)), link_motions(round_body.chain, shapes, motion)
    by_shape, by_rate = by_shape_and_rate(round_body.chain, links, shapes, motion, spins[:, None], rows)
    gradient = round_body.angular_momentum_gradient(shapes, motion, spins)
    near(by_shape, rows[:, 0] @ np.swapaxes(gradient, 1, 2))
    near(by_rate, rows[:, 0] @ round_body.momentum_matrix(shapes))


def test_through_gimbal_lock_by_definition(round_body):
    """The quarter turn about y at which three hinges lose a direction: link by link, without Pinocchio."""
    tree = urdf_tree(xml_tree(BALLS.encode(), "balls.urdf"))
    for pitch in (0.5 * np.pi, -0.5 * np.pi, 0.5 * np.pi - 1e-9):
        shape = np.concatenate([Rotation.from_euler("XYZ", [0.3, pitch, -0.7]).as_quat(), [0.1, -0.2, 0.3, 0.9], [0.4]])
        motion = np.array([0.3, -0.2, 0.5, 0.1, -0.4, 0.2, 0.6, 0.3, 0.7])
        named = [dict(zip(round_body.joint_names, each.tolist(), strict=True)) for each in (shape, motion)]
        inertia, momentum, *_ = inertia_and_momentum(tree, *named)
        near(round_body.locked_inertia(shape), inertia)
        near(round_body.internal_momentum(shape, motion), momentum)
        # All three directions are there.
        assert np.linalg.matrix_rank(sp.mechanical_connection(round_body, shape)[:, :4], tol=1e-3) == 3


def test_pinocchio_s_own_model_of_it(round_body, rng):
    """A model with Pinocchio's spherical joints is taken over; its quaternions and rates are ours."""
    model = round_body._model.copy()
    given = sp.load_body(model)
    assert given.joint_names == round_body.joint_names
    data, shape, motion = model.createData(), rng.normal(size=9), rng.normal(size=9)
    q, v = pin.neutral(model), np.zeros(model.nv)
    q[7:11], q[11:15] = shape[:4] / np.linalg.norm(shape[:4]), shape[4:8] / np.linalg.norm(shape[4:8])
    q[15], q[16] = np.cos(shape[8]), np.sin(shape[8])
    v[6:] = given.joint_rates(shape, motion)
    hg = pin.computeCentroidalMomentum(model, data, q, v)
    near(given.internal_momentum(shape, motion), hg.angular)
    # The rates are those by which Pinocchio itself moves its quaternions.
    step = 1e-5
    moved = [given.rate_frame(shape) @ v[6:] * side * step + shape for side in (1.0, -1.0)]
    ahead, behind = (pin.integrate(model, q, side * step * v)[7:11] for side in (1.0, -1.0))
    found = (moved[0] - moved[1])[:4] / np.linalg.norm(shape[:4])
    np.testing.assert_allclose(found, ahead - behind, rtol=0, atol=1e-13)


def test_other_inertias_keep_the_joints(both, rng):
    body, hinged = both
    shapes, angles, _, _ = shapes_of_both(hinged, rng, 4)
    heavier = [one.with_inertias(masses={"arm": 2.0, "head": 0.3}) for one in both]
    near(heavier[0].locked_inertia(shapes), heavier[1].locked_inertia(angles))
    family = body.with_inertias(masses={"arm": [1.0, 2.0]})
    inertia, momentum = family.sample(shapes, np.ones((4, 9)))
    for k in range(2):
        near(inertia[k], family[k].locked_inertia(shapes))
        near(momentum[k], family[k].internal_momentum(shapes, np.ones((4, 9))))


# ---- Files ----------------------------------------------------------------------------------------------------------


def test_limits_of_a_ball_joint_are_told_and_ignored(load_urdf):
    text = BALLS.replace("<parent link=", '<limit effort="1" velocity="1" lower="0" upper="1"/><parent link=', 1)
    with pytest.warns(IgnoredElementWarning, match="'shoulder'"):
        body = load_urdf(text)
    assert np.isinf(body.joint_limits).all()


def test_efforts_and_rates_of_other_joints_are_kept(load_urdf):
    tail = "<link name='tail'/>" + joint("wag", "revolute", "trunk", "tail")
    text = BALLS.replace("</robot>", tail + "</robot>")
    with pytest.warns(match="mass"):
        body = load_urdf(text)
    place = body.joint_index("wag")
    assert (body.rate_limits[place], body.effort_limits[place]) == (1.0, 1.0)
    assert body.joint_limits[place].tolist() == [-10.0, 10.0]
    assert np.isinf(np.delete(body.rate_limits, place)).all()


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("planar", "its two slides turn with it.*two prismatic joints and a revolute one"),
        ("floating", "only the base floats.*three prismatic joints and a spherical one"),
    ],
)
def test_other_joints_of_several_directions_are_refused_with_the_reason(kind, reason, load_urdf):
    with pytest.raises(ModelFileError, match=rf"{kind}.*inside a body.*{reason}"):
        load_urdf(urdf(*LINKS[:2], joint("hip", kind, "trunk", "arm")))


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        (pin.JointModelSphericalZYX, "can fall together"),
        (pin.JointModelPlanar, "two prismatic joints"),
        (pin.JointModelFreeFlyer, "only the base floats"),
        (pin.JointModelTranslation, "three prismatic"),
    ],
)
def test_joints_of_a_model_are_refused_with_the_reason(kind, reason):
    model = pin.Model()
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.appendBodyToJoint(root, pin.Inertia.Random(), pin.SE3.Identity())
    number = model.addJoint(root, kind(), pin.SE3.Identity(), "hip")
    model.appendBodyToJoint(number, pin.Inertia.Random(), pin.SE3.Identity())
    with pytest.raises(ModelFileError, match=f"'hip'.*{reason}"):
        sp.load_body(model)


def test_what_follows_or_leads_a_ball_joint_is_refused(round_body, load_urdf):
    for joint_name, leader in (("shoulder", "elbow"), ("elbow", "shoulder")):
        with pytest.raises(ModelFileError, match="'shoulder'"):
            round_body.with_couplings({joint_name: Coupling.linear(leader, 2.0)})
    with pytest.raises(ModelFileError, match=r"'neck\.x'"):
        round_body.with_couplings({"elbow": Coupling.linear("neck.x", 2.0)})
    with pytest.raises(UnknownNameError, match="shoulder"):
        round_body.with_couplings({"sholder": Coupling.linear("elbow", 2.0)})
    with pytest.raises(ModelFileError, match="spherical"):
        load_urdf(BALLS.replace("<parent link=", '<mimic joint="elbow"/><parent link=', 1))
    with pytest.raises(ModelFileError, match=r"neck\.w"):
        load_urdf(BALLS.replace('"elbow"', '"neck.w"'))
