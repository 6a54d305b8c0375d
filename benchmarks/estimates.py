"""Whether error estimates hold: `python -m benchmarks.estimates [RUNS [SEED]]`; needs a C compiler.

Random bodies, paths, momenta and tolerances; the true error is the largest at sixty random times and the end, against
an integration in extended precision. `harmonics` are loops of one or two harmonics up to the 24th, `mixed` are Fourier
loops, moves, splines and black boxes of smooth terms.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import shapephase as sp

from .extended import BURST, GAUSSIAN, HARMONIC, RAMP, Terms, Truth, angles_between

TIMES = 60


@dataclass(frozen=True)
class Run:
    """One reconstruction judged: errors in rad; without a result the true error is NaN."""

    what: str
    tolerance: float
    error: float
    estimate: float
    evaluations: int


@dataclass(frozen=True)
class Trial:
    """A path, and the same in a form that the extended precision follows."""

    what: str
    path: sp.ShapePath
    exact: sp.ShapePath | Terms


def main() -> None:
    """Print a summary of each family."""
    runs, seed = (int(argument) for argument in (sys.argv[1:] + ["200", "1"][len(sys.argv) - 1 :]))
    for family in (harmonics, mixed):
        print(summary(family.__name__, judged(family, runs, seed)))


def judged(family: Callable[[sp.Body, np.random.Generator], Trial], runs: int, seed: int) -> list[Run]:
    """Runs of a family on the bodies that come with the library."""
    rng = np.random.default_rng(seed)
    bodies = [sp.load_body(name) for name in sp.robot_names()]
    truths = [Truth(body) for body in bodies]
    results = []
    for _ in range(runs):
        number = int(rng.integers(len(bodies)))
        results.append(judge(bodies[number], truths[number], family(bodies[number], rng), rng))
    return results


def judge(body: sp.Body, truth: Truth, trial: Trial, rng: np.random.Generator) -> Run:
    """One run, with momentum in half of all."""
    tolerance = 10.0 ** rng.uniform(-12.0, -5.0)
    momentum = np.zeros(3)
    if rng.random() < 0.5:
        momentum = rng.normal(size=3)
        moment = float(np.trace(body.locked_inertia(np.zeros(body.n_shape)))) / 3.0
        momentum *= 10.0 ** rng.uniform(-1.0, 1.0) * moment / np.linalg.norm(momentum)
    times = np.append(np.sort(rng.uniform(0.0, trial.path.duration, TIMES)), trial.path.duration)
    what = f"{body.name} {trial.what}{'' if momentum.any() else ', at rest'}"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            motion = sp.reconstruct(sp.articulated(body, trial.path), momentum, tolerance=tolerance)
    except sp.errors.AccuracyNotReached:
        return Run(what, tolerance, np.nan, np.nan, 0)
    exact, bound = truth.attitudes(trial.exact, trial.path.breaks, momentum, times)
    error = float(angles_between(exact, motion.attitude(times)).max())
    return Run(what, tolerance, max(error - bound, 1e-18), float(motion.error_estimate), motion.evaluations)


def summary(name: str, runs: list[Run]) -> str:
    """What the runs of a family came to."""
    done = [run for run in runs if not np.isnan(run.error)]
    over = sorted((run.error / run.estimate, run) for run in done if run.error > run.estimate)
    ratio = np.array([run.estimate / run.error for run in done])
    slack = np.array([run.tolerance / run.error for run in done])
    lines = [
        f"{name}: {len(runs)} runs, {len(runs) - len(done)} refused, {len(over)} above their estimate",
        f"  estimate / true error: median {np.median(ratio):.3g}, least {ratio.min():.3g}, 95 % "
        f"{np.quantile(ratio, 0.95):.3g}",
        f"  tolerance / true error: median {np.median(slack):.3g}; evaluations: median "
        f"{np.median([run.evaluations for run in done]):.0f}",
    ]
    lines += [f"  {times:.3g} times its estimate {run.estimate:.2g}: {run.what}" for times, run in over[::-1][:10]]
    return "\n".join(lines)


def harmonics(body: sp.Body, rng: np.random.Generator) -> Trial:
    """One harmonic, or two of one or two joints, amplitudes 0.1 to 4."""
    highest = int(rng.integers(1, 25))
    chosen = [highest] if rng.random() < 0.5 else [highest, int(rng.integers(1, highest + 1))]
    sines = np.zeros((body.n_shape, highest))
    for harmonic in chosen:
        joint = int(rng.integers(body.n_shape))
        sines[joint, harmonic - 1] += _reach(body)[joint] * 10.0 ** rng.uniform(-1.0, np.log10(4.0))
    path = sp.ShapePath.fourier(np.zeros(body.n_shape), 0.0 * sines, sines, 1.0)
    return Trial(f"harmonics {chosen}", path, path)


def mixed(body: sp.Body, rng: np.random.Generator) -> Trial:
    """A loop, a move, a spline or a black box of smooth terms."""
    return (_loop, _move, _spline, _terms)[rng.integers(4)](body, rng)


def _loop(body: sp.Body, rng: np.random.Generator) -> Trial:
    count = int(rng.integers(1, 9))
    size = 10.0 ** rng.uniform(-2.0, 0.0) * _reach(body)[:, None] / np.arange(1, count + 1) ** rng.uniform(0.5, 2.0)
    cosines, sines = rng.normal(size=(2, body.n_shape, count)) * size
    path = sp.ShapePath.fourier(np.zeros(body.n_shape), cosines, sines, 10.0 ** rng.uniform(-1.0, 1.0))
    return Trial(f"loop of {count}", path, path)


def _move(body: sp.Body, rng: np.random.Generator) -> Trial:
    count = int(rng.integers(2, 6))
    points = rng.normal(size=(count, body.n_shape)) * 0.5 * _reach(body)
    path = sp.ShapePath.waypoints(np.cumsum(rng.uniform(0.1, 1.0, count)), points)
    return Trial(f"move through {count}", path, path)


def _spline(body: sp.Body, rng: np.random.Generator) -> Trial:
    count = int(rng.integers(4, 60))
    points = np.cumsum(rng.normal(size=(count, body.n_shape)), axis=0) * 0.2 / np.sqrt(count) * _reach(body)
    path = sp.ShapePath.spline(np.cumsum(rng.uniform(0.5, 1.0, count)) / count, points)
    return Trial(f"spline of {count}", path, path)


def _terms(body: sp.Body, rng: np.random.Generator) -> Trial:
    rows = []
    for joint in range(body.n_shape):
        kind = (HARMONIC, GAUSSIAN, RAMP, BURST)[rng.integers(4)]
        width, frequency = 10.0 ** rng.uniform(-1.5, 0.0), rng.uniform(1.0, 20.0)
        size = _reach(body)[joint] * 10.0 ** rng.uniform(-2.0, 0.0)
        rows.append((kind, joint, size, rng.uniform(0.2, 0.8), width, frequency, rng.uniform(0.0, 6.0)))
    terms = Terms(body.n_shape, np.array(rows))
    return Trial("black box", sp.ShapePath.function(terms, 1.0), terms)


def _reach(body: sp.Body) -> np.ndarray:
    return np.array([0.1 if unit == "m" else 1.0 for unit in body.joint_units])


if __name__ == "__main__":
    main()
