"""How finely panels are to be stepped, and what the steps are off by, from the defects of the formula."""

from __future__ import annotations

import math

import numpy as np

from ..estimate_constants import (
    AIM,
    AT_REST,
    BY_CHANCE,
    DEGREES_A_RADIAN,
    DEGREES_A_STEP,
    DEGREES_OF_TURN,
    DISTANCE,
    FEW_STEPS,
    FORESEEN,
    FORESEEN_AT_REST,
    FULL_ORDER,
    LEAST_ORDER,
    LITTLE_TURN,
    LOOKS_AT_REST,
    MOST_GROWTH_BY_CHANCE,
    MOST_ODD,
    MOST_SHORTENED,
    MOST_TURN,
    NEAR,
    NEARLY_AT_REST,
    ORDER,
    POWER_OF_EVENNESS,
    ROUNDED_DOWN,
    TINY,
    UNRESOLVED,
)
from .jit import kernel, part
from .panel_kernel import norm_of_term


@kernel
def sizes_of_terms(series, width, magnitude, least, rates, found):
    """Arguments as of `panels.sizes_of_terms`; the last two are filled."""
    for panel in range(len(width)):
        turn = last = 0.0
        for k in range(rates.shape[1]):
            size = (magnitude * norm_of_term(series[panel], k, 0) + norm_of_term(series[panel], k, 1)) * width[panel]
            rates[panel, k] = size
            turn += size
            if size > least:
                last = float(k)
        # Without momentum a steady turn is exact.
        radians = DEGREES_A_RADIAN * min(turn, MOST_TURN) if magnitude else 0.0
        swing = 0.0
        for k in range(0 if magnitude else 1, rates.shape[1]):
            swing += rates[panel, k] * (k + radians) ** ORDER
        found[0, panel], found[1, panel], found[2, panel] = turn, swing, last
        found[3, panel] = magnitude * norm_of_term(series[panel], 0, 0) * width[panel]


@part
def make_whole(planned, moving, steps):
    """As `StepRequirements.whole_steps`; steps are filled."""
    for panel in range(len(planned)):
        whole = int(math.ceil(planned[panel] - (0.0 if moving else ROUNDED_DOWN)))  # noqa: RUF046 (a float in machine code)
        whole = max(whole, 2 if moving else 1)
        steps[panel] = whole + whole % 2 if moving and whole > MOST_ODD else whole


@kernel
def plan_steps(
    series, width, rates, turns, sizes, loops, tolerance, turn_a_step, moving, table, signed, planned
):  # fmt: skip
    """As `StepRequirements.plan`, with the tables of defects; planned (P,) is filled."""
    turn, swing, degree = sizes[0], sizes[1], sizes[2]
    total = count = 0.0
    for panel in range(len(turn)):
        each = swing[panel] ** (1.0 / (ORDER + 1.0))
        planned[panel] = each
        total += each * each
    common = 2.0 * (loops * DISTANCE * math.sqrt(total) / (AIM * tolerance)) ** (1.0 / ORDER)
    least = np.empty(len(turn))
    for panel in range(len(turn)):
        least[panel] = max(max(degree[panel] / DEGREES_A_STEP, turn[panel] / turn_a_step), 1.0)
        planned[panel] = max(common * planned[panel], least[panel])
        count += planned[panel]
    steps, found = np.empty(len(turn), np.int64), np.empty(5)
    looks = 1 if moving else LOOKS_AT_REST
    for _ in range(looks if loops * count <= FEW_STEPS else 0):
        make_whole(planned, moving, steps)
        if moving:
            defects_of_panels(rates, turns, steps, table, found)
            excess, order = (
                loops * remaining_by_defects(found) * found[1] / (FORESEEN * tolerance),
                order_by_defects(found),
            )
            is_near = not excess > 1.0
        else:
            excess = loops * _foreseen_error_at_rest(series, width, steps, signed) / (FORESEEN_AT_REST * tolerance)
            order = ORDER
            # Fewer steps than the least there are none.
            is_near = excess <= 1.0 and (excess >= NEAR or not (planned > least).any())
        if is_near:
            break
        shorter = min(excess ** (1.0 / order), MOST_SHORTENED)
        for panel in range(len(turn)):
            planned[panel] = max(shorter * planned[panel], least[panel])


