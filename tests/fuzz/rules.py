"""The rules of the strict readers, written down once more: what is wrong with something that was accepted."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from .engine_rules import biomod_faults, yeadon_faults
from .pieces import JOINTS
from .plain_readers import NotPlain, plain_columns, strict_number

FARTHEST = 1e6
"""The largest coordinate of a joint [rad or m]."""
_UNITS = {"rad": 1.0, "deg": np.pi / 180.0, "mrad": 1e-3, "m": 1.0, "cm": 1e-2, "mm": 1e-3, "1": 1.0}
_IN_A_SECOND = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9, "min": 1.0 / 60.0}
_CHANGING = {"trim", "resample", "smooth", "close", "names"}
"""Options with which a path is not that of the file's own samples."""
_TRIANGLE = 1e-3
"""Part by which moments in files may break the triangle inequality by rounding."""
_SAME = 1e-9
"""Of two ways to one number, relative to the largest: sums of a few dozen products of rounded factors."""
_OFF_UNIT = 0.1
"""Of the length of a quaternion."""
_ROUNDING = 1e-11
"""Of a moment, relative to the largest of the whole body: ten times what the library allows for."""
_SWING = 1e-8
"""Of a spline from its samples [rad or m]: sums of terms of up to 4e6, in doubles."""


def motion_faults(file: Path, body: Any, recorded: Any, options: Mapping[str, Any]) -> Iterator[str]:
    """What is wrong with a motion that was accepted.

    Times ascend strictly from zero, coordinates are finite and within reach, attitudes are rotations; and joints and
    times are those that a plain reader finds, in the units that the record tells.
    """
    times, path, record = recorded.times, recorded.path, recorded.record
    if times[0] != 0.0 or not np.isfinite(times).all() or np.any(np.diff(times) <= 0.0) or len(times) < 2:
        yield f"times {times}"
        return
    shapes = path.shape(times)
    if shapes.shape != (len(times), body.n_shape) or not np.isfinite(shapes).all():
        yield f"shapes {shapes}"
        return
    if not np.isfinite(path.rate(times)).all():
        yield "rates that are not finite"
    if np.abs(shapes).max(initial=0.0) > FARTHEST * (1.0 + _SAME) and not {"smooth", "close", "resample"} & set(
        options
    ):
        yield f"a coordinate of {np.abs(shapes).max():g}"
    if recorded.base_attitude is not None:
        square = recorded.base_attitude @ recorded.base_attitude.swapaxes(1, 2)
        if not np.allclose(square, np.eye(3), atol=_SAME):
            yield "an attitude that is no rotation"
    if recorded.base_position is not None and not np.isfinite(recorded.base_position).all():
        yield "a position that is not finite"
    json.dumps(dict(record), allow_nan=False)
    try:
        columns = plain_columns(file, JOINTS if set(JOINTS) == set(body.joint_names) else body.joint_names)
    except NotPlain as fault:
        yield f"a plain reader does not take it: {fault}"
        return
    if columns is not None and not _CHANGING & set(options):
        yield from _column_faults(columns, body, recorded, shapes, options)


