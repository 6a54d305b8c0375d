"""A hundred turns on thirteen bodies, from rest to rest within rate limits: `python -m benchmarks.plans [BODY ...]`.

Axes and angles are drawn by a seed and kept whatever comes of them. Each turn gets one and a half times the shortest
duration that was found for it: that of a plan without limits, stretched until it keeps to them, and shortened by the
cost "time". What is measured is the plan of least kinetic energy in that duration, its first guess included.

    --goals N  of each body at most
    --seed S   of the axes and angles
    --kept F   every turn is a line of this file; turns that it has are not made again
    --first N  of all goals, these alone
    --mujoco   where each plan leaves the body by MuJoCo, too
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import argparse
import json
import multiprocessing
import resource
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any, cast

import numpy as np

import shapephase as sp
from shapephase import so3
from shapephase.errors import PlanNotFound, ShapePhaseError
from shapephase.optimal_control import Limits, Plan, plan_reorientation

from .cases import Case
from .simulators import mujoco_attitude

GOALS = 100
SEED = 20261123
LEAST, MOST = np.radians([20.0, 180.0])
TIMES = 4001
"""Of a plan, at which positions and rates are compared with their limits."""
REACHED = 1e-8
"""[rad] true miss."""
UNSTATED = 3.0
"""[rad/s or m/s] rate of joints of which a file states none."""
AIMS = ((12, 5.0), (36, 20.0), (52, 120.0))
"""Joints, and the processor time [s] aimed at."""

# ---- Bodies written here ---------------------------------------------------------------------------------------------


def _link(name: str, mass: float, moments: tuple[float, float, float], centre: str = "0 0 0") -> str:
    x, y, z = moments
    return (
        f'<link name="{name}"><inertial><origin xyz="{centre}"/><mass value="{mass}"/>'
        f'<inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def _hinge(name: str, parent: str, child: str, axis: str, place: str, reach: float = 2.5) -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="{place}"/>'
        f'<axis xyz="{axis}"/><limit lower="{-reach}" upper="{reach}" velocity="3" effort="10"/></joint>'
    )


def _robot(name: str, *parts: str) -> str:
    return f'<robot name="{name}">{"".join(parts)}</robot>'


def planar_chain() -> str:
    """Three equal rods in a plane, joined by two hinges."""
    rods = [_link(f"rod_{k}", 1.0, (0.01, 0.1, 0.1), "0.5 0 0") for k in range(3)]
    return _robot(
        "planar3", *rods, *(_hinge(f"hinge_{k}", f"rod_{k}", f"rod_{k + 1}", "0 0 1", "1 0 0") for k in (0, 1))
    )


def hinged_pair() -> str:
    """Two bodies joined by three hinges in one point."""
    links = [_link("front", 2.0, (0.02, 0.05, 0.06), "0.2 0 0"), _link("rear", 1.5, (0.02, 0.04, 0.03), "-0.2 0 0")]
    between = [_link(f"between_{k}", 1e-3, (1e-6, 1e-6, 1e-6)) for k in range(2)]
    hinges = zip(
        ("front", "between_0", "between_1"), ("between_0", "between_1", "rear"), np.eye(3, dtype=int), strict=True
    )
    joints = [_hinge(f"hinge_{k}", a, b, " ".join(map(str, axis)), "0 0 0") for k, (a, b, axis) in enumerate(hinges)]
    return _robot("hinged_pair", *links, *between, *joints)


def two_armed_satellite() -> str:
    """A bus with two arms of three joints."""
    parts = [_link("bus", 60.0, (6.0, 8.0, 7.0))]
    for side, sign in (("left", 1), ("right", -1)):
        above = "bus"
        for k, axis in enumerate(("1 0 0", "0 1 0", "0 0 1")):
            place = f"0 {0.5 * sign} 0.2" if k == 0 else f"0 {0.45 * sign} 0"
            parts.append(_link(f"{side}_{k}", 6.0, (0.2, 0.03, 0.2), f"0 {0.22 * sign} 0"))
            parts.append(_hinge(f"{side}_hinge_{k}", above, f"{side}_{k}", axis, place))
            above = f"{side}_{k}"
    return _robot("two_armed_satellite", *parts)


def winged_satellite() -> str:
    """A bus with two wings that turn about one axis, and an arm of three joints."""
    wings = [_link(f"{side}_wing", 8.0, (3.0, 0.3, 3.2), f"0 {1.2 * sign} 0") for side, sign in (("l", 1), ("r", -1))]
    arm = [_link(f"arm_{k}", 7.0 - k, (0.03, 0.25, 0.25), "0.35 0 0") for k in range(3)]
    places = ("0.4 0 0.3", "0.7 0 0", "0.7 0 0")
    hinges = [
        _hinge(f"arm_hinge_{k}", f"arm_{k - 1}" if k else "bus", f"arm_{k}", axis, places[k])
        for k, axis in enumerate(("0 0 1", "0 1 0", "1 0 0"))
    ]
    drives = [
        _hinge(f"{side}_drive", "bus", f"{side}_wing", "0 1 0", f"0 {0.5 * sign} 0")
        for side, sign in (("l", 1), ("r", -1))
    ]
    return _robot("winged_satellite", _link("bus", 80.0, (9.0, 7.0, 11.0)), *wings, *arm, *drives, *hinges)


def long_tree() -> str:
    """A tree of 52 joints."""
    rng = np.random.default_rng(5)
    parts = [_link("link_0", 5.0, (0.1, 0.1, 0.1))]
    for k in range(52):
        parent = k if rng.random() < 0.7 else int(rng.integers(0, k + 1))
        axis = ("1 0 0", "0 1 0", "0 0 1")[k % 3]
        parts.append(_link(f"link_{k + 1}", 0.5, (0.001, 0.002, 0.002), "0.05 0.01 0"))
        parts.append(_hinge(f"joint_{k}", f"link_{parent}", f"link_{k + 1}", axis, "0.1 0 0.02", 1.5))
    return _robot("tree_52", *parts)


WRITTEN = {
    "planar3": planar_chain,
    "hinged_pair": hinged_pair,
    "two_armed_satellite": two_armed_satellite,
    "winged_satellite": winged_satellite,
    "tree_52": long_tree,
}
BODIES = (
    "planar3", "hinged_pair", "cat_two_halves", "satellite", "two_armed_satellite", "example:ur5_robot",
    "example:solo12", "example:anymal", "cat", "astronaut", "diver", "example:human", "tree_52",
)  # fmt: skip


def body_named(name: str) -> sp.Body:
    """A body that comes with the library, or one of those above."""
    if name not in WRITTEN:
        return sp.load_body(name)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.urdf"
        file.write_text(WRITTEN[name]())
        return sp.load_body(file)


def turns(seed: int) -> list[tuple[str, np.ndarray]]:
    """Bodies and rotation vectors of all goals; a planar body turns in its plane."""
    rng = np.random.default_rng(seed)
    drawn = []
    for number in range(GOALS):
        axis = so3.normalised(rng.normal(size=3))
        name = BODIES[number % len(BODIES)]
        drawn.append((name, rng.uniform(LEAST, MOST) * (np.array([0.0, 0.0, 1.0]) if name == "planar3" else axis)))
    return drawn


# ---- One turn --------------------------------------------------------------------------------------------------------


def judged(name: str, turn: np.ndarray, by_mujoco: bool = False) -> dict[str, Any]:
    """The plan of one turn, and what it comes to."""
    warnings.simplefilter("ignore")
    body, goal = body_named(name), so3.exp(turn)
    stated = body.rate_limits
    limits = Limits(rate_limits=np.where(np.isfinite(stated), stated, UNSTATED))
    row: dict[str, Any] = {"body": name, "joints": body.n_shape, "degrees": float(np.degrees(np.linalg.norm(turn)))}
    duration = _shortest(body, goal, limits)
    row["duration"] = 1.5 * duration
    begin = time.process_time()
    try:
        plan, row["said"] = plan_reorientation(body, goal, duration=1.5 * duration, limits=limits), ""
    except PlanNotFound as failure:
        plan, row["said"] = cast("Plan | None", failure.best), str(failure)
    row["seconds"] = time.process_time() - begin
    row["megabytes"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    if plan is None:
        return row | {"miss": np.pi, "cost": np.inf, "kkt": np.inf, "beyond": np.inf}
    motion = sp.reconstruct(sp.articulated(body, plan.path), [0.0, 0.0, 0.0], tolerance=1e-10)
    miss = so3.angle(goal.T @ motion.final_attitude) + float(motion.error_estimate)
    row |= {"miss": miss, "cost": plan.cost, "kkt": plan.kkt_residual, "beyond": beyond(body, plan.path, limits)}
    return row | {"mujoco": _miss_by_mujoco(body, plan.path, goal)} if by_mujoco else row


def _miss_by_mujoco(body: sp.Body, path: sp.ShapePath, goal: np.ndarray) -> float:
    """The angle from the goal at which MuJoCo's inertia and momentum leave the body, integrated by SciPy [rad]."""
    end, _ = mujoco_attitude(Case(body.name, body, path, np.zeros(3)), 1e-12, 1e-13)
    return float(so3.angle(goal.T @ so3.matrix_from_quat(end)))


