"""Deformations: a body's locked inertia and internal momentum as functions of time, whatever they come from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import (
    breaks_argument,
    check_function,
    inertia_argument,
    made_by,
    on_unphysical_argument,
    positive_argument,
    times_argument,
)
from ..arrays import Array, finite_array, lock_arrays
from ..body.body import Body
from ..body.family import BodyFamily
from ..body.loading import as_body_or_particles
from ..body.particles.point_masses import ParticleBody
from ..card_pictures import MOST_POINTS, curves_picture
from ..display import Card, card_html, card_text, numbers, short_repr
from ..errors import ShapeError, ShapePhaseError, SingularInertiaError
from ..inertia_tensor import triangle_defect
from ..integrator.limited_steps import StepLimits
from ..integrator.sampling import Sampler
from ..letters import value_text
from ..refinement import least_over
from ..shape_space.body_path import as_path, path_gap, users_route_along
from ..shape_space.scan.function_scan import FunctionScan
from ..shape_space.shape_path import CLOSED, ShapePath
from ._physical_validity import check_never_on_a_line, check_triangle
from .descriptions import (
    ArticulatedDescription,
    Description,
    ParticleDescription,
    ParticlePath,
    ParticlesAlong,
    PrescribedDescription,
    RigidDescription,
)
from .rotors import Rotor, RotorDescription, RotorValue, mapping_of_joints, rotors_argument, widened_path


@made_by(
    "articulated(body, path), particles, prescribed or rigid",
    Body="of one made by articulated, it is deformation.description.body",
    ShapePath="of one made by articulated, it is deformation.description.path",
)
@dataclass(frozen=True, eq=False)
class Deformation:
    """A free body that changes its shape in a known way, seen from its base frame.

    Made by `articulated`, `particles`, `assembly`, `prescribed` or `rigid`, or from another by a gauge.

    Attributes
    ----------
    description : the functions themselves
    duration : [s]
    declared_breaks : (M,) times between which all is declared to be smooth, first 0, last `duration` [s]
    closure : (3, 3) where the shape at the end is the one at the start turned by it (the identity for a closed
        joint path seen from the base), else None
    shape_gap : how far the end shape is from the start shape [largest joint difference, or relative change]
    label : what it is, in messages and figures
    loops : the deformation is its first `duration / loops` seconds, this many times
    inputs : SHA-256 of the files it was made from, "body" and "path", if it was made from files
    made_from : the body, its joints, the recording and what was done to it, as JSON can hold it: for `provenance`

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> print(np.linalg.eigvalsh(sp.articulated(cat, loop).inertia(0.3)).round(6))
    [0.005918 0.019082 0.02    ]
    """

    description: Description
    duration: float
    declared_breaks: Array
    closure: Array | None
    shape_gap: float
    label: str
    loops: int = 1
    inputs: Mapping[str, str] = field(default_factory=dict)
    made_from: Mapping[str, Any] = field(default_factory=dict)

    __post_init__ = lock_arrays
    __repr__, _repr_html_ = card_text, card_html

    @cached_property
    def breaks(self) -> Array:
        """Times between which all is smooth, those that the scan found among them: (M,), first 0, last `duration` [s].

        Raises and warns like `scan`.
        """
        scan = self.scan
        if scan is None or not len(scan.found_breaks):
            return self.declared_breaks
        starts = self.duration / self.loops * np.arange(self.loops)
        return np.union1d(self.declared_breaks, (starts[:, None] + scan.found_breaks).ravel())

    @property
    def scan(self) -> FunctionScan | None:
        """Result of the scan of the user's functions of time, and its cost; None without such a function.

        Functions are scanned before they are integrated: a path of joints known only as a function, inertia and
        internal momentum, positions of particles, the paths of an assembly's parts, the frame of a gauge. It finds what
        is wider than 1/2,000 of the duration (of one loop, in a path of loops); narrower features have to be declared
        as breaks. Done when first needed, at some 5,500 times, and kept. In rad: columns are scaled by the turn of the
        body that they cause.

        Raises
        ------
        TrajectoryError
            If what must be continuous jumps, or rates are not derivatives; the message has the time.
        NoisyPathError, AccuracyNotReached
            If values carry noise, or are too rough for thousands of panels.

        Warns
        -----
        UndeclaredBreakWarning
            For kinks that were not declared; they are among the `breaks` from then on.
        """
        return self.description.scan

    def inertia(self, t: ArrayLike) -> Array:
        """Locked inertia: times (...) -> (..., 3, 3), base axes, about the centre of mass [kg m^2]."""
        times = times_argument(t, self.duration)
        return self.description.sample(times.ravel())[0].reshape(*times.shape, 3, 3)

    def internal_momentum(self, t: ArrayLike) -> Array:
        """L_o, angular momentum with the base at rest: times (...) -> (..., 3), base axes [kg m^2/s]."""
        times = times_argument(t, self.duration)
        return self.description.sample(times.ravel())[1].reshape(*times.shape, 3)

    def stored_momentum(self, t: ArrayLike) -> Array:
        """Part of L_o that wheels hold whatever the joints do: times (...) -> (..., 3), base axes [kg m^2/s].

        Zero without wheels. A wheel that keeps its momentum p about its axle a stores p a, one at a held speed J s a.
        It is not a rate of the shape: what it turns the body by grows with the time that a motion takes, and is no part
        of the holonomy.
        """
        times = times_argument(t, self.duration)
        stored = self.description.stored_momentum(times.ravel())
        return np.zeros((*times.shape, 3)) if stored is None else stored.reshape(*times.shape, 3)

    @property
    def has_wheels(self) -> bool:
        """True where wheels store momentum."""
        return self.description.stored_momentum(np.zeros(1)) is not None

    def inertia_rate(self, t: ArrayLike) -> Array:
        """Rate of the locked inertia: times (...) -> (..., 3, 3) [kg m^2/s]."""
        times = times_argument(t, self.duration)
        return self.description.inertia_rate(times.ravel()).reshape(*times.shape, 3, 3)

    def frame(self, t: ArrayLike) -> Array:
        """U(t), this description's frame in the original one, d_here = U d: times (...) -> (..., 3, 3)."""
        times = times_argument(t, self.duration)
        return self.description.frame(times.ravel()).reshape(*times.shape, 3, 3)

    def centre_of_mass(self, t: ArrayLike) -> Array:
        """Centre of mass from the base origin: times (...) -> (..., 3), this description's axes [m]."""
        times = times_argument(t, self.duration)
        return self.description.centre_of_mass(times.ravel()).reshape(*times.shape, 3)

    def kinetic_energy(self, t: ArrayLike, angular_velocity: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
        """Kinetic energy about the centre of mass while this frame turns: times (...) -> (...) [J].

        Source: Cabrera 2006, equation (4); theory.md A6.

        Parameters
        ----------
        angular_velocity : (3,) or t.shape + (3,) of this frame, its own axes [rad/s]; at rest it is T_0

        Raises
        ------
        GaugeError
            If only the inertia is known, not the masses (`prescribed`, or a motion read from a file).
        ShapeError
            If `angular_velocity` has another shape.
        """
        times = times_argument(t, self.duration)
        omega = finite_array(angular_velocity, "angular_velocity", (3,), unit="rad/s")
        if omega.ndim > 1 and omega.shape != (*times.shape, 3):
            raise ShapeError(
                f"angular_velocity: (3,) or one for each time, {(*times.shape, 3)}, is needed, got {omega.shape}"
            )
        turning = np.broadcast_to(omega, (*times.shape, 3)).reshape(1, -1, 3)
        return self.description.kinetic_energy(times.ravel(), turning).reshape(times.shape)[()]

    def triangle_defect(self) -> tuple[float, float]:
        """Largest violation of the triangle inequality, relative to the largest moment, and its time [s].

        Negative where every inertia of [0, duration] is that of some distribution of mass. Found at 65 points
        between any two breaks and around the worst of them. Source: theory.md A4.
        """
        least, when = least_over(lambda t: -triangle_defect(self.description.sample(t)[0]), self.breaks)
        return -least, when

    def sampler(self) -> Sampler:
        """A fresh sampler for the integrator, after the scan of a user's functions of time.

        Raises SingularInertiaError for particles that are on one line at some time; raises and warns like `scan`.
        """
        known = self.description
        return Sampler(known.sample, known.smoothness(self.breaks), known.channels)

    def step_limits(self) -> StepLimits:
        """The longest steps of an integrator that evaluates the deformation itself, in any gauge."""
        known: Any = self.description
        limits = known.smoothness(self.breaks).step_limits
        while hasattr(known, "original"):
            known = known.original
            limits = limits.combined(known.smoothness(self.breaks).step_limits)
        return limits

    def _card(self) -> Card:
        """Duration, least and largest moments, internal momentum; with the principal moments in time."""
        rows = [("duration", numbers(self.duration, "s") + (f", {self.loops} loops" if self.loops > 1 else ""))]
        title = f"Deformation: {self.label}"
        times = np.linspace(0.0, self.duration, MOST_POINTS)
        try:
            inertia, internal = self.inertia(times), self.internal_momentum(times)
        except ShapePhaseError as error:
            return Card(title, [*rows, ("cannot be evaluated", str(error))])
        moments = np.asarray(np.linalg.eigvalsh(inertia), dtype=np.float64)
        rows += [
            ("principal moments", f"{moments.min():.6g} to {moments.max():.6g} kg m^2"),
            ("internal momentum", f"up to {np.linalg.norm(internal, axis=-1).max():.6g} kg m^2/s"),
            ("shape closes", "yes" if self.closure is not None else f"no, by {self.shape_gap:.4g}"),
            ("breaks", f"{len(self.declared_breaks)}"),
        ]
        return Card(title, rows, curves_picture(moments, "principal moments in time"))


@made_by(Deformation="take one of them, family[0]")
@dataclass(frozen=True, eq=False)
class DeformationFamily(Sequence[Deformation]):
    """The deformations of N bodies of a family along one path, as a sequence. Made by `articulated`.

    Attributes
    ----------
    bodies : the family
    path : with columns in the order of the bodies' joints
    """

    bodies: BodyFamily
    path: ShapePath

    __repr__ = short_repr

    def __len__(self) -> int:
        """Number of deformations."""
        return len(self.bodies)

    @overload
    def __getitem__(self, index: int) -> Deformation: ...

    @overload
    def __getitem__(self, index: slice) -> DeformationFamily: ...

    def __getitem__(self, index: int | slice) -> Deformation | DeformationFamily:
        """One of them, made at every call, or those of a slice."""
        return articulated(self.bodies[index], self.path)

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return self.path.duration

    def inertia(self, t: ArrayLike) -> Array:
        """Locked inertia of each: times (...) -> (N, ..., 3, 3), base axes, about the centre of mass [kg m^2]."""
        return self._sampled(t)[0]

    def internal_momentum(self, t: ArrayLike) -> Array:
        """L_o of each, angular momentum with the base at rest: times (...) -> (N, ..., 3), base axes [kg m^2/s]."""
        return self._sampled(t)[1]

    def _sampled(self, t: ArrayLike) -> tuple[Array, Array]:
        times = times_argument(t, self.duration)
        inertia, momentum = self.bodies.sample(*self.path.curve(times.ravel()))
        batch = (len(self), *times.shape)
        return inertia.reshape(*batch, 3, 3), momentum.reshape(*batch, 3)


@overload
def articulated(
    body: Body | ParticleBody | str,
    path: ShapePath | str,
    *,
    rotors: Mapping[str, RotorValue] | None = None,
    rotor_speeds: Mapping[str, RotorValue] | None = None,
) -> Deformation: ...


@overload
def articulated(body: BodyFamily, path: ShapePath | str) -> DeformationFamily: ...


def articulated(
    body: Body | ParticleBody | BodyFamily | str,
    path: ShapePath | str,
    *,
    rotors: Mapping[str, RotorValue] | None = None,
    rotor_speeds: Mapping[str, RotorValue] | None = None,
) -> Deformation | DeformationFamily:
    """The deformation of a body whose joints follow a path, or those of all bodies of a `BodyFamily`.

    Joints are matched by name where the path has names, else by order. A `ParticleBody` gives one of `particles`.
    Wheels are left out of the path: those that no motor turns keep their momentum, others the speed that a motor
    holds. On a joint of the path they make a control-moment gyroscope. What a wheel turns the body by depends on how
    long the motion takes: `split` states it apart from the holonomy. A wheel among the joints of the path is part of
    the shape: it turns by given angles, whatever the pace.

    `rotors` and `rotor_speeds` take a number, which stays, or what a motor makes of it in time: a pair of times (K,)
    [s] from the start of the path to its end and values (K,), joined by `ShapePath.spline`, or a `ShapePath` of one
    column.

    Parameters
    ----------
    rotors : for each such joint p = J (a . omega_link + spin), the momentum of its wheel along the axle a, with the
        turn of the wheel in space [kg m^2/s]; `inertia` is then that which Routh's reduction leaves, I - J a a^T
    rotor_speeds : or the speed of the wheel on its axle [rad/s]

    Raises
    ------
    UnknownNameError, TrajectoryError
        If the path has other joints than the body, or a wheel's values last longer or less than it.
    ShapeError
        For a rotor that is not symmetric about its axle.

    Warns
    -----
    TrajectoryWarning
        Where the angles of the path look like degrees, by the limits of the joints.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> deformation = sp.articulated(cat, sp.examples.kane_scher(0.0, 0.5))
    >>> deformation.duration, deformation.inertia(0.0).trace().round(6).item()
    (1.0, 0.045)
    """
    momenta, speeds = mapping_of_joints(rotors, "rotors"), mapping_of_joints(rotor_speeds, "rotor_speeds")
    if isinstance(body, BodyFamily):
        path = as_path(path, body.body)
        if momenta or speeds:
            raise ShapeError("rotors are those of one body; take one of the family, family[0]")
        return DeformationFamily(body, users_route_along(body.body, path))
    body = as_body_or_particles(body)
    path = as_path(path, body)
    if isinstance(body, ParticleBody):
        if momenta or speeds:
            raise ShapeError("rotors are wheels of links; a body of particles has none")
        route = users_route_along(body, path)
        return particles(body.masses, ParticlesAlong(body, route), route.duration, route.breaks)
    wheels = rotors_argument(body, momenta, speeds, path.duration)
    if wheels:
        path = widened_path(body, path, tuple(wheel.joint for wheel in wheels))
    return deformation_along(body, users_route_along(body, path), wheels)


def deformation_along(body: Body, route: ShapePath, wheels: tuple[Rotor, ...] = ()) -> Deformation:
    """The deformation of `articulated` along a route by `route_along`, whose angles are certainly in radians."""
    gap = float(np.max(np.abs(path_gap(body, route)), initial=0.0))
    closure = np.eye(3) if gap <= CLOSED else None
    description, breaks, loops = ArticulatedDescription(body, route), route.breaks, route.loops
    if wheels:
        description = RotorDescription(body, route, wheels)
        breaks, loops = description.breaks, description.loops
    inputs = {name: given.sha256 for name, given in (("body", body), ("path", route)) if given.sha256}
    label = f"{body.name} along a path"
    made_from: dict[str, Any] = {"body": {"name": body.name, "sha256": body.sha256}, "joints": list(body.joint_names)}
    if route.sha256 is not None:
        made_from["path"] = {"sha256": route.sha256}
    if route.record is not None:
        made_from["recording"] = dict(route.record)
    if wheels:
        made_from["wheels"] = {wheel.joint: wheel.record for wheel in wheels}
    return Deformation(description, route.duration, breaks, closure, gap, label, loops, inputs, made_from)


def rigid(inertia: ArrayLike, duration: float) -> Deformation:
    """A rigid body: constant inertia (3, 3) [kg m^2], no internal momentum, for `duration` [s].

    Source: Cabrera 2006, example 2.6; theory.md A10.

    Examples
    --------
    >>> sp.rigid(np.diag([1.0, 2.0, 2.5]), 3.0).inertia(1.0).tolist()
    [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.5]]
    """
    tensor = inertia_argument(finite_array(inertia, "inertia", (3, 3))[None])[0]
    length = positive_argument(duration)
    return Deformation(RigidDescription(tensor), length, np.array([0.0, length]), np.eye(3), 0.0, "rigid body")


def prescribed(
    inertia: Callable[[Array], ArrayLike],
    internal_momentum: Callable[[Array], ArrayLike] | None,
    duration: float,
    breaks: ArrayLike = (),
    *,
    on_unphysical: str = "allow",
) -> Deformation:
    """A deformation given by functions of time.

    The shape is taken to be a loop when the inertia at the end is that at the start, to 1e-9. Before they are
    integrated the functions are scanned once (`Deformation.scan`, which has its own errors and warnings).

    Parameters
    ----------
    inertia : times (N,) -> (N, 3, 3) [kg m^2], symmetric positive definite
    internal_momentum : times (N,) -> (N, 3) [kg m^2/s]; None: zero
    duration : [s]
    breaks : interior times where a derivative jumps, or the inertia itself [s]
    on_unphysical : what to do with tensors that break the triangle inequality, as no distribution of mass does:
        "allow" them, "warn" or "error". The last two search all times when the deformation is made, and "error" checks
        whatever is evaluated later, too. The equations of motion need only positive definite tensors

    Raises
    ------
    ShapeError, UnphysicalInertiaError
        If a function returns the wrong shape, a tensor that is not symmetric or, with "error", one that breaks the
        triangle inequality.

    Warns
    -----
    UnphysicalInertiaWarning
        With "warn", for tensors that break the triangle inequality; the message has the worst time.

    Examples
    --------
    >>> def inertia(t):
    ...     return np.eye(3) * (1.0 + t)[:, None, None]
    >>> growing = sp.prescribed(inertia, None, 1.0)
    >>> motion = sp.reconstruct(growing, [0.0, 0.0, 1.0])
    >>> print(f"{sp.so3.angle(motion.final_attitude):.9f} = log 2")
    0.693147181 = log 2
    """
    check_function(inertia, "inertia", "a function of times that gives inertia tensors")
    if internal_momentum is not None:
        check_function(internal_momentum, "internal_momentum", "a function of times that gives angular momenta")
    length = positive_argument(duration)
    edges = breaks_argument(breaks, length)
    description = PrescribedDescription(inertia, internal_momentum, edges)
    ends = description.sample(np.array([0.0, length]))[0]
    if on_unphysical_argument(on_unphysical) != "allow":
        _, worst = least_over(lambda t: -triangle_defect(description.sample(t)[0]), edges)
        check_triangle(description.sample(np.array([worst]))[0], np.array([worst]), on_unphysical)
        description = replace(description, on_unphysical=on_unphysical)
    gap = float(np.max(np.abs(ends[1] - ends[0])) / np.max(np.abs(ends[0])))
    return Deformation(description, length, edges, np.eye(3) if gap <= CLOSED else None, gap, "prescribed inertia")


def particles(
    masses: ArrayLike,
    positions: Callable[[Array], tuple[ArrayLike, ArrayLike]] | tuple[ArrayLike, ArrayLike],
    duration: float | None = None,
    breaks: ArrayLike = (),
) -> Deformation:
    """A body of point masses that move in a known way as seen from a frame.

    The shape is a loop when the particles at the end are those at the start turned by some rotation, which
    is then the closure. A function is scanned once before it is integrated (`Deformation.scan`, which has its own
    errors and warnings): velocities that are not those of the positions are refused.

    Source: Cabrera 2006, sections 2.1 to 2.3; theory.md A1 to A3, A7, A8.

    Parameters
    ----------
    masses : (m,) [kg], positive, two or more
    positions : times (N,) -> positions (N, m, 3) [m], velocities (N, m, 3) [m/s]; or samples in time, the pair
        times (K,) [s], positions (K, m, 3) [m], joined by a cubic spline whose knots become breaks (periodic when the
        last sample equals the first to 1e-9, else not-a-knot; the first time is shifted to 0). Need not be centred
    duration : [s]; of samples it is known
    breaks : interior times where a derivative jumps [s]

    Raises
    ------
    ShapeError, TrajectoryError
        If shapes of arrays disagree, a mass is not positive, or times do not ascend.
    SingularInertiaError
        If the particles are on one line at some time, which the message names: for samples at once, for a function
        when the inertia or the motion is computed.

    Examples
    --------
    >>> times = np.linspace(0.0, 2.0, 9)
    >>> apart = np.array([[[1 + t, 0, 0], [-1 - t, 0, 0], [0, 1, 0]] for t in times])
    >>> deformation = sp.particles([1.0, 1.0, 1.0], (times, apart))
    >>> deformation.inertia([0.0, 2.0])[:, 2, 2].round(6).tolist()  # 2 x^2 + 2/3
    [2.666667, 18.666667]
    """
    weights = finite_array(masses, "masses", (None,), unit="kg").copy()
    if weights.ndim != 1 or len(weights) < 2 or np.any(weights <= 0.0):
        raise ShapeError(f"masses: two numbers or more above 0 [kg] are needed, got {value_text(weights)}")
    if callable(positions):
        if duration is None:
            raise ShapeError("positions given by a function need a duration [s]")
        length = positive_argument(duration)
        edges = breaks_argument(breaks, length)
        description = ParticleDescription(weights, positions, edges)
    else:
        path = _sampled_positions(positions, weights)
        length = path.duration
        if duration is not None and abs(positive_argument(duration) - length) > 1e-9 * length:
            raise ShapeError(f"duration: the samples last {length:.9g} s, got {value_text(duration)}; leave it out")
        edges = np.union1d(path.breaks, breaks_argument(breaks, length))
        description = ParticleDescription(weights, ParticlePath(path), edges, path.swings.most)
    ends, _ = description.centred(np.array([0.0, length]))
    turn = _best_turn(weights, ends[0], ends[1])
    radius = float(np.max(np.linalg.norm(ends[0], axis=-1)))
    if radius == 0.0:
        raise SingularInertiaError("all particles are in one place: there is no inertia that could turn")
    if not callable(positions):
        check_never_on_a_line(description.moment, edges)
    gap = float(np.max(np.linalg.norm(ends[1] - ends[0] @ turn.T, axis=-1))) / radius
    closure = turn if gap <= CLOSED else None
    return Deformation(description, length, edges, closure, gap, f"{len(weights)} particles")


def _sampled_positions(samples: tuple[ArrayLike, ArrayLike], masses: Array) -> ShapePath:
    """The spline through samples, each first moved to its centre of mass, which a spline lets through."""
    if not isinstance(samples, tuple | list) or len(samples) != 2:
        raise ShapeError(
            "positions: a function of times, or the pair times (K,), positions (K, m, 3) is needed, got "
            f"{value_text(samples)}"
        )
    points = finite_array(samples[1], "positions", (None, len(masses), 3), unit="m")
    if points.ndim != 3:
        raise ShapeError(f"positions: samples (K, {len(masses)}, 3) are needed, got {points.shape}")
    centred = points - ((masses / masses.sum()) @ points)[:, None]
    return ShapePath.spline(samples[0], centred.reshape(len(points), -1))


def _best_turn(masses: Array, start: Array, end: Array) -> Array:
    """The rotation that takes one set of points nearest to another (Kabsch 1976)."""
    left, _, right = np.linalg.svd(np.einsum("m,mi,mj->ij", masses, end, start))
    sign = np.sign(np.linalg.det(left @ right))
    return left @ np.diag([1.0, 1.0, sign]) @ right
