"""The curve of a gyrostat's momentum in the body: where a sphere and a displaced ellipsoid meet, by elliptic functions.

With x = Pi/|Pi| and b = h/|Pi|, in principal axes with A = I^-1, the curve has x.x = 1 and (x - b).A(x - b) = 2 E, two
quadrics S and Q of the points X = (x, 1). Among Q - c S four are cones, for the roots c of a quartic; two at least are
real. Lines through the vertex V of such a cone meet the curve in pairs, and those pairs are the points of a conic in
the plane that is polar to V. Let P and P1 be the points of our oval in that plane, T the pole of the line through them.
The conic is Y = q^2 P + q T + P1, and

    X(t) = q^2 P + q T + P1 + (q'/k) V,    q'^2 = k^2 (f1 q^3 + f2 q^2 + f3 q),

so that q is an elliptic function of second order, infinite at P and zero at P1. Nothing but the isolated root c is
assumed to be well determined: where two others meet, next to a separatrix, all else changes smoothly.

Sources: Volterra 1899; Wittenburg 1977, section 4.6; DLMF 19.29, 23.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import permutations

import numpy as np
from scipy.special import elliprf, elliprj

from .. import elliptic
from ..arrays import Array, lock_arrays
from ..errors import AccuracyNotReached
from ._arguments import FEW_ULPS, HALVINGS

_EPS = float(np.finfo(float).eps)
_TOLERANCE = 1e-9  # of the imaginary part of a root tried as real, and of the distance of the curve from its start
_METRIC = np.diag([1.0, 1.0, 1.0, -1.0])


@dataclass(frozen=True, eq=False)
class GyrostatOrbit:
    """The closed curve of x, principal axes."""

    points: Array
    """(3, 4) P, T and P1."""
    vertex: Array
    """(4,) V."""
    along: float
    """k, that is q'/k is the part along V."""
    leading: float
    """c of q'^2 = c q (q - r)(q - s) [1/s^2]."""
    roots: tuple[complex, complex]
    """r and s, real and not positive, or conjugate."""
    rate: float
    """Rate of the argument u of the elliptic functions [1/s]."""
    complement: float
    """m1 = 1 - k^2 of these."""
    phase: float
    """u at t = 0."""

    __post_init__ = lock_arrays

    @property
    def is_oscillating(self) -> bool:
        """True where there is another oval: both other roots are real and not positive."""
        return self.roots[0].imag == 0.0 and self.roots[0].real <= 0.0

    @cached_property
    def half_period(self) -> float:
        """From P to P1 [s]; infinite on a separatrix."""
        quarter = float(elliptic.complete_k(self.complement)) if self.complement > 0.0 else np.inf
        return (1.0 if self.is_oscillating else 2.0) * quarter / self.rate

    def ratio(self, times: Array) -> tuple[Array, Array, Array, Array, Array]:
        """q as numerator over weight, both 0 or more, q' times the weight squared, half periods, the rest's sign.

        Times are counted from the start.
        """
        u = self.rate * times + self.phase
        sn, cn, dn, am = elliptic.jacobi(u, np.array(self.complement))
        if self.is_oscillating:
            scale = -self.roots[1].real
            turns = np.rint(am / np.pi)
            # By half turns of the amplitude sn and cn change their signs together.
            top, weight = scale * cn * cn, sn * sn
            slope = -2.0 * scale * self.rate * cn * dn * sn
            return top, weight, slope, turns, _side(am - np.pi * turns)
        scale = float(np.abs(self.roots[0]))
        # 1 + cn and 1 - cn, the smaller of them without loss of digits.
        large = 1.0 + np.abs(cn)
        small = sn * sn / large
        above, below = np.where(cn < 0.0, small, large), np.where(cn < 0.0, large, small)
        slope = -2.0 * scale * self.rate * sn * dn
        turns = np.rint(am / (2.0 * np.pi))
        return scale * above, below, slope, turns, _side(am - 2.0 * np.pi * turns)

    def directions(self, times: Array) -> Array:
        """x: (...) -> (..., 3) unit vectors."""
        top, weight, slope, _, _ = self.ratio(times)
        whole = np.stack([top * top, top * weight, weight * weight], axis=-1) @ self.points
        whole = whole + (slope / self.along)[..., None] * self.vertex
        x = whole[..., :3] / whole[..., 3:]
        return x / np.linalg.norm(x, axis=-1, keepdims=True)


