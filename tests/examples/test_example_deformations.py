"""The examples of Cabrera's section 4.2 against closed forms, other descriptions and SciPy on the raw equations."""

from __future__ import annotations

from itertools import pairwise

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import shapephase as sp
from shapephase import so3
from shapephase.bounds.energy import energy_along
from shapephase.bounds.regimes import regime_certificate
from shapephase.errors import ShapeError, TrajectoryError, UnknownNameError, UnphysicalInertiaError
from shapephase.examples import (
    EXAMPLES,
    Scale,
    astronaut,
    axial_as_printed,
    axial_stretch,
    cat,
    dipole_antenna,
    expansion,
    first_loop,
    furniture,
    homothety,
    printed_antenna,
    pulsation,
    regime_crossing,
    rigid_body,
    slow_antenna,
)
from shapephase.inertia_tensor import triangle_defect
from shapephase.phases.phases import arc_phases
from shapephase.rigid_body import EulerTop

# What is computed is the same with and without machine code, which is quicker.

TURN = so3.exp(np.array([0.3, -0.7, 0.4]))
TILTED = TURN @ np.diag([1.0, 1.4, 2.1]) @ TURN.T


def motion_of(example, tolerance=1e-12):
    return sp.reconstruct(example.deformation, example.momentum, tolerance=tolerance)


def raw_motion(inverse, momentum, times, kinks=()):
    """R and Pi from R' = R hat(I^-1 R^T mu), by SciPy; `inverse` is a function of one time."""
    values = np.empty((len(times), 3, 3))
    y = np.eye(3).ravel()
    for left, right in pairwise([0.0, *kinks, times[-1]]):
        inside = (times >= left) & (times <= right)
        run = solve_ivp(
            lambda t, y: (y.reshape(3, 3) @ so3.hat(inverse(t) @ y.reshape(3, 3).T @ momentum)).ravel(),
            (left, right),
            y,
            "DOP853",
            rtol=3e-14,
            atol=1e-14,
            dense_output=True,
        )
        values[inside] = run.sol(times[inside]).T.reshape(-1, 3, 3)
        y = run.y[:, -1]
    return values, so3.apply(so3.transpose(values), np.broadcast_to(momentum, (len(times), 3)))


def assert_known(example, motion, bound=1e-10):
    times = np.linspace(0.0, motion.duration, 57)
    gaps = so3.angle(so3.transpose(example.known.attitude(times)) @ motion.attitude(times))
    assert gaps.max() < bound
    assert np.abs(example.known.body_momentum(times) - motion.body_momentum(times)).max() < bound


def phase_gap(phase, motion):
    """Modulo 2 pi, against the phase and against the attitude itself."""
    read_off = so3.angle_about(motion.final_attitude, motion.momentum / np.linalg.norm(motion.momentum))
    split = sp.split(motion, "base")
    assert split.momentum_gap < 1e-10
    return max(abs(so3.wrap(phase - split.montgomery_phase)), abs(so3.wrap(phase - read_off)))


def energy(example, motion, times):
    inverse = np.linalg.inv(example.deformation.inertia(times))
    momentum = motion.body_momentum(times)
    return 0.5 * np.einsum("ni,nij,nj->n", momentum, inverse, momentum)


def moments_of(example, times):
    return np.diagonal(example.deformation.inertia(times), axis1=1, axis2=2)


# ---- F1: homothety --------------------------------------------------------------------------------------------------

HOMOTHETIES = {
    "pulsation": {},
    "expansion": {"scale": expansion(0.05)},
    "tilted tensor": {"inertia": TILTED, "momentum": TURN @ [0.5, -0.7, -3.0], "scale": pulsation(-0.3, 2.0)},
    "about the smallest moment": {"momentum": (3.5, 0.4, 0.3)},
    "axisymmetric": {"inertia": np.diag([1.0, 1.0, 1.6]), "momentum": (0.8, 0.0, 3.0)},
}


@pytest.mark.parametrize("name", HOMOTHETIES)
def test_a_growing_body_moves_as_the_rigid_one_in_its_own_time_f1(name):
    example = homothety(**HOMOTHETIES[name])
    motion = motion_of(example, 5e-12)
    assert_known(example, motion)
    assert example.phase == example.rigid.montgomery_phase
    assert phase_gap(example.phase, motion) < 1e-10
    assert np.all(example.deformation.internal_momentum(np.linspace(0.0, motion.duration, 9)) == 0.0)


