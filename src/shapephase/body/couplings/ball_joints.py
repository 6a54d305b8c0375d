"""Ball joints: four numbers of a shape that give a turn, and the three rates that they are of.

The four numbers p = (x, y, z, w) of a ball joint may have any length: the joint's turn is that of the quaternion p/|p|.
So the shape stays a point of a vector space, and its curves need no care; along p itself nothing turns. The rates
of the joint are the angular velocity in axes of the child, W(p) dp/dt with W(p) dp = 2 Vec(p* dp)/|p|^2.

Around any shape the joint is three hinges about x, y and z at angle zero, behind a turn of their own: there, far from
where their axes fall together, the angles are coordinates, and their rates are those of the ball.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ... import so3
from ...arrays import Array
from ...errors import ShapeError

COORDINATES = ("x", "y", "z", "w")  # endings of the names of a ball joint's four numbers
RATES = ("wx", "wy", "wz")  # endings of the names of its rates


class BallJoint(NamedTuple):
    """Place of a ball joint among rates and coordinates.

    name : of the joint
    row : of the first of its three rates among those of all joints
    column : of the first of its four numbers in the shape
    """

    name: str
    row: int
    column: int

    @property
    def names(self) -> list[str]:
        """Names of its four numbers."""
        return coordinate_names(self.name)

    @property
    def rows(self) -> slice:
        """Its three rates."""
        return slice(self.row, self.row + len(RATES))

    @property
    def columns(self) -> slice:
        """Its four numbers."""
        return slice(self.column, self.column + len(COORDINATES))

    def quaternions(self, shapes: Array) -> Array:
        """Unit quaternions: (N, n) -> (N, 4)."""
        numbers = shapes[:, self.columns]
        lengths = np.sqrt((numbers * numbers).sum(axis=1))
        if not lengths.all():
            raise ShapeError(
                f"ball joint {self.name}: its four numbers x, y, z, w are all zero, which is no turn; (0, 0, 0, 1) is "
                "its neutral attitude"
            )
        return numbers / lengths[:, None]

    def turns(self, shapes: Array) -> Array:
        """Rotations of the child in axes of the parent: (N, n) -> (N, 3, 3)."""
        return so3.matrix_from_quat(self.quaternions(shapes))

    def slopes(self, shapes: Array) -> Array:
        """W, the rates by the derivatives of the four numbers: (N, n) -> (N, 3, 4)."""
        numbers = shapes[:, self.columns]
        return 2.0 * vector_part(numbers) / (numbers * numbers).sum(axis=1)[:, None, None]

    def rates(self, shapes: Array, derivatives: Array) -> Array:
        """Angular velocity in axes of the child: (N, n), (N, n) -> (N, 3) [rad/s]."""
        return so3.apply(self.slopes(shapes), derivatives[:, self.columns])

    def slope_rates(self, shapes: Array, derivatives: Array) -> Array:
        """Rate of W along a motion: (N, n), (N, n) -> (N, 3, 4)."""
        swing, stretch = self._changes(shapes, derivatives)
        return swing - stretch[:, None, None] * self.slopes(shapes)

    def rates_by_shape(self, shapes: Array, derivatives: Array) -> Array:
        """Derivatives of the rates by the four numbers, whose own derivatives stay: (N, n), (N, n) -> (N, 3, 4)."""
        numbers = shapes[:, self.columns]
        swing, _ = self._changes(shapes, derivatives)
        rates = self.rates(shapes, derivatives)
        lengths = (numbers * numbers).sum(axis=1)[:, None, None]
        return -swing - 2.0 * rates[:, :, None] * numbers[:, None, :] / lengths

    def hinge_slope_rates(self, shapes: Array, derivatives: Array) -> Array:
        """Rate, along a motion, of the derivatives of the three hinges' angles by the four numbers, which are at the
        same time those of their rates: (N, n), (N, n) -> (N, 3, 4)."""
        slopes, (x, y, z) = self.slopes(shapes), self.rates(shapes, derivatives).T[:, :, None]
        even = 0.5 * (self.slope_rates(shapes, derivatives) + self.rates_by_shape(shapes, derivatives))
        by_x, by_y, by_z = np.moveaxis(slopes, 1, 0)
        # The vector part of three half turns one after the other: (yz, -xz, xy)/4.
        bend = np.stack([y * by_z + z * by_y, -(x * by_z + z * by_x), x * by_y + y * by_x], axis=1)
        return even - 0.5 * bend

    def frame(self, shapes: Array) -> Array:
        """Derivatives of the four numbers that give the rates and leave their length: (N, n) -> (N, 4, 3)."""
        return 0.5 * np.swapaxes(vector_part(shapes[:, self.columns]), -1, -2)

    def _changes(self, shapes: Array, derivatives: Array) -> tuple[Array, Array]:
        """2 Vec(p'* dp)/|p|^2 as a matrix, and the rate of log |p|^2."""
        numbers, slopes = shapes[:, self.columns], derivatives[:, self.columns]
        lengths = (numbers * numbers).sum(axis=1)
        return 2.0 * vector_part(slopes) / lengths[:, None, None], 2.0 * (numbers * slopes).sum(axis=1) / lengths


def vector_part(numbers: Array) -> Array:
    """The matrix of dp -> Vec(p* dp): (N, 4) -> (N, 3, 4)."""
    x, y, z, w = numbers.T
    rows = [[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z]]
    return np.moveaxis(np.array(rows), -1, 0)


def coordinate_names(ball: str) -> list[str]:
    """Names of the four numbers of a ball joint."""
    return [f"{ball}.{part}" for part in COORDINATES]


def rate_names(ball: str) -> list[str]:
    """Names of the three rates of a ball joint."""
    return [f"{ball}.{part}" for part in RATES]
