"""Trajectories with one fault planted, and whether an audit of them names it, for the quick and the large tests."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

import shapephase as sp
from support.flown_bodies import BODIES, Flown, body_of, flown, noisy

STEP = 0.001
EVERY = 5
"""Steps between samples."""
SPACING = STEP * EVERY
LATE = 0.01
"""[s] By which joints are shifted."""
SENSORS = {"turn": 0.01, "place": 0.002, "angle": 0.005, "rate": 0.05}
"""Noise of a clean run [rad, m, rad, rad/s]."""


@dataclass(frozen=True)
class Planted:
    """A trajectory, the hypothesis that is true of it, and its fitted numbers with what they may be off."""

    body: sp.Body
    trajectory: sp.FloatingTrajectory
    cause: str
    values: dict[str, tuple[float, float]]


def trajectory(name: str, motion: Flown, *, rates: bool = True, step: float = STEP) -> sp.FloatingTrajectory:
    qvel = motion.qvel if rates else None
    names = motion.joint_names
    return sp.FloatingTrajectory.from_mujoco(
        body_of(name), motion.times, motion.qpos, qvel, joint_names=names, integrator_step=step
    )


def planted(fault: str, name: str, seed: int, duration: float = 0.8) -> Planted:
    """One of `FAULTS` in a flight of a body."""
    return FAULTS[fault](name, seed, duration)


def _flight(name: str, seed: int, duration: float, **more) -> sp.FloatingTrajectory:
    return trajectory(name, flown(name, seed=seed, step=STEP, every=EVERY, duration=duration, **more))


def _mass(name: str, seed: int, duration: float) -> Planted:
    random = np.random.default_rng(seed + 100)
    links = [part.links[0] for part in body_of(name).moving_parts if part.mass > 1e-3]
    link, percent = str(random.choice(links)), 3.0 * float(random.choice([-1.0, 1.0]))
    run = _flight(name, seed, duration, heavier={link: 1.0 + 0.01 * percent})
    fixed = next(part.links[1:] for part in body_of(name).moving_parts if part.links[0] == link)
    part = f"{link} with {', '.join(fixed)} (fixed)" if fixed else link
    return Planted(body_of(name), run, f"mass of {part}", {"mass": (percent, 0.5)})


def _push(name: str, seed: int, duration: float, *, force: bool) -> Planted:
    random, body = np.random.default_rng(seed + 200), body_of(name)
    begin = round(random.uniform(0.25, 0.45) * duration, 3)
    end = begin + round(random.uniform(0.08, 0.25) * duration, 3)
    vector = random.normal(size=3) * (2.0 * body.mass if force else 3.0 * BODIES[name])
    arm = 0.1 * random.normal(size=3)

    def push(now: float) -> tuple[np.ndarray, np.ndarray]:
        on = begin - 1e-9 <= now < end - 1e-9
        if force:
            return vector * on, np.cross(arm, vector) * on
        return np.zeros(3), vector * on

    kind = "force" if force else "torque"
    values = {"from": (begin, 2.0 * SPACING), "to": (end, 2.0 * SPACING)}
    off = 0.02 * float(np.linalg.norm(vector))
    values |= {f"{kind} {axis}": (float(vector[k]), off) for k, axis in enumerate("xyz")}
    return Planted(body, _flight(name, seed, duration, push=push), f"{kind} from outside", values)


def _quaternion(name: str, seed: int, duration: float) -> Planted:
    run = _flight(name, seed, duration)
    swapped = replace(run, quaternion=np.roll(run.quaternion, -1, axis=1))
    return Planted(body_of(name), swapped, "quaternion written x y z w, read with w first", {})


def _frame(name: str, seed: int, duration: float) -> Planted:
    run = _flight(name, seed, duration)
    assert run.rate is not None
    turned = replace(run, rate=Rotation.from_quat(run.quaternion).apply(run.rate))
    return Planted(body_of(name), turned, "angular velocity in world axes", {})


def _degrees(name: str, seed: int, duration: float) -> Planted:
    run, body = _flight(name, seed, duration), body_of(name)
    factor = np.where(np.array(body.joint_units) == "rad", 180.0 / np.pi, 1.0)
    assert run.joint_rates is not None
    scaled = replace(run, shapes=run.shapes * factor, joint_rates=run.joint_rates * factor)
    return Planted(body, scaled, "joint angles and rates in degrees", {})


def _late_joints(name: str, seed: int, duration: float) -> Planted:
    lost = round(LATE / STEP)
    whole = trajectory(name, flown(name, seed=seed, step=STEP, duration=duration + LATE))
    base, joints = whole.part(lost, len(whole.times)), whole.part(0, len(whole.times) - lost)
    late = replace(base, shapes=joints.shapes, joint_rates=joints.joint_rates)
    return Planted(body_of(name), late.every(EVERY), "joints shifted in time", {"late by": (LATE, 0.0005)})


FAULTS = {
    "mass": _mass,
    "force": lambda name, seed, duration: _push(name, seed, duration, force=True),
    "torque": lambda name, seed, duration: _push(name, seed, duration, force=False),
    "quaternion": _quaternion,
    "frame": _frame,
    "degrees": _degrees,
    "late joints": _late_joints,
}


def faults_of_finding(case: Planted, found: sp.Audit, most: int = 1) -> list[str]:
    """What the audit has not found as it should; a tie may have so many members."""
    names = [one.name for one in found.cause]
    if case.cause not in names or len(names) > most:
        return [f"named {names}, not {case.cause}"]
    fitted = next(one for one in found.cause if one.name == case.cause).values
    return [
        f"{label} is {fitted[label].value}, not {value}"
        for label, (value, off) in case.values.items()
        if abs(fitted[label].value - value) > off
    ]


def clean_run(name: str, integrator: str, seed: int, *, rates: bool = True, duration: float = 1.0):
    """With the noise of sensors, steps so short that they leave less."""
    step = 0.0005
    motion = flown(name, seed=seed, integrator=integrator, step=step, every=20, duration=duration)
    return body_of(name), trajectory(name, noisy(motion, seed, **SENSORS), rates=rates, step=step)
