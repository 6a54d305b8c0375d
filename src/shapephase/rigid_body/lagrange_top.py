"""The Lagrange top, I1 = I2 with the centre of mass on the axis of symmetry, and the stability of the upright spin.

The upright spin, or sleeping top, is the relative equilibrium Pi = (0, 0, p), Gamma = (0, 0, 1). In the body-fixed
variables Pi, Gamma it is an equilibrium; p is Pi_3. Mgl below 0 hangs the top from its fixed point.

Source: Marsden and Ratiu, section 15.10; theory.md M3-M9 and its errata M-E9, M-E10.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object, number_argument
from ..arrays import Array, Mask, common_batch, finite_array
from ..display import short_repr
from ..errors import ShapeError, SingularInertiaError
from ._arguments import FEW_ULPS, positive_moments
from .heavy_top import HeavyTop, heavy_top_steps

_GROWTH = 50.0  # of the tilt, up to which a simulated spin counts as stable: stable spins next to the threshold nutate
_LARGEST_TILT = 0.5 / _GROWTH  # [rad] at the start of a simulation: its growth stays far below a right angle


@dataclass(frozen=True)
class LagrangeTop:
    """A heavy top with I1 = I2 = `transverse`, I3 = `axial` [kg m^2], chi = e3 and this Mgl [J].

    Examples
    --------
    >>> top = sp.rigid_body.LagrangeTop(1.0, 0.5, 2.0)
    >>> sp.rigid_body.sleeping_top(top, 3.0).spectrally_stable  # 9 > 4 Mgl I1 = 8
    True
    """

    transverse: float
    axial: float
    mgl: float

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("transverse", "axial", "mgl"):
            object.__setattr__(self, name, number_argument(getattr(self, name), name))
        if min(self.transverse, self.axial) <= 0.0:
            raise SingularInertiaError(f"moments must be above 0, got {self.transverse:.6g}, {self.axial:.6g} kg m^2")

    @property
    def heavy_top(self) -> HeavyTop:
        """This top as a general `HeavyTop`."""
        return HeavyTop(np.diag([self.transverse, self.transverse, self.axial]), self.mgl)

    @property
    def critical_momentum(self) -> float:
        """2 sqrt(Mgl I1), above which Pi_3 is that of a fast top; 0 for a hanging one [kg m^2/s]."""
        return 2.0 * np.sqrt(max(self.mgl, 0.0) * self.transverse)


@dataclass(frozen=True)
class SleepingTop:
    """Upright spin of a Lagrange top and its stability by two methods. Made by `sleeping_top`.

    The conserved quantity is H + Phi(Pi.Gamma, |Gamma|^2) + phi(Pi_3); dots are derivatives by Pi.Gamma.
    """

    momentum: float
    """p = Pi_3 [kg m^2/s]."""
    phi_dot: float  #: Phi_dot that makes the first variation vanish.
    phi_prime: float  #: Phi' that makes it vanish.
    axial_slope: float
    """phi'(p) that makes it vanish."""
    first_variation: Array
    """(6,) gradient of the conserved quantity by (Pi, Gamma) at the equilibrium; zero."""
    second_variation: Array
    """(6, 6) its second derivative there, with phi'' = Phi_dot_dot = Phi_dot' = 0 and Phi'' large."""
    minors: Array
    """(6,) its leading principal minors: all positive if the energy-Casimir method proves stability."""
    quadratic: Array
    """(3,) coefficients, highest first, of the e-quadratic that decides (see `e_quadratic`)."""
    eigenvalues: np.ndarray
    """(4,) complex spectrum of the linearised equations on the tangent space of the coadjoint orbit [1/s]."""
    energy_casimir: bool
    """Whether the second variation is definite (stable in the sense of Liapunov)."""
    spectrally_stable: bool
    """Whether no eigenvalue has a positive real part."""
    verdict: str
    """ "stable" or "unstable". Where p^2 = 4 Mgl I1 > 0 neither method decides, but `upright_potential` does: it has a
    strict minimum there, and the spin is stable. "marginal" where p and Mgl both vanish: a top at rest without weight,
    which any momentum carries away."""

    __repr__ = short_repr


