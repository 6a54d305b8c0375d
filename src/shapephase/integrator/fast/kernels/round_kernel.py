"""Rounds for one momentum in one call: plan the steps, take them three times, measure what they are off by."""

from __future__ import annotations

import math

import numpy as np

from ..estimate_constants import (
    DENSE_SHARE,
    EXPECTED_GROWTH,
    FAR,
    INFORMATIVE_ERROR,
    LITTLE_ROUNDING,
    MANY_STEPS,
    MOST_EXPECTED_GROWTH,
    MOST_SAMPLING,
    MOST_STEPPING,
    NEGLIGIBLE,
    REFINED,
    SHORT_TURN_A_STEP,
    SIGNIFICANT,
    TURN_A_STEP,
    VERY_FAR,
)
from .growth_kernel import growths_and_rounding
from .jit import kernel, part
from .march_kernel import march_at_rest, march_momenta
from .plan_kernel import (
    defects_of_panels,
    error_at_rest_by_defects,
    error_by_defects,
    make_whole,
    order_by_defects,
    plan_steps,
    sizes_of_terms,
)

_ONE_LANE = 1
_MOST_ROUNDS = 4


@part
def _largest_square(a, b, skip):
    """Of the distances of every `skip`-th quaternion of a from those of b; a quaternion and its negative are one."""
    worst = 0.0
    for k in range(len(b)):
        minus = plus = 0.0
        for i in range(4):
            x, y = a[skip * k, i], b[k, i]
            minus += (x - y) * (x - y)
            plus += (x + y) * (x + y)
        square = min(minus, plus)
        if not square <= worst:
            worst = square
    return worst


@part
def _march_at_rest(widths, series, perturbed, steps, quaternions, stepping, truncation):
    """As `march_momenta` for one loop without momentum."""
    whole, count = quaternions[0], quaternions.shape[1]
    march_at_rest(widths, series, steps, whole)
    other = np.empty((2 * count - 1, 4))
    march_at_rest(widths, series, 2 * steps, other)
    stepping[0], truncation[0] = 2.0 * math.sqrt(_largest_square(other, whole, 2)), 0.0
    if len(perturbed):
        march_at_rest(widths, perturbed, steps, other)
        truncation[0] = 2.0 * math.sqrt(_largest_square(other, whole, 1))


@part
def _up(number, marks):
    """As `rounded_up`, by the marks of a factor of two."""
    mantissa, exponent = math.frexp(number)
    for mark in marks:
        if mantissa <= mark:
            return math.ldexp(mark, exponent)
    return number


@part
def _too_coarse(found, tolerance):
    """The error of the steps, if they alone are why the estimate is above the tolerance and finer ones help; else 0."""
    distance, growth, rounding, stepping, sampling = found[1], found[3], found[4], found[11], found[12]
    if not (distance < INFORMATIVE_ERROR and math.isfinite(growth) and rounding <= LITTLE_ROUNDING * tolerance):
        return 0.0
    room = tolerance - rounding
    if (1.0 + DENSE_SHARE) * (sampling + stepping + rounding) <= tolerance or sampling > MOST_SAMPLING * room:
        return 0.0
    return stepping / room if stepping > MOST_STEPPING * room else 0.0