def test_the_phase_is_the_rigid_one_and_the_area_its_own_f1():
    """The dynamic phase is 2 f(Pi) T_RB/l, the solid angle the rigid body's: both halves, not the sum alone."""
    example = homothety()
    split = sp.split(motion_of(example), "base")
    assert split.dynamic_phase == pytest.approx(example.rigid.dynamic_phase, abs=1e-11)
    assert split.solid_angle == pytest.approx(example.rigid.solid_angle, abs=1e-11)
    assert abs(example.deformation.duration - example.rigid.period) > 0.01


@pytest.mark.parametrize("scale", [pulsation(), pulsation(-0.8, 1.3), expansion(), expansion(2.0)])
def test_the_clock_is_the_integral_of_the_inverse_square_f1(scale):
    for end in (0.3, 2.9, 7.0):
        exact = sum(
            quad(lambda t: float(scale.factor(t)) ** -2, *piece, epsabs=1e-14)[0]
            for piece in pairwise(np.linspace(0.0, end, 9))
        )
        assert float(scale.clock(np.array(end))) == pytest.approx(exact, rel=1e-13)


def test_a_body_that_expands_for_ever_turns_by_a_finite_angle_f1():
    example = homothety(expansion(0.5), duration=1e5)
    last = example.rigid.attitude(2.0)
    assert so3.angle(example.known.attitude(1e5).T @ last) < 2.0 * 3.2 / (0.5 * 1e5 * 0.5)
    with pytest.raises(TrajectoryError, match="duration"):
        homothety(expansion(0.5))


# ---- F2: bodies with a symmetry axis --------------------------------------------------------------------------------

AXIAL = {"as printed": axial_as_printed, "stretch": axial_stretch}


@pytest.mark.parametrize("name", AXIAL)
@pytest.mark.parametrize("momentum", [(3.0, 0.8, 0.6), (-2.0, 1.5, 0.9)])
def test_the_closed_form_is_the_motion_f2(name, momentum):
    example = AXIAL[name](momentum=momentum)
    motion = motion_of(example, 3e-12)
    assert_known(example, motion)
    assert phase_gap(example.phase, motion) < 1e-10
    times = np.linspace(0.0, motion.duration, 21)
    attitude, _ = raw_motion(lambda t: np.linalg.inv(example.deformation.inertia(t)), example.momentum, times)
    assert np.abs(example.known.attitude(times) - attitude).max() < 3e-12


@pytest.mark.parametrize("name", AXIAL)
def test_pi_goes_by_the_rigid_body_in_its_own_time_and_the_phase_does_not_f2(name):
    """Example 4.4: Pi = Pi_RB(sigma), sigma the integral of 1/I_1 − 1/I_2 over its value at the start."""
    example = AXIAL[name]()
    motion = motion_of(example)
    start = moments_of(example, np.zeros(1))[0]
    with mpmath.workdps(20):
        for t in np.linspace(0.0, motion.duration, 4)[1:]:

            def slip(s):
                one, two, _ = np.diagonal(example.deformation.inertia(float(s)))
                return mpmath.mpf(1.0 / one - 1.0 / two)

            sigma = float(mpmath.quad(slip, mpmath.linspace(0, t, 5)) / (1.0 / start[0] - 1.0 / start[1]))
            assert np.abs(example.rigid.body_momentum(sigma) - motion.body_momentum(t)).max() < 1e-10
    assert sigma == pytest.approx(example.rigid.period, rel=1e-12)
    assert abs(so3.wrap(example.phase - example.rigid.montgomery_phase)) > 0.3


def test_the_phase_as_printed_is_the_rate_times_another_time_f2():
    """l T/I_2 with the time of its own loop, l T_RB/I_2 for the rigid body."""
    example = axial_as_printed()
    size = np.linalg.norm(example.momentum)
    assert example.phase == pytest.approx(size * example.deformation.duration / 1.5, rel=1e-14)
    assert so3.wrap(example.rigid.montgomery_phase - size * example.rigid.period / 1.5) == pytest.approx(0, abs=1e-12)
    assert example.deformation.duration < 0.95 * example.rigid.period


