"""Noise of the samples that a path is made of."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, finite_array
from ..body.body import Body
from ..deformation.rotors import Rotor
from ..errors import ShapeError
from ..letters import value_text
from ..shape_space.files.labels import NO_UNIT, amounts
from ..shape_space.path_samples import PathSamples, columns_without_samples, path_samples
from ..shape_space.shape_path import ShapePath
from ..shape_space.summaries import body_summary
from ._propagation import carried

_NEGATIVE = 1e-9  # of the largest eigenvalue, for negative ones of a covariance: printed digits


def sample_covariance(body: Body, path: ShapePath, wheels: tuple[Rotor, ...], joints: ArrayLike | str) -> Array:
    """Variances (N n,) or covariance (N n, N n) of a path's samples, from the argument `joints` of `uncertainty`."""
    spun = [wheel.joint for wheel in wheels]
    driven = [column for column, name in enumerate(body.joint_names) if name not in spun]
    if isinstance(joints, str):
        # One amount of angles, of lengths, or both.
        by_unit = amounts(joints, "joints")
        summary = body_summary(body).joints
        given = np.array([by_unit[summary[column].unit] for column in driven])
    else:
        given = finite_array(joints, "joints")
    through = path_samples(path)
    if given.shape not in ((), (path.n_shape,)):
        return covariance_argument(given, "joints", through.count * path.n_shape)
    deviations = np.array(np.broadcast_to(deviations_argument(given, "joints"), path.n_shape))
    if given.ndim == 0:
        # The components of a quaternion change by half its turn.
        deviations[np.array(body.joint_units, dtype=str)[driven] == NO_UNIT] *= 0.5
    if given.ndim == 0 or isinstance(joints, str):
        deviations[columns_without_samples(path)] = 0.0
    return np.tile(deviations**2, through.count)


def carried_by_knots(samples: PathSamples, by_knots: Array, noise: Array) -> Array:
    """Covariance (k, k) of numbers with derivatives (k, knots n) by a path at its knots.

    By noise of its samples, and by the bias of smoothing: one unknown of variance one, times its estimate.
    """
    by_bias = by_knots @ samples.bias
    return sum((carried(rule(by_knots), noise) for rule in samples.rules), np.outer(by_bias, by_bias))


def deviations_argument(given: Array, name: str) -> Array:
    """Standard deviations; ShapeError where one is negative."""
    if np.any(given < 0.0):
        raise ShapeError(f"{name}: a standard deviation is not negative, got {value_text(given)}")
    return given


def covariance_argument(given: Array, name: str, numbers: int) -> Array:
    """A covariance of so many numbers, symmetric; ShapeError where it is none."""
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
