"""Calls of what `shapephase` offers, on objects that are there already: what each gives, as bytes.

Run as a script it prints a digest of each: `python -m support.public_calls`.
"""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
import json
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import shapephase as sp
from shapephase.examples.scenarios import MOTIONS, kane_scher

MOMENTUM = (0.01, 0.02, 0.03)
TIMES = np.array([0.1, 0.37, 0.8])
# What their parameters are called, and what is given for them.
GIVEN: dict[str, Any] = {
    "t": TIMES,
    "times": TIMES,
    "momentum": MOMENTUM,
    "angular_velocity": (0.1, -0.2, 0.3),
    "base_rate": np.array([0.1, -0.2, 0.3]),
    "link": "front",
    "factor": 0.5,
    "count": 2,
    "owner": "the body",
    "lateral": "y",
}
# Given although they have a default: links of the cat of two halves are not called left and right.
ASKED = {"lateral"}
DIVER = sp.load_body("diver")
SWING = sp.ShapePath.waypoints([0.0, 1.0], [[0.0, 0.5], [1.0, -0.4]])
# They make objects or figures, write files or need more than a few numbers, and are called by name below or elsewhere.
MAKERS = (
    "circle", "fourier", "spline", "waypoints", "function", "save", "write_csv", "with_couplings", "with_inertias",
    "with_wheel", "with_frame_inertias", "sampler", "samplers", "plot", "view", "to_dataframe", "to_xarray",
)  # fmt: skip


@dataclasses.dataclass(frozen=True, kw_only=True)
class Objects:
    """What the calls share."""

    body: sp.Body
    path: sp.ShapePath
    deformation: sp.Deformation
    motion: sp.Motion
    top: sp.EulerTop


def objects() -> Objects:
    body, path = sp.load_body("cat_two_halves"), kane_scher(0.3, 1.0)
    deformation = sp.articulated(body, path)
    top = sp.EulerTop(np.diag([1.0, 2.0, 3.0]), [0.1, 0.2, 0.3])
    return Objects(body=body, path=path, deformation=deformation, motion=sp.reconstruct(deformation, MOMENTUM), top=top)


