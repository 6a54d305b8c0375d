"""Gauges against U differentiated numerically, and the motions that must not notice them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from conftest import random_loop
from shapephase.errors import GaugeError, ShapeError
from shapephase.gauge import lift_frames
from shapephase.stepping import stepped_rotation

FIRST, SECOND = np.array([0.6, 0.0, 0.8]), np.array([0.0, 1.0, 0.0])


def vee(matrix):
    return np.stack([matrix[..., 2, 1], matrix[..., 0, 2], matrix[..., 1, 0]], axis=-1)


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


def frames(u):
    return lambda t: u(np.ravel(t))[0].reshape(*np.shape(t), 3, 3)


# ---- Any gauge ------------------------------------------------------------------------------------------------------


def test_the_gauge_law(loop):
    """B4: I -> U I U^T, L_o -> U (I omega_U + L_o), omega_U from U^T U' by differences."""
    u = turning()
    there = sp.in_gauge(loop, u)
    turn, omega = u(T)[0], rates_of(frames(u), T)
    inertia, momentum = loop.inertia(T), loop.internal_momentum(T)
    want = turn @ inertia @ transposed(turn)
    np.testing.assert_allclose(there.inertia(T), want, atol=1e-13 * np.abs(want).max())
    want = np.einsum("nij,nj->ni", turn, np.einsum("nij,nj->ni", inertia, omega) + momentum)
    np.testing.assert_allclose(there.internal_momentum(T), want, atol=1e-11 * np.abs(want).max())
    np.testing.assert_allclose(there.frame(T), turn, atol=1e-14)
    centre = np.einsum("nij,nj->ni", turn, loop.centre_of_mass(T))
    np.testing.assert_allclose(there.centre_of_mass(T), centre, atol=1e-13)
    assert there.duration == loop.duration
    np.testing.assert_array_equal(there.breaks, loop.breaks)


def test_the_inertia_rate_in_a_gauge(loop):
    there = sp.in_gauge(loop, turning())
    weights, step = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}, 1e-2
    want = sum(w * (there.inertia(T + k * step) - there.inertia(T - k * step)) for k, w in weights.items()) / step
    np.testing.assert_allclose(there.inertia_rate(T), want, atol=1e-10 * np.abs(there.inertia(T)).max())


def test_turning_the_masses_themselves_is_the_same():
    """B4 with nothing taken from it: particles put where U takes them, their velocities from U' d + U d'."""
    masses = np.array([1.0, 0.7, 1.3, 0.4])
    rest = np.array([[0.5, 0.1, -0.2], [-0.4, 0.6, 0.1], [0.2, -0.5, 0.7], [0.1, 0.3, -0.9]])

    def d(t):
        phase = t[:, None, None] + np.arange(12.0).reshape(4, 3)
        return rest + 0.2 * np.sin(phase), 0.2 * np.cos(phase)

    u, step = turning(), 1e-2

    def turned(t):
        points, speeds = d(t)
        weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
        slope = sum(w * (u(t + k * step)[0] - u(t - k * step)[0]) for k, w in weights.items()) / step
        frame = u(t)[0]
        return points @ transposed(frame), points @ transposed(slope) + speeds @ transposed(frame)

    seen = sp.in_gauge(sp.particles(masses, d, 6.0), u)
    put = sp.particles(masses, turned, 6.0)
    np.testing.assert_allclose(seen.inertia(T), put.inertia(T), atol=1e-13)
    np.testing.assert_allclose(seen.internal_momentum(T), put.internal_momentum(T), atol=1e-11)


def test_the_motion_does_not_notice_the_gauge(loop):
    """B4: R -> R U^T, Pi -> U Pi, one motion of the body in space."""
    u, mu = turning(), 0.3 * np.linalg.norm(loop.inertia(0.0)) * np.array([0.6, -0.3, 0.5])
    first = u(np.zeros(1))[0][0]
    plain = sp.reconstruct(loop, mu, tolerance=1e-10)
    seen = sp.reconstruct(sp.in_gauge(loop, u), mu, first.T, tolerance=1e-10)
    turn = u(T)[0]
    np.testing.assert_allclose(seen.attitude(T) @ turn, plain.attitude(T), atol=2e-9)
    momentum = np.einsum("nij,nj->ni", turn, plain.body_momentum(T))
    np.testing.assert_allclose(seen.body_momentum(T), momentum, atol=2e-9 * np.linalg.norm(mu))


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
        np.testing.assert_allclose(a, b, atol=1e-13 * max(1.0, np.abs(b).max()))
    np.testing.assert_allclose(both.closure, at_once.closure, atol=1e-13)


