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
from ..plots.plot_style import BLACK, BLUE, COLUMN, GREY, SERIES, SKY, SMALL, axes_image, finish
from ._observation import Observation
from ._residuals import Residuals
from .audit_result import Audit, RunAudit
from .hypothesis import Hypothesis, milliseconds

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_SHOWN = 8  # hypotheses
_ENDINGS = (".svg", ".pdf", ".png")
_LEAST_SHARE = 1e-6  # where the bars begin
_A_ROW = 3  # names of a legend beside each other
_LONGEST = 34  # letters of a name
_BINS = 120  # points of a curve of residuals, each the rms of the samples there


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
    ['momentum drift [1]', 'attitude error [deg]']
    """
    check_object(found, "Audit", "found")
    rows = 3 if found.hypotheses else 2
    figure = _figure(1.5 * COLUMN, 1.6 * rows)
    axes = np.ravel(figure.subplots(rows, 1)).tolist()
    _drift(axes[0], found)
    _attitude(axes[1], found)
    if found.hypotheses:
        _causes(axes[2], found)
    _plain(axes)
    return figure


def momentum_figure(run: RunAudit, seen: Observation) -> Figure:
    """Momentum about the centre of mass in time, all samples; those that were not audited are grey.

    seen : of the whole trajectory
    """
    return _in_flight(run, seen.times, seen.momentum, "angular momentum [kg m$^2$/s]")


def fall_figure(run: RunAudit, seen: Observation) -> Figure | None:
    """Centre of mass in time, with the nearest parabolas of the samples that were audited; None without places."""
    if seen.centre is None:
        return None
    inside = (run.first_time <= seen.times) & (seen.times <= run.last_time)
    powers = np.vander(seen.times - run.first_time, 3)
    places = seen.centre - seen.centre[inside][0]
    fall = powers @ np.linalg.lstsq(powers[inside], places[inside], rcond=None)[0]
    figure = _in_flight(run, seen.times, places, "centre of mass [m]")
    for values in fall[inside].T:
        figure.axes[0].plot(seen.times[inside], values, color=BLACK, linewidth=0.6, linestyle=":")
    return figure


def left_over_figures(found: Audit, before: Residuals) -> list[tuple[Hypothesis, Figure]]:
    """Residuals in time before and after each hypothesis that keeps them, the best first, with the same axes.

    before : of the first run
    """
    kept = [(one, one.residuals) for one in found.hypotheses if one.residuals is not None][:_MOST_SHOWN]
    named = {cause.name for cause in found.cause}
    start = before.in_time(before.vector)
    times, curve = _in_time(before.seen.times, start)
    after = [_in_time(before.seen.times, vector[: len(start)])[1] for _, vector in kept]
    every = np.concatenate([curve, *after])
    drawn = []
    for (hypothesis, _), left in zip(kept, after, strict=True):
        figure = _figure(COLUMN, 1.7)
        ax = figure.add_subplot()
        ax.plot(times, curve, color=GREY, linewidth=1.4)
        ax.plot(times, left, color=BLACK if hypothesis.name in named else BLUE, linewidth=1.2)
        ax.set_yscale("log")
        ax.set_ylim(0.5 * every.min(), 2.0 * every.max())
        ax.set_xlabel("time [s]")
        ax.set_ylabel("residuals [noise]")
        _plain([ax])
        drawn.append((hypothesis, figure))
    return drawn


def _in_flight(run: RunAudit, times: Array, values: Array, label: str) -> Figure:
    figure = _figure(COLUMN, 2.4)
    ax = figure.add_subplot()
    for axis, style, column in zip("xyz", _styles(3), values.T, strict=True):
        ax.plot(times, column, label=axis, **style)
    for first, last in ((times[0], run.first_time), (run.last_time, times[-1])):
        if last > first:
            ax.axvspan(first, last, color=GREY, alpha=0.35, linewidth=0.0)
    ax.set_xlim(times[0], times[-1])
    ax.set_xlabel("time [s]")
    ax.set_ylabel(label)
    _plain([ax])
    finish(ax, ncols=_A_ROW)
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


def _figure(width: float, height: float) -> Figure:
    """A new one [in]. Raises MissingExtraError."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("figures need Matplotlib: pip install 'shapephase[plot]'") from error
    return Figure(figsize=(width, height), layout="constrained")


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
    ax.set_ylabel("momentum drift [1]")
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
    return f"{name}, {milliseconds(step)} ms" if runs > 1 else name


def _styles(count: int) -> list[dict[str, Any]]:
    return [dict(SERIES[k % len(SERIES)]) for k in range(count)]
