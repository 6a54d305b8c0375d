"""A small body in gravity: its centre of mass on a Kepler orbit, and the torque that the free motion neglects."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import takewhile

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object, made_by, number_argument, positive_argument, vector_argument
from ..arrays import Array, finite_array
from ..display import short_repr
from ..errors import AccuracyNotReached, ShapeError
from ..inertia_tensor import inverse_inertia
from ..reconstruction.reconstruction import Motion
from ..refinement import halved, settled

_ROUNDING = 1e-12  # of eccentricities near 1, directions and times: closer ones have four digits left
_MIN_DISTANCE = 1e-60  # [m]: above, gm over its cube is finite for every gm below 1e128 m^3/s^2
_MAX_STEPS = 400_000  # of the estimate, some microseconds each
_CHUNK = 10_000  # steps whose matrices are made at once: some 30 MB


@made_by("bounds.KeplerOrbit.from_state(...) or from_elements(...)")
@dataclass(frozen=True, eq=False)
class KeplerOrbit:
    """The path of a centre of mass around a fixed point, in closed form; made by `from_state` or `from_elements`.

    A small body turns as if it were free: its base origin is at `orbit.position(t) + motion.base_position(t)`.

    Examples
    --------
    >>> orbit = sp.bounds.KeplerOrbit.from_state([7.0e6, 0.0, 0.0], [0.0, 7546.05, 0.0], gm=3.986e14)
    >>> print(f"{orbit.eccentricity:.5f}, {2.0 * np.pi / orbit.mean_motion:.0f} s")
    0.00000, 5829 s
    """

    gm: float
    """Gravity of the other body, G M [m^3/s^2]."""
    pericentre: float
    """Least distance from the other body [m]."""
    eccentricity: float
    """Below 1 an ellipse, above 1 a hyperbola."""
    axes: Array
    """(3, 3) inertial axes; columns to the pericentre, across it along the motion, and the orbit's normal."""
    mean_anomaly: float
    """At t = 0 [rad]; of a hyperbola e sinh(H) - H."""
    centre: Array
    """(3,) where the other body is [m]."""

    __repr__ = short_repr

    @staticmethod
    def from_state(
        position: ArrayLike, velocity: ArrayLike, gm: float, centre: ArrayLike = (0.0, 0.0, 0.0)
    ) -> KeplerOrbit:
        """The orbit through a position (3,) [m] with a velocity (3,) [m/s] at t = 0.

        Raises ShapeError for a velocity along the position, or a parabola (eccentricity 1 to within 1e-12).
        """
        pull = positive_argument(gm, "gm", "a number in m^3/s^2")
        middle = vector_argument(centre, "centre", unit="m")
        arm = vector_argument(position, "position", unit="m") - middle
        rate = vector_argument(velocity, "velocity", unit="m/s")
        distance, speed = float(np.linalg.norm(arm)), float(np.linalg.norm(rate))
        specific_momentum = np.cross(arm, rate)
        magnitude = float(np.linalg.norm(specific_momentum))
        if magnitude <= _ROUNDING * distance * speed or magnitude == 0.0:
            raise ShapeError(f"a velocity {rate} along the position {arm} from the centre leads straight into it")
        normal = specific_momentum / magnitude
        # e cos and e sin of the true anomaly: the eccentricity vector in the frame of the position.
        radial = arm / distance
        along, aside = magnitude**2 / (pull * distance) - 1.0, magnitude * float(arm @ rate) / (pull * distance)
        eccentricity, anomaly = float(np.hypot(along, aside)), float(np.arctan2(aside, along))
        _refuse_parabola(1.0 - eccentricity)
        first = so3.apply(so3.exp(-anomaly * normal), radial)
        return KeplerOrbit(
            gm=pull,
            pericentre=magnitude**2 / (pull * (1.0 + eccentricity)),
            eccentricity=eccentricity,
            axes=np.stack([first, so3.apply(so3.hat(normal), first), normal], axis=-1),
            mean_anomaly=_mean_anomaly(anomaly, eccentricity),
            centre=middle,
        )

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

        Raises ShapeError if axis and eccentricity contradict each other, or the orbit is a parabola.

        Parameters
        ----------
        semi_major_axis : [m], negative for a hyperbola
        eccentricity : 0 or more
        inclination, node, argument : turns about z by the node, x by the inclination, z by the argument of the
            pericentre [rad]
        mean_anomaly : [rad]
        """
        elements = [semi_major_axis, eccentricity, inclination, node, argument, mean_anomaly]
        axis, e, tilt, turn, argument_angle, mean = finite_array(elements, "elements", (len(elements),)).tolist()
        _refuse_parabola(1.0 - e)
        if e < 0.0 or axis * (1.0 - e) <= 0.0:
            raise ShapeError(
                "an ellipse has an eccentricity from 0 to 1 and a semi-major axis above 0, a hyperbola an eccentricity "
                f"above 1 and a semi-major axis below 0; got eccentricity {e} and semi-major axis {axis} m"
            )
        x, _, z = np.eye(3)
        axes = so3.exp(turn * z) @ so3.exp(tilt * x) @ so3.exp(argument_angle * z)
        return KeplerOrbit(
            gm=positive_argument(gm, "gm", "a number in m^3/s^2"),
            pericentre=axis * (1.0 - e),
            eccentricity=e,
            axes=axes,
            mean_anomaly=mean,
            centre=vector_argument(centre, "centre", unit="m"),
        )

    @property
    def semi_major_axis(self) -> float:
        """Half the major axis [m]; negative for a hyperbola."""
        return self.pericentre / (1.0 - self.eccentricity)

    @property
    def mean_motion(self) -> float:
        """Rate of the mean anomaly [rad/s]: (gm/|a|^3)^(1/2), Kepler's third law."""
        return float(np.sqrt(self.gm / abs(self.semi_major_axis) ** 3))

    @property
    def period(self) -> float:
        """Time of one revolution [s]; infinite for a hyperbola."""
        return 2.0 * np.pi / self.mean_motion if self.eccentricity < 1.0 else np.inf

    def position(self, t: ArrayLike) -> Array:
        """Position of the centre of mass: times (...), of any sign -> (..., 3) [m]."""
        times = finite_array(t, "t", unit="s")
        x, y, _, _ = self._in_plane(times)
        return self.centre + x[..., None] * self.axes[:, 0] + y[..., None] * self.axes[:, 1]

    def velocity(self, t: ArrayLike) -> Array:
        """Velocity of the centre of mass: times (...) -> (..., 3) [m/s]."""
        times = finite_array(t, "t", unit="s")
        _, _, x, y = self._in_plane(times)
        return x[..., None] * self.axes[:, 0] + y[..., None] * self.axes[:, 1]

    def _in_plane(self, times: Array) -> tuple[Array, Array, Array, Array]:
        """Position and velocity along the pericentre and across it."""
        e, gap, axis = self.eccentricity, 1.0 - self.eccentricity, abs(self.semi_major_axis)
        mean = self.mean_anomaly + self.mean_motion * times
        # Beyond 1e10 rad the rounding of the mean anomaly is more than 1e-6 rad; squares of 1e150 overflow.
        if np.abs(mean).max(initial=0.0) > (1e10 if e < 1.0 else 1e150):
            raise AccuracyNotReached(
                f"at times up to {np.abs(times).max():.3g} s the digits of the anomaly are lost; start the orbit "
                "nearer to them"
            )
        anomaly = eccentric_anomaly(mean, e)
        side = np.sqrt(abs(gap) * (1.0 + e))
        if e < 1.0:
            cosine, sine, half = np.cos(anomaly), np.sin(anomaly), 2.0 * np.sin(0.5 * anomaly) ** 2
            away, x = gap + e * half, gap - half
        else:
            cosine, sine, half = np.cosh(anomaly), np.sinh(anomaly), 2.0 * np.sinh(0.5 * anomaly) ** 2
            away, x = -gap + e * half, -gap - half
        rate = axis * self.mean_motion / away
        return axis * x, axis * side * sine, -rate * sine, rate * side * cosine


