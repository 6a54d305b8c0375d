"""A small body in gravity: Kepler's orbits, Newton's torque in 50 digits, the estimate against a full simulation."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.bounds import (
    GravityTorque,
    KeplerOrbit,
    eccentric_anomaly,
    gravity_force,
    gravity_gradient_torque,
    gravity_torque_estimate,
)
from shapephase.errors import AccuracyNotReached, ShapeError, ShapePhaseError
from support.independent import cross
from support.long_runs import full_but

EARTH = 3.986004418e14
MASSES = np.array([1.0, 0.7, 1.3, 0.4])
POINTS = np.array([[0.5, 0.1, -0.2], [-0.4, 0.6, 0.1], [0.2, -0.5, 0.7], [0.1, 0.3, -0.9]])
CENTRED = POINTS - MASSES @ POINTS / MASSES.sum()


def inertia_of(masses, points):
    return sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True))


INERTIA = inertia_of(MASSES, CENTRED)


# ---- Orbits ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("e", [0.0, 1e-9, 0.1, 0.5, 0.9, 0.999, 1 - 1e-9, 1 + 1e-9, 1.001, 1.5, 8.0])
def test_keplers_equation_is_solved_to_rounding(e):
    """A16: against 50 digits, from tiny anomalies on; relative to E itself."""
    mean = np.array([0.0, 1e-14, 1e-9, 1e-5, 1e-3, 0.1, 0.9, 2.0, 3.0, 3.14])
    found = eccentric_anomaly(mean, e)
    with mpmath.workdps(50):
        for m, start in zip(mean, found, strict=True):
            want = mpmath.mpf(float(start))
            for _ in range(60):
                if e < 1:
                    want -= (want - e * mpmath.sin(want) - mpmath.mpf(m)) / (1 - e * mpmath.cos(want))
                else:
                    want -= (e * mpmath.sinh(want) - want - mpmath.mpf(m)) / (e * mpmath.cosh(want) - 1)
            assert abs(start - want) <= 4e-16 * abs(want), (e, m)
    np.testing.assert_array_equal(eccentric_anomaly(-mean, e), -found)
    if e < 1:
        with mpmath.workdps(50):
            for m in mean + 10 * np.pi:
                turned = mpmath.mpf(float(eccentric_anomaly(m, e)))
                # One spacing of the anomaly's doubles, which is 7e-15 there.
                assert abs(turned - e * mpmath.sin(turned) - mpmath.mpf(float(m))) <= 2e-14


ORBITS = [
    ([7e6, 0.0, 0.0], [0.0, 7546.0, 100.0]),
    ([7e6, 1e6, -2e6], [-1000.0, 5000.0, 6000.0]),
    ([7e6, 1e6, -2e6], [-3000.0, -8000.0, 1000.0]),
    ([7e6, 0.0, 0.0], [3000.0, 12000.0, 1000.0]),
    ([7e6, 0.0, 0.0], [-11000.0, 1000.0, 2000.0]),
]


@pytest.mark.parametrize(("position", "velocity"), ORBITS)
def test_the_orbit_is_the_solution_of_newtons_equation_a16(position, velocity):
    """Both ways in time, against DOP853 on r'' = -gm r/|r|^3; ellipses and hyperbolas."""
    centre = np.array([1e6, -2e6, 3e6])
    orbit = KeplerOrbit.from_state(np.add(position, centre), velocity, EARTH, centre)
    np.testing.assert_allclose(orbit.position(0.0), np.add(position, centre), rtol=1e-14)
    np.testing.assert_allclose(orbit.velocity(0.0), velocity, rtol=0, atol=1e-14 * 1e4)

    def newton(_, y):
        return np.concatenate([y[3:], -EARTH * y[:3] / np.linalg.norm(y[:3]) ** 3])

    scale = np.repeat([7e6, 7e3], 3)
    for end in (9000.0, -7000.0):
        times = np.linspace(0.0, end, 7)
        run = solve_ivp(newton, (0.0, end), [*position, *velocity], "DOP853", times, rtol=3e-14, atol=1e-14 * scale)
        assert np.abs(orbit.position(times) - centre - run.y[:3].T).max() < 3e-11 * np.abs(run.y[:3]).max()
        assert np.abs(orbit.velocity(times) - run.y[3:].T).max() < 3e-11 * np.abs(run.y[3:]).max()


@pytest.mark.parametrize(("position", "velocity"), ORBITS)
def test_an_orbit_keeps_energy_momentum_and_the_eccentricity_vector(position, velocity):
    orbit = KeplerOrbit.from_state(position, velocity, EARTH)
    t = np.linspace(-2e4, 2e4, 50)
    r, v = orbit.position(t), orbit.velocity(t)
    distance = np.linalg.norm(r, axis=-1)
    energy = 0.5 * np.sum(v * v, axis=-1) - EARTH / distance
    np.testing.assert_allclose(
        energy, -0.5 * EARTH / orbit.semi_major_axis, rtol=0, atol=2e-14 * EARTH / distance.min()
    )
    swept = np.cross(r, v)
    np.testing.assert_allclose(swept, np.broadcast_to(np.cross(position, velocity), r.shape), rtol=0, atol=1e-13 * 1e11)
    vector = np.cross(v, swept) / EARTH - r / distance[:, None]
    np.testing.assert_allclose(
        vector, np.broadcast_to(orbit.eccentricity * orbit.axes[:, 0], r.shape), rtol=0, atol=1e-12
    )
    if orbit.eccentricity < 1:
        np.testing.assert_allclose(orbit.position(t + orbit.period), r, rtol=0, atol=1e-12 * np.abs(r).max())
        np.testing.assert_allclose(orbit.period**2 / orbit.semi_major_axis**3, 4 * np.pi**2 / EARTH, rtol=1e-14)
    else:
        assert orbit.period == np.inf


def test_an_orbit_from_elements_is_the_one_from_its_state():
    """The rotations are SciPy's; the state at the pericentre is the textbook one."""
    for axis, e in ((8e6, 0.0), (8e6, 0.3), (-9e6, 1.7)):
        angles = (0.4, 1.1, -0.7)
        orbit = KeplerOrbit.from_elements(axis, e, *angles, 0.6, EARTH)
        turn = Rotation.from_euler("ZXZ", [angles[1], angles[0], angles[2]]).as_matrix()
        at = -0.6 / orbit.mean_motion
        near, fast = axis * (1 - e), np.sqrt(EARTH * (1 + e) / (axis * (1 - e)))
        np.testing.assert_allclose(orbit.position(at), near * turn[:, 0], rtol=0, atol=1e-14 * abs(axis) * 5)
        np.testing.assert_allclose(orbit.velocity(at), fast * turn[:, 1], rtol=0, atol=1e-13 * 1e4)
        again = KeplerOrbit.from_state(orbit.position(0.0), orbit.velocity(0.0), EARTH)
        assert again.semi_major_axis == pytest.approx(axis, rel=1e-13)
        t = np.linspace(0, 5000, 5)
        np.testing.assert_allclose(again.position(t), orbit.position(t), rtol=0, atol=1e-12 * 3e7)


