"""Panels in machine code: the series through their samples, what these are off by, and how finely to step them."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from ...arrays import Array, Integers
from ...chebyshev import MARGIN_OF_WIDTH, on_halves, unit_nodes, values_to_coefficients
from ..steps.quadrature_defects import Defects, defect_table, signed_defects
from ._plain import plain
from .estimate_constants import HIGHEST_DEGREE

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
    matrices, places, _, _ = _tables(tuple(sorted(set(degree.tolist()))))
    _kernel().series_of_panels(degree, values, shift, rounding, matrices, places, coefficients, table)
    return coefficients.reshape(count, terms, 9), table


def times_of_samples(degree: Integers, left: Array, right: Array, margin: Array) -> Array:
    """What `sample_times` finds, by how far the first and last times of panels are moved: (P,) each -> (S,) [s]."""
    _, _, nodes, places = _tables(tuple(sorted(set(degree.tolist()))))
    times = np.empty(int(degree.sum()) + len(degree))
    _kernel().times_of_samples(degree, plain(left), plain(right), plain(margin), nodes, places, times)
    return times


class PanelsToSample(NamedTuple):
    """What becomes of panels, as of `FinerPanels`, and where they are to be sampled."""

    origin: Integers
    factor: Integers
    degree: Integers
    left: Array
    right: Array
    times: Array  # [s]


class SampledPanels(NamedTuple):
    """Panels after a round of sampling, and what to go on with."""

    values: Array  # (S, 9)
    coefficients: Array  # (P, n, 9)
    table: Array  # (P, 9) of the errors of the series
    errors: Array  # (4, P) as of `PanelErrors` [rad]
    further: Integers  # (P,) as `refining_factors` has them; of length zero: these panels do
    finer: PanelsToSample


class Demand(NamedTuple):
    """What panels are sampled for."""

    momentum: float  # [kg m^2/s]
    tolerance: float  # [rad]
    whole: float  # duration of all loops [s]
    loops: int
    margin: float  # how far the ends of wide panels are moved [s]


def sampled_round(
    old_degree: Integers, old_values: Array, panels: PanelsToSample, fresh: Array, hidden: Array | None, demand: Demand
) -> SampledPanels:
    """A round of sampling in one call.

    Parameters
    ----------
    old_degree, old_values : (O,), (S, 9) of the panels that these come from
    fresh : (F, 9) at the times of `panels`
    hidden : (P, 5) of a path that is resolved; None: nothing is known of that
    """
    origin, factor, degree, left, right, _ = panels
    matrices, places, _, _ = _tables(tuple(sorted(set(degree.tolist()))))
    *found, further, made, ends, times = _kernel().sample_round(
        old_degree, plain(old_values), origin, factor, degree, plain(left), plain(right), plain(fresh),
        _NOTHING_HIDDEN if hidden is None else plain(hidden), demand.momentum, demand.tolerance, demand.whole,
        demand.loops, demand.margin, MARGIN_OF_WIDTH, matrices, places, *_all_nodes(),
    )  # fmt: skip
    values, coefficients, table, errors = found
    finer = PanelsToSample(made[0], made[1], made[2], ends[0], ends[1], times)
    return SampledPanels(values, coefficients.reshape(len(degree), -1, 9), table, errors, further, finer)


def errors_of_panels(degree: Integers, width: Array, table: Array, hidden: Array | None, momentum: float) -> Array:
    """The table that `panel_errors` finds: (4, P) [rad]."""
    found = np.empty((4, len(degree)))
    path = _NOTHING_HIDDEN if hidden is None else plain(hidden)
    _kernel().errors_of_panels(degree, plain(width), plain(table), path, float(momentum), found)
    return found


def series_with_changed_ends(coefficients: Array, degree: Integers, widths: Array, momentum: float) -> Array:
    """What `perturbed_series` makes: (P, n, 9)."""
    changed = np.array(coefficients, dtype=np.float64)
    _kernel().change_ends(degree, plain(widths), float(momentum), changed.reshape(len(widths), -1))
    return changed


def halves_of_panels(coefficients: Array) -> Array:
    """What `halved_series` finds: (P, n, 9) -> (2 P, m, 9)."""
    panels, terms, channels = coefficients.shape
    matrix, kept = _halving_matrix(terms)
    found = np.empty((2 * panels, kept * channels))
    _kernel().halve_panels(plain(coefficients).reshape(panels, -1), matrix, found)
    return found.reshape(2 * panels, kept, channels)


def sizes_of_terms(coefficients: Array, widths: Array, magnitude: float, least: float) -> tuple[Array, Array]:
    """Rates of `StepRequirements` (P, n), and its sizes (4, P).

    `least` : of what is significant [rad]
    """
    count, terms = coefficients.shape[:2]
    rates, found = np.empty((count, terms)), np.empty((4, count))
    series = plain(coefficients).reshape(count, -1)
    _plan_kernel().sizes_of_terms(series, plain(widths), float(magnitude), float(least), rates, found)
    return rates, found


def plan_of_steps(
    coefficients: Array, widths: Array, rates: Array, turns: Array, sizes: Array,
    loops: int, tolerance: float, turn_a_step: float, *, moving: bool,
) -> Array:  # fmt: skip
    """What `StepRequirements.plan` finds: (P,)."""
    planned, series = np.empty(len(turns)), plain(coefficients).reshape(len(widths), -1)
    arrays, tables = (plain(rates), plain(turns), plain(sizes)), (plain(defect_table()), plain(signed_defects()))
    _plan_kernel().plan_steps(
        series, plain(widths), *arrays, loops, float(tolerance), turn_a_step, moving, *tables, planned
    )
    return planned


def defects_of_panels(rates: Array, turns: Array, steps: Integers) -> Defects:
    """What `PanelDefects.found` finds."""
    found = np.empty(5)
    _plan_kernel().defects_of_panels(plain(rates), plain(turns), steps, plain(defect_table()), found)
    return Defects(*found.tolist())


def warm() -> None:
    """Call the kernels with the least that they take."""
    degree, one = np.array([4]), np.ones(1)
    coefficients, table = series_of_panels(degree, np.ones((5, 9)), one, one)
    times_of_samples(degree, one, one, one)
    none, demand = np.zeros(1, dtype=np.int64), Demand(1.0, 1.0, 1.0, 1, 1.0)
    panels = PanelsToSample(none, none, degree, np.zeros(1), one, np.zeros(5))
    sampled_round(degree[:0], np.zeros((0, 9)), panels, np.ones((5, 9)), None, demand)
    errors_of_panels(degree, one, table, None, 1.0)
    halves_of_panels(coefficients)
    series_with_changed_ends(coefficients, degree, one, 1.0)
    rates, sizes = sizes_of_terms(coefficients, one, 1.0, 1.0)
    plan_of_steps(coefficients, one, rates, one, sizes, 1, 1.0, 1.0, moving=True)
    defects_of_panels(rates, one, np.array([2]))


def halved_matrix(degree: int) -> Array:
    """From sums and differences of the values at opposite nodes to even and odd coefficients, numbers in a row.

    Column after column: the even ones filled up with zeros to a multiple of eight, then the odd ones; as many columns
    of zeros follow as make a multiple of four.
    """
    whole, half = values_to_coefficients(degree), degree // 2 + 1
    return _columns(whole[::2, :half].T, whole[1::2, :half].T)


@lru_cache(maxsize=64)
def _halving_matrix(terms: int) -> tuple[Array, int]:
    """From even and odd coefficients to those of the second half of a series, as `halved_matrix`; how many these are.

    Of the first half they are the same with other signs.
    """
    second = on_halves(terms)[1]
    return _columns(second[:, 1::2].T, second[:, ::2].T), len(second)


def _columns(even: Array, odd: Array) -> Array:
    """Columns (k, n) of two matrices, each of one before that of the other, filled up with zeros."""
    count, size = max(len(even), len(odd)), max(even.shape[1], odd.shape[1])
    columns = np.zeros((-(-count // 4) * 4, 2, -(-size // 8) * 8))
    columns[: len(even), 0, : even.shape[1]] = even
    columns[: len(odd), 1, : odd.shape[1]] = odd
    return columns.ravel()


@lru_cache(maxsize=64)
def _tables(degrees: tuple[int, ...]) -> tuple[Array, Integers, Array, Integers]:
    """From values to coefficients, as of `halved_matrix`, and nodes of some degrees; after both, where each's begin."""
    matrices = [halved_matrix(degree) for degree in degrees]
    nodes = [unit_nodes(degree) for degree in degrees]
    found: list[Any] = []
    for parts in (matrices, nodes):
        places = np.zeros(degrees[-1] + 1, dtype=np.int64)
        places[list(degrees)] = np.cumsum([0, *(part.size for part in parts)])[:-1]
        found += [np.concatenate(parts), places]
    return found[0], found[1], found[2], found[3]


@lru_cache(maxsize=1)
def _all_nodes() -> tuple[Array, Integers]:
    """Of [-1, 1], of all degrees that panels can have, and where those of each begin."""
    nodes = [unit_nodes(degree) for degree in range(HIGHEST_DEGREE + 1)]
    return np.concatenate(nodes), np.cumsum([0, *(len(one) for one in nodes)])[:-1]


@lru_cache(maxsize=1)
def _kernel() -> Any:
    return import_module(".kernels.panel_kernel", __package__)


@lru_cache(maxsize=1)
def _plan_kernel() -> Any:
    return import_module(".kernels.plan_kernel", __package__)
