"""The attitude of a free body whose shape changes in a known way."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, overload

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import (
    check_choice,
    check_file_name,
    check_object,
    initial_state_arguments,
    made_by,
    number_argument,
    threads_argument,
    times_argument,
    tolerance_argument,
)
from ..arrays import Array, Integers, common_batch, copied_when_read, finite_array, lock_arrays, read_only
from ..deformation.deformation import Deformation, DeformationFamily
from ..display import frozen, short_repr
from ..errors import ShapeError, WrongObjectError
from ..inertia_tensor import inverse_inertia
from ..integrator.driven_attitude import dop853_attitude
from ..integrator.integrate import stepped_rotation
from ..integrator.interpolant import Interpolant
from ..integrator.lift import Lift, error_turns, lift_along
from ..integrator.many_rotations import GroupedRotations, assembled, rotations_of_variants
from ..integrator.stepped import SteppedRotation
from ..run_progress import ProgressCallback, watched
from ..shape_space.body_path import path_sampler
from ._motion_views import MotionViews, base_positions
from ._solvers import METHODS, SOLVERS, Solution, check_pieces
from .motion_record import read_motion_record, write_motion_record

if TYPE_CHECKING:
    from .external_torque import ExternalTorque, TorqueState
    from .forced_motion import ForcedMotion

_FAMILY_METHODS = ("auto", "spectral")
_BACKWARD_TOLERANCE = 1e-11  # [rad] of the turn back to the start: a hundredth of the usual one of `reconstruct`


@frozen
class Sensitivity:
    """Derivatives of the final attitude by the momentum and the initial attitude. Made by `Motion.sensitivity`.

    A change dmu of the momentum and a turn of the start to R(0) exp(hat(delta)) turn the end to R(T) exp(hat(e)) with
    e = by_momentum dmu + by_attitude delta: the derivative of the steps, not a difference.

    Attributes
    ----------
    by_momentum : batch + (3, 3) [rad per kg m^2/s], from inertial axes to base axes
    by_attitude : batch + (3, 3), base axes at the start to base axes at the end
    """

    by_momentum: Array
    by_attitude: Array


@made_by(
    "reconstruct(deformation, momentum), where articulated(body, path) makes a deformation, or load_motion(file)",
    Body="of one made by articulated, it is motion.deformation.description.body",
    ShapePath="of one made by articulated, it is motion.deformation.description.path",
    Deformation="it is motion.deformation",
)
@copied_when_read("initial_attitude")
@dataclass(frozen=True, eq=False, repr=False)
class Motion(MotionViews):
    """Motion of a free body: attitude, body angular momentum and angular velocity at any time of [0, T].

    Results have the shape batch + t.shape + item, where batch are the leading axes of momentum and attitude.

    Attributes
    ----------
    deformation : the body's shape in time
    momentum : batch + (3,), about the centre of mass, inertial axes [kg m^2/s]
    initial_attitude : batch + (3, 3), base axes to inertial axes
    tolerance : the one requested [rad]
    method : the one used
    evaluations : how often the locked inertia and internal momentum were computed
    solution : S(t), the attitude relative to the start: attitude(t) = initial_attitude S(t)

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 2.0), [0.0, 0.0, 5.0])
    >>> print(motion.angular_velocity(1.0).round(9))  # momentum over moment
    [0. 0. 2.]
    >>> print(motion.quat_xyzw(0.5).round(6))  # half a radian as half an angle
    [0.       0.       0.479426 0.877583]
    """

    deformation: Deformation
    momentum: Array
    initial_attitude: Array
    tolerance: float
    method: str
    evaluations: int
    solution: Solution

    __post_init__ = lock_arrays

    @property
    def duration(self) -> float:
        """Length T of the interval [s]."""
        return self.deformation.duration

    @property
    def batch(self) -> tuple[int, ...]:
        """Leading axes of momentum and initial attitude."""
        return self.momentum.shape[:-1]

    def attitude(self, t: ArrayLike) -> Array:
        """R(t), base axes to inertial axes: times (...) -> batch + (..., 3, 3).

        Equation :eq:`attitude` of the documentation.
        """
        times = times_argument(t, self.duration)
        turned = self._flat_attitude[:, None] @ self.solution.rotation(times.ravel())
        return turned.reshape(*self.batch, *times.shape, 3, 3)

    def quat_xyzw(self, t: ArrayLike) -> Array:
        """The attitude as quaternions x y z w with w >= 0: times (...) -> batch + (..., 4)."""
        return so3.quat_from_matrix(self.attitude(t))

    def body_momentum(self, t: ArrayLike) -> Array:
        """Pi(t) = R(t)^T momentum: times (...) -> batch + (..., 3), base axes [kg m^2/s].

        Equation :eq:`momentum` of the documentation.
        """
        times = times_argument(t, self.duration)
        attitude = self.attitude(times)
        spatial = self.momentum.reshape(*self.batch, *(1,) * times.ndim, 3)
        return so3.apply(so3.transpose(attitude), np.broadcast_to(spatial, attitude.shape[:-1]))

    def angular_velocity(self, t: ArrayLike) -> Array:
        """omega(t) = I^-1 (Pi - L_o): times (...) -> batch + (..., 3), base axes [rad/s]."""
        times = times_argument(t, self.duration)
        inertia, internal = self.deformation.description.sample(times.ravel())
        pi = self.body_momentum(times).reshape(-1, times.size, 3)
        omega = so3.apply(inverse_inertia(inertia, times.ravel()), pi - internal)
        return omega.reshape(*self.batch, *times.shape, 3)

    def base_position(
        self,
        t: ArrayLike,
        *,
        start: ArrayLike = (0.0, 0.0, 0.0),
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        gravity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> Array:
        """Position of the base origin, inertial axes: times (...) -> batch + (..., 3) [m].

        The centre of mass moves as start + velocity t + gravity t^2 / 2; by default it rests at the origin.

        Parameters
        ----------
        start, velocity, gravity : (3,) of the centre of mass, inertial axes [m], [m/s], [m/s^2]
        """
        return base_positions(self, t, start, velocity, gravity)

    @property
    def final_attitude(self) -> Array:
        """R(T): batch + (3, 3)."""
        return self.attitude(self.duration)

    @property
    def error_estimate(self) -> Array:
        """Estimate of the largest attitude error over [0, T]: batch [rad]."""
        return self.solution.error_estimate.reshape(self.batch)[()]

    @cached_property
    def equation_residual(self) -> Array:
        """Largest defect of I omega + L_o = R^T momentum, omega by differentiating R(t): batch [relative].

        The deformation is evaluated again at 20 times, so an error of sampling or stepping shows here.
        """
        if len(self.parts) > 1:
            residuals = [(rows, np.atleast_1d(part.equation_residual)) for rows, part in self.parts]
            return assembled(residuals).reshape(self.batch)
        ends = self.solution.times
        inner = np.repeat(ends[:-1], 2) + np.repeat(np.diff(ends), 2) * np.tile([0.3, 0.7], len(ends) - 1)
        times = inner[np.linspace(0, len(inner) - 1, 20).astype(int)]
        inertia, internal = self.deformation.description.sample(times)
        omega = self._differentiated(times)
        pi = self.body_momentum(times).reshape(-1, len(times), 3)
        defect = so3.apply(inertia[None], omega) + internal - pi
        scale = np.linalg.norm(pi, axis=-1).max() + np.linalg.norm(internal, axis=-1).max() + 1e-300
        return (np.linalg.norm(defect, axis=-1).max(axis=-1) / scale).reshape(self.batch)[()]

    @cached_property
    def parts(self) -> tuple[tuple[Integers, Motion], ...]:
        """Rows of the flattened batch that share samples and steps, and the motions of each; of one motion itself."""
        if not isinstance(self.solution, GroupedRotations):
            return ((np.arange(len(self._flat_attitude)), self),)
        momentum = self.momentum.reshape(-1, 3)
        return tuple(
            (rows, replace(self, momentum=momentum[rows], initial_attitude=self._flat_attitude[rows], solution=part))
            for rows, part in self.solution.parts
        )

    @cached_property
    def stepped(self) -> SteppedRotation | GroupedRotations:
        """The motion on interpolants; for another method an interpolant's steps hold the method's rotations."""
        if isinstance(self.solution, SteppedRotation | GroupedRotations):
            return self.solution
        start = so3.apply(so3.transpose(self._flat_attitude), self.momentum.reshape(-1, 3))
        stepped = stepped_rotation(self.deformation.sampler(), start, self.tolerance)
        return stepped.with_rotations(self.solution.rotation(stepped.times), self.solution.error_estimate)

    @property
    def horizontal_lift(self) -> SteppedRotation:
        """Rotation of the base by the shape motion alone, on the samples and steps of the motion."""
        return self.lift_with_errors.rotation

    @cached_property
    def lift_with_errors(self) -> Lift:
        """Horizontal lift with its error estimates; integrated once, when first needed."""
        deformation = self.deformation
        return lift_along(self._finest, deformation.stored_momentum if deformation.has_wheels else None)

    @cached_property
    def lift_without_momentum(self) -> Lift:
        """Rotation without total momentum: by the shape, and by the momentum that wheels store."""
        return lift_along(self._finest) if self.deformation.has_wheels else self.lift_with_errors

    @property
    def _finest(self) -> SteppedRotation:
        return self.stepped.finest if isinstance(self.stepped, GroupedRotations) else self.stepped

    @cached_property
    def error_turns(self) -> Array:
        """Attitude errors at the ends of steps by stepping and by sampling, base axes: (2, B, K + 1, 3) [rad]."""
        assert isinstance(self.stepped, SteppedRotation), "a batch has one array for each part"
        return read_only(error_turns(self.stepped, self.lift_without_momentum))

    @property
    def interpolant(self) -> Interpolant:
        """Series of I^-1 and I^-1 L_o that were integrated; in a batch those of the largest momentum."""
        return self.stepped.interpolant

    @property
    def amplification(self) -> Array:
        """Largest factor by which an attitude error grows from one time to a later one: batch."""
        return self.stepped.amplification.reshape(self.batch)[()]

    @cached_property
    def sensitivity(self) -> Sensitivity:
        """Derivatives of the final attitude by momentum and initial attitude."""
        stepped = self.stepped
        slope = stepped.momentum_slope
        start = so3.apply(so3.transpose(self._flat_attitude), self.momentum.reshape(-1, 3))
        by_momentum = slope @ so3.transpose(self._flat_attitude)
        by_attitude, matrix = so3.transpose(stepped.end) + slope @ so3.hat(start), (*self.batch, 3, 3)
        return Sensitivity(by_momentum.reshape(matrix), by_attitude.reshape(matrix))

    def dynamic_phase(self, t: ArrayLike) -> Array:
        """Integral of omega . Pi/|Pi| from 0 to t: times (...) -> batch + (...) [rad]; zero without momentum.

        Equation :eq:`montgomery-phase` of the documentation.
        Source: Cabrera 2006, equation (12); theory.md B9.
        """
        times = times_argument(t, self.duration)
        return self.stepped.dynamic_phase(times.ravel()).reshape((*self.batch, *times.shape))[()]

    def solid_angle(self, t: ArrayLike) -> Array:
        """Signed area enclosed by the direction of Pi from 0 to t and the great circle that closes it, base axes.

        Times (...) -> batch + (...) [sr]; zero without momentum. It grows continuously from zero as long as Pi keeps
        away from the point opposite its start, where it jumps by 4 pi: at the end of the motion it is that of
        `split(motion, "base")` up to multiples of 4 pi, to the same accuracy, and dynamic_phase - solid_angle turns the
        start into the attitude, up to the transport along the great circle.

        Source: theory.md D; numerics.md section 3.
        """
        times = times_argument(t, self.duration)
        return self.stepped.solid_angle(times.ravel()).reshape((*self.batch, *times.shape))[()]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the motion to an NPZ file that `load_motion` reads, and with a body, as its recording, `split`."""
        check_file_name(path, "path")
        write_motion_record(self, path)

    @cached_property
    def _flat_attitude(self) -> Array:
        return self.initial_attitude.reshape(-1, 3, 3)

    def _differentiated(self, times: Array) -> Array:
        """Angular velocity by differences of order eight of the attitude within a step: (N,) -> (B, N, 3)."""
        ends = self.solution.times
        index = np.clip(np.searchsorted(ends, times, side="right") - 1, 0, len(ends) - 2)
        reach = np.minimum(times - ends[index], ends[index + 1] - times)
        h = 0.24 * reach
        middle = self.solution.rotation(times)
        total = np.zeros((*middle.shape[:2], 3))
        for k, weight in enumerate((4 / 5, -1 / 5, 4 / 105, -1 / 280), start=1):
            ahead, behind = self.solution.rotation(times + k * h), self.solution.rotation(times - k * h)
            total += weight * (so3.vee(so3.transpose(middle) @ ahead) - so3.vee(so3.transpose(middle) @ behind))
        return total / h[:, None]


