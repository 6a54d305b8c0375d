"""Arguments and options that several commands take, each declared once with its help.

Rare options stand in a group of their own, which `--help` only counts and `--help-all` lists.
"""

from __future__ import annotations

from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

from ..errors import ShapeError

if TYPE_CHECKING:
    from cyclopts.help import HelpPanel
    from rich.console import Console, ConsoleOptions

HELP_ALL = "--help-all"
SHOWS_ALL: ContextVar[bool] = ContextVar("SHOWS_ALL", default=False)  # True while a page of `--help-all` is printed


def _print_rare(console: Console, options: ConsoleOptions, panel: HelpPanel) -> None:
    from cyclopts.help.formatters import DefaultFormatter

    if SHOWS_ALL.get():
        DefaultFormatter()(console, options, panel)
    else:
        console.print(f"{len(panel.entries)} more options: {HELP_ALL}")


RARE = Group("More options", sort_key=1, help_formatter=_print_rare)


def option(text: str | None = None, *, several: bool = False, **more: Any) -> Parameter:
    """Return an option with its help, by default the text below it; of `several` values up to the next option."""
    more |= {"negative_iterable": "", "consume_multiple": True} if several else {}
    more |= {} if text is None else {"help": text}
    return Parameter(show_default=False, **more)


def rare(text: str | None = None, **more: Any) -> Parameter:
    """Return an option that only `--help-all` shows."""
    return option(text, group=RARE, **more)


BodyArgument = Annotated[
    str,
    Parameter(
        help="The body: a file (URDF, xacro, MJCF, OpenSim, bioMod, BVH, MVNX, measurements of Yeadon's human), a name "
        "from `shapephase robots`, or example:NAME of example-robot-data; for example `cat`."
    ),
]
MotionArgument = Annotated[
    str,
    Parameter(
        allow_leading_hyphen=True,  # standard input is a hyphen
        help="The motion of its joints: a file (CSV, Excel, Parquet, NPZ, MATLAB, HDF5, OpenSim, BVH, C3D, MVNX, ROS, "
        "MuJoCo qpos), `-` for standard input, or a name from `shapephase robots`; for example `fall.csv` or "
        "`cat_righting`.",
    ),
]
Moments = Annotated[
    tuple[float, float, float],
    Parameter(help="The three principal moments, in kg m^2; for example `1 2 3`."),
]
GivenMomentum = Annotated[
    tuple[float, float, float],
    option(
        "Angular momentum about the centre of mass, inertial axes, in kg m^2/s; default: zero. For example "
        "`--momentum 0 0 0.02`.",
        negative_iterable="",
    ),
]
Gauge = Annotated[
    str,
    Parameter(
        help="Frame in which phases are measured: horizontal, base, principal, mean_body or link:NAME; for example "
        "`--gauge base`."
    ),
]
Tolerance = Annotated[
    float,
    Parameter(help="Accuracy of the attitude, from 1e-13 to 1e-4, in rad; for example `--tolerance 1e-6`."),
]
PageFile = Annotated[
    Path | None,
    option("Write the page to this HTML file, which opens offline; for example `--html page.html`."),
]
ReportFile = Annotated[
    Path | None,
    option("Write a report with animation and figures to this HTML file; for example `--html report.html`."),
]
FilmFile = Annotated[
    Path | None,
    option(
        "Write a film to this GIF or MP4 file, or six pictures side by side to this PNG file, drawn by Chromium "
        "(`pip install 'shapephase[video]'`). For example `--video film.gif`."
    ),
]
FigureFile = Annotated[
    Path, Parameter(help="Write the figure to this file, .svg, .pdf or .png; for example `--out figure.pdf`.")
]
OptionalFigureFile = Annotated[
    Path | None, option("Write the figure to this file, .svg, .pdf or .png; for example `--out figure.svg`.")
]
UpAxis = Annotated[
    str | None,
    option(
        "Axis that points up in a recording and in 3-D: x, y, z, -x, -y or -z; default: against the recorded fall, "
        "else z, or y for a body that is symmetric across z. For example `--up y`.",
        allow_leading_hyphen=True,  # "-z" is an axis
    ),
]


