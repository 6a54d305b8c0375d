"""A small body in gravity: its centre of mass on a Kepler orbit, and the torque that a free body neglects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import positive_argument
from ..arrays import Array, finite_array
from ..errors import AccuracyNotReached, ShapeError
from ..inertia_tensor import inverse_inertia
from ..reconstruction.reconstruction import Motion

# Of the mean anomaly [rad]: where 1e-6 rad of it are left, and where squares are no numbers any more.
_FARTHEST_ELLIPSE, _FARTHEST_HYPERBOLA = 1e10, 1e150
_HALVINGS, _AGREEMENT, _MOST_STEPS, _CHUNK = 10, 1e-4, 400_000, 10_000


@dataclass(frozen=True, eq=False)
class KeplerOrbit:
    """The path of a centre of mass around a fixed point, in closed form; made by `from_state` or `from_elements`.

    A small body turns as if it were free: its base origin is at `orbit.position(t) + motion.base_position(t)`.

    Attributes
    ----------
    gm : gravity of the other body, G M [m^3/s^2]
    pericentre : least distance [m]
    eccentricity : below 1 an ellipse, above 1 a hyperbola
    axes : (3, 3) inertial axes; columns to the pericentre, across it along the motion, and the orbit's normal
    mean_anomaly : at t = 0 [rad]; of a hyperbola e sinh(H) - H
    centre : (3,) where the other body is [m]
    """

    gm: float
    pericentre: float
    eccentricity: float
    axes: Array
    mean_anomaly: float
    centre: Array

    @staticmethod
    def from_state(
        position: ArrayLike, velocity: ArrayLike, gm: float, centre: ArrayLike = (0.0, 0.0, 0.0)
    ) -> KeplerOrbit:
        """The orbit through a position (3,) [m] with a velocity (3,) [m/s] at t = 0.

        Raises
        ------
        ShapeError
            For a fall straight to the centre, or a parabola (eccentricity 1 to 1e-12).
        """
        pull = positive_argument(gm, "gm", "a number in m^3/s^2")
        middle = _vector(centre, "centre", "m")
        arm, speed = _vector(position, "position", "m") - middle, _vector(velocity, "velocity", "m/s")
        distance, pace = float(np.linalg.norm(arm)), float(np.linalg.norm(speed))
        swept = np.cross(arm, speed)
        size = float(np.linalg.norm(swept))
        if size <= 1e-12 * distance * pace or size == 0.0:
            raise ShapeError(f"a velocity {speed} along the way from the centre {arm} leads straight into it")
        normal = swept / size
        # e cos and e sin of the true anomaly: the eccentricity vector in the frame of the position.
        out = arm / distance
        along, aside = size**2 / (pull * distance) - 1.0, size * float(arm @ speed) / (pull * distance)
        eccentricity, anomaly = float(np.hypot(along, aside)), float(np.arctan2(aside, along))
        first = so3.apply(so3.exp(-anomaly * normal), out)
        axes = np.stack([first, so3.apply(so3.hat(normal), first), normal], axis=-1)
        pericentre = size**2 / (pull * (1.0 + eccentricity))
        _refuse_parabola(1.0 - eccentricity)
        mean = _mean_anomaly(anomaly, eccentricity)
        return KeplerOrbit(pull, pericentre, eccentricity, axes, mean, middle)

    @staticmethod
    def from_elements(
        semi_major_axis: float,
        eccentricity: float,
        inclination: float,
        node: float,
        argument: float,
        mean_anomaly: float,
        gm: float,
        centre: ArrayLike = (0.0, 0.0, 0.0),
    ) -> KeplerOrbit:
        """The orbit with these elements at t = 0.

        Parameters
        ----------
        semi_major_axis : [m], below zero for a hyperbola
        eccentricity : 0 or more
        inclination, node, argument : turns about z by the node, x by the inclination, z by the argument of the
            pericentre [rad]
        mean_anomaly : [rad]

        Raises
        ------
        ShapeError
            If axis and eccentricity do not belong together, or the orbit is a parabola.
        """
        numbers = finite_array(
            [semi_major_axis, eccentricity, inclination, node, argument, mean_anomaly], "elements", (6,)
        )
        axis, e, tilt, turn, argument_angle, mean = (float(number) for number in numbers)
        _refuse_parabola(1.0 - e)
        if e < 0.0 or axis * (1.0 - e) <= 0.0:
            raise ShapeError(
                "an ellipse has an eccentricity from 0 to 1 and an axis above 0, a hyperbola more than 1 and below 0; "
                f"got eccentricity {e} and semi-major axis {axis} m"
            )
        x, z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
        axes = so3.exp(turn * z) @ so3.exp(tilt * x) @ so3.exp(argument_angle * z)
        pull = positive_argument(gm, "gm", "a number in m^3/s^2")
        return KeplerOrbit(pull, axis * (1.0 - e), e, axes, mean, _vector(centre, "centre", "m"))

    @property
    def semi_major_axis(self) -> float:
        """[m]; below zero for a hyperbola."""
        return self.pericentre / (1.0 - self.eccentricity)

    @property
    def mean_motion(self) -> float:
        """Rate of the mean anomaly [rad/s]: (gm/|a|^3)^(1/2), Kepler's third law."""
        return float(np.sqrt(self.gm / abs(self.semi_major_axis) ** 3))

    @property
    def period(self) -> float:
        """[s]; infinite for a hyperbola."""
        return 2.0 * np.pi / self.mean_motion if self.eccentricity < 1.0 else np.inf

    def position(self, t: ArrayLike) -> Array:
        """Where the centre of mass is: times (...), of any sign -> (..., 3) [m]."""
        times = finite_array(t, "t", unit="s")
        x, y, _, _ = self._in_plane(times)
        return self.centre + x[..., None] * self.axes[:, 0] + y[..., None] * self.axes[:, 1]

    def velocity(self, t: ArrayLike) -> Array:
        """How fast it moves: times (...) -> (..., 3) [m/s]."""
        times = finite_array(t, "t", unit="s")
        _, _, x, y = self._in_plane(times)
        return x[..., None] * self.axes[:, 0] + y[..., None] * self.axes[:, 1]

    def _in_plane(self, times: Array) -> tuple[Array, Array, Array, Array]:
        """Position and velocity along the pericentre and across it."""
        e, gap, axis = self.eccentricity, 1.0 - self.eccentricity, abs(self.semi_major_axis)
        mean = self.mean_anomaly + self.mean_motion * times
        if np.abs(mean).max(initial=0.0) > (_FARTHEST_ELLIPSE if e < 1.0 else _FARTHEST_HYPERBOLA):
            raise AccuracyNotReached(f"at times up to {np.abs(times).max():.3g} s the digits of the anomaly are lost")
        anomaly = eccentric_anomaly(mean, e)
        side = np.sqrt(abs(gap) * (1.0 + e))
        if e < 1.0:
            cosine, sine, half = np.cos(anomaly), np.sin(anomaly), 2.0 * np.sin(0.5 * anomaly) ** 2
            away, x = gap + e * half, gap - half
        else:
            cosine, sine, half = np.cosh(anomaly), np.sinh(anomaly), 2.0 * np.sinh(0.5 * anomaly) ** 2
            away, x = -gap + e * half, -gap - half
        pace = axis * self.mean_motion / away
        return axis * x, axis * side * sine, -pace * sine, pace * side * cosine


