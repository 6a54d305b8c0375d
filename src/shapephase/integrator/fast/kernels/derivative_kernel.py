"""How the attitude changes with the momentum's direction at the start: the derivative of the steps themselves.

By an imaginary change so small that its square is nothing: what is imaginary in the results is the derivative, and no
difference is taken.
"""

from __future__ import annotations

import math

import numpy as np

from .dormand_prince import STAGES
from .jit import inline, kernel
from .stage_series import CHANNELS, SIZE, STRIDE
from .steps_with_momentum import product, unscaled_step

_CHANGE = 1e-60
"""Of the direction; its products with whatever grows stay far from the smallest and the largest numbers."""


@inline
def _inverse_root(z):
    root = 1.0 / math.sqrt(z.real)
    return complex(root, -0.5 * root / z.real * z.imag)


@inline
def _cos_sin(z):
    c, s = math.cos(z.real), math.sin(z.real)
    return complex(c, -s * z.imag), complex(s, c * z.imag)


@kernel
def step_derivatives(channels, loops, direction, seeds, magnitude, marks, quaternions, slopes):
    """Quaternions (M, 4) after `marks` steps, and their derivatives (M, S, 4) along `seeds` (S, 3).

    channels: (K, 108) of one loop, at the stages one after another, times the step's length
    """
    c = np.empty(SIZE)
    for seed in range(len(seeds)):
        u = complex(direction[0], _CHANGE * seeds[seed, 0])
        v = complex(direction[1], _CHANGE * seeds[seed, 1])
        w = complex(direction[2], _CHANGE * seeds[seed, 2])
        q0, q1, q2, q3 = 0j, 0j, 0j, 1.0 + 0j
        mark = done = 0
        for _ in range(loops):
            for k in range(-1 if done == 0 else 0, len(channels)):
                if k >= 0:
                    for stage in range(STAGES):
                        for j in range(CHANNELS):
                            c[j * STRIDE + stage] = channels[k, stage * CHANNELS + j]
                    x, y, z, turn, _ = unscaled_step(c, 0, magnitude, u, v, w)
                    scale = _inverse_root(x * x + y * y + z * z)
                    x, y, z = x * scale, y * scale, z * scale
                    cosine, sine = _cos_sin(0.5 * turn)
                    b0, b1, b2, b3 = product(
                        sine * u, sine * v, sine * w, cosine,
                        y * w - z * v, z * u - x * w, x * v - y * u, 1.0 + (u * x + v * y + w * z),
                    )  # fmt: skip
                    q0, q1, q2, q3 = product(q0, q1, q2, q3, b0, b1, b2, b3)
                    scale = _inverse_root(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
                    q0, q1, q2, q3 = q0 * scale, q1 * scale, q2 * scale, q3 * scale
                    u, v, w, done = x, y, z, done + 1
                while mark < len(marks) and marks[mark] == done:
                    quaternions[mark, 0], quaternions[mark, 1] = q0.real, q1.real
                    quaternions[mark, 2], quaternions[mark, 3] = q2.real, q3.real
                    slopes[mark, seed, 0], slopes[mark, seed, 1] = q0.imag / _CHANGE, q1.imag / _CHANGE
                    slopes[mark, seed, 2], slopes[mark, seed, 3] = q2.imag / _CHANGE, q3.imag / _CHANGE
                    mark += 1
