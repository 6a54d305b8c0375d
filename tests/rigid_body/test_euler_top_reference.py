"""The Euler top against a frozen reference of 60 digits; `euler_top_reference.py` makes it and says what is in it.

Bodies with principal moments and body momentum given as doubles, in all orders and octants, at six times up to 100
characteristic times either way. Momentum errors are relative to |Pi|, attitude errors are angles.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shapephase import so3
from shapephase.rigid_body import EulerTop
from support.independent import cross
from support.long_runs import full_but
from support.places import DATA

EPS = np.finfo(float).eps
REFERENCE = dict(np.load(DATA / "euler_top_reference.npz"))
NAMES = REFERENCE["names"].tolist()
SIZE = np.linalg.norm(REFERENCE["momentum"], axis=-1)
SORTED = np.sort(REFERENCE["moments"], axis=-1)
TRIAXIAL = np.all(np.diff(SORTED) > 0.0, axis=-1)
SEPARATRIX = NAMES.index("separatrix")


def rows_of(name):
    return np.flatnonzero(REFERENCE["kind"] == NAMES.index(name))


@cache
def top_of(row):
    return EulerTop.principal(REFERENCE["moments"][row], REFERENCE["momentum"][row])


def exact_attitude(row):
    return so3.matrix_from_quat(REFERENCE["quat_xyzw"][row])


def errors(top, row, turned=None):
    """Largest errors of momentum and attitude; `turned` (3, 3) takes the case's body axes to those of `top`."""
    turned = np.eye(3) if turned is None else turned
    times = REFERENCE["times"][row]
    momentum = top.body_momentum(times) @ turned - REFERENCE["body_momentum"][row]
    attitude = turned.T @ top.attitude(times) @ turned
    off = so3.angle(so3.transpose(exact_attitude(row)) @ attitude)
    return float(np.linalg.norm(momentum, axis=-1).max() / SIZE[row]), float(off.max())


def rotated_top(row, turned):
    tensor = turned @ np.diag(REFERENCE["moments"][row]) @ turned.T
    return EulerTop(0.5 * (tensor + tensor.T), turned @ REFERENCE["momentum"][row])


def random_rotations(count, seed):
    return so3.matrix_from_quat(so3.normalised(np.random.default_rng(seed).standard_normal((count, 4))))


def test_the_reference_covers_what_it_should():
    ladder = np.isin(REFERENCE["kind"], [NAMES.index("about the largest"), NAMES.index("about the smallest")])
    for side in (1, -1):
        m1 = np.sort(REFERENCE["m1"][ladder & (REFERENCE["side"] == side)])
        assert 0.8e-18 < m1[0] < 1.3e-18
        assert m1[-1] > 0.99
        assert np.diff(np.log10(m1)).max() < 0.4
    orders = {tuple(order) for order in np.argsort(REFERENCE["moments"][TRIAXIAL]).tolist()}
    octants = {tuple(signs) for signs in np.signbit(REFERENCE["momentum"]).tolist()}
    assert (len(REFERENCE["kind"]) >= 600, len(orders), len(octants)) == (True, 6, 8)
    assert np.all(REFERENCE["m1"][REFERENCE["kind"] == SEPARATRIX] == 0.0)
    gaps = np.diff(np.log(SORTED))
    assert np.min(gaps[gaps > 0.0]) < 2e-14
    assert np.max(np.abs(REFERENCE["times"]) * SIZE[:, None] / SORTED[:, 1:2]) > 99.999


def test_the_reference_keeps_energy_magnitude_and_spatial_momentum():
    start, later = REFERENCE["momentum"], REFERENCE["body_momentum"]
    spatial = so3.apply(so3.matrix_from_quat(REFERENCE["quat_xyzw"]), later)
    assert np.abs(spatial - start[:, None]).max(axis=(1, 2)) / SIZE == pytest.approx(0.0, abs=4e-15)
    energy = np.sum(start**2 / REFERENCE["moments"], axis=-1)
    after = np.sum(later**2 / REFERENCE["moments"][:, None], axis=-1)
    spread = SIZE**2 / SORTED[:, 0] / energy
    assert np.max(np.abs(after / energy[:, None] - 1.0) / spread[:, None]) < 2e-15