@dataclass(frozen=True)
class GravityTorque:
    """First-order effect of the neglected gravity-gradient torque on a motion. Made by `gravity_torque_estimate`."""

    largest_torque: float
    """Largest gravity-gradient torque along the motion [N m]."""
    impulse: float
    """The largest change of the angular momentum [kg m^2/s]."""
    attitude_error: float
    """The largest rotation away from the free motion [rad]."""
    tolerance: float
    """The rotation that is allowed [rad]."""

    __repr__ = short_repr

    @property
    def is_free(self) -> bool:
        """True if the free motion agrees with the true one within the tolerance."""
        return self.attitude_error <= self.tolerance


def eccentric_anomaly(mean_anomaly: ArrayLike, eccentricity: float) -> Array:
    """Kepler's equation E - e sin(E) = M, or e sinh(H) - H = M for e > 1, solved for E or H to rounding.

    Newton's method from above the root, where the function is convex, so that it always converges.

    Raises ShapeError for a negative eccentricity, or 1.

    Parameters
    ----------
    mean_anomaly : (...) [rad]; E is in the same revolution
    eccentricity : 0 or more, not 1

    Examples
    --------
    >>> anomaly = sp.bounds.eccentric_anomaly(1.0, 0.5)
    >>> print(f"{anomaly - 0.5 * np.sin(anomaly):.12f}")  # Kepler's equation
    1.000000000000
    """
    mean = finite_array(mean_anomaly, "mean_anomaly", unit="rad")
    e = number_argument(eccentricity, "eccentricity")
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
    for _ in range(60):  # always fewer; the error is about the square of the last step
        excess = _excess(anomaly, e < 1.0)
        slope = gap + e * (2.0 * np.sin(0.5 * anomaly) ** 2 if e < 1.0 else 2.0 * np.sinh(0.5 * anomaly) ** 2)
        step = (gap * anomaly + e * excess - rest) / slope
        anomaly = anomaly - step
        if np.all(np.abs(step) <= 1e-9 * anomaly):
            break
    return np.where(mean < turns, -anomaly, anomaly) + turns


