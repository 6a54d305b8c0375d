"""Angular momenta of links at the times of a motion or a recording, with derivatives by what has noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..body.joint_chain import JointChain
from ..body.link_motions import link_motions
from ..dynamics.moving_body import moving_body, needed_body_and_path
from ..errors import TrajectoryError
from ..inertia_tensor import inverse_inertia
from ..reconstruction.reconstruction import Motion
from ..shape_space.files.smoothing import smoothed_path
from ..shape_space.interpolation import neighbours_signs
from ..shape_space.path_noise import path_errors, stated_noise, summed_errors, white_noise
from ..shape_space.shape_path import ShapePath

_FEWEST = 8  # samples: fewer do not separate a motion from its noise
_STEP = 1e-6  # [rad or m] of differences of momenta, which are smooth over a radian: bars keep five digits
_ROUNDING = 32.0 * float(np.finfo(np.float64).eps)  # of the links' momenta: rounding of 32 operations
_AT_ONCE = 256  # times whose derivatives are in memory together
_TRUNCATION = 0.5  # of what a spline through every second sample differs by: at the ends a third was measured
_LINE = 10.0  # noise levels over the whole time: three of them rms, which is motion
_QUATERNION = 4  # columns of the base, before those of the joints
_BASE = tuple(f"base.{part}" for part in "xyzw")  # the names make a ball joint of it, whose columns smooth alike


class Directions(NamedTuple):
    """Axes along which momenta are taken.

    names : C names
    axes : (C, 3) unit vectors
    with_base : (C,) True for those that are fixed to the base, in base axes; the others are inertial
    """

    names: tuple[str, ...]
    axes: Array
    with_base: Any

    def at(self, attitude: Array) -> Array:
        """Inertial axes: (N, 3, 3) -> (N, C, 3)."""
        return np.where(self.with_base[:, None], so3.apply(attitude[:, None], self.axes), self.axes)


INERTIAL = Directions(("x", "y", "z"), np.eye(3), np.zeros(3, dtype=bool))


@dataclass(frozen=True, eq=False, kw_only=True)
class MomentumSamples:
    """Momenta of the F frames of a body's chain at N times, and the derivatives that carry noise into them.

    body, times : (N,) [s]
    attitude : (N, 3, 3) base axes to inertial axes
    momenta : (directions) -> (N, F, 2, C), local and remote [kg m^2/s]
    bars : (directions) -> (N, 1 + F, C) standard deviations, of the whole first
    summed_bars : (directions, weights (m, N)) -> (m, C), of weighted sums of the whole
    """

    body: Body
    times: Array
    attitude: Array
    momenta: Callable[[Directions], Array]
    bars: Callable[[Directions], Array]
    summed_bars: Callable[[Directions, Array], Array]


def link_momenta(chain: JointChain, attitude: Array, spin: Array, shapes: Array, rates: Array) -> Array:
    """Local and remote angular momentum of each frame about the centre of mass of all: (N, F, 2, 3), inertial axes.

    attitude, spin : (N, 3, 3), (N, 3) of the base; its angular velocity in base axes [rad/s]
    """
    links = link_motions(chain, shapes, rates)
    spins = links.spins + spin[:, None]
    speeds = links.speeds + so3.cross(np.broadcast_to(spin[:, None], links.places.shape), links.places)
    local = so3.apply(links.turns, so3.apply(chain.inertias, so3.apply(so3.transpose(links.turns), spins)))
    remote = chain.masses[:, None] * so3.cross(links.places, speeds)
    return so3.apply(attitude[:, None, None], np.stack([local, remote], axis=2))


def _along(directions: Directions, attitude: Array, momenta: Array) -> Array:
    """Components (N, F, 2, 3) -> (N, F, 2, C)."""
    return momenta @ np.swapaxes(directions.at(attitude), -1, -2)[:, None]


def _whole_first(momenta: Array) -> Array:
    """Whole and links, local and remote together: (N, F, 2, C) -> (N, 1 + F, C)."""
    links = momenta.sum(axis=2)
    return np.concatenate([links.sum(axis=1, keepdims=True), links], axis=1)


def samples_of_motion(motion: Motion, times: Array) -> MomentumSamples:
    """Momenta of a reconstructed motion; its bars are those of the attitude's numerical error."""
    body, path = needed_body_and_path(motion, "momenta of links need")
    moving = moving_body(motion, body, path, times)
    attitude = motion.attitude(times) @ motion.deformation.frame(times)
    inertia, internal = body.sample(moving.shapes, moving.rates)
    inverse = inverse_inertia(inertia, times)
    total = so3.apply(attitude, so3.apply(inertia, moving.spins[0]) + internal)

    def momenta(directions: Directions, turn: Array | None = None) -> Array:
        turned = attitude if turn is None else so3.exp(turn) @ attitude
        spin = so3.apply(inverse, so3.apply(so3.transpose(turned), total) - internal)
        return _along(directions, turned, link_momenta(body.chain, turned, spin, moving.shapes, moving.rates))

    def bars(directions: Directions) -> Array:
        steps = [
            _whole_first(momenta(directions, turn) - momenta(directions, -turn)) / (2.0 * _STEP)
            for turn in _STEP * np.eye(3)
        ]
        rounding = _ROUNDING * float(np.linalg.norm(_whole_first(momenta(directions)), axis=-1).sum(axis=1).max())
        return rounding + float(motion.error_estimate) * np.sqrt(np.sum(np.square(steps), axis=0))

    def summed_bars(directions: Directions, weights: Array) -> Array:
        return np.abs(weights) @ bars(directions)[:, 0]

    return MomentumSamples(
        body=body, times=times, attitude=attitude, momenta=momenta, bars=bars, summed_bars=summed_bars
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Recorded:
    """A floating body as it was recorded.

    times, attitude : (N,) [s], (N, 3, 3) base axes to inertial axes
    path : of the joints, where the recording has made one
    shapes : (N, n) [rad or m]
    position : (N, 3) of the base's origin [m], or None
    spin, joint_rates : (N, 3) base axes [rad/s], (N, n), where they were recorded
    noise : standard deviations of a sample, of the base [rad] and of the joints (n,) [rad or m]; None: by the samples
    """

    times: Array
    attitude: Array
    shapes: Array
    path: ShapePath | None = None
    position: Array | None = None
    spin: Array | None = None
    joint_rates: Array | None = None
    noise: tuple[float | None, Array | None] = (None, None)


class _Columns(NamedTuple):
    """Numbers of the base and the joints at N times with rates, and the bars of linear functions of them.

    values, rates : (N, 4 + n) a quaternion of the base behind its mean turn, then the joints
    mean_turn : (3,) rate of that turn, inertial axes [rad/s]
    bars : derivatives (N, m, 4 + n, 2) by values and rates -> (N, m)
    summed : the same, summed over the times -> (m,)
    """

    values: Array
    rates: Array
    mean_turn: Array
    bars: Callable[[Array, slice], Array]
    summed: Callable[[Array], Array]


def samples_of_recording(body: Body, recorded: Recorded) -> MomentumSamples:
    """Momenta of a recording as it is: nothing is presumed to be conserved.

    Rates are those of smoothing splines through the samples, of the base's attitude beside its mean turn, where they
    were not recorded. Bars hold the white noise of the samples and the known bias of smoothing.

    Raises TrajectoryError for fewer than eight samples.
    """
    if len(recorded.times) < _FEWEST:
        raise TrajectoryError(f"{len(recorded.times)} samples; momenta of a recording need {_FEWEST}: give more")
    columns = _given(recorded) if recorded.spin is not None else _smoothed(body, recorded)
    since = (recorded.times - recorded.times[0])[:, None]

    def attitude_and_spin(values: Array, rates: Array, part: slice) -> tuple[Array, Array]:
        length = np.linalg.norm(values[:, :_QUATERNION], axis=1, keepdims=True)
        unit, slope = values[:, :_QUATERNION] / length, rates[:, :_QUATERNION] / length
        left = so3.matrix_from_quat(unit)
        spin = 2.0 * so3.quat_product(so3.quat_inverse(unit), slope)[:, :3]
        spin = spin + so3.apply(so3.transpose(left), np.broadcast_to(columns.mean_turn, spin.shape))
        return so3.exp(since[part] * columns.mean_turn) @ left, spin

    def of_columns(directions: Directions, values: Array, rates: Array, part: slice) -> Array:
        attitude, spin = attitude_and_spin(values, rates, part)
        joints = values[:, _QUATERNION:], rates[:, _QUATERNION:]
        return _along(directions, attitude, link_momenta(body.chain, attitude, spin, *joints))

    def slopes(directions: Directions, part: slice) -> Array:
        """Derivatives of the whole, then of links, by values and rates: (N, 1 + F, C, 4 + n, 2)."""
        values, rates = columns.values[part], columns.rates[part]
        here = of_columns(directions, values, rates, part)
        moved = [
            _whole_first(of_columns(directions, values + move, rates + turn, part) - here) / step
            for column in np.eye(values.shape[1])
            # Momenta are linear in the rates, so that any step gives the derivative.
            for move, turn, step in ((_STEP * column, 0.0, _STEP), (0.0, column, 1.0))
        ]
        return np.stack(moved, axis=-1).reshape(*moved[0].shape, -1, 2)

    slopes_of_whole: dict[tuple[str, ...], Array] = {}

    def bars(directions: Directions) -> Array:
        parts, wholes = [], []
        for first in range(0, len(since), _AT_ONCE):
            block = slice(first, first + _AT_ONCE)
            derivative = slopes(directions, block)
            flat = derivative.reshape(len(derivative), -1, *derivative.shape[3:])
            parts.append(columns.bars(flat, block).reshape(derivative.shape[:3]))
            wholes.append(derivative[:, 0])
        slopes_of_whole[directions.names] = np.concatenate(wholes)
        return np.concatenate(parts)

    def summed_bars(directions: Directions, weights: Array) -> Array:
        if directions.names not in slopes_of_whole:
            bars(directions)
        derivative = slopes_of_whole[directions.names]
        weighted = weights.T[:, :, None, None, None] * derivative[:, None]
        return columns.summed(weighted.reshape(len(since), -1, *derivative.shape[2:])).reshape(len(weights), -1)

    everything = slice(None)
    return MomentumSamples(
        body=body,
        times=recorded.times,
        attitude=attitude_and_spin(columns.values, columns.rates, everything)[0],
        momenta=lambda directions: of_columns(directions, columns.values, columns.rates, everything),
        bars=bars,
        summed_bars=summed_bars,
    )


def _given(recorded: Recorded) -> _Columns:
    """Rates that were recorded, each sample with noise of its own."""
    assert recorded.spin is not None
    assert recorded.joint_rates is not None
    quaternion = neighbours_signs(so3.quat_from_matrix(recorded.attitude), (slice(0, _QUATERNION),))
    spins = np.concatenate([recorded.spin, np.zeros((len(recorded.spin), 1))], axis=1)
    rates = 0.5 * so3.quat_product(quaternion, spins)
    base, joints = _levels(recorded, quaternion)
    spin_noise = 0.5 * float(white_noise(recorded.spin[:, None], 3)[0])
    rate_noise = white_noise(recorded.joint_rates[:, :, None], 1)
    levels = np.stack(
        [np.append(np.full(_QUATERNION, base), joints), np.append(np.full(_QUATERNION, spin_noise), rate_noise)], axis=1
    )
    return _Columns(
        values=np.hstack([quaternion, recorded.shapes]),
        rates=np.hstack([rates, recorded.joint_rates]),
        mean_turn=np.zeros(3),
        bars=lambda derivative, _: np.sqrt(np.einsum("tmja,ja->tm", derivative**2, levels**2)),
        summed=lambda derivative: np.sqrt(np.einsum("tmja,ja->m", derivative**2, levels**2)),
    )


def _levels(recorded: Recorded, quaternion: Array) -> tuple[float, Array]:
    """Noise of each number of the base's quaternion, half that of its turn, and of the joints (n,)."""
    base, joints = recorded.noise
    half = float(white_noise(quaternion[:, None], 3)[0]) if base is None else 0.5 * base
    return half, white_noise(recorded.shapes[:, :, None], 1) if joints is None else joints


def _smoothed(body: Body, recorded: Recorded) -> _Columns:
    """Rates by smoothing splines, of joints that were smoothed already by those."""
    times = recorded.times - recorded.times[0]
    steps = so3.log(recorded.attitude[1:] @ so3.transpose(recorded.attitude[:-1]))
    mean_turn = steps.sum(axis=0) / times[-1]
    left = so3.transpose(so3.exp(times[:, None] * mean_turn)) @ recorded.attitude
    quaternion = neighbours_signs(so3.quat_from_matrix(left), (slice(0, _QUATERNION),))
    base, joints = _levels(recorded, quaternion)
    near, slopes = _near(times, quaternion, np.full(_QUATERNION, base), _BASE)
    paths = [(near, np.full(_QUATERNION, base))]
    if body.n_shape:
        known = None if recorded.path is None else stated_noise(recorded.path)
        if recorded.path is not None and known is not None:
            paths.append((recorded.path, known if recorded.noise[1] is None else joints))
            slopes = np.append(slopes, np.zeros(body.n_shape))
        else:
            near, more = _near(times, recorded.shapes, joints, body.joint_names)
            paths.append((near, joints))
            slopes = np.append(slopes, more)
    curves = [path.curve(times) for path, _ in paths]
    errors = [path_errors(path, times, level) for path, level in paths]
    # Shape and rate; the third is the acceleration.
    covariance = np.concatenate([error.covariance for error in errors], axis=1)[..., :2, :2]
    bias = np.concatenate([error.bias for error in errors], axis=1)[..., :2]
    values, rates = (np.hstack([curve[which] for curve in curves]) for which in (0, 1))
    values, rates = values - times[:, None] * slopes, rates - slopes
    missed = _truncation(times, values, rates, (*_BASE, *body.joint_names))

    def bars(derivative: Array, part: slice) -> Array:
        by_noise = np.einsum("tmja,tjab,tmjb->tm", derivative, covariance[part], derivative, optimize=True)
        systematic = (np.einsum("tmja,tja->tm", derivative, off[part]) ** 2 for off in (bias, missed))
        return np.sqrt(by_noise + sum(systematic))

    def summed(derivative: Array) -> Array:
        padded = np.concatenate([derivative, np.zeros_like(derivative[..., :1])], axis=-1)
        ends = np.cumsum([0] + [path.n_shape for path, _ in paths])
        parts = [
            summed_errors(path, times, padded[:, :, first:past], level)
            for (path, level), first, past in zip(paths, ends[:-1], ends[1:], strict=True)
        ]
        # Errors of the spline do not cancel as noise does.
        between = np.abs(np.einsum("tmja,tja->tm", derivative, missed)).sum(axis=0)
        return np.sqrt(np.sum(np.square([*parts, between]), axis=0))

    return _Columns(
        values=values,
        rates=rates,
        mean_turn=mean_turn,
        bars=bars,
        summed=summed,
    )


def _truncation(times: Array, values: Array, rates: Array, names: tuple[str, ...]) -> Array:
    """Errors of splines between samples, by those through every second one: (N, 4 + n, 2) of values and rates."""
    half = np.unique(np.append(np.arange(0, len(times), 2), len(times) - 1))
    coarse = ShapePath.spline(times[half], values[half], False, joint_names=names).curve(times)
    return _TRUNCATION * np.stack([coarse[0] - values, coarse[1] - rates], axis=-1)


def _near(times: Array, samples: Array, noise: Array, names: tuple[str, ...]) -> tuple[ShapePath, Array]:
    """A smoothing spline near samples plus lines in time, and the slopes of these (n,).

    Columns that move no more than their noise get a line: smoothing, and its penalty, do not depend on lines, and
    others are refused as noise alone.
    """
    slopes = np.where(noise < samples.std(axis=0), 0.0, _LINE * noise / times[-1])
    return smoothed_path(times, samples + times[:, None] * slopes, noise, False, names)[0], slopes


def with_noise(recorded: Recorded, base: float | None, joints: Array | None) -> Recorded:
    """The recording with standard deviations of its samples that are stated."""
    kept_base, kept_joints = recorded.noise
    return replace(recorded, noise=(kept_base if base is None else base, kept_joints if joints is None else joints))