def test_times_whose_digits_are_lost_are_refused():
    """An ellipse after 1e10 radians, a hyperbola where its numbers overflow; not before."""
    for position, velocity in ORBITS:
        orbit = KeplerOrbit.from_state(position, velocity, EARTH)
        for t in (1e308, -1e308, 1e160):
            with pytest.raises(AccuracyNotReached, match="digits"):
                orbit.position(t)
    assert np.isfinite(orbit.position(1e140)).all()
    with pytest.raises(ShapeError, match="position"):
        gravity_gradient_torque(np.eye(3), [1e-200, 0.0, 0.0], 1.0)


def test_impossible_orbits_are_refused():
    for make, said in (
        (lambda: KeplerOrbit.from_state([7e6, 0, 0], [100.0, 0, 0], EARTH), "straight"),
        (lambda: KeplerOrbit.from_state([7e6, 0, 0], [0, 0, 0], EARTH), "straight"),
        (lambda: KeplerOrbit.from_state([0, 0, 0], [0, 100.0, 0], EARTH), "straight"),
        (lambda: KeplerOrbit.from_state([2.0, 0, 0], [0, 1.0, 0], 1.0), "parabola"),
        (lambda: KeplerOrbit.from_elements(1.0, 1.0, 0, 0, 0, 0, 1.0), "parabola"),
        (lambda: KeplerOrbit.from_elements(1.0, 1.5, 0, 0, 0, 0, 1.0), "hyperbola"),
        (lambda: KeplerOrbit.from_elements(-1.0, 0.5, 0, 0, 0, 0, 1.0), "hyperbola"),
        (lambda: KeplerOrbit.from_elements(1.0, -0.5, 0, 0, 0, 0, 1.0), "eccentricity"),
        (lambda: KeplerOrbit.from_elements(1.0, 0.5, 0, 0, 0, 0, -1.0), "gm"),
        (lambda: KeplerOrbit.from_elements(1.0, np.nan, 0, 0, 0, 0, 1.0), "elements"),
        (lambda: KeplerOrbit.from_state(np.ones((2, 3)), [0, 1, 0], 1.0), "position"),
        (lambda: eccentric_anomaly(0.1, -0.1), "eccentricity"),
        (lambda: eccentric_anomaly(np.nan, 0.1), "mean_anomaly"),
        (lambda: gravity_gradient_torque(np.eye(3), [0.0, 0.0, 0.0], 1.0), "position"),
        (lambda: gravity_force(1.0, [0.0, 0.0, 0.0], 1.0), "position"),
    ):
        with pytest.raises(ShapePhaseError, match=said):
            make()


