"""Figures of certain bounds of a motion: the reachable part of the momentum sphere, and tightness of bounds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..arguments import check_object
from ..arrays import Array
from ..bounds.all_bounds import Bound
from ..bounds.regimes import CrownRegion
from ..errors import ShapeError, WrongObjectError
from ..letters import value_text
from ..reconstruction.reconstruction import Motion
from ._sphere_axes import SphereAxes
from .plot_style import BLACK, BLUE, SKY, SMALL, VERMILION, check_flat_axes, one_motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_POINTS = 241  # of the crown's raster across the sphere: one is 0.01 in wide
_VISIBLE = 1e-3  # of the half sphere that is seen: a smaller crown is not
_TIMES = 800  # points of the motion's curve
_OFF_AXIS = 40.0  # [degrees] between eye and axis where the axis would be too near to the pole
_NEAR_POLE = 50.0  # [degrees] elevation of such an axis
_ELEVATION = 24.0  # [degrees] of the eye otherwise
_AZIMUTH_OFFSET = 35.0


def plot_crown(
    ax: Axes, crown: CrownRegion, motion: Motion | None = None, *, view: tuple[float, float] | None = None
) -> Axes:
    """The crown region on the sphere of unit momentum, in which Pi is certain to stay, and a motion inside it.

    Source: Cabrera 2006, section 4.1; theory.md E8.

    Parameters
    ----------
    ax : flat axes, drawn on in parallel projection
    crown : from `crown_region`
    motion : of one momentum, no batch; drawn over the certificate's interval
    view : elevation and azimuth of the eye [degrees]; None: beside the certificate's axis

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> crown = sp.bounds.crown_region(motion.deformation, [0.1, 0.2, 2.0])
    >>> len(sp.plots.plot_crown(ax, crown).lines) > 1
    True
    """
    check_object(crown, "CrownRegion", "crown")
    if motion is not None:
        check_object(motion, "Motion", "motion")
    check_flat_axes(ax)
    from matplotlib.patches import Circle, Patch

    axis = crown.certificate.axis
    sphere = SphereAxes(ax, _beside(axis) if view is None else view)
    across = np.linspace(-1.0, 1.0, _POINTS)
    x, y = np.meshgrid(across, across)
    inside = np.hypot(x, y) <= 1.0
    # Beyond the limb as on it, so that what is cut off there by the circle has no steps.
    flat = np.stack([x, y], axis=-1) / np.maximum(1.0, np.hypot(x, y))[..., None]
    towards = np.sqrt(np.maximum(1.0 - np.sum(flat**2, axis=-1), 0.0))[..., None] * sphere.eye
    within = crown.contains(flat @ sphere.screen + towards).astype(float)
    limb = Circle((0.0, 0.0), 1.0, transform=ax.transData)
    if within.any():
        filled = ax.contourf(x, y, within, levels=[0.5, 1.5], colors=[SKY], alpha=0.45, zorder=1.2)
        filled.set_clip_path(limb)
    if within.any() and not within.all():
        ax.contour(x, y, within, levels=[0.5], colors=[BLUE], linewidths=0.8, zorder=1.5).set_clip_path(limb)
    title = f"certain before the motion: {crown.certificate.regime}"
    if within[inside].mean() > _VISIBLE:
        sphere.named[r"crown: where $\Pi$ can be"] = Patch(facecolor=SKY, edgecolor=BLUE, alpha=0.45)
    else:
        title += "\nits crown is thinner than a line, or behind"
    if motion is not None:
        track = _track(motion, crown)
        sphere.curve(track, r"$\Pi/|\Pi|$", color=BLACK, linewidth=1.6)
        sphere.point(track[0], "start", color=VERMILION, marker="*", markersize=9.0)
    sphere.point(axis, "the axis it circles", color=BLACK, marker="o")
    sphere.finish(r"$\Pi_{}/|\Pi|$", title)
    return ax


def plot_bounds(ax: Axes, bounds: Sequence[Bound]) -> Axes:
    """Tightness of each bound: a bar of `Bound.tightness`, 1 where it equals the value it bounds.

    Parameters
    ----------
    bounds : from `bounds.bounds`

    Raises
    ------
    WrongObjectError
        For anything but bounds.
    ShapeError
        If there are none.

    Examples
    --------
    >>> ax = sp.plots.column_axes()
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> len(sp.plots.plot_bounds(ax, sp.bounds.bounds(motion)).patches) > 3
    True
    """
    check_flat_axes(ax)
    if not isinstance(bounds, Sequence) or not all(isinstance(bound, Bound) for bound in bounds):
        raise WrongObjectError(f"bounds: those of bounds.bounds(motion) are needed, got {value_text(bounds)}")
    if not bounds:
        raise ShapeError("bounds: one or more are needed to be drawn, got none")
    places = np.arange(len(bounds))[::-1]
    for upper, colour, hatch in ((True, SKY, None), (False, "#F3BE73", "////")):
        chosen = [(place, bound) for place, bound in zip(places, bounds, strict=True) if bound.is_upper is upper]
        ax.barh(
            [place for place, _ in chosen],
            [bound.tightness for _, bound in chosen],
            height=0.7,
            color=colour,
            edgecolor=BLACK,
            linewidth=0.6,
            hatch=hatch,
            label="upper bound" if upper else "lower bound",
        )
    ax.set_yticks(places, [bound.name for bound in bounds], fontsize=SMALL - 1)
    ax.set(xlim=(0.0, 1.0), ylim=(-0.6, len(bounds) - 0.4))
    ax.set_xlabel("tightness (1: equal)", fontsize=SMALL)
    ax.tick_params(axis="x", labelsize=SMALL)
    ax.legend(fontsize=SMALL, frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    return ax


def _beside(axis: Array) -> tuple[float, float]:
    """A view from 40 degrees off a direction, lower than it where it points up."""
    elevation, azimuth = np.degrees([np.arcsin(np.clip(axis[2], -1.0, 1.0)), np.arctan2(axis[1], axis[0])])
    near_pole = abs(elevation) > _NEAR_POLE
    return elevation - np.copysign(_OFF_AXIS, elevation) if near_pole else _ELEVATION, azimuth + _AZIMUTH_OFFSET


def _track(motion: Motion, crown: CrownRegion) -> Array:
    one_motion(motion)
    start, end = crown.certificate.interval
    momenta = motion.body_momentum(np.linspace(start, min(end, motion.duration), _TIMES))
    return momenta / np.linalg.norm(momenta, axis=-1, keepdims=True)
