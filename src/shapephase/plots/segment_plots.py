"""Momentum of links stacked in time; somersault, tilt and twist of an athlete; shares of limbs in a turn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..arguments import check_choice, check_keywords, check_object
from ..arrays import Array
from ..error_bars.angles_in_time import somersault_bars
from ..errors import WrongObjectError
from ..reconstruction.reconstruction import Motion
from ..segments.limb_contributions import Contributions
from ..segments.momentum import SegmentMomentum
from ._joint_styles import plain_text
from .plot_style import (
    BLACK,
    BLUE,
    COLUMN,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SERIES,
    SKY,
    SMALL,
    VERMILION,
    check_flat_axes,
    column_axes,
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
_NAMED = len(_COLOURS) - 1  # sources of a turn with an area of their own; the others are grey
_WIDE = 26  # letters of a name in a legend of two columns
_BAR = 0.4  # height of a bar: two for each group, and a gap
_LINE = 0.32  # [in] height of a group in the figure: two bars and two lines of small letters
_HEAD = 1.1  # [in] of legend and axis
_TIMES_OF_BARS = 61  # between which error bars are drawn straight: fewer miss how those of a twist grow in a somersault
_ERRORS = ("joints", "inertias", "momentum", "attitude", "start", "rotors")


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


def plot_somersault(ax: Axes, motion: Motion, *, times: Array | None = None, **errors: Any) -> Axes:
    """Draw somersault, tilt and twist in degrees, with bands of the error where that is seen.

    Without errors of the inputs the bands are those of the numerical error; with them two standard deviations, whose
    largest the legend states.

    Parameters
    ----------
    ax : flat axes
    motion : of an athlete, no batch; axes as by `Motion.athlete_axes`
    times : (N,) where to draw [s]; None: several in each step of the integrator
    errors : joints, inertias, momentum, attitude, start or rotors, as for `error_bars.somersault_bars`

    Examples
    --------
    >>> dive = sp.examples.full_dive()
    >>> motion = sp.reconstruct(dive.deformation, dive.momentum)
    >>> ax = sp.plots.plot_somersault(sp.plots.column_axes(), motion)
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['somersault', 'tilt', 'twist']
    """
    check_object(motion, "Motion", "motion")
    check_keywords(errors, plot_somersault, _ERRORS)
    check_flat_axes(ax)
    one_motion(motion)
    t = motion_times(motion, times)
    angles, widths = motion.somersault_tilt_twist(t), motion.somersault_errors(t)
    names = ["somersault", "tilt", "twist"]
    if errors:
        known = np.linspace(t[0], t[-1], _TIMES_OF_BARS)
        bars = somersault_bars(motion, known, **errors)
        widths = tuple(2.0 * np.interp(t, known, bar) for bar in bars)
        names = [f"{name} ± {np.degrees(width.max()):.2g}°" for name, width in zip(names, widths, strict=True)]
    for name, angle, width, style in zip(names, angles, widths, SERIES, strict=False):
        ax.fill_between(t, angle - width, angle + width, color=style["color"], alpha=0.3, linewidth=0.0)
        ax.plot(t, angle, label=name, **style)
    in_time(ax, (t[0], t[-1]), "[rad]", title="± 2 standard deviations, at most" if errors else None)
    degrees_first(ax, "angle", radians=False)
    return ax


def plot_shares(ax: Axes, shares: Contributions) -> Axes:
    """Draw for each group what it adds on average (Shapley), and what is lost with it on the baseline.

    Error bars are those of a recording's noise and of random orders, one standard deviation, else numerical errors.

    Parameters
    ----------
    ax : flat axes
    shares : by `contributions`

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> motion = sp.reconstruct(sp.articulated(cat, sp.examples.kane_scher(0.3, 0.6)), np.zeros(3))
    >>> shares = sp.contributions(motion, of="rotation", about=[1.0, 0.0, 0.0])
    >>> len(sp.plots.plot_shares(sp.plots.column_axes(), shares).patches)  # two bars for each of three joints
    6
    """
    check_object(shares, "Contributions", "shares")
    check_flat_axes(ax)
    names, places = list(shares.groups), np.arange(len(shares.groups))
    lost, bars = shares.whole - shares.without[: len(names)], shares.bars
    of_lost = np.full(len(names), shares.error) if bars is None else bars.lost[: len(names)]
    for values, errors, offset, colour, text in (
        (shares.shared, shares.shared_bars[: len(names)], -0.5, BLUE, "shared: average over all orders"),
        (lost, of_lost, 0.5, ORANGE, "lost when held"),
    ):
        ax.barh(places + offset * _BAR, values / shares.scale, _BAR, color=colour, label=text,
                xerr=errors / shares.scale, error_kw={"elinewidth": 0.8, "capsize": 1.5})  # fmt: skip
    ax.axvline(0.0, color=BLACK, linewidth=0.8)
    ax.set_yticks(places, [plain_text(name) for name in names], fontsize=SMALL)
    ax.invert_yaxis()
    ax.tick_params(axis="x", labelsize=SMALL)
    unit = f" [{shares.unit}]" if shares.unit else ""
    ax.set_xlabel(f"{plain_text(shares.of)}{unit}", fontsize=SMALL)
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), fontsize=SMALL, frameon=False)
    return ax


def plot_direct_shares(ax: Axes, shares: Contributions) -> Axes:
    """Draw what momentum and joints did to an angle in time, as stacked areas, and the angle itself as a line.

    Parameters
    ----------
    ax : flat axes
    shares : by `contributions`, of a result that has direct shares; six sources with the largest are named

    Raises
    ------
    WrongObjectError
        For a result without direct shares.

    Examples
    --------
    >>> dive = sp.reconstruct(
    ...     sp.articulated(sp.load_body("diver"), sp.examples.MOTIONS["diver_twist"].path()), [0.0, 61.558831, 0.0]
    ... )
    >>> len(sp.plots.plot_direct_shares(sp.plots.column_axes(), sp.contributions(dive)).lines)
    1
    """
    check_object(shares, "Contributions", "shares")
    check_flat_axes(ax)
    direct = shares.direct
    if direct is None:
        raise WrongObjectError(
            f"shares: {shares.of} has no direct shares; take 'twist', 'tilt', 'somersault' or 'rotation'"
        )
    values = direct.shares / shares.scale
    order = np.argsort(-np.abs(values).max(axis=0), kind="stable")
    order = order[np.abs(values[:, order]).max(axis=0) > 0.0]
    # In the order of the body, so that a limb has one colour here and in the figure of the momentum.
    named, others = np.sort(order[:_NAMED]), order[_NAMED:]
    bands: list[tuple[Any, str, str]] = [
        (values[:, k], colour, direct.sources[k]) for k, colour in zip(named, _COLOURS, strict=False)
    ]
    if len(others):
        bands.append((values[:, others].sum(axis=1), GREY, f"{len(others)} others"))
    above, below = np.zeros((2, len(direct.times)))
    handles = []
    for band, colour, _ in bands:
        up, down = np.maximum(band, 0.0), np.minimum(band, 0.0)
        handles.append(ax.fill_between(direct.times, above, above + up, color=colour, linewidth=0.0))
        ax.fill_between(direct.times, below, below + down, color=colour, linewidth=0.0)
        above, below = above + up, below + down
    (line,) = ax.plot(direct.times, direct.angle / shares.scale, color=BLACK, linewidth=1.4)
    texts = [plain_text(name) for _, _, name in bands]
    in_time(
        ax, (direct.times[0], direct.times[-1]), f"{shares.of} [{shares.unit}]", handles=[line, *handles],
        labels=["sum", *texts], ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0),
    )  # fmt: skip
    return ax


def contributions_figure(shares: Contributions) -> Axes:
    """Return the first axes of a figure one column wide: bars by group, and below them the direct shares in time.

    Examples
    --------
    >>> dive = sp.reconstruct(
    ...     sp.articulated(sp.load_body("diver"), sp.examples.MOTIONS["diver_twist"].path()), [0.0, 61.558831, 0.0]
    ... )
    >>> len(sp.plots.contributions_figure(sp.contributions(dive)).figure.axes)
    2
    """
    check_object(shares, "Contributions", "shares")
    bars = _HEAD + _LINE * len(shares.groups)
    if shares.direct is None:
        return plot_shares(column_axes(bars), shares)
    areas = 0.75 * COLUMN
    first = column_axes(bars + areas)
    figure = first.figure
    figure.clear()
    first, second = figure.subplots(2, 1, height_ratios=[bars, areas])
    plot_shares(first, shares)
    plot_direct_shares(second, shares)
    return first
