"""The principal frame against closed forms, through crossings, avoided crossings and intervals of equal moments."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.deformation._principal_frame import principal_frames
from shapephase.errors import GaugeError, TrajectoryError
from support.bodies import joint, link, random_loop, urdf
from support.long_runs import full_but

EYE, X, Y, Z = np.eye(3), *np.eye(3)
FIRST, SECOND = np.array([0.6, 0.3, -0.5]), np.array([0.1, -0.7, 0.4])
T = np.linspace(0.0, 2.0, 801)
WEIGHTS = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}


def transposed(matrices):
    return np.swapaxes(matrices, -1, -2)


def about(axis, angles):
    return Rotation.from_rotvec(np.multiply.outer(angles, axis)).as_matrix()


def turning(t):
    """R(t) of a body that turns smoothly, and its angular velocity in fixed axes."""
    first, second = about(FIRST, 0.3 + 1.2 * t + 0.4 * np.sin(3.0 * t)), about(SECOND, np.cos(t))
    rate = (1.2 + 1.2 * np.cos(3.0 * t))[:, None] * FIRST - np.sin(t)[:, None] * (first @ SECOND)
    return first @ second, rate


def still(t):
    return np.broadcast_to(EYE, (len(t), 3, 3)), np.zeros((len(t), 3))


def diagonal(*moments):
    """Times -> diagonal tensors of these functions of time or numbers."""
    return lambda t: (
        np.stack([np.broadcast_to(m(t) if callable(m) else m, t.shape) for m in moments], -1)[..., None] * (EYE)
    )


def seen(tensors, motion):
    """Tensors of a body that turns."""

    def inertia(t):
        r, _ = motion(t)
        return r @ tensors(t) @ transposed(r)

    return inertia


def prescribed(inertia, breaks=(), duration=2.0):
    return sp.prescribed(inertia, None, duration, breaks)


def looked_at(deformation):
    """Look at its functions, as is done once before anything else; the times at which they were evaluated till then."""
    scan = deformation.scan
    # The two ends, by which a loop is known.
    return scan.evaluations + 2


def off_diagonal(deformation, frames, t):
    """The largest entry off the diagonal, per trace."""
    u, _ = frames(t)
    there = u @ deformation.inertia(t) @ transposed(u)
    return np.max(np.abs(there - there * EYE), axis=(1, 2), initial=0.0) / np.trace(there, axis1=1, axis2=2)


def named(frame):
    """The signed permutation matrix that a matrix is near to; fails if it is near to none."""
    name = np.round(frame)
    np.testing.assert_allclose(np.abs(name).sum(axis=0), 1.0)
    np.testing.assert_allclose(np.abs(name).sum(axis=1), 1.0)
    return name


def assert_rotations(u):
    np.testing.assert_allclose(u @ transposed(u), np.broadcast_to(EYE, u.shape), atol=1e-14, rtol=0)
    np.testing.assert_allclose(np.linalg.det(u), 1.0, atol=1e-14, rtol=0)


def assert_continuous(frames, duration=2.0, fastest=None):
    """No jump at any multiple of duration/2^14, where halving puts its joints, nor at any other time."""
    t = duration * np.arange(1, 2**14) / 2**14
    before, after = frames(np.nextafter(t, 0.0)), frames(t)
    speed = np.maximum(np.abs(before[1]), np.abs(after[1])).max(axis=1)
    step = 1e-14 + 4.0 * np.spacing(t) * speed
    assert np.all(np.abs(before[0] - after[0]).max(axis=(1, 2)) < step)
    if fastest is not None:
        assert speed.max() < fastest


def assert_rates(frames, t, step, tolerance):
    """hat(rate) = U^T U', by nine-point differences."""
    slope = sum(w * (frames(t + k * step)[0] - frames(t - k * step)[0]) for k, w in WEIGHTS.items()) / step
    u, rate = frames(t)
    spin = transposed(u) @ slope
    want = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)
    np.testing.assert_allclose(rate, want, atol=tolerance * max(1.0, np.abs(want).max()), rtol=0)


def assert_rule(deformation, frames, later=1e-3):
    """Moments ascend just after the start; the first two axes lie along their largest base component."""
    u, _ = frames(np.array([0.0, later]))
    moments = np.diag(u[1] @ deformation.inertia(later) @ u[1].T)
    assert np.all(np.diff(moments) > 0.0)
    for axis in u[0, :2]:
        assert axis[np.argmax(np.abs(axis))] > 0.0
    np.testing.assert_allclose(np.cross(u[0, 0], u[0, 1]), u[0, 2], atol=1e-14, rtol=0)


# ---- Meetings at an instant -----------------------------------------------------------------------------------------

