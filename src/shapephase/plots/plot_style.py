"""Style of all figures: colours, lines and sizes; and argument checks that drawing functions share.

The colours are those of Okabe and Ito, which people with any colour vision can tell apart; lines also differ by their
dashes and points by their markers, so that nothing is lost in black and white. Sizes are for figures one column wide,
3.4 in.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_choice, check_object, number_argument, times_argument
from ..arrays import Array
from ..deformation.deformation import Deformation
from ..errors import MissingExtraError, ShapeError
from ..files import write_whole
from ..letters import value_text
from ..reconstruction.reconstruction import Motion
from ..shape_space.shape_path import ShapePath
from ..warning_filters import quiet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Colours of Okabe and Ito, as hexadecimal RGB.
BLACK = "#000000"
BLUE = "#0072B2"
SKY = "#56B4E9"
VERMILION = "#D55E00"
ORANGE = "#E69F00"
GREEN = "#009E73"
PURPLE = "#CC79A7"
GREY = "#999999"  # not of that palette: background
# Ends of the colours of a curvature in figures and pages; lines and text on them can be read.
POSITIVE_CURVATURE = "#4C8CC0"
NEGATIVE_CURVATURE = "#D08838"
SMALL = 8  # [pt] readable in a figure one column wide
COLUMN = 3.4  # [in] one column of most journals
SERIES: tuple[dict[str, Any], ...] = (
    {"color": BLUE, "linestyle": "-", "linewidth": 1.6},
    {"color": VERMILION, "linestyle": (0, (5, 2)), "linewidth": 1.5},
    {"color": GREEN, "linestyle": (0, (6, 1.5, 1, 1.5)), "linewidth": 1.5},
    {"color": BLACK, "linestyle": (0, (1, 1.2)), "linewidth": 1.5},
    {"color": ORANGE, "linestyle": (0, (7, 5)), "linewidth": 1.7},
    {"color": PURPLE, "linestyle": (0, (3, 1.5, 1, 1.5, 1, 1.5)), "linewidth": 1.5},
)
"""One style for each curve of a figure, the first three for x, y and z."""
_NO_GLYPH = ("Glyph .* missing from", UserWarning)  # a letter that the font has not
_SYMBOLS = "dejavuserif"  # in sans-serif I and l are the same bar
_RESOLUTION = 300  # [dots per inch] of raster images: what journals ask for
_EDGE = 0.05  # [widths and heights] between an inset and the axes' edge or the next line
_LEGEND_GAP = 0.12  # [in] between a picture and the legend below it, and around both
_BESIDE_LEGEND = 0.2  # [in] by which axes with labels on their left lie to the right in their panel
_LEAST_PICTURE = 0.3  # [in] of a picture whose legend needs all of the panel
_FEW = 2  # points of a line that is a mark or a zero line
_PLAIN_POWERS = (-4, 4)  # of ten that the numbers of a time axis show as they are
# Loops of a path up to which its lines have their whole breadth, and the least part of it.
_MANY_LOOPS = 12
_FINEST = 0.35
_RASTER_PIECE = 5_000  # points of a curve that are drawn as an image in one piece
_MIN_POINTS = 800  # of a curve in time: more than one column has pixels at 200 dpi
_POINTS_PER_LOOP = 200  # of a curve in time
_MAX_VECTOR_POINTS = 10_000  # ten in each dot of a column's width; longer curves are images


def column_axes(height: float = 2.6, *, projection: str | None = None) -> Axes:
    """Axes of a new figure one column wide (3.4 in) that leaves room for labels and legend by itself.

    The figure is `axes.figure`; no window shows it; `axes.figure.savefig(path, dpi=300)` writes it. Lines that are
    drawn there without a colour have those of Okabe and Ito.

    Parameters
    ----------
    height : [in]
    projection : None: flat; "3d"

    Raises
    ------
    ShapeError
        If the height is not above 0.
    MissingExtraError
        If Matplotlib is not installed.

    Examples
    --------
    >>> axes = sp.plots.column_axes()
    >>> axes.figure.get_size_inches().round(2).tolist()
    [3.4, 2.6]
    """
    _check_matplotlib()
    from matplotlib.figure import Figure
    from matplotlib.projections import get_projection_names

    inches = number_argument(height, "height", "in")
    if projection is not None:
        check_choice(projection, "projection", get_projection_names())
    if not inches > 0.0:
        raise ShapeError(f"height: a length above 0 [in] is needed, got {value_text(height)}")
    axes = Figure(figsize=(COLUMN, inches), layout="constrained").add_subplot(projection=projection)
    axes.set_prop_cycle(color=[look["color"] for look in SERIES])
    return axes


def axes_image(ax: Any, ending: str, resolution: float = _RESOLUTION) -> bytes:
    """The figure of some axes as "svg", "pdf" or "png", without a date, so that equal figures give equal files."""
    stamp = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {}}[ending]
    for artist in ax.figure.findobj(_is_long):
        artist.set_rasterized(True)
    from matplotlib import rc_context

    stream = BytesIO()
    # In one piece, a curve that crosses itself very often is more than the rasterizer holds.
    # And a letter that the font has not is an empty frame in the figure.
    with quiet(*_NO_GLYPH), rc_context({"agg.path.chunksize": _RASTER_PIECE}):
        ax.figure.savefig(stream, format=ending, dpi=resolution, metadata=stamp)
    return stream.getvalue()


def write_axes(ax: Any, out: str | os.PathLike[str]) -> None:
    """Write a figure to an .svg, .pdf or .png file, whole or not at all."""
    image = axes_image(ax, Path(out).suffix.removeprefix(".").lower())
    write_whole(out, lambda stream: stream.write(image))


def _is_long(artist: Any) -> bool:
    """True where an artist has more points than a figure of vectors should hold."""
    if hasattr(artist, "get_xdata"):
        return len(artist.get_xdata(orig=True)) > _MAX_VECTOR_POINTS
    if hasattr(artist, "get_patch_transform"):
        return len(artist.get_path().vertices) > _MAX_VECTOR_POINTS
    if hasattr(artist, "get_offsets") and hasattr(artist, "get_paths"):
        return sum(len(path.vertices) for path in artist.get_paths()) > _MAX_VECTOR_POINTS
    return False


def check_axes(ax: object) -> None:
    """Check that these are Matplotlib axes.

    Raises
    ------
    MissingExtraError
        If Matplotlib is not installed.
    ShapeError
        For anything else.
    """
    _check_matplotlib()
    from matplotlib.axes import Axes

    if not isinstance(ax, Axes):
        raise ShapeError(f"ax: expected Matplotlib axes, as of Figure().add_subplot(), got {type(ax).__name__}")


def check_flat_axes(ax: object) -> None:
    """Check that these are two-dimensional Matplotlib axes. Raises like `check_axes`."""
    check_axes(ax)
    if getattr(ax, "name", "") == "3d":
        raise ShapeError("ax: flat axes are needed here, got three-dimensional ones; make them without a projection")


def check_motion_axes(ax: object, motion: Motion) -> None:
    """Check that these are flat axes for one motion. Raises like `check_axes`, WrongObjectError, ShapeError."""
    check_object(motion, "Motion", "motion")
    check_flat_axes(ax)
    one_motion(motion)


def one_motion(motion: Motion) -> None:
    """Raise `ShapeError` for a batch."""
    if motion.batch:
        raise ShapeError(f"a picture shows one motion, this is a batch of {motion.batch}; reconstruct one of them")


def motion_times(motion: Motion, times: ArrayLike | None) -> Array:
    """Times to draw at: as given, or so many in each integrator step that no turn is missed."""
    if times is not None:
        return given_times(times, motion.duration)
    steps = motion.solution.times
    parts = max(4, int(np.ceil(_MIN_POINTS / (len(steps) - 1))))
    return subdivided(np.union1d(steps, motion.deformation.breaks), parts)


def even_times(of: Deformation | ShapePath, times: ArrayLike | None) -> Array:
    """Times to draw at: as given, or evenly spaced between the breaks."""
    if times is not None:
        return given_times(times, of.duration)
    count = max(_MIN_POINTS, _POINTS_PER_LOOP * of.loops)
    return subdivided(of.breaks, max(2, int(np.ceil(count / (len(of.breaks) - 1)))))


def given_times(times: ArrayLike, duration: float) -> Array:
    """Two or more ascending times of [0, duration]: (N,)."""
    values = times_argument(times, duration)
    if values.ndim != 1 or len(values) < 2 or np.any(np.diff(values) <= 0.0):
        raise ShapeError(f"times: two or more that increase are needed, (N,), got an array of shape {values.shape}")
    return values


def subdivided(edges: Array, parts: int) -> Array:
    """Every interval cut into equal parts: (K + 1,) -> (K parts + 1,)."""
    inner = edges[:-1, None] + np.diff(edges)[:, None] * np.arange(parts) / parts
    return np.append(inner.ravel(), edges[-1])


def finish(ax: Any, **place: Any) -> Any:
    """Small ticks and a legend of two columns, by default above the axes; returns the legend.

    Where the panel is too narrow for it, the legend has fewer columns, and its title more lines.
    """
    ax.tick_params(labelsize=SMALL)
    ax.xaxis.get_offset_text().set_fontsize(SMALL)
    ax.yaxis.get_offset_text().set_fontsize(SMALL)
    above = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0)} if not {"loc", "bbox_to_anchor"} & {*place} else {}
    look = {
        "fontsize": SMALL - 1,
        "title_fontsize": SMALL - 1,
        "handlelength": 2.6,
        "handletextpad": 0.6,
        "columnspacing": 1.0,
    }
    settings = {"ncols": 2, "frameon": False, **look, **above, **place}
    room = (panel_size(ax)[0] - _BESIDE_LEGEND * ax.axison) * ax.figure.dpi
    while True:
        legend = ax.legend(**settings)
        legend.get_title().set_multialignment("center")
        with_symbols(ax)
        title = _extent(legend.get_title()).width
        if title > room:
            lines = settings["title"].split("\n")
            longest = int(max(map(len, lines)) * room / title)
            settings["title"] = "\n".join(part for line in lines for part in wrap(line, longest))
        elif _extent(legend).width > room and settings["ncols"] > 1:
            settings["ncols"] -= 1
        else:
            return legend


def panel_size(ax: Any) -> tuple[float, float]:
    """Width and height that some axes with their labels have in a figure [in]: their cell where a layout fills it."""
    figure, spec = ax.figure, ax.get_subplotspec()
    whole = figure.bbox.width / figure.dpi, figure.bbox.height / figure.dpi
    if spec is None or figure.get_layout_engine() is None:
        box = ax.get_position()
        return whole[0] * box.width, whole[1] * box.height
    grid = spec.get_gridspec()
    shares = ((grid.get_width_ratios(), spec.colspan), (grid.get_height_ratios(), spec.rowspan))
    width, height = (
        length * sum(ratios[span.start : span.stop]) / sum(ratios) for length, (ratios, span) in zip(whole, shares)
    )
    return width, height


def finish_below(ax: Any, **place: Any) -> Any:
    """Finish a picture in axes of equal scales, with room inside them for the legend below it; returns the legend."""
    legend = finish(ax, loc="lower center", borderaxespad=0.0, **place)
    # A legend wider than the axes would make the layout shrink them.
    legend.set_in_layout(False)
    # A notebook would crop the image to the axes: the figure's own patch keeps all of it.
    ax.figure.patch.set_in_layout(True)
    width, height = panel_size(ax)
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    needed = _LEGEND_GAP + _extent(legend).height / ax.figure.dpi
    scale = max((right - left) / width, (top - bottom) / max(height - needed, _LEAST_PICTURE))
    ax.set_ylim(bottom - needed * scale, top)
    return legend


def align_zeros(*axes: Any) -> None:
    """Widen the ordinates of several axes at one place until their zeros are at one height."""
    limits = np.array([ax.get_ylim() for ax in axes])
    limits[:, 0], limits[:, 1] = np.minimum(limits[:, 0], 0.0), np.maximum(limits[:, 1], 0.0)
    spans = np.ptp(limits, axis=1)
    shares = limits / spans[:, None]
    for ax, span in zip(axes, spans, strict=True):
        ax.set_ylim(shares[:, 0].min() * span, shares[:, 1].max() * span)


def zero_line(ax: Any) -> None:
    """Draw a faint line at zero."""
    ax.axhline(0.0, color=GREY, linewidth=0.5, zorder=1)


def with_symbols(ax: Any) -> None:
    """Let the symbols in labels, legend and texts of some axes have serifs, which distinguish l, I and 1."""
    legend = ax.get_legend()
    named = [*legend.get_texts(), legend.get_title()] if legend else []
    for text in (ax.xaxis.label, ax.yaxis.label, *ax.texts, *named):
        text.set_math_fontfamily(_SYMBOLS)


def in_time(ax: Any, duration: tuple[float, float], label: str, *, loops: int = 1, **place: Any) -> None:
    """Limits, labels and legend of a figure whose abscissa is time [s]; `label` with its unit is for the ordinate.

    Lines and markers are finer for a path with many `loops`.
    """
    ax.set_xlim(*duration)
    finer(ax, loops)
    ax.set_xlabel("$t$ [s]", fontsize=SMALL)
    label_ordinate(ax, label, max(map(abs, ax.get_ylim())))
    finish(ax, **place)


def finer(ax: Any, loops: int) -> None:
    """Make lines and markers finer where many loops stand side by side, so that they do not run together."""
    share = max(_MANY_LOOPS / max(loops, _MANY_LOOPS), _FINEST)
    for line in ax.lines:
        line.set(linewidth=share * line.get_linewidth(), markersize=share * line.get_markersize())


def label_ordinate(ax: Any, label: str, largest: float) -> None:
    """Name an ordinate whose numbers go up to `largest`, with their power of ten in the unit.

    Where Matplotlib writes it, above the axis, the legend stands.
    """
    from matplotlib.ticker import ScalarFormatter

    power, scale = power_of_ten(largest, _PLAIN_POWERS)
    formatter = ScalarFormatter(useOffset=False)
    if power:
        formatter.set_powerlimits((power, power))
    else:
        formatter.set_scientific(False)
    ax.yaxis.set_major_formatter(formatter)
    ax.yaxis.get_offset_text().set_visible(False)
    words, bracket, unit = label.rpartition("[")
    ax.set_ylabel(f"{words}{bracket}{scale}{unit}", fontsize=SMALL)


def power_of_ten(largest: float, plain: tuple[int, int] = (-3, 2)) -> tuple[int, str]:
    """The power to take out of numbers up to the largest, and how it is written before a unit; none if it is plain."""
    power = int(np.floor(np.log10(largest))) if largest > 0.0 else 0
    if plain[0] <= power <= plain[1]:
        return 0, ""
    return power, "10" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")) + " "


def degrees_first(ax: Any, label: str, *, radians: bool = True) -> None:
    """An ordinate in degrees on the left, for what is drawn in radians; on the right these, if they are to be seen."""
    left = ax.secondary_yaxis("left", functions=(np.degrees, np.radians))
    largest = max(map(abs, ax.get_ylim()))
    label_ordinate(left, f"{label} [deg]", float(np.degrees(largest)))
    left.tick_params(labelsize=SMALL)
    if radians:
        ax.yaxis.tick_right()
        ax.yaxis.set_label_position("right")
        # Axes that share their ordinates have lost the numbers on both sides.
        ax.tick_params(axis="y", labelright=True)
        label_ordinate(ax, f"{label} [rad]", largest)
    else:
        ax.tick_params(axis="y", left=False, labelleft=False)
        ax.set_ylabel("")


def ticks_in_degrees(axis: Any) -> None:
    """Put ticks of an axis whose data are in radians at round numbers of degrees."""
    from matplotlib.ticker import AutoLocator

    class DegreeLocator(AutoLocator):
        def tick_values(self, vmin: float, vmax: float) -> list[float]:
            return np.radians(super().tick_values(np.degrees(vmin), np.degrees(vmax))).tolist()

    axis.set_major_locator(DegreeLocator())
    axis.set_major_formatter(lambda value, _: f"{round(np.degrees(value), 6):g}".replace("-", "−"))


def inset_where_free(ax: Any, extent: tuple[float, float], room: tuple[float, float, float]) -> Any | None:
    """Axes in a corner of others over which none of their lines passes; None if there is no such corner.

    extent : width and height [widths and heights of the axes]
    room : to the left of them, below and above them, for what is written there [the same]
    """
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    curves = [line.get_xydata() for line in ax.lines if len(line.get_xydata()) > _FEW]
    points = np.concatenate(curves or [np.zeros((0, 2))])
    x, y = (points[:, 0] - left) / (right - left), (points[:, 1] - bottom) / (top - bottom)
    wide, high = extent[0] + room[0] + _EDGE, extent[1] + room[1] + room[2] + _EDGE
    for across, up in ((0.0, 1.0 - high), (1.0 - wide, 1.0 - high), (1.0 - wide, 0.0), (0.0, 0.0)):
        inside = (x > across) & (x < across + wide) & (y > up) & (y < up + high)
        if not inside.any():
            place = (across + room[0] + 0.5 * _EDGE, up + room[1] + 0.5 * _EDGE)
            return ax.inset_axes((*place, *extent))
    return None


def add_polygons(ax: Any, polygons: Sequence[Array], **look: Any) -> None:
    """Fill polygons, a sequence of (N_k, 3), in three-dimensional axes."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    # Between polygons of different lengths Matplotlib leaves memory that was never set, and reads limits from it.
    longest = max(map(len, polygons))
    equal = [np.pad(polygon, ((0, longest - len(polygon)), (0, 0)), mode="edge") for polygon in polygons]
    ax.add_collection3d(Poly3DCollection(np.stack(equal), **look))


def _extent(artist: Any) -> Any:
    """Box of a text or a legend [pixels]."""
    # A letter that the font has not is as wide as its empty frame.
    with quiet(*_NO_GLYPH):
        return artist.get_window_extent()


def _check_matplotlib() -> None:
    try:
        import matplotlib.axes  # noqa: F401
    except ImportError:
        raise MissingExtraError("figures need Matplotlib; install it with: pip install 'shapephase[plot]'") from None