def _column_faults(
    columns: Mapping[str, Sequence[float]], body: Any, recorded: Any, shapes: Any, options: Mapping[str, Any]
) -> Iterator[str]:
    record, times = recorded.record, recorded.times
    read = record["columns"]
    usual = "deg" if options.get("degrees") else "rad"
    yield from _ball_faults(columns, body, read, shapes, usual)
    for joint, label in read.items():
        if joint.rpartition(".")[0] in body.ball_joints:
            continue
        if label not in columns:
            yield f"joint {joint} is read from {label!r}, which a plain reader does not find in {list(columns)}"
            continue
        expected = _UNITS[record["units"][joint]] * np.array(columns[label], dtype=float)
        found = shapes[:, body.joint_names.index(joint)]
        if expected.shape != found.shape or not np.allclose(expected, found, rtol=_SAME, atol=_SWING):
            yield f"joint {joint}: {found} where the file says {expected}"
        said = re.search(r"(?:[\[(]|_)(rad|deg|mrad|mm|cm|m)[\])]?$", label)
        if said and label not in body.joint_names and said[1] != record["units"][joint]:
            yield f"joint {joint} is read in {record['units'][joint]} from {label!r}"
    if set(read) | set(record["at_rest"]) != set(body.joint_names):
        yield f"joints {list(read)} and {list(record['at_rest'])}"
    used = {part for label in read.values() for part in (label, *label.split(", "))}
    others = [name for name in columns if name not in {*used, *record["left_out"]}]
    clock = [name for name in others if not re.match(r"(base_)?q[xyzw]$|base_[xyz]_m$|omega_[xyz]_rad_s$", name)]
    if "timestep" in options or clock == []:
        return
    if len(clock) != 1:
        yield f"columns {clock} are nowhere"
        return
    raw = np.array(columns[clock[0]], dtype=float)
    expected = (raw - raw[0]) / _IN_A_SECOND[record["time_unit"]]
    # A clock of nanoseconds is subtracted as whole numbers there, and as doubles here.
    slack = 4.0 * np.finfo(float).eps * np.abs(raw).max() / _IN_A_SECOND[record["time_unit"]] + 1e-9 * times[-1]
    if expected.shape != times.shape or not np.allclose(expected, times, rtol=0.0, atol=slack):
        yield f"times {times} where the file says {expected}"


def _ball_faults(
    columns: Mapping[str, Sequence[float]], body: Any, read: Mapping[str, str], shapes: Any, usual: str
) -> Iterator[str]:
    """The quaternions of ball joints are those of the columns, of either sign, or of angles in their order."""
    for ball in body.ball_joints:
        parts = [f"{ball}.{part}" for part in "xyzw"]
        found = shapes[:, [body.joint_names.index(part) for part in parts]]
        labels = [read[part] for part in parts if part in read]
        if not np.allclose(np.linalg.norm(found, axis=1), 1.0, rtol=0.0, atol=_OFF_UNIT):
            yield f"ball joint {ball}: {found}"
        if len(labels) < len(parts):
            continue
        if ", " in labels[0]:
            turns = labels[0].split(", ")
            angles = np.array([columns[label] for label in turns]).T
            scales = [_UNITS["deg" if "deg" in label else "mrad" if "mrad" in label else usual] for label in turns]
            order = "".join(label[label.index(f"{ball}.r") + len(ball) + 2] for label in turns).upper()
            expected = Rotation.from_euler(order, angles * scales).as_quat()
        else:
            expected = np.array([columns[label] for label in labels]).T
        if expected.shape != found.shape:
            yield f"ball joint {ball}: {found} where the file says {expected}"
            continue
        expected *= np.where(np.sum(expected * found, axis=1) < 0.0, -1.0, 1.0)[:, None]
        if not np.allclose(expected, found, rtol=_SAME, atol=_SWING):
            yield f"ball joint {ball}: {found} where the file says {expected}"


def body_faults(file: Path, body: Any, warned: Sequence[str], options: Mapping[str, Any]) -> Iterator[str]:
    """What is wrong with a body that was accepted.

    Its mass is positive and that of the file; so are its joints. Its locked inertia is positive definite and satisfies
    the triangle inequality. Every number read is written strictly. A link's mass is not negative, its moments are not
    negative, and moments that break the triangle inequality are warned of.
    """
    shape = body.shape()
    inertia = body.locked_inertia(shape)
    moments = np.linalg.eigvalsh(inertia) if np.isfinite(inertia).all() else np.full(3, np.nan)
    allowed = options.get("on_unphysical") == "warn"
    # Of a body whose mass is in one point, moments are what rounding leaves of those about the base's origin.
    floor = _ROUNDING * body.mass * float(np.sum(body.centre_of_mass(shape) ** 2))
    if not (body.mass > 0.0 and np.isfinite(body.mass)):
        yield f"mass {body.mass}"
    if not np.isfinite(body.internal_momentum(shape, np.ones(body.n_shape))).all() or not np.isfinite(moments).all():
        yield "numbers that are not finite"
    elif not warned and (
        moments[0] < -_SAME * moments[2] - floor or moments[2] > (1.0 + _TRIANGLE) * (moments[0] + moments[1]) + floor
    ):
        yield f"a body with moments {moments} and no warning"
    if not all(lower <= upper for lower, upper in body.joint_limits):
        yield f"limits {body.joint_limits}"
    if file.suffix in (".urdf", ".xacro"):
        yield from _urdf_faults(_expanded(file, options), body, warned, allowed)
    elif file.suffix == ".bioMod":
        yield from biomod_faults(file, body)
    elif file.suffix == ".txt":
        yield from yeadon_faults(file, body)
    else:
        yield from _mjcf_faults(file, body)


