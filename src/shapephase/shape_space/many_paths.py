"""Many motions of one body in one call: only where each ends is kept."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import tolerance_argument
from ..arrays import Array, Integers, finite_array
from ..body.body import Body
from ..body.loading import as_body
from ..display import short_repr
from ..errors import ShapeError, ShapePhaseError, WrongObjectError
from ..integrator.many_rotations import rotations_of_each
from ..letters import value_text
from .body_path import as_path, path_sampler, route_along
from .shape_path import ShapePath


@dataclass(frozen=True, eq=False)
class FinalAttitudes:
    """Final attitudes of many motions. Made by `final_attitudes`.

    Attributes
    ----------
    attitude : (P, 3, 3) R(T), base axes to inertial axes
    error_estimate : (P,) of the largest attitude error over each motion [rad]
    evaluations : (P,) how often the locked inertia and internal momentum were computed
    """

    attitude: Array
    error_estimate: Array
    evaluations: Integers

    __repr__ = short_repr


def final_attitudes(
    body: Body | str,
    paths: Iterable[ShapePath | str],
    momentum: ArrayLike,
    attitude: ArrayLike | None = None,
    *,
    tolerance: float = 1e-9,
) -> FinalAttitudes:
    """The attitude at the end of each of many paths of one body, as `reconstruct` would find it.

    The paths are taken one after another, from a generator if need be, and forgotten: memory holds one motion and the
    results.

    Parameters
    ----------
    paths : P of them
    momentum : (3,) for all, or (P, 3) [kg m^2/s]
    attitude : (3, 3) for all, or (P, 3, 3), at the start; None: the identity
    tolerance : of each attitude [rad]

    Raises
    ------
    ShapeError
        If there are more or fewer paths than momenta or attitudes.
    ShapePhaseError
        What `reconstruct` raises, with the number of the path in front.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> paths = [sp.examples.kane_scher(0.0, bend) for bend in (0.3, 0.5)]
    >>> print(np.degrees(sp.so3.angle(sp.final_attitudes(cat, paths, np.zeros(3)).attitude)).round(3))
    [26.393 65.305]
    """
    body = as_body(body)
    goal = tolerance_argument(tolerance)
    spatial = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
    start = np.eye(3) if attitude is None else so3.rotation_argument(attitude, "attitude")
    for name, array, single in (("momentum", spatial, 1), ("attitude", start, 2)):
        if array.ndim > single + 1:
            raise ShapeError(f"{name}: one for all paths or one for each is needed, got {array.shape}")
    if isinstance(paths, str | ShapePath) or not isinstance(paths, Iterable):
        raise WrongObjectError(f"paths: several of ShapePath in a list are needed, got {value_text(paths)}")
    ends: list[Array] = []
    estimates: list[float] = []
    evaluations: list[int] = []
    for number, path in enumerate(paths):
        route = as_path(path, body, f"path {number}")
        mu, first = _of_path(spatial, 1, number), _of_path(start, 2, number)
        try:
            sampler = path_sampler(body, route_along(body, route))
            solution = rotations_of_each(sampler, (first.T @ mu)[None], goal)
        except ShapePhaseError as error:
            raise type(error)(f"path {number}: {error}") from error
        ends.append(first @ solution.end[0])
        estimates.append(float(solution.error_estimate[0]))
        evaluations.append(sampler.evaluations)
    for name, array, single in (("momenta", spatial, 1), ("attitudes", start, 2)):
        if array.ndim > single and len(array) != len(ends):
            raise ShapeError(f"{len(array)} {name} were given for {len(ends)} paths")
    shape = (len(ends), 3, 3)
    return FinalAttitudes(np.array(ends).reshape(shape), np.array(estimates), np.array(evaluations, dtype=np.int64))


def _of_path(array: Array, single: int, number: int) -> Array:
    if array.ndim == single:
        return array
    if number >= len(array):
        raise ShapeError(f"there are more paths than the {len(array)} momenta or attitudes given")
    return np.asarray(array[number])
