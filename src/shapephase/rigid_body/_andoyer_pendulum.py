"""The free rigid body as a pendulum in Serret and Andoyer's variables (y, p_y).

    H_1 = sqrt(G^2 - p_y^2) sin(y),  H_2 = sqrt(G^2 - p_y^2) cos(y),  H_3 = p_y,

for the body momentum H of size G and principal moments I_1 > I_2 > I_3. y and p_y are canonically conjugate on the
sphere of momenta. Along axis 1, at y = pi/2, is the stable equilibrium of the (y, p_y) plane, along axis 2, at y = 0,
the unstable one; the momenta along axis 3, p_y = G and -G, have no y.

Source: Bonnard, Cots and Shcherbakova 2013, sections 3.4 and 3.5; theory.md N12.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import moments_argument
from ..arrays import Array, common_shape, finite_array
from ..errors import ShapeError
from .pendulum import rigid_body_pendulum

_NAMES = {"libration": "oscillating", "rotation": "rotating"}


@dataclass(frozen=True, eq=False)
class AndoyerPendulum:
    """The reduced Euler-Poinsot motion in the (y, p_y) plane, see `andoyer_pendulum`."""

    moments: Array
    """(3,) descending principal moments [kg m^2]."""

    def coordinates(self, momentum: ArrayLike) -> tuple[Array, Array, Array]:
        """G, y in (-pi, pi] and p_y of body momenta: (..., 3) -> (...), (...) [rad], (...) [kg m^2/s].

        Raises
        ------
        ShapeError
            If a momentum is along axis 3, where y is undefined, or no three finite numbers.

        Source: Bonnard et al., before (5).
        """
        pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
        bad = (pi[..., 0] == 0.0) & (pi[..., 1] == 0.0)
        if bad.any():
            where = tuple(int(i) for i in np.argwhere(bad)[0])
            raise ShapeError(f"momentum: entry {list(where)} is {pi[where]}, along axis 3, where y is undefined")
        # Adding zero takes the sign off a zero, of which arctan2 would make minus a half turn.
        return np.linalg.norm(pi, axis=-1), np.arctan2(pi[..., 0] + 0.0, pi[..., 1]), pi[..., 2]

    def body_momentum(self, magnitude: ArrayLike, y: ArrayLike, p_y: ArrayLike) -> Array:
        """H of G, y and p_y, the inverse of `coordinates`: (...) each -> (..., 3) [kg m^2/s].

        Raises
        ------
        ShapeError
            If |p_y| is larger than G; so do the other methods.
        """
        size, y, p_y = _variables(magnitude, y, p_y)
        radius = np.sqrt((size - p_y) * (size + p_y))
        return np.stack([radius * np.sin(y), radius * np.cos(y), p_y], axis=-1)

    def hamiltonian(self, magnitude: ArrayLike, y: ArrayLike, p_y: ArrayLike) -> Array:
        """((G^2 - p_y^2)(sin^2(y)/I_1 + cos^2(y)/I_2) + p_y^2/I_3)/2, the energy: (...) each -> (...) [J].

        Source: Bonnard et al. (5), (6).
        """
        size, y, p_y = _variables(magnitude, y, p_y)
        first, second, third = 1.0 / self.moments
        across = first * np.sin(y) ** 2 + second * np.cos(y) ** 2
        return 0.5 * ((size - p_y) * (size + p_y) * across + third * p_y * p_y)

    def rates(self, magnitude: ArrayLike, y: ArrayLike, p_y: ArrayLike) -> tuple[Array, Array]:
        """y' [rad/s] and p_y' [kg m^2/s^2], Hamilton's equations: (...) each -> (...), (...).

        Source: Bonnard et al. (8).
        """
        size, y, p_y = _variables(magnitude, y, p_y)
        first, second, third = 1.0 / self.moments
        sine, cosine = np.sin(y), np.cos(y)
        y_rate = p_y * ((third - first) * sine**2 + (third - second) * cosine**2)
        return y_rate, (second - first) * (size - p_y) * (size + p_y) * sine * cosine

    def square_eigenvalues(self, magnitude: ArrayLike) -> tuple[Array, Array]:
        """lambda^2 of the linearised motion at y = pi/2, negative, and at y = 0, positive: (...) -> (...), (...).

        Source: Bonnard et al., after (8).
        """
        size = finite_array(magnitude, "magnitude", unit="kg m^2/s")
        first, second, third = 1.0 / self.moments
        return -(second - first) * (third - first) * size**2, (second - first) * (third - second) * size**2

    def trajectory_type(self, momentum: ArrayLike) -> str:
        """ "oscillating" about y = pi/2 modulo pi, "rotating", "separatrix" or "equilibrium", of a momentum (3,).

        Decided in exact arithmetic of the numbers given.
        Source: Bonnard et al., proposition 7.
        """
        regime = rigid_body_pendulum(self.moments, (0, 1, 2)).motion(momentum).regime
        return _NAMES.get(regime, regime)

    def from_pendulum_angle(self, theta: ArrayLike) -> Array:
        """y of the angle theta of `rigid_body_pendulum(moments, (0, 1, 2))`, continuous: (...) -> (...) [rad].

        cot(y) = (k_2/k_1) tan(theta), so that the closed solution for theta is one for y.
        """
        theta = finite_array(theta, "theta", unit="rad")
        pendulum = rigid_body_pendulum(self.moments, (0, 1, 2))
        sine, cosine = np.sin(theta), np.cos(theta)
        shift = np.arctan2((pendulum.k2 - pendulum.k1) * sine * cosine, pendulum.k1 * cosine**2 + pendulum.k2 * sine**2)
        return 0.5 * np.pi - theta - shift


def andoyer_pendulum(moments: ArrayLike) -> AndoyerPendulum:
    """The pendulum in Serret and Andoyer's variables of principal moments (3,), I_1 > I_2 > I_3 [kg m^2].

    Raises
    ------
    ShapeError
        If the moments are not positive, or do not descend strictly.
    """
    values = moments_argument(moments)
    if not (values[0] > values[1] > values[2]):
        raise ShapeError(f"moments: got {values}; expected I_1 > I_2 > I_3, as in the definition of y")
    return AndoyerPendulum(values)


def _variables(magnitude: ArrayLike, y: ArrayLike, p_y: ArrayLike) -> tuple[Array, Array, Array]:
    size, y, p_y = (finite_array(v, name) for v, name in ((magnitude, "magnitude"), (y, "y"), (p_y, "p_y")))
    common_shape(magnitude=size, y=y, p_y=p_y)
    size, y, p_y = np.broadcast_arrays(size, y, p_y)
    if np.any(np.abs(p_y) > size):
        where = tuple(int(i) for i in np.argwhere(np.abs(p_y) > size)[0])
        raise ShapeError(f"p_y: entry {list(where)} is {p_y[where]:.9g}, beyond the momentum's size {size[where]:.9g}")
    return size, y, p_y
