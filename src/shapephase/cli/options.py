"""Arguments and options that several commands take, each declared once with its help."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ..errors import ShapeError

BodyArgument = Annotated[
    str,
    Parameter(
        help="The body: a URDF, xacro, MJCF, OpenSim or bioMod file, measurements for Yeadon's human, a name "
        "from `shapephase robots`, "
        "or example:NAME of example-robot-data; for example `cat`."
    ),
]
MotionArgument = Annotated[
    str,
    Parameter(
        allow_leading_hyphen=True,  # standard input is a hyphen
        help="The motion of its joints: a file (CSV, Excel, Parquet, NPZ, MATLAB, HDF5, OpenSim, C3D, ROS, MuJoCo "
        "qpos), `-` for standard input, or a name from `shapephase robots`; for example `fall.csv` or `cat_righting`.",
    ),
]
Momentum = Annotated[
    tuple[float, float, float] | None,
    Parameter(
        negative_iterable="",
        show_default=False,
        help="Angular momentum about the centre of mass, inertial axes, in kg m^2/s; without it, that of a recorded "
        "base, fitted to its free flight; else zero. For example `--momentum 0 0 0.02`.",
    ),
]
GivenMomentum = Annotated[
    tuple[float, float, float],
    Parameter(
        negative_iterable="",
        show_default=False,
        help="Angular momentum about the centre of mass, inertial axes, in kg m^2/s; zero if not given. For example "
        "`--momentum 0 0 0.02`.",
    ),
]
Gauge = Annotated[
    str,
    Parameter(
        help="The frame that the phases are seen in: horizontal, base, principal, mean_body or link:NAME; for example "
        "`--gauge base`."
    ),
]
Tolerance = Annotated[
    float,
    Parameter(help="Of the attitude, from 1e-13 to 1e-4, in rad; for example `--tolerance 1e-6`."),
]
ReportFile = Annotated[
    Path | None,
    Parameter(
        help="Write a report with animation and figures to this HTML file; without it none is written. For example "
        "`--html report.html`."
    ),
]
UpAxis = Annotated[
    str | None,
    Parameter(
        allow_leading_hyphen=True,  # "-z" is an axis
        show_default=False,
        help="The axis that is up, of a recording and in 3-D: x, y, z, -x, -y or -z, without unit; without it that of "
        "the recorded fall, else z, or y for a body whose left and right are across z. For example `--up y`.",
    ),
]
Calibration = Annotated[
    str | None,
    Parameter(
        show_default=False,
        help="How recorded segments lie in the body's links: a time at which the body stands in its zero pose, in s or "
        "the unit of the file, the name of such a pose in the file, or links, where they have the axes of the links; "
        "without it as the file says. For example `--calibration 0.5`.",
    ),
]
LengthTolerance = Annotated[
    float | None,
    Parameter(
        show_default=False,
        help="Share by which distances between recorded segments may differ from the body's, without unit; without it "
        "0.1. For example `--length-tolerance 0.2`.",
    ),
]
FigureFile = Annotated[
    Path, Parameter(help="Write the figure to this file, .svg, .pdf or .png; for example `--out figure.pdf`.")
]


@Parameter(name="*")
@dataclass(frozen=True)
class PrintOptions:
    """What is printed. `main` looks for these among the words of the command line, and the commands ignore them."""

    json: Annotated[
        bool,
        Parameter(
            negative="",
            show_default=False,
            help="Print JSON instead of a table, errors too; for example `--json | jq`.",
        ),
    ] = False
    quiet: Annotated[
        bool,
        Parameter(
            name=("--quiet", "-q"), negative="", show_default=False, help="On standard error, say nothing but errors."
        ),
    ] = False
    verbose: Annotated[
        bool,
        Parameter(
            name=("--verbose", "-v"), negative="", show_default=False, help="On standard error, say what is being done."
        ),
    ] = False


@Parameter(name="*")
@dataclass(frozen=True)
class BodyOptions:
    """What floats; each is an argument of `load_body`."""

    root: Annotated[
        str | None,
        Parameter(
            show_default=False,
            help="Of a URDF, xacro or MJCF file: free removes all joints between the world, or a root without mass, "
            "and the body, without unit; without it a single one, as of an arm that is bolted down, is an error, and "
            "several are the free base. For example `--root free`.",
        ),
    ] = None
    root_body: Annotated[
        str | None,
        Parameter(
            show_default=False,
            help="Of an MJCF, OpenSim or bioMod file: the body that floats, with all that hangs on it, without unit; "
            "needed where the file has several. For example `--root-body torso`.",
        ),
    ] = None
    packages: Annotated[
        tuple[str, ...],
        Parameter(
            negative_iterable="",
            consume_multiple=True,
            show_default=False,
            help="Of a URDF or xacro file: folders in which the packages that it names are looked for, without unit, "
            "before those around the file. For example `--packages ~/ros/src`.",
        ),
    ] = ()
    xacro: Annotated[
        tuple[str, ...],
        Parameter(
            negative_iterable="",
            consume_multiple=True,
            show_default=False,
            help="Of a xacro file: values of its arguments, NAME:=VALUE; for example `--xacro payload:=true`.",
        ),
    ] = ()
    on_unphysical: Annotated[
        str | None,
        Parameter(
            show_default=False,
            help="Of a body whose links have inertias that no matter has: error, or warn to take them as the file has "
            "them; for example `--on-unphysical warn`.",
        ),
    ] = None
    length_unit: Annotated[
        float | None,
        Parameter(
            show_default=False,
            help="Of a BVH file, which says none: the length of a unit, in m; for example `--length-unit 0.01` for "
            "centimetres.",
        ),
    ] = None
    person_mass: Annotated[
        float | None,
        Parameter(
            show_default=False,
            help="Of the human whose skeleton a BVH file has, in kg; without it 70. For example `--person-mass 62`.",
        ),
    ] = None

    @property
    def loading(self) -> dict[str, Any]:
        """Those arguments of `load_body` that are given. Raises ShapeError for what is no NAME:=VALUE."""
        found = {name: value for name, value in vars(self).items() if value not in (None, ()) and name != "xacro"}
        if self.xacro:
            found["xacro_args"] = dict(map(_xacro_argument, self.xacro))
        return found


def _xacro_argument(word: str) -> tuple[str, str]:
    name, separator, value = word.partition(":=")
    if not (name and separator):
        raise ShapeError(f"--xacro: {word!r} is no NAME:=VALUE; type it as in --xacro payload:=true")
    return name, value


@Parameter(name="*")
@dataclass(frozen=True)
class FlightOptions:
    """How the body flies: its momentum, and its attitude at the start."""

    momentum: Momentum = None
    attitude: Annotated[
        tuple[float, float, float, float] | None,
        Parameter(
            negative_iterable="",
            show_default=False,
            help="Of the base at the start, a quaternion x y z w without unit; if not given, as recorded, or that of a "
            "library's motion (cats begin on their back), else 0 0 0 1. For example `--attitude 1 0 0 0`.",
        ),
    ] = None


def _motion_option(text: str, **more: Any) -> Parameter:
    return Parameter(help=text, show_default=False, **more)


FillOption = Annotated[
    str | None,
    _motion_option(
        "Bridge gaps (empty cells, NaN) of up to this length, in s or with a unit: joints and places by a cubic "
        "spline, rotations by a rotation spline; gaps at the start and the end are cut off. Without it a gap is an "
        "error. For example `--fill 0.1s` or `--fill 100ms`."
    ),
]
ResampleOption = Annotated[
    float | None,
    _motion_option(
        "Put the path through so many of its own values a second instead, evenly spaced, in 1/s; uneven samples are "
        "put on such times before --lowpass. For example `--resample 100`."
    ),
]
LowPassOption = Annotated[
    float | None,
    _motion_option(
        "Low-pass filter joints and base, over the whole recording: cut-off of a Butterworth filter of second order "
        "run forwards and backwards (-3 dB by both passes), in 1/s, in place of --smooth; for example `--lowpass 6`."
    ),
]


@Parameter(name="*")
@dataclass(frozen=True)
class RecordingOptions:
    """How a file of recorded samples is read; each is an argument of `read_recorded_motion`."""

    names: Annotated[
        tuple[str, ...],
        _motion_option(
            "Which column is which joint: COLUMN=JOINT, COLUMN= to leave a column out, or a file of such lines (or of "
            "JSON); for example `--names LKnee=left_knee frame=` or `--names lab.txt`.",
            negative_iterable="",
            consume_multiple=True,
        ),
    ] = ()
    degrees: Annotated[
        bool | None,
        _motion_option(
            "Turning joints are in degrees, or in radians; without it, as the file says. For example `--degrees`.",
            negative="--radians",
        ),
    ] = None
    time_unit: Annotated[
        str | None,
        _motion_option(
            "Unit of the times: s, ms, us, ns or min; without it, as the file says. For example `--time-unit ms`."
        ),
    ] = None
    timestep: Annotated[
        float | None,
        _motion_option("Time between samples, in s, for a file without times; for example `--timestep 0.01`."),
    ] = None
    topic: Annotated[
        str | None,
        _motion_option(
            "Which part of a file with more than one motion: the topic of a ROS bag, the sheet of a workbook, the "
            "structure of a .mat file; for example `--topic /joint_states`."
        ),
    ] = None
    joint_order: Annotated[
        str | None,
        _motion_option(
            "Order of the joints in MuJoCo's qpos or Isaac's joint_pos without names: mujoco, isaac, isaac-by-name or "
            "body, without unit; without it by the places of bodies in the file, else mujoco. For example "
            "`--joint-order isaac`."
        ),
    ] = None
    rest: Annotated[
        tuple[str, ...],
        _motion_option(
            "Where joints rest that have no column: JOINT=VALUE, in rad or m or with a unit; for example "
            "`--rest neck=0.1 left_elbow=30deg`.",
            negative_iterable="",
            consume_multiple=True,
        ),
    ] = ()
    rest_missing: Annotated[
        bool,
        _motion_option(
            "All other joints without a column rest at zero, or at their limit next to it; for example "
            "`--rest-missing`.",
            negative="",
        ),
    ] = False
    ignore_extra: Annotated[
        bool,
        _motion_option(
            "Columns that are no joints of the body are left out; for example `--ignore-extra`.", negative=""
        ),
    ] = False
    trim: Annotated[
        tuple[float, float] | None,
        _motion_option(
            "Keep the samples from the first to the last of two times, in s or the unit in which the file itself tells "
            "the time; for example `--trim 12.5 13.9`.",
            negative_iterable="",
        ),
    ] = None
    resample: ResampleOption = None
    fill: FillOption = None
    smooth: Annotated[
        str | None,
        _motion_option(
            "Noise of the recorded samples, rms, in rad or m or with units; without it the path goes through all of "
            "them. For example `--smooth 0.3deg` or `--smooth 0.3deg,1mm`."
        ),
    ] = None
    smooth_penalty: Annotated[
        float | None,
        _motion_option(
            "The penalty of that smoothing, in s^5; without it, of each joint the likeliest for its noise. For example "
            "`--smooth-penalty 1e-9`."
        ),
    ] = None
    lowpass: LowPassOption = None
    close: Annotated[
        str | None,
        _motion_option(
            "Make a loop of a cycle whose ends are apart by no more than this, in rad or m or with units; for example "
            "`--close 3deg` or `--close 3deg,5mm`."
        ),
    ] = None
    close_by: Annotated[
        str | None,
        _motion_option(
            "How that is done: drift (the gap is taken off evenly in time), smooth (a smoother that runs on from the "
            "end to the start, where --smooth is given) or geodesic (the shortest way back is put at the end); for "
            "example `--close-by geodesic`."
        ),
    ] = None
    base_order: Annotated[
        str | None,
        _motion_option(
            "The axes of the base's recorded angles in the order in which they turn, without unit; without it zxy for "
            "OpenSim's tilt, list and rotation, zyx for roll, pitch and yaw. For example `--base-order yxz`."
        ),
    ] = None
    base_axes: Annotated[
        str | None,
        _motion_option(
            "Where the x, y and z axis of the body's base point to in the axes whose attitude was recorded, without "
            "unit, or estimate, with --flight; without it x,-z,y for OpenSim's pelvis, else x,y,z. For example "
            "`--base-axes x,y,z`."
        ),
    ] = None
    flight: Annotated[
        tuple[str, ...],
        _motion_option(
            "Keep the free flight only, and fit the momentum to the recorded attitude of the base: auto (the longest "
            "fall of the centre of mass), auto:2 (the second in time), all, or its first and last time, in s or the "
            "unit of the file; without it, where the base is recorded and no --momentum is given, auto, or all where "
            "nothing falls. For example `--flight 12.5 13.9`.",
            negative_iterable="",
            consume_multiple=True,
        ),
    ] = ()
    gravity: Annotated[
        float | None,
        _motion_option(
            "By which the body falls in flight, in m/s^2; without it 9.81, and another fall is an error, as it says "
            "that a unit of length or the frame rate is another. For example `--gravity 3.7`."
        ),
    ] = None
    up: UpAxis = None
    calibration: Calibration = None
    length_tolerance: LengthTolerance = None


@Parameter(name="*")
@dataclass(frozen=True)
class ErrorOptions:
    """What is not known exactly, for error bars; each is one standard deviation."""

    joint_noise: Annotated[
        str | None,
        _motion_option(
            "Print error bars: one standard deviation of the noise of each sample, in rad or m or with units; without "
            "it the one of --smooth. For example `--joint-noise 0.3deg` or `--joint-noise 0.3deg,1mm`."
        ),
    ] = None
    mass_error: Annotated[
        float | None,
        _motion_option(
            "The same of the mass of each link, as a part of it, without unit; for example `--mass-error 0.05`."
        ),
    ] = None
    centre_error: Annotated[
        float | None,
        _motion_option(
            "The same of the centre of mass of each link along each axis, in radii of gyration of the link, without "
            "unit; for example `--centre-error 0.1`."
        ),
    ] = None
    inertia_error: Annotated[
        float | None,
        _motion_option(
            "The same of the rotational inertia of each link, as a part of it, without unit; for example "
            "`--inertia-error 0.05`."
        ),
    ] = None
    momentum_error: Annotated[
        float | None,
        _motion_option(
            "The same of each component of the momentum, in kg m^2/s; for example `--momentum-error 0.001`."
        ),
    ] = None
    attitude_error: Annotated[
        float | None,
        _motion_option(
            "The same of the attitude at the start about each axis, in rad; for example `--attitude-error 0.01`."
        ),
    ] = None


AS_TEXT = PrintOptions()
AS_WRITTEN = BodyOptions()
EXACT = ErrorOptions()
AT_REST = FlightOptions()
AS_RECORDED = RecordingOptions()
