"""Attitudes as kernels of SPICE: a C-kernel of type 5, with a clock and a frame."""

from __future__ import annotations

import json
import os
import tempfile
import textwrap
from pathlib import Path
from typing import Any

import numpy as np

from .. import so3
from ..arguments import check_file_name, check_text, number_argument, whole_argument
from ..arrays import Array
from ..display import frozen
from ..errors import AccuracyNotReached, MissingExtraError, OutputFileError, UnknownNameError
from ..files import write_whole
from ..provenance import provenance
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ._attitude_records import WINDOW, error_argument, record_times
from ._whole_motion import base_attitude, base_rate, check_ending, continued_quaternions

_TICKS = 10**9  # of the clock in a second
_LONGEST = 10**6  # [s] that the clock counts
_OF_A_CLOCK = 1000  # SPICE numbers the instruments of clock N from -1000 N on
_LAGRANGE_WITH_RATES = 3  # subtype of C-kernels of type 5
_COMMENT = 100  # characters of a line; SPICE takes up to 255
_SEGMENT = "shapephase"
_CLOCK = """\
KPL/SCLK

The clock and the frame of a C-kernel written by shapephase.

\\begindata
SCLK_KERNEL_ID           = ( @2000-01-01 )
SCLK_DATA_TYPE_{clock}   = ( 1 )
SCLK01_TIME_SYSTEM_{clock} = ( 1 )
SCLK01_N_FIELDS_{clock}  = ( 2 )
SCLK01_MODULI_{clock}    = ( {longest} {ticks} )
SCLK01_OFFSETS_{clock}   = ( 0 0 )
SCLK01_OUTPUT_DELIM_{clock} = ( 1 )
SCLK_PARTITION_START_{clock} = ( 0.0E+00 )
SCLK_PARTITION_END_{clock} = ( {end} )
SCLK01_COEFFICIENTS_{clock} = ( 0.0E+00 {epoch!r} 1.0E+00 )

FRAME_{frame}            = {instrument}
FRAME_{instrument}_NAME     = '{frame}'
FRAME_{instrument}_CLASS    = 3
FRAME_{instrument}_CLASS_ID = {instrument}
FRAME_{instrument}_CENTER   = -{clock}
CK_{instrument}_SCLK        = -{clock}
CK_{instrument}_SPK         = -{clock}
\\begintext
"""


@frozen(kw_only=True)
class SpiceKernels:
    """Kernels that were written.

    Made by `write_spice_ck`.

    Attributes
    ----------
    attitude, clock : files, the C-kernel and the text kernel with clock and frame, to be loaded by `furnsh`
    records : of attitude and angular velocity
    error : stated, of the attitude at any time between [rad]
    instrument, clock_id : SPICE's identifiers
    frame : name of the base's frame
    """

    attitude: Path
    clock: Path
    records: int
    error: float
    instrument: int
    clock_id: int
    frame: str


