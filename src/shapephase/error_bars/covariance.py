"""Error bars of a motion's results: from noise of the joints, errors of inertias, of momentum and of the start."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from functools import partial
from typing import Any, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_executor, whole_argument
from ..arrays import Array
from ..body.body import Body
from ..deformation.deformation import articulated
from ..deformation.rotors import Rotor
from ..display import frozen
from ..phases.phase_split import PhaseSplit
from ..phases.phases import split
from ..phases.whole_turns import count_slopes
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion, reconstruct
from ..shape_space.path_samples import path_samples
from ..shape_space.shape_path import ShapePath
from ._joint_noise import carried_by_knots
from ._propagation import angle_bar, carried
from .error_sources import InertiaErrors, Inputs, by_relative_errors, drawn_bodies, inputs_of
from .forced_covariance import ForcedUncertainty, forced_uncertainty
from .recorded_momentum import UNKNOWNS, RecordedMomentum
from .result_derivatives import (
    Derivatives,
    ResultDerivative,
    derivatives,
    described_by,
    fit_by_inertias,
    fit_by_knots,
    fit_by_rotors,
)

_ROUNDING = 1e-9  # of the largest variance of a rotation: smaller ones about other axes are rounding
_ROTATIONS = (
    "final_attitude",
    "total_rotation",
    "holonomy",
    "dynamical_rotation",
    "wheel_rotation",
    "momentum_rotation",
)
_PHASES = ("dynamic_phase", "solid_angle", "montgomery_phase")


@frozen
class Uncertainty:
    """Error bars of the results of a motion, to first order or from draws. Made by `uncertainty`.

    A rotation D may be exp(hat(e)) D, where e has mean zero and the covariance that is given, inertial axes. Phases are
    those of the horizontal gauge; without momentum they are exactly zero.

    Attributes
    ----------
    final_attitude, total_rotation, holonomy, dynamical_rotation, wheel_rotation, momentum_rotation : (3, 3)
        covariances [rad^2]
    dynamic_phase, solid_angle, montgomery_phase : standard deviations [rad]
    start : (6, 6) covariance of the turn of the start, base axes [rad^2], and of the momentum [(kg m^2/s)^2], with all
        that moves a fit to a recording
    somersaults, twists : standard deviations of an athlete's counts by `turn_counts`, about the same axes
        [revolutions]; None of another body, and where the tilt at an end is a right angle
    total_angle, holonomy_angle, wheel_angle : standard deviations of the angles of these rotations [rad]; at 180
        degrees rms changes, as an angle only shrinks there; near 0 the rms of the whole rotation, an upper bound
    smoothing_bias : by how much smoothing has shifted the result that it shifts most, as far as that is known, in
        standard deviations of its own, which hold it; 0 where nothing was smoothed or `joints` are exact
    draws : number of motions this was estimated from; 0: by derivatives
    """

    final_attitude: Array
    total_rotation: Array
    holonomy: Array
    dynamical_rotation: Array
    wheel_rotation: Array
    momentum_rotation: Array
    dynamic_phase: float
    solid_angle: float
    montgomery_phase: float
    start: Array
    total_angle: float
    holonomy_angle: float
    wheel_angle: float
    smoothing_bias: float = 0.0
    draws: int = 0
    somersaults: float | None = None
    twists: float | None = None


@overload
def uncertainty(
    motion: Motion,
    *,
    joints: ArrayLike | str | None = None,
    inertias: InertiaErrors | None = None,
    momentum: ArrayLike | None = None,
    attitude: ArrayLike | None = None,
    start: RecordedMomentum | ArrayLike | None = None,
    rotors: float | Mapping[str, float] | None = None,
) -> Uncertainty: ...


@overload
def uncertainty(
    motion: ForcedMotion,
    *,
    joints: ArrayLike | str | None = None,
    inertias: InertiaErrors | None = None,
    momentum: ArrayLike | None = None,
    attitude: ArrayLike | None = None,
    start: ArrayLike | None = None,
    rotors: float | Mapping[str, float] | None = None,
) -> ForcedUncertainty: ...


def uncertainty(
    motion: Motion | ForcedMotion,
    *,
    joints: ArrayLike | str | None = None,
    inertias: InertiaErrors | None = None,
    momentum: ArrayLike | None = None,
    attitude: ArrayLike | None = None,
    start: RecordedMomentum | ArrayLike | None = None,
    rotors: float | Mapping[str, float] | None = None,
) -> Uncertainty | ForcedUncertainty:
    """Error bars of the results of `split`, to first order, from the errors of its inputs.

    Sources are independent of each other; inputs without errors are exact. The cost is that of a few reconstructions,
    however many samples and links there are.

    Equation :eq:`covariance` of the documentation.
    Source: the derivatives are those of `derivatives`.

    Parameters
    ----------
    motion : of an articulated body; under a torque that is a function of time alone, whose bars are those of the state
        at the end
    joints : of the samples that the path is made of: the standard deviation of white noise, one number or one for each
        joint (n,) [rad or m], or a text such as "0.3deg" or "0.3deg,1mm"; or the covariance (N n, N n) of all samples,
        row by row; for a periodic path without the last, which is the first. For a recording that was closed, smoothed
        or resampled, all samples as recorded, with those before and after a flight that were smoothed with it; joints
        that rest without a column have no noise. The bias of smoothing widens the bars, too
    inertias : of the body's links
    momentum : the covariance (3, 3) [(kg m^2/s)^2], inertial axes, or one standard deviation of all components
    attitude : of the start, turned to R(0) exp(hat(delta)): the covariance (3, 3) of delta [rad^2], or one standard
        deviation [rad]
    start : instead of these two the covariance (6, 6) of both, the turn of the start first; or the whole fit of
        `momentum_from_recording`, whose `motion` this is: then errors of `joints` and `inertias` move the fit, too, as
        they do where the recorded attitudes stay what they are
    rotors : of the wheels' values, one standard deviation for all or one by name of the joint, in the unit of each
        value [kg m^2/s] or [rad/s]; of a value given in time, of a constant that is added to it

    Raises
    ------
    WrongObjectError
        If the motion is not one of an articulated body, or, with `joints`, its path not one through samples; for a
        torque that depends on the state.
    ShapeError
        For a batch, for covariances that are not, for the fit of another motion, and for `start` beside `momentum`
        or `attitude`.
    UnknownNameError
        For a link that the body does not have, or a joint that turns no wheel.
    TrajectoryError
        For a text that is not an amount.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> bars = sp.uncertainty(motion, momentum=1e-5)
    >>> print(f"{bars.dynamic_phase:.6f} rad")
    0.000813 rad
    """
    inputs = inputs_of(motion, joints, inertias, momentum, attitude, start, rotors)
    if isinstance(motion, ForcedMotion):
        return forced_uncertainty(motion, inputs)
    derived = derivatives(motion)
    covariances = [np.zeros((3, 3)) for _ in _ROTATIONS]
    variances, of_start = np.zeros(len(_PHASES)), np.zeros((UNKNOWNS, UNKNOWNS))
    counting, of_counts = count_slopes(motion), np.zeros((2, 2))
    for cause in _causes(derived, inputs):
        for total, name in zip(covariances, _ROTATIONS, strict=True):
            total += carried(getattr(cause.derivative, name), cause.covariance)
        variances += [carried(getattr(cause.derivative, name)[None], cause.covariance)[0, 0] for name in _PHASES]
        of_start += carried(cause.start, cause.covariance)
        if counting is not None:
            ends = np.vstack([cause.derivative.final_attitude, cause.start[:3]])
            of_counts += carried(counting @ ends, cause.covariance)
    deviations = np.sqrt(variances)
    bias = 0.0 if inputs.samples is None else _smoothing_bias(derived, covariances, deviations)
    counts = None if counting is None else of_counts
    return _uncertainty(split(motion), covariances, deviations, of_start, counts, smoothing_bias=bias, draws=0)


def sampled_uncertainty(
    motion: Motion,
    *,
    joints: ArrayLike | str | None = None,
    inertias: InertiaErrors | None = None,
    momentum: ArrayLike | None = None,
    attitude: ArrayLike | None = None,
    start: RecordedMomentum | ArrayLike | None = None,
    rotors: float | Mapping[str, float] | None = None,
    draws: int = 400,
    seed: int = 0,
    executor: Executor | None = None,
) -> Uncertainty:
    """Return the error bars of `uncertainty` by drawing errors and reconstructing each motion: a check of first order.

    400 draws give a standard deviation to 4 %. The bias of smoothing is alike in all of them, and is not in the bars.

    Raises like `uncertainty` and `reconstruct`.

    Parameters
    ----------
    motion, joints, inertias, momentum, attitude, start, rotors : as for `uncertainty`; errors are normally distributed,
        and move a fit to first order
    draws : how many, two or more
    seed : of the random numbers
    executor : of `concurrent.futures`, or of a cluster (`distributed.Client.get_executor()`), that reconstructs the
        motions; None: one after the other, here. Results do not depend on it

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> bars = sp.sampled_uncertainty(motion, momentum=1e-5, draws=10)
    >>> print(f"{bars.draws} draws, {bars.dynamic_phase:.4f} rad")
    10 draws, 0.0008 rad
    """
    check_executor(executor)
    draws, seed = whole_argument(draws, "draws", 2), whole_argument(seed, "seed", 0)
    body, path, _, wheels = described_by(motion)
    inputs, rng = inputs_of(motion, joints, inertias, momentum, attitude, start, rotors), np.random.default_rng(seed)
    normal = partial(_drawn, rng, draws)
    paths, bodies, changes = [path] * draws, [body] * draws, np.zeros((draws, UNKNOWNS))
    if inputs.samples is not None:
        samples, errors = path_samples(path), normal(inputs.samples)
        paths = [samples.path_through(samples.values + row.reshape(samples.values.shape)) for row in errors]
        changes += errors @ samples.by_samples(moved_fit_by_knots(motion, inputs)).T
    if inputs.links is not None:
        errors = normal(inputs.links)
        bodies = drawn_bodies(body, wheels, errors)
        changes += errors @ moved_fit_by_links(motion, inputs).T
    if inputs.attitude is not None:
        changes[:, :3] += normal(inputs.attitude)
    if inputs.momentum is not None:
        changes[:, 3:] += normal(inputs.momentum)
    if inputs.start is not None:
        changes += normal(inputs.start)
    added = np.zeros((draws, len(wheels)))
    if inputs.rotors is not None:
        added = normal(inputs.rotors)
        changes += added @ moved_fit_by_rotors(motion, inputs).T
    starts, momenta = motion.initial_attitude @ so3.exp(changes[:, :3]), motion.momentum + changes[:, 3:]
    middle = split(motion)
    turns, phases = np.empty((len(_ROTATIONS), draws, 3)), np.empty((draws, len(_PHASES)))
    compute = map if executor is None else executor.map
    expected = [_rotation(motion, middle, name) for name in _ROTATIONS]
    one_draw = partial(_results_of_draw, motion.tolerance, wheels)
    for row, (rotations, angles) in enumerate(compute(one_draw, bodies, paths, momenta, starts, added)):
        for which, (rotation, usual) in enumerate(zip(rotations, expected, strict=True)):
            turns[which, row] = so3.log(rotation @ usual.T)
        phases[row] = angles
    covariances = [np.cov(vectors, rowvar=False) for vectors in turns]
    counting = count_slopes(motion)
    counts = None if counting is None else np.cov(np.hstack([turns[0], changes[:, :3]]) @ counting.T, rowvar=False)
    of_start = np.cov(changes, rowvar=False)
    return _uncertainty(middle, covariances, phases.std(axis=0, ddof=1), of_start, counts, draws=draws)


def _results_of_draw(
    tolerance: float,
    rotors: tuple[Rotor, ...],
    body: Body,
    path: ShapePath,
    momentum: Array,
    start: Array,
    added: Array,
) -> tuple[list[Array], list[Array]]:
    """Rotations and phases of one motion, which may be computed in another process."""
    momenta: dict[str, float | ShapePath] = {}
    speeds: dict[str, float | ShapePath] = {}
    for rotor, change in zip(rotors, added, strict=True):
        (momenta if rotor.is_momentum else speeds)[rotor.joint] = _shifted(rotor.value, change)
    deformation = articulated(body, path, rotors=momenta, rotor_speeds=speeds)
    drawn = reconstruct(deformation, momentum, start, tolerance=tolerance)
    parts = split(drawn)
    return [_rotation(drawn, parts, name) for name in _ROTATIONS], [getattr(parts, name) for name in _PHASES]


def _shifted(value: float | ShapePath, change: float) -> float | ShapePath:
    """A wheel's value, or its path in time, with a constant added."""
    if not isinstance(value, ShapePath):
        return value + change
    samples = path_samples(value)
    return samples.path_through(samples.values + change)


