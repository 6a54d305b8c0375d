"""Inertia and momentum of random bodies, rounded: `python -m benchmarks.body_leaf [BODIES [SEED]]`; needs a C compiler.

Pinocchio's and the kernel's, each against extended precision, in units of eps times the sum of
the magnitudes of the terms: what no computation in doubles can avoid is a few of these for every joint.
"""

# Pinocchio fills its namespace at import time, where a type checker cannot look.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import shapephase as sp
from shapephase.body import Coupling
from shapephase.body.body import Body
from shapephase.body.joint_chain import JointChain
from shapephase.integrator.link_tree import tree_channels, tree_inertia_and_momentum

from .extended import Truth

MOST_JOINTS = 12
FAR = 100.0
"""Displacement of some joints [m]."""
ROUNDINGS = 8
"""Allowed for every joint, and for three more."""


@dataclass(frozen=True)
class Leaf:
    """One body at one shape: the larger error of inertia and momentum, over eps times the sum of their terms."""

    joints: int
    far: bool
    pinocchio: float
    kernel: float

    @property
    def allowed(self) -> float:
        """What either may be."""
        return ROUNDINGS * (self.joints + 3.0)


def main() -> None:
    """Print the largest of each, and the time of both."""
    bodies, seed = (int(argument) for argument in (sys.argv[1:] + ["2000", "1"][len(sys.argv) - 1 :]))
    found = leaves(bodies, seed)
    for name, chosen in (
        ("near", [x for x in found if not x.far]),
        ("some joints 100 m away", [x for x in found if x.far]),
    ):
        for leaf in ("pinocchio", "kernel"):
            size = np.array([getattr(x, leaf) for x in chosen])
            share = max(getattr(x, leaf) / x.allowed for x in chosen)
            print(
                f"{len(chosen)} bodies, {name}; {leaf}: median {np.median(size):.2f}, worst {size.max():.2f} eps of "
                f"the terms, at most {share:.2f} of what is allowed"
            )
    print("processor time for one shape of 400 [us]")
    for name in sp.robot_names():
        ours, theirs = timed(sp.load_body(name))
        print(f"  {name:16} Pinocchio {theirs:6.2f}, kernel {ours:6.3f}")


def leaves(bodies: int, seed: int) -> list[Leaf]:
    """Random bodies, each at one random shape and rate; every other has joints far away."""
    rng = np.random.default_rng(seed)
    return [leaf(random_body(rng, far=bool(number % 2)), rng, far=bool(number % 2)) for number in range(bodies)]


def leaf(body: sp.Body, rng: np.random.Generator, *, far: bool) -> Leaf:
    """Both errors at a random shape and rate."""
    shape, rate = rng.uniform(-3.0, 3.0, (2, 1, body.n_shape))
    (exact,) = Truth(body).inertia_and_momentum(shape, rate)
    unit = np.repeat(extent(body.chain, shape[0], rate[0]), (9, 3)) * np.finfo(float).eps
    errors = []
    for inertia, momentum in (body.sample(shape, rate), tree_inertia_and_momentum(body.chain.rows, shape, rate)):
        gap = np.abs(np.concatenate([inertia.reshape(-1), momentum.reshape(-1)]) - exact)
        # Where there are no terms, there must be no error.
        errors.append(float(np.max(gap / np.where(unit > 0.0, unit, 1e-300))))
    return Leaf(len(body.chain.names), far, *errors)


