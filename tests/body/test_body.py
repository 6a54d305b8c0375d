"""The body against forward kinematics in plain NumPy, built from the file's XML, and against its own point masses."""

from __future__ import annotations

import copy
import pickle
import threading
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.body import example_file, robots_folder
from shapephase.errors import ModelFileError, ShapeError, UnknownNameError, UnphysicalInertiaError
from support.bodies import EVERY_BODY, joint, link, random_shapes, urdf
from support.urdf_links import UrdfLinks

RELATIVE = 1e-12


def file_of(name):
    if name.startswith("example:"):
        return example_file(name.removeprefix("example:"))
    return robots_folder() / f"{name}.urdf"


@pytest.fixture(scope="session", params=EVERY_BODY)
def case(request):
    """A body and its tree."""
    return sp.load_body(request.param), UrdfLinks(file_of(request.param))


def named(body, vector):
    return dict(zip(body.joint_names, vector, strict=True))


def close(actual, desired, relative=RELATIVE):
    np.testing.assert_allclose(actual, desired, rtol=0, atol=relative * np.abs(desired).max())


# ---- The whole model ------------------------------------------------------------------------------------------------


def test_no_mass_is_lost_and_every_joint_is_there(case):
    """U1: a model built without the free-flyer loses the root link; its mass counts here."""
    body, tree = case
    assert body.mass == pytest.approx(tree.masses().sum(), rel=1e-14)
    assert set(body.joint_names) == {j["name"] for j in tree.joints if j["kind"] != "fixed" and j["mimic"] is None}
    assert body.n_shape == len(body.joint_names)
    assert set(body.link_names) == set(tree.links)
    assert tree.links[tree.root][0] > 0.0


def test_inertia_momentum_and_centre_against_numpy(case, rng):
    """U2, U3, A3, A7: I, L_o and the centre of mass, summed over the links of the XML."""
    body, tree = case
    shapes, rates = random_shapes(body, rng, 4), rng.normal(size=(4, body.n_shape))
    inertia, momentum = body.locked_inertia(shapes), body.internal_momentum(shapes, rates)
    centre, energy = body.centre_of_mass(shapes), body.kinetic_energy(shapes, rates)
    assert inertia.shape == (4, 3, 3)
    for row in range(4):
        want = tree.totals(named(body, shapes[row]), named(body, rates[row]))
        close(centre[row], want[0])
        close(inertia[row], want[1])
        close(momentum[row], want[2])
        assert energy[row] == pytest.approx(want[3], rel=RELATIVE)


def test_momentum_matrix_columns_are_unit_rates(case, rng):
    """A7: L_o is linear in the rates; each column of J is the momentum of one joint."""
    body, tree = case
    shape = random_shapes(body, rng, 1)[0]
    matrix = body.momentum_matrix(shape)
    assert matrix.shape == (3, body.n_shape)
    columns = [tree.totals(named(body, shape), named(body, unit))[2] for unit in np.eye(body.n_shape)]
    close(matrix, np.transpose(columns))
    inertia, momentum = body.sample(shape[None], np.ones((1, body.n_shape)))
    close(inertia[0], body.locked_inertia(shape), 1e-15)
    close(momentum[0], np.sum(columns, axis=0), 1e-11)


def test_gradients_against_complex_differentiation(case, rng):
    """U4: dI/dr_k, dJ/dr_k and dI/dt, against the imaginary part of NumPy's sums at r + ih: no difference is taken."""
    body, tree = case
    shape, rate = random_shapes(body, rng, 1)[0], rng.normal(size=body.n_shape)
    at_rest = named(body, np.zeros(body.n_shape))
    columns = rng.choice(body.n_shape, size=min(6, body.n_shape), replace=False)
    inertia, matrix = body.inertia_gradient(shape), body.momentum_matrix_gradient(shape)
    assert inertia.shape == (body.n_shape, 3, 3)
    assert matrix.shape == (body.n_shape, 3, body.n_shape)
    for k in columns:
        moved = named(body, shape + 1e-30j * np.eye(body.n_shape)[k])
        _, tensor, momentum, _ = tree.totals(moved, named(body, rate))
        np.testing.assert_allclose(inertia[k], tensor.imag * 1e30, atol=1e-12 * np.abs(inertia).max(), rtol=0)
        np.testing.assert_allclose(matrix[k] @ rate, momentum.imag * 1e30, atol=1e-11 * np.abs(matrix).max(), rtol=0)
    along = tree.totals(named(body, shape + 1e-30j * rate), at_rest)[1].imag * 1e30
    np.testing.assert_allclose(body.inertia_rate(shape, rate), along, atol=1e-11 * np.abs(along).max(), rtol=0)


