"""The figure of an audit: how momentum and attitude drift, and what each hypothesis leaves over."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arguments import check_file_name, check_object
from ..arrays import Array
from ..errors import MissingExtraError, unknown_name
from ..files import write_whole
from ..plotting.plot_style import BLACK, BLUE, COLUMN, GREY, SERIES, SKY, SMALL, axes_image, finish
from ._observation import Observation
from ._residuals import Residuals
from .audit_result import Audit, RunAudit
from .hypothesis import Hypothesis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_SHOWN = 8
"""Hypotheses."""
_ENDINGS = (".svg", ".pdf", ".png")
_LEAST_SHARE = 1e-6
"""Of what is to be explained: where the bars begin."""
_A_ROW = 3
"""Names of a legend beside each other."""
_LONGEST = 34
"""Letters of a name."""
_BINS = 120  # points of a curve of residuals, each the rms of the samples there
_SMALL_MULTIPLES = 2  # figures of a row


def audit_figure(found: Audit) -> Figure:
    """Drift of the momentum, error of the attitude, and what the hypotheses leave over, below each other.

    Raises
    ------
    MissingExtraError
        Without Matplotlib.

    Examples
    --------
    >>> cat, times = sp.load_body("cat_two_halves"), np.linspace(0.0, 1.0, 51)
    >>> still = sp.FloatingTrajectory(
    ...     times=times, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (51, 1)), shapes=np.zeros((51, 3)))
    >>> figure = sp.auditing.audit_figure(sp.audit(cat, still))
    >>> [ax.get_ylabel() for ax in figure.axes]
    ['momentum drift', 'attitude error [deg]']
    """
    check_object(found, "Audit", "found")
    rows = 3 if found.hypotheses else 2
    figure = _figure(1.6 * rows)
    axes = np.ravel(figure.subplots(rows, 1)).tolist()
    _drift(axes[0], found)
    _attitude(axes[1], found)
    if found.hypotheses:
        _causes(axes[2], found)
    _plain(axes)
    return figure


def flight_figure(run: RunAudit, seen: Observation) -> Figure:
    """Momentum and centre of mass in time, all samples; those that were not audited are grey.

    seen : of the whole trajectory
    """
    rows = 1 if seen.centre is None else 2
    figure = _figure(2.2 * rows)
    axes = np.ravel(figure.subplots(rows, 1, sharex=True)).tolist()
    _by_axes(axes[0], seen.times, seen.momentum, "momentum [kg m$^2$/s]")
    if seen.centre is not None:
        _by_axes(axes[1], seen.times, seen.centre - seen.centre[0], "centre of mass [m]")
        inside = (run.times[0] <= seen.times) & (seen.times <= run.times[-1])
        powers = np.vander(seen.times - run.times[0], 3)
        for values in (seen.centre - seen.centre[0]).T:
            fall = powers @ np.linalg.lstsq(powers[inside], values[inside], rcond=None)[0]
            axes[1].plot(seen.times[inside], fall[inside], color=BLACK, linewidth=0.7, linestyle=":")
    for ax in axes:
        for first, last in ((seen.times[0], run.times[0]), (run.times[-1], seen.times[-1])):
            if last > first:
                ax.axvspan(first, last, color=GREY, alpha=0.35, linewidth=0.0)
        ax.set_xlim(seen.times[0], seen.times[-1])
    axes[-1].set_xlabel("time [s]")
    _plain(axes)
    finish(axes[0], ncols=_A_ROW)
    return figure


def left_over_figure(found: Audit, shown: Sequence[Hypothesis], before: Residuals) -> Figure:
    """Residuals in time before and after each hypothesis, small multiples with the same axes.

    before : of the first run
    """
    shown = shown[:_MOST_SHOWN]
    named = {one.name for one in found.cause}
    rows = -(-len(shown) // _SMALL_MULTIPLES)
    figure = _figure(0.4 + 1.3 * rows)
    axes = np.ravel(figure.subplots(rows, _SMALL_MULTIPLES, sharex=True, sharey=True, squeeze=False)).tolist()
    times, curve = _in_time(before.seen.times, before.vector)
    for ax, one in zip(axes, shown, strict=False):
        assert one.residuals is not None
        ax.plot(times, curve, color=GREY, linewidth=1.2)
        after = _in_time(before.seen.times, one.residuals[: len(before.vector)])[1]
        ax.plot(times, after, color=BLACK if one.name in named else BLUE, linewidth=1.0)
        ax.set_title(_short(one.name), fontsize=SMALL)
        ax.set_yscale("log")
    for ax in axes[len(shown) :]:
        ax.set_visible(False)
    for ax in axes[max(len(shown) - _SMALL_MULTIPLES, 0) : len(shown)]:
        ax.set_xlabel("time [s]")
        ax.tick_params(labelbottom=True)
    _plain(axes)
    return figure


def _in_time(times: Array, vector: Array) -> tuple[Array, Array]:
    """Rms of the residuals of neighbouring samples, at most `_BINS` of them, and their times."""
    squares = (vector.reshape(-1, len(times), 3) ** 2).mean(axis=(0, 2))
    parts = np.array_split(np.arange(len(times)), min(_BINS, len(times)))
    least = np.finfo(np.float64).tiny
    return (
        np.array([times[part].mean() for part in parts]),
        np.sqrt([max(float(squares[part].mean()), least) for part in parts]),
    )


def _by_axes(ax: Axes, times: Array, values: Array, label: str) -> None:
    for axis, style, column in zip("xyz", _styles(3), values.T, strict=True):
        ax.plot(times, column, label=axis, **style)
    ax.set_ylabel(label)


def _figure(height: float) -> Figure:
    """A new one, one and a half columns wide. Raises MissingExtraError."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("figures need Matplotlib: pip install 'shapephase[plot]'") from error
    return Figure(figsize=(1.5 * COLUMN, height), layout="constrained")