@dataclass(frozen=True)
class GravityTorque:
    """What the torque of gravity, neglected for a free body, does to a motion, to first order.

    Attributes
    ----------
    largest_torque : [N m]
    impulse : the largest change of the angular momentum [kg m^2/s]
    attitude_error : the largest turn away from the free motion [rad]
    tolerance : the turn that is allowed [rad]
    """

    largest_torque: float
    impulse: float
    attitude_error: float
    tolerance: float

    @property
    def is_free(self) -> bool:
        """Whether the free motion is the true one within the tolerance."""
        return self.attitude_error <= self.tolerance


def eccentric_anomaly(mean_anomaly: ArrayLike, eccentricity: float) -> Array:
    """Kepler's equation E - e sin(E) = M, or e sinh(H) - H = M for e > 1, solved for E or H to rounding.

    Parameters
    ----------
    mean_anomaly : (...) [rad]; E comes on the same turn
    eccentricity : 0 or more, not 1

    Raises
    ------
    ShapeError
        For a negative eccentricity, or 1.

    Newton's method, from above, where both sides are convex: no start fails.
    """
    mean = finite_array(mean_anomaly, "mean_anomaly", unit="rad")
    e = float(finite_array(eccentricity, "eccentricity"))
    if e < 0.0:
        raise ShapeError(f"eccentricity: 0 or more is needed, got {e}")
    _refuse_parabola(1.0 - e)
    turns = np.round(mean / (2.0 * np.pi)) * (2.0 * np.pi) if e < 1.0 else np.zeros_like(mean)
    rest = np.abs(mean - turns)
    gap = abs(1.0 - e)
    with np.errstate(divide="ignore", over="ignore"):
        by_line, by_cube = rest / gap, np.cbrt((np.pi**2 if e < 1.0 else 6.0) * rest / (e or 1e-300))
    first = np.minimum(by_line, rest + e) if e < 1.0 else np.arcsinh(by_line)
    anomaly = np.minimum(first, by_cube)
    for _ in range(60):
        excess = _excess(anomaly, e < 1.0)
        slope = gap + e * (2.0 * np.sin(0.5 * anomaly) ** 2 if e < 1.0 else 2.0 * np.sinh(0.5 * anomaly) ** 2)
        step = (gap * anomaly + e * excess - rest) / slope
        anomaly = anomaly - step
        # The next error is about the square of this step.
        if np.all(np.abs(step) <= 1e-9 * anomaly):
            break
    return np.where(mean < turns, -anomaly, anomaly) + turns