def _shortest(body: sp.Body, goal: np.ndarray, limits: Limits) -> float:
    """The shortest duration found: rest-to-rest motions without momentum turn a body alike however fast they are."""
    rates = np.asarray(limits.rate_limits)
    try:
        slow = plan_reorientation(body, goal, limits=Limits(rate_limits=None)).path
    except PlanNotFound as failure:
        if failure.best is None:
            return 1.0
        slow = cast("Plan", failure.best).path
    stretched = float((np.abs(slow.rate(np.linspace(0.0, 1.0, TIMES))) / rates).max()) * 1.001
    try:
        return plan_reorientation(body, goal, duration=stretched, cost="time", limits=limits).path.duration
    except ShapePhaseError:
        return stretched


def beyond(body: sp.Body, path: sp.ShapePath, limits: Limits) -> float:
    """By how much positions and rates exceed their limits between the nodes, as a part of their range."""
    times = np.linspace(0.0, path.duration, TIMES)
    shapes, rates = path.shape(times), np.abs(path.rate(times)) / np.asarray(limits.rate_limits)
    lower, upper = body.joint_limits.T
    bounded = np.isfinite(upper - lower)
    over = np.maximum(lower - shapes, shapes - upper)[:, bounded] / (upper - lower)[bounded]
    return float(max(over.max(initial=0.0), rates.max() - 1.0, 0.0))


