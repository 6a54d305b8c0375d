"""The one look at deformations given as functions of time: inertias, particles, parts of assemblies, gauges.

Truth is SciPy's DOP853 at 1e-13 with its own right side, begun anew wherever the functions are not smooth, and in short
steps where they are narrow.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.deformation import assembly, boom, link_gauge, moving_mass, rigid_part
from shapephase.errors import AccuracyNotReached, NoisyPathError, TrajectoryError, UndeclaredBreakWarning
from support.independent import hat
from support.long_runs import full_but

# What is computed is the same with and without machine code, which is quicker.

T = 3.0
TOLERANCE = 1e-9
MOMENTUM = np.array([0.3, 1.0, 0.5])
Array = np.ndarray
Scalar = Callable[[Array], Array]


def bump(centre: float, support: float, size: float = 1.0) -> tuple[Scalar, Scalar]:
    """Smooth, exactly zero beyond its support; and its derivative."""

    def value(t: Array) -> Array:
        x = 2.0 * (t - centre) / support
        return size * np.where(np.abs(x) < 1.0, np.exp(1.0 - 1.0 / np.maximum(1.0 - x * x, 1e-300)), 0.0)

    def slope(t: Array) -> Array:
        x = 2.0 * (t - centre) / support
        room = np.where(np.abs(x) < 1.0, 1.0 - x * x, np.inf)
        return -value(t) * 4.0 * x / (support * room**2)

    return value, slope


def nothing(t: Array) -> Array:
    return np.zeros(len(t))


def inertia(of_x: Scalar = nothing, scale: float = 1.0) -> Callable[[Array], Array]:
    """A tensor that swings and turns, with something on the entry xx."""

    def tensors(t: Array) -> Array:
        tensor = (1.0 + 0.1 * np.sin(t))[:, None, None] * np.diag([1.0, 1.3, 1.9])
        tensor[:, 0, 1] = tensor[:, 1, 0] = 0.1 * np.sin(2.0 * t)
        tensor[:, 0, 0] += of_x(t)
        return scale * tensor

    return tensors


def internal(of_x: Scalar = nothing, scale: float = 1.0) -> Callable[[Array], Array]:
    return lambda t: scale * np.stack([0.4 * np.sin(t) + of_x(t), 0.4 * np.cos(2.0 * t), 0.1 * t], axis=-1)


def attitudes(tensors, momenta, momentum: Array, edges: Sequence[float], times: Array) -> Array:
    """R(t) from R' = R hat(I^-1 (R^T momentum - L_o)), piece by piece."""

    def slope(t: float, y: Array, low: float, high: float) -> Array:
        at = np.array([np.clip(t, low, high)])
        rotation = y.reshape(3, 3)
        return (rotation @ hat(np.linalg.solve(tensors(at)[0], rotation.T @ momentum - momenta(at)[0]))).ravel()

    value, found = np.eye(3).ravel(), np.empty((len(times), 3, 3))
    for left, right in pairwise(edges):
        inside = (times >= left) & (times < right)
        ends = np.nextafter(left, right), np.nextafter(right, left)
        run = solve_ivp(
            slope, (left, right), value, "DOP853", t_eval=np.append(times[inside], right), args=ends,
            rtol=1e-13, atol=1e-14, max_step=min(0.1, (right - left) / 32.0),
        )  # fmt: skip
        found[inside], value = run.y.T[:-1].reshape(-1, 3, 3), run.y[:, -1]
    found[times == edges[-1]] = value.reshape(3, 3)
    return found


def assert_right(motion: sp.Motion, truth: Array, times: Array) -> None:
    """Within the tolerance, and one and a half estimates, which are measured; but for what DOP853 itself is off by."""
    error = np.linalg.norm(motion.attitude(times) - truth, axis=(1, 2)).max() / np.sqrt(2.0)
    assert error < min(1.5 * motion.error_estimate, motion.tolerance) + 2e-12


def solved(deformation: sp.Deformation, tolerance: float = TOLERANCE, momentum: Array = MOMENTUM) -> sp.Motion:
    return sp.reconstruct(deformation, momentum, tolerance=tolerance)