class _Cause(NamedTuple):
    """The derivatives by what is not known exactly, m numbers, those of attitude and momentum at the start, (6, m),
    and the covariance of these numbers."""

    derivative: ResultDerivative
    start: Array
    covariance: Array


def _causes(derived: Derivatives, inputs: Inputs) -> Iterator[_Cause]:
    by_start = _combined(np.hstack, derived.by_attitude, derived.by_momentum)

    def moving_the_fit(derivative: ResultDerivative, start: Array, covariance: Array) -> _Cause:
        return _Cause(_combined(lambda pair: pair[0] + pair[1] @ start, derivative, by_start), start, covariance)

    if inputs.samples is not None:
        samples, by_fit = path_samples(derived.path), moved_fit_by_knots(derived.motion, inputs)
        for rule in samples.rules:
            yield moving_the_fit(derived.at_knots(rule), rule(by_fit), inputs.samples)
        # The bias is one unknown of variance one, times its estimate.
        taken = samples.bias[:, None]
        yield moving_the_fit(derived.at_knots(lambda by_knots: by_knots @ taken), by_fit @ taken, np.ones(1))
    if inputs.links is not None:
        by_parameters = partial(by_relative_errors, derived.body, derived.rotors)
        by_links = _combined(lambda only: by_parameters(only[0]), derived.by_inertias)
        yield moving_the_fit(by_links, moved_fit_by_links(derived.motion, inputs), inputs.links)
    if inputs.momentum is not None:
        yield _Cause(derived.by_momentum, np.eye(UNKNOWNS)[:, 3:], inputs.momentum)
    if inputs.attitude is not None:
        yield _Cause(derived.by_attitude, np.eye(UNKNOWNS)[:, :3], inputs.attitude)
    if inputs.start is not None:
        yield _Cause(by_start, np.eye(UNKNOWNS), inputs.start)
    if inputs.rotors is not None:
        yield moving_the_fit(derived.by_rotors, moved_fit_by_rotors(derived.motion, inputs), inputs.rotors)


