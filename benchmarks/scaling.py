"""How time and memory grow, with attitudes, with loops and with joints: `python -m benchmarks.scaling`."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable
from functools import partial

import numpy as np
import pinocchio as pin

import shapephase as sp
from shapephase import so3

from .cases import Case, cases, fourier
from .contestants import solve_ivp_attitude

RUNS = 9


def print_scaling() -> None:
    """Print the three tables; memory is what NumPy and Python hold at most, beyond what was there before."""
    case = next(c for c in cases() if c.name == "example:human loop")
    print_attitudes(case)
    print_loops(case)
    print_joints()


def print_attitudes(case: Case) -> None:
    """Many attitudes of one loop (target: 10,000 in at most 1000 times the time of one)."""
    deformation = sp.articulated(case.body, case.path)
    for tolerance in (1e-6, 1e-9):
        once = partial(sp.reconstruct, deformation, case.momentum, tolerance=tolerance)
        single = median_seconds(once)
        print(f"\n{case.name} at {tolerance:g} rad, once {1e3 * single:.2f} ms (10,000 attitudes: target 1000 times)")
        for count in (10, 100, 1000, 10_000):
            attitudes = so3.exp(np.random.default_rng(0).normal(size=(count, 3)))
            row(f"{count:6d} attitudes", partial(once, attitude=attitudes), single)


def print_loops(case: Case) -> None:
    """One loop many times (target: 1000 in at most 1100 times the time of one, memory linear)."""
    # About the long axis and slowly: most other motions of this loop are chaotic, and no method follows them that far.
    calm = np.array([0.0, 8.0, 0.0])
    for momentum, name in ((calm, "8 kg m^2/s"), (np.zeros(3), "at rest")):
        once = partial(sp.reconstruct, sp.articulated(case.body, case.path), momentum, tolerance=1e-6)
        single = median_seconds(once)
        print(f"\n{case.name}, {name}, at 1e-6 rad in all, once {1e3 * single:.2f} ms (1000 loops: target 1100 times)")
        for count in (10, 100, 1000):
            often = sp.articulated(case.body, case.path.repeated(count))
            row(f"{count:6d} loops", partial(sp.reconstruct, often, momentum, tolerance=1e-6), single)


def print_joints() -> None:
    """Bodies of 3 to 100 joints, against DOP853 at the relative tolerance 1e-9."""
    print("\nrandom trees of links, a loop with momentum at 1e-9 rad, against DOP853 at rtol 1e-9")
    for joints in (3, 6, 12, 25, 50, 100):
        body = random_tree(joints)
        path = fourier(body, joints, size=0.6 / joints**0.5)
        case = Case(f"{joints} joints", body, path, np.array([0.3, 0.2, 1.0]) * joints)
        ours = partial(sp.reconstruct, sp.articulated(body, path), case.momentum, tolerance=1e-9)
        theirs = median_seconds(partial(solve_ivp_attitude, case, 1e-9))
        single = median_seconds(ours)
        print(
            f"  {joints:6d} joints   {1e3 * single:7.2f} ms, DOP853 {1e3 * theirs:7.2f} ms, {theirs / single:5.1f} "
            f"times; {ours().evaluations} evaluations, memory {peak(ours) / 1e6:.2f} MB"
        )


def row(name: str, run: Callable[[], object], single: float) -> None:
    """One line: time, how many times the single run, and the memory peak."""
    taken = median_seconds(run, 3)
    print(f"  {name:18}{taken:8.3f} s, {taken / single:7.0f} times once, memory {peak(run) / 1e6:8.2f} MB")


def random_tree(joints: int) -> sp.Body:
    """Links of about 1 kg and 0.2 m, each on one of the last three before it, about random axes."""
    rng = np.random.default_rng(joints)
    model = pin.Model()
    numbers = [model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")]
    model.appendBodyToJoint(numbers[0], pin.Inertia.FromEllipsoid(2.0, 0.2, 0.15, 0.1), pin.SE3.Identity())
    for number in range(joints):
        axis = rng.normal(size=3)
        place = pin.SE3(np.eye(3), 0.2 * rng.normal(size=3))
        parent = numbers[max(0, len(numbers) - int(rng.integers(1, 4)))]
        revolute = pin.JointModelRevoluteUnaligned(axis / np.linalg.norm(axis))
        numbers.append(model.addJoint(parent, revolute, place, f"joint_{number}"))
        mass = float(rng.uniform(0.5, 1.5))
        link = pin.Inertia.FromEllipsoid(mass, 0.15, 0.05, 0.04)
        model.appendBodyToJoint(numbers[-1], link, pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0])))
    return sp.load_body(model)


def median_seconds(run: Callable[[], object], runs: int = RUNS) -> float:
    """The median time of some runs, after one that does not count."""
    run()
    taken = []
    for _ in range(runs):
        start = time.process_time()
        run()
        taken.append(time.process_time() - start)
    return float(np.median(taken))


def peak(run: Callable[[], object]) -> int:
    """The most memory that a run holds [bytes]."""
    tracemalloc.start()
    run()
    top = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return top


if __name__ == "__main__":
    print_scaling()
