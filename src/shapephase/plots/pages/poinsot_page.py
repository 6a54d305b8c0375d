"""Poinsot's description as a page to play: the inertia ellipsoid of a free rigid body rolls on the invariable plane."""

from __future__ import annotations

from typing import Any

import numpy as np

from ... import so3
from ...arguments import check_object, number_argument
from ...arrays import Array
from ...display import numbers
from ...errors import ShapeError
from ...inertia_tensor import inverse_inertia
from ...letters import value_text
from ...rigid_body.euler_top import EulerTop
from ...rigid_body.poinsot import Poinsot
from .page import Page, frame_count, playing_speed
from .report_data import plot_data
from .templates import SCENE_SCRIPTS, page_from

_PERIODS = 3.0  # of the body momentum that are shown
_TURNS = 6.0  # shown without a period, at the rate of the angular velocity at the start
_POLHODE = 361  # points: chords are within a line's width of the curve
_PLANE = 1.15  # radius of the drawn plane, over that of ellipsoid and herpolhode
_ARROW = 1.35  # length of the momentum's arrow, over the distance of the plane
_LINES = 13  # of the plane in each direction
_COLOUR = (0.337, 0.706, 0.914, 0.62)  # of the ellipsoid, which is transparent
_OUTERMOST = 61  # times at which the ellipsoid's extent is taken, to keep it in the picture


def rolling_ellipsoid(
    top: EulerTop, *, duration: float | None = None, speed: float | None = None, frames: int | None = None
) -> Page:
    """Page of Poinsot's description of a free rigid body, to play and scrub.

    The ellipsoid {w : w.I w = 2K} moves with the body and rolls without slipping on the plane {w : w.mu = 2K}. The
    point of contact is the angular velocity; it draws the polhode on the ellipsoid and the herpolhode on the plane.
    Lengths are angular velocities [rad/s]. The momentum points down, so that the plane lies below, as a table does.

    Source: Marsden and Ratiu, section 15.5; theory.md H2, I1.

    Parameters
    ----------
    top : with angular momentum
    duration : of the motion shown, from t = 0 [s]; None: three periods of the body momentum, or where there is none as
        long as six turns at the rate of the angular velocity at the start
    speed : seconds of motion in a second of playing; None: 1, or such that playing takes from 4 to 20 s
    frames : None: 30 in a second of playing

    Raises
    ------
    ShapeError
        For a top without momentum; a duration or a speed that is not above 0; fewer than two frames.

    Examples
    --------
    >>> top = sp.EulerTop.principal([1.0, 2.0, 3.0], [0.6, 0.9, 0.5])
    >>> page = sp.plots.rolling_ellipsoid(top, frames=50)
    >>> page.write("rolling.html")
    >>> page.title
    'A rigid body: its ellipsoid rolls on the invariable plane'
    """
    check_object(top, "EulerTop", "top")
    rolling = Poinsot(top)
    shown = _duration(top, duration)
    rate = playing_speed(shown, speed)
    count = frame_count(shown, rate) if frames is None else frames
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 2:
        raise ShapeError(f"frames: a whole number of 2 or more is needed, got {value_text(frames)}")
    times = np.linspace(0.0, shown, int(count))
    return page_from(
        "poinsot.html",
        title="A rigid body: its ellipsoid rolls on the invariable plane",
        scripts=(*SCENE_SCRIPTS, "plots", "poinsot_page"),
        styles=("page", "report_page"),
        data={
            "motion": _motion(rolling, times, rate),
            "rolling": _rolling(rolling, times),
            "plots": _plots(rolling, times),
        },
        film=(shown, rate),
        facts=rolling_facts(top),
    )


def _duration(top: EulerTop, duration: float | None) -> float:
    if duration is None:
        if np.isfinite(top.period):
            return _PERIODS * top.period
        return _TURNS * 2.0 * np.pi / float(np.linalg.norm(top.angular_velocity(0.0)))
    found = number_argument(duration, "duration", "s")
    if not found > 0.0:
        raise ShapeError(f"duration: a time above 0 is needed, got {value_text(duration)} s")
    return found


def _motion(rolling: Poinsot, times: Array, speed: float) -> dict[str, Any]:
    """Data of the moving ellipsoid, as `motion_data` has them."""
    top, still = rolling.top, np.zeros((len(times), 3), dtype=np.float32)
    whole = np.zeros((len(times), 4), dtype=np.float32)
    whole[:, 3] = 1.0
    reach = float(rolling.semi_axes.max())
    pose = np.eye(4)
    pose[:3, :3] = top.axes
    ellipsoid = {
        "kind": "ellipsoid",
        "dimensions": rolling.semi_axes.tolist(),
        "colour": list(_COLOUR),
        "pose": pose.T.ravel().tolist(),
    }
    node = {"name": "ellipsoid", "turns": whole, "places": still, "scales": None, "shapes": [ellipsoid]}
    return {
        "duration": float(times[-1]),
        "frames": len(times),
        "speed": speed,
        "turns": so3.quat_from_matrix(top.attitude(times)).astype(np.float32),
        "places": still,
        "centre": still,
        "momentum": top.momentum.tolist(),
        "trail": None,
        "reach": reach,
        "arrow": max(1.0, _ARROW * rolling.distance / reach),
        "extent": _extent(rolling, times).astype(np.float32),
        "up": (-rolling.normal).tolist(),
        "ghost": False,
        "floor": None,
        "meshes": [],
        "chain": None,
        "joints": [],
        "nodes": [node],
    }


