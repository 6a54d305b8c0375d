"""Checks of shapes and rates that bodies of links and of particles share, and what follows from their maps."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, check_reach, common_batch, finite_array
from ..errors import ShapeError, unknown_name


class ShapeArguments:
    """Mixin of `Body` and `ParticleBody`, which have names of coordinates, J(r) and d[I, J]/dr_k."""

    name: str
    joint_names: tuple[str, ...]
    _coordinate = "joint"

    def momentum_matrix(self, shape: ArrayLike) -> Array:
        """J(r): (..., n) -> (..., 3, n)."""
        raise NotImplementedError

    def angular_map_gradient(self, shape: ArrayLike) -> Array:
        """d[I, J]/dr_k: (..., n) -> (..., n, 3, 3 + n)."""
        raise NotImplementedError

    @property
    def n_shape(self) -> int:
        """The number of coordinates of a shape: one of each axis, four of a ball joint."""
        return len(self.joint_names)

    def joint_index(self, name: str) -> int:
        """The place of a coordinate in the shape vector. Raises UnknownNameError."""
        if name not in self.joint_names:
            raise unknown_name(f"{self._coordinate} of {self.name}", name, self.joint_names)
        return self.joint_names.index(name)

    def internal_momentum(self, shape: ArrayLike, rate: ArrayLike) -> Array:
        """Angular momentum of a change of shape about the centre of mass with the base at rest.

        Raises like `locked_inertia`. Source: Cabrera 2006, section 2.3 (L_o); theory.md A7.

        Parameters
        ----------
        shape, rate : (..., n) [rad or m], [rad/s or m/s]; leading axes broadcast

        Returns
        -------
        (..., 3) base axes [kg m^2/s]
        """
        r, v = self._checked(shape), self._checked(rate, "rate")
        common_batch(shape=r.shape[:-1], rate=v.shape[:-1])
        return (self.momentum_matrix(r) @ v[..., None])[..., 0]

    def inertia_gradient(self, shape: ArrayLike) -> Array:
        """dI/dr_k, exact: (..., n) -> (..., n, 3, 3) [kg m^2 per unit of joint].

        Source: numerics.md section 4 (rate of the centroidal map at unit joint rates).
        """
        return self.angular_map_gradient(shape)[..., :3]

    def momentum_matrix_gradient(self, shape: ArrayLike) -> Array:
        """dJ/dr_k: (..., n) -> (..., n, 3, n), the first n counts k; exact where `angular_map_gradient` is."""
        return self.angular_map_gradient(shape)[..., 3:]

    def _checked(self, shape: ArrayLike, name: str = "shape") -> Array:
        array = finite_array(shape, name)
        if array.ndim == 0 or array.shape[-1] != self.n_shape:
            raise ShapeError(
                f"{name}: expected (..., {self.n_shape}), one entry per {self._coordinate} of {self.name} "
                f"({', '.join(self.joint_names)}), got shape {array.shape}"
            )
        check_reach(array, name)
        return array

    def _pair(self, shape: ArrayLike, rate: ArrayLike) -> tuple[Array, Array]:
        """Shape and rate with equal leading axes."""
        r, v = self._checked(shape), self._checked(rate, "rate")
        batch = common_batch(shape=r.shape[:-1], rate=v.shape[:-1])
        return np.broadcast_to(r, (*batch, self.n_shape)), np.broadcast_to(v, (*batch, self.n_shape))

    def _turning(self, shape: ArrayLike, rate: ArrayLike, angular_velocity: ArrayLike) -> tuple[Array, Array, Array]:
        """Shape, rate and angular velocity of the base with equal leading axes."""
        r, v = self._pair(shape, rate)
        omega = finite_array(angular_velocity, "angular_velocity", (3,), unit="rad/s")
        batch = common_batch(shape=r.shape[:-1], angular_velocity=omega.shape[:-1])
        r, v = (np.broadcast_to(array, (*batch, self.n_shape)) for array in (r, v))
        return r, v, np.broadcast_to(omega, (*batch, 3))

    def _with_base_rate(self, shape: ArrayLike, rate: ArrayLike, base_rate: ArrayLike) -> tuple[Array, Array, Array]:
        """Shape, rate and one base rate for each of them."""
        w = finite_array(base_rate, "base_rate", (3,), unit="rad/s")
        r, v = self._pair(shape, rate)
        if common_batch(shape=r.shape[:-1], base_rate=w.shape[:-1]) != r.shape[:-1]:
            raise ShapeError(f"base_rate: (3,) or one for each shape {r.shape} is needed, got {w.shape}")
        return r, v, np.broadcast_to(w, (*r.shape[:-1], 3))

    def _rows(self, array: Array) -> Array:
        """(..., n) -> (N, n), for n = 0 too."""
        return array.reshape(math.prod(array.shape[:-1]), self.n_shape)
