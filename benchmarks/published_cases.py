"""What is computed for the page of published numbers, by public names alone; `published` has what was printed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.optimize import brentq, root_scalar

import shapephase as sp
from shapephase.optimal_control import Limits, path_cost, plan_reorientation, shoot
from shapephase.rigid_body import geodesics

# A brick that tumbles: slug ft^2 and degrees a second, units that cancel.
_BRICK = np.array([0.001894220, 0.006211019, 0.007194665])
_BRICK_RATES = np.radians([10.0, 20.0, 30.0])


def brick_rate(axis: int) -> float:
    top = sp.EulerTop.principal(_BRICK, _BRICK * _BRICK_RATES)
    return float(np.degrees(top.angular_velocity(30.0)[axis]))


# Six masses of 1 kg in pairs on three axes, whose moment about y changes.
MORPHING = np.array([0.3, 0.35, 0.4])
MORPHING_RATES = np.array([0.1, 15.0, 0.1])
_MORPHING_TIME = 0.2
"""[s]"""


def mass_radii(moments: np.ndarray) -> np.ndarray:
    """How far from the centre six masses of 1 kg are, in pairs on the axes, for three principal moments: (3,) -> (3,).

    A pair at r has the second moment 2 r² along its axis.
    """
    return np.sqrt(np.diagonal(sp.inertia_tensor.second_moment(np.diag(moments))) / 2.0)


def six_masses() -> sp.ParticleBody:
    """The spacecraft of Trivailo and Kojima; its shape is three radii."""
    axes = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, None]
    slopes = np.array([axes * np.abs(np.eye(3)[k]) for k in range(3)])

    def places(radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.einsum("nk,kmi->nmi", radii, slopes), np.tile(slopes, (len(radii), 1, 1, 1))

    return sp.particle_body(np.ones(6), places, ["x", "y", "z"], units="m", name="six masses")


def spacecraft() -> sp.EulerTop:
    """The spacecraft while its moments are kept."""
    return sp.EulerTop.principal(MORPHING, MORPHING * MORPHING_RATES)


@cache
def inversion_time() -> float:
    """When the spacecraft, its moments kept, has turned over: the rate about y is least [s]."""
    top = spacecraft()

    def slope(t: float) -> float:
        """That of the rate about y, but for a factor."""
        rates = top.angular_velocity(t)
        return float(rates[0] * rates[2])

    return float(root_scalar(slope, bracket=(0.5 * top.period, 0.6 * top.period), xtol=1e-14).root)


def morphed_motion(moment: float, start: float, after: float = 2.0) -> sp.Motion:
    """The spacecraft whose moment about y becomes another one within 0.2 s from a time on."""
    radii = [mass_radii(np.array([0.3, about_y, 0.4])) for about_y in (0.35, moment)]
    times = np.cumsum([0.0, start, _MORPHING_TIME, after])
    path = sp.ShapePath.waypoints(times, [radii[0], *radii, radii[1]], joint_names=["x", "y", "z"])
    return sp.reconstruct(sp.articulated(six_masses(), path), MORPHING * MORPHING_RATES)


def morphed_spin(moment: float, start: float) -> float:
    motion = morphed_motion(moment, start)
    return float(motion.angular_velocity(motion.duration)[1])


# The cat of two halves turns about its length, as cheaply as can be, from free rates.


@cache
def best_turn(degrees: float) -> tuple[float, float]:
    """The least kinetic cost of a turn of `cat_two_halves` from straight to straight [J s], and its bend [degrees]."""
    cat = sp.load_body("cat_two_halves")
    goal = sp.so3.exp(np.array([np.radians(degrees), 0.0, 0.0]))
    plan = plan_reorientation(cat, goal, rates_at_ends="free", limits=Limits(rate_limits=None))
    best = shoot(cat, plan.path, goal)
    pitch, yaw = best.shape(np.linspace(0.0, 1.0, 2001))[:, :2].T
    return float(best.cost), float(np.degrees(np.arccos(np.cos(pitch) * np.cos(yaw))).max())


def circle_cost() -> float:
    path = sp.examples.kane_scher(0.0, np.radians(59.426458741516))
    return float(path_cost(sp.load_body("cat_two_halves"), path))


def righting_turn(alpha: float, beta: float) -> float:
    path = sp.examples.kane_scher(np.radians(alpha), np.radians(beta))
    return float(np.degrees(sp.so3.angle(sp.holonomy(sp.load_body("cat_two_halves"), path))))


# Halley: from the precession of its long axis and its roll about it to the rate and its direction.
_PRECESSION, _ROLL, _TILT = 3.69, 7.1, np.radians(66.0)


def _halley() -> sp.EulerTop:
    """The axisymmetric body of unit transverse moment with these two clocks, in days."""
    axial = 1.0 / (1.0 + _PRECESSION / (_ROLL * np.cos(_TILT)))
    magnitude = 2.0 * np.pi / _PRECESSION
    return sp.EulerTop.principal([1.0, 1.0, axial], magnitude * np.array([np.sin(_TILT), 0.0, np.cos(_TILT)]))


def halley_period() -> float:
    return float(2.0 * np.pi / np.linalg.norm(_halley().angular_velocity(0.0)))


def halley_angle() -> float:
    return float(np.degrees(sp.rigid_body.cones(_halley()).space_half_angle))


def tumbling(
    moments: tuple[float, float, float], clocks: tuple[float, float], energies: tuple[float, float]
) -> tuple[sp.EulerTop, float]:
    """The body whose period over that of its long axis' precession is the one observed, and its energy over the least.

    Moments ascend, the greatest is 1; the energies bracket the one found.
    """

    def body(energy: float) -> sp.EulerTop:
        along = (energy - 1.0) / (1.0 / moments[0] - 1.0)
        return sp.EulerTop.principal(moments, [np.sqrt(along), 0.0, np.sqrt(1.0 - along)])

    def gap(energy: float) -> float:
        return body(energy).long_axis_precession_per_period / (2.0 * np.pi) - clocks[1] / clocks[0]

    energy = float(root_scalar(gap, bracket=energies, xtol=1e-14).root)
    return body(energy), energy


def third_clock(top: sp.EulerTop, roll: float) -> float:
    """The time in which an axis across the long one, which Pi circles, goes round the momentum, as the period."""
    return float(roll * 2.0 * np.pi / top.montgomery_phase)


TOUTATIS = ((1.0 / 3.22, 3.09 / 3.22, 1.0), (7.35, 5.41), (1.1, 3.2))
APOPHIS = ((0.61, 0.965, 1.0), (27.38, 263.0), (1.005, 1.035))


# The metric of orbital transfer, d phi^2 + sin^2 phi/(1 - lambda sin^2 phi) d theta^2, phi from the pole.
_LAMBDA = 0.8


def orbital_transfer(latitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """m and m' of the latitude, pi/2 - phi."""
    square = np.cos(latitude) ** 2
    room = 1.0 - _LAMBDA * square
    return square / room, -np.sin(2.0 * latitude) / room**2