def test_a_cylinder_is_what_its_moments_say_f2b():
    example = axial_stretch(3.0, 0.4, 1.2, speed=0.25, duration=4.0)
    for t in (0.0, 1.7, 4.0):
        length = 1.2 + 0.25 * t
        along = 3.0 / length * float(mpmath.quad(lambda x: x**2, [-length / 2, length / 2]))
        across = float(mpmath.quad(lambda r: 3.0 * 2.0 * r**3 / 0.4**2, [0, 0.4])) / 2.0
        inertia = example.deformation.inertia(t)
        np.testing.assert_allclose(inertia, np.diag([2.0 * across, across + along, across + along]), atol=1e-14, rtol=0)
    assert example.deformation.triangle_defect()[0] < 0.0


def test_a_true_stretch_goes_round_at_the_corrected_rate_c_e13():
    """Example 4.4 speaks of a stretch along the axis: I_1 stays. Pi goes round at Pi_1 (1/I(t) − 1/I_1)."""
    example = axial_stretch()
    motion = motion_of(example)
    one = moments_of(example, np.zeros(1))[0, 0]
    for t in (1.0, 3.0, 6.0):
        momentum, omega = motion.body_momentum(t), motion.angular_velocity(t)
        rate = np.cross(momentum, omega)
        azimuth_rate = (momentum[1] * rate[2] - momentum[2] * rate[1]) / (momentum[1] ** 2 + momentum[2] ** 2)
        moments = moments_of(example, np.array([t]))[0]
        assert moments[0] == one
        assert azimuth_rate == pytest.approx(momentum[0] * (1.0 / moments[1] - 1.0 / one), rel=1e-11)
        printed = momentum[0] * (1.0 / moments[1] - 1.0 / moments_of(example, np.zeros(1))[0, 1])
        assert abs(azimuth_rate - printed) > 0.2 * abs(azimuth_rate)


# ---- C-E13: which printed examples no body can follow ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "limit", "fine"),
    [
        (
            lambda end, **more: axial_as_printed(2.0, 1.5, expansion_rate=end / 2.0 - 1.0, duration=1.0, **more),
            3.0,
            2.9,
        ),
        (lambda end, **more: printed_antenna(1, grown=end, **more), 3.5, 3.4),
        (lambda end, **more: printed_antenna(3, grown=end, **more), 2.5, 2.4),
    ],
    ids=["F2 beyond 2 I_2", "F3 beyond I_2 + I_3", "F4 beyond I_1 + I_2"],
)
def test_as_printed_the_triangle_inequality_fails_c_e13(make, limit, fine):
    assert make(fine).deformation.triangle_defect()[0] < 0.0
    assert make(limit).deformation.triangle_defect()[0] == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(UnphysicalInertiaError):
        make(limit + 0.1)
    beyond = make(limit + 0.1, on_unphysical="allow").deformation
    assert triangle_defect(beyond.inertia(0.0)) < 0.0
    assert triangle_defect(beyond.inertia(beyond.duration)) > 0.02


@pytest.mark.parametrize("name", EXAMPLES)
def test_what_is_shipped_is_a_body_c_e13(name):
    assert EXAMPLES[name]().deformation.triangle_defect()[0] < 1e-12


# ---- F3, F4, E11: the antenna as printed ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "example", [printed_antenna(1), printed_antenna(3), regime_crossing()], ids=["F3", "F4", "E11"]
)
def test_the_energy_falls_by_half_the_printed_rate_f3_f4(example):
    """C-E7: dE/dt = Pi_k² d(1/I_k)/dt / 2, in 4.1.1 printed without the half; and the energy falls to the coast."""
    motion = motion_of(example)
    end = example.deformation.breaks[1]
    times = np.linspace(0.0, end * (1.0 - 1e-9), 2001)
    values = energy(example, motion, times)
    assert np.all(np.diff(values) < 0.0)
    assert np.ptp(energy(example, motion, np.linspace(end, motion.duration, 101))) < 1e-12
    inverse = np.linalg.inv(example.deformation.inertia(times))
    slope = np.gradient(np.diagonal(inverse, axis1=1, axis2=2), times, axis=0, edge_order=2)
    integrand = np.sum(motion.body_momentum(times) ** 2 * slope, axis=-1)
    total = np.trapezoid(integrand, times)
    assert 0.5 * total == pytest.approx(values[-1] - values[0], rel=1e-5)
    assert abs(total / (values[-1] - values[0]) - 2.0) < 1e-4


