"""A motion in three dimensions as a page."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import check_flag, check_keywords, check_object
from ...errors import VisualWarning
from ...reconstruction.forced_motion import ForcedMotion
from ...reconstruction.reconstruction import Motion
from .._moving_scene import MovingScene, moving_scene
from .motion_data import motion_data, up_axis
from .page import Page, frame_count, playing_speed
from .templates import SCENE_SCRIPTS, page_from


def view(
    motion: Motion | ForcedMotion,
    *,
    speed: float | None = None,
    frames: int | None = None,
    trail: str | None = None,
    ghost: bool = True,
    up: str | None = None,
    **fall: ArrayLike,
) -> Page:
    """Page of a moving body, to play, stop and scrub.

    The body moves as reconstructed, with the conserved angular momentum as an arrow from the centre of mass, the axes
    of the base and of space, and the body at the start as a transparent ghost. The clock is the time of the body. Its
    joints can be moved by hand. Under a torque the arrow turns, and is as long as the momentum is large.

    Parameters
    ----------
    motion : of one momentum, no batch
    speed : seconds of motion in a second of playing; None: 1, or such that playing takes from 4 to 20 s
    frames : None: 30 in a second of playing
    trail : a link whose origin leaves a trail, light at the start and dark at the end
    ghost : whether the body at the start is shown
    up : the inertial axis that is up in the picture: "x", "y", "z", "-x", "-y" or "-z"; None: against gravity if there
        is any, else y for a body whose left and right are mirror images across z and not across y, else z
    fall : start, velocity, gravity of the centre of mass as in `Motion.base_position`; by default it rests at the
        origin, and there is no ground

    Returns
    -------
    the page, to write, show or film; a notebook displays it

    Raises
    ------
    ShapeError, UnknownNameError
        For the arguments that `moving_scene` refuses, a speed that is not above 0, or an unknown axis.

    Warns
    -----
    VisualWarning
        For the shapes that `visuals` warns of; where `frames` is None, also if something turns by more than a quarter
        turn from one frame to the next, so that it may seem to turn the other way.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> page = sp.view(motion, frames=5)
    >>> page.write("page.html")
    >>> page.html[:15].lower()
    '<!doctype html>'
    """
    check_keywords(fall, view)
    scene, data = scene_and_data(motion, speed=speed, frames=frames, trail=trail, ghost=ghost, up=up, fall=fall)
    return page_from(
        "motion.html",
        title=scene.title,
        scripts=(*SCENE_SCRIPTS, "motion_page"),
        styles=("page", "motion_page"),
        data={"motion": data},
        film=(motion.duration, data["speed"]),
        with_joints=bool(data["joints"]),
    )


def scene_and_data(
    motion: Motion | ForcedMotion,
    *,
    speed: float | None,
    frames: int | None,
    trail: str | None,
    ghost: bool,
    up: str | None,
    fall: Mapping[str, ArrayLike],
) -> tuple[MovingScene, dict[str, Any]]:
    """Return a motion as a scene, and as the data of a page; arguments, errors and warnings as `view`."""
    check_object(motion, "Motion", "motion", or_kind="ForcedMotion")
    check_flag(ghost, "ghost")
    rate = playing_speed(motion.duration, speed)
    up_axis(up, None)
    count = frame_count(motion.duration, rate) if frames is None else frames
    scene = moving_scene(motion, count, trail=trail, **fall)
    if frames is None and scene.largest_turn > 0.5 * math.pi:
        warnings.warn(
            f"from one frame to the next something turns by {math.degrees(scene.largest_turn):.0f} degrees and may "
            f"seem to turn the other way; choose more than {count} frames, or a lower speed than {rate:.3g}",
            VisualWarning,
            stacklevel=3,
        )
    if up is None and scene.falls:
        gravity = np.asarray(fall["gravity"], dtype=float)
        upwards = -gravity / np.linalg.norm(gravity)
    else:
        upwards = up_axis(up, scene.body)
    return scene, motion_data(scene, speed=rate, ghost=ghost, up=upwards)
