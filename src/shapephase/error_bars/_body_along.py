"""Derivatives of a body's angular momentum along a path, by this path and by the inertias of the body's links."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Array
from ..body.body import Body
from ..body.couplings.coordinate_map import check_smooth
from ..body.inertial_regressor import LinkMotions, by_link_parameters, link_motions
from ..body.momentum_gradients import by_independent, by_shape_and_rate
from ..integrator import link_tree, machine_code
from ..shape_space.path_samples import PathSamples


@dataclass(frozen=True, eq=False)
class BodyAlong:
    """A body at N shapes and rates of a path.

    Attributes
    ----------
    body : the body of the path
    times : (N,) [s]
    shapes, rates : (N, n)
    """

    body: Body
    times: Array
    shapes: Array
    rates: Array

    def by_knots(self, samples: PathSamples, spins: Array, rows: Array, momenta: Array) -> Array:
        """Sums of row . d(I w + J rate), w staying, by the path at its knots.

        Parameters
        ----------
        spins, rows : (N, S, 3), (N, S, r, 3)
        momenta : (N, S, 3) I w + J rate, minus the derivative by the duration's logarithm where a path is closed

        Returns
        -------
        (S r, m)
        """
        chain, closing = self.body.chain, samples.is_closing(self.times)
        check_smooth(chain.follows, "derivatives by a path need", kinks_only=True)
        if self._has_kernels:
            of_all = link_tree.momentum_gradients(chain.rows, self.shapes, self.rates, spins, rows)
            parts = by_independent(chain, *of_all, self.shapes, self.rates)
        else:
            parts = by_shape_and_rate(chain, self._links, self.shapes, self.rates, spins, rows)
        by_knots = samples.by_knots(self.times, *parts)
        if closing.any():
            by_duration = -np.einsum("nsrc,nsc->sr", rows[closing], momenta[closing]).ravel()
            by_knots += by_duration[:, None] * samples.seconds_by_knots()
        return by_knots

    def by_inertias(self, spins: Array, rows: Array) -> Array:
        """Derivatives by mass, first moment and inertia of each frame: (S r, 10 (k + 1))."""
        chain = self.body.chain
        if not self._has_kernels:
            pairs = zip(np.moveaxis(rows, 1, 0), np.moveaxis(spins, 1, 0), strict=True)
            return np.concatenate([by_link_parameters(self._links, row, spin) for row, spin in pairs])
        sums = link_tree.inertial_sums(chain.rows, self.shapes, self.rates, spins, rows)
        return chain.rows.in_chain_axes(sums).reshape(len(sums), -1)

    @property
    def _has_kernels(self) -> bool:
        """True where kernels serve: bodies with ball joints have no rows, and interpreted kernels are slower."""
        return self.body.chain.has_rows and machine_code.is_used()

    @cached_property
    def _links(self) -> LinkMotions:
        return link_motions(self.body.chain, self.shapes, self.rates)
