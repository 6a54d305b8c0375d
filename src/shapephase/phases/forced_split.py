"""The split of a motion under a torque from outside: the momentum's direction moves in space, too."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from .. import so3, sphere
from ..arrays import Array, lock_arrays
from ..deformation.deformation import Deformation
from ..deformation.gauge import horizontal_gauge, in_gauge, named_gauge
from ..display import short_repr
from ..errors import AccuracyNotReached, GaugeError
from ..plain_data import plain
from ..reconstruction.forced_motion import ForcedMotion
from ..refinement import halved, settled
from .momentum_curve import Gauge

_NO_MOMENTUM = 1e-9  # share of the largest momentum below which it has no direction
_DOUBT = 1e-3  # relative error from which it has none
_SETTLED = 1e-12  # [sr], [rad], below the error of any motion
_ROUNDING = 1e-14  # [rad] of a direction, where the motion is as good as exact
_HALVINGS = 10  # of all steps, for a momentum that is small for a short time only


@dataclass(frozen=True, eq=False, kw_only=True)
class ForcedSplit:
    """The rotation of a motion under a torque from outside.

    The direction of the momentum goes along a curve u in the body, seen in a gauge, and along a curve m in space, each
    closed by the great circle from its end to its start. With G_u and G_m the shortest turns along these circles, and
    R the attitude of the gauge's frame,

        G_m R(T) G_u^T = exp(phase hat(m(0))) R(0),

        phase = dynamic_phase - body_solid_angle + space_solid_angle (mod 2 pi).

    Equation :eq:`forced-phase` of the documentation.

    Attributes
    ----------
    gauge : the frame that the momentum was seen from
    total_rotation : (3, 3) Delta R, which takes the shape at the start to that at the end
    holonomy : (3, 3) what the shape alone does; is_loop False: the lift's endpoint of an open path
    dynamical_rotation : (3, 3) the rest: total = dynamical holonomy; what wheels store turns the body by is in it
    phase : as above [rad]; `angle` is the same in (-pi, pi]
    dynamic_phase : integral of omega . Pi/|Pi| [rad]
    body_solid_angle, space_solid_angle : signed, of the closed curves u and m [sr]
    body_gap, space_gap : angles between the ends of u, and of m [rad]
    residual : |phase - the same angle read off the attitudes| modulo 2 pi [rad]
    error_estimate : of phase and residual, by the errors of attitude and momentum [rad]
    work, energy_change : of the torque, and of the kinetic energy; the joints did the difference; None where only the
        inertia is known, not the masses [J]
    is_loop : whether the shape is the same at the end

    Examples
    --------
    >>> push = sp.ExternalTorque(lambda state: [0.0, 0.2, 0.0], axes="space")
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 1.5, 2.0]), 4.0), [0.3, 0.2, 1.0], torque=push)
    >>> parts = sp.split(motion, "base")
    >>> bool(parts.residual < 1e-8)
    True
    """

    gauge: str
    total_rotation: Array
    holonomy: Array
    dynamical_rotation: Array
    phase: float
    dynamic_phase: float
    body_solid_angle: float
    space_solid_angle: float
    body_gap: float
    space_gap: float
    residual: float
    error_estimate: float
    work: float
    energy_change: float | None
    is_loop: bool

    __repr__ = short_repr
    __post_init__ = lock_arrays

    @property
    def angle(self) -> float:
        """The phase in (-pi, pi] [rad]."""
        return float(so3.wrap(self.phase))

    def to_dict(self) -> dict[str, Any]:
        """Everything for JSON, rotations as lists, units in names."""
        units = {"body_solid_angle": "_sr", "space_solid_angle": "_sr", "work": "_J", "energy_change": "_J"}
        units |= dict.fromkeys(("gauge", "total_rotation", "holonomy", "dynamical_rotation", "is_loop"), "")
        return {name + units.get(name, "_rad"): value for name, value in plain(self).items()}


def forced_split(motion: ForcedMotion, gauge: Gauge) -> ForcedSplit:
    """Split of a motion under a torque."""
    deformation = motion.deformation
    least, when = _least_momentum(motion)
    most = float(np.linalg.norm(motion.momentum(motion.solution.times), axis=-1).max())
    if least <= _NO_MOMENTUM * most or least * _DOUBT <= motion.momentum_error:
        raise GaugeError(
            f"the momentum passes through zero at t = {when:.6g} s ({least:.3g} kg m^2/s of {most:.3g}): it has no "
            "direction there, and the motion no phase; split the parts before and after"
        )
    frames = _frames(deformation, gauge)
    edges = np.union1d(motion.solution.times, motion.breaks)

    def in_body(times: Array) -> tuple[Array, Array]:
        """Direction of the momentum in the gauge, and its rate: that of m, less the frame's turn."""
        turn, spin, magnitude = _seen(motion, frames, times)
        pi = so3.apply(turn, motion.body_momentum(times))
        change = so3.apply(turn, motion.torque(times)) + np.cross(pi, spin)
        return _direction(pi, change, magnitude)

    def in_space(times: Array) -> tuple[Array, Array]:
        momenta = motion.momentum(times)
        change = so3.apply(motion.attitude(times), motion.torque(times))
        return _direction(momenta, change, np.linalg.norm(momenta, axis=-1))

    dynamic, length = _dynamic_phase(motion, frames, edges)
    body_area, space_area = (float(sphere.curve_area(curve, edges, _SETTLED)) for curve in (in_body, in_space))
    ends = np.array([0.0, motion.duration])
    (u, v), (m, n) = in_body(ends)[0], in_space(ends)[0]
    attitudes = motion.attitude(ends)
    first, last = attitudes @ so3.transpose(frames(ends)[0])
    phase = dynamic - body_area + space_area
    turned = so3.between(n, m) @ last @ so3.between(v, u).T @ first.T
    read_off = float(so3.angle_about(turned, m))
    closure = np.eye(3) if deformation.closure is None else deformation.closure
    lift = horizontal_gauge(deformation).frame(motion.duration) @ deformation.frame(motion.duration).T
    change = None
    with suppress(GaugeError):  # where only the inertia is known
        change = float(np.diff(deformation.kinetic_energy(ends, motion.angular_velocity(ends)))[0])
    total = attitudes[1] @ closure @ attitudes[0].T
    holonomy = attitudes[0] @ lift @ closure @ attitudes[0].T
    # The curve in the body is displaced by both errors, by which areas and read-off angle change about as much.
    doubt = motion.error_estimate + motion.momentum_error / least + _ROUNDING
    gaps = so3.angle_between(np.stack([v, n]), np.stack([u, m]))
    # Each radian by which an end is displaced across its closing great circle adds so much to the area.
    closing = min(float(np.tan(0.5 * gaps).sum()) * doubt, 2.0 * np.pi)
    return ForcedSplit(
        gauge=gauge if isinstance(gauge, str) else "given",
        total_rotation=total,
        holonomy=holonomy,
        dynamical_rotation=total @ holonomy.T,
        phase=phase,
        dynamic_phase=dynamic,
        body_solid_angle=body_area,
        space_solid_angle=space_area,
        body_gap=float(gaps[0]),
        space_gap=float(gaps[1]),
        residual=float(np.abs(so3.wrap(phase - read_off))),
        error_estimate=(4.0 + length) * doubt + closing + _SETTLED,
        work=float(motion.work(motion.duration)),
        energy_change=change,
        is_loop=deformation.closure is not None,
    )


