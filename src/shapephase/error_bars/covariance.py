"""Error bars of a motion's results: from noise of the joints, errors of inertias, of momentum and of the start."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arrays import Array, finite_array, lock_arrays
from ..body.body import Body
from ..body.family import BodyFamily
from ..deformation.deformation import articulated
from ..errors import ShapeError, unknown_name
from ..phases.phase_split import PhaseSplit
from ..phases.phases import split
from ..reconstruction.reconstruction import Motion, reconstruct
from ..shape_space.files._labels import amounts
from ..shape_space.path_samples import path_samples
from ..shape_space.shape_path import ShapePath
from ..shape_space.summaries import body_summary
from .result_derivatives import Derivatives, ResultDerivative, derivatives, described_by

# An angle has a bar of its own where it is this many of them from 0 and from 180 degrees.
_BARS_FROM_THE_ENDS = 5.0
# Negative eigenvalues of a covariance, relative to the largest: printed digits.
_NEGATIVE = 1e-9
# Relative errors of a link: of its mass, of its centre (3), of its inertia.
_OF_A_LINK = 5
# Of its own mass and inertia, what a link keeps in a draw at least.
_LEAST_SHARE = 1e-3
_ROTATIONS = ("final_attitude", "total_rotation", "holonomy", "dynamical_rotation")
_PHASES = ("dynamic_phase", "solid_angle", "montgomery_phase")


@dataclass(frozen=True, kw_only=True)
class InertiaErrors:
    """Relative standard deviations of the inertias of links, independent of each other.

    Each is one number for all moving links, or a mapping from names of links.

    Attributes
    ----------
    masses : of the mass, with which the rotational inertia grows
    centres : of each coordinate of the centre of mass, in radii of gyration of the link
    inertias : of the rotational inertia as a whole, the mass being as it is

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> found = sp.uncertainty(motion, inertias=sp.InertiaErrors(masses=0.05))
    >>> print(f"{found.dynamic_phase:.4f} rad")
    0.0107 rad
    """

    masses: float | Mapping[str, float] = 0.0
    centres: float | Mapping[str, float] = 0.0
    inertias: float | Mapping[str, float] = 0.0


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """How far the results of a motion may be off, to first order or as drawn.

    A rotation D may be exp(hat(e)) D, where e has mean zero and the covariance that is given, inertial axes. Phases are
    those of the horizontal gauge; without momentum they are exactly zero.

    Attributes
    ----------
    final_attitude, total_rotation, holonomy, dynamical_rotation : (3, 3) covariances [rad^2]
    dynamic_phase, solid_angle, montgomery_phase : standard deviations [rad]
    total_angle, holonomy_angle : standard deviations of the angles of these rotations [rad]; NaN where an angle is
        less than five of them from 0 or from 180 degrees: there it cannot be said by one number
    smoothing_bias : by how much smoothing has shifted the result that it shifts most, as far as that is known, in
        standard deviations of its own, which do not hold it; 0 where nothing was smoothed or `joints` are exact
    draws : how many motions this was estimated from; 0: found by derivatives

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> found = sp.uncertainty(motion, attitude=0.01)
    >>> print(np.sqrt(found.final_attitude.diagonal()).round(3))
    [0.012 0.009 0.01 ]
    """

    final_attitude: Array
    total_rotation: Array
    holonomy: Array
    dynamical_rotation: Array
    dynamic_phase: float
    solid_angle: float
    montgomery_phase: float
    total_angle: float
    holonomy_angle: float
    smoothing_bias: float = 0.0
    draws: int = 0

    __post_init__ = lock_arrays


def uncertainty(
    motion: Motion,
    *,
    joints: ArrayLike | str | None = None,
    inertias: InertiaErrors | None = None,
    momentum: ArrayLike | None = None,
    attitude: ArrayLike | None = None,
) -> Uncertainty:
    """How far the results of `split` may be off, to first order, by what is not known exactly.

    The four sources are independent of each other; what is not given is exact. The cost is that of a few
    reconstructions, however many samples and links there are.

    Parameters
    ----------
    motion : of an articulated body
    joints : of the samples that the path is made of: the standard deviation of white noise, one or one for each
        joint (n,) [rad or m], or a text such as "0.3deg" or "0.3deg,1mm"; or the covariance (N n, N n) of all samples,
        row by row; of a periodic path without the last, which is the first. Of a recording that was closed, smoothed
        or resampled all samples as recorded; one number is not for joints that rest without a column
    inertias : of the body's links
    momentum : the covariance (3, 3) [(kg m^2/s)^2], inertial axes, or one standard deviation of all components
    attitude : of the start, turned to R(0) exp(hat(delta)): the covariance (3, 3) of delta [rad^2], or one standard
        deviation [rad]

    Raises
    ------
    WrongObjectError
        If the motion is not one of an articulated body, or, with `joints`, its path not one through samples.
    ShapeError
        For a batch, and for covariances that are not.
    UnknownNameError
        For a link that the body does not have.
    TrajectoryError
        For a text that is no amount.

    Notes
    -----
    Equation :eq:`covariance` of the documentation.
    Source: the derivatives are those of `derivatives`.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> found = sp.uncertainty(motion, momentum=1e-5)
    >>> print(f"{found.dynamic_phase:.6f} rad")
    0.000813 rad
    """
    found = derivatives(motion)
    inputs = _inputs(motion, joints, inertias, momentum, attitude)
    covariances = [np.zeros((3, 3)) for _ in _ROTATIONS]
    variances = np.zeros(len(_PHASES))
    for derivative, covariance in _by_source(found, inputs):
        for total, name in zip(covariances, _ROTATIONS, strict=True):
            total += _carried(getattr(derivative, name), covariance)
        variances += [_carried(getattr(derivative, name)[None], covariance)[0, 0] for name in _PHASES]
    deviations = np.sqrt(variances)
    bias = 0.0 if inputs.samples is None else _smoothing_bias(found, covariances, deviations)
    return _uncertainty(split(motion), covariances, deviations, smoothing_bias=bias, draws=0)


def sampled_uncertainty(
    motion: Motion,
    *,
    joints: ArrayLike | str | None = None,
    inertias: InertiaErrors | None = None,
    momentum: ArrayLike | None = None,
    attitude: ArrayLike | None = None,
    draws: int = 400,
    seed: int = 0,
) -> Uncertainty:
    """The same as `uncertainty` by drawing errors and reconstructing each motion anew: a check of the first order.

    Of 400 draws a standard deviation is known to 4 %.

    Parameters
    ----------
    motion, joints, inertias, momentum, attitude : as for `uncertainty`; errors are normally distributed
    draws : how many, two or more
    seed : of the random numbers

    Notes
    -----
    Raises as `uncertainty` and `reconstruct`.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> found = sp.sampled_uncertainty(motion, momentum=1e-5, draws=10)
    >>> print(f"{found.draws} draws, {found.dynamic_phase:.4f} rad")
    10 draws, 0.0008 rad
    """
    if draws < 2:
        raise ShapeError(f"draws: two or more are needed, got {draws}")
    body, path = described_by(motion)
    inputs, rng = _inputs(motion, joints, inertias, momentum, attitude), np.random.default_rng(seed)
    normal = partial(_drawn, rng, draws)
    paths = [path] * draws
    if inputs.samples is not None:
        samples = path_samples(path)
        moved = samples.values + normal(inputs.samples).reshape(draws, *samples.values.shape)
        paths = [samples.path_through(values) for values in moved]
    bodies = [body] * draws if inputs.links is None else _drawn_bodies(body, normal(inputs.links))
    momenta = np.broadcast_to(motion.momentum, (draws, 3))
    if inputs.momentum is not None:
        momenta = momenta + normal(inputs.momentum)
    starts = np.broadcast_to(motion.initial_attitude, (draws, 3, 3))
    if inputs.attitude is not None:
        starts = starts @ so3.exp(normal(inputs.attitude))
    middle = split(motion)
    turns, phases = np.empty((len(_ROTATIONS), draws, 3)), np.empty((draws, len(_PHASES)))
    for row in range(draws):
        deformation = articulated(bodies[row], paths[row])
        drawn = reconstruct(deformation, momenta[row], starts[row], tolerance=motion.tolerance)
        parts = split(drawn)
        for which, name in enumerate(_ROTATIONS):
            turns[which, row] = so3.log(_rotation(drawn, parts, name) @ _rotation(motion, middle, name).T)
        phases[row] = [getattr(parts, name) for name in _PHASES]
    covariances = [np.cov(one, rowvar=False) for one in turns]
    return _uncertainty(middle, covariances, phases.std(axis=0, ddof=1), draws=draws)


class _Inputs(NamedTuple):
    """Covariances of what is not known exactly: variances (m,) or matrices (m, m); None where it is exact.

    Attributes
    ----------
    samples : of the path's samples
    links : of the relative errors of each frame of the body's chain: mass, centre (3), inertia
    momentum, attitude : (3, 3)
    """

    samples: Array | None
    links: Array | None
    momentum: Array | None
    attitude: Array | None


def _inputs(
    motion: Motion,
    joints: ArrayLike | str | None,
    inertias: InertiaErrors | None,
    momentum: ArrayLike | None,
    attitude: ArrayLike | None,
) -> _Inputs:
    body, path = described_by(motion)
    samples = None
    if joints is not None:
        through = path_samples(path)
        numbers = through.count * path.n_shape
        given = _by_joint(body, joints) if isinstance(joints, str) else finite_array(joints, "joints")
        if given.shape in ((), (path.n_shape,)):
            each = np.array(np.broadcast_to(_deviations(given, "joints"), path.n_shape))
            if given.ndim == 0 or isinstance(joints, str):
                each[_without_samples(path)] = 0.0
            samples = np.tile(each**2, through.count)
        else:
            samples = _covariance(given, "joints", numbers)
    links = None if inertias is None else _link_variances(body, inertias)
    return _Inputs(samples, links, _of_vector(momentum, "momentum"), _of_vector(attitude, "attitude"))


def _without_samples(path: ShapePath) -> list[int]:
    """The joints that rest where a reader was told, without a column in the file."""
    resting = {} if path.record is None else path.record.get("at_rest", {})
    return [column for column, name in enumerate(path.joint_names or ()) if name in resting]


def _by_joint(body: Body, text: str) -> Array:
    """(n,) standard deviations from a text that says one of angles, of lengths or of both."""
    said = amounts(text, "joints")
    return np.array([said[joint.unit] for joint in body_summary(body).joints])


def _of_vector(given: ArrayLike | None, name: str) -> Array | None:
    if given is None:
        return None
    array = finite_array(given, name)
    return _deviations(array, name) ** 2 * np.eye(3) if array.ndim == 0 else _covariance(array, name, 3)


def _deviations(given: Array, name: str) -> Array:
    if np.any(given < 0.0):
        raise ShapeError(f"{name}: a standard deviation is not negative, got {given}")
    return given


def _covariance(given: Array, name: str, numbers: int) -> Array:
    if given.shape != (numbers, numbers):
        raise ShapeError(
            f"{name}: one standard deviation or a covariance ({numbers}, {numbers}) is needed, got {given.shape}"
        )
    scale = np.abs(given).max(initial=0.0)
    if np.abs(given - given.T).max(initial=0.0) > _NEGATIVE * scale:
        raise ShapeError(f"{name}: a covariance is symmetric")
    least = np.linalg.eigvalsh(given)[0]
    if least < -_NEGATIVE * scale:
        raise ShapeError(f"{name}: a covariance has no negative eigenvalue, this one has {least:.3g}")
    return 0.5 * (given + given.T)


def _link_variances(body: Body, errors: InertiaErrors) -> Array:
    """(5 (k + 1),)."""
    deviations = np.zeros((len(body.chain.masses), _OF_A_LINK))
    for name, columns in (("masses", slice(0, 1)), ("centres", slice(1, 4)), ("inertias", slice(4, 5))):
        given = getattr(errors, name)
        if isinstance(given, Mapping):
            for link, one in given.items():
                if link not in body.chain.link_frames:
                    raise unknown_name(f"link of {body.name}", link, body.chain.link_frames)
                frame, _ = body.chain.link_frames[link]
                deviations[frame, columns] = _deviations(finite_array(one, f"{name} of link {link!r}", ()), name)
        else:
            deviations[:, columns] = _deviations(finite_array(given, name, ()), name)
    return (deviations**2).ravel()


def _by_source(found: Derivatives, inputs: _Inputs) -> Iterator[tuple[ResultDerivative, Array]]:
    """The derivatives by what is not known exactly, and its covariance."""
    if inputs.samples is not None:
        yield found.by_samples, inputs.samples
    if inputs.links is not None:
        yield _by_relative_errors(found.body, found.by_inertias), inputs.links
    if inputs.momentum is not None:
        yield found.by_momentum, inputs.momentum
    if inputs.attitude is not None:
        yield found.by_attitude, inputs.attitude


def _by_relative_errors(body: Body, by_inertias: ResultDerivative) -> ResultDerivative:
    """From derivatives by the ten parameters of each frame to those by its five relative errors."""
    chain = body.chain
    jacobian = np.zeros((len(chain.masses), 10, _OF_A_LINK))
    entries = chain.inertias[:, [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
    jacobian[:, 0, 0], jacobian[:, 4:, 0] = chain.masses, entries
    for axis in range(3):
        jacobian[:, 1 + axis, 1 + axis] = chain.masses * _gyration(body)
    jacobian[:, 4:, 4] = entries

    def relative(derivative: Array) -> Array:
        by_frame = derivative.reshape(*derivative.shape[:-1], len(chain.masses), 10)
        return np.einsum("...kp,kpe->...ke", by_frame, jacobian).reshape(*derivative.shape[:-1], -1)

    return ResultDerivative(*(relative(getattr(by_inertias, name)) for name in (*_ROTATIONS, *_PHASES)))


def _gyration(body: Body) -> Array:
    """The radius of gyration of each frame's mass: (k + 1,) [m]."""
    masses, traces = body.chain.masses, np.trace(body.chain.inertias, axis1=1, axis2=2)
    return np.sqrt(np.divide(0.5 * traces, masses, out=np.zeros_like(masses), where=masses > 0.0))