def _combined(rule: Callable[[tuple[Array, ...]], Array], *parts: ResultDerivative) -> ResultDerivative:
    """Result of a rule for each derivative of the parts."""
    return ResultDerivative(*(rule(tuple(getattr(part, name) for part in parts)) for name in (*_ROTATIONS, *_PHASES)))


def carried_errors(motion: Motion, inputs: Inputs, by_knots: Array, by_start: Array) -> Array:
    """Covariance (r, r) of numbers with derivatives by the path at its knots (r, knots n) and by the start (r, 6).

    By errors of the joints, of momentum and start, and of a fit that these move; others do not count.
    """
    total = np.zeros((len(by_start), len(by_start)))
    if inputs.samples is not None:
        moved = by_knots + by_start @ moved_fit_by_knots(motion, inputs)
        total += carried_by_knots(path_samples(described_by(motion).path), moved, inputs.samples)
    of_momentum, of_all = slice(3, UNKNOWNS), slice(UNKNOWNS)
    for columns, given in ((of_momentum, inputs.momentum), (slice(3), inputs.attitude), (of_all, inputs.start)):
        if given is not None:
            total += carried(by_start[:, columns], given)
    return total


def moved_fit_by_knots(motion: Motion, inputs: Inputs) -> Array:
    """Derivatives of fitted attitude and momentum at the start by the path at its knots: (6, knots n)."""
    if inputs.fit is None:
        path = described_by(motion).path
        return np.zeros((UNKNOWNS, path_samples(path).bias.size))
    return fit_by_knots(motion, inputs.fit.times, inputs.fit.by_attitudes, inputs.fit.by_rates)


