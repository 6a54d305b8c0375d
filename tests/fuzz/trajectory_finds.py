"""What was found and mended in trajectories and their audits, and of folders of packages."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .finds import Case
from .pieces import BODY, Trial
from .studies import GOOD_MOTION
from .trajectories import flown


def _flight(change: Callable[[dict[str, Any]], object], **options: object) -> Trial:
    """A flight in MuJoCo's vectors, with something changed."""
    found = {name: flown()[name].copy() for name in ("time", "qpos", "qvel", "joint_names")}
    change(found)
    stream = io.BytesIO()
    np.savez(stream, **found)
    return Trial(
        kind="trajectory", source="find", files={"run.npz": stream.getvalue()}, main="run.npz", options=options
    )


def _biorbd(places: np.ndarray, rates: np.ndarray) -> Trial:
    stream = io.BytesIO()
    np.savez(stream, time=flown()["time"], Q=places, Qdot=rates)
    return Trial(kind="trajectory", source="find", files={"run.npz": stream.getvalue()}, main="run.npz")


def _table(*more: str) -> Trial:
    """The same as a table, whose first place stands once more under other names."""
    numbers = np.column_stack([flown()["time"], flown()["qpos"], *([flown()["qpos"][:, 0]] * len(more))])
    header = ",".join(["time", *(f"qpos_{k}" for k in range(10)), *more])
    text = "\n".join([header, *(",".join(map(repr, row)) for row in numbers.tolist())]) + "\n"
    return Trial(kind="trajectory", source="find", files={"run.csv": text.encode()}, main="run.csv")


def _swing(found: dict[str, Any]) -> None:
    found["qpos"][:, 7] *= 1.3


def _wild_joint(found: dict[str, Any]) -> None:
    found["qpos"][:, 8] += 0.01 * np.random.default_rng(3).random(len(found["time"]))


def _wild_base(found: dict[str, Any]) -> None:
    found["qpos"][:, 2] *= 2.1


def _study(entry: str) -> Trial:
    text = f'body = "body.urdf"\nmotion = "motion.csv"\n{entry}\n'
    files = {"study.toml": text.encode(), "body.urdf": BODY.encode(), "motion.csv": GOOD_MOTION.encode()}
    return Trial(kind="study", source="find", files=files, main="study.toml")


CASES: Mapping[str, Case] = {
    "a number of a fit that the samples do not bound": Case(make=lambda: _flight(_swing), outcome="accepted"),
    "noise of one joint alone": Case(make=lambda: _flight(_wild_joint), outcome="accepted"),
    "a link that would weigh less than nothing": Case(make=lambda: _flight(_wild_base), outcome="accepted"),
    "rates whose squares are no numbers": Case(
        make=lambda: _flight(lambda found: np.copyto(found["qvel"][3:5], 1e300)), said="run.npz: rate: sample 3 has"
    ),
    "a step between samples that is a word": Case(
        make=lambda: _flight(lambda found: found.update(timestep=np.array("a"))), said="run.npz: timestep"
    ),
    "two joints of one name": Case(
        make=lambda: _flight(lambda found: found.update(joint_names=np.array(["boom", "hip", "hip"]))),
        said="'hip' stands 2 times",
    ),
    "a time that stands still": Case(
        make=lambda: _flight(lambda found: np.copyto(found["time"][5:], 0.1)), said="/run.npz: sample 6: time 0.1 s"
    ),
    "rates of biorbd for other coordinates": Case(
        make=lambda: _biorbd(flown()["Q"], flown()["Qdot"].T), said="run.npz: Qdot: expected shape (32, 9)"
    ),
    "two columns of one number": Case(make=lambda: _table("qpos[0]"), said="two columns are number 0 of qpos"),
    "two columns of times": Case(make=lambda: _table("t"), said="columns 'time' and 't' are both times"),
    "a column whose number has 5000 digits": Case(make=lambda: _table("qpos_" + "9" * 5000), outcome="accepted"),
    "what is varied, in 70,000 letters": Case(
        make=lambda: _study(f"[over.{'x' * 70_000}]\nvalues = [1.0]"), outcome="StudyError", said="a name of 70000"
    ),
    "a folder of packages without a name": Case(
        make=lambda: _study('packages = [""]'), outcome="StudyError", said="packages: folders in a list are needed"
    ),
}
