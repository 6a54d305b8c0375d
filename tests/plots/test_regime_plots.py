"""The crown and the bars of bounds show what the certificate and the bounds say."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.path import Path

import shapephase as sp
from shapephase.bounds.all_bounds import bounds
from shapephase.bounds.regimes import crown_region
from shapephase.errors import ShapeError
from shapephase.examples import printed_antenna
from shapephase.plots import column_axes, plot_bounds, plot_crown


@pytest.fixture(scope="module")
def antenna():
    example = printed_antenna(3)
    return example, sp.reconstruct(example.deformation, example.momentum)


def test_the_crown_is_filled_where_the_momentum_can_be(antenna):
    example, motion = antenna
    crown = crown_region(example.deformation, example.momentum)
    elevation, azimuth = np.radians([50.0, 20.0])
    eye = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    up = np.cross(eye, right)
    ax = plot_crown(column_axes(3.4), crown, motion, view=(50.0, 20.0))
    filled = next(shape for shape in ax.collections if len(shape.get_facecolor()))
    rings = [Path(ring) for path in filled.get_paths() for ring in path.to_polygons()]
    rng = np.random.default_rng(8)
    shown = []
    for x, y in rng.uniform(-0.95, 0.95, (400, 2)):
        if x * x + y * y > 0.9:
            continue
        direction = x * right + y * up + np.sqrt(1.0 - x * x - y * y) * eye
        near = crown.contains(direction + 0.02 * rng.normal(size=(40, 3)))
        # Next to the edge the grid of the picture may differ.
        if near.all() or not near.any():
            drawn = sum(ring.contains_point((x, y)) for ring in rings) % 2 == 1
            shown.append(drawn == near.all())
    assert len(shown) > 100
    assert all(shown)
    curve = np.concatenate([np.array(line.get_data()).T for line in ax.lines if line.get_linewidth() == 1.6])
    times = np.linspace(0.0, motion.duration, 800)
    projected = motion.body_momentum(times) @ np.stack([right, up], axis=-1) / np.linalg.norm(example.momentum)
    for point in projected[::37]:
        assert np.abs(curve - point).max(axis=1).min() < 1e-12
    assert r"crown: where $\Pi$ can be" in [text.get_text() for text in ax.get_legend().get_texts()]


def test_a_crown_that_cannot_be_seen_is_not_in_the_legend():
    """Of a rigid body the energy is certain, and the crown is its polhode, without a width."""
    body = sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0)
    ax = plot_crown(column_axes(3.4), crown_region(body, [0.1, 0.2, 2.0]), sp.reconstruct(body, [0.1, 0.2, 2.0]))
    assert not any("crown" in text.get_text() for text in ax.get_legend().get_texts())
    assert "thinner than a line" in ax.get_legend().get_title().get_text()


def test_bars_are_as_long_as_bounds_are_tight(antenna):
    found = bounds(antenna[1])
    ax = plot_bounds(column_axes(4.0), found)
    drawn = {}
    for container in ax.containers:
        for bar in container:
            drawn[round(bar.get_y() + 0.5 * bar.get_height())] = (bar.get_width(), container.get_label())
    names = [label.get_text() for label in ax.get_yticklabels()]
    assert names == [bound.name for bound in found]
    for place, bound in enumerate(reversed(found)):
        assert drawn[place] == (bound.tightness, "upper bound" if bound.is_upper else "lower bound")


def test_what_cannot_be_drawn_is_refused(antenna):
    example, motion = antenna
    crown = crown_region(example.deformation, example.momentum)
    with pytest.raises(ShapeError, match="flat"):
        plot_crown(column_axes(projection="3d"), crown)
    with pytest.raises(ShapeError, match="bounds"):
        plot_bounds(column_axes(), ())
    batch = sp.reconstruct(motion.deformation, np.tile(example.momentum, (2, 1)))
    with pytest.raises(ShapeError, match="batch"):
        plot_crown(column_axes(), crown, batch)


def test_a_crown_over_the_whole_sphere_ends_at_the_limb_without_steps():
    sweep = sp.articulated(sp.load_body("satellite"), sp.examples.satellite_sweep())
    ax = plot_crown(column_axes(3.4), crown_region(sweep, [0.0, 0.0, 1.0]))
    (filled,) = [shape for shape in ax.collections if len(shape.get_facecolor())]
    (square,) = [ring for path in filled.get_paths() for ring in path.to_polygons()]
    assert square.min(axis=0) == pytest.approx([-1.0, -1.0])
    assert square.max(axis=0) == pytest.approx([1.0, 1.0])
    ends = ax.transData.transform([(-1.0, -1.0), (1.0, 1.0)])
    clip = filled.get_clip_path().get_transformed_points_and_affine()
    box = clip[1].transform_path(clip[0]).get_extents()
    assert np.reshape(box.get_points(), (2, 2)) == pytest.approx(ends, abs=1e-6)
