"""Results of an audit, by run and together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from ..arrays import Array
from ..display import frozen
from ._airborne import AirbornePart
from ._consistency import RateAgreement
from ._engine_faults import StepOrder
from .floating_trajectory import TrajectoryNoise
from .hypothesis import EXPLAINS, Hypothesis, milliseconds, percent

_MOST_SHOWN = 8  # hypotheses in a table


@frozen(kw_only=True)
class RunAudit:
    """Result of an audit for one run.

    Attributes
    ----------
    name : of the trajectory
    airborne : which samples are in the air, and how that was found
    first_time, last_time : of these [s]
    given_rates : whether rates were given; else they are differences of the samples
    step : of the integrator [s]
    noise : of the samples
    times, momentum : (N,) [s] and (N, 3), world axes, about the centre of mass [kg m^2/s]
    momentum_scale : the momenta of the turn of the base and of the joints' motion, rms [kg m^2/s]
    momentum_drift : the largest slow change [kg m^2/s]
    momentum_noise : what noise brings to that, relative to the scale
    momentum_ratio : its square over what noise explains: above 1, noise does not
    fall_off : how far the centre of mass is from its parabola, slowly [m]; None where places are not given
    fall_ratio : its square over what noise explains, or None
    extent : radius of gyration of the body [m]
    agreement : of given rates with the configurations, or None
    attitude_error : (N,) angle to the nearest exact reconstruction that was found [rad]; None where there is none
    tolerance : of the momentum, by which that was decided, without unit
    recorded : whether the samples were measured, not computed
    right : whether momentum, fall and rates hold within noise or tolerance
    momentum_bars : standard deviations of the momentum, world axes [kg m^2/s], of a flight of so few samples that it is
        fitted as a whole; else None
    fall_bar : standard deviation of the fall, with 1 cm of wander [m/s^2], or None
    least_drift : the smallest steady change of the momentum that the samples would have shown, relative to its scale

    Examples
    --------
    >>> cat, times = sp.load_body("cat_two_halves"), np.linspace(0.0, 1.0, 51)
    >>> still = sp.FloatingTrajectory(
    ...     times=times, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (51, 1)), shapes=np.zeros((51, 3)))
    >>> sp.audit(cat, still).runs[0].right
    True
    """

    name: str
    airborne: AirbornePart
    first_time: float
    last_time: float
    given_rates: bool
    step: float
    noise: TrajectoryNoise
    times: Array
    momentum: Array
    momentum_scale: float
    momentum_drift: float
    momentum_noise: float
    momentum_ratio: float
    fall_off: float | None
    fall_ratio: float | None
    extent: float
    agreement: RateAgreement | None
    attitude_error: Array | None
    tolerance: float
    recorded: bool
    right: bool
    momentum_bars: tuple[float, float, float] | None = None
    fall_bar: float | None = None
    least_drift: float = 0.0

    @property
    def decided(self) -> bool:
        """False where the momentum changes by more than the tolerance, and noise may be why, or hide why."""
        return not self.right or min(self.relative_drift, self.least_drift) <= self.tolerance

    @property
    def relative_drift(self) -> float:
        """Drift of the momentum relative to its scale."""
        return self.momentum_drift / self.momentum_scale if self.momentum_scale > 0.0 else 0.0

    @property
    def drift_of_itself(self) -> float:
        """The change of the momentum over its own size in the mean, without unit; infinite where it has none."""
        size = float(np.linalg.norm(self.momentum.mean(axis=0)))
        return self.momentum_drift / size if size > 0.0 else np.inf

    @property
    def words(self) -> str:
        """What a recording shows, in a line."""
        part = self.drift_of_itself
        if not np.isfinite(part):
            found = "no angular momentum"
        elif self.right:
            found = f"conserved within {percent(part)} of itself"
        else:
            found = f"not conserved, changes by {percent(part)} of itself"
        if self.airborne.acceleration is not None:
            found += f", falls with {float(np.linalg.norm(self.airborne.acceleration)):.3g} m/s^2"
        return found

    @property
    def record(self) -> dict[str, Any]:
        """The numbers as JSON can hold them."""
        fit = self.agreement
        return {
            "name": self.name,
            "right": self.right,
            "first_time_s": self.first_time,
            "last_time_s": self.last_time,
            "samples": len(self.times),
            "airborne": self.airborne.how,
            "acceleration_m_s2": self.airborne.acceleration,
            "step_s": self.step,
            "rates_given": self.given_rates,
            "noise": asdict(self.noise),
            "momentum_kg_m2_s": self.momentum.mean(axis=0).tolist(),
            "momentum_bars_kg_m2_s": self.momentum_bars,
            "fall_bar_m_s2": self.fall_bar,
            "momentum_drift_kg_m2_s": self.momentum_drift,
            "momentum_drift_relative": self.relative_drift,
            "momentum_drift_of_itself": self.drift_of_itself if np.isfinite(self.drift_of_itself) else None,
            "momentum_over_noise": self.momentum_ratio,
            "momentum_drift_least_shown": self.least_drift,
            "tolerance": self.tolerance,
            "fall_off_m": self.fall_off,
            "fall_over_noise": self.fall_ratio,
            "rates_mismatch": None if fit is None else fit.mismatch,
            "rates_late_s": None if fit is None else fit.late,
            "rates_over_noise": None if fit is None else fit.ratio,
            "attitude_error_end_rad": None if self.attitude_error is None else float(self.attitude_error[-1]),
            "attitude_error_largest_rad": None if self.attitude_error is None else float(self.attitude_error.max()),
        }


@frozen(kw_only=True)
class Audit:
    """Result of an audit.

    Attributes
    ----------
    body : its name
    runs : of each trajectory
    tolerance : within which it had to be right, without unit
    hypotheses : all that were fitted, what leaves least first; none where all is right
    cause : the hypotheses that explain what is wrong and that the noise cannot separate; one: it is named
    step_order : how drifts go with the integrator's step; None where the runs do not tell
    notes : caveats, in words

    Examples
    --------
    >>> cat, times = sp.load_body("cat_two_halves"), np.linspace(0.0, 1.0, 51)
    >>> still = sp.FloatingTrajectory(
    ...     times=times, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (51, 1)), shapes=np.zeros((51, 3)))
    >>> print(sp.audit(cat, still).verdict)
    right within noise or 0.001
    """

    body: str
    runs: tuple[RunAudit, ...]
    tolerance: float
    hypotheses: tuple[Hypothesis, ...]
    cause: tuple[Hypothesis, ...]
    step_order: StepOrder | None
    notes: tuple[str, ...]

    @property
    def right(self) -> bool:
        """True where all runs are right, and their samples would have shown a fault beyond the tolerance."""
        return all(run.right and run.decided for run in self.runs)

    @property
    def wrong(self) -> bool:
        """True where a run breaks a law by more than noise and tolerance; else samples may hide it."""
        return not all(run.right for run in self.runs)

    @property
    def verdict(self) -> str:
        """The result in one line."""
        recorded = [run.words for run in self.runs if run.recorded]
        shown = "; ".join(recorded)
        if not self.wrong and not self.right:
            least = max(run.least_drift for run in self.runs if not run.decided)
            hidden = f"the samples hide changes of the momentum below {percent(least)}"
            return "; ".join([*recorded, f"cannot tell: {hidden}, the tolerance is {percent(self.tolerance)}"])
        if self.right:
            within = f"right within noise or {self.tolerance:.2g}"
            return f"{shown}: {within}, as 1 cm of wander leaves it" if recorded else within
        if recorded:
            return f"{shown}; {self._blame}"
        return self._blame

    @property
    def _blame(self) -> str:
        if any(run.momentum_bars is not None for run in self.runs):
            return "wrong; so few samples do not tell causes apart"
        if not self.cause:
            return "wrong, and no single hypothesis explains it"
        if len(self.cause) == 1:
            first = self.cause[0]
            return f"wrong: {first.name}" + (f" ({first.text})" if first.values else "")
        return "wrong: one of these, which the samples cannot separate: " + ", ".join(one.name for one in self.cause)

    @property
    def record(self) -> dict[str, Any]:
        """Everything but the curves, as JSON can hold it."""
        order = self.step_order
        return {
            "body": self.body,
            "right": self.right,
            "wrong": self.wrong,
            "verdict": self.verdict,
            "tolerance": self.tolerance,
            "runs": [run.record for run in self.runs],
            "cause": [one.name for one in self.cause],
            "hypotheses": [one.record for one in self.hypotheses],
            "step_order": None if order is None else asdict(order),
            "notes": list(self.notes),
        }

    def table(self) -> str:
        """The findings as text.

        Examples
        --------
        >>> cat, times = sp.load_body("cat_two_halves"), np.linspace(0.0, 1.0, 51)
        >>> still = sp.FloatingTrajectory(
        ...     times=times, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (51, 1)), shapes=np.zeros((51, 3)))
        >>> print(sp.audit(cat, still).table().splitlines()[0])
        trajectory: 51 samples from 0 to 1 s, places are not given, and no fall can be looked for
        """
        lines = [line for run in self.runs for line in _run_lines(run)]
        if self.step_order is not None:
            lines += _order_lines(self.step_order)
        if self.hypotheses:
            lines += [
                "",
                "what explains it, by what it leaves over, of all and in units of the noise; * leaves no more than "
                f"{percent(EXPLAINS)} or noise:",
            ]
            names = {one.name for one in self.cause}
            width = max(len(one.name) for one in self.hypotheses[:_MOST_SHOWN])
            for one in self.hypotheses[:_MOST_SHOWN]:
                mark = "*" if one.name in names else " "
                rest = "; ".join(part for part in (one.text, one.remark) if part)
                lines.append(
                    f" {mark} {one.name:<{width}}  {percent(one.share):>8}  {one.left_over:>8.2g}  {rest}".rstrip()
                )
        return "\n".join([*lines, "", *self.notes, "", self.verdict])


def _run_lines(run: RunAudit) -> list[str]:
    how = run.airborne.how.removeprefix("all of it: ")
    found = [f"{run.name}: {len(run.times)} samples from {run.first_time:.6g} to {run.last_time:.6g} s, {how}"]
    mean = " ".join(f"{part:.4g}" for part in run.momentum.mean(axis=0))
    if run.momentum_bars is not None:
        mean += f" ± {' '.join(f'{bar:.2g}' for bar in run.momentum_bars)}"
    drift = f"drifts by {run.relative_drift:.2g} of what turns the body"
    drift = "constant within noise" if run.momentum_ratio <= 1.0 else drift
    found.append(f"  angular momentum   {mean} kg m^2/s, {drift}")
    if run.fall_off is not None and run.fall_ratio is not None and run.airborne.acceleration is not None:
        pull = " ".join(f"{part:.4g}" for part in run.airborne.acceleration)
        pull += f" ± {run.fall_bar:.2g}" if run.fall_bar is not None else ""
        found.append(f"  fall               {pull} m/s^2, off by {run.fall_off:.2g} m{_by_noise(run.fall_ratio)}")
    if run.agreement is not None:
        late = f", late by {milliseconds(run.agreement.late, 3)} ms" if run.agreement.ratio > 1.0 else ""
        found.append(
            f"  rates              off those of the configurations by {run.agreement.mismatch:.2g}{late}"
            f"{_by_noise(run.agreement.ratio)}"
        )
    if run.attitude_error is not None:
        largest = float(np.degrees(run.attitude_error.max()))
        found.append(f"  attitude           up to {largest:.3g} degrees from the nearest exact reconstruction")
    return found


def _by_noise(ratio: float) -> str:
    return ", as noise explains" if ratio <= 1.0 else ""


def _order_lines(order: StepOrder) -> list[str]:
    pairs: Mapping[float, float] = dict(zip(order.steps, order.drifts, strict=True))
    shown = ", ".join(f"{drift:.2g} at {milliseconds(step)} ms" for step, drift in pairs.items())
    between = ", ".join(f"{each:.2f}" for each in order.between)
    return ["", f"drift of the momentum by the step: {shown}; order {order.order:.2f} (from step to step {between})"]