def moved_fit_by_links(motion: Motion, inputs: Inputs) -> Array:
    """Derivatives of the fit by the relative errors of links."""
    assert inputs.links is not None
    if inputs.fit is None:
        return np.zeros((UNKNOWNS, len(inputs.links)))
    described = described_by(motion)
    by_parameters = fit_by_inertias(motion, inputs.fit.times, inputs.fit.by_attitudes, inputs.fit.by_rates)
    return by_relative_errors(described.body, described.rotors, by_parameters)


def moved_fit_by_rotors(motion: Motion, inputs: Inputs) -> Array:
    """Derivatives of the fit by the wheels' values: (6, W)."""
    assert inputs.rotors is not None
    if inputs.fit is None:
        return np.zeros((UNKNOWNS, len(inputs.rotors)))
    return fit_by_rotors(motion, inputs.fit.times, inputs.fit.by_attitudes, inputs.fit.by_rates)


def _drawn(rng: np.random.Generator, draws: int, covariance: Array) -> Array:
    """Normal errors: variances (m,) or a covariance (m, m) -> (draws, m)."""
    if covariance.ndim == 1:
        return rng.normal(size=(draws, len(covariance))) * np.sqrt(covariance)
    values, vectors = np.linalg.eigh(covariance)
    return (rng.normal(size=(draws, len(values))) * np.sqrt(np.maximum(values, 0.0))) @ vectors.T


