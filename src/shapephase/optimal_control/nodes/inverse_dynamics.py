r"""Efforts of the joints of a free tree of links with their first and second derivatives, link by link.

The base moves such that the momentum about the centre of mass is M, base axes, without a wrench on it. With s x
twists, s x* forces, I, P, F inertia, momentum and rate of momentum of all that a joint carries along its screw s,

    V' = V + s u,   A' = A + s w + V x s u   from frame to frame,   effort = s . F,

V and A of the base such that all momentum is M and all force none. A joint j moves all that it carries as one rigid
body; the defect of V and A from being moved along is

    p = V x s,   a = A x s + V x p      (V and A of the frame that the joint hangs on),

so that with K x = I' x + x x* P (I' the rate of I) the derivative of F of any link that hangs on j is

    by r_j   s x* F + I a + K p,      by u_j   2 I p + K s,      by w_j   I s.

The second derivatives of a sum of efforts, l . effort, are those of

    S = sum over links of  L . F + b . P,   L the twist of the link by rates l,

where the base's own part of L, and b, are such that V and A of the base do not matter to first order. They are again
products of a vector of the joint that carries the other and a vector of the other. With Q the momentum by L,
c = L x s, D = sum over links of I' L - L x* P + I b, and E x = x x* Q - (rate of I by L) x,

    g = s x* F + I a + K p,   h = s x* P + I p,   k = s x* Q + I c,   e = 2 I p + K s,   f = I s,
    d = s x* D + E p + K^T c + I (b x s),

and of j that carries i, or is the same,

    r_i r_j: c_j g_i + a_j k_i + p_j d_i + (b x s)_j h_i,    r_i u_j: 2 p_j k_i + s_j d_i,    r_i w_j: s_j k_i,
    u_i r_j: p_j E s_i + c_j e_i + (b x s)_j f_i,            u_i u_j: s_j E s_i,              w_i r_j: c_j f_i.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...body.joint_chain import JointChain
from ..symbolic import joint_frames
from .node_mechanics import carries
from .spatial import Twist, gathered, links_of, passed_on, screws_of


@dataclass(frozen=True, eq=False)
class InverseDynamics:
    """CasADi functions of x = (coordinates, rates, accelerations of all k joints, momentum): (3 k + 3,).

    efforts : x -> efforts of all joints (k,)
    slopes : x -> their derivatives (k, 3 k + 3)
    second : x, factors (k,) -> second derivatives (3 k + 3, 3 k + 3) of their product with the efforts
    """

    efforts: Any
    slopes: Any
    second: Any


def inverse_dynamics(chain: JointChain) -> InverseDynamics:
    """Return the functions of a tree without ball joints, in symbols.

    Source: recursive Newton-Euler (Featherstone, Rigid Body Dynamics Algorithms, section 5.3); first and second
    derivatives after Singh, Russell and Wensing 2022 and 2023, with the base's motion eliminated.
    """
    import casadi

    count = len(chain.parents)
    x, factors = casadi.SX.sym("x", 3 * count + 3), casadi.SX.sym("factors", count)
    tree = _MovingTree(chain, x)
    options = {"cse": True}
    efforts = casadi.Function("efforts", [x], [tree.efforts], options)
    first = casadi.Function("effort_rows", [x], tree.rows(), options)
    second = casadi.Function("effort_second_rows", [x, factors], tree.second_rows(factors), options)
    at, weights = casadi.MX.sym("x", 3 * count + 3), casadi.MX.sym("factors", count)
    rows = first(at)
    return InverseDynamics(
        efforts=efforts,
        slopes=casadi.Function("effort_slopes", [at], [_slopes(chain, *rows)]),
        second=casadi.Function("effort_second", [at, weights], [_second(chain, rows, *second(at, weights))]),
    )


def _slopes(chain: JointChain, s: Any, p: Any, a: Any, f: Any, g: Any, h: Any, e: Any, b: Any, *base: Any) -> Any:
    """Derivatives of the efforts: at a given motion of the base, and by the change of that motion."""
    import casadi

    carried = carries(chain).T
    below, above = casadi.DM(carried), casadi.DM(carried.T - np.eye(len(carried)))
    by_place = below * (f.T @ a + b.T @ p) + above * (s.T @ g)
    by_rate = below * (2.0 * (f.T @ p) + b.T @ s) + above * (s.T @ e)
    by_bend = below * (f.T @ s) + above * (s.T @ f)
    answer = _base_slopes(f, g, h, e, *base)
    return casadi.horzcat(by_place, by_rate, by_bend, casadi.MX(len(carried), 3)) + casadi.vertcat(b, f).T @ answer


def _base_slopes(f: Any, g: Any, h: Any, e: Any, inverse: Any, coriolis: Any) -> Any:
    """Derivatives of velocity and acceleration of the base by x, (12, 3 k + 3)."""
    import casadi

    none, momentum = casadi.MX(*f.shape), casadi.DM.eye(6)[:, :3]
    velocity = inverse @ casadi.horzcat(-h, -f, none, momentum)
    force = casadi.horzcat(g, e, f, casadi.MX(6, 3)) + coriolis @ velocity
    return casadi.vertcat(velocity, -(inverse @ force))


def _second(chain: JointChain, rows: Any, c: Any, bs: Any, k: Any, d: Any, es: Any, of_base: Any) -> Any:
    import casadi

    s, p, a, f, g, h, e = rows[:7]
    whole = carries(chain)
    above, apart = casadi.DM(whole), casadi.DM(whole - np.eye(len(whole)))
    places = above * (c.T @ g + a.T @ k + p.T @ d + bs.T @ h)
    mixed = (above * (p.T @ es + c.T @ e + bs.T @ f)).T + apart * (2.0 * (p.T @ k) + s.T @ d)
    bent = (above * (c.T @ f)).T + apart * (s.T @ k)
    rates = above * (s.T @ es)
    none, count = casadi.MX(6, 6), len(whole)
    corner = casadi.vertcat(
        casadi.horzcat(places + (apart * places).T, mixed.T, bent.T),
        casadi.horzcat(mixed, rates + (apart * rates).T, casadi.MX(count, count)),
        casadi.horzcat(bent, casadi.MX(count, 2 * count)),
    )
    corner = casadi.diagcat(corner, casadi.MX(3, 3))
    beside = casadi.vertcat(
        casadi.horzcat(d, es, casadi.MX(6, count + 3)), casadi.horzcat(k, casadi.MX(6, 2 * count + 3))
    )
    base = casadi.vertcat(casadi.horzcat(of_base, none), casadi.horzcat(none, none))
    answer = _base_slopes(f, g, h, e, *rows[8:])
    across = answer.T @ beside
    return corner + across + across.T + answer.T @ base @ answer


class _MovingTree:
    """Twists, accelerations, forces and momenta of a moving tree, and the efforts of all joints, as expressions."""

    def __init__(self, chain: JointChain, x: Any) -> None:
        import casadi

        self._chain, self._parents, count = chain, chain.parents, len(chain.parents)
        place, rate, bend, momentum = x[:count], x[count : 2 * count], x[2 * count : 3 * count], x[3 * count :]
        # There are no ball joints, which would be counted from a shape.
        frames = joint_frames(chain, place, place)
        self._screws, self._links = screws_of(chain, frames), links_of(chain, frames)
        self._bodies = gathered(chain, self._links)
        none = Twist(casadi.SX(3, 1), casadi.SX(3, 1))
        carried = [screw * rate[k] for k, screw in enumerate(self._screws)]
        lent = self._bodies[0].momentum(none)
        for body, twist in zip(self._bodies[1:], carried, strict=True):
            lent = lent + body.momentum(twist)
        self._twists = passed_on(self._chain, self._bodies[0].twist(Twist(momentum, none.linear) - lent), carried)
        self._swept = [self._twists[parent].cross(screw) for parent, screw in zip(self._parents, self._screws)]
        steps = [screw * bend[k] + self._swept[k] * rate[k] for k, screw in enumerate(self._screws)]
        still = passed_on(self._chain, none, steps)
        self._link_momenta = [link.momentum(twist) for link, twist in zip(self._links, self._twists, strict=True)]
        held = gathered(
            chain,
            [
                link.momentum(rise) + twist.on_force(momentum)
                for link, rise, twist, momentum in zip(
                    self._links, still, self._twists, self._link_momenta, strict=True
                )
            ],
        )
        lift = none - self._bodies[0].twist(held[0])
        self._rises = [rise + lift for rise in still]
        self._forces = [force + body.momentum(lift) for force, body in zip(held, self._bodies, strict=True)]
        self._momenta = gathered(self._chain, self._link_momenta)
        self._link_changes = [link.moved(twist) for link, twist in zip(self._links, self._twists, strict=True)]
        self._changes = gathered(self._chain, self._link_changes)
        self.efforts = casadi.vertcat(*(screw.power(force) for screw, force in zip(self._screws, self._forces[1:])))

    def _coriolis(self, frame: int, twist: Twist) -> Twist:
        """Product K x for all that hangs on a frame."""
        return self._changes[frame].momentum(twist) + twist.on_force(self._momenta[frame])

    def rows(self) -> list[Any]:
        """Rows s, p, a, f, g, h, e, K^T s, one column a joint, then the inverse of I and K of the base."""
        columns = []
        for k, (parent, s, p) in enumerate(zip(self._parents, self._screws, self._swept)):
            body = self._bodies[k + 1]
            a = self._rises[parent].cross(s) + self._twists[parent].cross(p)
            g = s.on_force(self._forces[k + 1]) + body.momentum(a) + self._coriolis(k + 1, p)
            h = s.on_force(self._momenta[k + 1]) + body.momentum(p)
            e = body.momentum(p) * 2.0 + self._coriolis(k + 1, s)
            b = self._changes[k + 1].momentum(s) - s.on_force(self._momenta[k + 1])
            columns.append((s, p, a, body.momentum(s), g, h, e, b))
        inverse = [self._bodies[0].twist(unit) for unit in _units()]
        coriolis = [self._coriolis(0, unit) for unit in _units()]
        return [_side_by_side(column) for column in (*zip(*columns, strict=True), inverse, coriolis)]

    def second_rows(self, factors: Any) -> list[Any]:
        """Rows c, b x s, k, d, E s, one column a joint, then E of the base."""
        lent = [screw * factors[k] for k, screw in enumerate(self._screws)]
        whole = self._bodies[0]
        total = self._bodies[1].momentum(lent[0])
        for body, twist in zip(self._bodies[2:], lent[1:], strict=True):
            total = total + body.momentum(twist)
        loads = passed_on(self._chain, whole.twist(total) * -1.0, lent)
        shares = gathered(self._chain, [link.momentum(load) for link, load in zip(self._links, loads, strict=True)])
        bare = [
            change.momentum(load) - load.on_force(momentum)
            for change, load, momentum in zip(self._link_changes, loads, self._link_momenta, strict=True)
        ]
        bare = gathered(self._chain, bare)
        beta = whole.twist(bare[0]) * -1.0
        changes = gathered(self._chain, [link.moved(load) for link, load in zip(self._links, loads, strict=True)])
        columns = []
        for k, (parent, s, p) in enumerate(zip(self._parents, self._screws, self._swept)):
            body, frame = self._bodies[k + 1], k + 1
            c, bs = loads[parent].cross(s), beta.cross(s)
            drawn = bare[frame] + body.momentum(beta)
            d = s.on_force(drawn) + p.on_force(shares[frame]) - changes[frame].momentum(p)
            d = d + self._changes[frame].momentum(c) - c.on_force(self._momenta[frame]) + body.momentum(bs)
            es = s.on_force(shares[frame]) - changes[frame].momentum(s)
            columns.append((c, bs, s.on_force(shares[frame]) + body.momentum(c), d, es))
        of_base = [changes[0].momentum(unit) * -1.0 for unit in _units()]
        return [_side_by_side(column) for column in (*zip(*columns, strict=True), of_base)]


def _units() -> list[Twist]:
    """The six unit twists."""
    import casadi

    columns = [casadi.SX(column) for column in casadi.horzsplit(casadi.DM.eye(6))]
    return [Twist(column[:3], column[3:]) for column in columns]


def _side_by_side(twists: Any) -> Any:
    import casadi

    return casadi.densify(casadi.horzcat(*(twist.stacked for twist in twists)))
