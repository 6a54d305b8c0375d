"""Panels in machine code: the series through their samples, what these are off by, and how finely to step them."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from ...arrays import Array, Integers
from ...chebyshev import values_to_coefficients
from ._plain import plain

_NOTHING_HIDDEN = np.zeros((0, 5))


def series_of_panels(degree: Integers, values: Array, shift: Array, rounding: Array) -> tuple[Array, Array]:
    """Coefficients (P, n, 9) through samples (S, 9) at Chebyshev points, and the table of their errors (P, 9).

    Parameters
    ----------
    degree : (P,)
    values : (S, 9) panel after panel; those at the ends are moved along their slopes, in their place
    shift : (P,) how far, in half widths
    rounding : (P,) of the times of the samples, in half widths
    """
    count, terms = len(degree), int(degree.max(initial=0)) + 1
    coefficients, table = np.empty((count, terms * 9)), np.empty((count, 9))
    matrices, places = _matrices(tuple(np.unique(degree).tolist()))
    _kernel().series_of_panels(degree, values, shift, rounding, matrices, places, coefficients, table)
    return coefficients.reshape(count, terms, 9), table


def errors_of_panels(
    degree: Integers, width: Array, table: Array, hidden: Array | None, momentum: float
) -> tuple[Array, Array, Array]:
    """What `panel_errors` finds: (P,) each [rad]."""
    found = np.empty((3, len(degree)))
    path = _NOTHING_HIDDEN if hidden is None else plain(hidden)
    _kernel().errors_of_panels(degree, plain(width), plain(table), path, float(momentum), found)
    return found[0], found[1], found[2]


def series_with_changed_ends(coefficients: Array, degree: Integers, widths: Array, momentum: float) -> Array:
    """What `perturbed_series` makes: (P, n, 9)."""
    changed = np.array(coefficients, dtype=np.float64)
    _kernel().change_ends(degree, plain(widths), float(momentum), changed.reshape(len(widths), -1))
    return changed


def sizes_of_terms(coefficients: Array, widths: Array, magnitude: float, least: float) -> tuple[Array, Array]:
    """Rates of `StepRequirements` (P, n), and of each panel turn, swing and last significant degree (3, P).

    `least` : of what is significant [rad]
    """
    count, terms = coefficients.shape[:2]
    rates, found = np.empty((count, terms)), np.empty((3, count))
    series = plain(coefficients).reshape(count, -1)
    _kernel().sizes_of_terms(series, plain(widths), float(magnitude), float(least), rates, found)
    return rates, found


def warm() -> None:
    """Call the kernels with the least that they take."""
    degree, one = np.array([4]), np.ones(1)
    coefficients, table = series_of_panels(degree, np.ones((5, 9)), one, one)
    errors_of_panels(degree, one, table, None, 1.0)
    series_with_changed_ends(coefficients, degree, one, 1.0)
    sizes_of_terms(coefficients, one, 1.0, 1.0)


@lru_cache(maxsize=64)
def _matrices(degrees: tuple[int, ...]) -> tuple[Array, Integers]:
    """From values to coefficients of some degrees, column after column, and where each degree's begins."""
    parts = [values_to_coefficients(degree).T.ravel() for degree in degrees]
    places = np.zeros(degrees[-1] + 1, dtype=np.int64)
    places[list(degrees)] = np.cumsum([0, *(part.size for part in parts)])[:-1]
    return np.concatenate(parts), places


@lru_cache(maxsize=1)
def _kernel() -> Any:
    return import_module("._panel_kernel", __package__)
