"""The rotation of a motion split into shape holonomy and Montgomery phase."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import so3, sphere
from .arrays import Array
from .errors import GaugeError, unknown_name
from .gauge import Frames, lift_frames, principal_frames
from .interpolant import Interpolant
from .reconstruction import Motion
from .stepping import SteppedRotation, stepped_rotation

GAUGES = ("horizontal", "base", "principal")
_MOST_STEPS = 20_000
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True, eq=False)
class PhaseSplit:
    """What turned a free body: its shape, and its angular momentum.

    All rotations are in inertial axes; fields have the motion's batch axes in front. With mu the unit vector of
    the momentum, seen from the gauge's frame,

        exp(montgomery_phase hat(mu)) tilt = dynamical_rotation            in the horizontal gauge,
        exp(montgomery_phase hat(mu)) tilt = total_rotation                in the base gauge of a closed joint path,
        total_rotation = dynamical_rotation holonomy                       always.

    Attributes
    ----------
    gauge : the frame from which the momentum curve was seen
    total_rotation : (3, 3) Delta R, from the start to the end of the motion, the same in every gauge
    holonomy : (3, 3) R_G, what the loop of shapes alone does; for an open path the endpoint of its lift
    dynamical_rotation : (3, 3) R_D, what the momentum adds
    montgomery_phase : theta_M = dynamic_phase + geometric_phase, unwrapped [rad]
    montgomery_angle : the same in (-pi, pi] [rad]
    dynamic_phase : theta_D = integral of omega . Pi dt over the momentum's size [rad]
    geometric_phase : minus the solid angle [rad]
    solid_angle : signed, of the momentum curve in this gauge, closed by the great circle; counted from the
        region of the sphere farthest from the curve [sr]
    tilt : (3, 3) transport along the closing great circle; the identity when the momentum closes in this gauge
    momentum_gap : angle between the ends of the momentum curve in this gauge [rad]
    shape_gap : how far the end shape is from the start shape
    residual : |theta_M - the same angle read off the attitude|, modulo 2 pi: two independent computations [rad]
    is_loop : whether the shape closes
    has_phase : whether there is angular momentum; without it all phases are 0 and R_D is the identity
    """

    gauge: str
    total_rotation: Array
    holonomy: Array
    dynamical_rotation: Array
    montgomery_phase: Array
    montgomery_angle: Array
    dynamic_phase: Array
    geometric_phase: Array
    solid_angle: Array
    tilt: Array
    momentum_gap: Array
    shape_gap: float
    residual: Array
    is_loop: bool
    has_phase: Array


def split(motion: Motion, gauge: str = "horizontal") -> PhaseSplit:
    """Split the rotation of a motion into shape holonomy and Montgomery phase.

    Parameters
    ----------
    gauge : "horizontal", the frame that the shape motion alone would carry along (the split people want);
        "base", the deformation's own frame, whose phase already holds the shape's part; "principal", the
        principal axes of inertia

    Raises
    ------
    UnknownNameError
        For another gauge.
    GaugeError
        If the principal axes are not continuous.

    Source: Cabrera 2006, section 3.1 and equations (11) to (13), with a signed solid angle; theory.md B7, B9, D.
    """
    if gauge not in GAUGES:
        raise unknown_name("gauge", gauge, GAUGES)
    spatial = motion.momentum.reshape(-1, 3)
    start = motion.initial_attitude.reshape(-1, 3, 3)
    size = np.linalg.norm(spatial, axis=-1)
    has_phase = size > 0.0
    # Without momentum any axis serves: what hangs on it is set to zero below.
    axis = np.where(has_phase[:, None], spatial, [0.0, 0.0, 1.0]) / np.where(has_phase, size, 1.0)[:, None]
    duration = motion.duration
    closure = np.eye(3) if motion.deformation.closure is None else motion.deformation.closure
    lift = _lift(motion.interpolant, motion.tolerance)
    carried = start @ lift.rotation(np.array([duration]))[0, 0] @ closure
    holonomy = carried @ so3.transpose(start)
    end = motion.final_attitude.reshape(-1, 3, 3)
    total = end @ closure @ so3.transpose(start)
    dynamical = np.where(has_phase[:, None, None], total @ so3.transpose(holonomy), np.eye(3))
    frames: Frames | None = None
    if gauge == "horizontal":
        frames = lift_frames(lift)
    elif gauge == "principal":
        frames = principal_frames(motion.deformation)
    dynamic, area, ends = _phase_integrals(motion, axis, frames, refine=gauge == "principal")
    dynamic, area = np.where(has_phase, dynamic, 0.0), np.where(has_phase, area, 0.0)
    first, last = _in_gauge(start, end, frames, duration)
    closing = so3.between(ends[:, 1], ends[:, 0])
    tilt = np.where(has_phase[:, None, None], first @ closing @ so3.transpose(first), np.eye(3))
    phase = dynamic - area
    read_off = so3.angle_about(last @ so3.transpose(first) @ so3.transpose(tilt), axis) * has_phase
    batch = motion.batch
    matrix = (*batch, 3, 3)
    return PhaseSplit(
        gauge=gauge,
        total_rotation=total.reshape(matrix),
        holonomy=holonomy.reshape(matrix),
        dynamical_rotation=dynamical.reshape(matrix),
        montgomery_phase=phase.reshape(batch)[()],
        montgomery_angle=so3.wrap(phase).reshape(batch)[()],
        dynamic_phase=dynamic.reshape(batch)[()],
        geometric_phase=(0.0 - area).reshape(batch)[()],
        solid_angle=area.reshape(batch)[()],
        tilt=tilt.reshape(matrix),
        momentum_gap=(_angle_between(ends[:, 0], ends[:, 1]) * has_phase).reshape(batch)[()],
        shape_gap=motion.deformation.shape_gap,
        residual=np.abs(so3.wrap(phase - read_off)).reshape(batch)[()],
        is_loop=motion.deformation.closure is not None,
        has_phase=has_phase.reshape(batch)[()],
    )


class _Resolved:
    """A finished interpolant in the place of a sampler: nothing is evaluated again."""

    def __init__(self, interpolant: Interpolant) -> None:
        self._interpolant = interpolant

    def refine(self, momentum: float, tolerance: float) -> None:
        """Nothing: the motion has already been sampled as finely as its own tolerance asked."""

    def interpolant(self) -> Interpolant:
        return self._interpolant

    def error(self, momentum: float) -> float:  # noqa: ARG002
        return 0.0


def _lift(interpolant: Interpolant, tolerance: float) -> SteppedRotation:
    """The horizontal lift on the motion's own samples."""
    return stepped_rotation(_Resolved(interpolant), np.zeros((1, 3)), min(tolerance, 1e-11))


