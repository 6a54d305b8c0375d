"""Residuals of momentum, fall and rates in units of their noise, and what changes of these add to them.

What a free body may have anyway is projected out: any constant momentum, any parabola of the centre of mass; and, where
requested, the drift of a semi-implicit Euler step of any length.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ._consistency import RateDifferences, rate_differences
from ._observation import Observation
from ._smooth_part import cosines
from .hypothesis import FittedValue, Hypothesis, Leftover

_ROUNDING = 16.0 * float(np.finfo(np.float64).eps)  # of the largest variance: rounding of sums of a dozen products
_TURN = 0.01
"""[rad] Turn over which derivatives at fixed velocities are taken: cut off are 1e-4 / 12 of them, rounding is less."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of one run, whitened.

    seen : what they are of
    rates : given rates less those of the configurations, or None
    step : what a step of one second of semi-implicit Euler would add
    vector : (M,); one more number where the drift of a step is projected out, how long the step is [s]
    """

    seen: Observation
    rates: RateDifferences | None
    step: StepDrift
    vector: Array
    _momentum_factor: Array
    _centre_factor: Array | None
    _free: Array
    _own: tuple[int, int, int]
    _drift: Array | None = None

    @property
    def square(self) -> float:
        """Sum of squares."""
        return float(self.vector @ self.vector)

    def whitened(self, momentum: Array, centre: Array | None = None, rates: Array | None = None) -> Array:
        """Changes of momentum, centre of mass (N, 3, k) and rates (M, c, k) in units of noise: (rows, k)."""
        blocks = [self._momentum_factor @ self.seen.seen(momentum)]
        if self._centre_factor is not None:
            blocks.append(self._centre_factor @ (np.zeros_like(momentum) if centre is None else centre))
        if self.rates is not None:
            shape = (*self.rates.level.shape, momentum.shape[2])
            blocks.append(np.zeros(shape) if rates is None else rates / self.rates.level[:, :, None])
        return np.vstack([block.reshape(-1, momentum.shape[2]) for block in blocks])

    def columns(self, momentum: Array, centre: Array | None = None, rates: Array | None = None) -> Array:
        """What such changes add to the vector: (M, k)."""
        whole = self.whitened(momentum, centre, rates)
        whole = whole - self._free @ (self._free.T @ whole)
        if self._drift is None:
            return whole
        steps = self._drift.T @ whole / (self._drift**2).sum()
        return np.vstack([whole - self._drift @ steps, steps])

    def step_column(self) -> Array:
        """What a step of one second adds: (M, 1)."""
        return self.columns(*(None if part is None else part[:, :, None] for part in self.step))  # type: ignore[arg-type]

    def of(self, seen: Observation) -> Array:
        """Vector of another observation of the samples, in units of this one's noise."""
        centre = seen.centre
        rates = None if self.rates is None else self.rates.difference[:, :, None]
        return self.columns(seen.momentum[:, :, None], None if centre is None else centre[:, :, None], rates)[:, 0]

    def blocks(self, vector: Array) -> dict[int, Array]:
        """The parts of a vector in samples and directions, (rows, c), for momentum, fall and rates."""
        count = len(self.seen.times)
        sizes = (
            3 * count,
            3 * count * (self._centre_factor is not None),
            0 if self.rates is None else self.rates.level.size,
        )
        parts = np.split(vector, np.cumsum(sizes))[:3]
        rows = (count, count, 0 if self.rates is None else len(self.rates.times))
        return {k: part.reshape(rows[k], -1) for k, part in enumerate(parts) if len(part)}

    def step_of(self, vector: Array) -> tuple[float, float] | None:
        """Length of the step that is projected out of a vector and its bar [s]; None where none is."""
        return None if self._drift is None else (float(vector[-1]), float(1.0 / np.linalg.norm(self._drift)))

    def in_time(self, vector: Array) -> Array:
        """The part of a vector that is of momentum and fall."""
        return np.concatenate([part.ravel() for block, part in self.blocks(vector).items() if block < 2])

    def moments(self, vector: Array) -> Array:
        """(3, 3): of each block sums of squares and of fourth powers of its cosines, and its independent numbers."""
        found = np.zeros((3, 3))
        for block, part in self.blocks(vector).items():
            squares = cosines(part) ** 2
            found[block] = squares.sum(), (squares**2).sum(), part.size - self._own[block]
        return found


def residuals(body: Body, seen: Observation, *, any_step: bool = False) -> Residuals:
    """Residuals of an observation.

    any_step : whether the drift of a step of any length is projected out, too
    """
    factor = inverse_factor(seen.momentum_noise)
    centre = None if seen.centre_noise is None else inverse_factor(seen.centre_noise)
    rates = rate_differences(seen.trajectory, seen.noise) if seen.given_rates else None
    since = (seen.times - seen.times[0]) / (seen.times[-1] - seen.times[0])
    powers = [since[:, None, None] ** k for k in range(3)]
    free = [np.concatenate([power * factor for power in powers[: 1 if seen.given_rates else 2]], axis=2)]
    if centre is not None:
        free.append(np.concatenate([power * centre for power in powers], axis=2))
    blocks = [block.reshape(3 * len(since), -1) for block in free]
    own = [blocks[0].shape[1], blocks[1].shape[1] if len(blocks) > 1 else 0, 0]
    if rates is not None:
        blocks.append(np.zeros((rates.level.size, 0)))
    step = step_drift(body, seen, None if rates is None else rates.slope)
    basis = np.linalg.qr(np.asarray(block_diag(*blocks), dtype=np.float64))[0]
    made = Residuals(seen, rates, step, np.zeros(0), factor, centre, basis, (own[0], own[1], own[2]))
    if any_step and (column := made.step_column()).any():
        made = replace(made, _drift=column)
    return replace(made, vector=made.of(seen))