@Parameter(name="*")
@dataclass(frozen=True)
class PrintOptions:
    """What is printed. `main` reads these from the command line; the commands ignore them."""

    json: Annotated[bool, option(negative="")] = False
    """Print JSON instead of a table, errors too; for example `--json | jq`."""
    quiet: Annotated[bool, option(name=("--quiet", "-q"), negative="")] = False
    """Print only errors on standard error."""
    verbose: Annotated[bool, option(name=("--verbose", "-v"), negative="")] = False
    """Print each step on standard error."""


@Parameter(name="*")
@dataclass(frozen=True)
class BodyOptions:
    """How the body's file is read; each field is an argument of `load_body`."""

    root: Annotated[str | None, rare()] = None
    """For URDF, xacro, MJCF: free removes all joints between the world, or a massless root, and the body; default: a
    single such joint is an error, several are the free base. For example `--root free`."""
    root_body: Annotated[str | None, rare()] = None
    """For MJCF, OpenSim, bioMod: the body that floats, with everything attached to it; needed where the file has
    several. For example `--root-body torso`."""
    packages: Annotated[tuple[str, ...], rare(several=True)] = ()
    """For URDF, xacro: folders that are searched for the packages it names, before those around the file. For example
    `--packages ~/ros/src`."""
    xacro: Annotated[tuple[str, ...], rare(several=True)] = ()
    """For xacro: values of its arguments, NAME:=VALUE; for example `--xacro payload:=true`."""
    on_unphysical: Annotated[str | None, rare()] = None
    """For links with impossible inertias: error, or warn to use them as they are; for example
    `--on-unphysical warn`."""
    length_unit: Annotated[float | None, rare()] = None
    """For BVH, which states none: the unit of length, in m; for example `--length-unit 0.01` for centimetres."""
    person_mass: Annotated[float | None, rare()] = None
    """For BVH: mass of the person, in kg; default: 70. For example `--person-mass 62`."""

    @property
    def loading(self) -> dict[str, Any]:
        """Arguments of `load_body` that are given. Raises ShapeError for a word that is not NAME:=VALUE."""
        given = {name: value for name, value in vars(self).items() if value not in (None, ()) and name != "xacro"}
        if self.xacro:
            given["xacro_args"] = dict(map(_xacro_argument, self.xacro))
        return given


def _xacro_argument(word: str) -> tuple[str, str]:
    name, separator, value = word.partition(":=")
    if not (name and separator):
        raise ShapeError(f"--xacro: NAME:=VALUE is needed, as in --xacro payload:=true, got {word!r}")
    return name, value


@Parameter(name="*")
@dataclass(frozen=True)
class StartOptions:
    """Momentum of the body, and its attitude at the start."""

    momentum: Annotated[tuple[float, float, float] | None, option(negative_iterable="")] = None
    """Angular momentum about the centre of mass, inertial axes, in kg m^2/s; default: by --rate, or fitted to a
    recorded base, else zero. For example `--momentum 0 0 0.02`."""
    rate: Annotated[tuple[str, ...], rare(several=True)] = ()
    """Angular velocity of the base at the start instead of --momentum, base axes, in rad/s or with a unit; for example
    `--rate 0 0 0.01` or `--rate "0 0 2 deg/s"`."""
    rate_time: Annotated[float | None, rare()] = None
    """Time of --rate, in s from the start of the motion; default: 0. For example `--rate-time 12.5`."""
    attitude: Annotated[tuple[float, float, float, float] | None, rare(negative_iterable="")] = None
    """Attitude of the base at the start, a quaternion x y z w; default: as recorded, or as a motion of the library
    begins, else 0 0 0 1. For example `--attitude 1 0 0 0`."""

    @property
    def has_momentum(self) -> bool:
        """True where the momentum is given, or the angular velocity in its place."""
        return self.momentum is not None or bool(self.rate)