def test_link_poses_against_numpy(case, rng):
    body, tree = case
    shapes = random_shapes(body, rng, 2)
    for name in body.link_names:
        poses = body.link_pose(shapes, name)
        assert poses.shape == (2, 4, 4)
        for row in range(2):
            turn, place, _, _ = tree.motion(named(body, shapes[row]), named(body, np.zeros(body.n_shape)))[name]
            np.testing.assert_allclose(poses[row, :3, :3], turn, atol=1e-13, rtol=0)
            np.testing.assert_allclose(poses[row, :3, 3], place, atol=1e-13, rtol=0)
            np.testing.assert_array_equal(poses[row, 3], [0, 0, 0, 1])


# ---- The same body as point masses ----------------------------------------------------------------------------------


@pytest.fixture
def cloud(case, rng):
    """A body in one shape and motion, and point masses with the same second moments."""
    body, tree = case
    shape, rate = random_shapes(body, rng, 1)[0], rng.normal(size=body.n_shape)
    return body, shape, rate, tree.particles(named(body, shape), named(body, rate))


def test_angular_momentum_and_its_transformation_law(cloud, rng):
    """A5, Cabrera (3): L(d/dt (R d)) = R I(d) omega + R L(d'), summed over the masses; A7: L_o = L(d')."""
    body, shape, rate, (masses, places, speeds) = cloud
    inertia, internal = body.locked_inertia(shape), body.internal_momentum(shape, rate)
    close(internal, masses @ np.cross(places, speeds), 1e-11)
    turn, omega = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    there, moving = places @ turn.T, (np.cross(omega, places) + speeds) @ turn.T
    close(turn @ (inertia @ omega + internal), masses @ np.cross(there, moving), 1e-11)


def test_kinetic_energy_and_its_transformation_law(cloud, rng):
    """A6, Cabrera (4) with the half of erratum C-E1: T = omega.I omega/2 + L_o.omega + T_0."""
    body, shape, rate, (masses, places, speeds) = cloud
    omega = rng.normal(size=3)
    at_rest = body.kinetic_energy(shape, rate)
    assert at_rest == pytest.approx(0.5 * masses @ np.sum(speeds**2, axis=-1), rel=1e-11)
    turning = 0.5 * masses @ np.sum((np.cross(omega, places) + speeds) ** 2, axis=-1)
    formula = 0.5 * omega @ body.locked_inertia(shape) @ omega + body.internal_momentum(shape, rate) @ omega + at_rest
    assert formula == pytest.approx(turning, rel=1e-11)


# ---- Choice of the base frame ---------------------------------------------------------------------------------------


def rebased(text, turn, shift):
    """The same URDF described from a root frame turned by `turn` and shifted by `shift` in the old root axes."""
    root = ElementTree.fromstring(text)
    children = {j.find("child").get("link") for j in root.findall("joint")}
    (base,) = {element.get("name") for element in root.findall("link")} - children
    hung = [j for j in root.findall("joint") if j.find("parent").get("link") == base]
    hung += [e for element in root.findall("link") if element.get("name") == base for e in element.findall("inertial")]
    for element in hung:
        origin = element.find("origin")
        if origin is None:
            origin = ElementTree.SubElement(element, "origin")
        rpy = [float(x) for x in (origin.get("rpy") or "0 0 0").split()]
        xyz = np.array([float(x) for x in (origin.get("xyz") or "0 0 0").split()])
        local = Rotation.from_matrix(turn.T) * Rotation.from_euler("xyz", rpy)
        origin.set("rpy", " ".join(repr(float(x)) for x in local.as_euler("xyz")))
        origin.set("xyz", " ".join(repr(float(x)) for x in turn.T @ (xyz - shift)))
    return ElementTree.tostring(root, encoding="unicode")