def gravity_gradient_torque(inertia: ArrayLike, position: ArrayLike, gm: float) -> Array:
    """Torque of a distant attracting body on a small one, about its centre of mass: 3 gm/r^3 n x I n.

    The first term of the torque of Newton's forces; with d the extent of the body, the next is smaller by d/r, or by
    (d/r)^2 for a body that is symmetric under inversion in its centre of mass.

    Parameters
    ----------
    inertia : (..., 3, 3) [kg m^2]
    position : (..., 3) of the centre of mass from the attracting body, r n, in the inertia's axes [m]
    gm : [m^3/s^2]

    Returns
    -------
    (..., 3) [N m], in those axes

    Examples
    --------
    >>> place, inertia = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0), np.diag([1.0, 2.0, 3.0])
    >>> print(sp.bounds.gravity_gradient_torque(inertia, place, 1.0).round(9))  # 3/2 (I_2 - I_1)
    [0.  0.  1.5]
    """
    tensor = finite_array(inertia, "inertia", (3, 3), unit="kg m^2")
    arm = finite_array(position, "position", (3,), unit="m")
    pull = positive_argument(gm, "gm", "a number in m^3/s^2")
    distance = _distance(arm)
    unit = arm / distance
    return 3.0 * pull / distance**3 * np.cross(unit, so3.apply(tensor, unit))


def gravity_force(mass: float, position: ArrayLike, gm: float) -> Array:
    """Force on a body as small as a point, -gm m r/|r|^3: (..., 3) [m] from the attracting body -> (..., 3) [N].

    All its particles have the same acceleration, so that there is no torque and the orbit is independent of the
    attitude.

    Source: Cabrera 2006, remark 4.7, with the cube of the distance in the denominators; theory.md A16, C-E14.

    Examples
    --------
    >>> sp.bounds.gravity_force(2.0, [2.0, 0.0, 0.0], 8.0)[0].item()  # -8 * 2/4
    -4.0
    """
    arm = finite_array(position, "position", (3,), unit="m")
    distance = _distance(arm)
    weight, pull = positive_argument(mass, "mass", "kg"), positive_argument(gm, "gm", "a number in m^3/s^2")
    return -pull * weight * arm / distance**3


def gravity_torque_estimate(motion: Motion, orbit: KeplerOrbit, tolerance: float | None = None) -> GravityTorque:
    """Turn by which the gravity gradient along an orbit would lead a body away from its free motion.

    The torque 3 gm/r^3 n x I n, at the attitudes of the free motion, changes the momentum by dmu, and the attitude
    becomes exp(eps) R with eps' = R I^-1 R^T (dmu + mu x eps): to first order, with the growth of eps along the
    motion. The change of the torque with the attitude is left out: trust it while `attitude_error` is well below 1.

    Source: Cabrera 2006, remark 4.7; theory.md A16; the equation of eps by linearising theory.md section 2.

    Parameters
    ----------
    motion : of one body, not a batch; with the inertial axes and the t = 0 of the orbit
    orbit : of its centre of mass
    tolerance : allowed rotation [rad]; None: that of the motion

    Raises
    ------
    AccuracyNotReached
        If the estimate would take too many steps.
    ShapeError
        For a batch of motions.

    Examples
    --------
    >>> orbit = sp.bounds.KeplerOrbit.from_state([7.0e6, 0.0, 0.0], [0.0, 7546.05, 0.0], gm=3.986e14)
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 10.0), [0.0, 0.5, 5.0])
    >>> found = sp.bounds.gravity_torque_estimate(motion, orbit)
    >>> print(f"{found.largest_torque:.1e} N m")
    1.8e-06 N m
    """
    check_object(motion, "Motion", "motion")
    check_object(orbit, "KeplerOrbit", "orbit")
    if motion.batch:
        raise ShapeError(f"one motion is needed, this is a batch of {motion.batch}; reconstruct one of them")
    allowed = motion.tolerance if tolerance is None else positive_argument(tolerance, "tolerance", "an angle in rad")
    edges = np.unique(np.concatenate([motion.solution.times, motion.deformation.breaks]))
    edges = edges[np.concatenate([[True], np.diff(edges) > _ROUNDING * motion.duration])]
    edges[-1] = motion.duration

    def excess(last: Array, new: Array) -> float:
        return float(np.max(np.abs(new - last) - 1e-4 * new))  # enough for an order of magnitude

    steps = takewhile(lambda ends: len(ends) <= _MAX_STEPS, halved(edges, 10))
    effects = settled((_largest_effects(motion, orbit, ends) for ends in steps), excess, 0.0)
    if effects is None:
        raise AccuracyNotReached(
            "the torque of gravity changes too fast to be estimated; choose a shorter part of the motion"
        )
    torque, impulse, error = effects.tolist()
    return GravityTorque(largest_torque=torque, impulse=impulse, attitude_error=error, tolerance=allowed)


