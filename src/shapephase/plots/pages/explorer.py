"""Page to draw loops of two joints on, with the turn of the body along them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arrays import Array, finite_array
from ...body.body import Body
from ...body.drawing.appearance import visuals
from ...body.loading import as_body
from ...errors import ShapeError
from ...letters import value_text
from ...shape_space.curvature_field import curvature_on_plane
from .._moving_scene import shapes_by_link
from ..plot_style import NEGATIVE_CURVATURE, POSITIVE_CURVATURE
from .motion_data import body_data, frame_nodes, up_axis
from .page import Page
from .plane_series import PlaneSeries, least_perturbation_turns, plane_series
from .templates import SCENE_SCRIPTS, page_from

_MAP = 101  # points of the curvature map along each joint
_END = {"rad": np.pi, "m": 1.0}  # [rad, m] of the map for a joint without a limit
_NO_LIMIT = 100.0
_MARGIN = 0.06  # of the map's width, on either side: a spline swings beyond its points
_FRAMES = 241  # of the moving body
_DURATION = 4.0
_SIZES = 5  # shapes along each joint at which the size of the body is taken


def explore(body: Body | str, joints: Sequence[str], *, rest: ArrayLike | None = None, up: str | None = None) -> Page:
    """Page with the curvature of the connection over two joints, to draw closed loops on.

    The page computes the turn of the body along the periodic cubic spline through the loop's points, by ordered
    products of exponentials, without angular momentum or with one that is chosen by sliders. It states how far the turn
    may be off: by the Chebyshev series of inertia and momentum that it carries, and by its steps; and the flux of the
    curvature through the loop. Sliders move what is drawn. The loop can be saved as a CSV file that `split` reads, the
    map with it as PNG or SVG; the loop of such a file can be opened.

    Parameters
    ----------
    joints : two of the body's, by name
    rest : (n,) values of the other joints, in the body's order [rad or m]; None: neutral
    up : as in `view`

    Returns
    -------
    the page; `data["plane"]["box"]` are the ends of the series, `data["plane"]["connection_error"]` is its error

    Raises
    ------
    UnknownNameError, ShapeError
        For joints that the body does not have, or other than two; an unknown axis.
    SingularInertiaError
        If at a shape of the map all mass is on one line.

    Examples
    --------
    >>> plane = sp.plots.explore(sp.load_body("cat"), ("waist_pitch", "waist_yaw")).data["plane"]
    >>> print(np.round(plane["box"], 3).tolist(), plane["connection_error"] < 1e-9)  # the map's ends [rad]
    [[-2.286, 1.186], [-1.68, 1.68]] True
    """
    body = as_body(body)
    if (
        isinstance(joints, str)
        or not isinstance(joints, Sequence | np.ndarray)
        or len(joints) != 2
        or joints[0] == joints[1]
    ):
        raise ShapeError(f"joints: two different joints of {body.name} are needed, got {value_text(joints)}")
    places = body.joint_index(joints[0]), body.joint_index(joints[1])
    for name in joints:
        if body.joint_units[body.joint_index(name)] not in _END:
            raise ShapeError(f"joints: {name} is a number of a ball joint, which has no plane of angles; take others")
    still = body.shape() if rest is None else finite_array(rest, "rest", (body.n_shape,))
    upwards = up_axis(up, body)
    shown = _map_box(body, places)
    margin = _MARGIN * (shown[:, 1:] - shown[:, :1])
    series = plane_series(body, places, shown + margin * np.array([-1.0, 1.0]), still)
    return page_from(
        "explore.html",
        title=f"{body.name}: loops of {joints[0]} and {joints[1]}",
        scripts=(*SCENE_SCRIPTS, "plots", "loop", "holonomy", "svg_pen", "map", "explore_page"),
        styles=("page", "explore_page"),
        data={
            "motion": _still_motion(body, places, shown, still, upwards),
            "plane": _plane_data(body, joints, places, shown, still, series),
        },
        joints=list(joints),
    )


def _map_box(body: Body, places: tuple[int, int]) -> Array:
    box = []
    for place in places:
        end = _END[body.joint_units[place]]
        lower, upper = body.joint_limits[place]
        box.append((lower if abs(lower) < _NO_LIMIT else -end, upper if abs(upper) < _NO_LIMIT else end))
    return np.array(box)


def _plane_data(
    body: Body, joints: Sequence[str], places: tuple[int, int], shown: Array, rest: Array, series: PlaneSeries
) -> dict[str, Any]:
    """The map, in base axes and in the frame of least perturbation, and the series."""
    across, along = (np.linspace(ends[0], ends[1], _MAP) for ends in shown)
    field = curvature_on_plane(body, joints, across, along, rest)
    turns = least_perturbation_turns(series, across, along)
    return {
        "joints": [{"name": body.joint_names[k], "unit": body.joint_units[k], "place": k} for k in places],
        "all_joints": list(body.joint_names),
        "rest": rest.tolist(),
        "shown": shown.tolist(),
        "box": series.box.tolist(),
        "degree": len(series.inertia) - 1,
        # six entries of a symmetric tensor: xx, yy, zz, yz, xz, xy
        "inertia": np.ascontiguousarray(series.inertia[..., [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]),
        "momentum": np.ascontiguousarray(series.momentum),
        "inertia_error": series.inertia_error,
        "momentum_error": series.momentum_error,
        "connection_error": series.error,
        "largest_momentum": _largest_momentum(series),
        "map": _MAP,
        "colours": {"positive": POSITIVE_CURVATURE, "negative": NEGATIVE_CURVATURE},
        "curvature": {
            "base axes": field.astype(np.float32),
            "least perturbation": so3.apply(turns, field).astype(np.float32),
        },
    }


def _largest_momentum(series: PlaneSeries) -> float:
    """Largest momentum of the sliders: about one turn in a round of the loop, two digits [kg m^2/s]."""
    mean = float(np.trace(series.inertia[0, 0])) / 3.0
    return float(f"{2.0 * np.pi * mean / _DURATION:.1e}")


def _still_motion(body: Body, places: tuple[int, int], shown: Array, rest: Array, up: Array) -> dict[str, Any]:
    """Data of the body at rest, in whose place the page's scripts put the motion along a loop."""
    grid = np.meshgrid(*(np.linspace(ends[0], ends[1], _SIZES) for ends in shown), indexing="ij")
    shapes = np.tile(rest, (_SIZES**2, 1))
    shapes[:, places[0]], shapes[:, places[1]] = (values.ravel() for values in grid)
    by_link = shapes_by_link(visuals(body))
    centre = body.centre_of_mass(shapes)
    reach = 0.0
    for link, own in by_link.items():
        poses = body.link_pose(shapes, link)
        for shape in own:
            corners = shape.corners @ shape.pose[:3, :3].T + shape.pose[:3, 3]
            points = corners @ so3.transpose(poses[:, :3, :3]) + poses[:, None, :3, 3] - centre[:, None]
            reach = max(reach, float(np.linalg.norm(points, axis=-1).max()))
    stored: list[dict[str, Any]] = []
    still = np.zeros((_FRAMES, 3), dtype=np.float32)
    identity = np.zeros((_FRAMES, 4), dtype=np.float32)
    identity[:, 3] = 1.0
    return {
        "duration": _DURATION,
        "frames": _FRAMES,
        "speed": 1.0,
        "turns": identity,
        "places": still,
        "centre": still.copy(),
        "shapes": np.tile(rest, (_FRAMES, 1)).astype(np.float32),
        "momentum": [0.0, 0.0, 0.0],
        "momentum_changes": True,
        "trail": None,
        "reach": reach,
        "extent": (0.8 * reach * np.concatenate([np.eye(3), -np.eye(3)])).astype(np.float32),
        "up": up.tolist(),
        "ghost": True,
        "floor": None,
        "meshes": stored,
        "nodes": frame_nodes(body, by_link, {}, stored),
        **body_data(body),
    }
