"""What a stretch of a trajectory says of momentum, fall and rates, with the noise of each, for one body.

Where nothing acts on a body, its angular momentum about the centre of mass is constant and the centre of mass goes
along a parabola. Where rates are given, the momentum of every sample is seen by itself. Where they are not, they are
differences of the samples; their noise is as large as it is fast, and what is looked at is the sum of the momentum
over the time, in which the noise is that of the samples.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from .floating_trajectory import FloatingTrajectory, TrajectoryNoise, estimated_noise

_ROUNDING = 32.0 * float(np.finfo(np.float64).eps)  # of a momentum or place: rounding of 32 operations
_AT_REST = 1e-6  # rad: a body that turns by less in all the time is at rest
_NUDGE = 1e-6  # [rad or m] By which a joint is moved to see how the centre of mass goes with it: for the noise alone
_ENOUGH = 32  # samples at which that is looked at; between them it is taken as it is nearby
REACH = 4  # neighbours on each side, which the samples at both ends do not have


@dataclass(frozen=True, eq=False, kw_only=True)
class Observation:
    """One stretch of a trajectory of N samples, as one body has it.

    mass : of the body [kg]
    trajectory : with rates, given or found
    given_rates : whether they were given
    noise : of the samples
    attitude : (N, 3, 3)
    rate : (N, 3) of the base, base axes [rad/s]
    inertia, internal : (N, 3, 3), (N, 3) base axes
    momentum : (N, 3) world axes [kg m^2/s]
    momentum_noise : (N, 3, 3) covariance of what `seen` makes of it
    carried_noise : where rates are not given, what each noise of a sample adds to its momentum and to later ones,
        (N, 3, m) twice, as `smooth_part` takes it; else None
    centre : (N, 3) of mass [m], or None
    centre_noise : (N, 3, 3) its covariance, or None
    """

    mass: float
    trajectory: FloatingTrajectory
    given_rates: bool
    noise: TrajectoryNoise
    attitude: Array
    rate: Array
    inertia: Array
    internal: Array
    momentum: Array
    momentum_noise: Array
    carried_noise: tuple[Array, Array] | None
    centre: Array | None
    centre_noise: Array | None

    @property
    def times(self) -> Array:
        """[s]."""
        return self.trajectory.times

    @property
    def joint_rates(self) -> Array:
        """[rad/s or m/s]."""
        assert self.trajectory.joint_rates is not None
        return self.trajectory.joint_rates

    @property
    def scale(self) -> float:
        """What momenta are compared with: the turn of the base and the joints' own, in the mean [kg m^2/s]."""
        turning = so3.apply(self.inertia, self.rate)
        return float(np.sqrt((turning**2 + self.internal**2).sum(axis=1).mean()))

    @property
    def finest(self) -> float:
        """What rounding of a momentum is relative to: the same, but of a body at rest a very slow turn."""
        slow = _AT_REST / float(self.times[-1] - self.times[0])
        return self.scale + slow * float(np.trace(self.inertia, axis1=1, axis2=2).mean())

    @property
    def extent(self) -> float:
        """A length of the body [m]."""
        return _extent(self.inertia, self.mass)

    def seen(self, momentum: Array) -> Array:
        """A momentum in time (N, ..., 3 at axis 1 kept), as it is looked at: itself, or its sum over the time."""
        if self.given_rates:
            return momentum
        steps = np.diff(self.times)
        steps = steps.reshape(-1, *([1] * (momentum.ndim - 1)))
        summed = np.cumsum(0.5 * steps * (momentum[1:] + momentum[:-1]), axis=0)
        return np.concatenate([np.zeros_like(momentum[:1]), summed])


def _extent(inertia: Array, mass: float) -> float:
    """Radius of gyration, in the mean [m]."""
    return float(np.sqrt(0.5 * np.trace(inertia, axis1=1, axis2=2).mean() / mass))


def with_rates(trajectory: FloatingTrajectory) -> FloatingTrajectory:
    """The trajectory itself, or, without rates, what is left of it between differences."""
    if trajectory.joint_rates is not None:
        return trajectory
    weights = difference_weights(trajectory.times)
    inner = trajectory.part(REACH, len(trajectory.times) - REACH)
    velocity = None if trajectory.position is None else differentiated(trajectory.position, weights)
    return replace(
        inner,
        rate=turn_rates(trajectory.attitude, weights),
        rate_axes="base",
        velocity=velocity,
        velocity_axes="world",
        joint_rates=differentiated(trajectory.shapes, weights),
    )


def observed(body: Body, trajectory: FloatingTrajectory, noise: TrajectoryNoise | None = None) -> Observation:
    """What a trajectory says; without a noise, with the one that its samples show."""
    given = trajectory.joint_rates is not None
    level = noise or trajectory.noise or estimated_noise(trajectory)
    moving = with_rates(trajectory)
    attitude, rate, joint_rates = moving.attitude, moving.base_rate, moving.joint_rates
    assert rate is not None
    assert joint_rates is not None
    inertia, internal = body.sample(moving.shapes, joint_rates)
    from_base = so3.apply(inertia, rate) + internal
    extent = _extent(inertia, body.mass)
    centre, centre_noise = _centre(body, moving, attitude, level, extent)
    seen = Observation(
        mass=body.mass,
        trajectory=moving,
        given_rates=given,
        noise=level,
        attitude=attitude,
        rate=rate,
        inertia=inertia,
        internal=internal,
        momentum=so3.apply(attitude, from_base),
        momentum_noise=np.zeros((len(rate), 3, 3)),
        carried_noise=None,
        centre=centre,
        centre_noise=centre_noise,
    )
    if not given:
        seen = replace(seen, carried_noise=_carried_noise(body, seen))
    return replace(seen, momentum_noise=_momentum_noise(body, seen, from_base))


