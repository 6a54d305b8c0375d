"""Bodies with other masses, centres of mass and rotational inertias: against Pinocchio, and against other files."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from benchmarks.body_leaf import extent, random_body

import shapephase as sp
from shapephase.body import Body, BodyFamily
from shapephase.body.inertial_regressor import by_link_parameters, inertial_regressor, link_motions, parameters
from shapephase.body.momentum_gradients import by_shape_and_rate
from shapephase.errors import ShapeError, UnknownNameError, UnphysicalInertiaError, UnphysicalInertiaWarning
from support.bodies import joint, link, random_shapes, urdf

EPS = np.finfo(float).eps
TURNED = (0.3, -0.2, 0.7)


def changes(body: Body, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Other numbers for all frames of a chain, in their axes."""
    chain = body.chain
    frames = len(chain.masses)
    scales = rng.uniform(0.5, 2.0, (2, count, frames))
    centres = chain.centres + 0.3 * rng.normal(size=(count, frames, 3))
    return chain.masses * scales[0], centres, chain.inertias * scales[1][..., None, None]


def changed_by_hand(body: Body, mass: np.ndarray, centre: np.ndarray, tensor: np.ndarray) -> pin.Model:
    model = body._model.copy()
    for frame in range(len(mass)):
        model.inertias[frame + 1] = pin.Inertia(mass[frame], centre[frame], tensor[frame])
    return model


def numbers(body: sp.Body) -> dict[str, np.ndarray]:
    """What `with_inertias` takes, as the body has it."""
    parts = body.moving_parts
    return {
        "masses": np.array([part.mass for part in parts]),
        "centres": np.array([part.centre for part in parts]),
        "inertias": np.array([part.inertia for part in parts]),
    }


# ---- The regressor --------------------------------------------------------------------------------------------------


def test_the_regressor_is_right_to_rounding():
    """Random bodies, every other with joints 100 m away: of each changed body the terms' rounding, as for the leaf.

    8 eps for each joint and three more, of the sum of the terms as they are seen from the base; the oracle is
    Pinocchio on the changed model.
    """
    rng = np.random.default_rng(3)
    for number in range(30):
        body = random_body(rng, far=bool(number % 2))
        shapes, rates = rng.uniform(-3.0, 3.0, (2, 2, body.n_shape))
        given = changes(body, rng, 3)
        inertia, momentum = inertial_regressor(body.chain, shapes, rates).inertia_and_momentum(*given)
        allowed = 8.0 * (len(body.chain.names) + 3.0) * EPS
        for variant in range(3):
            other = body.with_frame_inertias(*(part[variant] for part in given))
            expected = other.sample(shapes, rates)
            for row in range(2):
                sizes = extent(other.chain, shapes[row], rates[row])
                assert np.abs(inertia[variant, row] - expected[0][row]).max() <= allowed * sizes[0]
                assert np.abs(momentum[variant, row] - expected[1][row]).max() <= allowed * sizes[1]


def test_it_is_the_derivative_at_its_own_body(body, rng):
    """By differences of Pinocchio's I and L_o on changed models: quotients in the parameters of one link."""
    chain = body.chain
    shape, rate = random_shapes(body, rng, 1), rng.normal(size=(1, body.n_shape))
    matrix = inertial_regressor(chain, shape, rate).matrices[0, :9]
    frame = int(rng.choice(np.flatnonzero(chain.masses)))
    mass, offset = chain.masses.copy(), chain.centres.copy()
    step = 1e-4
    found = []
    for sign in (1.0, -1.0):
        mass[frame], offset[frame] = chain.masses[frame] * (1.0 + sign * step), chain.centres[frame] + sign * step
        model = changed_by_hand(body, mass, offset, chain.inertias)
        given = parameters(mass[None], offset[None], chain.inertias[None], chain.centres)[0]
        found.append((given, _sampled(body, model, shape, rate)))
    change = (found[0][0] - found[1][0]) / (2.0 * step)
    slope = (found[0][1] - found[1][1]) / (2.0 * step)
    # What is left are products of two changes, of a centre by a step [m] and of a mass by its share.
    left = 20.0 * step**2 * body.mass * (1.0 + np.abs(rate).max())
    assert np.abs(matrix @ change - slope).max() < left