# ---- All turns -------------------------------------------------------------------------------------------------------


def main() -> None:
    """Print each turn, and what they come to by body."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bodies", nargs="*")
    parser.add_argument("--goals", type=int, default=GOALS)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--kept", type=Path)
    parser.add_argument("--first", type=int, default=GOALS)
    parser.add_argument("--mujoco", action="store_true")
    asked = parser.parse_args()
    rows = _kept(asked.kept)
    counts: dict[str, int] = {}
    print(
        f"{'body':22}{'joints':>7}{'degrees':>9}{'duration':>10}{'seconds':>9}{'miss':>10}{'KKT':>10}{'beyond':>9}{'cost':>12}"
    )
    for number, (name, turn) in enumerate(turns(asked.seed)[: asked.first]):
        counts[name] = counts.get(name, 0) + 1
        if counts[name] > asked.goals or (asked.bodies and name not in asked.bodies):
            continue
        if number not in rows:
            # A process for each, so that its memory and its first look at the body are its own.
            with multiprocessing.get_context("spawn").Pool(1) as alone:
                rows[number] = alone.apply(judged, (name, turn, asked.mujoco))
            if asked.kept is not None:
                with asked.kept.open("a") as file:
                    file.write(json.dumps(rows[number] | {"number": number, "seed": asked.seed}) + "\n")
        _print_row(rows[number])
    _print_summary([rows[number] for number in sorted(rows)])


def _kept(file: Path | None) -> dict[int, dict[str, Any]]:
    if file is None or not file.exists():
        return {}
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    return {row["number"]: row for row in rows}


def _print_row(row: dict[str, Any]) -> None:
    print(
        f"{row['body']:22}{row['joints']:7d}{row['degrees']:9.1f}{row['duration']:10.3g}{row['seconds']:9.1f}"
        f"{row['miss']:10.1e}{row['kkt']:10.1e}{row['beyond']:9.1e}{row['cost']:12.5g}  {row['said'][:80]}",
        flush=True,
    )


def _print_summary(rows: list[dict[str, Any]]) -> None:
    reached = [row for row in rows if row["miss"] < REACHED and row["beyond"] < 1e-6 and not row["said"]]
    print(f"\n{len(reached)} of {len(rows)} reach their goal within their limits")
    if seen := [row["mujoco"] for row in rows if "mujoco" in row]:
        print(f"{len(seen)} by MuJoCo: at most {max(seen):.1e} rad from the goal")
    for name in BODIES:
        of_body = [row for row in rows if row["body"] == name]
        if of_body:
            seconds = np.median([row["seconds"] for row in of_body])
            aim = next(aim for most, aim in AIMS if of_body[0]["joints"] <= most)
            there = sum(row in reached for row in of_body)
            memory = max(row["megabytes"] for row in of_body)
            print(f"{name:22}{there:3d} of {len(of_body):3d}, median {seconds:6.1f} s (aim {aim:.0f}), {memory:.0f} MB")


if __name__ == "__main__":
    main()
