"""One HTML file about a motion: what happened, the body moving beside its curves, figures, numbers and inputs."""

from __future__ import annotations

import base64
import os
from collections.abc import Callable, Sequence
from typing import Any

from ..arguments import check_file_name, check_object
from ..arrays import Array
from ..files import write_whole
from ..phases.phases import PhaseSplit
from ..reconstruction.reconstruction import Motion
from ..shape_space.shape_path import ShapePath
from ._letters import printable
from ._report_text import (
    CONVENTIONS,
    accuracy,
    input_rows,
    is_rigid,
    joint_rows,
    lead,
    part_rows,
    split_rows,
    story,
    torque_words,
)
from .named_figures import FIGURES, figure_image
from .pages.report_data import report_data
from .pages.templates import SCENE_SCRIPTS, page_html
from .viewer import scene_and_data

# Of a figure [in]; the style of a report has the shares of taller ones in a row.
_USUAL_HEIGHT = 2.8


def figure_rows(figures: Sequence[Any]) -> list[Sequence[Any]]:
    """Figures in rows that are all full: two each, and three in the last one of an odd number."""
    last = max(len(figures) - 3, 0) if len(figures) % 2 else len(figures)
    rows = [figures[k : k + 2] for k in range(0, last, 2)]
    return rows + ([figures[last:]] if len(figures) % 2 else [])


def write_report(
    motion: Motion,
    result: PhaseSplit,
    path: str | os.PathLike[str],
    *,
    shape_path: ShapePath | None = None,
    title: str | None = None,
    purpose: str | None = None,
    trail: str | None = None,
    up: str | None = None,
    error_bars: Sequence[str] = (),
    recording: Sequence[str] = (),
    noise: Array | None = None,
    begin: Callable[[str], object] = lambda _: None,
) -> None:
    """Write a motion and its split as one HTML file that opens offline; whole or not at all.

    The body moves in it, and the curves beside it and the momentum on its sphere show the same time.

    Parameters
    ----------
    motion : of one momentum, no batch
    result : its split
    path : of the file
    shape_path : of the joints, for a figure and a table of them
    title : None: the label of the deformation
    purpose : a sentence or two that come first, such as what the motion was made for; None: none
    trail : a link whose origin leaves a trail in the animation
    up : as in `motion_page`
    error_bars : lines about how far the numbers may be off by what the inputs leave open, as `split` prints them
    recording : lines about what was read of a recording and done to it, as `split` prints them
    noise : of the samples of the joints, rms (n,) [rad or m], for bars of rates and torques; None: the one that a
        recording was smoothed for
    begin : called with a few words before each longer step

    Raises
    ------
    MissingExtraError
        Without Matplotlib: pip install 'shapephase[plot]'.
    ShapeError
        If the motion is a batch.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> sp.plots.write_report(motion, sp.split(motion, "base"), "report.html")
    >>> from pathlib import Path
    >>> Path("report.html").read_text()[:9]
    '<!doctype'
    """
    check_object(motion, "Motion", "motion")
    check_object(result, "PhaseSplit", "result")
    check_file_name(path, "path")
    if shape_path is not None:
        check_object(shape_path, "ShapePath", "shape_path")
    begin("recording the animation")
    scene, data = scene_and_data(motion, speed=None, frames=None, trail=trail, ghost=True, up=up, fall={})
    beside = report_data(motion, scene.times, result.gauge, scene.body, scene.shapes)
    has_joints = shape_path is not None and shape_path.n_shape > 0
    figures = []
    for kind, figure in FIGURES.items():
        if (figure.with_momentum and not result.has_phase) or (figure.with_path and not has_joints):
            continue
        if figure.of_change and is_rigid(motion):
            continue
        begin(f"drawing {kind.replace('_', ' ')}")
        image = base64.b64encode(figure_image(kind, motion, shape_path, result.gauge)).decode()
        figures.append({"caption": figure.caption, "image": image, "tall": figure.height > _USUAL_HEIGHT})
    torques = [torque_words(motion, noise)] if scene.body is not None and scene.body.n_shape else []
    page = page_html(
        "report.html",
        title=printable(title or motion.deformation.label),
        scripts=(*SCENE_SCRIPTS, "plots", "sphere", "report_page"),
        styles=("page", "report_page"),
        data={"motion": data, **beside},
        lead=lead(motion),
        story=[
            *([purpose] if purpose else []),
            *story(motion, result, scene.body),
            *torques,
            accuracy(motion, error_bars),
        ],
        gauge=result.gauge,
        with_sphere=bool(result.has_phase),
        split_rows=split_rows(result),
        error_bars=[line for line in error_bars if line],
        recording=[line for line in recording if line],
        rows=figure_rows(figures),
        joints=joint_rows(scene.body, shape_path, noise) if scene.body is not None and shape_path is not None else (),
        parts=part_rows(scene.body) if scene.body is not None else (),
        input_rows=input_rows(motion, result.gauge, scene.body),
        conventions=CONVENTIONS,
    )
    write_whole(path, lambda stream: stream.write(page.encode()))
