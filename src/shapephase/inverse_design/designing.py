"""The member of a family of deformations whose phase, attitude or regime is the wanted one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import (
    check_choice,
    check_function,
    initial_state_arguments,
    made_by,
    number_argument,
    tolerance_argument,
    vector_argument,
    whole_argument,
)
from ..arrays import Array, finite_array, lock_arrays
from ..bounds.regimes import Regime, RegimeCertificate
from ..deformation.deformation import Deformation
from ..display import short_repr
from ..errors import DesignNotFound, ShapeError
from ..letters import value_text
from ..phases.phase_split import PhaseSplit
from ..reconstruction.reconstruction import Motion
from ._family_cover import Cover, NotEnclosed
from ._search import Goals, Member, OutOfMembers, Search

_GAUGES = ("horizontal", "base")
_REGIMES = (Regime.ABOUT_SMALLEST.value, Regime.ABOUT_LARGEST.value)


@made_by("design(family, momentum, box, theta=...)")
@dataclass(frozen=True, eq=False)
class Design:
    """Member of a family of deformations, and its motion. Made by `design`.

    Attributes
    ----------
    parameters : (n,) of the member
    deformation : the member, family(parameters)
    motion : its motion
    phases : its `split`, in the gauge of the goal
    miss : largest distance from the goals that are angles [rad]
    error : estimate of the largest error of those angles [rad]
    certificate : of the regime, from deformation and initial momentum alone; None without that goal
    members : number of members whose motions were computed
    """

    parameters: Array
    deformation: Deformation
    motion: Motion
    phases: PhaseSplit
    miss: float
    error: float
    certificate: RegimeCertificate | None
    members: int

    __post_init__ = lock_arrays
    __repr__ = short_repr


def design(
    family: Callable[[Array], Deformation],
    momentum: ArrayLike,
    box: ArrayLike,
    *,
    theta: float | None = None,
    dynamic: float | None = None,
    attitude: ArrayLike | None = None,
    regime: str | None = None,
    gauge: str = "horizontal",
    start: ArrayLike | None = None,
    initial_attitude: ArrayLike | None = None,
    tolerance: float = 1e-9,
    members: int = 400,
) -> Design:
    """Find the member of a family of deformations whose motion has the wanted phase, attitude or regime.

    Several goals hold together. Gauss-Newton steps search from several members; with more parameters than goals they
    are the shortest ones, measured by the widths of the box. Where they fail, enclosures exclude boxes of parameters
    one by one, so that a goal that no member meets is shown to be such.

    Equation :eq:`family-distance` of the documentation. Errors of the family are passed on.
    Source: Cabrera 2006, section 4, read backwards; the enclosure is derived here.

    Parameters
    ----------
    family : parameters (n,) -> deformation, smooth in them, with its duration and breaks
    momentum : (3,) about the centre of mass, inertial axes [kg m^2/s]
    box : (n, 2) least and greatest value of each parameter
    theta : Montgomery phase of the whole motion, modulo 2 pi [rad]
    dynamic : dynamic phase [rad]
    attitude : (3, 3) at the end. A momentum that is to close in the body, with a phase theta in the base gauge, needs
        exp(theta hat(mu)) times the initial attitude
    regime : "about axis 1" or "about axis 3", certified; as the only goal with the margin made as wide as it gets
    gauge : "horizontal" or "base", for both phases
    start : (n,) where the search begins; None: the middle of the box
    initial_attitude : (3, 3); None: the identity
    tolerance : of the angles that are goals [rad]
    members : number of motions to compute at most; to enclose a family takes tens to thousands

    Raises
    ------
    DesignNotFound
        If no member was found: its `best` is the nearest, its `cover` the enclosures where there is none.
    ShapeError
        For no goal, a box or start that does not fit, and phases without momentum.

    Examples
    --------
    >>> def antenna(x):
    ...     return sp.examples.printed_antenna(3, extension_time=x[0], coast=8.0 - x[0]).deformation
    >>> found = sp.design(antenna, [0.3, 0.4, 0.9], [[1.0, 7.0]], theta=4.1)
    >>> print(f"{found.parameters[0]:.6f} s, {found.phases.montgomery_phase:.6f} rad")
    4.592602 s, 4.100000 rad
    """
    check_function(family, "family", "a function of parameters (n,) that returns a Deformation")
    given = finite_array(box, "box", (2,)).copy()
    if given.ndim != 2 or not len(given) or np.any(given[:, 0] >= given[:, 1]):
        raise ShapeError(f"box: (n, 2), each least value below the greatest, is needed, got {value_text(box)}")
    state = initial_state_arguments(momentum, initial_attitude)
    if state[0].ndim != 1:
        raise ShapeError(f"momentum: (3,) is needed, got {state[0].shape}; design for each of them")
    check_choice(gauge, "gauge", _GAUGES)
    if regime is not None:
        check_choice(regime, "regime", _REGIMES)
    goals = Goals(
        theta=None if theta is None else number_argument(theta, "theta", "rad"),
        dynamic=None if dynamic is None else number_argument(dynamic, "dynamic", "rad"),
        attitude=None if attitude is None else so3.rotation_argument(attitude, "attitude"),
        regime=regime,
        gauge=gauge,
    )
    if not goals.names:
        raise ShapeError("a goal is needed: theta=, dynamic=, attitude= or regime=")
    if not state[0].any() and goals.names != ["attitude"]:
        raise ShapeError("momentum: phases and regimes need some; without momentum the goal is an attitude")
    first = given.mean(axis=1) if start is None else vector_argument(start, "start", len(given))
    if np.any((first < given[:, 0]) | (first > given[:, 1])):
        raise ShapeError(f"start: inside the box is needed, got {value_text(start)}")
    search = Search(family, state, given, goals, tolerance_argument(tolerance), whole_argument(members, "members", 1))
    cover, reason = None, ""
    try:
        found = search.searched(first)
        if found is None:
            found, cover = search.covered()
    except (OutOfMembers, NotEnclosed) as error:
        found, reason = None, str(error)
    if found is None:
        best = _designed(search, search.nearest)
        raise DesignNotFound(_refusal(goals, best, search.nearest, cover, reason), best, cover)
    return _designed(search, found)


def _designed(search: Search, member: Member) -> Design:
    return Design(
        parameters=member.x,
        deformation=member.motion.deformation,
        motion=member.motion,
        phases=member.phases,
        miss=member.miss,
        error=member.error,
        certificate=search.certificate(member),
        members=len(search.members),
    )


def _refusal(goals: Goals, best: Design, nearest: Member, cover: Cover | None, reason: str) -> str:
    """Message: the goals, the nearest member, and what is known of all others."""
    texts = {"attitude": "the attitude", "regime": f"the regime {goals.regime!r}"}
    wanted = [texts[name] if name in texts else f"{name} = {getattr(goals, name):.9g} rad" for name in goals.names]
    at = np.array2string(best.parameters, precision=6)
    miss = [f"misses by {best.miss:.6g} rad"] if nearest.misses else []
    if best.certificate is not None:
        miss.append(f"has a margin of {nearest.margin:.3g} J")
    shown = f"{' and '.join(wanted)}: of {best.members} members the nearest, x = {at}, {' and '.join(miss)}"
    if cover is None:
        return f"no member was found with {shown}; there may be one: {reason}"
    excluded = f"enclosures of {len(cover.least)} boxes exclude all but what is narrower than their grid of members"
    return f"no member has {shown}; {excluded}: another goal or a wider box"
