"""A split rotation: the numbers of `split`, what they are of, and how they are shown."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ..arguments import made_by
from ..arrays import Array, Mask
from ..display import card_html, card_text, short_repr
from ..plain_data import plain
from ._card import split_card
from ._deferred import Deferred
from .error_estimates import SplitErrors
from .split_text import split_lines


@dataclass(frozen=True, eq=False)
class SplitMotion:
    """What is told of a motion beside its split.

    Attributes
    ----------
    label : what moved, for people
    duration : [s]
    momentum : batch + (3,), inertial axes [kg m^2/s]
    error_estimate : of the attitude at all times: batch [rad]
    evaluations : how often the locked inertia and internal momentum were computed

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> sp.split(motion).about.duration
    4.0
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
    """What turned a free body: its shape, its angular momentum, and what its wheels store of that.

    All rotations are in inertial axes; fields have the motion's batch axes in front. With mu the unit vector of
    the momentum (where there is some), seen from the gauge's frame,

        exp(montgomery_phase hat(mu)) closing_tilt = dynamical_rotation    in the horizontal gauge,
        exp(montgomery_phase hat(mu)) closing_tilt = total_rotation        in the base gauge of a closed joint path,
        total_rotation = dynamical_rotation holonomy                       always.

    Attributes
    ----------
    gauge : the frame from which the momentum curve was seen
    total_rotation : (3, 3) Delta R, from the start to the end of the motion, the same in every gauge
    holonomy : (3, 3) R_G, what the loop of shapes alone does, whatever its pace; for an open path the endpoint of its
        lift
    dynamical_rotation : (3, 3) R_D, what the momentum adds, that which wheels store included
    wheel_rotation : (3, 3) R_W, what wheels that store momentum add where there is no total momentum: R_D is R_W then,
        and otherwise R_D R_W^T is what the total momentum adds to it; the identity without such wheels
    montgomery_phase : theta_M = dynamic_phase + geometric_phase, unwrapped [rad]
    montgomery_angle : the same in (-pi, pi] [rad]
    dynamic_phase : theta_D = integral of omega . Pi dt over the momentum's magnitude [rad]
    geometric_phase : minus the solid angle [rad]
    solid_angle : signed, of the momentum curve in this gauge, closed by the great circle; counted from the
        region of the sphere farthest from the curve [sr]
    closing_tilt : (3, 3) transport along the closing great circle; the identity when the momentum closes in this gauge.
        No tilt of an athlete, which is an angle of the attitude (`Motion.somersault_tilt_twist`)
    momentum_gap : angle between the ends of the momentum curve in this gauge [rad]
    closing_phase : what the closing great circle adds to the geometric phase; the rest is swept by the momentum
        itself, about the direction opposite the region that is not counted [rad]
    shape_gap : how far the end shape is from the start shape
    residual : |theta_M - the same angle read off the attitude|, modulo 2 pi: two independent computations [rad]
    is_loop : whether the shape closes
    has_phase : whether there is angular momentum; without it all phases are 0 and R_D is R_W
    has_wheels : whether wheels store momentum (`articulated(..., rotors=, rotor_speeds=)`)
    about : what was split

    Notes
    -----
    Equations :eq:`split`, :eq:`tilt` and, with wheels, :eq:`wheel-split` of the documentation.

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
    _card = split_card

    def __str__(self) -> str:
        """The table that the command line prints; of a batch, how far each number spreads."""
        return "\n".join(split_lines(self))

    def to_dict(self) -> dict[str, Any]:
        """Every number under its name, with the error estimates, as JSON can hold it; angles in rad."""
        return plain(self) | {"error_estimates": plain(self.error_estimates)}

    @property
    def error_estimates(self) -> SplitErrors:
        """Of each of these numbers; computed when first looked at, which takes once or twice as long as the split."""
        return self._errors.value
