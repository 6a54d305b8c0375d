"""Gauges against U differentiated numerically, and the motions that must not notice them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import NoisyPathError, ShapeError, TrajectoryError, UndeclaredBreakWarning
from support.bodies import random_loop
from support.independent import (
    BODIES,
    apart,
    body_of,
    geodesic_turn,
    hat,
    random_rotation,
    random_vector,
    turn,
    wrapped,
)
from support.long_runs import full_but

FIRST, SECOND = np.array([0.6, 0.0, 0.8]), np.array([0.0, 1.0, 0.0])


def vee(matrix):
    return np.stack([matrix[..., 2, 1], matrix[..., 0, 2], matrix[..., 1, 0]], axis=-1)


def closure_of(deformation):
    assert deformation.closure is not None
    return deformation.closure


def rates_of(frame, t, step=1e-2):
    """Body rates vee(U^T U') of rotations U(t), by nine-point differences."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    slope = sum(w * (frame(t + k * step) - frame(t - k * step)) for k, w in weights.items()) / step
    return vee(np.swapaxes(frame(t), -1, -2) @ slope)


def turning(speed=1.0):
    """U = exp(f e1) exp(g e2) with its body rates f' U2^T e1 + g' e2; not the identity at 0."""

    def u(t):
        f, g = 0.4 + np.sin(speed * t), 0.3 * speed * t
        df, dg = speed * np.cos(speed * t), 0.3 * speed + 0 * t
        second = Rotation.from_rotvec(g[:, None] * SECOND)
        whole = Rotation.from_rotvec(f[:, None] * FIRST) * second
        return whole.as_matrix(), df[:, None] * second.inv().apply(FIRST) + dg[:, None] * SECOND

    return u


def transposed(matrices):
    return np.swapaxes(matrices, -1, -2)


@pytest.fixture
def loop(body, rng):
    """A slow loop, so that nine-point differences reach rounding."""
    return sp.articulated(body, random_loop(body, rng, harmonics=1, duration=6.0, amplitude=0.5))


T = np.linspace(0.3, 5.7, 9)


# ---- Any gauge ------------------------------------------------------------------------------------------------------


def test_the_inertia_rate_in_a_gauge(loop):
    there = sp.in_gauge(loop, turning())
    weights, step = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}, 1e-2
    want = sum(w * (there.inertia(T + k * step) - there.inertia(T - k * step)) for k, w in weights.items()) / step
    np.testing.assert_allclose(there.inertia_rate(T), want, atol=1e-10 * np.abs(there.inertia(T)).max(), rtol=0)


def test_a_gauge_in_a_gauge(loop):
    """Frames multiply from the left: seen from U2 after U1 is seen from U2 U1."""
    one, two = turning(), turning(-0.7)
    both = sp.in_gauge(sp.in_gauge(loop, one), two)

    def product(t):
        (a, wa), (b, wb) = one(t), two(t)
        return b @ a, wa + np.einsum("nji,nj->ni", a, wb)

    at_once = sp.in_gauge(loop, product)
    for name in ("frame", "inertia", "internal_momentum", "inertia_rate", "centre_of_mass"):
        a, b = getattr(both, name)(T), getattr(at_once, name)(T)
        np.testing.assert_allclose(a, b, atol=1e-13 * max(1.0, np.abs(b).max()), rtol=0)
    np.testing.assert_allclose(closure_of(both), closure_of(at_once), atol=1e-13, rtol=0)


def test_the_closure_in_a_gauge(loop):
    """The end shape is the start shape turned by U(T) closure U(0)^T."""
    u = turning()
    there = sp.in_gauge(loop, u)
    ends = u(np.array([0.0, 6.0]))[0]
    np.testing.assert_allclose(closure_of(there), ends[1] @ ends[0].T, atol=1e-14, rtol=0)
    np.testing.assert_allclose(
        there.inertia(6.0),
        closure_of(there) @ there.inertia(0.0) @ closure_of(there).T,
        atol=1e-12 * np.abs(there.inertia(0.0)).max(),
        rtol=0,
    )