@pytest.mark.parametrize("name", EVERY_BODY)
def test_another_base_frame_turns_the_answers_and_nothing_else(name, rng, load_urdf):
    """U9: I -> Q^T I Q, L_o -> Q^T L_o; where the base origin lies does not matter at all."""
    body, text = sp.load_body(name), file_of(name).read_text(encoding="utf-8-sig")
    shape, rate = random_shapes(body, rng, 1)[0], rng.normal(size=body.n_shape)
    inertia, momentum = body.locked_inertia(shape), body.internal_momentum(shape, rate)
    turn, shift = Rotation.from_rotvec([0.3, -0.8, 1.1]).as_matrix(), np.array([0.7, -1.3, 0.4])
    for q, s in ((np.eye(3), shift), (turn, np.zeros(3)), (turn, shift)):
        other = load_urdf(rebased(text, q, s))
        assert other.joint_names == body.joint_names
        close(other.locked_inertia(shape), q.T @ inertia @ q, 1e-11)
        close(other.internal_momentum(shape, rate), q.T @ momentum, 1e-11)
        close(other.centre_of_mass(shape), q.T @ (body.centre_of_mass(shape) - s), 1e-11)
        assert other.kinetic_energy(shape, rate) == pytest.approx(body.kinetic_energy(shape, rate), rel=1e-11)


# ---- Joints that need care ------------------------------------------------------------------------------------------


def test_a_continuous_joint_is_one_angle_that_returns_after_a_turn(rng):
    satellite = sp.load_body("satellite")
    wheel = satellite.joint_index("wheel_spin")
    np.testing.assert_array_equal(satellite.continuous, np.arange(satellite.n_shape) == wheel)
    np.testing.assert_array_equal(satellite.joint_limits[wheel], [-np.inf, np.inf])
    shape = random_shapes(satellite, rng, 1)[0]
    for turns in (1, -3, 1000):
        further = shape + 2.0 * np.pi * turns * np.eye(satellite.n_shape)[wheel]
        close(satellite.locked_inertia(further), satellite.locked_inertia(shape))
        close(satellite.momentum_matrix(further), satellite.momentum_matrix(shape))


LINKS = [
    link("base", 3.0, [0.3, 0.5, 0.6], (0.1, 0.0, -0.2)),
    link("la", 1.0, [0.02, 0.03, 0.04], (0.2, 0.1, 0.0)),
    link("lb", 0.8, [0.02, 0.02, 0.03], (0.0, 0.3, 0.1)),
    link("lc", 0.5, [0.01, 0.02, 0.02], (0.1, 0.1, 0.1)),
    link("ld", 0.7, [0.03, 0.02, 0.02], (0.0, 0.0, 0.4)),
    link("le", 0.4, [0.01, 0.01, 0.01], (0.2, -0.1, 0.0)),
]
# Followers stand before their leaders, in the file and in the alphabet; one follows a follower, one never ends.
CHAIN = [
    ("a_follower", "revolute", "base", "la", (0, 1, 0), (0.2, 0, 0), ("m_middle", "-1.5", "0.3")),
    ("m_middle", "revolute", "la", "lb", (1, 0, 1), (0.3, 0, 0.1), ("z_leader", "2", "0.1")),
    ("z_leader", "revolute", "lb", "lc", (0, 0, 1), (0, 0.4, 0), None),
    ("slide", "prismatic", "base", "ld", (0, 1, 1), (0, -0.3, 0), None),
    ("wheel", "continuous", "ld", "le", (1, 0, 0), (0, 0, 0.5), ("z_leader", "-3", None)),
]


