"""Words and tables of a report: story, split, joints, masses, inputs and provenance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ... import so3
from ...arrays import Array
from ...body.body import Body
from ...deformation.descriptions import RigidDescription
from ...display import number_with_bar
from ...dynamics.loads import JointLoads
from ...dynamics.moving_body import body_and_path
from ...dynamics.torque_noise import LoadErrors, load_errors
from ...dynamics.torques import joint_torques
from ...errors import WrongObjectError
from ...phases.phases import PhaseSplit
from ...phases.split_text import CLOSED_GAP, DEGREE_DIGITS, RADIAN_DIGITS, digits_left
from ...phases.whole_turns import turn_counts
from ...provenance import provenance
from ...reconstruction.reconstruction import Motion
from ...shape_space.body_path import in_joint_order
from ...shape_space.path_noise import path_errors, stated_noise
from ...shape_space.shape_path import ShapePath
from ...shape_space.summaries import body_summary, path_summary

CONVENTIONS = (
    ("attitude R", "", "takes base axes to inertial axes; R' = R hat(omega), omega in base axes"),
    ("quaternion", "", "x y z w, w not negative"),
    ("momentum", "", "about the centre of mass, inertial axes, constant"),
    ("phase", "", "angle about the momentum, right-hand rule; solid angles are signed, seen from outside"),
    (
        "split",
        "",
        "total rotation = exp(Montgomery phase about the momentum) closing tilt holonomy, in the horizontal gauge",
    ),
)
_NO_TURN = 1e-12  # [rad] a smaller turn has no axis worth showing
_NO_LIMIT = 1e6  # [rad or m] some models write the largest number there is for no limit
_NO_WORK = 1e-9  # of the joints' absolute works: a smaller sum is rounding or quadrature error

Row = tuple[str, str, str]


def lead(motion: Motion) -> str:
    """One line below the title."""
    momentum = " ".join(f"{value:g}" for value in motion.momentum)
    return f"{motion.duration:g} s, angular momentum ({momentum}) kg m²/s"


def is_rigid(motion: Motion) -> bool:
    """True where the body keeps its shape."""
    description = motion.deformation.description
    path = getattr(description, "path", None)
    rests = path is not None and not np.ptp(path.shape(path.sample_times), axis=0).any()
    return rests or isinstance(description, RigidDescription)


def story(motion: Motion, result: PhaseSplit, body: Body | None) -> list[str]:
    """Sentences about the motion and its split."""
    name = f"The body ({body.name}, {body.n_joints} joints, {body.mass:.4g} kg)" if body else "The body"
    loop = "and ends in the shape it began with" if result.is_loop else "and ends in another shape than it began with"
    words = [f"{name} changes its shape for {motion.duration:g} s {loop}."]
    if is_rigid(motion):
        words = [f"The body is rigid and turns for {motion.duration:g} s."]
    if not result.has_phase and not result.has_wheels:
        turned = _turn(result.total_rotation)
        words.append(f"There is no angular momentum: the shape alone turned it by {turned}, but for whole turns.")
        return words
    size = float(np.linalg.norm(motion.momentum))
    momentum = f"the angular momentum of {size:.4g} kg m²/s"
    if result.has_wheels:
        momentum = f"{momentum} with that stored in wheels" if result.has_phase else "the momentum stored in wheels"
    alone = (
        f"The shape alone turned it by {_turn(result.holonomy)}; {momentum} added "
        f"{_turn(result.dynamical_rotation)}. Both together turned it by {_turn(result.total_rotation)}, but for whole "
        "turns."
    )
    if not result.has_phase:
        return [*words, "There is no total angular momentum.", alone]
    if is_rigid(motion):
        turned = _turn(result.total_rotation)
        alone = f"The angular momentum of {size:.4g} kg m²/s turned it by {turned}, but for whole turns."
    words.append(alone)
    words += [said for said in (str(turn_counts(motion, result)),) if said]
    phase, dynamic, geometric = (
        f"{np.degrees(float(value)):z.2f}°"
        for value in (result.montgomery_phase, result.dynamic_phase, result.geometric_phase)
    )
    words.append(
        f"Seen in the {result.gauge} gauge the body turned about its momentum by a Montgomery phase of {phase}: "
        f"{dynamic} from how fast it turned (the dynamic phase), {geometric} from the solid angle that the momentum's "
        "direction went round (the geometric phase)."
    )
    gap = float(result.momentum_gap)
    if gap > CLOSED_GAP:
        closing = f"{np.degrees(float(result.closing_phase)):z.2f}°"
        words.append(
            f"There the momentum's direction ended {np.degrees(gap):.2f}° from where it began. The great circle back "
            f"to the start closes its curve, and adds {closing} of the geometric phase; beside the phase it turns the "
            f"body by {_turn(result.closing_tilt)} across the momentum, the tilt of the closing."
        )
    return words


def torque_words(motion: Motion, noise: Array | None = None) -> str:
    """Sentences about the largest torque and the work, with bars for a recording. Raises like `joint_torques`.

    noise : of the samples of a recording (n,), where it is known
    """
    loads = joint_torques(motion, 0.0).loads
    bars, doubt = _load_bars(motion, loads, noise)
    parts = []
    for unit, effort, kind in (("rad", "N m", "torque"), ("m", "N", "force")):
        rows = [k for k, own in enumerate(loads.joint_units) if own == unit]
        if rows:
            most = max(rows, key=lambda k: loads.peak_torque[k])
            off = None if bars is None else float(bars.peak_torque[most])
            share = 100.0 / float(loads.effort_limits[most]) if np.isfinite(loads.effort_limits[most]) else 0.0
            limit = ""
            if share:
                part = _bar_text(share * loads.peak_torque[most], None if off is None else share * off, ".1f")
                limit = f", {part}% of its limit" if off is None else f", {part} % of its limit"
            parts.append(
                f"the largest {kind} is that of {loads.joint_names[most]}, "
                f"{_bar_text(loads.peak_torque[most], off, '.3g')} {effort} at {loads.peak_time[most]:.3g} s{limit}"
            )
    words = f"Joints: {'; '.join(parts)}. " if parts else ""
    whole = float(loads.work.sum())
    if abs(whole) <= _NO_WORK * float(np.abs(loads.work).sum()):
        rest = "The net work of all joints is zero: the kinetic energy ends as it began."
    else:
        work = _bar_text(whole, None if bars is None else bars.total_work, ".3g")
        rest = f"Net work of all joints: {work} J, the change of the kinetic energy."
    return f"{words}{rest}{doubt}"


def _load_bars(motion: Motion, loads: JointLoads, noise: Array | None) -> tuple[LoadErrors | None, str]:
    """Bars of the loads of a recording, and a sentence where they are unknown."""
    found = body_and_path(motion)
    assert found is not None
    if noise is None and found[1].record is None:
        return None, ""
    if noise is None and stated_noise(found[1]) is None:
        return None, (
            " Their errors are unknown: give the noise of the recording (--smooth 0.3deg); most of a torque may be "
            "noise."
        )
    try:
        return load_errors(motion, loads, noise), ""
    except WrongObjectError as error:
        return None, f" Their errors are unknown: {error}."


def _bar_text(value: float, bar: float | None, usual: str) -> str:
    return format(float(value), usual) if bar is None else number_with_bar(float(value), float(bar))


def accuracy(motion: Motion, error_bars: Sequence[str]) -> str:
    """Sentences about the errors of the numbers."""
    words = (
        f"The numerical error of the attitude is at most {float(motion.error_estimate):.1e} rad at all times: an "
        "estimate, not a bound."
    )
    if error_bars:
        words += " The errors due to the inputs are far larger, and stand under error bars."
    return words


def split_rows(result: PhaseSplit) -> list[Row]:
    """Rows of the split."""
    errors = result.error_estimates
    rows = [
        _rotation("Total rotation", result.total_rotation, errors.total_rotation),
        _rotation("Shape holonomy" if result.is_loop else "Shape lift (open path)", result.holonomy, errors.holonomy),
        _rotation("Dynamical rotation", result.dynamical_rotation, errors.dynamical_rotation),
    ]
    if result.has_wheels:
        rows.append(_rotation("Stored wheel momentum", result.wheel_rotation, errors.wheel_rotation))
    if not result.has_phase:
        words = "none: there is no angular momentum, the body turns by its shape alone"
        if result.has_wheels:
            words = "none: there is no total angular momentum, the body turns by its shape and what its wheels store"
        return [*rows, ("Montgomery phase", "", words)]
    area = f"{float(result.solid_angle):z.{digits_left(float(errors.geometric_phase), RADIAN_DIGITS)}f}"
    closing = []
    if float(result.momentum_gap) > CLOSED_GAP:
        remark = "of the geometric phase, by the great circle that closes the momentum's curve"
        closing.append(_phase("Closing arc", result.closing_phase, errors.closing_phase, remark))
    return [
        *rows,
        _phase("Montgomery phase", result.montgomery_phase, errors.montgomery_phase, f"{result.gauge} gauge"),
        _phase("Dynamic phase", result.dynamic_phase, errors.dynamic_phase, ""),
        _phase("Geometric phase", result.geometric_phase, errors.geometric_phase, f"solid angle {area} sr"),
        *closing,
        _rotation("Tilt of the closing", result.closing_tilt, errors.closing_tilt),
        _phase("Momentum gap", result.momentum_gap, errors.momentum_gap, "between its directions at start and end"),
    ]


def joint_rows(body: Body, path: ShapePath, noise: Array | None = None) -> list[tuple[str, ...]]:
    """Rows of the joints: name, range, limits and largest rate, with its bar for a recording; `noise` as for
    `torque_words`."""
    found = path_summary(body, path)
    bars = _rate_bars(body, path, found.fastest_at, noise)
    rows = []
    columns = zip(
        body.joint_names, body.joint_units, found.lowest, found.highest, body.joint_limits, found.fastest, strict=True
    )
    for k, (name, unit, low, high, (least, most), rate) in enumerate(columns):
        limits = f"{_amount(least, unit)} … {_amount(most, unit)}"
        fastest = f"{_amount(rate, unit)}/s"
        if bars is not None and unit == "rad":
            fastest = f"({number_with_bar(float(np.degrees(rate)), float(np.degrees(bars[k])))})°/s"
        elif bars is not None:
            fastest = f"{number_with_bar(float(rate), float(bars[k]))} {unit}/s".replace(" 1/s", " /s")
        elif path.record is not None:
            fastest += " ± unknown"
        rows.append((name, _amount(low, unit), _amount(high, unit), limits, fastest))
    return rows


def _rate_bars(body: Body, path: ShapePath, times: Array, noise: Array | None) -> Array | None:
    """Bars of each joint's rate at its own time (n,); None where they are unknown."""
    route = in_joint_order(body, path)
    if noise is None and stated_noise(route) is None:
        return None
    try:
        return np.diag(path_errors(route, times, noise).rate)
    except WrongObjectError:
        return None