def _drawn_bodies(body: Body, errors: Array) -> BodyFamily:
    """One body for each row of relative errors (draws, 5 (k + 1))."""
    chain = body.chain
    each = errors.reshape(len(errors), -1, _OF_A_LINK)
    growth = np.maximum(1.0 + each[..., 0], _LEAST_SHARE)
    tensors = (growth * np.maximum(1.0 + each[..., 4], _LEAST_SHARE))[..., None, None] * chain.inertias
    centres = chain.centres + _gyration(body)[:, None] * each[..., 1:4]
    return BodyFamily(body, growth * chain.masses, centres, tensors)


def _drawn(rng: np.random.Generator, draws: int, covariance: Array) -> Array:
    """Normal errors: variances (m,) or a covariance (m, m) -> (draws, m)."""
    if covariance.ndim == 1:
        return rng.normal(size=(draws, len(covariance))) * np.sqrt(covariance)
    values, vectors = np.linalg.eigh(covariance)
    return (rng.normal(size=(draws, len(values))) * np.sqrt(np.maximum(values, 0.0))) @ vectors.T


def _carried(derivative: Array, covariance: Array) -> Array:
    """The covariance of derivative @ errors: (r, m), (m,) or (m, m) -> (r, r)."""
    return (derivative * covariance if covariance.ndim == 1 else derivative @ covariance) @ derivative.T


