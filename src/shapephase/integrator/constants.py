"""Constants of error estimates, each with what it follows from or was measured by: numerics.md section 1."""

from __future__ import annotations

EPS = 2.0**-52
"""Of rounding."""

# ---- Samples ---------------------------------------------------------------------------------------------------------
SAMPLING_SHARE = 0.2
"""Of the tolerance: what the terms that are missing from series may turn the body by, as far as it is foreseen."""
HIDDEN_SHARE = 0.1
"""Of the tolerance: what the first panels may leave unseen of a path that is resolved."""
SLOWEST_DECAY = 0.97
"""Of terms from one degree to the next: of what falls more slowly the sum beyond the last is 30 times that at most."""
CHANGED_LAST_TERMS = 3.0
"""Times what is missing beyond the last terms, by which they are changed to see what that does to an attitude."""
BEYOND_LAST_TERMS = 10.0
"""Over the degree: few terms show their decay less well."""
ROUNDED_SAMPLES = 30.0
"""Units of rounding: what the inverse of an inertia of condition 10 leaves in the terms of a series."""
RANDOM_SUM = 4.0
"""Standard deviations of a sum of errors that are independent of each other."""

# ---- Steps -----------------------------------------------------------------------------------------------------------
ORDER = 8
"""Of the formula: half as long steps have 2^-8 of the error."""
STEPPING = 10.0
"""Times the distance between two step sizes, times by how much it fell from the pair before, is the error of the finer
steps; the formula's order alone would make it 1. Measured: with 4 one motion of harmonics in 70 exceeds it, with 8 one
of all kinds in 700, by a sixth."""
ANGLE_OF_STEP = 2.5
"""[rad] that a body turns in one of the coarsest steps at a tolerance of 1e-9."""
TERMS_OF_STEP = 10.0
"""Of a panel's series, that one such step follows."""
SMALL_TERM = 0.05
"""Of the tolerance: terms that turn the body by less are not followed."""
STEPPING_SHARE = 0.4
"""Of the tolerance: what the error of steps may take."""

# ---- Rounding --------------------------------------------------------------------------------------------------------
ROUNDING_OF_START = 4.0
"""Units of rounding in the start and the last product."""
ROUNDING_OF_STEP = 2.0
"""Units of rounding of a step, which add up as the root of their number."""
MEASURED_ROUNDING = 4.0
"""Times the distance between two marches, which round differently: their rounding is not larger."""
ROUNDED_INERTIA = 3.0
"""Units of rounding of an inertia, relative to its largest moment: of its sums, of its inverse, and one for chance."""
ROUNDING_SHARE = 0.05
"""Of the tolerance: a bound of rounding above it is measured."""
