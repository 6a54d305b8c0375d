"""Screws against a hinge and a slide along one axis, moved together."""

import numpy as np
import pytest

import shapephase as sp
from support.bodies import link, urdf

LEAD = 0.07  # [m/rad]
ENDS = '<parent link="{}"/><child link="{}"/>'
PLACE = '<origin xyz="0.1 0.2 -0.3" rpy="0.3 -0.2 0.5"/><axis xyz="0.2 0.5 1.0"/>'


@pytest.fixture(scope="module")
def bodies(tmp_path_factory):
    trunk, nut = link("trunk", 2.0, [0.3, 0.2, 0.1]), link("nut", 0.7, [0.02, 0.05, 0.06], (0.1, 0.2, 0.3))
    screw = (
        f'<drake:joint name="thread" type="screw">{ENDS.format("trunk", "nut")}{PLACE}'
        f'<drake:screw_thread_pitch value="{2 * np.pi * LEAD!r}"/></drake:joint>'
    )
    hinge = f'<joint name="thread" type="continuous">{ENDS.format("trunk", "between")}{PLACE}</joint>'
    slide = (
        f'<joint name="slide" type="prismatic">{ENDS.format("between", "nut")}<axis xyz="0.2 0.5 1.0"/>'
        '<limit lower="-9" upper="9" effort="0" velocity="0"/></joint>'
    )
    files = [tmp_path_factory.mktemp("screws") / f"{name}.urdf" for name in ("screw", "pair")]
    files[0].write_text(urdf(trunk, nut, screw))
    files[1].write_text(urdf(trunk, nut, '<link name="between"/>', hinge, slide))
    return tuple(map(sp.load_body, files))


def test_inertia_and_momentum_are_those_of_a_hinge_with_a_slide(bodies):
    turns = np.linspace(-7.0, 7.0, 25)[:, None]
    screw, pair = bodies
    both = turns * [1.0, LEAD]
    np.testing.assert_allclose(screw.locked_inertia(turns), pair.locked_inertia(both), rtol=1e-13, atol=1e-13)
    momenta = pair.momentum_matrix(both) @ [[1.0], [LEAD]]
    np.testing.assert_allclose(screw.momentum_matrix(turns), momenta, rtol=1e-13, atol=1e-13)


def test_the_body_turns_as_one_with_a_hinge_and_a_slide(bodies):
    def final(body, *strokes):
        path = sp.ShapePath.fourier(np.zeros(len(strokes)), np.zeros((len(strokes), 1)), np.array([strokes]).T, 3.0)
        return sp.reconstruct(sp.articulated(body, path), [0.1, 0.2, 0.3]).final_attitude

    screw, pair = bodies
    np.testing.assert_allclose(final(screw, 1.0), final(pair, 1.0, LEAD), atol=1e-11)