def calls(on: Objects) -> dict[str, Callable[[], Any]]:
    """Every public method of the objects, and the functions that take them."""
    found: dict[str, Callable[[], Any]] = {}
    given = {**GIVEN, "shape": 0.3 * np.ones(on.body.n_shape), "rate": 0.2 * np.ones(on.body.n_shape)}
    given |= {"link": on.body.link_names[-1], "name": on.body.joint_names[0], "reference": given["shape"]}
    given |= {"names": on.body.joint_names[:1], "joint_names": on.path.joint_names, "other": on.path}
    for field in dataclasses.fields(on):
        thing = getattr(on, field.name)
        for name, _ in inspect.getmembers(type(thing), inspect.isfunction):
            if name.startswith("_") or name in MAKERS:
                continue
            words = dict(given)
            if (field.name, name) == ("body", "shape"):
                found["body.shape"] = on.body.shape
                continue
            if name in ("sample", "sample_rates"):
                words |= {"shape": np.full((2, on.body.n_shape), 0.3), "rate": np.full((2, on.body.n_shape), 0.2)}
            signature = inspect.signature(getattr(thing, name)).parameters.values()
            needed = {
                p.name: words[p.name]
                for p in signature
                if p.name in ASKED or (p.default is p.empty and p.kind is not p.VAR_KEYWORD)
            }
            found[f"{field.name}.{name}"] = lambda thing=thing, name=name, needed=needed: getattr(thing, name)(**needed)
    body, path, deformation, motion = on.body, on.path, on.deformation, on.motion
    shape = given["shape"]
    return found | {
        "articulated": lambda: sp.reconstruct(sp.articulated(body, path), MOMENTUM),
        "reconstruct": lambda: sp.reconstruct(deformation, MOMENTUM),
        "reconstruct many": lambda: sp.reconstruct(deformation, np.outer([1.0, 2.0, 3.0], MOMENTUM)),
        "dop853": lambda: sp.reconstruct(deformation, MOMENTUM, method="dop853"),
        "momentum_from_rate": lambda: sp.momentum_from_rate(deformation, (0.1, 0.2, 0.3)),
        "split": lambda: sp.split(motion),
        "split base": lambda: sp.split(motion, "base"),
        "running_phases": lambda: sp.running_phases(motion, TIMES),
        "arc_phases": lambda: sp.arc_phases(motion, [0.0, 0.4, 1.0]),
        "parallel_transport": lambda: sp.parallel_transport(motion, TIMES),
        "horizontal_lift": lambda: sp.horizontal_lift(body, path),
        "holonomy": lambda: sp.holonomy(body, path),
        "mechanical_connection": lambda: sp.mechanical_connection(body, shape),
        "curvature": lambda: sp.curvature(body, shape),
        "curvature_on_plane": lambda: sp.curvature_on_plane(body, body.joint_names[:2], TIMES, TIMES),
        "is_flat": lambda: sp.is_flat(body),
        "joint_torques": lambda: sp.joint_torques(motion, TIMES),
        "path_errors": lambda: sp.path_errors(sampled(path), TIMES, 0.01),
        "torque_errors": lambda: sp.torque_errors(torques_of_samples(body, path), 0.01),
        "turn_counts": lambda: sp.turn_counts(motion, sp.split(motion)),
        "mujoco_arrays": lambda: sp.exports.mujoco_arrays(motion, TIMES),
        "pinocchio_arrays": lambda: sp.exports.pinocchio_arrays(motion, TIMES),
        "free_hinges": lambda: sp.free_hinges(body, swung(body), {body.joint_names[0]: (0.3, 1.0)}, MOMENTUM),
        "torque": lambda: sp.reconstruct(deformation, MOMENTUM, torque=lambda s: 0.01 * s.rate).final_attitude,
        "minimum_perturbation": lambda: sp.minimum_perturbation(body, shape, 0.2, 2),
        "reachable": lambda: sp.reachable(body, shape),
        "generalised_jacobian": lambda: sp.generalised_jacobian(body, shape, given["link"]),
        "reaction_null_space": lambda: sp.reaction_null_space(body, shape),
        "dynamic_manipulability": lambda: sp.dynamic_manipulability(body, shape, given["link"]),
        "particle_body": lambda: sp.curvature(sp.particle_body([1.0, 2.0, 3.0], corners, ["angle"]), [0.4]),
        "contributions": lambda: sp.contributions(motion, "rotation", groups="joints"),
        "segment_momentum": lambda: sp.segment_momentum(motion),
        "clearance": lambda: sp.clearance(DIVER, SWING).approaches,
        "horizontal_gauge": lambda: sp.reconstruct(sp.horizontal_gauge(deformation), MOMENTUM),
        "link_gauge": lambda: sp.link_gauge(deformation, given["link"]).inertia(TIMES),
        "mean_body_gauge": lambda: sp.mean_body_gauge(deformation).inertia(TIMES),
        "principal_gauge": lambda: sp.principal_gauge(deformation).inertia(TIMES),
        "fixed_points": lambda: sp.fixed_points(deformation, 0.02),
        "stroboscopic_map": lambda: sp.stroboscopic_map(deformation, 0.02, [[0.0, 0.0, 1.0]]),
        "uncertainty": lambda: sp.uncertainty(motion, momentum=0.001),
        "body_summary": lambda: sp.body_summary(body),
        "path_summary": lambda: sp.path_summary(body, path),
        "bounds": lambda: sp.bounds.bounds(motion),
        **{
            f"motion {name}": lambda motion=motion: flown(motion.body, motion.path())
            for name, motion in MOTIONS.items()
        },
        "load_body": lambda: sp.load_body("cat_two_halves").locked_inertia(shape),
        "audit": lambda: audited(motion, body, path),
        "saved": lambda: saved(motion),
        "recorded": lambda: recorded(path, body),
        "robot_names": lambda: sp.robot_names(),
        "study": studied,
    }