@pytest.mark.parametrize("name", ["antenna_along_1", "antenna_along_3", "regime_crossing", "dipole_antenna"])
def test_the_raw_equations_say_the_same_f3_f4(name):
    example = EXAMPLES[name]()
    motion = motion_of(example)
    times = np.linspace(0.0, motion.duration, 31)
    kink = example.deformation.breaks[1]
    attitude, momentum = raw_motion(
        lambda t: np.linalg.inv(example.deformation.inertia(t)), example.momentum, times, [kink]
    )
    assert np.abs(motion.attitude(times) - attitude).max() < 3e-12
    assert np.abs(motion.body_momentum(times) - momentum).max() < 3e-12


def test_printed_antenna_passes_from_axis_1_to_axis_3_with_the_order_kept_f3():
    example = printed_antenna(1)
    motion = motion_of(example)
    times = np.linspace(0.0, motion.duration, 1001)
    moments = moments_of(example, times)
    assert np.all(np.diff(moments, axis=1) > 0.0)
    values, threshold = energy(example, motion, times), 0.5 * example.momentum @ example.momentum / 1.5
    assert values[0] > 1.15 * threshold
    assert values[-1] < 0.99 * threshold
    assert example.rigid.orbit.circled == 0
    after = times > 5.0
    momentum = motion.body_momentum(times)
    assert np.ptp(np.sign(momentum[after, 2])) == 0
    assert np.ptp(np.sign(momentum[after, 0])) == 2
    late = EulerTop.principal(moments[-1], motion.body_momentum(5.0))
    assert late.orbit.circled == 2
    np.testing.assert_allclose(momentum[after], late.body_momentum(times[after] - 5.0), atol=1e-11, rtol=0)


@pytest.mark.parametrize("seed", range(6))
def test_printed_antenna_stays_about_axis_3_f4(seed):
    """I_3 grows, I_1 and I_2 stay: energy falls, its limit l²/(2 I_2) stays."""
    rng = np.random.default_rng(seed)
    one, two, three = np.sort(rng.uniform(1.0, 2.0, 3))
    top = EulerTop.principal([one, two, three], rng.normal(size=3))
    while top.orbit.circled != 2:
        top = EulerTop.principal([one, two, three], rng.normal(size=3))
    grown = rng.uniform(three, one + two)
    example = printed_antenna(
        3, (one, two, three), grown=grown, momentum=top.momentum, extension_time=rng.uniform(1, 9)
    )
    motion = motion_of(example, 1e-10)
    times = np.linspace(0.0, motion.duration, 2001)
    assert np.all(energy(example, motion, times) < 0.5 * top.magnitude**2 / two)
    assert np.all(motion.body_momentum(times)[:, 2] * top.momentum[2] > 0.0)


def test_case_3_crosses_under_the_triangle_cap_e11():
    example = regime_crossing()
    motion = motion_of(example)
    values = energy(example, motion, np.array([0.0, 0.2, motion.duration]))
    assert values == pytest.approx([0.48189, 0.33610, 0.33610], abs=5e-6)
    threshold = 0.5 * example.momentum @ example.momentum / 1.05
    assert threshold == pytest.approx(0.47619, abs=5e-6)
    moments = moments_of(example, np.linspace(0.0, 0.2, 11))
    np.testing.assert_allclose(moments[[0, -1]], [[1.0, 1.05, 1.06], [1.0, 1.05, 2.05]], atol=1e-15, rtol=0)
    assert np.all(np.diff(moments, axis=1) > 0.0)
    late = motion.body_momentum(np.linspace(0.2, motion.duration, 801))
    assert late[:, 2].min() > 0.7
    assert late[:, 0].min() < -0.5
    early = EulerTop.principal([1.0, 1.05, 1.06], example.momentum)
    frozen = early.body_momentum(np.linspace(0.0, early.period, 801))
    assert frozen[:, 0].min() > 0.1
    assert frozen[:, 2].min() < -0.5


# ---- F4b: the physical antenna --------------------------------------------------------------------------------------


