"""What `make bench` measures in each process, with public names alone, so that an older checkout can run it as well."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

import shapephase as sp

from .cases import Case, as_function, fourier, numbered_case, spline

ROBOTS = Path(__file__).parents[1] / "robots"
TOLERANCE = 1e-9
_EXACT = 3e-11
"""[rad]; what a momentum alone is integrated to, to judge it among others."""
_SPEEDS = (0.4, 4.0, 12.0)
"""Of the momenta on one path, as rates of turning [rad/s]."""


def compiled() -> str:
    """Compile or load what can be, ahead of all measurements; what was done, in words."""
    began = time.perf_counter()
    try:
        sp.compile_steps()
    except sp.ShapePhaseError as error:
        return f"not compiled: {error}"
    return f"compiled or loaded in {time.perf_counter() - began:.1f} s"


_case = cache(numbered_case)
_CAT_LOOP = 2
"""Number of the case in which many momenta share one path."""
_DERIVED = ("cat", "astronaut", "example:human")
"""Bodies whose results' derivatives are timed."""
_FAMILIES = (_CAT_LOOP, 8)
"""Numbers of the cases in which many bodies do: the cat and a human."""


@cache
def _path(number: int, box: bool) -> sp.ShapePath:
    path = _case(number).path
    return as_function(path) if box else path


@cache
def _deformation(number: int, box: bool) -> sp.Deformation:
    return sp.articulated(_case(number).body, _path(number, box))


def first_black_boxes(numbers: list[int]) -> dict[str, float]:
    """Median processor time of a reconstruction on a path and a deformation just made, and of the second [ms]."""
    taken = []
    for number in numbers:
        case = _case(number)
        path = as_function(case.path)
        runs = partial(lambda c, p: sp.reconstruct(sp.articulated(c.body, p), c.momentum), case, path)
        taken.append([seconds(runs) for _ in range(3)])
    one, _, three = 1e3 * np.median(taken, axis=0)
    return {"first reconstruction [ms]": one, "third [ms]": three}


def reconstructed(number: int, box: bool, tolerance: float, times: np.ndarray) -> tuple[np.ndarray, float, int] | None:
    """Attitudes at times, error estimate and evaluations of a case; None where it is refused."""
    try:
        motion = sp.reconstruct(_deformation(number, box), _case(number).momentum, tolerance=tolerance)
    except sp.errors.AccuracyNotReached:
        return None
    return motion.attitude(times), float(motion.error_estimate), motion.evaluations


def reconstruction_seconds(number: int, box: bool, tolerance: float, runs: int) -> float:
    """Median processor time of some runs as users call it, each on a deformation of its own [s].

    The path is the same in all of them; the first run, which does not count, fills the caches.
    """
    case, path = _case(number), _path(number, box)

    def run() -> object:
        return sp.reconstruct(sp.articulated(case.body, path), case.momentum, tolerance=tolerance)

    return median_seconds(run, runs)


# ---- What follows a reconstruction ----------------------------------------------------------------------------------


def afterwards(turns: int, numbers: list[int]) -> dict[str, float]:
    """Median ratios to a reconstruction, and times [ms]: its split, also with estimates; attitudes at 10,000 times."""
    rows = []
    for number in numbers:
        case = _case(number)
        deformation = _deformation(number, False)
        many = np.random.default_rng(0).uniform(0.0, case.path.duration, 10_000)
        taken = []
        for _ in range(turns + 1):
            began = time.process_time()
            motion = sp.reconstruct(deformation, case.momentum, tolerance=TOLERANCE)
            done = time.process_time()
            motion.attitude(many)
            looked = time.process_time()
            # Of a motion of its own, which nothing was asked of yet.
            fresh = sp.reconstruct(deformation, case.momentum, tolerance=TOLERANCE)
            again = time.process_time()
            found = sp.split(fresh)
            split = time.process_time()
            assert found.error_estimates is not None
            taken.append((done - began, looked - done, split - again, time.process_time() - again))
        rows.append(np.median(taken[1:], axis=0))
    single, attitudes, split, with_estimates = np.array(rows).T
    return {
        "reconstruct [ms]": 1e3 * float(np.median(single)),
        "split / reconstruct": float(np.median(split / single)),
        "  at most": float((split / single).max()),
        "split with its error estimates / reconstruct": float(np.median(with_estimates / single)),
        "10,000 attitudes / reconstruct": float(np.median(attitudes / single)),
        "  at most [ms]": 1e3 * float(attitudes.max()),
    }