@pytest.mark.parametrize("name", NAMES)
def test_the_reference_solves_the_equations(name):
    """By a general integrator, over short times, on two bodies of each kind."""
    for row in rows_of(name)[[1, -1]]:
        moments, start, times = (
            REFERENCE["moments"][row],
            REFERENCE["momentum"][row] / SIZE[row],
            REFERENCE["times"][row],
        )

        def slope(_, state, moments=moments, size=SIZE[row]):
            rate = size * state[:3] / moments
            x, w = state[3:6], state[6]
            turn = 0.5 * np.append(w * rate + cross(x, rate), -x @ rate)
            return np.concatenate([cross(state[:3], rate), turn])

        for place in (0, 1, 4):
            begin = np.concatenate([start, [0.0, 0.0, 0.0, 1.0]])
            end = solve_ivp(slope, (0.0, times[place]), begin, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
            assert np.abs(end[:3] - REFERENCE["body_momentum"][row, place] / SIZE[row]).max() < 1e-9
            attitude = so3.matrix_from_quat(so3.normalised(end[3:]))
            assert so3.angle(exact_attitude(row)[place].T @ attitude) < 1e-9


@pytest.mark.parametrize("name", NAMES)
def test_momentum_and_attitude_against_60_digits(name, record_property):
    found = np.array([errors(top_of(row), row) for row in rows_of(name)])
    record_property("worst", found.max(axis=0).tolist())
    assert found[:, 0].max() < 1e-12
    assert found[:, 1].max() < 1e-12


def test_complement_and_axis_against_60_digits():
    for row in np.flatnonzero(TRIAXIAL & (REFERENCE["side"] != 0)):
        top, m1, side = top_of(row), REFERENCE["m1"][row], REFERENCE["side"][row]
        assert top.complement == pytest.approx(m1, rel=1e-14, abs=0.0)
        circled = np.argmax(REFERENCE["moments"][row]) if side > 0 else np.argmin(REFERENCE["moments"][row])
        axis = np.sign(REFERENCE["momentum"][row, circled]) * np.eye(3)[circled]
        assert top.axis.tolist() == axis.tolist()
    for row in rows_of("separatrix"):
        top = top_of(row)
        assert (top.complement, top.regime, top.period, top.condition) == (0.0, "separatrix", np.inf, np.inf)


def test_a_given_attitude_comes_before_the_motion():
    rows = np.arange(0, len(SIZE), 17)
    for row, given in zip(rows, random_rotations(len(rows), 1)):
        top = EulerTop.principal(REFERENCE["moments"][row], REFERENCE["momentum"][row], given)
        off = so3.angle(so3.transpose(given @ exact_attitude(row)) @ top.attitude(REFERENCE["times"][row]))
        assert off.max() < 1e-12
        assert top.momentum == pytest.approx(given @ REFERENCE["momentum"][row], abs=8.0 * EPS * SIZE[row])


@pytest.mark.parametrize("name", full_but(NAMES, *NAMES[::2]))
def test_rotated_tensors_lose_no_more_than_their_condition(name):
    """A tensor turned out of its axes and its momentum are rounded: each turn of a hundred times loses a few digits."""
    rows = rows_of(name)
    for row, turned in zip(rows, random_rotations(len(rows), 2)):
        top = rotated_top(row, turned)
        worst = max(errors(top, row, turned))
        assert worst <= 1e-12 + 300.0 * EPS * top.condition
        if name.startswith("about"):
            assert worst <= 1e-12 + 1000.0 * EPS / REFERENCE["m1"][row]


def test_the_condition_is_near_one_over_m1_and_no_excuse():
    for row in np.concatenate([rows_of("about the largest"), rows_of("about the smallest")]):
        assert 0.1 < top_of(row).condition * REFERENCE["m1"][row] < 300.0
    for name in ("spherical", "lower pair nearly equal", "upper pair nearly equal", "all nearly equal"):
        for row in rows_of(name):
            assert 1.0 <= top_of(row).condition < 1e3
