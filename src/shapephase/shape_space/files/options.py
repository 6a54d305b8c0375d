"""Keyword arguments of the functions that read recorded motions, their check, and names of columns for joints."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypedDict, TypeVar

from numpy.typing import ArrayLike

from ...arguments import check_choice, check_file_name, check_mapping, positive_argument
from ...arguments import names_argument as names_list
from ...body.body import Body
from ...body.joint_orders import WORDS
from ...errors import ShapeError, TrajectoryError, WrongObjectError, unknown_name
from ...letters import value_text
from ._gaps import fill_argument
from ._joint_columns import JointChoices
from ._segment_links import SegmentChoices
from .base_columns import base_choices
from .closing import close_argument
from .flight import FlightChoices, flight_choices
from .labels import label
from .recording import check_text, file_bytes
from .times import trim_argument

Read = TypeVar("Read", bound=Callable[..., Any])


class TrajectoryOptions(TypedDict, total=False):
    """Keyword arguments of `read_trajectory`, which `read_recorded_motion` describes."""

    names: Mapping[str, str | None] | Sequence[str] | str | os.PathLike[str] | None
    degrees: bool | None
    timestep: float | None
    topic: str | None
    joint_order: str | None
    rest_missing: bool
    ignore_extra: bool
    fill: float | str | None
    lowpass: float | None
    resample: float | None
    base_order: str | None
    base_axes: ArrayLike | str | None
    base_inverse: bool | None
    calibration: float | str | None
    length_tolerance: float | None


class ReadingOptions(TrajectoryOptions, total=False):
    """Keyword arguments of `read_recorded_motion` and `read_shape_path`."""

    time_unit: str | None
    rest: Mapping[str, float | str] | None
    trim: tuple[float, float] | None
    smooth: float | str | Mapping[str, float | str] | None
    smooth_penalty: float | None
    close: float | str | bool | None
    close_by: str | None
    flight: str | Sequence[float] | None
    up: str | None
    gravity: float | str | None
    without: Sequence[str] | None
    wheel_speeds: Mapping[str, str] | None


def show_options(options: type) -> Callable[[Read], Read]:
    """Decorator: `help` and editors show the keyword arguments of a class of options, with their defaults."""

    def with_signature(function: Read) -> Read:
        plain = inspect.signature(function)
        shown = [part for part in plain.parameters.values() if part.kind is not part.VAR_KEYWORD]
        for name, kind in options.__annotations__.items():
            # A TypedDict keeps its annotations as forward references.
            text, default = kind.__forward_arg__, None if "None" in kind.__forward_arg__ else False
            shown.append(inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=text))
        function.__signature__ = plain.replace(parameters=shown)  # type: ignore[attr-defined]
        return function

    return with_signature


def check_options(given: Mapping[str, Any], options: type, function: str) -> None:
    """Raise WrongObjectError, a TypeError, for an unknown keyword argument."""
    for name in given:
        if name not in options.__annotations__:
            raise WrongObjectError(str(unknown_name(f"argument of {function}", name, options.__annotations__)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Reading:
    """How a recording is read, checked.

    names : column or segment -> joint or link, None to leave it out; None: not given
    listed : True where names were a list, one for each column
    joints, segments, flight : how columns become joints and base, segments links, and what a flight is
    """

    names: Mapping[str, str | None] | None
    listed: bool
    joints: JointChoices
    segments: SegmentChoices
    flight: FlightChoices
    trim: tuple[float, float] | None
    rate: float | None
    cut_off: float | None
    close: float | str | None
    given: Callable[[str], Any]

    @classmethod
    def of(cls, options: ReadingOptions, body: Body) -> Reading:
        """Checked options. Raises ShapeError, TrajectoryError, UnknownNameError; WrongObjectError for unknown ones."""
        check_options(options, ReadingOptions, "read_recorded_motion")
        given = options.get
        trim, order = trim_argument(given("trim")), given("joint_order")
        flight = flight_choices(given("flight"), given("up"), given("gravity"))
        base = base_choices(given("base_order"), given("base_axes"), given("base_inverse"))
        close = close_argument(given("close"))
        if order is not None:
            check_choice(order, "joint_order", WORDS)
        resample, lowpass = given("resample"), given("lowpass")
        rate = None if resample is None else positive_argument(resample, "resample", "a number of samples a second")
        cut_off = None if lowpass is None else positive_argument(lowpass, "lowpass", "a frequency in Hz")
        if cut_off is not None and not (given("smooth") is None and given("smooth_penalty") is None):
            raise TrajectoryError(
                "lowpass and smooth are two ways to do one thing; leave one of them out (lowpass, --lowpass; smooth, "
                "--smooth; smooth_penalty, --smooth-penalty)"
            )
        if close is None and given("close_by") is not None:
            raise TrajectoryError(
                f"close_by={value_text(given('close_by'))}: how large a gap is to be closed? Give close, as 0.05 or "
                "'3deg'"
            )
        names = names_argument(given("names"))
        without, speeds = _left_out(given("without"), body), given("wheel_speeds") or {}
        check_mapping(speeds, "wheel_speeds", "wheel -> column")
        if not all(isinstance(column, str) for column in speeds.values()):
            raise ShapeError(f"wheel_speeds: names of columns are needed, got {value_text(speeds)}")
        return cls(
            names=names,
            listed=isinstance(given("names"), list | tuple),
            joints=JointChoices(
                names={},
                base=base,
                degrees=given("degrees"),
                rest=given("rest"),
                rest_missing=given("rest_missing", False),
                ignore_extra=given("ignore_extra", False),
                fill=fill_argument(given("fill")),
                without=tuple(name for name in body.joint_names if name in without or name in speeds),
                wheel_speeds=speeds,
            ),
            segments=SegmentChoices(
                names=names or {}, calibration=given("calibration"), length_tolerance=given("length_tolerance")
            ),
            flight=flight,
            trim=trim,
            rate=rate,
            cut_off=cut_off,
            close=close,
            given=given,
        )


def _left_out(names: object, body: Body) -> tuple[str, ...]:
    """Joints whose path is not wanted. Raises ShapeError, UnknownNameError."""
    left_out = () if names is None else names_list(names, "without", "names of joints in a list")
    for name in left_out:
        body.joint_index(name)
    return left_out


def read_names(file: str | os.PathLike[str]) -> dict[str, str | None]:
    """Read a mapping from columns to joints, for the argument `names` of `read_recorded_motion`.

    The file is a text with a line `column=joint` for each, where nothing behind the equals sign leaves the column out,
    and `#` begins a comment.

    Raises
    ------
    InputFileNotFoundError
        If there is no such file.
    ShapeError
        For anything else in it, with the line.

    Examples
    --------
    >>> with open("names.txt", "w") as file:
    ...     _ = file.write("LKnee=left_knee")
    >>> sp.shape_space.files.read_names("names.txt")
    {'LKnee': 'left_knee'}
    """
    check_file_name(file, "file")
    where = Path(file)
    data = file_bytes(where)
    check_text(data, where)
    text = data.decode("utf-8-sig")
    names: dict[str, str | None] = {}
    for count, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.strip().startswith("#"):
            continue
        column, joint = name_pair(line, f"{where}: line {count}")
        if column in names:
            raise ShapeError(f"{where}: line {count}: {column!r:.60} stands twice")
        names[column] = joint
    return names


def name_pair(text: str, where: str) -> tuple[str, str | None]:
    """One `column=joint`; without a joint the column is left out. Raises ShapeError, which begins with `where`."""
    column, mark, joint = text.strip().rpartition("=")
    if not mark or not column.strip():
        raise ShapeError(f"{where}: COLUMN=JOINT is needed, got {text.strip()!r:.60}")
    return column.strip(), joint.strip() or None


def names_argument(names: Any) -> Mapping[str, str | None] | None:
    """Names with a file of them read, and a list as names of columns by their numbers. Raises ShapeError."""
    if isinstance(names, str | os.PathLike):
        return read_names(names)
    if isinstance(names, list | tuple):
        return {str(number): name for number, name in enumerate(names, start=1)}
    if names is not None and not isinstance(names, Mapping):
        raise ShapeError(f"names: a mapping, name in the file -> joint, is needed, got {value_text(names)}")
    return names


def names_by_label(names: Mapping[str, str | None], labels: Iterable[str]) -> dict[str, str | None]:
    """Label of the file -> name; keys may lack the label's unit.

    Raises ShapeError for names that are no texts; KeyError with the name, if no label has it; TrajectoryError if
    several do.
    """
    known = list(labels)
    plain: dict[str, list[str]] = {}
    for text in known:
        plain.setdefault(label(text).name, []).append(text)
    by_label: dict[str, str | None] = {}
    for column, name in names.items():
        if not isinstance(column, str) or not (name is None or isinstance(name, str)):
            raise ShapeError(
                f"names: texts are needed (None leaves a column out), got {value_text(column)}: {name!r:.40}"
            )
        candidates = [column] if column in known else plain.get(column, [])
        if not candidates:
            raise KeyError(column)
        if len(candidates) > 1:
            raise TrajectoryError(f"names: {column!r} may be {' or '.join(map(repr, candidates))}; write it in full")
        by_label[candidates[0]] = name
    return by_label