# ---- Functions of inertia and internal momentum ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("where", "share", "moves"),
    full_but(
        product(["inertia", "momentum"], [1 / 50, 1 / 500, 1 / 2000], [True, False]),
        *[("inertia", 1 / 50, True), ("momentum", 1 / 500, False)],
        *[("inertia", 1 / 2000, True), ("momentum", 1 / 2000, False)],
    ),
)
def test_a_bump_is_found_wherever_it_is(where: str, share: float, moves: bool):
    width, momentum = share * T, MOMENTUM if moves else np.zeros(3)
    for centre in np.random.default_rng(3).uniform(width, T - width, 3):
        value = bump(centre, width, 0.3 if where == "inertia" else 0.3 / width)[0]
        both = (inertia(value), internal()) if where == "inertia" else (inertia(), internal(value))
        motion = solved(sp.prescribed(*both, T), momentum=momentum)
        edges = [0.0, centre - 0.5 * width, centre, centre + 0.5 * width, T]
        times = np.array([0.3, centre, centre + 0.2 * width, 2.9, T])
        assert_right(motion, attitudes(*both, momentum, edges, np.sort(times)), np.sort(times))


def test_units_do_not_matter():
    """Of a gnat and of a ship: the same panels, breaks and evaluations."""
    scans = []
    for scale in (1e-12, 1.0, 1e9):
        value = lambda t: bump(1.1, 0.02, 0.3)[0](t) + 0.2 * np.abs(t - 2.2)  # noqa: E731
        deformation = sp.prescribed(inertia(value, scale), internal(scale=scale), T)
        with pytest.warns(UndeclaredBreakWarning):
            motion = sp.reconstruct(deformation, scale * MOMENTUM, tolerance=TOLERANCE)
        scans.append((deformation.scan, motion))
    for scan, motion in scans[1:]:
        assert str(scan) == str(scans[0][0])
        np.testing.assert_allclose(scan.found_breaks, [2.2], atol=1e-12)
        np.testing.assert_allclose(motion.final_attitude, scans[0][1].final_attitude, atol=1e-11, rtol=0)


KINKS = {
    "inertia": (inertia(lambda t: 0.3 * np.abs(t - 1.234)), internal(), 1e-12),
    "inertia at the end of a panel": (inertia(lambda t: 0.3 * np.abs(t - 1.5)), internal(), 1e-12),
    "momentum": (inertia(), internal(lambda t: np.abs(t - 1.234)), 1e-8),
    "jump of the momentum": (inertia(), internal(lambda t: np.where(t < 1.234, 0.0, 0.3)), 1e-14),
}


@pytest.mark.parametrize("name", KINKS)
def test_a_kink_is_named_and_becomes_a_break(name: str):
    tensors, momenta, near = KINKS[name]
    where = 1.5 if "panel" in name else 1.234
    deformation = sp.prescribed(tensors, momenta, T)
    with pytest.warns(UndeclaredBreakWarning, match="deformation") as caught:
        motion = solved(deformation)
    assert len(caught) == 1
    np.testing.assert_allclose(deformation.breaks, [0.0, where, T], atol=near)
    np.testing.assert_array_equal(deformation.declared_breaks, [0.0, T])
    times = np.array([0.4, 1.3, T])
    assert_right(motion, attitudes(tensors, momenta, MOMENTUM, [0.0, where, T], times), times)


def test_a_found_break_is_used_by_all_that_asks_for_breaks():
    """The rate of the inertia on both sides, and the worst time of the triangle inequality, which is the kink."""
    peak = 1.2345678
    tensors = lambda t: np.diag([1.0, 1.3, 1.9]) + (0.4 - 0.3 * np.abs(t - peak))[:, None, None] * np.diag([0, 0, 1.0])  # noqa: E731
    deformation = sp.prescribed(tensors, None, T)
    with pytest.warns(UndeclaredBreakWarning):
        defect, when = deformation.triangle_defect()
    assert when == pytest.approx(peak, abs=1e-9)
    assert defect == pytest.approx((2.3 - 2.3) / 2.3, abs=1e-9)
    rates = deformation.inertia_rate([peak - 1e-6, peak + 1e-6])[:, 2, 2]
    np.testing.assert_allclose(rates, [0.3, -0.3], atol=1e-9)
    assert deformation.scan is deformation.scan


def test_an_inertia_jumps_only_where_that_is_declared():
    tensors = inertia(lambda t: 0.3 * (t > 1.234))
    with pytest.raises(TrajectoryError, match="I_xx"):
        solved(sp.prescribed(tensors, internal(), T))
    times = np.array([0.4, 1.3, T])
    motion = solved(sp.prescribed(tensors, internal(), T, [1.234]))
    assert_right(motion, attitudes(tensors, internal(), MOMENTUM, [0.0, 1.234, T], times), times)