@dataclass(frozen=True, kw_only=True, eq=False)
class Swing:
    """The angle psi about the momentum, a quotient of linear forms of X integrated along the orbit.

    psi = drift t + sum of weights_i times the integral of 1/(q - poles_i) + an inverse tangent.
    """

    orbit: GyrostatOrbit
    """The curve."""
    drift: float
    """[rad/s]."""
    weights: Array
    poles: Array
    """`weights` and `poles`: (2,) complex, of the integrals of the third kind."""
    odd: complex
    """Factor of the inverse tangent [rad]."""

    __post_init__ = lock_arrays

    def angle(self, times: Array) -> Array:
        """Angle psi, without its constant: (N,) -> (N,) [rad]."""
        orbit = self.orbit
        top, weight, _, turns, sign = orbit.ratio(times)
        total = self.drift * (times + orbit.phase / orbit.rate)
        ends = np.ones(1), np.full(1, float(np.abs(orbit.roots[0])))
        for amount, pole in zip(self.weights, self.poles, strict=True):
            if orbit.is_oscillating or not orbit.complement:
                # On a separatrix no half period is ever over.
                partial = self._from_far(top, weight, pole)
                half = self._from_far(0.0 * ends[0], ends[0], pole) if orbit.complement else np.zeros(1)
            else:
                # Short of |r| the arguments of Carlson's integral would come near its cut: there from the other end.
                half = self._from_far(ends[1], ends[0], pole) + self._to_near(ends[1], ends[0], pole)
                far = top >= ends[1] * weight
                partial = np.where(
                    far,
                    self._from_far(np.where(far, top, ends[1]), np.where(far, weight, 1.0), pole),
                    half - self._to_near(np.where(far, ends[1], top), np.where(far, 1.0, weight), pole),
                )
            total = total + (amount * (sign * partial + 2.0 * turns * half)).real
        places = top - self.poles[:, None] * weight
        return total + (self.odd * (np.log(places[1]) - np.log(places[0]))).real

    def _from_far(self, top: Array, weight: Array, pole: complex) -> Array:
        """The integral of dt/(q - pole) from P, where q is infinite, to q = top/weight."""
        first, second = self.orbit.roots
        scaled = np.where(weight > 0.0, weight, 1.0)
        third = elliprj(top + 0j, top - first * scaled, top - second * scaled, top - pole * scaled)
        return np.where(weight > 0.0, 2.0 / (3.0 * np.sqrt(self.orbit.leading)) * scaled * np.sqrt(scaled) * third, 0.0)

    def _to_near(self, top: Array, weight: Array, pole: complex) -> Array:
        """The integral of dt/(q - pole) from q = top/weight to P1, where q is zero: with 1/q for q."""
        first, second = self.orbit.roots
        scaled = np.where(top > 0.0, top, 1.0)
        args = weight + 0j, weight - scaled / first, weight - scaled / second
        third = scaled * np.sqrt(scaled) / (3.0 * pole) * elliprj(*args, weight - scaled / pole)
        factor = -2.0 / (pole * np.abs(first) * np.sqrt(self.orbit.leading))
        return np.where(top > 0.0, factor * (np.sqrt(scaled) * elliprf(*args) + third), 0.0)


def _side(rest: Array) -> Array:
    """-1 below zero, else 1: also at P1 itself, where the sine vanishes and the integral is that of half a period."""
    return np.where(rest < 0.0, -1.0, 1.0)


