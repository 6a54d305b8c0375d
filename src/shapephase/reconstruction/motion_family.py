"""The motions of many bodies with the same joints along the same path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import initial_state_arguments, made_by, times_argument
from ..arrays import Array, Integers, lock_arrays
from ..deformation.deformation import DeformationFamily
from ..display import short_repr
from ..errors import ShapeError, unknown_name
from ..integrator.families import VariantRotations, rotations_of_variants
from .reconstruction import Motion

_METHODS = ("auto", "spectral")


@made_by(Motion="take one of its motions, family[0]")
@dataclass(frozen=True, eq=False)
class MotionFamily(Sequence[Motion]):
    """How N bodies turn: a sequence of motions, made by `reconstruct` of a family.

    Attributes
    ----------
    deformations : what moved
    momentum : (N, 3) of each about its centre of mass, inertial axes [kg m^2/s]
    initial_attitude : (N, 3, 3) base axes to inertial axes
    tolerance : the one requested [rad]
    solution : S(t) of each, the attitude relative to the start

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> family = cat.with_inertias(masses=np.outer([1.0, 2.0], [part.mass for part in cat.moving_parts]))
    >>> motions = sp.reconstruct(sp.articulated(family, loop), [0.0, 0.0, 0.0])
    >>> [round(float(sp.so3.angle(motion.final_attitude)), 6) for motion in motions]
    [1.139791, 1.139791]
    """

    deformations: DeformationFamily
    momentum: Array
    initial_attitude: Array
    tolerance: float
    solution: VariantRotations

    __post_init__ = lock_arrays
    __repr__ = short_repr

    def __len__(self) -> int:
        """N."""
        return len(self.momentum)

    @overload
    def __getitem__(self, index: int) -> Motion: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Motion, ...]: ...

    def __getitem__(self, index: int | slice) -> Motion | tuple[Motion, ...]:
        """One of the motions, put together when it is asked for, or those of a slice."""
        numbers = range(len(self))[index]
        if isinstance(numbers, range):
            return tuple(self[number] for number in numbers)
        solution = self.solution[numbers]
        return Motion(
            deformation=self.deformations[numbers],
            momentum=self.momentum[numbers],
            initial_attitude=self.initial_attitude[numbers],
            tolerance=self.tolerance,
            method="spectral",
            evaluations=solution.interpolant.evaluations,
            solution=solution,
        )

    @property
    def duration(self) -> float:
        """[s]."""
        return self.deformations.duration

    @property
    def error_estimate(self) -> Array:
        """Estimate of the largest attitude error of each over [0, T]: (N,) [rad]."""
        return self.solution.error_estimate

    @property
    def evaluations(self) -> Integers:
        """How often the locked inertia and internal momentum of each were computed: (N,)."""
        return self.solution.evaluations

    @property
    def final_attitude(self) -> Array:
        """R(T) of each: (N, 3, 3)."""
        return self.initial_attitude @ self.solution.end

    def attitude(self, t: ArrayLike) -> Array:
        """R(t) of each, base axes to inertial axes: times (...) -> (N, ..., 3, 3)."""
        times = times_argument(t, self.duration)
        turned = np.empty((len(self), times.size, 3, 3))
        for number, start in enumerate(self.initial_attitude):
            turned[number] = start @ self.solution[number].rotation(times.ravel())[0]
        return turned.reshape(len(self), *times.shape, 3, 3)


def reconstruct_family(
    deformations: DeformationFamily,
    momentum: ArrayLike,
    attitude: ArrayLike | None,
    tolerance: float,
    method: str,
) -> MotionFamily:
    """As `reconstruct`, with the tolerance already checked."""
    if not isinstance(method, str) or method not in _METHODS:
        raise unknown_name("method for a family of bodies", method, _METHODS)
    count = len(deformations)
    spatial, start = initial_state_arguments(momentum, attitude)
    if spatial.shape[:-1] not in ((), (count,)):
        raise ShapeError(
            f"momentum and attitude: one for all or one for each of {count} bodies is needed, got a batch of "
            f"{spatial.shape[:-1]}"
        )
    spatial, start = np.broadcast_to(spatial, (count, 3)), np.broadcast_to(start, (count, 3, 3))
    at_start = so3.apply(so3.transpose(start), spatial)
    solution = rotations_of_variants(deformations.variants(), at_start, tolerance)
    return MotionFamily(
        deformations=deformations,
        momentum=spatial,
        initial_attitude=start,
        tolerance=tolerance,
        solution=solution,
    )