# Moments as functions of the time from the meeting, how near the axes and their rates are, and when order is seen.
# The flatter the meeting, the less the inertia tells of the axes there.
MEETINGS = {
    "crossing": ((lambda s: 1.0 + 0.3 * s, lambda s: 1.0 - 0.2 * s, 1.7), 5e-12, 1e-9, 1e-6),
    "crossing the largest": ((1.2, lambda s: 1.7 + 0.2 * s, lambda s: 1.7 - 0.1 * s), 5e-12, 1e-9, 1e-6),
    "three at once": ((lambda s: 1.0 + 0.3 * s, lambda s: 1.0 - 0.2 * s, 1.0), 5e-12, 1e-9, 1e-6),
    "touching": ((lambda s: 1.0 + 0.3 * s**2, 1.0, 1.7), 1e-9, 1e-7, 1e-3),
    "two crossings 1e-3 apart": ((lambda s: 1.0 + 0.3 * s * (s - 1e-3), 1.0, 1.7), 1e-9, 1e-7, 1e-4),
    "two crossings 1e-7 apart": ((lambda s: 1.0 + 0.3 * s * (s - 1e-7), 1.0, 1.7), 1e-9, 1e-7, 1e-3),
    "cubic": ((lambda s: 1.0 + 0.05 * s**3, 1.0, 1.7), 1e-7, 1e-5, 0.01),
    "touching closely": ((lambda s: 1.0 + 0.03 * s**4, 1.0, 1.7), 1e-6, 1e-4, 0.1),
}


@pytest.mark.parametrize("when", full_but([0.0, 0.25, 0.5, 0.7, 1.0, 1.999999, 2.0], 0.7))
@pytest.mark.parametrize("motion", full_but([still, turning], turning))
@pytest.mark.parametrize("meeting", MEETINGS)
def test_where_moments_meet_the_axes_go_straight_on(meeting, motion, when):
    """U = P R^T with one signed permutation P for all time, whatever the order of the moments."""
    moments, near, near_rate, later = MEETINGS[meeting]
    moments = [(lambda t, m=m: m(t - when)) if callable(m) else m for m in moments]
    deformation = prescribed(seen(diagonal(*moments), motion))
    frames = principal_frames(deformation)
    t = np.unique(np.concatenate([T, np.clip(when + np.geomspace(1e-9, 1e-2, 15), 0, 2), [when]]))
    (u, rate), (r, spin) = frames(t), motion(t)
    assert_rotations(u)
    straight, clear = u @ r, np.argmax(np.abs(t - when))
    np.testing.assert_allclose(straight, np.broadcast_to(named(straight[clear]), u.shape), atol=near, rtol=0)
    np.testing.assert_allclose(rate, -spin, atol=near_rate, rtol=0)
    assert off_diagonal(deformation, frames, t).max() < (1e-12 if near < 1e-8 else 1e-11)
    assert_continuous(frames)
    assert_rule(deformation, frames, later if when == 0.0 else 0.0)


def test_frames_and_rates_of_a_clear_case():
    """Where the gaps are wide both are exact to rounding."""
    frames = principal_frames(prescribed(seen(diagonal(1.0, 1.3, 1.7), turning)))
    (u, rate), (r, spin) = frames(T), turning(T)
    np.testing.assert_allclose(u @ r, np.broadcast_to(named(u[0] @ r[0]), u.shape), atol=2e-13, rtol=0)
    np.testing.assert_allclose(rate, -spin, atol=2e-11, rtol=0)
    assert_rates(frames, np.linspace(0.03, 1.97, 50), 2e-3, 1e-10)


@pytest.mark.parametrize("when", full_but([-1.0, 0.0, 0.25, 0.5, 0.7, 0.75, 1.2, 1.25], 0.0, 0.5, 0.7))
def test_a_crossing_costs_no_more_than_a_clear_case(when):
    """Nothing is halved: four panels of 51 samples, and the choice at the start."""
    asked = []

    def inertia(t):
        asked.append(len(t))
        return seen(diagonal(lambda s: 1.2 + 0.1 * (s - when), 1.2, 1.7), turning)(t)

    deformation = prescribed(inertia)
    asked_before = looked_at(deformation)
    principal_frames(deformation)
    assert sum(asked) - asked_before < 300


def test_a_long_motion():
    """A thousand radians in twelve days: as many panels as a fast motion, no fewer digits in the end."""
    asked = []

    def inertia(t):
        asked.append(len(t))
        return seen(diagonal(1.0, 1.3, 1.7), lambda t: (about(X, 1e-3 * t), None))(t)

    deformation = prescribed(inertia, duration=1e6)
    asked_before = looked_at(deformation)
    frames = principal_frames(deformation)
    assert sum(asked) - asked_before < 12_000
    t = 1e6 * (1.0 - np.linspace(0.0, 1e-3, 201))
    assert off_diagonal(deformation, frames, t).max() < 1e-13
    np.testing.assert_allclose(frames(t)[1], np.broadcast_to(-1e-3 * X, (201, 3)), atol=1e-13, rtol=0)