def test_an_open_path_has_no_closure_in_any_gauge():
    diver = sp.load_body("diver")
    deformation = sp.articulated(diver, sp.ShapePath.waypoints([0, 6], [[0.0, 0.0], [1.0, -0.4]]))
    for gauge in (lambda d: sp.in_gauge(d, turning()), sp.horizontal_gauge, sp.principal_gauge):
        assert gauge(deformation).closure is None


def test_what_is_no_gauge_is_refused(loop):
    def first(u):
        return sp.in_gauge(loop, u).inertia(0.3)

    eye, still = np.eye(3)[None], np.zeros((1, 3))
    for bad, said in (
        (lambda _: (2.0 * eye, still), "U: not a rotation"),
        (lambda _: (-eye, still), "U: a reflection"),
        (lambda _: (np.repeat(eye, 2, 0), still), r"\(2, 3, 3\)"),
        (lambda t: (np.repeat(eye, len(t), 0), np.zeros(3)), r"\(3,\)"),
        (lambda t: (np.repeat(eye, len(t), 0), np.full((len(t), 3), np.nan)), "body rates of U"),
        (lambda t: (np.zeros((len(t), 4)), still), r"\(\d, 4\)"),
    ):
        with pytest.raises(ShapeError, match=said):
            first(bad)


# ---- Ten random gauges: what must not change, what must -------------------------------------------------------------

Array = NDArray[np.float64]
LENGTH = 3.0
GAUGES = range(10)
GIVEN = ("U and rates", "U alone", "rates")


@dataclass(frozen=True)
class RandomGauge:
    """U = exp(f e1) exp(g e2) U_0, f and g trigonometric, with a drift where it is not periodic; U(0) is not 1."""

    first: Array
    second: Array
    waves: Array
    drifts: Array
    start: Array
    periodic: bool
    given: str

    @classmethod
    def of(cls, seed: int) -> RandomGauge:
        random = np.random.default_rng([2006, seed])
        first, second = (v / np.linalg.norm(v) for v in random.normal(size=(2, 3)))
        periodic = seed % 2 == 1
        drifts = np.zeros(2) if periodic else random.uniform(0.2, 0.5, 2)
        start = Rotation.random(rng=random).as_matrix()
        return cls(first, second, random.uniform(-0.5, 0.5, (2, 2, 2)), drifts, start, periodic, GIVEN[seed % 3])

    def _angles(self, t: Array) -> tuple[Array, Array]:
        """f, g and their rates: (2, N) each."""
        frequency = 2.0 * np.pi / LENGTH * np.arange(1, 3)[:, None]
        wave = self.waves / np.arange(1, 3)
        cosine, sine = np.cos(frequency * t), np.sin(frequency * t)
        value = wave[:, 0] @ cosine + wave[:, 1] @ sine + self.drifts[:, None] * t
        rate = -wave[:, 0] @ (frequency * sine) + wave[:, 1] @ (frequency * cosine) + self.drifts[:, None]
        return value, rate

    def turns(self, t: Array) -> Array:
        (f, g), _ = self._angles(t)
        outer, inner = Rotation.from_rotvec(f[:, None] * self.first), Rotation.from_rotvec(g[:, None] * self.second)
        return (outer * inner).as_matrix() @ self.start

    def rates(self, t: Array) -> Array:
        (_, g), (df, dg) = self._angles(t)
        inner = Rotation.from_rotvec(g[:, None] * self.second)
        return (df[:, None] * inner.inv().apply(self.first) + dg[:, None] * self.second) @ self.start

    def applied(self, deformation: sp.Deformation) -> sp.Deformation:
        if self.given == "rates":
            return sp.in_gauge(deformation, rates=self.rates, start=self.turns(np.zeros(1))[0])
        if self.given == "U alone":
            return sp.in_gauge(deformation, self.turns)
        return sp.in_gauge(deformation, lambda t: (self.turns(t), self.rates(t)))

    def differences(self, t: Array, step: float = 1e-2) -> Array:
        """Body rates from U alone, by the test's own nine points."""
        return rates_of(lambda times: self.turns(np.ravel(times)), t, step)


