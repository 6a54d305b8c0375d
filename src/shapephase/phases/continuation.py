"""Closed orbits followed through magnitudes of the momentum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object, direction_argument, magnitudes_argument
from ..arrays import Array
from ..deformation.deformation import Deformation
from ..display import short_repr
from ..errors import ShapeError, TrajectoryError
from ._loop_map import TINY, UP, MomentumLoop, closed_points, solve_linear, tangent_basis

_LARGEST_STEP = 0.1  # [rad] of the direction from orbit to orbit, so that Newton's method stays on the branch
_SMALLEST_STEP = 1e-6  # of the range: an orbit that needs shorter steps is lost, as at a fold


@dataclass(frozen=True, eq=False)
class OrbitBranch:
    """A closed orbit followed through magnitudes of the momentum. Made by `continued_orbits`.

    Attributes
    ----------
    magnitudes : (k,) reached, of those requested [kg m^2/s]
    directions : (k, 3) u(0), unit vectors, the deformation's frame
    drift : (k, 3) how the direction moves with the magnitude, its derivative [per kg m^2/s]
    trace : (k,) of the linearised map
    stopped : why the branch ends before the last requested magnitude; None when it does not
    fold : the magnitude at which it meets another orbit and both vanish, to about 1e-8 of the range followed
        [kg m^2/s]; None when it does not
    """

    magnitudes: Array
    directions: Array
    drift: Array
    trace: Array
    stopped: str | None
    fold: float | None

    __repr__ = short_repr


def continued_orbits(
    deformation: Deformation, magnitudes: ArrayLike, *, start: ArrayLike | None = None, tolerance: float = 1e-10
) -> OrbitBranch:
    """One closed orbit followed through growing, or falling, magnitudes of the momentum.

    Each step predicts the orbit by the exact derivative with respect to the momentum's magnitude, and Newton's method
    corrects it; a step is shortened until the correction is small against it. The branch ends at a fold, where two
    orbits meet (trace 2) and there are none beyond.

    Source: theory.md section 2.

    Parameters
    ----------
    magnitudes : (K,) 0 or more, all growing or all falling [kg m^2/s]
    start : (3,) direction of the orbit at the first magnitude, to 0.1 rad; None: the branch that at zero momentum is
        the axis about which the loop alone turns this frame, right-handed, by an angle below pi (by pi: either end).
        The other end of the axis begins another branch.
    tolerance : of the attitude [rad]

    Raises
    ------
    OpenPathError
        If the shape does not close.
    ShapeError
        If there is no orbit near `start`, or the magnitudes are in no order.
    TrajectoryError
        If the branch is to start at zero momentum, and the loop alone does not turn the frame: then every direction
        comes back.
    AccuracyNotReached
        If errors grow so much along the loop that the tolerance cannot be met.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> seen = sp.horizontal_gauge(sp.articulated(cat, loop))
    >>> start = sp.fixed_points(seen, 0.005).directions[0]
    >>> branch = sp.continued_orbits(seen, [0.005, 0.006], start=start)
    >>> branch.magnitudes.tolist()
    [0.005, 0.006]
    """
    check_object(deformation, "Deformation", "deformation")
    magnitudes = magnitudes_argument(magnitudes)
    loop = MomentumLoop.of(deformation, tolerance)
    first = 0.0 if start is None else float(magnitudes[0])
    axis = _axis_at_rest(loop) if first == 0.0 else UP
    given = axis if start is None else direction_argument(start, "start")
    if given.shape != (3,):
        raise ShapeError(f"start: one direction (3,) is needed, got {given.shape}")
    orbit = _corrected(loop, first, given)
    if orbit is None or so3.angle_between(orbit.direction, given) > _LARGEST_STEP:
        raise ShapeError(
            f"start: no closed orbit within {_LARGEST_STEP} rad of {given} was found at {first:.9g} kg m^2/s; "
            "`fixed_points` tells where they are"
        )
    span = max(float(np.ptp([first, *magnitudes])), float(magnitudes[0]))
    reached: list[_Orbit] = []
    stopped, fold = None, None
    for magnitude in magnitudes:
        orbit, stopped, fold = _followed(loop, orbit, float(magnitude), span)
        if stopped:
            break
        reached.append(orbit)
    return OrbitBranch(
        magnitudes[: len(reached)],
        np.array([orbit.direction for orbit in reached]).reshape(-1, 3),
        np.array([orbit.drift for orbit in reached]).reshape(-1, 3),
        np.array([2.0 - orbit.excess for orbit in reached]),
        stopped,
        fold,
    )


@dataclass(frozen=True)
class _Orbit:
    """A fixed point at one magnitude of the momentum: direction (3,), 2 - trace, and its rate by magnitude (3,)."""

    magnitude: float
    direction: Array
    excess: float
    drift: Array


def _axis_at_rest(loop: MomentumLoop) -> Array:
    """The axis about which the loop alone turns the frame."""
    turn = so3.log(loop.run(0.0, UP[None]).end[0])
    angle = float(np.linalg.norm(turn))
    if angle < 1e-7:
        raise TrajectoryError(
            f"without momentum this loop turns the frame by {angle:.3g} rad, so every direction comes back and none "
            "begins a branch; give as `start` one of the `fixed_points` at a first magnitude above 0"
        )
    return turn / angle


def _corrected(loop: MomentumLoop, magnitude: float, guess: Array) -> _Orbit | None:
    """The fixed point next to a guess, or None."""
    closed = closed_points(loop, magnitude, guess[None], loop.goal, 1e-12, iterations=6)
    if not closed.gap[0] < loop.accepted:
        return None
    drift = -solve_linear(closed.slope, closed.by_magnitude, 1e-9)[0] @ tangent_basis(closed.points)[0]
    return _Orbit(magnitude, closed.points[0], float(closed.excess[0]), drift)


def _followed(loop: MomentumLoop, orbit: _Orbit, target: float, span: float) -> tuple[_Orbit, str | None, float | None]:
    """The orbit at another magnitude of the momentum; or how far it went, why no further, and where the fold is."""
    passed, step = [orbit], abs(target - orbit.magnitude)
    while orbit.magnitude != target:
        left = target - orbit.magnitude
        step = min(step, abs(left), _LARGEST_STEP / max(float(np.linalg.norm(orbit.drift)), TINY))
        magnitude = target if step == abs(left) else orbit.magnitude + float(np.copysign(step, left))
        moved = orbit.drift * (magnitude - orbit.magnitude)
        guess = so3.normalised(orbit.direction + moved)
        following = _corrected(loop, magnitude, guess)
        if following is not None and _continues(orbit, following, guess, moved, span):
            orbit, step = following, 2.0 * step
            passed = [*passed[-2:], orbit]
            continue
        step *= 0.5
        if step < _SMALLEST_STEP * span:
            return orbit, *_ending(passed, magnitude)
    return orbit, None, None


def _continues(orbit: _Orbit, following: _Orbit, guess: Array, moved: Array, span: float) -> bool:
    """True where a corrected orbit is on the branch: next to the guess, and moving on alike where the index changes."""
    length = float(np.linalg.norm(moved))
    if so3.angle_between(following.direction, guess) > 0.3 * length + 1e-3:
        return False
    if orbit.excess * following.excess > 0.0:
        return True
    drift, other = np.linalg.norm(orbit.drift), np.linalg.norm(following.drift)
    return bool(np.linalg.norm(following.drift - orbit.drift) < 0.3 * (drift + other) + 1e-3 / span)


def _ending(passed: list[_Orbit], lost: float) -> tuple[str, float | None]:
    """End of a branch: a fold, or an unknown cause.

    At a fold the excess 2 - trace goes through zero evenly along the branch, and the magnitude has its extreme:
    magnitude = fold + a excess^2 + b excess^3, from the last three orbits.
    """
    magnitude, excess = passed[-1].magnitude, np.array([orbit.excess for orbit in passed])
    if len(passed) == 3 and np.all(np.diff(np.abs(excess)) < 0.0):
        powers = np.stack([np.ones(3), excess**2, excess**3], axis=1)
        fold = float(np.linalg.solve(powers, np.array([orbit.magnitude for orbit in passed]))[0])
        if abs(fold - magnitude) < 10.0 * abs(lost - magnitude):
            side = "above" if lost > magnitude else "below"
            return (
                f"at {fold:.9g} kg m^2/s this orbit meets another (trace 2), and {side} there is neither; the branch "
                "goes back along the other"
            ), fold
    trace = 2.0 - passed[-1].excess
    return f"the orbit was lost between {magnitude:.9g} and {lost:.9g} kg m^2/s, at trace {trace:.6g}", None