@dataclass(frozen=True)
class StabilityChart:
    """Stability of the upright spin over the ratio of moments and the spin, by three methods.

    Made by `stability_chart`.
    """

    axial_ratios: Array
    """(R,) I3/I1."""
    momenta: Array
    """(P,) Pi_3 in units of sqrt(Mgl I1); the threshold is 2."""
    energy_casimir: Mask  #: (R, P) True where the energy-Casimir method finds the spin stable.
    spectrum: Mask  #: (R, P) True where the spectrum does.
    simulation: Mask
    """(R, P) True where the simulation does."""
    largest_tilt: Array
    """(R, P) of the simulated motions [rad]."""

    __repr__ = short_repr


def sleeping_top(top: LagrangeTop, momentum: float) -> SleepingTop:
    """The upright spin with Pi_3 = `momentum` [kg m^2/s], and its stability: stable if Pi_3^2 >= 4 Mgl I1, else not.

    At equality, which the theorem leaves open, the energy has a strict minimum among the motions of the same Pi_3
    and Pi.Gamma (see `upright_potential`), and an isolated level of conserved quantities is stable.
    The free number e = -Phi_dot/p is taken where the e-quadratic is largest, at 1/(2 I1).

    Source: Marsden and Ratiu, theorem 15.10.1; D. Aeyels, Syst. Control Lett. 19 (1992) 461, for equality.

    Examples
    --------
    >>> top = sp.rigid_body.LagrangeTop(1.0, 0.5, 2.0)
    >>> [sp.rigid_body.sleeping_top(top, spin).spectrally_stable for spin in (2.8, 2.9)]  # sqrt(8) = 2.83
    [False, True]
    """
    check_object(top, "LagrangeTop", "top")
    p = number_argument(momentum, "momentum")
    i1, i3, mgl = top.transverse, top.axial, top.mgl
    phi_dot = -0.5 * p / i1
    phi_prime = -0.5 * (mgl + phi_dot * p)
    axial_slope = -(p / i3 + phi_dot)
    b = -2.0 * phi_prime + 2.0 * i3 * phi_dot**2 + abs(mgl) + p * p / i1
    second = second_variation(top, p, phi_dot, b=b)
    excess = p * p - 4.0 * mgl * i1
    at_threshold = abs(excess) <= FEW_ULPS * p * p  # `critical_momentum`, but for rounding
    stable = bool(np.all(spectrally_stable([i1, i1, i3], mgl, p)))
    return SleepingTop(
        momentum=p,
        phi_dot=phi_dot,
        phi_prime=phi_prime,
        axial_slope=axial_slope,
        first_variation=np.array(
            [0.0, 0.0, p / i3 + phi_dot + axial_slope, 0.0, 0.0, mgl + phi_dot * p + 2.0 * phi_prime]
        ),
        second_variation=second,
        minors=np.array([np.linalg.det(second[:n, :n]) for n in range(1, len(second) + 1)]),
        quadratic=e_quadratic(top, p),
        eigenvalues=sleeping_spectrum([i1, i1, i3], mgl, p),
        energy_casimir=excess > 0.0 and not at_threshold,
        spectrally_stable=stable,
        verdict=("stable" if p else "marginal") if at_threshold else "stable" if excess > 0.0 else "unstable",
    )


def upright_potential(top: LagrangeTop, momentum: float, tilt: ArrayLike) -> Array:
    """V(tilt) - V(0) of a top with Pi_3 = Pi.Gamma = `momentum`: (...) [rad] -> (...) [J].

    The energy of such motions is I1 tilt'^2/2 + V. With u = tan^2(tilt/2), V = Mgl (1 - u)/(1 + u) + p^2 u/(2 I1),
    so V - V(0) = (p^2/(2 I1) - 2 Mgl) u + 2 Mgl u^2/(1 + u). At p^2 = 4 Mgl I1 the first term vanishes and the second
    is positive: 2 Mgl u^2 - ..., a minimum of fourth order in the tilt.

    Raises ShapeError if a tilt is pi or more. Source: theory.md M6, what theorem 15.10.1 leaves out.

    Parameters
    ----------
    momentum : p = Pi_3 [kg m^2/s]
    tilt : of the axis from the upward vertical, in (-pi, pi) [rad]

    Examples
    --------
    >>> top = sp.rigid_body.LagrangeTop(1.0, 0.5, 2.0)
    >>> heights = sp.rigid_body.upright_potential(top, top.critical_momentum, [0.1, 0.2])
    >>> print(f"{heights[1] / heights[0]:.1f}, nearly 2^4")
    16.0, nearly 2^4
    """
    check_object(top, "LagrangeTop", "top")
    p, angle = number_argument(momentum, "momentum"), finite_array(tilt, "tilt", unit="rad")
    if np.any(np.abs(angle) >= np.pi):
        raise ShapeError(
            f"tilt: {np.abs(angle).max():.6g} rad; between -pi and pi the axis points away from straight down"
        )
    u = np.tan(0.5 * angle) ** 2
    return ((p * p / top.transverse - 4.0 * top.mgl) / 2.0 + 2.0 * top.mgl * u / (1.0 + u)) * u


