"""The numbers by which errors are estimated, the same in machine code and without it."""

from __future__ import annotations

EPS = 2.0**-52
"""Unit of rounding."""
TINY = 1e-300
"""Keeps quotients and logarithms of coefficients defined where these are zero."""

# ---- From the tails of spectra -------------------------------------------------------------------------------------

ROUNDING = 30.0 * EPS
"""Of a coefficient, relative to the largest: samples are right to some ten units, and their sums to thirty."""
CONVERGED_TAIL = 1e-2
"""A tail of at most this part of the spectrum's middle counts as convergence of what is missing beyond it."""
LEAST_OF_FLOOR = 0.02
"""Of the floor: what a spectrum's estimate is at least, since tails can be small by chance."""
UNAVERAGED_PHASE = 8.0
"""[rad] phase of the missing terms, beyond the body's turn, over which they do not average out."""
NOISE_FACTOR = 4.0
"""Of the root of the sum of squared noises: their sum is hardly ever larger."""

# ---- Finer panels --------------------------------------------------------------------------------------------------

HALF_DEGREE = 10
"""Of both halves of a bisected panel: enough to see how fast the spectrum decays."""
HIGHEST_DEGREE = 80
"""Of a panel; bisecting needs fewer samples than a higher degree."""
MOST_RAISED = 4
"""How many times the degree can be raised by at once."""
MOST_MISSING = 3.1
"""Times the degree: a panel that misses more degrees is bisected."""

# ---- Series with their last terms changed --------------------------------------------------------------------------

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

# ---- How finely to step --------------------------------------------------------------------------------------------

ORDER = 8.0
"""Of the formula."""
SIGNIFICANT = 0.2
"""A term of the rate of turning, times the panel's width, is significant above this part of the tolerance."""
DEGREES_A_RADIAN = 0.6
"""What a radian turned on a panel adds to the degrees of its series: they swing as seen from space."""
MOST_TURN = 1e9
"""[rad] on a panel, that a plan of steps is made for."""

DEGREES_A_STEP = 2.4
"""Significant Chebyshev degrees of a panel that one step may span, so that half as many steps still see all of them."""
TURN_A_STEP = 2.0
"""[rad] bound of the turn in one step; it is up to twice the turn itself."""
SHORT_TURN_A_STEP = 0.6
"""[rad] the same where the propagator of a step must be right over a long motion without the steps' derivative."""
DISTANCE = 10.0**-8.1
"""The distance between so many steps and half as many: this times the root of the sum of the panels' squared errors,
each the sum of its terms times the eighth power of their degree over half the steps. Three of four random motions
need no more."""
AIM = 40.0
"""Of the tolerance: the distance that is planned for; its part that counts is far smaller, and so is the usual one."""

# ---- The error of steps, from their distance from half as many -----------------------------------------------------

NOT_SMALL = 0.02
"""Of the distance: terms above count when it is asked how many degrees a step spans."""
SPANNED_DEGREES = (1.6, 1.9, 2.4, 3.0, 3.5, 5.0)
"""For each the error is a part of the distance. An eighth-order formula would allow 1/255; that is the median of 1,200
random motions, half of them with bumps and ramps that hide. It is less sure the more degrees a step spans: of 10,000
motions one came to 1/9.6 at 2.2 degrees."""
PARTS_OF_DISTANCE = (1.0 / 80.0, 1.0 / 32.0, 1.0 / 8.0, 1.0 / 5.0, 1.0 / 4.0, 1.0)
"""Their logarithms are joined by straight lines."""
CHANCE_DEGREES = (1.6, 2.4)
"""The distance of steps that span so many degrees may be small by chance."""
CHANCE_PARTS = (0.0, 0.005)
"""Of the tolerance: then the error is at least this, joined by a straight line, as far as the distance allows."""
MOST_BY_CHANCE = 0.25
"""Of the distance: more error than that was never hidden by chance."""

# ---- Rounding along the motion -------------------------------------------------------------------------------------

ROUNDING_OF_START = 4.0
"""Units: of the first attitude. Of 250 motions with errors that are rounding alone none was above the estimate."""
ROUNDING_OF_STEP = 2.0
"""Units: of a step, at random."""
ROUNDING_OF_RADIAN = 1.0
"""Units: of each radian turned."""

# ---- Polynomials of the dense output -------------------------------------------------------------------------------

TERMS = 6
"""Of Taylor's series at each end of a piece; the polynomials have twice as many coefficients. With six they are a
hundred times nearer to the motion than the steps of most tolerances, and more terms only add rounding."""

# ---- Columns of a table of panels' estimates: nine numbers a panel -------------------------------------------------
INVERSE = 0
"""Error of I^-1 by its tail; that of I^-1 L_o follows in the next column."""
DECAY = 2
"""Of the spectrum, per degree; the slower one of both."""
CONVERGING = 3
"""One where both tails are far below the middle, else zero."""
AT_ROUNDING = 4
"""One where both tails are rounding, else zero."""
INVERSE_NORM = 5
"""The largest term of I^-1."""
DRIFT_NORM = 6
"""The largest term of I^-1 L_o."""
FLOOR = 7
"""What rounding alone leaves of I^-1; that of I^-1 L_o follows."""
