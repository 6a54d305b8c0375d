"""Every error of the library: what came, what was expected, the valid choices, and where.

`ShapePhaseError` is the root. A bad value is also a `ValueError`, a missing file also a `FileNotFoundError`,
a failed computation also an `ArithmeticError`, so that a caller who knows only Python's own names catches them too.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class ShapePhaseError(Exception):
    """Root of every error raised on purpose by this library."""


class ShapeError(ShapePhaseError, ValueError):
    """An array has the wrong shape or type, or an entry that is no finite number."""


class UnknownNameError(ShapePhaseError, ValueError):
    """A joint, body, motion, gauge or method that does not exist."""


class ModelFileError(ShapePhaseError, ValueError):
    """A body's file or model cannot be used as it is."""


class UnphysicalInertiaError(ModelFileError):
    """A link has a mass or an inertia that no body can have."""


class InputFileNotFoundError(ShapePhaseError, FileNotFoundError):
    """A file named by the user is not there or cannot be opened."""


class TrajectoryError(ShapePhaseError, ValueError):
    """A trajectory that is no usable function of time: its times, joints, values or ends."""


class OpenPathError(TrajectoryError):
    """A closed loop of shapes was needed, and the path ends elsewhere than it begins."""


class SingularInertiaError(ShapePhaseError, ArithmeticError):
    """The locked inertia is not positive definite: some axis has no inertia, so the rotation is undefined."""


class AccuracyNotReached(ShapePhaseError, ArithmeticError):
    """The requested tolerance was not met; the best estimate is in the message."""


class GaugeError(ShapePhaseError, ArithmeticError):
    """The frame asked for does not exist continuously along the motion."""


class MissingExtraError(ShapePhaseError, ImportError):
    """An optional dependency is not installed; the message names the extra."""


class ResultFileError(ShapePhaseError, ValueError):
    """A result file that this version cannot read."""


def unknown_name(kind: str, name: str, valid: Iterable[str]) -> UnknownNameError:
    """The error for a name that does not exist, with the nearest and all valid names."""
    choices = [str(v) for v in valid]
    near = difflib.get_close_matches(str(name), choices, n=1)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    listed = ", ".join(choices) if choices else "none"
    return UnknownNameError(f"unknown {kind} {name!r}.{hint} Valid: {listed}")