def gyrostat_orbit(rates: Array, shift: Array, start: Array, speed: float) -> GyrostatOrbit:
    """The orbit through a start: A's diagonal (3,) [1/(kg m^2)], b (3,), x (3,), and |Pi| [kg m^2/s].

    Raises AccuracyNotReached if no cone gives the curve, as next to an equilibrium.
    """
    cones, quadric = _pencil(rates, shift, start)
    nearest, best = _TOLERANCE, None
    for cone in cones:
        orbit = _by_cone(cone, quadric, rates, shift, start, speed)
        distance = _distance_from(start, orbit) if orbit is not None else np.inf
        if distance <= nearest:
            nearest, best = distance, orbit
        if distance < FEW_ULPS:
            break
    if best is None:
        raise AccuracyNotReached("the curve of the momentum was not found: it is too near to a point or to a circle")
    return best


def _distance_from(start: Array, orbit: GyrostatOrbit) -> float:
    return float(np.linalg.norm(orbit.directions(np.zeros(())) - start))


def _pencil(rates: Array, shift: Array, start: Array) -> tuple[list[tuple[float, Array]], Array]:
    """Real roots c with the vertices of their cones, the most isolated first, and Q: [(c, (4,))], (4, 4).

    The last entry of Q is such that the start is on it to rounding.
    """
    quadric = np.zeros((4, 4))
    quadric[:3, :3] = np.diag(rates)
    quadric[:3, 3] = quadric[3, :3] = -rates * shift
    quadric[3, 3] = -(rates * start) @ start + 2.0 * (rates * shift) @ start
    roots, vectors = np.linalg.eig(_METRIC @ quadric)
    order = []
    for k in range(4):
        vertex = np.real(vectors[:, k])
        if abs(roots[k].imag) <= _TOLERANCE * abs(roots[k]) and float(vertex @ _METRIC @ vertex) > 0.0:
            isolation = float(np.abs(np.delete(roots, k) - roots[k]).min())
            order.append((isolation, float(roots[k].real), vertex / np.linalg.norm(vertex)))
    order.sort(key=lambda cone: -cone[0])
    return [(root, vertex) for _, root, vertex in order], quadric


def _by_cone(
    place: tuple[float, Array], quadric: Array, rates: Array, shift: Array, start: Array, speed: float
) -> GyrostatOrbit | None:
    root, vertex = place
    space = float(vertex @ _METRIC @ vertex)
    basis = _polar_basis(vertex)
    conic = basis.T @ (quadric - root * _METRIC) @ basis
    conic = 0.5 * (conic + conic.T)
    angles = _on_circle(conic)
    here = np.append(start, 1.0)
    within = here - (vertex @ _METRIC @ here) / space * vertex
    projected = np.asarray(np.linalg.lstsq(basis, within, rcond=None)[0], dtype=np.float64)
    points = np.stack([np.cos(angles), np.sin(angles), np.ones(len(angles))], axis=1)
    lowest, best = np.inf, None
    for far, near in permutations(points, 2):
        orbit = _through(far, near, conic, basis, vertex, projected, here, rates, shift, speed)
        if orbit is not None:
            # Either end may be infinite: the one where the momentum moves faster has more digits.
            distance = _distance_from(start, orbit)
            score = distance if distance > 1e3 * _EPS else -abs(orbit.along * orbit.leading)
            if score < lowest:
                lowest, best = score, orbit
    return best


def _polar_basis(vertex: Array) -> Array:
    """The plane polar to V: columns two of length 1 and one of length -1 in the metric of the sphere: (4, 3).

    The circle of the sphere in it is (cos, sin, 1).
    """
    normal = _METRIC @ vertex
    plane = np.linalg.svd(normal[None])[2][1:].T
    values, vectors = np.linalg.eigh(plane.T @ _METRIC @ plane)
    basis = (plane @ vectors / np.sqrt(np.abs(values)))[:, ::-1]
    basis[:, 2] *= np.sign(basis[3, 2])
    return basis


