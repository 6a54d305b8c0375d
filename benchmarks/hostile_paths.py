"""Paths known only as functions of time that try to hide something: `python -m benchmarks.hostile_paths [runs] [seed]`.

Bursts, bumps, short ramps, jumps, kinks, noise and wrong rates, as wide as the whole motion or a hundred-thousandth of
it, are judged against 80-bit precision (`benchmarks.extended`): solved within the estimate, solved with a warning that
names the time, refused with the time, refused without it, or silently wrong.
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import re
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

import shapephase as sp
from shapephase.errors import ShapePhaseError, UndeclaredBreakWarning

from .extended import BUMP, BURST, GAUSSIAN, HARMONIC, RAMP, Terms, Truth, angles_between

# Few joints: what is judged is how the path is followed, and the truth takes its time.
BODIES = ("cat_two_halves", "cat", "satellite")
SMOOTH = ("bump", "gaussian", "burst", "smooth ramp")
ROUGH = ("kink", "soft kink", "straight ramp", "jump", "noise", "wrong rate", "wrong rate in a window")
KINDS = SMOOTH + ROUGH
NARROWEST = 1e-5
"""Width of what is hidden, as a share of the duration."""
# What counts as the width of a Gaussian or a hyperbolic tangent: beyond, less than 1e-7 of it is left.
_TAILS = 8.0
# [rad] Every second path is at rest but for what it hides; wrong rates need something that moves.
_BACKGROUNDS = (0.0, 0.3)
EDGES = (1.0, 0.1, 1 / 50, 1 / 500, 1 / 2000, 1e-4, NARROWEST)
OUTCOMES = ("solved", "warned", "refused, time named", "refused", "silently wrong")


@dataclass(frozen=True)
class Hostile:
    """One path with something hidden in it."""

    kind: str
    body: str
    width: float  # share of the duration
    centre: float  # [s]
    duration: float  # [s]
    function: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    truth: Terms | sp.ShapePath  # what the shapes are
    breaks: np.ndarray
    momentum: np.ndarray
    tolerance: float
    noise: float = 0.0


@lru_cache(maxsize=8)
def _body(name: str) -> sp.Body:
    return sp.load_body(name)


@lru_cache(maxsize=8)
def _truth(name: str) -> Truth:
    return Truth(_body(name))


def hostile_paths(count: int, seed: int = 1) -> Iterator[Hostile]:
    """A seeded series of them; each run depends on its own number alone."""
    for number in range(count):
        yield hostile_path(KINDS[number % len(KINDS)], np.random.default_rng((seed, number)))


def hostile_path(kind: str, rng: np.random.Generator) -> Hostile:
    """A path of a kind, at random."""
    name = str(rng.choice(BODIES))
    body = _body(name)
    n, duration = body.n_shape, float(10.0 ** rng.uniform(-0.5, 1.0))
    width = float(10.0 ** rng.uniform(np.log10(NARROWEST), 0.0))
    support = width * duration
    centre = float(rng.uniform(0.5 * support, duration - 0.5 * support))
    size = float(10.0 ** rng.uniform(-3.0, 0.0))
    background = float(rng.choice(_BACKGROUNDS[1:] if "wrong" in kind else _BACKGROUNDS))
    joints = rng.permutation(n)[: rng.integers(1, n + 1)]
    amplitudes = size * rng.uniform(-1.0, 1.0, len(joints))
    inertia = float(np.linalg.eigvalsh(body.locked_inertia(np.zeros(n)))[-1])
    momentum = rng.normal(size=3) * inertia / duration * float(rng.choice([0.0, 2.0]))
    tolerance = float(10.0 ** rng.uniform(-9.0, -5.0))
    edges = np.array([0.0, duration])
    if kind in SMOOTH or kind in ROUGH[4:]:
        rows = _swings(rng, n, background, duration)
        if kind in SMOOTH:
            rows += [
                _term(kind, int(j), float(a), centre, support, rng) for j, a in zip(joints, amplitudes, strict=True)
            ]
        truth: Terms | sp.ShapePath = Terms(n, np.array(rows).reshape(-1, 7))
        edges = np.unique(np.clip(centre + support * np.array([-4.0, -0.5, 0.0, 0.5, 4.0]), 0.0, duration))
        edges = np.unique(np.concatenate([[0.0, duration], edges]))
    else:
        truth = _broken(kind, rng, n, background, duration, (centre, support), joints, amplitudes)
        edges = truth.breaks
    function: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]] = truth if isinstance(truth, Terms) else truth.curve
    noise = 0.0
    if kind == "noise":
        noise = float(10.0 ** rng.uniform(-12.0, -2.0))
        function = _noisy(function, noise, int(rng.integers(1 << 30)), (centre, support))
    elif kind == "wrong rate":
        width, centre = 1.0, 0.5 * duration
        function = _wrong(function, float(10.0 ** rng.uniform(-5.0, 0.0)), joints, (centre, 10.0 * duration))
    elif kind == "wrong rate in a window":
        function = _wrong(function, float(10.0 ** rng.uniform(-2.0, 1.0)), joints, (centre, support))
    return Hostile(kind, name, width, centre, duration, function, truth, edges, momentum, tolerance, noise)


def _swings(rng: np.random.Generator, n: int, size: float, duration: float) -> list[tuple[float, ...]]:
    frequency = 2.0 * np.pi / duration
    return [
        (HARMONIC, float(i), size * rng.uniform(-1.0, 1.0), 0.0, 0.0, frequency * k, rng.uniform(0.0, 6.0))
        for i in range(n)
        for k in (1.0, 2.0)
    ]


def _term(kind: str, joint: int, size: float, centre: float, support: float, rng: np.random.Generator) -> tuple:
    if kind == "bump":
        return (BUMP, float(joint), size, centre, 0.5 * support, 0.0, 0.0)
    width = support / _TAILS
    if kind == "burst":
        swings = 2.0 * np.pi / support * rng.uniform(1.0, 8.0)
        return (BURST, float(joint), size, centre, width, swings, rng.uniform(0.0, 6.0))
    return (GAUSSIAN if kind == "gaussian" else RAMP, float(joint), size, centre, width, 0.0, 0.0)


def _broken(
    kind: str,
    rng: np.random.Generator,
    n: int,
    background: float,
    duration: float,
    place: tuple[float, float],
    joints: np.ndarray,
    amplitudes: np.ndarray,
) -> sp.ShapePath:
    """A cubic in time, and on it a kink, a straight ramp or a jump."""
    from shapephase.shape_space.curves import PiecewisePolynomial

    centre, support = place
    knots = np.array([0.0, centre - 0.5 * support, centre + 0.5 * support, duration])
    base = background * rng.uniform(-1.0, 1.0, (4, n)) / duration ** np.arange(4)[:, None]
    pieces = np.zeros((4, 3, n))
    for k, start in enumerate(knots[:-1]):
        for power in range(4):
            for term in range(power, 4):
                pieces[power, k] += base[term] * _binomial(term, power) * start ** (term - power)
    if kind == "straight ramp":
        pieces[1, 1, joints] += amplitudes / support
        pieces[0, 2, joints] += amplitudes
    elif kind == "kink":
        # There and back: a triangle would be a bump of bounded support.
        pieces[1, 1, joints] += amplitudes / duration
        pieces[0, 2, joints] += amplitudes * support / duration
    elif kind == "soft kink":
        rate = amplitudes / (support * duration)
        pieces[2, 1, joints] += rate
        pieces[0, 2, joints] += rate * support**2
        pieces[1, 2, joints] += 2.0 * rate * support
    else:
        pieces[0, 1, joints] += amplitudes
    return sp.ShapePath(PiecewisePolynomial(knots, pieces), duration, knots, n)


def _binomial(n: int, k: int) -> float:
    from math import comb

    return float(comb(n, k))


def _noisy(function: Callable, noise: float, seed: int, place: tuple[float, float]) -> Callable:
    """Noise on shapes and rates that depends on the time alone, within the support."""
    centre, support = place

    def noisy(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        shapes, rates = function(times)
        grains = (times.view(np.uint64) * np.uint64(2654435761) + np.uint64(seed)) * np.uint64(0x9E3779B97F4A7C15)
        grains ^= grains >> np.uint64(31)
        grains *= np.uint64(0xBF58476D1CE4E5B9)
        dust = noise * ((grains >> np.uint64(11)) / 2.0**53 - 0.5) * (np.abs(times - centre) < 0.5 * support)
        return shapes + dust[:, None], rates + dust[:, None]

    return noisy


def _wrong(function: Callable, share: float, joints: np.ndarray, place: tuple[float, float]) -> Callable:
    """Rates too large by a share, within a smooth window."""
    centre, support = place

    def wrong(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        shapes, rates = function(times)
        x = 2.0 * (times - centre) / support
        window = np.where(np.abs(x) < 1.0, np.exp(1.0 - 1.0 / np.maximum(1.0 - x * x, 1e-300)), 0.0)
        rates = rates.copy()
        rates[:, joints] *= 1.0 + share * window[:, None]
        return shapes, rates

    return wrong


@dataclass(frozen=True)
class Verdict:
    """What became of a run; error and estimate [rad] where it was solved."""

    outcome: str
    message: str = ""
    error: float = np.nan
    estimate: float = np.nan
    evaluations: int = 0
    scan: int = 0


def judged(hostile: Hostile) -> Verdict:
    """Solve it, and compare with the truth."""
    caught: list[str] = []
    try:
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always")
            path = sp.ShapePath.function(hostile.function, hostile.duration)
            deformation = sp.articulated(_body(hostile.body), path)
            motion = sp.reconstruct(deformation, hostile.momentum, tolerance=hostile.tolerance)
        caught = [str(w.message) for w in heard if issubclass(w.category, UndeclaredBreakWarning)]
    except ShapePhaseError as error:
        message = f"{type(error).__name__}: {error}"
        named = re.search(r"(at|near|t =) -?[0-9.]+(e[-+][0-9]+)? s", message)
        return Verdict("refused, time named" if named else "refused", message)
    feature = hostile.centre + hostile.width * hostile.duration * np.linspace(-0.6, 0.6, 13)
    times = np.unique(np.clip(np.concatenate([np.linspace(0.0, hostile.duration, 41), feature]), 0.0, hostile.duration))
    exact, uncertain = _truth(hostile.body).attitudes(hostile.truth, hostile.breaks, hostile.momentum, times)
    error = float(angles_between(exact, motion.attitude(times)).max())
    estimate = float(motion.error_estimate)
    scan = path.scan.evaluations if path.scan is not None else 0
    right = error <= max(estimate, 3.0 * uncertain)
    outcome = ("warned" if caught else "solved") if right else "silently wrong"
    return Verdict(outcome, "; ".join(caught), error, estimate, motion.evaluations, scan)


def main() -> None:
    """Print what became of the runs, by kind and by width."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 3000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    table: dict[tuple[str, int], Counter[str]] = {}
    faults: list[str] = []
    begun = time.monotonic()
    for number, hostile in enumerate(hostile_paths(runs, seed)):
        verdict = judged(hostile)
        band = int(np.searchsorted(-np.array(EDGES), -hostile.width, side="right")) - 1
        table.setdefault((hostile.kind, band), Counter())[verdict.outcome] += 1
        smooth_and_wide = hostile.kind in SMOOTH and hostile.width > 1 / 500
        if verdict.outcome in ("silently wrong", "refused") or (smooth_and_wide and verdict.outcome != "solved"):
            faults.append(
                f"{number:5d} {hostile.kind:22} {hostile.body:14} width {hostile.width:.2e} tolerance "
                f"{hostile.tolerance:.1e} noise {hostile.noise:.0e}: {verdict.outcome}, error {verdict.error:.2g}, "
                f"estimate {verdict.estimate:.2g} {verdict.message[:160]}"
            )
    print(f"{runs} runs, seed {seed}, {time.monotonic() - begun:.0f} s")
    print(f"{'kind':24}{'width of the duration':>24}" + "".join(f"{outcome:>21}" for outcome in OUTCOMES))
    for kind in KINDS:
        for band in range(len(EDGES) - 1):
            counts = table.get((kind, band))
            if counts:
                print(
                    f"{kind:24}{f'{EDGES[band + 1]:.5g} to {EDGES[band]:.5g}':>24}"
                    + "".join(f"{counts[outcome]:21d}" for outcome in OUTCOMES)
                )
    narrow = [counts for (_, band), counts in table.items() if EDGES[band] <= 1 / 2000]
    total = sum(sum(counts.values()) for counts in narrow)
    missed = sum(counts["silently wrong"] for counts in narrow)
    wide = sum(counts["silently wrong"] for (_, band), counts in table.items() if EDGES[band] > 1 / 2000)
    print(f"wider than 1/2,000: {wide} silently wrong; narrower: {total - missed} of {total} found")
    print(*faults, sep="\n")


if __name__ == "__main__":
    main()