def _frames(deformation: Deformation, gauge: Gauge) -> Callable[[Array], tuple[Array, Array]]:
    """U(t) of a gauge and its body rates: (N,) -> (N, 3, 3), (N, 3). Raises like `split`."""
    if isinstance(gauge, str) and gauge == "base":
        return lambda t: (np.broadcast_to(np.eye(3), (len(t), 3, 3)), np.zeros((len(t), 3)))
    seen: Any = named_gauge(deformation, gauge) if isinstance(gauge, str) else in_gauge(deformation, gauge)
    return seen.description.frames


def _seen(motion: ForcedMotion, frames: Any, times: Array) -> tuple[Array, Array, Array]:
    """U(t), the angular velocity of the gauge's frame in its own axes, and the size of the momentum."""
    turn, rate = frames(times)
    spin = so3.apply(turn, motion.angular_velocity(times) - rate)
    return turn, spin, np.linalg.norm(motion.momentum(times), axis=-1)


def _dynamic_phase(motion: ForcedMotion, frames: Any, edges: Array) -> tuple[float, float]:
    """The integral of omega . Pi/|Pi|, and that of the size of omega, by which errors of direction count [rad]."""

    def integrals(edges: Array) -> tuple[float, float]:
        nodes, weights = sphere.gauss_nodes(edges[:-1], edges[1:])
        turn, spin, magnitude = _seen(motion, frames, nodes.ravel())
        along = so3.apply(turn, motion.body_momentum(nodes.ravel())) / magnitude[:, None]
        weight = weights.ravel()
        return float(weight @ np.sum(spin * along, axis=-1)), float(weight @ np.linalg.norm(spin, axis=-1))

    phases = settled(map(integrals, halved(edges, _HALVINGS)), lambda a, b: abs(a[0] - b[0]), _SETTLED * len(edges))
    if phases is None:
        raise AccuracyNotReached(
            "the dynamic phase does not settle: the momentum turns too fast, or its torque has undeclared breaks"
        )
    return phases


def _direction(vector: Array, change: Array, magnitude: Array) -> tuple[Array, Array]:
    unit = vector / magnitude[:, None]
    slope = change / magnitude[:, None]
    return unit, slope - np.sum(unit * slope, axis=-1)[:, None] * unit


def _least_momentum(motion: ForcedMotion) -> tuple[float, float]:
    """The least size of the momentum, and when: [kg m^2/s], [s]."""
    ends = motion.solution.times
    times = np.append(
        (ends[:-1, None] + np.diff(ends)[:, None] * np.linspace(0.0, 1.0, 8, endpoint=False)).ravel(), ends[-1]
    )
    sizes = np.linalg.norm(motion.momentum(times), axis=-1)
    place = int(np.argmin(sizes))
    left, right = times[max(place - 1, 0)], times[min(place + 1, len(times) - 1)]
    minimum = minimize_scalar(
        lambda t: float(np.sum(np.square(motion.momentum(min(max(t, left), right))))),
        bounds=(left, right),
        method="bounded",
        options={"xatol": 1e-12 * motion.duration},
    )
    least = float(np.sqrt(minimum.fun))
    return (least, float(minimum.x)) if least < sizes[place] else (float(sizes[place]), float(times[place]))