@Parameter(name="*")
@dataclass(frozen=True)
class WheelOptions:
    """Wheels that store momentum."""

    rotor: Annotated[tuple[str, ...], rare(several=True)] = ()
    """Momentum of a wheel along its axle, turn in space included, that no motor changes: JOINT=VALUE, in kg m^2/s; for
    example `--rotor rw1=1.5`."""
    rotor_speed: Annotated[tuple[str, ...], rare(several=True)] = ()
    """Speed of a wheel on its axle, held by its motor: JOINT=VALUE, in rad/s or with a unit, or JOINT=COLUMN of the
    recording; for example `--rotor-speed rw1=6000rpm` or `--rotor-speed rw1=tacho:rpm`."""
    wheel: Annotated[tuple[str, ...], rare(several=True)] = ()
    """Wheels without a joint in the file, wheel_1 and so on: axis in axes of the base, and inertia about it, in kg m^2,
    which is taken out of that of the base; for example `--wheel "0 0 1" 0.05 --rotor wheel_1=1.5`."""


@Parameter(name="*")
@dataclass(frozen=True)
class ColumnOptions:
    """How columns of recorded samples become joints and a base: options of `RecordingOptions` and of `audit`."""

    names: Annotated[tuple[str, ...], option(several=True)] = ()
    """Which column is which joint: COLUMN=JOINT, COLUMN= to ignore a column, or a file of such lines; for
    example `--names LKnee=left_knee frame=` or `--names lab.txt`."""
    degrees: Annotated[bool | None, option(negative="--radians")] = None
    """Turning joints are in degrees, or in radians; default: as the file states. For example `--degrees`."""
    lowpass: Annotated[float | None, option()] = None
    """Low-pass filter instead of --smooth: cut-off in 1/s of a second-order Butterworth filter, forwards and backwards
    (-3 dB by both passes); for example `--lowpass 6`."""
    joint_order: Annotated[str | None, rare()] = None
    """Order of unnamed joints in MuJoCo's qpos or Isaac's joint_pos: mujoco, isaac, isaac-by-name or body; default: by
    the poses of bodies in the file, else mujoco. For example `--joint-order isaac`."""
    rest_missing: Annotated[bool, rare(negative="")] = False
    """Keep joints without a column at zero, or at their limit next to it; for example `--rest-missing`."""
    ignore_extra: Annotated[bool, rare(negative="")] = False
    """Ignore columns that match no joint; for example `--ignore-extra`."""
    resample: Annotated[float | None, rare()] = None
    """Resample evenly at this rate, in 1/s; uneven samples are resampled before --lowpass. For example
    `--resample 100`."""
    fill: Annotated[str | None, rare()] = None
    """Fill gaps (empty cells, NaN) of up to this length by splines, in s or with a unit; gaps at the ends are cut off.
    Default: a gap is an error. For example `--fill 0.1s` or `--fill 100ms`."""
    base_order: Annotated[str | None, rare()] = None
    """Order in which the recorded angles of the base turn about their axes; default: zxy for OpenSim's tilt, list and
    rotation, zyx for roll, pitch and yaw. For example `--base-order yxz`."""
    base_axes: Annotated[str | None, rare()] = None
    """Directions of the base's x, y and z axes in the axes whose attitude was recorded, or estimate, with --flight;
    default: x,-z,y for OpenSim's pelvis, else x,y,z. For example `--base-axes x,y,z`."""
    base_inverse: Annotated[bool | None, rare(negative="")] = None
    """The recorded attitudes take the recorder's axes to the base's; default: as recorded rates show, else base axes to
    the recorder's. For example `--base-inverse`."""
    calibration: Annotated[str | None, rare()] = None
    """How recorded segments lie in the body's links: a time of the zero pose, in s or the unit of the file, the name of
    such a pose in the file, or links if segments have the axes of the links; default: as the file states. For example
    `--calibration 0.5`."""
    length_tolerance: Annotated[float | None, rare()] = None
    """Largest relative difference between recorded segment lengths and the body's, as a fraction; default: 0.1. For
    example `--length-tolerance 0.2`."""