def part_rows(body: Body) -> list[tuple[str, ...]]:
    """Rows of the rigid parts with mass: first link, mass, centre of mass and principal moments."""
    return [
        (
            part.links[0] if len(part.links) == 1 else f"{part.links[0]} +{len(part.links) - 1}",
            f"{part.mass:.6g}",
            " ".join(f"{value:.4f}" for value in part.centre_of_mass + 0.0),
            " ".join(f"{value:.4g}" for value in part.principal_moments),
        )
        for part in body_summary(body).parts
        if part.mass > 0.0
    ]


def input_rows(motion: Motion, gauge: str, body: Body | None) -> list[Row]:
    """Rows of accuracy, inputs and method."""
    quaternion = ", ".join(f"{x:z.9f}" for x in motion.quat_xyzw(motion.duration))
    rows = [
        ("Final attitude", "", f"quaternion x y z w ({quaternion})"),
        ("Error estimate", f"{float(motion.error_estimate):.2e} rad", f"tolerance {motion.tolerance:g} rad"),
        ("Evaluations", str(motion.evaluations), f"of the body, method {motion.method}"),
        ("Gauge", "", gauge),
        ("Deformation", "", motion.deformation.label),
    ]
    if body is not None and body.file is not None:
        rows.append(("File, body", "", body.file.name))
    rows += [(f"SHA-256, {name}", "", digest) for name, digest in motion.deformation.inputs.items()]
    return [*rows, *_origin_rows(motion.deformation.made_from)]


