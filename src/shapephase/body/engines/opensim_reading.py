"""OpenSim models (Seth and others 2018), as OpenSim itself reads them.

A custom joint becomes a chain of joints of one axis: three slides, then three turns. A coordinate that an axis follows
one to one is the joint of that axis; all other axes follow the coordinates by the functions of the file, exactly.
Coordinates of the joint to the ground are the free base.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ... import so3
from ...arrays import Array
from ...errors import ShapeError
from ..couplings.coupling import Coupling, circular
from ..couplings.functions import JointFunction, hermite, piecewise_linear, polynomial
from ..formats.xml_text import listed, quoted
from ..link_tree import Joint
from .chain import Chain, UnusableModelError, check_name
from .opensim_numbers import ends, engine, entries_of, loaded, pose_of, tensor_of, value_and_slope, vector_of
from .opensim_poses import add_poses

_CUBIC = 3
_FREE = 6  # coordinates of a body that floats
_UNITS = np.eye(3)
_NAMED = {"x": _UNITS[0], "y": _UNITS[1], "z": _UNITS[2]}
_TURN = "revolute"
_SLIDE = "prismatic"
# Axes of OpenSim's joints in order, and the coordinate of each.
_KNOWN = {
    "WeldJoint": (),
    "PinJoint": ((_TURN, _UNITS[2], 0),),
    "SliderJoint": ((_SLIDE, _UNITS[0], 0),),
    "UniversalJoint": ((_TURN, _UNITS[0], 0), (_TURN, _UNITS[1], 1)),
    "GimbalJoint": ((_TURN, _UNITS[0], 0), (_TURN, _UNITS[1], 1), (_TURN, _UNITS[2], 2)),
    "PlanarJoint": ((_SLIDE, _UNITS[0], 1), (_SLIDE, _UNITS[1], 2), (_TURN, _UNITS[2], 0)),
}


class _Axis(NamedTuple):
    """One axis of a joint; `name` is for a joint that follows coordinates."""

    name: str
    kind: str
    direction: Array
    rule: Coupling


class _Coordinate(NamedTuple):
    """A coordinate of the shape: with its limits; locked at a value; or following others."""

    kind: str
    limits: tuple[float, float]
    locked: float | None
    rule: Coupling | None


def chain_of(path: str, root_body: str | None = None) -> Chain:
    """Links and joints of an .osim file, on the body that is joined to the ground.

    root_body : that body, with all that hangs on it, where several are
    """
    engine().Logger.setLevelString("Off")
    engine().Logger.removeFileSink()
    content = Path(path).read_bytes()
    return _Reading(path, content.decode("utf-8", "replace"), root_body).chain()


class _Reading:
    """A file on its way to a chain."""

    def __init__(self, path: str, text: str, root_body: str | None) -> None:
        self._path, self._text = path, text
        self._model = loaded(path)
        self._joints = entries_of(self._model.getJointSet())
        self._chain = Chain(Path(path).stem)
        self._base = self._base_joint(root_body)
        self._bodies = self._tree()
        self._coordinates = self._known_coordinates()

    def chain(self) -> Chain:
        """All of it, with what OpenSim computes at some shapes."""
        base = ends(self._base)[1]
        for body in sorted(self._bodies, key=lambda one: one.getName() != base):
            name, line = body.getName(), self._fault("", body.getName()).line
            check_name(name, f"body {name!r}", line)
            self._chain.add_link(name, body.getMass(), vector_of(body.getMassCenter()), tensor_of(body), line)
        axes = {joint.getName(): self._axes(joint) for joint in self._joints if joint is not self._base}
        carriers = self._carriers(axes)
        self._add_bare_coordinates(base, axes, carriers)
        for joint in self._joints:
            if joint is not self._base:
                self._add_joint(joint, axes[joint.getName()], carriers)
        for name, coordinate in self._coordinates.items():
            if coordinate.rule is not None and any(name == joint.name for joint in self._chain.joints):
                self._chain.couplings[name] = self._unlocked(coordinate.rule)
        self._chain.base_angles = self._base_angles()
        if self._chain.base_angles is None:
            self._chain.base_joints = self._way()
        locked = {name: one.locked for name, one in self._coordinates.items()}
        add_poses(self._chain, self._path, base, {body.getName() for body in self._bodies}, locked)
        return self._chain

    def _fault(self, message: str, name: str) -> UnusableModelError:
        """A fault at the first line that has an object of this name."""
        before, match, _ = self._text.partition(f'name="{name}"')
        return UnusableModelError(message, before.count("\n") + 1 if match else 1)

    def _base_joint(self, root_body: str | None) -> Any:
        """The one joint to the ground. Raises UnusableModelError where there are several or none."""
        grounded = [joint for joint in self._joints if "ground" in ends(joint)]
        bodies = [ends(joint)[1] for joint in grounded]
        if root_body is not None and root_body not in bodies:
            names = listed([*map(repr, bodies)]) or "none"
            raise self._fault(
                f"root_body: {quoted(root_body)!r} is not joined to the ground; there is {names}", "ground"
            )
        if len(grounded) != 1 and root_body is None:
            named = listed([repr(joint.getName()) for joint in grounded]) or "none"
            most = max(bodies, key=lambda name: len(self._below(name)), default="")
            way = f"; say which by root_body={most!r} (--root-body {most})" if bodies else ""
            raise self._fault(
                f"one joint to the ground is needed, which is the base's, got {named}{way}",
                grounded[1].getName() if grounded else "ground",
            )
        above: dict[str, str] = {}
        for joint in self._joints:
            child, name = ends(joint)[1], joint.getName()
            if child in above:
                raise self._fault(
                    f"body {child!r} hangs on two joints, {above[child]!r} and {name!r}; closed chains are not read",
                    name,
                )
            above[child] = name
        joint = grounded[0 if root_body is None else bodies.index(root_body)]
        name, count, body = joint.getName(), joint.numCoordinates(), ends(joint)[1]
        if count < _FREE:
            text = f"joint {name!r} to the ground has {count} coordinates: {body!r} floats freely instead"
            self._chain.notes.append(text)
        return joint

    def _below(self, root: str) -> set[str]:
        """Names of the bodies that hang on one, and its own."""
        reached, more = {root}, {root}
        while more := {ends(joint)[1] for joint in self._joints if ends(joint)[0] in more} - reached:
            reached |= more
        return reached

    def _tree(self) -> list[Any]:
        """The bodies that hang on the base; those of other trees and their joints are left out."""
        bodies = entries_of(self._model.getBodySet())
        reached = self._below(ends(self._base)[1])
        if len(reached) < len(bodies):
            self._chain.notes.append(f"{len(bodies) - len(reached)} bodies that hang elsewhere are left out")
        self._joints = [joint for joint in self._joints if ends(joint)[1] in reached]
        return [body for body in bodies if body.getName() in reached]

    def _base_angles(self) -> tuple[list[str], str] | None:
        """The angles of the base, where each turns about one of the ground's axes as the others have turned it."""
        joint = engine().CustomJoint.safeDownCast(self._base)
        frames = (self._base.getParentFrame(), self._base.getChildFrame())
        if joint is None or any(np.any(pose_of(frame.findTransformInBaseFrame())[0] != np.eye(3)) for frame in frames):
            return None
        names, turned = [], ""
        for k in range(3):
            axis = joint.getSpatialTransform().getTransformAxis(k)
            place = [letter for letter, unit in _NAMED.items() if np.array_equal(vector_of(axis.getAxis()), unit)]
            drivers = axis.getCoordinateNames()
            if not place or drivers.size() != 1 or not axis.hasFunction():
                return None
            rule = self._rule(axis.getFunction(), [drivers.getValue(0)], joint.getName())
            if rule.start or len(rule.terms) != 1 or _sign(rule.terms[0][1]) != 1.0:
                return None
            names.append(drivers.getValue(0))
            turned += place[0]
        return (names, turned) if len(set(names)) == len(set(turned)) == len(names) else None

    def _way(self) -> list[Joint]:
        """The joints that move the base, as in a plane; none where one of its axes is a curve of a coordinate."""
        try:
            axes = self._own_axes(self._base)
        except UnusableModelError:
            return []
        terms = [term for axis in axes for term in axis.rule.terms]
        names = [name for name, _ in terms]
        if len(set(names)) < len(names) or not all(_sign(function) for _, function in terms):
            return []
        whole, self._chain = self._chain, Chain("")
        self._add_joint(self._base, axes, {axis.rule.terms[0][0]: axis.name for axis in axes if axis.rule.terms})
        way, self._chain = self._chain, whole
        return way.joints if way.moving() else []

    def _known_coordinates(self) -> dict[str, _Coordinate]:
        """By name; those of the base are not among them."""
        coordinates: dict[str, _Coordinate] = {}
        couplers = self._couplers()
        for joint in self._joints:
            for k in range(joint.numCoordinates() if joint is not self._base else 0):
                coordinate = joint.get_coordinates(k)
                name = coordinate.getName()
                check_name(name, f"coordinate {name!r}", self._fault("", name).line)
                if name in coordinates:
                    raise self._fault(f"two coordinates are named {name!r}; give each a name of its own", name)
                if coordinate.getDefaultIsPrescribed():
                    self._chain.notes.append(("coordinate", repr(name), "prescribed in the file, free to move here"))
                clamped = coordinate.getDefaultClamped()
                limits = (coordinate.getRangeMin(), coordinate.getRangeMax()) if clamped else (-np.inf, np.inf)
                locked = coordinate.getDefaultValue() if coordinate.getDefaultLocked() else None
                sliding = coordinate.getMotionType() == engine().Coordinate.Translational
                rule = None if locked is not None else couplers.get(name)
                coordinates[name] = _Coordinate(_SLIDE if sliding else _TURN, limits, locked, rule)
        for name, rule in couplers.items():
            if name not in coordinates:
                continue
            for driver, _ in rule.terms:
                if driver not in coordinates:
                    raise self._fault(f"coordinate {name!r} follows {driver!r}, which is the base's or unknown", name)
        if (name := circular({name: rule for name, rule in couplers.items() if name in coordinates})) is not None:
            raise self._fault(f"coordinate {name!r} follows itself, by way of others; remove a coupler", name)
        return coordinates

    def _couplers(self) -> dict[str, Coupling]:
        """Couplings of coordinates that follow others."""
        couplers = {}
        for constraint in entries_of(self._model.getConstraintSet()):
            if not constraint.get_isEnforced():
                continue
            coupler = engine().CoordinateCouplerConstraint.safeDownCast(constraint)
            if coupler is None:
                kind = constraint.getConcreteClassName()
                text = "ignored, its joints are free to move"
                self._chain.notes.append((kind, repr(constraint.getName()), text))
                continue
            drivers = entries_of(coupler.getIndependentCoordinateNames())
            couplers[coupler.getDependentCoordinateName()] = self._rule(
                coupler.getFunction(), drivers, coupler.getName()
            )
        return couplers

    def _own_axes(self, joint: Any) -> list[_Axis]:
        """The axes of a joint in the order in which they move what is behind them."""
        name, kind = joint.getName(), joint.getConcreteClassName()
        if kind == "CustomJoint":
            transform = engine().CustomJoint.safeDownCast(joint).getSpatialTransform()
            axes = [self._custom_axis(name, transform.getTransformAxis(k), k) for k in (3, 4, 5, 0, 1, 2)]
        elif kind in _KNOWN:
            axes = [
                _Axis(f"{name}_{k}", moves, axis, Coupling(0.0, ((joint.get_coordinates(place).getName(), _SAME),)))
                for k, (moves, axis, place) in enumerate(_KNOWN[kind])
            ]
        else:
            raise self._fault(f"joint {name!r} is a {kind}; {', '.join(_KNOWN)} and CustomJoint are supported", name)
        return axes

    def _axes(self, joint: Any) -> list[_Axis]:
        """The axes of a joint of the body, with the values of locked coordinates."""
        axes = self._own_axes(joint)
        for driver in (driver for axis in axes for driver, _ in axis.rule.terms):
            if driver not in self._coordinates:
                name = joint.getName()
                raise self._fault(f"joint {name!r} follows coordinate {driver!r}, which is the base's or unknown", name)
        return [axis._replace(rule=self._unlocked(axis.rule)) for axis in axes]

    def _custom_axis(self, joint: str, axis: Any, number: int) -> _Axis:
        names = axis.getCoordinateNames()
        drivers = [names.getValue(place) for place in range(names.size())]
        label = f"{joint}_{axis.getName() or number}"
        rule = Coupling(0.0, ()) if not axis.hasFunction() else self._rule(axis.getFunction(), drivers, joint)
        return _Axis(label, _SLIDE if number > 2 else _TURN, vector_of(axis.getAxis()), rule)

    def _unlocked(self, rule: Coupling) -> Coupling:
        """The coupling with the values of locked coordinates."""
        start, kept = rule.start, []
        for driver, function in rule.terms:
            locked = self._coordinates[driver].locked
            if locked is None:
                kept.append((driver, function))
            else:
                start += float(function(np.array(locked)).value)
        return Coupling(start, tuple(kept))

    def _rule(self, function: Any, drivers: list[str], owner: str) -> Coupling:
        """A function of OpenSim as functions of one coordinate each."""
        kind = function.getConcreteClassName()
        if kind == "MultiplierFunction":
            multiplier = engine().MultiplierFunction.safeDownCast(function)
            inner, factor = self._rule(multiplier.getFunction(), drivers, owner), multiplier.getScale()
            return inner.scaled(factor)
        if kind == "Constant":
            return Coupling(engine().Constant.safeDownCast(function).getValue(), ())
        if kind == "LinearFunction":
            numbers = entries_of(engine().LinearFunction.safeDownCast(function).getCoefficients())
            if len(numbers) != len(drivers) + 1:
                raise self._fault(f"{owner!r}: {len(numbers)} coefficients for {len(drivers)} coordinates", owner)
            slopes = zip(drivers, numbers, strict=False)
            return Coupling(numbers[-1], tuple((name, polynomial(np.array([0.0, slope]))) for name, slope in slopes))
        if len(drivers) != 1:
            raise self._fault(f"{owner!r}: a {kind} of one coordinate is supported, not of {len(drivers)}", owner)
        try:
            return Coupling(0.0, ((drivers[0], self._single(function, kind, owner)),))
        except ShapeError as error:
            raise self._fault(f"{owner!r}: its {kind}: {error}", owner) from None

    def _single(self, function: Any, kind: str, owner: str) -> JointFunction:
        """A function of one coordinate, exactly."""
        if kind == "PolynomialFunction":
            highest_first = engine().PolynomialFunction.safeDownCast(function).getCoefficients()
            return polynomial(np.array(vector_of(highest_first, highest_first.size()))[::-1])
        if kind == "PiecewiseLinearFunction":
            lines = engine().PiecewiseLinearFunction.safeDownCast(function)
            return piecewise_linear(*np.array([(lines.getX(k), lines.getY(k)) for k in range(lines.getSize())]).T)
        spline = engine().SimmSpline.safeDownCast(function)
        if kind == "GCVSpline" and engine().GCVSpline.safeDownCast(function).getDegree() == _CUBIC:
            spline = engine().GCVSpline.safeDownCast(function)
        if spline is None:
            raise self._fault(
                f"{owner!r}: a {kind} cannot be taken over exactly; Constant, LinearFunction, PolynomialFunction, "
                "PiecewiseLinearFunction, SimmSpline, cubic GCVSpline and MultiplierFunction can",
                owner,
            )
        knots = np.array([spline.getX(k) for k in range(spline.getSize())])
        return hermite(knots, *np.array([value_and_slope(function, [knot]) for knot in knots]).T)

    def _carriers(self, axes: dict[str, list[_Axis]]) -> dict[str, str]:
        """The axis, by its name, that is the joint of a coordinate: the first that goes as it does, or against it."""
        carriers: dict[str, str] = {}
        for axis in (axis for own in axes.values() for axis in own):
            terms = axis.rule.terms
            kind = self._coordinates[terms[0][0]].kind if len(terms) == 1 else ""
            if kind == axis.kind and _sign(terms[0][1]) and terms[0][0] not in carriers:
                carriers[terms[0][0]] = axis.name
        return carriers

    def _add_bare_coordinates(self, base: str, axes: dict[str, list[_Axis]], carriers: dict[str, str]) -> None:
        """Joints that move nothing, on the base, of coordinates that others follow by curves alone."""
        rules = [axis.rule for own in axes.values() for axis in own]
        rules += [one.rule for one in self._coordinates.values() if one.rule is not None]
        followed = {driver for rule in rules for driver, _ in rule.terms}
        for name, coordinate in self._coordinates.items():
            if name in followed and name not in carriers and coordinate.locked is None:
                self._step(base, f"{base}__{name}", (np.eye(3), np.zeros(3)), name, coordinate.kind, _UNITS[2])

    def _add_joint(self, joint: Any, axes: list[_Axis], carriers: dict[str, str]) -> None:
        """Steps from the parent to the child: fixed frames, and joints of one axis between them."""
        above, child = ends(joint)
        pose = pose_of(joint.getParentFrame().findTransformInBaseFrame())
        for axis in axes:
            rule, direction = axis.rule, axis.direction / np.linalg.norm(axis.direction)
            name, sign = axis.name, 1.0
            driver = rule.terms[0][0] if rule.terms else ""
            if carriers.get(driver) == axis.name:
                function = rule.terms[0][1]
                name, sign = driver, _sign(function)
                rule = Coupling(rule.start + float(function(np.zeros(())).value), ())
            if not rule.terms:
                # Along the same axis, so that it does not matter which comes first.
                moved, still = rule.start * direction, np.zeros(3)
                pose = _after(pose, *((np.eye(3), moved) if axis.kind == _SLIDE else (so3.exp(moved), still)))
            if name == axis.name and not rule.terms:
                continue
            below = f"{child}__{name}"
            self._step(above, below, pose, name, axis.kind, sign * direction)
            if rule.terms:
                self._chain.couplings[name] = self._unlocked(rule)
            above, pose = below, (np.eye(3), np.zeros(3))
        turn, place = pose_of(joint.getChildFrame().findTransformInBaseFrame())
        turn, place = _after(pose, turn.T, -turn.T @ place)
        self._chain.add_joints(above, child, place, turn, [])

    def _step(self, above: str, below: str, pose: tuple[Array, Array], name: str, kind: str, axis: Array) -> None:
        self._chain.add_frame(below)
        known = self._coordinates.get(name)
        limits = (-np.inf, np.inf) if known is None else known.limits
        self._chain.add_joints(above, below, pose[1], pose[0], [(name, kind, axis, list(limits))])


_SAME = polynomial(np.array([0.0, 1.0]))


def _sign(function: JointFunction) -> float:
    """1 or -1 where a function goes as its coordinate, or against it; else 0."""
    straight = not len(function.knots) and not function.coefficients[2:].any() and len(function.coefficients) > 1
    slope = float(function.coefficients[1, 0]) if straight else 0.0
    return slope if abs(slope) == 1.0 else 0.0


def _after(pose: tuple[Array, Array], turn: Array, place: Array) -> tuple[Array, Array]:
    return pose[0] @ turn, pose[1] + pose[0] @ place
