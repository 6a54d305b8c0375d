"""The free rigid body as a pendulum in Serret and Andoyer's variables (y, p_y).

With G the magnitude of the body momentum Pi and the principal moments ascending, I_1 < I_2 < I_3,

    Pi_3 = sqrt(G^2 - p_y^2) sin(y),  -Pi_2 = sqrt(G^2 - p_y^2) cos(y),  Pi_1 = p_y.

y and p_y are canonically conjugate on the sphere of momenta. Along axis 3, at y = pi/2, is the stable equilibrium of
the (y, p_y) plane, along axis 2, at y = 0 and pi, the unstable one; momenta along axis 1, p_y = G and -G, have no y.

Moments may be in any order: axes 1, 2, 3 above are the caller's by ascending moment, axis 2 reversed where that order
is left-handed. Bonnard et al. number the axes by descending moments: their H_1, H_2, H_3 are our Pi_3, -Pi_2, Pi_1 (the
sign keeps the frame right-handed). p_y is L itself, with y' = p_y (a_1 - w) as in the paper's (8); the geodesics of
`serret_andoyer` begin with p_y below 0, see there.

Source: Bonnard, Cots and Shcherbakova 2013, sections 3.4 and 3.5; theory.md N12.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import moments_argument
from ..arrays import Array, finite_array
from ..display import short_repr
from ..errors import ShapeError
from ..inertia_tensor import ascending_moments
from ._arguments import check_entries, together
from .pendulum import RigidBodyPendulum, rigid_body_pendulum

_REGIME_NAMES = {"libration": "oscillating", "rotation": "rotating"}  # the paper's names, where they differ


@dataclass(frozen=True, eq=False)
class AndoyerPendulum:
    """Reduced free rigid body in the (y, p_y) plane. Made by `andoyer_pendulum`."""

    moments: Array
    """(3,) principal moments about the caller's axes 1, 2, 3 [kg m^2]."""

    __repr__ = short_repr

    def coordinates(self, momentum: ArrayLike) -> tuple[Array, Array, Array]:
        """G, y in (-pi, pi] and p_y of body momenta: (..., 3) -> (...), (...) [rad], (...) [kg m^2/s].

        Source: Bonnard et al., before (5).
        Raises ShapeError if a momentum is along the axis of the smallest moment, where y is undefined, or is not three
        finite numbers.
        """
        pi = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
        order, parity = self._axes
        smallest, middle, largest = np.moveaxis(pi[..., order], -1, 0)
        along = (largest == 0.0) & (middle == 0.0)
        check_entries(along, pi, "momentum", "along the axis of the smallest moment y is undefined")
        # Adding zero takes the sign off a zero, of which arctan2 would make minus a half turn.
        return np.linalg.norm(pi, axis=-1), np.arctan2(largest + 0.0, -parity * middle), smallest

    def body_momentum(self, magnitude: ArrayLike, y: ArrayLike, p_y: ArrayLike) -> Array:
        """Pi of G, y and p_y, the inverse of `coordinates`: (...) each -> (..., 3) [kg m^2/s].

        Raises ShapeError if |p_y| is larger than G, here and in the other methods.
        """
        magnitude, y, p_y = _variables(magnitude, y, p_y)
        across = np.sqrt((magnitude - p_y) * (magnitude + p_y))
        order, parity = self._axes
        pi = np.empty((*p_y.shape, 3))
        pi[..., order] = np.stack([p_y, -parity * across * np.cos(y), across * np.sin(y)], axis=-1)
        return pi

    def hamiltonian(self, magnitude: ArrayLike, y: ArrayLike, p_y: ArrayLike) -> Array:
        """((G^2 - p_y^2)(sin^2(y)/I_3 + cos^2(y)/I_2) + p_y^2/I_1)/2, the energy: (...) each -> (...) [J].

        Source: Bonnard et al. (5), (6).
        """
        magnitude, y, p_y = _variables(magnitude, y, p_y)
        a1, a2, a3 = self._inverse
        across = a3 * np.sin(y) ** 2 + a2 * np.cos(y) ** 2
        return 0.5 * ((magnitude - p_y) * (magnitude + p_y) * across + a1 * p_y * p_y)

    def rates(self, magnitude: ArrayLike, y: ArrayLike, p_y: ArrayLike) -> tuple[Array, Array]:
        """y' [rad/s] and p_y' [kg m^2/s^2], Hamilton's equations: (...) each -> (...), (...).

        Source: Bonnard et al. (8).
        """
        magnitude, y, p_y = _variables(magnitude, y, p_y)
        a1, a2, a3 = self._inverse
        sine, cosine = np.sin(y), np.cos(y)
        y_rate = p_y * ((a1 - a3) * sine**2 + (a1 - a2) * cosine**2)
        return y_rate, (a2 - a3) * (magnitude - p_y) * (magnitude + p_y) * sine * cosine

    def square_eigenvalues(self, magnitude: ArrayLike) -> tuple[Array, Array]:
        """lambda^2 of the linearised motion at y = pi/2, negative, and at y = 0, positive: (...) -> (...), (...).

        Source: Bonnard et al., after (8).
        """
        magnitude = finite_array(magnitude, "magnitude", unit="kg m^2/s")
        a1, a2, a3 = self._inverse
        return -(a2 - a3) * (a1 - a3) * magnitude**2, (a2 - a3) * (a1 - a2) * magnitude**2

    def trajectory_type(self, momentum: ArrayLike) -> str:
        """ "oscillating" about y = pi/2 modulo pi, "rotating", "separatrix" or "equilibrium", of a momentum (3,).

        Decided in exact arithmetic of the numbers given.
        Source: Bonnard et al., proposition 7.
        """
        regime = self._pendulum.motion(momentum).regime
        return _REGIME_NAMES.get(regime, regime)

    def from_pendulum_angle(self, theta: ArrayLike) -> Array:
        """y of the angle theta of `rigid_body_pendulum`, continuous: (...) -> (...) [rad].

        That pendulum's axes are those of the largest, the middle and the smallest moment, in this order: (0, 1, 2) if
        the moments descend. cot(y) = (k_2/k_1) tan(theta) there, so that the closed solution for theta is one for y;
        where this order of the axes is odd, y belongs to -theta.
        """
        theta = finite_array(theta, "theta", unit="rad")
        pendulum = self._pendulum
        theta = -self._axes[1] * theta
        sine, cosine = np.sin(theta), np.cos(theta)
        shift = np.arctan2((pendulum.k2 - pendulum.k1) * sine * cosine, pendulum.k1 * cosine**2 + pendulum.k2 * sine**2)
        return 0.5 * np.pi - theta - shift

    @cached_property
    def _inverse(self) -> Array:
        """(3,) a_i = 1/I_i, descending."""
        return 1.0 / ascending_moments(self.moments)[0]

    @cached_property
    def _axes(self) -> tuple[NDArray[np.intp], float]:
        """(3,) indices of the caller's axes by ascending moment, and 1 if right-handed in that order, else -1."""
        _, order, parity = ascending_moments(self.moments)
        return order, float(parity)

    @property
    def _pendulum(self) -> RigidBodyPendulum:
        return rigid_body_pendulum(self.moments, self._axes[0][::-1].tolist())


def andoyer_pendulum(moments: ArrayLike) -> AndoyerPendulum:
    """The pendulum in Serret and Andoyer's variables of three different principal moments.

    Raises ShapeError if the moments are not positive, or two of them are equal.

    Parameters
    ----------
    moments : (3,) about the body axes 1, 2, 3, in any order [kg m^2]

    Examples
    --------
    >>> pendulum = sp.rigid_body.andoyer_pendulum([1.0, 2.0, 3.0])
    >>> pendulum.moments.tolist()
    [1.0, 2.0, 3.0]
    """
    values = moments_argument(moments)
    if not np.all(np.diff(np.sort(values)) > 0.0):
        raise ShapeError(f"moments: got {values}; three different moments are needed, as the definition of y needs")
    return AndoyerPendulum(moments=values)


def _variables(magnitude: ArrayLike, y: ArrayLike, p_y: ArrayLike) -> tuple[Array, Array, Array]:
    magnitude, y, p_y = together(magnitude=magnitude, y=y, p_y=p_y)
    check_entries(np.abs(p_y) > magnitude, p_y, "p_y", "that is beyond the momentum's magnitude")
    return magnitude, y, p_y