@pytest.mark.parametrize("gap", full_but([1e-6, 1e-8, 1e-10, 3e-12, 1e-12], 1e-6, 1e-12))
def test_nearly_symmetric_bodies(gap):
    """The distinct axis does not suffer from what rounding leaves open about the other two."""
    asked = []

    def inertia(t):
        asked.append(len(t))
        return seen(diagonal(1.0, 1.0 + gap, 1.7), turning)(t)

    deformation = prescribed(inertia)
    asked_before = looked_at(deformation)
    frames = principal_frames(deformation)
    assert sum(asked) - asked_before < 2500
    (u, rate), (r, spin) = frames(T), turning(T)
    np.testing.assert_allclose(u[:, 2], (u[0, 2] @ r[0, :, 2]) * r[:, :, 2], atol=3e-13, rtol=0)
    assert off_diagonal(deformation, frames, T).max() < 4e-13
    across = rate + spin - np.sum((rate + spin) * r[:, :, 2], axis=1)[:, None] * r[:, :, 2]
    np.testing.assert_allclose(across, 0.0, atol=1e-9, rtol=0)
    assert_continuous(frames, fastest=10.0)


@settings(deadline=None, derandomize=True)
@given(
    st.lists(st.floats(-1.0, 1.0), min_size=12, max_size=12),
    st.lists(st.floats(-0.4, 0.4), min_size=9, max_size=9),
)
def test_any_smooth_motion_with_any_smooth_moments(turns, curves):
    """Random rotations and moments, which cross where they like; off the diagonal there is nothing."""
    a, c = np.reshape(turns, (4, 3)), np.reshape(curves, (3, 3))

    def motion(t):
        vector = a[0] + np.sin(np.multiply.outer(t, [1.0, 1.7, 2.3])) @ a[1:]
        return Rotation.from_rotvec(vector).as_matrix(), None

    moments = [lambda t, k=k: 1.5 + np.cos(np.multiply.outer(t, [1.0, 2.0, 3.0]) + k) @ c[k] for k in range(3)]
    deformation = prescribed(seen(diagonal(*moments), motion))
    frames = principal_frames(deformation)
    assert off_diagonal(deformation, frames, T).max() < 1e-12
    u, rate = frames(T)
    assert_rotations(u)
    assert_continuous(frames)
    halves = np.diff(T)[:, None] * 0.5 * (rate[1:] + rate[:-1])
    turned = Rotation.from_matrix(transposed(u[:-1]) @ u[1:]).as_rotvec()
    np.testing.assert_allclose(turned, halves, atol=1e-4 * (1.0 + np.abs(rate).max() ** 3), rtol=0)


# ---- Avoided crossings ----------------------------------------------------------------------------------------------


def avoided(e, when=0.7):
    """Moments that would cross at `when`, with half gap e there; the axes lie at 0.5 atan2(e, d) about z."""

    def inertia(t):
        d = 0.3 * (t - when)
        tensors = diagonal(1.0, 1.0, 1.7)(t)
        tensors[:, 0, 0] += d
        tensors[:, 1, 1] -= d
        tensors[:, 0, 1] = tensors[:, 1, 0] = e
        return tensors

    return inertia


@pytest.mark.parametrize("when", full_but([0.0, 0.7, 1.0, 2.0], 0.7))
@pytest.mark.parametrize(("e", "near_rate"), [(1e-1, 1e-9), (1e-2, 1e-8), (1e-4, 3e-5), (1e-6, 2e-3), (1e-8, 3e-2)])
def test_an_avoided_crossing_turns_the_axes(e, near_rate, when):
    """What the axes lack, times the gap, is off the diagonal: next to nothing."""
    deformation = prescribed(avoided(e, when))
    frames = principal_frames(deformation)
    t = np.unique(np.clip(np.concatenate([T, when + e / 0.3 * np.sinh(np.linspace(-20, 20, 401))]), 0, 2))
    d = 0.3 * (t - when)
    gap = 2.0 * np.hypot(d, e)
    u, rate = frames(t)
    turned = u @ about(Z, 0.5 * np.arctan2(e, d))
    lack = np.abs(turned - named(turned[np.argmax(gap)])).max(axis=(1, 2))
    # Times are rounded, too: at e = 1e-8 the axes turn by 1e-9 from one to the next.
    assert np.all(lack < (1e-13 if e > 1e-3 else 2e-11) / gap + 1e-16 / e + 1e-14)
    assert off_diagonal(deformation, frames, t).max() < 3e-12
    # U = P exp(-phi z), phi' = -e d' / (2 (d^2 + e^2)).
    want = 0.5 * e * 0.3 / (d**2 + e**2)
    np.testing.assert_allclose(rate, want[:, None] * Z, atol=near_rate * want.max(), rtol=0)
    assert want.max() > 0.1 / e


@pytest.mark.parametrize(
    ("e", "when"), full_but(product([1e-9, 1e-10, 3e-11, 1e-11, 3e-12], [0.7, 1.0]), (1e-9, 0.7), (3e-12, 1.0))
)
def test_axes_that_turn_in_an_instant(e, when):
    """Either they are followed, or the error tells the time; off the diagonal nothing is hidden."""
    deformation = prescribed(avoided(e, when))
    frames = frames_or_error(deformation, when, 1e-7)
    t = np.unique(np.concatenate([T, when + e * np.sinh(np.linspace(-20, 20, 401))]).clip(0, 2))
    assert frames is None or off_diagonal(deformation, frames, t).max() < 1e-11


