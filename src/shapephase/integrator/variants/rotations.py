"""Attitudes of many deformations along one path, with one momentum each.

Panels and steps are planned for one deformation, the model, and for classes of momenta and of how far the others turn
beside it. Whether that was enough each says by estimates of its own, which are those of a deformation alone; where it
was not, a deformation is sampled and stepped as if there were no others.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import NamedTuple, Protocol

import numpy as np

from ... import run_progress, so3
from ...arrays import Array, Integers, Mask
from ...errors import AccuracyNotReached, SingularInertiaError
from .._last_terms import Perturbed, perturbed_series
from .._spectral_error import spectral_norms
from ..fast import engine
from ..fast.threads import processors
from ..fast.variants import march_variants
from ..integrate import norms
from ..interpolant import Interpolant
from ..many_rotations import GroupedRotations, rotations_of_each, rounded_up
from ..sampling import Samplers
from ..stepped import SteppedRotation, estimate_from_ends
from ..steps.error_propagator import growth_and_rounding
from ..steps.step_control import StepRequirements
from ..steps.step_loop import integrate_steps
from ..steps.step_record import StepRecord, checkpoint_steps
from .shared_panels import ManySeries, SharedPanels

# Of the tolerance: what the panels of the model may leave, so that deformations like it stay below a third of it.
_SAMPLING_SHARE = 0.2
# Classes of magnitudes in each factor of two, and of how far deformations turn.
_CLASSES = 4
# Steps of one motion from which on it is planned for itself.
_MANY_STEPS = 4000
# Of the tolerance: rounding below is not looked at closely.
_LITTLE_ROUNDING = 0.01
# Deformations at once: enough for the cost of array operations not to show, and arrays of a few MB.
_AT_ONCE = 32
# The same without machine code, where what they share is computed for each of these lots.
_AT_ONCE_INTERPRETED = 512
# Numbers of their series at once: some hundred MB.
_MOST_NUMBERS = 10_000_000
# Numbers of the series of all, which are kept: eight gigabytes.
_MOST_KEPT = 1_000_000_000


class Variants(Protocol):
    """Deformations along one path, and the one by which they are planned."""

    def __len__(self) -> int:
        """How many they are."""
        ...

    @property
    def model(self) -> Samplers:
        """Of the deformation by which they are planned."""
        ...

    def channels(self, rows: Integers, times: Array) -> tuple[Array, Mask]:
        """I^-1 and I^-1 L_o of some at times, and which can be relied on: (V,), (S,) -> (V, S, 9), (V,)."""
        ...

    def alone(self, row: int) -> Samplers:
        """Of one of them."""
        ...


@dataclass(frozen=True, eq=False)
class VariantPart:
    """Some of the deformations, on the same panels and with the same steps.

    Attributes
    ----------
    rows : (V,) which they are
    panels : that all are sampled on
    ceiling : magnitude of the momenta that they were planned for [kg m^2/s]
    coefficients : (V, P, n, 9) as those of an `Interpolant`
    hidden : (V,) as that of `Perturbed` [rad]
    steps, momentum, sampling_error, stepping_error, rounding_error, amplification : as those of a `SteppedRotation`
    record : of the steps
    """

    rows: Integers
    panels: SharedPanels
    ceiling: float
    coefficients: Array
    hidden: Array
    steps: Integers
    momentum: Array
    record: StepRecord
    sampling_error: Array
    stepping_error: Array
    rounding_error: Array
    amplification: Array

    @property
    def error_estimate(self) -> Array:
        """(V,) [rad]."""
        return estimate_from_ends(self.sampling_error + self.stepping_error + self.rounding_error)

    def some(self, places: Mask) -> VariantPart:
        """Those of them for which `places` (V,) is true."""
        if places.all():
            return self
        chosen = {name: getattr(self, name)[places] for name in _OF_EACH}
        return replace(self, **chosen, record=StepRecord(*(part[places] for part in vars(self.record).values())))

    def rotation(self, place: int) -> SteppedRotation:
        """Of the deformation at this place of the rows."""
        one = slice(place, place + 1)
        return SteppedRotation(
            interpolant=Interpolant(
                self.panels.edges, self.coefficients[place], self.panels.loops, len(self.panels.times)
            ),
            momentum=self.momentum[one],
            steps=self.steps,
            quaternions=self.record.quaternions[one],
            directions=self.record.directions[one],
            turns=self.record.turns[one],
            dynamics=self.record.dynamics[one],
            sampling_error=self.sampling_error[one],
            stepping_error=self.stepping_error[one],
            rounding_error=self.rounding_error[one],
            amplification=self.amplification[one],
            perturbed=Perturbed(partial(self._perturbed, place), float(self.hidden[place])),
        )

    def _perturbed(self, place: int) -> Array:
        panels = self.panels
        return perturbed_series(self.coefficients[place], panels.degrees, panels.widths, self.ceiling)


_OF_EACH = (
    "rows", "coefficients", "hidden", "momentum", "sampling_error", "stepping_error", "rounding_error", "amplification",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class VariantRotations:
    """S(t) of N deformations.

    Attributes
    ----------
    parts : of those that share panels and steps
    alone : of those that do not, by their number
    count : N
    """

    parts: tuple[VariantPart, ...]
    alone: Mapping[int, SteppedRotation]
    count: int

    def __getitem__(self, row: int) -> SteppedRotation:
        """Of one deformation, in a batch of one."""
        if row in self.alone:
            return self.alone[row]
        part, place = self._places[row]
        return self.parts[part].rotation(int(place))

    @cached_property
    def _places(self) -> Integers:
        """Part and place in it of each deformation: (N, 2)."""
        places = np.full((self.count, 2), -1)
        for number, part in enumerate(self.parts):
            places[part.rows] = np.stack([np.full(len(part.rows), number), np.arange(len(part.rows))], axis=1)
        return places

    @property
    def error_estimate(self) -> Array:
        """(N,) [rad]."""
        found = np.empty(self.count)
        for part in self.parts:
            found[part.rows] = part.error_estimate
        for row, one in self.alone.items():
            found[row] = one.error_estimate[0]
        return found

    @property
    def end(self) -> Array:
        """S at the end of the interval: (N, 3, 3)."""
        found = np.empty((self.count, 3, 3))
        for part in self.parts:
            found[part.rows] = so3.matrix_from_quat(part.record.quaternions[:, -1])
        for row, one in self.alone.items():
            found[row] = one.end[0]
        return found

    @property
    def evaluations(self) -> Integers:
        """How many times each deformation was evaluated: (N,)."""
        found = np.empty(self.count, dtype=np.int64)
        for part in self.parts:
            found[part.rows] = len(part.panels.times)
        for row, one in self.alone.items():
            found[row] = one.interpolant.evaluations
        return found


def rotations_of_variants(
    variants: Variants, momentum: Array, tolerance: float, *, threads: int | None = None
) -> VariantRotations:
    """Integrate the attitude equation of each deformation as if there were no others.

    Parameters
    ----------
    momentum : (N, 3) body angular momentum at the start of each [kg m^2/s]
    tolerance : of every attitude over the whole interval [rad]
    threads : at most, in machine code; None: one for each processor. Results do not depend on it

    Raises
    ------
    AccuracyNotReached, SingularInertiaError
        As of one deformation, with its number.
    """
    count, parts, left = len(momentum), [], []
    ceilings = rounded_up(norms(momentum), _CLASSES)
    plans = {float(ceiling): _plan(variants, float(ceiling), tolerance) for ceiling in np.unique(ceilings)}
    _check_size(plans, ceilings)
    lots = [lot for ceiling, plan in plans.items() for lot in _lots(np.flatnonzero(ceilings == ceiling), plan)]
    run_progress.begin(run_progress.STEPPING, max(count, 1))

    def integrated(lot: _Lot) -> tuple[list[VariantPart], list[int]]:
        return _integrated(variants, lot, momentum[lot.rows], tolerance)

    workers = max(1, min(processors() if threads is None else threads, len(lots))) if engine.is_ready() else 1
    with ThreadPoolExecutor(workers) as pool:
        # In one thread the usual way: errors then show where they are made.
        for found, failed in pool.map(integrated, lots) if workers > 1 else map(integrated, lots):
            parts += found
            left += failed
            run_progress.advance(sum(len(part.rows) for part in found) + len(failed))
    alone = {row: _alone(variants, row, count, momentum[row : row + 1], tolerance) for row in sorted(left)}
    return VariantRotations(tuple(parts), alone, count)


@dataclass(frozen=True, eq=False)
class _Plan:
    """What all are given at first, for momenta up to a ceiling."""

    panels: SharedPanels
    model: Interpolant
    ceiling: float  # [kg m^2/s]
    tolerance: float  # [rad]
    _steps: dict[float, Integers | None] = field(default_factory=dict)

    def turns(self, coefficients: Array) -> Array:
        """A bound of how far each turns in one loop: (V, P, n, 9) -> (V,) [rad]."""
        return self.rates(coefficients).reshape(len(coefficients), -1).sum(axis=1)

    def rates(self, coefficients: Array) -> Array:
        """The rates of `StepRequirements`: (V, P, n, 9) -> (V, P, n) [rad]."""
        sizes = spectral_norms(coefficients)
        return (self.ceiling * sizes[..., 0] + sizes[..., 1]) * self.panels.widths[:, None]

    def requirements(self, turning: float) -> StepRequirements:
        """Of the model, were it to turn so many times as far."""
        model = Interpolant(self.model.edges, turning * self.model.coefficients, self.model.loops, 0)
        # Deformations at rest are stepped as those with momentum.
        return replace(StepRequirements.from_interpolant(model, self.ceiling, self.tolerance), moving=True)

    def steps(self, turning: float) -> Integers | None:
        """Steps on each panel (P,) of those that turn so many times as far; None: too many to be planned together."""
        if turning not in self._steps:
            needed = self.requirements(turning)
            planned = needed.plan(self.tolerance, short=self.ceiling > 0.0 and needed.far)
            many = needed.very_far or needed.loops * float(planned.sum()) > _MANY_STEPS
            self._steps[turning] = None if many else needed.whole_steps(planned)
        return self._steps[turning]


class _Lot(NamedTuple):
    """Some that are computed in one go."""

    rows: Integers
    plan: _Plan | None


def _plan(variants: Variants, ceiling: float, tolerance: float) -> _Plan | None:
    """None: they cannot be planned together."""
    sampler = variants.model.on_panels()
    if sampler.is_checked or not len(variants):
        return None
    try:
        sampler.refine(ceiling, _SAMPLING_SHARE * tolerance)
    except (AccuracyNotReached, SingularInertiaError):
        return None
    model = sampler.as_sampled()
    # Without momentum further loops repeat the first, where a deformation is alone.
    if model.loops > 1 and not ceiling:
        return None
    return _Plan(SharedPanels(sampler), model, ceiling, tolerance)


def _check_size(plans: Mapping[float, _Plan | None], ceilings: Array) -> None:
    """Raise AccuracyNotReached for more than can be kept, before any memory is taken."""
    sizes = [
        (int(np.count_nonzero(ceilings == ceiling)), plan.model.coefficients.size)
        for ceiling, plan in plans.items()
        if plan is not None
    ]
    kept = sum(count * size for count, size in sizes)
    if kept > _MOST_KEPT:
        raise AccuracyNotReached(
            f"{len(ceilings)} motions on {max(size for _, size in sizes) // 9} samples each would take "
            f"{8e-9 * kept:.3g} GB; take slices of the family of some {int(len(ceilings) * _MOST_KEPT / kept)} bodies"
        )


def _lots(rows: Integers, plan: _Plan | None) -> Iterator[_Lot]:
    most = _AT_ONCE if engine.is_ready() else _AT_ONCE_INTERPRETED
    if plan is not None:
        most = max(1, min(most, _MOST_NUMBERS // plan.model.coefficients.size))
    for first in range(0, len(rows), most):
        yield _Lot(rows[first : first + most], plan)


def _integrated(
    variants: Variants, lot: _Lot, momentum: Array, tolerance: float
) -> tuple[list[VariantPart], list[int]]:
    """Those that came within the tolerance, and the numbers of the others."""
    if lot.plan is None:
        return [], lot.rows.tolist()
    plan, panels = lot.plan, lot.plan.panels
    channels, reliable = variants.channels(lot.rows, panels.times_with_fresh)
    count = len(panels.times)
    series = panels.series(channels[reliable, :count], plan.ceiling)
    # A deformation that its series do not give is sampled alone, where that becomes an error.
    given = panels.swings(series.coefficients, channels[reliable, count:], plan.ceiling) <= tolerance
    reliable[reliable] = given
    series = series.some(given)
    rows, momentum = lot.rows[reliable], momentum[reliable]
    left = lot.rows[~reliable].tolist()
    if not len(rows):
        return [], left
    (model_turn,) = plan.turns(plan.model.coefficients[None])
    turning = rounded_up(plan.turns(series.coefficients) / (model_turn or 1.0), _CLASSES)
    parts = []
    for one in np.unique(turning):
        of_class = turning == one
        steps = plan.steps(float(one))
        if steps is None:
            left += rows[of_class].tolist()
            continue
        part = _stepped(rows[of_class], plan, steps, float(one), series.some(of_class), momentum[of_class])
        passed = part.error_estimate <= tolerance
        left += part.rows[~passed].tolist()
        if passed.any():
            parts.append(part.some(passed))
    return parts, left


def _stepped(
    rows: Integers, plan: _Plan, steps: Integers, turning: float, series: ManySeries, momentum: Array
) -> VariantPart:
    """All of one class, with their errors."""
    panels = plan.panels
    record = _record(panels, series, steps, momentum)
    distances = np.where(np.isfinite(record.stepping), record.stepping, np.pi)
    amplifications, rounding = growth_and_rounding(
        record.propagators, record.quaternions, _LITTLE_ROUNDING * plan.tolerance, threads=1
    )
    requirements, rates = plan.requirements(turning), plan.rates(series.coefficients)
    stepping = np.array(
        [
            replace(requirements, rates=own).stepping_error(steps, distance, growth)
            for own, distance, growth in zip(rates, distances[:, None], amplifications, strict=True)
        ]
    )
    return VariantPart(
        rows=rows,
        panels=panels,
        ceiling=plan.ceiling,
        coefficients=series.coefficients,
        hidden=series.hidden,
        steps=steps,
        momentum=momentum,
        record=record,
        sampling_error=np.fmin(amplifications * series.error, record.truncation + amplifications * series.hidden),
        stepping_error=stepping[:, 0],
        rounding_error=rounding,
        amplification=amplifications,
    )


def _record(panels: SharedPanels, series: ManySeries, steps: Integers, momentum: Array) -> StepRecord:
    magnitudes = norms(momentum)
    moving = (magnitudes > 0.0)[:, None]
    # Without momentum any direction shows the rotation.
    directions = np.where(moving, momentum, [0.0, 0.0, 1.0]) / np.where(moving, magnitudes[:, None], 1.0)
    if engine.is_ready():
        marks = checkpoint_steps(panels.loops * int(steps.sum()))
        both = series.coefficients, series.perturbed
        return march_variants(panels.widths, *both, steps, panels.loops, directions, magnitudes, marks=marks)
    records = []
    for place, (coefficients, changed) in enumerate(zip(series.coefficients, series.perturbed, strict=True)):
        one = slice(place, place + 1)
        interpolant = Interpolant(panels.edges, coefficients, panels.loops, 0)
        records.append(vars(integrate_steps(interpolant, changed, steps, directions[one], magnitudes[one])))
    return StepRecord(**{name: np.concatenate([one[name] for one in records]) for name in records[0]})


def _alone(variants: Variants, row: int, count: int, momentum: Array, tolerance: float) -> SteppedRotation:
    try:
        found = rotations_of_each(variants.alone(row), momentum, tolerance, threads=1)
    except (AccuracyNotReached, SingularInertiaError) as error:
        raise type(error)(f"body {row} of {count}: {error}") from error
    return found.finest if isinstance(found, GroupedRotations) else found