@pytest.mark.parametrize("axis", [1, 2, 3])
def test_the_antenna_is_that_of_particles_f4b(axis):
    """The hub as six masses, and two tips: the same inertia, no internal momentum, the same motion."""
    example = dipole_antenna(axis, coast=1.0)
    hub = np.array([1.0, 1.5, 2.0])
    reach = np.sqrt(3.0 * (0.5 * hub.sum() - hub))
    points = np.concatenate([np.diag(reach), -np.diag(reach)])

    def positions(times):
        places, speeds = np.zeros((2, len(times), 8, 3))
        places[:, :6] = points
        out = 1.5 * np.minimum(times / 5.0, 1.0)
        places[:, 6, axis - 1], places[:, 7, axis - 1] = out, -out
        speeds[:, 6, axis - 1], speeds[:, 7, axis - 1] = 0.3 * (times < 5.0), -0.3 * (times < 5.0)
        return places, speeds

    body = sp.particles([1.0 / 6.0] * 6 + [0.5, 0.5], positions, 6.0, breaks=(5.0,))
    times = np.linspace(0.0, 6.0, 25)
    np.testing.assert_allclose(example.deformation.inertia(times), body.inertia(times), atol=1e-14, rtol=0)
    np.testing.assert_allclose(body.internal_momentum(times), 0.0, atol=1e-15, rtol=0)
    moments = moments_of(example, times)
    others = [k for k in range(3) if k != axis - 1]
    assert np.all(moments[:, axis - 1] == hub[axis - 1])
    assert np.all(np.diff(moments[times <= 5.0][:, others], axis=0) > 0.0)
    whole = sp.reconstruct(body, example.momentum, tolerance=1e-12)
    assert so3.angle(motion_of(example).final_attitude.T @ whole.final_attitude) < 3e-12


def test_along_the_largest_moment_the_order_does_not_last_f4b():
    """Against the paper's conclusion of example 4.5; along the smallest it does."""
    example = dipole_antenna(3)
    motion = motion_of(example)
    times = np.linspace(0.0, motion.duration, 501)
    assert np.all(np.diff(energy(example, motion, times)[times < 5.0]) < 0.0)
    moments = moments_of(example, times)
    assert np.argmax(moments[0]) == 2
    assert np.argmin(moments[-1]) == 2
    assert np.all(np.diff(moments_of(dipole_antenna(1), times), axis=1) > 0.0)


# ---- F5: slow deformations ------------------------------------------------------------------------------------------

DEFAULT = ((1.0, 1.5, 2.0), (0.4, 0.3, 3.2))
WIDE = ((1.0, 1.4, 2.0), (-0.6, 0.5, 1.0))


def phase_difference(rate, law, moments, momentum):
    """Of the first loop about axis 3, to the rigid body at the start."""
    example = slow_antenna(rate, law, moments=moments, momentum=momentum)
    motion = motion_of(example, 1e-11)
    loop = arc_phases(motion, [0.0, first_loop(motion)], "base")
    return so3.wrap(loop.montgomery_phase[0] - example.rigid.montgomery_phase), loop


@pytest.mark.parametrize("law", ["even", "periodic"])
def test_the_phase_tends_to_the_rigid_one_over_three_decades_f5(law):
    """First order in the rate in general, second where the rate starts from zero."""
    rates = 10.0 ** np.arange(-2.0, -5.5, -0.5)
    gaps = np.abs([phase_difference(rate, law, *DEFAULT)[0] for rate in rates])
    orders = np.log10(gaps[:-1] / gaps[1:]) / 0.5
    expected = 1.0 if law == "even" else 2.0
    assert np.all(np.abs(orders - expected) < 0.03)
    assert np.abs(orders[-1] - expected) < (2e-4 if law == "even" else 1e-2)
    assert gaps[0] / gaps[-1] > 10.0 ** (3.0 * expected - 0.1)


def test_the_loop_closes_along_the_meridian_f5():
    _, loop = phase_difference(1e-3, "even", *WIDE)
    assert 1e-4 < loop.momentum_gap[0] < 1e-1
    _, slower = phase_difference(1e-4, "even", *WIDE)
    assert loop.momentum_gap[0] / slower.momentum_gap[0] == pytest.approx(10.0, rel=0.1)


# ---- F6: furniture in a spacecraft ----------------------------------------------------------------------------------


