"""The gyrostat in closed form, against 50 digits, the integrator, and counts of its steady rotations."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import ShapeError
from shapephase.rigid_body import bifurcation_rotors, dual_spin_turn, gyrostat_equilibria
from support import gyrostat_reference
from support.independent import assert_within

EPS = np.finfo(float).eps
PER_CONDITION = 1e-14


@pytest.fixture(scope="module")
def reference():
    return np.load(gyrostat_reference.FILE)


def rotating(inertia, rotor, duration):
    def tensor(t):
        return np.broadcast_to(inertia, (len(t), 3, 3))

    def momentum(t):
        return np.broadcast_to(np.asarray(rotor, float), (len(t), 3))

    return sp.prescribed(tensor, momentum, duration)


@pytest.mark.parametrize("rows", [slice(0, 100, 5), pytest.param(slice(0, 100), marks=pytest.mark.full)])
def test_a_hundred_attitudes_are_those_of_50_digits(reference, rows):
    """Rotors about any axis; the first twenty start on a separatrix, as near as doubles can be."""
    ends = []
    reference = {name: reference[name][rows] if reference[name].ndim else reference[name] for name in reference.files}
    for inertia, rotor, momentum in zip(reference["inertia"], reference["rotor"], reference["momentum"], strict=True):
        ends.append(sp.Gyrostat(inertia, rotor, momentum).attitude(float(reference["duration"])))
    off = np.abs(np.array(ends) - reference["attitude"]).max(axis=(1, 2))
    assert len(off) in (20, 100)
    assert np.all(off < PER_CONDITION * reference["condition"])


def test_the_frozen_attitudes_solve_the_equations(reference):
    some = (reference[name][::4] for name in ("inertia", "rotor", "momentum"))
    rough = gyrostat_reference.plain_attitudes(*some, float(reference["duration"]), steps=300)
    off = np.abs(rough - reference["attitude"][::4]).max(axis=(1, 2))
    assert np.all(off < 1e-7 * reference["condition"][::4])


def test_half_periods_are_counted_where_the_sine_is_exactly_zero():
    """Among neighbouring doubles is one at which it is; the angle there was once without the last half period."""
    found = 0
    for sign in (1.0, -1.0):
        top = sp.Gyrostat(np.diag([11.0, 12.0, 1.0]), [sign * 60.0, 0.0, 0.0], [0.0, 80.0, 0.0])
        orbit = top._orbit
        for half in range(-3, 4):
            near = (half * orbit.half_period * orbit.rate - orbit.phase) / orbit.rate
            times = near + np.arange(-40, 41) * np.spacing(abs(near) + 1e-3)
            found += np.count_nonzero(sp.elliptic.jacobi(orbit.rate * times + orbit.phase, orbit.complement)[0] == 0.0)
            quat = top.quat_xyzw(times)
            assert np.abs(quat - quat[0]).max() < 1e-11
    assert found > 3


@pytest.mark.parametrize("case", [0, 25, pytest.param(slice(5, 100, 5), marks=pytest.mark.full)])
def test_it_is_what_reconstruct_integrates(reference, case):
    rows = np.arange(100)[case] if isinstance(case, slice) else [case]
    for row in rows:
        inertia, rotor, momentum = (reference[name][row] for name in ("inertia", "rotor", "momentum"))
        start = sp.so3.exp([0.3, -0.2, 0.9])
        top, times = sp.Gyrostat(inertia, rotor, momentum, start), np.linspace(0.0, 6.0, 5)
        motion = sp.reconstruct(rotating(inertia, rotor, 6.0), momentum, start, tolerance=1e-11)
        goal = 2e-11 + PER_CONDITION * reference["condition"][row]
        for ask in ("attitude", "body_momentum", "angular_velocity"):
            assert_within(getattr(top, ask)(times), getattr(motion, ask)(times), goal)


@pytest.mark.parametrize(
    ("moments", "rotor", "regime"),
    [
        ((1.0, 1.3, 1.7), (0.0, 0.0, 0.0), "one of two ovals"),
        ((1.3, 1.3, 1.3), (0.2, -0.3, 0.4), "circle"),
        ((1.0, 1.0, 1.7), (0.0, 0.0, 0.4), "circle"),
        ((1.0, 1.7, 1.7), (0.3, 0.0, 0.0), "circle"),
        ((1.0, 1.0, 1.7), (0.5, 0.2, 0.4), "one oval"),
        ((1.0, 1.3, 1.7), (0.0, 0.0, 0.4), None),
    ],
)
def test_symmetric_bodies_and_rotors_along_axes(moments, rotor, regime):
    inertia, momentum = np.diag(moments), np.array([0.3, -0.8, 0.6])
    top, times = sp.Gyrostat(inertia, rotor, momentum), np.linspace(-6.0, 6.0, 7)
    assert regime is None or top.regime == regime
    motion = sp.reconstruct(rotating(inertia, rotor, 6.0), momentum, tolerance=1e-12)
    assert_within(top.attitude(times[3:]), motion.attitude(times[3:]), 2e-12)
    turned = np.swapaxes(top.attitude(times), 1, 2) @ momentum
    assert_within(top.body_momentum(times), turned, 100 * EPS)


def test_without_a_rotor_it_is_the_euler_top():
    inertia, momentum, times = np.diag([3.0, 2.0, 1.0]), [0.6, 0.3, 1.5], np.linspace(-20.0, 20.0, 9)
    top, known = sp.Gyrostat(inertia, np.zeros(3), momentum), sp.EulerTop(inertia, momentum)
    assert_within(top.attitude(times), known.attitude(times), 500 * EPS)
    assert top.period == pytest.approx(known.period, rel=100 * EPS)
    assert np.exp(1j * top.phase) == pytest.approx(np.exp(1j * known.montgomery_phase), abs=500 * EPS)


def test_its_phase_is_the_turn_about_the_momentum_in_a_period(reference):
    for row in (25, 40, 60, 80):
        inertia, rotor, momentum = (reference[name][row] for name in ("inertia", "rotor", "momentum"))
        top = sp.Gyrostat(inertia, rotor, momentum)
        about = sp.so3.exp(top.phase * momentum / np.linalg.norm(momentum))
        late = top.attitude(top.period + 0.7)
        assert_within(late, about @ top.attitude(0.7), 1e-11)
        # Dynamic phase less the solid angle, as `split` finds it.
        found = sp.split(sp.reconstruct(rotating(inertia, rotor, top.period), momentum), "base")
        assert np.exp(1j * top.phase) == pytest.approx(np.exp(1j * found.montgomery_angle), abs=1e-8)


@pytest.mark.parametrize(
    "rotor", [(0.1, 0.05, 0.15), (0.4, 0.3, 0.2), (1.0, 2.0, 1.0), (0.0, 0.3, 0.2), (0.0, 0.0, 0.5)]
)
def test_steady_rotations_are_all_found_with_their_stability(rotor):
    """Against the extremes of the energy on a fine mesh of the sphere: least and most; Euler counts the saddles."""
    inertia = np.diag([1.0, 1.5, 2.2])
    found = gyrostat_equilibria(inertia, rotor, 1.0)
    kinds = [one.stability for one in found]
    for one in found:
        omega = np.linalg.solve(inertia, one.direction - rotor)
        assert_within(omega, one.rate * one.direction, 100 * EPS)
        assert sp.Gyrostat(inertia, rotor, one.direction).period > 1e3 or one.stability != "saddle"
    assert kinds.count("saddle") == len(found) - kinds.count("saddle") - 2
    lat, lon = np.meshgrid(np.linspace(0.0, np.pi, 181)[1:-1], np.linspace(0.0, 2.0 * np.pi, 361)[:-1], indexing="ij")
    mesh = np.stack([np.sin(lat) * np.cos(lon), np.sin(lat) * np.sin(lon), np.cos(lat)], axis=-1)
    energy = 0.5 * np.sum((mesh - rotor) ** 2 / np.diag(inertia), axis=-1)
    inner = energy[1:-1]
    around = [np.roll(energy, s, axis=1)[1 + r : len(energy) - 1 + r] for s in (-1, 0, 1) for r in (-1, 0, 1) if s or r]
    lowest = sum(bool(v) for v in np.all(inner < np.array(around), axis=0).ravel())
    highest = sum(bool(v) for v in np.all(inner > np.array(around), axis=0).ravel())
    poles = sum(abs(abs(one.direction[2]) - 1.0) < 1e-3 and one.stability != "saddle" for one in found)
    assert lowest + highest + poles == len(found) - kinds.count("saddle")


def test_small_motions_go_at_the_rates_of_the_steady_rotations():
    inertia, rotor = np.diag([1.0, 1.5, 2.2]), np.array([0.1, 0.05, 0.15])
    for one in gyrostat_equilibria(inertia, rotor, 1.0):
        if one.stability != "saddle":
            near = one.direction + 3e-3 * np.array([0.3, -0.5, 0.2])
            top = sp.Gyrostat(inertia, rotor, near / np.linalg.norm(near))
            assert 2.0 * np.pi / top.period == pytest.approx(one.frequency, rel=1e-4)


@pytest.mark.parametrize("axis", [(1.0, 0.7, 0.4), (0.0, 1.0, 0.5), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
def test_the_number_of_steady_rotations_changes_at_the_bifurcations(axis):
    inertia, unit = np.diag([1.0, 1.5, 2.2]), np.array(axis) / np.linalg.norm(axis)
    places = bifurcation_rotors(inertia, axis)
    counts = [
        len(gyrostat_equilibria(inertia, size * unit, 1.0))
        for place in places
        for size in (place * (1.0 - 1e-6), place * (1.0 + 1e-6))
    ]
    assert counts == [6, 4, 4, 2]


@pytest.mark.parametrize(("moments", "axis"), [([1.0, 1.0, 2.0], 2), ([1.0, 2.0, 2.0], 0)])
def test_steady_rotations_of_a_symmetric_body_turn_with_the_rotor(moments, axis):
    """A turn about the axis of symmetry changes nothing else; with the rotor in a principal plane one term vanishes."""
    rotor = np.where(np.arange(3) == axis, 0.15, [0.0, 0.2, 0.0])
    turn = sp.so3.exp(0.7 * np.eye(3)[axis])
    plain, turned = (gyrostat_equilibria(np.diag(moments), h, 1.0) for h in (rotor, turn @ rotor))
    assert len(plain) == len(turned) == 4
    for one, other in zip(plain, turned):
        assert other.direction == pytest.approx(turn @ one.direction, abs=1e-14)
        assert (other.stability, other.rate) == (one.stability, pytest.approx(one.rate, rel=1e-13))


def test_a_dual_spin_turn_is_what_a_slow_rotor_makes():
    """The rate of the rotor's momentum is small beside those of the body, and so is what is left of nutation."""
    inertia, axis, duration = np.diag([1.0, 1.5, 2.2]), np.array([0.6, 0.3, 0.5]), 400.0
    unit = axis / np.linalg.norm(axis)
    turn = dual_spin_turn(inertia, axis, 1.0, 401)
    assert_within(turn.direction[[0, -1]], [[0.0, 0.0, 1.0], unit], 10 * EPS)
    middle = len(turn.rotor) // 3
    steady = gyrostat_equilibria(inertia, turn.rotor[middle] * unit, 1.0)[0]
    assert_within(steady.direction, turn.direction[middle], 100 * EPS)

    def rotor(t):
        return np.sin(0.5 * np.pi * t / duration)[:, None] ** 2 * unit

    def tensor(t):
        return np.broadcast_to(inertia, (len(t), 3, 3))

    motion = sp.reconstruct(sp.prescribed(tensor, rotor, duration), [0.0, 0.0, 1.0], tolerance=1e-6)
    times = np.linspace(0.0, duration, 41)
    along = np.array(
        [np.interp(np.sin(0.5 * np.pi * times / duration) ** 2, turn.rotor, turn.direction[:, k]) for k in range(3)]
    ).T
    assert np.abs(motion.body_momentum(times) - along).max() < 0.05


