"""The eighth-order formula of Dormand and Prince, stage by stage: what is added to the start of a step.

Coefficients as SciPy's DOP853 holds them (Hairer, Norsett and Wanner, Solving ODEs I); zeros are left out. `sum_k` is
for stage k, `sum_b` for the end of the step; arguments are the slopes of the stages whose numbers their names bear.
"""

from __future__ import annotations

import numpy as np

from .jit import inline

STAGES = 12
NODES = np.array([
    0.0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726, 0.3333333333333333, 0.25,
    0.3076923076923077, 0.6512820512820513, 0.6, 0.8571428571428571, 1.0,
])  # fmt: skip
"""Of the stages, in units of the step."""


@inline
def sum_1(s0):
    """What stage 1 starts from: the earlier slopes by row 1 of the tableau."""
    return 0.05260015195876773 * s0


@inline
def sum_2(s0, s1):
    """What stage 2 starts from: the earlier slopes by row 2 of the tableau."""
    return 0.0197250569845379 * s0 + 0.0591751709536137 * s1


@inline
def sum_3(s0, s2):
    """What stage 3 starts from: the earlier slopes by row 3 of the tableau."""
    return 0.02958758547680685 * s0 + 0.08876275643042054 * s2


@inline
def sum_4(s0, s2, s3):
    """What stage 4 starts from: the earlier slopes by row 4 of the tableau."""
    return 0.2413651341592667 * s0 - 0.8845494793282861 * s2 + 0.924834003261792 * s3


@inline
def sum_5(s0, s3, s4):
    """What stage 5 starts from: the earlier slopes by row 5 of the tableau."""
    return 0.037037037037037035 * s0 + 0.17082860872947386 * s3 + 0.12546768756682242 * s4


@inline
def sum_6(s0, s3, s4, s5):
    """What stage 6 starts from: the earlier slopes by row 6 of the tableau."""
    return 0.037109375 * s0 + 0.17025221101954405 * s3 + 0.06021653898045596 * s4 - 0.017578125 * s5


@inline
def sum_7(s0, s3, s4, s5, s6):
    """What stage 7 starts from: the earlier slopes by row 7 of the tableau."""
    return (
        0.03709200011850479 * s0
        + 0.17038392571223998 * s3
        + 0.10726203044637328 * s4
        - 0.015319437748624402 * s5
        + 0.008273789163814023 * s6
    )


@inline
def sum_8(s0, s3, s4, s5, s6, s7):
    """What stage 8 starts from: the earlier slopes by row 8 of the tableau."""
    return (
        0.6241109587160757 * s0
        - 3.3608926294469414 * s3
        - 0.868219346841726 * s4
        + 27.59209969944671 * s5
        + 20.154067550477894 * s6
        - 43.48988418106996 * s7
    )


@inline
def sum_9(s0, s3, s4, s5, s6, s7, s8):
    """What stage 9 starts from: the earlier slopes by row 9 of the tableau."""
    return (
        0.47766253643826434 * s0
        - 2.4881146199716677 * s3
        - 0.590290826836843 * s4
        + 21.230051448181193 * s5
        + 15.279233632882423 * s6
        - 33.28821096898486 * s7
        - 0.020331201708508627 * s8
    )


@inline
def sum_10(s0, s3, s4, s5, s6, s7, s8, s9):
    """What stage 10 starts from: the earlier slopes by row 10 of the tableau."""
    return (
        -0.9371424300859873 * s0
        + 5.186372428844064 * s3
        + 1.0914373489967295 * s4
        - 8.149787010746927 * s5
        - 18.52006565999696 * s6
        + 22.739487099350505 * s7
        + 2.4936055526796523 * s8
        - 3.0467644718982196 * s9
    )


@inline
def sum_11(s0, s3, s4, s5, s6, s7, s8, s9, s10):
    """What stage 11 starts from: the earlier slopes by row 11 of the tableau."""
    return (
        2.273310147516538 * s0
        - 10.53449546673725 * s3
        - 2.0008720582248625 * s4
        - 17.9589318631188 * s5
        + 27.94888452941996 * s6
        - 2.8589982771350235 * s7
        - 8.87285693353063 * s8
        + 12.360567175794303 * s9
        + 0.6433927460157636 * s10
    )


@inline
def sum_b(s0, s5, s6, s7, s8, s9, s10, s11):
    """What the step adds: the slopes of all stages by their weights."""
    return (
        0.054293734116568765 * s0
        + 4.450312892752409 * s5
        + 1.8915178993145003 * s6
        - 5.801203960010585 * s7
        + 0.3111643669578199 * s8
        - 0.1521609496625161 * s9
        + 0.20136540080403034 * s10
        + 0.04471061572777259 * s11
    )