# ---- Newton's torque ------------------------------------------------------------------------------------------------


def exact_torque(masses, points, position, gm):
    """Sum of rho x (-gm m (r + rho)/|r + rho|^3) in 50 digits, and the textbook's first term in 50 digits."""
    with mpmath.workdps(50):
        r = [mpmath.mpf(float(x)) for x in position]
        total_mass = sum(mpmath.mpf(float(m)) for m in masses)
        rows = [[mpmath.mpf(float(x)) for x in p] for p in points]
        ms = [mpmath.mpf(float(m)) for m in masses]
        centre = [sum(m * p[k] for m, p in zip(ms, rows, strict=True)) / total_mass for k in range(3)]
        rows = [[p[k] - centre[k] for k in range(3)] for p in rows]

        def cross(a, b):
            return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

        exact, first = [mpmath.mpf(0)] * 3, [mpmath.mpf(0)] * 3
        r2 = sum(x * x for x in r)
        for m, p in zip(ms, rows, strict=True):
            there = [a + b for a, b in zip(r, p, strict=True)]
            d2 = sum(x * x for x in there)
            pull = [-gm * m * x / (d2 * mpmath.sqrt(d2)) for x in there]
            exact = [a + b for a, b in zip(exact, cross(p, pull), strict=True)]
            # n x I n is minus the sum of m (n.p) (n x p).
            dot = sum(a * b for a, b in zip(r, p, strict=True))
            term = [-3 * gm * m * dot * x / (r2 * r2 * mpmath.sqrt(r2)) for x in cross(r, p)]
            first = [a + b for a, b in zip(first, term, strict=True)]
        gap = mpmath.sqrt(sum((a - b) ** 2 for a, b in zip(exact, first, strict=True)))
        size = mpmath.sqrt(sum(a * a for a in first))
        return np.array([float(x) for x in exact]), np.array([float(x) for x in first]), float(gap / size)


DIRECTION = np.array([0.48, -0.6, 0.64])


