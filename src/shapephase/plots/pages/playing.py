"""How fast a page plays, and in how many frames."""

from __future__ import annotations

import math

import numpy as np

from ...errors import ShapeError
from ...letters import what_came

# Seconds that something is played in, unless a speed is given: long enough to follow it, not so long as to tire.
_MIN_PLAYING = 4.0
_MAX_PLAYING = 20.0
# Frames in a second of playing [1/s]: smooth to the eye.
_FRAME_RATE = 30
# Frames of a page, unless their number is given: keeps its file below some megabytes.
_MAX_FRAMES = 3000


def playing_speed(duration: float, speed: float | None) -> float:
    """Seconds of motion in a second of playing: as given, or by default. Raises ShapeError."""
    if speed is None:
        return duration / min(max(duration, _MIN_PLAYING), _MAX_PLAYING)
    if not (isinstance(speed, int | float | np.floating | np.integer) and 0.0 < speed < math.inf):
        raise ShapeError(
            f"speed: seconds of motion in a second of playing, above 0, are needed, got {what_came(speed)}"
        )
    return float(speed)


def frame_count(duration: float, speed: float) -> int:
    """As many as are smooth at that speed."""
    return min(max(math.ceil(_FRAME_RATE * duration / speed), 2), _MAX_FRAMES) + 1
