"""Andoyer's variables (g, k, l, G, K, L) of a turning body, to and from attitude and momentum and Euler angles.

G is the magnitude of the angular momentum mu, K its component along the inertial third axis, L that along the body's
third axis. With cos I = K/G and cos J = L/G the attitude, body to inertial axes, is

    R = R_z(k + pi) R_x(I) R_z(g) R_x(J) R_z(l),

so that Pi = (sqrt(G^2 - L^2) sin l, sqrt(G^2 - L^2) cos l, L), and mu has the azimuth k + pi/2. g, k, l are conjugate
to G, K, L: the six are canonical on the cotangent bundle of SO(3). k is that of Bonnard et al.; Deprit's h is k + pi.
For other third axes, multiply the attitude by constant rotations first.

Singular are L = G and L = -G, where only g + l or g - l is determined, and K = G and K = -G, where only g + k or
g - k is. There l, or k, is set to 0 and g is the whole turn. Next to them the variables lose digits: attitudes are
recovered to rounding times G/sqrt(G^2 - L^2) and G/sqrt(G^2 - K^2). The rates of a body whose third axis is not
principal, undefined there, raise an error, and so does a zero momentum.

Source: Bonnard, Cots and Shcherbakova 2013, section 3.4, with theory.md B-E3, B-E4; theory.md R1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arguments import check_object, inertia_argument
from ...arrays import Array, Mask, common_batch, finite_array
from ...display import short_repr
from ...errors import AccuracyNotReached, ChartPoleError, ShapeError, WrongObjectError
from ...inertia_tensor import inverse_inertia
from ...letters import value_text
from .._arguments import check_entries, together
from ..euler_angles import NEAREST, ZXZ, ZYZ, EulerChart

_MOST_SAMPLES = 200_000  # 14 MB of attitudes; or eight times the number of times given, if that is more


class TurningBody(Protocol):
    """Anything with an attitude and a body momentum at given times: an `EulerTop`, the `Motion` of `reconstruct`.

    Examples
    --------
    >>> top = sp.EulerTop.principal([3.0, 2.0, 1.0], [1.5, 0.3, 0.4])
    >>> top.attitude(0.0).shape, top.body_momentum(0.0).round(9).tolist()  # what is needed of it
    ((3, 3), [1.5, 0.3, 0.4])
    """

    def attitude(self, t: Array, /) -> Array:
        """R(t), body to inertial axes: (N,) -> (..., N, 3, 3)."""
        ...

    def body_momentum(self, t: Array, /) -> Array:
        """Pi(t): (N,) -> (..., N, 3) [kg m^2/s]."""
        ...


@dataclass(frozen=True, eq=False)
class AndoyerVariables:
    """Andoyer's g, k, l [rad] and the momenta conjugate to them [kg m^2/s], which broadcast together.

    Raises ShapeError if their shapes do not go together, an entry is not finite, G is not above 0, or |L| or |K| is
    above G.

    Examples
    --------
    >>> state = sp.rigid_body.geodesics.andoyer_variables(np.eye(3), [0.3, 0.4, 1.2])
    >>> print(f"{state.hamiltonian(np.diag([1.0, 2.0, 4.0])):.9f}, {0.3**2 / 2 + 0.4**2 / 4 + 1.2**2 / 8:.9f}")
    0.265000000, 0.265000000
    """

    g: Array  #: Angle conjugate to G [rad].
    k: Array  #: Angle conjugate to K [rad].
    l: Array  # noqa: E741
    """Angle conjugate to L [rad]."""
    total: Array
    """G, conjugate to g: |mu|."""
    vertical: Array
    """K, conjugate to k: the component along the inertial third axis."""
    axial: Array
    """L, conjugate to l: the component along the body's third axis."""

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for name, value in zip(list(vars(self)), together(**vars(self)), strict=True):
            object.__setattr__(self, name, value)
        check_entries(self.total <= 0.0, self.total, "total", "G must be above 0")
        for name, value in (("vertical", self.vertical), ("axial", self.axial)):
            check_entries(np.abs(value) > self.total, value, name, "K and L must be between -G and G")

    @property
    def is_regular(self) -> Mask:
        """True where they are regular: the momentum has more than 1e-8 of G across both third axes."""
        return (self._across > NEAREST * self.total) & (self._level > NEAREST * self.total)

    @property
    def body_momentum(self) -> Array:
        """Pi: (..., 3), body axes [kg m^2/s]. Singular cases included. Source: Bonnard et al., before (5)."""
        across = self._across
        return np.stack([across * np.sin(self.l), across * np.cos(self.l), self.axial], axis=-1)

    @property
    def spatial_momentum(self) -> Array:
        """mu: (..., 3), inertial axes [kg m^2/s]. Singular cases included."""
        level = self._level
        return np.stack([-level * np.sin(self.k), level * np.cos(self.k), self.vertical], axis=-1)

    @property
    def attitude(self) -> Array:
        """R, body to inertial axes: (..., 3, 3). Singular cases included."""
        outward = _vertical_frame(self.k, np.arctan2(self._level, self.vertical))
        return outward @ _turn(self.g, 0, 1) @ _body_frame(np.arctan2(self._across, self.axial), self.l)

    def euler_angles(self, chart: EulerChart = ZYZ) -> tuple[Array, Array]:
        """Euler angles (phi, theta, psi) in [rad] and their momenta: two (..., 3).

        p_phi = K and p_psi = L in both charts, `ZYZ` of Bonnard et al. and `ZXZ` of Marsden and Ratiu.

        Source: Bonnard et al., section 3.4, the complete relations, of which the last is for phi_3 (theory.md B-E4).

        Raises ChartPoleError within 1e-8 of a pole of the chart, where the two third axes are parallel. The inverse is
        `andoyer_from_euler`.
        """
        angles = chart.angles(self.attitude)
        return angles, chart.conjugate_momenta(angles, self.body_momentum)

    def hamiltonian(self, inertia: ArrayLike) -> Array:
        """The energy Pi.I^-1 Pi/2 of a body of this inertia: (..., 3, 3) [kg m^2, body axes] -> (...) [J].

        Source: Bonnard et al. (5), there in principal axes.
        """
        momentum = self.body_momentum
        return 0.5 * np.sum(momentum * so3.apply(self._inverse(inertia), momentum), axis=-1)

    def rates(self, inertia: ArrayLike) -> tuple[Array, Array, Array]:
        """g', l' [rad/s] and L' [kg m^2/s^2] of free motion; k, G and K are constant: (..., 3, 3) -> three (...).

        Source: Bonnard et al. (8), there in principal axes.

        Raises ChartPoleError at L = +-G, to 1e-8 of the momentum, if the body's third axis is not principal: l has no
        rate there.
        """
        inverse = self._inverse(inertia)
        sine, cosine, across, along = np.sin(self.l), np.cos(self.l), self._across, self.axial
        zero = np.zeros(across.shape)
        ahead, aside = np.stack([sine, cosine, zero], -1), np.stack([cosine, -sine, zero], -1)
        column, third = so3.apply(inverse, ahead), inverse[..., 2, 2]
        own, mixed = np.sum(column * ahead, axis=-1), column[..., 2]
        requirement = (
            f"the momentum is along the body's third axis to {NEAREST:g}, where l has no rate unless that axis is "
            "principal; turn the body axes, so that another axis is the third"
        )
        undefined = (across <= NEAREST * self.total) & np.any(inverse[..., 2, :2] != 0.0, axis=-1)
        check_entries(undefined, np.broadcast_to(along, undefined.shape), "axial", requirement, ChartPoleError)
        part = np.where(mixed == 0.0, 0.0, along * mixed / np.where(across > 0.0, across, 1.0))
        twist = across**2 * np.sum(column * aside, axis=-1) + across * along * np.sum(aside * inverse[..., 2], axis=-1)
        return self.total * (own + part), along * (third - own - part) + across * mixed, -twist

    @property
    def _across(self) -> Array:
        return np.sqrt((self.total - self.axial) * (self.total + self.axial))

    @property
    def _level(self) -> Array:
        return np.sqrt((self.total - self.vertical) * (self.total + self.vertical))

    def _inverse(self, inertia: ArrayLike) -> Array:
        tensor = inertia_argument(finite_array(inertia, "inertia", (3, 3), unit="kg m^2"))
        common_batch(inertia=tensor.shape[:-2], variables=self.l.shape)
        return inverse_inertia(tensor)


