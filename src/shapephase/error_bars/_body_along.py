"""How a body's angular momentum answers, along a path, to this path and to the inertias of the body's links."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Array
from ..body.body import Body
from ..body.couplings.coordinate_map import check_smooth
from ..body.inertial_regressor import LinkMotions, by_link_parameters, link_motions
from ..body.momentum_gradients import by_shape_and_rate
from ..integrator.fast import engine, gradients
from ..shape_space.path_samples import PathSamples


@dataclass(frozen=True, eq=False)
class BodyAlong:
    """A body at N shapes and rates of a path; in machine code where that is used.

    Attributes
    ----------
    body : whose they are
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
        momenta : (N, S, 3) I w + J rate, which a unit of the duration's logarithm takes off where a path is closed

        Returns
        -------
        (S r, m)
        """
        chain, closing = self.body.chain, samples.is_closing(self.times)
        check_smooth(chain.follows, "derivatives by a path need", kinks_only=True)
        if engine.is_ready() and chain.follows.is_linear:
            basis = samples.basis(self.times)
            sums = gradients.momentum_gradients(
                chain.rows, self.shapes, self.rates, spins, rows, basis.pieces, basis.powers, basis.slopes, basis.total
            )
            found = samples.by_knots_of(sums if chain.follows.is_identity else sums @ chain.matrix)
        else:
            parts = by_shape_and_rate(chain, self._links, self.shapes, self.rates, spins, rows)
            found = samples.by_knots(self.times, *parts)
        if closing.any():
            by_duration = -np.einsum("nsrc,nsc->sr", rows[closing], momenta[closing]).ravel()
            found += by_duration[:, None] * samples.seconds_by_knots()
        return found

    def by_inertias(self, spins: Array, rows: Array) -> Array:
        """The same by mass, first moment and inertia of each frame: (S r, 10 (k + 1))."""
        chain = self.body.chain
        if not engine.is_ready() or not chain.has_rows:
            each = [by_link_parameters(self._links, rows[:, k], spins[:, k]) for k in range(rows.shape[1])]
            return np.concatenate(each)
        found = gradients.inertial_sums(chain.rows, self.shapes, self.rates, spins, rows)
        return chain.rows.in_chain_axes(found).reshape(len(found), -1)

    @cached_property
    def _links(self) -> LinkMotions:
        return link_motions(self.body.chain, self.shapes, self.rates)
