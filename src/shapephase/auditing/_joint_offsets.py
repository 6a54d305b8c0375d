"""The hypotheses that one joint is read with a constant offset, as an encoder has that was set to zero elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..shape_space.ball_columns import ball_columns
from ._observation import Observation
from ._residuals import Residuals
from .hypothesis import FittedValue, Hypothesis

_NUDGE = 1e-6  # [rad or m] by which a joint is moved for the derivative of the centre of mass
_STEPS = 6  # of Gauss and Newton; each gains about two digits
_CANDIDATES = 4  # hypotheses that leave the least are fitted to the end, the others to first order
_UNSEEN = 1e9  # [rad or m] bar of an offset that moves nothing
_HALF_TURN = np.pi  # [rad] no joint that turns is off by more
_FARTHEST = 3.0  # radii of gyration of the whole body: no joint that slides is off by more


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
    freedom = sum(fit.freedom for fit in fits)
    strengths = np.linalg.norm(columns, axis=0)
    seen = strengths * _UNSEEN > 1.0
    values = np.where(seen, vector @ columns / np.where(seen, strengths, 1.0) ** 2, 0.0)
    squares = vector @ vector - (values * strengths) ** 2
    offsets = []
    for rank, place in enumerate(np.argsort(squares, kind="stable").tolist()):
        joint, value, left = int(joints[place]), float(values[place]), None
        unit = body.joint_units[joint]
        most = _HALF_TURN if unit == "rad" else _FARTHEST * fits[0].seen.extent
        if not seen[place] or abs(value) > most:
            continue
        square = float(squares[place])
        if rank < _CANDIDATES:
            value, left = _to_the_end(body, joint, value, columns[:, place], fits, most)
            square = float(left @ left)
        fitted = FittedValue(value=value, bar=float(1.0 / strengths[place]), unit=unit)
        offsets.append(
            Hypothesis(
                name=f"offset of joint {body.joint_names[joint]}",
                kind="offset",
                square=square,
                left_over=float(np.sqrt(max(square, 0.0) / freedom)),
                parameters=1,
                values={"offset": fitted},
                remark=f"read {np.degrees(value):+.3g} degrees off" if unit == "rad" else "",
                residuals=left,
            )
        )
    return offsets


def _by_shapes(body: Body, fit: Residuals) -> Array:
    """Derivatives of the residuals by each coordinate of the shape: (M, n)."""
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
    """Gauss and Newton with the whole dependence: the offset, `most` of it, and what it leaves."""
    best = (0.0, np.concatenate([fit.vector for fit in fits]))
    for _ in range(_STEPS):
        left = np.concatenate([fit.of(_read_with(body, fit.seen, joint, value)) for fit in fits])
        if left @ left >= best[1] @ best[1]:
            break
        best = (value, left)
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
