"""Least squares of Gauss and Newton between a reconstructed flight and recorded attitudes and rates of its base."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import NamedTuple, Self

import numpy as np

from .. import so3
from ..arrays import Array
from ..deformation.deformation import Deformation
from ..errors import AccuracyNotReached
from ..inertia_tensor import inverse_inertia
from ..reconstruction.reconstruction import Motion, reconstruct
from ._along_motion import legendre, responses
from ._residual_noise import most_modes

_MOST_ROUNDS = 40  # of Gauss and Newton; a flight of many turns takes ten
_ENOUGH_ROUNDS = 12  # after which a recording far from any flight of the body is refused
_SMALL_STEP = 1e-3  # of the standard deviations of the fit: a smaller step is the last
_NO_STEP = 1e-11  # [rad], and of the momentum: the last step without noise
_MOST_HALVINGS = 12  # of a step that leads away from the recording
UNKNOWNS = 6  # turn of the start and momentum
_SAME_AXES = 0.2  # [rad] between equal candidates for the axes
_MOST_LIKELY = 4  # candidates for the axes that are fitted
_ROUGH_ROUNDS = 15  # of least squares for a candidate
_VAGUE_AXES = 0.3  # [rad] uncertainty of axes that the recording leaves open
_FIRST_TIMES = 6  # attitudes that are fitted first, or up to twice as many
_NO_FLIGHT = 0.5  # [rad] rms from every motion of the body, beyond which a recording is none of its flights
_WINDOW = 0.3  # [rad] turns by which readings are compared: 0.5 deg of noise at both ends are 4 % of it


class State(NamedTuple):
    """A motion, axes (3, 3) from base axes to those recorded, and the bias of recorded rates (3,) [rad/s]."""

    motion: Motion
    axes: Array
    bias: Array


class Fitted(NamedTuple):
    """The nearest state; what is left, (K, 3), and its slopes, (3 K, m), attitudes before weighed rates."""

    state: State
    residuals: Array
    slopes: Array

    @property
    def motion(self) -> Motion:
        """The nearest motion."""
        return self.state.motion


def flight_fitted(least: FlightFit, *, find_axes: bool) -> Fitted:
    """The nearest flight; raises AccuracyNotReached where none is near."""
    fit = _with_axes(least) if find_axes else from_few(least, np.eye(3))
    check_near(fit.residuals, least)
    return fit


def from_few(least: FlightFit, axes: Array) -> Fitted:
    """Fit to the first few times, then to more and more, so that a wrong momentum never loses count of turns."""
    half = len(least.times) // 2
    if half < _FIRST_TIMES:
        return least.settled(least.first_state(axes))
    first = least.up_to(half)
    before = from_few(first, axes)
    check_near(before.residuals, first)
    return least.settled(before.state)


def _momenta(deformation: Deformation, times: Array, recorded: Array) -> Array:
    """Momenta by the turns between neighbouring attitudes: (N - 1, 3)."""
    middle = 0.5 * (times[1:] + times[:-1])
    turns = so3.log(so3.transpose(recorded[:-1]) @ recorded[1:])
    rates = turns / np.diff(times)[:, None]
    inertia, internal = deformation.description.sample(middle)
    seen = recorded[:-1] @ so3.exp(0.5 * turns)
    return so3.apply(seen, so3.apply(inertia, rates) + internal)


def _with_axes(least: FlightFit) -> Fitted:
    """The nearest fit from each of the likely axes, of which a nearly symmetric body has several."""
    assert least.recorded is not None
    fits, vague = [], False
    free = replace(least, find_axes=True)
    for axes in _likely_axes(least.deformation, least.times, least.recorded):
        # From unlikely axes a fit may wander about.
        with suppress(AccuracyNotReached):
            near = from_few(least, axes)
            if free.leaves_open(near, _VAGUE_AXES):
                vague = True
                continue
            fits.append(free.settled(near.state))
    if vague and not fits:
        raise AccuracyNotReached("the flight leaves the axes of the base open; give them: base_axes (--base-axes)")
    if not fits:
        raise AccuracyNotReached("with no axes of the base the recording comes near to a free flight of this body")
    return min(fits, key=lambda fit: size(fit.residuals))


def _likely_axes(deformation: Deformation, times: Array, recorded: Array) -> list[Array]:
    """The axes with which the momentum stays most constant, best first: near the 24 ways along the base's axes."""
    from scipy.optimize import least_squares

    def wander(turn: Array, about: Array) -> Array:
        momenta = _momenta(deformation, times, recorded @ about @ so3.exp(turn))
        return ((momenta - momenta.mean(axis=0)) / np.sqrt((momenta**2).sum(axis=1).mean())).ravel()

    candidates: list[tuple[float, Array]] = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            axes = np.eye(3)[:, order] * signs
            if np.linalg.det(axes) > 0.0:
                near = least_squares(wander, np.zeros(3), args=(axes,), max_nfev=_ROUGH_ROUNDS)
                candidates.append((float(near.cost), axes @ so3.exp(near.x)))
    kept: list[Array] = []
    for _, axes in sorted(candidates, key=lambda candidate: candidate[0]):
        if all(so3.angle(so3.transpose(axes) @ other) > _SAME_AXES for other in kept):
            kept.append(axes)
    return kept[:_MOST_LIKELY]


