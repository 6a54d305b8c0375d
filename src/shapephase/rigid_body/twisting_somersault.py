"""The twisting somersault in closed form: a rigid diver whose arms are a rotor that can be switched on and off.

Axes: x forward, the rotor's; y the axis of the somersault; z along the body, about which it twists. The dive has five
stages. First the body turns about the constant momentum mu = l e_y alone, at l/I_y. With the rotor on, of momentum h
about x, it is a `Gyrostat`, and the momentum leaves the y axis in the body: it tilts. With the rotor off it is an
`EulerTop` whose momentum circles z: it twists. The rotor, on again, takes the tilt away, and a somersault ends it.

The motion has a reversing symmetry, t -> -t with (Pi_x, Pi_y, Pi_z) -> (-Pi_x, Pi_y, Pi_z) and h -> -h. So the second
shape change undoes the first exactly where the twist lasts n T - 2 t_P, T the top's period, n the number of twists and
t_P the time it takes from the plane Pi_x = 0 to the point where the first change ended. With half a twist more it ends
at -y, and the rotor goes the same way twice. With the angle that the body's long axis turns through about mu,

    2 pi m = (l/I_y) (T_1 + T_5) + 2 (rotor on) + (twist),

m somersaults: Cabrera's phase formula for this body. Where shape changes take no time (the kick model) and nothing is
left for somersaults alone, m/n is the rotation number of the top, which the tilt decides (`tilt_of_ratio`).

Sources: Bharadwaj, Duignan, Dullin, Leung and Tong 2016 (the diver with a rotor); Dullin and Tong 2016.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from .. import elliptic, so3
from ..arguments import moments_argument
from ..arrays import Array, Integers, finite_array
from ..display import short_repr
from ..errors import ShapeError, TrajectoryError
from ..letters import value_text
from ..roots import bracketed_root
from ..sphere import gauss_nodes
from ._arguments import TWELVE_DIGITS, above_zero
from .euler_top import EulerTop
from .gyrostat import Gyrostat

_MOMENTA = np.geomspace(0.3, 4.0, 24)  # tried for a duration, relative to the momentum of the somersaults alone
_FORWARD, _ACROSS, _ = np.eye(3)  # x, about which the rotor turns; y, about which the body somersaults


@dataclass(frozen=True, eq=False, kw_only=True)
class RotorDive:
    """Dive of five stages. Made by `rotor_dive`."""

    moments: Array
    """(3,) about x, y and z, without what the rotor turns [kg m^2]."""
    momentum: float
    """l, about +y in inertial axes [kg m^2/s]."""
    rotor: float
    """h, about x, in the second stage [kg m^2/s]."""
    somersaults: float  #: m, number of somersaults.
    twists: float
    """n, number of twists."""
    times: Array
    """(6,) at which the stages begin and the dive ends [s]."""
    turns: Array
    """(5,) angles of the long axis about the momentum in each stage [rad], of sum 2 pi m."""
    tilt: float
    """The angle of the momentum from the plane of x and y halfway [rad]."""
    _lengths: tuple[float, float] = field(repr=False)

    __repr__ = short_repr

    @property
    def duration(self) -> float:
        """Duration of the whole dive [s]."""
        return float(self.times[-1])

    @cached_property
    def _bodies(self) -> tuple[Gyrostat, EulerTop, Gyrostat]:
        """Those of the three stages between the somersaults alone."""
        on, lasting = self._lengths
        inertia, spatial = np.diag(self.moments), self.momentum * _ACROSS
        tilting = Gyrostat(inertia, self.rotor * _FORWARD, spatial, so3.exp(self.turns[0] * _ACROSS))
        twisting = EulerTop.principal(self.moments, tilting.body_momentum(on), tilting.attitude(on))
        back = self.rotor if self.twists % 1.0 else -self.rotor
        return tilting, twisting, Gyrostat(inertia, back * _FORWARD, spatial, twisting.attitude(lasting))

    @property
    def landing(self) -> Array:
        """Exact last attitude of a dive of m somersaults and n twists: (3, 3), body axes to inertial axes."""
        turn, twist = 2.0 * np.pi * self.somersaults, 2.0 * np.pi * self.twists
        return so3.exp(turn * _ACROSS) @ so3.exp(np.array([0.0, 0.0, twist]))

    def attitude(self, t: ArrayLike) -> Array:
        """R(t), body axes to inertial axes, the identity at first: times (...) in [0, duration] -> (..., 3, 3)."""
        rate = self.momentum / float(self.moments[1])

        def alone(stage: int, since: Array) -> Array:
            start = np.eye(3) if not stage else self._bodies[2].attitude(self.times[4] - self.times[3])
            return so3.exp(rate * since[:, None] * _ACROSS) @ start

        return self._by_stage(t, (3, 3), lambda body, since: body.attitude(since), alone)

    def body_momentum(self, t: ArrayLike) -> Array:
        """Pi(t), the rotor's part included: times (...) -> (..., 3), body axes [kg m^2/s]."""

        def alone(stage: int, since: Array) -> Array:
            side = -1.0 if stage and self.twists % 1.0 else 1.0
            return np.broadcast_to(side * self.momentum * _ACROSS, (len(since), 3))

        return self._by_stage(t, (3,), lambda body, since: body.body_momentum(since), alone)

    def rotor_momentum(self, t: ArrayLike) -> Array:
        """Momentum of the rotor, L_o of the body as a deforming one: times (...) -> (..., 3), body axes [kg m^2/s].

        Switching times belong to the stage that begins.
        """
        times = self._checked(t)
        spins = np.array([0.0, self.rotor, 0.0, float(self._bodies[2].rotor[0]), 0.0])
        return spins[self._stage(times)][..., None] * _FORWARD

    def somersault(self, t: ArrayLike) -> Array:
        """The angle of the long axis about the momentum, followed along t: times (...) -> (...) [rad]; 2 pi m at last.

        The closed form gives it up to whole turns, which a quadrature of its rate counts.
        """
        times = self._checked(t)
        before = np.append(0.0, np.cumsum(self.turns)[:-1])

        def alone(stage: int, since: Array) -> Array:
            return before[stage] + since * self.momentum / float(self.moments[1])

        def turning(body: Gyrostat | EulerTop, since: Array) -> Array:
            return before[self._bodies.index(body) + 1] + _turned(body, since)

        rough = self._by_stage(times, (), turning, alone)
        return rough + so3.wrap(_azimuth(self.attitude(times)) - rough)

    def twist(self, t: ArrayLike) -> Array:
        """The angle of the body about z, against the momentum, followed along t: times (...) -> (...) [rad].

        Positive by the right-hand rule, 2 pi n at last; negative for a rotor below 0.
        """
        times, sense = self._checked(t), np.sign(self.rotor)
        pi, period = self.body_momentum(times), self._bodies[1].period
        start, end = self.times[2:4]
        gone = times - start + 0.5 * (self.twists * period - (end - start))
        # Before and after, the momentum has left or reached the y axis by less than half a turn.
        turns = np.where(times < start, 0.0, np.where(times > end, self.twists, gone / period))
        rough = 2.0 * np.pi * sense * turns
        return rough + so3.wrap(np.arctan2(pi[..., 0], pi[..., 1]) - rough)

    def _checked(self, t: ArrayLike) -> Array:
        times = finite_array(t, "t", unit="s")
        if np.any((times < 0.0) | (times > self.duration * (1.0 + TWELVE_DIGITS))):
            raise ShapeError(f"t: {times.min():.6g} to {times.max():.6g} s; the dive is on [0, {self.duration:.6g}] s")
        return np.minimum(times, self.duration)

    def _stage(self, times: Array) -> Integers:
        return np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, 4)

    def _by_stage(
        self,
        t: ArrayLike,
        shape: tuple[int, ...],
        of_body: Callable[[Gyrostat | EulerTop, Array], Array],
        alone: Callable[[int, Array], Array],
    ) -> Array:
        """Values of each stage at its times; `alone` is for the somersaults without twist, first and last."""
        times = self._checked(t)
        values, stages = np.empty((*times.shape, *shape)), self._stage(times)
        for stage in range(len(self.turns)):
            here = stages == stage
            since = times[here] - self.times[stage]
            values[here] = alone(stage, since) if stage in (0, 4) else of_body(self._bodies[stage - 1], since)
        return values


