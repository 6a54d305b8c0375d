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

DEGREES_A_STEP = 4.5
"""Significant Chebyshev degrees of a panel that one step may span."""
TURN_A_STEP = 2.0
"""[rad] bound of the turn in one step; it is up to twice the turn itself."""
SHORT_TURN_A_STEP = 0.6
"""[rad] the same where the propagator of a step must be right over a long motion without the steps' derivative."""
DISTANCE = 10.0**-8.1
"""The distance between so many steps and half as many: this times the root of the sum of the panels' squared errors,
each the sum of its terms times the eighth power of their degree over half the steps. Three of four random motions
need no more."""
AIM = 1000.0
"""Of the tolerance: the distance that is planned for; its part that counts is far smaller, and so is the usual one."""

FAR = 25.0
"""[rad] bound of the whole turn (some fifteen radians indeed) from which errors of the propagators have added up to
more than an estimate can bear."""
VERY_FAR = 100.0
"""[rad] the same of short steps; they were right to 3 % in turns of half as much, and to 30 % in the double."""
MANY_STEPS = 4000.0
"""Steps of one motion from which on propagators are not integrated along: the derivative of coarser ones costs less."""
NEGLIGIBLE = 0.15
"""Of the tolerance: below, what the samplers say, amplified, is not worth a march of its own, though it is too much."""
FORESEEN = 1.5
"""Of the tolerance: what defects would come to if they added up may be this large; most of it cancels along the way."""
MOST_ODD = 16
"""Steps of a panel up to which their number may be odd; one more of many costs little and hides nothing from pairs."""
FORESEEN_AT_REST = 0.6
"""The same without momentum, where the defects of the series themselves foretell the error."""
NEAR = 0.5
"""Of what is allowed for: steps that are foreseen to make so much of it are not made longer."""
ROUNDED_DOWN = 0.4
"""Of a step on a panel: without momentum so much less than a whole one is left out, which on average costs nothing."""
LOOKS_AT_REST = 3
"""At what defects foretell of a plan without momentum, before any step is taken; with it one shows all there is."""
FEW_STEPS = 1000.0
"""Of a motion, up to which a look ahead pays: of more a second round costs little but the steps themselves."""
MOST_SHORTENED = 4.0
"""How many times the steps become more at once."""
EXPECTED_GROWTH = 0.2
"""What errors are expected to grow by for each radian turned, before it is known."""
MOST_EXPECTED_GROWTH = 30.0

# ---- Another round -------------------------------------------------------------------------------------------------

MOST_STEPPING = 0.5
"""Of the room that rounding leaves: what the error of the steps may take up of a round that is not good enough."""
MOST_SAMPLING = 0.4
"""And that of the samples."""
REFINED = 0.5
"""Of that room: what a further round aims at."""
INFORMATIVE_ERROR = 0.1
"""[rad] distance of coarser steps up to which the propagators of the steps are trusted."""
LITTLE_ROUNDING = 0.01
"""Of the tolerance: rounding below is not looked at closely."""
DENSE_SHARE = 5e-3
"""Of the error at the ends of the steps: what the polynomials between them may add."""

# ---- The error of steps, from their distance from pairs ----- -----------------------------------------------------

FULL_ORDER = 2.0**-8
"""The part of the distance that the error is where steps are so short that it falls by the order of the formula."""
DEFECT_STEPS = 64
"""Steps of a panel, that the formula's defects are tabulated for."""
DEFECT_DEGREES = 192
"""And terms of its series."""
DEGREES_OF_TURN = 0.5
"""What a radian turned on a panel adds to the degrees of its terms, where the part is found that an error falls by."""
BY_CHANCE = 4.0
"""How many times the part that defects foretell the error may be, where all panels are alike, none cancels another and
errors do not grow. Two more factors tell how much more it may be otherwise: the sixteenth root of how many times the
distance is what defects would come to if they added up, and a power of evenness. Fitted so that of 23,000 motions,
hostile functions and loops of one harmonic among them, one was above, by a third."""
POWER_OF_EVENNESS = 0.375
"""Of how few panels the defects come from: of few it is likelier that steps and half of them agree by chance."""
MOST_GROWTH_BY_CHANCE = 20.0
"""Of errors along the motion, whose root counts: where they grow, fewer steps make the distance, and chance counts
more. A larger growth counts no more."""
NEARLY_AT_REST = 5.0
"""Added to one, how many times more chance counts where there is next to no momentum: swings of the body that cancel in
steps and in pairs of them alike. Of 2,500 loops with little momentum four were above without it, by up to 4.8 times."""
LITTLE_TURN = 0.1
"""[rad] by the momentum alone, where that counts half."""
AT_REST = 1.5
"""Without momentum steps are compared with twice as many, which are so much nearer that the distance is the error: how
many times the error of all times may be larger than that of the steps' ends."""
LEAST_ORDER = 2.0
"""By which errors fall at least when steps are made shorter."""
UNRESOLVED = 0.125
"""A term whose defect falls to no less than this part from pairs to steps is not seen by these: it adds its own."""

# ---- Rounding along the motion -------------------------------------------------------------------------------------

ROUNDING_OF_START = 4.0
"""Units: of the first attitude. Of 250 motions with errors that are rounding alone none was above the estimate."""
ROUNDING_OF_STEP = 2.0
"""Units: of a step, at random."""
ROUNDING_OF_RADIAN = 1.0
"""Units: of each radian turned."""
MEASURED_ROUNDING = 0.5
"""Of the tolerance: a bound above it is not believed before other marches have been looked at."""
OTHER_ROUNDINGS = 4
"""Of these marches, each on series through samples that are rounded otherwise."""
LEAST_NOISE = 0.25
"""Units, of a series' largest coefficient: by what its coefficients are off on these series at least."""
ROUNDING_BY_CHANCE = 3.0
"""How many times the largest of their distances the error due to rounding may be."""
LEAST_OF_BOUND = 1.0 / 6.0
"""Of the bound, that distances are believed."""

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
