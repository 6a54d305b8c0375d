"""Hypotheses in the order of what they leave over, and which of them the noise cannot separate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .hypothesis import Hypothesis

_SEPARATES = 16.0
"""Difference of two sums of squares, in units of what is left for each number: four standard deviations."""
_ALIKE = 0.5
"""Of what the best leaves, where that is more than noise: hypotheses that leave so little more explain as well."""
_MORE_THAN_NOISE = 2.0
"""Mean square from which what is left is more than noise."""
EXPLAINS = 0.2
"""Of the rms without any hypothesis: what explains it leaves less, or no more than noise."""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A hypothesis with the part of its square that is of the agreement of the rates."""

    hypothesis: Hypothesis
    of_rates: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Ranking:
    """What is left to choose from.

    Attributes
    ----------
    ranked : all, those that leave least first
    tie : the first and all that noise cannot tell from it; empty where nothing explains what is wrong
    """

    ranked: tuple[Hypothesis, ...]
    tie: tuple[Hypothesis, ...]


def ranking(candidates: Sequence[Candidate], square: float, freedom: int) -> Ranking:
    """The order.

    Parameters
    ----------
    square : of the residuals without any hypothesis
    freedom : how many of them are independent
    """
    if not candidates:
        return Ranking(ranked=(), tie=())
    least = min(candidates, key=lambda one: one.hypothesis.square)
    left = max(least.hypothesis.square - least.of_rates, 0.0)
    scale = max(1.0, left / freedom)

    def score(one: Candidate) -> float:
        return one.hypothesis.square / scale + one.hypothesis.parameters * float(np.log(freedom))

    ordered = sorted(candidates, key=score)
    best = ordered[0]
    allowed = _SEPARATES
    if scale > _MORE_THAN_NOISE:
        allowed = max(allowed, _ALIKE * left / scale)
    near = [one.hypothesis for one in ordered if score(one) - score(best) <= allowed]
    # A force contains a torque: where that is enough, it is named alone.
    if any(one.kind == "torque" for one in near):
        near = [one for one in near if one.kind != "force"]
    explaining = [one for one in near if one.square <= max(_MORE_THAN_NOISE * freedom, EXPLAINS**2 * square)]
    return Ranking(ranked=tuple(one.hypothesis for one in ordered), tie=tuple(explaining))
