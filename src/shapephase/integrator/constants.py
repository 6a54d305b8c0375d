"""Constants of error estimates, each with what it follows from or was measured by: numerics.md section 1."""

from __future__ import annotations

EPS = 2.0**-52  # rounding of a number near 1

# ---- Samples ---------------------------------------------------------------------------------------------------------
SAMPLING_SHARE = 0.2  # of the tolerance, for the predicted turn by missing terms of series
HIDDEN_SHARE = 0.1  # of the tolerance, for what the first panels may miss of a resolved path
SLOWEST_DECAY = 0.97  # from degree to degree: the sum beyond the last term is then at most 30 times that term
CHANGED_LAST_TERMS = 3.0  # times what is missing beyond the last terms: their change, whose effect is measured
BEYOND_LAST_TERMS = 10.0  # over the degree, relative to 1: few terms show their decay less well
ROUNDED_SAMPLES = 30.0  # units of rounding in the terms of a series, by the inverse of an inertia of condition 10
RANDOM_SUM = 4.0  # standard deviations of a sum of independent errors

# ---- Steps -----------------------------------------------------------------------------------------------------------
ORDER = 8  # of the formula: half as long steps have 2^-8 of the error
# The error of finer steps is STEPPING times the distance between two step sizes, times its fall from the pair before;
# the order alone would make it 1. With 4 one motion of harmonics in 70 exceeds it, with 8 one of all kinds in 700, by
# a sixth.
STEPPING = 10.0
USUAL_TOLERANCE = 1e-9  # [rad] that of `reconstruct`
ANGLE_OF_STEP = 2.5  # [rad] turned in one of the coarsest steps, at the usual tolerance
TERMS_OF_STEP = 10.0  # of a panel's series, for one of the coarsest steps at the usual tolerance
SMALL_TERM = 0.05  # of the tolerance: steps ignore terms that turn the body by less
STEPPING_SHARE = 0.4  # of the tolerance, for the error of steps

# ---- Rounding --------------------------------------------------------------------------------------------------------
ROUNDING_OF_START = 4.0  # units of rounding in the start and the last product
ROUNDING_OF_STEP = 2.0  # units of rounding in a step; they add up as the root of the number of steps
MEASURED_ROUNDING = 4.0  # times the distance between two marches, which round differently: bound of their rounding
ROUNDED_INERTIA = 3.0  # units of rounding of an inertia's largest moment: its sums, its inverse, and one for chance
ROUNDING_SHARE = 0.05  # of the tolerance: rounding is measured where its bound is larger
