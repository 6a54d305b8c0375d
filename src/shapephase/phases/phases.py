"""The rotation of a motion split into shape holonomy and Montgomery phase."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import partial
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from .. import so3, sphere
from ..arguments import check_choice, check_object, times_argument
from ..arrays import Array, Integers, finite_array
from ..display import short_repr
from ..errors import ShapeError
from ..inertia_tensor import inverse_inertia
from ..integrator.closing import areas_back, closed_curves
from ..letters import value_text
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.motion_record import write_table
from ..reconstruction.reconstruction import Motion
from ..run_progress import ProgressCallback, watched
from ._curve_errors import arc_errors, running_errors, split_errors
from .error_estimates import ArcErrors, Deferred, RunningErrors, by_parts
from .forced_split import ForcedSplit, forced_split
from .momentum_curve import Gauge, momentum_curve
from .phase_split import PhaseSplit, SplitMotion

CLOSINGS = ("start", "reference")  # ends of the great circle that closes the momentum's curve in `running_phases`


@overload
def split(motion: Motion, gauge: Gauge = "horizontal", *, progress: ProgressCallback | None = None) -> PhaseSplit: ...


@overload
def split(
    motion: ForcedMotion, gauge: Gauge = "horizontal", *, progress: ProgressCallback | None = None
) -> ForcedSplit: ...


def split(
    motion: Motion | ForcedMotion,
    gauge: Gauge = "horizontal",
    *,
    progress: ProgressCallback | None = None,
) -> PhaseSplit | ForcedSplit:
    """Split the rotation of a motion into shape holonomy and Montgomery phase.

    For a `ForcedMotion` the result is a `ForcedSplit`, which also has the solid angle of the momentum in space.
    Equations :eq:`split`, :eq:`closed-split` and :eq:`tilt` of the documentation.
    Source: Cabrera 2006, section 3.1 and equations (11) to (13), with a signed solid angle; theory.md B7, B9, D.

    Parameters
    ----------
    gauge : "horizontal", the frame that the shape motion alone would carry along (shape apart from momentum);
        "base", the deformation's own frame, whose phase already contains the shape's part; "principal", the
        principal axes of inertia; "mean_body", the frame nearest to the start shape; "link:NAME", a link of an
        articulated body; or U(t) itself, a function as for `in_gauge`
    progress : as for `reconstruct`

    Raises
    ------
    UnknownNameError
        For another gauge.
    GaugeError
        If the gauge's frame does not exist or is not continuous; with an external torque, if the momentum passes
        through zero, where it has no direction.
    RunStopped
        If `progress` stopped it.

    Examples
    --------
    >>> top = sp.EulerTop.principal([1.0, 2.0, 3.0], [0.6, 0.9, 0.5])
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), top.period), [0.6, 0.9, 0.5])
    >>> print(f"{sp.split(motion, 'base').montgomery_angle:.9f}, {sp.so3.wrap(top.montgomery_phase):.9f}")
    2.523520948, 2.523520948
    """
    if isinstance(motion, ForcedMotion):
        return forced_split(motion, gauge)
    check_object(motion, "Motion", "motion")
    if len(motion.parts) > 1:
        with watched(progress):
            return by_parts(motion, lambda part: split(part, gauge))
    deformation, batch = motion.deformation, motion.batch
    with watched(progress):
        curve = momentum_curve(motion, gauge)
        lift = motion.lift_with_errors
    has_phase = curve.has_phase
    moving = has_phase[:, None, None]
    start = motion.initial_attitude.reshape(-1, 3, 3)
    end, first, last = curve.end_attitudes
    closure = np.eye(3) if deformation.closure is None else deformation.closure
    total = end @ closure @ so3.transpose(start)
    holonomy = start @ lift.end @ closure @ so3.transpose(start)
    has_wheels = deformation.has_wheels
    dynamical = np.where(moving | has_wheels, total @ so3.transpose(holonomy), np.eye(3))
    wheels = np.broadcast_to(np.eye(3), total.shape)
    if has_wheels:
        with watched(progress):
            wheels = start @ motion.lift_without_momentum.end @ so3.transpose(start @ lift.end)
    closed = closed_curves(curve.corners, curve.references, curve.axis, first, last)
    tilt = np.where(moving, closed.tilt, np.eye(3))
    dynamic = np.where(has_phase, curve.dynamic.sum(axis=1), 0.0)
    area = np.where(has_phase, curve.slivers.sum(axis=1) + closed.area, 0.0)
    phase = dynamic - area
    residual = np.abs(so3.wrap(phase - closed.turn * has_phase))
    matrix = (*batch, 3, 3)
    return PhaseSplit(
        gauge=gauge if isinstance(gauge, str) else "given",
        total_rotation=total.reshape(matrix),
        holonomy=holonomy.reshape(matrix),
        dynamical_rotation=dynamical.reshape(matrix),
        wheel_rotation=wheels.reshape(matrix),
        momentum_rotation=np.where(moving, dynamical @ so3.transpose(wheels), np.eye(3)).reshape(matrix),
        montgomery_phase=phase.reshape(batch)[()],
        montgomery_angle=so3.wrap(phase).reshape(batch)[()],
        dynamic_phase=dynamic.reshape(batch)[()],
        geometric_phase=(0.0 - area).reshape(batch)[()],
        solid_angle=area.reshape(batch)[()],
        closing_tilt=tilt.reshape(matrix),
        momentum_gap=(closed.gap * has_phase).reshape(batch)[()],
        closing_phase=(0.0 - closed.closing * has_phase).reshape(batch)[()],
        shape_gap=deformation.shape_gap,
        residual=residual.reshape(batch)[()],
        is_loop=deformation.closure is not None,
        has_phase=has_phase.reshape(batch)[()],
        has_wheels=has_wheels,
        about=SplitMotion(
            label=deformation.label,
            duration=motion.duration,
            momentum=motion.momentum,
            error_estimate=motion.error_estimate,
            evaluations=motion.evaluations,
        ),
        _errors=Deferred(partial(split_errors, motion, curve, residual)),
    )


@dataclass(frozen=True, eq=False)
class RunningPhases:
    """Phases of a motion in time, starting from zero; fields are batch + t.shape. Made by `running_phases`.

    Directions of the momentum are joined to `reference` by great circles: with B(u) the shortest turn from there to
    u, and R the attitude of the gauge's frame,

        R(t) B(u(t)) = exp(montgomery_phase(t) hat(mu)) R(0) B(u(0)).

    Closed to the "start", they are the phases of the motion so far, and those of `split` at its end: the great circle
    goes from the momentum back to where it began, and areas are counted from the region that the whole curve leaves
    farthest. They grow continuously, but where that great circle passes over this region the area jumps by 4 pi.
    Closed to a "reference" far from the points opposite the curve nothing jumps, and the phases are those of the
    closed curve whenever the momentum is back at its start; the end of an open curve is not that of `split`.

    Attributes
    ----------
    times : (...) [s]
    gauge : the frame from which the momentum was seen
    closing : "start" or "reference"
    dynamic_phase, geometric_phase, montgomery_phase : unwrapped [rad]
    montgomery_angle : the last in (-pi, pi] [rad]
    solid_angle : of the curve so far, closed; minus the geometric phase [sr]
    momentum_gap : angle between the momentum and its start, in this gauge [rad]
    closing_phase : part of the geometric phase by the great circle back to the start; 0 closed to a "reference" [rad]
    jumps : number of jumps of the solid angle by 4 pi so far; solid_angle - 4 pi jumps is continuous
    reference : batch + (3,), in the gauge's frame; closed to the start, that direction
    residual : batch, the largest |phase - the same angle read off the attitude| modulo 2 pi [rad]
    error_estimates : of the phases at each time
    """

    times: Array
    gauge: str
    closing: str
    dynamic_phase: Array
    geometric_phase: Array
    montgomery_phase: Array
    montgomery_angle: Array
    solid_angle: Array
    momentum_gap: Array
    closing_phase: Array
    jumps: Integers
    reference: Array
    residual: Array
    error_estimates: RunningErrors

    __repr__ = short_repr

    def write_csv(self, path: str | os.PathLike[str]) -> None:
        """Write a time series: each phase in degrees, then in radians, the solid angle, and the jumps so far.

        The geometric phase includes the closing phase, whose column is beside the momentum's gap.

        Raises ShapeError for the phases of a batch, or of a single time.
        """
        if self.times.ndim != 1 or self.montgomery_phase.ndim != 1:
            raise ShapeError(f"a table holds one motion at (N,) times, these are {self.montgomery_phase.shape}")
        names = ("dynamic_phase", "geometric_phase", "montgomery_phase", "closing_phase", "momentum_gap")
        columns = {"time": self.times} | {f"{name}_deg": np.degrees(getattr(self, name)) for name in names}
        columns |= {f"{name}_rad": getattr(self, name) for name in names}
        write_table(path, columns | {"solid_angle_sr": self.solid_angle, "jumps": self.jumps.astype(np.float64)})


def running_phases(
    motion: Motion, t: ArrayLike, gauge: Gauge = "horizontal", *, closing: str = "start"
) -> RunningPhases:
    """Return all phases in time, ending in those of `split`.

    Raises the errors of `split`, and UnknownNameError for another closing. Source: Cabrera 2006, equation (12);
    theory.md D5, D9; numerics.md section 3 (branch).

    Parameters
    ----------
    t : times (...) [s]
    gauge : as for `split`
    closing : how the momentum's curve so far is closed: "start", by the great circle back to its start, which ends in
        the closing of `split`; "reference", by great circles to one fixed direction, without jumps

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 10.0), [0.0, 0.0, 5.0])
    >>> sp.running_phases(motion, [0.0, 5.0, 10.0], "base").dynamic_phase.round(9).tolist()  # 2 rad/s
    [0.0, 10.0, 20.0]
    """
    check_object(motion, "Motion", "motion")
    if len(motion.parts) > 1:
        return by_parts(motion, lambda part: running_phases(part, t, gauge, closing=closing), shared=("times",))
    check_choice(closing, "closing", CLOSINGS)
    to_start = closing == "start"
    times = times_argument(t, motion.duration)
    flat = times.ravel()
    curve = momentum_curve(motion, gauge, times=flat, clear_of_start=to_start)
    dynamic, area = curve.swept(flat)
    references, back, jumps = curve.references, 0.0 * area, np.zeros(area.shape, dtype=np.int64)
    if to_start:
        references = curve.corners[:, 0]
        back, jumps = curve.closing(flat)
        area = area + back
    directions = curve.directions(flat)
    gap = so3.angle_between(curve.corners[:, :1], directions) * curve.has_phase[:, None]
    about = so3.between(references[:, None], directions)
    frames = curve.attitudes(flat) @ about
    begin = curve.attitudes(np.zeros(1)) @ so3.between(references, curve.corners[:, 0])[:, None]
    seen = so3.angle_about(frames @ so3.transpose(begin), curve.axis[:, None]) * curve.has_phase[:, None]
    phase = dynamic - area
    residual, shape = np.abs(so3.wrap(phase - seen)), (*motion.batch, *times.shape)
    return RunningPhases(
        times=times,
        gauge=gauge if isinstance(gauge, str) else "given",
        closing=closing,
        dynamic_phase=dynamic.reshape(shape)[()],
        geometric_phase=(0.0 - area).reshape(shape)[()],
        montgomery_phase=phase.reshape(shape)[()],
        montgomery_angle=so3.wrap(phase).reshape(shape)[()],
        solid_angle=area.reshape(shape)[()],
        momentum_gap=gap.reshape(shape)[()],
        closing_phase=(0.0 - back).reshape(shape)[()],
        jumps=jumps.reshape(shape)[()],
        reference=references.reshape(*motion.batch, 3),
        residual=residual.max(axis=-1, initial=0.0).reshape(motion.batch)[()],
        error_estimates=running_errors(motion, curve, flat, residual, references, shape),
    )


@dataclass(frozen=True, eq=False)
class ArcPhases:
    """A motion cut into arcs, each with a phase of its own; fields have the motion's batch axes in front.

    Made by `arc_phases`.

    With R the attitude of the gauge's frame, arc k of K from times[k] to times[k + 1] turns it by

        R(times[k + 1]) R(times[k])^T = exp(montgomery_phase[k] hat(mu)) closing_tilt[k],

    and the arcs add up: total_phase = the sum of their Montgomery phases - polygon_angle is the phase of the whole,
    and total_closing_tilt the tilt of its closing.

    Attributes
    ----------
    times : (K + 1,) [s]
    gauge : the frame from which the momentum was seen
    dynamic_phase, geometric_phase, montgomery_phase : (K,) each arc closed by its great circle [rad]
    solid_angle : (K,) minus the geometric phase [sr]
    closing_tilt : (K, 3, 3) transport along the closing great circles, inertial axes
    momentum_gap : (K,) angles between the ends of the arcs [rad]
    polygon_angle : signed area of the closed polygon of those great circles [sr]
    total_phase : of all arcs as one [rad]
    total_closing_tilt : (3, 3)
    error_estimates : of each of these numbers
    """

    times: Array
    gauge: str
    dynamic_phase: Array
    geometric_phase: Array
    montgomery_phase: Array
    solid_angle: Array
    closing_tilt: Array
    momentum_gap: Array
    polygon_angle: Array
    total_phase: Array
    total_closing_tilt: Array
    error_estimates: ArcErrors

    __repr__ = short_repr


def arc_phases(motion: Motion, times: ArrayLike, gauge: Gauge = "horizontal") -> ArcPhases:
    """Return the phases of the arcs of a motion between given times, and their sum.

    All areas are counted from one region that no arc enters, so the arcs add up to the whole, not only modulo 4 pi.

    Raises also the errors of `split`. Source: Cabrera 2006, section 4.1; theory.md D9, D10.

    Parameters
    ----------
    times : (K + 1,) increasing [s]; for the loops of a repeated path, the multiples of its period
    gauge : as for `split`

    Raises
    ------
    ShapeError
        If the times do not increase.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 10.0), [0.0, 0.0, 5.0])
    >>> sp.arc_phases(motion, [0.0, 4.0, 10.0], "base").dynamic_phase.round(9).tolist()
    [8.0, 12.0]
    """
    check_object(motion, "Motion", "motion")
    cuts = times_argument(finite_array(times, "times", (None,), unit="s"), motion.duration)
    if cuts.ndim != 1 or len(cuts) < 2 or np.any(np.diff(cuts) <= 0.0):
        raise ShapeError(f"times: two or more that increase are needed, (K + 1,), got {value_text(cuts)}")
    if len(motion.parts) > 1:
        return by_parts(motion, lambda part: arc_phases(part, times, gauge), shared=("times",))
    curve = momentum_curve(motion, gauge, times=cuts)
    references = curve.references
    swept_phase, swept_area = curve.swept(cuts)
    ends = curve.directions(cuts)
    attitudes = curve.attitudes(cuts)
    moving = curve.has_phase[:, None]

    def closed(start: Array, end: Array) -> Array:
        return areas_back(references[:, None], end, start) * moving

    def tilted(frames: Array, start: Array, end: Array) -> Array:
        tilts = frames @ so3.between(end, start) @ so3.transpose(frames)
        return np.where(moving[..., None, None], tilts, np.eye(3))

    closing = closed(ends[:, :-1], ends[:, 1:])
    whole = closed(ends[:, :1], ends[:, -1:])[:, 0]
    dynamic, area = np.diff(swept_phase, axis=1), np.diff(swept_area, axis=1) + closing
    phase = dynamic - area
    polygon = whole - closing.sum(axis=1)
    tilts = tilted(attitudes[:, :-1], ends[:, :-1], ends[:, 1:])
    tilt = tilted(attitudes[:, :1], ends[:, :1], ends[:, -1:])

    def apart(phases: Array, starts: Array, stops: Array, transports: Array) -> Array:
        """Differences between phases and the angles read off the attitudes."""
        turns = stops @ so3.transpose(starts) @ so3.transpose(transports)
        return np.abs(so3.wrap(phases - so3.angle_about(turns, curve.axis[:, None]))) * moving

    total = phase.sum(axis=1) - polygon
    residuals = (
        apart(phase, attitudes[:, :-1], attitudes[:, 1:], tilts),
        apart(total[:, None], attitudes[:, :1], attitudes[:, -1:], tilt),
    )
    batch = motion.batch
    arcs = (*batch, len(cuts) - 1)
    return ArcPhases(
        times=cuts,
        gauge=gauge if isinstance(gauge, str) else "given",
        dynamic_phase=dynamic.reshape(arcs),
        geometric_phase=(0.0 - area).reshape(arcs),
        montgomery_phase=phase.reshape(arcs),
        solid_angle=area.reshape(arcs),
        closing_tilt=tilts.reshape(*arcs, 3, 3),
        momentum_gap=(so3.angle_between(ends[:, :-1], ends[:, 1:]) * moving).reshape(arcs),
        polygon_angle=polygon.reshape(batch)[()],
        total_phase=total.reshape(batch)[()],
        total_closing_tilt=tilt[:, 0].reshape(*batch, 3, 3),
        error_estimates=arc_errors(motion, curve, cuts, residuals),
    )


def parallel_transport(motion: Motion, t: ArrayLike, gauge: Gauge = "base") -> Array:
    """Return Par(R(0)) along the momentum's curve: attitudes that roll with Pi without a turn about the momentum.

    R(t) = exp(dynamic_phase(t) hat(mu)) Par(t): it turns at omega_h = Pi' x Pi / |Pi|^2 (gauge axes).

    Equation :eq:`open-arc` of the documentation.
    Raises the errors of `split`. Source: Cabrera 2006, section 4.1; theory.md D4, D9.

    Parameters
    ----------
    t : times (...) [s]
    gauge : as for `split`

    Returns
    -------
    batch + (..., 3, 3), of the gauge's frame; the attitude itself without momentum

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 3.0), [0.0, 0.0, 5.0])
    >>> print(sp.parallel_transport(motion, 3.0).round(9) + 0.0)  # the momentum stands still in the body
    [[1. 0. 0.]
     [0. 1. 0.]
     [0. 0. 1.]]
    """
    check_object(motion, "Motion", "motion")
    if len(motion.parts) > 1:
        return by_parts(motion, lambda part: parallel_transport(part, t, gauge))
    times = times_argument(t, motion.duration)
    flat = times.ravel()
    curve = momentum_curve(motion, gauge, times=flat)
    dynamic, _ = curve.swept(flat)
    back = so3.exp(-dynamic[..., None] * curve.axis[:, None])
    return (back @ curve.attitudes(flat)).reshape(*motion.batch, *times.shape, 3, 3)


def dynamic_phase_from_energy(motion: Motion) -> Array:
    """Return the dynamic phase of a motion in the base gauge, from kinetic energies: batch [rad].

    The integral of 2 T - 2 T_0 + L_o . I^-1 L_o - I^-1 L_o . Pi over |Pi|, T the whole kinetic energy about the centre
    of mass and T_0 that of the shape motion alone: a check of `dynamic_phase` that sums over the links.

    Source: Cabrera 2006, remark 3.7; theory.md D11.

    Raises
    ------
    GaugeError
        If the deformation is known by its inertia only.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 3.0), [0.0, 0.0, 5.0])
    >>> print(f"{float(sp.dynamic_phase_from_energy(motion)):.9f}")  # 2 rad/s for 3 s
    6.000000000
    """
    check_object(motion, "Motion", "motion")
    edges = motion.solution.times
    nodes, weights = sphere.gauss_nodes(edges[:-1], edges[1:])
    times = nodes.ravel()
    description = motion.deformation.description
    inertia, internal = description.sample(times)
    drift = so3.apply(inverse_inertia(inertia, times), internal)
    turning = motion.angular_velocity(times).reshape(-1, len(times), 3)
    momentum = motion.body_momentum(times).reshape(-1, len(times), 3)
    whole, shape_only = description.kinetic_energy(times, turning), description.kinetic_energy(times, 0.0 * turning)
    along = 2.0 * (whole - shape_only) + np.sum(drift * (internal - momentum), axis=-1)
    magnitude = np.linalg.norm(motion.momentum.reshape(-1, 3), axis=-1)
    phase = along @ weights.ravel() / np.where(magnitude > 0.0, magnitude, 1.0)
    return np.where(magnitude > 0.0, phase, 0.0).reshape(motion.batch)[()]
