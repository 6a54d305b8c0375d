"""A turn by Crocoddyl, in a Python of its own: this side of `crocoddyl_worker`."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

import shapephase as sp
from shapephase import so3

from ..simulators import plain_urdf
from .rest_to_rest import Turn, joints_of

WORKER = Path(__file__).with_name("crocoddyl_worker.py")
FOLDER = Path(__file__).parents[2] / "build" / "crocoddyl"


def environment() -> Path:
    """The Python of a virtual environment that has Crocoddyl, made where there is none yet."""
    python = FOLDER / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", FOLDER], check=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "crocoddyl>=3.2,<4", "numpy"], check=True)
    return python


def shot(turn: Turn, python: Path) -> tuple[sp.ShapePath, str, float]:
    """The path, what became of the search, and its processor time there [s]."""
    shapes, rates, accelerations = turn.first_guess(np.linspace(0.0, 1.0, turn.nodes + 1))
    asked = {
        "urdf": plain_urdf(turn.body._model, "revolute"),
        "joints": joints_of(turn.body),
        "goal": so3.quat_from_matrix(turn.goal).tolist(),
        "limits": turn.body.joint_limits.tolist(),
        "rate_limits": turn.rates.tolist(),
        "duration": turn.duration,
        "nodes": turn.nodes,
        "seconds": turn.seconds,
        "shapes": shapes.tolist(),
        "rates": rates.tolist(),
        "accelerations": accelerations.tolist(),
    }
    done = subprocess.run([python, WORKER], input=json.dumps(asked), text=True, stdout=subprocess.PIPE, check=True)
    answer = json.loads(done.stdout)
    nodes = [np.array(answer[key]) for key in ("shapes", "rates", "accelerations")]
    pieces = np.stack([nodes[0][:-1], nodes[1][:-1], 0.5 * nodes[2]], axis=-1)
    return turn.path(pieces), answer["said"], answer["seconds"]
