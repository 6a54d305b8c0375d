"""Twists, forces and inertias of rigid bodies about the base origin, as expressions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ...arrays import Array
from ...body.joint_chain import JointChain
from ..symbolic import constant, joint_screw, solve_linear


@dataclass(frozen=True, eq=False)
class Twist:
    """Angular velocity and velocity at the base origin; or angular momentum about it and momentum."""

    angular: Any
    linear: Any

    @property
    def stacked(self) -> Any:
        """Stacked angular and linear part."""
        import casadi

        return casadi.vertcat(self.angular, self.linear)

    def __add__(self, other: Twist) -> Twist:
        """Sum of two twists."""
        return Twist(self.angular + other.angular, self.linear + other.linear)

    def __sub__(self, other: Twist) -> Twist:
        """Difference of two twists."""
        return Twist(self.angular - other.angular, self.linear - other.linear)

    def __mul__(self, factor: Any) -> Twist:
        """Multiple of the twist."""
        return Twist(self.angular * factor, self.linear * factor)

    def power(self, force: Twist) -> Any:
        """Power of a force on this twist."""
        import casadi

        return casadi.dot(self.angular, force.angular) + casadi.dot(self.linear, force.linear)

    def cross(self, other: Twist) -> Twist:
        """Rate of another twist that is carried along with this one."""
        import casadi

        linear = casadi.cross(self.angular, other.linear) + casadi.cross(self.linear, other.angular)
        return Twist(casadi.cross(self.angular, other.angular), linear)

    def on_force(self, force: Twist) -> Twist:
        """Rate of a force, or a momentum, that is carried along with this twist."""
        import casadi

        angular = casadi.cross(self.angular, force.angular) + casadi.cross(self.linear, force.linear)
        return Twist(angular, casadi.cross(self.angular, force.linear))


@dataclass(frozen=True, eq=False)
class Inertia:
    """Mass, first moment and inertia about the base origin."""

    mass: float
    moment: Any
    inertia: Any

    @classmethod
    def of_link(cls, mass: float, frame: tuple[Any, Any], centre: Array, inertia: Array) -> Inertia:
        """Return the inertia of a link with centre of mass, and inertia about it, in a frame (orientation, origin)."""
        import casadi

        turn, place = frame
        centred = place + turn @ constant(centre)
        own = turn @ constant(inertia) @ turn.T
        return cls(
            mass, mass * centred, own + mass * (casadi.dot(centred, centred) * casadi.SX.eye(3) - centred @ centred.T)
        )

    def __add__(self, other: Inertia) -> Inertia:
        """Inertia of both as one body."""
        return Inertia(self.mass + other.mass, self.moment + other.moment, self.inertia + other.inertia)

    def momentum(self, twist: Twist) -> Twist:
        """Momentum of this body moving with a twist."""
        import casadi

        linear = self.mass * twist.linear + casadi.cross(twist.angular, self.moment)
        return Twist(self.inertia @ twist.angular + casadi.cross(self.moment, twist.linear), linear)

    def moved(self, screw: Twist) -> Inertia:
        """Derivative along a screw, which has no mass."""
        import casadi

        spin, along = casadi.skew(screw.angular), self.moment @ screw.linear.T
        turned = spin @ self.inertia
        slid = 2.0 * casadi.dot(self.moment, screw.linear) * casadi.SX.eye(3) - along - along.T
        moment = casadi.cross(screw.angular, self.moment) + self.mass * screw.linear
        return Inertia(0.0, moment, turned + turned.T + slid)

    def twist(self, force: Twist) -> Twist:
        """Twist of this body from its momentum, or its acceleration from a force."""
        import casadi

        about_centre = (
            self.inertia
            + (self.moment @ self.moment.T - casadi.dot(self.moment, self.moment) * casadi.SX.eye(3)) / self.mass
        )
        angular = solve_linear(about_centre, force.angular - casadi.cross(self.moment, force.linear) / self.mass)
        return Twist(angular, (force.linear - casadi.cross(angular, self.moment)) / self.mass)


def screws_of(chain: JointChain, frames: list[tuple[Any, Any]]) -> list[Twist]:
    """Screws of all joints of a tree, from the orientations and origins of its frames."""
    return [Twist(*joint_screw(chain, number, frames[number + 1])) for number in range(len(chain.parents))]


def links_of(chain: JointChain, frames: list[tuple[Any, Any]]) -> list[Inertia]:
    """Inertias of the links of all frames of a tree."""
    links = zip(chain.masses, frames, chain.centres, chain.inertias, strict=True)
    return [Inertia.of_link(float(mass), frame, centre, inertia) for mass, frame, centre, inertia in links]


def gathered(chain: JointChain, parts: list[Any]) -> list[Any]:
    """Sums of a quantity over all frames that hang on each."""
    sums = list(parts)
    for number in reversed(range(len(chain.parents))):
        sums[chain.parents[number]] = sums[chain.parents[number]] + sums[number + 1]
    return sums


def passed_on(chain: JointChain, base: Twist, steps: list[Twist]) -> list[Twist]:
    """Twist of each frame: the base's and the steps of all joints on the way."""
    twists = [base]
    for number, parent in enumerate(chain.parents):
        twists.append(twists[parent] + steps[number])
    return twists