def _on_circle(conic: Array) -> Array:
    """Angles where the conic meets the circle (cos, sin, 1): (2,) or (4,), or none.

    Between the extremes of the conic's form on the circle, a trigonometric polynomial of second degree, by bisection;
    a double root is two or none by the sign that rounding leaves.
    """
    m = conic
    cos2, sin2 = 0.5 * (m[0, 0] - m[1, 1]), m[0, 1]
    cos1, sin1, mean = 2.0 * m[0, 2], 2.0 * m[1, 2], 0.5 * (m[0, 0] + m[1, 1]) + m[2, 2]

    def form(t: Array) -> Array:
        return mean + cos1 * np.cos(t) + sin1 * np.sin(t) + cos2 * np.cos(2.0 * t) + sin2 * np.sin(2.0 * t)

    # Its slope is the real part of a polynomial in u = exp(i t); so are its extremes roots of one of fourth degree.
    high, low = complex(sin2, cos2), 0.5 * complex(sin1, cos1)
    extremes = np.roots([high, low, 0.0, np.conj(low), np.conj(high)])
    even = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    grid = np.sort(np.mod(np.concatenate([np.angle(extremes), even]), 2.0 * np.pi))
    left, right = grid, np.append(grid[1:], grid[0] + 2.0 * np.pi)
    change = np.sign(form(left)) * np.sign(form(right)) < 0.0
    left, right = left[change], right[change]
    sign = np.sign(form(left))
    for _ in range(HALVINGS):
        middle = 0.5 * (left + right)
        same = np.sign(form(middle)) == sign
        left, right = np.where(same, middle, left), np.where(same, right, middle)
    return 0.5 * (left + right)


def _through(
    far: Array, near: Array, conic: Array, basis: Array, vertex: Array, projected: Array, here: Array,
    rates: Array, shift: Array, speed: float,
) -> GyrostatOrbit | None:  # fmt: skip
    """The orbit from P = `far` to P1 = `near`, if the start is on it."""
    to_far, to_near = conic @ far, conic @ near
    pole = np.cross(to_far, to_near)
    pole = pole / np.linalg.norm(pole)
    chord, bend = float(far @ to_near), float(pole @ conic @ pole)
    if bend == 0.0 or chord == 0.0 or -2.0 * chord / bend <= 0.0:
        return None
    pole = pole * np.sqrt(-2.0 * chord / bend)
    bend = -2.0 * chord
    # The start is weight (q^2 P + q T + P1).
    at_far, at_near, at_pole = (float(projected @ polar) for polar in (to_far, to_near, conic @ pole))
    if at_pole * chord / bend * at_far < 0.0:
        pole, at_pole = -pole, -at_pole
    whole = np.stack([far, pole, near]) @ basis.T
    metric = whole @ _METRIC @ whole.T
    space = float(vertex @ _METRIC @ vertex)
    f1, f2, f3 = np.array([2.0 * metric[0, 1], metric[1, 1] + 2.0 * metric[0, 2], 2.0 * metric[1, 2]]) / -space
    if not f1 > 0.0:
        return None
    f3 = max(f3, 0.0)
    point = whole[0, :3] / whole[0, 3]
    direction = vertex[:3] - vertex[3] * point
    velocity = speed * np.cross(point, rates * (point - shift))
    # Next to P, q = 4/(c t^2) and X/q^2 = P - c t/(2 k) V.
    along = -2.0 * float(velocity @ direction) / float(direction @ direction) / f1 * float(whole[0, 3])
    leading = along**2 * f1
    if leading == 0.0:
        return None
    discriminant = f2 * f2 - 4.0 * f1 * f3
    # Two positive roots would end our oval: they are one, but for rounding, and it is a separatrix.
    double = discriminant >= 0.0 and f2 < 0.0
    if double and discriminant > 1e-13 * f2 * f2:
        return None
    if discriminant >= 0.0 and not double:
        large = -0.5 * (f2 + np.sqrt(discriminant)) / f1
        small = f3 / (f1 * large) if large else 0.0
        if not large < 0.0:
            return None
        roots = complex(small), complex(large)
        complement, rate = small / large, 0.5 * np.sqrt(-leading * large)
    else:
        real, imaginary = -0.5 * f2 / f1, 0.5 * np.sqrt(max(-discriminant, 0.0)) / f1
        size = float(np.sqrt(f3 / f1))
        roots = complex(real, imaginary), complex(real, -imaginary)
        complement = imaginary**2 / (2.0 * size * (size + real)) if real > 0.0 else (size - real) / (2.0 * size)
        rate = np.sqrt(leading * size)
    # q of the start, from the one of two quotients that keeps its digits.
    if abs(at_near) < abs(at_far):
        top, weight = at_pole * chord / bend, at_far
    else:
        top, weight = at_near, at_pole * chord / bend
    if weight < 0.0 or (weight == 0.0 and top < 0.0):
        top, weight = -top, -weight
    if top < 0.0:
        return None
    side = float(vertex @ _METRIC @ here) / space
    # X of the start has the fourth entry 1, that of the curve (top, weight) another.
    ours = np.array([top * top, top * weight, weight * weight]) @ whole[:, 3]
    sense = -np.sign(side * along) if ours > 0.0 else np.sign(side * along)
    complement = float(min(max(complement, 0.0), 1.0))
    if roots[0].imag == 0.0 and roots[0].real <= 0.0:
        cosine, sine = np.sqrt(top), np.sqrt(-roots[1].real * weight)
        length = float(np.hypot(sine, cosine))
        phase = float(elliptic.argument_of(sine / length, cosine / length, complement))
    else:
        # (1 + cn)/(1 - cn) = q/|root|; sn > 0.
        scaled = float(np.abs(roots[0])) * weight
        cosine, sine = (top - scaled) / (top + scaled), 2.0 * np.sqrt(top * scaled) / (top + scaled)
        phase = float(elliptic.argument_of(sine, abs(cosine), complement))
        if cosine < 0.0:
            phase = 2.0 * float(elliptic.complete_k(complement)) - phase if complement > 0.0 else np.inf
    phase = phase if sense >= 0.0 else -phase
    if not np.isfinite(phase):
        return None
    return GyrostatOrbit(whole, vertex, along, leading, roots, float(rate), complement, phase)


