"""One trial: a valid file, damaged at random, and what is wrong with how it is read."""

from __future__ import annotations

import random
import warnings
from functools import cache
from pathlib import Path

import numpy as np

import shapephase as sp

from .samples import BODY, JOINTS, READERS, WRITERS

_LONGEST_MESSAGE = 2000
"""Characters of an error that people read."""
_DIGITS = b"0123456789.-+eE"


def damaged_file(seed: int, folder: Path) -> Path:
    """Write one of the valid files with one to three changes of its bytes; each seed is one file."""
    chance = random.Random(seed)
    name = chance.choice(list(WRITERS))
    file = folder / f"{seed}_{name}"
    WRITERS[name](file)
    data = bytearray(file.read_bytes())
    for _ in range(chance.randint(1, 3)):
        at = chance.randrange(len(data))
        end = min(len(data), at + chance.randint(1, 40))
        match chance.randrange(6):
            case 0:
                data[at] = chance.randrange(256)
            case 1:
                del data[at:end]
            case 2:
                data[at:at] = data[at:end]
            case 3:
                data[at:end] = bytes(reversed(data[at:end]))
            case 4:
                data[at : at + 1] = bytes([chance.choice(_DIGITS)])
            case _:
                del data[at:]
        if not data:
            break
    file.write_bytes(data)
    return file


@cache
def _body(folder: Path) -> sp.Body:
    file = folder / "body.urdf"
    file.write_text(BODY)
    return sp.load_body(file)


def fault_of(file: Path) -> tuple[str, str]:
    """Outcome of reading a file, "read" or the name of an error, and what is wrong with it; nothing: an empty text."""
    body = _body(file.parent)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            recorded = sp.read_recorded_motion(file, body)
    except sp.errors.ShapePhaseError as error:
        said, outcome = str(error), type(error).__name__
        if file.name not in said or len(said) > _LONGEST_MESSAGE:
            return outcome, f"a message of {len(said)} characters: {said[:300]}"
        return outcome, ""
    except Exception as error:  # whatever escapes is a fault
        return "escaped", f"{type(error).__name__}: {error!s:.300}"
    shapes = recorded.path.shape(recorded.times)
    if not np.isfinite(shapes).all():
        return "read", "what was read is not finite"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            plain = READERS[file.suffix](file)
            times = np.asarray(plain["time"], dtype=np.float64)
            numbers = np.column_stack([np.asarray(plain[name], dtype=np.float64) for name in JOINTS])
    except Exception:  # others may refuse what we read, or name it otherwise
        return "read", ""
    expected = numbers[:, [JOINTS.index(name) for name in body.joint_names]]
    if expected.shape != shapes.shape or not np.allclose(shapes, expected, rtol=1e-9, atol=1e-9):
        return "read", f"joints differ from what another package reads:\n{shapes}\n{expected}"
    if not np.allclose(recorded.times, times - times[0], rtol=1e-9, atol=1e-9):
        return "read", f"times differ from what another package reads:\n{recorded.times}\n{times}"
    return "read", ""
