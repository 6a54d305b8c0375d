"""Planar bodies whose turns are known in closed form; angles about the normal of the plane, right-handed [rad]."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_pair, number_argument, positive_argument
from ..arrays import Array, common_shape, finite_array
from ..errors import ShapeError
from ..sphere import polygon_area


def beanie_turn(body: float, beanie: float, angle: ArrayLike = 2.0 * np.pi) -> Array:
    """Elroy's beanie: two bodies on a pin through both centres of mass; how far the first turns back.

    Source: Marsden, Montgomery and Ratiu 1990; theory.md section 7.

    Parameters
    ----------
    body, beanie : moments of inertia about the pin [kg m^2]
    angle : (...) by which the beanie turns on the body [rad]

    Returns
    -------
    (...) -angle I2/(I1 + I2)

    Examples
    --------
    >>> print(f"{np.degrees(sp.planar.beanie_turn(3.0, 1.0)):.6f} degrees in a turn of the beanie")
    -90.000000 degrees in a turn of the beanie
    """
    first, second = _moment(body, "body"), _moment(beanie, "beanie")
    return -finite_array(angle, "angle", unit="rad") * second / (first + second)


def two_link_turn(
    inertias: tuple[float, float], masses: tuple[float, float], levers: tuple[float, float], angle: ArrayLike
) -> Array:
    """Two links on a hinge, free in the plane: how far the first turns while the hinge goes from 0 to an angle.

    With m the reduced mass, P = I1 + I2 + m (a^2 + b^2) and Q = 2 m a b, the connection is half the hinge's rate and
    D/2 over P + Q cos(angle), D = I2 + m b^2 - I1 - m a^2, which has an inverse tangent for its integral.

    Source: theory.md B1 with one joint.

    Parameters
    ----------
    inertias : of both about their centres of mass [kg m^2]
    masses : [kg]
    levers : a from the first's centre of mass to the hinge, b from the hinge to the second's, both outward along the
        links, which are in line at the angle 0 [m]
    angle : (...) of the hinge [rad], any number of turns

    Examples
    --------
    >>> turn = sp.planar.two_link_turn((1.0, 1.0), (1.0, 1.0), (0.5, 0.5), np.pi / 2)
    >>> print(f"{np.degrees(turn):.6f} degrees: equal links share it")
    -45.000000 degrees: equal links share it
    """
    for pair, name in ((inertias, "inertias"), (masses, "masses"), (levers, "levers")):
        check_pair(pair, name, "two numbers")
    first, second = (_moment(value, "inertias") for value in inertias)
    m1, m2 = (positive_argument(value, "masses", "a mass in kg") for value in masses)
    a, b = (number_argument(value, "levers", "m") for value in levers)
    turned = finite_array(angle, "angle", unit="rad")
    mass = m1 * m2 / (m1 + m2)
    whole, swing = first + second + mass * (a * a + b * b), 2.0 * mass * a * b
    difference = second + mass * b * b - first - mass * a * a
    root = np.sqrt((whole - swing) * (whole + swing))
    turns = np.rint(turned / (2.0 * np.pi))
    rest = 0.5 * (turned - 2.0 * np.pi * turns)
    integral = 2.0 / root * (np.arctan2((whole - swing) * np.sin(rest), root * np.cos(rest)) + np.pi * turns)
    return -0.5 * (turned + difference * integral)


def square_cat_turn(near: ArrayLike, far: ArrayLike, angle: ArrayLike) -> Array:
    """The square cat: equal masses on two crosses, one of arms 1, one of arms r that turns on it, and r changes.

    It goes round a rectangle: the cross turns by an angle at r = `far` and back at r = `near`. The connection is
    r^2/(1 + r^2) times the angle's rate.

    Source: theory.md section 7.

    Parameters
    ----------
    near, far : (...) arms, over those of the first cross [1]
    angle : (...) of the second cross on the first [rad]

    Raises
    ------
    ShapeError
        If an arm is below 0.

    Examples
    --------
    >>> print(f"{np.degrees(sp.planar.square_cat_turn(1.0, 2.0, np.pi / 2)):.6f} degrees")
    -27.000000 degrees
    """
    inner, outer = finite_array(near, "near"), finite_array(far, "far")
    turned = finite_array(angle, "angle", unit="rad")
    common_shape(near=inner, far=outer, angle=turned)
    if np.any(inner < 0.0) or np.any(outer < 0.0):
        raise ShapeError("near and far: arms of 0 or more are needed")
    return -turned * (outer**2 / (1.0 + outer**2) - inner**2 / (1.0 + inner**2))


def three_body_turn(masses: ArrayLike, positions: ArrayLike) -> float:
    """Three bodies in a plane without angular momentum, whose triangle goes round a loop: how far it has turned.

    On the sphere of shapes the loop encloses a solid angle, and the frame in which the first Jacobi vector rests turns
    by half of it.

    Source: Montgomery 1996; Iwai 1987; theory.md section 7.

    Parameters
    ----------
    masses : (3,) [kg]
    positions : (N, 3, 2) of the triangle round the loop, the last not that of the start again; in axes in which any
        turn may be [m]. Straight steps on the sphere join them

    Returns
    -------
    [rad] about the normal; of a loop of triangles that come back up to a turn

    Raises
    ------
    ShapeError
        If a mass is not above 0, there are fewer than three triangles, or all bodies are in one place.

    Examples
    --------
    >>> t = np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)
    >>> still, moving = np.zeros((2, 1000, 2))
    >>> moving[:, 0], moving[:, 1] = 0.2 * np.cos(t), 1.0 + 0.2 * np.sin(t)
    >>> turn = sp.planar.three_body_turn([1.0, 1.0, 1.0], np.stack([still, still + [1.0, 0.0], moving], axis=1))
    >>> print(f"{np.degrees(turn):.3f} degrees")
    -2.747 degrees
    """
    weights = finite_array(masses, "masses", (3,), unit="kg")
    points = finite_array(positions, "positions", (3, 2), unit="m")
    if weights.shape != (3,) or np.any(weights <= 0.0) or points.ndim != 3 or len(points) < 3:
        raise ShapeError("masses and positions: three masses above 0 and (N, 3, 2) positions are needed")
    places = points[..., 0] + 1j * points[..., 1]
    pair = weights[0] * weights[1] / (weights[0] + weights[1])
    third = weights[2] * (weights[0] + weights[1]) / weights.sum()
    centre = (weights[0] * places[:, 0] + weights[1] * places[:, 1]) / (weights[0] + weights[1])
    first, second = np.sqrt(pair) * (places[:, 1] - places[:, 0]), np.sqrt(third) * (places[:, 2] - centre)
    size = np.abs(first) ** 2 + np.abs(second) ** 2
    if np.any(size == 0.0):
        raise ShapeError("positions: all three bodies are in one place")
    product = np.conj(first) * second
    sphere = np.stack([2.0 * product.real, 2.0 * product.imag, np.abs(first) ** 2 - np.abs(second) ** 2], axis=-1)
    sphere /= size[:, None]
    return -0.5 * float(polygon_area(sphere))


def yo_yo_rate(hub: float, mass: float, radius: float, length: ArrayLike, rate: float = 1.0) -> Array:
    """Rate of a hub from which two cords with masses at their ends unwind, by the free length of each cord.

    From momentum and energy, which both stay. Source: Fedor 1961; theory.md section 7.

    Parameters
    ----------
    hub : its moment of inertia [kg m^2]
    mass : of both ends together [kg]
    radius : of the hub, at which the ends rest before [m]
    length : (...) of each free cord, still along a tangent [m]
    rate : of the hub before [rad/s]

    Returns
    -------
    (...) rate (c R^2 - l^2)/(c R^2 + l^2), c = 1 + hub/(mass R^2) [rad/s]; 0 at `yo_yo_stop`, negative beyond

    Examples
    --------
    >>> stop = sp.planar.yo_yo_stop(3.0, 0.2, 0.5)
    >>> print(f"{sp.planar.yo_yo_rate(3.0, 0.2, 0.5, stop) + 0.0:.6f} rad/s with {stop:.6f} m of cord")
    0.000000 rad/s with 3.905125 m of cord
    """
    moment, ends = _moment(hub, "hub"), positive_argument(mass, "mass", "a mass in kg")
    size = positive_argument(radius, "radius", "a length in m")
    free = finite_array(length, "length", unit="m")
    whole = size * size + moment / ends
    return number_argument(rate, "rate", "rad/s") * (whole - free * free) / (whole + free * free)


def yo_yo_stop(hub: float, mass: float, radius: float) -> float:
    """The length of each cord that stops a hub, whatever its rate: sqrt(R^2 + hub/mass) [m]. Arguments of `yo_yo_rate`.

    Examples
    --------
    >>> print(f"{sp.planar.yo_yo_stop(3.0, 1.0, 1.0):.6f} m")
    2.000000 m
    """
    moment, ends = _moment(hub, "hub"), positive_argument(mass, "mass", "a mass in kg")
    size = positive_argument(radius, "radius", "a length in m")
    return float(np.sqrt(size * size + moment / ends))


def _moment(value: float, name: str) -> float:
    return positive_argument(value, name, "a moment of inertia in kg m^2")