def _momentum_noise(body: Body, seen: Observation, from_base: Array) -> Array:
    """Covariance of each sample of what `seen` makes of the momentum."""
    level, moving = seen.noise, seen.trajectory
    if seen.carried_noise is None:
        answers = body.angular_momentum_gradient(moving.shapes, seen.joint_rates, seen.rate)
        factors = [
            level.attitude * so3.hat(from_base),
            level.rate * seen.inertia,
            np.swapaxes(answers, 1, 2) * np.array(level.joints),
            body.momentum_matrix(moving.shapes) * np.array(level.joint_rates),
        ]
        least = _ROUNDING * seen.finest
        turned = seen.attitude @ np.concatenate(factors, axis=2)
    else:
        least = _ROUNDING * seen.finest * float(moving.times[-1] - moving.times[0])
        turned = seen.carried_noise[0]
    return turned @ np.swapaxes(turned, 1, 2) + least**2 * np.eye(3)


def _carried_noise(body: Body, seen: Observation) -> tuple[Array, Array]:
    """What noise of the samples, whose differences the rates are, adds to the sum of the momentum over the time.

    A turn e of the sample, world axes, adds I e' + e x L to the momentum, joints that are off by d add J d' and what
    they change in I and J. The sum over the time of the first parts is I e and J d at the sample itself, and what
    is left over by the change of I and J in the meantime goes to all that come later.
    """
    level, moving = seen.noise, seen.trajectory
    steps = np.gradient(seen.times)[:, None, None]
    inertia = seen.attitude @ seen.inertia @ so3.transpose(seen.attitude)
    matrix = seen.attitude @ body.momentum_matrix(moving.shapes)
    answers = np.swapaxes(body.angular_momentum_gradient(moving.shapes, seen.joint_rates, seen.rate), 1, 2)
    turned = -np.gradient(inertia, seen.times, axis=0) - so3.hat(seen.momentum)
    moved = seen.attitude @ answers - np.gradient(matrix, seen.times, axis=0)
    joints = np.array(level.joints)
    now = np.concatenate([level.attitude * inertia, matrix * joints], axis=2)
    return now, steps * np.concatenate([level.attitude * turned, moved * joints], axis=2)


def _centre(
    body: Body, moving: FloatingTrajectory, attitude: Array, level: TrajectoryNoise, extent: float
) -> tuple[Array | None, Array | None]:
    """Centre of mass, and the covariance of each sample; None without places."""
    if moving.position is None:
        return None, None
    own = body.centre_of_mass(moving.shapes)
    places = np.linspace(0, len(own) - 1, min(len(own), _ENOUGH)).astype(np.int64)
    nudges = _NUDGE * np.eye(body.n_shape)
    few = moving.shapes[places, None]
    moved = (body.centre_of_mass(few + nudges) - body.centre_of_mass(few - nudges)) / (2.0 * _NUDGE)
    nearest = np.searchsorted(places, np.arange(len(own)), side="left")
    answers = np.swapaxes(moved, 1, 2)[nearest]
    factors = attitude @ np.concatenate([level.attitude * so3.hat(own), answers * np.array(level.joints)], axis=2)
    centre = moving.position + so3.apply(attitude, own)
    least = _ROUNDING * float(np.abs(centre).max() + np.abs(own).max() + extent)
    return centre, factors @ np.swapaxes(factors, 1, 2) + (level.position**2 + least**2) * np.eye(3)


def difference_weights(times: Array, reach: int = REACH) -> Array:
    """(N - 2 reach, 2 reach + 1): what neighbours are multiplied by for the derivative in their middle [1/s]."""
    count = 2 * reach + 1
    windows = np.lib.stride_tricks.sliding_window_view(times, count)
    since = windows - windows[:, reach, None]
    usual = np.abs(since).max(axis=1, keepdims=True)
    powers = (since / usual)[:, None, :] ** np.arange(count)[:, None]
    slope = np.zeros((len(windows), count, 1))
    slope[:, 1] = 1.0
    return np.linalg.solve(powers, slope)[:, :, 0] / usual


def fewer_neighbours(times: Array) -> Array:
    """Weights without the outermost neighbours, which get zeros: the difference shows the truncation error."""
    return np.pad(difference_weights(times[1:-1], REACH - 1), ((0, 0), (1, 1)))


def differentiated(values: Array, weights: Array) -> Array:
    """(N, k) -> (N - 2 REACH, k)."""
    windows = np.lib.stride_tricks.sliding_window_view(values, weights.shape[1], axis=0)
    return np.einsum("nw,nkw->nk", weights, windows)


def turn_rates(attitudes: Array, weights: Array) -> Array:
    """Angular velocity, base axes: (N, 3, 3) -> (N - 2 REACH, 3), by the turns from the middle to its neighbours."""
    count = len(weights)
    middle = so3.transpose(attitudes[REACH : REACH + count])
    found = np.zeros((count, 3))
    for k in range(weights.shape[1]):
        if k != REACH:
            found += weights[:, k, None] * so3.log(middle @ attitudes[k : k + count])
    return found
