"""A dive that MuJoCo has simulated, as motion capture records it: a `.mot` with the pelvis, y up, with noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from support.independent import SimulatedMotion, mujoco_motion
from support.motion_writers import write_opensim

JOINTS = ("left_shoulder_abduction", "right_shoulder_abduction")
PELVIS = ("pelvis_tilt", "pelvis_list", "pelvis_rotation", "pelvis_tx", "pelvis_ty", "pelvis_tz")
RATE = 100.0
"""Samples a second."""
TAKE_OFF, FLIGHT, AFTER = 0.4, 1.5, 0.3
"""[s] The push, the dive, and its end in the water."""
GRAVITY = 9.81
SPEED = 3.0
"""Of the centre of mass, upwards, at take-off [m/s]."""
ATTITUDE_NOISE, PLACE_NOISE, JOINT_NOISE = np.radians(0.5), 0.002, np.radians(0.3)
"""Standard deviations [rad, m, rad]."""
# From a pelvis (x forward, y up, z right) to the ground of the same kind, for a body that is x forward, z up.
Y_UP = Rotation.from_matrix([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
MOMENTUM = np.array([3.0, 60.0, -2.0])
"""In axes with z up [kg m^2/s]."""


@dataclass(frozen=True)
class Dive:
    """The left arm goes down and up again, each by the quintic of least jerk."""

    duration: float = FLIGHT
    first: float = 0.25
    last: float = 0.95
    takes: float = 0.3

    def shape(self, t: float) -> np.ndarray:
        return np.array([3.0 - 2.8 * self._down(t, 0), -3.0])

    def rate(self, t: float) -> np.ndarray:
        return np.array([-2.8 * self._down(t, 1), 0.0])

    def acceleration(self, t: float) -> np.ndarray:
        return np.array([-2.8 * self._down(t, 2), 0.0])

    def _down(self, t: float, order: int) -> float:
        quintic = np.polynomial.Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
        curve = quintic if order == 0 else quintic.deriv(order)
        ends = [float(np.clip((t - start) / self.takes, 0.0, 1.0)) for start in (self.first, self.last)]
        return (curve(ends[0]) - curve(ends[1])) / self.takes**order


@lru_cache(maxsize=1)
def simulated() -> tuple[np.ndarray, SimulatedMotion]:
    """Times of the samples in the dive [s], and the motion, z up, about a centre of mass at rest."""
    times = np.arange(round(FLIGHT * RATE) + 1) / RATE
    return times, mujoco_motion("diver", JOINTS, Dive(), MOMENTUM, None, times)  # type: ignore[arg-type]


def momentum() -> np.ndarray:
    """In the axes of the recorder [kg m^2/s]."""
    return Y_UP.apply(MOMENTUM)


def write_take(file: Path, seed: int | None) -> Path:
    """A take with push, dive and landing; seed None: without noise."""
    times, motion = simulated()
    count = round((TAKE_OFF + FLIGHT + AFTER) * RATE)
    clock = np.arange(count) / RATE
    place = np.clip(np.arange(count) - round(TAKE_OFF * RATE), 0, len(times) - 1)
    dive = Dive()
    shapes = np.array([dive.shape(t) for t in times[place]])
    turns = Y_UP * Rotation.from_matrix(motion.attitude[place])
    # The centre of mass is pushed off evenly, falls, and is stopped evenly.
    since, after = clock - TAKE_OFF, clock - TAKE_OFF - FLIGHT
    landing = SPEED - GRAVITY * FLIGHT
    height = SPEED * since - 0.5 * GRAVITY * since**2
    height = np.where(since < 0.0, SPEED * since + 0.5 * SPEED / TAKE_OFF * since**2, height)
    end = SPEED * FLIGHT - 0.5 * GRAVITY * FLIGHT**2
    height = np.where(after > 0.0, end + landing * after - 0.5 * landing / AFTER * after**2, height)
    centre = np.column_stack([0.8 * np.clip(since, 0.0, FLIGHT), 10.0 + height, 0.0 * clock])
    places = centre + Y_UP.apply(motion.position[place])
    if seed is not None:
        rng = np.random.default_rng(seed)
        turns = turns * Rotation.from_rotvec(ATTITUDE_NOISE * rng.normal(size=(count, 3)))
        places = places + PLACE_NOISE * rng.normal(size=places.shape)
        shapes = shapes + JOINT_NOISE * rng.normal(size=shapes.shape)
    angles = (turns * Y_UP.inv()).as_euler("ZXY", degrees=True)
    write_opensim(file, [*PELVIS, *JOINTS], clock, np.column_stack([angles, places, np.degrees(shapes)]), True)
    return file
