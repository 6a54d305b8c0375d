"""The motion of a body with left and right exchanged."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import so3
from ..arrays import Array, Integers
from ..body.body import Body
from ..body.link_motions import link_motions
from ..deformation.deformation import articulated
from ..errors import ShapeError
from ..reconstruction.reconstruction import Motion, reconstruct
from ..shape_space.curves import Curve, Swings, swings_of
from .direct_shares import articulated_parts, rotors_of

_NEAR = 0.05  # of the body's extent, and of an axis of length one: left and right of measured models differ by 1 to 3 %


@dataclass(frozen=True, eq=False)
class _Exchanged:
    """Curve whose coordinates are those of their mirror images, with a sign."""

    curve: Curve
    images: Integers
    signs: Array

    @property
    def swings(self) -> Swings:
        return swings_of(self.curve)

    def __call__(self, times: Array) -> tuple[Array, Array]:
        shapes, rates = self.curve(times)
        return self.signs * shapes[:, self.images], self.signs * rates[:, self.images]


def mirrored_motion(motion: Motion, **axes: Any) -> Motion:
    """Motion along the mirrored path, with momentum and attitude as they are; `axes` as for `Motion.athlete_axes`.

    Raises ShapeError for a body with a joint that has no mirror image.
    """
    body, path = articulated_parts(motion.deformation)
    if rotors_of(motion.deformation):
        raise ShapeError("baseline: a body with wheels has no mirrored motion; give another motion, or a posture")
    lateral = motion.athlete_axes(**{key: value for key, value in axes.items() if value is not None}).lateral
    images, signs = _mirror_images(body, lateral)
    mirrored = replace(path, curve=_Exchanged(path.curve, images, signs), origin=None)
    return reconstruct(
        articulated(body, mirrored), motion.momentum, motion.initial_attitude, tolerance=motion.tolerance
    )


def _mirror_images(body: Body, lateral: Array) -> tuple[Integers, Array]:
    """Coordinate of which each is the mirror image, and its sign: by place and axis with all coordinates at zero."""
    if body.ball_joints:
        raise ShapeError("baseline: a body with ball joints has no mirrored motion; give another motion")
    chain, zero = body.chain, np.zeros((1, body.n_shape))
    pose = link_motions(chain, zero, zero)
    origins = (pose.places - so3.apply(pose.turns, chain.centres))[0]
    frames = np.array([chain.names.index(name) for name in body.joint_names])
    turns, places = pose.turns[0, frames + 1], origins[frames + 1]
    reflection = np.eye(3) - 2.0 * np.outer(lateral, lateral)
    extent = float(np.ptp(origins, axis=0).max())
    # A turn is mirrored as a pseudovector, a slide as a vector.
    hinges, slides = so3.apply(turns, chain.axes[frames]), so3.apply(turns, chain.slides[frames])
    images, signs = [], []
    for name, place, hinge, slide in zip(
        body.joint_names, places @ reflection, -hinges @ reflection, slides @ reflection, strict=True
    ):
        alignment = hinges @ hinge + slides @ slide
        off = np.linalg.norm(places - place, axis=1) / extent + 1.0 - np.abs(alignment)
        nearest = int(np.argmin(off))
        if off[nearest] > _NEAR:
            raise ShapeError(
                f"baseline: joint {name} of {body.name} has no mirror image across the plane of left and right; give "
                "another motion or posture as the baseline"
            )
        images.append(nearest)
        signs.append(np.sign(alignment[nearest]))
    doubled = [body.joint_names[image] for image, count in Counter(images).items() if count > 1]
    if doubled:
        raise ShapeError(f"baseline: joints of {body.name} share the mirror image {doubled[0]}; give another motion")
    return np.array(images), np.array(signs)
