"""Jacobi's elliptic functions and Legendre's integrals by the complementary parameter, batched.

SciPy and mpmath take the parameter m = k²; here everything takes m1 = 1 − m = k'², in [0, 1], given as such: near the
separatrix m1 is as small as 1e-30 and m rounds to one, so m1 cannot be computed from m. The limit m1 = 0 (hyperbolic
functions) is allowed. Arguments broadcast; those that are not finite real numbers, or out of range, raise
`ShapeError`.

No formula loses digits by a subtraction. An argument is reduced by the period 2K, which costs as much
as the rounding of the argument itself, a few 1e-16 |u|; an amplitude is never reduced, only its sine and cosine used.

Sources: Abramowitz and Stegun 16.4, 17.6 (arithmetic-geometric mean); Bulirsch 1965 (the descending Landen steps in
the cotangent of the amplitude, which keeps the digits of small cn and dn); Carlson 1979, 1995 and DLMF 19.25, 19.36.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import elliprc, elliprd, elliprf, elliprj

from .arrays import Array, Mask, common_shape, finite_array
from .errors import ShapeError

_SMALL_ARGUMENT = 1e-9  # below it sn u = am u = u and cn u = 1 to the last digit
_FLOOR = 1e-60  # least m1 in integrals that converge as m1 goes to 0: a smaller one changes no digit, but overflows
_CHARACTERISTIC = 1e100  # largest -n: beyond it the integral of the third kind overflows
_PERIODS = 1e12  # longest argument [periods 2K]: reducing it costs twelve of the sixteen digits
_MEANS_AGREE = 1e-8  # relative difference of two means that the next arithmetic-geometric step makes equal
_FAR = 1e-3  # ratio y/p below which SciPy's R_J uses an asymptotic form that is accurate to 1e-12 only


def complete_k(m1: ArrayLike) -> Array:
    """K = F(pi/2), the quarter period: (...) -> (...); infinite at m1 = 0. Parameter m = k² = 1 − m1.

    Examples
    --------
    >>> print(f"{sp.elliptic.complete_k(0.5):.9f}")  # m = 1/2, the lemniscate: Gamma(1/4)^2/(4 sqrt(pi))
    1.854074677
    """
    (m1,) = _arguments(m1=m1)
    return _quarter_period(m1)[()]


def complete_e(m1: ArrayLike) -> Array:
    """E = E(pi/2): (...) -> (...), from 1 at m1 = 0 to pi/2 at m1 = 1. Parameter m = k² = 1 − m1.

    Examples
    --------
    >>> print(f"{sp.elliptic.complete_e(1.0):.9f} = pi/2")
    1.570796327 = pi/2
    """
    (m1,) = _arguments(m1=m1)
    return _second_kind(np.ones(()), np.zeros(()), m1)[()]


def complete_pi(n: ArrayLike, m1: ArrayLike) -> Array:
    """Pi(n) = Pi(n; pi/2), n < 1: (...), (...) -> (...); infinite at m1 = 0. Parameter m = k² = 1 − m1.

    Examples
    --------
    >>> print(f"{sp.elliptic.complete_pi(-3.0, 1.0):.9f} = pi/4")  # at m = 0: pi/(2 sqrt(1 - n))
    0.785398163 = pi/4
    """
    n, m1 = _arguments(n=n, m1=m1)
    return _complete_third_kind(n, m1)[()]


def jacobi(u: ArrayLike, m1: ArrayLike) -> tuple[Array, Array, Array, Array]:
    """Jacobi's sn, cn, dn and am of u with parameter m = k² = 1 − m1.

    For |u| of a hundred sn and cn are right to 1e-13 and dn to 1e-13 of itself, however small; so is cn except next to
    its zeros. The errors grow as 1e-15 |u|, or less; that of am also as its size.

    Parameters
    ----------
    u : (...) argument, any real number up to 1e12 periods
    m1 : (...) complementary parameter in [0, 1]

    Returns
    -------
    sn, cn, dn, am : (...) each; dn >= 0; the amplitude [rad] is continuous in u, it grows by pi with every 2K

    Examples
    --------
    >>> sn, cn, dn, am = sp.elliptic.jacobi(1.0, 1.0)
    >>> print(f"{sn:.9f} = sin 1, {cn:.9f} = cos 1")  # at m = 0
    0.841470985 = sin 1, 0.540302306 = cos 1
    """
    u, m1 = _arguments(u=u, m1=m1)
    sine, cosine, _, turns = _reduced_jacobi(u, m1)
    return _continued(sine, cosine, turns, m1)


def jacobi_and_pi_excess(n: ArrayLike, u: ArrayLike, m1: ArrayLike) -> tuple[Array, Array, Array, Array, Array]:
    """`jacobi`, and Pi(n; am u) − u/(1 − n) for n <= 0, at the cost of little more: (...) x 3 -> five (...).

    The part proportional to u is left out, so that a caller who multiplies it by a large factor can add it exactly and
    not as the difference of two rounded arguments.

    Source: Abramowitz and Stegun 17.7.15, where the integrals of the first kind add up to u/(1 − n).

    Examples
    --------
    >>> *_, excess = sp.elliptic.jacobi_and_pi_excess(0.0, 0.7, 0.5)
    >>> float(excess)  # Pi(0; am u) = u
    0.0
    """
    n, u, m1 = _arguments(n=n, u=u, m1=m1)
    _refuse(n > 0.0, n, "n", "along u the characteristic must be 0 or less; incomplete_pi takes those up to 1")
    sine, cosine, _, turns = _reduced_jacobi(u, m1)
    excess = _excess(n, sine, cosine, m1) + _whole(turns, _excess(n, np.ones(()), np.zeros(()), m1))
    return *_continued(sine, cosine, turns, m1), excess[()]


def complete_pi_excess(n: ArrayLike, m1: ArrayLike) -> Array:
    """Pi(n) − K/(1 − n), for n <= 0: (...), (...) -> (...); finite at m1 = 0 too. Parameter m = k² = 1 − m1.

    Examples
    --------
    >>> print(f"{sp.elliptic.complete_pi_excess(-3.0, 1.0):.9f} = pi/4 - pi/8")
    0.392699082 = pi/4 - pi/8
    """
    n, m1 = _arguments(n=n, m1=m1)
    _refuse(n > 0.0, n, "n", "the characteristic must be 0 or less; complete_pi takes those up to 1")
    return _excess(n, np.ones(()), np.zeros(()), m1)[()]


def argument_of(sn: ArrayLike, cn: ArrayLike, m1: ArrayLike) -> Array:
    """The u in [−K, K] with these sn and cn >= 0, up to a common factor: (...), (...), (...) -> (...).

    Preferable to `incomplete_f` of the amplitude: for small m1 next to ±K an amplitude lacks the digits of cn.
    Infinite at m1 = 0 and cn = 0. Parameter m = k² = 1 − m1.

    Examples
    --------
    >>> print(f"{sp.elliptic.argument_of(np.sin(0.7), np.cos(0.7), 1.0):.9f}")  # at m = 0 the angle itself
    0.700000000
    """
    sine, cosine, m1 = _arguments(sn=sn, cn=cn, m1=m1)
    length = np.hypot(sine, cosine)
    _refuse(
        (cosine < 0.0) | (length == 0.0), np.broadcast_arrays(cosine, length)[0], "cn", "0 or more, sn and cn not 0"
    )
    return _first_kind(sine / length, cosine / length, m1)[()]


def jacobi_pi(n: ArrayLike, u: ArrayLike, m1: ArrayLike) -> Array:
    """The integral of 1/(1 − n sn²) from 0 to u, which is Pi(n; am u), for n <= 0: (...), (...), (...) -> (...).

    Preferable to `incomplete_pi` of an amplitude: for small m1 the amplitude stays near odd multiples of pi/2
    for so long that its digits do not determine u. Parameter m = k² = 1 − m1; u as in `jacobi`, also at m1 = 0.

    Examples
    --------
    >>> print(f"{sp.elliptic.jacobi_pi(0.0, 0.7, 0.5):.9f}")  # without n the argument itself
    0.700000000
    """
    n, u, m1 = _arguments(n=n, u=u, m1=m1)
    _refuse(n > 0.0, n, "n", "along u the characteristic must be 0 or less; incomplete_pi takes those up to 1")
    sine, cosine, rest, turns = _reduced_jacobi(u, m1)
    return (_third_kind(n, sine, cosine, m1, rest) + _whole(turns, _complete_third_kind(n, _regular(m1))))[()]


def incomplete_f(phi: ArrayLike, m1: ArrayLike) -> Array:
    """F(phi), the integral of 1/sqrt(1 − m sin²) from 0 to phi: (...), (...) -> (...). Parameter m = k² = 1 − m1.

    Any real phi [rad]. Where F is infinite, at m1 = 0 and |phi| >= pi/2 (as rounded), a `ShapeError` is raised.

    Examples
    --------
    >>> print(f"{sp.elliptic.incomplete_f(0.7, 1.0):.9f}")  # at m = 0 the angle itself
    0.700000000
    """
    phi, m1 = _arguments(phi=phi, m1=m1)
    _refuse_infinite(phi, m1)
    sine, cosine, turns = _folded(phi)
    return (_first_kind(sine, cosine, m1) + _whole(turns, _quarter_period(_regular(m1))))[()]


def incomplete_e(phi: ArrayLike, m1: ArrayLike) -> Array:
    """E(phi), the integral of sqrt(1 − m sin²) from 0 to phi: (...), (...) -> (...). Parameter m = k² = 1 − m1.

    Any real phi [rad]; at m1 = 0 the integral of |cos|.

    Examples
    --------
    >>> print(f"{sp.elliptic.incomplete_e(0.7, 0.0):.9f} = sin 0.7")  # at m = 1
    0.644217687 = sin 0.7
    """
    phi, m1 = _arguments(phi=phi, m1=m1)
    sine, cosine, turns = _folded(phi)
    return (_second_kind(sine, cosine, m1) + _whole(turns, _second_kind(np.ones(()), np.zeros(()), m1)))[()]


def incomplete_pi(n: ArrayLike, phi: ArrayLike, m1: ArrayLike) -> Array:
    """Pi(n; phi), the integral of 1/((1 − n sin²) sqrt(1 − m sin²)) from 0 to phi: (...), (...), (...) -> (...).

    Source: for n < 0 Abramowitz and Stegun 17.7.15, the only form whose terms all have the same sign.

    Parameters
    ----------
    n : (...) characteristic from -1e100 to below 1, of the sign of Abramowitz and Stegun, SymPy and mpmath
    phi : (...) any real amplitude [rad]
    m1 : (...) complementary parameter in [0, 1]; m = k² = 1 − m1

    Raises
    ------
    ShapeError
        For n >= 1, where the integrand has poles, for n < -1e100, and where the integral is infinite: m1 = 0 and
        |phi| >= pi/2 as rounded.

    Examples
    --------
    >>> print(f"{sp.elliptic.incomplete_pi(-3.0, np.pi / 2, 1.0):.9f} = pi/4")
    0.785398163 = pi/4
    """
    n, phi, m1 = _arguments(n=n, phi=phi, m1=m1)
    _refuse_infinite(phi, m1)
    sine, cosine, turns = _folded(phi)
    part = _third_kind(n, sine, cosine, m1, _first_kind(sine, cosine, m1))
    return (part + _whole(turns, _complete_third_kind(n, _regular(m1))))[()]


def _arguments(**values: ArrayLike) -> tuple[Array, ...]:
    """The arguments as arrays, of shapes that go together, m1 in [0, 1] and n below 1."""
    arrays = {name: finite_array(value, name) for name, value in values.items()}
    _refuse((arrays["m1"] < 0.0) | (arrays["m1"] > 1.0), arrays["m1"], "m1", "m1 = 1 - k^2 must be in [0, 1]")
    if "n" in arrays:
        _refuse(arrays["n"] >= 1.0, arrays["n"], "n", "the characteristic must be below 1, else the integral has poles")
        _refuse(arrays["n"] < -_CHARACTERISTIC, arrays["n"], "n", f"the least one taken is -{_CHARACTERISTIC:g}")
    common_shape(**arrays)
    return tuple(arrays.values())


def _refuse(bad: Mask, values: Array, name: str, requirement: str) -> None:
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        raise ShapeError(f"{name}: entry {list(where)} is {values[where]:.17g}; {requirement}")


def _refuse_infinite(phi: Array, m1: Array) -> None:
    requirement = "with m1 = 0 the integral is infinite from |phi| = pi/2 on; keep phi inside, or m1 above 0"
    _refuse((m1 == 0.0) & (np.abs(phi) >= 0.5 * np.pi), np.broadcast_arrays(phi, m1)[0], "phi", requirement)


def _regular(m1: Array) -> Array:
    """m1 with 1 in place of 0: where no whole period is counted, the period does not matter, but must be finite."""
    return np.where(m1 > 0.0, m1, 1.0)


def _whole(turns: Array, quarter: Array) -> Array:
    return 2.0 * turns * quarter


def _means(m1: Array) -> tuple[list[Array], list[Array]]:
    """The arithmetic-geometric mean of 1 and sqrt(m1) > 0, all its steps down to where the two agree."""
    upper, lower = [np.ones(m1.shape)], [np.sqrt(m1)]
    while np.any(upper[-1] - lower[-1] > _MEANS_AGREE * upper[-1]):
        upper.append(0.5 * (upper[-1] + lower[-1]))
        lower.append(np.sqrt(upper[-2] * lower[-1]))
    return upper, lower


def _quarter_period(m1: Array) -> Array:
    upper, lower = _means(_regular(m1))
    return np.where(m1 > 0.0, np.pi / (upper[-1] + lower[-1]), np.inf)


def _reduced_jacobi(u: Array, m1: Array) -> tuple[Array, Array, Array, Array]:
    """sn and cn of the rest of u after whole periods 2K, that rest in [-K, K], and their number."""
    upper, lower = _means(_regular(m1))
    mean = 0.5 * (upper[-1] + lower[-1])
    period = np.where(m1 > 0.0, np.pi / mean, np.inf)
    turns = np.rint(u / period)
    long = "that is more than 1e12 periods 2K, and rounding leaves few digits of the phase; take whole periods off"
    _refuse(np.abs(turns) > _PERIODS, np.broadcast_to(u, turns.shape), "u", long)
    rest = u - turns * np.where(m1 > 0.0, period, 0.0)
    length = np.maximum(np.abs(rest), _SMALL_ARGUMENT)
    fade = np.exp(-length)
    scale = 1.0 / (1.0 + fade * fade)
    sine, cosine = -np.expm1(-2.0 * length) * scale, 2.0 * fade * scale
    if np.any(m1 > 0.0):
        angle = np.where(m1 > 0.0, length * mean, 1.0)
        cotangent = np.cos(angle) / np.sin(angle)
        scaled, delta, square = mean * cotangent, np.ones(()), mean * cotangent * cotangent
        for a, b in zip(reversed(upper), reversed(lower), strict=True):
            scaled = scaled * delta
            delta = (b + square) / (a + square)
            square = scaled * scaled / a
        hypotenuse = np.hypot(1.0, scaled)
        sine = np.where(m1 > 0.0, 1.0 / hypotenuse, sine)
        cosine = np.where(m1 > 0.0, scaled / hypotenuse, cosine)
    small = np.abs(rest) < _SMALL_ARGUMENT
    return np.where(small, rest, np.copysign(sine, rest)), np.where(small, 1.0, cosine), rest, turns


def _continued(sine: Array, cosine: Array, turns: Array, m1: Array) -> tuple[Array, Array, Array, Array]:
    """sn, cn, dn and am from those of the reduced argument."""
    sign = 1.0 - 2.0 * np.mod(turns, 2.0)
    amplitude = turns * np.pi + np.arctan2(sine, cosine)
    delta = np.hypot(cosine, np.sqrt(m1) * sine)
    return (sign * sine)[()], (sign * cosine)[()], delta[()], amplitude[()]


def _folded(phi: Array) -> tuple[Array, Array, Array]:
    """Sine and cosine >= 0 of the amplitude's rest in [-pi/2, pi/2] after whole half turns, and their number.

    The sine and cosine of NumPy are accurate for any phi; a remainder formed by subtraction would not be, and at small
    m1 the integrals magnify its error by 1/sqrt(m1).
    """
    sine, cosine = np.sin(phi), np.cos(phi)
    odd = np.where(cosine < 0.0, 1.0, 0.0)
    return np.where(cosine < 0.0, -sine, sine), np.abs(cosine), 2.0 * np.rint(0.5 * (phi / np.pi - odd)) + odd


def _first_kind(sine: Array, cosine: Array, m1: Array) -> Array:
    square = cosine * cosine
    return sine * elliprf(square, square + m1 * (sine * sine), 1.0)


def _second_kind(sine: Array, cosine: Array, m1: Array) -> Array:
    """DLMF 19.25.10."""
    m1 = np.maximum(m1, _FLOOR)
    m, square = 1.0 - m1, cosine * cosine
    delta = square + m1 * (sine * sine)
    tail = elliprf(square, delta, 1.0) + m * sine * sine * elliprd(square, 1.0, delta) / 3.0
    return sine * (m1 * tail + m * cosine / np.sqrt(delta))


def _third_kind(n: Array, sine: Array, cosine: Array, m1: Array, first: Array) -> Array:
    """Pi(n) of an amplitude in [-pi/2, pi/2] by its sine, cosine and integral of the first kind."""
    negative = n < 0.0
    q = np.where(negative, -n, 1.0)
    m1 = np.where(n <= 0.0, np.maximum(m1, _FLOOR), m1)
    m, square, sine_square = 1.0 - m1, cosine * cosine, sine * sine
    delta = square + m1 * sine_square
    dual = (m + q) / (1.0 + q)
    characteristic = np.where(negative, dual, n)
    pole = np.where(negative, m1 / (1.0 + q) + dual * square, square + (1.0 - n) * sine_square)
    carlson = _carlson_j(square, delta, pole) if np.any(n > 0.0) else elliprj(square, delta, 1.0, pole)
    third = first + characteristic * sine * sine_square * carlson / 3.0
    share = q / (1.0 + q)
    bend = np.sqrt(share / (m + q)) * np.arctan(np.sqrt(q * dual) * sine * cosine / np.sqrt(delta))
    return np.where(negative, share * m1 / (m + q) * third + m / (m + q) * first + bend, third)


def _excess(n: Array, sine: Array, cosine: Array, m1: Array) -> Array:
    """Pi(n) − F/(1 − n) of an amplitude in [-pi/2, pi/2], n <= 0."""
    m1, q = np.maximum(m1, _FLOOR), -n
    m, square = 1.0 - m1, cosine * cosine
    delta = square + m1 * (sine * sine)
    dual, share = (m + q) / (1.0 + q), q / (1.0 + q)
    third = sine * sine * sine * elliprj(square, delta, 1.0, m1 / (1.0 + q) + dual * square) / 3.0
    steep = np.sqrt(share / np.where(m + q > 0.0, m + q, 1.0))
    return m1 * share / (1.0 + q) * third + steep * np.arctan(np.sqrt(q * dual) * sine * cosine / np.sqrt(delta))


def _carlson_j(x: Array, y: Array, p: Array) -> Array:
    """R_J(x, y, 1, p) for x <= y, p > 0.

    Where y is far below p, SciPy's asymptotic form is accurate to 1e-12 only; three duplications (DLMF 19.26.18) lead
    out of that region.
    """
    far = y < _FAR * p
    a, b, c, q = x, y, np.ones(()), np.where(far, p, 1.0)
    total, scale = np.zeros(()), 1.0
    for _ in range(3):
        ra, rb, rc = np.sqrt(a), np.sqrt(b), np.sqrt(c)
        shift = ra * rb + ra * rc + rb * rc
        alpha, beta = q * (ra + rb + rc) + ra * rb * rc, np.sqrt(q) * (q + shift)
        total = total + 3.0 * scale * elliprc(alpha * alpha, beta * beta)
        a, b, c, q, scale = a + shift, b + shift, c + shift, q + shift, 2.0 * scale
    x, y, z, p = np.where(far, a, x), np.where(far, b, y), np.where(far, c, 1.0), np.where(far, q, p)
    return np.where(far, total, 0.0) + np.where(far, scale, 1.0) * elliprj(x, y, z, p)


def _complete_third_kind(n: Array, m1: Array) -> Array:
    """Pi(n); below the floor and for n > 0 by its limit, as Carlson's integral would overflow next to m1 = 0."""
    regular = _regular(m1)
    quarter = _quarter_period(regular)
    value = _third_kind(n, np.ones(()), np.zeros(()), np.maximum(regular, _FLOOR), quarter)
    root = np.sqrt(np.maximum(n, 0.0))
    limit = (quarter - root * np.log((1.0 + root) / np.sqrt(1.0 - n))) / (1.0 - n)
    value = np.where((n > 0.0) & (regular < _FLOOR), limit, value)
    return np.where(m1 > 0.0, value, np.inf)