@pytest.mark.parametrize("where", ["inertia I_xx", "internal momentum L_x"])
def test_noise_is_told_from_roughness(where: str):
    rng = np.random.default_rng(4)

    def on_x(level: float, rate: float) -> tuple:
        value = lambda t: level * rng.normal(size=len(t)) + rate * np.sin(t / max(rate, 1e-300))  # noqa: E731
        return (inertia(value), internal()) if "inertia" in where else (inertia(), internal(value))

    unit = r"kg m\^2 " if "inertia" in where else r"kg m\^2/s "
    with pytest.raises(NoisyPathError, match=rf"noisy: the {where} scatters by .* {unit}near t = .* s"):
        solved(sp.prescribed(*on_x(1e-5, 0.0), T))
    with pytest.raises(AccuracyNotReached, match="near"):
        solved(sp.prescribed(*on_x(0.0, 1e-7), T))
    # What is near rounding is left to the tolerance.
    assert solved(sp.prescribed(*on_x(1e-14, 0.0), T), 1e-8).error_estimate < 1e-8


def test_the_look_is_one_call_and_is_kept():
    calls: list[int] = []

    def counted(t: Array) -> Array:
        calls.append(len(t))
        return inertia()(t)

    deformation = sp.prescribed(counted, internal(), T)
    before = len(calls)
    scan = deformation.scan
    assert scan is not None
    assert len(calls) == before + 1
    assert 5000 < scan.evaluations == calls[-1] < 6000
    first = solved(deformation)
    second = solved(deformation, momentum=2.0 * MOMENTUM)
    assert sum(calls[before + 1 :]) < 1.2 * (first.evaluations + second.evaluations) + 100


def test_constant_functions_and_known_kinds():
    still = sp.prescribed(lambda t: np.stack([np.diag([1.0, 1.3, 1.9])] * len(t)), None, T)
    np.testing.assert_allclose(
        solved(still).final_attitude, solved(sp.rigid(np.diag([1.0, 1.3, 1.9]), T)).final_attitude, atol=1e-10
    )
    # Without internal momentum an inertia that moves is not at rest.
    moved = inertia(bump(1.1, 0.3, 0.5)[0])
    times = np.array([1.0, 1.2, T])
    truth = attitudes(moved, lambda t: np.zeros((len(t), 3)), MOMENTUM, [0.0, 0.95, 1.25, T], times)
    assert_right(solved(sp.prescribed(moved, None, T)), truth, times)
    samples = np.random.default_rng(2).normal(size=(9, 5, 3))
    for known in (sp.rigid(np.eye(3), T), sp.particles(np.ones(5), (np.linspace(0.0, T, 9), samples))):
        assert known.scan is None


# ---- Particles ------------------------------------------------------------------------------------------------------


def cloud(count: int, moved: tuple[Scalar, Scalar] = (nothing, nothing), spoilt: float = 0.0, offset: float = 0.0):
    """Particles that swing along straight lines; the last has something more; velocities of it may be too large."""
    rng = np.random.default_rng(count)
    at, way, masses = rng.normal(size=(count, 3)), 0.3 * rng.normal(size=(count, 3)), rng.uniform(0.5, 2.0, count)
    phase = rng.uniform(0.0, 6.0, count)

    def motion(t: Array) -> tuple[Array, Array]:
        swing = np.sin(1.3 * t[:, None] + phase), 1.3 * np.cos(1.3 * t[:, None] + phase)
        points, speeds = at + offset + swing[0][:, :, None] * way, swing[1][:, :, None] * way
        points[:, -1, 0] += moved[0](t)
        speeds[:, -1, 0] += moved[1](t)
        speeds[:, -1] *= 1.0 + spoilt * bump(1.3, 0.4)[0](t)[:, None]
        return points, speeds

    def tensors(t: Array) -> Array:
        points, _ = motion(t)
        points = points - (masses @ points / masses.sum())[:, None]
        second = np.einsum("m,nmi,nmj->nij", masses, points, points)
        return np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second

    def momenta(t: Array) -> Array:
        points, speeds = motion(t)
        points = points - (masses @ points / masses.sum())[:, None]
        return np.einsum("m,nmi->ni", masses, np.cross(points, speeds - (masses @ speeds / masses.sum())[:, None]))

    return masses, motion, tensors, momenta