def swing_about(orbit: GyrostatOrbit, axis: Array, numerator: Array) -> Swing:
    """The angle whose rate is numerator.X / (1 + axis.x): (3,) axis with axis.V + V4 = 0, (4,) numerator [1/s]."""
    below, above = orbit.points @ np.append(axis, 1.0), orbit.points @ numerator
    d0, d1, d2 = below
    drift = float(above[0] / d0)
    c1, c0 = above[1] - drift * d1, above[2] - drift * d2
    root = np.sqrt(complex(d1 * d1 - 4.0 * d0 * d2))
    shifted = -0.5 * (d1 + (root if (np.conj(d1) * root).real >= 0.0 else -root))
    poles = np.array([shifted / d0, d2 / shifted])
    gap = poles[0] - poles[1]
    weights = np.array([(c1 * poles[0] + c0) / (d0 * gap), -(c1 * poles[1] + c0) / (d0 * gap)])
    odd = complex(-(orbit.vertex @ numerator) / (orbit.along * d0 * gap))
    return Swing(orbit=orbit, drift=drift, weights=weights, poles=poles, odd=odd)


def best_axis(orbit: GyrostatOrbit) -> Array:
    """The unit vector e, with e.V + V4 = 0, that stays farthest from the opposite of the momentum's directions."""
    basis = _polar_basis(orbit.vertex)
    angles = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles), np.ones(len(angles))], axis=1) @ basis.T
    against = circle[:, :3] / circle[:, 3:]
    reach = orbit.half_period if np.isfinite(orbit.half_period) else 20.0 / orbit.rate
    seen = orbit.directions(np.linspace(-reach, reach, 65) - orbit.phase / orbit.rate)
    least = (1.0 - seen @ against.T).min(axis=0)
    return -against[int(np.argmax(least))]
