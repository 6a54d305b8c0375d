"""Laws of mechanics over random bodies of the catalog and random paths (theory.md B8, C2, C8)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import shapephase as sp
from support.independent import BODIES, MujocoBody, apart, body_of, random_loop, random_rotation, random_vector

TIMES = np.linspace(0.0, 2.0, 33)
LAW = settings(derandomize=True, deadline=None)
EXACT = 1e-12


@dataclass(frozen=True)
class Case:
    """A body, a seed for its path, and a momentum relative to what is usual for the body."""

    name: str
    kind: str
    seed: int
    size: float

    @property
    def body(self) -> sp.Body:
        return body_of(self.name)

    @property
    def path(self) -> sp.ShapePath:
        """A loop of two seconds: Fourier, periodic spline through 8 knots, or waypoints there and back."""
        random = np.random.default_rng(self.seed)
        if self.kind == "fourier":
            return random_loop(self.seed, self.body.n_shape).path
        # Knots apart: a spline through close knots with distant values swings by thousands of radians.
        times = np.linspace(0.0, 2.0, 8)
        times[1:-1] += random.uniform(-0.1, 0.1, 6)
        shapes = random.uniform(-0.6, 0.6, (8, self.body.n_shape))
        shapes[-1] = shapes[0]
        return sp.ShapePath.spline(times, shapes) if self.kind == "spline" else sp.ShapePath.waypoints(times, shapes)

    @property
    def deformation(self) -> sp.Deformation:
        return sp.articulated(self.body, self.path)

    @property
    def momentum(self) -> np.ndarray:
        return random_vector(self.seed + 1, self.size * BODIES[self.name])

    @property
    def attitude(self) -> np.ndarray:
        return random_rotation(self.seed + 2)


def cases(largest: float):
    names = st.sampled_from([name for name in BODIES if name in sp.robot_names()])
    kinds = st.sampled_from(["fourier", "spline", "waypoints"])
    sizes = st.just(0.0) | st.floats(1e-3, largest) if largest > 0.0 else st.just(0.0)
    return st.builds(Case, names, kinds, st.integers(0, 10_000), sizes)


def lift(path: sp.ShapePath, case: Case, **options) -> np.ndarray:
    """The final attitude at zero momentum, from the identity."""
    motion = sp.reconstruct(sp.articulated(case.body, path), np.zeros(3), tolerance=3e-12, **options)
    return motion.final_attitude


@LAW
@given(cases(largest=2.0))
def test_attitudes_are_orthogonal_and_carry_the_momentum(case: Case):
    """C2, C8: R^T R = 1, det R = 1, R Pi = momentum and |Pi| = |momentum|, whatever the tolerance."""
    motion = sp.reconstruct(case.deformation, case.momentum, case.attitude, tolerance=1e-6)
    r, pi = motion.attitude(TIMES), motion.body_momentum(TIMES)
    size = np.linalg.norm(case.momentum)
    assert np.abs(np.swapaxes(r, 1, 2) @ r - np.eye(3)).max() < EXACT
    assert np.abs(np.linalg.det(r) - 1.0).max() < EXACT
    assert np.abs(np.einsum("nij,nj->ni", r, pi) - case.momentum).max() <= EXACT * size
    assert np.abs(np.linalg.norm(pi, axis=1) - size).max() <= EXACT * size


@LAW
@given(cases(largest=2.0))
def test_the_momentum_of_the_motion_is_conserved(case: Case):
    """R (I omega + L_o) = momentum, with omega by differences of R and I, L_o from the body itself."""
    motion = sp.reconstruct(case.deformation, case.momentum, case.attitude, tolerance=1e-10)
    assert motion.equation_residual < 1e-7
    omega = motion.angular_velocity(TIMES)
    shapes, rates = case.path.shape(TIMES), case.path.rate(TIMES)
    pi = np.einsum("nij,nj->ni", case.body.locked_inertia(shapes), omega) + case.body.internal_momentum(shapes, rates)
    spatial = np.einsum("nij,nj->ni", motion.attitude(TIMES), pi)
    scale = BODIES[case.name] + np.abs(pi).max()
    assert np.abs(spatial - case.momentum).max() < EXACT * scale


@LAW
@given(cases(largest=0.0), st.floats(0.1, 10.0))
def test_at_zero_momentum_haste_changes_nothing(case: Case, factor: float):
    path = case.path
    assert apart(lift(path.stretched(factor), case), lift(path, case)) < 1e-11


@LAW
@given(cases(largest=0.0))
def test_at_zero_momentum_the_reversed_loop_gives_the_inverse(case: Case):
    path = case.path
    there = lift(path, case)
    assert apart(lift(path.reversed(), case) @ there, np.eye(3)) < 1e-11


@LAW
@given(cases(largest=0.0))
def test_at_zero_momentum_two_loops_give_the_product(case: Case):
    """The later factor stands on the right: R = R_1 R_2. The second loop is one of another kind from the same start."""
    first = case.path
    other = random_loop(case.seed + 5, case.body.n_shape)
    moved = sp.ShapePath.fourier(other.mean + first.shape(0.0) - other.shape(0.0), other.cosines, other.sines, 1.0)
    both = lift(first.then(moved), case)
    r1, r2 = lift(first, case), lift(moved, case)
    assert apart(both, r1 @ r2) < 1e-11
    assert apart(lift(moved.then(first), case), r2 @ r1) < 1e-11
    assert apart(lift(first.repeated(3), case), r1 @ r1 @ r1) < 1e-11


@LAW
@given(cases(largest=2.0), st.integers(0, 10_000))
def test_turning_attitude_and_momentum_turns_the_motion(case: Case, seed: int):
    """Inertial axes are a choice: Q R, Q momentum -> Q R(t); Pi(t) and omega(t) stay."""
    q = random_rotation(seed)
    motion = sp.reconstruct(case.deformation, case.momentum, case.attitude, tolerance=1e-9)
    turned = sp.reconstruct(case.deformation, q @ case.momentum, q @ case.attitude, tolerance=1e-9)
    growth = 1.0 + np.linalg.norm(motion.sensitivity.by_attitude)
    assert apart(turned.attitude(TIMES), q @ motion.attitude(TIMES)) < 1e-11 * growth
    change = np.abs(turned.body_momentum(TIMES) - motion.body_momentum(TIMES)).max()
    assert change <= 1e-11 * growth * np.linalg.norm(case.momentum)


@LAW
@given(cases(largest=1.0))
def test_a_motion_is_the_sequence_of_its_halves(case: Case):
    """Deterministic flow: the second loop starts with the attitude where the first ended, with the same momentum."""
    path = case.path
    twice = sp.reconstruct(sp.articulated(case.body, path.repeated(2)), case.momentum, case.attitude, tolerance=1e-10)
    once = sp.reconstruct(case.deformation, case.momentum, case.attitude, tolerance=1e-10)
    again = sp.reconstruct(case.deformation, case.momentum, once.final_attitude, tolerance=1e-10)
    assert apart(twice.attitude(2.0), once.final_attitude) < 2e-10
    assert apart(twice.final_attitude, again.final_attitude) < 4e-10


@LAW
@given(cases(largest=1.0))
def test_time_runs_backward(case: Case):
    """The reversed path with the opposite momentum undoes the motion."""
    there = sp.reconstruct(case.deformation, case.momentum, case.attitude, tolerance=1e-10)
    reversed_path = sp.articulated(case.body, case.path.reversed())
    back = sp.reconstruct(reversed_path, -case.momentum, there.final_attitude, tolerance=1e-10)
    assert apart(back.attitude(TIMES), there.attitude(2.0 - TIMES)) < 4e-10


@LAW
@given(cases(largest=2.0))
def test_the_momentum_is_about_the_centre_of_mass(case: Case):
    """MuJoCo sums the momentum over the links about their common centre; the base's own velocity does not matter."""
    simulated = MujocoBody(case.name, case.body.joint_names)
    motion = sp.reconstruct(case.deformation, case.momentum, case.attitude, tolerance=1e-9)
    scale = BODIES[case.name]
    for t in (0.0, 0.77, 2.0):
        simulated.place(motion.base_position(t), motion.attitude(t), case.path.shape(t))
        assert np.abs(simulated.centre_of_mass()).max() < 1e-11
        simulated.move(random_vector(case.seed, 2.0), motion.angular_velocity(t), case.path.rate(t))
        internal = np.abs(motion.deformation.internal_momentum(t)).max()
        assert np.abs(simulated.momentum_about_centre() - case.momentum).max() < 2e-11 * (scale + internal)