@pytest.mark.parametrize(
    ("count", "share"), full_but(product([4, 60], [1 / 100, 1 / 2000]), (4, 1 / 100), (60, 1 / 2000))
)
def test_particles_with_a_bump(count: int, share: float):
    width = share * T
    masses, motion, tensors, momenta = cloud(count, bump(1.234, width, 0.3))
    deformation = sp.particles(masses, motion, T)
    edges, times = [0.0, 1.234 - 0.5 * width, 1.234, 1.234 + 0.5 * width, T], np.array([1.0, 1.234, 2.0, T])
    assert_right(solved(deformation), attitudes(tensors, momenta, MOMENTUM, edges, times), times)
    assert deformation.scan is not None
    assert deformation.scan.rate_defect < 1e-9


@pytest.mark.parametrize("count", [4, 60], ids=["each", "sums"])
def test_particles_with_a_kink_or_a_jump(count: int):
    masses, motion, tensors, momenta = cloud(
        count, (lambda t: 0.3 * np.abs(t - 1.234), lambda t: 0.3 * np.sign(t - 1.234))
    )
    with pytest.warns(UndeclaredBreakWarning, match="function"):
        found = solved(sp.particles(masses, motion, T))
    assert found.deformation.breaks == pytest.approx([0.0, 1.234, T], abs=1e-13)
    times = np.array([1.0, 1.3, T])
    assert_right(found, attitudes(tensors, momenta, MOMENTUM, [0.0, 1.234, T], times), times)
    masses, motion, *_ = cloud(count, (lambda t: 0.3 * (t > 1.234), nothing))
    for breaks in ((), (1.234,)):
        with pytest.raises(TrajectoryError, match="jumps"):
            solved(sp.particles(masses, motion, T, breaks))


@pytest.mark.parametrize("count", [4, 60], ids=["each", "sums"])
@pytest.mark.parametrize("offset", [0.0, 1e4])
def test_velocities_that_are_not_those_of_the_positions(count: int, offset: float):
    """Of one particle, for a while, by a part in a thousand; also far from the origin."""
    masses, motion, *_ = cloud(count, spoilt=1e-3, offset=offset)
    said = "the velocity .* of particle 3 along" if count == 4 else "the rate .* of sum"
    with pytest.raises(TrajectoryError, match=rf"positions gives {said} .* at 1\.\d* s, but its positions change"):
        solved(sp.particles(masses, motion, T))
    masses, motion, *_ = cloud(count, offset=offset)
    assert solved(sp.particles(masses, motion, T), 1e-8).error_estimate < 1e-8


def test_a_grain_of_dust_may_be_noisy():
    """What scatters is judged by what it does to the attitude: not at all at a millionth of a millionth of the mass."""
    rng = np.random.default_rng(1)
    masses, motion, *_ = cloud(4)

    def noisy(t: Array) -> tuple[Array, Array]:
        points, speeds = motion(t)
        points[:, 3] += 1e-5 * rng.normal(size=(len(t), 3))
        return points, speeds

    light = masses * [1.0, 1.0, 1.0, 1e-12]
    assert solved(sp.particles(light, noisy, T)).error_estimate < TOLERANCE
    with pytest.raises(NoisyPathError, match="position"):
        solved(sp.particles(masses, noisy, T))


# ---- Assemblies -----------------------------------------------------------------------------------------------------


def driven(value: Scalar, slope: Scalar, size: Sequence[float], at: Sequence[float]) -> sp.ShapePath:
    return sp.ShapePath.function(
        lambda t: (np.array(at) + value(t)[:, None] * size, slope(t)[:, None] * np.array(size)), T
    )


