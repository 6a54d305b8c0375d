"""What comes out of the steps, whatever takes them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ...arrays import Array, Integers, read_only

# Times between which the growth of errors is compared: 28 pairs.
CHECKPOINTS = 8


@dataclass(eq=False)
class StepRecord:
    """K steps for each momentum of a batch of B, and how far coarser marches come out from them.

    Attributes
    ----------
    quaternions : (B, K + 1, 4) S at the step ends, xyzw
    directions : (B, K + 1, 3) Pi/|Pi| at the step ends; without momentum (B, 0, 3)
    turns : (B, K) of each step about its starting direction, the shortest rotation between its ends taken off [rad]
    dynamics : (B, K) dynamic phase of each step [rad]
    propagators : (B, M, 3, 3) error propagators, the state transition matrices that carry a small turn of the start to
        even parts of the steps; (B, 0, 3, 3) without momentum or where they were not asked for
    stepping : (B,) the largest angle between the steps and those beside them, at the ends that both have: pairs of
        steps, without momentum twice as many [rad]
    truncation : (B,) the largest angle between pairs of steps, without momentum all steps, on the series and on the
        perturbed ones; zero without these [rad]
    """

    quaternions: Array
    directions: Array
    turns: Array
    dynamics: Array
    propagators: Array
    stepping: Array
    truncation: Array

    @classmethod
    def empty(cls, batch: int, count: int, marks: int) -> StepRecord:
        """Room for so many momenta, steps and propagators of each."""
        return cls(
            quaternions=np.empty((batch, count + 1, 4)),
            directions=np.empty((batch, count + 1, 3)),
            turns=np.empty((batch, count)),
            dynamics=np.empty((batch, count)),
            propagators=np.empty((batch, marks, 3, 3)),
            stepping=np.empty(batch),
            truncation=np.zeros(batch),
        )


@lru_cache(maxsize=256)
def checkpoint_steps(count: int) -> Integers:
    """After how many of so many steps the propagators are kept: (CHECKPOINTS,), the first none, the last all."""
    return read_only(np.arange(CHECKPOINTS) * count // (CHECKPOINTS - 1))


def ends_of_pairs(steps: Integers, loops: int) -> Integers:
    """After how many steps each pair of them ends, the start before all: (L + 1,); one of an odd number is left alone.

    A series swings fastest at the ends of its panel: it is the one in the middle, or next to it.
    """
    ends, start = [0], 0
    for count in steps.tolist():
        before = 2 * ((count + 1) // 4 if count % 2 else count // 2)
        ends.extend(range(start + 2, start + before + 1, 2))
        ends.extend(range(start + before + 1, start + count + 1, 2))
        start += count
    if loops == 1:
        return np.array(ends)
    return np.append(0, (np.array(ends[1:]) + start * np.arange(loops)[:, None]).ravel())