def corners(shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A triangle that opens, and its derivative by the angle."""
    sine, cosine, none = np.sin(shapes[:, 0]), np.cos(shapes[:, 0]), np.zeros(len(shapes))
    fixed = np.broadcast_to([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], (len(shapes), 2, 3))
    places = np.concatenate([fixed, np.stack([cosine, sine, none], axis=1)[:, None]], axis=1)
    moved = np.concatenate([0.0 * fixed, np.stack([-sine, cosine, none], axis=1)[:, None]], axis=1)
    return places, moved[:, None]


def flown(name: str, path: sp.ShapePath) -> sp.PhaseSplit:
    """One of the motions that come with the library."""
    return sp.split(sp.reconstruct(sp.articulated(sp.load_body(name), path), MOMENTUM))


def swung(body: sp.Body) -> sp.ShapePath:
    """A path of all joints but the first."""
    return sp.ShapePath.waypoints([0.0, 1.0], np.outer([0.0, 0.1], np.ones(body.n_shape - 1)))


def audited(motion: sp.Motion, body: sp.Body, path: sp.ShapePath) -> tuple[bool, np.ndarray]:
    """Whether a motion is right in flight, and its momentum by its samples."""
    times = np.linspace(0.0, motion.duration, 41)
    run = sp.FloatingTrajectory(
        times=times, quaternion=sp.so3.quat_from_matrix(motion.attitude(times)), shapes=path.shape(times)
    )
    found = sp.audit(body, run)
    return found.right, found.runs[0].momentum


def sampled(path: sp.ShapePath) -> sp.ShapePath:
    """The path through samples, whose noise can be asked for."""
    times = np.linspace(0.0, path.duration, 41)
    return sp.ShapePath.spline(times, path.shape(times), joint_names=path.joint_names)


def torques_of_samples(body: sp.Body, path: sp.ShapePath) -> sp.JointTorques:
    """What drives the joints along the path through samples."""
    return sp.joint_torques(sp.reconstruct(sp.articulated(body, sampled(path)), MOMENTUM), TIMES)


def saved(motion: sp.Motion) -> sp.Motion:
    """A motion that went through a file."""
    with tempfile.TemporaryDirectory() as folder:
        motion.save(f"{folder}/motion.npz")
        return sp.load_motion(f"{folder}/motion.npz")


def recorded(path: sp.ShapePath, body: sp.Body) -> Any:
    """A path that went through a table, and its text."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "path.csv"
        sp.write_shape_path(path, file)
        return file.read_text(), sp.read_shape_path(file, body).shape(TIMES)


def studied() -> Any:
    """What a study of a few cats has stored, and the numbers of its last case."""
    over = {"momentum_z": [0.0, 0.01], "masses": sp.study.LogNormal(0.1)}
    more = {"parameters": {"alpha": 0.0, "beta": 0.5}}
    study = sp.study.Study("cat_two_halves", "kane_scher", over, ("final_attitude", "holonomy"), **more)
    with tempfile.TemporaryDirectory() as folder:
        store = study.run(f"{folder}/out.zarr", workers=0)
        return store.values("final_attitude"), store.values("holonomy"), study.case(1).masses


def numbers(thing: Any, depth: int = 0) -> list[Any]:
    """All numbers and words of a result, in order."""
    if isinstance(thing, np.ndarray):
        return [thing]
    if isinstance(thing, str | int | float | bool | None):
        return [repr(thing)]
    if isinstance(thing, tuple | list):
        return [number for part in thing for number in numbers(part, depth)]
    if isinstance(thing, Mapping):
        return numbers(list(thing.items()), depth)
    if isinstance(thing, sp.Motion):
        return [thing.attitude(TIMES), thing.final_attitude, thing.error_estimate]
    if isinstance(thing, sp.Deformation | sp.ShapePath):
        return [(thing.inertia if isinstance(thing, sp.Deformation) else thing.shape)(TIMES * thing.duration)]
    if isinstance(thing, sp.Body):
        return [thing.locked_inertia(np.full(thing.n_shape, 0.3)), repr(thing.joint_names)]
    if dataclasses.is_dataclass(thing) and depth < 3:
        fields = [getattr(thing, field.name) for field in dataclasses.fields(thing) if not field.name.startswith("_")]
        return numbers(fields, depth + 1)
    return []


def as_bytes(thing: Any) -> bytes:
    found = numbers(thing)
    assert found, thing
    parts = [part if isinstance(part, str) else (part.shape, str(part.dtype), part.tobytes()) for part in found]
    return repr(parts).encode()


def digest(call: Callable[[], Any]) -> str:
    return hashlib.sha256(as_bytes(call())).hexdigest()


def digests(on: Objects) -> dict[str, str]:
    return {name: digest(call) for name, call in calls(on).items()}


def digests_of_motions() -> dict[str, str]:
    """Of all that come with the library."""
    return {name: digest(lambda motion=motion: flown(motion.body, motion.path())) for name, motion in MOTIONS.items()}


if __name__ == "__main__":
    print(json.dumps(digests(objects())), file=sys.stdout)
