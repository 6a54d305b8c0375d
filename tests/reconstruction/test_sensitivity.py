"""Answers of a motion to small changes, and its phases as functions of time.

`Motion.sensitivity` and `Motion.amplification` are held against differences of whole motions, the library's and
Pinocchio's, against the chain rule and against the symmetric top in closed form; `Motion.dynamic_phase` and
`Motion.solid_angle` against quadrature of the body's own angular velocity, the split and the attitude itself.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import TrajectoryError
from support.independent import (
    BODIES,
    EVERY_BODY,
    FourierLoop,
    apart,
    axisymmetric_attitude,
    body_of,
    geodesic_turn,
    hat,
    random_loop,
    random_rotation,
    random_vector,
    turn,
)
from support.long_runs import full_but

Array = NDArray[np.float64]
TIGHT = 1e-12
EXACT = 1e-12
PHASE = 1e-12
DIFFERENCES = 1e-9
LONG_LOOPS = 30
UP = np.array([0.0, 0.0, 1.0])
# Besides one Fourier loop for every body: the other kinds of paths, and one so long that its steps take another route.
KINDS = ("spline", "open spline", "waypoints", "function", "long", "fast")
CASES = (*BODIES, *KINDS)
# Bodies and paths that differ in more than numbers.
QUICK = ("example:human", "cat_two_halves", "satellite", "open spline", "waypoints", "fast")
EVERY_CASE = full_but(CASES, *QUICK)


def path_of(kind: str, joints: int, seed: int) -> sp.ShapePath:
    """A path of two seconds (`long`: thirty loops of a quarter of a second each)."""
    loop = random_loop(seed, joints)
    if kind == "long":
        return random_loop(seed, joints, size=0.2, duration=0.25).path.repeated(LONG_LOOPS)
    if kind == "function":
        return sp.ShapePath.function(loop.at, loop.duration)
    if kind in ("spline", "open spline", "waypoints"):
        random = np.random.default_rng(seed)
        shapes = random.uniform(-0.5, 0.5, (7, joints))
        if kind == "spline":
            shapes[-1] = shapes[0]
        times = np.linspace(0.0, 2.0, 7)
        times[1:-1] += random.uniform(-0.1, 0.1, 5)
        return sp.ShapePath.waypoints(times, shapes) if kind == "waypoints" else sp.ShapePath.spline(times, shapes)
    return loop.path


@lru_cache(maxsize=16)
def deformation_of(case: str) -> sp.Deformation:
    body = body_of(body_name(case))
    return sp.articulated(body, path_of(case, body.n_shape, 1))


def body_name(case: str) -> str:
    return case if case in BODIES else "cat"


def usual_momentum(case: str) -> float:
    return BODIES[body_name(case)] * (5.0 if case == "fast" else 1.0)


@lru_cache(maxsize=32)
def motion_of(case: str, *, moving: bool = True) -> sp.Motion:
    momentum = random_vector(2, usual_momentum(case)) if moving else np.zeros(3)
    return sp.reconstruct(deformation_of(case), momentum, random_rotation(3), tolerance=TIGHT)


def momentum_scale(case: str) -> float:
    """The momentum whose change turns the end by about a radian [kg m^2/s]."""
    deformation = deformation_of(case)
    return float(np.trace(deformation.inertia(0.0))) / 3.0 / deformation.duration


def turn_between(first: Array, second: Array) -> Array:
    """The rotation vectors from rotations (..., 3, 3) to others, in the axes of their bodies: (M, 3)."""
    return Rotation.from_matrix((np.swapaxes(first, -1, -2) @ second).reshape(-1, 3, 3)).as_rotvec()


def extrapolated(ends: Array, step: float) -> Array:
    """Derivatives (M, 3) from the ends after changes by +1, -1, +1/2 and -1/2 steps: (4, M, 3, 3) -> (M, 3)."""
    whole = turn_between(ends[1], ends[0]) / (2.0 * step)
    half = turn_between(ends[3], ends[2]) / step
    return (4.0 * half - whole) / 3.0


def neighbours(momentum: Array, attitude: Array, changes: Array, turns: Array, step: float) -> tuple[Array, Array]:
    """Momenta (4, M, 3) and starts (4, M, 3, 3) changed by +1, -1, +1/2 and -1/2 steps of changes and turns (M, 3)."""
    reach = step * np.array([1.0, -1.0, 0.5, -0.5])[:, None, None]
    turned = Rotation.from_rotvec((reach * turns).reshape(-1, 3)).as_matrix().reshape(4, -1, 3, 3)
    return momentum + reach * changes, attitude @ turned


def by_differences(motion: sp.Motion, scale: float, step: float) -> tuple[Array, Array]:
    """by_momentum times `scale` and by_attitude, from whole motions next to this one.

    All of them are one batch, on the same samples and steps, so that of their errors only rounding is left.
    """
    changes, turns = np.zeros((6, 3)), np.zeros((6, 3))
    changes[:3], turns[3:] = scale * np.eye(3), np.eye(3)
    momenta, starts = neighbours(motion.momentum, motion.initial_attitude, changes, turns, step)
    ends = sp.reconstruct(motion.deformation, momenta, starts, tolerance=motion.tolerance).final_attitude
    columns = extrapolated(ends, step)
    return columns[:3].T, columns[3:].T


def check_differences(motion: sp.Motion, scale: float, step: float) -> None:
    by_momentum, by_attitude = by_differences(motion, scale, step)
    found = motion.sensitivity
    assert np.linalg.norm(scale * found.by_momentum - by_momentum) < DIFFERENCES * np.linalg.norm(by_momentum)
    assert np.linalg.norm(found.by_attitude - by_attitude) < DIFFERENCES * np.linalg.norm(by_attitude)


# ---- Sensitivity: differences of whole motions ----------------------------------------------------------------------


@pytest.mark.parametrize("case", EVERY_CASE)
def test_sensitivity_is_the_limit_of_differences(case: str):
    motion = motion_of(case)
    check_differences(motion, momentum_scale(case), 4e-3 / np.linalg.norm(motion.sensitivity.by_attitude))


@pytest.mark.parametrize("case", EVERY_CASE)
def test_sensitivity_without_momentum(case: str):
    """Another route: by_momentum is then the integral of S I^-1 S^T, and a turned start is a turned end."""
    motion = motion_of(case, moving=False)
    check_differences(motion, momentum_scale(case), 2e-3)
    there = motion.initial_attitude.T @ motion.final_attitude
    np.testing.assert_allclose(motion.sensitivity.by_attitude, there.T, rtol=0, atol=1e-14)


@pytest.mark.parametrize("tolerance", full_but([1e-4, 1e-6, 1e-9], 1e-4, 1e-9))
@pytest.mark.parametrize("case", EVERY_CASE)
def test_sensitivity_is_as_good_as_the_motion(case: str, tolerance: float):
    tight = motion_of(case)
    loose = sp.reconstruct(tight.deformation, tight.momentum, tight.initial_attitude, tolerance=tolerance)
    for field in ("by_momentum", "by_attitude"):
        truth = getattr(tight.sensitivity, field)
        assert np.linalg.norm(getattr(loose.sensitivity, field) - truth) < tolerance * np.linalg.norm(truth)


@pytest.mark.parametrize("share", [1e-3, 1e-5, 1e-9, 1e-12, 1e-100, 1e-300])
def test_a_vanishing_momentum_answers_like_none(share: float):
    """From the steps of a moving body to the integral at rest there is no jump: two opposite momenta together are at
    rest, up to the square of their share of what turns the body by a radian.
    """
    still = motion_of("cat", moving=False)
    momentum = random_vector(4, share * momentum_scale("cat"))
    there, back = (
        sp.reconstruct(still.deformation, sign * momentum, still.initial_attitude, tolerance=TIGHT).sensitivity
        for sign in (1.0, -1.0)
    )
    near = 1e-11 + 10.0 * share**2
    for first, second, rest in (
        (there.by_attitude, back.by_attitude, still.sensitivity.by_attitude),
        (there.by_momentum, back.by_momentum, still.sensitivity.by_momentum),
    ):
        assert np.linalg.norm(0.5 * (first + second) - rest) < near * np.linalg.norm(rest)


# ---- Sensitivity: closed form and chain rule ------------------------------------------------------------------------


def symmetric_top(across: float, along: float, momentum: Array, attitude: Array, time: float) -> tuple[Array, Array]:
    """by_momentum and by_attitude of a rigid body with moments (across, across, along).

    The derivative of R = exp(t mu/across) R_0 A, where A = exp(t k Pi_3 e_3), Pi = R_0^T mu and
    k = 1/along - 1/across: a turn of the start passes through A and changes the spin by e_3 . (Pi x delta);
    the precession's derivative is that of the exponential map (Rodrigues).
    """
    rate = 1.0 / along - 1.0 / across
    start = attitude.T @ momentum
    spin = turn(UP, time * rate * start[2])
    vector = momentum * time / across
    angle = np.linalg.norm(vector)
    k = hat(vector)
    right = np.eye(3) - (1.0 - np.cos(angle)) / angle**2 * k + (angle - np.sin(angle)) / angle**3 * k @ k
    by_attitude = spin.T + time * rate * np.outer(UP, np.cross(UP, start))
    by_momentum = spin.T @ attitude.T @ right * (time / across) + time * rate * np.outer(UP, attitude @ UP)
    return by_momentum, by_attitude


@pytest.mark.parametrize(("across", "along"), [(2.0, 1.0), (1.0, 1.7)])
@pytest.mark.parametrize("time", [1.0, 30.0])
def test_sensitivity_and_amplification_of_the_symmetric_top(across: float, along: float, time: float):
    """The start's tilt changes the spin, so the end's turn grows in proportion to time: a shear, by k |Pi x e_3| t."""
    momentum, attitude = random_vector(1, 1.3), random_rotation(2)
    deformation = sp.rigid(np.diag([across, across, along]), time)
    motion = sp.reconstruct(deformation, momentum, attitude, tolerance=TIGHT)
    truth = axisymmetric_attitude(across, along, momentum, attitude, np.array([time]))[0]
    assert apart(motion.final_attitude, truth) < TIGHT
    by_momentum, by_attitude = symmetric_top(across, along, momentum, attitude, time)
    size = np.linalg.norm(by_attitude)
    assert np.linalg.norm(motion.sensitivity.by_attitude - by_attitude) < 10.0 * TIGHT * size
    assert np.linalg.norm(motion.sensitivity.by_momentum - by_momentum) < 10.0 * TIGHT * np.linalg.norm(by_momentum)
    shear = abs(1.0 / along - 1.0 / across) * np.linalg.norm(np.cross(attitude.T @ momentum, UP)) * time
    assert motion.amplification == pytest.approx(0.5 * (shear + np.hypot(shear, 2.0)), rel=0.01)


@pytest.mark.parametrize("moving", [True, False])
@pytest.mark.parametrize("case", EVERY_CASE)
def test_turning_momentum_and_start_turns_the_whole_motion(case: str, moving: bool):
    """Inertial axes are a choice: by_momentum (xi x mu) + by_attitude R(0)^T xi = R(T)^T xi for every xi."""
    motion = motion_of(case, moving=moving)
    found, mu = motion.sensitivity, motion.momentum
    for xi in np.eye(3):
        moved = found.by_momentum @ np.cross(xi, mu) + found.by_attitude @ (motion.initial_attitude.T @ xi)
        size = np.linalg.norm(found.by_momentum) * np.linalg.norm(mu) + np.linalg.norm(found.by_attitude)
        assert np.linalg.norm(moved - motion.final_attitude.T @ xi) < EXACT * size


@pytest.mark.parametrize("case", EVERY_CASE)
def test_a_turn_about_the_momentum_stays_one(case: str):
    motion = motion_of(case)
    carried = motion.sensitivity.by_attitude @ motion.body_momentum(0.0)
    size = np.linalg.norm(motion.sensitivity.by_attitude) * np.linalg.norm(motion.momentum)
    assert np.linalg.norm(carried - motion.body_momentum(motion.duration)) < EXACT * size


@pytest.mark.parametrize("share", full_but([1.0, 1e-2, 1e-4, 0.0], 1.0, 0.0))
@pytest.mark.parametrize("name", EVERY_BODY)
def test_sensitivity_of_two_motions_one_after_the_other(name: str, share: float):
    """by_attitude is the product, by_momentum that of the second part and the first one's carried through it.

    Also with a hundredth and less of the usual momentum.
    """
    joints = body_of(name).n_shape
    first, other = random_loop(1, joints), random_loop(7, joints, duration=1.3)
    joined = other.mean + first.shape(0.0) - other.shape(0.0)
    second = FourierLoop(joined, other.cosines, other.sines, other.duration)
    check_composition(name, first.path, second.path, random_vector(2, share * BODIES[name]))


@pytest.mark.parametrize(("name", "loops"), full_but([("cat", (12, 6)), ("satellite", (20, 10))], ("cat", (12, 6))))
def test_sensitivity_of_a_long_path_and_its_parts(name: str, loops: tuple[int, int]):
    """The few steps of the parts, and the many of the whole, where errors are known to grow in another way."""
    loop = random_loop(1, body_of(name).n_shape, size=0.2, duration=0.25).path
    check_composition(name, loop.repeated(loops[0]), loop.repeated(loops[1]), random_vector(2, BODIES[name]))


def check_composition(name: str, first: sp.ShapePath, second: sp.ShapePath, momentum: Array) -> None:
    body, start = body_of(name), random_rotation(3)
    whole = sp.reconstruct(sp.articulated(body, first.then(second)), momentum, start, tolerance=TIGHT)
    one = sp.reconstruct(sp.articulated(body, first), momentum, start, tolerance=TIGHT)
    two = sp.reconstruct(sp.articulated(body, second), momentum, one.final_attitude, tolerance=TIGHT)
    by_attitude = two.sensitivity.by_attitude @ one.sensitivity.by_attitude
    by_momentum = two.sensitivity.by_momentum + two.sensitivity.by_attitude @ one.sensitivity.by_momentum
    assert np.linalg.norm(whole.sensitivity.by_attitude - by_attitude) < EXACT * np.linalg.norm(by_attitude)
    assert np.linalg.norm(whole.sensitivity.by_momentum - by_momentum) < EXACT * np.linalg.norm(by_momentum)


# ---- Amplification --------------------------------------------------------------------------------------------------


def largest_growth(motion: sp.Motion) -> Array:
    return np.linalg.svd(motion.sensitivity.by_attitude, compute_uv=False)[..., 0]


@pytest.mark.parametrize("case", EVERY_CASE)
def test_amplification_covers_the_growth_to_the_end(case: str):
    motion = motion_of(case)
    assert motion.amplification >= max(1.0, 0.95 * largest_growth(motion))
    assert motion_of(case, moving=False).amplification == 1.0


@pytest.mark.parametrize("tolerance", [1e-5, 1e-9])
def test_amplification_of_a_batch_covers_the_growth_to_the_end(tolerance: float):
    """As many as are stepped on whole arrays, all but at rest to fast, also when a step may turn far."""
    random = np.random.default_rng(1)
    momenta = random.normal(size=(30, 3)) * BODIES["cat"] * np.geomspace(1e-3, 10.0, 30)[:, None]
    batch = sp.reconstruct(deformation_of("cat"), momenta, random_rotation(3), tolerance=tolerance)
    assert batch.amplification.shape == (30,)
    assert np.all(batch.amplification >= 1.0)
    assert np.all(batch.amplification >= 0.95 * largest_growth(batch))


def test_amplification_remembers_growth_that_has_gone_again():
    """A body let go beside its middle axis turns over and back: its end has forgotten what the middle amplified."""
    inertia, momentum = np.diag([1.0, 2.0, 3.0]), np.array([2e-3, 2.0, 1e-3])
    duration = 24.0
    motion = sp.reconstruct(sp.rigid(inertia, duration), momentum, tolerance=1e-8)
    parts = [sp.reconstruct(sp.rigid(inertia, duration * k / 7), momentum, tolerance=1e-8) for k in range(1, 8)]
    growths = [float(largest_growth(part)) for part in parts]
    assert max(growths) > 1.5 * growths[-1]
    assert motion.amplification >= 0.95 * max(growths)


# ---- Phases as functions of time ------------------------------------------------------------------------------------

_NODES, _WEIGHTS = leggauss(12)


@lru_cache(maxsize=16)
def curve_of(case: str) -> tuple[Array, Array, Array, Array]:
    return followed(motion_of(case), 450 if case == "long" else 120)


def followed(motion: sp.Motion, panels: int) -> tuple[Array, Array, Array, Array]:
    """Panel edges (P + 1,), and at Gauss's nodes of each panel: weights (P, 12), u = Pi/|Pi| and omega (P, 12, 3).

    The angular velocity is computed from the body, not from the samples that the integrator used.
    """
    edges = np.unique(np.concatenate([np.linspace(0.0, motion.duration, panels + 1), motion.deformation.breaks]))
    half = 0.5 * np.diff(edges)[:, None]
    times = edges[:-1, None] + half * (1.0 + _NODES)
    return edges, half * _WEIGHTS, directions(motion, times), motion.angular_velocity(times)


def running(weights: Array, values: Array) -> Array:
    """Integrals from the first edge to every edge."""
    return np.concatenate([[0.0], np.cumsum(np.sum(weights * values, axis=-1))])


def area_seen_from(reference: Array, case: str) -> Array:
    """Signed area of the momentum's curve from 0 to each edge, by the area form that is singular opposite `reference`.

    The curve by quadrature of n . (u x u')/(1 + n . u) with u' = u x omega, the great circle that closes it by
    Eriksson's formula for the triangle (n, u(t), u(0)).
    """
    motion = motion_of(case)
    edges, weights, unit, omega = curve_of(case)
    rate = np.cross(unit, np.cross(unit, omega)) @ reference / (1.0 + unit @ reference)
    return running(weights, rate) + triangle(reference, directions(motion, edges), directions(motion, [0.0]))


def directions(motion: sp.Motion, times: ArrayLike) -> Array:
    return motion.body_momentum(times) / np.linalg.norm(motion.momentum)


def triangle(reference: Array, first: Array, second: Array) -> Array:
    excess = np.cross(first, second) @ reference
    return 2.0 * np.arctan2(excess, 1.0 + np.sum(first * second, axis=-1) + (first + second) @ reference)


def modulo_sphere(area: Array) -> Array:
    """An area modulo the sphere's, nearest to zero."""
    return 2.0 * np.angle(np.exp(0.5j * np.asarray(area)))


@pytest.mark.parametrize("case", EVERY_CASE)
def test_dynamic_phase_is_the_integral_of_the_rate_about_the_momentum(case: str):
    edges, weights, unit, omega = curve_of(case)
    truth = running(weights, np.sum(unit * omega, axis=-1))
    found = motion_of(case).dynamic_phase(edges)
    assert found[0] == 0.0
    assert np.abs(found - truth).max() < PHASE


@pytest.mark.parametrize("case", EVERY_CASE)
def test_solid_angle_is_the_area_of_the_momentum_curve(case: str):
    """Modulo the sphere, with the reference, of many, that the curve's opposite keeps farthest from."""
    edges, _, unit, _ = curve_of(case)
    candidates = np.random.default_rng(1).normal(size=(500, 3))
    candidates /= np.linalg.norm(candidates, axis=1, keepdims=True)
    nearness = (unit.reshape(-1, 3) @ candidates.T).min(axis=0)
    assert nearness.max() > -0.99
    truth = area_seen_from(candidates[np.argmax(nearness)], case)
    found = motion_of(case).solid_angle(edges)
    assert found[0] == 0.0
    assert np.abs(modulo_sphere(found - truth)).max() < PHASE


@pytest.mark.parametrize("case", EVERY_CASE)
def test_phases_turn_the_start_into_the_attitude(case: str):
    """R(t) R(0)^T = exp((dynamic_phase - solid_angle) mu^) tilt(t), the great circle from Pi(t) back to Pi(0)."""
    check_reading(motion_of(case), 1e-12)


def check_reading(motion: sp.Motion, near: float) -> None:
    times = np.linspace(0.0, motion.duration, 301)
    angle = motion.dynamic_phase(times) - motion.solid_angle(times)
    axis, start = motion.momentum / np.linalg.norm(motion.momentum), motion.initial_attitude
    unit = directions(motion, times)
    closing = np.array([start @ geodesic_turn(u, unit[0]) @ start.T for u in unit])
    turns = np.array([turn(axis, phase) for phase in angle])
    assert apart(turns @ closing @ start, motion.attitude(times)) < near


def test_phases_at_the_end_of_a_step_are_free_of_the_errors_between_steps():
    """At a loose tolerance the motion's own steps are long; the split's are half as long."""
    deformation = sp.articulated(body_of("cat"), sp.examples.cat_righting())
    motion = sp.reconstruct(deformation, [0.05, 0.0, 0.1], tolerance=1e-6)
    split, end = sp.split(motion, "base"), motion.duration
    near = 1e-2 * float(motion.error_estimate)
    assert abs(motion.dynamic_phase(end) - split.dynamic_phase) < near
    assert abs(modulo_sphere(motion.solid_angle(end) - split.solid_angle)) < near
    assert motion.solid_angle(0.0) == 0.0


@pytest.mark.parametrize("size", full_but([0.1, 0.3], 0.3))
@pytest.mark.parametrize("name", EVERY_BODY)
def test_solid_angle_grows_continuously(name: str, size: float):
    """Not only modulo the sphere: seen from the start itself, while the curve keeps away from the start's opposite."""
    motion = sp.reconstruct(
        deformation_of(name), random_vector(2, size * BODIES[name]), random_rotation(3), tolerance=TIGHT
    )
    edges, weights, unit, omega = followed(motion, 120)
    start = directions(motion, [0.0])[0]
    assert (unit @ start).min() > -0.5
    # Seen from the start, the closing great circle has no area.
    rate = np.cross(unit, np.cross(unit, omega)) @ start / (1.0 + unit @ start)
    assert np.abs(motion.solid_angle(edges) - running(weights, rate)).max() < PHASE


# ---- Batches, times, other methods ----------------------------------------------------------------------------------

TIMES = (0.7, [2.0], np.array([2.0, 0.0, 1.3]), np.empty(0), np.linspace(0.0, 2.0, 6).reshape(2, 3), np.empty((2, 0)))


def batch_of(momenta: Array, attitudes: Array | None = None) -> sp.Motion:
    return sp.reconstruct(deformation_of("cat"), momenta, attitudes, tolerance=TIGHT)


def some_momenta(*batch: int) -> Array:
    return np.random.default_rng(3).normal(size=(*batch, 3)) * BODIES["cat"]


@pytest.mark.parametrize("t", TIMES, ids=lambda t: f"times{np.shape(t)}")
@pytest.mark.parametrize("batch", [(), (3,), (2, 2), (0,)], ids=lambda batch: f"batch{batch}")
@pytest.mark.parametrize("moving", [True, False])
def test_phases_have_the_axes_of_batch_and_times(t: ArrayLike, batch: tuple[int, ...], moving: bool):
    motion = batch_of(some_momenta(*batch) * moving)
    for phase in (motion.dynamic_phase, motion.solid_angle):
        values = phase(t)
        assert np.shape(values) == (*batch, *np.shape(t))
        np.testing.assert_array_equal(np.reshape(values, (*batch, np.size(t))), phase(np.ravel(t)))


@pytest.mark.parametrize("t", [-0.1, 2.1, [0.0, 3.0]])
def test_phases_outside_the_motion_are_refused(t: ArrayLike):
    for phase in (motion_of("cat").dynamic_phase, motion_of("cat").solid_angle):
        with pytest.raises(TrajectoryError, match="outside"):
            phase(t)


@pytest.mark.parametrize("count", full_but([4, 30], 4))
def test_a_batch_answers_like_its_members(count: int):
    """Few momenta are stepped one by one, many on whole arrays; the first is none at all."""
    momenta = some_momenta(count)
    momenta[0] = 0.0
    attitudes = np.stack([random_rotation(k) for k in range(count)])
    batch, times = batch_of(momenta, attitudes), np.linspace(0.0, 2.0, 21)
    dynamic, area = batch.dynamic_phase(times), batch.solid_angle(times)
    assert batch.sensitivity.by_momentum.shape == batch.sensitivity.by_attitude.shape == (count, 3, 3)
    for row in range(0, count, max(1, count // 6)):
        single = batch_of(momenta[row], attitudes[row])
        for field in ("by_momentum", "by_attitude"):
            alone = getattr(single.sensitivity, field)
            assert np.linalg.norm(getattr(batch.sensitivity, field)[row] - alone) < 1e-11 * np.linalg.norm(alone)
        assert batch.amplification[row] == pytest.approx(single.amplification, rel=0.05)
        assert np.abs(dynamic[row] - single.dynamic_phase(times)).max() < 1e-11
        assert np.abs(modulo_sphere(area[row] - single.solid_angle(times))).max() < 1e-11


def test_sensitivity_of_momenta_against_attitudes():
    momenta = np.stack([np.zeros(3), *some_momenta(2)])
    attitudes = np.stack([random_rotation(k) for k in range(2)])
    batch = batch_of(momenta[:, None], attitudes)
    assert batch.sensitivity.by_momentum.shape == batch.sensitivity.by_attitude.shape == (3, 2, 3, 3)
    for place in np.ndindex(3, 2):
        single = batch_of(momenta[place[0]], attitudes[place[1]])
        for field in ("by_momentum", "by_attitude"):
            alone = getattr(single.sensitivity, field)
            assert np.linalg.norm(getattr(batch.sensitivity, field)[place] - alone) < 1e-11 * np.linalg.norm(alone)


@pytest.mark.parametrize("momenta", [np.zeros(3), np.zeros((2, 3)), [[0.01, 0.0, 0.02], [0.0, 0.0, 0.0]]])
def test_there_is_no_phase_without_momentum(momenta: ArrayLike):
    """Neither for a body at rest alone nor for one among others that move."""
    motion, times = batch_of(np.array(momenta)), np.linspace(0.0, 2.0, 7)
    at_rest = np.linalg.norm(motion.momentum, axis=-1) == 0.0
    for phase in (motion.dynamic_phase, motion.solid_angle):
        values = phase(times)
        np.testing.assert_array_equal(values[at_rest], np.zeros_like(values[at_rest]))
        assert np.all(values[~at_rest][:, 1:] != 0.0)


def test_a_motion_by_dop853_answers_too():
    """Its phases are read on the collocation's steps, with the attitudes that DOP853 found at their ends."""
    ours = motion_of("satellite")
    theirs = sp.reconstruct(ours.deformation, ours.momentum, ours.initial_attitude, tolerance=1e-9, method="dop853")
    times = np.linspace(0.0, 2.0, 21)
    assert np.abs(theirs.dynamic_phase(times) - ours.dynamic_phase(times)).max() < 2e-9
    assert np.abs(theirs.solid_angle(times) - ours.solid_angle(times)).max() < 2e-9
    check_reading(theirs, 2e-9)
    for field in ("by_momentum", "by_attitude"):
        truth = getattr(ours.sensitivity, field)
        assert np.linalg.norm(getattr(theirs.sensitivity, field) - truth) < 1e-8 * np.linalg.norm(truth)
    assert theirs.amplification == pytest.approx(ours.amplification, rel=0.01)
