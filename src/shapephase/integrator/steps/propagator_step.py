"""How small a turn of the start grows over a step: the error propagator, by the variation at the step's middle."""

from __future__ import annotations

from typing import Any

from .rotation_step import unit, variation

# The stages at 1/3 and 0.65 of a step: the mean of their variations stands for that of the whole step.
_INNER_STAGES = (5, 8)


def next_propagator(propagator: Any, start: Any, end: Any, magnitude: Any, channels: Any) -> list[list[Any]]:
    """The error propagator after a step, by the Cayley transform of the variation at its middle, for each half of it.

    That is a rotation where the variation is one, however long the step.
    """
    middle = [0.25 * magnitude * part for part in unit([a + b for a, b in zip(start, end, strict=True)])]
    first, second = (channels[stage] for stage in _INNER_STAGES)
    inner = [0.5 * (a + b) for a, b in zip(first[:6], second[:6], strict=True)]
    quarter = variation(middle, [*inner, *(0.125 * (a + b) for a, b in zip(first[6:], second[6:], strict=True))])
    back = [[float(i == j) - quarter[i][j] for j in range(3)] for i in range(3)]
    adjugate = adjugate_of(back)
    twice = 2.0 / (back[0][0] * adjugate[0][0] + back[0][1] * adjugate[1][0] + back[0][2] * adjugate[2][0])
    # Of a matrix M the Cayley transform is 2 / (1 - M) - 1.
    half = [[twice * adjugate[i][j] - float(i == j) for j in range(3)] for i in range(3)]
    return matrix_product(half, matrix_product(half, propagator))


def adjugate_of(matrix: Any) -> list[list[Any]]:
    """Of a 3 x 3 matrix of numbers, arrays or symbols."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    return [
        [e * i - f * h, c * h - b * i, b * f - c * e],
        [f * g - d * i, a * i - c * g, c * d - a * f],
        [d * h - e * g, b * g - a * h, a * e - b * d],
    ]


def matrix_product(a: Any, b: Any) -> list[list[Any]]:
    """Of two 3 x 3 matrices of numbers, arrays or symbols."""
    return [[row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j] for j in range(3)] for row in a]