@lru_cache(maxsize=3)
def tumbling(name: str) -> sp.Motion:
    """A body in a closed loop of its joints, with momentum, from a random attitude."""
    body = body_of(name)
    path = random_loop(body, np.random.default_rng(11), duration=LENGTH, amplitude=0.5)
    deformation = sp.articulated(body, path)
    return sp.reconstruct(deformation, random_vector(5, 0.5 * BODIES[name]), random_rotation(6), tolerance=1e-12)


def applied(matrices, vectors):
    return np.einsum("...ij,...j->...i", matrices, vectors)


@pytest.mark.parametrize("seed", full_but(GAUGES, *GAUGES[::3]))
@pytest.mark.parametrize("name", ["example:human", "cat", "satellite"])
def test_one_motion_in_ten_random_gauges_b4(name, seed):
    """At all times, ends included; Delta R is the same; theta_M and the gap of Pi are what U makes of them."""
    plain, gauge = tumbling(name), RandomGauge.of(seed)
    loop, mu, start = plain.deformation, plain.momentum, plain.initial_attitude
    there = gauge.applied(loop)
    t = np.linspace(0.0, LENGTH, 101)
    u, omega_u = gauge.turns(t), gauge.differences(t)

    inertia = u @ loop.inertia(t) @ transposed(u)
    internal = applied(u, applied(loop.inertia(t), omega_u) + loop.internal_momentum(t))
    np.testing.assert_allclose(there.frame(t), u, atol=3e-12, rtol=0)
    np.testing.assert_allclose(there.inertia(t), inertia, atol=1e-10 * np.abs(inertia).max(), rtol=0)
    np.testing.assert_allclose(there.internal_momentum(t), internal, atol=1e-10 * np.abs(internal).max(), rtol=0)

    seen = sp.reconstruct(there, mu, start @ u[0].T, tolerance=1e-12)
    np.testing.assert_allclose(seen.attitude(t), plain.attitude(t) @ transposed(u), atol=1e-10, rtol=0)
    pi = applied(u, plain.body_momentum(t))
    np.testing.assert_allclose(seen.body_momentum(t), pi, atol=1e-10 * float(np.linalg.norm(mu)), rtol=0)
    omega = applied(u, plain.angular_velocity(t) - omega_u)
    np.testing.assert_allclose(seen.angular_velocity(t), omega, atol=1e-9 * np.abs(omega).max(), rtol=0)

    here, moved = sp.split(plain, "base"), sp.split(seen, "base")
    assert apart(moved.total_rotation, here.total_rotation) < 1e-10
    assert apart(moved.holonomy, here.holonomy) < 1e-10
    assert apart(moved.dynamical_rotation, here.dynamical_rotation) < 1e-10

    axis = mu / np.linalg.norm(mu)
    ends = applied(u[[0, -1]], applied(transposed(plain.attitude([0.0, LENGTH])), axis))
    gap = 2.0 * np.arcsin(0.5 * np.linalg.norm(ends[1] - ends[0]))
    assert moved.momentum_gap == pytest.approx(gap, abs=1e-10)
    first = start @ u[0].T
    tilt = first @ geodesic_turn(ends[1], ends[0]) @ first.T
    by_axis = plain.final_attitude @ u[-1].T @ u[0] @ start.T
    assert apart(turn(axis, float(moved.montgomery_phase)) @ tilt, by_axis) < 1e-10
    slip = np.einsum("ni,ni->n", *(f(nodes()[0]) for f in (gauge.differences, plain.body_momentum)))
    dynamic = here.dynamic_phase - nodes()[1] @ slip / np.linalg.norm(mu)
    assert moved.dynamic_phase == pytest.approx(dynamic, abs=1e-10)

    phase_differs = abs(wrapped(moved.montgomery_phase - here.montgomery_phase)) > 1e-2
    gap_differs = abs(moved.momentum_gap - here.momentum_gap) > 1e-2
    # A frame that returns makes another solid angle and another theta_D, and theta_M the same up to whole turns.
    assert phase_differs == gap_differs == (not gauge.periodic)
    assert abs(wrapped(moved.solid_angle - here.solid_angle)) > 1e-2


