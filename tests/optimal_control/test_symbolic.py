"""The symbolic mechanics of a body against Pinocchio, for every robot at hand and every kind of joint."""

from __future__ import annotations

import gc
import pickle
import subprocess
import sys
import warnings
import weakref
from pathlib import Path

import casadi
import numpy as np
import pinocchio as pin
import pytest

import shapephase as sp
from shapephase.body import catalog
from shapephase.errors import UnknownNameError
from shapephase.optimal_control import symbolic_body
from shapephase.optimal_control.symbolic import QUANTITIES, solve_linear
from support.bodies import joint, link, urdf
from support.bodies import random_shapes as shapes_in_limits

EXAMPLES = Path(catalog.example_file("human")).parents[3] / "robots"
FILES = sorted(EXAMPLES.rglob("*.urdf"))
NO_BODIES = {"ur3.urdf", "alex_psyonic_hands.urdf"}
ROBOTS = [path for path in FILES if path.name not in NO_BODIES]
QUICK = {"panda.urdf", "human.urdf", "talos_reduced.urdf", "solo12.urdf", "double_pendulum.urdf"}


def loaded(source):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return sp.load_body(source, on_unphysical="warn")


def random_shapes(body, rng, count):
    """Some files have limits as large as numbers get."""
    return np.clip(shapes_in_limits(body, rng, count), -3.0, 3.0)


def close(ours, truth, relative):
    assert ours.shape == truth.shape
    assert np.abs(ours - truth).max(initial=0.0) <= relative * np.abs(truth).max(initial=0.0)


def number(function, shape):
    return np.array(function(shape))


def by_joint(function, shape, rows, columns):
    """The derivative's rows of entries, column after column, as (n, rows, columns)."""
    return number(function, shape).T.reshape(len(shape), columns, rows).swapaxes(1, 2)


def check_values(body, shape):
    symbols = symbolic_body(body)
    inertia, matrix = body.locked_inertia(shape), body.momentum_matrix(shape)
    close(number(symbols.inertia, shape), inertia, 1e-12)
    close(number(symbols.momentum_matrix, shape), matrix, 1e-12)
    # A thin body's inertia may be nearly singular: what must hold is the equation.
    close(inertia @ number(symbols.connection, shape), matrix, 1e-12)
    centre = body.centre_of_mass(shape)
    assert np.abs(number(symbols.centre_of_mass, shape)[:, 0] - centre).max() <= 1e-12 * (1.0 + np.abs(centre).max())


def check_derivatives(body, shape):
    symbols, n = symbolic_body(body), body.n_shape
    close(by_joint(symbols.derivative("inertia"), shape, 3, 3), body.inertia_gradient(shape), 1e-10)
    ours = by_joint(symbols.derivative("momentum_matrix"), shape, 3, n)
    close(ours, body.momentum_matrix_gradient(shape), 1e-10)


def check_metric(body, shape, rates):
    """Twice the energy about the centre of mass at zero momentum, by Pinocchio, in all directions of the rates."""
    metric = number(symbolic_body(body).shape_metric, shape)
    assert np.array_equal(metric, metric.T)
    turning = -(sp.mechanical_connection(body, shape) @ rates.T).T
    energies = body.kinetic_energy(shape, rates, turning)
    close(0.5 * np.einsum("ki,ij,kj->k", rates, metric, rates), energies, 1e-11)
    # The form of Cabrera 2006, equation (4): T_0 less what the turning of the whole takes away.
    momentum = body.internal_momentum(shape, rates)
    taken = np.einsum("ki,ki->k", momentum, np.linalg.solve(body.locked_inertia(shape), momentum.T).T)
    close(body.kinetic_energy(shape, rates) - 0.5 * taken, energies, 1e-9)


# ---- Every robot ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", [path for path in ROBOTS if path.name in QUICK], ids=lambda path: path.stem)
def test_inertia_and_momentum_of_some_robots_are_pinocchios(path, rng):
    body = loaded(path)
    for shape in random_shapes(body, rng, 2):
        check_values(body, shape)
        check_derivatives(body, shape)


@pytest.mark.full
@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
def test_inertia_and_momentum_of_every_robot_are_pinocchios(path, rng):
    body = loaded(path)
    for shape in random_shapes(body, rng, 2):
        check_values(body, shape)
        check_derivatives(body, shape)
    check_metric(body, random_shapes(body, rng, 1)[0], rng.normal(size=(3, body.n_shape)))


def test_our_own_bodies_have_pinocchios_values_and_metric(body, rng):
    for shape in random_shapes(body, rng, 3):
        check_values(body, shape)
        check_metric(body, shape, rng.normal(size=(4, body.n_shape)))