def chain_text(with_mimic):
    joints = []
    for name, kind, parent, child, axis, xyz, rule in CHAIN:
        leader, multiplier, offset = rule or (None, None, None)
        extra = f'<mimic joint="{leader}" multiplier="{multiplier}"' if rule and with_mimic else ""
        extra += (f' offset="{offset}"/>' if offset else "/>") if extra else ""
        joints.append(joint(name, kind, parent, child, axis, xyz, extra=extra))
    return urdf(*LINKS, *joints)


def test_mimic_joints_follow_theirs(load_urdf, rng):
    """The same body with the followers driven by hand: same I, L_o, energy; the gradients by the chain rule."""
    tied, free = load_urdf(chain_text(True)), load_urdf(chain_text(False))
    assert set(tied.joint_names) == {"z_leader", "slide"}
    assert set(free.joint_names) == {row[0] for row in CHAIN}
    assert tied.joint_limits.shape == (2, 2)
    shapes, rates = rng.uniform(-1, 1, (3, 2)), rng.normal(size=(3, 2))
    pull = {"z_leader": (1.0, 0.0), "m_middle": (2.0, 0.1), "a_follower": (-3.0, 0.15), "wheel": (-3.0, 0.0)}
    z, s = tied.joint_index("z_leader"), tied.joint_index("slide")
    spread, offset = np.zeros((5, 2)), np.zeros(5)
    for name, (factor, start) in pull.items():
        spread[free.joint_index(name), z], offset[free.joint_index(name)] = factor, start
    spread[free.joint_index("slide"), s] = 1.0
    full, full_rates = shapes @ spread.T + offset, rates @ spread.T
    close(tied.locked_inertia(shapes), free.locked_inertia(full), 1e-13)
    close(tied.momentum_matrix(shapes), free.momentum_matrix(full) @ spread, 1e-13)
    close(tied.internal_momentum(shapes, rates), free.internal_momentum(full, full_rates), 1e-13)
    close(tied.kinetic_energy(shapes, rates), free.kinetic_energy(full, full_rates), 1e-13)
    close(tied.centre_of_mass(shapes), free.centre_of_mass(full), 1e-13)
    close(tied.link_pose(shapes, "lc"), free.link_pose(full, "lc"), 1e-13)
    close(tied.inertia_gradient(shapes), np.einsum("nkij,kl->nlij", free.inertia_gradient(full), spread), 1e-12)
    by_hand = np.einsum("nkij,kl,jm->nlim", free.momentum_matrix_gradient(full), spread, spread)
    close(tied.momentum_matrix_gradient(shapes), by_hand, 1e-12)
    close(tied.inertia_rate(shapes, rates), free.inertia_rate(full, full_rates), 1e-12)


def test_a_follower_of_a_fixed_joint_is_refused(load_urdf):
    text = urdf(
        *LINKS[:3],
        joint("held", "fixed", "base", "la"),
        joint("j", "revolute", "la", "lb", extra='<mimic joint="held"/>'),
    )
    with pytest.raises(ModelFileError, match="held"):
        load_urdf(text)


def test_a_body_without_joints_is_a_rigid_body(load_urdf):
    """A10: a shape of zero coordinates; the link's own inertia comes back."""
    rigid = load_urdf(urdf(link("only", 2.0, [1.0, 2.0, 2.5], (0.3, 0.2, 0.1))))
    assert rigid.n_shape == 0
    np.testing.assert_allclose(rigid.locked_inertia([]), np.diag([1.0, 2.0, 2.5]), atol=1e-14, rtol=0)
    assert rigid.momentum_matrix(np.zeros((4, 0))).shape == (4, 3, 0)
    assert rigid.inertia_gradient(np.zeros((4, 0))).shape == (4, 0, 3, 3)
    np.testing.assert_allclose(rigid.internal_momentum([], []), np.zeros(3))
    np.testing.assert_allclose(rigid.centre_of_mass(np.zeros(0)), [0.3, 0.2, 0.1], atol=1e-15, rtol=0)
    assert sp.mechanical_connection(rigid, []).shape == (3, 0)


