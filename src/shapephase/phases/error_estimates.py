"""Error estimates of phases."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Array
from ..display import short_repr


@dataclass(frozen=True, eq=False)
class SplitErrors:
    """Error estimates of a `PhaseSplit`, under the names of its fields, with the motion's batch axes.

    Made by `split`.

    Near the point opposite its start, a small displacement of the end of the momentum's curve turns the closing great
    circle by any angle, so the tilt of the closing may be wrong by up to pi and phases by up to 2 pi.

    Attributes
    ----------
    total_rotation, holonomy, dynamical_rotation, wheel_rotation, closing_tilt : angle from the true rotation [rad]
    montgomery_phase, dynamic_phase, geometric_phase, closing_phase : modulo 4 pi [rad]
    montgomery_angle : modulo 2 pi [rad]
    solid_angle : modulo 4 pi [sr]
    momentum_gap : [rad]
    """

    total_rotation: Array
    holonomy: Array
    dynamical_rotation: Array
    wheel_rotation: Array
    montgomery_phase: Array
    montgomery_angle: Array
    dynamic_phase: Array
    geometric_phase: Array
    solid_angle: Array
    closing_tilt: Array
    momentum_gap: Array
    closing_phase: Array

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class RunningErrors:
    """Error estimates of `RunningPhases`, modulo 4 pi; fields are batch + t.shape [rad]. Made by `running_phases`."""

    dynamic_phase: Array
    geometric_phase: Array
    montgomery_phase: Array
    solid_angle: Array

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class ArcErrors:
    """Error estimates of `ArcPhases`, with its names and shapes, modulo 4 pi; angles of rotations [rad].

    Made by `arc_phases`.
    """

    dynamic_phase: Array
    geometric_phase: Array
    montgomery_phase: Array
    solid_angle: Array
    closing_tilt: Array
    momentum_gap: Array
    polygon_angle: Array
    total_phase: Array
    total_closing_tilt: Array

    __repr__ = short_repr
