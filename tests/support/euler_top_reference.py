"""Free rigid bodies to 60 digits, in tests/data/euler_top_reference.npz.

`python -m support.euler_top_reference` solves the cases in the file anew, in some minutes.

Every case is a body with principal moments and body momentum given as doubles, taken as exact numbers. The truth is the
textbook solution at 120 digits, where no cancellation matters: momentum by the Jacobi functions of mpmath, attitude by
the ZYZ angles with Legendre's incomplete integral of the third kind (theory.md H9, D17); elementary where the body is
symmetric, steady or on the separatrix.

The times are multiples of I_mid/|Pi| from -100 to 100, for extreme ratios of the time of one radian at the fastest.
The arrays, N cases of K times each: names (kinds,), kind (N,), moments (N, 3), momentum (N, 3) in body axes at t = 0,
m1 (N,) the complementary parameter, side (N,) of the separatrix (1: Pi circles the axis of the largest moment, -1: of
the smallest, 0: neither), times (N, K), body_momentum (N, K, 3), quat_xyzw (N, K, 4) with the identity at t = 0.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from fractions import Fraction

import mpmath
import numpy as np
from mpmath import mpf

from .places import DATA

FILE = DATA / "euler_top_reference.npz"
DIGITS = 120

State = tuple[list, list]


def truth(moments: np.ndarray, momentum: np.ndarray, times: np.ndarray) -> tuple[mpf, int, list[State]]:
    """m1, side, and momentum and quaternion at each time."""
    inertia, x = [mpf(float(v)) for v in moments], [mpf(float(v)) for v in momentum]
    when = [mpf(float(t)) for t in times]
    if all(x[i] == 0 or x[j] == 0 or inertia[i] == inertia[j] for i, j in ((0, 1), (0, 2), (1, 2))):
        rate = [v / i for v, i in zip(x, inertia)]
        return *parameter(inertia, x), [(x, turn(rate, t)) for t in when]
    if len(set(inertia)) == 2:
        return *parameter(inertia, x), [symmetric(inertia, x, t) for t in when]
    m1, side = parameter(inertia, x)
    low, middle, high = sorted(range(3), key=lambda i: inertia[i])
    axes = [high, middle, low] if side < 0 else [low, middle, high]
    # A proper relabelling of the axes, or Euler's equations would change sign.
    signs = [1 if axes in ([0, 1, 2], [1, 2, 0], [2, 0, 1]) else -1, 1, 1]
    states = circling([inertia[a] for a in axes], [s * x[a] for s, a in zip(signs, axes)], when, side == 0)
    back = [axes.index(i) for i in range(3)]
    return (
        m1,
        side,
        [([signs[b] * y[b] for b in back], [signs[b] * q[b] for b in back] + [q[3]]) for y, q in states],
    )


def parameter(inertia: list, x: list) -> tuple[mpf, int]:
    """The complementary parameter and the side; m1 = 1 for a symmetric body."""
    low, middle, high = sorted(range(3), key=lambda i: inertia[i])
    (a, b, c), (u, v, w) = ([q[low], q[middle], q[high]] for q in (inertia, x))
    twice, square = u * u / a + v * v / b + w * w / c, u * u + v * v + w * w
    excess = separation(*(Fraction(float(q)) for q in (a, b, c, u, w)))
    if a == c or excess == 0:
        return mpf(1) if a == b or b == c else mpf(0), 0
    side = -1 if excess > 0 else 1
    if a == b or b == c:
        return mpf(1), side
    if side < 0:
        a, c = c, a
    return 1 - (a - b) * (square - twice * c) / ((b - c) * (twice * a - square)), side


def separation(a: Fraction, b: Fraction, c: Fraction, u: Fraction, w: Fraction) -> Fraction:
    """Twice the energy times the middle moment, less |Pi|^2: exact, as on the separatrix it must be 0."""
    return u * u * (b - a) / a - w * w * (c - b) / c


def turn(rate: list, t: mpf) -> list:
    """The quaternion of a steady rotation."""
    size = mpmath.sqrt(sum(v * v for v in rate))
    return [mpmath.sin(size * t / 2) * v / size for v in rate] + [mpmath.cos(size * t / 2)]


def symmetric(inertia: list, x: list, t: mpf) -> State:
    """Two equal moments: a turn about the momentum after one about the axis of symmetry."""
    axis = next(i for i in range(3) if inertia.count(inertia[i]) == 1)
    across = inertia[(axis + 1) % 3]
    spin = [mpf(0)] * 3
    spin[axis] = x[axis] * (1 / inertia[axis] - 1 / across)
    about = turn(spin, t) if x[axis] != 0 else [mpf(0), mpf(0), mpf(0), mpf(1)]
    quat = product(turn([v / across for v in x], t), about)
    vector = product(product(conjugate(quat), [*x, mpf(0)]), quat)
    return vector[:3], quat


def circling(moments: list, y: list, times: list, separatrix: bool) -> list[State]:
    """Three moments, the middle one in the middle, momentum about the third axis: A cn, B sn, C dn of rate t + u0."""
    j1, j2, j3 = moments
    square, twice = sum(v * v for v in y), sum(v * v / j for v, j in zip(y, moments))
    size = mpmath.sqrt(square)
    first = mpmath.sqrt(j1 * (square - twice * j3) / (j1 - j3))
    third = mpmath.sqrt(j3 * (twice * j1 - square) / (j1 - j3))
    rate = mpmath.sqrt((twice * j1 - square) * (j2 - j3) / (j1 * j2 * j3))
    third = -third if y[2] < 0 else third
    if separatrix:
        first = -first if y[0] < 0 else first
    second = third * first * (1 / j1 - 1 / j3) / rate
    m = mpf(1) if separatrix else (j1 - j2) * (square - twice * j3) / ((j2 - j3) * (twice * j1 - square))
    n = -(third**2) * m / first**2
    if separatrix:
        s = mpmath.sqrt(-n)
        start = mpmath.asinh(y[1] / second / (y[2] / third))

        def functions(u: mpf) -> tuple:
            fall = mpmath.sech(u)
            return fall, mpmath.tanh(u), fall, (u + s * mpmath.atan(s * mpmath.tanh(u))) / (1 - n)
    else:
        quarter, whole, nome = mpmath.ellipk(m), mpmath.ellippi(n, m), mpmath.qfrom(m=m)
        start = mpmath.ellipf(mpmath.atan2(y[1] / second, y[0] / first), m)

        def functions(u: mpf) -> tuple:
            turns = mpmath.nint(u / (2 * quarter))
            rest, sign = u - 2 * turns * quarter, (-1) ** int(turns)
            sn, cn, dn = (mpmath.ellipfun(name, rest, q=nome) for name in ("sn", "cn", "dn"))
            third_kind = 2 * turns * whole + mpmath.ellippi(n, mpmath.atan2(sn, cn), m)
            return sign * cn, sign * sn, dn, third_kind

    def state(t: mpf) -> State:
        cn, sn, dn, third_kind = functions(rate * t + start)
        vector = [first * cn, second * sn, third * dn]
        azimuth = size * t / j3 + size * (twice - square / j3) / (first**2 * rate) * third_kind
        tilt = mpmath.atan2(mpmath.hypot(vector[0], vector[1]), vector[2])
        spin = mpmath.atan2(vector[1], -vector[0])
        half = (azimuth + spin) / 2, (azimuth - spin) / 2
        sine, cosine = mpmath.sin(tilt / 2), mpmath.cos(tilt / 2)
        # Rz(azimuth) Ry(tilt) Rz(spin), frame with the momentum along z.
        quat = [
            -sine * mpmath.sin(half[1]),
            sine * mpmath.cos(half[1]),
            cosine * mpmath.sin(half[0]),
            cosine * mpmath.cos(half[0]),
        ]
        return vector, quat

    initial = conjugate(state(mpf(0))[1])
    return [(vector, product(initial, quat)) for vector, quat in map(state, times)]


def product(p: list, q: list) -> list:
    """Quaternion product, xyzw."""
    x, y, z, w = p
    a, b, c, d = q
    return [
        w * a + x * d + y * c - z * b,
        w * b - x * c + y * d + z * a,
        w * c + x * b - y * a + z * d,
        w * d - x * a - y * b - z * c,
    ]


def conjugate(q: list) -> list:
    """The inverse of a unit quaternion."""
    return [-q[0], -q[1], -q[2], q[3]]


def solved(moments: np.ndarray, momentum: np.ndarray, times: np.ndarray) -> tuple:
    """One case: m1, side, and truth rounded to doubles."""
    with mpmath.workdps(DIGITS):
        m1, side, states = truth(moments, momentum, times)
        vectors = [[float(v) for v in vector] for vector, _ in states]
        quats = [[float(v) if quat[3] >= 0 else -float(v) for v in quat] for _, quat in states]
        return float(m1), side, vectors, quats


def main() -> None:
    """Solve the cases of the file once more, and write the file."""
    kept = dict(np.load(FILE))
    with ProcessPoolExecutor() as pool:
        results = list(pool.map(solved, kept["moments"], kept["momentum"], kept["times"], chunksize=4))
    for name, column in zip(("m1", "side", "body_momentum", "quat_xyzw"), zip(*results)):
        new = np.array(column, dtype=kept[name].dtype)
        print(f"{name}: {np.count_nonzero(new != kept[name])} of {new.size} numbers changed")
        kept[name] = new
    np.savez_compressed(FILE, **kept)


if __name__ == "__main__":
    main()