def andoyer_variables(attitude: ArrayLike, body_momentum: ArrayLike) -> AndoyerVariables:
    """Andoyer's variables of a state, the angles in (-pi, pi]: (..., 3, 3), (..., 3) -> (...) each.

    Raises ShapeError if an argument is not a rotation or not a finite vector, or a momentum is zero.

    Parameters
    ----------
    attitude : (..., 3, 3) body to inertial axes
    body_momentum : (..., 3) Pi = R^T mu, body axes [kg m^2/s]

    Examples
    --------
    >>> state = sp.rigid_body.geodesics.andoyer_variables(np.eye(3), [0.3, 0.4, 1.2])
    >>> print(f"{state.total:.9f} {state.axial:.9f}")
    1.300000000 1.200000000
    """
    rotation = so3.rotation_argument(attitude, "attitude")
    momentum = finite_array(body_momentum, "body_momentum", (3,), unit="kg m^2/s")
    shape = common_batch(attitude=rotation.shape[:-2], body_momentum=momentum.shape[:-1])
    momentum = np.broadcast_to(momentum, (*shape, 3))
    total, vertical, azimuth, tilt = _outer(so3.apply(rotation, momentum), "body_momentum")
    across = np.hypot(momentum[..., 0], momentum[..., 1])
    # Adding zero takes the sign off a zero, of which arctan2 would make half a turn.
    inner = np.arctan2(momentum[..., 0] + 0.0, momentum[..., 1] + 0.0)
    inward = _body_frame(np.arctan2(across, momentum[..., 2]), inner)
    middle = so3.transpose(_vertical_frame(azimuth, tilt)) @ rotation @ so3.transpose(inward)
    turn = np.arctan2(middle[..., 1, 0] - middle[..., 0, 1], middle[..., 0, 0] + middle[..., 1, 1])
    # G was rounded in inertial axes; next to the pole G - |L| has to keep its digits.
    magnitude = np.abs(momentum[..., 2])
    axial = np.where(magnitude > across, total - across**2 / (total + magnitude), magnitude)
    axial = np.copysign(axial, momentum[..., 2])
    return AndoyerVariables(so3.wrap(turn), so3.wrap(azimuth), so3.wrap(inner), total, vertical, axial)