@pytest.mark.parametrize("momentum", [30.0, 0.0, -12.0])
@pytest.mark.parametrize("duration", [5.0, 20.0])
def test_a_walk_round_turns_the_spacecraft_by_the_reduced_mass_f6(momentum, duration):
    example = furniture(duration, momentum=(0.0, 0.0, momentum))
    motion = motion_of(example)
    assert_known(example, motion, 1e-12)
    reduced = 400.0 * 80.0 / 480.0
    largest = 500.0 + reduced * 4.0
    turn = (momentum * duration - 2.0 * np.pi * reduced * 4.0) / largest
    assert example.turn == pytest.approx(turn, rel=1e-14)
    assert abs(so3.wrap(so3.angle_about(motion.final_attitude, np.array([0.0, 0.0, 1.0])) - turn)) < 1e-12
    holonomy = so3.angle_about(sp.split(motion).holonomy, np.array([0.0, 0.0, 1.0]))
    assert abs(so3.wrap(holonomy + 2.0 * np.pi * reduced * 4.0 / largest)) < 1e-11


def test_the_assembly_is_that_of_particles_and_of_the_reduced_mass_f6():
    example = furniture(height=0.5, momentum=(10.0, -20.0, 30.0))
    assert example.known is None
    assert furniture(height=0.5).known is None
    assert furniture(momentum=(1.0, 0.0, 30.0)).turn is None
    hub = np.array([300.0, 350.0, 500.0])
    reach = np.sqrt(3.0 * (0.5 * hub.sum() - hub) / 400.0)
    pace = 2.0 * np.pi / 20.0

    def positions(times):
        places, speeds = np.zeros((2, len(times), 7, 3))
        places[:, :6] = np.concatenate([np.diag(reach), -np.diag(reach)])
        cosine, sine = np.cos(pace * times), np.sin(pace * times)
        places[:, 6] = np.stack([2.0 * cosine, 2.0 * sine, np.full_like(times, 0.5)], axis=-1)
        speeds[:, 6, :2] = 2.0 * pace * np.stack([-sine, cosine], axis=-1)
        return places, speeds

    body = sp.particles([400.0 / 6.0] * 6 + [80.0], positions, 20.0)
    times = np.linspace(0.0, 20.0, 17)
    np.testing.assert_allclose(example.deformation.inertia(times), body.inertia(times), rtol=0, atol=1e-11)
    np.testing.assert_allclose(
        example.deformation.internal_momentum(times), body.internal_momentum(times), rtol=0, atol=1e-11
    )
    place, speed = (part[:, 6] for part in positions(times))
    reduced = 400.0 * 80.0 / 480.0
    np.testing.assert_allclose(body.internal_momentum(times), reduced * np.cross(place, speed), atol=1e-11, rtol=0)
    outer = place[:, :, None] * place[:, None, :]
    square = np.sum(place**2, axis=-1)[:, None, None] * np.eye(3)
    np.testing.assert_allclose(body.inertia(times), np.diag(hub) + reduced * (square - outer), atol=1e-11, rtol=0)
    other = sp.reconstruct(body, example.momentum, tolerance=1e-12)
    assert so3.angle(motion_of(example).final_attitude.T @ other.final_attitude) < 3e-12


# ---- F7, F8, F9 -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("example", [cat(), cat(halves=True)], ids=["realistic", "Kane and Scher"])
def test_the_cat_rights_itself_f7(example):
    motion = motion_of(example)
    assert np.all(example.momentum == 0.0)
    assert so3.angle(motion.final_attitude) == pytest.approx(example.turn, abs=1e-9)
    assert example.turn == np.pi


@pytest.mark.parametrize("legs", [False, True])
def test_the_astronaut_pitches_f8(legs):
    example = astronaut(legs)
    end = motion_of(example).final_attitude
    assert so3.angle(end) == pytest.approx(example.turn, abs=1e-8)
    assert so3.angle_about(end, np.array([0.0, 1.0, 0.0])) == pytest.approx(example.turn, abs=1e-8)


@pytest.mark.parametrize("momentum", [(0.6, 0.5, 1.2), (1.2, 0.1, -0.4)])
def test_the_rigid_body_is_the_euler_top_f9(momentum):
    example = rigid_body(momentum=momentum)
    motion = sp.reconstruct(example.deformation, example.momentum, tolerance=1e-12, method="spectral")
    assert_known(example, motion, 1e-11)
    assert phase_gap(example.phase, motion) < 1e-11