@LAW
@given(cases(largest=1.0))
def test_every_gauge_has_the_same_total_rotation_and_its_identity(case: Case):
    """Delta R = R_D R_G; R_D = exp(theta_M mu^) tilt in the horizontal, Delta R = exp(theta_M mu^) tilt in the base."""
    motion = sp.reconstruct(case.deformation, case.momentum, case.attitude, tolerance=1e-9)
    size = np.linalg.norm(case.momentum)
    horizontal, base = sp.split(motion), sp.split(motion, "base")
    total = motion.final_attitude @ case.attitude.T
    for split in (horizontal, base):
        assert apart(split.total_rotation, total) < EXACT
        assert split.residual < 1e-10
        # Without momentum R_D is the identity and R_G is computed anew.
        assert apart(split.dynamical_rotation @ split.holonomy, total) < (EXACT if size > 0.0 else 1e-9)
    if size > 0.0:
        about = [rotation_about(case.momentum / size, split.montgomery_phase) for split in (horizontal, base)]
        assert apart(about[0] @ horizontal.closing_tilt @ horizontal.holonomy, total) < 1e-10
        assert apart(about[1] @ base.closing_tilt, total) < 1e-10


def rotation_about(axis: np.ndarray, angle: float) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(angle * axis).as_matrix()
