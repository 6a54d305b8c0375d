"""Shares of limbs in a turn: bars by group, and what momentum and joints did in time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..arguments import check_object
from ..errors import WrongObjectError
from ..segments.limb_contributions import Contributions
from ._joint_styles import plain_text
from .plot_style import (
    BLACK,
    BLUE,
    COLUMN,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    SMALL,
    VERMILION,
    check_flat_axes,
    column_axes,
    in_time,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS = (BLUE, ORANGE, GREEN, SKY, VERMILION, PURPLE)
_BAR = 0.4  # height of a bar: two for each group, and a gap
_LINE = 0.32  # [in] height of a group in the figure: two bars and two lines of small letters
_HEAD = 1.1  # [in] of legend and axis


def plot_shares(ax: Axes, shares: Contributions) -> Axes:
    """Draw for each group what it adds on average (Shapley), and what is lost with it on the baseline.

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
    lost = shares.whole - shares.without[: len(names)]
    for values, errors, offset, colour, text in (
        (shares.shared, shares.errors, -0.5, BLUE, "shared: average over all orders"),
        (lost, np.full(len(names), shares.error), 0.5, ORANGE, "lost when held"),
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
    named, others = order[: len(_COLOURS)], order[len(_COLOURS) :]
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
