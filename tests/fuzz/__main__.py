"""`python -m fuzz`: search for inputs that show a fault, for so many minutes or trials, and print what was found."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

from .limited_process import LimitedProcess
from .search import GRAMMARS, SHARES, Find, Tally, searched

_ROUND = 100
"""About as many trials of a round over all the grammars, in parts of `SHARES`."""


def main() -> int:
    """Search, print the table of outcomes and the finds, and return 1 if there are any."""
    parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=20.0, help="stop after so many minutes")
    parser.add_argument("--trials", type=int, default=sys.maxsize, help="stop after about so many trials")
    parser.add_argument("--only", nargs="*", choices=tuple(GRAMMARS), default=tuple(GRAMMARS), help="grammars to use")
    parser.add_argument("--seed", type=int, default=int.from_bytes(os.urandom(3)), help="begin here; printed")
    parser.add_argument("--processes", type=int, default=0, help="trials of commands in processes of their own")
    parser.add_argument("--no-shrink", action="store_true", help="keep finds as they are, and search on")
    parser.add_argument("--finds", type=Path, default=Path("fuzz_finds"), help="folder for inputs that show a fault")
    asked = parser.parse_args()
    print(f"seed {asked.seed}", flush=True)
    tally, end, start = Tally(), time.monotonic() + 60.0 * asked.minutes, asked.seed
    faulty: dict[str, Find] = {}
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as folder:
        process = LimitedProcess(Path(folder), long=True)
        try:
            # A find ends a round, and the rest of the trials follow.
            while (left := asked.processes - tally.trials) > 0:
                find = searched(process, "command", left, start, tally, by_command_line=True, shrink=False)
                _note(find, f"process{start}", faulty, asked.finds)
                print(f"{tally.trials} of {asked.processes} processes", flush=True)
                start += 1
            while tally.trials < asked.trials + asked.processes and time.monotonic() < end:
                rounds = min(10, max(1, (asked.trials - tally.trials) // _ROUND))
                for grammar in asked.only:
                    if (asked.no_shrink or grammar not in faulty) and time.monotonic() < end:
                        share = SHARES[grammar] * rounds
                        find = searched(process, grammar, share, start, tally, shrink=not asked.no_shrink)
                        _note(find, f"{grammar}{start}" if asked.no_shrink else grammar, faulty, asked.finds)
                start += 1
                if set(asked.only) <= set(faulty):
                    break
        finally:
            process.stop()
            print(tally.table(), flush=True)
    print(f"{len(faulty)} finds" + (f", kept in {asked.finds}" if faulty else ""))
    return 1 if faulty else 0


def _note(find: Find | None, grammar: str, faulty: dict[str, Find], folder: Path) -> None:
    """Keep a find and print it; a grammar that has one is not searched further."""
    if find is None:
        return
    faulty[grammar] = find
    place = folder / grammar
    place.mkdir(parents=True, exist_ok=True)
    for name, content in find.trial.files.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes(content)
    trial = find.trial
    print(f"\n{grammar}: {trial.kind} {trial.main} {dict(trial.options)} {list(trial.arguments)}")
    for name, content in trial.files.items():
        print(f"  {name}: {content[:600]!r}")
    print("\n".join(find.faults), end="\n\n", flush=True)


if __name__ == "__main__":
    sys.exit(main())