# ---- All of them, and what is refused -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_example_is_computed_to_1e_12(name):
    example = EXAMPLES[name]()
    motion = motion_of(example)
    assert motion.error_estimate < 1e-12
    assert motion.equation_residual < 1e-9
    assert example.momentum.shape == (3,)
    if example.known is not None:
        assert_known(example, motion, 1e-11)
    if example.phase is not None:
        assert phase_gap(example.phase, motion) < 1e-10


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: slow_antenna(1e-3, "fast"), UnknownNameError, "periodic"),
        (lambda: slow_antenna(0.0), ShapeError, "rate"),
        (lambda: slow_antenna(momentum=(3.0, 0.1, 0.1)), ShapeError, "axis 3"),
        (lambda: homothety(inertia=np.diag([1.0, 1.5, 2.6])), UnphysicalInertiaError, "triangle"),
        (lambda: printed_antenna(2), ShapeError, "1 or 3"),
        (lambda: printed_antenna(3, grown=1.9), ShapeError, "above"),
        (lambda: printed_antenna(3, (1.0, -1.5, 2.0)), ShapeError, "positive principal moments"),
        (lambda: dipole_antenna(0), ShapeError, "1, 2 or 3"),
        (lambda: axial_stretch(speed=-0.1), ShapeError, "speed"),
        (lambda: axial_stretch(momentum=(0.0, 1.0, 0.0)), TrajectoryError, "duration"),
        (lambda: axial_as_printed(momentum=[[1.0, 0.0, 0.0]]), ShapeError, "momentum"),
        (lambda: pulsation(1.0), ShapeError, "amount"),
        (lambda: homothety(Scale(pulsation().factor, lambda t: t)), TrajectoryError, "clock"),
        (lambda: homothety(Scale(expansion().factor, lambda t: 1.0 + expansion().clock(t))), TrajectoryError, "clock"),
        (lambda: homothety(Scale(lambda t: t - 1.0, pulsation().clock), duration=2.0), ShapeError, "above 0"),
        (lambda: homothety(Scale(lambda t: t[:1] + 1.0, pulsation().clock), duration=2.0), ShapeError, "shape"),
        (lambda: rigid_body(momentum=(0.0, 0.0, 0.0)), TrajectoryError, "period"),
        (lambda: homothety(momentum=(0.0, 1.0, 0.0)), TrajectoryError, "duration"),
        (lambda: first_loop(motion_of(printed_antenna(1, coast=1.0))), TrajectoryError, "degrees"),
        (lambda: first_loop(motion_of(printed_antenna(3)), 4), ShapeError, "axis"),
    ],
)
def test_what_cannot_be_is_refused(call, error, words):
    with pytest.raises(error, match=words):
        call()


@pytest.mark.parametrize("name", ["default", "nearer the separatrix", "fast"])
def test_the_certificate_is_given_before_the_motion_and_kept_f4(name):
    """Must hold for the printed antenna along axis 3: the order prevails, the energy falls."""
    options = {
        "default": {},
        "nearer the separatrix": {"momentum": (0.2, 0.45, 0.85)},
        "fast": {"momentum": (1.0, 1.0, 9.0)},
    }[name]
    example = printed_antenna(3, **options)
    certificate = regime_certificate(example.deformation, example.momentum)
    assert certificate.regime == "about axis 3"
    motion = motion_of(example, 1e-10)
    times = np.linspace(0.0, motion.duration, 2000)
    momentum = motion.body_momentum(times)
    assert np.all(momentum @ certificate.axis > 0.0)
    low, high = certificate.cosines
    cosine = momentum @ certificate.axis / np.linalg.norm(example.momentum)
    assert low.min() <= cosine.min() <= cosine.max() <= high.max()
    energy = energy_along(motion, times)
    assert certificate.energy[0] <= energy.min() <= energy.max() <= certificate.energy[1] * (1.0 + 1e-12)
    assert np.all(energy < certificate.threshold[0])


@pytest.mark.parametrize("name", ["antenna_1", "regime_crossing"])
def test_no_certificate_where_the_momentum_changes_its_axis_f3(name):
    example = printed_antenna(1) if name == "antenna_1" else regime_crossing()
    assert regime_certificate(example.deformation, example.momentum).regime == "may cross"