def gravity_gradient_torque(inertia: ArrayLike, position: ArrayLike, gm: float) -> Array:
    """Torque of a distant attracting body on a small one, about its centre of mass: 3 gm/r^3 n x I n.

    The first term of the torque of Newton's forces; the next is smaller by size/r, or by (size/r)^2 where the body
    is its own mirror image in its centre of mass.

    Parameters
    ----------
    inertia : (..., 3, 3) [kg m^2]
    position : (..., 3) of the centre of mass from the attracting body, r n, in the inertia's axes [m]
    gm : [m^3/s^2]

    Returns
    -------
    (..., 3) [N m], in those axes
    """
    tensor = finite_array(inertia, "inertia", (3, 3), unit="kg m^2")
    arm = finite_array(position, "position", (3,), unit="m")
    pull = positive_argument(gm, "gm", "a number in m^3/s^2")
    distance = _distance(arm)
    unit = arm / distance
    return 3.0 * pull / distance**3 * np.cross(unit, so3.apply(tensor, unit))


def gravity_force(mass: float, position: ArrayLike, gm: float) -> Array:
    """Force on a body as small as a point, -gm m r/|r|^3: (..., 3) [m] from the attracting body -> (..., 3) [N].

    The same acceleration for all its particles, so that there is no torque and the orbit does not know the attitude.

    Source: Cabrera 2006, remark 4.7, whose denominators are the cubes of the distance; theory.md A16, C-E14.
    """
    arm = finite_array(position, "position", (3,), unit="m")
    distance = _distance(arm)
    weight, pull = positive_argument(mass, "mass", "kg"), positive_argument(gm, "gm", "a number in m^3/s^2")
    return -pull * weight * arm / distance**3


def gravity_torque_estimate(motion: Motion, orbit: KeplerOrbit, tolerance: float | None = None) -> GravityTorque:
    """Is the body free enough? What the gravity gradient along an orbit would have done to a motion.

    The torque 3 gm/r^3 n x I n, at the attitudes of the free motion, changes the momentum by dmu, and the attitude
    becomes exp(eps) R with eps' = R I^-1 R^T (dmu + mu x eps): its growth along the motion included, to first order.
    What torque the turned attitude makes in its turn is left out: trust it while `attitude_error` is well below 1.

    Parameters
    ----------
    motion : of one body, not a batch; inertial axes are those of the orbit, t = 0 is the same
    orbit : of its centre of mass
    tolerance : allowed turn [rad]; None: that of the motion

    Raises
    ------
    ShapeError
        For a batch of motions.
    AccuracyNotReached
        If the steps of the estimate would be too many.

    Source: Cabrera 2006, remark 4.7; theory.md A16; the equation of eps by linearising theory.md section 2.
    """
    if motion.batch:
        raise ShapeError(f"one motion is needed, this is a batch of {motion.batch}; reconstruct one of them")
    allowed = motion.tolerance if tolerance is None else positive_argument(tolerance, "tolerance", "an angle in rad")
    edges = np.unique(np.concatenate([motion.solution.times, motion.deformation.breaks]))
    edges = edges[np.concatenate([[True], np.diff(edges) > 1e-12 * motion.duration])]
    edges[-1] = motion.duration
    before = None
    for _ in range(_HALVINGS):
        if len(edges) > _MOST_STEPS:
            break
        now = _drift(motion, orbit, edges)
        if before is not None and np.all(np.abs(now - before) <= _AGREEMENT * now):
            return GravityTorque(float(now[0]), float(now[1]), float(now[2]), allowed)
        before = now
        edges = np.sort(np.concatenate([edges, 0.5 * (edges[1:] + edges[:-1])]))
    raise AccuracyNotReached(
        "the torque of gravity changes too fast to be estimated; take a shorter part of the motion"
    )


