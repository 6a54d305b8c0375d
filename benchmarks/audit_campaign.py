"""Which cause an audit names: `python -m benchmarks.audit_campaign [--runs N] [--seed S] [--kinds ...]`.

Flights of five bodies by MuJoCo (Euler, implicitfast, RK4) and Drake (discrete), logged every 1 to 10 steps, with one
fault planted, or none. Printed for each kind of run: how often the true cause is first or in a tie of at most five, how
often a wrong one is named alone, and how often a right run raises an alarm.
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.signal import butter, lfilter, sosfilt, sosfiltfilt
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import ShapePhaseError

from .audit_flights import LIBRARY, MOMENTA, Flight, body_of, fly

MOST_IN_A_TIE = 5
VISIBLE, INVISIBLE = 2e-3, 5e-4
"""Drifts of the momentum by the step alone that an audit has to name, and must not [relative]."""


def noisy(rng: np.random.Generator, size: float, colour: Callable[[np.ndarray], np.ndarray]) -> Any:
    """Noise of a fraction of degrees and millimetres on configurations, and ten times that a second on rates."""

    def make(shape: tuple[int, ...]) -> np.ndarray:
        return size * colour(rng.normal(size=(shape[0] + 500, *shape[1:])))[500:]

    def record(run: sp.FloatingTrajectory) -> sp.FloatingTrajectory:
        turned = Rotation.from_quat(run.quaternion) * Rotation.from_rotvec(make((len(run.times), 3)))
        assert run.position is not None
        assert run.rate is not None
        assert run.velocity is not None
        assert run.joint_rates is not None
        return replace(
            run,
            quaternion=turned.as_quat(),
            position=run.position + 0.3 * make(run.position.shape),
            shapes=run.shapes + make(run.shapes.shape),
            rate=run.rate + 10.0 * make(run.rate.shape),
            velocity=run.velocity + 3.0 * make(run.velocity.shape),
            joint_rates=run.joint_rates + 10.0 * make(run.joint_rates.shape),
        )

    return record


def white(values: np.ndarray) -> np.ndarray:
    return values


def low_passed(rng: np.random.Generator, flight: Flight) -> Any:
    """A recording with white noise, all of it filtered by Butterworth, to and fro or as time goes."""
    spacing = flight.step * flight.every
    sections = butter(
        int(rng.integers(2, 5)), min(rng.uniform(6.0, 20.0), 0.2 / spacing), fs=1.0 / spacing, output="sos"
    )
    add = noisy(rng, 10.0 ** rng.uniform(-3.3, -2.3), white)
    causal = bool(rng.random() < 0.4)

    def smooth(values: np.ndarray | None) -> np.ndarray | None:
        if values is None:
            return None
        if not causal:
            return sosfiltfilt(sections, values, axis=0)
        first = values[0]
        return sosfilt(sections, values - first, axis=0) + first

    def record(run: sp.FloatingTrajectory) -> sp.FloatingTrajectory:
        run = add(run)
        signs = np.where((run.quaternion[1:] * run.quaternion[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
        near = run.quaternion * np.concatenate([[1.0], np.cumprod(signs)])[:, None]
        fields = {
            name: smooth(getattr(run, name)) for name in ("position", "shapes", "rate", "velocity", "joint_rates")
        }
        quaternion = smooth(near)
        assert quaternion is not None
        run = replace(run, quaternion=quaternion / np.linalg.norm(quaternion, axis=1)[:, None], **fields)
        # What is filtered begins before a flight and ends after it.
        edge = int(0.25 / spacing)
        return run.part(edge, len(run.times) - (0 if causal else edge))

    return record


def in_other_axes(turn_rate: bool, velocity: bool) -> Any:
    def record(run: sp.FloatingTrajectory) -> sp.FloatingTrajectory:
        turned = Rotation.from_quat(run.quaternion)
        return replace(
            run,
            rate=turned.apply(run.rate) if turn_rate else run.rate,
            velocity=turned.inv().apply(run.velocity) if velocity else run.velocity,
        )

    return record


def wrong_link(flight: Flight, rng: np.random.Generator) -> None:
    body = body_of(flight.name)
    heavy = [part for part in body.moving_parts if part.mass > 0.02 * body.mass]
    link = heavy[int(rng.integers(len(heavy)))].links[0]
    what, factor = str(rng.choice(["mass", "inertia", "centre"])), float(rng.choice([0.75, 1.25, 1.5]))
    if flight.name == "cat_two_halves" and what == "mass":
        what = "inertia"  # its halves have their centres in the waist, where masses change nothing
    axis, arm = (
        int(rng.integers(3)),
        0.15 * float(np.sqrt(0.5 * np.trace(body.locked_inertia(np.zeros(body.n_shape))) / body.mass)),
    )

    def change(model: Any) -> None:
        number = model.body(link).id
        if what in ("mass", "inertia"):
            model.body_mass[number] *= factor
        if what == "inertia":
            model.body_inertia[number] *= factor
        if what == "centre":
            model.body_ipos[number, axis] += arm

    flight.change = change
    flight.words = (
        {
            "mass": f"mass of {link}",
            "inertia": f"mass and inertia of {link}",
            "centre": f"centre of {link}, {'xyz'[axis]}",
        }[what],
    )


def shown_offset(body: sp.Body, rng: np.random.Generator) -> tuple[int, float]:
    """A joint whose offset changes inertia, momentum or centre of mass by a thousandth at least, and the offset."""
    while True:
        joint = int(rng.integers(body.n_shape))
        off = float(np.radians(rng.choice([-2.0, 2.0, 3.0])) if body.joint_units[joint] == "rad" else 0.03)
        shape = rng.uniform(-0.5, 0.5, body.n_shape)
        other = shape + off * np.eye(body.n_shape)[joint]
        changes = [
            np.linalg.norm(of(other) - of(shape)) / np.linalg.norm(of(shape))
            for of in (body.locked_inertia, body.momentum_matrix)
        ]
        if max(changes) > 1e-3:
            return joint, off


def planned(kind: str, seed: int) -> Flight:
    """A flight of one kind."""
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    name = list(MOMENTA)[int(rng.integers(len(MOMENTA)))]
    if kind == "drag" and name == "cat_two_halves":
        name = "crane"  # a fluid throws links that weigh nothing about
    flight = Flight(kind, name, rng, every=int(rng.integers(1, 11)))
    flight.integrator = str(rng.choice(["euler", "implicitfast", "rk4", "rk4", "drake"]))
    if flight.integrator == "drake" and (name in LIBRARY or kind in ("wrong link", "landing", "drag")):
        flight.integrator = "euler"
    flight.step = float(rng.choice([0.0005, 0.001, 0.002]))
    flight.duration = max(0.8, 45 * flight.every * flight.step)
    flight.rates = bool(rng.random() < 0.75)
    size = 10.0 ** rng.uniform(-4.3, -2.7)
    if kind in ("right", "right, white noise", "right, coloured noise"):
        flight.integrator = str(rng.choice(["rk4", flight.integrator]))
    if kind == "right, white noise":
        flight.record = noisy(rng, size, white)
    elif kind == "right, coloured noise":
        memory = rng.uniform(0.5, 0.97)
        flight.record = noisy(rng, size, lambda x: np.sqrt(1.0 - memory**2) * lfilter([1.0], [1.0, -memory], x, axis=0))
    elif kind == "filtered":
        flight.duration += 0.5
        flight.record, flight.words, flight.silence_allowed = low_passed(rng, flight), ("filtered",), True
    elif kind == "landing":
        flight.floor, flight.duration = True, 1.1
        flight.height = 0.5 * 9.81 * rng.uniform(0.75, 0.95) ** 2 - 3.0 * 0.8
        flight.height = max(flight.height, 0.5)
    elif kind == "drag":
        flight.words = ("drag",)
        if rng.random() < 0.5:
            flight.drag = rng.uniform(0.02, 0.2)
        else:
            density, viscosity = rng.uniform(1.0, 30.0), rng.choice([0.0, rng.uniform(0.1, 1.0)])
            flight.change = lambda model: (
                setattr(model.opt, "density", density),
                setattr(model.opt, "viscosity", viscosity),
            )
    elif kind == "wrong link":
        wrong_link(flight, rng)
    elif kind in ("frame", "two laws"):
        turns = bool(rng.random() < 0.5)
        flight.rates, flight.record = True, in_other_axes(turns, not turns)
        flight.words = ("angular velocity in world axes" if turns else "linear velocity in base axes",)
        if kind == "two laws":
            flight.integrator, flight.step = "euler", float(rng.choice([0.002, 0.004]))
            flight.duration = max(0.8, 45 * flight.every * flight.step)
    elif kind == "joint offset":
        joint, off = shown_offset(body_of(name), rng)
        flight.record = lambda run: replace(run, shapes=run.shapes + off * np.eye(run.shapes.shape[1])[joint])
        flight.words = (f"offset of joint {body_of(name).joint_names[joint]}",)
    elif kind == "gravity":
        flight.gravity, flight.words = float(rng.choice([9.0, 8.0, 10.8, 1.62, 3.7])), ("gravity",)
    elif kind == "sparse steps":
        flight.integrator = "drake" if name not in LIBRARY and rng.random() < 0.4 else "euler"
        flight.step = float(rng.choice([0.002, 0.004]))
        flight.duration = max(0.8, 45 * flight.every * flight.step)
    return flight


KINDS = (
    "right", "right, white noise", "right, coloured noise", "filtered", "landing", "drag", "wrong link", "frame",
    "two laws", "joint offset", "gravity", "sparse steps",
)  # fmt: skip
RIGHT = ("right", "right, white noise", "right, coloured noise", "landing")


def is_true(flight: Flight, found: Any) -> bool:
    """Whether every part of a hypothesis is there, and the planted cause among them, or the step where none is."""
    names = found.name.split(", and ")
    steps = [name for name in names if name.startswith("integration step")]
    if steps and flight.integrator == "rk4":
        return False
    others = [name for name in names if name not in steps]
    if not others:
        return flight.kind in (*RIGHT, "filtered", "sparse steps") and flight.drift >= INVISIBLE
    return len(others) == 1 and any(word in others[0] for word in flight.words)


def judged(flight: Flight) -> tuple[str, str]:
    """Column of the table, and what was named."""
    run = fly(flight)
    try:
        found = sp.audit(body_of(flight.name), run)
    except ShapePhaseError as error:
        return "refused", str(error)
    names = "; ".join(one.name for one in found.cause)
    by_step = flight.kind in (*RIGHT, "sparse steps") and flight.integrator != "rk4"
    if not found.right and not found.wrong:
        return "cannot tell", names
    if found.right:
        hidden = not by_step or flight.drift <= VISIBLE or flight.kind != "right"
        right = flight.silence_allowed or (flight.kind in RIGHT and hidden)
        return "no alarm" if right or (by_step and flight.drift <= VISIBLE) else "missed", names
    true = [place for place, one in enumerate(found.cause) if is_true(flight, one)]
    if flight.kind in RIGHT and not (true and by_step and flight.drift >= INVISIBLE):
        return "alarm", names
    if true and (true[0] == 0 or len(found.cause) <= MOST_IN_A_TIE):
        return "first" if len(found.cause) == 1 else "tie", names
    return "wrong alone" if len(found.cause) == 1 else "missed", names


def main() -> None:
    """Print a table of counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=120)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="*", default=KINDS)
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    counts: dict[str, Counter[str]] = {kind: Counter() for kind in options.kinds}
    for number in range(options.runs):
        kind = options.kinds[number % len(options.kinds)]
        flight = planned(kind, options.seed + number // len(options.kinds))
        outcome, named = judged(flight)
        counts[kind][outcome] += 1
        if options.verbose or outcome in ("missed", "wrong alone", "alarm", "refused"):
            print(
                f"{options.seed + number // len(options.kinds)} {kind}: {outcome}; {flight.name} {flight.integrator} "
                f"{1e3 * flight.step:g} ms x {flight.every}, rates {flight.rates}, drift {flight.drift:.2g}, "
                f"true {flight.words}; named: {named[:200]}",
                flush=True,
            )
    columns = ("no alarm", "cannot tell", "first", "tie", "missed", "wrong alone", "alarm", "refused")
    print(f"{'kind':24}" + "".join(f"{name:>13}" for name in columns))
    for kind, count in counts.items():
        print(f"{kind:24}" + "".join(f"{count[name]:13d}" for name in columns))


if __name__ == "__main__":
    main()
