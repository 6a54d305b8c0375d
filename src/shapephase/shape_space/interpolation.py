"""Curves from samples or coefficients: cubic splines, quintics from rest to rest, Fourier series."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_time_steps, names_argument, positive_argument, vector_argument
from ..arrays import Array, check_reach, finite_array
from ..body.body import Body
from ..body.particles.point_masses import ParticleBody
from ..errors import ShapeError, TrajectoryError
from ..letters import value_text
from .curves import CLOSED, Fourier, PiecewisePolynomial

_PARTS = ("x", "y", "z", "w")  # endings of the four names, behind a dot
REST_TO_REST = (10.0, -15.0, 6.0)  # quintic of least jerk from 0 to 1: coefficients of s^3, s^4, s^5


def sample_arguments(
    times: ArrayLike, shapes: ArrayLike, joint_names: Sequence[str] | None
) -> tuple[Array, Array, tuple[slice, ...]]:
    """Times from 0 (N,), shapes (N, n) with continuous quaternions, and columns of ball joints, checked.

    Raises ShapeError, TrajectoryError.
    """
    t = finite_array(times, "times", (None,), unit="s")
    r = finite_array(shapes, "shapes", (None, None))
    if t.ndim != 1 or r.ndim != 2 or len(t) != len(r):
        raise ShapeError(f"times (N,) and shapes (N, n) are needed, got {t.shape} and {r.shape}")
    check_reach(r, "shapes")
    if len(t) < 2:
        raise TrajectoryError(f"a path needs two samples or more, got {len(t)}")
    late = np.flatnonzero(np.diff(t) <= 0.0)
    if len(late):
        row = int(late[0]) + 1
        raise TrajectoryError(f"times must ascend: sample {row} at {t[row]:.9g} s follows {t[row - 1]:.9g} s")
    check_time_steps(t - t[0])
    balls = ball_columns(path_joint_names(joint_names, r.shape[1]))
    return t - t[0], neighbours_signs(r, balls), balls


def path_joint_names(joint_names: Sequence[str] | None, n_shape: int) -> tuple[str, ...] | None:
    """Names of the joints of a path, checked. Raises TrajectoryError."""
    if joint_names is None:
        return None
    names = names_argument(joint_names, "joint_names", f"{n_shape} names")
    if len(names) != n_shape or len(set(names)) != len(names):
        raise TrajectoryError(f"joint_names: {n_shape} different names are needed, got {value_text(names)}")
    return names


def fourier_curve(mean: ArrayLike, cosines: ArrayLike, sines: ArrayLike, period: float) -> Fourier:
    """A Fourier series, its coefficients checked. Raises ShapeError, TrajectoryError."""
    middle = finite_array(mean, "mean", (None,))
    a = finite_array(cosines, "cosines", (len(middle), None))
    b = finite_array(sines, "sines", a.shape)
    if middle.ndim != 1 or a.ndim != 2 or b.ndim != 2:
        shapes = f"{middle.shape}, {a.shape} and {b.shape}"
        raise ShapeError(f"mean (n,), cosines (n, K) and sines (n, K) are needed, got {shapes}")
    for values, name in ((middle, "mean"), (a, "cosines"), (b, "sines")):
        check_reach(values, name)
    return Fourier(middle.copy(), a.copy(), b.copy(), period)


def circle_coefficients(
    body: Body | ParticleBody, joints: tuple[str, str], radius: float, centre: ArrayLike | None
) -> tuple[Array, Array, Array]:
    """Coefficients of the series of `ShapePath.circle`, within the limits of the joints: (n,), (n, 1), (n, 1)."""
    size = positive_argument(radius, "radius", "a number in rad or m")
    first, second = places = [body.joint_index(name) for name in joints]
    units = [body.joint_units[place] for place in places]
    if first == second or units[0] != units[1] or units[0] not in ("rad", "m"):
        found = " and ".join(f"{name} [{unit}]" for name, unit in zip(joints, units))
        raise ShapeError(f"a circle needs two different joints that both turn or both slide, got {found}")
    middle = np.zeros(body.n_shape) if isinstance(body, ParticleBody) else body.shape()
    if centre is not None:
        middle = vector_argument(centre, "centre", body.n_shape, "rad or m")
    for place in places:
        lower, upper = body.joint_limits[place]
        room = float(min(middle[place] - lower, upper - middle[place]))
        if size > room:
            fits = f"radii up to {room:.6g} fit there" if room > 0.0 else "move the centre"
            raise TrajectoryError(
                f"{body.joint_names[place]} of {body.name} goes from {lower:.6g} to {upper:.6g} {units[0]}: "
                f"a circle of {size:.6g} about {middle[place]:.6g} leaves that; {fits}"
            )
    cosines, sines = np.zeros((2, body.n_shape, 1))
    cosines[first], sines[second] = size, size
    return middle, cosines, sines


def same_shape(a: Array, b: Array) -> bool:
    """True where two shapes (n,) are equal to the accuracy of files."""
    return bool(np.all(np.abs(a - b) <= CLOSED * np.maximum(1.0, np.abs(a))))


def spline_curve(times: Array, shapes: Array, balls: Sequence[slice], periodic: bool | None) -> PiecewisePolynomial:
    """The C2 cubic spline through samples; periodic None: where the last sample equals the first.

    Raises TrajectoryError if a periodic one does not close.
    """
    factors = factors_between(shapes[-1], shapes[0], balls)
    closes = same_shape(shapes[-1], shapes[0] * factors) and len(times) > 2
    if periodic and not closes:
        joint = int(np.argmax(np.abs(shapes[-1] - shapes[0])))
        raise TrajectoryError(
            f"a periodic spline needs the last sample to equal the first (and three samples or more); joint number "
            f"{joint} ends {shapes[-1, joint] - shapes[0, joint]:.6g} from its start"
        )
    if not (closes if periodic is None else periodic):
        return PiecewisePolynomial(times, _spline_coefficients(times, shapes, False), "not-a-knot")
    if np.any(np.abs(factors - 1.0) > CLOSED):
        # A quaternion ends at its negative: the spline is the first half of one that is gone through twice.
        signs = np.where(factors < 0.0, -1.0, 1.0)
        twice = np.concatenate([times, times[-1] + times[1:]])
        loop = np.concatenate([shapes[:-1], shapes[:-1] * signs, shapes[:1]])
        coefficients = _spline_coefficients(twice, loop, True)[:, : len(times) - 1]
        return PiecewisePolynomial(times, np.ascontiguousarray(coefficients), "not-a-knot")
    shapes = np.concatenate([shapes[:-1], shapes[:1]])
    return PiecewisePolynomial(times, _spline_coefficients(times, shapes, True), "periodic")


def rest_to_rest_curve(times: Array, shapes: Array) -> PiecewisePolynomial:
    """Straight moves from rest to rest through waypoints, each by the quintic of least jerk."""
    moves, steps = np.diff(shapes, axis=0), np.diff(times)[:, None]
    coefficients = np.zeros((3 + len(REST_TO_REST), *moves.shape))
    for power, factor in enumerate(REST_TO_REST, 3):
        coefficients[power] = factor * moves / steps**power
    coefficients[0] = shapes[:-1]
    return PiecewisePolynomial(times, coefficients, "rest to rest")


def _spline_coefficients(times: Array, shapes: Array, periodic: bool) -> Array:
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(times, shapes, bc_type="periodic" if periodic else "not-a-knot")
    pieces = np.broadcast_to(spline.c[::-1], (len(spline.c), len(times) - 1, shapes.shape[1]))
    return np.ascontiguousarray(pieces)


def ball_columns(names: Sequence[str] | None) -> tuple[slice, ...]:
    """Places of four names in a row, `joint.x`, `joint.y`, `joint.z` and `joint.w` of one joint."""
    known, balls = list(names or ()), []
    for first in range(len(known) - len(_PARTS) + 1):
        four = known[first : first + len(_PARTS)]
        joint = four[0].removesuffix(".x")
        if joint and tuple(four) == tuple(f"{joint}.{part}" for part in _PARTS):
            balls.append(slice(first, first + len(_PARTS)))
    return tuple(balls)


def neighbours_signs(samples: Array, balls: Sequence[slice]) -> Array:
    """The samples (N, n), quaternions with the sign that is nearer to the one before."""
    return samples * near_signs(samples, balls) if balls else samples


def near_signs(samples: Array, balls: Sequence[slice]) -> Array:
    """Factors of samples (N, n) that bring each quaternion near the one before: (N, n), 1 or -1."""
    signs = np.ones_like(samples)
    for ball in balls:
        four = samples[:, ball]
        flips = np.where(np.sum(four[1:] * four[:-1], axis=1) < 0.0, -1.0, 1.0)
        signs[1:, ball] = np.cumprod(flips)[:, None]
    return signs


def factors_between(end: Array, start: Array, balls: Sequence[slice]) -> Array:
    """Factors of the columns of `start` that give those of `end`, where these are the same turn: (n,)."""
    factors = np.ones(len(end))
    for ball in balls:
        length = float(start[ball] @ start[ball])
        factor = float(end[ball] @ start[ball]) / length if length else 1.0
        size = float(np.linalg.norm(end[ball]))
        if factor and np.linalg.norm(end[ball] - factor * start[ball]) <= CLOSED * size:
            factors[ball] = factor
    return factors
