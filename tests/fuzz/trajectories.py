"""Grammar of trajectories of floating bodies, which an audit reads: vectors of three programs in NPZ and CSV."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from .array_motions import archive, npy_bytes
from .pieces import BODY, JOINTS, ODD_NAMES, Trial, entry, odd_one, rarely, sometimes_damaged

_SAMPLES = 32
"""More than an audit needs in the air."""
_GRAVITY = (0.0, 0.0, -9.81)
_ODD_SCALES = (0.0, -1.0, 57.3, 1e-3, 1e3, 1e9, 1e154, 1e300, 1e-160, 1e-320, np.nan, np.inf)
RATES = {"qpos": "qvel", "q": "v", "Q": "Qdot"}
"""Places -> their rates."""
_SPELLED = ("{}_{}", "{}[{}]", "{}{}", "{} {}")
_READING: tuple[dict[str, Any], ...] = (
    *({"step": 0.001}, {"step": 1e-300}, {"step": 1e300}, {"step": -1.0}, {"step": float("nan")}, {"timestep": 0.02}),
    *({"timestep": 1e-320}, {"timestep": 0.0}, {"degrees": True}, {"rest_missing": True, "ignore_extra": True}),
    *({"names": {"hip": "wrist"}}, {"base_order": "xyz"}, {"base_axes": "x,-z,y"}, {"topic": "a"}),
)
_AUDITING: tuple[dict[str, Any], ...] = (
    *({"flight": "all"}, {"flight": "none"}, {"flight": [0.0, 0.3]}, {"flight": [0.3, 0.0]}, {"flight": [0.1, 0.1001]}),
    *(
        {"flight": [-1e300, 1e300]},
        {"flight": [0.1]},
        {"tolerance": 1e-13},
        {"tolerance": 1e300},
        {"tolerance": 1e-320},
    ),
    *({"tolerance": 0.0}, {"tolerance": -1.0}, {"tolerance": float("nan")}),
)
OF_AUDIT = ("flight", "tolerance")
"""Options of `audit`; the others are those of `read_trajectory`."""


@cache
def flown() -> Mapping[str, np.ndarray]:
    """A flight of the body of `pieces`, without a fault, in the vectors of MuJoCo, Pinocchio and biorbd."""
    from scipy.spatial.transform import Rotation

    import shapephase as sp

    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "body.urdf").write_text(BODY)
        body = sp.load_body(Path(folder) / "body.urdf")
    times = np.linspace(0.0, 0.6, _SAMPLES)
    bends = 0.3 * np.column_stack([np.sin(4.0 * times), np.cos(3.0 * times) - 1.0, 0.5 * np.sin(6.0 * times)])
    path = sp.ShapePath.spline(times, bends, periodic=False, joint_names=JOINTS)
    motion = sp.reconstruct(sp.articulated(body, path), [0.1, 0.5, 0.4])
    found = sp.exports.mujoco_arrays(motion, times, velocity=[0.1, 0.2, 3.0], gravity=_GRAVITY)
    turns = Rotation.from_quat(found.qpos[:, [4, 5, 6, 3]].copy())
    own = turns.inv().apply(found.qvel[:, :3].copy())
    angles = np.column_stack([found.qpos[:, :3], turns.as_euler("XYZ"), found.qpos[:, 7:]])
    return {
        "time": times,
        "qpos": found.qpos,
        "qvel": found.qvel,
        "q": np.column_stack([found.qpos[:, :3], turns.as_quat(), found.qpos[:, 7:]]),
        "v": np.column_stack([own, found.qvel[:, 3:]]),
        "Q": angles,
        "Qdot": np.gradient(angles, times, axis=0),
        "joint_names": np.array(found.joint_names),
    }


def arrays(chance: Random) -> dict[str, Any]:
    """Of one of the programs, now and then with a fault of the physics."""
    whole = flown()
    kind = chance.choice(tuple(RATES))
    rows = odd_one(chance, slice(None), (slice(None, None, -1), slice(11), slice(2, None), slice(1), slice(0)), 20)
    found: dict[str, Any] = {name: whole[name][rows].copy() for name in ("time", kind, RATES[kind])}
    for _ in range(odd_one(chance, 0, (1, 2), 2)):
        name = odd_one(chance, chance.choice([name for name in found if name != "time"]), ("time",), 10)
        values = found[name]
        if not values.size:
            break
        column = chance.randrange(values.shape[-1]) if values.ndim > 1 else 0
        part = values[:, column] if values.ndim > 1 else values
        match chance.randrange(6):
            case 0:
                with np.errstate(all="ignore"):
                    part *= odd_one(chance, 1.0 + 0.3 * chance.random(), _ODD_SCALES, 3)
            case 1:
                part += chance.choice((0.1, 1.0, 1e6, 1e15))
            case 2:
                part[chance.randrange(len(part))] = chance.choice((0.0, np.nan, np.inf, 1e300, -1e300, 5.0))
            case 3:
                part[:] = part[0]
            case 4:
                part += 0.01 * np.array([chance.random() for _ in part])
            case _:
                values[:] = np.roll(values, 1, axis=-1)
    if rarely(chance, 4):
        del found[RATES[kind]]
    if rarely(chance, 12):
        for name in {*found} - {"time"}:
            found[name][:] = found[name][:1]
    return found


def _archived(chance: Random, found: dict[str, Any]) -> bytes:
    if rarely(chance, 4):
        odd = (["hip"], ["hip"] * 3, [*JOINTS, "more"], ["a", "b", "c"], [1, 2, 3], list(ODD_NAMES[:3]), [], "hip")
        found["joint_names"] = np.array(odd_one(chance, list(flown()["joint_names"]), odd, 2))
    if rarely(chance, 5):
        odd_steps = (0.0, -1.0, np.nan, 1e-320, 1e300, [0.1, 0.2], "a", "0.1", 1j, [], True)
        found["timestep"] = np.array(odd_one(chance, 0.04, odd_steps, 2))
        if chance.randrange(2):
            found.pop("time")
    if rarely(chance, 8):
        name = chance.choice(sorted(found))
        values = np.atleast_1d(found[name])
        odd_ones = (values.T, values[..., None], values[:-1], values.astype("U8"), values.astype(str).astype("S8"))
        found[name] = chance.choice(odd_ones)
    if rarely(chance, 12):
        found[chance.choice(("q", "Q", "qpos", "time", "shapes"))] = chance.choice((np.zeros(3), np.zeros((32, 9))))
    return archive(chance, {f"{name}.npy": npy_bytes(chance, array, 60) for name, array in found.items()})


def _table(chance: Random, found: Mapping[str, Any]) -> bytes:
    spelled = chance.choice(_SPELLED)
    labels, columns = [], []
    for name, values in found.items():
        if values.ndim == 1:
            labels.append(odd_one(chance, name, ("t", "time [s]", "time [ms]", "Time", ""), 8))
            columns.append(values)
            continue
        for k, column in enumerate(values.T):
            number = odd_one(chance, str(k), ("0", "007", "99", "-1", "٣", "9" * 5000, "1" * 19), 200)
            labels.append(odd_one(chance, spelled, _SPELLED, 60).format(name, number))
            columns.append(column)
    if rarely(chance, 8):
        place = chance.randrange(len(labels))
        extra = chance.choice((labels[place], "more", "hip", "t", "qpos_0", "qvel00", *ODD_NAMES))
        labels, columns = [*labels, extra], [*columns, columns[place]]
    order = chance.sample(range(len(labels)), len(labels)) if rarely(chance, 5) else range(len(labels))
    rows = [[labels[k].replace(",", ";") for k in order]]
    count = len(columns[0])
    rows += [[entry(chance, float(columns[k][row]), 3000) for k in order] for row in range(count)]
    text = "\n".join(",".join(row) for row in rows) + "\n"
    return sometimes_damaged(chance, text.encode(errors="replace"), 20)


def file_of(chance: Random) -> tuple[str, bytes]:
    """The name of a file of a trajectory, and what is in it."""
    found = arrays(chance)
    if chance.randrange(2):
        return "run.npz", _archived(chance, found)
    return odd_one(chance, "run.csv", ("run.txt",), 8), _table(chance, found)


def trajectory(chance: Random) -> Trial:
    """A file that is read, and audited if it can be."""
    name, data = file_of(chance)
    given = dict(odd_one(chance, {}, _READING, 6)) | dict(odd_one(chance, {}, _AUDITING, 5))
    return Trial(kind="trajectory", source=f"audited {name[4:].upper()}", files={name: data}, main=name, options=given)
