"""Figures of a store: how an output is spread, how it goes along a grid, and maps over two grids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arguments import check_choice, check_object, names_argument
from ..arrays import Array
from ..errors import StudyError, unknown_name
from ..plots.plot_style import BLACK, BLUE, GREY, SERIES, SKY, SMALL, check_flat_axes, finish
from ..warning_filters import quiet
from .store import StudyStore

if TYPE_CHECKING:
    from matplotlib.axes import Axes

KINDS = ("histogram", "quantiles", "map")
# Bins of a histogram: 2 n^(1/3) after Rice, but no more than a column shows.
_FEWEST_BINS = 10
_MOST_BINS = 120
# The bands of quantiles: half and nine tenths of the cases are in them.
_HALF = (0.25, 0.75)
_MOST = (0.05, 0.95)
_DEGREES = 180.0 / np.pi
# Numbers along an axis, at most: of five letters each they have room in a column.
_TICKS = 6


def plot_study(
    ax: Axes, store: StudyStore, output: str, *, kind: str | None = None, along: str | Sequence[str] = ()
) -> Axes:
    """One number of each case: how it is spread, its quantiles along a grid, or its median over two grids.

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
    grids = [_Grid.of(store, name) for name in store.attributes["grids"]]
    given = (along,) if isinstance(along, str) else names_argument(along, "along", "names of grids")
    for name in given:
        check_choice(name, "grid of the study", [grid.name for grid in grids])
    chosen = [next(grid for grid in grids if grid.name == name) for name in given]
    chosen += [grid for grid in grids if len(grid.places) > 1 and grid not in chosen]
    if kind is None:
        kind = KINDS[min(len(given) or len(chosen), 2)]
    check_choice(kind, "kind of figure", KINDS)
    if len(chosen) < KINDS.index(kind):
        raise StudyError(f"a figure of kind {kind!r} needs {KINDS.index(kind)} grids, the study has {len(chosen)}")
    values, label = _values(store, output)
    table = values.reshape(*(len(grid.places) for grid in grids), -1)
    numbers = {grid.name: number for number, grid in enumerate(grids)}
    axes = [numbers[grid.name] for grid in chosen[: KINDS.index(kind)]]
    if kind == "histogram":
        _draw_histograms(ax, table, label, chosen, numbers)
        return ax
    sorted_out = np.moveaxis(table, axes, range(len(axes)))
    cells = sorted_out.reshape(*sorted_out.shape[: len(axes)], -1)
    # A cell in which all cases failed stays empty.
    with quiet(category=RuntimeWarning):
        if kind == "quantiles":
            _draw_quantiles(ax, chosen[0], cells, label)
        else:
            _draw_map(ax, chosen[0], chosen[1], np.nanmedian(cells, axis=-1), label)
    return ax


@dataclass(frozen=True, kw_only=True, eq=False)
class _Grid:
    """A grid as an axis: its places, in degrees where they are angles, and names where it has no numbers."""

    name: str
    label: str
    places: Array
    names: list[str]

    @classmethod
    def of(cls, store: StudyStore, name: str) -> _Grid:
        values = store.attributes["grids"][name]
        if isinstance(values[0], str) or np.ndim(values) > 1:
            names = [str(one) for one in values] if isinstance(values[0], str) else []
            return cls(name=name, label=_words(name), places=np.arange(len(values), dtype=float), names=names)
        factor, label = _shown(name, store.attributes["units"][name])
        return cls(name=name, label=label, places=factor * np.asarray(values, dtype=float), names=[])

    def say(self, number: int) -> str:
        return self.names[number] if self.names else f"{self.places[number]:.4g}"