def test_the_metric_is_the_mass_matrix_reduced_by_the_base(body, rng):
    """M_ss - M_sb M_bb^-1 M_bs of Pinocchio's composite rigid body algorithm."""
    shape = random_shapes(body, rng, 1)[0]
    model = body._model
    mass = pin.crba(model, model.createData(), body._joints.configurations(shape[None])[0])
    mass = np.triu(mass) + np.triu(mass, 1).T
    fold = np.array([body._joints.velocities(row[None], row[None])[0] for row in np.eye(body.n_shape)]).T
    base, both, joints = mass[:6, :6], mass[:6] @ fold, fold.T @ mass @ fold
    close(number(symbolic_body(body).shape_metric, shape), joints - both.T @ np.linalg.solve(base, both), 1e-11)


# ---- Every kind of joint --------------------------------------------------------------------------------------------


@pytest.fixture
def mixed(load_urdf):
    """Oblique turning, endless and sliding joints, followers with offsets, a fixed link, a link without mass."""
    moments = [0.02, 0.03, 0.035]
    return load_urdf(
        urdf(
            link("base", 2.0, [[0.05, 0.01, 0.0], [0.01, 0.06, -0.005], [0.0, -0.005, 0.04]], com=(0.1, -0.05, 0.02)),
            link("upper", 1.0, moments, com=(0.0, 0.1, 0.2)),
            link("wheel", 0.7, moments, com=(0.05, 0.0, 0.1)),
            link("slide", 0.5, moments, com=(0.0, -0.1, 0.0)),
            link("tip", 0.3, moments, com=(0.2, 0.0, 0.0)),
            link("finger", 0.2, moments, com=(0.0, 0.0, 0.3)),
            link("other", 0.25, moments, com=(0.1, 0.1, 0.0)),
            '<link name="empty"/>',
            link("end", 0.4, moments, com=(0.0, 0.2, 0.1)),
            joint("bend", "revolute", "base", "upper", axis=(1, 2, -2), xyz=(0.1, 0.2, 0.3), rpy=(0.3, -0.2, 0.5)),
            joint("spin", "continuous", "upper", "wheel", axis=(0, 3, 4), xyz=(0.0, 0.1, 0.4), rpy=(0.1, 0.2, 0.3)),
            joint("push", "prismatic", "wheel", "slide", axis=(2, -1, 2), xyz=(0.2, 0.0, 0.1), rpy=(-0.4, 0.1, 0.2)),
            joint("weld", "fixed", "slide", "tip", xyz=(0.1, 0.0, 0.2), rpy=(0.2, 0.6, -0.3)),
            joint("follow", "revolute", "base", "finger", axis=(0, 1, 0), xyz=(-0.1, 0.0, 0.2),
                  extra='<mimic joint="bend" multiplier="-1.5" offset="0.2"/>'),
            joint("draw", "prismatic", "finger", "other", axis=(1, 0, 0), xyz=(0.0, 0.2, 0.0),
                  extra='<mimic joint="push" multiplier="0.3" offset="-0.1"/>'),
            joint("wrist", "continuous", "base", "empty", axis=(0, 0, 1), xyz=(0.0, -0.3, 0.0)),
            joint("hand", "revolute", "empty", "end", axis=(1, 0, 0), rpy=(0.0, 1.0, 0.0)),
        )
    )  # fmt: skip


def test_every_kind_of_joint_followers_and_fixed_links(mixed, rng):
    assert mixed.n_shape == 5
    for shape in rng.uniform(-1.5, 1.5, (5, 5)):
        check_values(mixed, shape)
        check_derivatives(mixed, shape)
        check_metric(mixed, shape, rng.normal(size=(6, 5)))


def test_a_screw_of_a_pinocchio_model(rng):
    """A joint that slides as it turns, which no file can hold."""
    pin.seed(7)
    model = pin.Model()
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.appendBodyToJoint(root, pin.Inertia.Random(), pin.SE3.Identity())
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    screw = model.addJoint(root, pin.JointModelHelicalUnaligned(axis, 0.4), pin.SE3.Random(), "screw")
    model.appendBodyToJoint(screw, pin.Inertia.Random(), pin.SE3.Random())
    body = loaded(model)
    for shape in rng.uniform(-2.0, 2.0, (3, 1)):
        check_values(body, shape)
        check_derivatives(body, shape)
        check_metric(body, shape, np.ones((1, 1)))


def test_poses_of_links(mixed, rng):
    shape = rng.uniform(-1.5, 1.5, 5)
    for name in mixed.link_names:
        close(number(symbolic_body(mixed).link_pose(name), shape), mixed.link_pose(shape, name), 1e-14)


def test_a_body_without_joints(load_urdf):
    body = load_urdf(urdf(link("alone", 2.0, [0.1, 0.2, 0.25], com=(0.3, 0.0, 0.1))))
    check_values(body, np.zeros(0))
    assert symbolic_body(body).shape_metric(np.zeros(0)).shape == (0, 0)


