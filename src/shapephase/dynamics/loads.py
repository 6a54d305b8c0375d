"""Loads of the joints of a moving body over a whole motion: peaks against limits, and the work that they do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev as series
from numpy.polynomial.legendre import leggauss

from ..arrays import Array, lock_arrays
from ..chebyshev import chebyshev
from ..display import short_repr
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ..refinement import halved, settled
from .moving_body import BY_JOINTS, drive, needed_body_and_path
from .wheels import solution_times

_POINTS = 10  # Gauss points of a panel
_LOOKS = 65  # places of a panel where peaks are searched: a smooth torque hides at most 1e-4 of itself between two
_SETTLED = 1e-11  # difference of two quadratures, of the work done back and forth
_MOST_HALVINGS = 5  # of the motion's steps: its torques are as smooth as what was integrated
_NO_POWER = 1e-13  # of the largest power: below it the sign is rounding


@dataclass(frozen=True, eq=False, kw_only=True)
class JointLoads:
    """Peaks and work of the joints over a whole motion; arrays are batch + (n,) where nothing else is stated.

    Made by `joint_torques`.

    Equation :eq:`joint-work` of the documentation.

    Attributes
    ----------
    joint_names, joint_units : "rad" for torques in N m, "m" for forces in N
    mass : of the body [kg]
    peak_torque : largest size [N m or N]
    peak_time : when [s]
    peak_rate : (n,) largest size [rad/s or m/s]
    peak_power : largest size [W]
    rate_time, power_time : (n,) and batch + (n,), when these two are [s]
    positive_work, negative_work : done by the joint, and taken up by it, the latter negative [J]
    energy_change : batch, of the kinetic energy [J]
    energy_defect : batch, by how much the work of all joints, and of a torque from outside, misses it, of the work that
        joints do back and forth [1]
    effort_limits, rate_limits : (n,) of the body, infinite where none is stated
    """

    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    mass: float
    peak_torque: Array
    peak_time: Array
    peak_rate: Array
    peak_power: Array
    rate_time: Array
    power_time: Array
    positive_work: Array
    negative_work: Array
    energy_change: Array
    energy_defect: Array
    effort_limits: Array
    rate_limits: Array

    __repr__ = short_repr
    __post_init__ = lock_arrays

    @property
    def work(self) -> Array:
        """Net, done by each joint: batch + (n,) [J]."""
        return self.positive_work + self.negative_work

    @property
    def peak_torque_per_mass(self) -> Array:
        """Peak torque per mass of the body: batch + (n,) [N m/kg or N/kg]."""
        return self.peak_torque / self.mass

    @property
    def effort_share(self) -> Array:
        """The peak torque as a part of the joint's limit: batch + (n,); 0 where none is stated."""
        return self.peak_torque / self.effort_limits

    @property
    def rate_share(self) -> Array:
        """The peak rate as a part of the joint's limit: (n,); 0 where none is stated."""
        return self.peak_rate / self.rate_limits

    def to_dict(self) -> dict[str, Any]:
        """All of it for JSON: by joint, with units in the names; null for a limit that is not stated."""
        joints = {}
        for k, (name, unit) in enumerate(zip(self.joint_names, self.joint_units, strict=True)):
            kind, effort = ("torque", "N_m") if unit == "rad" else ("force", "N")
            columns = {
                f"peak_{kind}_{effort}": self.peak_torque,
                f"peak_per_mass_{effort}_kg": self.peak_torque_per_mass,
                "peak_time_s": self.peak_time,
                f"effort_limit_{effort}": self.effort_limits,
                f"peak_rate_{unit}_s": self.peak_rate,
                f"rate_limit_{unit}_s": self.rate_limits,
                "peak_power_W": self.peak_power,
                "work_J": self.work,
                "positive_work_J": self.positive_work,
                "negative_work_J": self.negative_work,
            }
            values = {label: np.asarray(array[..., k]).tolist() for label, array in columns.items()}
            joints[name] = {label: None if value == np.inf else value for label, value in values.items()}
        return {
            "mass_kg": self.mass,
            "joints": joints,
            "energy_change_J": np.asarray(self.energy_change).tolist(),
            "energy_defect": np.asarray(self.energy_defect).tolist(),
        }


_GAUSS = np.asarray(leggauss(_POINTS)[0], dtype=np.float64)
_WEIGHTS = np.asarray(leggauss(_POINTS)[1], dtype=np.float64)
_TO_SERIES = np.asarray(np.linalg.inv(chebyshev(_GAUSS, _POINTS)), dtype=np.float64)  # from values at Gauss points
_EVEN = np.linspace(-1.0, 1.0, _LOOKS)
_TO_EVEN = chebyshev(_EVEN, _POINTS) @ _TO_SERIES  # from values at Gauss points to those at even places


