"""Random bodies, paths, momenta and tolerances for `benchmarks.estimates`, with what the extended precision follows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
import pinocchio as pin

import shapephase as sp

from .cases import as_function
from .extended import BUMP, BURST, CONSTANT, GAUSSIAN, HARMONIC, RAMP, Segment, Terms

BODIES = ("astronaut", "cat", "cat_two_halves", "diver", "satellite")
"""A run of a number stays the same run, whatever further bodies come with the library."""
_TOLERANCES = (-12.0, -5.0)
"""Powers of ten [rad]."""
_NARROWEST = 1.0 / 500.0
"""Width of the support of bursts, bumps and ramps, as a share of the duration."""
_TAILS = 8.0
"""Widths that count as the support of a Gaussian or a hyperbolic tangent: beyond, less than 1e-7 of it is left."""
_MOST_JOINTS = 12
_THIN, _FAR = 0.1, 0.05
"""Shares of random bodies that are long and thin, or that have joints up to 100 m apart."""
_MOST_LOOPS = 400


@dataclass(frozen=True)
class Trial:
    """One run to be: a body, a path, and the same path in segments that the extended precision follows."""

    what: str
    body: sp.Body
    path: sp.ShapePath
    segments: tuple[Segment, ...]
    momentum: np.ndarray
    tolerance: float
    seed: tuple[int, ...] = ()
    highest: int = 0

    def times(self, count: int) -> np.ndarray:
        """Random ones, and the end: ascending [s]."""
        found = np.random.default_rng((*self.seed, 1)).uniform(0.0, self.path.duration, count)
        return np.append(np.sort(found), self.path.duration)


@dataclass(frozen=True)
class Way:
    """A path and its segments."""

    what: str
    path: sp.ShapePath
    segments: tuple[Segment, ...] = field(default_factory=tuple)


# ---- Families -------------------------------------------------------------------------------------------------------


def harmonics(number: int, rng: np.random.Generator) -> Trial:
    """One harmonic, or two of one or two joints, amplitudes 0.1 to 4; bodies, momenta and harmonics take turns."""
    names = BODIES
    body = shipped(names[number % len(names)])
    highest = 1 + 7 * (number // (2 * len(names))) % 24
    chosen = [highest] if rng.random() < 0.5 else [highest, int(rng.integers(1, highest + 1))]
    sines = np.zeros((body.n_shape, highest))
    for harmonic in chosen:
        joint = int(rng.integers(body.n_shape))
        sines[joint, harmonic - 1] += _reach(body)[joint] * 10.0 ** rng.uniform(-1.0, np.log10(4.0))
    path = sp.ShapePath.fourier(np.zeros(body.n_shape), 0.0 * sines, sines, 1.0)
    trial = _trial(body, Way(f"harmonics {chosen}", path), rng, resting=number // len(names) % 2 == 0, seed=(number,))
    return replace(trial, highest=highest)


def mixed(number: int, rng: np.random.Generator) -> Trial:
    """All kinds of paths on bodies that come with the library and on random ones."""
    names = BODIES
    body = shipped(str(rng.choice(names))) if rng.random() < 0.4 else random_body(rng)
    kind = _KINDS[rng.choice(len(_KINDS), p=_SHARES)]
    return _trial(body, kind(body, rng), rng, resting=rng.random() < 0.4, seed=(number,))


def recordings(number: int, rng: np.random.Generator) -> Trial:
    """Recorded paths of some hundred to some thousand rows, smooth or noisy, on all kinds of bodies."""
    names = BODIES
    body = shipped(str(rng.choice(names))) if rng.random() < 0.6 else random_body(rng)
    return _trial(body, _recording(body, rng), rng, resting=rng.random() < 0.5, seed=(number,))


def _trial(body: sp.Body, way: Way, rng: np.random.Generator, *, resting: bool, seed: tuple[int, ...]) -> Trial:
    tolerance = 10.0 ** rng.uniform(*_TOLERANCES)
    momentum = np.zeros(3)
    if not resting:
        momentum = rng.normal(size=3)
        moment = float(np.trace(body.locked_inertia(way.path.shape(0.0)))) / 3.0
        # [rad/s] 0.1 to 30 rad in a loop; slower in many loops, most of which no method could follow else.
        speed = 10.0 ** rng.uniform(-1.0, 1.5) * np.sqrt(way.path.loops) / way.path.duration
        momentum *= speed * moment / np.linalg.norm(momentum)
    segments = way.segments or (_whole(way.path),)
    what = f"{body.name} ({len(body.chain.names)} joints), {way.what}{', at rest' if resting else ''}"
    return Trial(what, body, way.path, segments, momentum, tolerance, seed)


# ---- Bodies ---------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=16)
def shipped(name: str) -> sp.Body:
    """A body that comes with the library."""
    return sp.load_body(name)


def random_body(rng: np.random.Generator) -> sp.Body:
    """A tree of 1 to 12 joints, turning and sliding, of links of 0.03 to 3 kg; some long and thin, some far apart."""
    joints = int(np.exp(rng.uniform(0.0, np.log(_MOST_JOINTS + 1))))
    chain_like, kind = rng.random(), rng.random()
    # Thin: all links nearly on one line, one moment of inertia far below the others. Far: up to 100 m apart.
    spread = np.array([1.0, 1e-2, 1e-2]) if kind < _THIN else np.full(3, 100.0 if kind > 1.0 - _FAR else 1.0)
    model = pin.Model()
    model.name = "random tree"
    frames = [model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")]
    model.appendBodyToJoint(frames[0], _link(rng), pin.SE3(np.eye(3), 0.1 * rng.normal(size=3)))
    for number in range(joints):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        if rng.random() < 0.5:
            axis = np.eye(3)[rng.integers(3)]
        turning, sliding = pin.JointModelRevoluteUnaligned(axis), pin.JointModelPrismaticUnaligned(axis)
        turn = pin.exp3((0.1 if kind < _THIN else 1.0) * rng.normal(size=3))
        place = pin.SE3(turn, 10.0 ** rng.uniform(-1.5, 0.0) * rng.normal(size=3) / 2.0 * spread)
        parent = frames[-1] if rng.random() < chain_like else frames[rng.integers(len(frames))]
        frames.append(model.addJoint(parent, sliding if rng.random() < 0.15 else turning, place, f"joint_{number}"))
        model.appendBodyToJoint(frames[-1], _link(rng), pin.SE3(np.eye(3), 0.15 * rng.normal(size=3)))
    return sp.load_body(model)


def _link(rng: np.random.Generator) -> pin.Inertia:
    axes = 10.0 ** rng.uniform(-1.7, -0.3, 3)
    return pin.Inertia.FromEllipsoid(float(10.0 ** rng.uniform(-1.5, 0.5)), *(float(axis) for axis in axes))


def _reach(body: sp.Body) -> np.ndarray:
    return np.array([0.1 if unit == "m" else 1.0 for unit in body.joint_units])


# ---- Paths ----------------------------------------------------------------------------------------------------------


def _whole(path: sp.ShapePath, exact: sp.ShapePath | Terms | None = None, extra: tuple[float, ...] = ()) -> Segment:
    """A path as one segment; `extra` are breaks for the extended precision alone."""
    breaks = np.union1d(path.breaks, np.clip(extra, 0.0, path.duration)) if len(extra) else path.breaks
    return Segment(exact if exact is not None else path, breaks, path.duration)


def _loop(body: sp.Body, rng: np.random.Generator) -> Way:
    count = int(rng.integers(1, 9))
    size = 10.0 ** rng.uniform(-2.0, 0.0) * _reach(body)[:, None] / np.arange(1, count + 1) ** rng.uniform(0.5, 2.0)
    cosines, sines = rng.normal(size=(2, body.n_shape, count)) * size
    path = sp.ShapePath.fourier(np.zeros(body.n_shape), cosines, sines, 10.0 ** rng.uniform(-1.0, 1.0))
    return Way(f"loop of {count}", path, (_whole(path),))


def _move(body: sp.Body, rng: np.random.Generator) -> Way:
    count = int(rng.integers(2, 6))
    points = rng.normal(size=(count, body.n_shape)) * 0.5 * _reach(body)
    path = sp.ShapePath.waypoints(_times(count, rng), points)
    return Way(f"move through {count}", path, (_whole(path),))


def _spline(body: sp.Body, rng: np.random.Generator) -> Way:
    count = int(rng.integers(4, 60))
    points = np.cumsum(rng.normal(size=(count, body.n_shape)), axis=0) * 0.2 / np.sqrt(count) * _reach(body)
    if closed := rng.random() < 0.3:
        points -= np.linspace(0.0, 1.0, count)[:, None] * (points[-1] - points[0])
    path = sp.ShapePath.spline(_times(count, rng), points)
    return Way(f"spline of {count}{', closed' if closed else ''}", path, (_whole(path),))


def _recording(body: sp.Body, rng: np.random.Generator) -> Way:
    """Rows of a few harmonics, with or without noise, rests, a single wrong sample, and rounding to six digits."""
    count, noise = int(rng.choice([66, 100, 200, 400, 1000, 2500])), float(rng.choice([0.0, 1e-6, 1e-4, 1e-3, 1e-2]))
    reach, times = (
        _reach(body),
        _times(count, rng) if rng.random() < 0.3 else np.linspace(0.0, 10.0 ** rng.uniform(-1.0, 1.0), count),
    )
    phase, closed = times[:, None] / times[-1], bool(rng.random() < 0.4)
    rows = np.zeros((count, body.n_shape))
    size = 10.0 ** rng.uniform(-1.5, 0.2)
    for k in range(1, int(rng.integers(2, 7))):
        turns = 2.0 * np.pi * k * (1.0 if closed else rng.uniform(0.5, 1.5))
        rows += (
            size
            * reach
            * rng.normal(size=body.n_shape)
            / k
            * np.sin(turns * phase + rng.uniform(0.0, 6.0, body.n_shape))
        )
    if rests := rng.random() < 0.2:
        rows *= np.clip((phase - 0.4) / 0.3, 0.0, 1.0) ** 2
    if wrong := rng.random() < 0.15:
        rows[int(rng.integers(1, count - 1))] += reach * 10.0 ** rng.uniform(-6.0, -1.0)
    rows += noise * reach * rng.normal(size=rows.shape)
    if rounded := rng.random() < 0.2:
        rows = np.round(rows, 6)
    if closed:
        rows[-1] = rows[0]
    path = sp.ShapePath.spline(times, rows, periodic=closed)
    said = {"closed": closed, "resting at times": rests, "one wrong": wrong, "rounded": rounded}
    extra = "".join(f", {name}" for name, holds in said.items() if holds)
    return Way(f"{count} rows, noise {noise:g}{extra}", path, (_whole(path),))


def _times(count: int, rng: np.random.Generator) -> np.ndarray:
    """Of samples, unevenly spaced [s]."""
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 1.0, count - 1))])
    return times / times[-1] * 10.0 ** rng.uniform(-1.0, 1.0)


def _terms(body: sp.Body, rng: np.random.Generator) -> Way:
    """A function of time: on every joint one smooth term, on some joints another one, narrow ones among them."""
    duration = 10.0 ** rng.uniform(-1.0, 1.0)
    rows, edges = [], []
    for joint in range(body.n_shape):
        for _ in range(1 + int(rng.random() < 0.2)):
            kind = (HARMONIC, GAUSSIAN, RAMP, BURST, BUMP)[rng.integers(5)]
            support = duration * _NARROWEST ** rng.beta(1.0, 2.0)
            centre = rng.uniform(0.5 * support, duration - 0.5 * support)
            width = support / (2.0 if kind == BUMP else _TAILS)
            swings = 2.0 * np.pi / (duration if kind == HARMONIC else support) * rng.uniform(0.3, 6.0)
            size = _reach(body)[joint] * 10.0 ** rng.uniform(-2.0, 0.0)
            rows.append((kind, joint, size, centre, width, swings, rng.uniform(0.0, 6.0)))
            if kind != HARMONIC:
                edges += [centre + share * support for share in (-0.5, -0.25, 0.0, 0.25, 0.5)]
    terms = Terms(body.n_shape, np.array(rows))
    path = sp.ShapePath.function(terms, duration)
    return Way("black box of terms", path, (_whole(path, terms, tuple(edges)),))


def _known_as_function(body: sp.Body, rng: np.random.Generator) -> Way:
    """A loop, a move or a spline, known only as a function with breaks."""
    way = (_loop, _move, _spline)[rng.integers(3)](body, rng)
    return Way(f"black box of a {way.what}", as_function(way.path), way.segments)


def _constant(body: sp.Body, rng: np.random.Generator) -> Way:
    """A body whose joints rest, said in three ways."""
    shape = rng.normal(size=body.n_shape) * _reach(body)
    duration = 10.0 ** rng.uniform(-1.0, 1.0)
    none = np.zeros((body.n_shape, 2))
    rows = np.array([(CONSTANT, joint, value, 0.0, 0.0, 0.0, 0.0) for joint, value in enumerate(shape)])
    terms = Terms(body.n_shape, rows)
    path = (
        lambda: sp.ShapePath.fourier(shape, none, none, duration),
        lambda: sp.ShapePath.waypoints([0.0, duration], [shape, shape]),
        lambda: sp.ShapePath.function(terms, duration),
    )[rng.integers(3)]()
    return Way("constant shape", path, (_whole(path, terms),))


def _joined(body: sp.Body, rng: np.random.Generator) -> Way:
    """Two or three paths one after another, the later ones from where the one before ended."""
    way = _SIMPLE[rng.integers(len(_SIMPLE))](body, rng)
    for _ in range(int(rng.integers(1, 3))):
        count = int(rng.integers(2, 12))
        points = rng.normal(size=(count, body.n_shape)) * 0.3 * _reach(body)
        points[0] = way.path.shape(way.path.duration)
        make = sp.ShapePath.spline if count > 3 and rng.random() < 0.5 else sp.ShapePath.waypoints
        path = make(_times(count, rng), points)
        following = as_function(path) if rng.random() < 0.3 else path
        way = Way(f"{way.what}, then {count} points", way.path.then(following), (*way.segments, _whole(path)))
    return way


def _repeated(body: sp.Body, rng: np.random.Generator) -> Way:
    """A loop up to hundreds of times."""
    way = _loop(body, rng)
    if rng.random() < 0.3:
        way = Way(f"black box of a {way.what}", as_function(way.path), way.segments)
    # [joints] Bodies of many joints are followed in extended precision for few loops only.
    most = min(_MOST_LOOPS, 2000 / (len(body.chain.names) + 1))
    count = int(np.exp(rng.uniform(np.log(2.0), np.log(most))))
    return Way(f"{way.what}, {count} times", way.path.repeated(count), way.segments * count)


def _reversed(body: sp.Body, rng: np.random.Generator) -> Way:
    """Backwards, and more slowly."""
    way = _SIMPLE[rng.integers(len(_SIMPLE))](body, rng)
    (segment,), factor = way.segments, float(10.0 ** rng.uniform(-1.0, 1.0))
    if rng.random() < 0.5:
        breaks = segment.duration - segment.breaks[::-1]
        back = replace(segment, breaks=breaks, origin=segment.duration, pace=-1.0)
        return Way(f"{way.what}, reversed", way.path.reversed(), (back,))
    slow = replace(segment, breaks=segment.breaks * factor, duration=segment.duration * factor, pace=1.0 / factor)
    return Way(f"{way.what}, stretched", way.path.stretched(factor), (slow,))


_SIMPLE = (_loop, _move, _spline, _terms)
_KINDS: tuple[Callable[[sp.Body, np.random.Generator], Way], ...] = (
    _loop, _move, _spline, _terms, _known_as_function, _constant, _joined, _repeated, _reversed,
)  # fmt: skip
_SHARES = (0.15, 0.1, 0.15, 0.2, 0.1, 0.03, 0.1, 0.1, 0.07)
