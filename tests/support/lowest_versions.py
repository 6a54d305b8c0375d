"""The lowest versions that pyproject.toml claims: `python tests/support/lowest_versions.py [EXTRA ...]`, for pip."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

_LOWEST = re.compile(r"([\w-]+)>=([\w.]+)")


def lowest_versions(*extras: str) -> list[str]:
    """What the library and these extras need, each in the lowest version that is allowed: `numpy==2.0`, ..."""
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = [*project["dependencies"], *(one for extra in extras for one in project["optional-dependencies"][extra])]
    found = [_LOWEST.match(one) for one in needed]
    assert all(found), f"without a lowest version: {needed[found.index(None)]}"
    return [f"{match[1]}=={match[2]}" for match in found if match]


if __name__ == "__main__":
    print(*lowest_versions(*sys.argv[1:]))