def second_variation(
    top: LagrangeTop, momentum: float, phi_dot: float, *, a: float = 0.0, b: float = 0.0, c: float = 0.0, d: float = 0.0
) -> Array:
    """Second derivative of H + Phi(Pi.Gamma, |Gamma|^2) + phi(Pi_3) at the upright spin: (6, 6) by (Pi, Gamma).

    Phi' and phi' are those of a vanishing first variation, Phi' = -(Mgl + Phi_dot p)/2 and phi' = -(p/I3 + Phi_dot);
    a = phi'', b = 4 Phi'', c = Phi_dot_dot, d = 2 Phi_dot'. The entries a36 = Phi_dot + p c + d and
    a66 = 2 Phi' + b + p^2 c + 2 p d differ from the printed ones.

    It is positive definite if and only if 1/I3 + a + c > 0 (15.10.8), 2 Phi'/I1 > Phi_dot^2 (15.10.9) and
    (1/I3 + a + c) a66 > a36^2. The third condition printed, a66 > 0 (15.10.10), is necessary and not sufficient: the
    example meets all three, and has a negative eigenvalue. The threshold of stability does not change, since b may be
    as large as one likes.

    Source: Marsden and Ratiu (15.10.5-10) with theory.md M-E9.

    Examples
    --------
    >>> top = sp.rigid_body.LagrangeTop(1.0, 0.5, 0.1)
    >>> matrix = sp.rigid_body.second_variation(top, 3.0, -1.5, b=-3.9)
    >>> print(f"{matrix[5, 5]:.6f} {np.linalg.eigvalsh(matrix).min():.6f}")  # (15.10.10) holds
    0.500000 -0.427051
    """
    check_object(top, "LagrangeTop", "top")
    p, phi_dot, a, b, c, d = (number_argument(v, "second variation") for v in (momentum, phi_dot, a, b, c, d))
    vertical = -(top.mgl + phi_dot * p)
    matrix = np.diag([1.0 / top.transverse, 1.0 / top.transverse, 1.0 / top.axial + a + c, vertical, vertical, 0.0])
    matrix[0, 3] = matrix[3, 0] = matrix[1, 4] = matrix[4, 1] = phi_dot
    matrix[2, -1] = matrix[-1, 2] = phi_dot + p * c + d
    matrix[-1, -1] = vertical + b + p * p * c + 2.0 * p * d
    return matrix


def e_quadratic(top: LagrangeTop, momentum: float) -> Array:
    """Coefficients, highest first, of -p^2 e^2 + (p^2/I1) e - Mgl/I1: (3,).

    It is positive for some e, and the spin stable, if its discriminant p^2 (p^2 - 4 Mgl I1)/I1^2 is.
    Source: Marsden and Ratiu (15.10.11).

    Examples
    --------
    >>> sp.rigid_body.e_quadratic(sp.rigid_body.LagrangeTop(1.0, 0.5, 2.0), 3.0).tolist()
    [-9.0, 9.0, -2.0]
    """
    check_object(top, "LagrangeTop", "top")
    p, i1 = number_argument(momentum, "momentum"), top.transverse
    return np.array([-p * p, p * p / i1, -top.mgl / i1])


