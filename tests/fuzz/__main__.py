"""`python -m fuzz`: damage valid files at random for so many minutes; files that show a fault stay in a folder."""

from __future__ import annotations

import argparse
import faulthandler
import os
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

from .trials import damaged_file, fault_of

_AT_ONCE = 200
"""Trials of a process: one that dies takes few with it."""
_SECONDS = 60
"""[s] A file that takes longer to read is a fault."""


def main() -> int:
    """Search, print outcomes and faults, and return 1 if there are any."""
    parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=20.0, help="stop after so many minutes")
    parser.add_argument("--seed", type=int, default=int.from_bytes(os.urandom(3)), help="begin here; printed")
    parser.add_argument("--finds", type=Path, default=Path("fuzz_finds"), help="folder for files that show a fault")
    parser.add_argument("--here", type=int, default=0, help="try so many seeds in this process")
    given = parser.parse_args()
    given.finds.mkdir(exist_ok=True)
    if given.here:
        return _tried(range(given.seed, given.seed + given.here), given.finds)
    print(f"seed {given.seed}", flush=True)
    start, end, faulty = given.seed, time.monotonic() + 60.0 * given.minutes, 0
    while time.monotonic() < end:
        command = [sys.executable, "-m", "fuzz", "--finds", str(given.finds), "--here", str(_AT_ONCE)]
        code = subprocess.run([*command, "--seed", str(start)]).returncode
        if code:
            faulty += 1
            print(f"a fault between the seeds {start} and {start + _AT_ONCE} (exit code {code})", flush=True)
        start += _AT_ONCE
    print(f"{start - given.seed} files, {faulty} rounds with faults" + f", kept in {given.finds}" * bool(faulty))
    return 1 if faulty else 0


def _tried(seeds: range, finds: Path) -> int:
    """Read a damaged file for each seed; where the process dies, the last one is left in the folder."""
    outcomes, faulty = Counter[str](), False
    for seed in seeds:
        faulthandler.dump_traceback_later(_SECONDS, exit=True)
        file = damaged_file(seed, finds)
        outcome, fault = fault_of(file)
        faulthandler.cancel_dump_traceback_later()
        outcomes[outcome] += 1
        if fault:
            faulty = True
            print(f"{file}: {fault}", flush=True)
        else:
            file.unlink()
    print(", ".join(f"{count} {outcome}" for outcome, count in outcomes.most_common()), flush=True)
    return 1 if faulty else 0


if __name__ == "__main__":
    faulthandler.enable()
    sys.exit(main())