def write_spice_ck(
    motion: Motion | ForcedMotion,
    path: str | os.PathLike[str],
    *,
    error: float | None = None,
    epoch: float = 0.0,
    reference: str = "J2000",
    instrument: int = -999001,
    frame: str = "SHAPEPHASE_BASE",
) -> SpiceKernels:
    """Write the attitude of the base as a C-kernel (`.bc`), and beside it clock and frame as a text kernel (`.tsc`).

    The C-kernel is of type 5, subtype 3: SPICE takes polynomials of degree 7 through the eight records nearest to a
    time, of the quaternions and of the angular velocities. Records are as near to each other as the error requires.

    Parameters
    ----------
    motion : a single one, in any gauge
    path : of the C-kernel
    error : the largest of the attitude between records [rad], beside the motion's own; None: 1e-8, or a thousandth of
        the noise that the joints were smoothed for, if that is larger
    epoch : of the motion's start, TDB seconds past J2000 as `spiceypy.str2et` gives them. Such times are floating-point
        numbers, in this year to 1e-7 s, within which a fast body turns
    reference : SPICE's name of the inertial axes
    instrument : SPICE's identifier of the base, below -1000; that of its clock is a thousandth of it
    frame : name of the base's frame

    Raises
    ------
    AccuracyNotReached
        If times of SPICE at this epoch are too coarse for the error, or millions of records were needed.
    MissingExtraError
        Without spiceypy.
    UnknownNameError
        For another reference, an instrument that is not below -1000.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 2.0), [0.0, 0.0, 5.0])
    >>> sp.exports.write_spice_ck(motion, "spin.bc", error=1e-9).error
    1e-09
    """
    check_file_name(path, "path")
    where, goal, start = (
        Path(path),
        error_argument(motion, error),
        number_argument(epoch, "epoch", "s"),
    )
    check_ending(where, "a C-kernel", ".bc")
    check_text(reference, "reference", "SPICE's name of inertial axes")
    whole = -instrument if isinstance(instrument, int | np.integer) else instrument
    number = -whole_argument(whole, "minus instrument", _OF_A_CLOCK)
    try:
        import spiceypy
    except ImportError:
        raise MissingExtraError(
            "SPICE kernels need spiceypy; install it with: pip install 'shapephase[data]'"
        ) from None
    times = record_times(motion, goal)
    _check_epoch(motion, times, start, goal)
    clock = -number // _OF_A_CLOCK
    text = _CLOCK.format(
        clock=clock,
        longest=_LONGEST,
        ticks=_TICKS,
        end=float(_LONGEST * _TICKS),
        epoch=start,
        frame=frame,
        instrument=number,
    )
    content = _c_kernel(spiceypy, motion, times, number, reference)
    beside = where.with_suffix(".tsc")
    write_whole(beside, lambda stream: stream.write(text.encode()))
    write_whole(where, lambda stream: stream.write(content))
    return SpiceKernels(
        attitude=where,
        clock=beside,
        records=len(times),
        error=goal,
        instrument=number,
        clock_id=-clock,
        frame=frame,
    )


def _check_epoch(motion: Motion | ForcedMotion, times: Array, start: float, error: float) -> None:
    """Raise AccuracyNotReached where the body turns too far within the last digit of a time."""
    attitude = base_attitude(motion, times)
    steps = so3.angle(so3.transpose(attitude[:-1]) @ attitude[1:])
    digit = float(np.spacing(abs(start) + motion.duration))
    turned = float((steps / np.diff(times)).max()) * digit
    if turned > 0.25 * error:
        raise AccuracyNotReached(
            f"epoch: times of SPICE around {start:g} s have steps of {digit:.1e} s, in which this body turns "
            f"{turned:.1e} rad; an error of {error:g} rad needs an epoch nearer to J2000, or allow a larger one"
        )


def _c_kernel(spiceypy: Any, motion: Motion | ForcedMotion, times: Array, instrument: int, reference: str) -> bytes:
    """The bytes of the kernel. SPICE's matrices take inertial components to those of the base."""
    attitude = base_attitude(motion, times)
    # The quaternion of the inverse, w first.
    inverse = continued_quaternions(attitude)[:, [3, 0, 1, 2]] * [1.0, -1.0, -1.0, -1.0]
    packets = np.hstack([inverse, so3.apply(attitude, base_rate(motion, times))])
    ticks = times * _TICKS
    comments = textwrap.wrap(json.dumps(provenance(motion.deformation.made_from)), _COMMENT)
    with tempfile.TemporaryDirectory() as folder:
        file = str(Path(folder) / "attitude.bc")
        try:
            handle = spiceypy.ckopn(file, _SEGMENT, 0)
            spiceypy.ckw05(
                handle, _LAGRANGE_WITH_RATES, WINDOW - 1, ticks[0], ticks[-1], instrument, reference, True, _SEGMENT,
                ticks, packets, 1.0 / _TICKS, 1, ticks[:1],
            )  # fmt: skip
            spiceypy.dafac(handle, comments)
            spiceypy.ckcls(handle)
        except spiceypy.utils.exceptions.SpiceyError as fault:
            reason = str(getattr(fault, "short", "") or fault).strip()
            if "FRAME" in reason:
                raise UnknownNameError(f"reference: SPICE knows no inertial frame {reference!r}") from None
            raise OutputFileError(f"SPICE cannot write the kernel: {reason}") from None
        return Path(file).read_bytes()
