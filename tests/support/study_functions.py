"""Functions that studies of the tests send to other processes, which find them by their names."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np

import shapephase as sp

POISON = 1e-3
"""[kg m^2/s] The x component of the momentum of a case in which something is to happen."""


def peak_rate(motion: sp.Motion) -> float:
    """The largest angular velocity at eleven times [rad/s]."""
    return float(np.linalg.norm(motion.angular_velocity(np.linspace(0.0, motion.duration, 11)), axis=-1).max())


def share_of_the_arms(motion: sp.Motion) -> float:
    """What both arms add to the twist [turns]."""
    return float(sp.contributions(motion).shared.sum() / (2.0 * np.pi))


def bend(depth: float, duration: float = 1.0) -> sp.ShapePath:
    """A loop of the cat of two halves."""
    return sp.examples.kane_scher(0.0, depth, duration)


def poisoned(motion: sp.Motion) -> float:
    """Raises, hangs or ends the process in the cases 1, 2 and 3 times POISON; else the final turn."""
    which = round(float(motion.momentum[0]) / POISON)
    if which == 1:
        raise ArithmeticError("the case is poisoned")
    if which == 2:
        time.sleep(1e3)
    if which == 3:
        os.abort()
    return float(sp.so3.angle(motion.final_attitude))


def counted(motion: sp.Motion) -> float:
    """The final turn; each call leaves a line in the file that $STUDY_LOG names."""
    with open(os.environ["STUDY_LOG"], "a") as log:
        log.write(f"{motion.momentum[0]!r}\n")
    return float(sp.so3.angle(motion.final_attitude))


def slow(motion: sp.Motion) -> float:
    """The same, a little later."""
    time.sleep(0.02)
    return counted(motion)


def logged(path: Path) -> list[str]:
    """What `counted` wrote."""
    return path.read_text().splitlines() if path.exists() else []


def orphaning(motion: sp.Motion) -> float:
    """Ends its process where the momentum is POISON, and leaves a child with open files that writes $STUDY_LOG."""
    if round(float(motion.momentum[0]) / POISON) == 1:
        if os.fork() == 0:
            time.sleep(5.0)
            Path(os.environ["STUDY_LOG"]).touch()
            os._exit(0)
        os._exit(3)
    return 1.0


def lacking(motion: sp.Motion) -> float:
    """Needs a file, which $STUDY_FILE names, where there is momentum along x."""
    if motion.momentum[0] > 0.0 and not Path(os.environ["STUDY_FILE"]).exists():
        raise FileNotFoundError("needed.csv: no such file")
    return float(sp.so3.angle(motion.final_attitude))