@lru_cache(maxsize=1)
def nodes() -> tuple[Array, Array]:
    """Nodes and weights of a fine Gauss rule on [0, LENGTH]."""
    points, weights = np.polynomial.legendre.leggauss(12)
    edges = np.linspace(0.0, LENGTH, 41)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (points + 1.0)).ravel(), (half * weights).ravel()


@pytest.mark.parametrize("name", ["example:human", "cat", "satellite"])
def test_the_horizontal_gauge_carries_no_momentum(name):
    """I omega_U + L_o with U differentiated here: an error of 1e-12 of U may swing four times along the motion."""
    loop = tumbling(name).deformation
    frame = sp.horizontal_gauge(loop).frame
    t = np.linspace(0.1, LENGTH - 0.1, 57)
    momentum = loop.internal_momentum(t)
    inertia = loop.inertia(t)
    left = applied(inertia, rates_of(frame, t, step=5e-3)) + momentum
    largest = np.linalg.norm(inertia, 2, axis=(1, 2)).max()
    assert np.linalg.norm(left, axis=-1).max() < 1e-12 * 2.0 * np.pi * 4.0 / LENGTH * largest


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_holonomy_is_found_from_any_frame(seed):
    """U_hor,here(t) = U_0 U_hor(t) U(t)^T when seen from U: the same lift, its closure turned by U(0)."""
    loop, gauge = tumbling("cat").deformation, RandomGauge.of(seed)
    t = np.linspace(0.0, LENGTH, 9)
    u = gauge.turns(t)
    lifted, plain = sp.horizontal_gauge(gauge.applied(loop)), sp.horizontal_gauge(loop)
    np.testing.assert_allclose(lifted.frame(t), u[0] @ plain.frame(t), atol=1e-11, rtol=0)
    np.testing.assert_allclose(closure_of(lifted), u[0] @ closure_of(plain) @ u[0].T, atol=1e-11, rtol=0)


# ---- U alone, and rates alone ---------------------------------------------------------------------------------------

BOX = np.diag([1.0, 1.6, 2.1])


def box(duration=6.0, breaks=()):
    return sp.prescribed(lambda t: np.stack([BOX] * len(t)), None, duration, breaks)


def about(axis, angle):
    """Times -> rotations about one axis by angle(t)."""
    return lambda t: Rotation.from_rotvec(angle(t)[:, None] * axis).as_matrix()


def spin_of(deformation, t):
    """The body rates of U that a gauge works with, read off a constant inertia: L_o = U I omega_U."""
    frame = deformation.frame(t)
    return np.linalg.solve(BOX, (transposed(frame) @ deformation.internal_momentum(t)[..., None]))[..., 0]


@pytest.mark.parametrize("swings", [1, 3, 10, 40])
def test_u_alone_is_differentiated(swings):
    """A closed form of the rate, 1e-9 of its size at all times, for slow frames and fast ones."""
    speed = 2.0 * np.pi * swings / 6.0
    u = turning(speed)
    t = np.linspace(0.0, 6.0, 1001)
    there = sp.in_gauge(box(), lambda times: u(times)[0])
    want = u(t)[1]
    np.testing.assert_allclose(spin_of(there, t), want, atol=1e-9 * np.abs(want).max(), rtol=0)
    np.testing.assert_allclose(there.frame(t), u(t)[0], atol=1e-14, rtol=0)
    given = sp.in_gauge(box(), u)
    size = np.abs(given.inertia_rate(t)).max()
    np.testing.assert_allclose(there.inertia_rate(t), given.inertia_rate(t), atol=1e-9 * size, rtol=0)