def sleeping_matrix(moments: ArrayLike, mgl: ArrayLike, momentum: ArrayLike) -> Array:
    """The linearised equations of (Pi_1, Pi_2, Gamma_1, Gamma_2) at an upright spin: (..., 4, 4).

    Source: Marsden and Ratiu (15.10.15) with theory.md M-E10, extended to I2 other than I1.

    Parameters
    ----------
    moments : (..., 3) principal moments by body axis, in any order; I1 and I2 need not be equal, and the centre of
        mass lies on axis 3 [kg m^2]
    mgl : (...) [J]
    momentum : (...) p = Pi_3 [kg m^2/s]

    Examples
    --------
    >>> sp.rigid_body.sleeping_matrix([1.0, 1.0, 0.5], 2.0, 3.0).tolist()
    [[0.0, 3.0, 0.0, 2.0], [-3.0, 0.0, -2.0, 0.0], [0.0, -1.0, 0.0, 6.0], [1.0, 0.0, -6.0, 0.0]]
    """
    i1, i2, i3, weight, p = _upright(moments, mgl, momentum)
    matrix = np.zeros((*p.shape, 4, 4))
    matrix[..., 0, 1], matrix[..., 0, 3] = p / i3 - p / i2, weight
    matrix[..., 1, 0], matrix[..., 1, 2] = p / i1 - p / i3, -weight
    matrix[..., 2, 1], matrix[..., 2, 3] = -1.0 / i2, p / i3
    matrix[..., 3, 0], matrix[..., 3, 2] = 1.0 / i1, -p / i3
    return matrix


def characteristic_polynomial(moments: ArrayLike, mgl: ArrayLike, momentum: ArrayLike) -> tuple[Array, Array, Array]:
    """B, C and the discriminant B^2 - 4C of lambda^4 + B lambda^2 + C of `sleeping_matrix`: three of (...).

    For I1 = I2 the discriminant is (2 I1 - I3)^2 (p/I3)^2 (p^2 - 4 Mgl I1)/I1^4. For I3 = 2 I1 it vanishes for every
    p: the two pairs of roots coincide, and the sign of B decides.

    Source: Marsden and Ratiu (15.10.16) with theory.md M-E10. Arguments as `sleeping_matrix`.

    Examples
    --------
    >>> b, c, discriminant = sp.rigid_body.characteristic_polynomial([1.0, 1.0, 0.5], 2.0, 8.0**0.5)
    >>> abs(float(discriminant)) < 1e-9  # it vanishes at Pi_3^2 = 4 Mgl I1
    True
    """
    i1, i2, i3, weight, p = _upright(moments, mgl, momentum)
    spin = p / i3
    first, second = spin * (i1 - i3) / i1, spin * (i2 - i3) / i2
    b = first * second + spin * spin - weight * (1.0 / i1 + 1.0 / i2)
    c = (first * spin + weight / i1) * (second * spin + weight / i2)
    symmetric = (2.0 * i1 - i3) ** 2 * spin * spin * (p * p - 4.0 * weight * i1) / i1**4
    return b[()], c[()], np.where(i1 == i2, symmetric, b * b - 4.0 * c)[()]


def sleeping_spectrum(moments: ArrayLike, mgl: ArrayLike, momentum: ArrayLike) -> np.ndarray:
    """The four eigenvalues of `sleeping_matrix`: (..., 4) complex [1/s]. Arguments as there.

    Found through their squares (-B +- sqrt(B^2 - 4C))/2, so they come in pairs of opposite sign.

    Examples
    --------
    >>> print(sp.rigid_body.sleeping_spectrum([1.0, 1.0, 0.5], 2.0, 3.0).real.round(9) + 0.0)
    [0. 0. 0. 0.]
    """
    b, c, discriminant = characteristic_polynomial(moments, mgl, momentum)
    root = np.sqrt(np.asarray(discriminant, dtype=complex))
    # The larger of the two without cancellation, the other by the product.
    large = -0.5 * (b + np.where(b < 0.0, -root, root))
    small = np.where(large == 0.0, 0.0, c / np.where(large == 0.0, 1.0, large))
    first, second = np.sqrt(large), np.sqrt(small)
    return np.stack([first, -first, second, -second], axis=-1)