def extent(chain: JointChain, shape: np.ndarray, rate: np.ndarray) -> tuple[float, float]:
    """The terms of inertia and momentum as seen from the base, by their sizes, added up without cancelling."""
    q, v = chain.matrix @ shape + chain.offset, np.abs(chain.matrix @ rate)
    reach, spin, speed = np.zeros((3, len(chain.names) + 1))
    for joint, parent in enumerate(chain.parents):
        slide, axis = (float(np.linalg.norm(part[joint])) for part in (chain.slides, chain.axes))
        reach[joint + 1] = reach[parent] + float(np.linalg.norm(chain.places[joint])) + slide * abs(q[joint])
        spin[joint + 1] = spin[parent] + axis * v[joint]
        speed[joint + 1] = speed[parent] + (axis * reach[joint + 1] + slide) * v[joint]
    reach = reach + np.linalg.norm(chain.centres, axis=1)
    speed = speed + spin * reach
    share, own = chain.masses / chain.masses.sum(), np.linalg.norm(chain.inertias, axis=(1, 2))
    reach, speed = reach + share @ reach, speed + share @ speed
    return float(chain.masses @ reach**2 + own.sum()), float(chain.masses @ (reach * speed) + own @ spin)


def random_body(rng: np.random.Generator, *, far: bool) -> sp.Body:
    """A random tree of 1 to 12 joints of all kinds, some of which follow others."""
    model = pin.Model()
    numbers = [model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")]
    _give_mass(model, numbers[0], rng)
    mimics: dict[str, tuple[str, float, float]] = {}
    leaders: list[str] = []
    for joint in range(int(rng.integers(1, MOST_JOINTS + 1))):
        axis = rng.normal(size=3)
        axis = axis / np.linalg.norm(axis) if rng.random() < 0.7 else np.eye(3)[rng.integers(3)]
        kinds = (pin.JointModelRevoluteUnaligned, pin.JointModelPrismaticUnaligned, pin.JointModelHelicalUnaligned)
        kind = int(rng.choice(4, p=(0.6, 0.2, 0.1, 0.1)))
        moving = pin.JointModelRUBX() if kind == 3 else kinds[kind](axis, *([rng.normal()] if kind == 2 else []))
        distance = 10.0 ** rng.uniform(-2.0, 0.5)
        if far and (joint == 0 or rng.random() < 0.3):
            distance = FAR
        direction = rng.normal(size=3)
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        pose = pin.SE3(turn * np.linalg.det(turn), distance * direction / np.linalg.norm(direction))
        name = f"joint_{joint}"
        numbers.append(model.addJoint(int(rng.choice(numbers)), moving, pose, name))
        _give_mass(model, numbers[-1], rng)
        if leaders and rng.random() < 0.2:
            mimics[name] = str(rng.choice(leaders)), float(rng.normal()), float(rng.normal())
        else:
            leaders.append(name)
    rules = {name: Coupling.linear(*rule) for name, rule in mimics.items()}
    return Body(model, "random", rules)


def _give_mass(model: pin.Model, number: int, rng: np.random.Generator) -> None:
    """A link of random mass and inertia, of the size of its distance from the joint; one in ten has none."""
    if number > 1 and rng.random() < 0.1:
        return
    mass, size = 10.0 ** rng.uniform(-2.0, 2.0), 10.0 ** rng.uniform(-2.0, 0.5)
    corners = rng.normal(size=(5, 3)) * size
    corners -= corners.mean(axis=0)
    moment = mass / 5.0 * corners.T @ corners
    inertia = pin.Inertia(mass, rng.normal(size=3) * size, np.trace(moment) * np.eye(3) - moment)
    model.appendBodyToJoint(number, inertia, pin.SE3.Identity())


def timed(body: sp.Body, shapes: int = 400, runs: int = 21) -> tuple[float, float]:
    """Processor time of the kernel and of Pinocchio for one shape, medians of runs in turns [us]."""
    shape, rate = np.random.default_rng(2).normal(size=(2, shapes, body.n_shape))
    calls = (lambda: tree_channels(body.chain.rows, shape, rate), lambda: body.sample(shape, rate))
    spent = np.empty((2, runs))
    for call in calls:
        call()
    for run in range(runs):
        for place, call in enumerate(calls):
            start = time.process_time_ns()
            call()
            spent[place, run] = time.process_time_ns() - start
    ours, theirs = np.median(spent, axis=1) / (1e3 * shapes)
    return float(ours), float(theirs)


if __name__ == "__main__":
    main()