def frames_or_error(deformation, when, near):
    """The frames, or None after an error that tells this time."""
    try:
        return principal_frames(deformation)
    except GaugeError as error:
        np.testing.assert_allclose(said_time(error), when, atol=near, rtol=0)
        return None


def said_time(error):
    return float(str(error).split("t = ")[1].split(" s")[0])


@pytest.mark.parametrize("e", [1e-12, 1e-13, 1e-15])
def test_a_coupling_by_rounding_is_passed_straight(e):
    frames = principal_frames(prescribed(avoided(e)))
    u, rate = frames(T)
    np.testing.assert_allclose(u, np.broadcast_to(named(u[0]), u.shape), atol=1e-8, rtol=0)
    assert np.abs(rate).max() < 1e-2


# ---- Moments equal over an interval ---------------------------------------------------------------------------------


def interval(turn, base=(1.0, 1.0, 1.7), apart=(1.0, -1.0, 0.0)):
    """Moments that are equal from 0.5 to 1.5; afterwards the axes are turned."""

    def inertia(t):
        before, after = np.minimum(t - 0.5, 0.0), np.maximum(t - 1.5, 0.0)
        turned = turn @ np.diag(apart) @ turn.T
        return np.diag(base) + 0.3 * (np.multiply.outer(before, np.diag(apart)) + np.multiply.outer(after, turned))

    return inertia


def nearest_quarter(angle):
    return (angle + np.pi / 4) % (np.pi / 2) - np.pi / 4


@pytest.mark.parametrize("base", [(1.0, 1.0, 1.7), (1.0, 1.0, 1.0)])
@pytest.mark.parametrize("angle", [0.0, np.pi / 2])
def test_axes_that_are_the_same_before_and_after_an_interval_of_equal_moments(angle, base):
    deformation = prescribed(interval(about(Z, angle), base), (0.5, 1.5))
    frames = principal_frames(deformation)
    u, rate = frames(T)
    np.testing.assert_allclose(u, np.broadcast_to(named(u[0]), u.shape), atol=5e-12, rtol=0)
    np.testing.assert_allclose(rate, 0.0, atol=1e-9, rtol=0)
    assert_continuous(frames)


@pytest.mark.parametrize("base", [(1.0, 1.0, 1.7), (1.0, 1.0, 1.0)])
@pytest.mark.parametrize("angle", [0.3, 2.0])
def test_axes_that_are_others_after_an_interval_of_equal_moments(angle, base):
    with pytest.raises(GaugeError, match=f"jump by {abs(np.degrees(nearest_quarter(angle))):.3g} degrees") as caught:
        principal_frames(prescribed(interval(about(Z, angle), base), (0.5, 1.5)))
    assert said_time(caught.value) == 1.5


@pytest.mark.parametrize("side", ["start", "end"])
def test_equal_moments_that_part_on_one_side_only(side):
    """Nothing turns about the distinct axis while the others are equal: the axes of the end come too late."""

    def first(t):
        return 1.0 + 0.3 * (np.maximum(t - 0.8, 0.0) if side == "start" else np.maximum(0.8 - t, 0.0))

    deformation = prescribed(seen(diagonal(first, 1.0, 1.7), turning), (0.8,))
    if side == "start":
        with pytest.raises(GaugeError, match=r"jump by .* at t = 0\.8 s"):
            principal_frames(deformation)
        return
    frames = principal_frames(deformation)
    (_, rate), (r, spin) = frames(T), turning(T)
    np.testing.assert_allclose(np.sum(rate * r[:, :, 2], axis=1)[T > 0.801], 0.0, atol=1e-10, rtol=0)
    np.testing.assert_allclose(rate[T < 0.799], -spin[T < 0.799], atol=1e-8, rtol=0)
    assert off_diagonal(deformation, frames, T).max() < 1e-13
    assert_continuous(frames)
    assert_rule(deformation, frames)


# ---- Bodies whose moments are never separate ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("moments", "frame"),
    [
        ((1, 1, 1), [X, Y, Z]),
        ((1, 2, 2), [X, Y, Z]),
        ((2, 1, 2), [Y, X, -Z]),
        ((1, 1, 2), [X, Y, Z]),
        ((2, 2, 1), [Z, X, Y]),
        ((1, 2, 3), [X, Y, Z]),
        ((3, 2, 1), [Z, Y, -X]),
    ],
)
def test_rigid_bodies(moments, frame):
    deformation = sp.rigid(np.diag(np.array(moments, dtype=float)), 2.0)
    u, rate = principal_frames(deformation)(T)
    np.testing.assert_allclose(u, np.broadcast_to(frame, u.shape), atol=1e-14, rtol=0)
    np.testing.assert_allclose(rate, 0.0, atol=1e-10, rtol=0)


