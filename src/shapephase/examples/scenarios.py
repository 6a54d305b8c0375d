"""Ready motions of the bodies that come with the library, by name, each with its source and its known answer."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..arguments import check_choice, number_argument, positive_argument
from ..arrays import Array
from ..body.body import Body
from ..body.loading import as_body_or_particles, load_body
from ..body.particles.point_masses import ParticleBody
from ..deformation.deformation import articulated
from ..display import short_repr
from ..errors import ShapeError, TrajectoryError
from ..shape_space.curves import Curve, Swings
from ..shape_space.files.read import read_shape_path
from ..shape_space.shape_path import ShapePath
from ._closed_form_motions import Example

_WAIST = ("waist_pitch", "waist_yaw", "waist_roll")  # joints of both cats, in the order of their angles
_BEND = _WAIST[:2]  # joints of the waist that cannot twist
_ARM_UP, _ARM_DOWN = 3.0, 0.2  # [rad]
# Shares of a simple dive: an arm moves, and half of its stay below.
_ARM_MOVES, _ARM_STAYS = 0.2, 0.13155869448710526
# Shares of the dive of five stages: the arm goes down, stays down, goes up. The last two and the momentum times the
# duration [kg m^2] solve the three equations of the landing, by Newton's method.
_GOES_DOWN, _STAYS_DOWN, _GOES_UP = 0.2, 0.2722422708607259, 0.17453232069381736
_MOMENTUM_TIMES_DURATION = 92.37710163942651


@dataclass(frozen=True)
class NamedMotion:
    """A motion that comes with the library: its body, the function that makes its path, a description, how it begins.

    Attributes
    ----------
    attitude : (4,) at the start, a quaternion x y z w from base axes to inertial axes with z up: commands begin with it
        where none is given

    Examples
    --------
    >>> motion = sp.examples.MOTIONS["cat_righting"]
    >>> motion.body, motion.path().duration, motion.attitude  # on its back
    ('cat', 2.0, (1.0, 0.0, 0.0, 0.0))
    """

    body: str
    path: Callable[[], ShapePath]
    about: str
    attitude: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)

    __repr__ = short_repr


def kane_scher(alpha: float, beta: float, duration: float = 1.0, *, body: str = "cat_two_halves") -> ShapePath:
    """The righting of the cat of two halves: it bends without twisting, and the bend goes once round.

    The rear half's axis b goes round a cone of half angle `beta` about a line that leans by `alpha` from the
    front half's axis towards the belly; the waist does not twist. The bend goes from alpha + beta (belly)
    over the right side to beta - alpha (back) and over the left.

    Parameters
    ----------
    alpha, beta : [rad], 0 <= alpha < beta < pi/2; of "cat_untwisted" beta < pi - alpha
    duration : of one loop [s]
    body : whose waist it is, "cat_two_halves" or "cat_untwisted", whose angles are singular at no bend

    Raises
    ------
    TrajectoryError
        If the angles are outside these limits.

    Notes
    -----
    Equation :eq:`kane-scher` of the documentation.
    With axial to transverse inertia 0.25 the cat turns by 180 degrees about the bisector of the two half axes at
    (alpha, beta) = (0, 59.426459), (10, 60.036246), (20, 61.813873), (30, 64.618733), (45, 70.316222),
    (60, 77.132402) degrees, and at (20, 40) by 259.512497 degrees, counted through the motion.

    Source: Kane and Scher 1969, equation (5).

    Examples
    --------
    >>> cat, path = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, np.radians(59.426458741516))
    >>> print(f"{np.degrees(sp.so3.angle(sp.holonomy(cat, path))):.6f} degrees")
    180.000000 degrees
    """
    alpha = number_argument(alpha, "alpha", "rad")
    beta = number_argument(beta, "beta", "rad")
    period = positive_argument(duration)
    check_choice(body, "body that bends", ("cat_two_halves", "cat_untwisted"))
    joints, limit, words = _WAIST, 0.5 * np.pi, "pi/2"
    if body == "cat_untwisted":
        joints, limit, words = _BEND, np.pi - alpha, "pi - alpha"
    if not 0.0 <= alpha < beta < limit:
        raise TrajectoryError(
            f"0 <= alpha < beta < {words} [rad] is needed, got alpha = {alpha:.9g}, beta = {beta:.9g}"
        )
    return _loop(_KaneScher(alpha, beta, period, angles=len(joints)), period, joints)


def cat_righting(duration: float = 2.0) -> ShapePath:
    """The realistic `cat` rights itself from rest to rest: 180 degrees about its long axis at zero momentum.

    A cat on its back, with the attitude `MOTIONS["cat_righting"].attitude` at the start, ends on its feet. The turn
    does not depend on the duration. The joints keep the rates of 30 rad/s of the body's file in 1.62 s and longer: the
    angles of the waist, of which one is its bend to the side, change fast where that is near a quarter turn.

    The waist bends without twisting, the direction of the bend goes once round, and the waist straightens, with the
    legs tucked and neck and tail bending along. Two numbers were solved for, the largest bend and the tail's share;
    two are enough, because a loop that is its own mirror image run backwards turns about an axis in the plane of
    symmetry.

    Examples
    --------
    >>> turn = sp.holonomy(sp.load_body("cat"), sp.examples.cat_righting())
    >>> print(f"{np.degrees(sp.so3.angle(turn)):.6f} degrees")
    180.000000 degrees
    """
    return _cat_loop(duration)


def cat_righting_twist(duration: float = 1.5) -> ShapePath:
    """The realistic `cat` rights itself as in `cat_righting`, and its waist twists, too: it has to bend less.

    While the bend goes round, the rear half is turned against the front half by up to half a radian more than a bend
    without twist does, against the sense of the bend's direction. So 91 degrees of bend do what takes 101 without. Bend
    and share of the tail were solved for; in the manner of cats on film (Marey 1894), with numbers of our own. The
    joints keep the rates of the body's file in 1.12 s and longer.

    Examples
    --------
    >>> turn = sp.holonomy(sp.load_body("cat"), sp.examples.cat_righting_twist())
    >>> print(f"{np.degrees(sp.so3.angle(turn)):.6f} degrees")
    180.000000 degrees
    """
    return _cat_loop(duration, largest_bend=1.590080737531, tail_share=0.751770426503, twist=0.5)


def astronaut_arm_circles(duration: float = 2.0) -> ShapePath:
    """One circle of both arms of the `astronaut`: 11.825049 degrees nose down at zero momentum.

    The arms go up in front of the body, close together, and come down spread at the sides.
    In the manner of Kulwicki 1962 and Kane, Headrick and Yatteau 1972; the numbers are our own.

    Examples
    --------
    >>> turn = sp.holonomy(sp.load_body("astronaut"), sp.examples.astronaut_arm_circles())
    >>> print(f"{np.degrees(sp.so3.angle(turn)):.6f} degrees")
    11.825049 degrees
    """
    abduction = (0.75, 0.0, -0.75)
    return _one_harmonic(
        "astronaut",
        duration,
        {
            "left_shoulder_flexion": (-1.05, 2.05, 0.0),
            "right_shoulder_flexion": (-1.05, 2.05, 0.0),
            "left_shoulder_abduction": abduction,
            "right_shoulder_abduction": tuple(-value for value in abduction),
        },
    )


def astronaut_leg_swing(duration: float = 4.0) -> ShapePath:
    """One swing of legs and trunk of the `astronaut`: 12.352775 degrees nose down at zero momentum.

    The legs swing forward stretched and come back bent, the trunk bends along.
    In the manner of Kulwicki 1962 and Kane, Headrick and Yatteau 1972; the numbers are our own.

    Examples
    --------
    >>> turn = sp.holonomy(sp.load_body("astronaut"), sp.examples.astronaut_leg_swing())
    >>> print(f"{np.degrees(sp.so3.angle(turn)):.6f} degrees")
    12.352775 degrees
    """
    return _one_harmonic(
        "astronaut",
        duration,
        {
            "left_hip_flexion": (-0.75, 1.2, 0.0),
            "right_hip_flexion": (-0.75, 1.2, 0.0),
            "left_knee": (1.15, 0.0, -1.15),
            "right_knee": (1.15, 0.0, -1.15),
            "lumbar_flexion": (0.25, -0.5, 0.0),
        },
    )


def antenna_deployment(duration: float = 60.0) -> ShapePath:
    """The boom of the `satellite` extends from its lower to its upper limit, from rest to rest: an open path.

    Examples
    --------
    >>> path = sp.examples.antenna_deployment()
    >>> print(path.shape([0.0, 60.0])[:, path.joint_names.index("boom_extension")].round(6))
    [0.  1.8]
    """
    duration = number_argument(duration, "duration", "s")
    body = load_body("satellite")
    lower, upper = body.joint_limits[body.joint_index("boom_extension")]
    ends = [body.shape({"boom_extension": float(length)}) for length in (lower, upper)]
    return ShapePath.waypoints([0.0, duration], ends, joint_names=body.joint_names)


def satellite_sweep(duration: float = 60.0) -> ShapePath:
    """One sweep of the `satellite`: the boom goes out and in while its arm swings to and fro, a quarter period behind.

    At zero momentum it turns by 5.405499 degrees, most of it about the z axis. The numbers are our own.

    Examples
    --------
    >>> path = sp.examples.satellite_sweep()
    >>> print(np.abs(path.shape(0.0) - path.shape(path.duration)).max().round(9))  # a loop
    0.0
    """
    return _one_harmonic(
        "satellite",
        duration,
        {"boom_extension": (0.9, -0.9, 0.0), "arm_1": (0.0, 0.0, 1.2), "arm_2": (0.9, 0.0, 0.0)},
    )


def diver_twist(duration: float = 1.5) -> ShapePath:
    """A dive of the `diver`: forward, one and a half somersaults with a twist, by one arm that goes down and up.

    Both arms are overhead. In a fifth of the time the left one comes down to the side, which tilts the body away from
    the plane of the somersault, so that it twists, and goes up again when the tilt is such that this takes it away.
    With the momentum (0, 92.338247 / duration, 0) kg m^2/s and upright at the start (the somersault is about +y) it
    ends after exactly one and a half somersaults and one twist, 0.016 degrees from the plane. Momentum and the time
    that the arm stays down were solved for. Without momentum nothing is left of it: an arm comes back on its own way.

    From a platform of ten metres a dive takes about 1.5 s. In the manner of Yeadon 1993 and of Dullin and Tong,
    arXiv:1510.08046; the numbers are our own.

    Examples
    --------
    >>> dive = sp.examples.diver_twist()
    >>> print(dive.duration, dive.shape(0.75))
    1.5 [ 0.2 -3. ]
    """
    period = positive_argument(duration)
    moves = 0.5 + np.array([-_ARM_STAYS - _ARM_MOVES, -_ARM_STAYS, _ARM_STAYS, _ARM_STAYS + _ARM_MOVES])
    return _arm_down_and_up(period * np.array([0.0, *moves, 1.0]))


def five_stage_dive(duration: float = 1.6) -> ShapePath:
    """A dive of the `diver` that lands: forward, one and a half somersaults and one twist, exactly.

    Its stages are those of Dullin and Tong: somersault, shape change, twist, the change back, somersault. The left arm
    comes down and goes up again, like in `diver_twist`. Here it goes up a little faster than it came down, because
    the shoulders are not in the plane of the centre of mass: so the twist ends with the momentum exactly along the axis
    of the somersault. `full_dive` has it with its momentum, (0, 92.37710163942651 / duration, 0) kg m^2/s. The arm
    keeps its rate of 20 rad/s in 1.504 s and longer.

    Source: Dullin and Tong 2016 (theory.md F10); the numbers are our own.

    Examples
    --------
    >>> dive = sp.examples.five_stage_dive()
    >>> print(dive.duration, dive.breaks.round(4), dive.shape(0.75))
    1.6 [0.     0.2826 0.6026 1.0382 1.3174 1.6   ] [ 0.2 -3. ]
    """
    period = positive_argument(duration)
    alone = 0.5 * (1.0 - _GOES_DOWN - _STAYS_DOWN - _GOES_UP)
    times = period * np.append(0.0, np.cumsum([alone, _GOES_DOWN, _STAYS_DOWN, _GOES_UP, alone]))
    times[-1] = period
    return _arm_down_and_up(times)


def _arm_down_and_up(times: Array) -> ShapePath:
    """Path of the diver whose left arm goes down and up between these six times."""
    body = load_body("diver")
    both_up = {"left_shoulder_abduction": _ARM_UP, "right_shoulder_abduction": -_ARM_UP}
    up, down = body.shape(both_up), body.shape(both_up | {"left_shoulder_abduction": _ARM_DOWN})
    return ShapePath.waypoints(times, [up, up, down, down, up, up], joint_names=body.joint_names)


def full_dive(duration: float = 1.6) -> Example:
    """F10: `five_stage_dive` with its momentum: half a turn about y in all, after 1.5 somersaults and a twist.

    Source: Dullin and Tong 2016; theory.md F10.

    Examples
    --------
    >>> dive = sp.examples.full_dive()
    >>> motion = sp.reconstruct(dive.deformation, dive.momentum)
    >>> print(motion.final_attitude.round(9) + 0.0)
    [[-1.  0.  0.]
     [ 0.  1.  0.]
     [ 0.  0. -1.]]
    """
    path = five_stage_dive(duration)
    momentum = np.array([0.0, _MOMENTUM_TIMES_DURATION / path.duration, 0.0])
    return Example(deformation=articulated(load_body("diver"), path), momentum=momentum, phase=3.0 * np.pi, turn=np.pi)


def _on_its_back(bend: float = 0.0) -> tuple[float, float, float, float]:
    """Quaternion x y z w of half a turn about the horizontal line between the axes of a cat's two halves.

    Without bend that is the x axis; a bend towards the belly [rad] tilts the front half's axis up by half of it.
    """
    return float(np.cos(0.25 * bend)), 0.0, float(np.sin(0.25 * bend)), 0.0


MOTIONS: Mapping[str, NamedMotion] = {
    "kane_scher": NamedMotion(
        "cat_two_halves",
        lambda: kane_scher(np.radians(20.0), np.radians(61.813873)),
        "the cat of Kane and Scher rights itself, bend 81.8 to 41.8 degrees",
        _on_its_back(np.radians(20.0 + 61.813873)),
    ),
    "cat_righting": NamedMotion(
        "cat", cat_righting, "a realistic cat rights itself from its back, legs tucked, rest to rest", _on_its_back()
    ),
    "cat_righting_twist": NamedMotion(
        "cat",
        cat_righting_twist,
        "a realistic cat rights itself; its waist twists, too, and bends less",
        _on_its_back(),
    ),
    "astronaut_arm_circles": NamedMotion("astronaut", astronaut_arm_circles, "pitch turn by one circle of the arms"),
    "astronaut_leg_swing": NamedMotion("astronaut", astronaut_leg_swing, "pitch turn by one swing of legs and trunk"),
    "antenna_deployment": NamedMotion("satellite", antenna_deployment, "the boom antenna comes out, an open path"),
    "satellite_sweep": NamedMotion("satellite", satellite_sweep, "boom out and in, arm to and fro: turn about z"),
    "diver_twist": NamedMotion("diver", diver_twist, "1.5 somersaults with a twist by one arm, momentum 0 61.558831 0"),
    "five_stage_dive": NamedMotion(
        "diver", five_stage_dive, "1.5 somersaults with a twist, into the plane again, momentum 0 57.735688525 0"
    ),
}
"""Motions that come with the library, by name: functions and commands take such a name in place of a path.

