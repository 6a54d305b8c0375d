"""A rigid body of three different moments in the gravity gradient of a circular orbit, to thirty digits.

Taylor series of forty terms in forty-five digits: every equation is made of products. Run as a script,
`python -m support.gravity_gradient_reference`, it writes `tests/data/gravity_gradient.json`, and says by how much steps
half as long differ.
"""

from __future__ import annotations

import json
from pathlib import Path

FILE = Path(__file__).parents[1] / "data" / "gravity_gradient.json"
MOMENTS = ("1", "1.6", "2.1")
# Of the orbit [rad/s]
RATE = "1"
# Attitudes are the identity at the start; momenta are those of the body then.
STARTS = (("0.3", "0.2", "2.0"), ("0.05", "-0.9", "0.4"), ("-0.6", "0.1", "3.5"))
TIMES = ("2.5", "5", "7.5", "10")
_TERMS = 40
_DIGITS = 45
# Of a step [s]
_STEP = "0.125"


def motion(start, halvings=0):
    """Quaternion x y z w and body momentum at each of TIMES, as strings of thirty digits."""
    import mpmath

    mpmath.mp.dps = _DIGITS
    mpf = mpmath.mpf
    moments, rate = [mpf(one) for one in MOMENTS], mpf(RATE)
    # Quaternion, body momentum, cosine and sine of the orbit's angle.
    state = [mpf(0), mpf(0), mpf(0), mpf(1), *(mpf(one) for one in start), mpf(1), mpf(0)]
    step = mpf(_STEP) / 2**halvings
    found, t = [], mpf(0)
    for end in TIMES:
        while t < mpf(end):
            series = _series(state, moments, rate, mpf)
            state = [sum(term * step**power for power, term in enumerate(one)) for one in series]
            t += step
        found.append([mpmath.nstr(one, 30) for one in state[:7]])
    return found


def _series(state, moments, rate, mpf):
    """Taylor coefficients of the state."""
    terms = [[one] for one in state]
    squares = [[[] for _ in range(4)] for _ in range(4)]
    direction = [[] for _ in range(3)]
    torques = [[] for _ in range(3)]
    omegas = [[] for _ in range(3)]

    def product(a, b, n):
        return sum((a[k] * b[n - k] for k in range(n + 1)), mpf(0))

    for n in range(_TERMS):
        q, pi, (c, s) = terms[:4], terms[4:7], terms[7:]
        for i in range(4):
            for j in range(i, 4):
                squares[i][j].append(product(q[i], q[j], n))
        xx, yy, zz, ww = (squares[i][i] for i in range(4))
        xy, xz, xw, yz, yw, zw = (squares[i][j] for i, j in ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)))
        # Rows one and two of R: R^T (c, s, 0) is what they sum to.
        one = [[xx, yy, zz, ww], [xy, zw], [xz, yw]]
        rows = (
            ([one[0][0][k] - one[0][1][k] - one[0][2][k] + one[0][3][k] for k in range(n + 1)],
             [2 * (xy[k] - zw[k]) for k in range(n + 1)], [2 * (xz[k] + yw[k]) for k in range(n + 1)]),
            ([2 * (xy[k] + zw[k]) for k in range(n + 1)],
             [yy[k] - xx[k] - zz[k] + ww[k] for k in range(n + 1)], [2 * (yz[k] - xw[k]) for k in range(n + 1)]),
        )  # fmt: skip
        for axis in range(3):
            direction[axis].append(product(rows[0][axis], c, n) + product(rows[1][axis], s, n))
            omegas[axis].append(pi[axis][n] / moments[axis])
        for axis in range(3):
            i, j = (axis + 1) % 3, (axis + 2) % 3
            # 3 n^2 r x I r
            torques[axis].append(3 * rate**2 * (moments[j] - moments[i]) * product(direction[i], direction[j], n))
        change = [
            (product(q[3], omegas[0], n) + product(q[1], omegas[2], n) - product(q[2], omegas[1], n)) / 2,
            (product(q[3], omegas[1], n) + product(q[2], omegas[0], n) - product(q[0], omegas[2], n)) / 2,
            (product(q[3], omegas[2], n) + product(q[0], omegas[1], n) - product(q[1], omegas[0], n)) / 2,
            -(product(q[0], omegas[0], n) + product(q[1], omegas[1], n) + product(q[2], omegas[2], n)) / 2,
        ]
        for axis in range(3):
            i, j = (axis + 1) % 3, (axis + 2) % 3
            change.append(product(pi[i], omegas[j], n) - product(pi[j], omegas[i], n) + torques[axis][n])
        change += [-rate * s[n], rate * c[n]]
        for one_term, slope in zip(terms, change, strict=True):
            one_term.append(slope / (n + 1))
    return terms


if __name__ == "__main__":
    import mpmath

    values = [motion(start) for start in STARTS]
    halved = [motion(start, 1) for start in STARTS]
    worst = max(
        abs(mpmath.mpf(a) - mpmath.mpf(b))
        for one, other in zip(values, halved, strict=True)
        for first, second in zip(one, other, strict=True)
        for a, b in zip(first, second, strict=True)
    )
    print(f"steps half as long differ by {mpmath.nstr(worst, 3)}")
    FILE.write_text(json.dumps({"motions": values}, indent=1) + "\n")
