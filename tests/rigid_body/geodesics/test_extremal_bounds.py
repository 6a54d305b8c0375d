"""Bounds that the enclosures rest on, against extremals and their variational equation integrated by DOP853.

How far extremals of a cell of momenta part, how far they still are from their goal, when all have met a symmetric one,
how much a curve turns about a forbidden axis, and with which momenta no extremal is the shortest.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shapephase import so3
from shapephase.rigid_body.geodesics import _arrival_search, _momentum_cover, _symmetric_arrivals, axisymmetric_metric

ROUNDING = 1e-9  # of DOP853
ALONE = [pytest.param(number, marks=pytest.mark.full if number >= 4 else ()) for number in range(60)]


def inverse_moments_of(rng, ratio, number):
    """Moments up to `ratio`-fold apart; every third metric has a forbidden axis."""
    inverse = np.sort(np.exp(-rng.uniform(0.0, np.log(ratio), 3)))[::-1]
    if number % 3 == 0:
        inverse[2] = 0.0
    return inverse


def extremals(inverse_moments, starts, times):
    """Momenta, attitudes, derivatives of attitudes by starts, and the difference of the angular displacements.

    (M, N, 3), (T,) -> (T, M, N, 3), (T, M, N, 3, 3) twice, (T, N, 3): the integral of R a (Pi of the last of the M less
    Pi of the first), R of the first. The derivatives are in body axes: delta R = R hat(Z delta Pi).
    """
    inverse = inverse_moments[:, None]
    eye = np.broadcast_to(np.eye(3), (*starts.shape, 3))
    state = np.concatenate([starts[..., None], eye, eye, 0.0 * eye, 0.0 * starts[..., None]], axis=-1)

    def rate(_, flat):
        y = flat.reshape(state.shape)
        momentum, inertial, jacobian, field = y[..., :1], y[..., 1:4], y[..., 4:7], y[..., 7:10]
        turning = -so3.hat(inverse_moments * momentum[..., 0])
        return np.concatenate(
            [
                turning @ momentum,
                turning @ inertial,
                turning @ jacobian + so3.hat(momentum[..., 0]) @ (inverse * jacobian),
                inverse * jacobian + turning @ field,
                so3.transpose(inertial) @ (inverse * (momentum[-1:] - momentum)),
            ],
            axis=-1,
        ).ravel()

    span = (0.0, times[-1])
    found = solve_ivp(rate, span, state.ravel(), method="DOP853", t_eval=times, rtol=1e-11, atol=1e-12)
    y = np.moveaxis(found.y.reshape(*state.shape, len(times)), -1, 0)
    return y[..., 0], so3.transpose(y[..., 1:4]), y[..., 7:10], y[:, 0, :, :, 10]


def random_cells(rng, cover, size):
    half = rng.uniform(0.001, 0.06) * np.ones(size)
    return _momentum_cover.Cells(
        azimuth=rng.uniform(0.0, 2.0 * np.pi, size),
        height=rng.uniform(-1.0, 1.0, size) * (1.0 if cover.forbidden else 1.45),
        half_azimuth=half,
        half_height=half,
        time=0.0 * half,
        ancestor=np.arange(size),
    )


def momenta_within(rng, cover, cells):
    """One momentum of each cell, in units of the cover."""
    part = rng.uniform(-1.0, 1.0, (2, len(cells)))
    return cover.chart(cells.azimuth + part[0] * cells.half_azimuth, cells.height + part[1] * cells.half_height)[0]


@pytest.mark.parametrize("number", ALONE)
def test_extremals_of_a_cell_part_by_no_more_than_its_bounds(number):
    """The angle at once, and what is left beside the derivative: bounds are up to 1.4, 8 and 15 times too large."""
    rng = np.random.default_rng(number)
    inverse = inverse_moments_of(rng, 8.0, number)
    duration = rng.uniform(0.3, 1.5) * np.pi / np.sqrt(inverse[0])
    cover = _arrival_search.momentum_cover(inverse, duration, _arrival_search.largest_axial(inverse, 0.5 * duration))
    cells, count = random_cells(rng, cover, 30), 24
    bounds = _momentum_cover.flow_bounds(cover, cells, count)
    assert bounds.closed.mean() > 0.8
    times, used = bounds.step * (np.arange(count) + rng.uniform(0.95, 1.0, count)), []
    growth, bend = (
        np.stack(columns) for columns in zip(*(bounds.at(cells.ancestor, t * np.ones(30)) for t in times), strict=True)
    )
    for _ in range(4):
        pair = np.stack([momenta_within(rng, cover, cells) for _ in range(2)])
        change = pair[1] - pair[0]
        apart = np.linalg.norm(change, axis=-1)
        _, attitudes, fields, displacement = extremals(inverse, pair * cover.units, times)
        to_body = so3.transpose(attitudes[:, 0])
        turned = so3.log(to_body @ attitudes[:, 1])
        straight = so3.apply(fields[:, 0], change * cover.units)
        sizes = [turned, so3.apply(to_body, displacement) - straight, turned - straight]
        limits = [growth * apart, bend * apart**2, (bend + 0.25 * 1.05 * growth**2) * apart**2]
        used.append(
            [((np.linalg.norm(s, axis=-1) - ROUNDING) / limit).max() for s, limit in zip(sizes, limits, strict=True)]
        )
        assert np.max(used) <= 1.0
    assert np.all(np.max(used, axis=0) > 1.0 / np.array([1.4, 8.0, 15.0]))


@pytest.mark.parametrize("number", ALONE)
def test_no_extremal_of_a_cell_is_nearer_to_the_goal_than_its_bound(number):
    """The distances left are those of the closed form."""
    rng = np.random.default_rng(number)
    other = [0.0, rng.uniform(0.1, 0.9), rng.uniform(0.1, 0.9)][number % 3]
    inverse, order = (
        (np.array([1.0, other, other]), [1, 2, 0]) if number % 3 == 1 else (np.array([1.0, 1.0, other]), [0, 1, 2])
    )
    closed = axisymmetric_metric(1.0 / inverse[order[0]], 1.0 / inverse[order[2]] if other else np.inf)
    duration, size = rng.uniform(1.0, 4.0), 20
    cover = _arrival_search.momentum_cover(inverse, duration, _arrival_search.largest_axial(inverse, 0.5 * duration))
    cells = replace(random_cells(rng, cover, size), time=rng.uniform(0.0, duration, size))
    bounds = _momentum_cover.flow_bounds(cover, cells, 24)
    used = []
    for row in range(size):
        cell = cells[row : row + 1]
        momenta = np.concatenate([momenta_within(rng, cover, cell) for _ in range(4)])[None] * cover.units
        ends = extremals(inverse, momenta, np.array([0.0, cell.time[0]]))[1][-1, 0]
        turn = rng.normal(size=3)
        goal = ends[0] @ so3.exp(10.0 ** rng.uniform(-2.5, 0.4) * turn / np.linalg.norm(turn))
        left = closed.distance((so3.transpose(ends) @ goal)[:, order][:, :, order]).min()
        length = _arrival_search.progress(
            cover, bounds, cell, _arrival_search.Goal(quat=so3.quat_from_matrix(goal), on_su2=False)
        ).length[0]
        assert length <= left + ROUNDING
        used.append(length / left)
    assert max(used) > 0.7


@pytest.mark.parametrize("number", ALONE[:12])
def test_all_extremals_of_a_cell_have_met_a_symmetric_one_if_its_bounds_say_so(monkeypatch, number):
    """By the signs at one instant. Cells are as large as the bounds allow, to 5 %, most momenta at their corners."""
    monkeypatch.setattr(_symmetric_arrivals, "INSTANTS", 1)
    rng = np.random.default_rng(number)
    inverse = inverse_moments_of(rng, 4.0, number)
    time = rng.uniform(0.85, 1.0) * np.pi / np.sqrt(max(inverse[2], inverse[1] / 3.0))
    cover = _arrival_search.momentum_cover(inverse, time, _arrival_search.largest_axial(inverse, 0.5 * time))
    cells = replace(random_cells(rng, cover, 200), half_azimuth=np.full(200, 0.04), half_height=np.full(200, 0.04))
    bounds = _momentum_cover.flow_bounds(cover, cells, 24)
    met = np.zeros(200, dtype=bool)
    for _ in range(40):
        met |= _symmetric_arrivals.have_met(cover, bounds, cells)
        smaller = np.where(met, 1.0, 0.95)
        cells = replace(cells, half_azimuth=smaller * cells.half_azimuth, half_height=smaller * cells.half_height)
    met &= cells.half_azimuth < 0.04
    assert met.any()
    cells = cells[met]
    momenta = [
        cover.chart(cells.azimuth + i * cells.half_azimuth, cells.height + j * cells.half_height)[0]
        for i, j in ((-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0))
    ]
    starts = np.concatenate([*momenta, momenta_within(rng, cover, cells)])[None] * cover.units
    momentum, attitudes, _, _ = extremals(inverse, starts, np.linspace(0.0, time, 41))
    quats = so3.quat_from_matrix(attitudes[:, 0])
    # Of the two quaternions the one that is continued from 1.
    end = quats[-1] * np.prod(np.sign(np.sum(quats[1:] * quats[:-1], axis=-1, keepdims=True)), axis=0)
    signs = np.concatenate([end[:, 3:], end[:, :2] * momentum[20, 0, :, :2]], axis=-1)
    assert np.all(np.any(signs < ROUNDING, axis=-1))


@pytest.mark.parametrize("number", [pytest.param(n, marks=pytest.mark.full if n >= 2 else ()) for n in range(30)])
def test_no_curve_turns_about_the_forbidden_axis_sooner_than_its_bound(number):
    """Of extremals from all starts that the bound allows. It is up to 2 times too small."""
    rng = np.random.default_rng(number)
    inverse = np.array([1.0, rng.uniform(0.15, 1.0), 0.0]) * rng.uniform(0.3, 2.0)
    height = 10.0 ** rng.uniform(-4.0, -0.9)
    upwards = height * rng.choice([0.0, 0.1, 0.5])
    deviation = max(upwards, rng.choice([0.0, 0.5, 2.0]) * height ** rng.choice([0.5, 1.0]))
    bound = _arrival_search.least_climb(inverse, *np.array([[height], [upwards], [deviation]]))[0]
    scale = np.sqrt(inverse[0] * inverse[1])
    half_circle = np.sqrt(2.0 * np.pi / scale * (height - upwards))
    # Of curvatures from straight to a whole circle, begun in all directions.
    curvatures = np.linspace(0.0, 4.0 * np.pi, 13) / (half_circle * scale)
    third, phase = np.meshgrid(curvatures, np.linspace(0.0, 2.0 * np.pi, 20))
    across = [np.cos(phase) / np.sqrt(inverse[0]), np.sin(phase) / np.sqrt(inverse[1])]
    times = np.sort(np.append(np.linspace(0.19, 1.19, 48) * half_circle, bound))
    attitudes = extremals(inverse, np.stack([*across, third], axis=-1).reshape(1, -1, 3), np.append(0.0, times))[1][
        1:, 0
    ]
    flat = np.sqrt(deviation**2 - upwards**2)
    turned = [
        so3.log(so3.exp(np.array([flat * np.cos(about), flat * np.sin(about), upwards])) @ attitudes)[..., 2]
        for about in np.linspace(0.0, 2.0 * np.pi, 12)
    ]
    arrived = np.abs(turned).max(axis=(0, 2)) >= height
    assert not arrived[times <= bound].any()
    assert times[np.argmax(arrived)] < 2.0 * bound


@pytest.mark.parametrize("number", [pytest.param(n, marks=pytest.mark.full if n >= 3 else ()) for n in range(30)])
def test_extremals_beyond_the_largest_axial_momentum_have_a_conjugate_point_before(number):
    """A variation of negative second order shows it; some with half of the largest axial momentum have none."""
    rng = np.random.default_rng(number)
    inverse = np.sort(np.exp(-rng.uniform(0.0, np.log(6.0), 3)))[::-1]
    inverse[2] *= 0.0 if number % 2 == 0 else 10.0 ** rng.uniform(-4.0, -3.0)
    before = rng.uniform(0.3, 1.0) / np.sqrt(inverse[0])
    highest = _arrival_search.largest_axial(inverse, before)
    times = np.linspace(0.0, before, 200)[1:]

    def all_conjugate(third):
        phase = np.linspace(0.0, np.pi, 30)
        radius = np.sqrt(1.0 - inverse[2] * third**2)
        across = radius * np.stack([np.cos(phase), np.sin(phase)], axis=-1) / np.sqrt(inverse[:2])
        starts = np.concatenate([across, np.full((30, 1), third)], axis=-1)
        return bool((np.linalg.det(extremals(inverse, starts[None], times)[2]) < 0.0).any(axis=0).all())

    assert all(all_conjugate(factor * highest) for factor in (1.0, 1.1, 1.5))
    assert not all_conjugate(0.5 * highest)