Examples
--------
>>> sp.examples.MOTIONS["satellite_sweep"].body
'satellite'
"""


def named_motion(name: str, body: Body | ParticleBody | str | None = None) -> ShapePath:
    """The path of one of `MOTIONS`, whose `attitude` is how it begins, or of a recording.

    Functions that take a `ShapePath` take such a name in its place.

    Parameters
    ----------
    name : of a motion; for a `Body` also the name of a file of `read_shape_path`, which comes first
    body : whose joints the motion must have; None: any

    Raises
    ------
    UnknownNameError
        For an unknown name.
    ShapeError
        For a motion of joints that the body does not have.
    TrajectoryError
        For the faults of a file.

    Examples
    --------
    >>> sp.examples.named_motion("cat_righting").duration
    2.0
    """
    body = None if body is None else as_body_or_particles(body)
    if isinstance(body, Body) and os.path.isfile(name):
        return read_shape_path(name, body)
    check_choice(name, "motion" if body is None else "motion (no such file either)", MOTIONS)
    path, owner = MOTIONS[name].path(), MOTIONS[name].body
    if body is not None and not set(path.joint_names or ()) <= set(body.joint_names):
        fitting = [other for other, known in MOTIONS.items() if known.body == body.name]
        hint = f"; of {body.name} there is {', '.join(fitting)}" if fitting else ""
        raise ShapeError(f"{name} is a motion of {owner}, whose joints {body.name} does not have{hint}")
    return path


@dataclass(frozen=True)
class _KaneScher:
    """Waist angles of `kane_scher` and their rates at times (N,), three or the two of the waist that cannot twist."""

    alpha: float
    beta: float
    duration: float
    angles: int
    swings: ClassVar[Swings] = Swings(4.0, smooth_loop=True)

    def __call__(self, times: Array) -> tuple[Array, Array]:
        frequency = 2.0 * np.pi / self.duration
        c, s = np.cos(frequency * times), np.sin(frequency * times)
        ca, sa, cb, sb = np.cos(self.alpha), np.sin(self.alpha), np.cos(self.beta), np.sin(self.beta)
        axis = np.stack([ca * cb - sa * sb * c, -sb * s, sa * cb + ca * sb * c], axis=-1)
        rate = frequency * np.stack([sa * sb * s, -sb * c, -ca * sb * s], axis=-1)
        return _untwisted(axis, rate) if self.angles == len(_WAIST) else _bent(axis, rate)


@dataclass(frozen=True)
class _CatRighting:
    """Every joint of the cat from the bend, which rises and falls, and its direction (ny, nz), which goes once round.

    largest_bend : of the waist [rad]
    tail_share : of the bend that the tail makes, relative
    twist : of the waist beyond that which bends it without twist, against the direction of the bend [rad]
    """

    duration: float
    joint_names: tuple[str, ...]
    largest_bend: float = 1.75867609613
    tail_share: float = 0.387753066315
    twist: float = 0.0
    swings: ClassVar[Swings] = Swings(4.0)

    def __call__(self, times: Array) -> tuple[Array, Array]:
        x = times / self.duration
        s = x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)
        s_rate = 140.0 * x**3 * (1.0 - x) ** 3 / self.duration
        bend, bend_rate = np.sin(np.pi * s), np.pi * s_rate * np.cos(np.pi * s)
        ny, nz = np.cos(2.0 * np.pi * s), -np.sin(2.0 * np.pi * s)
        ny_rate, nz_rate = 2.0 * np.pi * s_rate * nz, -2.0 * np.pi * s_rate * ny
        angle, turning = self.largest_bend * bend, self.largest_bend * bend_rate
        cosine, sine = np.cos(angle), np.sin(angle)
        axis = np.stack([cosine, nz * sine, -ny * sine], axis=-1)
        tilting = nz_rate * sine + nz * cosine * turning, -ny_rate * sine - ny * cosine * turning
        waist, waist_rate = _untwisted(axis, np.stack([-sine * turning, *tilting], axis=-1))
        waist[:, 2] += self.twist * bend * nz
        waist_rate[:, 2] += self.twist * (bend_rate * nz + bend * nz_rate)
        pitch, pitch_rate = bend * ny, bend_rate * ny + bend * ny_rate
        yaw, yaw_rate = bend * nz, bend_rate * nz + bend * nz_rate
        shapes, rates = (np.zeros((len(times), len(self.joint_names))) for _ in range(2))
        for column, joint in enumerate(_WAIST):
            place = self.joint_names.index(joint)
            shapes[:, place], rates[:, place] = waist[:, column], waist_rate[:, column]
        for joint, value, rate, factor in (
            ("neck_pitch", pitch, pitch_rate, -1.0),
            ("neck_yaw", yaw, yaw_rate, -1.0),
            ("tail_1_pitch", pitch, pitch_rate, self.tail_share),
            ("tail_1_yaw", yaw, yaw_rate, self.tail_share),
            *((f"front_{side}_shoulder_pitch", bend, bend_rate, 1.2) for side in ("left", "right")),
            *((f"front_{side}_elbow", bend, bend_rate, -2.4) for side in ("left", "right")),
            *((f"rear_{side}_hip_pitch", bend, bend_rate, -1.2) for side in ("left", "right")),
            *((f"rear_{side}_knee", bend, bend_rate, 2.4) for side in ("left", "right")),
        ):
            place = self.joint_names.index(joint)
            shapes[:, place], rates[:, place] = factor * value, factor * rate
        return shapes, rates


# Squares of tiny numbers are zero, also where NumPy is set to raise.
@np.errstate(under="ignore")
def _untwisted(axis: Array, axis_rate: Array) -> tuple[Array, Array]:
    """Waist angles pitch, yaw, roll (Ry Rz Rx) that carry the x axis to `axis` without twist, and their rates.

    The rotation is the one along the great circle from x to `axis`; all (N, 3).
    """
    (x, y, z), (dx, dy, dz) = axis.T, axis_rate.T
    upper, lower = y * z, x * (1.0 + x) + z * z
    upper_rate, lower_rate = dy * z + y * dz, dx * (1.0 + 2.0 * x) + 2.0 * z * dz
    angles = np.stack([np.arctan2(-z, x), np.arcsin(y), np.arctan2(upper, lower)], axis=-1)
    rates = np.stack(
        [
            (z * dx - x * dz) / (x * x + z * z),
            dy / np.sqrt(1.0 - y * y),
            (upper_rate * lower - upper * lower_rate) / (upper**2 + lower**2),
        ],
        axis=-1,
    )
    return angles, rates


def _bent(axis: Array, axis_rate: Array) -> tuple[Array, Array]:
    """Pitch and yaw (Ry Rz Ry, the pitch twice) that carry the x axis to `axis`, and their rates; all (N, 2) of (N, 3).

    1 + x = cos^2(pitch) (1 + cos(yaw)), so the only singular axis is -x.
    """
    (x, y, z), (dx, dy, dz) = axis.T, axis_rate.T
    reach = 1.0 + x
    pitch = np.arctan2(-z, reach)
    pitch_rate = (z * dx - reach * dz) / (reach**2 + z**2)
    across = y * np.cos(pitch)
    across_rate = dy * np.cos(pitch) - y * np.sin(pitch) * pitch_rate
    yaw = 2.0 * np.arctan2(across, reach)
    yaw_rate = 2.0 * (across_rate * reach - across * dx) / (reach**2 + across**2)
    return np.stack([pitch, yaw], axis=-1), np.stack([pitch_rate, yaw_rate], axis=-1)


def _loop(curve: Curve, period: float, names: tuple[str, ...]) -> ShapePath:
    return ShapePath(curve, period, np.array([0.0, period]), len(names), names)


def _cat_loop(duration: float, **bends: float) -> ShapePath:
    """Path of the cat that rights itself, with the numbers of `_CatRighting`."""
    period, names = positive_argument(duration), load_body("cat").joint_names
    return _loop(_CatRighting(period, names, **bends), period, names)


def _one_harmonic(name: str, duration: float, joints: Mapping[str, tuple[float, ...]]) -> ShapePath:
    """A loop of a body with one harmonic: mean, cosine and sine for the joints that move."""
    body = load_body(name)
    mean, cosine, sine = np.zeros((3, body.n_shape))
    for joint, (a, b, c) in joints.items():
        place = body.joint_index(joint)
        mean[place], cosine[place], sine[place] = a, b, c
    return ShapePath.fourier(mean, cosine[:, None], sine[:, None], duration, joint_names=body.joint_names)