def test_names_that_pinocchio_uses_itself(load_urdf):
    """A joint called root_joint, universe or as our own free-flyer is a joint like any other."""
    plain = load_urdf(urdf(*LINKS[:2], joint("hip", "revolute", "base", "la", (0, 1, 0), (0.1, 0.2, 0.3))))
    for name in ("root_joint", "universe", "la", "shapephase free-flyer"):
        odd = load_urdf(urdf(*LINKS[:2], joint(name, "revolute", "base", "la", (0, 1, 0), (0.1, 0.2, 0.3))))
        assert odd.joint_names == (name,)
        close(odd.locked_inertia([0.7]), plain.locked_inertia([0.7]))
        close(odd.link_pose([0.7], "la"), plain.link_pose([0.7], "la"))


# ---- Arrays in and out ----------------------------------------------------------------------------------------------


def test_leading_axes_are_kept(body, rng):
    shapes = random_shapes(body, rng, 6).reshape(2, 3, -1)
    rates = rng.normal(size=shapes.shape)
    n = body.n_shape
    assert body.locked_inertia(shapes).shape == (2, 3, 3, 3)
    assert body.momentum_matrix_gradient(shapes).shape == (2, 3, n, 3, n)
    assert body.kinetic_energy(shapes, rates).shape == (2, 3)
    assert body.internal_momentum(shapes, rates[0, 0]).shape == (2, 3, 3)
    assert body.internal_momentum(shapes[0, 0], rates).shape == (2, 3, 3)
    assert body.locked_inertia(np.zeros((0, n))).shape == (0, 3, 3)
    for i in range(2):
        for j in range(3):
            np.testing.assert_array_equal(body.locked_inertia(shapes)[i, j], body.locked_inertia(shapes[i, j]))
            np.testing.assert_array_equal(body.inertia_gradient(shapes)[i, j], body.inertia_gradient(shapes[i, j]))


@pytest.mark.parametrize(
    "dress",
    [
        lambda x: x.astype(">f8"),
        lambda x: x.astype(np.float32),
        lambda x: x.astype(">f4"),
        lambda x: np.repeat(x, 2, axis=-1)[..., ::2],
        lambda x: x[..., ::-1].copy()[..., ::-1],
        lambda x: np.asfortranarray(x),
        lambda x: np.ma.array(x),
        lambda x: x.astype(np.longdouble),
        lambda x: x.tolist(),
        lambda x: np.frombuffer(x.tobytes()).reshape(x.shape),
    ],
    ids=[
        "big-endian",
        "float32",
        "big-endian-float32",
        "strided",
        "reversed",
        "fortran",
        "unmasked",
        "longdouble",
        "list",
        "read-only",
    ],
)
def test_any_real_array_gives_the_right_answer(dress, rng):
    cat = sp.load_body("cat")
    shapes = random_shapes(cat, rng, 3).astype(np.float32).astype(float)
    want = cat.locked_inertia(shapes.copy())
    np.testing.assert_array_equal(cat.locked_inertia(dress(shapes)), want)
    np.testing.assert_array_equal(
        cat.internal_momentum(dress(shapes), dress(shapes)), cat.internal_momentum(shapes, shapes)
    )


def test_whole_numbers_are_angles_too():
    cat = sp.load_body("cat")
    np.testing.assert_array_equal(cat.locked_inertia(np.ones(23, dtype=int)), cat.locked_inertia(np.ones(23)))


N = 23
BAD = {
    "nan": (np.where(np.arange(N) == 4, np.nan, 0.0), r"entry \[4\] is nan"),
    "inf": (np.where(np.arange(2 * N).reshape(2, N) == 30, -np.inf, 0.0), r"entry \[1, 7\] is -inf"),
    "masked": (np.ma.masked_equal(np.arange(float(N)), 3.0), "masked"),
    "complex": (np.zeros(N) + 1j, "complex128"),
    "text": (["0.1"] * N, "<U3"),
    "one word": ("tuck", "expected real numbers, got 'tuck'"),
    "objects": (np.zeros(N).astype(object), "object"),
    "nothing": (None, "expected real numbers, got None"),
    "dates": (np.zeros(N, dtype="datetime64[s]"), "datetime64"),
    "ragged": ([[0.0] * N, [0.0]], "rectangular"),
    "narrow": (np.zeros(N - 1), r"\(22,\)"),
    "wide": (np.zeros((5, N + 1)), r"\(5, 24\)"),
    "column": (np.zeros((N, 1)), r"\(23, 1\)"),
    "number": (0.0, r"\(\)"),
}


