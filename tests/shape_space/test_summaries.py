"""What a summary says of a joint motion: which joints leave their limits, which do not move."""

import numpy as np
import pytest

import shapephase as sp


def swing(body: sp.Body, joint: int, low: float, high: float) -> sp.ShapePath:
    """One joint goes from the lower value to the upper one and back; the others rest at neutral."""
    neutral = body.shape()
    shapes = np.tile(neutral, (3, 1))
    shapes[:, joint] = low, high, low
    return sp.ShapePath.waypoints([0.0, 1.0, 2.0], shapes)


@pytest.mark.parametrize("factor", [1.0, 1.0 - 1e-12, 1.0 + 1e-12])
def test_a_joint_exactly_at_its_limits_is_not_beyond_them(factor: float):
    """Neither where it reaches them to the last digit, nor where rounding falls on either side."""
    body = sp.load_body("cat")
    for joint, (lower, upper) in enumerate(body.joint_limits):
        if np.isfinite([lower, upper]).all():
            summary = sp.path_summary(body, swing(body, joint, factor * lower, factor * upper))
            assert summary.joints_beyond_limits == (), body.joint_names[joint]


def test_a_joint_faster_than_its_file_allows_is_named():
    """Up and down by a sine: its largest rate is amplitude times frequency."""
    body = sp.load_body("cat")
    joint = body.joint_index("waist_yaw")
    for share, named in ((1.0 - 1e-6, ()), (1.0, ()), (1.0 + 1e-6, ("waist_yaw",))):
        sine = np.zeros((body.n_shape, 1))
        sine[joint] = share * 30.0 / (2.0 * np.pi / 0.2)
        path = sp.ShapePath.fourier(body.shape(), np.zeros_like(sine), sine, 0.2, joint_names=body.joint_names)
        assert sp.path_summary(body, path).joints_beyond_rates == named
    wheel = sp.load_body("satellite")
    assert np.isinf(wheel.rate_limits[wheel.joint_index("wheel_spin")]) == (
        sp.path_summary(wheel, swing(wheel, wheel.joint_index("wheel_spin"), 0.0, 1e4)).joints_beyond_rates == ()
    )


def test_a_joint_beyond_one_limit_is_named():
    body = sp.load_body("cat")
    for joint, (lower, upper) in enumerate(body.joint_limits):
        name = body.joint_names[joint]
        past_upper = sp.path_summary(body, swing(body, joint, 0.5 * (lower + upper), upper + 1e-6))
        past_lower = sp.path_summary(body, swing(body, joint, lower - 1e-6, 0.5 * (lower + upper)))
        assert past_upper.joints_beyond_limits == past_lower.joints_beyond_limits == (name,)
        assert past_upper.still_joints == tuple(other for other in body.joint_names if other != name)