def _drift(motion: Motion, orbit: KeplerOrbit, edges: Array) -> Array:
    """Largest torque, change of momentum and turn, by Runge-Kutta steps of order four between edges."""
    state, largest = np.zeros((6, 1)), np.zeros(3)
    for start in range(0, len(edges) - 1, _CHUNK):
        steps, torque = _steps(motion, orbit, edges[start : start + _CHUNK + 1])
        largest[0] = max(largest[0], torque)
        states = np.empty((len(steps), 6, 1))
        for i, step in enumerate(steps):
            state = states[i] = step[:, :6] @ state + step[:, 6:]
        reached = np.linalg.norm(states.reshape(-1, 2, 3), axis=-1).max(axis=0)
        largest[1:] = np.maximum(largest[1:], reached)
    return largest


def _steps(motion: Motion, orbit: KeplerOrbit, edges: Array) -> tuple[Array, float]:
    """What each step makes of the state (dmu, eps), (N, 6, 7): a matrix, and what is added; the largest torque."""
    times = np.sort(np.concatenate([edges, 0.5 * (edges[1:] + edges[:-1])]))
    attitude = motion.attitude(times)
    turned = so3.transpose(attitude)
    inertia = motion.deformation.description.sample(times)[0]
    position = orbit.position(times) - orbit.centre
    torque = so3.apply(attitude, gravity_gradient_torque(inertia, so3.apply(turned, position), orbit.gm))
    inverse = attitude @ inverse_inertia(inertia, times) @ turned
    # Rates of the state, with a seventh entry that stays 1.
    rates = np.zeros((len(times), 7, 7))
    rates[:, 3:6, :3], rates[:, 3:6, 3:6] = inverse, inverse @ so3.hat(motion.momentum)
    rates[:, :3, 6] = torque
    first, middle, last = rates[:-2:2], rates[1:-1:2], rates[2::2]
    h = np.diff(edges)[:, None, None]
    one = np.eye(7)
    k1 = first
    k2 = middle @ (one + 0.5 * h * k1)
    k3 = middle @ (one + 0.5 * h * k2)
    k4 = last @ (one + h * k3)
    steps = one + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return steps[:, :6], float(np.linalg.norm(torque, axis=-1).max())


def _excess(x: Array, is_ellipse: bool) -> Array:
    """x - sin(x), or sinh(x) - x, without the loss of digits near zero."""
    square = x * x
    sign = -1.0 if is_ellipse else 1.0
    series, term = np.zeros_like(x), np.where(np.abs(x) < 1.0, x, 0.0)
    for k in range(1, 10):
        term = term * square / ((2 * k) * (2 * k + 1))
        series = series + sign ** (k - 1) * term
    with np.errstate(over="ignore"):
        direct = x - np.sin(x) if is_ellipse else np.sinh(x) - x
    return np.where(np.abs(x) < 1.0, series, direct)


def _mean_anomaly(true_anomaly: float, e: float) -> float:
    """From the true anomaly, by the tangent of its half."""
    half = np.tan(0.5 * true_anomaly) * np.sqrt(abs(1.0 - e) / (1.0 + e))
    anomaly = np.asarray(2.0 * np.arctan(half) if e < 1.0 else 2.0 * np.arctanh(half))
    return float(abs(1.0 - e) * anomaly + e * _excess(anomaly, e < 1.0))


def _refuse_parabola(gap: float) -> None:
    if abs(gap) < 1e-12:
        raise ShapeError("eccentricity 1 is a parabola, between ellipse and hyperbola; change the velocity a little")


def _distance(arm: Array) -> Array:
    distance = np.linalg.norm(arm, axis=-1, keepdims=True)
    if np.any(distance < 1e-60):
        raise ShapeError("position: the centre of mass is in the attracting body's centre, where nothing is finite")
    return distance


def _vector(value: ArrayLike, name: str, unit: str) -> Array:
    vector = finite_array(value, name, (3,), unit=unit)
    if vector.ndim != 1:
        raise ShapeError(f"{name}: one vector (3,) [{unit}] is needed, got {vector.shape}")
    return vector