@pytest.mark.parametrize(
    "vector",
    [
        (0.3, -0.8, 0.5),
        (1.2, 0.1, -0.4),
        (-0.2, 1.3, 0.7),
        (2.0, 1.0, 0.3),
        *np.random.default_rng(1).normal(size=(4, 3)),
    ],
)
def test_a_tilted_body_of_revolution(vector):
    """One axis lies in the plane of the distinct axis and of the base axis farthest from it."""
    turn = Rotation.from_rotvec(vector).as_matrix()
    for moments in ((1.0, 1.0, 1.7), (1.7, 1.7, 1.0)):
        deformation = sp.rigid(turn @ np.diag(moments) @ turn.T, 2.0)
        u, _ = principal_frames(deformation)(np.array([0.0, 2.0]))
        np.testing.assert_allclose(u[0], u[1], atol=1e-14, rtol=0)
        assert_rotations(u)
        distinct = turn[:, 2]
        farthest = EYE[np.argmin(np.abs(distinct))]
        volumes = np.abs([np.linalg.det([axis, distinct, farthest]) for axis in u[0]])
        assert np.sort(volumes)[1] < 1e-14
        place = 2 if moments[2] > 1.0 else 0
        np.testing.assert_allclose(np.abs(u[0, place] @ distinct), 1.0, atol=1e-14, rtol=0)
        for axis in u[0, :2]:
            assert axis[np.argmax(np.abs(axis))] > 0.0
        one, other = (np.argmax(np.abs(axis)) for k, axis in enumerate(u[0]) if k != place)
        assert one < other


@pytest.mark.parametrize("axis", [(1.0, 1.0, 3.0), (-1.0, 1.0, 3.0), (1.0, 1.0, 1.0), (2.0, 5.0, -2.0)])
def test_rounding_does_not_choose_among_base_axes(axis):
    """Base axes equally far from the distinct one: the first of them counts."""
    unit = np.array(axis) / np.linalg.norm(axis)
    frames = []
    for seed in range(8):
        noise = np.random.default_rng(seed).uniform(-3e-16, 3e-16, (3, 3))
        tensor = EYE + 0.7 * np.outer(unit, unit) + noise + noise.T
        frames.append(principal_frames(sp.rigid(tensor, 2.0))(np.zeros(1))[0][0])
    np.testing.assert_allclose(frames, np.broadcast_to(frames[0], (8, 3, 3)), atol=1e-14, rtol=0)


@pytest.mark.parametrize("moments", [(1.0, 1.0, 1.7), (1.7, 1.7, 1.0), (1.0, 1.0, lambda t: 0.7 + 0.4 * t)])
def test_a_turning_body_of_revolution_is_carried_parallel(moments):
    """Also where its moments cross."""
    deformation = prescribed(seen(diagonal(*moments), turning))
    frames = principal_frames(deformation)
    (u, rate), (r, _) = frames(T), turning(T)
    np.testing.assert_allclose(np.sum(rate * r[:, :, 2], axis=1), 0.0, atol=1e-10, rtol=0)
    along = np.einsum("nij,nj->ni", u, r[:, :, 2])
    np.testing.assert_allclose(along, np.broadcast_to(np.round(along[0]), along.shape), atol=1e-12, rtol=0)
    assert np.abs(along[0]).max() > 0.5
    assert off_diagonal(deformation, frames, T).max() < 1e-14
    assert_continuous(frames)
    assert_rates(frames, np.linspace(0.03, 1.97, 50), 2e-3, 1e-10)


@pytest.mark.filterwarnings("ignore::shapephase.errors.UndeclaredBreakWarning")
@pytest.mark.parametrize("when", [0.9, 0.777])
def test_a_disc_becomes_a_rod_at_a_time_that_is_no_break(when):
    """The instant has some width when it is found by halving, but the frame does not turn in it."""

    def inertia(t):
        way = np.where((t < when)[:, None, None], np.diag([0.0, 0.0, 1.0]), np.diag([1.0, 0.0, 0.0]))
        return EYE + 0.3 * (t - when)[:, None, None] * way

    frames = frames_or_error(prescribed(inertia), when, 1e-9)
    if frames is not None:
        t = np.unique(np.concatenate([T, when + np.linspace(-1e-10, 1e-10, 1001)]))
        np.testing.assert_allclose(
            frames(t)[0], np.broadcast_to(named(frames(t)[0][0]), (len(t), 3, 3)), atol=1e-9, rtol=0
        )


def test_a_disc_cannot_become_a_rod_along_a_slanted_axis():
    rod = about(X, 0.5)

    def inertia(t):
        way = np.where((t < 0.9)[:, None, None], np.diag([0.0, 0.0, 1.0]), rod @ np.diag([0.0, 0.0, 1.0]) @ rod.T)
        return EYE + 0.3 * (t - 0.9)[:, None, None] * way

    with pytest.raises(GaugeError, match="degrees") as caught:
        principal_frames(prescribed(inertia, (0.9,)))
    assert said_time(caught.value) == 0.9


# ---- No continuous frame --------------------------------------------------------------------------------------------