@made_by(Motion="take one of its motions, family[0]")
@dataclass(frozen=True, eq=False)
class MotionFamily(Sequence[Motion]):
    """Motions of N bodies of a family, as a sequence. Made by `reconstruct`.

    Attributes
    ----------
    deformations : those of the bodies
    momentum : (N, 3) of each about its centre of mass, inertial axes [kg m^2/s]
    initial_attitude : (N, 3, 3) base axes to inertial axes
    tolerance : the one requested [rad]
    solution : S(t) of each, the attitude relative to the start
    """

    deformations: DeformationFamily
    momentum: Array
    initial_attitude: Array
    tolerance: float
    solution: tuple[SteppedRotation, ...]

    __post_init__ = lock_arrays
    __repr__ = short_repr

    def __len__(self) -> int:
        """Number of motions, N."""
        return len(self.momentum)

    @overload
    def __getitem__(self, index: int) -> Motion: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Motion, ...]: ...

    def __getitem__(self, index: int | slice) -> Motion | tuple[Motion, ...]:
        """Return one of the motions, or a tuple of those of a slice."""
        numbers = range(len(self))[index]
        if isinstance(numbers, range):
            return tuple(self[number] for number in numbers)
        solution = self.solution[numbers]
        return Motion(
            deformation=self.deformations[numbers],
            momentum=self.momentum[numbers],
            initial_attitude=self.initial_attitude[numbers],
            tolerance=self.tolerance,
            method="spectral",
            evaluations=solution.interpolant.evaluations,
            solution=solution,
        )

    @property
    def duration(self) -> float:
        """Length T of the interval [s]."""
        return self.deformations.duration

    @property
    def error_estimate(self) -> Array:
        """Estimate of the largest attitude error of each over [0, T]: (N,) [rad]."""
        return np.array([rotation.error_estimate[0] for rotation in self.solution])

    @property
    def evaluations(self) -> Integers:
        """How often the locked inertia and internal momentum of each were computed: (N,)."""
        return np.array([rotation.interpolant.evaluations for rotation in self.solution], dtype=np.int64)

    @property
    def final_attitude(self) -> Array:
        """R(T) of each: (N, 3, 3)."""
        return self.initial_attitude @ np.array([rotation.end[0] for rotation in self.solution]).reshape(-1, 3, 3)

    def attitude(self, t: ArrayLike) -> Array:
        """R(t) of each, base axes to inertial axes: times (...) -> (N, ..., 3, 3)."""
        times = times_argument(t, self.duration)
        turned = np.empty((len(self), times.size, 3, 3))
        for number, start in enumerate(self.initial_attitude):
            turned[number] = start @ self.solution[number].rotation(times.ravel())[0]
        return turned.reshape(len(self), *times.shape, 3, 3)


