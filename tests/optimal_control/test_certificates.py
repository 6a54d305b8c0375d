"""What shows that a plan is optimal, against the equations of extremals and dense linear algebra."""

from dataclasses import replace

import casadi
import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.errors import TrajectoryError
from shapephase.optimal_control import Limits, Search, Start, plan_reorientation, wong_residual
from shapephase.optimal_control._spline_basis import SplineBasis
from shapephase.optimal_control.collocation import CollocationProgram
from shapephase.optimal_control.guesses.loops import guesses
from shapephase.optimal_control.planning import hamiltonian_spread
from shapephase.optimal_control.task import reorientation

QUARTER = so3.exp(np.array([0.5 * np.pi, 0.0, 0.0]))
FREE = {"rates_at_ends": "free", "limits": Limits(rate_limits=None)}
BODY = sp.load_body("cat_two_halves")


@pytest.fixture(scope="module")
def cat():
    return plan_reorientation(BODY, QUARTER, duration=2.0, search=Search(pieces=32), **FREE)


def test_the_hamiltonian_is_that_of_the_extremal(cat):
    """H = L: the cost is H times the duration, and H at the start is the energy of the fitted extremal."""
    fit = wong_residual(BODY, cat.path)
    lift = -so3.apply(sp.shape_space.mechanical_connection(BODY, np.zeros(3)), fit.rate)
    energy = BODY.kinetic_energy(np.zeros(3), fit.rate, lift)
    assert cat.hamiltonian_spread < 2e-3
    assert cat.cost == pytest.approx(2.0 * energy, rel=5e-3)


def test_the_hamiltonian_of_another_path_varies(cat):
    """A loop at a pace that swings by a tenth has an energy that swings by four tenths."""
    task, basis = reorientation(BODY, QUARTER, duration=2.0, **FREE), SplineBasis(64)
    places = basis.nodes + 0.1 / (2.0 * np.pi) * np.sin(2.0 * np.pi * basis.nodes)
    swung = basis.through(cat.path.shape(2.0 * places))
    even = basis.through(cat.path.shape(2.0 * basis.nodes))
    assert hamiltonian_spread(task, basis, even, 2.0) == pytest.approx(0.0, abs=2e-3)
    assert hamiltonian_spread(task, basis, swung, 2.0) == pytest.approx(0.4, rel=0.05)


def test_rates_at_their_limits_are_left_out():
    """Along a straight way all pieces are at the limit."""
    task = reorientation(BODY, QUARTER, limits=Limits(rate_limits=1.0), rates_at_ends="free", end="free")
    basis = SplineBasis(12)
    straight = basis.through(basis.nodes[:, None] * np.array([1.0, 0.0, 0.0]))
    assert hamiltonian_spread(task, basis, straight, 1.0) is None
    assert hamiltonian_spread(task, basis, straight, 1.1) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("options", [{"cost": "acceleration"}, {"momentum": [0.0, 0.0, 1e-3]}])
def test_no_statement_where_the_density_is_no_hamiltonian(options):
    basis = SplineBasis(12)
    assert hamiltonian_spread(reorientation(BODY, QUARTER, **options), basis, np.ones((13, 3)), 1.0) is None


def test_the_second_order_by_dense_algebra():
    """The Hessian of the Lagrangian, on what the rows and the bounds leave, by an orthogonal basis of it."""
    task, basis = reorientation(BODY, QUARTER, limits=Limits(rate_limits=None)), SplineBasis(10)
    program = CollocationProgram(task, basis)
    guess = guesses(task, basis, 0, 1)[0]
    start = [
        guess.control,
        1.0,
        lambda places: guess.quaternions(places, task.turn_to_goal(guess.motion.final_attitude)),
    ]
    found = program.solve(*start, iterations=100)
    assert found.second_order is True
    low, high = program._bounds()
    solver = casadi.nlpsol(
        "again",
        "ipopt",
        program.program,
        {"ipopt": {"print_level": 0, "sb": "yes"}, "print_time": 0, **program.derivatives},
    )
    inside = (guess.quaternions(places, np.zeros(3)).ravel() for places in (program.places, basis.nodes))
    first = np.concatenate([found.control.ravel(), [1.0], *inside])
    again = solver(x0=first, lbx=low, ubx=high, lbg=program._low, ubg=program._high)
    _, slopes = program.derivatives["jac_g"](again["x"], [])
    upper = np.array(program.derivatives["hess_lag"](again["x"], [], 1.0, again["lam_g"]))
    hessian = upper + np.triu(upper, 1).T
    x = np.array(again["x"]).ravel()
    free = (x > low + 1e-6) & (x < high - 1e-6)
    rows = np.array(slopes)[program._low == program._high][:, free]
    _, sizes, directions = np.linalg.svd(rows)
    rank = int((sizes > 1e-10 * sizes[0]).sum())
    assert rank < free.sum()
    kept = directions[rank:]
    assert np.linalg.eigvalsh(kept @ hessian[np.ix_(free, free)] @ kept.T).min() > 0.0


@pytest.mark.full
@pytest.mark.parametrize(
    "motion",
    [{"joints": ["waist_pitch", "waist_yaw"]}, {"symmetric": {"waist_yaw": ("waist_pitch", 1.0)}}],
    ids=["held", "coupled"],
)
def test_a_plan_of_coupled_joints_is_an_extremal_of_their_motions(motion):
    goal = so3.exp(np.array([0.1, 0.0, 0.0]) if "joints" in motion else np.array([0.0, 0.05, 0.05]))
    plan = plan_reorientation(BODY, goal, search=Search(pieces=24), **motion, **FREE)
    assert wong_residual(BODY, plan.path, **motion).residual < 1e-2
    assert wong_residual(BODY, plan.path).residual > 5e-2


def test_a_path_that_moves_otherwise_is_refused(cat):
    with pytest.raises(TrajectoryError, match="waist_roll"):
        wong_residual(BODY, cat.path, joints=["waist_pitch", "waist_yaw"])


def test_starts_that_agree_are_counted(cat):
    one = cat.starts[0]
    starts = (
        one,
        replace(one, cost=one.cost * 1.0005),
        replace(one, cost=2.0 * one.cost),
        replace(one, converged=False),
    )
    assert replace(cat, starts=starts).agreeing_starts == 2
    assert isinstance(one, Start)
    assert "3 of them converged, 2 to this cost" in str(replace(cat, starts=starts))