def jumping(when, power, angle=np.pi / 4):
    """Two moments meet at an instant, and go on along axes turned by an angle."""

    def inertia(t):
        way = np.where((t < when)[:, None, None], EYE, about(Z, angle)) @ np.diag([1.0, -1.0, 0.0])
        way = np.where((t < when)[:, None, None], way, way @ about(Z, -angle))
        return np.diag([1.0, 1.0, 1.7]) + 0.3 * ((t - when) ** power)[:, None, None] * way

    return inertia


JUMPS = [*product([1, 2], [0.9, 1.0], [0.3, np.pi / 4, 1.2]), (1, 0.9, 0.01)]


@pytest.mark.parametrize(("power", "when", "angle"), full_but(JUMPS, *JUMPS[1::4], JUMPS[-1]))
def test_axes_that_jump_at_a_break(power, when, angle):
    with pytest.raises(GaugeError, match=f"jump by {abs(np.degrees(nearest_quarter(angle))):.3g} degrees") as caught:
        principal_frames(prescribed(jumping(when, power, angle), (when,)))
    assert said_time(caught.value) == when
    assert "horizontal gauge" in str(caught.value)
    assert "kg m^2" in str(caught.value)


@pytest.mark.filterwarnings("ignore::shapephase.errors.UndeclaredBreakWarning")
@pytest.mark.parametrize("when", [0.9, 1.0, 0.123])
def test_axes_that_jump_at_a_time_that_is_no_break(when):
    with pytest.raises(GaugeError) as caught:
        principal_frames(prescribed(jumping(when, 1)))
    assert said_time(caught.value) == pytest.approx(when, abs=1e-9)


@pytest.mark.parametrize("breaks", [(), (0.9,)])
def test_an_inertia_that_jumps(breaks):
    turn = Rotation.from_rotvec([0.2, 0.1, 0.1]).as_matrix()
    one, two = np.diag([1.0, 1.3, 1.7]), turn @ np.diag([1.0, 1.3, 1.7]) @ turn.T
    # Where no break was declared it is refused already by the look at the function.
    with pytest.raises(GaugeError if breaks else TrajectoryError) as caught:
        principal_frames(prescribed(lambda t: np.where((t < 0.9)[:, None, None], one, two), breaks))
    if breaks:
        assert said_time(caught.value) == pytest.approx(0.9, abs=1e-9)
    else:
        assert " at 0.9 s; an inertia must be continuous" in str(caught.value)


@pytest.mark.filterwarnings("ignore::shapephase.errors.UndeclaredBreakWarning")
@pytest.mark.parametrize("power", [2, 3, 4])
def test_moments_that_part_too_slowly_to_tell(power):
    """Where they are equal to rounding for a while the frame may turn; a jump that cannot be seen does no harm."""
    for breaks in ((), (0.9,)):
        deformation = prescribed(jumping(0.9, power), breaks)
        frames = frames_or_error(deformation, 0.9, 1e-3)
        if frames is not None:
            t = np.unique(np.concatenate([T, 0.9 + np.linspace(-1e-3, 1e-3, 401)]))
            assert off_diagonal(deformation, frames, t).max() < 1e-11
            assert_continuous(frames)
    assert frames is None or power > 2


def flat(angle):
    """Moments whose difference vanishes with all derivatives at 0.9 (Rellich), axes at any angle of time there."""

    def inertia(t):
        s = np.where(t == 0.9, 1.0, t - 0.9)
        size, phase = np.where(t == 0.9, 0.0, np.exp(-1.0 / s**2)), 2.0 * angle(s)
        tensors = diagonal(1.0, 1.0, 1.7)(t)
        tensors[:, 0, 0] += size * np.cos(phase)
        tensors[:, 1, 1] -= size * np.cos(phase)
        tensors[:, 0, 1] = tensors[:, 1, 0] = size * np.sin(phase)
        return tensors

    return inertia


@pytest.mark.parametrize("angle", [lambda s: 0.4 * (s > 0.0), lambda s: 1.0 / s, lambda s: 3.0 / s])
def test_rellichs_examples(angle):
    """No eigenframe is continuous at 0.9; the moments are equal to rounding from 0.7 to 1.1."""
    with pytest.raises(GaugeError, match="jump") as caught:
        principal_frames(prescribed(flat(angle)))
    assert 0.7 < said_time(caught.value) < 1.1


# ---- Motions that are not smooth ------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore::shapephase.errors.UndeclaredBreakWarning")
@pytest.mark.parametrize("first", [0.7, lambda t: 1.0 + 0.3 * (t - 0.77)])
def test_a_kink_that_is_no_break(first):
    """The axes turn back at once at 0.77."""

    def motion(t):
        return about(FIRST, np.abs(t - 0.77)), None

    deformation = prescribed(seen(diagonal(first, 1.0, 1.7), motion))
    frames = principal_frames(deformation)
    t = np.unique(np.concatenate([T, 0.77 + np.linspace(-1e-6, 1e-6, 101)]))
    assert off_diagonal(deformation, frames, t).max() < 3e-12
    r, _ = motion(T)
    u, _ = frames(T)
    np.testing.assert_allclose(u @ r, np.broadcast_to(named(u[0] @ r[0]), u.shape), atol=1e-9, rtol=0)


