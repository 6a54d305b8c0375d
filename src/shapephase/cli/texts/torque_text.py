"""Torques of joints as a table for people and as plain data for programs."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...body.body import Body
from ...display import number_with_bar
from ...dynamics.loads import JointLoads
from ...dynamics.torque_noise import LoadErrors, load_errors
from ...dynamics.torques import JointTorques
from ...errors import WrongObjectError
from ...plain_data import plain
from ...reconstruction.reconstruction import Motion
from ...shape_space.files.read import RecordedMotion
from .result_text import split_heading

_LEAST_SHARE = 1e-3  # of a limit that is printed
_EFFORTS = {"rad": "N m", "m": "N"}


def torque_lines(
    loads: JointLoads, flown: Motion, body: Body, motion_name: str, bars: LoadErrors | None = None
) -> list[str]:
    """Return the table of peaks, limits, power and work of each joint, with bars for a recording."""
    head = ("joint", "peak", "", "at [s]", "per kg", "of limit", "peak rate", "", "of limit", "peak [W]", "work [J]")
    rows: list[tuple[str, ...]] = [head]
    for k, (name, unit) in enumerate(zip(loads.joint_names, loads.joint_units, strict=True)):
        own = (
            (None,) * 4 if bars is None else (bars.peak_torque[k], bars.peak_rate[k], bars.peak_power[k], bars.work[k])
        )
        rows.append(
            (
                name,
                _with_bar(loads.peak_torque[k], own[0]),
                _EFFORTS[unit],
                f"{loads.peak_time[k]:.4g}",
                _with_bar(loads.peak_torque_per_mass[k], None if own[0] is None else own[0] / loads.mass),
                _share(loads.effort_limits[k], loads.effort_share[k], own[0]),
                _with_bar(loads.peak_rate[k], own[1]),
                f"{unit}/s",
                _share(loads.rate_limits[k], loads.rate_share[k], own[1]),
                _with_bar(loads.peak_power[k], own[2]),
                _with_bar(loads.work[k], own[3]),
            )
        )
    beyond = [
        name
        for name, effort, rate in zip(loads.joint_names, loads.effort_share, loads.rate_share, strict=True)
        if max(effort, rate) > 1.0
    ]
    whole, change = (
        _with_bar(float(value), None if bars is None else bars.total_work, 6)
        for value in (loads.work.sum(), loads.energy_change)
    )
    return [
        split_heading(body, motion_name, flown),
        "",
        *_aligned(rows),
        "",
        f"net work of all joints {whole} J, change of the kinetic energy {change} J",
        f"beyond a limit of the body's file: {', '.join(beyond) if beyond else 'none'}",
    ]


def load_bars(motion: Motion, loads: JointLoads, recorded: RecordedMotion | None) -> tuple[LoadErrors | None, str]:
    """Return the bars of a recording's loads, and a line about them; other motions have none."""
    if recorded is None:
        return None, ""
    if recorded.smoothing is None:
        return (
            None,
            "± unknown: give the noise of the recording (--smooth 0.3deg, --lowpass 6); most of this may be noise",
        )
    try:
        found = load_errors(motion, loads)
    except WrongObjectError as error:
        return None, f"± unknown: {error}"
    if recorded.smoothing.low_pass is not None:
        return (
            found,
            "± one standard deviation, by the noise that passes the filter; what the filter removes is not included",
        )
    return found, "± one standard deviation, by the given noise and the smoothing bias"


def _aligned(rows: list[tuple[str, ...]]) -> list[str]:
    """Return aligned columns: names and units to the left, numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [
            cell.ljust(width) if which == 0 or rows[0][which] == "" else cell.rjust(width)
            for which, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        # A unit follows its number.
        lines.append("".join((" " if rows[0][k] == "" else "  ") * (k > 0) + cell for k, cell in enumerate(cells)))
    return [line.rstrip() for line in lines]


def _with_bar(value: float, bar: float | None, digits: int = 4) -> str:
    """Return a number with its bar, if it has one, ending at the same digit."""
    if bar is None:
        return f"{value:.{digits}g}"
    return number_with_bar(float(value), float(bar))


def torque_data(
    found: JointTorques, flown: Motion, body: Body, motion_name: str, bars: LoadErrors | None = None
) -> dict[str, Any]:
    """Return the torques for programs."""
    own = {} if bars is None else {"standard_deviations": plain(bars)}
    return {
        "body": body.name,
        "motion": motion_name,
        "duration_s": flown.duration,
        "momentum_kg_m2_s": flown.momentum.tolist(),
        **found.loads.to_dict(),
        "largest_base_wrench": float(np.abs(found.base_wrench).max(initial=0.0)),
        "error_estimate_rad": float(flown.error_estimate),
        **own,
    }


def _share(limit: float, share: float, bar: float | None) -> str:
    """Return the used share of a limit; the bar is that of the load."""
    if not np.isfinite(limit):
        return "none"
    if bar is not None:
        return f"{number_with_bar(100.0 * share, 100.0 * bar / limit)} %"
    return f"{100.0 * share:.1f} %" if share >= _LEAST_SHARE or share == 0.0 else "<0.1 %"