def leftover(fits: Sequence[Residuals], vector: Array) -> Leftover:
    """Residuals of all runs by blocks; the vectors of the runs come one after the other."""
    parts = np.split(vector, np.cumsum([len(fit.vector) for fit in fits])[:-1])
    left = leftover_of_moments(np.sum([fit.moments(part) for fit, part in zip(fits, parts, strict=True)], axis=0))
    return replace(
        left,
        in_time=np.concatenate([fit.in_time(part) for fit, part in zip(fits, parts, strict=True)]),
        steps=tuple(step for fit, part in zip(fits, parts, strict=True) if (step := fit.step_of(part)) is not None),
    )


def leftover_of_moments(moments: Array) -> Leftover:
    """Residuals by blocks, from sums over runs of what `Residuals.moments` returns."""
    squares, fourths, counts = moments.T
    effective = np.where(fourths > 0.0, 3.0 * squares**2 / np.where(fourths > 0.0, fourths, 1.0), counts)
    return Leftover(squares, counts, np.minimum(effective, counts))


def fitted_hypothesis(
    name: str,
    kind: str,
    left: Leftover,
    *,
    parameters: int = 0,
    values: Mapping[str, FittedValue] | None = None,
    remark: str = "",
) -> Hypothesis:
    """A hypothesis by what it leaves."""
    square = float(left.squares.sum())
    return Hypothesis(
        name=name,
        kind=kind,
        square=square,
        left_over=float(np.sqrt(square / left.counts.sum())),
        parameters=parameters,
        values=values or {},
        remark=remark,
        leftover=left,
        residuals=left.in_time,
    )


def inverse_factor(covariances: Array) -> Array:
    """W with W C W^T = 1: (N, 3, 3)."""
    # Noise of one joint alone has one direction, and rounding what is across.
    floor = _ROUNDING * np.trace(covariances, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariances + floor)), dtype=np.float64)


class StepDrift(NamedTuple):
    """Changes per second of step of momentum (N, 3), centre of mass (N, 3) or None, and rates (M, c) or None."""

    momentum: Array
    centre: Array | None
    rates: Array | None


def step_drift(body: Body, seen: Observation, slope: Array | None) -> StepDrift:
    """What the step of a semi-implicit integrator adds, to first order.

    Semi-implicit Euler takes v' = v + h a(q, v), then q' = q moved with v' for h. With L(q, v), linear in v, moved at
    fixed v: dL/ds = G and d2L/ds2 = H. A step conserves L(q, v') + h G(q, v) = L(q, v): L grows by h^2 (dG/dt - H / 2),

        L(t) - L(0) = h (G - G(0) - 1/2 integral of H dt).

    The centre of mass c, with second and third derivative c2 and c3 at fixed v, leaves its parabola by h times the
    integral of (c2 - integral of c3 dt) / 2, and the rates given are those of h / 2 earlier. Rates that are differences
    of the samples are later by h / 2, which takes G / 2 off.

    slope : (M, c) derivatives of the given rates, or None
    """
    fastest = max(float(np.abs(seen.rate).max()), float(np.abs(seen.joint_rates).max(initial=0.0)), 1e-300)
    short = _TURN / fastest
    shapes, rates = seen.trajectory.shapes, seen.joint_rates
    momenta, centres = {}, {}
    for k in (-2, -1, 0, 1, 2):
        moved = shapes + k * short * rates
        turned = seen.attitude @ so3.exp(k * short * seen.rate)
        inertia, internal = body.sample(moved, rates)
        momenta[k] = so3.apply(turned, so3.apply(inertia, seen.rate) + internal)
        centres[k] = so3.apply(turned, body.centre_of_mass(moved))
    slow = (momenta[1] - momenta[-1]) / (2.0 * short)
    bent = (momenta[1] - 2.0 * momenta[0] + momenta[-1]) / short**2
    share = 1.0 if seen.given_rates else 0.5
    momentum = share * slow - 0.5 * _integral(seen.times, bent)
    if seen.centre is None:
        return StepDrift(momentum, None, None if slope is None else 0.5 * slope)
    second = (centres[1] - 2.0 * centres[0] + centres[-1]) / short**2
    third = (centres[2] - 2.0 * centres[1] + 2.0 * centres[-1] - centres[-2]) / (2.0 * short**3)
    centre = 0.5 * _integral(seen.times, second - _integral(seen.times, third))
    return StepDrift(momentum, centre, None if slope is None else 0.5 * slope)


def _integral(times: Array, values: Array) -> Array:
    return np.asarray(CubicSpline(times, values).antiderivative()(times))
