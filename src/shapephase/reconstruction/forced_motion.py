"""Motion of a body under an external torque: attitude and momentum are integrated together."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_choice, check_file_name, initial_state_arguments, times_argument
from ..arrays import Array, finite_array, lock_arrays
from ..deformation.deformation import Deformation
from ..display import Card, card_html, card_text, error_text, momentum_text, numbers
from ..errors import ShapeError
from ..inertia_tensor import inverse_inertia
from ..integrator.driven_attitude import DrivenAttitude, driven_attitude
from ..offers import offered
from ._motion_views import base_positions
from .attitude_angles import continuous
from .external_torque import ExternalTorque, TorqueState
from .forced_record import read_forced_record, write_forced_record
from .motion_record import joint_path, write_table

METHODS = ("auto", "dop853")
_ROWS = 201  # of a table, by default
_COLUMNS = (
    "time", "qx", "qy", "qz", "qw", "omega_x_rad_s", "omega_y_rad_s", "omega_z_rad_s", "momentum_x_kg_m2_s",
    "momentum_y_kg_m2_s", "momentum_z_kg_m2_s", "torque_x_N_m", "torque_y_N_m", "torque_z_N_m", "work_J",
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class ForcedMotion:
    """Motion of a body under an external torque; made by `reconstruct(..., torque=)`.

    Attributes
    ----------
    deformation : what moved
    torque_law : the given torque
    initial_momentum : (3,) about the centre of mass, inertial axes [kg m^2/s]
    initial_attitude : (3, 3), base axes to inertial axes
    tolerance : the one requested [rad]
    solution : attitude, momentum and work in time

    Examples
    --------
    >>> push = sp.ExternalTorque(lambda state: [0.0, 0.0, 0.5], axes="space")
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 1.0, 2.0]), 2.0), [0.0, 0.0, 2.0], torque=push)
    >>> motion.momentum(2.0).round(9).tolist(), motion.angular_velocity(2.0).round(9).tolist()
    ([0.0, 0.0, 3.0], [0.0, 0.0, 1.5])
    >>> print(motion.work(2.0).round(9))  # (3^2 - 2^2) / (2 x 2)
    1.25
    """

    deformation: Deformation
    torque_law: ExternalTorque
    initial_momentum: Array
    initial_attitude: Array
    tolerance: float
    solution: DrivenAttitude

    __repr__, _repr_html_ = card_text, card_html
    __post_init__ = lock_arrays

    @property
    def duration(self) -> float:
        """Length T of the interval [s]."""
        return self.deformation.duration

    @property
    def batch(self) -> tuple[int, ...]:
        """Leading axes: none, it is always one motion."""
        return ()

    @cached_property
    def breaks(self) -> Array:
        """Breaks of the deformation and of the torque: (M,), first 0, last `duration` [s]."""
        return np.union1d(self.deformation.breaks, self.torque_law.edges(self.duration))

    @property
    def evaluations(self) -> int:
        """How often inertia, internal momentum and torque were computed."""
        return self.solution.evaluations

    def attitude(self, t: ArrayLike) -> Array:
        """R(t), base axes to inertial axes: times (...) -> (..., 3, 3)."""
        times = times_argument(t, self.duration)
        return self.solution.attitude(times.ravel()).reshape(*times.shape, 3, 3)

    def quat_xyzw(self, t: ArrayLike) -> Array:
        """The attitude as quaternions x y z w with w >= 0: times (...) -> (..., 4)."""
        return so3.quat_from_matrix(self.attitude(t))

    def momentum(self, t: ArrayLike) -> Array:
        """Angular momentum about the centre of mass, inertial axes: times (...) -> (..., 3) [kg m^2/s]."""
        times = times_argument(t, self.duration)
        return self.solution.states(times.ravel())[:, :3].reshape(*times.shape, 3)

    def body_momentum(self, t: ArrayLike) -> Array:
        """Pi(t) = R(t)^T momentum: times (...) -> (..., 3), base axes [kg m^2/s]."""
        return so3.apply(so3.transpose(self.attitude(t)), self.momentum(t))

    def angular_velocity(self, t: ArrayLike) -> Array:
        """omega(t) = I^-1 (Pi - L_o): times (...) -> (..., 3), base axes [rad/s]."""
        times = times_argument(t, self.duration)
        inertia, internal = self.deformation.description.sample(times.ravel())
        pi = self.body_momentum(times).reshape(-1, 3)
        return so3.apply(inverse_inertia(inertia, times.ravel()), pi - internal).reshape(*times.shape, 3)

    def torque(self, t: ArrayLike) -> Array:
        """External torque: times (...) -> (..., 3), base axes [N m]."""
        times = times_argument(t, self.duration)
        flat = times.ravel()
        inertia, internal = self.deformation.description.sample(flat)
        attitudes, momenta = self.attitude(flat), self.body_momentum(flat)
        rates = so3.apply(inverse_inertia(inertia, flat), momenta - internal)
        shapes = _shapes(self.deformation)(flat)
        return _torques(self.torque_law, flat, attitudes, rates, shapes, inertia, momenta).reshape(*times.shape, 3)

    def work(self, t: ArrayLike) -> Array:
        """Work of the torque since the start, the integral of torque . omega: times (...) -> (...) [J]."""
        times = times_argument(t, self.duration)
        return self.solution.states(times.ravel())[:, 3].reshape(times.shape)[()]

    def base_position(
        self,
        t: ArrayLike,
        *,
        start: ArrayLike = (0.0, 0.0, 0.0),
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        gravity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> Array:
        """Position of the base origin as `Motion.base_position` has it: times (...) -> (..., 3) [m].

        The torque comes without a force: the centre of mass moves as without it.
        """
        return base_positions(self, t, start, velocity, gravity)

    @property
    def final_attitude(self) -> Array:
        """R(T): (3, 3)."""
        return self.attitude(self.duration)

    @property
    def final_momentum(self) -> Array:
        """Angular momentum at the end, inertial axes: (3,) [kg m^2/s]."""
        return self.momentum(self.duration)

    @property
    def error_estimate(self) -> float:
        """Estimate of the attitude error over [0, T], the difference of two integrations [rad]."""
        return float(self.solution.attitude_errors[-1])

    @property
    def momentum_error(self) -> float:
        """Estimate of the momentum error over [0, T] [kg m^2/s]."""
        return float(np.linalg.norm(self.solution.state_errors[-1, :3]))

    def error_in_time(self, t: ArrayLike) -> Array:
        """Estimate of the attitude error from the start to each time: (...) -> (...) [rad]."""
        times = times_argument(t, self.duration)
        place = np.searchsorted(self.solution.error_times, times)
        return self.solution.attitude_errors[np.minimum(place, len(self.solution.error_times) - 1)]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the motion to an NPZ file that `ForcedMotion.load` reads, without need of body and torque function.

        The file has the torque as it was along this motion, in time.
        """
        check_file_name(path, "path")
        write_forced_record(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> ForcedMotion:
        """Read a motion written by `save`.

        Raises
        ------
        InputFileNotFoundError
            If there is no such file.
        ResultFileError
            If the file is not a motion under a torque, is damaged, or was written by a version with another format.

        Examples
        --------
        >>> push = sp.ExternalTorque(lambda state: [0.0, 0.0, 0.5], axes="space")
        >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 1.0, 2.0]), 2.0), [0.0, 0.0, 2.0], torque=push)
        >>> motion.save("pushed.npz")
        >>> print(sp.ForcedMotion.load("pushed.npz").momentum(2.0).round(9))
        [0. 0. 3.]
        """
        check_file_name(path, "path")
        return cls(**read_forced_record(path))

    def view(self, **options: Any) -> Any:
        """Return a page of the motion in three dimensions, as `Motion.view`; the arrow of the momentum changes.

        Parameters
        ----------
        options : of `shapephase.view`
        """
        return offered("Motion.view")(self, **options)

    def write_csv(self, path: str | os.PathLike[str], times: ArrayLike | None = None) -> None:
        """Write a time series: attitude (x y z w), angular velocity, momentum, torque and its work.

        Parameters
        ----------
        times : (N,) [s]; None: 201 even times
        """
        t = np.linspace(0.0, self.duration, _ROWS) if times is None else finite_array(times, "times", (None,), unit="s")
        rows = [
            continuous(self.quat_xyzw(t)).T,
            self.angular_velocity(t).T,
            self.momentum(t).T,
            self.torque(t).T,
            self.work(t)[None],
        ]
        write_table(path, dict(zip(_COLUMNS, [t, *np.concatenate(rows)], strict=True)))

    def _card(self) -> Card:
        rows = [
            ("duration", numbers(self.duration, "s")),
            ("momentum at the start", momentum_text(self.initial_momentum)),
            ("and at the end", momentum_text(self.final_momentum)),
            ("work of the torque", numbers(self.work(self.duration), "J")),
            ("final attitude", f"{numbers(self.quat_xyzw(self.duration))}, x y z w"),
            ("error estimate", error_text(self.error_estimate)),
        ]
        return Card(f"ForcedMotion: {self.deformation.label}", rows)


def reconstruct_forced(
    deformation: Deformation,
    momentum: ArrayLike,
    attitude: ArrayLike | None,
    torque: ExternalTorque | Callable[[TorqueState], ArrayLike],
    tolerance: float,
    method: str,
) -> ForcedMotion:
    """Return the motion under a torque, with the arguments and errors of `reconstruct`."""
    check_choice(method, "method with a torque", METHODS)
    law = torque if isinstance(torque, ExternalTorque) else ExternalTorque(torque)
    spatial, start = initial_state_arguments(momentum, attitude)
    if spatial.ndim > 1 or start.ndim > 2:
        raise ShapeError("with a torque from outside one motion at a time is computed; give one momentum and attitude")
    breaks = np.union1d(deformation.breaks, law.edges(deformation.duration))
    sample, shapes = deformation.description.sample, _shapes(deformation)

    def rates(times: Array, turned: Array, states: Array) -> tuple[Array, Array]:
        inertia, internal = sample(times)
        pi = so3.apply(so3.transpose(turned), states[:, :3])
        omega = so3.apply(inverse_inertia(inertia, times), pi - internal)
        torques = _torques(law, times, turned, omega, shapes(times), inertia, pi)
        return omega, np.column_stack([so3.apply(turned, torques), np.sum(torques * omega, axis=-1)])

    tensor = sample(np.zeros(1))[0][0]
    least = float(np.linalg.eigvalsh(inverse_inertia(tensor))[0])
    # Its own momentum, and one that turns it by a radian in the whole time.
    size = float(np.linalg.norm(spatial)) + 1.0 / (least * deformation.duration)
    scales = np.array([size, size, size, size**2 * least])
    limits = deformation.step_limits()
    solution = driven_attitude(rates, breaks, start, np.append(spatial, 0.0), scales, tolerance, limits)
    return ForcedMotion(deformation, law, spatial, start, tolerance, solution)


def _torques(law: ExternalTorque, *states: Array) -> Array:
    """Torques (N, 3), base axes, at given times, attitudes, rates, shapes, inertias and momenta."""
    return np.array(
        [
            law.in_base_axes(
                TorqueState(time=float(t), attitude=turned, rate=omega, shape=shape, inertia=tensor, momentum=pi)
            )
            for t, turned, omega, shape, tensor, pi in zip(*states, strict=True)
        ]
    )


def _shapes(deformation: Deformation) -> Callable[[Array], Array]:
    """Return the function from times (N,) to shapes (N, n); without joints (N, 0)."""
    path = joint_path(deformation)
    if path is None:
        return lambda t: np.zeros((len(t), 0))
    return lambda t: path.curve(t)[0]
