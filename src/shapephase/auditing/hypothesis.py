"""Causes that may explain what is wrong, what was fitted for them, and which of them the samples cannot separate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..arrays import Array
from ..display import short_repr
from ..plain_data import plain

_HUNDRED, _THOUSAND = 100.0, 1000.0
AND = ", and "  # between the names of two causes that are fitted together
_STRONG = 10.0  # difference of two criteria that is very strong evidence (Kass and Raftery 1995)
_FEWEST = 3.0  # effective numbers of a single cosine
_ROUNDS = 4  # the effective numbers are those of the best hypothesis, which they decide
_NOISE = 3.0  # mean square up to which what is left is noise: that of samples is known to some 70 %
_SETTLED = 0.05  # of the rms: steps of 2 ms at 20 rad/s leave so much by terms of second order
EXPLAINS = 0.2  # of the rms without any hypothesis: more is not explained


@dataclass(frozen=True, eq=False)
class Leftover:
    """Residuals of the three laws: momentum, fall, rates.

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
    """Possible cause of a difference, fitted to the samples.

    Attributes
    ----------
    name : in messages and figures, such as "mass of head"
    kind : "inertia", "torque", "force", "time", "filter", "frame", "quaternion", "units", "engine", "step",
        "drag", "offset" or "gravity"
    square : what is left over, squared and summed in units of the noise
    left_over : the same as the rms of a residual, in units of the noise
    share : of the rms without any hypothesis
    parameters : how many numbers were fitted for it
    values : what they are
    remark : a caveat, in words
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


@dataclass(frozen=True, kw_only=True)
class Ranking:
    """Hypotheses by evidence.

    ranked : all, the best first
    tie : the first and all that the samples cannot separate from it; empty where nothing explains what is wrong
    """

    ranked: tuple[Hypothesis, ...]
    tie: tuple[Hypothesis, ...]

    def beside(self, other: Hypothesis) -> Ranking:
        """The ranking where another cause, of which no residual holds anything, is there as well."""
        if not self.ranked:
            return Ranking(ranked=(other,), tie=(other,))
        both = tuple(one.paired_with(other.name, other.parameters, other.values) for one in self.tie)
        return Ranking(ranked=(*both, *self.ranked[len(both) :]), tie=both)


@dataclass(frozen=True, eq=False)
class Evidence:
    """What there is to explain.

    What a hypothesis leaves of each law (momentum, fall, rates) is taken for noise of unknown size, no smaller than
    that of the samples: with nu effective numbers and x, the square over what noise leaves, -2 log likelihood is nu
    x up to x = 1 and nu (1 + log x) beyond. The Bayesian information criterion (Schwarz 1978) adds log(sum of nu)
    for each fitted number.

    without : residuals without any hypothesis
    allowed : (3,) share of these squares that is within the tolerance; 1 or more where that law holds
    colour : (3,) mean square of the noise of the samples, in units of white noise with its highest frequencies
    """

    without: Leftover
    allowed: Array
    colour: Array

    def ranking(self, hypotheses: Sequence[Hypothesis]) -> Ranking:
        """Return the order and the tie."""
        known = [(one, left) for one in hypotheses if (left := one.leftover) is not None]
        if not known:
            return Ranking(ranked=(), tie=())
        squares = np.array([left.squares for _, left in known])
        counts = self.without.counts
        # No hypothesis leaves less than the noise. Laws that hold anyway count with what the tolerance leaves.
        noise = np.clip(squares.min(axis=0), counts, self.colour * counts)
        holds = np.maximum(noise, np.where(self.allowed >= 1.0, self.allowed * self.without.squares, 0.0))
        size = squares / np.where(holds > 0.0, holds, 1.0)
        misfit = np.where(size <= 1.0, size, 1.0 + np.log(np.maximum(size, 1.0)))
        fitted = np.array([one.parameters for one, _ in known], dtype=np.float64)
        best, score, effective = 0, np.zeros(len(known)), np.minimum(counts, _ROUNDS * _FEWEST)
        for _ in range(_ROUNDS):
            score = misfit @ effective + fitted * np.log(max(effective.sum(), 2.0))
            best = int(np.argmin(score))
            left = known[best][1]
            effective = np.where(left.squares <= noise, counts, np.minimum(np.maximum(left.effective, _FEWEST), counts))
        order = np.argsort(score, kind="stable")
        whole = max(float(self.without.squares.sum()), np.finfo(float).tiny)
        shared = [replace(one, share=float(np.sqrt(max(one.square, 0.0) / whole))) for one, _ in known]
        near = [shared[place] for place in order if score[place] - score[best] <= _STRONG]
        return Ranking(
            ranked=tuple(shared[place] for place in order), tie=tuple(one for one in near if self.explained_by(one))
        )

    def explained_by(self, hypothesis: Hypothesis) -> bool:
        """True where a hypothesis leaves noise, a fifth, or what the tolerance allows, of each law."""
        return self._within(hypothesis, EXPLAINS**2)

    def settled_by(self, hypothesis: Hypothesis) -> bool:
        """True where a hypothesis leaves noise or tolerance, or a twentieth by one that is true to first order."""
        return self._within(hypothesis, _SETTLED**2 if hypothesis.parameters else 0.0)

    def _within(self, hypothesis: Hypothesis, share: float) -> bool:
        left = hypothesis.leftover
        assert left is not None
        most = np.maximum(_NOISE * self.colour * left.counts, np.maximum(share, self.allowed) * self.without.squares)
        return bool(np.all(left.squares <= most))


def percent(share: float) -> str:
    """Share as text."""
    return f"{_HUNDRED * share:.2g} %"


def milliseconds(time: float, digits: int = 4) -> str:
    """Time, in seconds, as text in milliseconds."""
    return f"{_THOUSAND * time:.{digits}g}"
