"""Derivatives of a fit of momentum and start to recorded attitudes, by the path and by the body's inertias.

A change turns the attitude at each recorded time by eta(t_k) of `_along_motion`. The recording stays, so that the fit
moves like one to attitudes turned by -eta(t_k).
"""

from __future__ import annotations

import numpy as np

from .. import so3
from ..arrays import Array
from ..reconstruction.reconstruction import Motion
from ..shape_space.path_samples import path_samples
from ._along_motion import AlongMotion, BodyAlong, along_motion, responses
from .result_derivatives import described_by


def fit_by_knots(motion: Motion, times: Array, by_attitudes: Array) -> Array:
    """Derivative of the fit by the path at its knots: (6, knots n); `by_attitudes` is that of `RecordedMomentum`."""
    body, path = described_by(motion)
    along = along_motion(motion, path, times)
    rows = _by_added_momentum(motion, along, times, by_attitudes)
    samples, body_along = path_samples(path), BodyAlong(body, along.times, along.shapes, along.rates)
    momenta = motion.momentum @ along.attitudes
    return body_along.by_knots(samples, along.spins[:, None], rows[:, None], momenta[:, None])


def fit_by_inertias(motion: Motion, times: Array, by_attitudes: Array) -> Array:
    """Derivative of the fit by the ten parameters of each frame, in the order of `by_inertias`: (6, 10 (k + 1))."""
    body, path = described_by(motion)
    along = along_motion(motion, path, times)
    rows = _by_added_momentum(motion, along, times, by_attitudes)
    return BodyAlong(body, along.times, along.shapes, along.rates).by_inertias(along.spins[:, None], rows[:, None])


def _by_added_momentum(motion: Motion, along: AlongMotion, times: Array, by_attitudes: Array) -> Array:
    """Change of the fit by a unit of internal angular momentum at each node, base axes: (M, 6, 3)."""
    # Turns at the recorded times from the turn at the end by an equal change.
    from_end = np.linalg.inv(along.adjoint_at_start.T)
    at_times = responses(motion, times)[:, :, :3] @ from_end
    by_turn = np.moveaxis(by_attitudes.reshape(len(by_attitudes), -1, 3), 1, 0)
    by_end = by_turn @ so3.transpose(motion.attitude(times)) @ at_times
    # A change at a node turns only the attitudes recorded later.
    later = np.concatenate([np.cumsum(by_end[::-1], axis=0)[::-1], np.zeros((1, *by_end.shape[1:]))])
    carried = so3.transpose(along.adjoint) @ along.attitudes @ along.inverse
    return along.weights[:, None, None] * (later[np.searchsorted(times, along.times)] @ carried)
