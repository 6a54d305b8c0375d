"""Momentum of links stacked in time; somersault, tilt and twist of an athlete."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..arguments import check_choice, check_object
from ..arrays import Array
from ..reconstruction.reconstruction import Motion
from ..segments.momentum import SegmentMomentum
from ._joint_styles import plain_text
from .plot_style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SERIES,
    SKY,
    VERMILION,
    check_flat_axes,
    degrees_first,
    in_time,
    motion_times,
    one_motion,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HEIGHT = 3.4  # [in] of the stacked figure: its legend has up to five lines
_COLOURS = (BLUE, ORANGE, SKY, VERMILION, GREEN, PURPLE, GREY)
_FILLS = ("", "////", "....")  # of areas beyond the seventh, whose colours come again
_WIDE = 26  # letters of a name in a legend of two columns


def plot_segment_momentum(ax: Axes, momentum: SegmentMomentum, axis: str | None = None) -> Axes:
    """Draw one component of the momentum in time: links stacked above and below zero, the whole as a line with bars.

    A body of more than seven links is drawn by limbs. Flights have a mark on the axis of time.

    Parameters
    ----------
    ax : flat axes
    momentum : by `segment_momentum`
    axis : one of its axes; None: that along which the whole is largest, rms

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.5)
    >>> found = sp.segment_momentum(sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005]))
    >>> ax = sp.plots.plot_segment_momentum(sp.plots.column_axes(), found)
    >>> ax.get_legend().get_texts()[0].get_text()
    'front'
    """
    check_object(momentum, "SegmentMomentum", "momentum", call="segment_momentum(motion)")
    check_flat_axes(ax)
    if axis is not None:
        check_choice(axis, "axis of this momentum", momentum.axes)
    sizes = (momentum.whole**2).mean(axis=0)
    if not sizes.any():
        sizes = (momentum.by_link**2).mean(axis=(0, 1))
    along = int(np.argmax(sizes)) if axis is None else momentum.axes.index(axis)
    by_link = dict(zip(momentum.links, np.moveaxis(momentum.by_link, 1, 0), strict=True))
    parts = by_link if len(by_link) <= len(_COLOURS) else momentum.by_limb()
    times, whole, bars = momentum.times, momentum.whole[:, along], momentum.whole_bars[:, along]
    # Areas above zero and below it, each on those of the same sign.
    above, below = np.zeros_like(times), np.zeros_like(times)
    handles, texts = [], []
    for k, (name, values) in enumerate(parts.items()):
        up, down = np.maximum(values[:, along], 0.0), np.minimum(values[:, along], 0.0)
        look: dict[str, Any] = {
            "facecolor": _COLOURS[k % len(_COLOURS)],
            "hatch": _FILLS[k // len(_COLOURS) % len(_FILLS)],
        }
        for start, added in ((above, up), (below, down)):
            area = ax.fill_between(times, start, start + added, linewidth=0.3, edgecolor="white", **look)
        handles.append(area)
        texts.append(plain_text(name))
        above, below = above + up, below + down
    if (momentum.as_recorded and bars.max() > 0.0) or not whole.any():
        ax.fill_between(times, whole - bars, whole + bars, color=BLACK, alpha=0.3, linewidth=0.0)
    handles += ax.plot(times, whole, color=BLACK, linewidth=1.3)
    texts.append("whole ± σ" if momentum.as_recorded else "whole")
    low = min(float(below.min()), float(whole.min()))
    for flight in momentum.flights if momentum.as_recorded else ():
        ends = (flight.first_time, flight.last_time)
        (mark,) = ax.plot(ends, (low, low), color=BLACK, linewidth=0.8, marker="|", clip_on=False)
        if "flight" not in texts:
            handles.append(mark)
            texts.append("flight")
    unit = {"1": "1", "1/s": "1/s"}.get(momentum.unit, "kg m$^2$/s")
    columns = 1 if max(map(len, texts)) > _WIDE else 2
    above_axes = {"ncols": columns, "loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
    label = f"momentum, {momentum.axes[along]} [{unit}]"
    in_time(ax, (times[0], times[-1]), label, handles=handles, labels=texts, **above_axes)
    return ax


def plot_somersault(ax: Axes, motion: Motion, *, times: Array | None = None) -> Axes:
    """Draw somersault, tilt and twist in degrees, with bands of the numerical error where that is seen.

    Parameters
    ----------
    ax : flat axes
    motion : of an athlete, no batch; axes as by `Motion.athlete_axes`
    times : (N,) where to draw [s]; None: several in each step of the integrator

    Examples
    --------
    >>> dive = sp.examples.full_dive()
    >>> motion = sp.reconstruct(dive.deformation, dive.momentum)
    >>> ax = sp.plots.plot_somersault(sp.plots.column_axes(), motion)
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['somersault', 'tilt', 'twist']
    """
    check_object(motion, "Motion", "motion")
    check_flat_axes(ax)
    one_motion(motion)
    t = motion_times(motion, times)
    angles, errors = motion.somersault_tilt_twist(t), motion.somersault_errors(t)
    for name, angle, error, style in zip(("somersault", "tilt", "twist"), angles, errors, SERIES, strict=False):
        ax.fill_between(t, angle - error, angle + error, color=style["color"], alpha=0.3, linewidth=0.0)
        ax.plot(t, angle, label=name, **style)
    in_time(ax, (t[0], t[-1]), "[rad]")
    degrees_first(ax, "angle", radians=False)
    return ax