def _extent(rolling: Poinsot, times: Array) -> Array:
    """The rim of the plane, and the highest that the ellipsoid ever is above it: (N, 3)."""
    across, along = rolling.plane_axes
    normal, twice_energy = rolling.normal, rolling.distance * rolling.top.magnitude
    around = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)[:, None]
    rim = rolling.distance * normal + _plane_radius(rolling) * (np.cos(around) * across + np.sin(around) * along)
    some = times[:: max(1, len(times) // _OUTERMOST)]
    # The ellipsoid w.S w = 2K reaches sqrt(2K n.S^-1 n) along n.
    inverse = inverse_inertia(rolling.ellipsoid(some))
    heights = np.sqrt(twice_energy * np.einsum("i,nij,j->n", normal, inverse, normal))
    return np.concatenate([rim, -heights.max() * normal[None]])


def _plane_radius(rolling: Poinsot) -> float:
    return _PLANE * max(float(rolling.semi_axes.max()), rolling.annulus[1])


def _rolling(rolling: Poinsot, times: Array) -> dict[str, Any]:
    """Curves beside the ellipsoid, and the plane as lines, in rad/s."""
    top = rolling.top
    across, along = rolling.plane_axes
    foot, radius = rolling.distance * rolling.normal, _plane_radius(rolling)
    shares = np.linspace(-1.0, 1.0, _LINES)[1:-1, None]
    halves = np.sqrt(1.0 - shares**2)
    lines = [
        foot + radius * np.stack([shares * one - halves * other, shares * one + halves * other], axis=1)
        for one, other in ((across, along), (along, across))
    ]
    last = top.period if np.isfinite(top.period) else times[-1]
    return {
        "contact": rolling.herpolhode(times).astype(np.float32),
        "polhode": rolling.polhode(np.linspace(0.0, last, _POLHODE)).astype(np.float32),
        "inertia": top.inertia.ravel().tolist(),
        "foot": foot.tolist(),
        "across": across.tolist(),
        "along": along.tolist(),
        "radius": radius,
        "annulus": list(rolling.annulus),
        "lines": np.concatenate(lines).reshape(-1, 3).astype(np.float32),
    }


def _plots(rolling: Poinsot, times: Array) -> list[dict[str, Any]]:
    velocity = rolling.polhode(times) @ rolling.top.axes
    along = {f"axis of I{sign}": velocity[:, k] for k, sign in enumerate("₁₂₃")}
    turning = plot_data("angular velocity along the principal axes", "rad/s", along)
    if not rolling.annulus[1]:
        # The herpolhode is a point.
        return [turning]
    radius, angle = rolling.herpolhode_radius(times), np.degrees(rolling.herpolhode_angle(times))
    return [
        turning,
        plot_data("herpolhode: distance from the foot of the momentum", "rad/s", {"radius": radius}),
        plot_data("herpolhode: angle about the momentum", "°", {"angle": angle}),
    ]


def rolling_facts(top: EulerTop) -> list[tuple[str, str, str]]:
    """Names, numbers and meanings for a top with momentum."""
    rolling = Poinsot(top)
    inner, outer = rolling.annulus
    rows = [
        ("Principal moments", numbers(top.moments, "kg m²"), "ascending; the axes of the ellipsoid are √(2K/I)"),
        ("Semi-axes", numbers(rolling.semi_axes, "rad/s"), "of the ellipsoid"),
        ("Angular momentum", numbers(top.magnitude, "kg m²/s"), "the normal of the plane"),
        ("Energy", numbers(top.energy, "J"), f"so that the plane is {rolling.distance:.6g} rad/s from the centre"),
        ("Regime", top.regime, "what the momentum does in the body"),
        ("Annulus", f"{inner:.6g}, {outer:.6g} rad/s", "circles that the herpolhode touches"),
    ]
    if np.isfinite(top.period):
        rows += [
            ("Period", numbers(top.period, "s"), "of the momentum in the body: the polhode closes"),
            ("Angle per period", f"{np.degrees(rolling.angle_per_period):.6g}°", "by which the herpolhode advances"),
        ]
    return rows
