"""What is wrong with a trajectory or an audit that was accepted: the files read once more, and no NaN in findings."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .pieces import JOINTS
from .plain_readers import NotPlain, delimited

_SAME = 1e-12
"""Of numbers that are copied."""
_FEWEST = 12
_LABEL = re.compile(r"(qpos|qvel|q|v|Q|Qdot)[_\[ ]?([0-9]{1,6})\]?")
_SHAPES_FROM = {"qpos": 7, "q": 7, "Q": 6}
_NOT_FINITE = re.compile(r"\b(nan|inf)\b")


def trajectory_faults(file: Path, body: Any, run: Any) -> Iterator[str]:
    """Times ascend, all is finite, quaternions are of length one; times and joints are those of the file."""
    times = run.times
    if len(times) < _FEWEST or not np.isfinite(times).all() or np.any(np.diff(times) <= 0.0):
        yield f"times {times}"
        return
    for name in ("quaternion", "shapes", "position", "rate", "velocity", "joint_rates"):
        values = getattr(run, name)
        if values is not None and (len(values) != len(times) or not np.isfinite(values).all()):
            yield f"{name} {values}"
            return
    if not np.allclose(np.linalg.norm(run.quaternion, axis=1), 1.0, rtol=0.0, atol=1e-12):
        yield "a quaternion whose length is not one"
    try:
        found = _plain(file)
    except NotPlain as fault:
        yield f"a plain reader does not take it: {fault}"
        return
    kind = next((name for name in _SHAPES_FROM if name in found), None)
    if kind is None:
        return
    places = found[kind]
    # MuJoCo compiles the file of `pieces` in its own order.
    nameless = JOINTS if kind == "qpos" else body.joint_names
    names = [str(name) for name in np.ravel(found.get("joint_names", nameless))]
    if len(set(names)) != len(names):
        yield f"joint names {names}"
        return
    if kind == "Q" and places.shape[0] == _SHAPES_FROM["Q"] + body.n_shape != places.shape[1]:
        places = places.T
    columns = [
        _SHAPES_FROM[kind] + (names if kind != "Q" else list(body.joint_names)).index(n) for n in body.joint_names
    ]
    if not np.allclose(run.shapes, places[:, columns], rtol=_SAME, atol=0.0):
        yield f"joints {run.shapes} where the file says {places[:, columns]}"
    if "time" in found and not np.allclose(times, found["time"], rtol=_SAME, atol=0.0):
        yield f"times {times} where the file says {found['time']}"


def _plain(file: Path) -> Mapping[str, Any]:
    data = file.read_bytes()
    if file.suffix == ".npz":
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            return dict(arrays)
    numbered: dict[str, dict[int, list[float]]] = {}
    columns = delimited(data)
    for label, values in columns.items():
        match = _LABEL.fullmatch(label)
        if match:
            if int(match[2]) in numbered.setdefault(match[1], {}):
                raise NotPlain(f"{label} stands twice")
            numbered[match[1]][int(match[2])] = values
    found: dict[str, Any] = {
        name: np.array([those[k] for k in sorted(those)], dtype=float).T for name, those in numbered.items()
    }
    clocks = [label for label in columns if label in ("t", "time", "time [s]")]
    if found and len(clocks) > 1:
        raise NotPlain(f"times {clocks}")
    return found | ({"time": np.array(columns[clocks[0]])} if clocks else {})


def audit_faults(found: Any) -> Iterator[str]:
    """Every number is one, nothing explains what is right, and what explains the rest is among what was tried."""
    try:
        json.dumps(found.record, allow_nan=False)
    except (TypeError, ValueError) as fault:
        yield f"{fault}: {found.record}"
    if _NOT_FINITE.search(found.table()):
        yield found.table()
    if found.right and (found.hypotheses or found.cause):
        yield f"right, and {found.cause} explains it"
    if not {one.name for one in found.cause} <= {one.name for one in found.hypotheses}:
        yield f"{found.cause} of {found.hypotheses}"
    for run in found.runs:
        if min(run.momentum_scale, run.momentum_drift, run.momentum_noise, run.extent) < 0.0:
            yield f"{run.record}"
