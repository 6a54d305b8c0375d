"""The hypotheses that one joint is read with a constant offset, as an encoder has that was set to zero elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..shape_space.interpolation import ball_columns
from ._observation import Observation
from ._residuals import Residuals, fitted_hypothesis, leftover
from .hypothesis import FittedValue, Hypothesis

_NUDGE = 1e-6  # [rad or m] by which a joint is moved for the derivative of the centre of mass
_STEPS = 6  # of Gauss and Newton; each gains about two digits
_CANDIDATES = 4  # hypotheses that leave the least are fitted to the end, the others to first order
_FARTHEST = 3.0  # radii of gyration: no slide is set farther off


def joint_offsets(body: Body, fits: Sequence[Residuals]) -> list[Hypothesis]:
    """One hypothesis for each joint of one coordinate, fitted to all runs together."""
    joints = np.arange(body.n_shape)
    joints = np.setdiff1d(
        joints, np.concatenate([joints[:0], *(joints[ball] for ball in ball_columns(body.joint_names))])
    )
    if not len(joints):
        return []
    columns = np.vstack([_by_shapes(body, fit) for fit in fits])[:, joints]
    vector = np.concatenate([fit.vector for fit in fits])
    strengths = np.linalg.norm(columns, axis=0)
    turning = np.array([body.joint_units[joint] == "rad" for joint in joints])
    most = np.where(turning, np.pi, _FARTHEST * fits[0].seen.extent)
    values = vector @ columns / np.maximum(strengths, 1e-150) ** 2
    tried = np.flatnonzero(np.abs(values) <= most).tolist()
    lefts = {place: vector - values[place] * columns[:, place] for place in tried}
    offsets = []
    for rank, place in enumerate(sorted(tried, key=lambda place: leftover(fits, lefts[place]).size)):
        joint, value, left = int(joints[place]), float(values[place]), lefts[place]
        if rank < _CANDIDATES:
            value, left = _to_the_end(body, joint, value, columns[:, place], fits, float(most[place]))
        unit = body.joint_units[joint]
        fitted = FittedValue(value=value, bar=float(1.0 / strengths[place]), unit=unit)
        offsets.append(
            fitted_hypothesis(
                f"offset of joint {body.joint_names[joint]}",
                "offset",
                leftover(fits, left),
                parameters=1,
                values={"offset": fitted},
                remark=f"read {np.degrees(value):+.3g} degrees off" if unit == "rad" else "",
            )
        )
    return offsets


def _by_shapes(body: Body, fit: Residuals) -> Array:
    """What each coordinate of the shape adds to the residuals: (M, n)."""
    seen = fit.seen
    shapes = seen.trajectory.shapes
    momentum = body.angular_momentum_gradient(shapes, seen.joint_rates, seen.rate)
    nudges = _NUDGE * np.eye(body.n_shape)
    ahead, behind = (body.centre_of_mass(shapes[:, None] + sign * nudges) for sign in (1.0, -1.0))
    centre = (ahead - behind) / (2.0 * _NUDGE)
    return fit.columns(*(seen.attitude @ np.swapaxes(change, 1, 2) for change in (momentum, centre)))


def _to_the_end(
    body: Body, joint: int, value: float, column: Array, fits: Sequence[Residuals], most: float
) -> tuple[float, Array]:
    """Gauss and Newton with the whole dependence: the offset, at most `most`, and what it leaves."""
    best, least = (0.0, np.concatenate([fit.vector for fit in fits])), float(sum(fit.square for fit in fits))
    for _ in range(_STEPS):
        left = np.concatenate([fit.of(_read_with(body, fit.seen, joint, value)) for fit in fits])
        square = float(left @ left)
        if square >= least:
            break
        best, least = (value, left), square
        value = float(np.clip(value + column @ left / (column @ column), -most, most))
    return best


def _read_with(body: Body, seen: Observation, joint: int, offset: float) -> Observation:
    """Samples with an offset taken off one joint."""
    shapes = seen.trajectory.shapes.copy()
    shapes[:, joint] -= offset
    inertia, internal = body.sample(shapes, seen.joint_rates)
    momentum = so3.apply(seen.attitude, so3.apply(inertia, seen.rate) + internal)
    if seen.centre is None or seen.trajectory.position is None:
        return replace(seen, momentum=momentum)
    centre = seen.trajectory.position + so3.apply(seen.attitude, body.centre_of_mass(shapes))
    return replace(seen, momentum=momentum, centre=centre)