@pytest.mark.parametrize(("symmetric", "order"), [(False, 1), (True, 2)])
def test_the_exact_torque_tends_to_the_gravity_gradient_a16(symmetric, order):
    """The relative remainder is in proportion to size/r over three decades; to its square for a body that is its own
    mirror image in its centre, where the third moments vanish.
    """
    masses, points = (np.tile(MASSES, 2), np.concatenate([POINTS, -POINTS])) if symmetric else (MASSES, POINTS)
    ratios = []
    for distance in (1e2, 1e3, 1e4, 1e5):
        exact, first, remainder = exact_torque(masses, points, distance * DIRECTION, 1)
        centred = points - masses @ points / masses.sum()
        library = gravity_gradient_torque(inertia_of(masses, centred), distance * DIRECTION, 1.0)
        size = float(np.linalg.norm(first))
        assert np.linalg.norm(library - first) < 1e-13 * size
        assert np.linalg.norm(library - exact) == pytest.approx(remainder * size, abs=1e-13 * size)
        ratios.append(remainder * distance**order)
    assert 0.05 < ratios[-1] < 20.0
    # The factor before (size/r)^order settles: its own correction falls with size/r.
    assert abs(ratios[0] / ratios[-1] - 1) < 0.1
    assert abs(ratios[1] / ratios[-1] - 1) < 0.01
    assert abs(ratios[2] / ratios[-1] - 1) < 0.001


def test_the_torque_law_is_batched_and_follows_the_axes_a16():
    rng = np.random.default_rng(5)
    turn = Rotation.random(6, rng=rng).as_matrix()
    positions = rng.normal(size=(6, 3)) * 1e3
    want = np.einsum("nij,nj->ni", turn, gravity_gradient_torque(INERTIA, positions, 2.5))
    there = turn @ INERTIA @ np.swapaxes(turn, 1, 2)
    found = gravity_gradient_torque(there, np.einsum("nij,nj->ni", turn, positions), 2.5)
    np.testing.assert_allclose(found, want, rtol=0, atol=1e-13 * np.abs(want).max())
    np.testing.assert_allclose(
        gravity_gradient_torque(3.0 * np.eye(3), positions, 2.5), np.zeros((6, 3)), rtol=0, atol=1e-20
    )


def test_the_force_has_the_cube_of_the_distance_c_e14():
    """Remark 4.7 prints (r_CM - P)^3, which has no meaning for a vector; the slope of gm m/|r| decides."""
    position = np.array([3.0, -2.0, 5.0])
    with mpmath.workdps(30):
        slope = [
            mpmath.diff(
                lambda x, k=k: 7 * 2 / mpmath.sqrt(sum((position[j] if j != k else x) ** 2 for j in range(3))), x0
            )
            for k, x0 in enumerate(position)
        ]
    want = np.array([float(x) for x in slope])
    np.testing.assert_allclose(gravity_force(2.0, position, 7.0), want, rtol=1e-14)
    printed = -7.0 * 2.0 / position**3 * position
    assert np.abs(printed - want).max() > 0.1 * np.abs(want).max()
    np.testing.assert_allclose(gravity_force(2.0, 3 * position, 7.0), want / 9, rtol=1e-14)


def test_equal_accelerations_make_no_torque_a16():
    """Remark 4.7: with F_i = m_i g(r_CM) the torque about the centre vanishes whatever the shape."""
    forces = np.array([gravity_force(m, [1e3, 2e3, -5e2], EARTH) for m in MASSES])
    torque = np.sum(np.cross(CENTRED, forces), axis=0)
    assert np.abs(torque).max() < 1e-15 * np.abs(forces).max()


# ---- The estimate against a full simulation -------------------------------------------------------------------------


def breathing(t, size=1.0):
    """Positions, velocities and accelerations of a body that changes its shape without symmetry."""
    rate = np.array([0.9, 1.3, 0.7, 1.1])[:, None] * np.array([1.0, 0.8, 1.2])
    phase = rate * np.asarray(t)[:, None, None] + np.arange(12).reshape(4, 3)
    return (
        size * (POINTS + 0.1 * np.sin(phase)),
        size * 0.1 * rate * np.cos(phase),
        -size * 0.1 * rate**2 * np.sin(phase),
    )


def still(t, size=1.0):
    at = np.broadcast_to(size * CENTRED, (len(t), 4, 3))
    return at, 0 * at, 0 * at


