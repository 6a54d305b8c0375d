"""Hypotheses about the surroundings: the air slows a body, by forces against the velocities, or gravity is wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import cumulative_trapezoid

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..body.link_motions import link_motions
from ..shape_space.free_fall import GRAVITY
from ._observation import Observation
from ._residuals import Residuals, fitted_hypothesis, leftover, step_drift
from .audit_result import RunAudit
from .hypothesis import FittedValue, Hypothesis

_HIGHEST = 8  # order of the polynomials whose slope is the velocity, the samples allowing
_SAMPLES_EACH = 6  # samples that a polynomial needs
_STEPS = 12  # of Gauss and Newton, for the arm multiplies the force
_ENOUGH = 1e-9  # relative change of what is left below which the fit ends
_UNITS = {"linear": "N s/m", "quadratic": "N s^2/m^2", "density": "kg/m^3", "viscosity": "Pa s", "turn": "N m s"}
_AXES = "xyz"
_ELSEWHERE = 0.005  # of gravity: on earth it is 9.78 to 9.83 m/s^2
_BARS = 4.0  # standard deviations by which it has to be off
_OF_A_PARABOLA = 720.0  # variance of the acceleration of a parabola over T, of N samples of variance one: 720 / (N T^4)
_SAG = 8.0  # acceleration of a parabola over T whose middle is off its chord by s: 8 s / T^2


@dataclass(frozen=True, eq=False)
class _Flight:
    """A run with the velocity of its centre of mass, world axes: (N, 3) [m/s]."""

    fit: Residuals
    velocity: Array

    def columns(self, torque: Array, force: Array) -> Array:
        """Change of the residuals, (M, k), by torques about the centre of mass and forces (N, 3, k), world axes."""
        times = self.fit.seen.times
        momentum, speed = (cumulative_trapezoid(push, times, axis=0, initial=0.0) for push in (torque, force))
        return self.fit.columns(momentum, cumulative_trapezoid(speed, times, axis=0, initial=0.0) / self.fit.seen.mass)


def drag(body: Body, fits: Sequence[Residuals]) -> list[Hypothesis]:
    """The law that explains most; empty where places are unknown, or where every law would speed the body up.

    Either of the whole body: a force -c v - k |v| v at a point fixed to the centre of mass or to the base, and a
    torque -d omega with the rate of the base. Or of each link: density and viscosity of a fluid that acts on the box of
    uniform density that has the link's mass and inertia.
    """
    if any(fit.seen.centre is None for fit in fits):
        return []
    flights = [_Flight(fit, _velocity(fit)) for fit in fits]
    laws = [*_of_whole_body(flights), *_of_links(body, flights)]
    return sorted(laws, key=lambda law: (round(law.leftover.size, 1) if law.leftover else 0.0, law.parameters))[:1]


def _velocity(fit: Residuals) -> Array:
    seen = fit.seen
    assert seen.centre is not None
    half = 0.5 * float(seen.times[-1] - seen.times[0])
    since = (seen.times - seen.times[0]) / half - 1.0
    highest = max(2, min(_HIGHEST, len(since) // _SAMPLES_EACH))
    return legendre.legval(since, legendre.legder(legendre.legfit(since, seen.centre, highest))).T / half


def _of_whole_body(flights: Sequence[_Flight]) -> Iterator[Hypothesis]:
    laws_of_force = (("quadratic",), ("linear",), ("linear", "quadratic"))
    for laws, turn, point in product(laws_of_force, ((), ("turn",)), ("centre of mass", "origin of the base")):
        names = (*laws, *turn)
        vector = np.concatenate([flight.fit.vector for flight in flights])
        numbers = np.zeros(len(names) + 3)
        matrix, made = _all_by_numbers(flights, laws, turn, point, numbers)
        for _ in range(_STEPS):
            before = vector - made
            numbers = numbers + np.linalg.lstsq(matrix, before, rcond=None)[0]
            matrix, made = _all_by_numbers(flights, laws, turn, point, numbers)
            left = vector - made
            if abs(before @ before - left @ left) <= _ENOUGH * (left @ left):
                break
        if np.all(numbers[: len(names)] > 0.0):
            remark = f"of the whole body, centre of pressure from the {point}"
            yield _hypothesis(flights, matrix, vector - made, names, numbers, remark)


def _all_by_numbers(
    flights: Sequence[_Flight], laws: Sequence[str], turn: Sequence[str], point: str, numbers: Array
) -> tuple[Array, Array]:
    """The results of `_by_numbers`, of all runs below each other."""
    parts = [_by_numbers(flight, laws, turn, point, numbers) for flight in flights]
    return np.vstack([columns for columns, _ in parts]), np.concatenate([made for _, made in parts])


def _by_numbers(
    flight: _Flight, laws: Sequence[str], turn: Sequence[str], point: str, numbers: Array
) -> tuple[Array, Array]:
    """Derivatives of the residuals by each number, (M, k), and their change by all of them, (M,)."""
    seen, count = flight.fit.seen, len(laws)
    speed = np.linalg.norm(flight.velocity, axis=1, keepdims=True)
    forces = np.stack([-flight.velocity * (speed if law == "quadratic" else 1.0) for law in laws], axis=2)
    arm, force = seen.attitude @ numbers[-3:], forces @ numbers[:count]
    if point != "centre of mass":
        assert seen.trajectory.position is not None
        assert seen.centre is not None
        arm = arm + seen.trajectory.position - seen.centre
    slowing = [-so3.apply(seen.attitude, seen.rate)[:, :, None] for _ in turn]
    torques = np.concatenate(
        [np.cross(arm[:, :, None], forces, axis=1), *slowing, np.cross(seen.attitude, force[:, :, None], axis=1)],
        axis=2,
    )
    nothing = np.zeros((len(force), 3, torques.shape[2] - count))
    columns = flight.columns(torques, np.concatenate([forces, nothing], axis=2))
    return columns, columns[:, :-3] @ numbers[:-3]


def _of_links(body: Body, flights: Sequence[_Flight]) -> Iterator[Hypothesis]:
    vector = np.concatenate([flight.fit.vector for flight in flights])
    matrix = np.vstack([_by_fluid(body, flight) for flight in flights])
    for kept in ([0], [1], [0, 1]):
        numbers = np.asarray(np.linalg.lstsq(matrix[:, kept], vector, rcond=None)[0], dtype=np.float64)
        left = vector - matrix[:, kept] @ numbers
        if np.all(numbers > 0.0):
            names = [("density", "viscosity")[place] for place in kept]
            yield _hypothesis(flights, matrix[:, kept], left, names, numbers, "of a fluid on each link")


def _by_fluid(body: Body, flight: _Flight) -> Array:
    """Change of the residuals by a fluid of unit density, and of unit viscosity: (M, 2).

    Source: MuJoCo's documentation, Computation, Fluid forces, Inertia model.
    """
    seen, chain = flight.fit.seen, body.chain
    links = link_motions(chain, seen.trajectory.shapes, seen.joint_rates)
    forces, torques = np.zeros((2, len(seen.times), 3, 2))
    velocity = so3.apply(so3.transpose(seen.attitude), flight.velocity)
    for frame, (mass, inertia) in enumerate(zip(chain.masses.tolist(), chain.inertias, strict=True)):
        moments, axes = np.linalg.eigh(inertia)
        squares = 6.0 * (0.5 * moments.sum() - moments) * 2.0
        if mass <= 0.0 or squares.max() <= 0.0:
            continue
        # Sides of the box: (a, b, c) with m (b^2 + c^2) / 12 about the first.
        sides = np.sqrt(np.maximum(squares, 0.0) / mass)
        turn, place = links.turns[:, frame] @ axes, links.places[:, frame]
        spin = np.einsum("nji,nj->ni", turn, seen.rate + links.spins[:, frame])
        speed = velocity + so3.cross(seen.rate, place) + links.speeds[:, frame]
        speed = np.einsum("nji,nj->ni", turn, speed)
        across, beside = np.roll(sides, -1), np.roll(sides, -2)
        mean = float(sides.mean())
        pushes = [-0.5 * across * beside * np.abs(speed) * speed, -3.0 * np.pi * mean * speed]
        twists = [-sides * (across**4 + beside**4) / 64.0 * np.abs(spin) * spin, -np.pi * mean**3 * spin]
        for k, (push, twist) in enumerate(zip(pushes, twists, strict=True)):
            force = so3.apply(turn, push)
            forces[:, :, k] += force
            torques[:, :, k] += so3.cross(place, force) + so3.apply(turn, twist)
    return flight.columns(seen.attitude @ torques, seen.attitude @ forces)


def _hypothesis(
    flights: Sequence[_Flight], matrix: Array, left: Array, names: Sequence[str], numbers: Array, remark: str
) -> Hypothesis:
    bars = np.sqrt(np.diag(np.linalg.pinv(matrix.T @ matrix)))
    labels = [(name, _UNITS[name]) for name in names]
    labels += [(f"centre of pressure {axis}", "m") for axis in _AXES[: len(numbers) - len(names)]]
    return fitted_hypothesis(
        "drag of the air",
        "drag",
        leftover([flight.fit for flight in flights], left),
        parameters=len(numbers),
        values={
            name: FittedValue(value=float(value), bar=float(bar), unit=unit)
            for (name, unit), value, bar in zip(labels, numbers, bars, strict=True)
        },
        remark=remark,
    )


def wrong_gravity(
    body: Body, seen: Sequence[Observation], runs: Sequence[RunAudit], wander: float, steps: Sequence[float]
) -> Hypothesis | None:
    """None where every fall is that on earth with x, y or z up, of a recording also down, or none, as in orbit.

    runs : results of the same trajectories
    wander : of the centre of mass of those that are recordings [m]
    steps : of semi-implicit Euler, whose drift of the centre of mass is taken off [s]
    """
    for sampled, run, step in zip(seen, runs, steps, strict=True):
        if sampled.centre is None or sampled.centre_noise is None or run.fall_off is None:
            continue
        off = max(run.fall_off, wander if run.recorded else 0.0)
        drift = step_drift(body, sampled, None).centre if step else None
        centre = sampled.centre if drift is None else sampled.centre - step * drift
        pull, bar = _fall(sampled.times, centre, sampled.centre_noise, off)
        by_step = pull - _fall(sampled.times, sampled.centre, sampled.centre_noise, off)[0]
        size, axis = float(np.linalg.norm(pull)), int(np.argmax(np.abs(pull)))
        # What a step adds is known as well as the rates are, whose frame may be wrong.
        allowed = _ELSEWHERE * GRAVITY + _BARS * bar + float(np.linalg.norm(by_step))
        expected = np.zeros(3)
        expected[axis] = np.copysign(GRAVITY, pull[axis]) if run.recorded else -GRAVITY
        if size > allowed and np.linalg.norm(pull - expected) > allowed:
            tilt = float(np.degrees(np.arccos(min(abs(pull[axis]) / size, 1.0))))
            return Hypothesis(
                name="gravity",
                kind="gravity",
                square=0.0,
                left_over=0.0,
                parameters=3,
                share=0.0,
                values={
                    "size": FittedValue(value=size, bar=bar, unit="m/s^2"),
                    "tilt": FittedValue(value=tilt, bar=float(np.degrees(bar / size)), unit="deg"),
                },
                remark=f"{run.name} falls towards {'-' if pull[axis] < 0.0 else '+'}{_AXES[axis]}; expected "
                f"{GRAVITY:.4g} m/s^2 along an axis of the world with x, y or z up, or no weight",
            )
    return None


def _fall(times: Array, centres: Array, covariances: Array, off: float) -> tuple[Array, float]:
    """Acceleration (3,), and its standard deviation by noise and by how far the centre of mass may be off [m/s^2]."""
    span = float(times[-1] - times[0])
    pull = 2.0 * np.linalg.lstsq(np.vander((times - times[0]) / span, 3), centres, rcond=None)[0][0]
    variance = float(np.trace(covariances, axis1=1, axis2=2).mean()) / 3.0
    bar = float(np.hypot(np.sqrt(_OF_A_PARABOLA * variance / len(times)), _SAG * off))
    return pull / span**2, bar / span**2
