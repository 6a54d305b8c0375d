"""Cosine and sine without calls or branches, so that loops over them become vectors.

The polynomials are those of fdlibm (k_cos.c, k_sin.c), the three parts of pi/2 those of its e_rem_pio2.c.
"""

from __future__ import annotations

import math

import numpy as np

from ..machine_code import inline

MOST_ANGLE = 1e5
"""[rad]; up to here the products with the first two parts of pi/2 are exact."""
_QUARTERS = 2.0 / math.pi
_HALF_PI_1 = 1.5707963267341256
_HALF_PI_2 = 6.077100506303966e-11
_HALF_PI_3 = 2.0222662487959506e-21


@inline
def cos_sin(x):
    """Both to an ulp or so for |x| below MOST_ANGLE."""
    quarters = np.floor(x * _QUARTERS + 0.5)
    r = ((x - quarters * _HALF_PI_1) - quarters * _HALF_PI_2) - quarters * _HALF_PI_3
    z = r * r
    s = 2.7557313707070068e-06 + z * (-2.5050760253406863e-08 + z * 1.58969099521155e-10)
    s = -0.16666666666666632 + z * (0.00833333333332249 + z * (-0.0001984126982985795 + z * s))
    c = 2.480158728947673e-05 + z * (-2.7557314351390663e-07 + z * (2.087572321298175e-09 - z * 1.1359647557788195e-11))
    c = 0.0416666666666666 + z * (-0.001388888888887411 + z * c)
    s, half = r + r * (z * s), 1.0 - 0.5 * z
    c = half + (((1.0 - half) - 0.5 * z) + z * (z * c))
    quarter = quarters - 4.0 * np.floor(0.25 * quarters)
    odd = quarter == 1.0 or quarter == 3.0
    a, b = s if odd else c, c if odd else s
    return -a if quarter == 1.0 or quarter == 2.0 else a, -b if quarter >= 2.0 else b
