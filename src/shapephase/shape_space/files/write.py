"""Joint motions written as tables and arrays, for `read_shape_path` to read."""

from __future__ import annotations

import csv
import io
import json
import os
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import check_file_name, check_text
from ...arrays import Array, finite_array
from ...errors import ShapeError, TrajectoryError, TrajectoryWarning, unknown_name
from ...files import output_target, write_whole
from ...provenance import provenance
from ..body_path import as_path
from ..path_series import spline_error
from ..shape_path import ShapePath
from .labels import SI, doubtful_turns
from .times import doubtful_steps

_WRITTEN = (".csv", ".npz", ".tsv")
_FAR_OFF = 1e-3  # [rad or m] error of reading back a table at given times, above which a warning is issued


def write_shape_path(
    path: ShapePath | str, file: str | os.PathLike[str], times: ArrayLike | None = None, *, comment: str | None = None
) -> None:
    """Write a joint motion as CSV, TSV or NPZ, by the file's ending; what `read_shape_path` reads.

    A pipe or a device without such an ending gets CSV. Labels of a table have a unit, `[s]` or `[SI]` (rad or m), where
    `read_shape_path` needs it: for times more than a second apart, and for joints that turn more than two times.

    Parameters
    ----------
    times : (N,) of the samples, ascending [s]; None: `path.sample_times`, so that what is read back is the path to 1e-9
        rad or m (of its largest value where that is above 1), a spline as it was
    comment : what stands above the table, each of its lines behind `#`; in NPZ, in the provenance

    Raises
    ------
    TrajectoryError
        If the path has no joint names, times do not ascend, or a table of the path takes more than a million rows.
    UnknownNameError
        For an unknown ending of the file.
    ShapeError
        If the times are not one row.

    Warns
    -----
    TrajectoryWarning
        If the times given are so few that what is read back is more than 0.001 rad or m from the path.

    Examples
    --------
    >>> sp.write_shape_path(sp.examples.cat_righting(), "cat.csv")
    >>> print(sp.read_shape_path("cat.csv", sp.load_body("cat")).duration)
    2.0
    """
    path = as_path(path)
    check_file_name(file, "file")
    where = Path(file)
    suffix = where.suffix.lower()
    if suffix not in _WRITTEN and not output_target(where).is_stream:
        raise unknown_name(f"ending of the motion file {where}:", where.suffix, _WRITTEN)
    if comment is not None:
        check_text(comment, "comment", "a text")
    if path.joint_names is None:
        raise TrajectoryError("a motion file names its joints, and this path has no joint names; make it with them")
    if times is None:
        t = path.sample_times
    else:
        t = finite_array(times, "times", (None,), unit="s")
        if t.ndim != 1:
            raise ShapeError(f"times: one row of times (N,) is needed, got shape {t.shape}")
        _check_rows(path, t)
    shapes = path.shape(t)
    if suffix == ".npz":
        made_from = {"joints": list(path.joint_names), "recording": None if path.record is None else dict(path.record)}
        if comment is not None:
            made_from["comment"] = comment
        arrays = {
            "time": t,
            "shapes": shapes,
            "joint_names": np.array(path.joint_names),
            "provenance": np.array(json.dumps(provenance(made_from))),
        }
        write_whole(where, lambda stream: np.savez(stream, **arrays))
        return
    text = io.StringIO()
    text.writelines(f"# {line}\n" for line in (comment or "").splitlines())
    writer = csv.writer(text, delimiter="\t" if suffix == ".tsv" else ",", lineterminator="\n")
    turning = np.abs(shapes).max(axis=0) > 2.0 * np.pi
    labels = [
        f"{name} [{SI}]" if turning[k] or doubtful_turns(shapes[:, k]) else name
        for k, name in enumerate(path.joint_names)
    ]
    writer.writerow(["time [s]" if len(t) > 1 and doubtful_steps(t) else "time", *labels])
    writer.writerows([[repr(float(v)) for v in row] for row in np.column_stack([t, shapes])])
    write_whole(where, lambda stream: stream.write(text.getvalue().encode()))


def _check_rows(path: ShapePath, times: Array) -> None:
    """Warn where the spline through rows at these times is far from the path. Raises TrajectoryError like `spline`."""
    off, when = spline_error(path, times)
    worst = int(np.argmax(off))
    if off[worst] > _FAR_OFF:
        name = path.joint_names[worst] if path.joint_names else worst
        warnings.warn(
            f"{len(times)} rows do not describe this path: read back, joint {name} is {off[worst]:.3g} rad or m off at "
            f"{when[worst]:.6g} s. Leave times out for as many rows as it needs, or give more of them",
            TrajectoryWarning,
            stacklevel=3,
        )
