"""Whether the error estimates of phases hold: `python -m benchmarks.phase_estimates [harmonics] [mixed] [--runs N]`.

The motions of `benchmarks.estimates`, split in the base gauge, in the horizontal one and in a user's. The truth is
integrated in extended precision: attitude and lift by extrapolation, the dynamic phase and the area along the
momentum's curve by Gauss-Legendre rules over them. Motions at rest get a small momentum instead.

    --seed S  each run depends on it and on its number alone
    --most S  integrations that would take more than about S seconds are left out (default 1.2); some runs take a dozen
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

import shapephase as sp
from shapephase import sphere

from .estimates import FAMILIES, most_steps
from .extended import TooLong, Truth
from .random_motions import Trial

GAUGES = ("base", "horizontal", "given")
QUANTITIES = (
    "total_rotation", "holonomy", "dynamical_rotation", "closing_tilt", "montgomery_phase", "dynamic_phase",
    "solid_angle", "momentum_gap",
)  # fmt: skip
_NODES = np.polynomial.legendre.leggauss(16)
_MOST_PANELS = 200
"""More would take minutes in extended precision."""
_MOST_SECONDS = 1.2
"""[s] of one integration in extended precision."""
_MEASURED = 4.0
"""How many times the bound of its own error a true error has to be to be counted in the percentiles."""


@dataclass(frozen=True)
class Judged:
    """One number of one split: its true error, known to `uncertainty`, and its estimate [rad]."""

    what: str
    gauge: str
    quantity: str
    error: float
    uncertainty: float
    estimate: float

    @property
    def above(self) -> float:
        """How many times its estimate the error is at least."""
        return (self.error - self.uncertainty) / self.estimate


@dataclass(frozen=True)
class ExactSplit:
    """A split in long double."""

    total_rotation: np.ndarray
    holonomy: np.ndarray
    dynamical_rotation: np.ndarray
    closing_tilt: np.ndarray
    montgomery_phase: np.longdouble
    dynamic_phase: np.longdouble
    solid_angle: np.longdouble
    momentum_gap: np.longdouble


def main() -> None:
    """Print a summary of each family."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.phase_estimates")
    parser.add_argument("family", nargs="*", choices=[[], *FAMILIES])
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--most", type=float, default=_MOST_SECONDS)
    asked = parser.parse_args()
    for family in asked.family or FAMILIES:
        rows = [row for number in range(asked.runs) for row in judged(family, asked.seed, number, asked.most)]
        print(summary(f"{family}, seed {asked.seed}, {asked.runs} runs", rows))


def judged(family: str, seed: int, number: int, most: float = _MOST_SECONDS) -> list[Judged]:
    """Every number of the splits of one random motion; none where it is refused, or its truth takes too long."""
    rng = np.random.default_rng((seed, number))
    trial = FAMILIES[family](number, rng)
    if not trial.momentum.any():
        moment = float(np.trace(trial.body.locked_inertia(trial.path.shape(0.0)))) / 3.0
        small = rng.normal(size=3) * 10.0 ** rng.uniform(-4.0, -1.0) * moment / trial.path.duration
        trial = replace(trial, what=trial.what.replace("at rest", "nearly at rest"), momentum=small)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            deformation = sp.articulated(trial.body, trial.path)
            motion = sp.reconstruct(deformation, trial.momentum, tolerance=trial.tolerance)
            curve = exact_curve(trial, deformation.closure, most)
        except (sp.errors.ShapePhaseError, TooLong, ArithmeticError):
            return []
    what = f"{family} {seed} {number}: {trial.what}, to {trial.tolerance:.1g}"
    results = []
    for gauge in GAUGES:
        exact = exact_split(curve, gauge)
        found = sp.split(motion, swinging(trial.path.duration) if gauge == "given" else gauge)
        for name in QUANTITIES:
            turns = 4.0 if name.endswith(("phase", "angle")) else None
            error = distance(getattr(found, name), getattr(exact, name), turns)
            estimate = float(getattr(found.error_estimates, name))
            results.append(Judged(what, gauge, name, error, curve.uncertainty, estimate))
    return results


@lru_cache(maxsize=16)
def _truth(body: sp.Body) -> Truth:
    return Truth(body)