def _values(store: StudyStore, output: str) -> tuple[Array, str]:
    """One number of each case, and what it is called. Raises UnknownNameError, StudyError."""
    units = {name: unit for name, unit in store.attributes["units"].items() if name not in store.attributes["grids"]}
    if not isinstance(output, str):
        raise unknown_name("output of the study", output, units)
    name = next((name for name in units if output == name or output.startswith(f"{name}_")), None)
    if name is None:
        raise unknown_name("output of the study", output, units)
    values = store.values(name)
    entry = output.removeprefix(name).split("_")[1:]
    try:
        places = tuple(int(place) for place in entry)
        one = values[(slice(None), *places)]
    except (ValueError, IndexError):
        raise unknown_name(f"entry of {name}", output, [f"{name}{'_0' * (values.ndim - 1)}"]) from None
    if one.ndim > 1:
        example = f"{output}{'_0' * (one.ndim - 1)}"
        raise StudyError(f"{output}: one number of each case is drawn, this has {one[0].size}; name one, as {example}")
    if not np.isfinite(one).any():
        raise StudyError(f"{output}: no case has a value yet")
    factor, label = _shown(output, units[name])
    return factor * one, label


def _shown(name: str, unit: str) -> tuple[float, str]:
    """What numbers are multiplied by, and their label."""
    if unit == "rad":
        return _DEGREES, f"{_words(name)} [deg]"
    return 1.0, f"{_words(name)} [{unit.replace('^2', '²')}]" if unit else _words(name)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _draw_histograms(ax: Any, table: Array, label: str, grids: list[_Grid], numbers: dict[str, int]) -> None:
    finite = table[np.isfinite(table)]
    bins = int(np.clip(2.0 * len(finite) ** (1.0 / 3.0), _FEWEST_BINS, _MOST_BINS))
    edges = np.histogram_bin_edges(finite, bins)
    if len(grids) == 1 and len(grids[0].places) <= len(SERIES):
        for number, rows in enumerate(np.moveaxis(table, numbers[grids[0].name], 0)):
            looks = SERIES[number]
            ax.hist(rows[np.isfinite(rows)], edges, histtype="step", label=grids[0].say(number), **looks)
        finish(ax, title=grids[0].label)
    else:
        ax.hist(finite, edges, color=SKY)
        low, middle, high = np.quantile(finite, [_MOST[0], 0.5, _MOST[1]])
        ax.axvline(middle, color=BLUE, linewidth=1.4, label=f"median {middle:.4g}")
        for place, said in ((low, f"5 % and 95 %: {low:.4g}, {high:.4g}"), (high, None)):
            ax.axvline(place, color=BLACK, linewidth=1.0, linestyle=(0, (4, 2)), label=said)
        finish(ax)
    ax.set_xlabel(label, fontsize=SMALL)
    ax.set_ylabel("cases", fontsize=SMALL)


def _draw_quantiles(ax: Any, grid: _Grid, cells: Array, label: str) -> None:
    """Cells (n, cases)."""
    places = grid.places
    if cells.shape[-1] > 1:
        low, high = np.nanquantile(cells, _MOST, axis=-1)
        ax.fill_between(places, low, high, color=SKY, alpha=0.35, linewidth=0.0, label="9 of 10 cases")
        low, high = np.nanquantile(cells, _HALF, axis=-1)
        ax.fill_between(places, low, high, color=SKY, alpha=0.8, linewidth=0.0, label="half of them")
    middle = np.nanmedian(cells, axis=-1)
    ax.plot(places, middle, color=BLUE, linewidth=1.6, marker=".", label="median" if cells.shape[-1] > 1 else None)
    ax.grid(color=GREY, alpha=0.3, linewidth=0.5)
    ax.margins(x=0.0)
    _name_axis(ax.xaxis, grid)
    ax.set_ylabel(label, fontsize=SMALL)
    if cells.shape[-1] > 1:
        finish(ax, ncols=3)
    else:
        ax.tick_params(labelsize=SMALL)


def _draw_map(ax: Any, across: _Grid, up: _Grid, middle: Array, label: str) -> None:
    """Medians (n, m)."""
    mesh = ax.pcolormesh(across.places, up.places, middle.T, shading="nearest", cmap="viridis", rasterized=True)
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
