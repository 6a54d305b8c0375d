"""Which worker of pytest-xdist runs which test."""

from __future__ import annotations

import re
from functools import cache

from xdist.scheduler import LoadScopeScheduling

from support.places import ROOT

_MACHINE_CODE = re.compile(r'usefixtures\("(fast|compiled)"\)|getfixturevalue\("fast"\)|def test_\w+\([^)]*\bfast\b')


class WholeFiles(LoadScopeScheduling):
    """A file's tests go to one worker, which computes what they share once.

    So do all files that use machine code: two workers would both compile it.
    """

    def _split_scope(self, nodeid: str) -> str:
        return _group(nodeid.split("::")[0])


@cache
def _group(file: str) -> str:
    return "machine code" if _MACHINE_CODE.search((ROOT / file).read_text(encoding="utf-8")) else file