def _plain(axes: Sequence[Axes]) -> None:
    for ax in axes:
        ax.tick_params(which="both", labelsize=SMALL)
        ax.xaxis.label.set_fontsize(SMALL)
        ax.yaxis.label.set_fontsize(SMALL)
        ax.spines[["top", "right"]].set_visible(False)


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST else name[:_LONGEST] + "…"


def write_audit_figure(found: Audit, file: str | os.PathLike[str]) -> None:
    """The figure of `audit_figure` as a file, by its ending .svg, .pdf or .png.

    Raises
    ------
    UnknownNameError
        For another ending.

    Examples
    --------
    >>> cat, times = sp.load_body("cat_two_halves"), np.linspace(0.0, 1.0, 51)
    >>> still = sp.FloatingTrajectory(
    ...     times=times, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (51, 1)), shapes=np.zeros((51, 3)))
    >>> print(sp.auditing.write_audit_figure(sp.audit(cat, still), "audit.svg"))
    None
    """
    check_file_name(file, "file")
    where = Path(file)
    if where.suffix.lower() not in _ENDINGS:
        raise unknown_name(f"ending of the figure {where}:", where.suffix, _ENDINGS)
    image = axes_image(audit_figure(found).axes[0], where.suffix.lower()[1:])
    write_whole(where, lambda stream: stream.write(image))


def _drift(ax: Axes, found: Audit) -> None:
    """Each run's momentum less that at its start, relative to what turns and moves the body."""
    for run, style in zip(found.runs, _styles(len(found.runs)), strict=True):
        scale = run.momentum_scale if run.momentum_scale > 0.0 else 1.0
        drift = np.linalg.norm(run.momentum - run.momentum.mean(axis=0), axis=1) / scale
        ax.plot(run.times, drift, label=_named(run.name, run.step, len(found.runs)), **style)
    ax.axhline(found.tolerance, color=GREY, linewidth=0.8, linestyle=":")
    ax.set_ylabel("momentum drift")
    ax.set_yscale("log")
    if len(found.runs) > 1:
        ax.legend(fontsize=SMALL - 1, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=_A_ROW)


def _attitude(ax: Axes, found: Audit) -> None:
    for run, style in zip(found.runs, _styles(len(found.runs)), strict=True):
        if run.attitude_error is not None:
            ax.plot(run.times, np.degrees(run.attitude_error), **style)
    ax.set_ylim(bottom=0.0)
    ax.set_ylabel("attitude error [deg]")
    ax.set_xlabel("time [s]")


def _causes(ax: Axes, found: Audit) -> None:
    """Bars of what is left over, relative to what is to be explained; those that are named are dark."""
    shown = found.hypotheses[:_MOST_SHOWN]
    named = {one.name for one in found.cause}
    rows = np.arange(len(shown))[::-1]
    shares = np.array([max(one.share, 2.0 * _LEAST_SHARE) for one in shown])
    colours = [BLACK if one.name in named else SKY for one in shown]
    ax.barh(rows, shares, left=0.0, color=colours, height=0.7)
    ax.set_xscale("log")
    ax.set_xlim(_LEAST_SHARE, 1.5)
    ax.set_yticks(rows, [_short(one.name) for one in shown])
    ax.set_xlabel("left over, as a part of what is wrong")


def _named(name: str, step: float, runs: int) -> str:
    return f"{name}, {1e3 * step:.4g} ms" if runs > 1 else name


def _styles(count: int) -> list[dict[str, Any]]:
    return [dict(SERIES[k % len(SERIES)]) for k in range(count)]