def _origin_rows(made_from: Mapping[str, Any]) -> list[Row]:
    """Rows of joints, recording and provenance."""
    found = provenance()
    record = dict(made_from.get("recording", {}))
    rows = [("Joints", "", ", ".join(made_from.get("joints", ())))] if made_from.get("joints") else []
    rows += [("File, joints", "", str(record.pop("file")))] if "file" in record else []
    for name, value in record.items():
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


def _turn(rotation: Array) -> str:
    """Angle and axis of a rotation for a sentence."""
    vector = so3.log(rotation)
    angle = float(np.linalg.norm(vector))
    if np.degrees(angle) < 0.005:
        return "nothing (below 0.01°)"
    return f"{np.degrees(angle):.2f}° about ({', '.join(f'{x:.2f}' for x in np.round(vector / angle, 2) + 0.0)})"


def _rotation(name: str, rotation: Array, error: Array) -> Row:
    vector = so3.log(rotation)
    angle = float(np.linalg.norm(vector))
    axis = ""
    if angle >= _NO_TURN:
        axis = "about (" + ", ".join(f"{x:.6f}" for x in np.round(vector / angle, 6) + 0.0) + ")"
    degrees, radians = _with_error(angle, error)
    return name, degrees, f"{radians} {axis}".strip()


def _phase(name: str, phase: Array, error: Array, remark: str) -> Row:
    degrees, radians = _with_error(float(phase), error)
    return name, degrees, f"{radians}; {remark}" if remark else radians


def _with_error(angle: float, error: Array) -> tuple[str, str]:
    """An angle in degrees, and in radians with its error; with the digits that the error leaves."""
    off = float(error)
    in_degrees = digits_left(float(np.degrees(off)), DEGREE_DIGITS)
    in_radians = digits_left(off, RADIAN_DIGITS)
    return f"{np.degrees(angle):z.{in_degrees}f}°", f"{angle:z.{in_radians}f} ± {off:.1e} rad"


def _amount(value: float, unit: str) -> str:
    if abs(value) > _NO_LIMIT:
        return "none"
    return f"{np.degrees(value):z.1f}°" if unit == "rad" else f"{value:z.4g} {unit}".removesuffix(" 1")
