"""Steady spins of pseudo-rigid bodies, against symbols, raw integration, central differences and the rigid limit."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import shapephase as sp
from shapephase import so3
from shapephase.errors import ShapeError, UnphysicalInertiaError
from shapephase.rigid_body import PseudoRigidBody, pseudo_rigid_spin, steady_rotation

BODY = PseudoRigidBody([3.0, 2.0, 1.0], shear=10.0, bulk=20.0)


def symbolic_force():
    """DV/dQ by differentiating the energy, written once more."""
    q = ca.SX.sym("q", 3, 3)
    volume = ca.log(ca.det(q))
    energy = 5.0 * (ca.trace(q.T @ q) - 3.0) - 10.0 * volume + 10.0 * volume**2
    return ca.Function("force", [q], [ca.reshape(ca.gradient(energy, ca.vec(q)), 3, 3), energy])


def integrated(force, q, rate, times, tolerance=1e-12):
    """Q'' = -force E^-1 from Q and Q', by SciPy."""

    def slope(_, y):
        pull = np.array(force(y[:9].reshape(3, 3))[0])
        return np.concatenate([y[9:], -(pull / BODY.second_moments).ravel()])

    start = np.concatenate([q.ravel(), rate.ravel()])
    run = solve_ivp(slope, (0.0, times[-1]), start, method="DOP853", rtol=tolerance, atol=0.1 * tolerance, t_eval=times)
    return run.y[:9].T.reshape(-1, 3, 3)


@pytest.mark.parametrize("axis", [0, 2])
def test_a_steady_spin_is_a_motion_l8(axis):
    force, spin = symbolic_force(), pseudo_rigid_spin(BODY, axis, 6.0)
    start = np.diag(spin.stretches)
    pull, energy = force(start)
    assert BODY.force(start) == pytest.approx(np.array(pull), abs=1e-13)
    assert BODY.stored_energy(start) == pytest.approx(float(energy), abs=1e-13)
    times = np.linspace(0.0, 5.0, 6)
    turning = so3.hat(spin.rate * np.eye(3)[axis]) @ start
    assert integrated(force, start, turning, times) == pytest.approx(spin.deformation(times), abs=1e-9)
    angular = turning @ np.diag(BODY.second_moments) @ start.T
    assert so3.vee(angular - angular.T)[axis] == pytest.approx(6.0, rel=1e-12)


def test_curvatures_by_central_differences_l8():
    """The amended potential on all nine directions; one of them, the turn about the momentum, is flat."""
    for axis, momentum in ((0, 6.0), (1, 3.0), (2, 6.0)):
        spin = pseudo_rigid_spin(BODY, axis, momentum)
        mu = momentum * np.eye(3)[axis]

        def amended(q, mu=mu):
            second = q @ np.diag(BODY.second_moments) @ q.T
            inertia = np.trace(second) * np.eye(3) - second
            return float(BODY.stored_energy(q) + 0.5 * mu @ np.linalg.solve(inertia, mu))

        start, step = np.diag(spin.stretches), 1e-3
        units = step * np.eye(9).reshape(9, 3, 3)
        hessian = np.array(
            [
                [sum(s * t * amended(start + s * a + t * b) for s in (1.0, -1.0) for t in (1.0, -1.0)) for a in units]
                for b in units
            ]
        ) / (4.0 * step * step)
        gradient = [(amended(start + a) - amended(start - a)) / (2.0 * step) for a in units]
        assert np.abs(gradient).max() < 1e-4
        expected = np.linalg.eigvalsh(hessian)
        flat = int(np.argmin(np.abs(expected)))
        assert abs(expected[flat]) < 1e-4
        assert spin.curvatures == pytest.approx(np.delete(expected, flat), abs=1e-3)