@pytest.mark.full
def test_an_assembly_is_looked_at_through_all_its_parts():
    """A mass on a known path, one with a bump, and a boom with a kink, against the same as prescribed functions."""
    known = sp.ShapePath.waypoints([0.0, 1.1, T], [[0.2, 0.0, 1.0], [1.0, 0.5, 0.0], [0.2, 0.0, 1.0]])
    width = T / 1000.0
    bumped = driven(*bump(0.789, width), [0.0, 0.4, 0.1], [1.0, -1.0, 0.3])
    kinked = driven(lambda t: np.abs(t - 2.345), lambda t: np.sign(t - 2.345), [0.3], [0.5])
    whole = assembly(
        rigid_part(20.0, np.diag([3.0, 4.0, 5.0])),
        [moving_mass(2.0, known), moving_mass(1.0, bumped), boom(3.0, 2.0, [0.5, 0.0, 0.0], [0.0, 1.0, 1.0], kinked)],
    )
    with pytest.warns(UndeclaredBreakWarning, match="parts"):
        motion = solved(whole)
    np.testing.assert_allclose(whole.breaks, [0.0, 1.1, 2.345, T], atol=1e-13)
    edges, times = [0.0, 0.789 - 0.5 * width, 0.789, 0.789 + 0.5 * width, 1.1, 2.345, T], np.array([0.5, 0.789, 2.4, T])
    sampled = lambda k: lambda t: whole.description.sample(t)[k]  # noqa: E731
    assert_right(motion, attitudes(sampled(0), sampled(1), MOMENTUM, edges, times), times)
    assert whole.scan is not None
    assert whole.scan.evaluations > 5000


def test_a_part_of_an_assembly_that_jumps_is_named():
    jumping = driven(lambda t: 1.0 * (t > 0.777), nothing, [0.0, 0.4, 0.1], [1.0, -1.0, 0.3])
    whole = assembly(rigid_part(20.0, np.diag([3.0, 4.0, 5.0])), [moving_mass(1.0, jumping)])
    with pytest.raises(TrajectoryError, match="jumps"):
        solved(whole)


# ---- Gauges ---------------------------------------------------------------------------------------------------------

AXIS = np.array([0.6, 0.0, 0.8])


def frame(value: Scalar, slope: Scalar):
    """A frame that turns about one axis by sin t and something more."""
    return lambda t: (
        Rotation.from_rotvec((np.sin(t) + value(t))[:, None] * AXIS).as_matrix(),
        (np.cos(t) + slope(t))[:, None] * AXIS,
    )


def gauged(deformation: sp.Deformation, given: str, value: Scalar, slope: Scalar) -> sp.Deformation:
    u = frame(value, slope)
    if given == "rates":
        return sp.in_gauge(deformation, rates=lambda t: u(t)[1], start=u(np.zeros(1))[0][0])
    return sp.in_gauge(deformation, u if given == "both" else lambda t: u(t)[0])


def swinging_cat(shapes: tuple[Scalar, Scalar] = (nothing, nothing)) -> sp.Deformation:
    body = sp.load_body("cat_two_halves")
    size = np.linspace(0.5, 0.8, body.n_shape)

    def swings(t: Array) -> tuple[Array, Array]:
        return (np.sin(2.0 * t) + shapes[0](t))[:, None] * size, (2.0 * np.cos(2.0 * t) + shapes[1](t))[:, None] * size

    return sp.articulated(body, sp.ShapePath.function(swings, T))


@pytest.mark.parametrize("given", ["both", "alone", "rates"])
@pytest.mark.parametrize("share", [1 / 100, 1 / 1500])
def test_a_bump_of_a_frame_leaves_the_motion_as_it_is(given: str, share: float):
    """B4: the attitude seen from there is R U^T; the body may have a bump of its own at another time."""
    momentum = np.array([0.02, 0.01, 0.03])
    plain = swinging_cat(bump(0.5, 2.0 * share * T, 0.3))
    value, slope = bump(1.7, share * T, 0.3)
    seen = gauged(plain, given, value, slope)
    start = frame(value, slope)(np.zeros(1))[0][0]
    one = sp.reconstruct(plain, momentum, tolerance=TOLERANCE)
    two = sp.reconstruct(seen, momentum, start.T, tolerance=TOLERANCE)
    times = np.array([0.5, 1.0, 1.7, 1.7 + 0.2 * share * T, 2.5, T])
    apart = two.attitude(times) @ frame(value, slope)(times)[0] - one.attitude(times)
    assert np.abs(apart).max() < one.error_estimate + two.error_estimate + 1e-11
    assert seen.scan is not None


@pytest.mark.parametrize("given", ["both", "alone", "rates"])
def test_a_kink_of_a_frame_becomes_a_break(given: str):
    momentum = np.array([0.02, 0.01, 0.03])
    plain = swinging_cat()
    value, slope = (lambda t: 0.3 * np.abs(t - 1.234)), (lambda t: 0.3 * np.sign(t - 1.234))
    with pytest.warns(UndeclaredBreakWarning, match="declared") as caught:
        seen, found = (there := gauged(plain, given, value, slope)), there.breaks
    np.testing.assert_allclose(found, [0.0, 1.234, T], atol=1e-11)
    assert len(caught) == 1
    start = frame(value, slope)(np.zeros(1))[0][0]
    one = sp.reconstruct(plain, momentum, tolerance=TOLERANCE)
    two = sp.reconstruct(seen, momentum, start.T, tolerance=TOLERANCE)
    times = np.array([1.0, 1.3, T])
    apart = two.attitude(times) @ frame(value, slope)(times)[0] - one.attitude(times)
    assert np.abs(apart).max() < one.error_estimate + two.error_estimate + 1e-11


