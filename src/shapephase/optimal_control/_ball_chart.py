"""Three coordinates for each ball joint of a plan: its turn from the start, axis times tangent of half the angle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..body.body import Body
from ..body.couplings.ball_joints import BallJoint, vector_part
from ..body.particles.point_masses import ParticleBody
from ..errors import TrajectoryError

_FARTHEST = np.tan(np.radians(80.0))  # 160 degrees from the start about an axis; a half turn is infinitely far
_NO_TURN = 1e-9  # cosine of half the turn to an end that is half a turn away


@dataclass(frozen=True, eq=False)
class BallChart:
    """Chart of ball joints about the start of a plan: three coordinates s for four, quaternion p = start (s, 1).

    The shape is affine in s, and every turn but those of half a turn has one s.

    starts : each ball joint, the index of its first number among the coordinates, and its quaternion at the start
    """

    starts: tuple[tuple[BallJoint, int, Array], ...]

    @classmethod
    def of(cls, body: Body | ParticleBody, start: Array, leaders: Sequence[int]) -> BallChart | None:
        """Return the chart for the coordinates of some joints (m,), from a shape (n,); None if no ball joint moves."""
        starts = [
            (ball, list(leaders).index(ball.column), ball.quaternions(start[None])[0])
            for ball in body.follows.balls
            if ball.column in leaders
        ]
        return cls(starts=tuple(starts)) if starts else None

    def shapes(self, coupling: Array, offset: Array) -> tuple[Array, Array]:
        """Return coupling and offset for the new coordinates: (n, m), (n,) -> (n, m - balls), (n,)."""
        coupling, offset = coupling.copy(), offset.copy()
        for _, first, quaternion in self.starts:
            # The rows include joints that mirror it.
            four = coupling[:, first : first + 4]
            offset += four @ quaternion
            coupling[:, first : first + 3] = four @ vector_part(quaternion[None])[0].T
        return np.delete(coupling, self._left_out, axis=1), offset

    def coordinates(self, values: Array, name: str) -> Array:
        """Return the new coordinates of a shape called `name`: (m,) -> (m - balls,). Raises TrajectoryError."""
        charted = values.copy()
        for ball, first, quaternion in self.starts:
            four = values[first : first + 4]
            along = float(quaternion @ four)
            if not abs(along) > _NO_TURN * float(np.linalg.norm(four)):
                raise TrajectoryError(
                    f"{name}: ball joint {ball.name} is half a turn from its start, which a plan does not reach; go "
                    "there in two plans"
                )
            charted[first : first + 3] = vector_part(quaternion[None])[0] @ four / along
        return np.delete(charted, self._left_out)

    def limits(self, lower: Array, upper: Array, rates: Array) -> tuple[Array, Array, Array]:
        """Return limits of the new coordinates; ball joints have none of their own."""
        lower, upper = lower.copy(), upper.copy()
        for _, first, _ in self.starts:
            lower[first : first + 3], upper[first : first + 3] = -_FARTHEST, _FARTHEST
        dropped = self._left_out
        return np.delete(lower, dropped), np.delete(upper, dropped), np.delete(rates, dropped)

    @property
    def _left_out(self) -> list[int]:
        return [first + 3 for _, first, _ in self.starts]