def _expanded(file: Path, options: Mapping[str, Any]) -> bytes | str:
    """The text of a URDF, of a xacro file that which xacrodoc makes of it."""
    data = file.read_bytes()
    if not re.search(rb"xacro:|[$][{(]", data):
        return data
    import xacrodoc

    folders = [Path(folder).absolute() for folder in options.get("packages", ())]
    found = {part.name: part for folder in folders for part in (folder, *folder.iterdir()) if part.is_dir()}
    xacrodoc.packages.look_in([str(folder) for folder in folders])
    xacrodoc.packages.update_package_cache(found)
    return xacrodoc.XacroDoc.from_file(str(file), resolve_packages=False).dom.toxml()


def _urdf_faults(text: bytes | str, body: Any, warned: Sequence[str], allowed: bool) -> Iterator[str]:
    root = ElementTree.fromstring(text)
    if root.tag != "robot":
        yield f"<{root.tag}>"
    moving, total, names = 0, 0.0, [link.get("name") for link in root.findall("link")]
    if len(set(names)) != len(names) or not all(names):
        yield "names of links that stand twice, or none"
    children = [child.get("link") for child in root.findall("joint/child")]
    parents = [parent.get("link") for parent in root.findall("joint/parent")]
    if (
        sorted([*children, *(set(names) - set(children))]) != sorted(names)
        or len(children) != len(names) - 1
        or not set(parents) <= set(names)
    ):
        yield "links that form no tree"
    mimics = 0
    for joint in root.findall("joint"):
        kind = joint.get("type")
        if kind not in ("revolute", "continuous", "prismatic", "spherical", "fixed"):
            yield f"a joint {kind!r}"
        moving += {"fixed": 0, "spherical": 4}.get(str(kind), 1)
        mimics += kind != "fixed" and joint.find("mimic") is not None
        axis = joint.find("axis")
        if kind not in ("fixed", "spherical") and axis is not None and not any(_numbers(axis.get("xyz", "1 0 0"))):
            yield "an axis of no length"
    if moving - mimics != body.n_shape:
        yield f"{moving} moving joints, {mimics} of which follow, and {body.n_shape} coordinates"
    # What rounding leaves beside the largest moment of the whole body is no fault.
    floor = _ROUNDING * max((_largest_moment(inertial) for inertial in root.findall("link/inertial")), default=0.0)
    for inertial in root.findall("link/inertial"):
        mass, tensor = inertial.find("mass"), inertial.find("inertia")
        if mass is None or tensor is None:
            yield "an inertial without mass or inertia"
            continue
        (value,) = _numbers(mass.get("value", ""))
        total += value
        xx, yy, zz, xy, xz, yz = (
            _numbers(tensor.get(key, ""))[0] for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if value < 0.0:
            yield f"a mass of {value}"
        if moments[0] < -1e-6 * max(moments[2], 0.0) - floor and not allowed:
            yield f"moments {moments}"
        if moments[2] > (1.0 + 2.0 * _TRIANGLE) * (moments[0] + moments[1]) + floor and not warned:
            yield f"moments {moments} and no warning"
    if not np.isclose(total, body.mass, rtol=1e-12):
        yield f"mass {body.mass}, and the file's links have {total}"


def _largest_moment(inertial: ElementTree.Element) -> float:
    """About the link's origin, or more."""
    found = [float(tensor.get(key, "0")) for tensor in inertial.findall("inertia") for key in ("ixx", "iyy", "izz")]
    away = [_numbers(origin.get("xyz", "0 0 0")) for origin in inertial.findall("origin")]
    masses = [float(mass.get("value", "0")) for mass in inertial.findall("mass")]
    return max(map(abs, found), default=0.0) + sum(m * (x * x + y * y + z * z) for m in masses for x, y, z in away)


def _numbers(text: str) -> list[float]:
    return [strict_number(word) for word in text.split()]


def _mjcf_faults(file: Path, body: Any) -> Iterator[str]:
    """MuJoCo's own reading, where it takes the file."""
    import mujoco

    try:
        model = mujoco.MjModel.from_xml_string(file.read_text(encoding="utf-8-sig"))
    except ValueError:
        return
    if not np.isclose(model.body_mass.sum(), body.mass, rtol=1e-9, atol=0.0):
        yield f"mass {body.mass}, and MuJoCo finds {model.body_mass.sum()}"
    # Of the kinds of joints 1 is a ball, which has a quaternion, 2 slides and 3 is a hinge.
    coordinates = int(np.isin(model.jnt_type, (2, 3)).sum() + 4 * (model.jnt_type == 1).sum())
    if coordinates != body.n_shape:
        yield f"{body.n_shape} coordinates, and MuJoCo finds {coordinates}"
        return
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    centre = model.body_mass @ data.xipos / model.body_mass.sum()
    inertia = np.zeros((3, 3))
    for mass, moments, turn, place in zip(
        model.body_mass, model.body_inertia, data.ximat.reshape(-1, 3, 3), data.xipos - centre, strict=True
    ):
        inertia += turn @ np.diag(moments) @ turn.T + mass * (place @ place * np.eye(3) - np.outer(place, place))
    turn = data.xmat[1].reshape(3, 3)
    found = body.locked_inertia(body.shape())
    expected = turn.T @ inertia @ turn
    if not np.allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max()):
        yield f"inertia {found.tolist()}, and MuJoCo finds {expected.tolist()}"


