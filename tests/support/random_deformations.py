"""Random smooth deformations with a momentum, of every kind the library knows, for the bounds that must always hold."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

import shapephase as sp

KINDS = (
    "diagonal",
    "diagonal, internal momentum",
    "turned frame",
    "turned frame, internal momentum",
    "growing antenna",
    "slow",
    "circling",
    "circling, internal momentum",
    "turning axes",
    "particles",
    "cat",
)


def random_case(seed):
    """A kind, a deformation, and a momentum (3,): the same for the same seed."""
    rng = np.random.default_rng([2006, seed])
    kind = KINDS[seed % len(KINDS)]
    duration = float(rng.uniform(0.5, 4.0))
    if kind == "cat":
        return kind, sp.articulated(_cat(), _cat_loop(rng, duration)), _vector(rng, rng.uniform(0.3, 3.0) * 0.02)
    size = float(np.exp(rng.uniform(-1.0, 2.0)))
    if kind == "particles":
        masses = rng.uniform(0.2, 2.0, int(rng.integers(4, 8)))
        swings = 0.25 * rng.uniform(-1.0, 1.0, (2, len(masses), 3))
        places = rng.normal(size=(len(masses), 3))
        rate = 2.0 * np.pi / duration
        deformation = sp.particles(
            masses,
            lambda t: (
                places
                + np.multiply.outer(np.sin(rate * t), swings[0])
                + np.multiply.outer(np.cos(rate * t), swings[1]),
                rate
                * (np.multiply.outer(np.cos(rate * t), swings[0]) - np.multiply.outer(np.sin(rate * t), swings[1])),
            ),
            duration,
        )
        return kind, deformation, _vector(rng, 3.0 * size)
    moments = _moments(kind, rng, duration)
    frame = np.eye(3) if kind in ("diagonal", "diagonal, internal momentum", "slow") else _rotation(rng)
    axis = rng.normal(size=3) * 0.3
    start, stir = _vector(rng, size), 0.3
    if "circling" in kind:
        # Near the axis of the smallest or of the largest moment, fast enough for some turns round it.
        chosen = frame[:, [np.argmin, np.argmax][seed % 2](moments(np.zeros(1))[0])]
        start, stir = 20.0 / duration * (chosen + 0.3 * _vector(rng, 1.0)), 0.002

    def inertia(t):
        columns = np.broadcast_to(frame, (len(t), 3, 3))
        if kind == "turning axes":
            columns = Rotation.from_rotvec(np.multiply.outer(np.sin(2.0 * t / duration), axis)).as_matrix() @ columns
        return np.einsum("nij,nj,nkj->nik", columns, moments(t), columns)

    internal = None
    if "internal" in kind or kind == "turning axes":
        waves, phases = stir * size * rng.uniform(-1.0, 1.0, 3), rng.uniform(0.0, 6.0, 3)

        def internal(t):
            return waves * np.sin(2.0 * np.pi * t[:, None] / duration + phases)

    return kind, sp.prescribed(inertia, internal, duration), start


def _moments(kind, rng, duration):
    """Principal moments in time that keep the triangle inequality: those of positive second moments of mass."""
    base = np.sort(rng.uniform(0.2, 1.5, 3))[::-1]
    depth = rng.uniform(0.0, 0.02 if kind == "slow" or "circling" in kind else 0.35, 3)
    pace, phases = rng.integers(1, 4, 3), rng.uniform(0.0, 6.0, 3)

    def second(t):
        if kind == "growing antenna":
            # Mass that moves out along the axes 1 and 2 alike makes the third moment grow most.
            return base * (1.0 + np.multiply.outer(t / duration, depth * np.array([1.0, 1.0, 0.0])))
        return base * (1.0 + depth * np.sin(2.0 * np.pi * pace * t[:, None] / duration + phases))

    return lambda t: second(t).sum(axis=1, keepdims=True) - second(t)


@lru_cache(maxsize=1)
def _cat():
    return sp.load_body("cat_two_halves")


def _cat_loop(rng, duration):
    decay = rng.uniform(0.1, 0.5) / np.arange(1, 4)
    mean = rng.uniform(-0.3, 0.3, _cat().n_shape)
    cosines, sines = decay * rng.uniform(-1.0, 1.0, (2, len(mean), 3))
    return sp.ShapePath.fourier(mean, cosines, sines, duration)


def _rotation(rng):
    return Rotation.random(rng=rng).as_matrix()


def _vector(rng, size):
    direction = rng.normal(size=3)
    return size * direction / np.linalg.norm(direction)