def andoyer_from_euler(angles: ArrayLike, momenta: ArrayLike, chart: EulerChart = ZYZ) -> AndoyerVariables:
    """Andoyer's variables of Euler angles (phi, theta, psi) and their momenta: (..., 3), (..., 3) -> (...) each.

    Raises ChartPoleError within 1e-8 of a pole of the chart, ShapeError if a momentum is zero.

    Examples
    --------
    >>> state = sp.rigid_body.geodesics.andoyer_from_euler([0.1, 1.0, 0.2], [1.2, 0.1, 0.3])
    >>> print(f"{state.vertical:.9f} {state.axial:.9f}")
    1.200000000 0.300000000
    """
    check_object(chart, "EulerChart", "chart")
    return andoyer_variables(chart.attitude(angles), chart.body_momentum(angles, momenta))


def andoyer_motion(motion: TurningBody, t: ArrayLike) -> AndoyerVariables:
    """Andoyer's variables along a motion without torque, g and l unwrapped: times (N,) -> (..., N) each.

    In (-pi, pi] at the first time. When Pi has returned and l has gained 2 pi n, the gain of g is the angle by which
    the body has turned about mu, from which the Montgomery phase follows. Past L = G only g + l, past L = -G only g - l
    is followed reliably, and g and l may gain half turns there that leave the attitude unchanged. Between the times
    given the motion is sampled more densely, until it turns by less than a radian from one sample to the next.

    Equation :eq:`andoyer-energy` of the documentation.
    Source: Cabrera 2006 (13) for the phase; theory.md R1.

    Parameters
    ----------
    motion : with `attitude(t)` and `body_momentum(t)`: an `EulerTop`, or a `Motion`, also of a deforming body
    t : (N,) times in order, forward or backward; between two of them the body turns less than a few turns [s]

    Raises
    ------
    AccuracyNotReached
        If the attitude jumps, or turns so often between the times that it cannot be followed.
    WrongObjectError
        If the motion has no `attitude` or `body_momentum`.
    ShapeError
        If the times are not in strict order.

    Examples
    --------
    >>> top = sp.EulerTop.principal([3.0, 2.0, 1.0], [1.5, 0.3, 0.4])
    >>> state = sp.rigid_body.geodesics.andoyer_motion(top, [0.0, top.period])
    >>> print(state.total.round(9), f"{state.g[1] - state.g[0]:.6f}")
    [1.58113883 1.58113883] 7.508599
    """
    if not (hasattr(motion, "attitude") and hasattr(motion, "body_momentum")):
        raise WrongObjectError(f"motion: a Motion or an EulerTop is needed, got {value_text(motion)}")
    times = finite_array(t, "t", (None,), unit="s")
    if times.ndim != 1 or not times.size or not (np.all(np.diff(times) > 0.0) or np.all(np.diff(times) < 0.0)):
        raise ShapeError(f"t: a list (N,) of times in strict order, at least one, is needed, got shape {times.shape}")
    if times.size == 1:
        return andoyer_variables(motion.attitude(times), motion.body_momentum(times))
    dense, attitudes = _close_samples(motion, times)
    here = slice(None, None, (dense.size - 1) // (times.size - 1))
    momentum = motion.body_momentum(times)
    spatial = so3.apply(attitudes[..., here, :, :], momentum).mean(axis=-2, keepdims=True)
    total, vertical, azimuth, tilt = _outer(spatial, "motion")
    about = so3.transpose(_vertical_frame(azimuth, tilt)) @ attitudes
    angles = ZXZ.continuous_angles(about)[..., here, :]
    start = angles[..., :1, :]
    angles = angles + (so3.wrap(start) - start)
    axial = np.clip(momentum[..., 2], -total, total)
    return AndoyerVariables(angles[..., 0], so3.wrap(azimuth), angles[..., 2], total, vertical, axial)


def _close_samples(motion: TurningBody, times: Array) -> tuple[Array, Array]:
    """Times, evenly spaced between those given, dense enough to follow the attitudes, and these attitudes."""
    steps, before, parts = np.diff(times), np.inf, 1
    while True:
        inner = times[:-1, None] + steps[:, None] * (np.arange(parts) / parts)
        dense = np.append(inner.ravel(), times[-1])
        attitudes = motion.attitude(dense)
        turned = so3.angle(so3.transpose(attitudes[..., :-1, :, :]) @ attitudes[..., 1:, :, :])
        largest = float(np.max(turned, initial=0.0))
        # On one grid whole turns from one sample to the next would show as none: half the step must turn by half.
        if before < 1.0 and largest < 0.7 * before + 1e-9:
            return dense, attitudes
        before = largest
        if dense.size > max(_MOST_SAMPLES, 8 * times.size):
            raise AccuracyNotReached(
                f"motion: from one of {dense.size} samples to the next it still turns by {largest:.2g} rad; "
                "the attitude jumps, or the times are too far apart; give times closer together"
            )
        parts *= 2


def _outer(spatial: Array, name: str) -> tuple[Array, Array, Array, Array]:
    """G, K, k and I of the momentum in inertial axes."""
    zero = np.all(spatial == 0.0, axis=-1)
    check_entries(zero, spatial, name, "a momentum of zero has no direction, and no such variables")
    x, y, vertical = np.moveaxis(spatial, -1, 0)
    level = np.hypot(x, y)
    total = np.maximum(np.hypot(level, vertical), np.abs(vertical))
    return total, vertical, np.arctan2(0.0 - x, y + 0.0), np.arctan2(level, vertical)


def _vertical_frame(azimuth: Array, tilt: Array) -> Array:
    """R_z(azimuth + pi) R_x(tilt), whose third axis is that of the momentum."""
    return _turn(azimuth, 0, 1) @ _turn(-tilt, 1, 2) * np.array([-1.0, -1.0, 1.0])


def _body_frame(tilt: Array, angle: Array) -> Array:
    """R_x(tilt) R_z(angle)."""
    return _turn(tilt, 1, 2) @ _turn(angle, 0, 1)


def _turn(angle: Array, i: int, j: int) -> Array:
    angle = np.asarray(angle)
    matrix = np.zeros((*angle.shape, 3, 3))
    matrix[...] = np.eye(3)
    matrix[..., i, i] = matrix[..., j, j] = np.cos(angle)
    matrix[..., j, i] = np.sin(angle)
    matrix[..., i, j] = -matrix[..., j, i]
    return matrix
