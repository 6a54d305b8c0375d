"""How the results of a motion answer to small changes of everything that they depend on."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from .. import so3
from ..arguments import check_object
from ..arrays import Array, lock_arrays
from ..body.body import Body
from ..body.inertial_regressor import by_link_parameters, link_motions
from ..deformation.descriptions import ArticulatedDescription
from ..display import short_repr
from ..errors import ShapeError, WrongObjectError
from ..reconstruction.reconstruction import Motion
from ..shape_space.path_samples import PathSamples, path_samples
from ..shape_space.shape_path import ShapePath
from ._along_motion import along_motion


@dataclass(frozen=True, eq=False)
class ResultDerivative:
    """The derivatives of what `split` gives by m numbers; a change c of these changes the results by derivative @ c.

    A rotation D becomes exp(hat(derivative @ c)) D: the vectors are in inertial axes.

    Attributes
    ----------
    final_attitude, total_rotation, holonomy, dynamical_rotation : (3, m) [rad per unit]
    dynamic_phase, solid_angle, montgomery_phase : (m,) in the horizontal gauge [rad per unit]; without momentum zero

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> sp.derivatives(motion).by_momentum.dynamic_phase.shape
    (3,)
    """

    final_attitude: Array
    total_rotation: Array
    holonomy: Array
    dynamical_rotation: Array
    dynamic_phase: Array
    solid_angle: Array
    montgomery_phase: Array

    __post_init__ = lock_arrays
    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class _Changes:
    """By m numbers: turns of the ends of the motion and of its lift, inertial axes (3, m), and of l . G l (m,)."""

    end: Array
    lifted: Array
    action: Array


class Derivatives:
    """The exact derivatives of a motion's results, each found when it is first needed.

    One integral along the motion serves all numbers of a kind, however many there are: its integrand is carried to
    the end by the adjoint of the attitude equation.

    Attributes
    ----------
    motion : whose they are
    body, path : what moved, and how

    Notes
    -----
    Source: theory.md section 8.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> found = sp.derivatives(motion).by_momentum
    >>> print(f"{found.dynamic_phase[2]:.3f} rad per kg m^2/s")
    58.372 rad per kg m^2/s
    """

    def __init__(self, motion: Motion) -> None:
        self.motion = motion
        self.body, self.path = described_by(motion)
        self._along = along_motion(motion, self.body, self.path)

    @cached_property
    def by_momentum(self) -> ResultDerivative:
        """By the momentum, inertial axes: m = 3 [per kg m^2/s]."""
        along = self._along
        turning = along.attitudes @ along.inverse @ so3.transpose(along.attitudes)
        end = np.einsum("n,nba,nbc->ac", along.weights, along.adjoint, turning)
        return self._results(_Changes(end, np.zeros((3, 3)), 2.0 * self.motion.momentum @ end), by_momentum=True)

    @cached_property
    def by_attitude(self) -> ResultDerivative:
        """By a turn of the start, R(0) exp(hat(delta)): m = 3, base axes."""
        start = self.motion.initial_attitude
        end = self._along.adjoint_at_start.T @ start
        momentum = self.motion.momentum
        action = 2.0 * momentum @ (end - start)
        return self._results(_Changes(end, start, action), turned_start=start)

    @cached_property
    def by_samples(self) -> ResultDerivative:
        """By the samples that the path was put through: m = N n, row by row of the (N, n) samples [per rad or m].

        Of a recording that was closed, smoothed or resampled, by all of its samples as they were recorded, at the
        penalty of the smoothing as it is.

        Raises
        ------
        WrongObjectError
            If the path is not `ShapePath.spline` or `ShapePath.waypoints` through samples, nor a recording.
        """
        samples, by_knots = self._samples, self.by_knots
        return ResultDerivative(
            *(
                samples.by_samples(part.reshape(-1, part.shape[-1])).reshape(*part.shape[:-1], -1)
                for part in (getattr(by_knots, field.name) for field in fields(by_knots))
            )
        )

    @cached_property
    def by_knots(self) -> ResultDerivative:
        """The same by the values of the path at its knots, of a periodic path without the last."""
        along, body = self._along, self.body
        of_shape = np.swapaxes(body.angular_momentum_gradient(along.shapes, along.rates, along.spins), 1, 2)
        lifted = np.swapaxes(body.angular_momentum_gradient(along.shapes, along.rates, along.lifted_spins), 1, 2)
        matrix = body.momentum_matrix(along.shapes)
        relative = along.spins - along.lifted_spins
        by_shape = self._density(of_shape, lifted, np.einsum("na,nak->nk", relative, of_shape - lifted))
        by_rate = self._density(matrix, matrix, np.zeros((len(matrix), body.n_shape)))
        found = self._samples.by_knots(along.times, by_shape, by_rate)
        return self._results(_Changes(found[:3], found[3:6], found[6]))

    @cached_property
    def by_inertias(self) -> ResultDerivative:
        """By masses, first moments and inertias of the frames of `body.chain`: m = 10 (k + 1).

        Of each frame: mass [kg], first moment (3) [kg m] and inertia xx yy zz yz xz xy [kg m^2], both about the point
        where its centre of mass is, axes of the frame.
        """
        along = self._along
        links = link_motions(self.body.chain, along.shapes, along.rates)
        relative = along.spins - along.lifted_spins
        weighted = along.weights[:, None] * relative
        carried, lifted = self._carried()
        rows = np.concatenate([carried, 2.0 * weighted[:, None]], axis=1)
        of_motion = by_link_parameters(links, rows, along.spins)
        of_lift = by_link_parameters(links, lifted, along.lifted_spins)
        (squares,) = by_link_parameters(links, weighted[:, None], relative, moving=False)
        action = 2.0 * self.motion.momentum @ of_motion[:3] + of_motion[3] - squares
        return self._results(_Changes(of_motion[:3], of_lift, action))

    @property
    def _samples(self) -> PathSamples:
        return path_samples(self.path)

    def _carried(self) -> tuple[Array, Array]:
        """What a unit of angular momentum at each node turns both ends by: (N, 3, 3) each."""
        along = self._along
        minus = -along.weights[:, None, None]
        inverse = minus * along.inverse
        return so3.transpose(along.adjoint) @ along.attitudes @ inverse, along.lifted @ inverse

    def _density(self, of_motion: Array, of_lift: Array, squares: Array) -> Array:
        """What each node adds to turns of both ends and to the action, per unit of each number: (N, 7, m).

        of_motion, of_lift: (N, 3, m) the angular momentum that a unit adds at the spins of both
        squares: (N, m) w . dI w with w = I^-1 Pi
        """
        along, momentum = self._along, self.motion.momentum
        carried, lifted = self._carried()
        whole = np.empty((len(squares), 7, squares.shape[1]))
        whole[:, :3] = carried @ of_motion
        whole[:, 3:6] = lifted @ of_lift
        relative = along.spins - along.lifted_spins
        whole[:, 6] = 2.0 * np.einsum("a,nam->nm", momentum, whole[:, :3]) + along.weights[:, None] * (
            2.0 * np.einsum("na,nam->nm", relative, of_motion) - squares
        )
        return whole

    def _results(
        self, changes: _Changes, *, by_momentum: bool = False, turned_start: Array | None = None
    ) -> ResultDerivative:
        """Of all results, from the turns of both ends.

        by_momentum: whether the numbers are the components of the momentum
        turned_start: (3, m) turns of the start, inertial axes
        """
        motion = self.motion
        start, momentum = motion.initial_attitude, motion.momentum
        magnitude = float(np.linalg.norm(momentum))
        closure = np.eye(3) if motion.deformation.closure is None else motion.deformation.closure
        total = motion.final_attitude @ closure @ start.T
        holonomy = start @ motion.horizontal_lift.end[0] @ closure @ start.T
        of_total, of_holonomy = changes.end, changes.lifted
        if turned_start is not None:
            of_total, of_holonomy = of_total - total @ turned_start, of_holonomy - holonomy @ turned_start
        none = np.zeros(changes.action.shape)
        if not magnitude:
            parts = (0.0 * of_total, none, none, none)
        else:
            dynamical = total @ holonomy.T
            of_dynamical = of_total - dynamical @ of_holonomy
            axis = momentum / magnitude
            of_axis = (np.eye(3) - np.outer(axis, axis)) / magnitude if by_momentum else np.zeros((3, len(none)))
            dynamic = changes.action / magnitude
            if by_momentum:
                dynamic = dynamic - self._dynamic_phase * axis / magnitude
            montgomery = _twist_slope(dynamical, axis, of_dynamical, of_axis)
            parts = (of_dynamical, dynamic, dynamic - montgomery, montgomery)
        return ResultDerivative(changes.end, of_total, of_holonomy, *parts)

    @property
    def _dynamic_phase(self) -> float:
        """In the horizontal gauge [rad]."""
        along, momentum = self._along, self.motion.momentum
        relative = along.spins - along.lifted_spins
        body_momentum = so3.apply(so3.transpose(along.attitudes), momentum)
        return float(along.weights @ (relative * body_momentum).sum(axis=-1) / np.linalg.norm(momentum))


def derivatives(motion: Motion) -> Derivatives:
    """The exact derivatives of a motion's results by its path, its body's inertias, momentum and initial attitude.

    Raises
    ------
    WrongObjectError
        If it is no motion of an articulated body.
    ShapeError
        If the motion is a batch.

    Notes
    -----
    Equation :eq:`adjoint` of the documentation.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> found = sp.derivatives(motion).by_momentum
    >>> found.final_attitude.shape
    (3, 3)
    """
    return Derivatives(motion)


def described_by(motion: Motion) -> tuple[Body, ShapePath]:
    """The body and the path of a motion; WrongObjectError and ShapeError as for `derivatives`."""
    check_object(motion, "Motion", "motion")
    if motion.batch:
        raise ShapeError(f"derivatives are those of one motion, this is a batch of {motion.batch}; reconstruct one")
    description = motion.deformation.description
    if not isinstance(description, ArticulatedDescription):
        raise WrongObjectError("derivatives by path and inertias need an articulated body, made by `articulated`")
    return description.body, description.path


def _twist_slope(rotation: Array, axis: Array, turn: Array, of_axis: Array) -> Array:
    """Of the angle about an axis that is left when the shortest tilt of the axis is taken off a rotation: (m,).

    turn: (3, m) of the rotation, exp(hat(turn)) rotation
    of_axis: (3, m) how the axis itself changes
    """
    quaternion = so3.quat_from_matrix(rotation)
    vector, scalar = quaternion[:3], quaternion[3]
    of_scalar = -0.5 * vector @ turn
    of_vector = 0.5 * (scalar * turn + np.cross(turn, vector, axis=0))
    along = vector @ axis
    of_along = axis @ of_vector + vector @ of_axis
    return 2.0 * (scalar * of_along - along * of_scalar) / (scalar * scalar + along * along)