def newtonian(shape, orbit, momentum, duration, times):
    """All particles in the central field, their shape as prescribed, in double precision about the orbit.

    State: centre of mass, its velocity, angular momentum about it, attitude. Nothing is linearised: each particle
    feels its own force, taken relative to the one at the centre of mass without loss of digits.
    """
    share = MASSES / MASSES.sum()

    def forces(r, arms):
        # (r + rho)/|r + rho|^3 - r/|r|^3 without cancellation (Battin's function).
        q = np.sum(arms * (2 * r + arms), axis=-1) / (r @ r)
        f = q * (3 + 3 * q + q * q) / (1 + (1 + q) ** 1.5)
        return -orbit.gm / np.linalg.norm(r) ** 3 * (arms - (f / (1 + q) ** 1.5)[:, None] * (r + arms))

    def slope(t, y):
        r, v, spatial, attitude = y[:3], y[3:6], y[6:9], y[9:].reshape(3, 3)
        points, speeds, _ = (part[0] for part in shape(np.array([t])))
        points, speeds = points - share @ points, speeds - share @ speeds
        arms = points @ attitude.T
        tides = forces(r, arms)
        inner = np.einsum("m,mi->i", MASSES, np.cross(points, speeds))
        omega = np.linalg.solve(inertia_of(MASSES, points), attitude.T @ spatial - inner)
        return np.concatenate(
            [
                v,
                -orbit.gm * r / np.linalg.norm(r) ** 3 + share @ tides,
                np.sum(MASSES[:, None] * np.cross(arms, tides), axis=0),
                (attitude @ np.cross(np.eye(3), omega) * 1.0).ravel(),
            ]
        )

    start = np.concatenate([orbit.position(0.0), orbit.velocity(0.0), momentum, np.eye(3).ravel()])
    run = solve_ivp(slope, (0, duration), start, "DOP853", times, rtol=1e-12, atol=1e-13)
    assert run.success
    return run.y[:3].T, run.y[6:9].T, run.y[9:].T.reshape(-1, 3, 3)


@pytest.mark.parametrize("shape", full_but([still, breathing], breathing))
@pytest.mark.parametrize("momentum", [pytest.param((0.4, -0.3, 0.9), marks=pytest.mark.full), (0.02, 0.01, -0.03)])
def test_the_estimate_is_what_the_full_simulation_shows_a16(shape, momentum):
    """The orbit decouples to (size/r)^2, the attitude leaves the free motion by the estimate, to its first order."""
    duration = 30.0
    orbit = KeplerOrbit.from_elements(2e4, 0.2, 0.5, 0.3, 0.2, 0.1, 1e9)
    deformation = sp.particles(MASSES, lambda t: shape(t)[:2], duration)
    motion = sp.reconstruct(deformation, momentum, tolerance=1e-10)
    found = gravity_torque_estimate(motion, orbit)
    times = np.linspace(0, duration, 601)
    position, spatial, attitude = newtonian(shape, orbit, momentum, duration, times)
    away = np.linalg.norm(position - orbit.position(times), axis=-1).max()
    assert away < 2e4 * (1.0 / 2e4) ** 2
    turned = attitude @ np.swapaxes(motion.attitude(times), 1, 2)
    angle = np.linalg.norm(Rotation.from_matrix(turned).as_rotvec(), axis=-1).max()
    change = np.linalg.norm(spatial - momentum, axis=-1).max()
    # The next terms: the torque's (size/r, 1e-4 here), the estimate's own steps, and its square.
    slack = 1e-3 + 20 * found.attitude_error
    assert found.attitude_error > 1e-6
    assert found.attitude_error == pytest.approx(angle, rel=slack)
    assert found.impulse == pytest.approx(change, rel=slack)
    at = motion.attitude(times)
    body = np.einsum("nji,nj->ni", at, orbit.position(times))
    want = np.linalg.norm(gravity_gradient_torque(deformation.inertia(times), body, 1e9), axis=-1).max()
    assert found.largest_torque == pytest.approx(want, rel=1e-3)