@cache
def transfer_surface() -> geodesics.SurfaceOfRevolution:
    return geodesics.surface_of_metric(orbital_transfer, 0.5 * np.pi)


# The smallest holonomies.
def _parallel_circle(latitude: float) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    cosine, sine = np.cos(latitude), np.sin(latitude)

    def curve(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        level = np.stack([np.cos(t), np.sin(t), 0.0 * t], axis=-1)
        across = np.stack([-np.sin(t), np.cos(t), 0.0 * t], axis=-1)
        return cosine * level + [0.0, 0.0, sine], cosine * across

    return curve


_PARIS = np.radians(48.0 + 50.0 / 60.0 + 46.0 / 3600.0)
_SIDEREAL_DAY = 23.9344696
"""[h]"""


def foucault_rate() -> float:
    """Degrees an hour: the plane is transported round the parallel, and the ground turns once more."""
    turn = sp.sphere.transport(_parallel_circle(_PARIS), np.linspace(0.0, 2.0 * np.pi, 9))
    area = sp.so3.angle_about(turn, np.array([np.cos(_PARIS), 0.0, np.sin(_PARIS)]))
    return float(np.degrees(2.0 * np.pi - area % (2.0 * np.pi)) / _SIDEREAL_DAY)


def bicycle_wheel() -> float:
    """Degrees: the axle of a wheel goes round an octant of the sphere, over three quarters of great circles."""

    def curve(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        leg = np.minimum(t.astype(int), 2)
        angle = 0.5 * np.pi * (t - leg)
        start, end = np.eye(3)[leg], np.eye(3)[(leg + 1) % 3]
        cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
        return cosine * start + sine * end, 0.5 * np.pi * (cosine * end - sine * start)

    return float(np.degrees(sp.so3.angle(sp.sphere.transport(curve, np.arange(4.0)))))


def ant_on_a_disc(disc: float) -> float:
    """Degrees that a free disc turns while an ant of 1 kg walks once round its rim: four masses have its moment."""
    spokes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]) / np.sqrt(2.0)

    def places(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        angle, zero = angles[:, 0], 0.0 * angles[:, 0]
        ant = np.stack([np.cos(angle), np.sin(angle), zero], axis=-1)
        slope = np.stack([-np.sin(angle), np.cos(angle), zero], axis=-1)
        points = np.concatenate([np.tile(spokes, (len(angle), 1, 1)), ant[:, None]], axis=1)
        slopes = np.zeros_like(points)
        slopes[:, 4] = slope
        return points, slopes[:, None]

    masses = [*np.full(4, disc / 4.0), 1.0]
    body = sp.particle_body(masses, places, ["angle"], continuous=["angle"])
    path = sp.ShapePath.waypoints([0.0, 1.0], [[0.0], [2.0 * np.pi]], joint_names=["angle"])
    return float(np.degrees(sp.so3.angle_about(sp.holonomy(body, path, tolerance=1e-11), np.array([0.0, 0.0, 1.0]))))


def pentagon_turn() -> float:
    """Degrees that the loop of zero curvature turns a linked pentagon by, from 120 rays and their Fourier series."""
    pentagon, shapes = sp.examples.linked_pentagon(), []
    for angle in 2.0 * np.pi * np.arange(120) / 120.0:
        ray = np.array([np.cos(angle), np.sin(angle)])
        size = brentq(lambda size, ray=ray: sp.curvature(pentagon, size * ray)[0, 1, 2], 1.0, 2.5, xtol=1e-10)
        shapes.append(size * ray)
    waves = np.fft.rfft(shapes, axis=0)[:-1].T / len(shapes)
    loop = sp.ShapePath.fourier(waves[:, 0].real, 2.0 * waves[:, 1:].real, -2.0 * waves[:, 1:].imag, 1.0)
    return float(np.degrees(sp.so3.angle(sp.holonomy(pentagon, loop, tolerance=1e-12))))


def euler_days() -> float:
    axial = 1.00327
    return float(1.0 / sp.rigid_body.cones(sp.EulerTop.principal([1.0, 1.0, axial], [1e-6, 0.0, axial])).spin_rate)


def plate_ratio() -> float:
    found = sp.rigid_body.cones(sp.EulerTop.principal([1.0, 1.0, 2.0], [1e-4, 0.0, 2.0]))
    return float(found.precession_rate / found.spin_rate)
