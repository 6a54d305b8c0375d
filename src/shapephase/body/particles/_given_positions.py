"""Places of particles by a Python function: checked, compared with its derivatives, and with higher derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...arrays import Array, finite_array
from ...errors import ShapeError
from ...letters import value_text
from ..engines.chain import WEIGHTS
from .casadi_positions import derivatives_function

Places = Callable[[Array], tuple[ArrayLike, ArrayLike]]
_STEP = 0.02  # of differences for second derivatives: errors of 1e-13 where places swing once in a radian
_BROAD_STEP = 1e-4  # of differences that are compared with given derivatives
_NOT_DERIVATIVES = 1e-5  # of the places' size: a thousand times what these differences leave of true derivatives


@dataclass(frozen=True, eq=False)
class GivenPositions:
    """A user's places and derivatives, of the shapes they must have, and compared with each other."""

    function: Places
    n_shape: int
    particles: int

    def __call__(self, rows: Array) -> tuple[Array, Array]:
        """Places (N, m, 3) and their derivatives (N, n, m, 3)."""
        places, slopes = self._returned(rows)
        if len(rows):
            self._compare(rows[:1], places[:1], slopes[:1])
        return places, slopes

    def bends(self, rows: Array) -> Array:
        """Second derivatives, by differences: (N, n) -> (N, n, n, m, 3)."""
        return self._differences(rows, lambda at: self._returned(at)[1])

    def __getstate__(self) -> dict[str, Any]:
        """State for pickle, without functions of CasADi, which are made anew."""
        return {"function": self.function, "n_shape": self.n_shape, "particles": self.particles}

    @cached_property
    def symbolic(self) -> Any:
        """Function of CasADi of one shape (n) that gives the entries of the places, row by row: (3 m, 1)."""

        def derivatives(order: int, row: Array) -> Array:
            if order < 2:
                return self._returned(row)[order]
            return self.bends(row) if order == 2 else self._differences(row, self.bends)

        return derivatives_function(derivatives, self.n_shape, 3 * self.particles)

    def _differences(self, rows: Array, function: Callable[[Array], Array]) -> Array:
        """Derivatives of a function of shapes by each parameter, the new axis first: (N, n) -> (N, n, ...)."""
        count = self.n_shape
        moved = _STEP * np.arange(1, len(WEIGHTS) + 1)[:, None, None] * np.eye(count)
        at = rows[:, None, None, None] + np.stack([moved, -moved], axis=0)
        values = function(at.reshape(-1, count))
        values = values.reshape(*at.shape[:-1], *values.shape[1:])
        return np.einsum("d,ndk...->nk...", np.array(WEIGHTS) / _STEP, values[:, 0] - values[:, 1])

    def _returned(self, rows: Array) -> tuple[Array, Array]:
        pair = self.function(rows)
        if not isinstance(pair, tuple | list) or len(pair) != 2:
            raise ShapeError(
                f"places: a pair, places and their derivatives, must be returned for shapes, got {value_text(pair)}"
            )
        places, slopes = finite_array(pair[0], "places", unit="m"), finite_array(pair[1], "derivatives of places")
        expected = (len(rows), self.particles, 3), (len(rows), rows.shape[1], self.particles, 3)
        if (places.shape, slopes.shape) != expected:
            raise ShapeError(
                f"places: for shapes {rows.shape} places {expected[0]} and derivatives {expected[1]} are needed, got "
                f"{places.shape} and {slopes.shape}"
            )
        return places, slopes

    def _compare(self, row: Array, places: Array, slopes: Array) -> None:
        step = _BROAD_STEP * np.eye(row.shape[1])
        ahead, behind = (self._returned(row + sign * step)[0] for sign in (1.0, -1.0))
        wrong = np.abs((ahead - behind) / (2.0 * _BROAD_STEP) - slopes[0]).max(axis=(1, 2), initial=0.0)
        size = 1.0 + np.abs(places).max(initial=0.0) + np.abs(slopes).max(initial=0.0)
        if wrong.max(initial=0.0) > _NOT_DERIVATIVES * size:
            worst = int(np.argmax(wrong))
            raise ShapeError(
                f"places: the derivatives by parameter {worst} are not those of the places: at {value_text(row[0])} "
                f"they are off by {wrong[worst]:.3g}"
            )