def _smoothing_bias(derived: Derivatives, covariances: list[Array], deviations: Array) -> float:
    """The largest shift of a result by smoothing, in standard deviations: of a rotation about its worst axis."""
    taken = path_samples(derived.path).bias
    if not taken.any():
        return 0.0
    shifts = []
    for name, covariance in zip(_ROTATIONS, covariances, strict=True):
        values, vectors = np.linalg.eigh(covariance)
        known = values > _ROUNDING * max(float(values[-1]), 0.0)
        turn = vectors.T @ (getattr(derived.by_knots, name) @ taken)
        shifts.append(float(np.sqrt((turn[known] ** 2 / values[known]).sum())))
    for name, deviation in zip(_PHASES, deviations, strict=True):
        if deviation:
            shifts.append(abs(float(getattr(derived.by_knots, name) @ taken)) / float(deviation))
    return max(shifts)


def _rotation(motion: Motion, parts: PhaseSplit, name: str) -> Array:
    return motion.final_attitude if name == "final_attitude" else getattr(parts, name)


def _uncertainty(
    parts: PhaseSplit,
    covariances: list[Array],
    deviations: Array,
    start: Array,
    counts: Array | None,
    *,
    draws: int,
    smoothing_bias: float = 0.0,
) -> Uncertainty:
    _, total, holonomy, _, wheels, _ = covariances
    rotations = parts.total_rotation, parts.holonomy, parts.wheel_rotation
    bars = map(angle_bar, rotations, (total, holonomy, wheels))
    turns = (None, None) if counts is None else np.sqrt(np.diag(counts)).tolist()
    numbers: list[Any] = [*covariances, *deviations.tolist(), start, *bars, smoothing_bias, draws, *turns]
    return Uncertainty(*numbers)
