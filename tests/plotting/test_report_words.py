"""What a report says of a motion in words."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.examples import cat_righting
from shapephase.plotting._report_text import torque_words


def test_joints_that_give_out_what_they_take_back_do_no_work():
    """From rest to rest; a motion that ends faster than it begins changes its energy by the work said."""
    cat = sp.load_body("cat")
    assert "do no work" in torque_words(sp.reconstruct(sp.articulated(cat, cat_righting()), np.zeros(3)))
    pair = sp.load_body("cat_two_halves")
    path = sp.ShapePath.spline(
        [0.0, 0.3, 0.6, 1.0], [[0.0, 0.0, 0.0], [0.1, 0.0, 0.1], [0.2, 0.1, 0.4], [0.6, 0.2, 1.0]]
    )
    motion = sp.reconstruct(sp.articulated(pair, path), [0.0, 0.0, 0.005])
    first, last = motion.deformation.kinetic_energy(np.array([0.0, 1.0]), motion.angular_velocity(np.array([0.0, 1.0])))
    said = float(torque_words(motion).split("a work of ")[1].split(" J")[0])
    assert said == pytest.approx(last - first, rel=5e-3)