def test_u_alone_that_stands_still():
    """A constant turn, given alone, has no rate."""
    still = random_rotation(3)
    there = sp.in_gauge(box(), lambda t: np.stack([still] * len(t)))
    t = np.linspace(0.0, 6.0, 101)
    np.testing.assert_allclose(there.internal_momentum(t), 0.0, atol=1e-11, rtol=0)
    np.testing.assert_allclose(there.inertia(t), np.stack([still @ BOX @ still.T] * 101), atol=1e-14, rtol=0)


# Fractions of the interval: on and beside even divisions by 32, 64 and 100, in no relation to them, near the ends.
KINKS = (0.5, 0.515625, 0.31, 0.328125, 0.9, 0.9921875, 0.12345, 1e-3, 0.9999)


@pytest.mark.parametrize("size", [1.0, 1e-4])
@pytest.mark.parametrize("place", full_but(KINKS, *KINKS[::2]))
def test_a_kink_in_u_alone_is_seen(place, size):
    """Wherever it is: named and taken as a break, the rate right on both sides; it jumps there by twice the size."""
    kink = 6.0 * place
    t = np.sort(np.concatenate([np.linspace(0.0, 6.0, 1001), kink + np.array([-1e-3, -1e-5, 1e-5, 1e-3])]))
    t = t[(np.abs(t - kink) > 1e-9) & (t >= 0.0) & (t <= 6.0)]
    with pytest.warns(UndeclaredBreakWarning, match="gauge"):
        there = sp.in_gauge(box(), about(FIRST, lambda t: np.sin(t) + size * np.abs(t - kink)))
    np.testing.assert_allclose(there.breaks, [0.0, kink, 6.0], atol=1e-13 / size)
    want = (np.cos(t) + size * np.sign(t - kink))[:, None] * FIRST
    np.testing.assert_allclose(spin_of(there, t), want, atol=2e-9, rtol=0)


def test_a_jump_is_refused():
    with pytest.raises(TrajectoryError, match="jumps"):
        sp.in_gauge(box(), about(FIRST, lambda t: np.sin(t) + 0.3 * (t > 2.0312)))


def test_a_burst_in_u_alone_is_right():
    """A swing of 0.3 rad of any width, centred anywhere: 1e-8 of its largest rate."""
    for width in (0.5, 0.1, 0.05, 6e-3, 6e-4):
        for middle in (3.0, 3.0937, 2.2):
            bell = lambda t, m=middle, w=width: 0.3 * np.exp(-(((t - m) / w) ** 2))  # noqa: E731
            near = np.clip(middle + width * np.linspace(-6.0, 6.0, 501), 0.0, 6.0)
            t = np.union1d(np.linspace(0.0, 6.0, 1001), near)
            there = sp.in_gauge(box(), about(FIRST, lambda t, bell=bell: np.sin(t) + bell(t)))
            rate = np.cos(t) - 2.0 * (t - middle) / width**2 * bell(t)
            np.testing.assert_allclose(spin_of(there, t), rate[:, None] * FIRST, atol=1e-8 * np.abs(rate).max(), rtol=0)


BREAK = 2.2


def kinked(t):
    return np.sin(t) + 0.7 * np.abs(t - BREAK)