def test_a_break_at_a_meeting():
    """A kink of the axes just where moments cross, declared."""

    def motion(t):
        return about(FIRST, np.abs(t - 0.77)), None

    deformation = prescribed(seen(diagonal(lambda t: 1.0 + 0.3 * (t - 0.77), 1.0, 1.7), motion), (0.77,))
    frames = principal_frames(deformation)
    (u, rate), (r, _) = frames(T), motion(T)
    np.testing.assert_allclose(u @ r, np.broadcast_to(named(u[0] @ r[0]), u.shape), atol=1e-12, rtol=0)
    side = np.sign(T - 0.77)[:, None] * (np.abs(T - 0.77) > 1e-9)[:, None]
    np.testing.assert_allclose(rate * side**2, -side * FIRST, atol=1e-9, rtol=0)


@pytest.mark.parametrize("speed", [60.0, 400.0])
def test_axes_that_turn_many_times(speed):
    def motion(t):
        return about(FIRST, speed * t), None

    frames = principal_frames(prescribed(seen(diagonal(1.0, 1.3, 1.7), motion)))
    (u, rate), (r, _) = frames(T), motion(T)
    np.testing.assert_allclose(u @ r, np.broadcast_to(named(u[0] @ r[0]), u.shape), atol=1e-12, rtol=0)
    np.testing.assert_allclose(rate, np.broadcast_to(-speed * FIRST, rate.shape), atol=1e-10 * speed, rtol=0)


# ---- Bodies ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", full_but([0, 1, 2], 0))
@pytest.mark.parametrize("name", full_but(["satellite", "cat", "example:human", "astronaut"], "satellite"))
def test_bodies_along_random_loops(name, seed):
    body, rng = sp.load_body(name), np.random.default_rng(seed)
    deformation = sp.articulated(body, random_loop(body, rng, harmonics=3, duration=2.0, amplitude=0.6))
    frames = principal_frames(deformation)
    t = np.linspace(0.0, 2.0, 2000)
    assert off_diagonal(deformation, frames, t).max() < 1e-12
    u, rate = frames(t)
    assert_rotations(u)
    assert_continuous(frames)
    assert_rule(deformation, frames, 0.0)
    assert_rates(frames, np.linspace(0.01, 1.99, 40), min(2e-3, 2e-2 / np.abs(rate).max()), 1e-6)
    ends = frames(np.array([0.0, 2.0]))[0]
    name_at_end = named(ends[1] @ deformation.closure @ ends[0].T)
    np.testing.assert_allclose(ends[1] @ ends[0].T, name_at_end, atol=1e-10, rtol=0)
    assert np.linalg.det(name_at_end) == pytest.approx(1.0)
    # Axes of moments that stay apart are those of an eigenvalue routine, in order.
    _, axes = np.linalg.eigh(deformation.inertia(t))
    np.testing.assert_allclose(np.abs(np.einsum("nij,nji->ni", u, axes)), 1.0, atol=1e-9, rtol=0)


