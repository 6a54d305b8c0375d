"""Is a trajectory right in flight? Momentum, fall, attitude and rates against the laws of a free body, and why not."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from .. import so3
from ..arguments import check_object, positive_argument, whole_argument
from ..arrays import Array
from ..body.body import Body
from ..body.loading import as_body
from ..deformation.deformation import articulated
from ..error_bars.recorded_momentum import momentum_from_recording
from ..errors import ShapeError, ShapePhaseError, TrajectoryError, TrajectoryWarning
from ..letters import value_text
from ..reconstruction.reconstruction import reconstruct
from ..shape_space.interpolation import ball_columns, near_signs
from ..shape_space.shape_path import ShapePath
from ..warning_filters import quiet
from ._airborne import AirbornePart, airborne_part, off_parabola
from ._consistency import rate_agreement
from ._engine_faults import (
    StepOrder,
    integration_step,
    is_possible_step,
    no_gyroscopic_term,
    step_hypothesis,
    step_order,
)
from ._held_states import held_states
from ._joint_offsets import joint_offsets
from ._observation import Observation, observed
from ._other_readings import filtered_samples, other_readings, read_otherwise
from ._outside_pushes import outside_pushes
from ._residuals import Residuals, inverse_factor, leftover, residuals
from ._short_flight import TOLD_APART, short_run_audit
from ._smooth_part import polynomials, smooth_part
from ._surroundings import drag, wrong_gravity
from ._wrong_inertias import wrong_inertias
from .audit_result import Audit, RunAudit
from .floating_trajectory import FloatingTrajectory, TrajectoryNoise
from .hypothesis import AND, Evidence, Hypothesis, Ranking

_QUIET = 1e-6
"""[rad] Noise of the attitude below which the first sample is tried as the start of the exact reconstruction."""
_NEAR = 1e-4
"""[rad] From there on another start may be nearer: motions near the middle axis make much of the last digit."""
_STEADY = 0.01  # of the momentum: a flight does not change it by more
_TOLERANCE = 1e-3  # of momentum, rates and fall by default
_WANDER = 0.01
"""[m] Skin moves over bones, and bodies are not what tables make of them: markers and masses wander by so much."""
_MEASURED = 1e-4  # [rad or m] Noise from which on samples were measured, not computed
_PAIRED = 3  # readings that are tried together with every other cause: those that leave least
_TAKES = 0.25  # of the squares of a law that either cause leaves alone: two causes have to leave less
_ONE_AXIS = 1e-3  # of the base's rates: smaller ones across their main axis mean a turn about one axis
_MOST_SAMPLES = 500  # of each run, for fits of hypotheses
_MOST_LOOKED_AT = 5000  # samples of a trajectory that is read otherwise to find its fall
# Share of the samples in the air from which no other reading is tried: a landing at the end leaves more than that, and
# read wrongly it seems to be in the air.
_MOSTLY = 0.5
_NEARER = 0.7  # of the distance from a parabola read otherwise: noise alone does not make it so much less
_JOINT_TORQUES = "Torques and friction of the joints change no momentum: nothing here says whether they are right."


def audit(
    body: Body | str,
    trajectories: FloatingTrajectory | Sequence[FloatingTrajectory],
    *,
    tolerance: float | None = None,
    flight: str | Sequence[float] = "auto",
    noise: TrajectoryNoise | None = None,
    every: int | None = None,
) -> Audit:
    """Check trajectories against the laws of a free body, and find what explains a difference.

    In the air the angular momentum about the centre of mass is constant, the centre of mass goes along a parabola, and
    the rates are those of the configurations. A trajectory is right where all three hold within its own noise or
    within the tolerance. Where they do not, each hypothesis is fitted and ranked by its evidence: the integrator's
    step, and its order from several runs, a link's mass, centre or inertia, offsets of joints, drag, a torque or a
    force from outside, a shift in time or a filter, frames of velocities, the order of quaternions, degrees, gravity.
    Where the best leaves more than noise, they are fitted in twos. Hypotheses that the samples cannot separate are
    named together. A flight of 8 to 23 samples, typical for 25 to 60 frames a second, gets momentum, drift and fall
    with their standard deviations, and no causes.

    Parameters
    ----------
    body : as it should be
    trajectories : one, or several runs of the same body, with different steps to find the order of an integrator
    tolerance : of momentum and rates relative to those that turn and move the body, of the fall to its extent;
        without unit; None: 0.001, and of recordings with noise, or in a format in which people are recorded, what parts
        of the body that wander by a centimetre over the flight make of it
    flight : "auto", where the centre of mass falls longest; "auto:2", the second such flight; "all"; or its first and
        last time [s]
    noise : of the samples; None: what they show, the white part of it by differences, its spectrum by the residuals
    every : steps of the integrator between samples, where `integrator_step` is not given; None: fitted

    Raises
    ------
    ShapeError
        For arguments of the wrong kind.
    TrajectoryError
        If a trajectory has no flight that is long enough.

    Examples
    --------
    >>> top, times = sp.load_body("cat_two_halves"), np.linspace(0.0, 1.0, 101)
    >>> path = sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(top, path), [0.0, 0.001, 0.02])
    >>> trajectory = sp.FloatingTrajectory(
    ...     times=times, quaternion=sp.so3.quat_from_matrix(motion.attitude(times)), shapes=path.shape(times))
    >>> sp.audit(top, trajectory).right
    True
    """
    body = as_body(body)
    if noise is not None:
        check_object(noise, "TrajectoryNoise", "noise")
    runs = given_runs(trajectories)
    within = None if tolerance is None else positive_argument(tolerance, "tolerance", "a ratio")
    if every is not None:
        many = whole_argument(every, "every", 1)
        runs = [run if run.integrator_step else replace(run, integrator_step=run.assumed_step / many) for run in runs]
    runs = [_with_near_signs(body, run) for run in runs]
    states = [held_states(run) for run in runs]
    runs = [run for run, _ in states]
    parts = [_airborne(body, run, flight) for run in runs]
    flown = [run.part(part.first, part.past) for run, part in zip(runs, parts, strict=True)]
    if min(len(run.times) for run in flown) < TOLD_APART:
        return _short(body, flown, parts, within, noise)
    seen = [observed(body, run, noise) for run in flown]
    looked, allowed, colours = [], [], []
    for run, one, part in zip(flown, seen, parts, strict=True):
        audited, shares, colour = _run_audit(body, run, one, part, within)
        looked.append(audited)
        allowed.append(shares)
        colours.append(colour)
    order = step_order(seen, [one.momentum_noise for one in looked])
    found = Ranking(ranked=(), tie=())
    if not all(one.right for one in looked):
        levels = np.min(allowed, axis=0), np.max(colours, axis=0)
        found = _ranked(body, flown, looked, levels, order)
    # No residual holds a constant acceleration, so nothing else explains it.
    gravity = wrong_gravity(body, seen, looked, _WANDER, _steps(found, len(seen)))
    falls = bool(np.all(np.array(allowed)[:, 1] >= 1.0))
    if gravity is not None and (falls or all(one.kind == "step" for one in found.tie)):
        found = found.beside(gravity)
        looked = [replace(one, right=False) for one in looked]
    held = {hypothesis.name: hypothesis for _, hypothesis in states if hypothesis is not None}
    for hypothesis in held.values():
        found = found.beside(hypothesis)
    looked = [replace(one, right=one.right and held is None) for one, (_, held) in zip(looked, states, strict=True)]
    return Audit(
        body=body.name,
        runs=tuple(looked),
        tolerance=max(one.tolerance for one in looked),
        hypotheses=found.ranked,
        cause=found.tie,
        step_order=order,
        notes=_notes(seen, looked, order),
    )


def _steps(found: Ranking, runs: int) -> list[float]:
    """Steps of semi-implicit Euler that are named, of each run [s]; else zeros."""
    named = found.tie[0].values if found.tie and found.tie[0].kind == "step" else {}
    steps = [fitted.value for label, fitted in named.items() if label.startswith("step")]
    return steps if len(steps) == runs else [0.0] * runs


def _short(
    body: Body,
    flown: Sequence[FloatingTrajectory],
    parts: Sequence[AirbornePart],
    within: float | None,
    noise: TrajectoryNoise | None,
) -> Audit:
    """The audit of flights of few samples, none of which says why it is wrong."""
    wander = _WANDER if within is None else 0.0
    given = _TOLERANCE if within is None else within
    found = tuple(
        short_run_audit(body, run, part, given, wander if run.captured or run.joint_rates is None else 0.0, noise)
        for run, part in zip(flown, parts, strict=True)
    )
    few = f"A flight of fewer than {TOLD_APART} samples is fitted as a whole: it says what is wrong, but not why."
    return Audit(
        body=body.name,
        runs=found,
        tolerance=max(one.tolerance for one in found),
        hypotheses=(),
        cause=(),
        step_order=None,
        notes=(_JOINT_TORQUES, few),
    )


def given_runs(trajectories: FloatingTrajectory | Iterable[FloatingTrajectory]) -> list[FloatingTrajectory]:
    """One trajectory or several as a list. Raises ShapeError for other objects."""
    given = [trajectories] if isinstance(trajectories, FloatingTrajectory) else trajectories
    runs = list(given) if isinstance(given, Iterable) else []
    if not runs or not all(isinstance(run, FloatingTrajectory) for run in runs):
        raise ShapeError(f"trajectories: FloatingTrajectory or several are needed, got {value_text(trajectories)}")
    return runs


def _with_near_signs(body: Body, run: FloatingTrajectory) -> FloatingTrajectory:
    """Trajectory with each quaternion of a ball joint in the sign that is nearer to the sample before."""
    balls = ball_columns(body.joint_names)
    if not balls or run.shapes.shape[1] != body.n_shape:
        return run
    signs = near_signs(run.shapes, balls)
    rates = None if run.joint_rates is None else run.joint_rates * signs
    return replace(run, shapes=run.shapes * signs, joint_rates=rates)


def _airborne(body: Body, run: FloatingTrajectory, flight: str | Sequence[float]) -> AirbornePart:
    """The part in the air; a trajectory that falls only if it is read otherwise is looked at as it falls then."""
    found, fault = None, None
    try:
        found = airborne_part(body, run, flight)
    except TrajectoryError as error:
        fault = error
    if found is not None and found.past - found.first >= _MOSTLY * len(run.times):
        return found
    given, every = found, -(-len(run.times) // _MOST_LOOKED_AT)
    for changed in read_otherwise(body, run):
        other = changed.every(every)
        try:
            part = airborne_part(body, other, flight)
        except TrajectoryError:
            continue
        first, past = every * part.first, min(every * (part.past - 1) + 1, len(run.times))
        if given is not None and off_parabola(body, run, given) <= _NEARER * off_parabola(body, changed, given):
            continue
        if found is None or past - first > found.past - found.first:
            found = replace(part, first=first, past=past, how=f"{part.how}, if it is read otherwise")
    if found is None:
        assert fault is not None
        raise fault
    return found


def _run_audit(
    body: Body, run: FloatingTrajectory, seen: Observation, part: AirbornePart, given: float | None
) -> tuple[RunAudit, Array, Array]:
    """Audit of one run; for momentum, fall and rates the allowed share of squares, and the colour of the noise."""
    scale = seen.scale
    wander = _wander(run, seen) if given is None else 0.0
    tolerance = _TOLERANCE if given is None else given
    of_fall = max(tolerance, wander / seen.extent)
    if wander and scale > 0.0:
        span = float(seen.times[-1] - seen.times[0])
        tolerance = max(tolerance, 2.0 * np.pi / span * seen.mass * wander * seen.extent / scale)
    momentum, free = seen.seen(seen.momentum), 1 if seen.given_rates else 2
    inner = _off(seen.times, _in_units(momentum, seen.momentum_noise), free)
    # The sum of the momentum over the time is compared with a turn of the body.
    size = scale if seen.given_rates else seen.mass * seen.extent**2
    smooth = smooth_part(seen.times, momentum, seen.momentum_noise, free, seen.carried_noise, inner, size)
    values, level, least = smooth.values, smooth.noise, smooth.least
    if not seen.given_rates:
        values, least = (np.gradient(curve, seen.times, axis=0) for curve in (values, least))
        level /= seen.times[-1] - seen.times[0]
    drift = float(np.linalg.norm(values, axis=1).max())
    fall = None
    if seen.centre is not None and seen.centre_noise is not None:
        inner = _off(seen.times, _in_units(seen.centre, seen.centre_noise), 3)
        fall = smooth_part(seen.times, seen.centre, seen.centre_noise, 3, whitened=inner, size=seen.extent)
    agreement = rate_agreement(run, seen.noise)
    off = None if fall is None else float(np.linalg.norm(fall.values, axis=1).max())
    error = _attitude_error(body, seen)
    allowed = [_allowed(smooth.ratio, drift / scale if scale > 0.0 else 0.0, tolerance)]
    allowed.append(1.0 if fall is None or off is None else _allowed(fall.ratio, off / seen.extent, of_fall))
    # Half a step apart, as semi-implicit integrators leave them, is no fault.
    late = agreement is None or abs(agreement.late) <= run.assumed_step
    if agreement is not None:
        rates = _allowed(agreement.ratio, agreement.mismatch, tolerance)
        allowed.append(max(rates, float(late and agreement.mismatch_less_late <= tolerance)))
    else:
        allowed.append(1.0)
    audited = RunAudit(
        name=run.name,
        airborne=part,
        first_time=float(run.times[0]),
        last_time=float(run.times[-1]),
        given_rates=seen.given_rates,
        step=run.assumed_step,
        noise=seen.noise,
        times=seen.times,
        momentum=seen.momentum,
        momentum_scale=scale,
        momentum_drift=drift,
        momentum_noise=level / scale if scale > 0.0 else 0.0,
        momentum_ratio=smooth.ratio,
        least_drift=float(np.abs(least).max()) / scale if scale > 0.0 else 0.0,
        fall_off=off,
        fall_ratio=None if fall is None else fall.ratio,
        extent=seen.extent,
        agreement=agreement,
        attitude_error=error,
        tolerance=tolerance,
        recorded=wander > 0.0,
        right=min(allowed) >= 1.0,
    )
    colour = [1.0 if part is None else part.colour for part in (smooth, fall, agreement)]
    return audited, np.array(allowed), np.array(colour)


def _off(times: Array, whitened: Array, free: int) -> Array:
    """Less the polynomials that a free body may have anyway."""
    basis = polynomials(times, free - 1)
    return whitened - basis @ (basis.T @ whitened)


def _in_units(values: Array, covariances: Array) -> Array:
    return so3.apply(inverse_factor(covariances), values - values.mean(axis=0))


def _wander(run: FloatingTrajectory, seen: Observation) -> float:
    """How far parts of a body are known to be from where a recording has them [m]; 0 of what a simulator stores."""
    noisy = not seen.given_rates and max(seen.noise.attitude, seen.noise.position) > _MEASURED
    return _WANDER if run.captured or noisy else 0.0


def _allowed(ratio: float, value: float, tolerance: float) -> float:
    """Share of a square that noise or the tolerance allows; 1 or more where the law holds."""
    within = (tolerance / value) ** 2 if value > 0.0 else 1.0
    return max(within, 1.0) if ratio <= 1.0 else within


def _attitude_error(body: Body, seen: Observation) -> Array | None:
    """How far the attitude is from the nearest reconstruction found of the same joint motion: (N,) [rad]."""
    try:
        with quiet(category=TrajectoryWarning):
            return _from_exact(body, seen)
    except ShapePhaseError:
        # What is wrong may be so wrong that no motion follows.
        return None


def _from_exact(body: Body, seen: Observation) -> Array:
    times = seen.times - seen.times[0]
    path = ShapePath.spline(times, seen.trajectory.shapes, periodic=False, joint_names=body.joint_names)
    moving = articulated(body, path)
    if seen.noise.attitude >= _QUIET:
        return momentum_from_recording(moving, times, seen.attitude).angles
    motion = reconstruct(moving, seen.momentum[0], seen.attitude[0])
    exact = motion.attitude(np.minimum(times, motion.duration))
    off = so3.angle(so3.transpose(exact) @ seen.attitude)
    wanders = np.ptp(seen.momentum, axis=0).max() > _STEADY * seen.scale
    if off.max() > _NEAR and not wanders:
        # Where no flight is near all the same, it stays as far as it is.
        with suppress(ShapePhaseError):
            off = min(off, momentum_from_recording(moving, times, seen.attitude).angles, key=np.max)
    return off


def _ranked(
    body: Body,
    runs: Sequence[FloatingTrajectory],
    looked: Sequence[RunAudit],
    allowed: tuple[Array, Array],
    order: StepOrder | None,
) -> Ranking:
    """Hypotheses one by one; in twos where the best leaves more than noise and tolerance."""
    runs = [thinned(run) for run in runs]
    levels = [one.noise for one in looked]
    fits = [residuals(body, observed(body, run, level)) for run, level in zip(runs, levels, strict=True)]
    without = leftover(fits, np.concatenate([fit.vector for fit in fits]))
    evidence = Evidence(without, *allowed)
    if order is not None:
        late = max(
            (one.agreement.mismatch_less_late / max(one.agreement.mismatch, 1e-300) for one in looked if one.agreement),
            default=0.0,
        )
        step = step_hypothesis(order, without, late**2)
        steps = [] if step is None else [step]
    else:
        steps = integration_step(fits)
    readings = other_readings(body, runs, levels)
    singles = [*steps, *_causes(body, fits), *(one.hypothesis for one in readings)]
    found = evidence.ranking(singles)
    if not found.ranked or evidence.settled_by(found.ranked[0]):
        return found
    pairs = []
    if order is None:
        stepped = [residuals(body, fit.seen, any_step=True) for fit in fits]
        others = other_readings(body, runs, levels, any_step=True)
        seconds = [*_causes(body, stepped), *(one.hypothesis for one in others)]
        pairs += [one.paired_with("integration step", len(runs)) for one in seconds if _steps_are_possible(one, fits)]
    nearest = {one.name for one in found.ranked[:_PAIRED]}
    for reading in readings:
        first = reading.hypothesis
        if first.name in nearest:
            read = reading.fits(body)
            seconds = [*integration_step(read), *wrong_inertias(body, read)]
            pairs += [one.paired_with(first.name, first.parameters, first.values) for one in seconds]
    alone = {one.name: one for one in singles}
    pairs = [one for one in pairs if all(_takes(one, alone.get(name)) for name in one.name.split(AND))]
    nearest = {frozenset(one.name.split(AND)): one for one in sorted(pairs, key=lambda one: -one.square)}
    found = evidence.ranking([*singles, *nearest.values()])
    return found if found.tie else evidence.ranking([*found.ranked, *filtered_samples(fits, without)])


def _takes(pair: Hypothesis, alone: Hypothesis | None) -> bool:
    """Whether two causes leave much less of a law than one of them alone does."""
    if alone is None or alone.leftover is None or pair.leftover is None:
        return True
    return bool(np.any(pair.leftover.squares < _TAKES * alone.leftover.squares))


def _steps_are_possible(hypothesis: Hypothesis, fits: Sequence[Residuals]) -> bool:
    steps = () if hypothesis.leftover is None else hypothesis.leftover.steps
    return len(steps) == len(fits) and all(is_possible_step(fit, *step) for fit, step in zip(fits, steps, strict=True))


def _causes(body: Body, fits: Sequence[Residuals]) -> list[Hypothesis]:
    """Hypotheses that change what the laws predict, not what the samples are; each fitted to all runs."""
    return [
        *wrong_inertias(body, fits),
        *joint_offsets(body, fits),
        *outside_pushes(fits),
        *drag(body, fits),
        *no_gyroscopic_term(fits),
    ]


def thinned(run: FloatingTrajectory) -> FloatingTrajectory:
    """Every k-th sample, at most as many as hypotheses are fitted to."""
    every = -(-len(run.times) // _MOST_SAMPLES)
    return run if every == 1 else run.every(every)


def _notes(seen: Sequence[Observation], looked: Sequence[RunAudit], order: StepOrder | None) -> tuple[str, ...]:
    found = [_JOINT_TORQUES]
    if not all(one.given_rates for one in seen):
        found.append("Rates are not given: neither their frames nor whether they belong to the attitudes can be told.")
    for one in seen:
        if one.trajectory.joint_order is not None:
            found.append(f"{one.trajectory.name}: joints without names are in {one.trajectory.joint_order}.")
        rates = so3.apply(one.attitude, one.rate)
        strengths = np.linalg.svd(rates, compute_uv=False)
        if strengths[1] <= _ONE_AXIS * strengths[0]:
            found.append(
                f"{one.trajectory.name}: the base turns about one axis alone, so that the frame of its angular "
                "velocity cannot be told."
            )
    if any(one.fall_ratio is None for one in looked):
        found.append("Places are not given: nothing is known of the fall, nor of a force from outside.")
    if order is None and len(seen) == 1:
        found.append("One run says at most that a drift is consistent with an integration step; runs with others tell.")
    return tuple(found)
