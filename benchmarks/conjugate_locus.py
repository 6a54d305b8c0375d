"""A conjugate locus of 400 points against the variational equation: `python -m benchmarks.conjugate_locus [rtol ...]`.

`conjugate_locus` against SciPy's DOP853 on the extremal with Jacobi's equation, one extremal at a time, stopped by an
event at the first zero of the field (a right-hand side in plain floats, without waste). On an ellipsoid in closed
form, on the Serret-Andoyer metric of I = (3, 2, 1) by its stretch, and on a torus by m and m' alone, of which the table
is counted in. The two run in turn, in one process with one thread; medians of the runs. Errors are against 1e-13.
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp

from shapephase.rigid_body.geodesics import (
    SurfaceOfRevolution,
    conjugate_locus,
    conjugate_points,
    ellipsoid,
    surface_of_metric,
    surface_of_stretch,
)

POINTS = 400
"""Of a locus, as many as a figure shows."""
RUNS = 3
"""Of each, in turn; the least odd number with a median."""
LARGEST_RATIO = 0.05
"""Of our time to that of the integration: what the closed form is expected to save."""
ASPECT = 0.6
"""Polar over equatorial axis, oblate."""
INVERSE_MOMENTS = (1.0, 1.0 / 2.0, 1.0 / 3.0)
"""a_1 > a_2 > a_3 of ascending moments (1, 2, 3) [1/(kg m^2)]."""

Geometry = Callable[[float], tuple[float, float, float, float, float]]
"""x -> F_1, F_1', F_2, F_2' and the Gauss curvature, of F_1 dx^2 + F_2 d theta^2."""


@dataclass(frozen=True)
class Case:
    """A surface, how it is made anew, and its geometry for the integration."""

    name: str
    surface: Callable[[], SurfaceOfRevolution]
    geometry: Geometry


def main() -> None:
    """Print the table."""
    print(f"{POINTS} first conjugate points of a point on the equator; medians of {RUNS} runs")
    print(f"{'surface':16}{'rtol':>8}{'ours [ms]':>11}{'solve_ivp [ms]':>16}{'ratio':>8}{'error':>10}{'solve_ivp':>11}")
    for case in cases():
        truth = integrated(case, 1e-13)
        for rtol in [float(a) for a in sys.argv[1:]] or (1e-9, 1e-6):
            runs = [(*timed(partial(ours, case)), *timed(partial(integrated, case, rtol))) for _ in range(RUNS)]
            mine, theirs = (1e3 * float(np.median([run[k] for run in runs])) for k in (0, 2))
            errors = [float(np.abs(runs[-1][k] - truth).max()) for k in (1, 3)]
            print(
                f"{case.name:16}{rtol:8.0e}{mine:11.1f}{theirs:16.0f}{mine / theirs:8.4f}"
                f"{errors[0]:10.1e}{errors[1]:11.1e}"
            )
    print(f"expected: ratio at most {LARGEST_RATIO:g}")


def ours(case: Case) -> np.ndarray:
    """Conjugate times."""
    return conjugate_locus(case.surface(), POINTS).points.time


def integrated(case: Case, rtol: float) -> np.ndarray:
    """The same times by the variational equation, direction by direction."""
    surface = case.surface()
    directions = conjugate_locus(surface, POINTS).points.direction
    longest = 1.1 * float(conjugate_points(surface, directions).time.max())
    return np.array([first_zero(case.geometry, float(angle), longest, rtol) for angle in directions])


def first_zero(geometry: Geometry, direction: float, longest: float, rtol: float) -> float:
    """The first zero of the Jacobi field along one extremal."""
    f1, _, f2, _, _ = geometry(0.0)
    p = math.sqrt(f2) * math.cos(direction)

    def rate(_: float, state: np.ndarray) -> list[float]:
        x, momentum, _, field, slope = state.tolist()
        f1, f1_rate, f2, f2_rate, curvature = geometry(x)
        pull = 0.5 * (momentum * momentum * f1_rate / (f1 * f1) + p * p * f2_rate / (f2 * f2))
        return [momentum / f1, pull, p / f2, slope, -curvature * field]

    def conjugate(_: float, state: np.ndarray) -> float:
        return state[3]

    conjugate.terminal = True  # type: ignore[attr-defined]
    conjugate.direction = -1.0  # type: ignore[attr-defined]
    start = [0.0, math.sqrt(f1) * math.sin(direction), 0.0, 0.0, 1.0]
    options = {"method": "DOP853", "rtol": rtol, "atol": 0.1 * rtol, "events": conjugate}
    return float(solve_ivp(rate, (0.0, longest), start, **options).t_events[0][0])


def cases() -> list[Case]:
    """The three surfaces."""
    return [
        Case("ellipsoid", lambda: ellipsoid(ASPECT), ellipsoid_geometry),
        Case("Serret-Andoyer", andoyer, andoyer_geometry),
        Case("torus", lambda: surface_of_metric(torus, np.pi), torus_geometry),
    ]


def ellipsoid_geometry(psi: float) -> tuple[float, float, float, float, float]:
    sine, cosine = math.sin(psi), math.cos(psi)
    f1 = sine * sine + ASPECT**2 * cosine * cosine
    return f1, 2.0 * (1.0 - ASPECT**2) * sine * cosine, cosine * cosine, -2.0 * sine * cosine, (ASPECT / f1) ** 2


def andoyer() -> SurfaceOfRevolution:
    """By D = sqrt(a_3/((a_2 - a_3 - a_2 Y)(a_1 - a_3 - a_1 Y))); a_3, a_2, a_1 are A, B, C of Bonnard et al."""
    a1, a2, a3 = INVERSE_MOMENTS

    def stretch(square: np.ndarray, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        u, v = a2 * rest, a1 - a3 - a1 * square
        value = np.sqrt(a3 / (u * v))
        slope = 0.5 * value * (a2 / u + a1 / v)
        return value, slope, 0.5 * slope * (a2 / u + a1 / v) + 0.5 * value * ((a2 / u) ** 2 + (a1 / v) ** 2)

    return surface_of_stretch(stretch, 1.0 / a3, 1.0 - a3 / a2, "parallel")


def andoyer_geometry(y: float) -> tuple[float, float, float, float, float]:
    """In the angle from the axis of the largest moment, where no elliptic function is needed: half z is w."""
    a1, a2, a3 = INVERSE_MOMENTS
    sine, cosine = math.sin(y), math.cos(y)
    w = a3 * cosine * cosine + a2 * sine * sine
    w_rate = 2.0 * (a2 - a3) * sine * cosine
    total, pairs = a1 + a2 + a3, a1 * a2 + a1 * a3 + a2 * a3
    root = math.sqrt(pairs * pairs - 3.0 * a1 * a2 * a3 * total)
    curvature = total * (w - (pairs - root) / total) * (w - (pairs + root) / total) / (w * w)
    return 1.0 / (a1 - w), w_rate / (a1 - w) ** 2, 1.0 / w, -w_rate / (w * w), curvature


def torus(phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    r = 2.0 + np.cos(phi)
    return r * r, -2.0 * np.sin(phi) * r


def torus_geometry(phi: float) -> tuple[float, float, float, float, float]:
    cosine = math.cos(phi)
    r = 2.0 + cosine
    return 1.0, 0.0, r * r, -2.0 * math.sin(phi) * r, cosine / r


def timed(run: Callable[[], np.ndarray]) -> tuple[float, np.ndarray]:
    """Seconds, and the result."""
    start = time.process_time()
    result = run()
    return time.process_time() - start, result


if __name__ == "__main__":
    main()
