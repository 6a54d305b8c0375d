"""A free-floating body: its locked inertia and the angular momentum that its joint motions carry."""

from __future__ import annotations

# Pinocchio fills its namespace at import time, which a type checker cannot follow.
# pyright: reportAttributeAccessIssue=false
import math
import threading
from collections.abc import Iterable, Mapping
from copy import copy
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import made_by, positive_argument, vector_argument
from ..arrays import Array, finite_array
from ..card_pictures import sticks_picture
from ..display import Card, card_html, frozen, numbers
from ..errors import ShapeError, unknown_name
from ..inertia_tensor import second_moment
from ..letters import value_text
from ._centroidal_maps import (
    angular_map,
    angular_map_rate,
    centres_of_mass,
    full_map,
    internal_momenta,
    kinetic_energies,
    momentum_gradients,
)
from ._model_tree import model_with, model_with_wheel, moving_joints
from .couplings.coordinate_map import CoordinateMap
from .couplings.coupling import Coupling
from .couplings.joint_map import JointMap
from .family import BodyFamily, Given, given_inertias
from .joint_chain import joint_chain
from .link_motions import link_motions
from .link_tree import Joint, JointOrder
from .shape_arguments import ShapeArguments

_MOST_NAMED = 4  # joints on a card: they fit on one line


@frozen
class MovingPart:
    """Links that are fixed to each other, and their inertia together, in the axes of the first.

    Attributes
    ----------
    links : their names
    mass : [kg]
    centre : (3,) centre of mass [m]
    inertia : (3, 3) about the centre of mass [kg m^2]

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> [part.mass for part in cat.moving_parts]
    [1.0, 0.0, 0.0, 1.0]
    """

    links: tuple[str, ...]
    mass: float
    centre: Array
    inertia: Array


