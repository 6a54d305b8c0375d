"""Free rigid bodies to 60 digits, in tests/data/euler_top_reference.npz.

`python tests/support/euler_top_reference.py` rewrites them.

Every case is a body with principal moments and body momentum given as doubles, taken as exact numbers. The truth is the
textbook solution at 120 digits, where no cancellation matters: momentum by the Jacobi functions of mpmath, attitude by
the ZYZ angles with Legendre's incomplete integral of the third kind (theory.md H9, D17); elementary where the body is
symmetric, steady or on the separatrix. It takes some minutes.

A characteristic time is I_mid/|Pi| (for extreme ratios see `characteristic_time`). The arrays, N cases of K times each:
names (kinds,), kind (N,), moments (N, 3), momentum (N, 3) in body axes at t = 0, m1 (N,) the complementary parameter,
side (N,) of the separatrix (1: Pi circles the axis of the largest moment, -1: of the smallest, 0: neither), times
(N, K), body_momentum (N, K, 3), quat_xyzw (N, K, 4) with the identity at t = 0.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from fractions import Fraction
from math import isqrt

import mpmath
import numpy as np
from mpmath import mpf

from .places import DATA

FILE = DATA / "euler_top_reference.npz"
DIGITS = 120
TIMES = (0.37, 3.0, 31.4, 100.0, -7.3, -100.0)
EXTREME = "extreme ratios and sizes"
ORDERS = list(itertools.permutations(range(3)))
OCTANTS = np.array(list(itertools.product([1.0, -1.0], repeat=3)))

Case = tuple[np.ndarray, np.ndarray]
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


def arranged(rng: np.random.Generator, moments: list, momentum: list, count: int) -> Case:
    """The axes in one of the six orders, the momentum in one of the eight octants, by the case's number."""
    order = list(ORDERS[count % 6])
    signs = OCTANTS[(count // 6 + rng.integers(2)) % 8]
    return np.array(moments, dtype=float)[order], (np.abs(np.array(momentum, dtype=float)) * signs)[order]


def apart(rng: np.random.Generator) -> list[float]:
    """Three ascending moments, of ratios up to four, each 5% from the next at least."""
    while True:
        moments = np.sort(2.0 ** rng.uniform(-1.0, 1.0, 3))
        if np.all(np.diff(np.log(moments)) > 0.05):
            return moments.tolist()


def with_parameter(rng: np.random.Generator, moments: list[float], m1: float, side: int) -> list[float]:
    """A momentum of doubles with this m1: the third component is solved for, another nudged until rounding suits."""
    i1, i2, i3 = map(mpf, moments)
    wanted = mpf(m1)
    if side < 0:
        i1, i3 = i3, i1
    base, second = rng.uniform(0.2, 1.0), rng.uniform(0.1, 1.5)
    best, off = None, mpf("inf")
    for nudge in range(20000):
        first = float(base + (-1) ** nudge * ((nudge + 1) // 2) * np.spacing(base))
        pull = mpf(first) ** 2 * (i2 - i1) / i1 * (i3 - i1)
        pull += wanted * (i3 - i2) * mpf(second) ** 2 * (i2 - i1) / i2
        solved = float(mpmath.sqrt(pull * i3 / ((i3 - i2) * (i3 - i1) * (1 - wanted))))
        momentum = [first, second, solved] if side > 0 else [solved, second, first]
        found, where = parameter([mpf(v) for v in moments], [mpf(v) for v in momentum])
        miss = abs(mpmath.log(found / wanted)) if where == side and found > 0 else mpf("inf")
        if miss < off:
            best, off = momentum, miss
        if off < 0.2:
            break
    assert best is not None
    return best


def ladder(side: int) -> Callable[[np.random.Generator], Iterator[Case]]:
    """m1 from 1 to 1e-18, even in its logarithm."""

    def cases(rng: np.random.Generator) -> Iterator[Case]:
        for count, exponent in enumerate(np.linspace(0.0, 18.0, 121)):
            m1 = min(10.0**-exponent, 0.999)
            moments = apart(rng)
            yield arranged(rng, moments, with_parameter(rng, moments, m1, side), count)

    return cases


def nearly_equal(which: str) -> Callable[[np.random.Generator], Iterator[Case]]:
    """Relative differences from 1e-2 to 1e-14."""

    def cases(rng: np.random.Generator) -> Iterator[Case]:
        for count, exponent in enumerate(np.repeat(np.arange(2, 15), 5)):
            gaps = 10.0**-exponent * rng.uniform(0.5, 2.0, 2)
            low = rng.uniform(0.5, 2.0)
            near, other = low * (1.0 + gaps[0]), low * rng.uniform(1.3, 2.5)
            moments = {
                "lower": [low, near, other],
                "upper": [low, other, other * (1.0 + gaps[1])],
                "three": [low, near, near * (1.0 + gaps[1])],
            }[which]
            yield arranged(rng, moments, rng.standard_normal(3).tolist(), count)

    return cases


def nearly_equal_at_the_separatrix(rng: np.random.Generator) -> Iterator[Case]:
    """Both at once: differences of 1e-2 to 1e-10, m1 of 1e-2 to 1e-14."""
    for count in range(48):
        gap, m1 = 10.0 ** -rng.uniform(2.0, 10.0), 10.0 ** -rng.uniform(2.0, 14.0)
        low = rng.uniform(0.5, 2.0)
        moments = [[low, low * (1 + gap), 1.7 * low], [low, 1.7 * low, 1.7 * low * (1 + gap)]][count // 6 % 2]
        yield arranged(rng, moments, with_parameter(rng, moments, m1, 1 - 2 * (count % 2)), count)


def axisymmetric(rng: np.random.Generator) -> Iterator[Case]:
    """Exactly equal pairs, oblate and prolate; every tenth momentum across the axis, or nearly."""
    for count in range(60):
        equal, other = rng.uniform(0.5, 2.0), rng.uniform(0.5, 2.0)
        momentum = np.abs(rng.standard_normal(3))
        if count % 10 >= 8:
            momentum[2] = 1e-9 * (count % 2)
        yield arranged(rng, [equal, equal, other], momentum.tolist(), count)


def spherical(rng: np.random.Generator) -> Iterator[Case]:
    """Three equal moments."""
    for count in range(24):
        yield arranged(rng, [10.0 ** rng.uniform(-1, 1)] * 3, rng.standard_normal(3).tolist(), count)


def steady(rng: np.random.Generator) -> Iterator[Case]:
    """Exactly about each axis, the unstable one among them."""
    for count in range(54):
        yield arranged(rng, apart(rng), (rng.uniform(0.3, 3.0) * np.eye(3)[count // 6 % 3]).tolist(), count)


def nearly_steady(rng: np.random.Generator) -> Iterator[Case]:
    """Off each axis by 1e-2 to 1e-16."""
    for count in range(90):
        momentum = 10.0 ** -rng.uniform(2.0, 16.0) * rng.standard_normal(3)
        momentum[count // 6 % 3] = rng.uniform(0.3, 3.0)
        yield arranged(rng, apart(rng), momentum.tolist(), count)


def on_the_separatrix(rng: np.random.Generator) -> Iterator[Case]:
    """Moments whose separatrix has a rational slope, so that doubles lie on it exactly."""
    found = []
    for a, b, c in itertools.combinations(range(1, 41), 3):
        slope = Fraction(c * (b - a), a * (c - b))
        root = Fraction(isqrt(slope.numerator), isqrt(slope.denominator))
        if root * root == slope and c <= 4 * a:
            found.append((a, b, c, root))
    for count in range(72):
        a, b, c, root = found[rng.integers(len(found))]
        scale = float(rng.integers(1, 1 << 20)) / (1 << 20)
        middle = rng.uniform(0.0, 3.0) * scale * root.numerator if count % 9 else 0.0
        unit = 2.0 ** rng.integers(-5, 5)
        momentum = [root.denominator * scale, middle, root.numerator * scale]
        yield arranged(rng, [a * unit, b * unit, c * unit], momentum, count)


def extreme(rng: np.random.Generator) -> Iterator[Case]:
    """Moments of ratios down to 1e-6 without a triangle inequality, sizes from 1e-6 to 1e6."""
    pins = [[1e-6, 1.0, 1.1], [1e-6, 2e-6, 1.0], [1e-6, 1e-3, 1.0], [1e-6, 1.0, 1.0]]
    shapes = [*pins, [1e-3, 0.7, 1.0], [1.0, 1.3, 2.0]]
    for count in range(96):
        size, strength = 10.0 ** rng.uniform(-6.0, 6.0, 2)
        moments = [size * m for m in shapes[count // 6 % 6]]
        direction = np.abs(rng.standard_normal(3))
        if count % 4 == 3:
            direction[rng.integers(3)] *= 1e-5
        yield arranged(rng, moments, (strength * direction).tolist(), count)


KINDS: dict[str, Callable[[np.random.Generator], Iterator[Case]]] = {
    "about the largest": ladder(1),
    "about the smallest": ladder(-1),
    "lower pair nearly equal": nearly_equal("lower"),
    "upper pair nearly equal": nearly_equal("upper"),
    "all nearly equal": nearly_equal("three"),
    "nearly equal at the separatrix": nearly_equal_at_the_separatrix,
    "axisymmetric": axisymmetric,
    "spherical": spherical,
    "steady": steady,
    "nearly steady": nearly_steady,
    "separatrix": on_the_separatrix,
    EXTREME: extreme,
}


def solved(case: tuple[str, np.ndarray, np.ndarray]) -> tuple:
    """One case: times, m1, side, and truth rounded to doubles."""
    kind, moments, momentum = case
    with mpmath.workdps(DIGITS):
        times = np.array(TIMES) * characteristic_time(kind, moments, momentum)
        m1, side, states = truth(moments, momentum, times)
        vectors = [[float(v) for v in vector] for vector, _ in states]
        quats = [[float(v) if quat[3] >= 0 else -float(v) for v in quat] for _, quat in states]
        return times, float(m1), side, vectors, quats


def characteristic_time(kind: str, moments: np.ndarray, momentum: np.ndarray) -> float:
    """I_mid/|Pi|, in which a body of extreme ratios may turn by 1e6 rad; there no more than 1 rad at its fastest."""
    usual = float(np.median(moments) / np.linalg.norm(momentum))
    return min(usual, float(np.sqrt(moments.min() / np.sum(momentum**2 / moments)))) if kind == EXTREME else usual


def main() -> None:
    """Write the file."""
    begun = time.time()
    rng = np.random.default_rng(15081834)
    jobs = []
    with mpmath.workdps(DIGITS):
        for kind, cases in KINDS.items():
            jobs += [(kind, *case) for case in cases(rng)]
    print(f"{len(jobs)} cases made in {time.time() - begun:.0f} s", flush=True)
    with ProcessPoolExecutor() as pool:
        results = list(pool.map(solved, jobs, chunksize=4))
    columns = [np.array(column) for column in zip(*results)]
    times, m1, side, momenta, quats = columns
    names = list(KINDS)
    kind = np.array([names.index(job[0]) for job in jobs], dtype=np.uint8)
    for index, name in enumerate(names):
        rows = kind == index
        print(f"{name:32} {rows.sum():4d} cases, m1 {m1[rows].min():.1e} to {m1[rows].max():.1e}")
    FILE.parent.mkdir(exist_ok=True)
    np.savez_compressed(
        FILE,
        names=np.array(names),
        kind=kind,
        moments=np.array([job[1] for job in jobs]),
        momentum=np.array([job[2] for job in jobs]),
        m1=m1,
        side=side.astype(np.int8),
        times=times,
        body_momentum=momenta,
        quat_xyzw=quats,
    )
    print(f"{FILE.name}: {FILE.stat().st_size / 1e3:.0f} kB, {time.time() - begun:.0f} s")


if __name__ == "__main__":
    main()