@pytest.mark.parametrize("kind", BAD)
def test_what_is_no_shape_is_refused_by_name(kind):
    cat = sp.load_body("cat")
    value, said = BAD[kind]
    for method in (
        cat.locked_inertia,
        cat.momentum_matrix,
        cat.inertia_gradient,
        cat.momentum_matrix_gradient,
        cat.centre_of_mass,
    ):
        with pytest.raises(ShapeError, match=rf"shape: .*{said}"):
            method(value)
    with pytest.raises(ShapeError, match=rf"rate: .*{said}"):
        cat.internal_momentum(np.zeros(N), value)
    with pytest.raises(ValueError, match="shape"):
        cat.link_pose(value, "head")


def test_a_wrong_width_is_answered_with_the_joints():
    diver = sp.load_body("diver")
    with pytest.raises(ShapeError, match="left_shoulder_abduction"):
        diver.locked_inertia(np.zeros(3))


def test_arguments_and_answers_are_not_shared(rng):
    cat = sp.load_body("cat")
    shape = random_shapes(cat, rng, 1)[0]
    kept = shape.copy()
    first = cat.locked_inertia(shape)
    again = first.copy()
    cat.locked_inertia(0.5 * shape)
    cat.inertia_gradient(shape)
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(shape, kept)


# ---- Joints by name -------------------------------------------------------------------------------------------------


def test_shape_by_name(body):
    np.testing.assert_array_equal(body.shape(), np.zeros(body.n_shape))
    np.testing.assert_array_equal(body.shape({}), np.zeros(body.n_shape))
    values = dict(zip(body.joint_names, np.arange(1.0, body.n_shape + 1), strict=True))
    reversed_values = dict(reversed(values.items()))
    np.testing.assert_array_equal(body.shape(reversed_values), np.arange(1.0, body.n_shape + 1))
    for column, name in enumerate(body.joint_names):
        assert body.joint_index(name) == column


def test_an_unknown_joint_is_answered_with_the_nearest_and_all():
    cat = sp.load_body("cat")
    with pytest.raises(UnknownNameError, match="'waist_pitch'") as caught:
        cat.shape({"waist_pich": 0.3})
    assert all(name in str(caught.value) for name in cat.joint_names)
    with pytest.raises(ValueError, match="front_left"):
        cat.joint_index("Waist_Pitch_Joint_of_another_animal")
    with pytest.raises(UnknownNameError, match="'head'"):
        cat.link_pose(cat.shape(), "heads")


@pytest.mark.parametrize("value", [np.nan, np.inf, "up", 1j, None, [0.1, 0.2], [], np.ma.masked])
def test_a_coordinate_that_is_no_number_is_refused_by_joint(value):
    with pytest.raises(ShapeError, match="waist_pitch"):
        sp.load_body("cat").shape({"waist_pitch": value})


def test_limits_belong_to_the_joints_of_the_same_name(case):
    body, tree = case
    root = ElementTree.fromstring(tree.path.read_text())
    assert body.joint_limits.shape == (body.n_shape, 2)
    for element in root.findall("joint"):
        if element.get("type") in ("revolute", "prismatic") and element.find("mimic") is None:
            limit = element.find("limit")
            want = [float(limit.get("lower")), float(limit.get("upper"))]
            np.testing.assert_array_equal(body.joint_limits[body.joint_index(element.get("name"))], want)
    with pytest.raises(ValueError, match="read-only"):
        body.joint_limits[0, 0] = 1.0


# ---- Copies, processes, threads -------------------------------------------------------------------------------------


