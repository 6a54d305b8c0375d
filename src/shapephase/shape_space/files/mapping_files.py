"""Files that say which column of a recording is which joint, to be used again for every recording of one system."""

from __future__ import annotations

import json
import os
from pathlib import Path

from ...arguments import check_file_name
from ...errors import ShapeError
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
    return _from_json(text, where) if where.suffix.lower() == ".json" else _from_lines(text, where)


def name_pair(text: str, where: str) -> tuple[str, str | None]:
    """One `column=joint`; without a joint the column is left out. Raises ShapeError, which begins with `where`."""
    old, mark, new = text.rpartition("=")
    if not mark or not old.strip():
        raise ShapeError(f"{where}: COLUMN=JOINT is needed, got {text!r:.60}")
    return old.strip(), new.strip() or None


def _from_lines(text: str, where: Path) -> dict[str, str | None]:
    found: dict[str, str | None] = {}
    for count, line in enumerate(text.splitlines(), start=1):
        said = line.strip()
        if not said or said.startswith("#"):
            continue
        old, new = name_pair(said, f"{where}: line {count}")
        if old in found:
            raise ShapeError(f"{where}: line {count}: {old!r:.60} stands twice")
        found[old] = new
    return found


def _from_json(text: str, where: Path) -> dict[str, str | None]:
    try:
        pairs = json.loads(text, object_pairs_hook=tuple)
    except (ValueError, RecursionError) as error:
        raise ShapeError(f"{where}: no JSON ({error!s:.100})") from None
    # Only an object becomes a tuple, of pairs.
    if not isinstance(pairs, tuple) or not all(new is None or isinstance(new, str) for _, new in pairs):
        raise ShapeError(f'{where}: one object of texts, {{"column": "joint", "other": null}}, is needed')
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ShapeError(f"{where}: a column stands twice")
    return found
