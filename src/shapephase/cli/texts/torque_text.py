"""The torques of joints as a table for people and as plain data for programs."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...body.body import Body
from ...dynamics.loads import JointLoads
from ...dynamics.torques import JointTorques
from ...reconstruction.reconstruction import Motion
from .result_text import split_heading

# Of a limit, that is still printed.
_LEAST_SHARE = 1e-3
_EFFORTS = {"rad": "N m", "m": "N"}


def torque_lines(loads: JointLoads, flown: Motion, body: Body, motion_name: str) -> list[str]:
    """Peaks, limits, power and work of each joint for people."""
    width = max(map(len, ("joint", *loads.joint_names)))
    lines = [
        split_heading(body, motion_name, flown),
        "",
        f"{'joint':<{width}}{'peak':>15}{'at [s]':>10}{'per kg':>12}{'of limit':>10}{'peak rate':>17}{'of limit':>10}"
        f"{'peak [W]':>12}{'work [J]':>13}",
    ]
    for k, (name, unit) in enumerate(zip(loads.joint_names, loads.joint_units, strict=True)):
        lines.append(
            f"{name:<{width}}{loads.peak_torque[k]:11.4g} {_EFFORTS[unit]:<3}{loads.peak_time[k]:10.4g}"
            f"{loads.peak_torque_per_mass[k]:12.4g}{_share(loads.effort_limits[k], loads.effort_share[k]):>10}"
            f"{loads.peak_rate[k]:11.4g} {unit + '/s':<5}{_share(loads.rate_limits[k], loads.rate_share[k]):>10}"
            f"{loads.peak_power[k]:12.4g}{loads.work[k]:13.5g}"
        )
    beyond = [
        name
        for name, effort, rate in zip(loads.joint_names, loads.effort_share, loads.rate_share, strict=True)
        if max(effort, rate) > 1.0
    ]
    return [
        *lines,
        "",
        f"work of all joints {loads.work.sum():.6g} J, change of the kinetic energy {loads.energy_change:.6g} J",
        f"beyond a limit of the body's file: {', '.join(beyond) if beyond else 'none'}",
    ]


def torque_data(found: JointTorques, flown: Motion, body: Body, motion_name: str) -> dict[str, Any]:
    """The same for programs."""
    return {
        "body": body.name,
        "motion": motion_name,
        "duration_s": flown.duration,
        "momentum_kg_m2_s": flown.momentum.tolist(),
        **found.loads.to_dict(),
        "largest_base_wrench": float(np.abs(found.base_wrench).max(initial=0.0)),
        "error_estimate_rad": float(flown.error_estimate),
    }


def _share(limit: float, share: float) -> str:
    """How much of a limit is used."""
    if not np.isfinite(limit):
        return "none"
    return f"{100.0 * share:.1f} %" if share >= _LEAST_SHARE or share == 0.0 else "<0.1 %"