@overload
def reconstruct(
    deformation: Deformation,
    momentum: ArrayLike,
    attitude: ArrayLike | None = None,
    *,
    tolerance: float = 1e-9,
    method: str = "auto",
    threads: int | None = None,
    progress: ProgressCallback | None = None,
    torque: None = None,
) -> Motion: ...


@overload
def reconstruct(
    deformation: Deformation,
    momentum: ArrayLike,
    attitude: ArrayLike | None = None,
    *,
    tolerance: float = 1e-9,
    method: str = "auto",
    threads: int | None = None,
    progress: ProgressCallback | None = None,
    torque: ExternalTorque | Callable[[TorqueState], ArrayLike],
) -> ForcedMotion: ...


@overload
def reconstruct(
    deformation: DeformationFamily,
    momentum: ArrayLike,
    attitude: ArrayLike | None = None,
    *,
    tolerance: float = 1e-9,
    method: str = "auto",
    threads: int | None = None,
    progress: ProgressCallback | None = None,
) -> MotionFamily: ...


def reconstruct(
    deformation: Deformation | DeformationFamily,
    momentum: ArrayLike | None = None,
    attitude: ArrayLike | None = None,
    *,
    tolerance: float = 1e-9,
    method: str = "auto",
    threads: int | None = None,
    progress: ProgressCallback | None = None,
    torque: ExternalTorque | Callable[[TorqueState], ArrayLike] | None = None,
) -> Motion | MotionFamily | ForcedMotion:
    """Return the motion of a free body with a known change of shape and a given angular momentum.

    Solves R' = R hat(I^-1 (R^T momentum - L_o)); with an external torque the momentum changes by R torque, too.

    Equations :eq:`reconstruction`, :eq:`euler` and :eq:`external-torque` of the documentation.
    Source: Cabrera 2006, equations (8) to (10); theory.md section 2.

    Parameters
    ----------
    deformation : one, or those of a family of N bodies, each computed as if it were alone
    momentum : (..., 3) about the centre of mass, inertial axes [kg m^2/s]; zero is allowed. For a family (3,) or (N, 3)
    attitude : (..., 3, 3) of the deformation's frame at t = 0, to inertial axes; None: the identity. Leading
        axes of both broadcast.
    tolerance : largest attitude error over the whole interval, between 1e-13 and 1e-4 [rad]
    method : "auto" or "spectral" (the deformation sampled at Chebyshev points, the attitude stepped on the interpolant
        by a Runge-Kutta method of order 8), or "dop853" (SciPy's integrator on the deformation itself, an independent
        check)
    threads : largest number of threads for many momenta; None: one for each processor. Results do not depend on it
    progress : called some two hundred times in a long run as `progress(share, text)`: the share that is done, from 0
        to 1, which never falls, and what is being done; a true return stops the run
    torque : external torque, an `ExternalTorque` or a function of a `TorqueState` in base axes [N m]; None: no torque.
        With one, attitude and momentum are integrated together, by SciPy's DOP853, to a `ForcedMotion`

    Raises
    ------
    ShapeError, UnknownNameError
        For arguments of the wrong shape, or an unknown method.
    SingularInertiaError
        If the locked inertia is not positive definite somewhere.
    AccuracyNotReached
        If the tolerance cannot be met.
    TrajectoryError
        For more than 400,000 intervals between breaks in one loop (a recording has one between samples).
    RunStopped
        If `progress` stopped the run.
    WrongObjectError
        If no momentum is given.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 2.0), [0.0, 0.0, 5.0])
    >>> print(f"{sp.so3.log(motion.final_attitude)[2]:.6f} = 4 - 2 pi")  # 2 rad/s for 2 s
    -2.283185 = 4 - 2 pi
    """
    goal, workers = tolerance_argument(tolerance), threads_argument(threads)
    # The class whose check takes less time comes first.
    if not isinstance(deformation, Deformation) and (
        torque is not None or not isinstance(deformation, DeformationFamily)
    ):
        check_object(deformation, "Deformation", "deformation")
    if momentum is None:
        # Optional in the signature, so that a wrong deformation is reported first.
        raise WrongObjectError(
            "momentum: three numbers [kg m^2/s] are needed, none were given; for a body at rest they are "
            "[0.0, 0.0, 0.0]"
        )
    if torque is not None:
        from .forced_motion import reconstruct_forced

        assert isinstance(deformation, Deformation)
        return reconstruct_forced(deformation, momentum, attitude, torque, goal, method)
    if not isinstance(deformation, Deformation) and isinstance(deformation, DeformationFamily):
        with watched(progress):
            return _family_motions(deformation, momentum, attitude, goal, method)
    check_choice(method, "method", METHODS)
    spatial, start = initial_state_arguments(momentum, attitude)
    at_start = spatial if attitude is None else so3.apply(so3.transpose(start), spatial)
    with watched(progress):
        check_pieces(deformation)
        solution, evaluations = SOLVERS[method](deformation, at_start.reshape(-1, 3), goal, workers)
    return Motion(
        deformation=deformation,
        momentum=spatial,
        initial_attitude=start,
        tolerance=goal,
        method="spectral" if method == "auto" else method,
        evaluations=evaluations,
        solution=solution,
    )


