"""A leg whose knee, patella and arm follow two joints, and the same body with every joint driven on its own."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from scipy.interpolate import CubicSpline

from shapephase.body import Coupling
from support.bodies import joint, link, urdf

LEG = urdf(
    link("pelvis", 3.0, [0.5, 0.7, 0.9], (0.1, 0.0, -0.1)),
    link("thigh", 1.5, [0.3, 0.2, 0.35], (0.2, 0.1, 0.0)),
    link("slid", 0.1, [0.01, 0.02, 0.015], (0.0, 0.1, 0.0)),
    link("shank", 1.1, [0.15, 0.1, 0.2], (0.2, 0.0, 0.2)),
    link("patella", 0.4, [0.02, 0.015, 0.03], (0.1, 0.05, 0.0)),
    link("cap", 0.3, [0.02, 0.025, 0.03], (0.0, 0.1, 0.1)),
    link("arm", 1.2, [0.2, 0.25, 0.3], (-0.4, 0.0, 0.1)),
    joint("hip", "revolute", "pelvis", "thigh", (0.3, 1.0, 0.2), (0.5, 0.2, 0.1)),
    joint("knee_slide", "prismatic", "thigh", "slid", (1.0, 0.2, 0.0), (0.6, 0.0, 0.0)),
    joint("knee", "revolute", "slid", "shank", (0.1, 1.0, 0.4), (0.1, 0.0, 0.0)),
    joint("patella_turn", "revolute", "thigh", "patella", (0.0, 0.6, 1.0), (0.5, -0.2, 0.3)),
    joint("patella_slide", "prismatic", "patella", "cap", (0.0, 1.0, 0.0), (0.1, -0.2, 0.3)),
    joint("shoulder", "revolute", "pelvis", "arm", (0.0, 0.6, 1.0), (-0.5, -0.2, 0.3)),
    name="leg",
)  # fmt: skip
KNOTS = np.array([-0.6, -0.2, 0.1, 0.35, 0.7])
SLIDES = np.array([0.05, -0.02, 0.03, 0.11, 0.02])
TURNS = np.array([-0.5, -0.1, 0.3, 0.35, 0.9])
_POLYNOMIAL = (0.1, 0.7, -0.4, 0.3, 0.5)
_QUADRATIC = (0.02, 0.1, -0.3)


def couplings(turn):
    """The slide of the knee is a spline of the knee, the patella's turn `turn`, and its slide follows that; the arm
    follows knee and hip."""
    return {
        "knee_slide": Coupling.spline("knee", KNOTS, SLIDES),
        "patella_turn": turn,
        "patella_slide": Coupling.polynomial("patella_turn", _QUADRATIC, about=0.2),
        "shoulder": Coupling.polynomial("hip", _POLYNOMIAL, about=0.1) + Coupling.linear("knee", -0.5, 0.2),
    }  # fmt: skip


TURN = {
    "smooth": (Coupling.polynomial("knee", [0.2, -0.8, 0.5]), Polynomial([0.2, -0.8, 0.5])),
    "spline": (Coupling.spline("knee", KNOTS, TURNS, ends="natural"), CubicSpline(KNOTS, TURNS, bc_type="natural")),
}


def bounded(function, knots):
    """A SciPy function that goes on straight beyond its knots: coordinates -> values, slopes."""
    derivative = function.derivative() if hasattr(function, "derivative") else function.deriv()

    def followed(q):
        inside = q if knots is None else np.clip(q, knots[0], knots[-1])
        return function(inside) + derivative(inside) * (q - inside), derivative(inside)

    return followed


def by_hand(turn, names):
    """Coordinates and rates of all joints, in the order of `names`, from those of hip and knee: (N, 2), (N, 2)."""
    slide = bounded(CubicSpline(KNOTS, SLIDES), KNOTS)
    first = Polynomial(_POLYNOMIAL)
    second = Polynomial(_QUADRATIC)

    def all_joints(shapes, rates):
        (hip, knee), (hip_rate, knee_rate) = shapes.T, rates.T
        slid, slide_slope = slide(knee)
        turned, turn_slope = turn(knee)
        arm = first(hip - 0.1) - 0.5 * knee + 0.2
        found = {
            "hip": (hip, hip_rate),
            "knee": (knee, knee_rate),
            "knee_slide": (slid, slide_slope * knee_rate),
            "patella_turn": (turned, turn_slope * knee_rate),
            "patella_slide": (second(turned - 0.2), second.deriv()(turned - 0.2) * turn_slope * knee_rate),
            "shoulder": (arm, first.deriv()(hip - 0.1) * hip_rate - 0.5 * knee_rate),
        }  # fmt: skip
        return tuple(np.column_stack([found[name][k] for name in names]) for k in (0, 1))

    return all_joints
