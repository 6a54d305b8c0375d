"""Audits from within: of a simulation while it runs, and as an assertion of a test."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_choice, number_argument
from ..arrays import Array, real_array
from ..body.body import Body
from ..body.loading import as_body
from ..errors import ShapeError, TrajectoryError
from .audit_result import Audit
from .floating_trajectory import FloatingTrajectory
from .trajectory_audit import audit

CONVENTIONS = ("mujoco", "pinocchio")


class FlightRecorder:
    """Keeps the states of a running simulation, and audits them.

    Parameters
    ----------
    body : as it should be
    convention : "mujoco", for `qpos` and `qvel`, or "pinocchio", for `q` and `v`
    joint_names : in the order of these arrays; None: MuJoCo's of the body's file, or Pinocchio's, which is the body's
    integrator_step : of the integrator [s]; None: that between samples

    Examples
    --------
    >>> recorder = sp.auditing.FlightRecorder(sp.load_body("cat_two_halves"))
    >>> for k in range(40):  # in a loop of MuJoCo: recorder.add(data.time, data.qpos, data.qvel)
    ...     recorder.add(0.01 * k, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], np.zeros(9))
    >>> recorder.audit().right
    True
    """

    def __init__(
        self,
        body: Body | str,
        convention: str = "mujoco",
        *,
        joint_names: Sequence[str] | None = None,
        integrator_step: float | None = None,
    ) -> None:
        body = as_body(body)
        check_choice(convention, "convention", CONVENTIONS)
        self.body = body
        self.convention = convention
        self.joint_names = joint_names
        self.integrator_step = integrator_step
        self._times: list[float] = []
        self._places: list[Any] = []
        self._rates: list[Any] = []

    def __repr__(self) -> str:
        """One line for people."""
        return f"FlightRecorder({self.body.name!r}, {self.convention}, {len(self._times)} samples)"

    def add(self, time: float, configuration: ArrayLike, velocity: ArrayLike) -> None:
        """Keep a copy of one state: its time [s], `qpos` and `qvel` or `q` and `v`. Raises ShapeError."""
        at, place = number_argument(time, "time", "s"), _row(configuration, "configuration")
        rate = _row(velocity, "velocity")
        self._times.append(at)
        self._places.append(place)
        self._rates.append(rate)

    def trajectory(self) -> FloatingTrajectory:
        """What was kept. Raises TrajectoryError where that is nothing, or does not fit together."""
        if not self._times:
            raise TrajectoryError("nothing was recorded: call add(time, configuration, velocity) after each step")
        if len({len(row) for row in self._places}) > 1 or len({len(row) for row in self._rates}) > 1:
            raise TrajectoryError("the states that were recorded are of different lengths")
        make = FloatingTrajectory.from_mujoco if self.convention == "mujoco" else FloatingTrajectory.from_pinocchio
        return make(
            self.body,
            self._times,
            np.array(self._places),
            np.array(self._rates),
            joint_names=self.joint_names,
            integrator_step=self.integrator_step,
            name="recorded run",
        )

    def audit(self, *, tolerance: float = 1e-3, flight: str | Sequence[float] = "auto") -> Audit:
        """The audit of what was kept; parameters and errors as those of `audit`."""
        return audit(self.body, self.trajectory(), tolerance=tolerance, flight=flight)


def _row(value: ArrayLike, name: str) -> Array:
    """One row of numbers of a simulator, a copy; whether they are finite is looked at in the end. Raises ShapeError."""
    row = real_array(value, name).copy()
    if row.ndim != 1:
        raise ShapeError(f"{name}: one row of numbers is needed, got shape {row.shape}")
    return row


def assert_right_in_flight(
    body: Body | str,
    trajectories: FloatingTrajectory | Sequence[FloatingTrajectory],
    *,
    tolerance: float = 1e-3,
    flight: str | Sequence[float] = "auto",
) -> None:
    """Raise an AssertionError with the table unless the trajectories are right; also where the samples cannot decide.

    Raises
    ------
    AssertionError
        With the table of the audit.

    Examples
    --------
    >>> cat, times = sp.load_body("cat_two_halves"), np.linspace(0.0, 1.0, 51)
    >>> still = sp.FloatingTrajectory(
    ...     times=times, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (51, 1)), shapes=np.zeros((51, 3)))
    >>> print(sp.auditing.assert_right_in_flight(cat, still))
    None
    """
    found = audit(body, trajectories, tolerance=tolerance, flight=flight)
    if not found.right:
        raise AssertionError(found.table())
