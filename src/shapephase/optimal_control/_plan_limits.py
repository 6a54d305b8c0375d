"""Shares of limits that a path takes up, between the nodes of a program, too."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..body.particles.point_masses import ParticleBody
from ..dynamics.torques import joint_torques
from ..errors import UnstatedLimitWarning
from ..reconstruction.reconstruction import Motion
from ..shape_space.closest_approach import ClosestApproach, clearance
from ..shape_space.shape_path import ShapePath
from ._spline_basis import SplineBasis
from .plan_options import Limits
from .task import Reorientation

TIMES = 4001  # least number of even times at which efforts are compared with their limits
LIMIT_SLACK = 1e-7  # share by which the solver may exceed limits
_MARGIN = 5e-5  # by which efforts are limited tighter than their excess asks for; doubled each round
_HASTE = 1.5  # exponent above 1, since peaks move to where there is more room: 4 % too much takes back 6 %
_MOST_NAMED = 8  # joints in a warning
_FIRST_MARGIN = 1e-5  # [m] that nodes keep beyond the clearance: what splines lose between them with 40 pieces
_FINE_GAP = 1e-3  # [m] missing between nodes, beyond which there are more nodes
_MORE_NODES, _MOST_NODES = 4, 48  # factor and most of a piece: corners of boxes that pass fast need 48 on 12 pieces
_CLEARANCE_HASTE = 1.5  # factor by which margins exceed what is missing between nodes
_NEAR = 1e-3  # [m] beyond the clearance, up to which pairs are watched at all times


@dataclass(frozen=True)
class Margins:
    """Pairs of links whose distance a program bounds.

    beyond : by how much the nodes keep each pair farther apart than the clearance [m]
    nodes : number of Gauss nodes in a piece at which distances are bounded
    """

    beyond: Mapping[tuple[str, str], float]
    nodes: int

    def same_rows(self, other: Margins) -> bool:
        """True where a program has the same rows."""
        return (set(self.beyond), self.nodes) == (set(other.beyond), other.nodes)


def derivative_shares(task: Reorientation, basis: SplineBasis, control: Array, duration: float) -> dict[str, float]:
    """Largest shares of their limits that rates, accelerations and jerks take up, by their control points.

    Control points bound the rate from outside; accelerations and jerks are largest at theirs.
    """
    bounds = derivative_limits(task, duration)
    shares: dict[str, float] = {}
    for order, (name, limit) in enumerate(bounds.items(), start=1):
        if np.isfinite(limit).any():
            shares[name] = float((np.abs(basis.derivative_control(order) @ control) / limit).max(initial=0.0))
    return shares


def derivative_limits(task: Reorientation, duration: float) -> dict[str, Array]:
    """Limits of the first three derivatives by place, (m,) each."""
    limits = {"rate": task.rate_limit, "acceleration": task.acceleration_limit, "jerk": task.jerk_limit}
    return {name: limit * duration**order for order, (name, limit) in enumerate(limits.items(), start=1)}


def shortest_duration(task: Reorientation, basis: SplineBasis, control: Array) -> float:
    """Least duration in which a path keeps to its limits of rates, accelerations and jerks [s]."""
    shares = derivative_shares(task, basis, control, 1.0)
    orders = {"rate": 1, "acceleration": 2, "jerk": 3}
    return max(share ** (1.0 / orders[name]) for name, share in shares.items())


def effort_shares(task: Reorientation, basis: SplineBasis, motion: Motion) -> Array:
    """Largest shares of their measure that efforts take up in each piece of the spline: (pieces, l).

    By `joint_torques`, independent of the program's own mechanics, at 4,001 even places or more.
    """
    samples = -(-(TIMES - 1) // basis.pieces)
    places = np.linspace(0.0, 1.0, samples * basis.pieces + 1)
    measured = np.isfinite(task.effort_measure)
    torque = joint_torques(motion, np.minimum(places * motion.duration, motion.duration)).torque[:, measured]
    shares = np.abs(torque) / task.effort_measure[measured]
    inner = shares[:-1].reshape(basis.pieces, samples, -1).max(axis=1)
    return np.maximum(inner, shares[samples::samples])


def tightened(room: Array | None, shares: Array, stages: int, rounds: int) -> Array:
    """Shares of limits for efforts at the places of a program, where a path took up too much between them.

    room : at the nodes, `stages` a piece, and the ends of pieces (places, l); None: all of their limits
    shares : (pieces, l) of the path
    rounds : number of earlier calls
    """
    pieces, count = shares.shape
    most = (1.0 - _MARGIN * 2.0**rounds) / np.maximum(shares, 1.0) ** _HASTE
    factor = np.where(shares > 1.0 + LIMIT_SLACK, most, 1.0)
    ends = np.ones((pieces + 1, count))
    ends[:-1] = factor
    ends[1:] = np.minimum(ends[1:], factor)
    at_places = np.concatenate([np.repeat(factor, stages, axis=0), ends])
    return at_places if room is None else room * at_places


def closest_links(task: Reorientation, path: ShapePath) -> tuple[ClosestApproach, ...]:
    """Return the pairs of links that come nearer on a path than the clearance and a millimetre, at 4,001 times too."""
    if task.clearance is None or task.geometry is None:
        return ()
    geometry, times = task.geometry, np.linspace(0.0, path.duration, TIMES)
    near = clearance(task.links, path, below=task.clearance + _NEAR, geometry=geometry).approaches
    postures = geometry.postures(path.shape(times)) if near else None
    result = []
    for approach in near:
        members = np.flatnonzero(geometry.members[1] == geometry.pairs.index(approach.links))
        rows = np.repeat(np.arange(TIMES), len(members))
        assert postures is not None
        distances = geometry.separations(postures, rows, np.tile(members, TIMES)).distances
        least = int(np.argmin(distances))
        sampled = ClosestApproach(approach.links, float(times[rows[least]]), float(distances[least]))
        result.append(min(approach, sampled, key=lambda entry: entry.distance))
    return tuple(sorted(result, key=lambda entry: entry.distance))


def widened(margins: Margins, closest: tuple[ClosestApproach, ...], least: float) -> Margins:
    """Return margins with which pairs that came nearer than the clearance `least` [m] will keep it.

    What is missing between nodes is added to the nodes; where that is much, there are more nodes first.
    """
    missing = {near.links: least - near.distance for near in closest if near.distance < least}
    known = {links: gap for links, gap in missing.items() if links in margins.beyond}
    first = {links: _FIRST_MARGIN for links in missing if links not in known}
    if margins.nodes < _MOST_NODES and any(gap > _FINE_GAP for gap in known.values()):
        return Margins({**margins.beyond, **first}, _MORE_NODES * margins.nodes)
    added = {links: margins.beyond[links] + _CLEARANCE_HASTE * gap for links, gap in known.items()}
    return Margins({**margins.beyond, **added, **first}, margins.nodes)


def position_share(task: Reorientation, basis: SplineBasis, control: Array) -> dict[str, float]:
    """Largest distance of moving coordinates from the middle of their limits, as a share of half the range."""
    moves = task.movable
    middle, half = 0.5 * (task.lower + task.upper)[moves], 0.5 * (task.upper - task.lower)[moves]
    path = basis.matrix(np.linspace(0.0, 1.0, TIMES)) @ control[:, moves]
    return {"position": float((np.abs(path - middle) / half).max(initial=0.0))}


def limit_shares(task: Reorientation, basis: SplineBasis, control: Array, motion: Motion) -> dict[str, float]:
    """Largest shares that a path takes up of each kind of limit but that of positions: 1 is all of it."""
    shares = derivative_shares(task, basis, control, motion.duration)
    if task.efforts_limited:
        shares["effort"] = float(effort_shares(task, basis, motion).max(initial=0.0))
    return shares


def warn_of_unstated(task: Reorientation, limits: Limits) -> None:
    """Warn the caller's caller of limits taken from a file that does not state them (UnstatedLimitWarning)."""
    body, moves = task.body, np.abs(task.coupling).sum(axis=1) > 0.0
    if isinstance(body, ParticleBody):
        return
    unstated = {
        "rate": (limits.rate_limits, np.isinf(body.rate_limits) & moves, "they may move at any rate"),
        # A motor that holds its joint has an effort, too.
        "effort": (limits.effort_limits, np.isinf(body.effort_limits), "they may need any effort"),
    }
    for kind, (given, where, so) in unstated.items():
        names = [body.joint_names[joint] for joint in np.flatnonzero(where)]
        if isinstance(given, str) and names:
            more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
            warnings.warn(
                f"{body.name} states no {kind} limit for {', '.join(names[:_MOST_NAMED])}{more}: {so}; give "
                f"limits=Limits({kind}_limits=...), or None for no limits",
                UnstatedLimitWarning,
                stacklevel=3,
            )