def derivative_costs(turns: int) -> dict[str, float]:
    """Exact derivatives of all results, as ratios to the reconstruction: by all samples of a second at 60 Hz, by all
    inertial parameters, and by these, momentum and start together."""
    found: dict[str, float] = {}
    for name in _DERIVED:
        body = sp.load_body(name)
        size = float(np.trace(body.locked_inertia(np.zeros(body.n_shape)))) / 3.0
        deformation = sp.articulated(body, spline(body, 3, 60))
        taken = []
        for _ in range(turns + 1):
            began = time.process_time()
            motion = sp.reconstruct(deformation, size * np.array([0.6, -1.0, 2.0]), tolerance=TOLERANCE)
            done = time.process_time()
            derivatives = sp.derivatives(motion)
            assert derivatives.by_samples.holonomy.any()
            by_samples = time.process_time()
            assert derivatives.by_inertias.holonomy.any()
            by_inertias = time.process_time()
            assert derivatives.by_momentum.final_attitude.any()
            assert derivatives.by_attitude.final_attitude.any()
            single = done - began
            whole = time.process_time() - done
            taken.append(((by_samples - done) / single, (by_inertias - by_samples) / single, whole / single))
        samples, inertias, whole = np.median(taken[1:], axis=0)
        short = name.removeprefix("example:")
        found[f"{short}: by samples / reconstruct"] = float(samples)
        found[f"{short}: by inertias / reconstruct"] = float(inertias)
        found[f"{short}: by everything / reconstruct"] = float(whole)
    return found


def error_bar_costs(turns: int) -> dict[str, float]:
    """Error bars by noise of 1,000 samples in ten seconds, as ratios to the reconstruction, and in time [ms]."""
    found: dict[str, float] = {}
    for name in _DERIVED:
        body = sp.load_body(name)
        size = float(np.trace(body.locked_inertia(np.zeros(body.n_shape)))) / 3.0
        deformation = sp.articulated(body, spline(body, 3, 1000, 10.0))
        taken = []
        for _ in range(turns + 1):
            began = time.process_time()
            motion = sp.reconstruct(deformation, size * np.array([0.6, -1.0, 2.0]), tolerance=TOLERANCE)
            done = time.process_time()
            assert sp.uncertainty(motion, joints=0.005).holonomy.any()
            taken.append((done - began, time.process_time() - done))
        single, bars = np.median(taken[1:], axis=0)
        short = name.removeprefix("example:")
        found[f"{short}: reconstruct [ms]"] = 1e3 * float(single)
        found[f"{short}: bars / reconstruct"] = float(bars / single)
    return found


# ---- Many at once ---------------------------------------------------------------------------------------------------


def many_momenta(count: int, checked: int) -> dict[str, float]:
    """Momenta on the cat's Fourier loop: processor time of each [us], and the largest error of some."""
    case = _case(_CAT_LOOP)
    deformation = sp.articulated(case.body, case.path)
    rng = np.random.default_rng(0)
    found: dict[str, float] = {}
    for speed in _SPEEDS:
        momenta = _momenta(case, speed, count, rng)
        name = f"{count} momenta of {speed:g} rad/s, each [us]"
        try:
            sp.reconstruct(deformation, momenta[:300], tolerance=TOLERANCE)
            began = time.process_time()
            # Two threads of one core would each take longer than one alone does.
            motion = sp.reconstruct(deformation, momenta, tolerance=TOLERANCE, threads=1)
            found[name] = 1e6 * (time.process_time() - began) / count
        except sp.errors.AccuracyNotReached:
            found[name] = np.nan
            continue
        final, errors = motion.final_attitude, []
        for k in rng.integers(0, count, checked):
            alone = sp.reconstruct(deformation, momenta[k], tolerance=_EXACT).final_attitude
            errors.append(np.linalg.norm(alone - final[k]) / np.sqrt(2.0))
        found[f"  error / tolerance{' ' * len(found)}"] = max(errors) / TOLERANCE
    return found


def _momenta(case: Case, speed: float, count: int, rng: np.random.Generator) -> np.ndarray:
    axes = rng.normal(size=(count, 3))
    moment = float(np.trace(case.body.locked_inertia(np.zeros(case.body.n_shape)))) / 3.0
    return speed * moment * axes / np.linalg.norm(axes, axis=1, keepdims=True)


def threads(momenta: int, bodies: int) -> dict[str, float]:
    """How many times as fast two threads are as one, by the clock, on the same momenta and on the same bodies."""
    case = _case(_CAT_LOOP)
    many = sp.articulated(case.body, case.path), _momenta(case, 4.0, momenta, np.random.default_rng(0))
    runs = {"momenta": many}
    for number in _FAMILIES:
        case = _case(number)
        runs[f"bodies, {case.name}"] = sp.articulated(_variants(case, bodies), case.path), case.momentum
    found = {}
    for name, run in runs.items():
        taken = [[_clock(_in_threads, *run, number) for number in (1, 2)] for _ in range(5)]
        found[f"{name}, two threads / one"] = float(np.median([one / two for one, two in taken[1:]]))
    return found