def swinging(duration: float) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """A user's gauge: U = turn about z by a(t), then about x by b(t), with its body rates."""

    def frames(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        phase = 2.0 * np.pi * times / duration
        a, b = 0.7 * np.sin(phase) + 0.3, 0.5 * np.cos(phase)
        of_a, of_b = 0.7 * np.cos(phase) * 2.0 * np.pi / duration, -0.5 * np.sin(phase) * 2.0 * np.pi / duration
        one, nothing = np.ones_like(phase), np.zeros_like(phase)
        about_z = np.stack([np.cos(a), -np.sin(a), nothing, np.sin(a), np.cos(a), nothing, nothing, nothing, one], -1)
        about_x = np.stack([one, nothing, nothing, nothing, np.cos(b), -np.sin(b), nothing, np.sin(b), np.cos(b)], -1)
        rates = np.stack([of_b, np.sin(b) * of_a, np.cos(b) * of_a], -1)
        return about_z.reshape(-1, 3, 3) @ about_x.reshape(-1, 3, 3), rates

    return frames


@dataclass(frozen=True)
class ExactCurve:
    """Attitude, lift, momentum and angular velocity at the nodes of a rule, in long double."""

    times: np.ndarray
    edges: np.ndarray
    nodes: np.ndarray
    weights: np.ndarray
    attitude: np.ndarray
    lift: np.ndarray
    direction: np.ndarray
    turning: np.ndarray
    by_momentum: np.ndarray
    closure: np.ndarray
    uncertainty: float


def exact_curve(trial: Trial, closure: np.ndarray | None, most: float = _MOST_SECONDS) -> ExactCurve:
    """Of a motion that starts at the identity, on as many panels as two ways to the phase need to agree."""
    panels = max(8, 2 * trial.highest)
    while True:
        curve = _on_panels(trial, np.eye(3) if closure is None else closure, panels, most)
        if curve.uncertainty < max(1e-15, 1e-6 * trial.tolerance):
            return curve
        panels *= 2


def _on_panels(trial: Trial, closure: np.ndarray, panels: int, most: float) -> ExactCurve:
    path, momentum = trial.path, trial.momentum
    count = [int(np.ceil(panels * (b - a) / path.duration)) for a, b in zip(path.breaks[:-1], path.breaks[1:])]
    if sum(count) > _MOST_PANELS:
        raise TooLong("too many panels")
    parts = [np.linspace(a, b, 1 + n)[:-1] for a, b, n in zip(path.breaks[:-1], path.breaks[1:], count)]
    edges = np.concatenate([*parts, path.breaks[-1:]])
    half = 0.5 * np.diff(edges)[:, None]
    nodes = edges[:-1, None] + half * (_NODES[0] + 1.0)
    times = np.unique(np.concatenate([edges, nodes.ravel()]))
    truth = _truth(trial.body)
    steps = most_steps(trial, most)
    quaternions, first = truth.along(trial.segments, momentum, times, steps)
    lifts, second = truth.along(trial.segments, np.zeros(3), times, steps)
    attitude, lift = _matrices(quaternions), _matrices(lifts)
    sampled = truth.inertia_and_momentum(path.shape(times), path.rate(times))
    inertia = sampled[:, :9].reshape(-1, 3, 3)
    spatial = momentum.astype(np.longdouble)
    pi = np.einsum("nji,j->ni", attitude, spatial)
    curve = ExactCurve(
        times=times,
        edges=np.searchsorted(times, edges),
        nodes=np.searchsorted(times, nodes),
        weights=half.astype(np.longdouble) * _NODES[1],
        attitude=attitude,
        lift=lift,
        direction=pi / _norm(spatial),
        turning=_solved(inertia, pi - sampled[:, 9:]),
        by_momentum=_solved(inertia, pi),
        closure=closure,
        uncertainty=first + second,
    )
    return replace(curve, uncertainty=first + second + max(_disagreement(curve, gauge) for gauge in ("base", "given")))


def _disagreement(curve: ExactCurve, gauge: str) -> float:
    """Between the phase by its formula and the same angle read off the exact attitudes [rad]."""
    found = exact_split(curve, gauge)
    turn = curve.attitude[-1]
    if gauge == "given":
        frame, _ = swinging(float(curve.times[-1]))(curve.times[[0, -1]].astype(np.longdouble))
        turn = turn @ frame[1].T @ frame[0]
    turn = turn @ found.closing_tilt.T
    vector = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    angle = np.arctan2(curve.direction[0] @ vector, (np.trace(turn) - 1) / 2)
    return distance(found.montgomery_phase, angle, 2.0)


def exact_split(curve: ExactCurve, gauge: str | Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]) -> ExactSplit:
    """The split in one gauge, or in frames with their body rates."""
    frame, omega = np.broadcast_to(np.eye(3, dtype=np.longdouble), curve.attitude.shape), curve.turning
    if gauge == "horizontal":
        frame, omega = curve.lift, curve.by_momentum
    elif gauge != "base":
        frames = swinging(float(curve.times[-1])) if gauge == "given" else gauge
        frame, spin = frames(curve.times.astype(np.longdouble))
        omega = omega - spin
    u, w = (np.einsum("nij,nj->ni", frame, part) for part in (curve.direction, omega))
    dynamic = (np.sum(u[curve.nodes] * w[curve.nodes], axis=-1) * curve.weights).sum()
    corners = u[curve.edges]
    start = corners[:-1, None]
    slope = np.cross(u[curve.nodes], w[curve.nodes])
    form = np.sum(np.cross(u[curve.nodes], slope) * start, axis=-1) / (1 + np.sum(start * u[curve.nodes], axis=-1))
    middle = corners[0] + corners[-1]
    closed = np.concatenate([corners, [middle / _norm(middle)], corners[:1]])
    reference = sphere.far_reference(corners.astype(float)).astype(np.longdouble)
    area = (form * curve.weights).sum() + _triangles(reference, closed[:-1], closed[1:]).sum()
    seen = frame[0].T
    total, holonomy = curve.attitude[-1] @ curve.closure, curve.lift[-1] @ curve.closure
    return ExactSplit(
        total_rotation=total,
        holonomy=holonomy,
        dynamical_rotation=total @ holonomy.T,
        closing_tilt=seen @ _between(corners[-1], corners[0]) @ seen.T,
        montgomery_phase=dynamic - area,
        dynamic_phase=dynamic,
        solid_angle=area,
        momentum_gap=2 * np.arctan2(_norm(corners[-1] - corners[0]), _norm(corners[-1] + corners[0])),
    )


