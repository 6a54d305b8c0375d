"""What is known of a path that was made of others, from what is known of those."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...arrays import Array
from ...integrator.resolved import joined
from .function_scan import FunctionScan

if TYPE_CHECKING:
    from ..shape_path import ShapePath


@dataclass(frozen=True, eq=False)
class DerivedScan:
    """The scan of a path, changed by one of the methods of `FunctionScan`, or left as it is; found when it is needed.

    Attributes
    ----------
    path : the one that was looked at, or will be
    change : the name of the method; None: nothing changes
    arguments : of the method
    """

    path: ShapePath
    change: str | None = None
    arguments: tuple[Any, ...] = ()

    def __call__(self) -> FunctionScan:
        """Find it."""
        scan = self.path._scan
        return scan if self.change is None else getattr(scan, self.change)(*self.arguments)


@dataclass(frozen=True, eq=False)
class JoinedScan:
    """The scan of paths one after another, each with all its loops; found when it is needed."""

    paths: Sequence[ShapePath]

    def __call__(self) -> FunctionScan:
        """Find it."""
        scans = [path._scan for path in self.paths]
        whole = [joined([scan.resolved] * path.loops) for scan, path in zip(scans, self.paths, strict=True)]
        found: list[Array] = []
        start = 0.0
        for scan, path in zip(scans, self.paths, strict=True):
            found += [start + scan.duration * loop + scan.found_breaks for loop in range(path.loops)]
            start += path.duration
        return FunctionScan.of_several(scans, joined(whole), np.concatenate(found))
