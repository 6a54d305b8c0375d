"""The numbers by which errors are estimated, the same in machine code and without it."""

from __future__ import annotations

EPS = 2.0**-52
"""Unit of rounding."""
TINY = 1e-300
"""Keeps quotients and logarithms of coefficients defined where these are zero."""

# ---- From the tails of spectra -----------------------------------------------------------------------------------------

ROUNDING = 30.0 * EPS
"""Of a coefficient, relative to the largest: samples are right to some ten units, and their sums to thirty."""
CONVERGED_TAIL = 1e-2
"""Chebyshev degrees still missing beyond the tail of at most this part of the spectrum's middle count as convergence."""
LEAST_OF_FLOOR = 0.02
"""Of the floor: what a spectrum's estimate is at least, since tails can be small by chance."""
UNAVERAGED_PHASE = 8.0
"""[rad] phase of the missing terms, beyond the body's turn, over which they do not average out."""
NOISE_FACTOR = 4.0
"""Of the root of the sum of squared noises: their sum is hardly ever larger."""

# ---- Series with their last terms changed ------------------------------------------------------------------------------

LAST_TERMS = 2
"""Of a panel's series that are changed: two, since one may be small by chance, or by the symmetry of a motion."""
LEAST_DEGREE = 4
"""Below it a series has too few terms to show how they fall."""
SLOWEST_DECAY = 0.99
"""From one degree to the next: no slower one is believed."""
ROUNDED_TERM = 3e-14
"""Of the largest term of a series: what is smaller may be rounding, which does not fall any more."""
MISSING_FACTOR = 3.0
"""Of what is missing by the decay of the terms: they may fall more slowly beyond, and what aliases adds to it."""
FEW_TERMS = 10.0
"""Of few terms the decay is less sure: the factor is twice as large at this degree."""

# ---- How finely to step ------------------------------------------------------------------------------------------------

ORDER = 8.0
"""Of the formula."""
SIGNIFICANT = 0.2
"""A term of the rate of turning, times the panel's width, is significant above this part of the tolerance."""
DEGREES_A_RADIAN = 0.6
"""What a radian turned on a panel adds to the degrees of its series: they swing as seen from space."""
MOST_TURN = 1e9
"""[rad] on a panel, that a plan of steps is made for."""

# ---- Rounding along the motion -----------------------------------------------------------------------------------------

ROUNDING_OF_START = 4.0
"""Units: of the first attitude. Of 250 motions with errors that are rounding alone none was above the estimate."""
ROUNDING_OF_STEP = 2.0
"""Units: of a step, at random."""
ROUNDING_OF_RADIAN = 1.0
"""Units: of each radian turned."""