def rotor_dive(
    moments: ArrayLike, momentum: float, rotor: float, kick: float, *, somersaults: float, twists: float
) -> RotorDive:
    """The dive with m somersaults and n twists, of a momentum, a rotor and the time that it is on: in closed form.

    What is left for somersaults without twist, half of it at the start and half at the end, follows, and with it the
    duration. `rotor_dive_lasting` finds the momentum for a duration.

    Source: Bharadwaj et al. 2016; Cabrera 2006 (13); theory.md F10.

    Parameters
    ----------
    moments : (3,) about the rotor's axis x, the somersault's y and the long axis z, that about z the smallest [kg m^2]
    momentum : l > 0 [kg m^2/s]
    rotor : h, other than 0, about x; its sign is that of tilt and twist [kg m^2/s]
    kick : time for which the rotor is on, twice [s]
    somersaults : m > 0
    twists : n, a positive multiple of a half

    Raises
    ------
    ShapeError
        If the twists are not a multiple of a half, or the rotor is 0 or more than one number.
    TrajectoryError
        If there is no such dive: after the first shape change the momentum does not circle the long axis, or has
        circled it too far already, or shape changes and twist alone are more somersaults.

    Examples
    --------
    >>> dive = sp.rigid_body.rotor_dive([12.0, 11.0, 1.0], 70.0, 50.0, 0.12, somersaults=1.5, twists=2)
    >>> print((dive.turns / (2.0 * np.pi)).round(4), f"{dive.turns.sum() / np.pi:.9f} pi")
    [0.4787 0.0765 0.3897 0.0765 0.4787] 3.000000000 pi
    """
    values = _moments(moments)
    size, on = above_zero(momentum, "momentum", "kg m^2/s"), above_zero(kick, "kick", "s")
    count, around = above_zero(somersaults, "somersaults"), above_zero(twists, "twists")
    spin = finite_array(rotor, "rotor", unit="kg m^2/s")
    if (2.0 * around) % 1.0 or spin.shape or not spin:
        raise ShapeError("twists: a multiple of a half is needed; rotor: one momentum other than 0")
    tilting = Gyrostat(np.diag(values), float(spin) * _FORWARD, size * _ACROSS)
    tilted = tilting.body_momentum(on)
    twisting = EulerTop.principal(values, tilted, tilting.attitude(on))
    if twisting.orbit.circled != 0 or not np.isfinite(twisting.period) or tilted[2] * spin <= 0.0:
        raise TrajectoryError(f"after {on:.6g} s of the rotor the momentum does not circle the long axis: no twist")
    lasting = around * twisting.period - 2.0 * _since_the_plane(twisting)
    if lasting <= 0.0:
        raise TrajectoryError(f"the rotor, on for {on:.6g} s, twists by more than {0.5 * around:g} turns each time")
    changing, twisted = float(_turned(tilting, on)), float(_turned(twisting, lasting))
    left = 2.0 * np.pi * count - 2.0 * changing - twisted
    if left < 0.0:
        raise TrajectoryError(
            f"{around:g} twists and the shape changes for them are {count - 0.5 * left / np.pi:.6g} somersaults, more "
            f"than {count:g}; a quicker or stronger rotor tilts more"
        )
    alone = 0.5 * left * float(values[1]) / size
    return RotorDive(
        moments=values,
        momentum=size,
        rotor=float(spin),
        somersaults=count,
        twists=around,
        times=np.cumsum([0.0, alone, on, lasting, on, alone]),
        turns=np.array([0.5 * left, changing, twisted, changing, 0.5 * left]),
        tilt=float(np.arcsin(np.clip(twisting.body_momentum(0.5 * lasting)[2] / size, -1.0, 1.0))),
        _lengths=(on, lasting),
    )


