"""Page about a motion and its split: story, moving body beside its curves, figures, numbers and inputs."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

from ...arguments import check_object
from ...arrays import Array
from ...body.body import Body
from ...errors import RunStopped, ShapePhaseError
from ...phases.phases import PhaseSplit
from ...reconstruction.reconstruction import Motion
from ...run_progress import ProgressCallback, check_progress
from ...segments.limbs import SegmentTree
from ...shape_space.body_path import as_path
from ...shape_space.shape_path import ShapePath
from ..named_figures import FIGURES, figure_image
from .page import Page
from .report_data import report_data
from .report_text import (
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
from .templates import SCENE_SCRIPTS, page_from
from .viewer import scene_and_data

_MOVING = ("momentum", "phases", "attitude", "shape")  # figures that the page's scripts draw


def _report_to(progress: ProgressCallback | None, share: float, text: str) -> None:
    """Report progress. Raises RunStopped where the callback returns something true."""
    if progress is not None and progress(share, text):
        raise RunStopped(f"stopped on request while {text}")


def figure_rows(figures: Sequence[Any]) -> list[Sequence[Any]]:
    """Rows of two figures, and of an odd number three in the last row."""
    last = max(len(figures) - 3, 0) if len(figures) % 2 else len(figures)
    rows = [figures[k : k + 2] for k in range(0, last, 2)]
    return rows + ([figures[last:]] if len(figures) % 2 else [])


def _has_arms_or_legs(body: Body) -> bool:
    """True for a body with an arm or a leg on one side, such as a person or an animal."""
    return any(limb.side and limb.kind in ("arm", "leg") for limb in SegmentTree(body).limbs().values())


def report(
    motion: Motion,
    result: PhaseSplit,
    *,
    shape_path: ShapePath | str | None = None,
    title: str | None = None,
    purpose: str | None = None,
    trail: str | None = None,
    up: str | None = None,
    error_bars: Sequence[str] = (),
    recording: Sequence[str] = (),
    noise: Array | None = None,
    progress: ProgressCallback | None = None,
) -> Page:
    """Page about a motion and its split: words, the moving body beside its curves, figures, numbers and inputs.

    The curves and the momentum on its sphere show the time of the moving body. Each figure of `FIGURES` stands there
    once: momentum, phases, attitude and joints as curves that move, the others as pictures. Somersault, tilt and twist
    come first where they are counted and the body has arms or legs.

    Parameters
    ----------
    motion : of one momentum, no batch
    result : its split
    shape_path : of the joints, for their torques and a table of them
    title : None: the label of the deformation
    purpose : a sentence or two that come first, such as what the motion was made for; None: none
    trail : a link whose origin leaves a trail in the animation
    up : as in `view`
    error_bars : lines of error bars, as `split` prints them
    recording : lines about a recording and its processing, as `split` prints them
    noise : of the samples of the joints, rms (n,) [rad or m], for bars of rates and torques; None: that for which a
        recording was smoothed
    progress : called with the share that is done and what is being done; a true return stops the report

    Raises
    ------
    MissingExtraError
        Without Matplotlib: pip install 'shapephase[plot]'.
    ShapeError
        If the motion is a batch.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> page = sp.plots.report(motion, sp.split(motion, "base"))
    >>> page.write("report.html")
    >>> page.html[:9]
    '<!doctype'
    """
    check_object(motion, "Motion", "motion")
    check_object(result, "PhaseSplit", "result")
    if shape_path is not None:
        shape_path = as_path(shape_path, name="shape_path")
    check_progress(progress)
    _report_to(progress, 0.0, "recording the animation")
    scene, data = scene_and_data(motion, speed=None, frames=None, trail=trail, ghost=True, up=up, fall={})
    beside = report_data(motion, scene.times, result.gauge, scene.body, scene.shapes)
    has_joints = shape_path is not None and shape_path.n_shape > 0
    kinds = [kind for kind, figure in FIGURES.items() if kind not in _MOVING and figure.in_report]
    kinds = [kind for kind in kinds if result.has_phase or not FIGURES[kind].with_momentum]
    kinds = [kind for kind in kinds if has_joints or not FIGURES[kind].with_path]
    kinds = [kind for kind in kinds if not (FIGURES[kind].of_change and is_rigid(motion))]
    if scene.body is None or not _has_arms_or_legs(scene.body) or motion.counted_axes() is None:
        kinds = [kind for kind in kinds if not FIGURES[kind].of_athlete]
    figures = []
    for done, kind in enumerate(kinds, start=1):
        _report_to(progress, done / (len(kinds) + 1), f"drawing {kind.replace('_', ' ')}")
        try:
            image = base64.b64encode(figure_image(kind, motion, shape_path, result.gauge)).decode()
        except ShapePhaseError:
            # The path is open, or its curvature cannot be integrated.
            if not FIGURES[kind].of_loop:
                raise
            continue
        figures.append({"caption": FIGURES[kind].caption, "image": image})
    torques = [torque_words(motion, noise)] if scene.body is not None and scene.body.n_shape else []
    return page_from(
        "report.html",
        title=title or motion.deformation.label,
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
