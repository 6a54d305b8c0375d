"""Checks of a body's inertia at every time: not all mass on one line, and the triangle inequality."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np

from ..arrays import Array
from ..errors import SingularInertiaError, UnphysicalInertiaError, UnphysicalInertiaWarning
from ..inertia_tensor import triangle_defect
from ..refinement import least_over

_ROUNDING = 1e-9  # of the triangle inequality: a flat body is at its limit, and rounding puts it on either side
_LINE = 1e-12  # ratio of I's least eigenvalue to its largest, the limit of `inverse_inertia`


def line_measure(moment: Array) -> Array:
    """Zero where all mass is on one line, else up to 1/3: sum of the minors of a second moment over its squared trace.

    `moment` (N, 3, 3) is the integral of r r^T dm about the centre of mass [kg m^2]. The result (N,) is also zero where
    all mass is in one place. Source: theory.md A2.
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
    """Raise `SingularInertiaError` if all mass is on one line at any time; `moment` is a function of times (N,)."""
    least, when = least_over(lambda t: line_measure(moment(t)), breaks)
    if least <= _LINE:
        _refuse_line(when)


def check_triangle(inertia: Array, times: Array | None, on_unphysical: str) -> None:
    """Refuse, or warn of, tensors (N, 3, 3) that no distribution of mass has, with the worst of the times (N,).

    Raises UnphysicalInertiaError where `on_unphysical` is "error" and the triangle inequality fails by more than
    rounding. Source: theory.md A4.
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
