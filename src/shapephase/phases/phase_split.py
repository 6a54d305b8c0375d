"""Result of `split`, with its table and card."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .. import so3
from ..arguments import made_by
from ..arrays import Array, Mask
from ..card_pictures import bars_picture
from ..display import Card, angle_text, card_html, card_text, error_text, momentum_text, short_repr
from ..plain_data import plain
from .error_estimates import Deferred, SplitErrors
from .split_text import split_lines


@dataclass(frozen=True, eq=False)
class SplitMotion:
    """Properties of the motion that was split. Made by `split`.

    Attributes
    ----------
    label : name of the body and path
    duration : [s]
    momentum : batch + (3,), inertial axes [kg m^2/s]
    error_estimate : of the attitude at all times: batch [rad]
    evaluations : how often the locked inertia and internal momentum were computed
    """

    label: str
    duration: float
    momentum: Array
    error_estimate: Array
    evaluations: int

    __repr__ = short_repr


@made_by("split(motion)")
@dataclass(frozen=True, eq=False)
class PhaseSplit:
    """Rotation of a free body, split into the part of its shape, of its angular momentum and of its wheels.

    All rotations are in inertial axes; fields have the motion's batch axes in front. With mu the unit vector of
    the momentum (where there is some), seen from the gauge's frame,

        exp(montgomery_phase hat(mu)) closing_tilt = dynamical_rotation in the horizontal gauge,

        exp(montgomery_phase hat(mu)) closing_tilt = total_rotation in the base gauge of a closed joint path,

        total_rotation = dynamical_rotation holonomy always,

        dynamical_rotation = momentum_rotation wheel_rotation always.

    Equations :eq:`split`, :eq:`tilt` and, with wheels, :eq:`wheel-split` of the documentation.

    Attributes
    ----------
    gauge : the frame from which the momentum curve was seen
    total_rotation : (3, 3) Delta R, from the start to the end of the motion, the same in every gauge
    holonomy : (3, 3) R_G, rotation by the loop of shapes alone, at any pace; for an open path the end of its lift
    dynamical_rotation : (3, 3) R_D, rotation by the momentum, that of wheels included
    wheel_rotation : (3, 3) R_W, rotation by the momentum that wheels store, without total momentum, which grows with
        the time that the motion takes; the identity without such wheels
    momentum_rotation : (3, 3) R_M, rotation that the total momentum adds: R_D without wheels
    montgomery_phase : theta_M = dynamic_phase + geometric_phase, unwrapped [rad]
    montgomery_angle : theta_M in (-pi, pi] [rad]
    dynamic_phase : theta_D = integral of omega . Pi dt over the momentum's magnitude [rad]
    geometric_phase : minus the solid angle [rad]
    solid_angle : signed, of the momentum curve in this gauge, closed by the great circle; counted from the
        region of the sphere farthest from the curve [sr]
    closing_tilt : (3, 3) transport along the closing great circle; the identity when the momentum closes in this gauge.
        The tilt of an athlete is another angle (`Motion.somersault_tilt_twist`)
    momentum_gap : angle between the ends of the momentum curve in this gauge [rad]
    closing_phase : part of the geometric phase by the closing great circle; the momentum itself sweeps the rest, about
        the direction opposite the excluded region [rad]
    shape_gap : that of the `Deformation`: largest joint difference [rad or m], or relative change
    residual : |theta_M - the same angle read off the attitude|, modulo 2 pi: two independent computations [rad]
    is_loop : whether the shape closes
    has_phase : whether there is angular momentum; without it all phases are 0, R_D is R_W and R_M the identity
    has_wheels : whether wheels store momentum (`articulated(..., rotors=, rotor_speeds=)`)
    about : the motion that was split

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, np.radians(59.426458741516))
    >>> parts = sp.split(sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.0]))
    >>> print(f"{np.degrees(sp.so3.angle(parts.holonomy)):.6f} degrees by shape alone")
    180.000000 degrees by shape alone
    """

    gauge: str
    total_rotation: Array
    holonomy: Array
    dynamical_rotation: Array
    wheel_rotation: Array
    momentum_rotation: Array
    montgomery_phase: Array
    montgomery_angle: Array
    dynamic_phase: Array
    geometric_phase: Array
    solid_angle: Array
    closing_tilt: Array
    momentum_gap: Array
    closing_phase: Array
    shape_gap: float
    residual: Array
    is_loop: bool
    has_phase: Mask
    has_wheels: bool
    about: SplitMotion = field(repr=False)
    _errors: Deferred[SplitErrors] = field(repr=False)

    __repr__, _repr_html_ = card_text, card_html

    def __str__(self) -> str:
        """Return the table that the command line prints; for a batch the spread of each number."""
        return "\n".join(split_lines(self))

    def to_dict(self) -> dict[str, Any]:
        """Return every number under its name, with the error estimates, for JSON; angles in rad."""
        return plain(self) | {"error_estimates": plain(self.error_estimates)}

    @property
    def error_estimates(self) -> SplitErrors:
        """Error estimates of these numbers; computed on first use, in one or two times the time of the split."""
        return self._errors.value

    def _card(self) -> Card:
        """Rotations and phases; with bars of dynamic, geometric and Montgomery phase."""
        about = self.about
        whole = "shape holonomy" if self.is_loop else "shape lift (open)"
        rows = [
            ("momentum", momentum_text(about.momentum)),
            ("total rotation", angle_text(so3.angle(self.total_rotation))),
            (whole, angle_text(so3.angle(self.holonomy))),
            ("Montgomery phase", angle_text(self.montgomery_phase)),
            ("  dynamic", angle_text(self.dynamic_phase)),
            ("  geometric", angle_text(self.geometric_phase)),
            ("momentum gap", angle_text(self.momentum_gap)),
            ("error, residual", f"{error_text(about.error_estimate)}, {error_text(self.residual)}"),
        ]
        if not np.any(self.has_phase):
            whose = "total angular momentum" if self.has_wheels else "angular momentum"
            rows = [*rows[:3], ("phases", f"none: there is no {whose}"), rows[-1]]
        if self.has_wheels:
            rows.insert(3, ("stored wheel momentum", angle_text(so3.angle(self.wheel_rotation))))
        title = f"PhaseSplit of {about.label}, {about.duration:g} s, {self.gauge} gauge"
        if np.ndim(self.montgomery_phase) or not self.has_phase:
            return Card(title, rows)
        phases = [float(phase) for phase in (self.dynamic_phase, self.geometric_phase, self.montgomery_phase)]
        return Card(title, rows, bars_picture(phases, "dynamic, geometric and Montgomery phase"))
