"""Integrands of the derivatives of a motion's results, at the nodes of a quadrature.

With eta the turn of the attitude by a small change, inertial axes, and G = R I^-1 R^T,

    eta' = G (l x eta + s),

where s is the change of the angular momentum, inertial axes. Its adjoint Lambda' = l x (G Lambda),
Lambda = 1 at the end, makes one integral of every change: eta(T) = integral of Lambda^T G s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeVar

import numpy as np

from .. import so3
from ..arrays import Array, Integers
from ..body.body import Body
from ..body.couplings.coordinate_map import check_smooth
from ..body.inertial_regressor import LinkMotions, by_link_parameters, link_motions
from ..body.momentum_gradients import by_shape_and_rate
from ..deformation.rotors import RotorDescription
from ..inertia_tensor import inverse_inertia
from ..integrator.many_rotations import GroupedRotations
from ..integrator.stepped import SteppedRotation
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ..shape_space.path_samples import PathSamples
from ..shape_space.shape_path import ShapePath
from .wheels_along import WheelsAlong, reduced_chain

_NODES = 5  # of Gauss's rule on each piece: its order is ten, that of a step of the motion eight
_STEPS = 4  # of the motion in one piece, at first
# Ratio of neighbouring Legendre coefficients of the integrands, at most. They are multiplied by cubics of the path, so
# that the rule misses the ratio's seventh power, never more than 5e-8 of a derivative's norm.
_LARGEST_FACTOR = 0.15
_MOST_HALVINGS = 4  # of pieces with a larger ratio

# Gauss nodes and weights on [0, 1], and the integrals of Lagrange's polynomials from 0 to each node.
_PLACES, _SHARES = (
    0.5 * (values + shift) for values, shift in zip(np.polynomial.legendre.leggauss(_NODES), (1.0, 0.0))
)
_POWERS = np.vander(_PLACES, _NODES, increasing=True)
_INTEGRALS = (_POWERS * _PLACES[:, None] / np.arange(1.0, _NODES + 1.0)) @ np.linalg.inv(_POWERS)
# From values at the nodes to the coefficients of the last two Legendre polynomials: (2, m).
_ORDERS = np.arange(_NODES - 2, _NODES)
_LAST = (
    (2.0 * _ORDERS + 1.0) * np.polynomial.legendre.legvander(2.0 * _PLACES - 1.0, _NODES - 1)[:, _ORDERS]
).T * _SHARES


@dataclass(frozen=True, eq=False)
class AlongMotion:
    """A motion at N nodes.

    times, weights : (N,) [s]
    shapes, rates : (N, n)
    attitudes : (N, 3, 3) of the motion, base axes to inertial axes
    lifted : (N, C, 3, 3) of its horizontal lift and, where there are wheels, of the lift with what they store
    inverse : (N, 3, 3) I^-1 [1/(kg m^2)]
    spins, lifted_spins : (N, 3), (N, C, 3) angular velocities, base axes [rad/s]
    adjoint : (N, 3, 3) Lambda
    adjoint_at_start : (3, 3)
    wheels : (N, 3) adjoint of the integral of -Pi . I^-1 h, where wheels store h, by the turn of the attitude
    wheels_at_start : (3,)
    """

    times: Array
    weights: Array
    shapes: Array
    rates: Array
    attitudes: Array
    lifted: Array
    inverse: Array
    spins: Array
    lifted_spins: Array
    adjoint: Array
    adjoint_at_start: Array
    wheels: Array
    wheels_at_start: Array

    @property
    def integrands(self) -> list[Array]:
        """See `_AtNodes`."""
        lifted = np.moveaxis(self.lifted @ self.inverse[:, None], 1, 0)
        turned = so3.transpose(self.adjoint) @ self.attitudes @ self.inverse, *lifted
        spins = self.spins, *np.moveaxis(self.lifted_spins, 1, 0)
        return [*(matrices.reshape(len(self.times), 9) for matrices in turned), *spins]


def along_motion(motion: Motion, path: ShapePath, breaks: Array | None = None) -> AlongMotion:
    """A motion that is no batch, of an articulated body; no piece of the quadrature has one of the breaks within."""
    known = motion.deformation.breaks
    stepped = one_rotation(motion)
    edges = _pieces(stepped.times, stepped.panel, known if breaks is None else np.union1d(known, breaks))
    return _resolved(lambda edges: _at_nodes(motion, path, edges), edges)


class _AtNodes(Protocol):
    """What is known at the nodes of a quadrature."""

    @property
    def shapes(self) -> Array:
        """(N, n)."""
        ...

    @property
    def integrands(self) -> list[Array]:
        """Parts of all integrands beside the shapes, each of which counts by its length: (N, c) each."""
        ...


_A = TypeVar("_A", bound=_AtNodes)


def _resolved(at_nodes: Callable[[Array], _A], edges: Array) -> _A:
    """What is at the nodes on pieces that are halved until the integrands are resolved."""
    along = at_nodes(edges)
    for _ in range(_MOST_HALVINGS):
        rough = _factors(along) > _LARGEST_FACTOR
        if not rough.any():
            break
        edges = np.sort(np.append(edges, 0.5 * (edges[:-1] + edges[1:])[rough]))
        along = at_nodes(edges)
    return along


def _nodes(edges: Array) -> tuple[Array, Array, Array]:
    """Widths of the pieces, nodes and weights of the quadrature: (P,), (N,), (N,) [s]."""
    widths = np.diff(edges)
    return widths, (edges[:-1, None] + widths[:, None] * _PLACES).ravel(), (widths[:, None] * _SHARES).ravel()


def _at_nodes(motion: Motion, path: ShapePath, edges: Array) -> AlongMotion:
    widths, times, weights = _nodes(edges)
    stepped, start = one_rotation(motion), motion.initial_attitude
    shapes, rates = path.curve(times)
    inverse, drift = stepped.interpolant.inverse_and_drift(times)
    attitudes = start @ stepped.rotation(times)[0]
    lifts, drifts = [motion.lift_with_errors], [drift]
    if isinstance(motion.deformation.description, RotorDescription):
        lifts.append(motion.lift_without_momentum)
        drifts.insert(0, lifts[0].interpolant.inverse_and_drift(times)[1])
    lifted = np.stack([start @ lift.rotation.rotation(times)[0] for lift in lifts], axis=1)
    by_turning = so3.hat(motion.momentum) @ attitudes @ inverse @ so3.transpose(attitudes)
    adjoint, at_start = _adjoint(by_turning.reshape(len(widths), _NODES, 3, 3), widths)
    by_wheels = np.cross(motion.momentum, so3.apply(attitudes, drifts[-1] - drifts[0]))
    wheels, wheels_at_start = _sourced(adjoint, at_start, by_wheels.reshape(len(widths), _NODES, 3), widths)
    return AlongMotion(
        times=times,
        weights=weights,
        shapes=shapes,
        rates=rates,
        attitudes=attitudes,
        lifted=lifted,
        inverse=inverse,
        spins=(inverse @ (motion.momentum @ attitudes)[..., None])[..., 0] - drift,
        lifted_spins=-np.stack(drifts, axis=1),
        adjoint=adjoint.reshape(-1, 3, 3),
        adjoint_at_start=at_start,
        wheels=wheels.reshape(-1, 3),
        wheels_at_start=wheels_at_start,
    )


def _factors(along: _AtNodes) -> Array:
    """Ratio of neighbouring Legendre coefficients in each piece, for the integrand where they fall least: (P,)."""
    vectors = along.integrands
    whole = np.concatenate([*vectors, np.cos(along.shapes), np.sin(along.shapes)], axis=1)
    at_nodes = whole.reshape(-1, _NODES, whole.shape[1])
    squares = (_LAST @ at_nodes) ** 2
    # Vectors by their length; cosine and sine by one.
    starts, joints = np.cumsum([0, *(rows.shape[1] for rows in vectors)]), along.shapes.shape[1]
    sizes = np.add.reduceat(at_nodes[..., : starts[-1]] ** 2, starts[:-1], axis=2).max(axis=1)[:, None]
    last = np.add.reduceat(squares[..., : starts[-1]], starts[:-1], axis=2)
    shares = np.divide(last, sizes, out=np.zeros_like(last), where=sizes > 0.0).max(axis=2)
    turning = squares[..., starts[-1] :]
    shares = np.maximum(shares, (turning[..., :joints] + turning[..., joints:]).max(axis=2, initial=0.0))
    return (shares ** (0.5 / np.arange(_NODES - 2, _NODES))).max(axis=1)


def one_rotation(motion: Motion) -> SteppedRotation:
    """The steps of a motion that is no batch."""
    stepped = motion.stepped
    return stepped.finest if isinstance(stepped, GroupedRotations) else stepped


def responses(motion: Motion, times: Array, modes: int = 0) -> Array:
    """Turns of the attitude at each time by turns of the start and by changes of the momentum, inertial axes.

    (N,) ascending -> (N, 3, 6 + 3 modes): the first three columns by the start, the next three by the momentum, each
    three more by one that changes like the next Legendre polynomial from the first to the last of the times.
    """
    stepped = one_rotation(motion)
    edges = _pieces(stepped.times, stepped.panel, np.union1d(motion.deformation.breaks, times))
    widths = np.diff(edges)
    at = (edges[:-1, None] + widths[:, None] * _PLACES).ravel()
    inverse, _ = stepped.interpolant.inverse_and_drift(at)
    attitudes = motion.initial_attitude @ stepped.rotation(at)[0]
    turning = attitudes @ inverse @ so3.transpose(attitudes)
    scaled = widths[:, None, None, None] * turning.reshape(len(widths), _NODES, 3, 3)
    slopes = scaled @ so3.hat(motion.momentum)
    # Within a piece: from its start, and by a unit of momentum.
    shapes = legendre(at, times, modes).reshape(len(widths), _NODES, 1, -1, 1)
    changes = (scaled[..., None, :] * shapes).reshape(len(widths), _NODES, 3, -1)
    from_start, by_momentum = _within(slopes), _within(slopes, np.einsum("ij,pjab->piab", _INTEGRALS, changes))
    across = np.eye(3) + np.einsum("j,pjab->pab", _SHARES, slopes @ from_start)
    added = np.einsum("j,pjab->pab", _SHARES, changes + slopes @ by_momentum)
    columns = 6 + 3 * modes
    at_edges, reached = np.empty((len(edges), 3, columns)), np.eye(3, columns)
    at_edges[0] = reached
    for piece in range(len(widths)):
        reached = across[piece] @ reached
        reached[:, 3:] += added[piece]
        at_edges[piece + 1] = reached
    # Times that differ from an edge by rounding are that edge.
    return at_edges[np.searchsorted(0.5 * (edges[1:] + edges[:-1]), times)]


def legendre(at: Array, times: Array, modes: int) -> Array:
    """Legendre polynomials of orders 0 to `modes` from the first to the last of the times: (M,) -> (M, 1 + modes)."""
    since = 2.0 * (at - times[0]) / max(float(times[-1] - times[0]), np.finfo(float).tiny) - 1.0
    # Constant before and after: nothing was recorded there.
    return np.polynomial.legendre.legvander(np.clip(since, -1.0, 1.0), modes)


def _pieces(times: Array, panel: Integers, breaks: Array) -> Array:
    """Edges of the pieces for Gauss's rule: a few steps of one panel each, without a break inside.

    times, panel : (K + 1,), (K,) ends of the steps, and their panels
    """
    first = np.flatnonzero(np.diff(panel, prepend=-1))
    counts = np.diff(first, append=len(panel))
    within = np.arange(len(panel)) - np.repeat(first, counts)
    chosen = times[:-1][within % _STEPS == 0]
    edges = np.union1d(np.append(chosen, times[-1]), breaks)
    # Ends of loops and breaks that differ by rounding are one.
    apart = np.diff(edges) > 8.0 * np.finfo(float).eps * edges[-1]
    return np.append(edges[0], edges[1:][apart])


def _adjoint(slopes: Array, widths: Array) -> tuple[Array, Array]:
    """Lambda' = slope Lambda backwards from one at the end: pieces (P, m, c, c), (P,) -> (P, m, c, c), (c, c).

    By Gauss collocation, whose end values are of order 2 m.
    """
    count, _, size, _ = slopes.shape
    scaled = widths[:, None, None, None] * slopes
    inner = _within(scaled)
    across = np.eye(size) + np.einsum("j,pjab,pjbc->pac", _SHARES, scaled, inner)
    onward = np.linalg.inv(across)
    at_left = np.empty((count, size, size))
    right = np.eye(size)
    for piece in range(count - 1, -1, -1):
        right = np.matmul(onward[piece], right, out=at_left[piece])
    return inner @ at_left[:, None], right


def _sourced(adjoint: Array, at_start: Array, source: Array, widths: Array) -> tuple[Array, Array]:
    """Solution of x' = slope x - source that ends at zero, by `_adjoint`: (P, m, 3, 3), (3, 3), (P, m, 3), (P,) ->
    (P, m, 3), (3,)."""
    turned = widths[:, None, None] * np.linalg.solve(adjoint, source[..., None])[..., 0]
    onward = np.cumsum(np.einsum("j,pjk->pk", _SHARES, turned)[::-1], axis=0)[::-1]
    rest = onward[:, None] - np.einsum("ij,pjk->pik", _INTEGRALS, turned)
    return so3.apply(adjoint, rest), at_start @ onward[0]


def _within(scaled: Array, given: Array | None = None) -> Array:
    """X_i - sum_j a_ij scaled_j X_j = given_i at the nodes of each piece; None: one: (P, m, s, c) -> (P, m, s, c)."""
    count, m, size, _ = scaled.shape
    # Rows count nodes and components.
    system = -np.einsum("ij,pjab->piajb", _INTEGRALS, scaled).reshape(count, size * m, size * m) + np.eye(size * m)
    right = np.tile(np.eye(size), (m, 1)) if given is None else given.reshape(count, size * m, -1)
    return np.linalg.solve(system, right).reshape(count, m, size, -1)


@dataclass(frozen=True, eq=False)
class ForcedAlong:
    """A motion under a torque that is a function of time, at N nodes.

    With k = the change of the momentum, inertial axes, and f the torque there,

        eta' = G (l x eta + k + s),  k' = eta x f for a torque in base axes, 0 for one in inertial axes.

    times, weights : (N,) [s]
    shapes, rates : (N, n)
    attitudes : (N, 3, 3) base axes to inertial axes
    momenta : (N, 3) inertial axes [kg m^2/s]
    inverse : (N, 3, 3) I^-1 [1/(kg m^2)]
    spins : (N, 3) base axes [rad/s]
    adjoint : (N, 6, 6) of turn and momentum together, one at the end
    adjoint_at_start : (6, 6)
    """

    times: Array
    weights: Array
    shapes: Array
    rates: Array
    attitudes: Array
    momenta: Array
    inverse: Array
    spins: Array
    adjoint: Array
    adjoint_at_start: Array

    @property
    def integrands(self) -> list[Array]:
        """See `_AtNodes`."""
        turned = so3.transpose(self.adjoint[:, :3, :3]) @ self.attitudes @ self.inverse
        pushed = so3.transpose(self.adjoint[:, :3, 3:]) @ self.attitudes @ self.inverse
        return [turned.reshape(-1, 9), pushed.reshape(-1, 9), self.spins]

    @property
    def rows(self) -> Array:
        """Changes of turn and momentum at the end by a unit of internal momentum, base axes: (N, 6, 3)."""
        carried = so3.transpose(self.adjoint[:, :3]) @ self.attitudes @ self.inverse
        return -self.weights[:, None, None] * carried


def forced_along(motion: ForcedMotion, path: ShapePath) -> ForcedAlong:
    """A motion under a torque that is a function of time, of an articulated body."""
    times = motion.solution.times
    edges = _pieces(times, np.searchsorted(motion.breaks, times[:-1], side="right"), motion.breaks)
    return _resolved(lambda edges: _forced_at_nodes(motion, path, edges), edges)


def _forced_at_nodes(motion: ForcedMotion, path: ShapePath, edges: Array) -> ForcedAlong:
    widths, times, weights = _nodes(edges)
    attitudes, momenta = motion.attitude(times), motion.momentum(times)
    inverse = inverse_inertia(motion.deformation.description.sample(times)[0], times)
    turning = attitudes @ inverse @ so3.transpose(attitudes)
    slopes = np.zeros((len(times), 6, 6))
    slopes[:, :3, :3], slopes[:, :3, 3:] = turning @ so3.hat(momenta), turning
    if motion.torque_law.axes == "body":
        slopes[:, 3:, :3] = -so3.hat(so3.apply(attitudes, motion.torque(times)))
    adjoint, at_start = _adjoint(-so3.transpose(slopes).reshape(len(widths), _NODES, 6, 6), widths)
    return ForcedAlong(
        times=times,
        weights=weights,
        attitudes=attitudes,
        momenta=momenta,
        inverse=inverse,
        spins=motion.angular_velocity(times),
        adjoint=adjoint.reshape(-1, 6, 6),
        adjoint_at_start=at_start,
        **dict(zip(("shapes", "rates"), path.curve(times), strict=True)),
    )


@dataclass(frozen=True, eq=False)
class BodyAlong:
    """A body at N shapes and rates of a path.

    body : the body of the path
    times : (N,) [s]
    shapes, rates : (N, n)
    wheels : those of the motion, whose joints rest in the shapes
    """

    body: Body
    times: Array
    shapes: Array
    rates: Array
    wheels: WheelsAlong

    def by_knots(self, samples: PathSamples, spins: Array, rows: Array) -> Array:
        """Sums of row . d(I w + J rate), w staying, by the path at its knots.

        (S r, m), from spins (N, S, 3) and rows (N, S, r, 3).
        """
        return samples.by_knots(self.times, *self.by_shapes(spins, rows))

    def by_shapes(self, spins: Array, rows: Array) -> tuple[Array, Array]:
        """Products of row . d(I w + J rate), w staying, by the shapes and by the rates of joints that are no wheels.

        (N, S r, n) each, from spins (N, S, 3) and rows (N, S, r, 3).
        """
        chain = reduced_chain(self.body.chain, self.wheels.rotors)
        check_smooth(chain.follows, "derivatives by a path need", kinks_only=True)
        parts = by_shape_and_rate(chain, self._links, self.shapes, self.rates, spins, rows)
        if self.wheels.rotors:
            by_shape, by_rate = (derivative[..., self.wheels.driven] for derivative in parts)
            return by_shape + self.wheels.by_shape(rows), by_rate
        return parts

    def by_inertias(self, spins: Array, rows: Array) -> Array:
        """Derivatives by mass, first moment and inertia of each frame: (S r, 10 (k + 1))."""
        pairs = zip(np.moveaxis(rows, 1, 0), np.moveaxis(spins, 1, 0), strict=True)
        derivative = np.concatenate([by_link_parameters(self._links, row, spin) for row, spin in pairs])
        return self.wheels.by_inertias(derivative, rows) if self.wheels.rotors else derivative

    @cached_property
    def _links(self) -> LinkMotions:
        return link_motions(self.body.chain, self.shapes, self.rates)
