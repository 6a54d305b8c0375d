"""Places of particles as a function of CasADi, with derivatives that CasADi finds."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ...arrays import Array, finite_array
from ...errors import ShapeError
from ...letters import value_text


def is_casadi_function(value: object) -> bool:
    """True for a `casadi.Function`; CasADi is not imported to find out."""
    kind = type(value)
    return kind.__name__ == "Function" and kind.__module__.partition(".")[0] == "casadi"


class CasadiPositions:
    """Places of `particles` particles, shape (n) -> (m, 3), or (m, 2) in the plane z = 0."""

    def __init__(self, function: Any, n_shape: int, particles: int) -> None:
        sizes = [tuple(function.size_in(k)) for k in range(function.n_in())]
        given = [tuple(function.size_out(k)) for k in range(function.n_out())]
        if sizes != [(n_shape, 1)] or given not in ([(particles, 2)], [(particles, 3)]):
            raise ShapeError(
                f"places: a casadi.Function of one shape ({n_shape}, 1) that gives ({particles}, 3) or "
                f"({particles}, 2) is needed, got one of {sizes} that gives {given}"
            )
        self._function, self._flat = function, given == [(particles, 2)]
        self._sizes = n_shape, particles

    def __call__(self, rows: Array) -> tuple[Array, Array]:
        """Places (N, m, 3) and their derivatives (N, n, m, 3)."""
        n, m = self._sizes
        values, slopes = (self._evaluated(k, rows) for k in (0, 1))
        return self._in_space(values.reshape(-1, m, self._width)), self._in_space(
            slopes.reshape(-1, m, self._width, n).transpose(0, 3, 1, 2)
        )

    def bends(self, rows: Array) -> Array:
        """Second derivatives: (N, n) -> (N, n, n, m, 3)."""
        n, m = self._sizes
        return self._in_space(self._evaluated(2, rows).reshape(-1, m, self._width, n, n).transpose(0, 3, 4, 1, 2))

    @property
    def _width(self) -> int:
        return 2 if self._flat else 3

    @cached_property
    def _derivatives(self) -> list[Any]:
        """Places, first and second derivatives: each a function of (n) that gives a row in the order of C."""
        import casadi

        shape = casadi.MX.sym("shape", self._sizes[0])
        entries = casadi.vec(self._function(shape).T)
        functions = [casadi.Function("places", [shape], [entries])]
        for order in (1, 2):
            entries = casadi.vec(casadi.jacobian(entries, shape).T)
            functions.append(casadi.Function(f"derivatives_{order}", [shape], [entries]))
        return functions

    def _evaluated(self, order: int, rows: Array) -> Array:
        if not len(rows):
            return np.zeros((0, self._derivatives[order].size1_out(0)))
        try:
            values = self._derivatives[order].map(len(rows))(rows.T)
        except RuntimeError as error:
            where = value_text(rows[0] if len(rows) == 1 else rows)
            fault = str(error).splitlines()[-1]
            raise ShapeError(f"places: CasADi cannot evaluate the function at {where}: {fault}") from None
        return finite_array(np.asarray(values, dtype=np.float64).T, "places")

    def _in_space(self, values: Array) -> Array:
        if not self._flat:
            return values
        return np.concatenate([values, np.zeros((*values.shape[:-1], 1))], axis=-1)