def test_the_closure_in_a_gauge(loop):
    """The end shape is the start shape turned by U(T) closure U(0)^T."""
    u = turning()
    there = sp.in_gauge(loop, u)
    ends = u(np.array([0.0, 6.0]))[0]
    np.testing.assert_allclose(there.closure, ends[1] @ ends[0].T, atol=1e-14)
    np.testing.assert_allclose(
        there.inertia(6.0),
        there.closure @ there.inertia(0.0) @ there.closure.T,
        atol=1e-12 * np.abs(there.inertia(0.0)).max(),
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


# ---- Horizontal -----------------------------------------------------------------------------------------------------


def test_the_horizontal_gauge_has_no_internal_momentum(loop):
    """B2, B4: U differentiated numerically, I omega_U + L_o vanishes; U(0) is the identity."""
    there = sp.horizontal_gauge(loop)
    np.testing.assert_allclose(there.frame(0.0), np.eye(3), atol=1e-15)
    omega = rates_of(there.frame, T, step=0.05)
    momentum = loop.internal_momentum(T)
    drift = np.linalg.solve(loop.inertia(T), momentum[..., None])[..., 0]
    assert np.abs(drift).max() > 1e-3
    np.testing.assert_allclose(omega + drift, 0.0, atol=1e-10)  # I^-1 L_o there, in rad/s
    np.testing.assert_allclose(there.internal_momentum(T), 0.0, atol=1e-13 * np.abs(momentum).max())
    frame = there.frame(T)
    np.testing.assert_allclose(frame @ transposed(frame), np.stack([np.eye(3)] * len(T)), atol=1e-13)
    inertia = frame @ loop.inertia(T) @ transposed(frame)
    np.testing.assert_allclose(there.inertia(T), inertia, atol=1e-13 * np.abs(inertia).max())


def test_the_closure_of_the_horizontal_gauge_is_the_holonomy(body, rng):
    """B7, in base axes at t = 0."""
    path = random_loop(body, rng, amplitude=0.6)
    there = sp.horizontal_gauge(sp.articulated(body, path))
    np.testing.assert_allclose(there.closure, sp.holonomy(body, path, 1e-12), atol=3e-12)


def test_with_zero_momentum_the_body_is_at_rest_in_the_horizontal_gauge(loop):
    """B8: the lift is the motion."""
    motion = sp.reconstruct(loop, np.zeros(3), tolerance=1e-11)
    np.testing.assert_allclose(motion.attitude(T), sp.horizontal_gauge(loop).frame(T), atol=1e-10)


def test_frames_of_an_integrated_lift(loop):
    """The same U and rates as the horizontal gauge, from the interpolant alone."""
    lift = lift_frames(stepped_rotation(loop.sampler(), np.zeros((1, 3)), 1e-12))
    frame, omega = lift(T)
    np.testing.assert_allclose(frame, sp.horizontal_gauge(loop).frame(T), atol=3e-12)
    drift = np.linalg.solve(loop.inertia(T), loop.internal_momentum(T)[..., None])[..., 0]
    np.testing.assert_allclose(omega, -drift, atol=1e-10)


def test_the_horizontal_gauge_of_a_horizontal_gauge_turns_no_more(loop):
    once = sp.horizontal_gauge(loop)
    twice = sp.horizontal_gauge(once)
    np.testing.assert_allclose(twice.frame(T), once.frame(T), atol=1e-12)
    np.testing.assert_allclose(twice.closure, once.closure, atol=1e-12)


def test_the_horizontal_gauge_of_a_wheel():
    """A wheel on an axis of symmetry: U = exp(-z J/(I + J) angle)."""
    angle = lambda t: np.stack([0 * t, 0 * t, 1 - np.cos(t)], -1)  # noqa: E731
    bus, wheel = 3.0, 0.5
    deformation = sp.prescribed(
        lambda t: np.stack([np.diag([2.0, 2.5, bus + wheel])] * len(t)),
        lambda t: wheel * np.stack([0 * t, 0 * t, np.sin(t)], -1),
        6.0,
    )
    want = Rotation.from_rotvec(-wheel / (bus + wheel) * angle(T)).as_matrix()
    np.testing.assert_allclose(sp.horizontal_gauge(deformation).frame(T), want, atol=1e-12)


# ---- Principal ------------------------------------------------------------------------------------------------------


def test_the_principal_gauge_is_diagonal(loop):
    """B3: moments ascending off no diagonal, U proper and continuous, its rates those of U differentiated."""
    there = sp.principal_gauge(loop)
    t = np.linspace(0.0, 6.0, 2000)
    inertia, frame = there.inertia(t), there.frame(t)
    moments = np.diagonal(inertia, axis1=1, axis2=2)
    off = inertia - moments[:, :, None] * np.eye(3)
    np.testing.assert_allclose(off, 0.0, atol=1e-13 * moments.max())
    assert np.all(np.diff(moments, axis=1) > 0.0)
    np.testing.assert_allclose(np.linalg.det(frame), 1.0, atol=1e-13)
    np.testing.assert_allclose(frame @ transposed(frame), np.stack([np.eye(3)] * len(t)), atol=1e-13)
    assert np.linalg.norm(np.diff(frame, axis=0), axis=(1, 2)).max() < 0.2
    omega = rates_of(there.frame, T, step=2e-3)  # an avoided crossing turns the axes quickly
    inside = np.einsum("nij,nj->ni", loop.inertia(T), omega) + loop.internal_momentum(T)
    want = np.einsum("nij,nj->ni", there.frame(T), inside)
    np.testing.assert_allclose(there.internal_momentum(T), want, atol=1e-9 * max(1.0, np.abs(want).max()))


def test_the_first_principal_frame_is_fixed_by_rule(loop):
    """Each of the first two axes along its largest base component, the third completing a proper frame."""
    axes = sp.principal_gauge(loop).frame(0.0).T
    for column in (0, 1):
        assert axes[np.argmax(np.abs(axes[:, column])), column] > 0.0
    np.testing.assert_allclose(np.cross(axes[:, 0], axes[:, 1]), axes[:, 2], atol=1e-13)


@pytest.mark.parametrize("count", [2, 32, 33])
def test_the_principal_gauge_of_a_loop_gone_round_many_times(count, rng):
    """The axes at a phase of the loop are those of the first round, up to sign; U is continuous all along."""
    cat = sp.load_body("cat")
    path = random_loop(cat, rng, duration=1.0, amplitude=0.8)
    once = sp.principal_gauge(sp.articulated(cat, path))
    many = sp.principal_gauge(sp.articulated(cat, path.repeated(count)))
    t = np.linspace(0.0, 1.0, 50, endpoint=False)
    np.testing.assert_allclose(many.frame(t), once.frame(t), atol=1e-11)
    for loop in (1, count - 1):
        np.testing.assert_allclose(np.abs(many.frame(loop + t)), np.abs(once.frame(t)), atol=1e-10)
    np.testing.assert_allclose(many.closure, np.linalg.matrix_power(once.closure, count), atol=1e-10)


def rotating(speed, moments=(1.0, 2.0, 3.0)):
    """A rigid tensor that turns as seen from the base."""

    def inertia(t):
        r = Rotation.from_rotvec(speed * t[:, None] * FIRST).as_matrix()
        return r @ np.diag(moments) @ transposed(r)

    return inertia


@pytest.mark.parametrize("speed", [1.0, -2.0, 60.0])
def test_the_principal_gauge_follows_turning_axes(speed):
    """It turns with the tensor for many turns without a jump of sign, and undoes them: U(t) = U(0) R(t)^T."""
    there = sp.principal_gauge(sp.prescribed(rotating(speed), None, 6.0))
    t = np.linspace(0.0, 6.0, 60)
    back = Rotation.from_rotvec(-speed * t[:, None] * FIRST).as_matrix()
    np.testing.assert_allclose(there.frame(t), there.frame(0.0) @ back, atol=1e-12)
    omega = rates_of(there.frame, T, step=1e-2 / abs(speed))
    np.testing.assert_allclose(omega, np.stack([-speed * FIRST] * len(T)), atol=1e-9 * abs(speed))


def meeting(t):
    """Moments 1 + t/4, 1.4 and 2: the first two meet at t = 1.6."""
    return np.stack([np.diag([1.0 + 0.25 * s, 1.4, 2.0]) for s in t])


def test_where_moments_meet_there_is_no_principal_gauge():
    with pytest.raises(GaugeError, match="two principal moments meet at t = ") as caught:
        sp.principal_gauge(sp.prescribed(meeting, None, 6.0))
    said = float(str(caught.value).split("t = ")[1].split(" s")[0])
    assert said == pytest.approx(1.6, abs=1e-4)


def test_a_symmetric_body_has_no_principal_gauge():
    with pytest.raises(GaugeError, match="horizontal gauge"):
        sp.principal_gauge(sp.rigid(np.diag([1.0, 2.0, 2.0]), 1.0))


@pytest.mark.parametrize("width", [0.3, 0.1, 0.01])
@pytest.mark.parametrize("middle", [3.0, 3.09375, 3.042])
def test_moments_that_change_places_for_a_moment(width, middle):
    """However briefly they cross: a GaugeError, or a frame that is a rotation wherever it is asked for; no garbage."""

    def inertia(t):
        first = 1.0 + 0.2 * np.exp(-(((t - middle) / width) ** 2))
        return np.stack([np.diag([m, 1.1, 1.5]) for m in first])

    deformation = sp.prescribed(inertia, None, 6.0)
    t = middle + width * np.linspace(-3.0, 3.0, 61)
    try:
        frame = sp.principal_gauge(deformation).frame(t)
    except GaugeError:
        return
    np.testing.assert_allclose(frame @ transposed(frame), np.stack([np.eye(3)] * 61), atol=1e-12)


def test_horizontal_and_principal_gauges_differ():
    """B5, remark 2.12: diagonal axes generally carry internal momentum."""
    cat = sp.load_body("cat")
    deformation = sp.articulated(cat, random_loop(cat, np.random.default_rng(3), amplitude=0.6))
    momentum = sp.principal_gauge(deformation).internal_momentum(np.linspace(0, 1.5, 9))
    assert np.abs(momentum).max() > 1e-3 * np.abs(deformation.internal_momentum(np.linspace(0, 1.5, 9))).max()
