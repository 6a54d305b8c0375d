"""The problem that all planners get, in plain numbers, and what a path that one of them found comes to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import shapephase as sp
from shapephase import so3
from shapephase.optimal_control import Limits, path_cost

from ..plans import beyond

SMALL = 0.2
"""[rad or m] of the first guess's loop."""


@dataclass(frozen=True)
class Turn:
    """From rest to rest in one posture at the least integral of kinetic energy, without momentum, within limits.

    Attributes
    ----------
    goal : (3, 3) attitude at the end; the identity at the start
    duration : [s]
    nodes : intervals of the transcriptions
    seconds : of processor time, at most, for the solver
    """

    body: sp.Body
    goal: np.ndarray
    duration: float
    nodes: int
    seconds: float

    @property
    def step(self) -> float:
        return self.duration / self.nodes

    @property
    def rates(self) -> np.ndarray:
        """(n,) the largest [rad/s or m/s]."""
        return self.body.rate_limits

    def first_guess(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Shapes, rates and accelerations (N, n) of a small random loop at parts of the duration, from rest to rest.

        Nearly the same for all: the planners differ in their nodes only.
        """
        rng, n = np.random.default_rng(0), self.body.n_shape
        begin, room = self.body.shape(), self.body.joint_limits.T
        sines, cosines = SMALL * rng.normal(size=(2, n))
        phase = 2.0 * np.pi * places[:, None]
        pace = 2.0 * np.pi / self.duration
        # Zero with its slope at both ends.
        swell, slope, bend = 0.5 - 0.5 * np.cos(phase), 0.5 * np.sin(phase), 0.5 * np.cos(phase)
        wave = sines * np.sin(phase) + cosines * np.cos(phase)
        along = sines * np.cos(phase) - cosines * np.sin(phase)
        shapes = begin + swell * wave
        rates = pace * (slope * wave + swell * along)
        accelerations = pace**2 * (bend * wave + 2.0 * slope * along - swell * wave)
        inside = (shapes >= room[0]) & (shapes <= room[1])
        return np.clip(shapes, *room), np.where(inside, rates, 0.0), np.where(inside, accelerations, 0.0)

    def path(self, pieces: np.ndarray) -> sp.ShapePath:
        """The path of the polynomials (nodes, n, degree + 1) of the time after each node, constant terms first."""
        powers = np.arange(pieces.shape[-1])
        slopes = (powers * pieces)[..., 1:]

        def at(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            node = np.clip((times / self.step).astype(int), 0, len(pieces) - 1)
            after = (times - node * self.step)[:, None, None] ** powers
            return (pieces[node] * after).sum(axis=-1), (slopes[node] * after[..., :-1]).sum(axis=-1)

        breaks = self.step * np.arange(1, len(pieces))
        return sp.ShapePath.function(at, self.duration, breaks=breaks, joint_names=self.body.joint_names)

    def judged(self, path: sp.ShapePath) -> dict[str, float]:
        """Cost, miss of the true motion, and by how much the path misses its ends and its limits."""
        motion = sp.reconstruct(sp.articulated(self.body, path), [0.0, 0.0, 0.0])
        ends = np.array([0.0, self.duration])
        return {
            "cost": path_cost(self.body, path),
            "miss": float(so3.angle(self.goal.T @ motion.final_attitude)),
            "off": float(np.abs(path.shape(ends) - self.body.shape()).max()),
            "moves": float(np.abs(path.rate(ends)).max()),
            "beyond": beyond(self.body, path, Limits(rate_limits=self.rates)),
        }


def joints_of(body: sp.Body) -> list[str]:
    """The joints of `plain_urdf` in the order of the shape, of a body whose joints are all hinges or sliders."""
    joints, model = body._joints, body._model
    if body.ball_joints or body.continuous.any() or not joints.follows.is_identity:
        raise SystemExit(f"{body.name} has joints that turn without end, follow others or are balls")
    number = {int(column): joint for joint, column in enumerate(model.idx_vs) if joint > 1}
    return [f"joint{number[6 + int(column)]}" for column in joints._velocity_index]


def hermite(shapes: np.ndarray, rates: np.ndarray, step: float) -> np.ndarray:
    """(N, n, 4): the cubics through N + 1 nodes with these rates."""
    run = shapes[1:] - shapes[:-1]
    square = (3.0 * run / step - 2.0 * rates[:-1] - rates[1:]) / step
    cube = (rates[:-1] + rates[1:] - 2.0 * run / step) / step**2
    return np.stack([shapes[:-1], rates[:-1], square, cube], axis=-1)