def rotor_dive_lasting(
    moments: ArrayLike, duration: float, rotor: float, kick: float, *, somersaults: float, twists: float
) -> RotorDive:
    """The dive with m somersaults and n twists in a given time: the momentum is solved for.

    Other parameters and errors as `rotor_dive`; TrajectoryError also where no momentum between 0.3 and 4 times that of
    the somersaults alone gives the duration.

    Parameters
    ----------
    duration : of the whole dive, 1.5 s from a platform of ten metres [s]

    Examples
    --------
    >>> dive = sp.rigid_body.rotor_dive_lasting([12.0, 11.0, 1.0], 1.5, 50.0, 0.12, somersaults=1.5, twists=2)
    >>> print(f"{dive.duration:.9f} s, {dive.momentum:.4f} kg m^2/s, tilt {np.degrees(dive.tilt):.3f} degrees")
    1.500000000 s, 74.1313 kg m^2/s, tilt 19.398 degrees
    """
    span, values = above_zero(duration, "duration", "s"), _moments(moments)
    momenta = 2.0 * np.pi * above_zero(somersaults, "somersaults") * float(values[1]) / span * _MOMENTA

    def excess(momentum: float) -> float:
        return rotor_dive(values, momentum, rotor, kick, somersaults=somersaults, twists=twists).duration - span

    last, reason = None, "none of them is a dive"
    for momentum in momenta:
        try:
            now = (float(momentum), excess(float(momentum)))
        except TrajectoryError as error:
            last, reason = None, str(error)
            continue
        if last is not None and (last[1] > 0.0) != (now[1] > 0.0):
            found = bracketed_root(excess, last[0], now[0])
            return rotor_dive(values, found, rotor, kick, somersaults=somersaults, twists=twists)
        last = now
    raise TrajectoryError(
        f"duration: no momentum from {momenta[0]:.6g} to {momenta[-1]:.6g} kg m^2/s makes the dive last "
        f"{span:.6g} s ({reason})"
    )


