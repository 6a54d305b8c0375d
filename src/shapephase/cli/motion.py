"""Body and motion of a command, loaded and reconstructed."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .. import so3
from ..arguments import tolerance_argument
from ..arrays import Array, finite_array
from ..body.body import Body
from ..body.loading import load_body
from ..deformation.deformation import Deformation
from ..deformation.frames import gauge_link
from ..deformation.rotors import RotorDescription
from ..errors import ShapeError, unknown_name
from ..examples.scenarios import MOTIONS, named_motion
from ..integrator.constants import USUAL_TOLERANCE
from ..integrator.machine_code import expect_work
from ..reconstruction.reconstruction import Motion, momentum_from_rate, reconstruct
from ..run_progress import ProgressCallback
from ..shape_space.files.base_columns import ESTIMATE
from ..shape_space.files.flight import ANY_GRAVITY, RECORDED
from ..shape_space.files.labels import rate_size
from ..shape_space.files.options import name_pair, read_names
from ..shape_space.files.read import RecordedMotion, read_recorded_motion
from ..shape_space.shape_path import ShapePath, without_joints
from .joint_values import joint_values
from .options import (
    BODY_DEFAULTS,
    RECORDING_DEFAULTS,
    WHEEL_DEFAULTS,
    BodyOptions,
    RecordingOptions,
    StartOptions,
    WheelOptions,
)
from .wheels import NO_WHEELS, Wheels, wheel_lines, with_wheels

if TYPE_CHECKING:
    from ..error_bars.recorded_momentum import RecordedMomentum

_STANDARD_INPUT = "-"  # instead of a file name
_RECONSTRUCTIONS = 10  # in a fit of a momentum: two in each of some five rounds

# Endings of files that hold motions, and never bodies.
_OF_MOTIONS = (".csv", ".tsv", ".mot", ".sto", ".npz", ".npy", ".mat", ".parquet", ".xlsx", ".c3d", ".bag", ".mcap")
_LONGEST_SHOWN = 80  # characters of a name that an error repeats


@dataclass(frozen=True, eq=False)
class LoadedMotion:
    """A reconstructed motion, its body, path and recording.

    Attributes
    ----------
    recorded : None where the joints are not from a file
    fitted : its momentum, where it was fitted to the recorded base
    momentum_by : "fit", "given", or "nothing" for a recording without a turning base
    """

    motion: Motion
    body: Body
    path: ShapePath
    recorded: RecordedMotion | None
    fitted: RecordedMomentum | None = None
    momentum_by: str = "given"

    @property
    def beginning(self) -> str:
        """Text for the first line about a recording, its flight, or why its momentum is zero; and lines of wheels."""
        return "\n".join([self._of_recording, *wheel_lines(self.motion.deformation)])

    @property
    def _of_recording(self) -> str:
        if self.recorded is None:
            return ""
        if self.momentum_by == "nothing":
            base = "nothing of the base is recorded" if self.recorded.base_attitude is None else "the base never turns"
            return f", zero as {base} and no --momentum is given"
        record = self.recorded.record
        if self.recorded.flight is None and self.fitted is None:
            return ""
        whole = record["samples"] == record["samples_in_file"]
        return (
            f", {'all' if whole else 'flight'} from {record['first_time']:.9g} to {record['last_time']:.9g} "
            f"{record['time_unit']}"
        )

    @property
    def up(self) -> str | None:
        """Axis that points up in the recording, by its fall; None without one."""
        fall = None if self.recorded is None or self.recorded.flight is None else self.recorded.flight.fall
        return None if fall is None else fall.up.removeprefix("+")


def flight(
    body: str,
    motion: str,
    options: StartOptions,
    recording: RecordingOptions,
    tolerance: float = USUAL_TOLERANCE,
    progress: ProgressCallback | None = None,
    *,
    gauge: str = "base",
    trail: str | None = None,
    joint_noise: str | None = None,
    floating: BodyOptions = BODY_DEFAULTS,
    wheels: WheelOptions = WHEEL_DEFAULTS,
) -> LoadedMotion:
    """Return the motion of a command. Gauge, tolerance and trail are checked before the motion is read.

    joint_noise : for the fit of a momentum; None: that of the smoothing
    """
    start = _start(motion, options)
    goal = tolerance_argument(tolerance)
    momentum = None if options.momentum is None else finite_array(options.momentum, "momentum", (3,), unit="kg m^2/s")
    rate = _rate(options)
    plain = body_argument(body, floating)
    loaded, spinning = with_wheels(plain, wheels)
    for link in (gauge_link(gauge), trail):
        if link is not None:
            loaded.link_pose(loaded.shape(), link)
    path, recorded = joint_motion(motion, plain, recording, spinning, given=options.has_momentum)
    is_fitted = recorded is not None and not options.has_momentum
    expect_work(rows=len(path.breaks) * (_RECONSTRUCTIONS if is_fitted else 1))
    if recorded is None:
        deformation = spinning.deformation(loaded, path, None)
        if rate is not None:
            momentum = momentum_from_rate(deformation, rate, start, time=options.rate_time or 0.0)
        zero = np.zeros(3) if momentum is None else momentum
        moved = reconstruct(deformation, zero, start, tolerance=goal, progress=progress)
        return LoadedMotion(motion=moved, body=loaded, path=whole_path(deformation, path), recorded=None)
    from ..error_bars.recorded_flight import motion_from_recording

    flown = motion_from_recording(
        loaded,
        recorded,
        momentum=momentum,
        rate=rate,
        rate_time=options.rate_time or 0.0,
        attitude=start,
        joints=joint_noise,
        tolerance=goal,
        find_axes=recording.base_axes == ESTIMATE,
        progress=progress,
        rotors=spinning.momenta,
        rotor_speeds=spinning.speeds,
    )
    path = whole_path(flown.motion.deformation, path)
    return LoadedMotion(flown.motion, loaded, path, recorded, flown.fitted, flown.momentum_by)


def whole_path(deformation: Deformation, path: ShapePath) -> ShapePath:
    """Return the path with a column for each wheel, whose angle rests at zero."""
    description = deformation.description
    return description.route if isinstance(description, RotorDescription) else path


def _start(motion: str, options: StartOptions) -> Array | None:
    """Return the attitude at the start (3, 3): as given, or that of a motion of the library."""
    if options.attitude is not None:
        return so3.quat_argument(options.attitude, "attitude")
    return so3.matrix_from_quat(np.array(MOTIONS[motion].attitude)) if _is_named(motion) else None


def _rate(options: StartOptions) -> Array | None:
    """Return --rate [rad/s]. Raises ShapeError for other words than three numbers with a unit or without."""
    words = " ".join(options.rate).replace(",", " ").split()
    if not words:
        if options.rate_time is not None:
            raise ShapeError("--rate-time is the time of --rate; give it, too, as in --rate 0 0 0.01")
        return None
    if options.momentum is not None:
        raise ShapeError("--rate and --momentum: either states how the body turns; leave one of them out")
    size, omega = rate_size(words[-1]) if len(words) > 3 else 1.0, np.zeros(3)
    try:
        omega = np.array([float(word) for word in words[:3]])
    except ValueError:
        size = None
    if size is None or len(words) not in (3, 4):
        raise ShapeError(
            "--rate: three numbers in rad/s, or with a unit behind them, are needed, as in --rate 0 0 0.01 or "
            f"--rate '0 0 2 deg/s', got {' '.join(words)!r:.{_LONGEST_SHOWN}}"
        )
    return size * finite_array(omega, "rate", (3,), unit="rad/s")


def _is_named(motion: str) -> bool:
    """True for a motion of the library, if no file has its name."""
    return motion in MOTIONS and not os.path.isfile(motion)


def is_without_momentum(motion: str, options: StartOptions) -> bool:
    """True where the momentum is zero for sure; a recorded base may still give one."""
    if options.rate:
        return False  # joints that move carry momentum even where the base rests
    return _is_named(motion) if options.momentum is None else not any(options.momentum)


def body_argument(body: str, floating: BodyOptions) -> Body:
    """Return the body of a command. Raises like `load_body`, and ShapeError for a motion in its place."""
    is_file = os.path.isfile(body)
    if (body in MOTIONS and not is_file) or (is_file and Path(body).suffix.lower() in _OF_MOTIONS):
        raise ShapeError(
            f"{body[:_LONGEST_SHOWN]} is a motion; the body comes before it, as in `shapephase split cat cat_righting`"
        )
    return load_body(body, **floating.loading)


def joint_motion(
    motion: str,
    body: Body,
    recording: RecordingOptions = RECORDING_DEFAULTS,
    wheels: Wheels = NO_WHEELS,
    *,
    given: bool | None = None,
) -> tuple[ShapePath, RecordedMotion | None]:
    """Return the path of a motion, without its wheels, and its recording if it comes from a file.

    given : whether its momentum is given; False: it is fitted to the base; None: none is needed
    """
    if _is_named(motion):
        for field in fields(recording):
            if field.name != "up" and getattr(recording, field.name) != field.default:
                option = f"--{field.name.replace('_', '-')}"
                raise ShapeError(f"{option} is for recorded motions; {motion} is a motion of the library")
        path = named_motion(motion, body)
        for name, column in wheels.columns.items():
            raise ShapeError(
                f"--rotor-speed {name}={column}: columns are those of recorded motions; {motion} is a motion of the "
                f"library: give a speed, as {name}=6000rpm"
            )
        return without_joints(path, wheels.names), None
    if motion.startswith("-") and motion != _STANDARD_INPUT and not os.path.exists(motion):
        raise ShapeError(f"there is no option {motion[:_LONGEST_SHOWN]!r} of this command, and no such file either")
    if motion != _STANDARD_INPUT and not Path(motion).suffix and not os.path.exists(motion):
        raise unknown_name("motion (no such file either)", motion[:_LONGEST_SHOWN], MOTIONS)
    stretch = flight_words(recording.flight)
    choices = {name: value for name, value in vars(recording).items() if name != "step"} | {
        "timestep": recording.step,
        "names": column_names(recording.names),
        "rest": joint_values(body, recording.rest, "--rest"),
        "flight": stretch or (RECORDED if given is False else None),
        "trim": stretch if isinstance(stretch, tuple) else None,  # what lies outside may have gaps
        "gravity": ANY_GRAVITY if given and recording.gravity is None else recording.gravity,
        "without": [name for name in wheels.names if name in body.joint_names],
        "wheel_speeds": wheels.columns,
    }
    recorded = read_recorded_motion(motion, body, **choices)
    return recorded.path, recorded


def column_names(words: tuple[str, ...]) -> dict[str, str | None]:
    """Return the mapping of `--names`: pairs, files of pairs, or the names of all columns of a table without a header.

    Raises ShapeError for a column that stands twice.
    """
    found: dict[str, str | None] = {}
    for word in words:
        if "=" in word:
            pairs = dict([name_pair(word, "--names")])
        elif "," in word and not Path(word).exists():
            pairs = {str(number): name.strip() or None for number, name in enumerate(word.split(","), start=1)}
        else:
            pairs = read_names(word)
        doubled = [old for old in pairs if old in found]
        if doubled:
            raise ShapeError(f"--names: column {doubled[0]!r:.60} stands twice")
        found |= pairs
    return found


def flight_words(words: tuple[str, ...]) -> str | tuple[float, float] | None:
    """Return what `--flight` states: a word or two times. Raises ShapeError."""
    if len(words) < 2:
        return words[0] if words else None
    try:
        first, last = map(float, words)
    except ValueError:
        first = last = math.nan
    if not first < last:
        raise ShapeError(
            f"--flight: auto, auto:2, all, or a first and a later last time are needed, got {' '.join(words)!r:.60}"
        )
    return first, last
