r"""Inertia, momentum and energy of a tree of links with their first and second derivatives, in time linear in joints.

For all links together, about the base origin in base axes, the program needs sixteen numbers

    z = (first moment h, inertia J, angular momentum n and momentum p of the joint motion, twice its energy k),

with the base held. CasADi's own second derivatives of them are expressions of some millions of operations for a human.
But a joint moves all that hangs on it as one rigid body, along its screw s: so derivatives by two joints, of which the
first carries the second, are products of a vector of the one and a vector of the other. With s x twists, s x* forces,
V the twist of a joint's frame by the joint motion, I and P inertia and momentum of all that it carries, and

    S = c_h h + C : J + eta (n, p) + c_k k

any sum of the sixteen,

    d2S/dr_i dr_j = h_j' alpha_i + J_j' : B_i - b_i g_j + a_i e_j,
    d2S/dr_i du_j = - f_j t_i,    d2S/du_i dr_j = s_i g_j,    d2S/du_i du_j = 2 c_k s_i f_j,

    a = s x eta,   b = s x V,   t = a + 2 c_k b,   f = I s,   e = I b - s x* P,   g = s x* (I eta + 2 c_k P) - I t,

where h', J' are the derivatives of first moment and inertia along s, and alpha, B those of their factors.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays import Array
from ...body.body import Body
from ...body.joint_chain import JointChain
from ...body.particles.casadi_positions import symbol_kind
from ...body.particles.point_masses import ParticleBody
from ..symbolic import joint_frames, symbolic_body
from .spatial import Twist, gathered, links_of, passed_on, screws_of

SIZE = 16  # numbers in z
_INERTIA_ENTRIES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def node_mechanics(body: Body | ParticleBody) -> tuple[Any, Any]:
    """CasADi functions of coordinates and rates of all k joints of a body, and the shape its ball joints are about.

    Returns
    -------
    values : coordinates (k,), rates (k,), shape (n,) -> z (16,), its derivatives by both, (16, k) each
    second : coordinates, rates, shape, factors (16,) -> second derivatives of their product with z: by coordinates
        (k, k), by rates and coordinates (k, k), by rates (k, k)

    Source: composite rigid bodies (Featherstone, Rigid Body Dynamics Algorithms, section 6.2).
    """
    return _of_tree(body.chain) if isinstance(body, Body) else _of_particles(body)


def _of_particles(body: ParticleBody) -> tuple[Any, Any]:
    """Functions of particles, whose places CasADi differentiates; they are counted from the centre of mass."""
    import casadi

    maps = symbolic_body(body).maps
    kind, n = symbol_kind(maps), body.n_shape
    place, rate, shape, factors = (kind.sym(*what) for what in (("q", n), ("u", n), ("r", n), ("c", SIZE)))
    inertia, matrix, mass_matrix, _ = maps(place)
    still = kind(3, 1)
    numbers = casadi.vertcat(
        still, *(inertia[entry] for entry in _INERTIA_ENTRIES), matrix @ rate, still, rate.T @ mass_matrix @ rate
    )
    slopes = [casadi.densify(casadi.jacobian(numbers, by)) for by in (place, rate)]
    gradients = [casadi.gradient(casadi.dot(factors, numbers), by) for by in (place, rate)]
    second = [casadi.jacobian(gradients[of], by) for of, by in ((0, place), (1, place), (1, rate))]
    return (
        casadi.Function("mechanics", [place, rate, shape], [casadi.densify(numbers), *slopes], {"cse": True}),
        casadi.Function("mechanics_second", [place, rate, shape, factors], second, {"cse": True}),
    )


def _of_tree(chain: JointChain) -> tuple[Any, Any]:
    import casadi

    count = len(chain.parents)
    place, rate, factors = (casadi.SX.sym(name, size) for name, size in (("q", count), ("u", count), ("c", SIZE)))
    shape = casadi.SX.sym("shape", len(chain.follows.independent))
    tree = _Tree(chain, place, rate, shape)
    values = casadi.Function("mechanics", [place, rate, shape], [*tree.values()], {"cse": True})
    rows = casadi.Function("mechanics_rows", [place, rate, shape, factors], [*tree.rows(factors)], {"cse": True})
    q, u, c = (casadi.MX.sym(name, size) for name, size in (("q", count), ("u", count), ("c", SIZE)))
    r = casadi.MX.sym("r", shape.shape[0])
    carrying, carried, screws, forces, turned, lent = rows(q, u, r, c)
    above = casadi.DM(carries(chain))
    apart = casadi.DM(carries(chain) - np.eye(count))
    upper = above * (carrying.T @ carried)
    places = upper + (apart * upper).T
    mixed = (apart * (screws.T @ lent)) - (above * (turned.T @ forces)).T
    energies = above * (screws.T @ forces)
    rates = 2.0 * c[-1] * (energies + (apart * energies).T)
    return values, casadi.Function("mechanics_second", [q, u, r, c], [places, mixed, rates])


def carries(chain: JointChain) -> Array:
    """Matrix (k, k) of ones where the first joint carries the second, or is the same, else zeros."""
    return chain.hanging[:, 1:]


class _Tree:
    """Screws, twists, inertias and momenta of a tree, as expressions."""

    def __init__(self, chain: JointChain, place: Any, rate: Any, shape: Any) -> None:
        import casadi

        frames, none = joint_frames(chain, place, shape), casadi.SX(3, 1)
        self._screws, links, self._rate = screws_of(chain, frames), links_of(chain, frames), rate
        steps = [screw * rate[number] for number, screw in enumerate(self._screws)]
        self._twists = passed_on(chain, Twist(none, none), steps)
        self._bodies = gathered(chain, links)
        self._momenta = gathered(chain, [link.momentum(twist) for link, twist in zip(links, self._twists, strict=True)])
        self._forces = [body.momentum(screw) for body, screw in zip(self._bodies[1:], self._screws, strict=True)]

    def values(self) -> tuple[Any, Any, Any]:
        """Return z and its derivatives by coordinates and rates."""
        import casadi

        whole, momentum = self._bodies[0], self._momenta[0]
        energy = sum(screw.power(self._momenta[k + 1]) * self._rate[k] for k, screw in enumerate(self._screws))
        entries = [whole.inertia[place] for place in _INERTIA_ENTRIES]
        numbers = casadi.vertcat(whole.moment, *entries, momentum.angular, momentum.linear, energy)
        by_place, by_rate = [], []
        for number, screw in enumerate(self._screws):
            body, carried = self._bodies[number + 1], self._momenta[number + 1]
            moved = body.moved(screw)
            swept = screw.cross(self._twists[number + 1])
            change = screw.on_force(carried) - body.momentum(swept)
            entries = [moved.inertia[place] for place in _INERTIA_ENTRIES]
            by_place.append(
                casadi.vertcat(moved.moment, *entries, change.angular, change.linear, -2.0 * swept.power(carried))
            )
            force = self._forces[number]
            by_rate.append(casadi.vertcat(casadi.SX(9, 1), force.angular, force.linear, 2.0 * screw.power(carried)))
        return casadi.densify(numbers), *(casadi.densify(casadi.horzcat(*rows)) for rows in (by_place, by_rate))

    def rows(self, factors: Any) -> tuple[Any, ...]:
        """Vectors whose products are the second derivatives, one column a joint: X, Y, s, f, t, g."""
        import casadi

        of_moment, of_energy = factors[:3], factors[15]
        doubled = casadi.SX(3, 3)
        for number, (a, b) in enumerate(_INERTIA_ENTRIES):
            # Entries off the diagonal stand for both of their places.
            doubled[a, b] = doubled[b, a] = factors[3 + number] * (1.0 if a == b else 0.5)
        eta = Twist(factors[9:12], factors[12:15])
        columns: list[list[Any]] = [[] for _ in range(6)]
        for number, screw in enumerate(self._screws):
            body, carried, force = self._bodies[number + 1], self._momenta[number + 1], self._forces[number]
            swept, lever = screw.cross(self._twists[number + 1]), screw.cross(eta)
            turned = lever + swept * (2.0 * of_energy)
            lent = screw.on_force(body.momentum(eta) + carried * (2.0 * of_energy)) - body.momentum(turned)
            change = body.momentum(swept) - screw.on_force(carried)
            moved = body.moved(screw)
            spin = casadi.skew(screw.angular)
            weight = doubled @ spin - spin @ doubled
            along = casadi.cross(of_moment, screw.angular)
            along = along + 2.0 * (casadi.trace(doubled) * screw.linear - doubled @ screw.linear)
            entries = [(1.0 if a == b else 2.0) * moved.inertia[a, b] for a, b in _INERTIA_ENTRIES]
            weights = [weight[place] for place in _INERTIA_ENTRIES]
            columns[0].append(casadi.vertcat(swept.stacked, lever.stacked, along, *weights))
            columns[1].append(casadi.vertcat(-lent.stacked, change.stacked, moved.moment, *entries))
            for column, one in zip(columns[2:], (screw, force, turned, lent), strict=True):
                column.append(one.stacked)
        return tuple(casadi.densify(casadi.horzcat(*column)) for column in columns)
