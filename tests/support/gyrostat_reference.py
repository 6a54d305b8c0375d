"""Attitudes of gyrostats with 50 digits, by Taylor series, and how they answer to their inputs.

Run as a script it solves the cases in tests/data/gyrostat_reference.npz anew: `python -m support.gyrostat_reference`,
some minutes. They are bodies of 1 kg m^2 with momenta of about 1 kg m^2/s; the first twenty start on a separatrix.
"""

from __future__ import annotations

from pathlib import Path

import mpmath as mp
import numpy as np

FILE = Path(__file__).parents[1] / "data" / "gyrostat_reference.npz"
DIGITS = 50
ORDER = 50
"""Of the series; a step is half of what the last coefficients say their radius is."""
CHANGE = 1e-6
"""Relative change of an input by which the condition is found."""


def exact_attitude(inertia, rotor, momentum, duration):
    """R(duration) for R(0) = 1: Pi' = Pi x w, w = I^-1 (Pi - h), quaternion q' = q w/2; products of series."""
    with mp.workdps(DIGITS + 8):
        inverse = mp.inverse(mp.matrix(inertia.tolist()))
        inverse = [[inverse[i, j] for j in range(3)] for i in range(3)]
        h = [mp.mpf(float(value)) for value in rotor]
        state = [mp.mpf(float(value)) for value in momentum] + [mp.mpf(0)] * 3 + [mp.mpf(1)]
        time, end = mp.mpf(0), mp.mpf(float(duration))
        while time < end:
            rows = series(state, inverse, h)
            last = max(abs(row[-1]) for row in rows)
            step = min(end - time, mp.mpf(10) ** (-(DIGITS + 4) / mp.mpf(ORDER)) / last ** (mp.mpf(1) / ORDER))
            state = [mp.polyval(row[::-1], step) for row in rows]
            time += step
        x, y, z, w = state[3:]
        matrix = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        return np.array([[float(value) for value in row] for row in matrix])


def series(state, inverse, h):
    """Taylor coefficients of Pi and q (x y z w)."""
    p, q = [[value] for value in state[:3]], [[value] for value in state[3:]]
    rate = [[], [], []]
    for k in range(ORDER):
        for i in range(3):
            shifted = [p[j][k] - (h[j] if k == 0 else 0) for j in range(3)]
            rate[i].append(mp.fdot(inverse[i], shifted))
        back = [one[::-1] for one in rate]
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            p[i].append((mp.fdot(p[a], back[b]) - mp.fdot(p[b], back[a])) / (k + 1))
        x, y, z, w = q
        u, v, s = back
        new = (
            mp.fdot(w, u) + mp.fdot(y, s) - mp.fdot(z, v),
            mp.fdot(w, v) + mp.fdot(z, u) - mp.fdot(x, s),
            mp.fdot(w, s) + mp.fdot(x, v) - mp.fdot(y, u),
            -mp.fdot(x, u) - mp.fdot(y, v) - mp.fdot(z, s),
        )
        for row, value in zip(q, new, strict=True):
            row.append(value / (2 * (k + 1)))
    return p + q


def plain_attitudes(inertia, rotor, momentum, duration, steps=1500):
    """The same for many at once, by the classical method of Runge and Kutta: (N, ...) -> (N, 3, 3)."""
    inverse = np.linalg.inv(inertia)

    def slope(pi, turned):
        omega = np.einsum("nij,nj->ni", inverse, pi - rotor)
        spin = np.cross(np.eye(3), omega[:, None]).transpose(0, 2, 1) * -1.0
        return np.cross(pi, omega), turned @ np.swapaxes(spin, 1, 2) * -1.0

    pi, turned, step = momentum.copy(), np.broadcast_to(np.eye(3), inertia.shape).copy(), duration / steps
    for _ in range(steps):
        a = slope(pi, turned)
        b = slope(pi + 0.5 * step * a[0], turned + 0.5 * step * a[1])
        c = slope(pi + 0.5 * step * b[0], turned + 0.5 * step * b[1])
        d = slope(pi + step * c[0], turned + step * c[1])
        pi = pi + step / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0])
        turned = turned + step / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1])
    return turned


def conditions(inertia, rotor, momentum, duration):
    """How much relative changes of the inputs are magnified, added up: (N,)."""
    count = len(inertia)
    known = plain_attitudes(inertia, rotor, momentum, duration)
    total = np.ones(count)
    size = np.linalg.norm(momentum, axis=1)[:, None]
    for i in range(3):
        for j in range(i, 3):
            moved = np.zeros((3, 3))
            moved[i, j] = moved[j, i] = 1.0
            changed = inertia + CHANGE * np.linalg.norm(inertia, axis=(1, 2))[:, None, None] * moved
            total += np.abs(plain_attitudes(changed, rotor, momentum, duration) - known).max(axis=(1, 2)) / CHANGE
    for axis in np.eye(3):
        for moved in ((CHANGE * size * axis, 0.0), (0.0, CHANGE * size * axis)):
            changed = plain_attitudes(inertia, rotor + moved[0], momentum + moved[1], duration)
            total += np.abs(changed - known).max(axis=(1, 2)) / CHANGE
    return total


def main():
    kept = dict(np.load(FILE))
    inputs = kept["inertia"], kept["rotor"], kept["momentum"]
    duration = float(kept["duration"])
    kept["attitude"] = np.array([exact_attitude(*one, duration) for one in zip(*inputs, strict=True)])
    kept["condition"] = conditions(*inputs, duration)
    np.savez_compressed(FILE, **kept)


if __name__ == "__main__":
    main()
