"""`shapephase export`: a motion as files of other programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..errors import ShapeError
from . import options
from .options import option, rare
from .outcome import Outcome, check_writable
from .progress import steps
from .terminal import say_written

_TOLERANCE = 1e-9  # [rad] default of a motion that is computed here


@Parameter(name="*")
@dataclass(frozen=True)
class FileOptions:
    """Files to write, several at once."""

    ck: Annotated[Path | None, option()] = None
    """Attitude as a C-kernel of SPICE, with clock and frame beside it (.tsc); for example `--ck fall.bc`."""
    aem: Annotated[Path | None, option()] = None
    """Attitude as a message of CCSDS (AEM), in XML where the name ends in .xml; for example `--aem fall.aem`."""
    csv: Annotated[Path | None, option()] = None
    """Base, joints and wheels at times, in SI units, as CSV; for example `--csv fall.csv`."""
    mcap: Annotated[Path | None, option()] = None
    """Joints and pose of the base as a bag of ROS 2; for example `--mcap fall.mcap`."""
    parquet: Annotated[Path | None, rare()] = None
    """The columns of --csv as Parquet; for example `--parquet fall.parquet`."""
    nc: Annotated[Path | None, rare()] = None
    """The data set of --csv as NetCDF; for example `--nc fall.nc`."""
    mat: Annotated[Path | None, rare()] = None
    """The arrays of --csv for MATLAB; for example `--mat fall.mat`."""
    h5: Annotated[Path | None, rare()] = None
    """The arrays of --csv as HDF5; for example `--h5 fall.h5`."""
    bvh: Annotated[Path | None, rare()] = None
    """A skeleton in motion for programs of animation; for example `--bvh fall.bvh`."""
    mot: Annotated[Path | None, rare()] = None
    """Coordinates of OpenSim; for example `--mot fall.mot`."""


_FILE_DEFAULTS = FileOptions()
_STORED = (
    options.START_DEFAULTS,
    _TOLERANCE,
    options.WHEEL_DEFAULTS,
    options.RECORDING_DEFAULTS,
    options.BODY_DEFAULTS,
)  # options for motions computed here
_WHOLE = 1.0 + 1e-12  # the last sample is at the end where the duration is a whole number of samples
_ENDINGS = {"ck": (".bc",), "aem": (".aem", ".txt", ".xml"), "mot": (".mot", ".sto")}


def export_command(
    body: Annotated[
        str,
        Parameter(
            help="A stored motion (.npz of `shapephase split --out`), which has no joints, or the body: a file, or a "
            "name from `shapephase robots`; for example `fall.npz` or `cat`."
        ),
    ],
    motion: Annotated[
        str | None,
        Parameter(
            allow_leading_hyphen=True,
            help="The motion of its joints, a file or a name, as for `shapephase split`; for example `cat_righting`.",
        ),
    ] = None,
    /,
    *,
    files: FileOptions = _FILE_DEFAULTS,
    error: Annotated[
        float | None,
        option(
            "Largest error of the attitude between the records of --ck and --aem, in rad; default: 1e-8, or a "
            "thousandth of the noise of --smooth, if that is larger. For example `--error 1e-6`."
        ),
    ] = None,
    frequency: Annotated[
        float | None,
        option("Samples of the other files, in 1/s; default: 201 even times. For example `--frequency 100`."),
    ] = None,
    mrp: Annotated[
        bool,
        rare(
            "Write modified Rodrigues parameters instead of quaternions into tables; for example "
            "`--csv fall.csv --mrp`.",
            negative="",
        ),
    ] = False,
    start: options.StartOptions = options.START_DEFAULTS,
    tolerance: options.Tolerance = _TOLERANCE,
    wheels: options.WheelOptions = options.WHEEL_DEFAULTS,
    recording: options.RecordingOptions = options.RECORDING_DEFAULTS,
    floating: options.BodyOptions = options.BODY_DEFAULTS,
    printing: options.PrintOptions = options.PRINT_DEFAULTS,  # noqa: ARG001
) -> Outcome:
    """Write a motion for other programs: SPICE, CCSDS, ROS, tables, OpenSim, animation.

    Attitudes of spacecraft have as many records as the error requires; all else has even samples.
    """
    import numpy as np

    from ..arguments import positive_argument
    from ..exports.bvh import write_bvh
    from ..exports.ccsds import write_aem
    from ..exports.opensim import write_opensim_motion
    from ..exports.spice import write_spice_ck
    from ..exports.tables import export_motion
    from ..reconstruction.reconstruction import load_motion
    from . import motion as motions

    given = {name: file for name, file in vars(files).items() if file is not None}
    if not given:
        raise ShapeError(f"give files to write, one or more of {', '.join(f'--{name}' for name in vars(files))}")
    endings = {name: _ENDINGS.get(name, (f".{name}",)) for name in given}
    aside = True in [check_writable(file, f"--{name}", *endings[name]) for name, file in given.items()]
    goal = None if error is None else positive_argument(error, "--error", "an angle in rad")
    often = None if frequency is None else positive_argument(frequency, "--frequency", "a number in 1/s")
    with steps(2) as work:
        work.begin("loading and reconstructing")
        if motion is None:
            if Path(body).suffix.lower() != ".npz":
                raise ShapeError(
                    f"{body:.80} needs a motion, as in `shapephase export cat cat_righting --csv fall.csv`"
                )
            if (start, tolerance, wheels, recording, floating) != _STORED:
                raise ShapeError(f"{body:.80} is a stored motion; leave out options by which a motion is computed")
            moved = load_motion(body)
        else:
            moved = motions.flight(
                body, motion, start, recording, tolerance, work.watch, floating=floating, wheels=wheels
            ).motion
        work.begin("writing")
        times = None
        if often is not None:
            times = np.arange(np.floor(moved.duration * often * _WHOLE) + 1.0) / often
            times = np.minimum(times, moved.duration)
        written: dict[str, dict[str, object]] = {}
        for name, file in given.items():
            written[name] = {"file": str(file)}
            if name in ("ck", "aem"):
                made = (write_spice_ck if name == "ck" else write_aem)(moved, file, error=goal)
                written[name] |= {"records": made.records, "error_rad": made.error}
            elif name == "bvh":
                write_bvh(moved, file) if often is None else write_bvh(moved, file, rate=often)
            elif name == "mot":
                write_opensim_motion(moved, file, times)
            else:
                export_motion(moved, file, times, mrp=mrp and name != "mcap")
            say_written(file)
    lines = [
        f"{label['file']}"
        + (f": {label['records']} records within {label['error_rad']:.3g} rad" if "records" in label else "")
        for label in written.values()
    ]
    data = {"duration_s": moved.duration, "files": written}
    return Outcome("\n".join(lines), data, aside=aside, made_from=moved.deformation.made_from)