def name_faults(file: Path, names: Mapping[str, str | None]) -> Iterator[str]:
    """What is wrong with a mapping of names that was accepted."""
    text = file.read_bytes().decode("utf-8-sig")
    if file.suffix == ".json":
        if json.loads(text) != dict(names):
            yield f"{names}, and JSON says {json.loads(text)}"
        pairs = json.loads(text, object_pairs_hook=list)
        if len(pairs) != len(names):
            yield "a column that stands twice"
        return
    lines = [line.strip() for line in text.splitlines()]
    kept = [line for line in lines if line and not line.startswith("#")]
    found = {line[: line.rindex("=")].strip(): line[line.rindex("=") + 1 :].strip() or None for line in kept}
    if found != dict(names) or len(kept) != len(names):
        yield f"{names}, and the lines say {found}"


def record_faults(motion: Any) -> Iterator[str]:
    """What is wrong with a stored motion that was accepted.

    Its attitudes are rotations at every time, its momentum in the inertial frame is constant, its error estimate is no
    negative number.
    """
    duration = motion.deformation.duration
    if not 0.0 < duration < np.inf:
        yield f"duration {duration}"
        return
    attitudes = motion.attitude(np.linspace(0.0, duration, 7))
    if not np.isfinite(attitudes).all():
        yield "attitudes that are not finite"
    elif not np.allclose(attitudes @ attitudes.swapaxes(-1, -2), np.eye(3), atol=1e-6):
        yield "attitudes that are no rotations"
    if not np.all(np.asarray(motion.error_estimate) >= 0.0):
        yield f"an error estimate of {motion.error_estimate}"
    if not np.isfinite(motion.momentum).all() or motion.momentum.shape[-1:] != (3,):
        yield f"momentum {motion.momentum}"