def test_a_frame_that_jumps_or_has_wrong_rates_for_a_while_is_refused():
    plain = swinging_cat()
    with pytest.raises(TrajectoryError, match="jumps"):
        _ = gauged(plain, "both", lambda t: 0.3 * (t > 1.234), nothing).breaks
    with pytest.raises(TrajectoryError, match="rate"):
        _ = gauged(plain, "both", nothing, bump(1.234, 0.01, 1e-3)[0]).scan


def test_found_kinks_of_a_path_are_breaks_of_its_deformations_and_gauges():
    """Of a loop in every round; and what the path hides is not hidden from a gauge that follows from the body."""
    shapes = (lambda t: 0.3 * np.abs(t - 1.5), lambda t: 0.3 * np.sign(t - 1.5))
    plain = swinging_cat(shapes)
    with pytest.warns(UndeclaredBreakWarning):
        np.testing.assert_allclose(plain.breaks, [0.0, 1.5, T], atol=1e-13)
    hiding = swinging_cat(bump(1.234, T / 1500.0, 0.3))
    one = sp.reconstruct(hiding, [0.02, 0.01, 0.03], tolerance=TOLERANCE)
    there = link_gauge(hiding, hiding.description.body.link_names[-1])
    two = sp.reconstruct(there, [0.02, 0.01, 0.03], there.frame(0.0).T, tolerance=TOLERANCE)
    times = np.array([1.0, 1.234, 2.0, T])
    apart = two.attitude(times) @ there.frame(times) - one.attitude(times)
    assert np.abs(apart).max() < one.error_estimate + two.error_estimate + 1e-11


def test_a_frame_over_a_long_recording_is_sampled_densely_enough_without_a_look():
    body = sp.load_body("cat_two_halves")
    times = np.linspace(0.0, T, 2401)
    path = sp.ShapePath.spline(times, np.sin(2.0 * times)[:, None] * np.linspace(0.5, 0.8, body.n_shape))
    plain = sp.articulated(body, path)
    value, slope = bump(1.7, T / 1500.0, 0.3)
    seen = gauged(plain, "both", value, slope)
    assert seen.scan is None
    momentum, at = np.array([0.02, 0.01, 0.03]), np.array([1.0, 1.7, 2.5, T])
    start = frame(value, slope)(np.zeros(1))[0][0]
    one = sp.reconstruct(plain, momentum, tolerance=1e-7)
    two = sp.reconstruct(seen, momentum, start.T, tolerance=1e-7)
    apart = two.attitude(at) @ frame(value, slope)(at)[0] - one.attitude(at)
    assert np.abs(apart).max() < one.error_estimate + two.error_estimate + 1e-11


def test_a_split_in_a_frame_with_a_burst_is_that_of_the_frame_without():
    """A frame that ends as it began closes the motion as the base does: the same phase."""
    body = sp.load_body("cat_two_halves")
    swing, size = 2.0 * np.pi / T, np.linspace(0.5, 0.8, body.n_shape)
    loop = sp.ShapePath.function(
        lambda t: (np.sin(swing * t)[:, None] * size, swing * np.cos(swing * t)[:, None] * size), T
    )
    motion = sp.reconstruct(sp.articulated(body, loop), [0.02, 0.01, 0.03], tolerance=TOLERANCE)
    plain = sp.split(motion, "base")
    value, slope = bump(1.234, T / 1500.0, 0.3)
    burst = sp.split(
        motion, lambda t: (Rotation.from_rotvec(value(t)[:, None] * AXIS).as_matrix(), slope(t)[:, None] * AXIS)
    )
    assert burst.residual < 1e-9
    apart = plain.montgomery_phase - burst.montgomery_phase
    assert np.sin(0.5 * apart) == pytest.approx(0.0, abs=1e-9)
    assert plain.dynamic_phase != pytest.approx(burst.dynamic_phase, abs=1e-6)
