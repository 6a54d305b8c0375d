"""Speed beside compiled C++: `make bench`, or `python -m benchmarks [--quick] [--against SRC]`.

Seventeen motions, each as its known kind (Fourier loop, spline, moves) and as a black box (`ShapePath.function` of the
same path, looked at before), beside peer.cpp: Pinocchio in Boost.odeint's Runge-Kutta-Fehlberg 7(8), which takes the
motion as a function of time in C++, at the loosest relative tolerance (half decades) that keeps its own largest error
at its steps within 1e-9. Ours is `reconstruct(articulated(body, path))` at the tolerance asked for, 1e-9, and at the
loosest that keeps the true error within 1e-9 at the same times ("same error"). Truth is in extended precision
(`benchmarks.extended`). All take turns, in processes of one thread; times are processor time, ratios medians of the
turns' ratios. What is compiled is compiled first.

`--against SRC` names the `src` folder of another checkout, which runs in the same turns.
Then what follows a reconstruction, many momenta and bodies at once, threads, and recorded motions.
`--keep` writes what is printed to benchmarks/results.txt, too, which `python -m benchmarks.page` puts on its page.
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import argparse
import contextlib
import io
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

import numpy as np

from .cases import Case, numbered_case
from .contestant import Contestant, Setting, WorkloadFailed
from .extended import Truth, angles_between, exact_path
from .page import RESULTS, circumstances
from .peer import FLAGS, NoPeer, Peer
from .workloads import TOLERANCE

RUNS = 20
"""At a turn, after one that does not count: what one of many costs, not the first after a process has slept."""
_QUICK_CASES = (0, 2, 4, 7, 16)
_PEER = "C++"
_KINDS = ("loop", "move", "samples", "righting")
"""In the names of the cases."""
_GRID = np.arange(4.0, 13.1, 0.5)
"""Tolerances on which the loosest are looked for, as negative powers of ten."""


@dataclass
class Entry:
    """One way of running one case: its tolerance and times [s], turn by turn."""

    tolerance: float
    evaluations: int
    error: float
    seconds: list[float] = field(default_factory=list)

    @property
    def median(self) -> float:
        """[ms]."""
        return 1e3 * float(np.median(self.seconds))


Entries = dict[tuple[str, str, str], Entry]
"""By contestant, "known" or "box", "asked" or "same error"; of the peer under ("C++", "", "")."""


def main() -> None:
    """Print the tables."""
    asked = _arguments()
    kept = io.StringIO()
    with contextlib.redirect_stdout(Both(sys.stdout, kept)):
        print("\n".join(circumstances()), flush=True)
        measured(list(_QUICK_CASES if asked.quick else range(17)), asked.against, quick=asked.quick)
    if asked.keep:
        RESULTS.write_text(kept.getvalue(), encoding="utf-8")


class Both(io.TextIOBase):
    """What is written goes to two streams."""

    def __init__(self, first: TextIO, second: TextIO) -> None:
        self._streams = (first, second)

    def write(self, text: str, /) -> int:
        """Write to both."""
        for stream in self._streams:
            stream.write(text)
        return len(text)

    def flush(self) -> None:
        """Flush both."""
        for stream in self._streams:
            stream.flush()


def measured(numbers: list[int], against: Path | None, *, quick: bool) -> None:
    """Print all tables."""
    with tempfile.TemporaryDirectory() as folder:
        contestants = started(against, folder)
        try:
            print_cases(contestants, numbers, turns=5 if quick else 9)
            print_workloads(contestants, numbers, quick=quick)
        finally:
            for contestant in contestants:
                contestant.close()


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks")
    parser.add_argument("--quick", action="store_true", help="five cases and fewer turns, in about a minute")
    parser.add_argument("--against", type=Path, metavar="SRC", help="the src folder of another checkout")
    parser.add_argument("--keep", action="store_true", help="write what is printed to benchmarks/results.txt, too")
    return parser.parse_args()


def started(against: Path | None, folder: str) -> list[Contestant]:
    """The processes; what is compiled, is compiled first."""
    settings = [Setting("ours")]
    if against is not None:
        settings.append(Setting("before", against.resolve(), cache=f"{folder}/before"))
    contestants = [Contestant(setting) for setting in settings]
    for contestant in contestants:
        print(f"{contestant.name}: {contestant('compiled')}", flush=True)
    return contestants


# ---- Cases beside the peer ------------------------------------------------------------------------------------------


def print_cases(contestants: list[Contestant], numbers: list[int], turns: int) -> None:
    """A line for each case, known and as a black box, and the medians."""
    all_cases = {number: numbered_case(number) for number in numbers}
    ways = [(c.name, way, asked) for c in contestants for way in ("known", "box") for asked in ("asked", "same error")]
    print(f"\ncompiled C++: {' '.join(FLAGS)}; tolerance {TOLERANCE:g} rad; processor time [ms]; ratios to C++\n")
    heads = "".join(f"{c.name:>8.8}{'ratio':>6}{'same error':>11}{'evals':>6}" for c in contestants)
    print(f"{'case':38}{'':6}{'C++':>6}{'to':>6}{'evals':>6}{heads}")
    done: dict[int, Entries] = {}
    for number in numbers:
        done[number] = compared(all_cases[number], number, contestants, turns)
        for way in ("known", "box"):
            print(_row(all_cases[number], way, done[number], contestants), flush=True)
    if (_PEER, "", "") in done[numbers[0]]:
        print_medians({number: all_cases[number].name for number in numbers}, done, ways)
    for before in contestants[1:]:
        print(f"\n{contestants[0].name} / {before.name}, at the tolerance asked for")
        for way in ("known", "box"):
            ours, theirs = ((c.name, way, "asked") for c in (contestants[0], before))
            print(f"  {way:7}{_ratios(done, numbers, ours, theirs)}")


def print_medians(names: dict[int, str], done: dict[int, Entries], ways: list[tuple[str, str, str]]) -> None:
    """Of the ratios to the peer, over all cases and by their kinds."""
    kinds = [kind for kind in _KINDS if any(kind in name for name in names.values())]
    print("\nmedians of the ratios to C++" + " " * 52 + "".join(f"{kind:>11}" for kind in kinds))
    for way in ways:
        medians = []
        for kind in kinds:
            chosen = [number for number, name in names.items() if kind in name]
            medians.append(np.median([_paired(done[n][way], done[n][_PEER, "", ""]) for n in chosen]))
        of_all = _ratios(done, list(names), way, (_PEER, "", ""))
        print(f"  {way[0]:18}{way[1]:7}{way[2]:12}{of_all:41}" + "".join(f"{median:11.2f}" for median in medians))


def _row(case: Case, way: str, entries: Entries, contestants: list[Contestant]) -> str:
    peer = entries.get((_PEER, "", ""))
    line = f"{case.name:38}{way:6}"
    line += f"{peer.median:6.3f}{peer.tolerance:6.0e}{peer.evaluations:6d}" if peer else f"{'':18}"
    for contestant in contestants:
        ours = entries[contestant.name, way, "asked"]
        eased = entries[contestant.name, way, "same error"]
        ratios = [_paired(entry, peer) if peer else np.nan for entry in (ours, eased)]
        line += f"{ours.median:8.3f}{ratios[0]:6.2f}{ratios[1]:11.2f}{ours.evaluations:6d}"
    return line


def _paired(ours: Entry, theirs: Entry) -> float:
    """The median of the ratios, turn by turn."""
    return float(np.median(np.array(ours.seconds) / np.array(theirs.seconds)))


def _ratios(
    done: dict[int, Entries], numbers: list[int], ours: tuple[str, str, str], theirs: tuple[str, str, str]
) -> str:
    ratios = [_paired(done[number][ours], done[number][theirs]) for number in numbers]
    return f"median {np.median(ratios):5.2f}   from {min(ratios):5.2f} to {max(ratios):5.2f}"


def compared(case: Case, number: int, contestants: list[Contestant], turns: int) -> Entries:
    """All contestants on one case, in turns."""
    truth, exact = Truth(case.body), exact_path(case.path)
    entries: Entries = {}
    try:
        peer = Peer(case.body, case.path, case.path.breaks, case.momentum)
    except NoPeer as missing:
        print(f"  no peer: {missing}")
        peer, times = None, np.linspace(0.0, case.path.duration, 31)[1:]
    else:
        entries[_PEER, "", ""], times = _loosest_peer(peer, truth, exact, case)
    quaternions, _ = truth.attitudes(exact, exact.breaks, case.momentum, times)
    for contestant in contestants:
        for box, way in ((False, "known"), (True, "box")):
            found = _errors(contestant, number, box, times, quaternions)
            entries[contestant.name, way, "asked"] = found[TOLERANCE]
            within = [entry for entry in found.values() if entry.error <= TOLERANCE]
            eased = max(within, key=lambda entry: entry.tolerance, default=found[TOLERANCE])
            entries[contestant.name, way, "same error"] = Entry(eased.tolerance, eased.evaluations, eased.error)
    by_name = {contestant.name: contestant for contestant in contestants}
    for _ in range(turns):
        for (name, way, _), entry in entries.items():
            if name == _PEER and peer is not None:
                peer.seconds(entry.tolerance)
                entry.seconds.append(peer.seconds(entry.tolerance, RUNS))
            else:
                run = by_name[name]
                entry.seconds.append(run("reconstruction_seconds", number, way == "box", entry.tolerance, RUNS))
    return entries


def _loosest_peer(peer: Peer, truth: Truth, exact: object, case: Case) -> tuple[Entry, np.ndarray]:
    """The loosest tolerance of the peer whose errors stay within ours, and the times of its steps."""
    for tolerance in 10.0**-_GRID:
        steps = peer.steps(tolerance)
        quaternions, _ = truth.attitudes(exact, exact.breaks, case.momentum, steps.times)
        if (error := steps.error(quaternions)) <= TOLERANCE:
            return Entry(tolerance, steps.evaluations, error), steps.times
    raise ArithmeticError(f"{case.name}: the peer does not reach {TOLERANCE:g}")


def _errors(
    contestant: Contestant, number: int, box: bool, times: np.ndarray, quaternions: np.ndarray
) -> dict[float, Entry]:
    """By tolerance, from the loosest to the first that is within the error, and at the one asked for."""
    found: dict[float, Entry] = {}
    for tolerance in [float(f"1e-{exponent:g}") if exponent % 1 == 0 else 10.0**-exponent for exponent in _GRID]:
        within = any(entry.error <= TOLERANCE for entry in found.values())
        if within and tolerance != TOLERANCE:
            continue
        run = contestant("reconstructed", number, box, tolerance, times)
        if run is None:
            continue
        attitudes, _, evaluations = run
        found[tolerance] = Entry(tolerance, evaluations, float(angles_between(quaternions, attitudes).max()))
        if TOLERANCE in found and (within or found[tolerance].error <= TOLERANCE):
            break
    return found


# ---- Other workloads ------------------------------------------------------------------------------------------------


def print_workloads(contestants: list[Contestant], numbers: list[int], *, quick: bool) -> None:
    """A line for each number of each workload, a column for each contestant."""
    turns, many, few, rows = (3, 2000, 100, 1000) if quick else (7, 10_000, 1000, 10_000)
    print(f"\n{'':50}" + "".join(f"{c.name:>10.10}" for c in contestants))
    print_table("a black box for the first time", contestants, "first_black_boxes", numbers)
    print_table("after a reconstruction", contestants, "afterwards", turns, numbers)
    print_table("exact derivatives", contestants, "derivative_costs", turns)
    print_table("error bars of 1,000 noisy samples", contestants, "error_bar_costs", turns)
    print_table("recorded motions", contestants, "recorded", 3, rows)
    print_table("many momenta", contestants, "many_momenta", many, 20 if quick else 100)
    print_table("threads, by the clock", contestants, "threads", many, few)
    print_table("many bodies", contestants, "inertia_variants", few, 20)


def print_table(title: str, contestants: list[Contestant], workload: str, *arguments: object) -> None:
    """One workload."""
    columns, faults = [], []
    for contestant in contestants:
        try:
            columns.append(contestant(workload, *arguments))
        except WorkloadFailed as failed:
            columns.append({})
            faults.append(str(failed))
    print(title if any(columns) else f"{title}: not there", flush=True)
    for name in dict.fromkeys(name for column in columns for name in column):
        cells = (_cell(column[name]) if name in column else f"{'':10}" for column in columns)
        print(f"  {name:48}" + "".join(cells))
    for fault in faults:
        print(f"  {fault}")


def _cell(value: float) -> str:
    return f"{value:10,.0f}" if abs(value) >= 1000.0 else f"{value:10.3g}"


if __name__ == "__main__":
    main()
