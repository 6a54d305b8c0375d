"""Euler angles of the free rigid body: attitudes, rates, conjugate momenta, energy and Hamilton's equations.

Both charts of SO(3) are computed by the same formulas. Angles are (phi, theta, psi) in the order of the factors of the
attitude: `ZXZ`, R = R_z(phi) R_x(theta) R_z(psi), of Marsden and Ratiu, and `ZYZ`, R = R_z(phi) R_y(theta) R_z(psi), of
Bonnard et al. (their phi_1, phi_2, phi_3). They differ in the axis of the middle turn only, the line of nodes.

A chart is regular for 0 < theta < pi. At its poles, theta = 0 and pi, phi and psi turn about one line: an attitude
still has angles there (see `EulerChart.angles`), and rates still give an angular velocity; but some velocities have no
rates, and (phi, theta, psi) and their momenta are not coordinates.

Sources: Marsden and Ratiu, sections 15.6 and 15.7 (whose (15.6.6) gives the inverse of the attitude); Bonnard, Cots and
Shcherbakova 2013, section 3.3 (whose H_3 has the wrong sign); theory.md J1 to J10.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import inertia_argument
from ..arrays import Array, Mask, common_batch, finite_array
from ..display import short_repr
from ..errors import ChartPoleError, ShapeError
from ..inertia_tensor import inverse_inertia
from ._arguments import check_entries

NEAREST = 1e-8  # sine of theta up to which angles are not coordinates: dividing by it costs half of the sixteen digits
_AT_POLE = 1e-15  # sine of half the angle to a pole, up to which an attitude is at it: that of rounding


@dataclass(frozen=True)
class EulerChart:
    """Euler angles (phi, theta, psi) with R = R_z(phi) R_node(theta) R_z(psi); use `ZXZ` or `ZYZ`.

    Rates and momenta of given vectors, and what is made of momenta, need coordinates and raise `ChartPoleError` within
    1e-8 of a pole.

    Examples
    --------
    >>> turn = sp.rigid_body.ZXZ.attitude([0.1, 0.2, 0.3])
    >>> print(sp.rigid_body.ZXZ.angles(turn).round(9))
    [0.1 0.2 0.3]
    """

    name: str  #: "ZXZ" or "ZYZ".
    node: tuple[float, float]
    """The x and y components of the axis of the middle turn."""

    __repr__ = short_repr

    def attitude(self, angles: ArrayLike) -> Array:
        """The rotation from body to inertial axes: (..., 3) [rad] -> (..., 3, 3). Any real angles, poles included.

        Source: Marsden and Ratiu (15.6.1-5), R = P^T; Bonnard et al., section 3.3.
        """
        phi, theta, psi = np.moveaxis(finite_array(angles, "angles", (3,), unit="rad"), -1, 0)
        half_sum, half_difference, half = 0.5 * (phi + psi), 0.5 * (phi - psi), 0.5 * theta
        tilt = np.sin(half)[..., None] * self._node(half_difference)[..., :2]
        turn = np.cos(half)[..., None] * np.stack([np.sin(half_sum), np.cos(half_sum)], axis=-1)
        return so3.matrix_from_quat(np.concatenate([tilt, turn], axis=-1))

    def angles(self, attitude: ArrayLike) -> Array:
        """Angles of an attitude, theta in [0, pi], phi and psi in (-pi, pi]: (..., 3, 3) -> (..., 3) [rad].

        At a pole, to rounding, theta is exactly 0 or pi (as rounded), psi is 0 and phi takes the whole turn: there the
        attitude determines phi + psi, or at pi phi - psi, alone.
        """
        half_sum, half_difference, theta, pole = self._half_angles(attitude)
        half_sum = np.where(pole & (theta > 0.0), half_difference, half_sum)
        half_difference = np.where(pole & (theta == 0.0), half_sum, half_difference)
        return np.stack([so3.wrap(half_sum + half_difference), theta, so3.wrap(half_sum - half_difference)], axis=-1)

    def continuous_angles(self, attitudes: ArrayLike) -> Array:
        """Angles of successive attitudes, phi and psi unwrapped along them: (..., N, 3, 3) -> (..., N, 3) [rad].

        phi + psi and phi - psi are each followed to the nearest value. Next to theta = 0 only the first, next to pi
        only the second is well determined, and there phi and psi may jump by half turns that do not change the
        attitude. Samples at a pole keep the other combination from the sample before. Successive attitudes must be
        less than half a turn apart.

        Raises ShapeError if there is no axis of samples, or a matrix is not a rotation.
        """
        matrices = finite_array(attitudes, "attitudes", (None, 3, 3))
        if matrices.shape[-3] == 0:
            return np.zeros(matrices.shape[:-1])
        half_sum, half_difference, theta, pole = self._half_angles(matrices)
        quat = so3.quat_from_matrix(matrices)
        flips = np.sum(quat[..., 1:, :] * quat[..., :-1, :], axis=-1) < 0.0
        flipped = np.cumsum(np.pad(flips, [(0, 0)] * (flips.ndim - 1) + [(1, 0)]), axis=-1) % 2 == 1
        # The other sign of a quaternion adds a half turn to both half sums.
        half_sum = np.unwrap(
            _filled_forward(half_sum + np.pi * flipped, pole & (theta > 0.0), half_difference), axis=-1
        )
        half_difference = np.unwrap(
            _filled_forward(half_difference + np.pi * flipped, pole & (theta == 0.0), half_sum[..., :1]), axis=-1
        )
        return np.stack([half_sum + half_difference, theta, half_sum - half_difference], axis=-1)

    def is_regular(self, angles: ArrayLike) -> Mask:
        """True where the angles are coordinates, further than 1e-8 from a pole: (..., 3) -> (...).

        Source: Marsden and Ratiu, end of section 15.6; theory.md J8.
        """
        return np.abs(np.sin(finite_array(angles, "angles", (3,), unit="rad")[..., 1])) > NEAREST

    def body_rate_matrix(self, angles: ArrayLike) -> Array:
        """B with Omega = B (phi', theta', psi') in body axes: (..., 3) -> (..., 3, 3), |det B| = |sin theta|.

        Its columns are the inertial third axis, the line of nodes and the body's third axis, in body axes.
        Source: Marsden and Ratiu (15.7.1).
        """
        angles = finite_array(angles, "angles", (3,), unit="rad")
        node, across, sine, cosine = self._body_frame(angles)
        third = np.broadcast_to([0.0, 0.0, 1.0], node.shape)
        return np.stack([sine * across + cosine * third, node, third], axis=-1)

    def spatial_rate_matrix(self, angles: ArrayLike) -> Array:
        """B with omega = B (phi', theta', psi') in inertial axes: (..., 3) -> (..., 3, 3).

        Source: Marsden and Ratiu (15.7.1), whose omega has spatial components.
        """
        angles = finite_array(angles, "angles", (3,), unit="rad")
        node = self._node(angles[..., 0])
        sine, cosine = np.sin(angles[..., 1:2]), np.cos(angles[..., 1:2])
        third = np.broadcast_to([0.0, 0.0, 1.0], node.shape)
        return np.stack([third, node, cosine * third - sine * _across(node)], axis=-1)

    def body_angular_velocity(self, angles: ArrayLike, rates: ArrayLike) -> Array:
        """Omega [rad/s, body axes] of the rates of the angles: (..., 3), (..., 3) -> (..., 3). Poles included."""
        angles, rates = _pair(angles, rates, "rates", "rad/s")
        return so3.apply(self.body_rate_matrix(angles), rates)

    def spatial_angular_velocity(self, angles: ArrayLike, rates: ArrayLike) -> Array:
        """omega [rad/s, inertial axes] of the rates of the angles: (..., 3), (..., 3) -> (..., 3). Poles included."""
        angles, rates = _pair(angles, rates, "rates", "rad/s")
        return so3.apply(self.spatial_rate_matrix(angles), rates)

    def rates(self, angles: ArrayLike, angular_velocity: ArrayLike) -> Array:
        """(phi', theta', psi') of an angular velocity in body axes: (..., 3), (..., 3) -> (..., 3) [rad/s]."""
        angles, velocity = _pair(angles, angular_velocity, "angular_velocity", "rad/s")
        self._refuse_poles(angles)
        node, across, sine, cosine = self._body_frame(angles)
        phi_rate = _dot(across, velocity) / sine[..., 0]
        return np.stack([phi_rate, _dot(node, velocity), velocity[..., 2] - cosine[..., 0] * phi_rate], axis=-1)

    def rates_from_spatial(self, angles: ArrayLike, angular_velocity: ArrayLike) -> Array:
        """(phi', theta', psi') of an angular velocity in inertial axes: (..., 3), (..., 3) -> (..., 3) [rad/s]."""
        angles, velocity = _pair(angles, angular_velocity, "angular_velocity", "rad/s")
        self._refuse_poles(angles)
        node = self._node(angles[..., 0])
        psi_rate = -_dot(_across(node), velocity) / np.sin(angles[..., 1])
        phi_rate = velocity[..., 2] - np.cos(angles[..., 1]) * psi_rate
        return np.stack([phi_rate, _dot(node, velocity), psi_rate], axis=-1)

    def conjugate_momenta(self, angles: ArrayLike, body_momentum: ArrayLike) -> Array:
        """(p_phi, p_theta, p_psi) of a body momentum Pi: (..., 3), (..., 3) -> (..., 3) [kg m^2/s].

        p_phi is the component of the momentum along the inertial third axis, p_psi that along the body's, p_theta that
        along the line of nodes.

        Source: Marsden and Ratiu (15.7.3).
        """
        angles, momentum = _pair(angles, body_momentum, "body_momentum", "kg m^2/s")
        self._refuse_poles(angles)
        return so3.apply(so3.transpose(self.body_rate_matrix(angles)), momentum)

    def body_momentum(self, angles: ArrayLike, momenta: ArrayLike) -> Array:
        """Pi of (p_phi, p_theta, p_psi), the inverse of `conjugate_momenta`: (..., 3), (..., 3) -> (..., 3) [kg m^2/s].

        Source: Marsden and Ratiu (15.7.4); for ZYZ the brackets in Bonnard et al., proposition 6.
        """
        angles, momenta = _pair(angles, momenta, "momenta", "kg m^2/s")
        self._refuse_poles(angles)
        node, across, sine, cosine = self._body_frame(angles)
        p_phi, p_theta, p_psi = momenta[..., 0:1], momenta[..., 1:2], momenta[..., 2:3]
        return p_theta * node + (p_phi - p_psi * cosine) / sine * across + p_psi * np.array([0.0, 0.0, 1.0])

    def body_momentum_jacobian(self, angles: ArrayLike, momenta: ArrayLike) -> Array:
        """The derivatives of Pi by (phi, theta, psi, p_phi, p_theta, p_psi): (..., 3), (..., 3) -> (..., 3, 6).

        With D = [[0, 1], [-1, 0]] and this matrix M, M D M^T = hat(Pi): Pi as a function of angles and momenta takes
        the canonical bracket to the minus Lie-Poisson bracket.

        Source: Marsden and Ratiu, exercise 15.7-1.
        """
        angles, momenta = _pair(angles, momenta, "momenta", "kg m^2/s")
        self._refuse_poles(angles)
        node, across, sine, cosine = self._body_frame(angles)
        momentum = self.body_momentum(angles, momenta)
        third = np.broadcast_to([0.0, 0.0, 1.0], node.shape)
        slope = (momenta[..., 2:3] - momenta[..., 0:1] * cosine) / sine**2
        by_angles = [np.zeros(node.shape), slope * across, np.cross(momentum, third)]
        return np.stack([*by_angles, across / sine, node, third - cosine / sine * across], axis=-1)

    def kinetic_energy(self, inertia: ArrayLike, angles: ArrayLike, rates: ArrayLike) -> Array:
        """Omega.I Omega / 2 of angles and their rates: (..., 3, 3), (..., 3), (..., 3) -> (...) [J]. Poles included.

        Source: Marsden and Ratiu (15.3.3) with (15.7.2).
        """
        angles, rates = _pair(angles, rates, "rates", "rad/s")
        tensor = _inertia(inertia, angles)
        velocity = self.body_angular_velocity(angles, rates)
        return 0.5 * _dot(velocity, so3.apply(tensor, velocity))

    def hamiltonian(self, inertia: ArrayLike, angles: ArrayLike, momenta: ArrayLike) -> Array:
        """The kinetic energy of angles and conjugate momenta: (..., 3, 3), (..., 3), (..., 3) -> (...) [J].

        Source: Marsden and Ratiu (15.7.5), (15.7.6); Bonnard et al., proposition 6.
        """
        momentum = self.body_momentum(angles, momenta)
        inverse = inverse_inertia(_inertia(inertia, momentum))
        return 0.5 * _dot(momentum, so3.apply(inverse, momentum))

    def hamilton_equations(self, inertia: ArrayLike, angles: ArrayLike, momenta: ArrayLike) -> tuple[Array, Array]:
        """Rates of the angles and of their momenta in free motion: (..., 3, 3), (..., 3), (..., 3) -> two (..., 3).

        [rad/s], [kg m^2/s^2]; the inertia [kg m^2] in body axes.

        Source: Marsden and Ratiu, section 15.7, Hamilton's canonical equations.
        """
        angles, momenta = _pair(angles, momenta, "momenta", "kg m^2/s")
        momentum = self.body_momentum(angles, momenta)
        velocity = so3.apply(inverse_inertia(_inertia(inertia, momentum)), momentum)
        gradient = np.einsum("...i,...ij->...j", velocity, self.body_momentum_jacobian(angles, momenta))
        return gradient[..., 3:], -gradient[..., :3]

    def angles_about_momentum(self, body_momentum: ArrayLike) -> Array:
        """(theta, psi) when the inertial third axis is along the momentum: (..., 3) -> (..., 2) [rad].

        The two angles that Pi alone determines; phi advances by `precession_rate`. At a pole psi is 0.

        Source: Bonnard et al., before (4), with H_3 = +|H| cos phi_2; theory.md B-E3.
        Raises ShapeError if a momentum is zero.
        """
        momentum = finite_array(body_momentum, "body_momentum", (3,), unit="kg m^2/s")
        if np.any(np.all(momentum == 0.0, axis=-1)):
            raise ShapeError("body_momentum: a zero momentum has no direction; give one that is not zero")
        x, y = self.node
        theta = np.arctan2(np.hypot(momentum[..., 0], momentum[..., 1]), momentum[..., 2])
        along, over = x * momentum[..., 1] - y * momentum[..., 0], x * momentum[..., 0] + y * momentum[..., 1]
        # Adding zero takes the sign off a zero, of which arctan2 would make half a turn.
        return np.stack([theta, np.arctan2(over + 0.0, along + 0.0)], axis=-1)

    def _half_angles(self, attitude: ArrayLike) -> tuple[Array, Array, Array, Mask]:
        """(phi + psi)/2, (phi - psi)/2, theta, and whether the attitude is at a pole."""
        x, y, z, w = np.moveaxis(so3.quat_from_matrix(so3.rotation_argument(attitude, "attitude")), -1, 0)
        a, b = self.node
        tilt, turn = np.hypot(x, y), np.hypot(z, w)
        theta = np.where(tilt < _AT_POLE, 0.0, np.where(turn < _AT_POLE, np.pi, 2.0 * np.arctan2(tilt, turn)))
        pole = np.minimum(tilt, turn) < _AT_POLE
        return np.arctan2(z, w), np.arctan2(a * y - b * x, a * x + b * y), theta, pole

    def _node(self, angle: Array) -> Array:
        """The axis of the middle turn, turned about the third axis: (...) -> (..., 3)."""
        (x, y), sine, cosine = self.node, np.sin(angle), np.cos(angle)
        return np.stack([x * cosine - y * sine, x * sine + y * cosine, np.zeros_like(sine)], axis=-1)

    def _body_frame(self, angles: Array) -> tuple[Array, Array, Array, Array]:
        """The line of nodes and the horizontal axis across it, in body axes; sine and cosine of theta (..., 1)."""
        node = self._node(-angles[..., 2])
        return node, _across(node), np.sin(angles[..., 1:2]), np.cos(angles[..., 1:2])

    def _refuse_poles(self, angles: Array) -> None:
        theta = angles[..., 1]
        requirement = (
            f"a pole of the {self.name.upper()} chart to {NEAREST:g}, where the angles are not coordinates; turn the "
            "inertial or the body axes by a constant rotation, or use attitudes and body momenta"
        )
        check_entries(np.abs(np.sin(theta)) <= NEAREST, theta, "theta", requirement, ChartPoleError)


ZXZ = EulerChart("zxz", (1.0, 0.0))  # R = R_z(phi) R_x(theta) R_z(psi): Marsden and Ratiu, section 15.6
ZYZ = EulerChart("zyz", (0.0, 1.0))  # R = R_z(phi) R_y(theta) R_z(psi): Bonnard et al., section 3.3


def precession_rate(body_momentum: ArrayLike, angular_velocity: ArrayLike) -> Array:
    """phi', the rate at which the body's third axis turns about the momentum: (..., 3), (..., 3) -> (...) [rad/s].

    Both charts have the same, for the inertial third axis along the momentum.

    Source: Bonnard et al. (4), its last form, which needs no distinction of cases.
    Raises ChartPoleError if the body's third axis is within 1e-8 of the momentum's line.

    Examples
    --------
    >>> print(sp.rigid_body.precession_rate([3.0, 0.0, 4.0], [1.5, 0.0, 4.0]))  # of moments 2, 2, 1: 5/2
    2.5
    """
    momentum, velocity = _pair(body_momentum, angular_velocity, "angular_velocity", "rad/s", first="body_momentum")
    magnitude = np.linalg.norm(momentum, axis=-1)
    across = np.hypot(momentum[..., 0], momentum[..., 1])
    requirement = (
        "along it, the azimuth of the body's third axis is undefined; turn the body axes to have another third"
    )
    check_entries(across <= NEAREST * magnitude, momentum, "body_momentum", requirement, ChartPoleError)
    unit = momentum[..., :2] / across[..., None]
    return magnitude * _dot(unit, velocity[..., :2]) / across


def canonical_bracket(gradient_f: ArrayLike, gradient_g: ArrayLike) -> Array:
    """{F, G} = F_q.G_p - F_p.G_q from gradients by n coordinates and their n momenta: (..., 2n), (..., 2n) -> (...).

    Source: Marsden and Ratiu (15.7.7).
    Raises ShapeError if the gradients have different or odd lengths.

    Examples
    --------
    >>> sp.rigid_body.canonical_bracket([1.0, 0.0], [0.0, 1.0]).item()  # {q, p}
    1.0
    """
    first = finite_array(gradient_f, "gradient_f", (None,))
    second = finite_array(gradient_g, "gradient_g", (None,))
    count = first.shape[-1]
    if count != second.shape[-1] or count % 2:
        raise ShapeError(
            f"gradient_f, gradient_g: expected 2n entries each, coordinates before momenta, "
            f"got {count} and {second.shape[-1]}"
        )
    common_batch(gradient_f=first.shape[:-1], gradient_g=second.shape[:-1])
    n = count // 2
    return _dot(first[..., :n], second[..., n:]) - _dot(first[..., n:], second[..., :n])


def _pair(angles: ArrayLike, other: ArrayLike, name: str, unit: str, first: str = "angles") -> tuple[Array, Array]:
    """Two checked arguments (..., 3), broadcast together."""
    left = finite_array(angles, first, (3,), unit="rad" if first == "angles" else "kg m^2/s")
    right = finite_array(other, name, (3,), unit=unit)
    shape = common_batch(**{first: left.shape[:-1], name: right.shape[:-1]})
    return np.broadcast_to(left, (*shape, 3)), np.broadcast_to(right, (*shape, 3))


def _inertia(inertia: ArrayLike, vectors: Array) -> Array:
    tensor = inertia_argument(finite_array(inertia, "inertia", (3, 3), unit="kg m^2"))
    common_batch(inertia=tensor.shape[:-2], angles=vectors.shape[:-1])
    return tensor


def _filled_forward(values: Array, unknown: Mask, start: Array) -> Array:
    """The last known value in place of each unknown one; `start` holds the first, should that be unknown."""
    filled = np.where(unknown & (np.arange(values.shape[-1]) == 0), start[..., :1], values)
    known = np.where(unknown, 0, np.arange(values.shape[-1]))
    return np.take_along_axis(filled, np.maximum.accumulate(known, axis=-1), axis=-1)


def _across(node: Array) -> Array:
    """e_3 x node."""
    return np.stack([-node[..., 1], node[..., 0], node[..., 2]], axis=-1)


def _dot(a: Array, b: Array) -> Array:
    return np.sum(a * b, axis=-1)
