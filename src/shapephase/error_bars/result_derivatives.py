"""Derivatives of the results of a motion by everything that they depend on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .. import so3
from ..arguments import check_object
from ..arrays import Array
from ..body.body import Body
from ..deformation.deformation import Deformation
from ..deformation.descriptions import ArticulatedDescription
from ..deformation.rotors import Rotor, RotorDescription
from ..display import frozen
from ..errors import ShapeError, WrongObjectError
from ..inertia_tensor import inverse_inertia
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ..shape_space.path_samples import PathSamples, path_samples
from ..shape_space.shape_path import ShapePath
from ._along_motion import AlongMotion, BodyAlong, along_motion, responses
from .wheels_along import WheelsAlong


@frozen
class ResultDerivative:
    """Derivatives of the results of `split` by m numbers, whose change c changes the results by derivative @ c.

    Made by `derivatives`.

    A rotation D becomes exp(hat(derivative @ c)) D: the vectors are in inertial axes.

    Attributes
    ----------
    final_attitude, total_rotation, holonomy, dynamical_rotation, wheel_rotation, momentum_rotation : (3, m) [rad per
        unit]
    dynamic_phase, solid_angle, montgomery_phase : (m,) in the horizontal gauge [rad per unit]; without momentum zero
    """

    final_attitude: Array
    total_rotation: Array
    holonomy: Array
    dynamical_rotation: Array
    wheel_rotation: Array
    momentum_rotation: Array
    dynamic_phase: Array
    solid_angle: Array
    montgomery_phase: Array


@dataclass(frozen=True, eq=False)
class _Changes:
    """Derivatives by m numbers, inertial axes.

    end : (3, m) of the end of the motion
    lifted : (C, 3, m) of the ends of its lifts, see `AlongMotion`
    action : (m,) of the integral of Pi . (omega - that of the lift)
    """

    end: Array
    lifted: Array
    action: Array


class Derivatives:
    """The exact derivatives of a motion's results, each computed at its first use. Made by `derivatives`.

    One integral along the motion serves all numbers of a kind, however many there are: its integrand is carried to
    the end by the adjoint of the attitude equation.

    Source: theory.md section 8.

    Attributes
    ----------
    motion : the motion
    body, path : its body, and its path of the joints that are not wheels
    rotors : its wheels
    """

    def __init__(self, motion: Motion) -> None:
        check_object(motion, "Motion", "motion")
        self.motion = motion
        described = described_by(motion)
        self.body, self.path, self.rotors = described.body, described.path, described.rotors
        self._along = along_motion(motion, described.route)
        self._body = described.at(self._along.times, self._along.shapes, self._along.rates)

    @cached_property
    def by_momentum(self) -> ResultDerivative:
        """Derivatives by the momentum, inertial axes: m = 3 [per kg m^2/s]."""
        along = self._along
        turning = along.attitudes @ along.inverse @ so3.transpose(along.attitudes)
        end = np.einsum("n,nba,nbc->ac", along.weights, along.adjoint, turning)
        stored = so3.apply(along.attitudes, along.lifted_spins[:, 0] - along.lifted_spins[:, -1])
        by_wheels = along.weights @ (so3.apply(so3.transpose(turning), along.wheels) - stored)
        action = 2.0 * self.motion.momentum @ end + by_wheels
        return self._results(_Changes(end, np.zeros((along.lifted.shape[1], 3, 3)), action), by_momentum=True)

    @cached_property
    def by_attitude(self) -> ResultDerivative:
        """Derivatives by a turn of the start, R(0) exp(hat(delta)): m = 3, base axes."""
        start = self.motion.initial_attitude
        end = self._along.adjoint_at_start.T @ start
        momentum = self.motion.momentum
        action = 2.0 * momentum @ (end - start) + self._along.wheels_at_start @ start
        lifted = np.broadcast_to(start, (self._along.lifted.shape[1], 3, 3))
        return self._results(_Changes(end, lifted, action), turned_start=start)

    @cached_property
    def by_rotors(self) -> ResultDerivative:
        """Derivatives by the values of `rotors`: m = W.

        Per kg m^2/s of a momentum that stays, per rad/s of a held speed; for a value in time by a constant that is
        added to it.
        """
        _, rows = self._weights
        return self._results(_changes(self._body.wheels.by_values(rows)))

    @cached_property
    def by_samples(self) -> ResultDerivative:
        """Derivatives by the samples of the path: m = N n, row by row of the (N, n) samples [per rad or m].

        For a recording that was closed, smoothed or resampled, by all recorded samples at a fixed smoothing penalty.

        Raises
        ------
        WrongObjectError
            If the path is not `ShapePath.spline` or `ShapePath.waypoints` through samples, nor a recording.
        """
        return self.at_knots(self._samples.by_samples)

    @cached_property
    def by_knots(self) -> ResultDerivative:
        """Derivatives by the values of the path at its knots, for a periodic path without the last."""
        return self._results(_changes(self._body.by_knots(self._samples, *self._weights)))

    def at_knots(self, rule: Callable[[Array], Array]) -> ResultDerivative:
        """Derivatives by the inputs of the values at the knots, by a rule (k, knots n) -> (k, m)."""
        parts = (getattr(self.by_knots, field.name) for field in fields(ResultDerivative))
        return ResultDerivative(
            *(rule(part.reshape(-1, part.shape[-1])).reshape(*part.shape[:-1], -1) for part in parts)
        )

    @cached_property
    def by_inertias(self) -> ResultDerivative:
        """Derivatives by the masses, first moments and inertias of `body.chain`: m = 10 (k + 1).

        For each frame: mass [kg], first moment (3) [kg m] and inertia xx yy zz yz xz xy [kg m^2], both about its centre
        of mass, axes of the frame.
        """
        return self._results(_changes(self._body.by_inertias(*self._weights)))

    @property
    def _samples(self) -> PathSamples:
        return path_samples(self.path)

    @cached_property
    def _weights(self) -> tuple[Array, Array]:
        """Spins of motion and lifts at each node (N, 1 + C, 3), and changes of their ends and of the action by a unit
        of angular momentum added to each, base axes (N, 1 + C, 4, 3)."""
        along = self._along
        turned = -along.weights[:, None, None] * along.inverse
        end = so3.transpose(along.adjoint) @ along.attitudes @ turned
        weighted = along.weights[:, None] * (along.spins - along.lifted_spins[:, -1])
        spins = np.concatenate([along.spins[:, None], along.lifted_spins], axis=1)
        rows = np.zeros((*spins.shape[:2], 4, 3))
        rows[:, 0, :3], rows[:, 1:, :3] = end, along.lifted @ turned[:, None]
        # The action is quadratic in the difference of both: half of its change goes with each.
        by_wheels = (along.wheels[:, None] @ along.attitudes @ turned)[:, 0]
        rows[:, 0, 3] = 2.0 * (self.motion.momentum @ end) + by_wheels + weighted
        rows[:, 1, 3] = weighted
        return spins, rows

    def _results(
        self, changes: _Changes, *, by_momentum: bool = False, turned_start: Array | None = None
    ) -> ResultDerivative:
        """Derivatives of all results, from the turns of the ends.

        by_momentum: whether the numbers are the components of the momentum
        turned_start: (3, m) turns of the start, inertial axes
        """
        total, holonomy, dynamical, wheels = self._rotations
        of_total, of_holonomy = changes.end, changes.lifted[0]
        # Without wheels there is one lift, and exactly no such turn.
        of_wheels = changes.lifted[-1] - wheels @ of_holonomy if len(changes.lifted) > 1 else 0.0 * of_holonomy
        if turned_start is not None:
            of_total, of_holonomy = of_total - total @ turned_start, of_holonomy - holonomy @ turned_start
        momentum = self.motion.momentum
        magnitude = float(np.linalg.norm(momentum))
        if not magnitude:
            none = np.zeros(changes.action.shape)
            return ResultDerivative(
                changes.end, of_total, of_holonomy, of_wheels, of_wheels, 0.0 * of_total, none, none, none
            )
        of_dynamical = of_total - dynamical @ of_holonomy
        axis = momentum / magnitude
        by_turn, by_axis = self._twist_slopes
        dynamic, montgomery = changes.action / magnitude, by_turn @ of_dynamical
        if by_momentum:
            dynamic = dynamic - self._dynamic_phase * axis / magnitude
            montgomery = montgomery + (by_axis - (by_axis @ axis) * axis) / magnitude
        phases = dynamic, dynamic - montgomery, montgomery
        of_momentum = of_dynamical - dynamical @ wheels.T @ of_wheels
        return ResultDerivative(changes.end, of_total, of_holonomy, of_dynamical, of_wheels, of_momentum, *phases)

    @cached_property
    def _rotations(self) -> tuple[Array, Array, Array, Array]:
        """The total rotation, the holonomy, the dynamical rotation and that by wheels alone."""
        motion = self.motion
        start = motion.initial_attitude
        closure = np.eye(3) if motion.deformation.closure is None else motion.deformation.closure
        total = motion.final_attitude @ closure @ start.T
        holonomy = start @ motion.horizontal_lift.end[0] @ closure @ start.T
        lifts = (lift.end for lift in (motion.lift_without_momentum, motion.lift_with_errors))
        alone, by_shape = (start @ end for end in lifts)
        return total, holonomy, total @ holonomy.T, alone @ by_shape.T

    @cached_property
    def _twist_slopes(self) -> tuple[Array, Array]:
        """Derivatives of the twist of the dynamical rotation about the momentum (its swing taken off): (3,) each.

        By a turn of the rotation, exp(hat(turn)) rotation, and by the axis.
        """
        momentum, quaternion = self.motion.momentum, so3.quat_from_matrix(self._rotations[2])
        axis, vector, scalar = momentum / np.linalg.norm(momentum), quaternion[:3], quaternion[3]
        along = vector @ axis
        by_turn = scalar * (scalar * axis + so3.hat(vector) @ axis) + along * vector
        square = scalar * scalar + along * along
        return by_turn / square, 2.0 * scalar * vector / square

    @property
    def _dynamic_phase(self) -> float:
        """Dynamic phase in the horizontal gauge [rad]."""
        along, momentum = self._along, self.motion.momentum
        relative = along.spins - along.lifted_spins[:, 0]
        body_momentum = so3.apply(so3.transpose(along.attitudes), momentum)
        return float(along.weights @ (relative * body_momentum).sum(axis=-1) / np.linalg.norm(momentum))


def _changes(sums: Array) -> _Changes:
    """Changes from the sums of products with `Derivatives._weights`: (4 (1 + C), m)."""
    by_curve = sums.reshape(-1, 4, sums.shape[1])
    return _Changes(by_curve[0, :3], by_curve[1:, :3], by_curve[:, 3].sum(axis=0))


def derivatives(motion: Motion) -> Derivatives:
    """The exact derivatives of a motion's results by its path, its body's inertias, momentum and initial attitude.

    Equations :eq:`added-momentum` and :eq:`adjoint` of the documentation.

    Raises
    ------
    WrongObjectError
        If it is not a motion of an articulated body.
    ShapeError
        If the motion is a batch.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> sp.derivatives(motion).by_momentum.final_attitude.shape
    (3, 3)
    """
    return Derivatives(motion)


class Described(NamedTuple):
    """What a motion of a body with joints is made of.

    body : with the wheels
    path : of the joints that are not wheels
    route : the path with columns for all joints
    rotors : wheels
    """

    body: Body
    path: ShapePath
    route: ShapePath
    rotors: tuple[Rotor, ...]

    def at(self, times: Array, shapes: Array, rates: Array) -> BodyAlong:
        """The body at times (N,), with the shapes and rates of the route there, (N, n) each."""
        return BodyAlong(self.body, times, shapes, rates, WheelsAlong(self.body, self.rotors, times, shapes, rates))


def described_by(motion: Motion | ForcedMotion) -> Described:
    """What a motion is made of; WrongObjectError and ShapeError as for `derivatives`."""
    if not isinstance(motion, ForcedMotion):
        check_object(motion, "Motion", "motion")
    if motion.batch:
        raise ShapeError(f"derivatives are those of one motion, this is a batch of {motion.batch}; reconstruct one")
    return deformation_parts(motion.deformation)


def deformation_parts(deformation: Deformation) -> Described:
    """What a deformation is made of. Raises WrongObjectError where it is not that of a body with joints."""
    description = deformation.description
    if isinstance(description, RotorDescription):
        return Described(description.platform, description.driven_path, description.route, description.rotors)
    if not isinstance(description, ArticulatedDescription):
        raise WrongObjectError("derivatives by path and inertias need an articulated body, made by `articulated`")
    return Described(description.body, description.path, description.path, ())


def fit_by_knots(motion: Motion, times: Array, by_attitudes: Array, by_rates: Array) -> Array:
    """Derivative of the fit by the path at its knots: (6, knots n); the last arguments are of `RecordedMomentum`."""
    body_along, along, rows = _by_added_momentum(motion, times, by_attitudes)
    samples = path_samples(described_by(motion).path)
    by_knots = body_along.by_knots(samples, along.spins[:, None], rows[:, None])
    if by_rates.any():
        body_then, spins, rows = _by_momentum_at_rates(motion, times, by_rates)
        by_knots = by_knots + body_then.by_knots(samples, spins[:, None], rows[:, None])
    return by_knots


def fit_by_inertias(motion: Motion, times: Array, by_attitudes: Array, by_rates: Array) -> Array:
    """Derivative of the fit by the ten parameters of each frame, in the order of `by_inertias`: (6, 10 (k + 1))."""
    body_along, along, rows = _by_added_momentum(motion, times, by_attitudes)
    by_inertias = body_along.by_inertias(along.spins[:, None], rows[:, None])
    if by_rates.any():
        body_then, spins, rows = _by_momentum_at_rates(motion, times, by_rates)
        by_inertias = by_inertias + body_then.by_inertias(spins[:, None], rows[:, None])
    return by_inertias


def _by_momentum_at_rates(motion: Motion, times: Array, by_rates: Array) -> tuple[BodyAlong, Array, Array]:
    """Body and spins at the recorded rates, and the change of the fit by a unit of I omega + L_o there: (N, 6, 3).

    At one attitude the reconstructed rate falls by I^-1 times that change; the recorded one stays.
    """
    described = described_by(motion)
    inertia, _ = motion.deformation.description.sample(times)
    by_rate = np.moveaxis(by_rates.reshape(len(by_rates), -1, 3), 1, 0)
    rows = by_rate @ inverse_inertia(inertia)
    return described.at(times, *described.route.curve(times)), motion.angular_velocity(times), rows


def fit_by_rotors(motion: Motion, times: Array, by_attitudes: Array, by_rates: Array) -> Array:
    """Derivative of the fit by the wheels' values: (6, W)."""
    body_along, _, rows = _by_added_momentum(motion, times, by_attitudes)
    by_rotors = body_along.wheels.by_values(rows[:, None])
    if by_rates.any():
        body_then, _, rows = _by_momentum_at_rates(motion, times, by_rates)
        by_rotors = by_rotors + body_then.wheels.by_values(rows[:, None])
    return by_rotors