def test_an_unstable_spin_grows_as_its_eigenvalue_says_l8():
    force, spin = symbolic_force(), pseudo_rigid_spin(BODY, 1, 6.0)
    growth = spin.eigenvalues.real.max()
    start, turning = np.diag(spin.stretches), so3.hat(spin.rate * np.eye(3)[1])
    small = 1e-6 * np.random.default_rng(3).normal(size=(3, 3))
    times = np.array([0.0, 20.0, 25.0])
    moved = integrated(force, start + small, turning @ (start + small), times, 1e-9)
    # Momentum and turn of the disturbed motion differ a little; out of the plane nothing else is.
    out = [np.linalg.norm([q[1, 0], q[1, 2], q[0, 1], q[2, 1]]) for q in moved[1:]]
    assert spin.verdict == "unstable"
    assert np.log(out[1] / out[0]) / 5.0 == pytest.approx(growth, rel=0.1)


def test_a_stiff_body_is_the_rigid_one_l8():
    """Stretches, rates and the eigenvalues of the slow modes tend to those of the rigid body."""
    for axis, verdict in ((0, "spectrally stable"), (1, "unstable"), (2, "stable")):
        errors = []
        for stiffness in (1e3, 1e4):
            body = PseudoRigidBody([3.0, 2.0, 1.0], stiffness, 2.0 * stiffness)
            spin = pseudo_rigid_spin(body, axis, 2.0)
            rigid = steady_rotation(np.diag(body.moments()), 2.0 * np.eye(3)[axis])
            own = rigid.eigenvalues[0] if rigid.eigenvalues[0] else 1.0
            nearest = np.abs(spin.eigenvalues - own).min()
            errors.append([abs(spin.rate - 2.0 / rigid.moment), np.abs(spin.stretches - 1.0).max(), nearest])
            assert spin.verdict == verdict
        assert np.all(np.array(errors[1]) < 0.11 * np.array(errors[0]) + 1e-12)
    still = pseudo_rigid_spin(BODY, 2, 0.0)
    assert np.array_equal(still.stretches, np.ones(3))
    assert still.rate == 0.0


@pytest.mark.parametrize("count", [4, pytest.param(100, marks=pytest.mark.full)])
def test_a_free_motion_turns_by_the_phases_of_its_stretch(count):
    """Q by SciPy from symbols; the turn by `reconstruct` from the shape alone; the parts of `split` make the whole."""
    rng = np.random.default_rng(count)
    for _ in range(count):
        start, rate = so3.exp(rng.normal(size=3)) @ (np.eye(3) + 0.1 * rng.normal(size=(3, 3))), rng.normal(size=(3, 3))
        motion, times = BODY.motion(start, 0.5 * rate, 2.0), np.array([0.0, 0.9, 2.0])
        q = motion.deformation(times)
        if count < 10:
            assert q == pytest.approx(integrated(symbolic_force(), start, 0.5 * rate, times), abs=1e-10)
        assert motion.attitude(times) @ motion.stretch(times) == pytest.approx(q, abs=1e-13)
        shapes = sp.prescribed(motion.inertia, motion.internal_momentum, 2.0)
        moved = sp.reconstruct(shapes, motion.momentum, motion.attitude(0.0), tolerance=1e-11)
        assert so3.angle(so3.transpose(moved.attitude(times)) @ motion.attitude(times)).max() < 1e-10
        parts = sp.split(moved)
        assert so3.angle(parts.total_rotation @ moved.attitude(0.0) @ moved.final_attitude.T) < 1e-10
        assert parts.residual < 1e-10


def test_what_is_no_body_and_no_spin():
    for arguments in (([1.0, 2.0], 1.0, 1.0), ([1.0, 2.0, 3.0], [1.0], 1.0)):
        with pytest.raises(ShapeError):
            PseudoRigidBody(*arguments)
    for arguments in (([1.0, 2.0, 0.0], 1.0, 1.0), ([1.0, 2.0, 3.0], 0.0, 1.0), ([1.0, 2.0, 3.0], 1.0, -1.0)):
        with pytest.raises(UnphysicalInertiaError):
            PseudoRigidBody(*arguments)
    with pytest.raises(ShapeError, match="axis"):
        pseudo_rigid_spin(BODY, 3, 1.0)
    with pytest.raises(ShapeError, match="momentum"):
        pseudo_rigid_spin(BODY, 2, [1.0, 2.0])
    with pytest.raises(ShapeError, match="determinant"):
        BODY.force(-np.eye(3))
    with pytest.raises(ShapeError, match="stretches"):
        BODY.moments([1.0, -1.0, 1.0])