def _family_motions(
    deformations: DeformationFamily,
    momentum: ArrayLike,
    attitude: ArrayLike | None,
    tolerance: float,
    method: str,
) -> MotionFamily:
    """Return the motions of a family of deformations; the tolerance has been checked."""
    check_choice(method, "method for a family of bodies", _FAMILY_METHODS)
    count = len(deformations)
    spatial, start = initial_state_arguments(momentum, attitude)
    if spatial.shape[:-1] not in ((), (count,)):
        raise ShapeError(
            f"momentum and attitude: one for all or one for each of {count} bodies is needed, got a batch of "
            f"{spatial.shape[:-1]}"
        )
    spatial, start = np.broadcast_to(spatial, (count, 3)), np.broadcast_to(start, (count, 3, 3))
    at_start = so3.apply(so3.transpose(start), spatial)
    samplers = (path_sampler(body, deformations.path) for body in deformations.bodies)
    solution = rotations_of_variants(samplers, at_start, tolerance)
    return MotionFamily(
        deformations=deformations,
        momentum=spatial,
        initial_attitude=start,
        tolerance=tolerance,
        solution=solution,
    )


def load_motion(path: str | os.PathLike[str]) -> Motion:
    """Read a motion written by `Motion.save`; it needs neither the body nor the path it was made from.

    Raises
    ------
    InputFileNotFoundError
        If there is no such file.
    ResultFileError
        If the file is not a motion, is damaged, or was written by a version with another format.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> motion.save("motion.npz")
    >>> print(np.abs(sp.load_motion("motion.npz").final_attitude - motion.final_attitude).max().round(9))
    0.0
    """
    check_file_name(path, "path")
    return Motion(**read_motion_record(path))