def test_the_estimate_against_the_linear_equation_integrated_otherwise_a16(monkeypatch):
    """dmu' = torque, eps' = R I^-1 R^T (dmu + mu x eps), with DOP853 and dense attitudes: to the estimate's 1e-5."""
    orbit = KeplerOrbit.from_state([0.0, 3e3, 1e3], [400.0, 0.0, 100.0], 1e9, centre=[1e3, 0.0, 0.0])
    mu = np.array([0.4, -0.3, 0.9])
    motion = sp.reconstruct(sp.rigid(INERTIA, 6.0), mu, tolerance=1e-11)
    found = gravity_torque_estimate(motion, orbit, tolerance=1.0)

    def slope(t, y):
        turn = motion.attitude(t)
        n = orbit.position(t) - [1e3, 0.0, 0.0]
        distance = np.linalg.norm(n)
        there = turn @ INERTIA @ turn.T
        torque = 3e9 / distance**5 * cross(n, there @ n)
        return np.concatenate([torque, np.linalg.solve(there, y[:3] + cross(mu, y[3:]))])

    run = solve_ivp(slope, (0, 6), np.zeros(6), "DOP853", np.linspace(0, 6, 1201), rtol=1e-9, atol=1e-14)
    assert found.impulse == pytest.approx(np.linalg.norm(run.y[:3], axis=0).max(), rel=1e-5)
    assert found.attitude_error == pytest.approx(np.linalg.norm(run.y[3:], axis=0).max(), rel=1e-5)
    assert found.tolerance == 1.0
    monkeypatch.setattr("shapephase.bounds.gravity_gradient._CHUNK", 7)
    other = sp.reconstruct(sp.rigid(INERTIA, 6.0), mu, tolerance=1e-9, method="dop853")
    assert gravity_torque_estimate(other, orbit).attitude_error == pytest.approx(found.attitude_error, rel=1e-4)


def test_is_the_body_free_enough_a16():
    """A satellite on a low orbit is not to 1e-9 in a minute, and is to a degree; far away it is."""
    motion = sp.reconstruct(sp.rigid(np.diag([10.0, 14.0, 20.0]), 60.0), [1.0, 2.0, 3.0])
    low = KeplerOrbit.from_elements(7e6, 0.001, 0.9, 0.3, 0.2, 0.1, EARTH)
    far = KeplerOrbit.from_elements(7e10, 0.001, 0.9, 0.3, 0.2, 0.1, EARTH)
    near = gravity_torque_estimate(motion, low)
    assert isinstance(near, GravityTorque)
    assert near.tolerance == 1e-9
    assert not near.is_free
    assert gravity_torque_estimate(motion, low, np.radians(1.0)).is_free
    assert gravity_torque_estimate(motion, far).is_free
    assert 1e-6 < near.largest_torque <= 1.5 * EARTH / 6.993e6**3 * 10.0
    ball = gravity_torque_estimate(sp.reconstruct(sp.rigid(2.0 * np.eye(3), 60.0), [1.0, 2.0, 3.0]), low)
    assert ball.attitude_error < 1e-18
    assert ball.is_free


def test_the_estimate_refuses_what_it_cannot_do():
    orbit = KeplerOrbit.from_elements(7e6, 0.0, 0.9, 0.3, 0.2, 0.1, EARTH)
    rigid = sp.rigid(INERTIA, 1.0)
    with pytest.raises(ShapeError, match="batch"):
        gravity_torque_estimate(sp.reconstruct(rigid, np.eye(3)), orbit)
    with pytest.raises(ValueError, match="tolerance"):
        gravity_torque_estimate(sp.reconstruct(rigid, [0.0, 0.0, 1.0]), orbit, tolerance=0.0)
    hasty = KeplerOrbit.from_elements(1.0, 0.9, 0.0, 0.0, 0.0, 0.0, 1e16)
    with pytest.raises(AccuracyNotReached, match="fast"):
        gravity_torque_estimate(sp.reconstruct(rigid, [0.0, 0.0, 1.0]), hasty)