@dataclass(frozen=True, eq=False)
class FlightFit:
    """Least squares over momentum and start, and the axes or the bias where they are to be found.

    deformation, tolerance, find_axes, find_bias : as given
    times : (N,)
    recorded, rates : (N, 3, 3) and (N, 3) what is fitted, or None
    weight : of the rates [rad for each rad/s]; the inverse of their size where there are no attitudes
    start : (3, 3) attitude at the start, where there are no attitudes
    """

    deformation: Deformation
    times: Array
    recorded: Array | None
    tolerance: float
    find_axes: bool = False
    rates: Array | None = None
    weight: float = 1.0
    start: Array | None = None
    find_bias: bool = False

    def up_to(self, count: int) -> Self:
        """The problem of the first times."""
        recorded, rates = (None if part is None else part[:count] for part in (self.recorded, self.rates))
        return replace(self, times=self.times[:count], recorded=recorded, rates=rates)

    def settled(self, state: State) -> Fitted:
        """Fit by steps of Gauss and Newton from a state, halved where they go too far."""
        residuals = self._residuals(state)
        for number in range(_MOST_ROUNDS):
            if number == _ENOUGH_ROUNDS:
                check_near(residuals, self)
            slopes = self._slopes(state.motion)
            step = np.asarray(np.linalg.lstsq(slopes, residuals.ravel(), rcond=None)[0], dtype=np.float64)
            if self._is_small(step, slopes, state.motion, residuals):
                return Fitted(state, residuals, slopes)
            state, residuals = self._nearer(state, step, float((residuals**2).sum()))
        raise AccuracyNotReached(f"the momentum did not settle within {_MOST_ROUNDS} rounds; {_apart(residuals, self)}")

    def leaves_open(self, near: Fitted, most: float) -> bool:
        """True where the recording allows other axes or biases, farther off than `most`, by a fit to given ones."""
        slopes = self._slopes(near.motion)
        # A change that start and momentum undo.
        ours, others = slopes[:, -3:], slopes[:, :-3]
        alone = ours - others @ np.linalg.lstsq(others, ours, rcond=None)[0]
        weakest = float(np.linalg.svd(alone, compute_uv=False)[-1])
        return max(size(near.residuals), self.tolerance) > most * weakest

    def first_state(self, axes: Array) -> State:
        """Motion with the mean of the momenta by neighbouring attitudes, or by rates and the turns they make."""
        if self.recorded is not None:
            momenta, start = _momenta(self.deformation, self.times, self.recorded @ axes), self.recorded[0] @ axes
        else:
            assert self.rates is not None
            assert self.start is not None
            start, inertia, internal = self.start, *self.deformation.description.sample(self.times)
            turns = [start]
            for turn in so3.exp(0.5 * (self.rates[1:] + self.rates[:-1]) * np.diff(self.times)[:, None]):
                turns.append(turns[-1] @ turn)
            momenta = so3.apply(np.array(turns), so3.apply(inertia, self.rates) + internal)
        return State(self._reconstructed(momenta.mean(axis=0), start), axes, np.zeros(3))

    def wander(self) -> float:
        """Scatter of the momenta by turns of the attitudes, relative to them."""
        assert self.recorded is not None
        stride, known = 1, self.recorded
        while 4 * stride < len(known):
            if np.median(so3.angle(so3.transpose(known[:-stride]) @ known[stride:])) > _WINDOW:
                break
            stride *= 2
        momenta = _momenta(self.deformation, self.times[::stride], known[::stride])
        return size(momenta - momenta.mean(axis=0)) / (size(momenta) or 1.0)

    def rates_by_turns(self, motion: Motion) -> Array:
        """Change of the rates by turns of the attitude, both in base axes: (N, 3, 3) [1/s]."""
        inertia, _ = self.deformation.description.sample(self.times)
        return inverse_inertia(inertia) @ so3.hat(motion.momentum @ motion.attitude(self.times))

    def slopes_by_modes(self, motion: Motion) -> Array:
        """Change of the first recorded quantity by a momentum that changes as Legendre polynomials: (3 N, 3 K)."""
        modes = most_modes(len(self.times))
        slopes = self._slopes(motion, modes)[: 3 * len(self.times)]
        return slopes[:, slopes.shape[1] - 3 * modes :]

    def _slopes(self, motion: Motion, modes: int = 0) -> Array:
        """The change of all that is fitted by start, momentum and, backwards, axes, or bias, and by modes."""
        count, attitudes = len(self.times), so3.transpose(motion.attitude(self.times))
        turns = responses(motion, self.times, modes)
        turns[:, :, :3] = turns[:, :, :3] @ motion.initial_attitude
        turned = attitudes @ turns
        blocks = []
        if self.recorded is not None:
            extra = np.tile(-np.eye(3) if self.find_axes else np.zeros((3, 3)), (count, 1, 1))
            blocks.append((turned, extra))
        if self.rates is not None:
            inertia, _ = self.deformation.description.sample(self.times)
            added = np.zeros_like(turned)
            polynomials = legendre(self.times, self.times, modes)
            added[:, :, 3:] = np.einsum("nij,nk->nikj", attitudes, polynomials).reshape(count, 3, -1)
            by_momentum = self.rates_by_turns(motion) @ turned + inverse_inertia(inertia) @ added
            blocks.append((self.weight * by_momentum, np.tile(self.weight * np.eye(3), (count, 1, 1))))
        first = 3 if self.recorded is None else 0
        rows = []
        for by_state, extra in blocks:
            parts = [by_state[:, :, first:UNKNOWNS], *([extra] if self.find_axes or self.find_bias else [])]
            rows.append(np.concatenate([*parts, by_state[:, :, UNKNOWNS:]], axis=2))
        whole = np.concatenate(rows)
        return whole.reshape(3 * len(whole), -1)

    def _nearer(self, state: State, step: Array, before: float) -> tuple[State, Array]:
        trial, residuals = state, np.empty(0)
        if self.recorded is None:
            step = np.append(np.zeros(3), step)
        for halving in range(_MOST_HALVINGS):
            change = step * 0.5**halving
            start, extra = state.motion.initial_attitude @ so3.exp(change[:3]), change[UNKNOWNS:]
            trial = State(
                self._reconstructed(state.motion.momentum + change[3:UNKNOWNS], start),
                state.axes @ so3.exp(extra) if self.find_axes else state.axes,
                state.bias + extra if self.find_bias else state.bias,
            )
            residuals = self._residuals(trial)
            if (residuals**2).sum() <= before:
                break
        return trial, residuals

    def _is_small(self, step: Array, slopes: Array, motion: Motion, residuals: Array) -> bool:
        """True where a step is far below the uncertainty of the fit, or rounding."""
        unknowns = slopes.shape[1]
        by_unit = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
        noise = float(np.sqrt((residuals**2).sum() / (residuals.size - unknowns)))
        floor = np.full(unknowns, _NO_STEP)
        first = 0 if self.recorded is None else 3
        floor[first : first + 3] *= float(np.linalg.norm(motion.momentum))
        # The tolerance of the reconstruction also bounds the last step.
        return bool(np.all(np.abs(step) <= (_SMALL_STEP * noise + self.tolerance) * by_unit + floor))

    def _reconstructed(self, momentum: Array, attitude: Array) -> Motion:
        return reconstruct(self.deformation, momentum, attitude, tolerance=self.tolerance)

    def _residuals(self, state: State) -> Array:
        rows = []
        if self.recorded is not None:
            rows.append(so3.log(so3.transpose(state.motion.attitude(self.times)) @ self.recorded @ state.axes))
        if self.rates is not None:
            rows.append(self.weight * (self.rates - state.motion.angular_velocity(self.times) - state.bias))
        return np.concatenate(rows)


def size(vectors: Array) -> float:
    """Root mean square of the lengths."""
    return float(np.sqrt((vectors**2).sum(axis=1).mean()))


def check_near(residuals: Array, least: FlightFit) -> None:
    """Raise AccuracyNotReached where residuals are too large for noise."""
    if size(residuals) > _NO_FLIGHT:
        times = least.times
        raise AccuracyNotReached(
            f"{_apart(residuals, least)} from {times[0]:.6g} to {times[-1]:.6g} s: no free flight of this body, or the "
            "axes that were recorded are not those of its base"
        )


def _apart(residuals: Array, least: FlightFit) -> str:
    """Distance from reconstruction to recording, in words."""
    count, spread = len(least.times), size(residuals)
    if least.recorded is None:
        return f"the reconstruction stays {100.0 * spread:.3g} % (rms) from {count} rates"
    return f"the reconstruction stays {np.degrees(spread):.3g} degrees (rms) from {count} attitudes"
