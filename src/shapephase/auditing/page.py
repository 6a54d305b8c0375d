"""One HTML file about an audit: verdict, momentum and fall in time, what hypotheses leave over, and all numbers."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..arguments import check_object
from ..body.body import Body
from ..body.loading import as_body
from ..letters import printable
from ..plots.pages.page import Page
from ..plots.pages.report_page import figure_rows
from ..plots.pages.templates import page_from
from ..plots.plot_style import axes_image
from ._held_states import held_states
from ._observation import observed
from ._residuals import residuals
from .audit_result import Audit, RunAudit
from .figures import fall_figure, left_over_figures, momentum_figure
from .floating_trajectory import FloatingTrajectory
from .hypothesis import EXPLAINS, Hypothesis, percent
from .trajectory_audit import given_runs, thinned

_MOST_ROWS = 20  # hypotheses of the table; the record has all
_KEY = "Grey: not audited."


def audit_page(body: Body | str, trajectories: FloatingTrajectory | Sequence[FloatingTrajectory], found: Audit) -> Page:
    """Return the page of an audit, which opens offline.

    Momentum and fall are drawn for all samples, those that were not audited on grey; then the residuals before and
    after each hypothesis.

    Parameters
    ----------
    body, trajectories : those of the audit
    found : by `audit`

    Raises
    ------
    MissingExtraError
        Without Matplotlib: pip install 'shapephase[plot]'.

    Examples
    --------
    >>> cat, times = sp.load_body("cat_two_halves"), np.linspace(0.0, 1.0, 51)
    >>> still = sp.FloatingTrajectory(
    ...     times=times, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (51, 1)), shapes=np.zeros((51, 3)))
    >>> sp.auditing.audit_page(cat, still, sp.audit(cat, still)).html[:9]
    '<!doctype'
    """
    body = as_body(body)
    check_object(found, "Audit", "found")
    given = [held_states(run)[0] for run in given_runs(trajectories)]
    return page_from(
        "audit.html",
        title=f"Audit of {found.body}",
        scripts=(),
        styles=("page", "report_page", "audit_page"),
        data={},
        verdict=found.verdict,
        flights=figure_rows(list(_flights(body, given, found))),
        residuals=figure_rows(list(_left_over(body, given, found))),
        runs=[(run.name, _facts(run)) for run in found.runs],
        hypotheses=[_row(hypothesis, found) for hypothesis in found.hypotheses[:_MOST_ROWS]],
        others=max(len(found.hypotheses) - _MOST_ROWS, 0),
        enough=percent(EXPLAINS),
        notes=found.notes,
    )


def _flights(body: Body, trajectories: Sequence[FloatingTrajectory], found: Audit) -> Iterator[dict[str, str]]:
    for run, trajectory in zip(found.runs, trajectories, strict=True):
        seen, name = observed(body, trajectory, run.noise), printable(run.name)
        yield _shown(momentum_figure(run, seen), f"{name}: angular momentum about the centre of mass. {_KEY}")
        fall = fall_figure(run, seen)
        if fall is not None:
            yield _shown(fall, f"{name}: the centre of mass, dotted the parabolas of free fall. {_KEY}")


def _left_over(body: Body, trajectories: Sequence[FloatingTrajectory], found: Audit) -> Iterator[dict[str, str]]:
    if not any(hypothesis.residuals is not None for hypothesis in found.hypotheses):
        return
    part = found.runs[0].airborne
    flown = thinned(trajectories[0].part(part.first, part.past))
    before = residuals(body, observed(body, flown, found.runs[0].noise))
    for hypothesis, figure in left_over_figures(found, before):
        yield _shown(figure, f"{hypothesis.name}: {percent(hypothesis.share)} left over")


def _shown(figure: Any, caption: str) -> dict[str, str]:
    return {"caption": caption, "image": base64.b64encode(axes_image(figure.axes[0], "svg")).decode()}


def _facts(run: RunAudit) -> list[tuple[str, str, str]]:
    """Name, value and explanation of each result of a run."""
    rows = [
        ("audited", f"{run.first_time:.6g} to {run.last_time:.6g} s", f"{len(run.times)} samples; {run.airborne.how}"),
        (
            "momentum",
            f"{run.relative_drift:.2g}",
            "largest slow change, of what turns the body; " + _against(run.momentum_ratio),
        ),
    ]
    if run.fall_off is not None and run.fall_ratio is not None:
        rows.append(("fall", f"{run.fall_off:.2g} m", "off a parabola; " + _against(run.fall_ratio)))
    if run.airborne.acceleration is not None:
        pull = " ".join(f"{part:.4g}" for part in run.airborne.acceleration)
        rows.append(("acceleration", f"{pull} m/s²", "of the centre of mass, axes of the world"))
    if run.agreement is not None:
        rows.append(("rates", f"{run.agreement.mismatch:.2g}", "off the samples; " + _against(run.agreement.ratio)))
    if run.attitude_error is not None:
        degrees = f"{float(np.degrees(run.attitude_error.max())):.3g}°"
        rows.append(("attitude", degrees, "at most from the nearest exact reconstruction"))
    return rows


def _against(ratio: float) -> str:
    return "noise explains it" if ratio <= 1.0 else "more than noise"


def _row(hypothesis: Hypothesis, found: Audit) -> tuple[str, ...]:
    named = any(cause.name == hypothesis.name for cause in found.cause)
    return (
        "named" if named else "",
        hypothesis.name,
        percent(hypothesis.share),
        f"{hypothesis.left_over:.2g}",
        "; ".join(text for text in (hypothesis.text, hypothesis.remark) if text),
    )
