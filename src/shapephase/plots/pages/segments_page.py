"""Pages of the shares of limbs in a turn, and of the momentum by segment."""

from __future__ import annotations

import base64
from typing import Any

from ...arguments import check_object, check_text
from ...reconstruction.reconstruction import Motion
from ...segments.limb_contributions import Contributions
from ...segments.momentum import SegmentMomentum
from ...segments.momentum_text import bars_text, conservation_text, link_rows, mean_text
from ..plot_style import axes_image, column_axes
from ..segment_plots import HEIGHT, contributions_figure, plot_segment_momentum
from .page import Page, frame_count, playing_speed
from .report_page import figure_rows
from .templates import SCENE_SCRIPTS, page_from
from .viewer import scene_and_data


def contributions_page(shares: Contributions, *, title: str | None = None, up: str | None = None) -> Page:
    """Page of the shares of limbs: the motion beside that with a group held, by one clock; table and figure.

    Parameters
    ----------
    shares : by `contributions`
    title : None: the label of the deformation
    up : as in `view`

    Raises
    ------
    MissingExtraError
        Without Matplotlib: pip install 'shapephase[plot]'.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> motion = sp.reconstruct(sp.articulated(cat, sp.examples.kane_scher(0.3, 0.6)), np.zeros(3))
    >>> shares = sp.contributions(motion, of="rotation", about=[1.0, 0.0, 0.0])
    >>> sp.plots.contributions_page(shares).html[:9]
    '<!doctype'
    """
    check_object(shares, "Contributions", "shares", call="contributions(motion)")
    if title is not None:
        check_text(title, "title", "a text")
    motions = shares.motions()
    whole = motions.pop("")
    real = _motion_data(whole, whole, up)
    held = {name: _motion_data(motion, whole, up) for name, motion in motions.items()}
    unit = f" [{shares.unit}]" if shares.unit else ""
    tables: list[Any] = [
        (
            f"Groups{unit}",
            ("group", "held", "alone", "shared"),
            shares.rows(),
            f"Held: result with the group {shares.baseline}; alone: with all others so; shared: mean over all orders.",
        )
    ]
    if shares.direct is not None:
        tables.append((f"Direct, along the motion{unit}", ("source", shares.of), shares.direct_rows(), None))
    return page_from(
        "segments.html",
        title=title or whole.deformation.label,
        scripts=(*SCENE_SCRIPTS, "segments_page"),
        styles=("page", "report_page", "segments_page"),
        data={"motion": real, "held": held},
        lead=str(shares).split("\n", 1)[0],
        scenes=[("scene", "the motion"), ("beside", f"{shares.baseline}:")],
        held=list(held),
        flights=[],
        tables=tables,
        figures=[[_figure(contributions_figure(shares), "Shares by group, and what was done in time.")]],
        notes=shares.notes(),
    )


def momentum_page(
    found: SegmentMomentum, motion: Motion | None = None, *, title: str | None = None, up: str | None = None
) -> Page:
    """Page of the momentum by segment: the moving body, flights, links, and the stacked figure along each axis.

    Parameters
    ----------
    found : by `segment_momentum`
    motion : whose body is shown; None: no body
    title : None: the label of the motion's deformation
    up : as in `view`

    Raises
    ------
    MissingExtraError
        Without Matplotlib: pip install 'shapephase[plot]'.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> sp.plots.momentum_page(sp.segment_momentum(motion), motion).html[:9]
    '<!doctype'
    """
    check_object(found, "SegmentMomentum", "found", call="segment_momentum(motion)")
    if motion is not None:
        check_object(motion, "Motion", "motion")
    if title is not None:
        check_text(title, "title", "a text")
    heads, *rows = link_rows(found)
    return page_from(
        "segments.html",
        title=title or (motion.deformation.label if motion is not None else "Momentum by segment"),
        scripts=(*SCENE_SCRIPTS, "segments_page"),
        styles=("page", "report_page", "segments_page"),
        data={} if motion is None else {"motion": _motion_data(motion, motion, up)},
        lead=f"Momentum about the centre of mass, {found.unit.replace('^2', '²')}, along {', '.join(found.axes)}",
        scenes=[] if motion is None else [("scene", "the motion")],
        held=[],
        flights=[
            (
                f"{flight.first_time:.6g} to {flight.last_time:.6g} s",
                f"({mean_text(flight)})",
                conservation_text(flight),
            )
            for flight in found.flights
        ],
        tables=[("Links", heads, rows, bars_text(found))],
        figures=figure_rows(
            [
                _figure(plot_segment_momentum(column_axes(HEIGHT), found, axis), f"Momentum, {axis}")
                for axis in found.axes
            ]
        ),
        notes=[] if found.flights else ["No flight found: nothing falls freely, or places are not recorded."],
    )


def _motion_data(motion: Motion, whole: Motion, up: str | None) -> dict[str, Any]:
    """Data of a scene, with as many frames as are smooth for the whole motion, which sets the speed."""
    speed = playing_speed(whole.duration, None)
    frames = frame_count(whole.duration, speed)
    return scene_and_data(motion, speed=speed, frames=frames, trail=None, ghost=False, up=up, fall={})[1]


def _figure(ax: Any, caption: str) -> dict[str, str]:
    return {"caption": caption, "image": base64.b64encode(axes_image(ax, "svg")).decode()}