@dataclass(frozen=True, eq=False, kw_only=True)
class _Panels:
    """The joints at Gauss points of panels: edges (P + 1,) [s], torque, power (B, P, m, n) and rate (P, m, n)."""

    edges: Array
    torque: Array
    power: Array
    rate: Array

    @property
    def work(self) -> Array:
        """Net work of each joint: (B, n) [J]."""
        return np.einsum("p,m,bpmn->bn", 0.5 * np.diff(self.edges), _WEIGHTS, self.power)

    @property
    def both_ways(self) -> Array:
        """The work done back and forth, about: (B,) [J]."""
        return np.einsum("p,m,bpmn->b", 0.5 * np.diff(self.edges), _WEIGHTS, np.abs(self.power))

    def peaks(self, values: Array) -> tuple[Array, Array]:
        """Largest sizes and their times: values at Gauss points (B, P, m, n) -> (B, n), (B, n)."""
        times = _times(self.edges, _EVEN).ravel()
        sizes = np.abs(np.einsum("lm,bpmn->bpln", _TO_EVEN, values)).reshape(len(values), times.size, -1)
        return sizes.max(axis=1), times[sizes.argmax(axis=1)]

    def positive_work(self, which: int, joint: int) -> float:
        """The work of a joint while its power is positive, panels of both signs divided at its zeros [J]."""
        power, halves = self.power[which, :, :, joint], 0.5 * np.diff(self.edges)
        between = power @ _TO_EVEN.T
        small = _NO_POWER * np.abs(power).max(initial=0.0)
        mixed = (between.min(axis=1) < -small) & (between.max(axis=1) > small)
        positive = ~mixed & (power.sum(axis=1) > 0.0)
        total = float(halves[positive] @ (power[positive] @ _WEIGHTS))
        for row in np.flatnonzero(mixed):
            coefficients = _TO_SERIES @ power[row]
            roots = series.chebroots(coefficients)
            real = np.sort(roots.real[(np.abs(roots.imag) < 1e-9) & (np.abs(roots.real) < 1.0)])
            cuts = np.concatenate([[-1.0], real, [1.0]])
            works = np.diff(series.chebval(cuts, series.chebint(coefficients)))
            total += float(halves[row] * works[works > 0.0].sum())
        return total


def joint_loads(motion: Motion | ForcedMotion) -> JointLoads:
    """The loads over a whole motion, on its steps, which are halved until the work no longer changes."""
    body, _ = needed_body_and_path(motion, BY_JOINTS)
    edges = solution_times(motion)
    edges = edges[np.append(True, np.diff(edges) > 1e-12 * motion.duration)]
    edges[-1] = motion.duration
    finest: list[_Panels] = []

    def finer() -> Iterator[_Panels]:
        for steps in halved(edges, _MOST_HALVINGS):
            finest[:] = [_sampled(motion, steps)]
            yield finest[0]

    panels = settled(finer(), _difference, _SETTLED) or finest[0]
    ends = drive(motion, np.array([0.0, motion.duration]))
    change = ends.energy[:, 1] - ends.energy[:, 0]
    from_outside = float(motion.work(motion.duration)) if isinstance(motion, ForcedMotion) else 0.0
    positive = np.array([[panels.positive_work(b, k) for k in range(body.n_rates)] for b in range(len(change))])
    positive = positive.reshape(len(change), body.n_rates)
    net, moved = panels.work, panels.both_ways
    torques, rates, powers = map(panels.peaks, (panels.torque, panels.rate[None], panels.power))
    single = (*motion.batch, body.n_rates)
    defect = np.abs(net.sum(axis=1) + from_outside - change) / np.where(moved > 0.0, moved, 1.0)
    return JointLoads(
        joint_names=body.rate_names,
        joint_units=body.rate_units,
        mass=body.mass,
        peak_torque=torques[0].reshape(single),
        peak_time=torques[1].reshape(single),
        peak_rate=rates[0][0],
        peak_power=powers[0].reshape(single),
        rate_time=rates[1][0],
        power_time=powers[1].reshape(single),
        positive_work=positive.reshape(single),
        negative_work=(net - positive).reshape(single),
        energy_change=change.reshape(motion.batch)[()],
        energy_defect=defect.reshape(motion.batch)[()],
        effort_limits=body.effort_limits[list(body.rate_columns)],
        rate_limits=body.rate_limits[list(body.rate_columns)],
    )


def _difference(last: _Panels, panels: _Panels) -> float:
    """Largest difference of the works, as a share of the work done back and forth."""
    moved = np.where(panels.both_ways > 0.0, panels.both_ways, 1.0)
    return float(np.max(np.abs(panels.work - last.work) / moved[:, None], initial=0.0))


def _sampled(motion: Motion | ForcedMotion, edges: Array) -> _Panels:
    times = _times(edges, _GAUSS)
    efforts = drive(motion, times.ravel())
    grid = (*times.shape, efforts.rate.shape[-1])
    torque, power = (values.reshape(-1, *grid) for values in (efforts.torque, efforts.power))
    return _Panels(edges=edges, torque=torque, power=power, rate=efforts.rate.reshape(grid))


def _times(edges: Array, places: Array) -> Array:
    """Times of places in [-1, 1] of each panel: (P, m)."""
    return 0.5 * (edges[:-1] + edges[1:])[:, None] + 0.5 * np.diff(edges)[:, None] * places