# ---- Derivatives, inlining, use -------------------------------------------------------------------------------------


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_derivatives_are_the_slopes_of_the_values(mixed, rng, quantity):
    symbols, shape, step = symbolic_body(mixed), rng.uniform(-1.0, 1.0, 5), 1e-3
    function = getattr(symbols, quantity)
    exact = number(symbols.derivative(quantity), shape)
    for k, direction in enumerate(np.eye(5)):
        values = [number(function, shape + j * step * direction).ravel(order="F") for j in (-2, -1, 1, 2)]
        slope = (values[0] - 8.0 * values[1] + 8.0 * values[2] - values[3]) / (12.0 * step)
        np.testing.assert_allclose(exact[:, k], slope, rtol=0, atol=2e-10 * max(1.0, np.abs(exact).max()))


def test_the_curvature_comes_out_of_the_derivatives(mixed, rng):
    symbols, shape = symbolic_body(mixed), rng.uniform(-1.0, 1.0, 5)
    slopes = by_joint(symbols.derivative("connection"), shape, 3, 5).swapaxes(1, 2)
    columns = number(symbols.connection, shape).T
    ours = slopes - slopes.swapaxes(0, 1) - np.cross(columns[:, None], columns[None])
    close(ours, sp.curvature(mixed, shape), 1e-12)


def test_expressions_are_inlined_and_called(mixed, rng):
    symbols, shape = symbolic_body(mixed), rng.uniform(-1.0, 1.0, 5)
    half = casadi.SX.sym("half", 5)
    inlined = casadi.Function("inlined", [half], [symbols.shape_metric(2.0 * half)])
    assert inlined.is_a("SXFunction")
    close(number(inlined, 0.5 * shape), number(symbols.shape_metric, shape), 1e-15)
    graph = casadi.MX.sym("graph", 5)
    called = casadi.Function("called", [graph], [symbols.shape_metric(2.0 * graph)])
    close(number(called, 0.5 * shape), number(symbols.shape_metric, shape), 1e-15)


def test_it_is_made_once_for_a_body_and_goes_with_it():
    body = sp.load_body("cat_two_halves")
    assert symbolic_body(body) is symbolic_body(body)
    assert symbolic_body(body) is not symbolic_body(sp.load_body("cat_two_halves"))
    seen = weakref.ref(symbolic_body(body))
    del body
    gc.collect()
    assert seen() is None


def test_it_survives_pickling_and_serialising(mixed, rng):
    symbols, shape = symbolic_body(mixed), rng.uniform(-1.0, 1.0, 5)
    symbols.derivative("inertia")
    again = pickle.loads(pickle.dumps(symbols))
    assert again.joint_names == mixed.joint_names
    for quantity in QUANTITIES:
        value = number(getattr(symbols, quantity), shape)
        assert np.array_equal(number(getattr(again, quantity), shape), value)
        text = getattr(symbols, quantity).serialize()
        assert np.array_equal(number(casadi.Function.deserialize(text), shape), value)
    assert np.array_equal(number(again.derivative("inertia"), shape), number(symbols.derivative("inertia"), shape))
    reloaded = pickle.loads(pickle.dumps(mixed))
    assert np.array_equal(number(symbolic_body(reloaded).inertia, shape), number(symbols.inertia, shape))


def test_another_process_computes_the_same(rng):
    shape = random_shapes(sp.load_body("cat_two_halves"), rng, 1)[0].tolist()
    program = (
        "import shapephase as sp; from shapephase.optimal_control.symbolic import symbolic_body; "
        f"print(symbolic_body(sp.load_body('cat_two_halves')).shape_metric({shape}).full().tolist())"
    )
    there = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert there.strip() == str(symbolic_body(sp.load_body("cat_two_halves")).shape_metric(shape).full().tolist())


def test_solving_in_symbols_is_backward_stable(rng):
    """A nearly singular inertia: a rod whose own axis carries a millionth of a millionth."""
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    matrix, right = turn @ np.diag([1.0, 1.0, 1e-12]) @ turn.T, rng.normal(size=(3, 2))
    matrix = 0.5 * (matrix + matrix.T)
    answer = np.array(casadi.DM(solve_linear(casadi.SX(matrix), casadi.SX(right))))
    assert np.abs(matrix @ answer - right).max() < 1e-15 * np.abs(matrix).max() * np.abs(answer).max()


def test_unknown_quantities_and_links_are_named(mixed):
    with pytest.raises(UnknownNameError, match="shape_metric"):
        symbolic_body(mixed).derivative("shape_metrics")
    with pytest.raises(UnknownNameError, match="upper"):
        symbolic_body(mixed).link_pose("uper")


def test_importing_the_library_does_not_import_casadi():
    program = "import sys, shapephase, shapephase.optimal_control.extremals.shooting; print('casadi' in sys.modules)"
    seen = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert seen.stdout.strip() == "False"