def _in_gauge(start: Array, end: Array, frames: Frames | None, duration: float) -> tuple[Array, Array]:
    """Attitudes at the start and the end, of the gauge's frame."""
    if frames is None:
        return start, end
    turns, _ = frames(np.array([0.0, duration]))
    return start @ turns[0].T, end @ turns[1].T


def _phase_integrals(motion: Motion, axis: Array, frames: Frames | None, *, refine: bool) -> tuple[Array, Array, Array]:
    """Dynamic phase (B,), solid angle (B,), and the momentum directions in the gauge at both ends (B, 2, 3).

    The curve is cut at the integrator's steps, and finer where the gauge's own frame turns faster than those
    (`refine`). Between a step's arc and its chord the area is integrated with the chord's start as reference,
    where the area form is smooth; the chords form a polygon whose area is exact. So no curve is near the
    singularity of the area form, whatever it winds around.
    """
    edges = motion.solution.times
    dynamic, slivers, corners = _by_step(motion, axis, frames, edges)
    while refine:
        halved = np.sort(np.concatenate([edges, 0.5 * (edges[:-1] + edges[1:])]))
        fine_dynamic, _, fine_corners = _by_step(motion, axis, frames, halved)
        change = np.abs(fine_dynamic[:, 0::2] + fine_dynamic[:, 1::2] - dynamic).max(axis=0)
        bend = np.linalg.norm(fine_corners[:, 2::2] - fine_corners[:, :-2:2], axis=-1).max(axis=0)
        rough = (change > 1e-13 * max(1.0, float(np.abs(dynamic).sum(axis=1).max()))) | (bend > 0.5)
        if not rough.any():
            break
        if len(edges) > _MOST_STEPS:
            raise GaugeError(f"the gauge's frame turns too fast to be followed near t = {edges[:-1][rough][0]:.9g} s")
        edges = np.sort(np.concatenate([edges, 0.5 * (edges[:-1] + edges[1:])[rough]]))
        dynamic, slivers, corners = _by_step(motion, axis, frames, edges)
    area = slivers.sum(axis=1)
    for row, polygon in enumerate(corners):
        reference = sphere.far_reference(polygon)
        closing = np.stack([polygon[-1], so3.middle(polygon[-1], polygon[0]), polygon[0]])
        corner = np.concatenate([polygon, closing[1:]])
        area[row] += sphere.triangle_area(reference, corner[:-1], corner[1:]).sum()
    return dynamic.sum(axis=1), area, corners[:, [0, -1]]


def _by_step(motion: Motion, axis: Array, frames: Frames | None, edges: Array) -> tuple[Array, Array, Array]:
    """Dynamic phase and area between arc and chord for each step (B, K), directions at the edges (B, K + 1, 3)."""
    steps = np.diff(edges)
    nodes = (edges[:-1, None] + steps[:, None] * 0.5 * (_NODES + 1.0)).ravel()
    weights = 0.5 * steps[:, None] * _WEIGHTS
    direction, rate, corners = _momentum_curve(motion, axis, frames, nodes, edges)
    shape = (len(axis), len(steps), len(_NODES), 3)
    direction, rate = direction.reshape(shape), rate.reshape(shape)
    dynamic = (np.sum(direction * rate, axis=-1) * weights).sum(axis=-1)
    slope = np.cross(direction, rate)
    slivers = sphere.area_rate(corners[:, :-1, None], direction, slope)
    return dynamic, (slivers * weights).sum(axis=-1), corners


def _momentum_curve(
    motion: Motion, axis: Array, frames: Frames | None, nodes: Array, edges: Array
) -> tuple[Array, Array, Array]:
    """Unit momentum and angular velocity in the gauge at the nodes (B, N, 3), unit momentum at the edges."""
    start = so3.apply(so3.transpose(motion.initial_attitude.reshape(-1, 3, 3)), axis)
    size = np.linalg.norm(motion.momentum.reshape(-1, 3), axis=-1)

    def unit(times: Array) -> Array:
        return so3.apply(so3.transpose(motion.solution.rotation(times)), start[:, None, :])

    inverse, drift = motion.interpolant.inverse_and_drift(nodes)
    direction, corners = unit(nodes), unit(edges)
    rate = so3.apply(inverse, size[:, None, None] * direction) - drift
    if frames is None:
        return direction, rate, corners
    turn, spin = frames(nodes)
    turn_at_edges, _ = frames(edges)
    return so3.apply(turn, direction), so3.apply(turn, rate - spin), so3.apply(turn_at_edges, corners)


def _angle_between(a: Array, b: Array) -> Array:
    return 2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
