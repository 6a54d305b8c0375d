"""Figures of a store: the spread of an output, its quantiles along a grid, and maps over two grids."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..arguments import check_choice, check_object, names_argument
from ..arrays import Array
from ..errors import StudyError, unknown_name
from ..plots.plot_style import BLACK, BLUE, GREY, SERIES, SKY, SMALL, check_flat_axes, finish
from ..warning_filters import quiet
from .store import StudyStore

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_KINDS = ("histogram", "quantiles", "map")  # in the order of how many grids they need
_FEWEST_BINS = 10  # 2 n^(1/3) (Rice) where that is more
_MOST_BINS = 120  # no more than a column shows
_BANDS = ((0.05, 0.95, 0.35, "9 of 10 cases"), (0.25, 0.75, 0.8, "half of them"))  # quantiles, opacity, label
_TICKS = 6  # numbers of five letters that have room along a column


class _Grid(NamedTuple):
    """A grid as an axis: its places, in degrees where they are angles, and names where it has no numbers."""

    name: str
    label: str
    places: Array
    names: list[str]


def plot_study(
    ax: Axes, store: StudyStore, output: str, *, kind: str | None = None, along: str | Sequence[str] = ()
) -> Axes:
    """Draw one number of each case: its spread, its quantiles along a grid, or its median over two grids.

    Cases without results are left out; angles are shown in degrees. What is not an axis of the figure, draws and other
    grids, is taken together.

    Parameters
    ----------
    ax : flat axes
    output : a name of the store's; an entry of an array as in a table, `final_attitude_0_1`
    kind : "histogram", of up to six values of a grid one for each; "quantiles"; or "map"; None: what the grids permit,
        of two a map, of one quantiles
    along : grids that are the axes; none: the first

    Raises
    ------
    UnknownNameError
        For another output, kind or grid.
    StudyError
        If the study has too few grids, or no case has a value.
    MissingExtraError
        Without Matplotlib.

    Examples
    --------
    >>> over = {"momentum_z": [0.0, 0.1, 0.2], "masses": sp.study.LogNormal(0.05)}
    >>> study = sp.study.Study("cat", "cat_righting", over, outputs=("turn",), draws=4)
    >>> ax = sp.study.plot_study(sp.plots.column_axes(), study.run("drawn.zarr", workers=0), "turn")
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('momentum z [kg m²/s]', 'turn [deg]')
    """
    check_flat_axes(ax)
    check_object(store, "StudyStore", "store")
    grids = {name: _grid(store, name) for name in store.attributes["grids"]}
    given = (along,) if isinstance(along, str) else names_argument(along, "along", "names of grids")
    for name in given:
        check_choice(name, "grid of the study", grids)
    chosen = [*given, *(name for name, grid in grids.items() if len(grid.places) > 1 and name not in given)]
    kind = _KINDS[min(len(given) or len(chosen), 2)] if kind is None else kind
    check_choice(kind, "kind of figure", _KINDS)
    needed = _KINDS.index(kind)
    if len(chosen) < needed:
        raise StudyError(f"a figure of kind {kind!r} needs {needed} grids, the study has {len(chosen)}")
    values, label = _values(store, output)
    is_series = kind == "histogram" and len(chosen) == 1 and len(grids[chosen[0]].places) <= len(SERIES)
    axes = [grids[name] for name in chosen[: 1 if is_series else needed]]
    table = values.reshape(*(len(grid.places) for grid in grids.values()), -1)
    table = np.moveaxis(table, [list(grids).index(grid.name) for grid in axes], range(len(axes)))
    cells = table.reshape(*(len(grid.places) for grid in axes), -1)
    # A cell in which all cases failed stays empty.
    with quiet(category=RuntimeWarning):
        if kind == "histogram":
            _draw_histogram(ax, cells, label, axes)
        elif kind == "quantiles":
            _draw_quantiles(ax, cells, label, *axes)
        else:
            _draw_map(ax, cells, label, *axes)
    return ax


def _grid(store: StudyStore, name: str) -> _Grid:
    values = store.attributes["grids"][name]
    if isinstance(values[0], str) or np.ndim(values) > 1:
        names = values if isinstance(values[0], str) else []
        return _Grid(name, name.replace("_", " "), np.arange(len(values), dtype=float), names)
    factor, label = _shown(name, store.attributes["units"][name])
    return _Grid(name, label, factor * np.asarray(values, dtype=float), [])


def _values(store: StudyStore, output: str) -> tuple[Array, str]:
    """Return one number of each case, and its label. Raises UnknownNameError, StudyError."""
    units = {name: unit for name, unit in store.attributes["units"].items() if name not in store.attributes["grids"]}
    text = output if isinstance(output, str) else ""
    name = next((name for name in units if text == name or text.startswith(f"{name}_")), None)
    if name is None:
        raise unknown_name("output of the study", output, units)
    values = store.values(name)
    try:
        numbers = values[(slice(None), *(int(place) for place in text.removeprefix(name).split("_")[1:]))]
    except (ValueError, IndexError):
        raise unknown_name(f"entry of {name}", output, [f"{name}{'_0' * (values.ndim - 1)}"]) from None
    if numbers.ndim > 1:
        example = f"{output}{'_0' * (numbers.ndim - 1)}"
        raise StudyError(
            f"{output}: one number of each case is drawn, this has {numbers[0].size}; name one, as {example}"
        )
    if not np.isfinite(numbers).any():
        raise StudyError(f"{output}: no case has a value yet")
    factor, label = _shown(output, units[name])
    return factor * numbers, label


def _shown(name: str, unit: str) -> tuple[float, str]:
    """Return what numbers are multiplied by, and their label."""
    factor, unit = (180.0 / np.pi, "deg") if unit == "rad" else (1.0, unit.replace("^2", "²"))
    return factor, name.replace("_", " ") + (f" [{unit}]" if unit else "")


def _draw_histogram(ax: Any, cells: Array, label: str, series: list[_Grid]) -> None:
    finite = cells[np.isfinite(cells)]
    bins = int(np.clip(2.0 * len(finite) ** (1.0 / 3.0), _FEWEST_BINS, _MOST_BINS))
    edges = np.histogram_bin_edges(finite, bins)
    if series:
        names = series[0].names or [f"{place:.4g}" for place in series[0].places]
        for name, row, style in zip(names, cells, SERIES, strict=False):
            ax.hist(row[np.isfinite(row)], edges, histtype="step", label=name, **style)
        finish(ax, title=series[0].label)
    else:
        ax.hist(finite, edges, color=SKY)
        low, middle, high = np.quantile(finite, [0.05, 0.5, 0.95])
        ax.axvline(middle, color=BLUE, linewidth=1.4, label=f"median {middle:.4g}")
        for place, name in ((low, f"5 % and 95 %: {low:.4g}, {high:.4g}"), (high, None)):
            ax.axvline(place, color=BLACK, linewidth=1.0, linestyle=(0, (4, 2)), label=name)
        finish(ax)
    ax.set_xlabel(label, fontsize=SMALL)
    ax.set_ylabel("cases", fontsize=SMALL)


def _draw_quantiles(ax: Any, cells: Array, label: str, grid: _Grid) -> None:
    has_bands = cells.shape[-1] > 1
    for low, high, opacity, name in _BANDS if has_bands else ():
        ends = np.nanquantile(cells, [low, high], axis=-1)
        ax.fill_between(grid.places, *ends, color=SKY, alpha=opacity, linewidth=0.0, label=name)
    middle = np.nanmedian(cells, axis=-1)
    ax.plot(grid.places, middle, color=BLUE, linewidth=1.6, marker=".", label="median" if has_bands else None)
    ax.grid(color=GREY, alpha=0.3, linewidth=0.5)
    ax.margins(x=0.0)
    _name_axis(ax.xaxis, grid)
    ax.set_ylabel(label, fontsize=SMALL)
    if has_bands:
        finish(ax, ncols=3)
    ax.tick_params(labelsize=SMALL)


def _draw_map(ax: Any, cells: Array, label: str, across: _Grid, up: _Grid) -> None:
    middle = np.nanmedian(cells, axis=-1).T
    mesh = ax.pcolormesh(across.places, up.places, middle, shading="nearest", cmap="viridis", rasterized=True)
    _name_axis(ax.xaxis, across)
    _name_axis(ax.yaxis, up)
    ax.tick_params(labelsize=SMALL)
    bar = ax.figure.colorbar(mesh, ax=ax)
    bar.set_label(label, fontsize=SMALL)
    bar.ax.tick_params(labelsize=SMALL)


def _name_axis(axis: Any, grid: _Grid) -> None:
    axis.set_label_text(grid.label, fontsize=SMALL)
    if grid.names:
        axis.set_ticks(grid.places, grid.names)
    else:
        axis.get_major_locator().set_params(nbins=_TICKS)
