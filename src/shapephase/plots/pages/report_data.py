"""Curves beside the moving body of a report: in time, and the momentum on its sphere."""

from __future__ import annotations

from typing import Any

import numpy as np

from ... import so3
from ...arrays import Array
from ...body.body import Body
from ...phases.momentum_curve import Gauge, momentum_curve
from ...phases.phases import running_phases
from ...reconstruction.reconstruction import Motion
from .motion_data import single

_MOST_JOINTS = 8  # those that move most
_NO_TURN = 1e-9  # [rad] a smaller turn has no axis


def report_data(motion: Motion, times: Array, gauge: Gauge, body: Body | None, shapes: Array | None) -> dict[str, Any]:
    """Data of the curves at the frames (F,) [s]; `shapes` (F, n) are those of the body."""
    plots = [_turn_plot(motion, times)]
    data: dict[str, Any] = {"plots": plots, "directions": None}
    if motion.momentum.any():
        data["directions"] = single(momentum_curve(motion, gauge, times=times).directions(times)[0])
        phases = running_phases(motion, times, gauge)
        series = {
            "Montgomery": phases.montgomery_phase,
            "dynamic": phases.dynamic_phase,
            "geometric": phases.geometric_phase,
        }
        plots.insert(0, plot_data("phases so far", "°", {name: np.degrees(values) for name, values in series.items()}))
    if body is not None and shapes is not None:
        plots += _joint_plots(body, shapes)
    return data


def continued_rotation_vectors(rotations: Array) -> Array:
    """Rotation vectors that do not jump where the angle passes half a turn: (F, 3, 3) -> (F, 3) [rad]."""
    vectors = so3.log(rotations)
    for k in range(1, len(vectors)):
        angle, before = float(np.linalg.norm(vectors[k])), float(np.linalg.norm(vectors[k - 1]))
        if angle < _NO_TURN:
            # A whole turn has no axis of its own: that of before.
            if before > np.pi:
                vectors[k] += np.round(before / (2.0 * np.pi)) * 2.0 * np.pi * vectors[k - 1] / before
            continue
        axis = vectors[k] / angle
        turns = np.round((axis @ vectors[k - 1] - angle) / (2.0 * np.pi))
        vectors[k] += 2.0 * np.pi * turns * axis
    return vectors


def _turn_plot(motion: Motion, times: Array) -> dict[str, Any]:
    turned = motion.attitude(times) @ motion.initial_attitude.T
    vectors = np.degrees(continued_rotation_vectors(turned))
    series = {f"about {name}": vectors[:, k] for k, name in enumerate("XYZ")}
    return plot_data("turn since the start, as a rotation vector", "°", series)


def _joint_plots(body: Body, shapes: Array) -> list[dict[str, Any]]:
    found = []
    kinds = (("rad", "joints that turn", "°"), ("1", "ball joints, quaternions", ""), ("m", "joints that slide", "m"))
    for unit, title, shown in kinds:
        columns = np.flatnonzero([own == unit for own in body.joint_units])
        ranges = np.ptp(shapes[:, columns], axis=0)
        moving = columns[ranges > 0.0]
        most = moving[np.argsort(-ranges[ranges > 0.0], kind="stable")][:_MOST_JOINTS]
        left = len(moving) - len(most)
        if len(moving):
            scale = np.degrees(1.0) if unit == "rad" else 1.0
            more = f", {len(most)} of {len(moving)}" if left else ""
            series = {body.joint_names[k]: scale * shapes[:, k] for k in sorted(most.tolist())}
            found.append(plot_data(title + more, shown, series))
    return found


def plot_data(title: str, unit: str, series: dict[str, Array]) -> dict[str, Any]:
    """Data of curves that a page draws in time."""
    curves = [{"name": name, "values": single(values)} for name, values in series.items()]
    return {"title": title, "unit": unit, "series": curves}