@part
def _foreseen_error_at_rest(series, width, steps, signed):
    """As `StepRequirements.foreseen_error_at_rest`, of one loop."""
    total, terms = 0.0, min(series.shape[1] // 9, signed.shape[2])
    for panel in range(len(steps)):
        count, worst = min(steps[panel], len(signed) - 1), 0.0
        for end in range(2):
            x = y = z = 0.0
            for k in range(terms):
                defect = signed[count, end, k]
                x += defect * series[panel, 9 * k + 6]
                y += defect * series[panel, 9 * k + 7]
                z += defect * series[panel, 9 * k + 8]
            worst = max(worst, x * x + y * y + z * z)
        total += math.sqrt(worst) * width[panel] * (count / steps[panel]) ** ORDER
    return total


@part
def _defect(degree, row, slower, table):
    """Of a term, by the table's row for so many steps."""
    degree = min(degree * slower, table.shape[1] - 1.001)
    below = int(degree)
    first = table[row, below]
    return slower * slower * (first + (degree - below) * (table[row, below + 1] - first))


@kernel
def defects_of_panels(rates, turns, steps, table, found):
    """As `PanelDefects.found`, with the table of defects: the five fields of the result in their order are filled."""
    whole = coarse = unresolved = squares = 0.0
    count, pairs, rows = 0, 0, len(table) // 2
    for panel in range(len(steps)):
        here, half = steps[panel], steps[panel] // 2
        row, row_of_pairs = min(here, rows - 1), min(half, rows - 1)
        slower, slower_pairs = math.sqrt(row / here), math.sqrt(row_of_pairs / half)
        # Of an odd number the pairs have rows of their own.
        row_of_pairs += rows * (here % 2)
        of_panel = 0.0
        for k in range(rates.shape[1]):
            degree = k + DEGREES_OF_TURN * turns[panel]
            one = rates[panel, k] * _defect(degree, row, slower, table)
            other = rates[panel, k] * _defect(degree, row_of_pairs, slower_pairs, table)
            whole += one
            of_panel += other
            if one > UNRESOLVED * other:
                unresolved += one
        coarse += of_panel
        squares += of_panel * of_panel
        count += here
        pairs += half
    found[0], found[1], found[2] = whole, coarse, unresolved
    found[3] = coarse * coarse / (len(steps) * squares) if squares > 0.0 else 1.0
    found[4] = 2.0 * pairs / count


@part
def remaining_by_defects(found):
    """As `Defects.remaining`."""
    least = FULL_ORDER / found[4]
    return min(max(found[0] / found[1], least), 1.0) if found[1] > 0.0 else least


@part
def order_by_defects(found):
    """As `Defects.order`."""
    return min(max(-math.log2(remaining_by_defects(found)), LEAST_ORDER), ORDER)


@part
def error_by_defects(found, distance, loops, amplification, turn_by_momentum):
    """As `Defects.error`."""
    coarse, unresolved, evenness = found[1], found[2], found[3]
    cancelled = max(loops * coarse / max(distance, TINY), 1.0)
    factor = BY_CHANCE * evenness**-POWER_OF_EVENNESS * math.sqrt(math.sqrt(math.sqrt(math.sqrt(cancelled))))
    share = turn_by_momentum / LITTLE_TURN
    factor *= math.sqrt(min(amplification, MOST_GROWTH_BY_CHANCE))
    factor *= 1.0 + NEARLY_AT_REST / (1.0 + share * share)
    return min(max(factor * remaining_by_defects(found) * distance, loops * unresolved), distance)


@part
def error_at_rest_by_defects(found, distance, loops):
    """As `Defects.error_at_rest`."""
    return AT_REST * distance / (1.0 - min(remaining_by_defects(found), 0.5)) + loops * found[2]