def _in_threads(deformation: Any, momenta: np.ndarray, number: int) -> object:
    return sp.reconstruct(deformation, momenta, tolerance=TOLERANCE, threads=number)


def inertia_variants(count: int, checked: int) -> dict[str, float]:
    """Loops of bodies with the inertias of their links changed at random: processor time of each, alone and together.

    And the largest error of some, as a part of the tolerance.
    """
    found: dict[str, float] = {}
    for number in _FAMILIES:
        case = _case(number)
        made = seconds(lambda case=case: _variants(case, count))
        deformations = sp.articulated(_variants(case, count), case.path)
        motions = sp.reconstruct(deformations, case.momentum, tolerance=TOLERANCE)
        together = [seconds(partial(sp.reconstruct, deformations, case.momentum)) for _ in range(3)]
        some = [deformations[row] for row in range(0, count, max(1, count // checked))]
        alone = [seconds(partial(sp.reconstruct, one, case.momentum)) for one in some]
        exact = [sp.reconstruct(one, case.momentum, tolerance=_EXACT).final_attitude for one in some]
        errors = np.linalg.norm(exact - motions.final_attitude[:: max(1, count // checked)], axis=(1, 2)) / np.sqrt(2.0)
        found[f"{case.name}: {count} variants, each [us]"] = 1e6 * float(np.median(together)) / count
        found[f"  to make each [us]{' ' * len(found)}"] = 1e6 * made / count
        found[f"  one by one, each [us]{' ' * len(found)}"] = 1e6 * float(np.median(alone))
        found[f"  error / tolerance{' ' * len(found)}"] = float(errors.max()) / TOLERANCE
    return found


def _variants(case: Case, count: int) -> Any:
    """Masses and inertias by a tenth, centres of mass by a twentieth of their places."""
    rng, parts = np.random.default_rng(0), case.body.moving_parts
    shares = np.exp(0.1 * rng.normal(size=(2, count, len(parts))))
    places = 1.0 + 0.05 * rng.normal(size=(count, len(parts), 3))
    return case.body.with_inertias(
        masses=np.array([part.mass for part in parts]) * shares[0],
        centres=np.array([part.centre for part in parts]) * places,
        inertias=np.array([part.inertia for part in parts]) * shares[1][..., None, None],
    )


# ---- Recorded motions -----------------------------------------------------------------------------------------------


def recorded(turns: int, rows: int) -> dict[str, float]:
    """The cat's recording, and an analytic loop recorded in 100 rows and in many, rounded or not; without reading."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        body = sp.load_body("cat")
        righting = sp.read_shape_path(ROBOTS / "cat_righting.csv", body)
    found = {}
    turning = np.array([0.05, 0.0, 0.1])
    for words, path, momentum in (
        ("cat_righting.csv", righting, 0.25 * turning),
        ("loop in 100 rows", _recording(body, 100), turning),
        (f"loop in {rows} rows", _recording(body, rows), turning),
        (f"loop in {rows} rows, rounded to 1e-6", _recording(body, rows, 1e-6), turning),
    ):
        deformation = sp.articulated(body, path)
        try:
            motion = sp.reconstruct(deformation, momentum, tolerance=TOLERANCE)
        except sp.errors.AccuracyNotReached:
            found[f"{words}: refused"] = np.nan
            continue
        run = partial(sp.reconstruct, deformation, momentum, tolerance=TOLERANCE)
        found[f"{words} [ms]"] = 1e3 * median_seconds(run, turns)
        found[f"  evaluations{' ' * len(found)}"] = motion.evaluations
    return found


def _recording(body: sp.Body, rows: int, rounding: float = 0.0) -> sp.ShapePath:
    """A spline through samples of a loop of two harmonics."""
    loop = fourier(body, 3, harmonics=2, duration=2.0)
    times = np.linspace(0.0, 2.0, rows + 1)
    shapes = loop.shape(times)
    shapes[-1] = shapes[0]
    return sp.ShapePath.spline(times, np.round(shapes / rounding) * rounding if rounding else shapes)


# ---- Clocks ---------------------------------------------------------------------------------------------------------


def seconds(run: Callable[[], object]) -> float:
    """Processor time of one run [s]."""
    began = time.process_time()
    run()
    return time.process_time() - began


def median_seconds(run: Callable[[], object], runs: int) -> float:
    """The median of some runs, after one that does not count [s]."""
    return float(np.median([seconds(run) for _ in range(runs + 1)][1:]))


def _clock(run: Callable[..., object], *arguments: object) -> float:
    began = time.perf_counter()
    run(*arguments)
    return time.perf_counter() - began
