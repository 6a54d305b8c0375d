"""Shares of wheels in a turn, against motions reconstructed one by one and orders counted one by one."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import ShapeError, WrongObjectError
from support.gyroscope import gyroscope

_TIMES = np.linspace(0.0, 1.5, 7)
_JOINTS = ("swing", "slide")
_SAMPLES = 0.3 * np.random.default_rng(3).normal(size=(7, 2))
_SPEED = (_TIMES, 20.0 + 10.0 * np.sin(2.0 * _TIMES))
_MOMENTUM = np.array([0.05, -0.02, 0.08])
_AXIS = np.array([0.0, 0.6, 0.8])
GROUPS = ("swing", "slide", "wheels")


@pytest.fixture(scope="module")
def body(tmp_path_factory: pytest.TempPathFactory) -> sp.Body:
    return gyroscope(tmp_path_factory.mktemp("body"))


def motion_of(body: sp.Body, moving: tuple[str, ...] = GROUPS, *, momentum: np.ndarray = _MOMENTUM) -> sp.Motion:
    """The motion in which joints that are not among `moving` rest, and wheels store nothing unless they are."""
    samples = np.where([name in moving for name in _JOINTS], _SAMPLES, _SAMPLES[0])
    path = sp.ShapePath.spline(_TIMES, samples, periodic=False, joint_names=_JOINTS)
    turning = "wheels" in moving
    wheels = {"rotors": {"gyro": 0.3 * turning}, "rotor_speeds": {"fly": _SPEED if turning else 0.0}}
    return sp.reconstruct(sp.articulated(body, path, **wheels), momentum, tolerance=1e-10)


def turn(motion: sp.Motion, about: np.ndarray = _AXIS) -> float:
    """Integral of the angular velocity's component along an inertial axis, by Gauss between the knots."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    half = 0.5 * np.diff(_TIMES)[:, None]
    times = (_TIMES[:-1, None] + half * (1.0 + nodes)).ravel()
    spins = (motion.attitude(times) @ motion.angular_velocity(times)[..., None])[..., 0]
    return float((half * weights).ravel() @ (spins @ about))


def shares_of(motion: sp.Motion, **given) -> sp.Contributions:
    return sp.contributions(motion, of="rotation", about=_AXIS, **{"groups": "joints"} | given)


def test_wheels_are_a_group_whose_share_is_that_of_all_orders(body: sp.Body):
    shares = shares_of(motion_of(body))
    assert shares.held_names == GROUPS
    assert shares.groups == {"swing": ("swing",), "slide": ("slide",), "wheels": ("gyro", "fly")}
    assert shares.rest == ()
    turns = {
        frozenset(some): turn(motion_of(body, tuple(some)))
        for some in ([g for k, g in enumerate(GROUPS) if mask >> k & 1] for mask in range(8))
    }
    whole, none = turns[frozenset(GROUPS)], turns[frozenset()]
    gains = [
        [turns[frozenset(order[: order.index(g) + 1])] - turns[frozenset(order[: order.index(g)])] for g in GROUPS]
        for order in permutations(GROUPS)
    ]
    np.testing.assert_allclose(shares.shared, np.mean(gains, axis=0), rtol=0, atol=1e-8)
    np.testing.assert_allclose([shares.whole, shares.none], [whole, none], rtol=0, atol=1e-8)
    np.testing.assert_allclose(shares.alone, [turns[frozenset([g])] for g in GROUPS], rtol=0, atol=1e-8)
    np.testing.assert_allclose(shares.without, [turns[frozenset({*GROUPS} - {g})] for g in GROUPS], rtol=0, atol=1e-8)
    assert shares.shared.sum() == pytest.approx(shares.whole - shares.none, abs=1e-12)
    assert abs(shares.shared[2]) > 0.02, "wheels must matter"
    table = str(shares)
    assert "wheels without momentum" in table
    assert any(line.startswith("wheels ") for line in table.splitlines())
    assert shares.to_dict()["groups"]["wheels"] == ["gyro", "fly"]


def test_direct_shares_of_wheels_are_what_their_momentum_turns_the_body_by(body: sp.Body):
    motion = motion_of(body)
    direct = shares_of(motion).direct
    assert {*direct.sources} == {"momentum", "swing", "slide", "gyro", "fly"}
    assert direct.total.sum() == pytest.approx(turn(motion), abs=1e-8)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    half = 0.5 * np.diff(_TIMES)[:, None]
    times = (_TIMES[:-1, None] + half * (1.0 + nodes)).ravel()
    stored = np.linalg.solve(motion.deformation.inertia(times), motion.deformation.stored_momentum(times)[..., None])
    expected = -(half * weights).ravel() @ ((motion.attitude(times) @ stored)[..., 0] @ _AXIS)
    by_source = dict(zip(direct.sources, direct.total, strict=True))
    assert by_source["gyro"] + by_source["fly"] == pytest.approx(expected, abs=1e-8)


def test_wheels_in_no_group_keep_what_they_store(body: sp.Body):
    shares = shares_of(motion_of(body), groups={"arm": ["swing"]})
    assert shares.rest == ("slide", "gyro", "fly")
    assert shares.none == pytest.approx(turn(motion_of(body, ("slide", "wheels"))), abs=1e-8)
    named = shares_of(motion_of(body), groups={"arm": ["s*", "gyro"], "wheels": ()})
    assert named.groups == {"arm": ("swing", "slide"), "wheels": ("gyro", "fly")}
    assert named.none == pytest.approx(turn(motion_of(body, ())), abs=1e-8)


def test_the_difference_of_two_motions_is_shared_with_wheels(body: sp.Body):
    first, second = motion_of(body), motion_of(body, ("swing",))
    shares = shares_of(first, baseline=second)
    assert shares.held_names == GROUPS
    assert shares.none == pytest.approx(turn(second), abs=1e-8)
    assert shares.shared.sum() == pytest.approx(turn(first) - turn(second), abs=2e-8)
    alone = shares.alone[2]
    assert alone == pytest.approx(turn(motion_of(body, ("swing", "wheels"))), abs=1e-8)
    with pytest.raises(ShapeError, match="differ in wheels"):
        shares_of(first, baseline=second, groups={"arm": ["s*"]})


def test_what_wheels_do_not_have_is_refused(body: sp.Body):
    motion = motion_of(body)
    with pytest.raises(WrongObjectError, match="rim is a wheel"):
        shares_of(motion, link="rim")
    with pytest.raises(ShapeError, match="no mirrored motion"):
        shares_of(motion, baseline="mirrored", lateral="y")
    path = sp.ShapePath.spline(_TIMES, np.zeros((7, 3)), periodic=False, joint_names=[*_JOINTS, "fly"])
    other = sp.reconstruct(sp.articulated(body, path, rotors={"gyro": 0.1}), _MOMENTUM)
    with pytest.raises(WrongObjectError, match="fly by its speed, the baseline gyro by its momentum"):
        shares_of(motion, baseline=other)
    cat = sp.reconstruct(sp.articulated(sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.6)), _AXIS)
    with pytest.raises(ShapeError, match="no wheels"):
        sp.contributions(cat, of="rotation", groups={"waist": "waist_*", "wheels": ()})
