"""What the joints of a moving body bear over a whole motion: peaks against limits, and the work that they do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
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
from .moving_body import BY_JOINTS, Drive, check_motion, drive, needed_body_and_path

_POINTS = 10  # Gauss points of a panel
_LOOKS = 65  # places of a panel where peaks are searched: a smooth torque hides at most 1e-4 of itself between two
_SETTLED = 1e-11  # difference of two quadratures, of the work done back and forth
_MOST_HALVINGS = 5  # of the motion's steps: its torques are as smooth as what was integrated
_NO_POWER = 1e-13  # of the largest power: below it the sign is rounding


@dataclass(frozen=True, eq=False, kw_only=True)
class JointLoads:
    """Peaks and work of the joints over a whole motion; arrays are batch + (n,) where nothing else is said.

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

    Notes
    -----
    Equation :eq:`joint-work` of the documentation.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.5)
    >>> loads = sp.joint_torques(sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])).loads
    >>> bool(np.isclose(loads.work.sum(), loads.energy_change))
    True
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
        """Of the mass of the body: batch + (n,) [N m/kg or N/kg]."""
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


@dataclass(frozen=True, eq=False, kw_only=True)
class _Panels:
    """The joints at Gauss points of panels.

    edges : (P + 1,) [s]
    torque, power : (B, P, m, n)
    rate : (P, m, n)
    """

    edges: Array
    torque: Array
    power: Array
    rate: Array

    @property
    def work(self) -> Array:
        """(B, n) net [J]."""
        _, weights, _ = _rule()
        return np.einsum("p,m,bpmn->bn", 0.5 * np.diff(self.edges), weights, self.power)

    @property
    def moved(self) -> Array:
        """(B,) the work done back and forth, about [J]."""
        _, weights, _ = _rule()
        return np.einsum("p,m,bpmn->b", 0.5 * np.diff(self.edges), weights, np.abs(self.power))


def joint_loads(motion: Motion | ForcedMotion) -> JointLoads:
    """The loads over a whole motion, on its steps, which are halved until the work no longer changes."""
    check_motion(motion)
    body, _ = needed_body_and_path(motion, BY_JOINTS)
    breaks = motion.breaks if isinstance(motion, ForcedMotion) else motion.deformation.breaks
    edges = np.union1d(motion.solution.times, breaks)
    edges = edges[np.append(True, np.diff(edges) > 1e-12 * motion.duration)]
    edges[-1] = motion.duration
    seen: list[_Panels] = []

    def finer() -> Iterator[_Panels]:
        for one in halved(edges, _MOST_HALVINGS):
            seen[:] = [_sampled(motion, one)]
            yield seen[0]

    found = settled(finer(), _difference, _SETTLED) or seen[0]
    ends = drive(motion, np.array([0.0, motion.duration]))
    change = ends.energy[:, 1] - ends.energy[:, 0]
    from_outside = float(motion.work(motion.duration)) if isinstance(motion, ForcedMotion) else 0.0
    positive = np.array([[_positive(found, b, k) for k in range(body.n_rates)] for b in range(len(change))])
    positive = positive.reshape(len(change), body.n_rates)
    net, moved = found.work, found.moved
    torques, rates, powers = (_peaks(values, found.edges) for values in (found.torque, found.rate[None], found.power))
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


def _difference(last: _Panels, found: _Panels) -> float:
    """Of the works, as parts of the work done back and forth."""
    moved = np.where(found.moved > 0.0, found.moved, 1.0)
    return float(np.max(np.abs(found.work - last.work) / moved[:, None], initial=0.0))


def _sampled(motion: Motion | ForcedMotion, edges: Array) -> _Panels:
    local, _, _ = _rule()
    times = 0.5 * (edges[:-1] + edges[1:])[:, None] + 0.5 * np.diff(edges)[:, None] * local
    found: Drive = drive(motion, times.ravel())
    grid = (*times.shape, found.rate.shape[-1])
    return _Panels(
        edges=edges,
        torque=found.torque.reshape(-1, *grid),
        power=found.power.reshape(-1, *grid),
        rate=found.rate.reshape(grid),
    )


def _positive(panels: _Panels, which: int, joint: int) -> float:
    """The work that a joint does while its power is positive, panels of both signs divided at its zeros [J]."""
    _, weights, to_series = _rule()
    power = panels.power[which, :, :, joint]
    halves = 0.5 * np.diff(panels.edges)
    looked = power @ (chebyshev(_looks(), _POINTS) @ to_series).T
    small = _NO_POWER * np.abs(power).max(initial=0.0)
    both = (looked.min(axis=1) < -small) & (looked.max(axis=1) > small)
    alike = ~both & (power.sum(axis=1) > 0.0)
    total = float(halves[alike] @ (power[alike] @ weights))
    for row in np.flatnonzero(both):
        coefficients = to_series @ power[row]
        roots = series.chebroots(coefficients)
        real = np.sort(roots.real[(np.abs(roots.imag) < 1e-9) & (np.abs(roots.real) < 1.0)])
        cuts = np.concatenate([[-1.0], real, [1.0]])
        parts = np.diff(series.chebval(cuts, series.chebint(coefficients)))
        total += float(halves[row] * parts[parts > 0.0].sum())
    return total


def _peaks(values: Array, edges: Array) -> tuple[Array, Array]:
    """Largest sizes and their times: values at Gauss points (B, P, m, n) -> (B, n), (B, n)."""
    at = _places(edges).ravel()
    sizes = np.abs(_between(values)).reshape(len(values), at.size, -1)
    return sizes.max(axis=1), at[sizes.argmax(axis=1)]


def _between(values: Array) -> Array:
    """Values at Gauss points as those at the even places of `_looks`: (B, P, m, n) -> (B, P, looks, n)."""
    _, _, to_series = _rule()
    return np.einsum("lm,bpmn->bpln", chebyshev(_looks(), _POINTS) @ to_series, values)


def _places(edges: Array) -> Array:
    """The times of those places: (P, looks)."""
    return 0.5 * (edges[:-1] + edges[1:])[:, None] + 0.5 * np.diff(edges)[:, None] * _looks()


def _looks() -> Array:
    return np.linspace(-1.0, 1.0, _LOOKS)


@lru_cache(maxsize=1)
def _rule() -> tuple[Array, Array, Array]:
    """Gauss points of [-1, 1], their weights, and the matrix from values there to Chebyshev coefficients."""
    local, weights = (np.asarray(one, dtype=np.float64) for one in leggauss(_POINTS))
    return local, weights, np.asarray(np.linalg.inv(chebyshev(local, _POINTS)), dtype=np.float64)
