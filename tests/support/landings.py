"""Flights that end on a floor, and when MuJoCo has the first contact."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from support.flown_bodies import Flown, flown
from support.independent import floating_urdf, mujoco_model

_RADIUS = 0.04
"""[m] Of the ball at the centre of each link that the floor holds up."""


@dataclass(frozen=True)
class Landing:
    """A flight, and the last state at which nothing touches [s]."""

    motion: Flown
    last_free: float


def landing(name: str, *, seed: int, lands: float, duration: float, **more) -> Landing:
    """A flight that the floor ends at about `lands` [s]; further arguments are those of `flown`."""
    lowest: list[tuple[float, float]] = []

    def measure(_: mujoco.MjModel, data: mujoco.MjData) -> None:
        lowest.append((data.time, float(data.xipos[1:, 2].min())))

    flown(name, seed=seed, duration=duration, watch=measure, **more)
    heights = np.array(lowest)
    floor = float(np.interp(lands, *heights.T)) - _RADIUS
    touched: list[tuple[float, int]] = []

    def look(_: mujoco.MjModel, data: mujoco.MjData) -> None:
        touched.append((data.time, data.ncon))

    motion = flown(name, seed=seed, duration=duration, model=_over_a_floor(name, floor), watch=look, **more)
    times, contacts = np.array(touched).T
    free = times[: int(np.argmax(contacts > 0))] if contacts.any() else times
    return Landing(motion, float(free[-1]))


def _over_a_floor(name: str, height: float) -> mujoco.MjModel:
    """The body with a ball at each link's centre of mass, and a plane below it."""
    alone = mujoco_model(name)
    written = mujoco.MjSpec.from_string(floating_urdf(name))
    for number in range(1, alone.nbody):
        body, centre = written.body(alone.body(number).name), alone.body_ipos[number]
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[_RADIUS, 0, 0], pos=centre, mass=0.0, contype=1, conaffinity=2
        )
    written.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], pos=[0, 0, height], contype=2, conaffinity=1
    )
    return written.compile()