@pytest.mark.parametrize("given", ["U alone", "rates"])
def test_a_kink_at_a_break_is_right(given):
    """Where the deformation has a break the rate may jump: on both sides of it that of the formula."""
    deformation = box(breaks=[BREAK])
    rates = lambda t: (np.cos(t) + 0.7 * np.where(t >= BREAK, 1.0, -1.0))[:, None] * FIRST  # noqa: E731
    if given == "U alone":
        there = sp.in_gauge(deformation, about(FIRST, kinked))
    else:
        there = sp.in_gauge(deformation, rates=rates, start=turn(FIRST, kinked(0.0)))
    t = np.concatenate([np.linspace(0.0, 6.0, 501), np.nextafter(BREAK, [0.0, 6.0]), BREAK + np.array([-1e-6, 1e-6])])
    np.testing.assert_allclose(spin_of(there, t), rates(t), atol=1e-9, rtol=0)
    np.testing.assert_allclose(there.frame(t), about(FIRST, kinked)(t), atol=3e-12, rtol=0)
    mu = np.array([0.3, -0.4, 0.8])
    seen = sp.reconstruct(there, mu, about(FIRST, kinked)(np.zeros(1))[0].T, tolerance=1e-11)
    plain = sp.reconstruct(deformation, mu, tolerance=1e-11)
    np.testing.assert_allclose(seen.attitude(t) @ about(FIRST, kinked)(t), plain.attitude(t), atol=1e-10, rtol=0)


def wandering(t):
    """Body rates without a closed form of U."""
    return np.stack([np.sin(2.0 * t), 0.8 * np.cos(1.3 * t + 0.4), 0.5 - 0.7 * np.sin(t) ** 2], axis=-1)


@pytest.mark.parametrize("breaks", [(), (1.7, BREAK)])
def test_rates_alone_are_integrated(breaks):
    """U' = U hat(rate) from a start, against SciPy on the nine entries; the rate jumps at a break."""
    jumping = lambda t: wandering(t) + (np.asarray(t)[..., None] >= BREAK) * [0.0, 0.9, -0.4] * bool(breaks)  # noqa: E731
    start = random_rotation(8)
    there = sp.in_gauge(box(breaks=breaks), rates=jumping, start=start)
    edges = np.unique([0.0, *breaks, 6.0])
    value = start.ravel()
    for left, right in pairwise(edges):
        t = np.linspace(left, np.nextafter(right, 0.0), 40)
        middle = 0.5 * (left + right)
        side = jumping(np.array([middle]))[0] - wandering(np.array([middle]))[0]
        slope = lambda s, y, side=side: (y.reshape(3, 3) @ hat(wandering(np.array([s]))[0] + side)).ravel()  # noqa: E731
        run = solve_ivp(slope, (left, right), value, "DOP853", rtol=1e-13, atol=1e-14, max_step=0.1, t_eval=t)
        np.testing.assert_allclose(there.frame(t), run.y.T.reshape(-1, 3, 3), atol=1e-10, rtol=0)
        np.testing.assert_allclose(spin_of(there, t), jumping(t), atol=1e-11, rtol=0)
        value = run.y[:, -1]


def test_rates_alone_start_at_the_identity_unless_told():
    axis, start = np.array([0.0, 0.6, -0.8]), random_rotation(9)
    rates = lambda t: (0.5 + np.cos(t))[:, None] * axis  # noqa: E731
    t = np.linspace(0.0, 6.0, 31)
    want = about(axis, lambda t: 0.5 * t + np.sin(t))(t)
    np.testing.assert_allclose(sp.in_gauge(box(), rates=rates).frame(t), want, atol=3e-12, rtol=0)
    np.testing.assert_allclose(sp.in_gauge(box(), rates=rates, start=start).frame(t), start @ want, atol=3e-12, rtol=0)


def test_a_gauge_is_given_in_one_way():
    u, rates, one = turning(), lambda t: np.zeros((len(t), 3)), np.eye(3)
    for wrong in (
        lambda d: sp.in_gauge(d),
        lambda d: sp.in_gauge(d, start=one),
        lambda d: sp.in_gauge(d, u, rates=rates),
        lambda d: sp.in_gauge(d, u, start=one),
        lambda d: sp.in_gauge(d, u, rates=rates, start=one),
    ):
        with pytest.raises(ShapeError, match="body"):
            wrong(box())
    with pytest.raises(ShapeError, match="function"):
        sp.in_gauge(box(), one)  # type: ignore[arg-type]