@made_by("load_body(file or name)")
class Body(ShapeArguments):
    """A tree of rigid links that floats freely; its shape is the vector of its independent joints.

    Made by `load_body`. All quantities are in base axes, about the centre of mass of the whole body where
    that matters (theory.md section 1). Shapes may have any leading axes. A Body can be pickled and used from
    several threads.

    Attributes
    ----------
    name : of the body
    sha256, file : of the file it was loaded from, and where that was; None without a file
    packages : folders that were searched for the packages that the file names
    xacro_args : the arguments that its xacro file was expanded with
    joint_names : tuple of the independent joints, in the order of the shape vector; of a ball joint "shoulder" its
        four numbers "shoulder.x", "shoulder.y", "shoulder.z" and "shoulder.w"
    n_shape : number of their coordinates
    rate_names : of the rates of the independent joints, in the same order; of a ball joint "shoulder" the components
        "shoulder.wx", "shoulder.wy", "shoulder.wz" of its angular velocity in axes of the link that it moves
    n_rates, rate_units, rate_columns : number of those, "rad" or "m" for each, and the coordinate of each; of a ball
        joint its first
    ball_joints : names of the ball joints
    link_names : of all links, those fixed to others included
    mass : [kg]
    joint_limits : (n, 2) lower and upper [rad or m], infinite for continuous joints
    rate_limits : (n,) the largest rates that the file states [rad/s or m/s], infinite where it states none or zero
    effort_limits : (n,) the largest torques or forces of their motors that it states [N m or N]
    joint_units : "rad" or "m" for each joint, "1" for the four numbers of a ball joint, which may have any length: the
        joint's turn is that of the quaternion of length one
    continuous : (n,) True for a joint that turns without end: shapes 2 pi apart are the same
    chain : its links and joints as plain numbers
    couplings : by the name of each joint that follows others, how it does
    joint_orders : the orders in which simulators number the joints of its file; none without a file
    base_joints : of its file, those that lead from a world without mass to the base, whose recorded motion they are
    base_angles : names and axes of the angles by which its file turns the base; None where it names none
    base_slides : names of what its file moves the base along x, y and z by; None where it names none
    length_unit : of the lengths in its file [m]; None where its format has a unit of its own

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> cat.joint_names, round(cat.mass, 6)
    (('waist_pitch', 'waist_yaw', 'waist_roll'), 2.0)
    """

    def __init__(self, model: pin.Model, name: str, couplings: Mapping[str, Coupling] | None = None) -> None:
        self._model = model
        self._local = threading.local()
        self.name = name
        self.sha256: str | None = None
        self.file: Path | None = None
        self.packages: tuple[str, ...] = ()
        self.xacro_args: dict[str, str] = {}
        self.joint_orders: tuple[JointOrder, ...] = ()
        self.base_joints: tuple[Joint, ...] = ()
        self.base_angles: tuple[tuple[str, ...], str] | None = None
        self.base_slides: tuple[str, ...] | None = None
        self.length_unit: float | None = None
        self.mass = float(pin.computeTotalMass(model))
        self.couplings: Mapping[str, Coupling] = dict(couplings or {})
        self._joints = JointMap(model, pin.neutral(model), self.couplings)
        self.chain = joint_chain(model, self._joints.follows)
        self.joint_names, self.joint_units = self._joints.names, self._joints.units
        self.joint_limits, self.continuous = self._joints.limits, self._joints.continuous
        self.rate_limits, self.effort_limits = self._joints.rate_limits, self._joints.effort_limits
        self.rate_names, self.rate_units = self._joints.rate_names, self._joints.rate_units
        self.rate_columns, self.n_rates = self._joints.rate_columns, len(self.rate_names)
        self.ball_joints = tuple(ball.name for ball in self.chain.follows.balls)
        self.link_names = tuple(f.name for f in model.frames if f.type == pin.FrameType.BODY)

    @property
    def follows(self) -> CoordinateMap:
        """Coordinates of all joints from the shape."""
        return self.chain.follows

    @property
    def n_joints(self) -> int:
        """The number of independent joints, where a ball joint is one."""
        return self.n_shape - 3 * len(self.ball_joints)

    @property
    def moving_parts(self) -> tuple[MovingPart, ...]:
        """The base and what each joint moves, in Pinocchio's order; only those that have links."""
        frames: dict[int, list[Any]] = {}
        for frame in self._model.frames:
            if frame.type == pin.FrameType.BODY:
                frames.setdefault(frame.parentJoint, []).append(frame)
        parts = []
        for joint, inertia in enumerate(self._model.inertias.tolist()):
            if joint in frames:
                own = frames[joint][0].placement.actInv(inertia)
                names = tuple(frame.name for frame in frames[joint])
                parts.append(MovingPart(names, own.mass, np.array(own.lever), np.array(own.inertia)))
        return tuple(parts)

    def __repr__(self) -> str:
        """One line for people."""
        return f"Body({self.name!r}, {self.n_joints} joints, {self.mass:.6g} kg)"

    _repr_html_ = card_html

    def _card(self) -> Card:
        """Name, mass, principal moments and joints, with its frames as sticks in the neutral shape."""
        shape = self.shape()
        named = ", ".join(self.joint_names[:_MOST_NAMED]) + (", …" if self.n_shape > _MOST_NAMED else "")
        rows = [
            ("mass", numbers(self.mass, "kg")),
            ("links", f"{len(self.link_names)}"),
            ("joints", f"{self.n_joints}{f': {named}' if named else ''}"),
            ("centre of mass", numbers(self.centre_of_mass(shape), "m")),
            ("principal moments", numbers(np.linalg.eigvalsh(self.locked_inertia(shape)), "kg m^2")),
        ]
        motions = link_motions(self.chain, shape[None], np.zeros((1, self.n_shape)))
        centres, parents = motions.places[0], list(self.chain.parents)
        origins = centres - so3.apply(motions.turns[0], self.chain.centres)
        # From each frame to the joints that hang on it, and to the centre of mass of what moves with it.
        starts, ends = np.concatenate([origins[parents], origins]), np.concatenate([origins[1:], centres])
        return Card(f"Body {self.name!r}", rows, sticks_picture(starts, ends, "its joints"))

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the per-thread work space."""
        return {key: value for key, value in self.__dict__.items() if key != "_local"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore, with a fresh work space."""
        self.__dict__.update(state)
        self._local = threading.local()

    def shape(self, joints: Mapping[str, ArrayLike] | None = None) -> Array:
        """The shape with the named joints at the given coordinates and all others neutral: -> (n,) [rad or m].

        A ball joint is named as a whole, with its quaternion x, y, z, w.

        Raises
        ------
        UnknownNameError
            If a name is not one of `joint_names`.
        ShapeError
            If a coordinate is not one number, or that of a ball joint not four.
        """
        if joints is not None and not isinstance(joints, Mapping):
            raise ShapeError(f"joints by name are needed, a mapping such as {{'elbow': 0.3}}, got {value_text(joints)}")
        shape = self._joints.neutral.copy()
        for name, value in (joints or {}).items():
            coordinate = finite_array(value, f"joint {name}")
            if name in self.ball_joints and coordinate.shape == (4,) and coordinate.any():
                ball = self.chain.follows.balls[self.ball_joints.index(name)]
                shape[ball.columns] = coordinate / np.linalg.norm(coordinate)
                continue
            if name in self.ball_joints:
                raise ShapeError(f"ball joint {name}: a quaternion x, y, z, w is needed, got {value_text(value)}")
            if coordinate.ndim:
                raise ShapeError(f"joint {name}: one number is needed, got an array of shape {coordinate.shape}")
            shape[self.joint_index(name)] = coordinate
        return shape

    def with_inertias(
        self, masses: Given = None, centres: Given = None, inertias: Given = None, *, on_unphysical: str = "error"
    ) -> Body | BodyFamily:
        """Equal joints between links of other mass, centre of mass or rotational inertia: a body, or N of them.

        Each argument is for all moving parts, in the order of `moving_parts`, or for some: a mapping from the first
        link of a part. What is not given stays as it is. A leading axis N of anything that is given makes a
        `BodyFamily`, a sequence of N bodies that `articulated` and `reconstruct` take as one.

        Parameters
        ----------
        masses : (k,) or (N, k); of a link one number or (N,) [kg]
        centres : (k, 3) or (N, k, 3) centres of mass, axes of the part's first link; of a link (3,) or (N, 3) [m]
        inertias : (k, 3, 3) or (N, k, 3, 3) about the centre of mass, the same axes; of a link (3, 3) or (N, 3, 3)
            [kg m^2]
        on_unphysical : what to do with inertias that no distribution of mass has, by a negative principal moment or by
            the triangle inequality (to 0.1 %): "error", "warn" or "allow"

        Raises
        ------
        UnknownNameError, ShapeError
            For an unknown link, a link fixed to another, or arrays of the wrong shape.
        UnphysicalInertiaError
            For a mass that is not positive, a tensor that is not symmetric or, with "error", an impossible one.

        Warns
        -----
        UnphysicalInertiaWarning
            With "warn", for inertias that no distribution of mass has.
        """
        parts = tuple(part.links for part in self.moving_parts)
        given = {"masses": masses, "centres": centres, "inertias": inertias}
        changed = given_inertias(self.chain, parts, given, on_unphysical)
        return self.with_frame_inertias(*changed) if changed[0].ndim == 1 else BodyFamily(self, *changed)

    def with_frame_inertias(self, masses: Array, centres: Array, tensors: Array) -> Body:
        """The body with other inertias of all frames of its chain, in their axes, unchecked.

        Parameters
        ----------
        masses : (k + 1,) [kg]
        centres : (k + 1, 3) centres of mass [m]
        tensors : (k + 1, 3, 3) about them [kg m^2]
        """
        changed = copy(self)
        # The model has no frames between the three axes of a ball joint.
        between = [frame for ball in self.chain.follows.balls for frame in (ball.row + 1, ball.row + 2)]
        own = (np.delete(values, between, axis=0) for values in (masses, centres, tensors))
        changed._model = model_with(self._model, *own)
        changed.mass = float(pin.computeTotalMass(changed._model))
        changed.chain = self.chain.with_inertias(masses, centres, tensors)
        # It no longer agrees with its file.
        changed.sha256 = changed.file = None
        return changed

    def with_couplings(self, couplings: Mapping[str, Coupling]) -> Body:
        """The body with joints that follow others: their coordinates are functions of the others', and no longer
        of the shape.

        Joints that follow others already keep doing so, unless they are given another coupling here. Chains of joints
        that follow each other are followed to their end. The knots of a function are breaks of every motion: times at
        which a joint goes through one are found.

        Parameters
        ----------
        couplings : by name of a joint of the body

        Raises
        ------
        UnknownNameError
            For an unknown joint.
        ModelFileError
            If joints follow each other in a circle, or one that the body does not have.
        ShapeError
            If a value is not a `Coupling`.

        Examples
        --------
        >>> cat = sp.load_body("cat_two_halves")
        >>> bent = cat.with_couplings({"waist_roll": sp.body.Coupling.polynomial("waist_pitch", [0.0, 0.0, 1.5])})
        >>> bent.joint_names, sp.mechanical_connection(bent, [0.2, 0.0]).shape
        (('waist_pitch', 'waist_yaw'), (3, 2))
        """
        if not isinstance(couplings, Mapping):
            came = value_text(couplings)
            raise ShapeError(
                f"couplings by joint are needed, such as {{'knee': Coupling.linear('hip', 0.5)}}, got {came}"
            )
        joints = tuple(moving_joints(self._model))
        for name, coupling in couplings.items():
            if name not in joints:
                raise unknown_name(f"joint of {self.name}", name, joints)
            if not isinstance(coupling, Coupling):
                raise ShapeError(f"joint {name}: a Coupling is needed, got {value_text(coupling)}")
        return self._remade(self._model, {**self.couplings, **couplings})

    def with_wheel(self, axis: ArrayLike, inertia: float, *, name: str = "wheel_1", link: str | None = None) -> Body:
        """The body with a wheel of which its file has the mass, but no joint: one more joint without end.

        The wheel is taken out of the inertia of a link, at the centre of mass of what moves with it, so that mass and
        locked inertia of the whole stay as they are. It is a flat disc with the radius of gyration of the link.
        `articulated` takes what it stores by its name, as `rotors={"wheel_1": 1.5}`.

        Parameters
        ----------
        axis : (3,) of its axle, in axes of the link, of any length but zero
        inertia : J about the axle [kg m^2]
        name : of the joint, and of the link that it turns
        link : that carries it; None: the base

        Raises
        ------
        UnknownNameError
            For an unknown link.
        ShapeError
            For an axis of length zero, a name that the body has already, or a wheel that is more than the link holds:
            what is left must have an inertia that some distribution of mass has.
        TrajectoryError
            If the inertia is not above 0.

        Examples
        --------
        >>> cat = sp.load_body("cat_two_halves").with_wheel([0.0, 0.0, 1.0], 0.002)
        >>> cat.joint_names, round(cat.mass, 6)
        (('waist_pitch', 'waist_yaw', 'waist_roll', 'wheel_1'), 2.0)
        """
        frame = self._link_frame(self.link_names[0] if link is None else link)
        axle = vector_argument(axis, "axis")
        length = float(np.linalg.norm(axle))
        if length == 0.0:
            raise ShapeError("axis: a vector other than zero is needed, got [0, 0, 0]")
        about = positive_argument(inertia, "inertia", "a moment of inertia in kg m^2")
        taken = (*self.link_names, *self._model.names)
        if not isinstance(name, str) or not name or name in taken:
            raise ShapeError(f"name: one that {self.name} does not have is needed, got {value_text(name)}")
        return self._remade(model_with_wheel(self._model, frame, axle / length, about, name), self.couplings)

    def _remade(self, model: pin.Model, couplings: Mapping[str, Coupling]) -> Body:
        """A body of another model or with other couplings, with what else is known from its file."""
        changed = Body(model, self.name, couplings)
        for kept in ("joint_orders", "base_joints", "base_angles", "base_slides", "length_unit"):
            setattr(changed, kept, getattr(self, kept))
        return changed

    def joint_columns(self, names: Iterable[str]) -> list[int]:
        """The places of joints in the shape vector; of a ball joint, by its name or that of a number, all four.

        Raises
        ------
        UnknownNameError
            For an unknown joint.

        Examples
        --------
        >>> sp.load_body("cat_two_halves").joint_columns(["waist_roll", "waist_pitch"])
        [0, 2]
        """
        columns: set[int] = set()
        for name in names:
            balls = [ball for ball in self.chain.follows.balls if name == ball.name or name in ball.names]
            columns |= set(range(self.n_shape)[balls[0].columns]) if balls else {self.joint_index(name)}
        return sorted(columns)

    def rate_frame(self, shape: ArrayLike) -> Array:
        """Derivatives of the coordinates at unit rates of the joints: (..., n) -> (..., n, m), m = `n_rates`.

        One column a rate: for a joint of one axis its coordinate alone; for a ball joint with the four numbers p, the
        product of quaternions p (w, 0)/2, which keeps the length of p. So an array with an axis of coordinates, such as
        a momentum matrix or the columns of a connection, times this frame is the same for rates; two-forms such as the
        curvature take it twice.

        Examples
        --------
        >>> cat = sp.load_body("cat_two_halves")
        >>> cat.rate_frame(cat.shape()).tolist()  # no ball joints: rates are derivatives of coordinates
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        """
        r = self._checked(shape)
        return self._joints.frames(self._rows(r)).reshape(*r.shape, self.n_rates)

    def joint_rates(self, shape: ArrayLike, rate: ArrayLike) -> Array:
        """The rates of the joints from the derivatives of the shape: (..., n), (..., n) -> (..., m), m = `n_rates`.

        For a ball joint the angular velocity in axes of the link that it moves, relative to its parent link [rad/s].

        Examples
        --------
        >>> cat = sp.load_body("cat_two_halves")
        >>> cat.joint_rates(cat.shape(), [0.1, 0.2, 0.3]).tolist()
        [0.1, 0.2, 0.3]
        """
        r, v = self._pair(shape, rate)
        return self._joints.independent_rates(self._rows(r), self._rows(v)).reshape(*r.shape[:-1], self.n_rates)

    def locked_inertia(self, shape: ArrayLike) -> Array:
        """Inertia of the body frozen in a shape, about its centre of mass, base axes.

        Source: Cabrera 2006, section 2.3; theory.md A3.

        Parameters
        ----------
        shape : (..., n) [rad or m]

        Returns
        -------
        (..., 3, 3) [kg m^2]

        Raises
        ------
        ShapeError
            If the last axis is not the body's n joints, or an entry is not finite.
        """
        r = self._checked(shape)
        return angular_map(*self._maps(), self._rows(r))[:, :, :3].reshape(*r.shape[:-1], 3, 3)

    def momentum_matrix(self, shape: ArrayLike) -> Array:
        """J(r), the angular momentum per unit joint rate with the base at rest: L_o = J(r) rate.

        Raises like `locked_inertia`. Equation :eq:`internal-momentum` of the documentation.
        Source: theory.md A7.

        Parameters
        ----------
        shape : (..., n) [rad or m]

        Returns
        -------
        (..., 3, n) about the centre of mass, base axes [kg m^2/s per unit of joint rate]
        """
        r = self._checked(shape)
        return angular_map(*self._maps(), self._rows(r))[:, :, 3:].reshape(*r.shape[:-1], 3, self.n_shape)

    def angular_map_gradient(self, shape: ArrayLike) -> Array:
        """d[I, J]/dr_k, both of the above side by side in half the time: (..., n) -> (..., n, 3, 3 + n)."""
        r = self._checked(shape)
        n = self.n_shape
        shapes = np.repeat(self._rows(r), n, axis=0)
        rates = np.tile(np.eye(n), (math.prod(r.shape[:-1]), 1))
        return angular_map_rate(*self._maps(), shapes, rates).reshape(*r.shape[:-1], n, 3, 3 + n)

    def inertia_rate(self, shape: ArrayLike, rate: ArrayLike) -> Array:
        """dI/dt along a joint motion, exact: (..., n), (..., n) -> (..., 3, 3) [kg m^2/s]."""
        r, v = self._pair(shape, rate)
        flat = angular_map_rate(*self._maps(), self._rows(r), self._rows(v))
        return flat[:, :, :3].reshape(*r.shape[:-1], 3, 3)

    def angular_momentum_gradient(self, shape: ArrayLike, rate: ArrayLike, base_rate: ArrayLike) -> Array:
        """Derivative of the angular momentum I w + J rate by each joint while w and the rates stay the same, exact.

        One call of Pinocchio for all joints (its derivatives of the centroidal momentum), where `inertia_gradient`
        and `momentum_matrix_gradient` take one for each.

        Parameters
        ----------
        shape, rate : (..., n) [rad or m], [rad/s or m/s]
        base_rate : (..., 3) w, angular velocity of the base, base axes [rad/s]

        Returns
        -------
        (..., n, 3) dI/dr_k w + dJ/dr_k rate, base axes [kg m^2/s per unit of joint]
        """
        r, v, w = self._with_base_rate(shape, rate, base_rate)
        gradients = momentum_gradients(*self._maps(), self._rows(r), self._rows(v), w.reshape(-1, 3))
        return np.swapaxes(gradients, -1, -2).reshape(*r.shape, 3)

    def centre_of_mass(self, shape: ArrayLike) -> Array:
        """Centre of mass of the whole body from the base origin, base axes: (..., n) -> (..., 3) [m]."""
        r = self._checked(shape)
        return centres_of_mass(*self._maps(), self._rows(r)).reshape(*r.shape[:-1], 3)

    def link_pose(self, shape: ArrayLike, link: str) -> Array:
        """Pose of a link in base axes from the base origin: (..., n) -> (..., 4, 4).

        Raises
        ------
        UnknownNameError
            For an unknown link.
        """
        frame = self._link_frame(link)
        r = self._checked(shape)
        model, data = self._model, self._data()
        configurations = self._joints.configurations(self._rows(r))
        poses = np.empty((len(configurations), 4, 4))
        for row, q in enumerate(configurations):
            pin.forwardKinematics(model, data, q)
            poses[row] = pin.updateFramePlacement(model, data, frame).homogeneous
        return poses.reshape(*r.shape[:-1], 4, 4)

    def link_angular_velocity(self, shape: ArrayLike, rate: ArrayLike, link: str) -> Array:
        """Angular velocity of a link relative to the base: (..., n), (..., n) -> (..., 3), base axes [rad/s].

        Raises like `link_pose`.
        """
        frame = self._link_frame(link)
        r, v = self._pair(shape, rate)
        model, data = self._model, self._data()
        velocities = self._joints.velocities(self._rows(r), self._rows(v))
        turning = np.empty((len(velocities), 3))
        for row, (q, full) in enumerate(zip(self._joints.configurations(self._rows(r)), velocities, strict=True)):
            pin.forwardKinematics(model, data, q, full)
            turning[row] = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED).angular
        return turning.reshape(*r.shape[:-1], 3)

    def mass_correlation(self, shape: ArrayLike, rate: ArrayLike, reference: ArrayLike) -> tuple[Array, Array]:
        """The second moment of the mass between a shape and a reference shape, and its rate.

        Parameters
        ----------
        shape, rate : (..., n) [rad or m], [rad/s or m/s]
        reference : (n,)

        Returns
        -------
        correlation, its rate : (..., 3, 3) integral of r r_reference^T dm, each r from its own centre of mass, base
            axes [kg m^2], [kg m^2/s]

        Raises
        ------
        ShapeError
            If the reference is not one shape.
        """
        r, v = self._pair(shape, rate)
        still = self._checked(reference, "reference")
        if still.ndim != 1:
            raise ShapeError(f"reference: one shape ({self.n_shape},) is needed, got {still.shape}")
        masses, moments = self.chain.masses[:, None], second_moment(self.chain.inertias)
        then = link_motions(self.chain, still[None], np.zeros((1, self.n_shape)))
        now = link_motions(self.chain, self._rows(r), self._rows(v))
        reference_moments, weighted = moments @ so3.transpose(then.turns[0]), masses * then.places[0]
        correlation = so3.transpose(now.places) @ weighted + (now.turns @ reference_moments).sum(axis=1)
        slope = so3.transpose(now.speeds) @ weighted + (so3.hat(now.spins) @ now.turns @ reference_moments).sum(axis=1)
        matrix = (*r.shape[:-1], 3, 3)
        return correlation.reshape(matrix), slope.reshape(matrix)

    def kinetic_energy(self, shape: ArrayLike, rate: ArrayLike, angular_velocity: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
        """Kinetic energy of a joint motion and a turn of the base, about the centre of mass: -> (...) [J].

        Source: Cabrera 2006, equation (4); theory.md A6 (with the factor one half that C-E1 restores).

        Parameters
        ----------
        shape, rate : (..., n) [rad or m], [rad/s or m/s]
        angular_velocity : (..., 3) of the base, base axes [rad/s]; at rest it is T_0
        """
        r, v, omega = self._turning(shape, rate, angular_velocity)
        rows = self._rows(r), self._rows(v), omega.reshape(-1, 3)
        return kinetic_energies(*self._maps(), *rows).reshape(r.shape[:-1])

    def sample(self, shape: Array, rate: Array) -> tuple[Array, Array]:
        """Locked inertia and internal momentum along a trajectory: (N, n), (N, n) -> (N, 3, 3), (N, 3).

        Unchecked and in one pass: the library's own hot path.
        """
        whole = full_map(*self._maps(), shape)
        return whole[:, :, :3], internal_momenta(whole, self._joints, shape, rate)

    def sample_rates(self, shape: Array, rate: Array) -> tuple[Array, Array, Array, Array]:
        """I, J, dI/dt and dJ/dt along a trajectory: (N, n), (N, n) -> (N, 3, 3), (N, 3, n) and once more. Unchecked."""
        whole, slope = angular_map(*self._maps(), shape), angular_map_rate(*self._maps(), shape, rate)
        return whole[:, :, :3], whole[:, :, 3:], slope[:, :, :3], slope[:, :, 3:]

    def _link_frame(self, link: str) -> int:
        if not isinstance(link, str) or link not in self.link_names:
            raise unknown_name(f"link of {self.name}", link, self.link_names)
        return self._model.getFrameId(link, pin.FrameType.BODY)

    def _maps(self) -> tuple[pin.Model, pin.Data, JointMap]:
        return self._model, self._data(), self._joints

    def _data(self) -> pin.Data:
        try:
            return self._local.data
        except AttributeError:
            self._local.data = self._model.createData()
            return self._local.data