def distance(found: np.ndarray, exact: np.ndarray, turns: float | None = None) -> float:
    """Between two rotations, two angles, or two phases modulo so many times pi [rad]."""
    gap = np.asarray(found).astype(np.longdouble) - exact
    if gap.shape == (3, 3):
        return float(2 * np.arcsin(min(np.sqrt((gap * gap).sum() / 8), np.longdouble(1))))
    if turns is not None:
        whole = 4 * np.arctan(np.longdouble(1)) * turns
        gap = gap - whole * np.round(gap / whole)
    return float(abs(gap))


def _matrices(quaternions: np.ndarray) -> np.ndarray:
    x, y, z, w = quaternions.T
    return np.stack(
        [
            1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
            2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
            2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
        ],
        axis=-1,
    ).reshape(-1, 3, 3)  # fmt: skip


def _solved(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """By Cramer's rule: (N, 3, 3), (N, 3) -> (N, 3)."""
    a, b, c = np.moveaxis(matrix, -1, 0)
    determinant = np.sum(a * np.cross(b, c), axis=-1)
    parts = [
        np.sum(vector * np.cross(b, c), axis=-1),
        np.sum(a * np.cross(vector, c), axis=-1),
        np.sum(a * np.cross(b, vector), axis=-1),
    ]
    return np.stack(parts, axis=-1) / determinant[:, None]


def _triangles(reference: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    volume = np.sum(reference * np.cross(start, end), axis=-1)
    return 2 * np.arctan2(volume, 1 + np.sum(start * end + reference * start + reference * end, axis=-1))


def _between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The shortest rotation from a unit vector to another, by two halves."""
    middle = start + end
    middle = middle / _norm(middle)
    return _reflected(middle, end) @ _reflected(start, middle)


def _reflected(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The same for vectors at less than a right angle: two reflections."""
    half = start + end
    half = half / _norm(half)
    one = np.eye(3, dtype=np.longdouble)
    return (2 * np.outer(half, half) - one) @ (2 * np.outer(start, start) - one)


def _norm(vector: np.ndarray) -> np.longdouble:
    return np.sqrt(np.sum(vector * vector))


def summary(title: str, rows: list[Judged]) -> str:
    """Estimate over true error of each number in each gauge, and what is above its estimate."""
    above = sum(row.above > 1.0 for row in rows)
    lines = [f"{title}: {len(rows) // len(QUANTITIES) // len(GAUGES)} motions with a truth, {above} numbers above"]
    for gauge in GAUGES:
        for quantity in QUANTITIES:
            part = [row for row in rows if row.gauge == gauge and row.quantity == quantity]
            ratio = [row.estimate / row.error for row in part if row.error > _MEASURED * row.uncertainty]
            least, median, most = np.percentile(ratio, [0.0, 50.0, 95.0]) if ratio else np.full(3, np.nan)
            lines.append(
                f"  {gauge:12}{quantity:20} estimate / true of {len(ratio)}: median {median:8.3g}, least {least:8.3g}, "
                f"95 % {most:8.3g}"
            )
            lines += [
                f"      {row.above:.3g} times its {row.estimate:.2g}: {row.what}" for row in part if row.above > 1.0
            ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