def test_a_start_is_one_rotation():
    rates = lambda t: np.zeros((len(t), 3))  # noqa: E731
    for start, said in (
        (2.0 * np.eye(3), "start: not a rotation"),
        (-np.eye(3), "start: a reflection"),
        (np.stack([np.eye(3)] * 2), r"one rotation \(3, 3\)"),
        (np.eye(2), "start"),
        (np.full((3, 3), np.nan), "start"),
    ):
        with pytest.raises(ShapeError, match=said):
            sp.in_gauge(box(), rates=rates, start=start)


def test_what_are_no_rates_is_refused():
    for rates, said in (
        (lambda _: np.zeros(3), r"rates must return \(\d+, 3\)"),
        (lambda t: np.zeros((len(t), 4)), r"rates must return \(\d+, 3\)"),
        (lambda t: np.full((len(t), 3), np.inf), "body rates of U"),
        (lambda t: ["x"] * len(t), "body rates of U"),
    ):
        with pytest.raises(ShapeError, match=said):
            sp.in_gauge(box(), rates=rates)


def test_rates_too_rough_to_be_integrated_are_refused():
    noise = np.random.default_rng(4)
    with pytest.raises(NoisyPathError, match="noisy"):
        sp.in_gauge(box(), rates=lambda t: noise.normal(size=(len(t), 3)))


def test_what_u_alone_returns_is_checked():
    eye = np.eye(3)
    for bad, said in (
        (lambda t: np.stack([2.0 * eye] * len(t)), "U: not a rotation"),
        (lambda t: np.stack([-eye] * len(t)), "U: a reflection"),
        (lambda _: eye, r"\(3, 3\)"),
        (lambda t: np.stack([eye] * (len(t) + 1)), r"\(\d+, 3, 3\)"),
        (lambda t: np.full((len(t), 3, 3), np.nan), "U"),
        (lambda _: "turned", "U"),
    ):
        with pytest.raises(ShapeError, match=said):
            sp.in_gauge(box(), bad)


def test_u_that_stops_giving_its_rates_is_refused():
    u = turning()
    with pytest.raises(ShapeError, match="alone"):
        sp.in_gauge(box(), lambda t: u(t) if t[0] == 0.0 else u(t)[0])


@pytest.mark.parametrize(
    "spoilt",
    [
        lambda _, rates: -rates,
        lambda _, rates: 1.01 * rates,
        lambda turns, rates: applied(turns, rates),  # the axes of the other frame
        lambda _, rates: rates[:, ::-1],
        lambda _, rates: 0.0 * rates,
    ],
    ids=["sign", "scale", "axes", "order", "none"],
)
@pytest.mark.parametrize("breaks", [(), (BREAK,)])
def test_rates_that_are_not_those_of_u_are_refused(spoilt, breaks):
    """Also where only the second piece of the deformation has the wrong ones."""
    u = turning()

    def wrong(t):
        turns, rates = u(t)
        bad = np.where(bool(breaks) & (t[:, None] < BREAK), rates, spoilt(turns, rates))
        return turns, bad

    with pytest.raises(ShapeError, match="body"):
        sp.in_gauge(box(breaks=breaks), wrong)


# ---- Horizontal -----------------------------------------------------------------------------------------------------