def _by_added_momentum(motion: Motion, times: Array, by_attitudes: Array) -> tuple[BodyAlong, AlongMotion, Array]:
    """Body and motion at nodes, and the change of the fit by a unit of internal momentum there, base axes: (M, 6, 3).

    A change turns the attitude at each recorded time by eta(t_k) of `_along_motion`. The recording stays, so that the
    fit moves like one to attitudes turned by -eta(t_k).
    """
    described = described_by(motion)
    along = along_motion(motion, described.route, times)
    # Turns at the recorded times from the turn at the end by an equal change.
    from_end = np.linalg.inv(along.adjoint_at_start.T)
    at_times = responses(motion, times)[:, :, :3] @ from_end
    by_turn = np.moveaxis(by_attitudes.reshape(len(by_attitudes), -1, 3), 1, 0)
    by_end = by_turn @ so3.transpose(motion.attitude(times)) @ at_times
    # A change at a node turns only the attitudes recorded later.
    later = np.concatenate([np.cumsum(by_end[::-1], axis=0)[::-1], np.zeros((1, *by_end.shape[1:]))])
    carried = so3.transpose(along.adjoint) @ along.attitudes @ along.inverse
    rows = along.weights[:, None, None] * (later[np.searchsorted(times, along.times)] @ carried)
    return described.at(along.times, along.shapes, along.rates), along, rows


def turns_by_start(motion: Motion, times: Array) -> Array:
    """Derivatives of the attitude's turns at N times, base axes, by turn of the start and momentum: (3 N, 6)."""
    turned = so3.transpose(motion.attitude(times)) @ responses(motion, times)
    turned[:, :, :3] = turned[:, :, :3] @ motion.initial_attitude
    return turned.reshape(-1, turned.shape[2])


def turns_by_shapes(motion: Motion, times: Array, by_turns: Array) -> tuple[Array, Array, Array]:
    """Derivatives of numbers that depend on attitudes, by shapes and rates of joints that are no wheels, at M nodes.

    by_turns : (r, 3 N) of the numbers by turns of the attitudes at N times, base axes

    Returns the times of the nodes (M,) and both, (M, r, n), to be summed over the nodes.
    """
    # A change that turns the attitudes moves a fit to them as their turns backwards do.
    body_along, along, rows = _by_added_momentum(motion, times, -by_turns)
    return along.times, *body_along.by_shapes(along.spins[:, None], rows[:, None])