def _smoothing_bias(found: Derivatives, covariances: list[Array], deviations: Array) -> float:
    """The largest shift of a result by smoothing, in standard deviations: of a rotation about its worst axis."""
    taken = path_samples(found.path).bias
    if not taken.any():
        return 0.0
    shifts = []
    for name, covariance in zip(_ROTATIONS, covariances, strict=True):
        values, vectors = np.linalg.eigh(covariance)
        known = values > _NEGATIVE * max(float(values[-1]), 0.0)
        turn = vectors.T @ (getattr(found.by_knots, name) @ taken)
        shifts.append(float(np.sqrt((turn[known] ** 2 / values[known]).sum())))
    for name, deviation in zip(_PHASES, deviations, strict=True):
        if deviation:
            shifts.append(abs(float(getattr(found.by_knots, name) @ taken)) / float(deviation))
    return max(shifts)


def _rotation(motion: Motion, parts: PhaseSplit, name: str) -> Array:
    return motion.final_attitude if name == "final_attitude" else getattr(parts, name)


def _uncertainty(
    parts: PhaseSplit, covariances: list[Array], deviations: Array, *, draws: int, smoothing_bias: float = 0.0
) -> Uncertainty:
    final, total, holonomy, dynamical = covariances
    return Uncertainty(
        final_attitude=final,
        total_rotation=total,
        holonomy=holonomy,
        dynamical_rotation=dynamical,
        dynamic_phase=float(deviations[0]),
        solid_angle=float(deviations[1]),
        montgomery_phase=float(deviations[2]),
        total_angle=_bar(parts.total_rotation, total),
        holonomy_angle=_bar(parts.holonomy, holonomy),
        smoothing_bias=smoothing_bias,
        draws=draws,
    )


def _bar(rotation: Array, covariance: Array) -> float:
    """The standard deviation of a rotation's angle, along its axis [rad]; NaN near 0 and 180 degrees."""
    vector = so3.log(rotation)
    angle = float(np.linalg.norm(vector))
    # Across the axis the angle of a small rotation only grows: the widest direction decides.
    widest = float(np.sqrt(max(np.linalg.eigvalsh(covariance)[-1], 0.0)))
    if _BARS_FROM_THE_ENDS * widest >= min(angle, np.pi - angle):
        return np.nan
    axis = vector / angle
    return float(np.sqrt(max(axis @ covariance @ axis, 0.0)))
