"""The principal axes of inertia as a smooth frame in time, through every meeting of the principal moments.

U(t) is a quaternion whose components are polynomials on panels of time. A panel is taken when its frame makes the
inertia diagonal at and between the nodes, whatever the order of the moments; else it is halved. So moments that truly
cross are passed straight on, since the frame that goes straight on is diagonal there. Where they only come close, that
frame would show the coupling between the axes, and halving finds where these turn instead.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .. import so3
from ..arrays import Array
from ..chebyshev import PiecewiseChebyshev, exact_local_coordinate
from ..errors import GaugeError
from ._axis_panels import (
    EQUAL,
    NEARLY_DIAGONAL,
    NO_TURN,
    POINTS_BETWEEN,
    SEPARATE,
    SPHERICAL,
    SYMMETRIC,
    THIRD,
    AxisPanels,
    cube_turns,
    in_order,
    inertia_in,
    is_diagonal_at,
    moments_at,
    nearest_cube_turn,
    resolved,
)
from .deformation import Deformation

Frames = Callable[[Array], tuple[Array, Array]]

_PANELS_OF_A_LOOP = 4  # at first, at least: each is halved until its polynomials fit
_AT_JOINTS = 1e-11  # of the trace, for entries off the diagonal where panels meet: their polynomials are worst there
_SLOPPY = 1e-7  # of the trace: a smaller jump of the inertia is inexact data, like a loop read from a file
_JUMP = 0.1  # [rad] between neighbouring panels: farther apart the axes jump
_SPOT_CHECKS = np.array([-0.91, -0.43, 0.17, 0.71])  # in [-1, 1], to compare loops: apart from nodes and symmetry


def principal_frames(deformation: Deformation) -> Frames:
    """A smooth frame of principal axes: times (N,) -> U (N, 3, 3) and its body rates (N, 3) [rad/s].

    U I U^T is diagonal to 1e-11 of its trace, to some 2e-14 where nothing is sudden; hat(rate) = U^T U'.
    U is continuous wherever the inertia has a continuous frame of principal axes. Where moments are equal over an
    interval the frame goes on with the distinct axis and does not turn about it.

    At t = 0 one of the 24 frames is chosen: moments ascend (moments that meet there as just after they part), the first
    two axes each point along their largest base component, the third completes a proper frame. If two moments are
    equal for all time, one of their axes lies in the plane of the distinct axis and the base axis farthest from it, and
    the one that lies along the earlier base axis comes first; if all three are, U is the identity.

    Raises GaugeError if the axes jump where moments meet, or turn by more than 2e8 rad per loop.
    Source: Cabrera 2006, section 2.3.1 (b); theory.md B3.
    """
    panels = _joined(deformation)
    panels = replace(panels, series=so3.quat_product(_settled(panels), panels.series))
    panels = replace(panels, series=so3.quat_product(_labels_at_start(deformation, panels), panels.series))
    return _track(panels)


@dataclass(frozen=True, eq=False)
class _Track:
    """Quaternions xyzw, not of length one, and their derivatives, as a function of time: (N,) -> (N, 8)."""

    series: PiecewiseChebyshev

    def __call__(self, times: Array) -> tuple[Array, Array]:
        panel = self.series.panel_of(times)
        local = exact_local_coordinate(times, self.series.edges[panel], self.series.edges[panel + 1])
        both = self.series.at_local(local[:, None], panel)[:, 0]
        quat_xyzw, slope = both[:, :4], both[:, 4:]
        norm = np.linalg.norm(quat_xyzw, axis=-1, keepdims=True)
        return so3.matrix_from_quat(quat_xyzw / norm), so3.turn_of(quat_xyzw, slope) / norm**2


def _track(panels: AxisPanels) -> _Track:
    quats = PiecewiseChebyshev(panels.edges, panels.series)
    both = np.concatenate([quats.coefficients, quats.derivative().coefficients], axis=-1)
    return _Track(PiecewiseChebyshev(panels.edges, both))


def _joined(deformation: Deformation) -> AxisPanels:
    """Continuous panels over the whole motion. Raises GaugeError."""
    panels = _oriented(_over_loops(deformation))
    continuous, jumps = _continuous(deformation, panels)
    if jumps.any():
        joint = int(np.argmax(jumps))
        where = panels.left[joint + 1]
        raise GaugeError(
            f"the principal axes jump by {np.degrees(jumps[joint]):.3g} degrees at t = {where:.12g} s, "
            f"{moments_at(deformation, where)}: no frame of principal axes is continuous there; use the "
            "horizontal gauge"
        )
    return continuous


def _over_loops(deformation: Deformation) -> AxisPanels:
    """Panels for the whole motion; those of the first loop serve every loop in which they are diagonal, too."""
    period = deformation.duration / deformation.loops
    breaks = np.append(deformation.breaks[deformation.breaks < period * (1.0 - 1e-12)], period)
    ends = np.linspace(breaks[:-1], breaks[1:], -(-_PANELS_OF_A_LOOP // (len(breaks) - 1)) + 1, axis=1)
    left, right = ends[:, :-1].ravel(), ends[:, 1:].ravel()
    first = resolved(deformation, left, right)
    if deformation.loops == 1:
        return first
    starts = period * np.arange(deformation.loops)[:, None]
    edges = np.append((starts + first.left).ravel(), deformation.duration)
    panels = first.kept(np.tile(np.arange(len(first.left)), deformation.loops))
    panels = replace(panels, left=edges[:-1], right=edges[1:])
    good = is_diagonal_at(deformation, panels, _SPOT_CHECKS, np.array([NEARLY_DIAGONAL]))
    same = good.reshape(deformation.loops, -1).all(axis=1)
    if same.all():
        return panels
    left, right = starts[~same] + left, np.minimum(starts[~same] + right, deformation.duration)
    anew = resolved(deformation, left.ravel(), right.ravel())
    return in_order([panels.kept(np.repeat(same, len(first.left))), anew])


# ---- From panel to panel --------------------------------------------------------------------------------------------


def _oriented(panels: AxisPanels) -> AxisPanels:
    """The panels turned from the left, where they may be, so that each continues where the one before ends."""
    kinds = panels.kind.tolist()
    turns = np.tile(NO_TURN, (len(kinds), 1))
    first, last = (so3.normalised(end) for end in _ends(panels.series))
    group, table = cube_turns()
    steps = nearest_cube_turn(so3.quat_product(last[:-1], so3.quat_inverse(first[1:]))).tolist()
    label = 0
    for panel in range(1, len(kinds)):
        if kinds[panel - 1] == kinds[panel] == SEPARATE:
            label = int(table[label, steps[panel - 1]])
            turns[panel] = group[label]
            continue
        ideal = so3.quat_product(so3.quat_product(turns[panel - 1], last[panel - 1]), so3.quat_inverse(first[panel]))
        if kinds[panel] == SEPARATE:
            label = int(nearest_cube_turn(ideal))
            turns[panel] = group[label]
        elif kinds[panel] == SYMMETRIC:
            # The distinct axis becomes one of the frame's.
            seen = so3.matrix_from_quat(ideal) @ THIRD
            axis = np.sign(seen) * (np.arange(3) == np.argmax(np.abs(seen)))
            turns[panel] = so3.quat_product(so3.quat_from_matrix(so3.between(seen, axis)), ideal)
        else:
            turns[panel] = ideal
    strength = so3.apply(so3.matrix_from_quat(turns) ** 2, panels.strength)
    return replace(panels, series=so3.quat_product(turns[:, None], panels.series), strength=strength)


def _ends(series: Array) -> tuple[Array, Array]:
    """Values of Chebyshev series (P, n, 4) at -1 and at 1: (P, 4) each."""
    return np.einsum("pkc,k->pc", series, (-1.0) ** np.arange(series.shape[1])), series.sum(axis=1)


def _continuous(deformation: Deformation, panels: AxisPanels) -> tuple[AxisPanels, Array]:
    """The panels with the gaps between neighbours spread over both, and those too wide for that (P - 1,) [rad]."""
    series = panels.series
    first, last = (so3.normalised(end) for end in _ends(series))
    turn = so3.rotation_vector_from_quat(so3.quat_product(first[1:], so3.quat_inverse(last[:-1])))
    gap = np.linalg.norm(turn, axis=-1)
    if np.any(gap > _JUMP):
        return panels, np.where(gap > _JUMP, gap, 0.0)
    # The side on which an axis is known better moves less. Turning from the left does not mix the axes.
    known = panels.strength**2 + 1e-40
    share = known[1:] / (known[:-1] + known[1:])
    common = so3.quat_product(so3.quat_from_rotation_vector(share * turn), last[:-1])
    shift = np.zeros((2, len(series), 4))
    for at, missing in (
        (shift[0, 1:], so3.quat_product(common, so3.quat_inverse(first[1:]))),
        (shift[1, :-1], so3.quat_product(common, so3.quat_inverse(last[:-1]))),
    ):
        at[:, :3] = missing[:, :3] / missing[:, 3:]
    middle, slope = 0.5 * (shift[1] + shift[0])[:, None], 0.5 * (shift[1] - shift[0])[:, None]
    longer = np.pad(series, ((0, 0), (0, 1), (0, 0)))
    turned = so3.quat_product(slope, series)
    longer[:, :-1] += so3.quat_product(middle, series)
    longer[:, 1] += turned[:, 0]
    longer[:, 2:] += 0.5 * turned[:, 1:]
    longer[:, :-2] += 0.5 * turned[:, 1:]
    moved = replace(panels, series=longer)
    rows = np.flatnonzero(np.abs(shift).max(axis=(0, -1)) > 0.5 * NEARLY_DIAGONAL)
    wrong = np.zeros(len(series), dtype=bool)
    if len(rows):
        # Jumps of the inertia of inexact data at the ends of each panel, per trace.
        _, inertia = inertia_in(deformation, panels.left, panels.right, np.array([-1.0, 1.0]))
        jump = np.abs(inertia[1:, 0] - inertia[:-1, 1]).max(axis=(-1, -2))
        jump = np.where(jump < _SLOPPY, 2.0 * jump, 0.0)
        limit = _AT_JOINTS + (np.append(jump, 0.0) + np.append(0.0, jump))[rows, None]
        wrong[rows] = ~is_diagonal_at(deformation, moved.kept(rows), POINTS_BETWEEN, limit)
    return moved, np.where(wrong[1:] | wrong[:-1], gap, 0.0)


# ---- The choice at the start ----------------------------------------------------------------------------------------


def _settled(panels: AxisPanels) -> Array:
    """The turn from the left that uses up what moments that are equal for all time leave open: (4,)."""
    start = so3.normalised(_ends(panels.series[:1])[0])[0]
    if (panels.kind == SPHERICAL).all():
        return so3.quat_inverse(start)
    # Moments differ where the axes' turns are known: about the distinct axis alone they are not.
    if (panels.kind != SYMMETRIC).any() or (panels.strength[:, 2] > panels.strength[:, :2].max(axis=1)).any():
        return NO_TURN
    axes = so3.matrix_from_quat(start)
    distinct = axes[2]
    farthest = np.eye(3)[np.argmin(np.round(np.abs(distinct), 9))]
    seen = axes @ (farthest - (farthest @ distinct) * distinct)
    return so3.quat_from_rotation_vector(np.arctan2(seen[1], seen[0]) * -THIRD)


def _labels_at_start(deformation: Deformation, panels: AxisPanels) -> Array:
    """The one of the 24 turns from the left that names the axes at t = 0 by the rule of `principal_frames`: (4,)."""
    if (panels.kind == SPHERICAL).all():
        return NO_TURN
    times = np.append(0.0, deformation.duration * 2.0 ** np.arange(-45.0, 0.5))
    frames, _ = _track(panels)(times)
    moments = np.einsum("tij,tjk,tik->ti", frames, deformation.inertia(times), frames)
    moments /= moments.sum(axis=-1, keepdims=True)
    entries = np.abs(frames[0])
    largest = np.argmax(entries > entries.max(axis=-1, keepdims=True) - 1e-9, axis=-1)
    above = np.zeros(3)
    for i, j in itertools.permutations(range(3), 2):
        apart = moments[:, i] - moments[:, j]
        distinct = np.flatnonzero(np.abs(apart) > 10.0 * EQUAL)
        above[i] += apart[distinct[0]] > 0.0 if len(distinct) else largest[i] > largest[j]
    order = np.argsort(above, kind="stable")
    rows = np.eye(3)[order]
    rows[:2] *= np.sign((rows @ frames[0])[[0, 1], largest[order[:2]]])[:, None]
    rows[2] = np.cross(rows[0], rows[1])
    return so3.quat_from_matrix(rows)