@kernel
def take_rounds(
    widths, series, perturbed, loops, directions, magnitudes, ceiling, tolerance, refinement, expected, hidden,
    segments, checkpoints, table, signed, marks_of_finer, marks_of_growth,
):  # fmt: skip
    """Rounds of one momentum, or at rest of one loop, as long as nothing but shorter steps is needed.

    Arguments as of `march_momenta`, with one row, no rows of directions at rest, and:
    ceiling: of the magnitudes, that steps are planned for [kg m^2/s]
    refinement: how much finer steps are than they were planned at first, and what errors grow by, infinite where that
        is not known yet; both are those of the last round after it
    expected: what the samplers say of themselves [rad]
    hidden: its part that perturbed series do not show [rad]; infinite: these are not looked at
    checkpoints: at how many times propagators are kept
    table, signed: of defects
    marks_of_finer, marks_of_growth: that refinements are rounded up to, of a factor of two

    Returns whether the motion is short enough to be done here, and if so steps, quaternions, ends, turns, dynamics,
    propagators as of `march_momenta`, and thirteen numbers: whether perturbed series count, distance from the steps
    beside them, of the perturbed series, growth, rounding, the five of `defects_of_panels`, how many more steps were
    taken than planned, and the errors of steps and of samples.
    """
    panels, moving = len(widths), ceiling > 0.0
    rates, sizes, planned = np.empty((panels, series.shape[1] // 9)), np.empty((4, panels)), np.empty(panels)
    sizes_of_terms(series, widths, ceiling, SIGNIFICANT * tolerance, rates, sizes)
    turn = loops * sizes[0].sum()
    a_step = SHORT_TURN_A_STEP if moving and turn > FAR else TURN_A_STEP
    seen = sizes[0] if moving else np.zeros(panels)
    plan_steps(series, widths, rates, seen, sizes, loops, tolerance, a_step, moving, table, signed, planned)
    steps, found, rounds = np.empty(panels, np.int64), np.zeros(13), 0
    while True:
        finer, amplified = refinement[0], refinement[1]
        is_short = loops * finer * planned.sum() <= MANY_STEPS and not (moving and turn > VERY_FAR)
        if is_short:
            make_whole(finer * planned, moving, steps)
        total = loops * steps.sum() if is_short else 0
        quaternions, ends = np.empty((1, total + 1, 4)), np.empty((1, total + 1 if moving else 0, 3))
        turns, dynamics = np.zeros((1, total)), np.zeros((1, total))
        propagators = np.empty((1, checkpoints if moving else 0, 9))
        if not is_short:
            return False, steps, quaternions, ends, turns, dynamics, propagators, found
        growth = amplified
        if math.isinf(amplified):
            growth = min(1.0 + EXPECTED_GROWTH * (turn if moving else 0.0), MOST_EXPECTED_GROWTH)
        found[0] = 1.0 if expected * growth > NEGLIGIBLE * tolerance and math.isfinite(hidden) else 0.0
        other = perturbed if found[0] > 0.0 else perturbed[:0]
        if moving:
            marks = np.arange(checkpoints) * total // (checkpoints - 1)
            march_momenta(
                widths, series, other, steps, loops, directions, magnitudes, marks, _ONE_LANE, segments,
                quaternions, ends, turns, dynamics, propagators, found[1:2], found[2:3],
            )  # fmt: skip
        else:
            _march_at_rest(widths, series, other, steps, quaternions, found[1:2], found[2:3])
        growths_and_rounding(propagators, quaternions, found[3:4], found[4:5])
        defects_of_panels(rates, seen, steps if moving else 2 * steps, table, found[5:10])
        found[10] = steps.sum() / (finer * planned.sum())
        if not math.isfinite(found[1]):
            found[1] = math.pi
        if moving:
            found[11] = error_by_defects(found[5:10], found[1], loops, found[3], loops * sizes[3].sum())
        else:
            found[11] = error_at_rest_by_defects(found[5:10], found[1], loops)
        found[12] = found[3] * expected
        if found[0] > 0.0:
            measured = found[2] + found[3] * hidden
            found[12] = measured if math.isnan(found[12]) or measured < found[12] else found[12]
        rounds += 1
        excess = _too_coarse(found, tolerance)
        grown = _up(found[3], marks_of_growth)
        harmless = grown * expected <= NEGLIGIBLE * tolerance
        # A further round would look at perturbed series, which are not here.
        is_blind = math.isinf(hidden) and not harmless
        if rounds == _MOST_ROUNDS or excess == 0.0 or is_blind:
            return True, steps, quaternions, ends, turns, dynamics, propagators, found
        order = order_by_defects(found[5:10])
        finer *= min(max((excess / REFINED) ** (1.0 / order), 1.1, 1.02 * found[10]), 4.0)
        refinement[0] = _up(finer, marks_of_finer)
        refinement[1] = 1.0 if harmless else grown
