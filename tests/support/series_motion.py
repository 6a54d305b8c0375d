"""Deformations given as Chebyshev series, and their motions by SciPy: no sampling, none of the library's steps."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from scipy.integrate import solve_ivp

from shapephase.arrays import Array
from shapephase.integrator import Interpolant, Sampler, Smoothness
from support.independent import quaternion_rate, to_base

_VOIGT = [[0, 5, 4], [5, 1, 3], [4, 3, 2]]


def random_interpolant(rng: np.random.Generator, *, terms: int = 12, loops: int = 1) -> Interpolant:
    """A body that changes, on three panels of different widths."""
    edges = np.array([0.0, 0.7, 0.9, 1.4])
    series = 0.2 * rng.normal(size=(3, terms, 9)) * (0.4 ** np.arange(terms))[:, None]
    series[:, 0, :3] += [1.0, 0.8, 0.5]
    starts = 1.4 * np.arange(loops)[:, None]
    return Interpolant(np.append((starts + edges[:-1]).ravel(), 1.4 * loops), series, loops, 0)


def constant_interpolant(moments: Array, duration: float) -> Interpolant:
    """A rigid body of given principal moments on one panel."""
    series = np.zeros((1, 1, 9))
    series[0, 0, :3] = 1.0 / np.asarray(moments)
    return Interpolant(np.array([0.0, duration]), series, 1, 0)


def sampler_of_series(interpolant: Interpolant) -> Sampler:
    """A sampler of a body that is the series."""

    def body(_: Array) -> tuple[Array, Array]:
        raise AssertionError("the series are the body")

    known = Smoothness(interpolant.edges, oscillations=1.0, loops=interpolant.loops)
    return Sampler(body, known, interpolant.series)


class SeriesMotion(NamedTuple):
    """At times (N,)."""

    quaternions: Array  # (N, 4) xyzw
    dynamic: Array  # (N,) integral of omega . Pi/|Pi| [rad]
    channels: Array  # (N, 9)


def series_motion(interpolant: Interpolant, momentum: Array, times: Array) -> SeriesMotion:
    """By SciPy's DOP853 on each panel, at ascending times."""
    size = float(np.linalg.norm(momentum))
    edges, count = interpolant.edges, len(interpolant.coefficients)
    state, found, seen = np.array([0.0, 0.0, 0.0, 1.0, 0.0]), [], []
    for panel, (left, right) in enumerate(pairwise(edges)):
        series = interpolant.coefficients[panel % count]

        def channels(t: float | Array, series: Array = series, left: float = left, right: float = right) -> Array:
            return chebyshev.chebval((2.0 * t - left - right) / (right - left), series)

        def slope(t: float, y: Array, channels=channels) -> list[float]:
            here, pi = channels(t), to_base(y[:4] / np.linalg.norm(y[:4]), momentum)
            omega = here[:6][_VOIGT] @ pi - here[6:]
            return [*quaternion_rate(y[:4], omega), float(omega @ pi) / size if size else 0.0]

        inner = times[(times >= left) & ((times < right) if right < edges[-1] else (times <= right))]
        run = solve_ivp(slope, (left, right), state, "DOP853", t_eval=np.append(inner, right), rtol=3e-14, atol=1e-15)
        state = run.y[:, -1]
        state[:4] /= np.linalg.norm(state[:4])
        found.append(run.y[:, :-1].T)
        seen.append(channels(inner).T)
    whole = np.concatenate(found)
    return SeriesMotion(whole[:, :4], whole[:, 4], np.concatenate(seen))


def rates_of_momentum(channels: Array, momentum: Array, directions: Array) -> tuple[Array, Array]:
    """I^-1 Pi and I^-1 L_o, with Pi of the momentum's size along directions (N, 3): (N, 3) each."""
    inverse = channels[:, :6][:, _VOIGT]
    return np.linalg.norm(momentum) * np.einsum("nij,nj->ni", inverse, directions), channels[:, 6:]
