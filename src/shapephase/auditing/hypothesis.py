"""A cause that may explain what is wrong with a trajectory, with what was fitted for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..arrays import Array
from ..display import short_repr
from ..plain_data import plain

AND = ", and "  # between the names of two causes that are fitted together


@dataclass(frozen=True, eq=False)
class Leftover:
    """Residuals of the three laws: momentum, fall, rates.

    Attributes
    ----------
    squares : (3,) their sums of squares
    counts : (3,) independent numbers
    effective : (3,) those of them that the spectrum of the residuals leaves independent: nu = 3 (sum c^2)^2 / sum c^4
        of the coefficients c of cosines (Satterthwaite 1946 with variances c^2, of which c^4 / 3 is the square)
    steps : of each run the step whose drift was projected out, and its bar [s]; empty where none was
    in_time : (M,) of each run those of momentum and fall, sample by sample; None where the samples are others
    """

    squares: Array
    counts: Array
    effective: Array
    in_time: Array | None = None
    steps: tuple[tuple[float, float], ...] = ()

    @property
    def size(self) -> float:
        """Sum of the logarithms of the squares in units of noise, none less than 0: a law may have far more digits."""
        known = self.counts > 0.0
        return float(np.log(np.maximum(self.squares[known] / self.counts[known], 1.0)).sum())


@dataclass(frozen=True, kw_only=True)
class FittedValue:
    """A number that was fitted.

    Attributes
    ----------
    value, bar : the number and its standard deviation by the noise, infinite where the samples do not bound it
    unit : "" for a ratio

    Examples
    --------
    >>> sp.auditing.FittedValue(value=0.031, bar=0.002).unit
    ''
    """

    value: float
    bar: float
    unit: str = ""

    __repr__ = short_repr


@dataclass(frozen=True, kw_only=True)
class Hypothesis:
    """A cause, fitted.

    Attributes
    ----------
    name : for people, as "mass of head"
    kind : "inertia", "torque", "force", "time", "filter", "frame", "quaternion", "units", "engine", "step",
        "drag", "offset" or "gravity"
    square : what is left over, squared and summed in units of the noise
    left_over : the same as the rms of a residual, in units of the noise
    share : of the rms without any hypothesis
    parameters : how many numbers were fitted for it
    values : what they are
    remark : what else is to be said
    leftover : residuals of each law
    residuals : (M,) what is left over in time, in units of the noise: of each run the momentum of its samples, then the
        fall; None where the hypothesis has other samples

    Examples
    --------
    >>> sp.auditing.Hypothesis(name="mass of head", kind="inertia", square=300.0, left_over=1.0, parameters=1).values
    {}
    """

    name: str
    kind: str
    square: float
    left_over: float
    parameters: int
    share: float = 1.0
    values: Mapping[str, FittedValue] = field(default_factory=dict)
    remark: str = ""
    leftover: Leftover | None = field(default=None, repr=False, compare=False)
    residuals: Array | None = field(default=None, repr=False, compare=False)

    __repr__ = short_repr

    def paired_with(self, name: str, parameters: int, values: Mapping[str, FittedValue] | None = None) -> Hypothesis:
        """This hypothesis, fitted together with another one that has so many parameters."""
        both = {**self.values, **(values or {})}
        return replace(self, name=f"{self.name}{AND}{name}", parameters=self.parameters + parameters, values=both)

    @property
    def record(self) -> dict[str, Any]:
        """Return the hypothesis for JSON."""
        return {
            "name": self.name,
            "kind": self.kind,
            "left_over": self.left_over,
            "share": self.share,
            "square": self.square,
            "parameters": self.parameters,
            "values": {name: plain(found) for name, found in self.values.items()},
            "remark": self.remark,
        }

    @property
    def text(self) -> str:
        """The fitted numbers in a line."""
        return ", ".join(f"{name} {_shown(found)}" for name, found in self.values.items())


def _shown(found: FittedValue) -> str:
    if found.unit == "%":
        return f"{found.value:+.3g} %"
    return f"{found.value:.6g} {found.unit}".rstrip()