def test_a_body_survives_pickling_and_copying(body, rng):
    shapes = random_shapes(body, rng, 3)
    want = body.locked_inertia(shapes)
    for other in (pickle.loads(pickle.dumps(body)), copy.deepcopy(body), copy.copy(body)):
        assert other.joint_names == body.joint_names
        assert other.mass == body.mass
        np.testing.assert_array_equal(other.locked_inertia(shapes), want)
        np.testing.assert_array_equal(other.inertia_gradient(shapes), body.inertia_gradient(shapes))


def test_two_threads_on_one_body_give_the_serial_answers(rng):
    cat = sp.load_body("cat")
    shapes = random_shapes(cat, rng, 600)
    rates = rng.normal(size=shapes.shape)
    halves = (slice(0, 300), slice(300, 600))
    serial = [(cat.locked_inertia(shapes[h]), cat.inertia_rate(shapes[h], rates[h])) for h in halves]
    found, start = [[], []], threading.Barrier(2)

    def work(which):
        start.wait()
        for _ in range(4):
            part = halves[which]
            found[which].append((cat.locked_inertia(shapes[part]), cat.inertia_rate(shapes[part], rates[part])))

    threads = [threading.Thread(target=work, args=(which,)) for which in (0, 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for which in (0, 1):
        assert len(found[which]) == 4
        for inertia, inertia_rate in found[which]:
            np.testing.assert_array_equal(inertia, serial[which][0])
            np.testing.assert_array_equal(inertia_rate, serial[which][1])


# ---- A Pinocchio model ----------------------------------------------------------------------------------------------


def test_a_pinocchio_model_with_a_free_flyer(rng):
    from_file = sp.load_body("astronaut")
    model = pin.buildModelFromUrdf(str(file_of("astronaut")), pin.JointModelFreeFlyer())
    body = sp.load_body(model)
    assert body.joint_names == from_file.joint_names
    assert body.mass == from_file.mass
    shapes = random_shapes(body, rng, 3)
    np.testing.assert_array_equal(body.locked_inertia(shapes), from_file.locked_inertia(shapes))
    np.testing.assert_array_equal(body.momentum_matrix(shapes), from_file.momentum_matrix(shapes))


def test_a_body_keeps_its_own_model():
    """Changing the model afterwards changes no body (a joint added to a model in use corrupts Pinocchio's heap)."""
    model = pin.buildModelFromUrdf(str(file_of("diver")), pin.JointModelFreeFlyer())
    body = sp.load_body(model)
    before = body.locked_inertia(body.shape())
    model.inertias[1] = pin.Inertia(1000.0, np.zeros(3), 1000.0 * np.eye(3))
    np.testing.assert_array_equal(body.locked_inertia(body.shape()), before)


def test_a_pinocchio_model_without_a_free_flyer_is_told_how():
    """U1: its root link would be lost."""
    model = pin.buildModelFromUrdf(str(file_of("diver")))
    with pytest.raises(ModelFileError, match="JointModelFreeFlyer"):
        sp.load_body(model)
    with pytest.raises(ModelFileError, match="free-flyer"):
        sp.load_body(pin.Model())


def test_pinocchios_own_mimic_joints_are_refused():
    """Its derivative of the momentum map does not support them; read from a file they are followed."""
    text = urdf(
        *LINKS[:3], joint("a", "revolute", "base", "la"), joint("b", "revolute", "la", "lb", extra='<mimic joint="a"/>')
    )
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer(), True)
    with pytest.raises(ModelFileError, match="Mimic"):
        sp.load_body(model)


# ---- Inertias that cannot be ----------------------------------------------------------------------------------------


def test_a_negative_principal_moment_is_refused_or_warned_about(load_urdf):
    tensor = np.array([[0.02, 0.05, 0.0], [0.05, 0.03, 0.0], [0.0, 0.0, 0.04]])
    text = urdf(LINKS[0], link("la", 1.0, tensor), joint("hip", "revolute", "base", "la"))
    with pytest.raises(UnphysicalInertiaError, match="on_unphysical"):
        load_urdf(text)
    with pytest.warns(sp.UnphysicalInertiaWarning, match="'la'"):
        body = load_urdf(text, on_unphysical="warn")
    assert body.mass == 4.0
    with pytest.raises(UnknownNameError, match="warn"):
        load_urdf(text, on_unphysical="ignore")


def test_a_negative_moment_does_not_hide_in_a_link_fixed_to_another(load_urdf):
    """Pinocchio merges fixed links, and their sum may look sound: links are judged one by one."""
    text = urdf(LINKS[0], link("la", 1.0, [-0.02, 0.03, 0.04], (0.5, 0.5, 0.5)), joint("weld", "fixed", "base", "la"))
    with pytest.raises(UnphysicalInertiaError, match="la"):
        load_urdf(text)


def test_the_inertias_of_a_pinocchio_model_are_checked_too():
    text = urdf(LINKS[0], link("la", 1.0, [-0.02, 0.03, 0.04]), joint("hip", "revolute", "base", "la"))
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    with pytest.raises(UnphysicalInertiaError, match="'hip'"):
        sp.load_body(model)
    with pytest.warns(sp.UnphysicalInertiaWarning, match="'hip'"):
        assert sp.load_body(model, on_unphysical="warn").mass == 4.0


@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize("what", ["mass", "inertia", "negative"])
def test_a_pinocchio_model_spoilt_by_hand_is_refused(number, what):
    """Base or arm, a mass or an inertia that is no number or negative."""
    model = pin.buildModelFromXML(
        urdf(*LINKS[:2], joint("hip", "revolute", "base", "la")), pin.JointModelFreeFlyer(), "flyer"
    )
    if what == "inertia":
        entries = np.array([1.0, 0, 0, 0, np.nan, 0, 1, 0, 0, 1])
        model.inertias[number] = pin.Inertia.FromDynamicParameters(entries)
    else:
        model.inertias[number].mass = np.nan if what == "mass" else -1.0
    with pytest.raises(UnphysicalInertiaError, match="flyer" if number == 1 else "hip"):
        sp.load_body(model)


def test_a_broken_triangle_inequality_is_warned_about(load_urdf):
    text = urdf(LINKS[0], link("la", 1.0, [0.01, 0.01, 0.05]), joint("hip", "revolute", "base", "la"))
    with pytest.warns(sp.UnphysicalInertiaWarning, match="triangle"):
        load_urdf(text)
    # The rounding of a file's digits is not worth a word: up to a thousandth of the largest moment.
    load_urdf(text.replace('izz="0.05"', 'izz="0.02001"'))
    with pytest.warns(sp.UnphysicalInertiaWarning, match="triangle"):
        load_urdf(text.replace('izz="0.05"', 'izz="0.02004"'))


def test_a_body_on_one_line_is_refused_where_it_matters(load_urdf):
    """A2: collinear masses have no rotation about their line."""
    body = load_urdf(
        urdf(
            link("a", 1.0, [0, 0, 0]),
            link("b", 1.0, [0, 0, 0]),
            joint("s", "prismatic", "a", "b", (1, 0, 0), (1, 0, 0)),
        )
    )
    np.testing.assert_allclose(body.locked_inertia([1.0]), np.diag([0.0, 2.0, 2.0]), atol=1e-14, rtol=0)
    with pytest.raises(sp.errors.SingularInertiaError, match="line"):
        sp.mechanical_connection(body, [1.0])


def test_a_link_without_mass_only_carries_axes(load_urdf):
    """The same joint with its axis in a massless link between gives the same body."""
    hip = joint("hip", "revolute", "base", "la", (0, 1, 0), (0.1, 0.2, 0.3))
    split = urdf(
        *LINKS[:2],
        '<link name="between"/>',
        joint("hip", "revolute", "base", "between", (0, 1, 0), (0.1, 0.2, 0.3)),
        joint("weld", "fixed", "between", "la"),
    )
    plain, long = load_urdf(urdf(*LINKS[:2], hip)), load_urdf(split)
    close(long.locked_inertia([0.4]), plain.locked_inertia([0.4]))
    close(long.momentum_matrix([0.4]), plain.momentum_matrix([0.4]))


def test_repr_says_what_it_is():
    assert repr(sp.load_body("cat")) == "Body('cat', 23 joints, 4 kg)"