def test_a_rigid_diver_with_a_rotor_goes_stage_by_stage():
    """Bharadwaj, Duignan, Dullin, Leung and Tong 2016: a somersault, the rotor runs, the twist, the rotor stops.

    Each stage is a gyrostat that begins with the attitude at the end of the last one.
    """
    inertia, momentum = np.diag([20.0, 21.0, 1.0]), np.array([0.0, 120.0, 0.0])
    stages = [((0.0, 0.0, 0.0), 0.3), ((40.0, 0.0, 0.0), 0.25), ((0.0, 0.0, 0.0), 0.8), ((40.0, 0.0, 0.0), 0.25)]
    attitude = sp.so3.exp([0.02, 0.0, 0.01])
    begin = attitude
    for rotor, length in stages:
        attitude = sp.Gyrostat(inertia, rotor, momentum, attitude).attitude(length)
    legs = begin
    for rotor, length in stages:
        legs = sp.reconstruct(rotating(inertia, rotor, length), momentum, legs, tolerance=1e-11).final_attitude
    assert_within(attitude, legs, 2e-9)


def test_wrong_arguments_are_refused():
    inertia = np.diag([1.0, 1.5, 2.2])
    for ask in (
        lambda: sp.Gyrostat(inertia, [0.1, 0.2], [1.0, 0.0, 0.0]),
        lambda: sp.Gyrostat(inertia, np.zeros(3), [1.0, 0.0, 0.2]).attitude(1e14),
        lambda: bifurcation_rotors(inertia, np.zeros(3)),
        lambda: dual_spin_turn(inertia, [1.0, 0.0, 0.0], 1.0),
    ):
        with pytest.raises(ShapeError):
            ask()
