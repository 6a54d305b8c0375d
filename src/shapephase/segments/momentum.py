"""Angular momentum about the centre of mass in time, whole and by link, of motions and of recordings as they are."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_choice, positive_argument, times_argument
from ..arrays import Array, finite_array
from ..body import Body, visuals
from ..body.link_motions import link_motions
from ..body.loading import as_body
from ..deformation.deformation import articulated
from ..display import frozen, short_repr
from ..dynamics.moving_body import needed_body_and_path
from ..errors import ShapeError, TrajectoryError, TrajectoryWarning, WrongObjectError
from ..letters import value_text
from ..reconstruction import AthleteAxes
from ..reconstruction.motion_record import write_table
from ..reconstruction.reconstruction import Motion, reconstruct
from ..shape_space.files.read import RecordedMotion
from ..shape_space.free_fall import GRAVITY, free_fall
from ..shape_space.shape_path import ShapePath
from ._momentum_samples import (
    INERTIAL,
    Directions,
    MomentumSamples,
    Recorded,
    samples_of_motion,
    samples_of_recording,
    with_noise,
)
from .limbs import SegmentTree

_ROWS = 201  # times of a motion, by default
_BEYOND = 3.6  # bars of a change in one of three components: chance brings it in one of 1000 flights
_ROUGH = 1e-4  # [rad] tolerance of a motion that only shows which way the athlete's axes point
_FEWEST_IN_FLIGHT = 3  # samples: a line has two unknowns
_FORMULAS = {
    "speed": ("m h v", "1"),
    "gravity": ("m h sqrt(g h)", "1"),
    "inertia": ("m h^2", "1/s"),
}  # divisor of a momentum, and the unit of the quotient
AXES = ("inertial", "athlete")  # words for `axes`
NORMALISATIONS = tuple(_FORMULAS)


@dataclass(frozen=True)
class Normalisation:
    """Divisor of all momenta.

    Attributes
    ----------
    formula : of the divisor
    divisor : [kg m^2/s], or [kg m^2] for "m h^2"
    mass : m, of the body [kg]
    stature : h [m]
    stature_by : "given", or how it was measured
    speed : v, mean horizontal speed of the centre of mass [m/s]; None: not in the formula
    gravity : g [m/s^2]; None: not in the formula

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> found = sp.segment_momentum(motion, normalise="inertia", stature=0.5)
    >>> found.normalisation.formula, found.normalisation.divisor, found.unit
    ('m h^2', 0.5, '1/s')
    """

    formula: str
    divisor: float
    mass: float
    stature: float
    stature_by: str
    speed: float | None = None
    gravity: float | None = None

    __repr__ = short_repr


@frozen
class FlightMomentum:
    """Whole momentum in one flight.

    Attributes
    ----------
    first_time, last_time : [s]
    mean, mean_bar : (C,) along the chosen axes, with standard deviations
    change, change_bar : (3,) from the first to the last time by the best straight line, inertial axes
    percent, percent_bar : size of the change, of that of the mean, or of `relative_to`; None: both are zero
    relative_to : "mean", or "links" where the mean is within its noise: the rms sum of the sizes of the links' momenta
    more_than_noise : True where a component changes by more than 3.6 bars

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> sp.segment_momentum(motion).flights[0].more_than_noise
    False
    """

    first_time: float
    last_time: float
    mean: Array
    mean_bar: Array
    change: Array
    change_bar: Array
    percent: float | None
    percent_bar: float | None
    relative_to: str
    more_than_noise: bool


@frozen
class SegmentMomentum:
    """Angular momentum about the centre of mass of the whole body, at N times, along C axes.

    The local part of a link is its inertia times its angular velocity, the remote part that of its mass at its centre
    of mass. Made by `segment_momentum`.

    Attributes
    ----------
    times : (N,) [s]
    links : names of the L moving parts, each by its first link
    limbs : limb of each of them, or "trunk"
    axes : names of the C axes
    local, remote : (N, L, C) in `unit`
    bars : (N, L, C) standard deviations of local and remote together
    whole, whole_bars : (N, C) sum of all links, and its standard deviations
    unit : "kg m^2/s", or of the quotient by `normalisation`
    normalisation : None: momenta are absolute
    flights : whole momentum in each flight; empty where none was found
    as_recorded : True where nothing is presumed to be conserved

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.5)
    >>> found = sp.segment_momentum(sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005]))
    >>> found.links, found.local.shape, (found.whole[100].round(9) + 0.0).tolist()
    (('front', 'rear'), (201, 2, 3), [0.0, 0.0, 0.005])
    """

    times: Array
    links: tuple[str, ...]
    limbs: tuple[str, ...]
    axes: tuple[str, ...]
    local: Array
    remote: Array
    bars: Array
    whole: Array
    whole_bars: Array
    unit: str
    normalisation: Normalisation | None
    flights: tuple[FlightMomentum, ...]
    as_recorded: bool

    @property
    def by_link(self) -> Array:
        """Local and remote parts together: (N, L, C)."""
        return self.local + self.remote

    def by_limb(self) -> dict[str, Array]:
        """Local and remote parts of the links of each limb together, (N, C) by its name."""
        names = np.array(self.limbs)
        return {limb: self.by_link[:, names == limb].sum(axis=1) for limb in dict.fromkeys(self.limbs)}

    def __str__(self) -> str:
        """Return flights and links as a table."""
        from .momentum_text import momentum_lines

        return "\n".join(momentum_lines(self))

    def to_dict(self) -> dict[str, Any]:
        """Return flights, means of links and the normalisation for JSON; `columns` has the times."""
        from .momentum_text import momentum_data

        return momentum_data(self)

    def columns(self) -> dict[str, Array]:
        """Columns of a table by name: time, whole momentum with bars, local and remote part of each link."""
        unit = {"kg m^2/s": "kg_m2_s", "1/s": "1_s", "1": "1"}[self.unit]
        columns = {"time": self.times}
        for k, axis in enumerate(self.axes):
            columns[f"momentum_{axis}_{unit}"] = self.whole[:, k]
            columns[f"momentum_bar_{axis}_{unit}"] = self.whole_bars[:, k]
        for n, link in enumerate(self.links):
            for part, values in (("local", self.local), ("remote", self.remote)):
                for k, axis in enumerate(self.axes):
                    columns[f"{link}_{part}_momentum_{axis}_{unit}"] = values[:, n, k]
        return columns

    def write_csv(self, path: str | os.PathLike[str]) -> None:
        """Write `columns` to a CSV file."""
        write_table(path, self.columns())


class _Source(NamedTuple):
    """Samples, ends of flights and what else a recording or a motion has.

    flights : first and last sample of each
    position : (N, 3) of the base's origin [m], or None
    path : of the joints; None: none
    motion : None for a recording
    """

    samples: MomentumSamples
    flights: list[tuple[int, int]]
    position: Array | None = None
    path: ShapePath | None = None
    motion: Motion | None = None


def segment_momentum(
    motion: Any,
    body: Body | str | None = None,
    *,
    times: ArrayLike | None = None,
    axes: str | ArrayLike = "inertial",
    normalise: str | None = None,
    stature: float | None = None,
    speed: float | None = None,
    gravity: float = GRAVITY,
    flight: str | Sequence[float] = "auto",
    up: str | None = None,
    attitude_noise: float | None = None,
    joint_noise: ArrayLike | None = None,
) -> SegmentMomentum:
    """Angular momentum about the centre of mass in time, whole and by link, of a motion or as it was recorded.

    A recording is taken as it is, and nothing is presumed to be conserved: rates are those of smoothing splines through
    attitudes and joints, or as recorded, and bars hold the noise of the samples. The whole of a `Motion` is its
    momentum at all times, and bars hold its numerical error.

    Bars of a recording take its noise to be white, and the body's masses to be right.

    Parameters
    ----------
    motion : a single `Motion` of a body with joints, a `RecordedMotion` with its base, or a `FloatingTrajectory`
    body : of a recording
    times : (N,) of a `Motion` [s]; None: 201 even times. A recording has its own
    axes : "inertial"; "athlete": somersault (inertial), frontal and longitudinal axis (both with the body), by
        `Motion.athlete_axes`; or an inertial direction (3,)
    normalise : "speed" divides by m h v, "gravity" by m h sqrt(g h), "inertia" by m h^2; None: kg m^2/s
    stature : h [m]; None: extent of the body along its longitudinal axis in the first posture, by the shapes that are
        drawn: those of its file, else boxes of the links' inertia
    speed : v [m/s]; None: mean horizontal speed of the centre of mass, where places were recorded
    gravity : g [m/s^2], also of the falls that are flights
    flight : of a recording "auto": the flight that was read, else each fall of the centre of mass; "all"; or its first
        and last time [s]
    up : axis of the recording that points up; None: the one with the longest fall
    attitude_noise, joint_noise : standard deviations of a sample of the base [rad], and of the joints, one or (n,) [rad
        or m]; None: those of smoothing, else what differences of the samples show

    Raises
    ------
    WrongObjectError
        For other objects, a motion without joints, and axes that are not defined.
    ShapeError, UnknownNameError, TrajectoryError
        For arguments that do not fit, a recording without the attitude of the base, or of less than eight samples.

    Warns
    -----
    TrajectoryWarning
        For a recording that was low-pass filtered, without `attitude_noise`.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> sp.export_motion(motion, "turn.csv")
    >>> recorded = sp.read_recorded_motion("turn.csv", cat)
    >>> found = sp.segment_momentum(recorded, cat, flight="all")
    >>> print(found.flights[0].mean.round(6) + 0.0, found.flights[0].more_than_noise)
    [0.    0.    0.005] False
    """
    if normalise is not None:
        check_choice(normalise, "normalise", NORMALISATIONS)
    pull = positive_argument(gravity, "gravity", "an acceleration in m/s^2")
    kind = type(motion).__name__
    if not isinstance(motion, Motion | RecordedMotion) and kind != "FloatingTrajectory":
        raise WrongObjectError(
            f"motion: a Motion, a RecordedMotion or a FloatingTrajectory is needed, got {value_text(motion)}"
        )
    is_recorded, by_fall = not isinstance(motion, Motion), isinstance(flight, str) and flight == "auto"
    options = {
        "stature": (stature, normalise is not None),
        "speed": (speed, normalise == "speed"),
        "flight": (None if by_fall else flight, is_recorded),
        "attitude_noise": (attitude_noise, is_recorded),
        "joint_noise": (joint_noise, is_recorded),
    }
    idle = {name: value for name, (value, used) in options.items() if value is not None and not used}
    if idle:
        names = ", ".join(f"{name} ({value_text(value)})" for name, value in idle.items())
        raise ShapeError(
            f"{names}: without effect here; leave it out: stature needs normalise, speed needs normalise='speed', and "
            "flight and noise need a recording"
        )
    if isinstance(motion, Motion):
        source = _of_motion(motion, times)
    else:
        body = as_body(body)
        if isinstance(motion, RecordedMotion):
            recorded, given = _of_recording(motion), motion.flight is not None
            if motion.smoothing is not None and motion.smoothing.low_pass is not None and attitude_noise is None:
                warnings.warn(
                    "what the low-pass filter took off the noise of the base is no longer in its samples, so that bars "
                    "are too short; give the noise before the filter: attitude_noise (--attitude-noise 0.2deg)",
                    TrajectoryWarning,
                    stacklevel=2,
                )
        else:
            recorded, given = _of_trajectory(motion), False
        if times is not None:
            raise ShapeError("times: a recording has its own; resample it as it is read (resample)")
        levels = None if joint_noise is None else _joint_levels(joint_noise, body)
        base = (
            None if attitude_noise is None else positive_argument(attitude_noise, "attitude_noise", "an angle in rad")
        )
        recorded = with_noise(recorded, base, levels)
        if recorded.shapes.shape[1] != body.n_shape:
            raise ShapeError(
                f"motion: {recorded.shapes.shape[1]} columns of joints, and {body.name} has {body.n_shape}; give the "
                "body that it was read for"
            )
        samples = samples_of_recording(body, recorded)
        ends = _flights(body, recorded, "all" if given and by_fall else flight, up, pull)
        path = ShapePath.spline(
            recorded.times - recorded.times[0], recorded.shapes, False, joint_names=body.joint_names
        )
        source = _Source(samples, ends, recorded.position, recorded.path or path)
    found = source.samples
    inertial = found.momenta(INERTIAL).sum(axis=2)
    athlete = None
    if isinstance(axes, str):
        check_choice(axes, "axes", AXES)
    if (isinstance(axes, str) and axes == "athlete") or (normalise is not None and stature is None):
        athlete = _athlete(source, inertial.sum(axis=1), up)
    directions = _directions(axes, athlete)
    normalisation = None
    if normalise is not None:
        normalisation = _normalisation(normalise, source, athlete, stature, speed, pull)
    divisor = 1.0 if normalisation is None else normalisation.divisor
    momenta, bars = found.momenta(directions) / divisor, found.bars(directions) / divisor
    frames = _frames_with_links(found.body)
    whole = momenta.sum(axis=(1, 2))
    return SegmentMomentum(
        times=found.times,
        links=tuple(frames),
        limbs=_limbs(found.body, frames.values()),
        axes=directions.names,
        local=momenta[:, list(frames.values()), 0],
        remote=momenta[:, list(frames.values()), 1],
        bars=bars[:, [1 + frame for frame in frames.values()]],
        whole=whole,
        whole_bars=bars[:, 0],
        unit="kg m^2/s" if normalise is None else _FORMULAS[normalise][1],
        normalisation=normalisation,
        flights=tuple(_flight(found, directions, inertial, divisor, ends) for ends in source.flights),
        as_recorded=source.motion is None,
    )


def _frames_with_links(body: Body) -> dict[str, int]:
    """First link of each moving part -> its frame of the chain."""
    frames: dict[int, str] = {}
    for part in body.moving_parts:
        frames.setdefault(body.chain.link_frames[part.links[0]][0], part.links[0])
    return {link: frame for frame, link in sorted(frames.items()) if body.chain.masses[frame] > 0.0 or len(frames) == 1}


def _limbs(body: Body, frames: Iterable[int]) -> tuple[str, ...]:
    """Limb of each of some frames, or "trunk"."""
    tree = SegmentTree(body)
    by_joint = {joint: name for name, limb in tree.limbs().items() for joint in limb.joints}
    inside = tree.trunk_frames
    return tuple(
        "trunk" if frame in inside else by_joint.get(tree.joint_of.get(frame, ""), "trunk") for frame in frames
    )


def _of_motion(motion: Motion, times: ArrayLike | None) -> _Source:
    if motion.batch:
        raise ShapeError(f"momenta of links are those of one motion, this is a batch of {motion.batch}")
    at = np.linspace(0.0, motion.duration, _ROWS) if times is None else finite_array(times, "times", (None,), unit="s")
    at = times_argument(at, motion.duration)
    if at.ndim != 1 or len(at) < _FEWEST_IN_FLIGHT or np.any(np.diff(at) <= 0.0):
        raise ShapeError(f"times: (N,) ascending, three or more, are needed, got shape {at.shape}")
    return _Source(
        samples_of_motion(motion, at),
        [(0, len(at) - 1)],
        path=needed_body_and_path(motion, "momenta of links need")[1],
        motion=motion,
    )


def _of_recording(recorded: RecordedMotion) -> Recorded:
    if recorded.base_attitude is None:
        raise TrajectoryError(
            f"{recorded.record['file']}: the attitude of the base is not recorded, which its momentum needs; columns "
            "such as base_qx base_qy base_qz base_qw are needed, or reconstruct a motion with a known momentum"
        )
    times = np.asarray(recorded.times)
    return Recorded(
        times=times,
        attitude=recorded.base_attitude,
        shapes=recorded.path.shape(times),
        path=recorded.path,
        position=recorded.base_position,
    )


def _of_trajectory(trajectory: Any) -> Recorded:
    noise = trajectory.noise
    return Recorded(
        times=trajectory.times,
        attitude=trajectory.attitude,
        shapes=trajectory.shapes,
        position=trajectory.position,
        spin=trajectory.base_rate,
        joint_rates=trajectory.joint_rates,
        noise=(None, None) if noise is None else (noise.attitude, np.array(noise.joints)),
    )


def _joint_levels(given: ArrayLike, body: Body) -> Array:
    levels = finite_array(given, "joint_noise")
    if levels.shape not in ((), (body.n_shape,)) or np.any(levels < 0.0):
        raise ShapeError(
            f"joint_noise: one standard deviation or {body.n_shape} of them, zero or above, are needed, got "
            f"{value_text(given)}"
        )
    return np.array(np.broadcast_to(levels, body.n_shape))


def _flights(
    body: Body, recorded: Recorded, flight: str | Sequence[float], up: str | None, gravity: float
) -> list[tuple[int, int]]:
    """First and last sample of each flight."""
    times = recorded.times
    if isinstance(flight, str):
        check_choice(flight, "flight", ("auto", "all"))
        if flight == "all":
            return [(0, len(times) - 1)]
        if recorded.position is None:
            return []
        centres = recorded.position + so3.apply(recorded.attitude, body.centre_of_mass(recorded.shapes))
        try:
            return list(free_fall(times - times[0], centres, "motion", up=up, gravity=gravity).all_ends)
        except TrajectoryError:
            return []
    ends = finite_array(flight, "flight", (2,), unit="s")
    inside = np.flatnonzero((times >= ends[0]) & (times <= ends[1])) if ends.ndim == 1 else np.zeros(0)
    if len(inside) < _FEWEST_IN_FLIGHT:
        raise TrajectoryError(
            f"flight: {len(inside)} samples from {value_text(flight)} s, three or more are needed; the recording goes "
            f"from {times[0]:.9g} to {times[-1]:.9g} s"
        )
    return [(int(inside[0]), int(inside[-1]))]


def _athlete(source: _Source, inertial: Array, up: str | None) -> AthleteAxes:
    """Axes of the athlete; of a recording by a motion with its mean momentum in the first flight."""
    if source.motion is not None:
        return source.motion.athlete_axes(up=up)
    assert source.path is not None
    first, last = source.flights[0] if source.flights else (0, len(inertial) - 1)
    mean = inertial[first : last + 1].mean(axis=0)
    deformation = articulated(source.samples.body, source.path)
    return reconstruct(deformation, mean, source.samples.attitude[0], tolerance=_ROUGH).athlete_axes(up=up)


def _directions(axes: str | ArrayLike, athlete: AthleteAxes | None) -> Directions:
    if isinstance(axes, str):
        if axes == "inertial":
            return INERTIAL
        assert athlete is not None
        vectors = np.stack([athlete.somersault, athlete.frontal, athlete.longitudinal])
        return Directions(("somersault", "frontal", "longitudinal"), vectors, np.array([False, True, True]))
    vector = finite_array(axes, "axes", (3,))
    length = float(np.linalg.norm(vector))
    if vector.ndim != 1 or length == 0.0:
        raise ShapeError(
            f"axes: 'inertial', 'athlete' or three numbers, not all zero, are needed, got {value_text(axes)}"
        )
    return Directions(("along",), vector[None] / length, np.zeros(1, dtype=bool))


def _normalisation(
    word: str, source: _Source, athlete: AthleteAxes | None, stature: float | None, speed: float | None, gravity: float
) -> Normalisation:
    body, formula = source.samples.body, _FORMULAS[word][0]
    if stature is not None:
        height, by = positive_argument(stature, "stature", "a length in m"), "given"
    else:
        assert athlete is not None
        assert source.path is not None
        height, by = _stature(body, source.path.shape(0.0), athlete.longitudinal), "first posture, as drawn"
    if word == "inertia":
        return Normalisation(formula, body.mass * height**2, body.mass, height, by)
    if word == "gravity":
        return Normalisation(
            formula, body.mass * height * float(np.sqrt(gravity * height)), body.mass, height, by, gravity=gravity
        )
    pace = _mean_speed(source, athlete) if speed is None else positive_argument(speed, "speed", "a speed in m/s")
    return Normalisation(formula, body.mass * height * pace, body.mass, height, by, speed=pace)


def _stature(body: Body, shape: Array, axis: Array) -> float:
    """Extent along an axis of the base of the shapes that are drawn: those of its file, else boxes of inertia [m]."""
    links = link_motions(body.chain, shape[None], np.zeros_like(shape)[None])
    origins = links.places[0] - so3.apply(links.turns[0], body.chain.centres)
    heights: list[float] = []
    for visual in visuals(body):
        frame, pose = body.chain.link_frames[visual.link]
        in_frame = pose @ visual.pose
        corners = visual.corners @ in_frame[:3, :3].T + in_frame[:3, 3]
        heights += ((origins[frame] + corners @ links.turns[0, frame].T) @ axis).tolist()
    return max(heights) - min(heights)


def _mean_speed(source: _Source, athlete: AthleteAxes | None) -> float:
    """Mean horizontal speed of the centre of mass [m/s]."""
    if source.position is None or source.path is None:
        raise ShapeError(
            "speed: the places of the base are not recorded, so the mean speed v of m h v is unknown; give it: speed "
            "(--speed), or normalise by 'gravity' or 'inertia'"
        )
    samples = source.samples
    since = samples.times - samples.times[0]
    centres = source.position + so3.apply(samples.attitude, samples.body.centre_of_mass(source.path.shape(since)))
    way = (centres[-1] - centres[0]) / since[-1]
    up = np.array([0.0, 0.0, 1.0]) if athlete is None else athlete.up
    pace = float(np.linalg.norm(way - (way @ up) * up))
    if pace == 0.0:
        raise ShapeError("speed: the centre of mass does not move horizontally; give another speed (--speed)")
    return pace


def _flight(
    samples: MomentumSamples, directions: Directions, inertial: Array, divisor: float, ends: tuple[int, int]
) -> FlightMomentum:
    """Mean along the chosen axes, change in inertial ones, of momenta (N, L, 3)."""
    inside = slice(ends[0], ends[1] + 1)
    times = samples.times[inside]
    since = times - times.mean()
    weights = np.zeros((2, len(samples.times)))
    weights[0, inside] = 1.0 / len(times)
    weights[1, inside] = since * (times[-1] - times[0]) / (since**2).sum()
    mean, change = weights @ inertial.sum(axis=1) / divisor
    mean_bar, change_bar = samples.summed_bars(INERTIAL, weights) / divisor
    size, bar = float(np.linalg.norm(change)), float(np.linalg.norm(change_bar))
    relative_to, scale = "mean", float(np.linalg.norm(mean))
    if scale <= _BEYOND * float(np.linalg.norm(mean_bar)):
        sizes = np.linalg.norm(inertial[inside], axis=2).sum(axis=1) / divisor
        relative_to, scale = "links", float(np.sqrt((sizes**2).mean()))
    if directions is not INERTIAL:
        mean = weights[0] @ samples.momenta(directions).sum(axis=(1, 2)) / divisor
        mean_bar = samples.summed_bars(directions, weights[:1])[0] / divisor
    return FlightMomentum(
        first_time=float(times[0]),
        last_time=float(times[-1]),
        mean=mean,
        mean_bar=mean_bar,
        change=change,
        change_bar=change_bar,
        percent=100.0 * size / scale if scale > 0.0 else None,
        percent_bar=100.0 * bar / scale if scale > 0.0 else None,
        relative_to=relative_to,
        more_than_noise=bool(np.any(np.abs(change) > _BEYOND * change_bar)),
    )