def spectrally_stable(moments: ArrayLike, mgl: ArrayLike, momentum: ArrayLike) -> Mask:
    """True where no eigenvalue of an upright spin has a positive real part: (...). Arguments of `sleeping_matrix`.

    The squares of the eigenvalues must be real and not positive: B, C and B^2 - 4C not negative.

    Examples
    --------
    >>> sp.rigid_body.spectrally_stable([1.0, 1.0, 0.5], 2.0, [2.8, 2.9]).tolist()
    [False, True]
    """
    b, c, discriminant = characteristic_polynomial(moments, mgl, momentum)
    return (b >= 0.0) & (c >= 0.0) & (discriminant >= 0.0)


def stability_chart(
    axial_ratios: ArrayLike, momenta: ArrayLike, *, tilt: float = 1e-3, duration: float = 100.0
) -> StabilityChart:
    """Stability of upright spins by energy-Casimir, by spectrum and by simulation, in units of I1, Mgl, sqrt(I1/Mgl).

    The simulation releases the heavy top with its axis tilted and Pi along the axis; a spin counts as stable if the
    tilt stays within 50 times the first one. Next to the threshold the tilt grows slowly, at the rate
    sqrt(1 - Pi_3^2/4), and long durations are needed.

    Source: Marsden and Ratiu, theorem 15.10.1; theory.md M8.

    Parameters
    ----------
    axial_ratios : (R,) I3/I1 > 0
    momenta : (P,) Pi_3/sqrt(Mgl I1)
    tilt : at the start, in (0, 0.01] [rad]
    duration : of the simulation [sqrt(I1/Mgl)]

    Raises
    ------
    ShapeError
        If the ratios or momenta are not lists, or tilt and duration are outside their limits.
    AccuracyNotReached
        If the simulation needs more than 200,000 steps.

    Examples
    --------
    >>> chart = sp.rigid_body.stability_chart([0.5], [1.0, 3.0], duration=8.0)
    >>> chart.spectrum.tolist(), chart.simulation.tolist()
    ([[False, True]], [[False, True]])
    """
    ratios, spins = finite_array(axial_ratios, "axial_ratios"), finite_array(momenta, "momenta")
    lean, time = number_argument(tilt, "tilt"), number_argument(duration, "duration")
    if ratios.ndim != 1 or spins.ndim != 1 or not ratios.size or not spins.size:
        raise ShapeError(f"axial_ratios, momenta: two lists are needed, got shapes {ratios.shape}, {spins.shape}")
    if not 0.0 < lean <= _LARGEST_TILT or time <= 0.0:
        raise ShapeError(f"tilt must be in (0, 0.01] rad and duration above 0, got {lean:.6g}, {time:.6g}")
    moments = np.ones((len(ratios), 1, 3))
    moments[..., 0, 2] = ratios
    spectrum = spectrally_stable(moments, 1.0, spins)
    attitude = np.broadcast_to(so3.exp(np.array([lean, 0.0, 0.0])), (*spectrum.shape, 3, 3))
    momentum = np.broadcast_to(spins[:, None] * np.eye(3)[2], (*spectrum.shape, 3))
    largest = np.full(spectrum.shape, lean)
    top = HeavyTop(moments[..., None] * np.eye(3), 1.0)
    for _, quat, _, _ in heavy_top_steps(top, attitude, momentum, time, 1e-9):
        # The parts of the quaternion are sine and cosine of half the angle between body axis 3 and the vertical.
        across, along = np.hypot(quat[..., 0], quat[..., 1]), np.hypot(quat[..., 2], quat[..., 3])
        largest = np.maximum(largest, 2.0 * np.arctan2(across, along))
    return StabilityChart(
        axial_ratios=ratios,
        momenta=spins,
        energy_casimir=np.broadcast_to(spins * spins > 4.0, spectrum.shape).copy(),
        spectrum=spectrum,
        simulation=largest <= _GROWTH * lean,
        largest_tilt=largest,
    )


def _upright(moments: ArrayLike, mgl: ArrayLike, momentum: ArrayLike) -> tuple[Array, ...]:
    """I1, I2, I3, Mgl and Pi_3 as arrays of one shape."""
    inertia = positive_moments(moments)
    weight, spin = finite_array(mgl, "mgl", unit="J"), finite_array(momentum, "momentum", unit="kg m^2/s")
    common_batch(moments=inertia.shape[:-1], mgl=weight.shape, momentum=spin.shape)
    return tuple(np.broadcast_arrays(*np.moveaxis(inertia, -1, 0), weight, spin))
