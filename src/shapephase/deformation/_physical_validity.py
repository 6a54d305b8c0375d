"""What a body's inertia can be at every time: never on one line, and within the triangle inequality."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np

from ..arrays import Array
from ..chebyshev import inside, nodes_on
from ..errors import SingularInertiaError, UnphysicalInertiaError, UnphysicalInertiaWarning
from ..inertia_tensor import triangle_defect

# A flat body stands exactly at the limit of the triangle inequality, and rounding puts it on either side.
_ROUNDING = 1e-9
# As `inverse_inertia` has it: of I's least eigenvalue to its largest.
_LINE = 1e-12
# Chebyshev points of a piece, less one: far more than the swings of a shape motion between two breaks.
_NODES = 64
# Of more pieces than these each has fewer points, so that their number stays bounded.
_MOST_PIECES_FINE = 32
# Minima around which the search continues.
_LOWEST = 16
# Each divides the interval by four: together by 7e7, beyond which the value no longer changes.
_ZOOMS = 13
# Times evaluated at once: the arrays of many particles stay small.
_CHUNK = 4096


def least_over(function: Callable[[Array], Array], breaks: Array) -> tuple[float, float]:
    """The least value of a function that is smooth between breaks, and its time.

    Evaluated at up to 65 Chebyshev points of every piece (fewer, but nine at least, where pieces are many); around the
    sixteen lowest of these the search continues to some 1e-9 of the piece. A dip between the points can be missed.

    Parameters
    ----------
    function : times (N,) -> (N,)
    breaks : (M,) ascending [s]
    """
    left, right = inside(breaks[:-1], breaks[1:])
    count = int(np.clip(_NODES * _MOST_PIECES_FINE // len(left), 8, _NODES))
    times = nodes_on(left, right, count)
    values = _in_chunks(function, times)
    padded = np.pad(values, ((0, 0), (1, 1)), constant_values=np.inf)
    piece, node = np.nonzero((values <= padded[:, :-2]) & (values <= padded[:, 2:]))
    lowest = np.argsort(values[piece, node], kind="stable")[:_LOWEST]
    piece, node = piece[lowest], node[lowest]
    low, high = times[piece, np.maximum(node - 1, 0)], times[piece, np.minimum(node + 1, count)]
    best, when = values[piece, node], times[piece, node]
    for _ in range(_ZOOMS):
        points = np.linspace(low, high, 9, axis=1)
        found = _in_chunks(function, points)
        at = np.argmin(found, axis=1)
        row = np.arange(len(at))
        better = found[row, at] < best
        best, when = np.where(better, found[row, at], best), np.where(better, points[row, at], when)
        low, high = points[row, np.maximum(at - 1, 0)], points[row, np.minimum(at + 1, 8)]
    first = int(np.argmin(best))
    return float(best[first]), float(when[first])


def line_measure(moment: Array) -> Array:
    """Zero where all mass is on one line, else up to 1/3: sum of the minors of a second moment over its squared trace.

    Parameters
    ----------
    moment : (N, 3, 3), the integral of r r^T dm about the centre of mass [kg m^2]

    Returns
    -------
    (N,); zero too where all mass is in one place. Source: theory.md A2.
    """
    a, b, c = moment[:, 0, 0], moment[:, 1, 1], moment[:, 2, 2]
    trace = a + b + c
    minors = a * b - moment[:, 0, 1] ** 2 + b * c - moment[:, 1, 2] ** 2 + c * a - moment[:, 0, 2] ** 2
    return np.divide(minors, trace**2, out=np.zeros_like(minors), where=trace > 0.0)


def check_not_on_a_line(moment: Array, times: Array) -> None:
    """Raise `SingularInertiaError` with the first time at which all mass is on one line: (N, 3, 3), (N,)."""
    bad = line_measure(moment) <= _LINE
    if bad.any():
        _refuse_line(float(times[int(np.argmax(bad))]))


def check_never_on_a_line(moment: Callable[[Array], Array], breaks: Array) -> None:
    """As `check_not_on_a_line` for all times; `moment` is a function of times (N,)."""
    least, when = least_over(lambda t: line_measure(moment(t)), breaks)
    if least <= _LINE:
        _refuse_line(when)


def check_triangle(inertia: Array, times: Array | None, on_unphysical: str) -> None:
    """Refuse, or warn of, tensors (N, 3, 3) that no distribution of mass has, with the worst of the times (N,).

    Raises
    ------
    UnphysicalInertiaError
        Where `on_unphysical` is "error" and the triangle inequality fails by more than rounding.

    Notes
    -----
    Source: theory.md A4.
    """
    if on_unphysical == "allow" or not len(inertia):
        return
    defect = triangle_defect(inertia)
    worst = int(np.argmax(defect))
    if defect[worst] <= _ROUNDING:
        return
    moments = np.linalg.eigvalsh(inertia[worst])
    when = "" if times is None else f"at t = {times[worst]:.6g} s "
    message = (
        f"{when}the principal moments {moments} kg m^2 break the triangle inequality by "
        f"{100.0 * defect[worst]:.3g} % of the largest: no distribution of mass has them; correct them, or take them "
        "as they are with on_unphysical='allow'"
    )
    if on_unphysical == "error":
        raise UnphysicalInertiaError(message)
    warnings.warn(message, UnphysicalInertiaWarning, stacklevel=3)


def _refuse_line(when: float) -> None:
    raise SingularInertiaError(
        f"locked inertia at t = {when:.6g} s is not positive definite: all mass is on one line, so that a turn about "
        "it means nothing; three masses or more, not all on one line, are needed at every time"
    )


def _in_chunks(function: Callable[[Array], Array], times: Array) -> Array:
    flat = times.ravel()
    parts = [function(flat[start : start + _CHUNK]) for start in range(0, len(flat), _CHUNK)]
    return np.concatenate(parts).reshape(times.shape)