def tilt_of_ratio(moments: ArrayLike, somersaults_per_twist: float) -> float:
    """The tilt at which a rigid body does m somersaults in n twists, m/n given: its rotation number [rad].

    In the kick model shape changes take no time. The momentum, tilted from y towards z by this angle, then circles z n
    times while the long axis goes round the momentum m times.

    Source: Dullin and Tong 2016, the kick model; theory.md F10.
    Raises TrajectoryError if a twist takes more somersaults at any tilt.

    Parameters
    ----------
    moments : (3,) as for `rotor_dive` [kg m^2]
    somersaults_per_twist : m/n

    Examples
    --------
    >>> tilt = sp.rigid_body.tilt_of_ratio([12.0, 11.0, 1.0], 1.5 / 10.0)
    >>> top = sp.EulerTop.principal([12.0, 11.0, 1.0], [0.0, np.cos(tilt), np.sin(tilt)])
    >>> print(f"{np.degrees(tilt):.4f} degrees, {10.0 * top.long_axis_precession_per_period / np.pi:.9f} pi")
    39.3758 degrees, 3.000000000 pi
    """
    values, ratio = _moments(moments), above_zero(somersaults_per_twist, "somersaults_per_twist")
    rates = 1.0 / values
    least = np.arcsin(np.sqrt(max(0.0, (rates[0] - rates[1]) / (rates[2] - rates[1]))))

    def excess(tilt: float) -> float:
        top = EulerTop.principal(values, [0.0, np.cos(tilt), np.sin(tilt)])
        return top.long_axis_precession_per_period / (2.0 * np.pi) - ratio

    # Off the separatrix and the long axis, where the rotation number is not defined.
    margin = 1e-9
    low, high = float(least) + margin, 0.5 * np.pi - margin
    if excess(low) < 0.0 or excess(high) > 0.0:
        raise TrajectoryError(
            f"somersaults_per_twist: from {excess(high) + ratio:.6g} to {excess(low) + ratio:.6g} are possible for "
            f"this body, got {ratio:.6g}"
        )
    return bracketed_root(excess, low, high)


def _moments(moments: ArrayLike) -> Array:
    values = moments_argument(moments)
    if not values[2] < values[:2].min():
        raise ShapeError(f"moments: that about z, the long axis, must be the smallest, got {value_text(moments)}")
    return values


def _azimuth(attitude: Array) -> Array:
    """Azimuth of the long axis about y, from z: (..., 3, 3) -> (...) [rad]."""
    return np.arctan2(attitude[..., 0, 2], attitude[..., 2, 2])


def _turned(body: Gyrostat | EulerTop, since: ArrayLike) -> Array:
    """Angle that the long axis has turned through about the momentum: times (...) from 0 on -> (...) [rad]."""
    times = np.asarray(since, dtype=float)
    span = float(times.max(initial=0.0))
    # 16 cells a period: the error of the quadrature, which counts whole turns, is far below half of one.
    cells = 16 * (1 + int(min(span / body.period, 1e4)))
    edges = np.linspace(0.0, span, cells + 1)
    nodes, weights = gauss_nodes(edges[:-1], edges[1:])
    pi, omega = body.body_momentum(nodes), body.angular_velocity(nodes)
    across = np.sum(pi[..., :2] ** 2, axis=-1)
    rate = body.magnitude * np.sum(pi[..., :2] * omega[..., :2], axis=-1) / across
    rough = np.interp(times, edges, np.append(0.0, np.cumsum(np.sum(rate * weights, axis=1))))
    return rough + so3.wrap(_azimuth(body.attitude(times)) - _azimuth(body.attitude(0.0)) - rough)


def _since_the_plane(top: EulerTop) -> float:
    """Time since the momentum crossed Pi_x = 0 with Pi_y > 0, at t = 0 [s]."""
    quarter = float(elliptic.complete_k(top.complement))
    forward = int(np.argmax(np.abs(top.axes[0])))
    crossing = 0.0 if forward == 1 else quarter
    side = top.axes @ top.orbit.directions(np.asarray(crossing))
    if side[1] < 0.0:
        crossing += 2.0 * quarter
    return float((top.orbit.phase - crossing) % (4.0 * quarter)) / top.rate
