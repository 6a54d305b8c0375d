"""Turns of a body, whole ones counted: about its momentum, and somersaults and twists of an athlete."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arguments import check_object
from ..display import short_repr
from ..errors import ShapePhaseError
from ..reconstruction import AthleteAxes
from ..reconstruction.reconstruction import Motion
from .phase_split import PhaseSplit

_TURN = 2.0 * np.pi
_PARTS = 8  # of a step, between which the largest tilt is searched: a step turns the body by a fraction of a radian


@dataclass(frozen=True, eq=False)
class TurnCounts:
    """Turns of one motion from its start to its end.

    Attributes
    ----------
    about_momentum : the Montgomery phase in revolutions, in the gauge of the split; 0 without momentum
    somersaults, twists : of an athlete, in revolutions; None for another body
    largest_tilt : size of the athlete's largest tilt [rad]; None for another body
    axes : axes of these three
    error : error estimate of each count [revolutions]

    Examples
    --------
    >>> dive = sp.examples.full_dive()
    >>> motion = sp.reconstruct(dive.deformation, dive.momentum)
    >>> counts = sp.turn_counts(motion, sp.split(motion))
    >>> print(f"{counts.somersaults:.3f} somersaults, {abs(counts.twists):.3f} twists")
    1.500 somersaults, 1.000 twists
    """

    about_momentum: float
    somersaults: float | None
    twists: float | None
    largest_tilt: float | None
    axes: AthleteAxes | None
    error: float

    __repr__ = short_repr

    def __str__(self) -> str:
        """Return the counts in a sentence or two; "" without momentum and athlete."""
        text = ""
        if self.about_momentum:
            text = (
                "The angle of a rotation does not count whole turns: about its momentum the body turned "
                f"{_count(self.about_momentum)} times (± {self.error:.0e}; the Montgomery phase)."
            )
        if self.axes is not None and self.somersaults is not None and self.twists is not None:
            tilt = math.degrees(self.largest_tilt or 0.0)
            text += (
                f" As an athlete: {_count(self.somersaults)} somersaults and "
                f"{_count(self.twists)} twists, tilt at most {tilt:.1f} degrees (± {self.error:.0e} turns); "
                f"{self.axes}."
            )
        return text.strip()

    def to_dict(self) -> dict[str, Any]:
        """Return the counts for JSON, with the axes and their sources where the body is an athlete."""
        counts: dict[str, Any] = {"turns_about_momentum": self.about_momentum, "turns_error": self.error}
        if self.axes is not None:
            counts |= {
                "somersaults": self.somersaults,
                "twists": self.twists,
                "largest_tilt_rad": self.largest_tilt,
                "somersault_axes": {
                    name: {"axis": getattr(self.axes, name).tolist(), "by": reason}
                    for name, reason in sorted(self.axes.reasons.items())
                },
            }
        return counts


def _count(turns: float) -> str:
    """Return a number with four digits after the point; zero has no sign."""
    return f"{round(turns, 4) + 0.0:.4f}"


def turn_counts(motion: Motion, split: PhaseSplit) -> TurnCounts:
    """Return the turns of one motion about its momentum and, where links are named left and right, an athlete's counts.

    Parameters
    ----------
    split : of this motion

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.0, 0.0, 3.0 * 2.5 * np.pi])
    >>> print(f"{sp.turn_counts(motion, sp.split(motion)).about_momentum:.6f}")
    5.000000
    """
    check_object(motion, "Motion", "motion")
    check_object(split, "PhaseSplit", "split")
    about = float(split.montgomery_phase) / _TURN if split.has_phase else 0.0
    error = float(split.error_estimates.montgomery_phase) / _TURN
    try:
        axes = motion.athlete_axes()
    except ShapePhaseError:
        axes = None
    if axes is None or not split.has_phase or not axes.by_links:
        return TurnCounts(about, None, None, None, None, error)
    ends = motion.solution.times
    times = np.append((ends[:-1, None] + np.diff(ends)[:, None] * np.arange(_PARTS) / _PARTS).ravel(), ends[-1])
    somersault, tilt, twist = motion.somersault_tilt_twist(times)
    largest = float(np.abs(tilt).max())
    # Near a pole of the chart an error of the attitude turns somersault and twist by far more, half a turn at most.
    magnified = float(motion.error_estimate) / max(math.cos(largest), 1e-300) / _TURN
    return TurnCounts(
        about_momentum=about,
        somersaults=float(somersault[-1] - somersault[0]) / _TURN,
        twists=float(twist[-1] - twist[0]) / _TURN,
        largest_tilt=largest,
        axes=axes,
        error=max(error, min(magnified, 0.5)),
    )
