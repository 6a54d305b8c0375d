"""One HTML file about a motion: its split in numbers, the animation, the figures, the inputs with their hashes."""

from __future__ import annotations

import base64
import html
import os
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .. import so3
from ..arguments import check_object
from ..arrays import Array
from ..files import write_whole
from ..phases.phases import PhaseSplit
from ..provenance import provenance
from ..reconstruction.reconstruction import Motion
from ..shape_space.shape_path import ShapePath
from ._letters import printable
from ._page_policy import page_policy, policy_element
from .named_figures import FIGURES, figure_image
from .viewer import motion_html

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff; margin: 0 auto; max-width: 60rem;
       padding: 1rem 1.5rem 3rem; }
h1 { font-size: 1.6rem; margin: 1rem 0 0.2rem; } h2 { font-size: 1.15rem; margin: 2rem 0 0.5rem; }
p.lead { color: #555; margin: 0 0 1rem; }
iframe { width: 100%; height: 30rem; border: 1px solid #ccc; border-radius: 4px; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 0.15rem 1.2rem 0.15rem 0; vertical-align: top; }
td.number { text-align: right; } tr.first td { border-top: 1px solid #ddd; }
th { font-weight: 600; color: #555; font-size: 0.9rem; }
div.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(22rem, 1fr)); gap: 1rem; }
figure { margin: 0; } figure img { width: 100%; } figcaption { font-size: 0.9rem; color: #555; }
code { font-size: 0.85rem; overflow-wrap: anywhere; }
"""
_CONVENTIONS = (
    ("attitude R", "takes base axes to inertial axes; R' = R hat(omega), omega in base axes"),
    ("quaternion", "x y z w, w not negative"),
    ("momentum", "about the centre of mass, inertial axes, constant"),
    ("phase", "angle about the momentum, right-hand rule; solid angles are signed, seen from outside"),
    ("split", "total rotation = exp(Montgomery phase about the momentum) tilt holonomy, in the horizontal gauge"),
)


def write_report(
    motion: Motion,
    result: PhaseSplit,
    path: str | os.PathLike[str],
    *,
    shape_path: ShapePath | None = None,
    title: str | None = None,
    trail: str | None = None,
    begin: Callable[[str], object] = lambda _: None,
) -> None:
    """Write a motion and its split as one HTML file that opens offline; whole or not at all.

    Parameters
    ----------
    motion : of one momentum, no batch
    result : its split
    path : of the file
    shape_path : of the joints, for a figure of it
    title : None: the label of the deformation
    trail : a link whose origin leaves a trail in the animation
    begin : called with a few words before each longer step

    Raises
    ------
    MissingExtraError
        Without viser or Matplotlib: pip install 'shapephase[viz,plot]'.
    ShapeError
        If the motion is a batch.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> sp.plotting.write_report(motion, sp.split(motion, "base"), "report.html")
    >>> from pathlib import Path
    >>> Path("report.html").read_text()[:9]
    '<!doctype'
    """
    check_object(motion, "Motion", "motion")
    check_object(result, "PhaseSplit", "result")
    begin("recording the animation")
    animation = motion_html(motion, trail=trail)
    figures = []
    for kind, figure in FIGURES.items():
        if (figure.with_momentum and not result.has_phase) or (figure.with_path and shape_path is None):
            continue
        begin(f"drawing {kind.replace('_', ' ')}")
        figures.append(_figure(kind, motion, shape_path, result.gauge))
    heading = html.escape(printable(title or motion.deformation.label))
    page = "\n".join(
        [
            "<!doctype html>",
            f'<html lang="en"><head>{policy_element(page_policy(animation))}<title>{heading}</title>',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<style>{_STYLE}</style></head><body>",
            f"<h1>{heading}</h1>",
            f'<p class="lead">{_lead(motion)}</p>',
            f'<iframe title="animation" srcdoc="{html.escape(animation)}"></iframe>',
            "<h2>The split</h2>",
            _table(_split_rows(result)),
            "<h2>Figures</h2>",
            f'<div class="figures">{"".join(figures)}</div>',
            "<h2>Accuracy and inputs</h2>",
            _table(_input_rows(motion)),
            "<h2>Conventions</h2>",
            _table([(name, "", text) for name, text in _CONVENTIONS]),
            "</body></html>",
        ]
    )
    write_whole(path, lambda stream: stream.write(page.encode()))


def _figure(kind: str, motion: Motion, path: ShapePath | None, gauge: str) -> str:
    data = base64.b64encode(figure_image(kind, motion, path, gauge)).decode()
    caption = html.escape(FIGURES[kind].caption)
    image = f'<img alt="{caption}" src="data:image/svg+xml;base64,{data}">'
    return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"


def _lead(motion: Motion) -> str:
    momentum = " ".join(f"{value:g}" for value in motion.momentum)
    return f"{motion.duration:g} s, angular momentum ({momentum}) kg m²/s"


def _split_rows(result: PhaseSplit) -> list[tuple[str, str, str]]:
    errors = result.error_estimates
    rows = [
        _rotation("Total rotation", result.total_rotation, errors.total_rotation),
        _rotation("Shape holonomy" if result.is_loop else "Shape lift (open path)", result.holonomy, errors.holonomy),
        _rotation("Dynamical rotation", result.dynamical_rotation, errors.dynamical_rotation),
    ]
    if not result.has_phase:
        return [
            *rows,
            ("Montgomery phase", "", "none: there is no angular momentum, the body turns by its shape alone"),
        ]
    area = float(result.solid_angle)
    return [
        *rows,
        _phase("Montgomery phase", result.montgomery_phase, errors.montgomery_phase, f"{result.gauge} gauge"),
        _phase("Dynamic phase", result.dynamic_phase, errors.dynamic_phase, ""),
        _phase("Geometric phase", result.geometric_phase, errors.geometric_phase, f"solid angle {area:.9f} sr"),
        _rotation("Tilt", result.tilt, errors.tilt),
        _phase("Momentum gap", result.momentum_gap, errors.momentum_gap, "between its directions at start and end"),
    ]


def _rotation(name: str, rotation: Array, error: Array) -> tuple[str, str, str]:
    vector = so3.log(rotation)
    angle = float(np.linalg.norm(vector))
    axis = "" if angle < 1e-12 else "about (" + ", ".join(f"{x:.6f}" for x in np.round(vector / angle, 6) + 0.0) + ")"
    return name, f"{np.degrees(angle):.6f}°", f"{axis} ± {float(error):.1e} rad".strip()


def _phase(name: str, phase: Array, error: Array, remark: str) -> tuple[str, str, str]:
    radians = f"{float(phase):.9f} ± {float(error):.1e} rad"
    return name, f"{float(np.degrees(phase)):.6f}°", f"{radians}; {remark}" if remark else radians


def _input_rows(motion: Motion) -> list[tuple[str, str, str]]:
    quaternion = ", ".join(f"{x:.9f}" for x in motion.quat_xyzw(motion.duration) + 0.0)
    rows = [
        ("Final attitude", "", f"quaternion x y z w ({quaternion})"),
        ("Error estimate", f"{float(motion.error_estimate):.2e} rad", f"tolerance {motion.tolerance:g} rad"),
        ("Evaluations", str(motion.evaluations), f"of the body, method {motion.method}"),
        ("Deformation", "", motion.deformation.label),
    ]
    rows += [(f"SHA-256, {name}", "", digest) for name, digest in motion.deformation.inputs.items()]
    return [*rows, *_origin_rows(motion.deformation.made_from)]


def _origin_rows(made_from: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """The joints, the recording and what was done to it, and when, how and by what all was computed."""
    found = provenance()
    rows = [("Joints", "", ", ".join(made_from.get("joints", ())))] if made_from.get("joints") else []
    for name, value in made_from.get("recording", {}).items():
        if value not in (None, {}, []):
            rows.append((f"Recording, {name.replace('_', ' ')}", "", _plain_text(value)))
    versions = ", ".join(f"{name} {number}" for name, number in found["versions"].items())
    rows += [("Command line", "", found["command"])] if found["command"] else []
    return [*rows, ("Computed by", "", versions), ("Date", "", found["date"])]


def _plain_text(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name}: {_plain_text(entry)}" for name, entry in value.items())
    if isinstance(value, list | tuple):
        return " ".join(_plain_text(entry) for entry in value)
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _table(rows: list[tuple[str, str, str]]) -> str:
    escaped = ([html.escape(printable(cell)) for cell in row] for row in rows)
    lines = "".join(
        f'<tr><th>{name}</th><td class="number">{value}</td><td>{text}</td></tr>' for name, value, text in escaped
    )
    return f"<table>{lines}</table>"
