"""The hypothesis that the samples were low-pass filtered: what the laws leave is noise that ends at a frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ._noise_spectrum import cut_off
from ._residuals import Residuals, fitted_hypothesis
from .hypothesis import FittedValue, Hypothesis, Leftover

_FREE = (1, 2, 0)  # orders of cosines that the laws leave open in each block
_APART = 1.7  # ratio of the cut-offs of two laws up to which they are one


def filtered_samples(fits: Sequence[Residuals], without: Leftover) -> list[Hypothesis]:
    """The cut-off; empty where momentum and fall do not end at one frequency, as those of filtered samples do.

    Without rates the momentum is summed over the time, which adds slow noise of its own: there the fall decides.
    """
    cuts = []
    for fit in fits:
        span = float(fit.seen.times[-1] - fit.seen.times[0])
        blocks = (0, 1) if fit.seen.given_rates else (1,)
        for block, part in fit.blocks(fit.vector).items():
            if block in blocks:  # rates are held against differences of samples, which have a cut-off of their own
                order = cut_off(part, _FREE[block])
                if order is None:
                    return []
                cuts.append(0.5 * order / span)
    if not cuts or max(cuts) > _APART * min(cuts):
        return []
    value = FittedValue(value=float(np.exp(np.log(cuts).mean())), bar=float(np.ptp(cuts) / 2.0), unit="Hz")
    left = replace(without, squares=np.minimum(without.squares, without.counts), effective=without.counts)
    remark = "the noise of the samples ends there; filter a longer recording less, or state its noise"
    return [
        fitted_hypothesis("samples filtered", "filter", left, parameters=2, values={"cut-off": value}, remark=remark)
    ]