def momentum_from_rate(
    deformation: Deformation | DeformationFamily,
    angular_velocity: ArrayLike,
    attitude: ArrayLike | None = None,
    *,
    time: float = 0.0,
) -> Array:
    """Return the angular momentum of a body whose base has this angular velocity at one time while its shape moves.

    Source: Cabrera 2006, equation (7).

    Parameters
    ----------
    deformation : one, or, at the start, those of a family of N bodies, where leading axes are () or (N,)
    angular_velocity : (..., 3) of the base at that time, base axes [rad/s]
    attitude : (..., 3, 3) at t = 0; None: the identity
    time : at which the base turns so [s]; from a later one the motion is integrated back to the start

    Returns
    -------
    (..., 3) about the centre of mass, inertial axes [kg m^2/s]: R (I omega + L_o)

    Raises
    ------
    ShapeError
        For arrays of the wrong shape, or a family at a later time.
    TrajectoryError
        For a time outside the motion.

    Examples
    --------
    >>> sp.momentum_from_rate(sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0), [0.0, 0.0, 2.0]).tolist()
    [0.0, 0.0, 5.0]
    """
    if not isinstance(deformation, DeformationFamily):
        check_object(deformation, "Deformation", "deformation")
    omega = finite_array(angular_velocity, "angular_velocity", (3,), unit="rad/s")
    at = float(times_argument(number_argument(time, "time", "s"), deformation.duration))
    if at and not isinstance(deformation, Deformation):
        raise ShapeError(f"time: the rates of a family are those at the start, time=0, got {at:g}")
    inertia, internal = deformation.inertia(at), deformation.internal_momentum(at)
    common_batch(deformation=inertia.shape[:-2], angular_velocity=omega.shape[:-1])
    body = so3.apply(inertia, omega) + internal
    if at and isinstance(deformation, Deformation):
        body = _carried_to_start(deformation, body.reshape(-1, 3), at).reshape(body.shape)
    return body if attitude is None else so3.apply(so3.rotation_argument(attitude, "attitude"), body)


def _carried_to_start(deformation: Deformation, momenta: Array, time: float) -> Array:
    """Momenta in base axes at t = 0 by those at a later time: (B, 3) -> (B, 3).

    Shapes in reverse, with rates and momenta reversed, make a motion, too.
    """
    sample, breaks = deformation.description.sample, deformation.breaks

    def backwards(times: Array) -> tuple[Array, Array]:
        inertia, internal = sample(np.maximum(time - times, 0.0))
        return inertia, -internal

    passed = np.append(0.0, time - breaks[breaks < time][::-1])
    turns = [dop853_attitude(backwards, passed, -row, _BACKWARD_TOLERANCE) for row in momenta]
    starts = np.stack([turn.attitude(np.array([time]))[0] for turn in turns])
    return so3.apply(so3.transpose(starts), momenta)