def _sampled(body: Body, model: pin.Model, shape: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """I (xx yy zz yz xz xy) and L_o by Pinocchio's own centroidal map of a model."""
    q = body._joints.configurations(shape)[0]
    v = body._joints.velocities(shape, rate)[0]
    data = model.createData()
    pin.ccrba(model, data, q, v)
    return np.concatenate([np.array(data.Ig.inertia).ravel()[[0, 4, 8, 5, 2, 1]], data.hg.angular])


def test_derivatives_by_shape_and_rate_are_pinocchio_s(body, rng):
    """Joints that turn, slide, screw and follow others."""
    count, n = 7, body.n_shape
    shapes, rates = random_shapes(body, rng, count), rng.normal(size=(count, n))
    spins, rows = rng.normal(size=(count, 2, 3)), rng.normal(size=(count, 2, 4, 3))
    links = link_motions(body.chain, shapes, rates)
    by_shape, by_rate = by_shape_and_rate(body.chain, links, shapes, rates, spins, rows)
    gradients = [body.angular_momentum_gradient(shapes, rates, spins[:, k]) for k in range(2)]
    expected = np.concatenate([rows[:, k] @ np.swapaxes(gradients[k], 1, 2) for k in range(2)], axis=1)
    # Some hundred terms are rounded.
    np.testing.assert_allclose(by_shape, expected, rtol=0, atol=500 * EPS * np.abs(expected).max(initial=0.0))
    expected = rows.reshape(count, 8, 3) @ body.momentum_matrix(shapes)
    np.testing.assert_allclose(by_rate, expected, rtol=0, atol=500 * EPS * np.abs(expected).max(initial=0.0))


# ---- Bodies ---------------------------------------------------------------------------------------------------------


def a_file(mass: float, centre: tuple[float, float, float], moments: tuple[float, float, float]) -> str:
    """Two links and one that is fixed to the second in turned axes, which alone has mass there."""
    return urdf(
        link("base", 2.0, (0.1, 0.2, 0.15)), '<link name="arm"/>', link("tool", mass, moments, com=centre),
        joint("hinge", "revolute", "base", "arm", axis=(0.0, 1.0, 1.0), xyz=(0.1, 0.2, 0.3), rpy=TURNED),
        joint("weld", "fixed", "arm", "tool", xyz=(0.0, 0.4, 0.1), rpy=TURNED),
    )  # fmt: skip


@pytest.mark.parametrize("moving", [True, False])
def test_sums_of_the_derivatives_need_no_matrices(body, rng, moving):
    """Rows times dI spin + dL_o, against the matrices themselves."""
    shapes, rates = rng.normal(size=(2, 7, body.n_shape))
    rows, spins = rng.normal(size=(7, 4, 3)), rng.normal(size=(7, 3))
    matrices = inertial_regressor(body.chain, shapes, rates).matrices
    inertia = matrices[:, [0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(7, 3, 3, -1)
    added = np.einsum("nabp,nb->nap", inertia, spins) + (matrices[:, 6:9] if moving else 0.0)
    found = by_link_parameters(link_motions(body.chain, shapes, rates), rows, spins, moving=moving)
    size = np.einsum("nka,nap->kp", np.abs(rows), np.abs(inertia).sum(axis=2) * np.abs(spins).max() + np.abs(added))
    np.testing.assert_allclose(found, np.einsum("nka,nap->kp", rows, added), rtol=0, atol=64 * EPS * size.max())


def test_a_changed_body_is_the_one_of_a_changed_file(load_urdf, rng):
    body = load_urdf(a_file(0.5, (0.1, 0.0, 0.2), (0.01, 0.02, 0.025)))
    other = load_urdf(a_file(0.8, (0.0, 0.1, -0.2), (0.03, 0.02, 0.04)))
    part = other.moving_parts[1]
    assert part.links[0] == "arm"
    changed = body.with_inertias({"arm": part.mass}, {"arm": part.centre}, {"arm": part.inertia})
    shapes, rates = rng.normal(size=(2, 5, 1))
    # A few roundings of terms of one kilogram a metre away.
    assert np.abs(changed.locked_inertia(shapes) - other.locked_inertia(shapes)).max() < 1e-14
    assert np.abs(changed.internal_momentum(shapes, rates) - other.internal_momentum(shapes, rates)).max() < 1e-14
    assert np.abs(changed.inertia_gradient(shapes) - other.inertia_gradient(shapes)).max() < 1e-14
    assert changed.mass == pytest.approx(other.mass, rel=1e-15)
    assert changed.joint_names == body.joint_names
    assert body.mass == pytest.approx(2.5)
    assert changed.sha256 is changed.file is None


def test_what_is_not_given_stays(body):
    given = numbers(body)
    same = body.with_inertias(**given)
    assert np.abs(same.chain.centres - body.chain.centres).max() <= 4.0 * EPS * (1.0 + np.abs(body.chain.centres).max())
    assert np.allclose(
        same.chain.inertias, body.chain.inertias, rtol=0.0, atol=8.0 * EPS * np.abs(body.chain.inertias).max()
    )
    heavier = body.with_inertias(masses=2.0 * given["masses"])
    assert heavier.mass == pytest.approx(2.0 * body.mass, rel=1e-14)
    assert np.array_equal(heavier.chain.inertias, body.chain.inertias)
    assert np.array_equal(heavier.chain.centres, body.chain.centres)
    assert heavier.chain.rows.mass == pytest.approx(heavier.mass, rel=1e-14)


def test_a_family_is_its_bodies(body, rng):
    given = numbers(body)
    scales = rng.uniform(0.8, 1.2, (5, len(given["masses"])))
    family = body.with_inertias(masses=given["masses"] * scales, inertias=given["inertias"] * scales[..., None, None])
    assert isinstance(family, BodyFamily)
    assert len(family) == 5
    assert len(family[1:4]) == 3
    shapes, rates = random_shapes(body, rng, 4), rng.normal(size=(4, body.n_shape))
    inertia, momentum = family.sample(shapes, rates)
    for number, one in enumerate(family):
        alone = body.with_inertias(
            masses=given["masses"] * scales[number], inertias=given["inertias"] * scales[number][:, None, None]
        )
        assert np.array_equal(one.chain.inertias, alone.chain.inertias)
        assert np.array_equal(one.chain.rows.rows, alone.chain.rows.rows)
        fresh = replace(one.chain).rows
        assert np.array_equal(fresh.rows, one.chain.rows.rows)
        assert family.mass[number] == one.chain.rows.mass == fresh.mass
        expected = alone.sample(shapes, rates)
        assert np.abs(inertia[number] - expected[0]).max() < 1e-13 * np.abs(expected[0]).max()
        assert np.abs(momentum[number] - expected[1]).max() < 1e-13 * np.abs(momentum[number]).max()


def test_links_may_be_given_one_by_one():
    body = sp.load_body("cat")
    mass = body.moving_parts[3].mass
    name = body.moving_parts[3].links[0]
    family = body.with_inertias(masses={name: mass * np.array([1.0, 2.0])})
    assert isinstance(family, BodyFamily)
    assert np.allclose(family.mass, body.mass + mass * np.array([0.0, 1.0]), rtol=1e-14)
    mixed = body.with_inertias(masses={name: mass}, centres={body.moving_parts[0].links[0]: np.zeros((3, 3))})
    assert isinstance(mixed, BodyFamily)
    assert len(mixed) == 3


def test_they_can_be_pickled(body):
    changed = body.with_inertias(masses=numbers(body)["masses"] * np.array([[1.1], [1.2]]))
    again = pickle.loads(pickle.dumps(changed))
    shape = np.zeros(body.n_shape)
    assert np.array_equal(again[1].locked_inertia(shape), changed[1].locked_inertia(shape))


# ---- What is refused ------------------------------------------------------------------------------------------------


def test_names_and_shapes_are_checked(load_urdf):
    body = load_urdf(a_file(0.5, (0.1, 0.0, 0.2), (0.01, 0.02, 0.025)))
    with pytest.raises(UnknownNameError, match="'arm'"):
        body.with_inertias({"amr": 1.0})
    with pytest.raises(ShapeError, match="'tool'"):
        body.with_inertias(centres={"tool": np.zeros(3)})
    with pytest.raises(ShapeError, match="expected"):
        body.with_inertias(np.ones(3))
    with pytest.raises(ShapeError, match="leading"):
        body.with_inertias(np.ones((2, 2, 2)))
    with pytest.raises(ShapeError, match="'arm'"):
        body.with_inertias(inertias={"arm": np.ones(3)})
    with pytest.raises(ShapeError, match="'arm'"):
        body.with_inertias(np.ones((4, 2)), {"arm": np.zeros((3, 3))})
    with pytest.raises(ShapeError, match="masses"):
        body.with_inertias([1.0, np.nan])


def test_what_no_body_has_is_refused_and_named(load_urdf):
    body = load_urdf(a_file(0.5, (0.1, 0.0, 0.2), (0.01, 0.02, 0.025)))
    for mass in (0.0, -1.0, 1e40):
        with pytest.raises(UnphysicalInertiaError, match="'arm'"):
            body.with_inertias({"arm": [1.0, mass]})
    with pytest.raises(UnphysicalInertiaError, match="masses"):
        body.with_inertias({"arm": 0.0})
    skew = np.diag([1.0, 1.0, 1.0])
    skew[0, 1] = 1e-3
    with pytest.raises(UnphysicalInertiaError, match="'base'"):
        body.with_inertias(inertias={"base": skew})
    plate = np.diag([1.0, 1.0, 2.0])
    assert isinstance(body.with_inertias(inertias={"base": plate}), Body)
    for moments, text in (((1.0, 1.0, 2.1), "which break the triangle inequality"), ((-0.1, 1.0, 1.0), "negative")):
        broken = np.stack([plate, np.diag(moments)])
        with pytest.raises(UnphysicalInertiaError, match=rf"body 1: inertias: link 'base' has .*{text}"):
            body.with_inertias(inertias={"base": broken})
        with pytest.warns(UnphysicalInertiaWarning, match="'base'"):
            body.with_inertias(inertias={"base": broken}, on_unphysical="warn")
        body.with_inertias(inertias={"base": broken}, on_unphysical="allow")
    with pytest.raises(UnknownNameError, match="on_unphysical"):
        body.with_inertias(inertias={"base": plate}, on_unphysical="no")


def test_a_part_without_mass_may_stay_without(load_urdf):
    body = load_urdf(
        urdf(
            link("base", 2.0, (0.1, 0.2, 0.15)), '<link name="between"/>', link("arm", 1.0, (0.1, 0.1, 0.1)),
            joint("first", "revolute", "base", "between"), joint("second", "revolute", "between", "arm"),
        )
    )  # fmt: skip
    assert body.with_inertias([2.0, 0.0, 3.0]).mass == 5.0
    assert body.with_inertias([2.0, 0.5, 3.0]).mass == 5.5


def test_the_chain_of_a_body_is_not_changed_by_another(body):
    before = replace(body.chain)
    body.with_inertias(masses=2.0 * numbers(body)["masses"])
    assert np.array_equal(before.masses, body.chain.masses)
    assert body.mass == pytest.approx(body.chain.masses.sum(), rel=1e-14)
