"""Names of columns for joints: as a caller gives them, or from a file that serves every recording of one system."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ...arguments import check_file_name
from ...errors import ShapeError, TrajectoryError
from ...letters import value_text
from .labels import label
from .recording import check_text, file_bytes


def read_names(file: str | os.PathLike[str]) -> dict[str, str | None]:
    """Read a mapping from columns to joints, for the argument `names` of `read_recorded_motion`.

    A file that ends with `.json` holds one object, `{"column": "joint", "other": null}`. Any other is a text with a
    line `column=joint` for each, where nothing behind the equals sign leaves the column out, and `#` begins a comment.

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
    if where.suffix.lower() == ".json":
        return _from_json(text, where)
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


def _from_json(text: str, where: Path) -> dict[str, str | None]:
    try:
        pairs = json.loads(text, object_pairs_hook=tuple)
    except (ValueError, RecursionError) as error:
        raise ShapeError(f"{where}: no JSON ({error!s:.100})") from None
    # Only an object becomes a tuple, of pairs.
    if not isinstance(pairs, tuple) or not all(name is None or isinstance(name, str) for _, name in pairs):
        raise ShapeError(f'{where}: one object of texts, {{"column": "joint", "other": null}}, is needed')
    names = dict(pairs)
    if len(names) < len(pairs):
        raise ShapeError(f"{where}: a column stands twice")
    return names
