"""How far a study is."""

from __future__ import annotations

from dataclasses import dataclass

from ..display import short_repr


@dataclass(frozen=True, kw_only=True)
class StudyProgress:
    """What a study has done so far.

    Attributes
    ----------
    done : cases that are stored, failed ones among them
    cases : of the whole study
    failed : cases that raised, ran into their time limit or lost their process
    rate : cases computed in a second, since this run began; 0 before the first
    remaining : seconds that the rest takes at this rate; infinite where that is not known

    Examples
    --------
    >>> study = sp.study.Study("cat", "cat_righting", {"momentum_z": [0.0, 0.1]}, chunk=2)
    >>> seen = []
    >>> _ = study.run("watched.zarr", workers=0, progress=seen.append)
    >>> seen[-1].done, seen[-1].failed
    (2, 0)
    """

    done: int
    cases: int
    failed: int
    rate: float
    remaining: float

    __repr__ = short_repr