def _largest_effects(motion: Motion, orbit: KeplerOrbit, edges: Array) -> Array:
    """Largest torque, change of momentum and rotation: (3,), by fourth-order Runge-Kutta steps between edges."""
    state, largest = np.zeros((6, 1)), np.zeros(3)
    for start in range(0, len(edges) - 1, _CHUNK):
        steps, torque = _step_matrices(motion, orbit, edges[start : start + _CHUNK + 1])
        largest[0] = max(largest[0], torque)
        states = np.empty((len(steps), *state.shape))
        for i, step in enumerate(steps):
            state = states[i] = step[:, :-1] @ state + step[:, -1:]
        reached = np.linalg.norm(states.reshape(-1, 2, 3), axis=-1).max(axis=0)
        largest[1:] = np.maximum(largest[1:], reached)
    return largest


def _step_matrices(motion: Motion, orbit: KeplerOrbit, edges: Array) -> tuple[Array, float]:
    """Each step as an affine map of the state (dmu, eps): (N, 6, 7), the constant last; and the largest torque."""
    times = np.sort(np.concatenate([edges, 0.5 * (edges[1:] + edges[:-1])]))
    attitude = motion.attitude(times)
    to_body = so3.transpose(attitude)
    inertia = motion.deformation.description.sample(times)[0]
    position = orbit.position(times) - orbit.centre
    torque = so3.apply(attitude, gravity_gradient_torque(inertia, so3.apply(to_body, position), orbit.gm))
    inverse = attitude @ inverse_inertia(inertia, times) @ to_body
    # Rates of the state, with a seventh entry that stays 1.
    identity = np.eye(7)
    rates = np.zeros((len(times), *identity.shape))
    rates[:, 3:-1, :3], rates[:, 3:-1, 3:-1] = inverse, inverse @ so3.hat(motion.momentum)
    rates[:, :3, -1] = torque
    first, middle, last = rates[:-2:2], rates[1:-1:2], rates[2::2]
    h = np.diff(edges)[:, None, None]
    k2 = middle @ (identity + 0.5 * h * first)
    k3 = middle @ (identity + 0.5 * h * k2)
    k4 = last @ (identity + h * k3)
    steps = identity + h / 6.0 * (first + 2.0 * k2 + 2.0 * k3 + k4)
    return steps[:, :-1], float(np.linalg.norm(torque, axis=-1).max())


def _excess(x: Array, is_ellipse: bool) -> Array:
    """x - sin(x), or sinh(x) - x, without loss of digits near zero."""
    square = x * x
    sign = -1.0 if is_ellipse else 1.0
    near_zero = np.abs(x) < 1.0
    series, term = np.zeros_like(x), np.where(near_zero, x, 0.0)
    for k in range(1, 10):  # the next term is below a thousandth of the rounding of the first
        term = term * square / ((2 * k) * (2 * k + 1))
        series = series + sign ** (k - 1) * term
    with np.errstate(over="ignore"):
        direct = x - np.sin(x) if is_ellipse else np.sinh(x) - x
    return np.where(near_zero, series, direct)


def _mean_anomaly(true_anomaly: float, e: float) -> float:
    """The mean anomaly of a true anomaly, by the tangent of its half."""
    half = np.tan(0.5 * true_anomaly) * np.sqrt(abs(1.0 - e) / (1.0 + e))
    anomaly = np.asarray(2.0 * np.arctan(half) if e < 1.0 else 2.0 * np.arctanh(half))
    return float(abs(1.0 - e) * anomaly + e * _excess(anomaly, e < 1.0))


def _refuse_parabola(gap: float) -> None:
    if abs(gap) < _ROUNDING:
        raise ShapeError("an orbit of eccentricity 1, a parabola, is not supported; change the velocity a little")


def _distance(arm: Array) -> Array:
    distance = np.linalg.norm(arm, axis=-1, keepdims=True)
    if np.any(distance < _MIN_DISTANCE):
        raise ShapeError("position: the centre of mass is at the attracting body's centre, where gravity is infinite")
    return distance
