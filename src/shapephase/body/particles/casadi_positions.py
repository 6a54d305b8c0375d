"""Places of particles as functions of CasADi: derivatives that CasADi finds, and inertia and momentum in symbols."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from ...arrays import Array, finite_array
from ...errors import ShapeError
from ...letters import value_text

_ORDERS = 3  # derivatives of places in the second derivatives of a connection


def is_casadi_function(value: object) -> bool:
    """True for a `casadi.Function`; CasADi is not imported to find out."""
    kind = type(value)
    return kind.__name__ == "Function" and kind.__module__.partition(".")[0] == "casadi"


def symbol_kind(function: Any) -> Any:
    """CasADi's class of symbols that a function takes: SX, or MX for one with root finders or external parts."""
    import casadi

    return casadi.SX if function.is_a("SXFunction") else casadi.MX


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
        self._function, self._width = function, given[0][1]
        self._sizes = n_shape, particles

    def __call__(self, rows: Array) -> tuple[Array, Array]:
        """Places (N, m, 3) and their derivatives (N, n, m, 3)."""
        n, m = self._sizes
        values, slopes = (self._evaluated(k, rows) for k in (0, 1))
        return values.reshape(-1, m, 3), slopes.reshape(-1, m, 3, n).transpose(0, 3, 1, 2)

    def bends(self, rows: Array) -> Array:
        """Second derivatives: (N, n) -> (N, n, n, m, 3)."""
        n, m = self._sizes
        return self._evaluated(2, rows).reshape(-1, m, 3, n, n).transpose(0, 3, 4, 1, 2)

    @cached_property
    def symbolic(self) -> Any:
        """Function of one shape (n) that gives places (m, 3), in scalar operations where CasADi has them."""
        import casadi

        shape = casadi.MX.sym("shape", self._sizes[0])
        places = self._function(shape)
        whole = casadi.Function(
            "places", [shape], [casadi.horzcat(places, casadi.MX(places.shape[0], 3 - self._width))]
        )
        try:
            return whole.expand()
        except RuntimeError:  # of root finders and external functions
            return whole

    @cached_property
    def _derivatives(self) -> list[Any]:
        """Places, first and second derivatives: each a function of (n) that gives a row in the order of C."""
        import casadi

        places = self.symbolic
        shape = symbol_kind(places).sym("shape", self._sizes[0])
        entries = casadi.vec(places(shape).T)
        functions = [casadi.Function("places", [shape], [casadi.densify(entries)])]
        for order in (1, 2):
            entries = casadi.vec(casadi.jacobian(entries, shape).T)
            functions.append(casadi.Function(f"derivatives_{order}", [shape], [casadi.densify(entries)]))
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


def particle_maps(places: Any, masses: Array) -> Any:
    """Function of one shape (n,) that gives I (3, 3), J (3, n), mass matrix (n, n) and centre of mass (3,).

    places : function of one shape that gives (m, 3) [m], or its entries row by row
    masses : (m,) [kg]
    """
    import casadi

    n, m = places.numel_in(0), len(masses)
    kind = symbol_kind(places)
    shape = kind.sym("shape", n)
    at = casadi.reshape(places(shape), 3, m) if places.size2_out(0) == 1 else places(shape).T
    centring = casadi.DM(np.eye(m) - masses[:, None] / masses.sum())
    centre, at = at @ casadi.DM(masses / masses.sum()), at @ centring
    slopes = casadi.reshape(casadi.jacobian(casadi.vec(at), shape), 3, m * n)
    weighted = at @ casadi.diag(casadi.DM(masses))
    moment = weighted @ at.T
    turning = []
    for column in range(n):
        product = weighted @ slopes[:, m * column : m * (column + 1)].T
        turning.append(casadi.vertcat(*(product[a, b] - product[b, a] for a, b in ((1, 2), (2, 0), (0, 1)))))
    columns = casadi.reshape(slopes, 3 * m, n)
    energy = columns.T @ (casadi.repmat(casadi.DM(np.repeat(masses, 3)), 1, n) * columns)
    results = [casadi.trace(moment) * kind.eye(3) - moment, casadi.horzcat(*turning), energy, centre]
    return casadi.Function("maps", [shape], [casadi.densify(casadi.cse(result)) for result in results])


def derivatives_function(derivatives: Callable[[int, Array], Array], n_shape: int, size: int) -> Any:
    """Function of one shape (n,) that gives `size` numbers, with the first three derivatives of a Python function.

    derivatives : order k and a shape (1, n) -> derivatives of the numbers, (n, ..., n, size)

    The result has to be kept as long as functions made from it, which do not keep it.
    """
    import casadi

    rows = [size * n_shape ** max(order - 1, 0) for order in range(_ORDERS + 1)]

    class Derivative(casadi.Callback):
        def __init__(self, order: int) -> None:
            super().__init__()
            self.order, self.onward = order, Derivative(order + 1) if order < _ORDERS else self
            self.construct(f"places_{order}")

        def get_sparsity_in(self, i: int) -> Any:  # noqa: ARG002 (one input)
            return casadi.Sparsity.dense(n_shape, 1)

        def get_sparsity_out(self, i: int) -> Any:  # noqa: ARG002 (one output)
            return casadi.Sparsity.dense(rows[self.order], n_shape if self.order else 1)

        def eval(self, given: Any) -> list[Any]:
            values = derivatives(self.order, np.array(given[0]).reshape(1, n_shape))
            # Columns count the last derivative, rows the entries of the derivative before it, as CasADi stores them.
            return [casadi.DM(values.reshape(n_shape if self.order else 1, -1).T)]

        def has_jacobian(self) -> bool:
            return self.order < _ORDERS

        def get_jacobian(self, name: str, inames: Any, onames: Any, opts: Any) -> Any:
            shape, value = casadi.MX.sym("shape", n_shape), casadi.MX.sym("value", self.sparsity_out(0))
            return casadi.Function(name, [shape, value], [self.onward(shape)], inames, onames, opts)

    return Derivative(0)
