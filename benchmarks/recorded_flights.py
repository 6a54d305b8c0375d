"""What is made of recordings with their base: `python -m benchmarks.recorded_flights [--runs N] [--seed S]`.

Flights of people and robots at 25 to 250 samples a second, with noise (white, or correlated over three samples),
contact before and after, an outside torque in a third; some in wrong units of length or time, some with a tracker that
drifts, some without places; and people who stand, walk or push off. Attitudes are integrated here, by the rule of Runge
and Kutta of the fourth order with 2,000 steps a second. Printed is how often the bars of the momentum miss, how long
they are, which flights are found and which slips are named.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import shapephase as sp
from shapephase import so3
from shapephase.errors import ShapePhaseError

BODIES = {"diver": 60.0, "astronaut": 50.0, "cat": 0.15, "satellite": 20.0}
"""And the size of their momenta [kg m^2/s]."""
RATES = (25.0, 30.0, 60.0, 120.0, 250.0)
LENGTHS = (0.01 / 0.0254, 2.54, 1.0 / 3.2808, 3.2808)
SPEEDS = (0.5, 2.0, 4.0, 1.2)
_STEPS = 2000.0
_G = 9.81


@dataclass(frozen=True)
class Take:
    """A recording and what is true of it.

    momenta : (M, 3) at even times of the flight [kg m^2/s]
    """

    body: sp.Body
    file: Path
    rate: float
    duration: float
    before: float
    momenta: np.ndarray
    torque: bool
    slip: str
    places: bool
    drifts: bool


def attitudes(
    body: sp.Body,
    joints: Callable[[np.ndarray], np.ndarray],
    times: np.ndarray,
    start: np.ndarray,
    momentum: np.ndarray,
    torque: np.ndarray,
) -> np.ndarray:
    """(N, 3, 3) at ascending times of a body whose momentum is `momentum + torque t`."""
    count = int(np.ceil(times[-1] * _STEPS)) + 1
    half = 0.5 * times[-1] / count * np.arange(2 * count + 1)
    shapes, step = joints(half), 2.0 * half[1]
    rates = (joints(half + 1e-6) - joints(half - 1e-6)) / 2e-6
    inverse = np.linalg.inv(body.locked_inertia(shapes))
    carried = np.einsum("nij,nj->ni", body.momentum_matrix(shapes), rates)

    def rate(quaternion: np.ndarray, place: int) -> np.ndarray:
        turned = so3.matrix_from_quat(quaternion / np.linalg.norm(quaternion))
        spin = inverse[place] @ (turned.T @ (momentum + half[place] * torque) - carried[place])
        vector, scalar = quaternion[:3], quaternion[3]
        return 0.5 * np.append(scalar * spin + np.cross(vector, spin), -vector @ spin)

    now, found = so3.quat_from_matrix(start), np.empty((count + 1, 4))
    found[0] = now
    for k in range(count):
        first = rate(now, 2 * k)
        second = rate(now + 0.5 * step * first, 2 * k + 1)
        third = rate(now + 0.5 * step * second, 2 * k + 1)
        last = rate(now + step * third, 2 * k + 2)
        now = now + step / 6.0 * (first + 2.0 * second + 2.0 * third + last)
        found[k + 1] = now / np.linalg.norm(now)
    places = np.clip(np.round(times / step).astype(int), 0, count)
    turned = so3.matrix_from_quat(found[places])
    spins = np.stack(
        [
            inverse[2 * k] @ (turned[n].T @ (momentum + half[2 * k] * torque) - carried[2 * k])
            for n, k in enumerate(places)
        ]
    )
    # Less than half a step from the next: turned on by the rate there.
    return turned @ so3.exp(spins * (times - step * places)[:, None])


def take(number: int, seed: int, folder: Path) -> Take:
    rng = np.random.default_rng([seed, number])
    name = list(BODIES)[number % len(BODIES)]
    body, size = sp.load_body(name), BODIES[name]
    rate, duration = RATES[(number // 4) % len(RATES)], rng.uniform(0.32, 1.2)
    places = rng.random() < 0.7
    before, after = (rng.uniform(0.4, 0.8), rng.uniform(0.3, 0.6)) if places else (0.0, 0.0)
    pushed = number % 3 == 0
    momentum = size * rng.normal(size=3) * [0.2, 1.0, 0.2]
    torque = size * rng.uniform(0.2, 0.6) / duration * direction(rng) if pushed else np.zeros(3)
    limits = np.where(np.isfinite(body.joint_limits), body.joint_limits, [-3.0, 3.0])
    middle, reach = limits.mean(axis=1), 0.3 * np.ptp(limits, axis=1)
    reach = np.minimum(reach, 0.5)
    turns, phases = rng.uniform(3.0, 8.0, body.n_shape), rng.uniform(0.0, 6.0, body.n_shape)

    def joints(t: np.ndarray) -> np.ndarray:
        return middle + reach * np.sin(np.multiply.outer(t, turns) + phases)

    count = int((before + duration + after) * rate) + 1
    times = np.arange(count) / rate - before
    flying = (times >= 0.0) & (times <= duration)
    start = so3.exp(rng.normal(size=3))
    turned = np.empty((count, 3, 3))
    # In contact the base turns as it may: here about one axis, ever slower before and after.
    inside = times[flying] if flying.any() else np.array([0.0])
    path = attitudes(body, joints, np.append(inside, duration), start, momentum, torque)
    turned[flying] = path[:-1] if flying.any() else path[:0]
    spin = np.linalg.solve(body.locked_inertia(joints(np.array(0.0))), start.T @ momentum)
    turned[times < 0.0] = start @ so3.exp(np.outer(np.tanh(times[times < 0.0]), spin))
    turned[times > duration] = path[-1] @ so3.exp(np.outer(np.tanh(times[times > duration] - duration), spin))
    noise = np.radians(rng.choice([0.1, 0.3, 1.0])) * rng.normal(size=(count, 3))
    if rng.random() < 0.5:
        phi = np.exp(-1.0 / 3.0)
        for k in range(1, count):
            noise[k] = phi * noise[k - 1] + np.sqrt(1.0 - phi**2) * noise[k]
    drifts = rng.random() < 0.1
    drift = np.outer(times - times[0], np.radians(3.0) * np.array([0.0, 0.0, float(drifts)]))
    recorded = so3.exp(drift) @ turned @ so3.exp(noise)
    base = heights(times, duration, rng) - so3.apply(turned, body.centre_of_mass(joints(times)))
    base = base + rng.choice([0.001, 0.003]) * rng.normal(size=base.shape)
    slip, clock = "", times - times[0]
    if places and rng.random() < 0.25:
        if rng.random() < 0.5:
            slip, base = "length", base * rng.choice(LENGTHS)
        else:
            slip, clock = "time", clock * rng.choice(SPEEDS)
    file = folder / f"take{number}.npz"
    arrays = {
        "time": clock,
        "shapes": joints(times) + np.radians(0.05) * rng.normal(size=(count, body.n_shape)),
        "joint_names": np.array(body.joint_names),
        "base_quat_xyzw": so3.quat_from_matrix(recorded),
    }
    np.savez(file, **(arrays | ({"base_position": base} if places else {})))
    momenta = momentum + np.outer(np.linspace(0.0, duration, 51), torque)
    return Take(body, file, rate, duration, before, momenta, pushed, slip, places, drifts)


def direction(rng: np.random.Generator) -> np.ndarray:
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def heights(times: np.ndarray, duration: float, rng: np.random.Generator) -> np.ndarray:
    """Pushed off with a net g, free, and caught with a net g: (N, 3), z up [m]."""
    speed = 0.5 * _G * duration
    push = speed / _G
    before, after = np.maximum(times + push, 0.0), times - duration
    caught = np.clip(after, 0.0, push)
    height = np.select(
        [times < 0.0, times < duration],
        [0.5 * _G * before**2 - 0.5 * _G * push**2, speed * times - 0.5 * _G * times**2],
        -speed * caught + 0.5 * _G * caught**2,
    )
    return np.column_stack([rng.uniform(0.0, 1.0) * times, np.zeros_like(times), 1.0 + height])


def grounded(number: int, seed: int, folder: Path) -> Path:
    """Somebody stands, walks, or pushes off and is caught in the air by a coach."""
    rng = np.random.default_rng([seed, number, 1])
    body, times = sp.load_body("diver"), np.arange(240) / 60.0
    walk = np.column_stack([1.3 * times, 0.03 * np.sin(6.0 * times), 1.0 + 0.02 * np.sin(12.0 * times)])
    if number % 3 == 1:
        walk[:, :2] = 0.0
    if number % 3 == 2:
        pushed = np.clip(times - 1.0, 0.0, 0.3)
        walk[:, 2] = 1.0 + 0.5 * _G * pushed**2 + _G * 0.3 * np.clip(times - 1.3, 0.0, None) * np.exp(-times)
    joints = np.column_stack([0.3 * np.sin(6.0 * times), -0.3 * np.sin(6.0 * times + 0.3)])
    turned = so3.exp(0.1 * np.column_stack([np.sin(6.0 * times), np.sin(5.0 * times), np.sin(3.0 * times)]))
    base = walk - so3.apply(turned, body.centre_of_mass(joints)) + 0.002 * rng.normal(size=walk.shape)
    noise = so3.exp(np.radians(0.3) * rng.normal(size=(240, 3)))
    file = folder / f"ground{number}.npz"
    np.savez(
        file,
        time=times,
        shapes=joints,
        joint_names=np.array(body.joint_names),
        base_quat_xyzw=so3.quat_from_matrix(turned @ noise),
        base_position=base,
    )
    return file


def main() -> None:
    """Print a table of counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    counts: Counter[str] = Counter()
    misses: dict[str, list[np.ndarray]] = {"free": [], "pushed": [], "drifting": []}
    ratios: dict[str, list[float]] = {"free": [], "pushed": [], "drifting": []}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number in range(options.runs):
            one = take(number, options.seed, folder)
            said = judged(one, counts, misses, ratios)
            if options.verbose and said:
                print(number, one.body.name, one.rate, round(one.duration, 2), one.torque, one.slip, said, flush=True)
        for number in range(options.runs // 10):
            counts["on the ground"] += 1
            try:
                found = sp.read_recorded_motion(
                    grounded(number, options.seed, folder), sp.load_body("diver"), flight="recorded"
                )
                counts["on the ground, flight found"] += found.flight is not None and found.flight.by == "auto"
            except ShapePhaseError as error:
                counts["on the ground, called slipped"] += "is expected" in str(error)
    for key in sorted(counts):
        print(f"{key:60}{counts[key]:6d}")
    for kind, inside in misses.items():
        if inside:
            part = np.mean(inside, axis=0)
            length = np.median(ratios[kind])
            print(
                f"{kind:10}{len(inside):4d} flights: 95 % bars miss in {np.round(100 * (1 - part), 1)} % by component; "
                f"over the true error, as vectors, they are {length:.2f} in the median"
            )


def judged(one: Take, counts: Counter[str], misses: dict[str, list[np.ndarray]], ratios: dict[str, list[float]]) -> str:
    """Count what comes of a recording, and say what is wrong."""
    kind = "drifting" if one.drifts else "pushed" if one.torque else "free"
    long = one.places and one.rate >= 60.0 and not one.slip
    counts["flights at 60 Hz or more"] += long
    counts["slips"] += bool(one.slip)
    try:
        recorded = sp.read_recorded_motion(one.file, one.body, flight="recorded")
    except ShapePhaseError as error:
        named = "is expected" in str(error)
        counts["slips named"] += bool(one.slip) and named
        counts["right files called slipped"] += not one.slip and named
        return "" if one.slip and named else str(error)[-300:]
    if one.slip:
        counts[f"slips not seen ({one.slip})"] += 1
        return "slip not seen"
    flight = recorded.flight
    assert flight is not None
    if one.places:
        found = flight.by == "auto"
        inside = (
            found
            and flight.first_time > one.before - 1.5 / one.rate
            and flight.last_time < one.before + one.duration + 1.5 / one.rate
        )
        counts["flights at 60 Hz or more, found"] += bool(long and inside)
        counts["flights found with contact in them"] += bool(found and not inside)
        if not inside:
            return "not found"
    try:
        flown = sp.motion_from_recording(one.body, recorded, tolerance=1e-7)
    except ShapePhaseError as error:
        counts[f"refused ({kind}{'' if one.places else ', no places'})"] += 1
        return "" if one.torque and not one.places else str(error)[-200:]
    fit = flown.fitted
    assert fit is not None
    counts[f"warned ({kind})"] += not fit.conserved
    first = flight.first_time - one.before
    share = np.clip(np.array([first, first + recorded.times[-1]]) / one.duration, 0.0, 1.0)
    rows = one.momenta[int(50 * share[0]) : int(50 * share[1]) + 1]
    off = np.abs(rows - fit.momentum).max(axis=0)
    bar = 1.959964 * np.sqrt(np.diag(sp.uncertainty(fit.motion, start=fit).start)[3:])
    misses[kind].append(off <= bar)
    ratios[kind].append(float(np.linalg.norm(bar) / np.linalg.norm(off)))
    return "" if np.all(off <= 1.3 * bar) else f"{kind}: off {off / bar}"


if __name__ == "__main__":
    main()
