"""Attitudes as an Attitude Ephemeris Message of CCSDS."""

from __future__ import annotations

import datetime
import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from decimal import Decimal
from pathlib import Path

from .. import __version__
from ..arguments import check_choice, check_file_name, check_text
from ..arrays import Array
from ..display import frozen
from ..errors import UnknownNameError
from ..files import write_whole
from ..provenance import provenance
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ._attitude_records import WINDOW, error_argument, record_times
from ._whole_motion import base_attitude, continued_quaternions

TIME_SYSTEMS = ("TDB", "TT", "TAI", "GPS", "UTC")  # of the epochs of a message
_VERSION = "CCSDS_AEM_VERS"  # name of the first entry
_DIGITS = 15  # of a second: a turn at 100 rad/s within the last one is below rounding


@frozen(kw_only=True)
class AttitudeMessage:
    """A message that was written.

    Made by `write_aem`.

    Attributes
    ----------
    file : that holds it
    records : attitudes
    error : stated, of the attitude between them by polynomials of `degree` [rad]
    degree : of the polynomials of each part of the quaternion, through the records nearest to a time
    """

    file: Path
    records: int
    error: float
    degree: int


def write_aem(
    motion: Motion | ForcedMotion,
    path: str | os.PathLike[str],
    *,
    error: float | None = None,
    epoch: str = "2000-01-01T12:00:00",
    time_system: str = "TDB",
    object_name: str = "SHAPEPHASE",
    object_id: str = "2000-000A",
    reference: str = "EME2000",
) -> AttitudeMessage:
    """Write the attitude of the base as an Attitude Ephemeris Message (CCSDS 504.0-B-1): keywords and values, or XML.

    Quaternions turn the inertial axes into those of the base, scalar part last, every digit kept. Records are as
    near to each other as the error requires where a reader interpolates as the message states: each part of the
    quaternion by Lagrange's polynomial of degree 7 through the eight records nearest to a time.

    Source: CCSDS 504.0-B-1, Attitude Data Messages, section 4.

    Parameters
    ----------
    motion : a single one, in any gauge
    path : of the message; one that ends in .xml is written in XML
    error : the largest of the attitude between records [rad], beside the motion's own; None: 1e-8, or a thousandth of
        the noise that the joints were smoothed for, if that is larger
    epoch : of the motion's start, as "2026-11-23T10:00:00.5"
    time_system : of the epochs, one of "TDB", "TT", "TAI", "GPS", "UTC"; no second is inserted
    object_name, object_id : of the body
    reference : name of the inertial axes

    Raises
    ------
    AccuracyNotReached
        If millions of records were needed: the polynomials do not take kinks well.
    UnknownNameError
        For another time system, an invalid epoch.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 2.0), [0.0, 0.0, 5.0])
    >>> written = sp.exports.write_aem(motion, "spin.aem", error=1e-6)
    >>> print(written.file.read_text().splitlines()[0])
    CCSDS_AEM_VERS = 1.0
    """
    check_file_name(path, "path")
    check_choice(time_system, "time system", TIME_SYSTEMS)
    begin, goal = _epoch(epoch), error_argument(motion, error)
    times = record_times(motion, goal)
    quaternions = continued_quaternions(base_attitude(motion, times))
    epochs = _epochs(begin, times)
    header = {"CREATION_DATE": str(provenance()["date"])[:19], "ORIGINATOR": f"SHAPEPHASE {__version__}"}
    about = {
        "COMMENT": f"within {goal!r} rad between records",
        "OBJECT_NAME": object_name,
        "OBJECT_ID": object_id,
        "REF_FRAME_A": reference,
        "REF_FRAME_B": "SC_BODY_1",
        "ATTITUDE_DIR": "A2B",
        "TIME_SYSTEM": time_system,
        "START_TIME": epochs[0],
        "STOP_TIME": epochs[-1],
        "ATTITUDE_TYPE": "QUATERNION",
        "QUATERNION_TYPE": "LAST",
        "INTERPOLATION_METHOD": "LAGRANGE",
        "INTERPOLATION_DEGREE": str(WINDOW - 1),
    }
    text = (_xml if Path(path).suffix.lower() == ".xml" else _keywords)(header, about, epochs, quaternions)
    write_whole(path, lambda stream: stream.write(text.encode()))
    return AttitudeMessage(file=Path(path), records=len(times), error=goal, degree=WINDOW - 1)


def _keywords(header: Mapping[str, str], about: Mapping[str, str], epochs: list[str], quaternions: Array) -> str:
    """Message in keywords and values."""
    named = [f"{name} {value}" if name == "COMMENT" else f"{name} = {value}" for name, value in about.items()]
    rows = [" ".join([at, *map(repr, row)]) for at, row in zip(epochs, quaternions.tolist(), strict=True)]
    lines = [f"{_VERSION} = 1.0", *(f"{name} = {value}" for name, value in header.items())]
    return "\n".join([*lines, "", "META_START", *named, "META_STOP", "", "DATA_START", *rows, "DATA_STOP", ""])


def _xml(header: Mapping[str, str], about: Mapping[str, str], epochs: list[str], quaternions: Array) -> str:
    """Message in XML. Source: CCSDS 505.0-B-1, section 4."""
    root = ElementTree.Element("aem", id=_VERSION, version="1.0")
    heading, body = (ElementTree.SubElement(root, name) for name in ("header", "body"))
    segment = ElementTree.SubElement(body, "segment")
    metadata, data = (ElementTree.SubElement(segment, name) for name in ("metadata", "data"))
    for parent, entries in ((heading, header), (metadata, about)):
        for name, value in entries.items():
            ElementTree.SubElement(parent, name).text = value
    for at, row in zip(epochs, quaternions.tolist(), strict=True):
        state = ElementTree.SubElement(ElementTree.SubElement(data, "attitudeState"), "quaternionState")
        ElementTree.SubElement(state, "EPOCH").text = at
        parts = ElementTree.SubElement(state, "quaternion")
        for name, value in zip(("Q1", "Q2", "Q3", "QC"), row, strict=True):
            ElementTree.SubElement(parts, name).text = repr(value)
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _epoch(text: str) -> tuple[datetime.datetime, Decimal]:
    """Whole seconds, and the rest [s]. Raises UnknownNameError, WrongObjectError."""
    check_text(text, "epoch", "a date and time as 2026-11-23T10:00:00.5")
    whole, _, rest = text.partition(".")
    try:
        if rest and not (rest.isascii() and rest.isdigit()):
            raise ValueError
        epoch = datetime.datetime.fromisoformat(whole)
    except ValueError:
        epoch = None
    if epoch is None or epoch.tzinfo is not None:
        raise UnknownNameError(f"epoch: a date and time as 2026-11-23T10:00:00.5 are needed, got {text!r}")
    return epoch, Decimal(f"0.{rest or 0}")


def _epochs(begin: tuple[datetime.datetime, Decimal], times: Array) -> list[str]:
    """The epochs of times after the start."""
    epochs, step = [], Decimal(1).scaleb(-_DIGITS)
    for time in times.tolist():
        after = (begin[1] + Decimal(time)).quantize(step)
        whole = int(after)
        fraction = f"{after - whole:.{_DIGITS}f}".removeprefix("0.")
        epochs.append(f"{(begin[0] + datetime.timedelta(seconds=whole)).isoformat()}.{fraction}")
    return epochs
