"""What a report says of a motion in words."""

from __future__ import annotations

import re

import numpy as np
import pytest

import shapephase as sp
from shapephase.examples import cat_righting
from shapephase.plots.pages.report_text import joint_rows, torque_words


def test_joints_that_give_out_what_they_take_back_do_no_work():
    """From rest to rest; a motion that ends faster than it begins changes its energy by the work said."""
    cat = sp.load_body("cat")
    assert "The net work of all joints is zero" in torque_words(
        sp.reconstruct(sp.articulated(cat, cat_righting()), np.zeros(3))
    )
    pair = sp.load_body("cat_two_halves")
    path = sp.ShapePath.spline(
        [0.0, 0.3, 0.6, 1.0], [[0.0, 0.0, 0.0], [0.1, 0.0, 0.1], [0.2, 0.1, 0.4], [0.6, 0.2, 1.0]]
    )
    motion = sp.reconstruct(sp.articulated(pair, path), [0.0, 0.0, 0.005])
    first, last = motion.deformation.kinetic_energy(np.array([0.0, 1.0]), motion.angular_velocity(np.array([0.0, 1.0])))
    said = float(torque_words(motion).split("work of all joints: ")[1].split(" J")[0])
    assert said == pytest.approx(last - first, rel=5e-3)


def test_of_a_recording_no_torque_or_rate_stands_without_its_bar():
    """Of 31 samples of a second; that none is known is said, too."""
    import pandas

    body, times = sp.load_body("diver"), np.linspace(0.0, 1.0, 31)
    shapes = 0.5 * np.sin(5.0 * times[:, None] + [0.0, 1.0]) + 0.005 * np.random.default_rng(0).normal(size=(31, 2))
    table = pandas.DataFrame(shapes, columns=body.joint_names, index=pandas.Index(times, name="time [s]"))
    for smooth, torque, rate in (
        (
            0.005,
            r"N m at .* s, [\d.]+ ± [\d.]+ % of its limit.*work of all joints: [-\d.]+ ± [\d.]+ J",
            r"\([\d.]+ ± [\d.]+\)°/s",
        ),
        (None, "most of a torque may be noise", r"[\d.]+°/s ± unknown"),
    ):
        path = sp.read_shape_path(table, body, smooth=smooth)
        motion = sp.reconstruct(sp.articulated(body, path), [2.0, 3.0, 20.0])
        assert re.search(torque, torque_words(motion))
        assert all(re.fullmatch(rate, row[-1]) for row in joint_rows(body, path))
    bars = sp.path_errors(sp.read_shape_path(table, body, smooth=0.005), times, 0.005).rate
    assert np.all(bars > 0.0)
