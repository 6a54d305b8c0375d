"""Bodies and paths that every contestant runs; made with public names alone, also by older checkouts."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module

import numpy as np

import shapephase as sp


@dataclass(frozen=True)
class Case:
    """One body, one path, one momentum [kg m^2/s]."""

    name: str
    body: sp.Body
    path: sp.ShapePath
    momentum: np.ndarray


def fourier(body: sp.Body, seed: int, harmonics: int = 3, size: float = 0.25, duration: float = 1.0) -> sp.ShapePath:
    """A random smooth loop; sliding joints move a tenth as far."""
    rng = np.random.default_rng(seed)
    scale = np.array([0.1 if unit == "m" else 1.0 for unit in body.joint_units])[:, None]
    decay = size / np.arange(1, harmonics + 1) ** 1.5
    shape = (body.n_shape, harmonics)
    return sp.ShapePath.fourier(
        np.zeros(body.n_shape), rng.normal(size=shape) * decay * scale, rng.normal(size=shape) * decay * scale, duration
    )


def spline(body: sp.Body, seed: int, knots: int, duration: float = 1.0) -> sp.ShapePath:
    """A smooth loop through samples, as recorded data would be."""
    loop = fourier(body, seed, duration=duration)
    times = np.linspace(0.0, duration, knots + 1)
    return sp.ShapePath.spline(times, loop.shape(times))


def move(body: sp.Body, seed: int, duration: float = 1.0) -> sp.ShapePath:
    """From rest to rest through two waypoints."""
    rng = np.random.default_rng(seed)
    scale = np.array([0.1 if unit == "m" else 1.0 for unit in body.joint_units])
    points = rng.normal(size=(3, body.n_shape)) * 0.4 * scale
    return sp.ShapePath.waypoints([0.0, 0.5 * duration, duration], points)


def as_function(path: sp.ShapePath) -> sp.ShapePath:
    """The same path as a function of time about which only its breaks are known."""
    return sp.ShapePath.function(path.curve, path.duration, path.breaks[1:-1])


def cases() -> list[Case]:
    """Seventeen cases on twelve bodies: loops, recorded samples, moves; with momentum and without."""
    return [numbered_case(number) for number in range(len(_CASES))]


def numbered_case(number: int) -> Case:
    """One of them."""
    name, kind, momentum = _CASES[number]
    body = _body(name)
    path = kind(body, number)
    axis = np.random.default_rng(100 + number).normal(size=3)
    size = momentum * float(np.trace(body.locked_inertia(np.zeros(body.n_shape)))) / 3.0
    still = "" if momentum else ", at rest"
    return Case(f"{name} {kind.__name__}{still}", body, path, size * axis / np.linalg.norm(axis))


@cache
def _body(name: str) -> sp.Body:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return sp.load_body(name)


def loop(body: sp.Body, seed: int) -> sp.ShapePath:
    """Three harmonics in a second."""
    return fourier(body, seed)


def rich_loop(body: sp.Body, seed: int) -> sp.ShapePath:
    """Six harmonics in a second."""
    return fourier(body, seed, harmonics=6)


def samples_12(body: sp.Body, seed: int) -> sp.ShapePath:
    """Twelve samples a loop."""
    return spline(body, seed, 12)


def righting(_body: sp.Body, _seed: int) -> sp.ShapePath:
    """The cat's own."""
    try:
        scenarios = import_module("shapephase.examples.scenarios")
    except ImportError:  # an older checkout, to compare with
        scenarios = import_module("shapephase.scenarios")
    return scenarios.cat_righting()


Kind = Callable[[sp.Body, int], sp.ShapePath]
# Body, path, momentum as a rate of turning [rad/s] of a body with the mean moment of inertia.
_CASES: list[tuple[str, Kind, float]] = [
    ("cat_two_halves", loop, 3.0),
    ("cat", righting, 0.0),
    ("cat", loop, 4.0),
    ("astronaut", loop, 1.0),
    ("astronaut", move, 0.0),
    ("satellite", loop, 0.5),
    ("diver", loop, 6.0),
    ("diver", samples_12, 6.0),
    ("example:human", loop, 3.0),
    ("example:human", loop, 0.0),
    ("example:human", rich_loop, 6.0),
    ("example:talos_reduced", loop, 2.0),
    ("example:talos_reduced", move, 2.0),
    ("example:solo12", loop, 10.0),
    ("example:panda", loop, 2.0),
    ("example:ur5_robot", samples_12, 0.0),
    ("example:anymal", move, 5.0),
]
