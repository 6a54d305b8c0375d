"""How finely panels are to be stepped, and what the steps are off by, from the defects of the formula."""

from __future__ import annotations

import math

import numpy as np

from ..estimate_constants import (
    AIM,
    BY_CHANCE,
    DEGREES_A_RADIAN,
    DEGREES_A_STEP,
    DEGREES_OF_TURN,
    DISTANCE,
    FEW_STEPS,
    FORESEEN,
    FULL_ORDER,
    LEAST_ORDER,
    LOOKS_AHEAD,
    MOST_GROWTH_BY_CHANCE,
    MOST_SHORTENED,
    MOST_TURN,
    ORDER,
    POWER_OF_EVENNESS,
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


@part
def make_even(planned, steps):
    """As `even_steps`; steps are filled."""
    for panel in range(len(planned)):
        steps[panel] = 2 * int(math.ceil(0.5 * planned[panel]))  # noqa: RUF046 (a float in machine code)


@kernel
def plan_steps(rates, turns, sizes, loops, tolerance, turn_a_step, table, planned):
    """As `StepRequirements.plan`, with the table of defects; planned (P,) is filled."""
    turn, swing, degree = sizes[0], sizes[1], sizes[2]
    total = count = 0.0
    for panel in range(len(turn)):
        each = swing[panel] ** (1.0 / (ORDER + 1.0))
        planned[panel] = each
        total += each * each
    common = 2.0 * (loops * DISTANCE * math.sqrt(total) / (AIM * tolerance)) ** (1.0 / ORDER)
    for panel in range(len(turn)):
        least = max(degree[panel] / DEGREES_A_STEP, turn[panel] / turn_a_step)
        planned[panel] = max(max(common * planned[panel], least), 1.0)
        count += planned[panel]
    steps, found = np.empty(len(turn), np.int64), np.empty(4)
    for _ in range(LOOKS_AHEAD if loops * count <= FEW_STEPS else 0):
        make_even(planned, steps)
        defects_of_panels(rates, turns, steps, table, found)
        remaining = remaining_by_defects(found[0], found[1])
        excess = loops * remaining * found[1] / (FORESEEN * tolerance)
        if not excess > 1.0:
            break
        shorter = min(excess ** (1.0 / order_by_defects(remaining)), MOST_SHORTENED)
        for panel in range(len(turn)):
            planned[panel] *= shorter


@part
def _defect(degree, row, slower, table):
    """Of a term, by the table's row for so many steps."""
    degree = min(degree * slower, table.shape[1] - 1.001)
    below = int(degree)
    first = table[row, below]
    return slower * slower * (first + (degree - below) * (table[row, below + 1] - first))


@kernel
def defects_of_panels(rates, turns, steps, table, found):
    """As `defects`, with the table of defects: the four fields of the result in their order are filled."""
    whole = half = unresolved = squares = 0.0
    for panel in range(len(steps)):
        row, half_row = min(steps[panel], len(table) - 1), min(steps[panel] // 2, len(table) - 1)
        slower, half_slower = math.sqrt(row / steps[panel]), math.sqrt(half_row / (steps[panel] // 2))
        here = 0.0
        for k in range(rates.shape[1]):
            degree = k + DEGREES_OF_TURN * turns[panel]
            one = rates[panel, k] * _defect(degree, row, slower, table)
            other = rates[panel, k] * _defect(degree, half_row, half_slower, table)
            whole += one
            here += other
            if one > UNRESOLVED * other:
                unresolved += one
        half += here
        squares += here * here
    found[0], found[1], found[2] = whole, half, unresolved
    found[3] = half * half / (len(steps) * squares) if squares > 0.0 else 1.0


@part
def remaining_by_defects(whole, half):
    """As `Defects.remaining`."""
    return min(max(whole / half, FULL_ORDER), 1.0) if half > 0.0 else FULL_ORDER


@part
def order_by_defects(remaining):
    """As `Defects.order`."""
    return min(max(-math.log2(remaining), LEAST_ORDER), ORDER)


@part
def error_by_defects(found, distance, loops, amplification):
    """As `Defects.error`."""
    whole, half, unresolved, evenness = found[0], found[1], found[2], found[3]
    remaining = remaining_by_defects(whole, half)
    cancelled = max(loops * half / max(distance, TINY), 1.0)
    factor = BY_CHANCE * evenness**-POWER_OF_EVENNESS * math.sqrt(math.sqrt(math.sqrt(math.sqrt(cancelled))))
    factor *= math.sqrt(min(amplification, MOST_GROWTH_BY_CHANCE))
    return min(max(factor * remaining * distance, loops * unresolved), distance)
