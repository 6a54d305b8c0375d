"""The search: inputs drawn by Hypothesis from the grammars, counted, and the smallest of those that show a fault."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from random import Random
from typing import Any

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from . import (
    array_motions,
    ball_joints,
    bodies,
    commands,
    engine_bodies,
    studies,
    text_motions,
    trajectories,
    xacro_files,
)
from .limited_process import LimitedProcess
from .pieces import Trial

GRAMMARS: Mapping[str, Callable[[Random], Trial]] = {
    "delimited": text_motions.delimited,
    "opensim": text_motions.opensim,
    "yaml": text_motions.ros_yaml,
    "names": text_motions.name_files,
    "npz": array_motions.npz,
    "matlab": array_motions.matlab,
    "hdf5": array_motions.hdf5,
    "excel": array_motions.excel,
    "parquet": array_motions.parquet,
    "c3d": array_motions.c3d,
    "bag": array_motions.bag,
    "record": array_motions.record,
    "urdf": bodies.urdf,
    "mjcf": bodies.mjcf,
    "biomod": engine_bodies.biomod,
    "yeadon": engine_bodies.yeadon,
    "xacro": xacro_files.xacro,
    "balls": ball_joints.bodies,
    "ball columns": ball_joints.columns,
    "trajectory": trajectories.trajectory,
    "study": studies.study_file,
    "store": studies.store_trial,
    "command": commands.command,
    "audit": partial(commands.command, only="audit"),
    "samples": partial(commands.command, only="split --samples"),
}
SHARES: Mapping[str, int] = {
    "delimited": 16,
    "opensim": 8,
    "yaml": 10,
    "names": 6,
    "npz": 10,
    "matlab": 6,
    "hdf5": 3,
    "excel": 6,
    "parquet": 5,
    "c3d": 3,
    "bag": 4,
    "record": 4,
    "urdf": 10,
    "mjcf": 7,
    "biomod": 3,
    "yeadon": 3,
    "xacro": 4,
    "balls": 6,
    "ball columns": 8,
    "trajectory": 6,
    "study": 8,
    "store": 5,
    "command": 8,
    "audit": 3,
    "samples": 3,
}
"""How often each grammar is used, of a hundred or so."""


@dataclass(eq=False)
class Tally:
    """What became of the inputs.

    Attributes
    ----------
    outcomes : source -> outcome -> how many
    seconds, memory : source -> the most of one input [s of processor time, bytes]
    """

    outcomes: dict[str, Counter[str]] = field(default_factory=dict)
    seconds: Counter[str] = field(default_factory=Counter)
    memory: Counter[str] = field(default_factory=Counter)

    def count(self, source: str, answer: Mapping[str, Any]) -> None:
        self.outcomes.setdefault(source, Counter())[answer["outcome"]] += 1
        self.seconds[source] = max(self.seconds[source], answer["seconds"])
        self.memory[source] = max(self.memory[source], answer["memory"])

    @property
    def trials(self) -> int:
        return sum(sum(found.values()) for found in self.outcomes.values())

    def table(self) -> str:
        lines = []
        for source, found in sorted(self.outcomes.items()):
            good = found["accepted"] + found["exit 0"]
            rest = ", ".join(f"{name} {n}" for name, n in found.most_common() if name not in ("accepted", "exit 0"))
            most = f"{self.seconds[source]:6.2f} s {self.memory[source] >> 20:5d} MiB"
            lines.append(f"{source:22}{sum(found.values()):7d}{good:7d} accepted {most}   {rest}")
        return "\n".join([*lines, f"{'in all':22}{self.trials:7d}"])


@dataclass(frozen=True, kw_only=True)
class Find:
    """The smallest input found that shows a fault."""

    trial: Trial
    faults: tuple[str, ...]


class _Fault(Exception):
    pass


def searched(
    process: LimitedProcess,
    grammar: str,
    trials: int,
    start: int,
    tally: Tally,
    *,
    by_command_line: bool = False,
    shrink: bool = True,
) -> Find | None:
    """Try inputs of a grammar until one shows a fault; that one is made smaller where `shrink`, and comes back."""
    if not shrink:
        # Hypothesis takes longer to draw an input than most of them take to be tried.
        drawn = (GRAMMARS[grammar](Random(f"{grammar} {start} {k}")) for k in range(trials))
        return next(filter(None, (_tried(process, trial, tally, by_command_line) for trial in drawn)), None)
    found: list[Find] = []

    @seed(start)
    @settings(
        max_examples=trials,
        deadline=None,
        database=None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
        report_multiple_bugs=False,
    )
    @given(st.randoms(use_true_random=False))
    def attempt(chance: Random) -> None:
        find = _tried(process, GRAMMARS[grammar](chance), None if found else tally, by_command_line)
        if find is not None:
            found.append(find)
            raise _Fault

    try:
        attempt()
    except _Fault:
        return found[-1]
    return None


def _tried(process: LimitedProcess, trial: Trial, tally: Tally | None, by_command_line: bool) -> Find | None:
    """Try an input, and count it; what it shows if that is a fault."""
    answer = process.tried(trial, by_command_line=by_command_line)
    if tally is not None:
        tally.count(trial.source + " process" * by_command_line, answer)
    return Find(trial=trial, faults=tuple(answer["faults"])) if answer["faults"] else None