def test_the_horizontal_gauge_has_no_internal_momentum(loop):
    """B2, B4: U differentiated numerically, I omega_U + L_o vanishes; U(0) is the identity."""
    there = sp.horizontal_gauge(loop)
    np.testing.assert_allclose(there.frame(0.0), np.eye(3), atol=1e-15, rtol=0)
    # At this step the differences are right to 3e-11 rad/s for the fastest of the bodies.
    omega = rates_of(there.frame, T, step=0.04)
    momentum = loop.internal_momentum(T)
    drift = np.linalg.solve(loop.inertia(T), momentum[..., None])[..., 0]
    assert np.abs(drift).max() > 1e-3
    np.testing.assert_allclose(omega + drift, 0.0, atol=1e-10, rtol=0)  # I^-1 L_o there, in rad/s
    np.testing.assert_allclose(there.internal_momentum(T), 0.0, atol=1e-13 * np.abs(momentum).max(), rtol=0)
    frame = there.frame(T)
    np.testing.assert_allclose(frame @ transposed(frame), np.stack([np.eye(3)] * len(T)), atol=1e-13, rtol=0)
    inertia = frame @ loop.inertia(T) @ transposed(frame)
    np.testing.assert_allclose(there.inertia(T), inertia, atol=1e-13 * np.abs(inertia).max(), rtol=0)


def test_the_closure_of_the_horizontal_gauge_is_the_holonomy(body, rng):
    """B7, in base axes at t = 0."""
    path = random_loop(body, rng, amplitude=0.6)
    there = sp.horizontal_gauge(sp.articulated(body, path))
    np.testing.assert_allclose(closure_of(there), sp.holonomy(body, path, 1e-12), atol=3e-12, rtol=0)


def test_with_zero_momentum_the_body_is_at_rest_in_the_horizontal_gauge(loop):
    """B8: the lift is the motion."""
    motion = sp.reconstruct(loop, np.zeros(3), tolerance=1e-11)
    np.testing.assert_allclose(motion.attitude(T), sp.horizontal_gauge(loop).frame(T), atol=1e-10, rtol=0)


def test_the_horizontal_gauge_of_a_horizontal_gauge_turns_no_more(loop):
    once = sp.horizontal_gauge(loop)
    twice = sp.horizontal_gauge(once)
    np.testing.assert_allclose(twice.frame(T), once.frame(T), atol=1e-12, rtol=0)
    np.testing.assert_allclose(closure_of(twice), closure_of(once), atol=1e-12, rtol=0)


# ---- Principal ------------------------------------------------------------------------------------------------------


def test_the_principal_gauge_is_diagonal(loop):
    """B3: moments ascending off no diagonal, U proper and continuous, its rates those of U differentiated."""
    there = sp.principal_gauge(loop)
    t = np.linspace(0.0, 6.0, 2000)
    inertia, frame = there.inertia(t), there.frame(t)
    moments = np.diagonal(inertia, axis1=1, axis2=2)
    off = inertia - moments[:, :, None] * np.eye(3)
    np.testing.assert_allclose(off, 0.0, atol=1e-13 * moments.max(), rtol=0)
    assert np.all(np.diff(moments, axis=1) > 0.0)
    np.testing.assert_allclose(np.linalg.det(frame), 1.0, atol=1e-13, rtol=0)
    np.testing.assert_allclose(frame @ transposed(frame), np.stack([np.eye(3)] * len(t)), atol=1e-13, rtol=0)
    assert np.linalg.norm(np.diff(frame, axis=0), axis=(1, 2)).max() < 0.2
    omega = rates_of(there.frame, T, step=2e-3)  # an avoided crossing turns the axes quickly
    inside = np.einsum("nij,nj->ni", loop.inertia(T), omega) + loop.internal_momentum(T)
    want = np.einsum("nij,nj->ni", there.frame(T), inside)
    np.testing.assert_allclose(there.internal_momentum(T), want, atol=1e-9 * max(1.0, np.abs(want).max()), rtol=0)


def test_horizontal_and_principal_gauges_differ():
    """B5, remark 2.12: diagonal axes generally carry internal momentum."""
    cat = sp.load_body("cat")
    deformation = sp.articulated(cat, random_loop(cat, np.random.default_rng(3), amplitude=0.6))
    momentum = sp.principal_gauge(deformation).internal_momentum(np.linspace(0, 1.5, 9))
    assert np.abs(momentum).max() > 1e-3 * np.abs(deformation.internal_momentum(np.linspace(0, 1.5, 9))).max()