@Parameter(name="*")
@dataclass(frozen=True)
class RecordingOptions(ColumnOptions):
    """How a file of recorded samples is read; each field is an argument of `read_recorded_motion`."""

    flight: Annotated[tuple[str, ...], option(several=True)] = ()
    """Keep one flight, and fit the momentum to the recorded base: auto (longest fall of the centre of mass), auto:2
    (second in time), all, or its first and last time, in s or the unit of the file; default: auto where the base is
    recorded and --momentum is not given. For example `--flight 12.5 13.9`."""
    smooth: Annotated[str | None, option()] = None
    """Smooth for this noise of the samples, rms, in rad or m or with units; default: the path passes through all
    samples. For example `--smooth 0.3deg` or `--smooth 0.3deg,1mm`."""
    up: UpAxis = None
    time_unit: Annotated[str | None, rare()] = None
    """Unit of the times: s, ms, us, ns or min; default: as the file states. For example `--time-unit ms`."""
    step: Annotated[float | None, rare()] = None
    """Time between samples, in s, for a file without times; for example `--step 0.01`."""
    topic: Annotated[str | None, rare()] = None
    """Topic of a ROS bag, sheet of a workbook, or structure of a .mat file, where there are several; for example
    `--topic /joint_states`."""
    rest: Annotated[tuple[str, ...], rare(several=True)] = ()
    """Values of joints without a column: JOINT=VALUE, in rad or m or with a unit; for example
    `--rest neck=0.1 left_elbow=30deg`."""
    smooth_penalty: Annotated[float | None, rare()] = None
    """Penalty of --smooth, in s^5; default: for each joint the likeliest for its noise. For example
    `--smooth-penalty 1e-9`."""
    close: Annotated[str | None, rare()] = None
    """Close a cycle whose ends differ by at most this, in rad or m or with units; for example `--close 3deg` or
    `--close 3deg,5mm`."""
    close_by: Annotated[str | None, rare()] = None
    """How it is closed: drift (the gap is subtracted evenly in time) or smooth (a periodic smoother, with --smooth);
    for example `--close-by drift`."""
    gravity: Annotated[float | None, rare()] = None
    """Acceleration of the fall in flight, in m/s^2; default: 9.81. Another fall is an error: a unit of length or the
    frame rate is wrong. For example `--gravity 3.7`."""


@Parameter(name="*")
@dataclass(frozen=True)
class TrajectoryOptions(ColumnOptions):
    """How a trajectory is read; each is an argument of `read_trajectory`."""

    integrator_step: Annotated[tuple[float, ...], option(several=True)] = ()
    """Step of the integrator of each trajectory, in s; default: that between its samples. For example
    `--integrator-step 0.001 0.002`."""
    step: Annotated[float | None, option()] = None
    """Time between samples, in s, for files without times; for example `--step 0.01`."""


@Parameter(name="*")
@dataclass(frozen=True)
class ErrorOptions:
    """Uncertainties of the inputs, for error bars; each is one standard deviation."""

    joint_noise: Annotated[str | None, option()] = None
    """Print error bars for this noise of the samples, one standard deviation, in rad or m or with units; default: that
    of --smooth. For example `--joint-noise 0.3deg` or `--joint-noise 0.3deg,1mm`."""
    mass_error: Annotated[float | None, rare()] = None
    """Standard deviation of each link's mass, as a fraction of it; for example `--mass-error 0.05`."""
    centre_error: Annotated[float | None, rare()] = None
    """Standard deviation of each link's centre of mass along each axis, as a fraction of the link's radius of gyration;
    for example `--centre-error 0.1`."""
    inertia_error: Annotated[float | None, rare()] = None
    """Standard deviation of each link's rotational inertia, as a fraction of it; for example `--inertia-error 0.05`."""
    momentum_error: Annotated[float | None, rare()] = None
    """Standard deviation of each component of the momentum, in kg m^2/s; for example `--momentum-error 0.001`."""
    attitude_error: Annotated[float | None, rare()] = None
    """Standard deviation of the attitude at the start about each axis, in rad; for example `--attitude-error 0.01`."""
    rotor_error: Annotated[tuple[str, ...], rare(several=True)] = ()
    """Standard deviation of a wheel's momentum, in kg m^2/s, or speed, in rad/s or with a unit, JOINT=VALUE; of one
    given in time that of a constant offset. For example `--rotor-error rw1=20rpm`."""


# Defaults of the commands: a dataclass in a signature needs one instance.
PRINT_DEFAULTS = PrintOptions()
BODY_DEFAULTS = BodyOptions()
ERROR_DEFAULTS = ErrorOptions()
START_DEFAULTS = StartOptions()
WHEEL_DEFAULTS = WheelOptions()
RECORDING_DEFAULTS = RecordingOptions()
TRAJECTORY_DEFAULTS = TrajectoryOptions()