@pytest.mark.parametrize("count", full_but([2, 33, 1000], 2, 33))
def test_a_loop_gone_round_many_times(count):
    body, rng = sp.load_body("cat"), np.random.default_rng(5)
    path = random_loop(body, rng, duration=2.0, amplitude=0.6)
    once, many = (principal_frames(sp.articulated(body, p)) for p in (path, path.repeated(count)))
    t = np.linspace(0.0, 2.0, 50, endpoint=False)
    closure = named(once(np.array([2.0]))[0][0] @ once(np.array([0.0]))[0][0].T)
    np.testing.assert_allclose(many(t)[0], once(t)[0], atol=3e-13, rtol=0)
    for loop in (1, count // 2, count - 1):
        late = many(2.0 * loop + t)
        power = np.linalg.matrix_power(closure, loop)
        np.testing.assert_allclose(late[0], power @ once(t)[0], atol=1e-11, rtol=0)
        np.testing.assert_allclose(late[1], once(t)[1], atol=1e-7, rtol=0)
        assert off_diagonal(sp.articulated(body, path.repeated(count)), many, 2.0 * loop + t).max() < 3e-14
    joints = 2.0 * np.arange(1, count)
    before, after = many(np.nextafter(joints, 0.0))[0], many(joints)[0]
    np.testing.assert_allclose(before, after, atol=1e-11, rtol=0)


@pytest.mark.parametrize("swing", [lambda t: 0.2 * t**2, lambda t: 0.1 * t * np.sin(np.pi * t / 2) ** 2])
def test_loops_of_which_a_gauge_made_something_else(swing):
    """A deformation says it is a loop gone round three times; seen from a frame that turns it is not."""
    body, rng = sp.load_body("cat"), np.random.default_rng(5)
    plain = sp.articulated(body, random_loop(body, rng, duration=2.0, amplitude=0.4).repeated(3))

    def u(t):
        rate = sum(w * (swing(t + k * 1e-2) - swing(t - k * 1e-2)) for k, w in WEIGHTS.items()) / 1e-2
        return about(SECOND, swing(t)), rate[:, None] * SECOND

    there = sp.in_gauge(plain, u)
    frames = principal_frames(there)
    t = np.linspace(0.0, 6.0, 601)
    assert off_diagonal(there, frames, t).max() < 1e-12
    assert_continuous(frames, 6.0)
    product, alone = frames(t)[0] @ u(t)[0], principal_frames(plain)(t)[0]
    np.testing.assert_allclose(product, named(product[0] @ alone[0].T) @ alone, atol=1e-10, rtol=0)


def test_a_loop_of_inexact_data_gone_round():
    """Samples that close to 5e-10 only: the inertia jumps by as much, the frame does not."""
    body, rng = sp.load_body("cat"), np.random.default_rng(5)
    shapes = 0.3 * rng.standard_normal((4, body.n_shape))
    shapes = np.concatenate([shapes, shapes[:1] + 5e-10])
    deformation = sp.articulated(body, sp.ShapePath.waypoints(np.linspace(0, 2, 5), shapes).repeated(3))
    frames = principal_frames(deformation)
    assert off_diagonal(deformation, frames, np.linspace(0.0, 6.0, 3001)).max() < 1e-9
    assert_continuous(frames, 6.0)


def sliders(coupling=0.0):
    """Two masses on a rail along x that move apart: Ixx stays, Iyy and Izz grow past it."""
    tensor = np.diag([2.0, 1.0, 1.4])
    tensor[0, 1] = tensor[1, 0] = coupling
    return urdf(
        link("hub", 5.0, tensor),
        link("left", 0.5, [1e-3] * 3),
        link("right", 0.5, [1e-3] * 3),
        joint("out_left", "prismatic", "hub", "left", axis=(-1.0, 0.0, 0.0)),
        joint("out_right", "prismatic", "hub", "right", axis=(1.0, 0.0, 0.0)),
    )


def apart(t):
    return 0.8 + 0.5 * np.sin(np.pi * t)


def sliding():
    return sp.ShapePath.function(
        lambda t: (np.stack([apart(t)] * 2, -1), np.stack([0.5 * np.pi * np.cos(np.pi * t)] * 2, -1)), 2.0
    )


def test_a_body_whose_moments_cross(load_urdf):
    """Ixx = 2.002, Iyy = 1.002 + x^2, Izz = 1.402 + x^2: four crossings, no turn."""
    deformation = sp.articulated(load_urdf(sliders()), sliding())
    frames = principal_frames(deformation)
    u, rate = frames(T)
    moments = np.linalg.eigvalsh(deformation.inertia(T))
    x = apart(T)
    np.testing.assert_allclose(
        moments, np.sort(np.stack([0 * x + 2.002, 1.002 + x**2, 1.402 + x**2], -1)), atol=1e-14, rtol=0
    )
    assert np.diff(moments).min() < 1e-2
    np.testing.assert_allclose(
        u,
        np.broadcast_to([Y, X, -Z] if apart(0) ** 2 > 0.6 else [Y, Z, X], u.shape),
        atol=1e-12,
        rtol=0,
    )
    np.testing.assert_allclose(rate, 0.0, atol=1e-9, rtol=0)
    assert off_diagonal(deformation, frames, T).max() < 1e-14
    seen_in = sp.reconstruct(deformation, [0.3, -1.0, 0.5], tolerance=1e-10)
    assert seen_in.error_estimate < 1e-9


@pytest.mark.parametrize("coupling", [1e-1, 1e-3, 1e-5, 1e-7])
def test_a_body_whose_moments_avoid_to_cross(load_urdf, coupling):
    """The axes in the plane of the coupling lie at 0.5 atan2(2 Ixy, Ixx - Iyy)."""
    deformation = sp.articulated(load_urdf(sliders(coupling)), sliding())
    frames = principal_frames(deformation)
    half_gap = 0.5 * (1.0 - apart(T) ** 2)
    u, _ = frames(T)
    turned = u @ about(Z, 0.5 * np.arctan2(coupling, half_gap))
    np.testing.assert_allclose(turned, np.broadcast_to(named(turned[0]), u.shape), atol=1e-9, rtol=0)
    assert off_diagonal(deformation, frames, T).max() < 3e-12
    # Each passage beyond the crossing and back turns the axes by a quarter and back.
    assert np.abs(np.diff(frames(np.array([1.0, 0.5, 1.5]))[0], axis=0)).max() > 0.6


def test_no_times_and_many_times():
    frames = principal_frames(prescribed(seen(diagonal(1.0, 1.3, 1.7), turning)))
    u, rate = frames(np.zeros(0))
    assert u.shape == (0, 3, 3)
    assert rate.shape == (0, 3)
    t = np.linspace(0.0, 2.0, 50_001)
    u, rate = frames(t)
    for start, end in pairwise([0, 777, 30_000, 50_001]):
        np.testing.assert_allclose(frames(t[start:end])[0], u[start:end], atol=2e-15, rtol=0)
        np.testing.assert_allclose(frames(t[start:end])[1], rate[start:end], atol=1e-12, rtol=0)
