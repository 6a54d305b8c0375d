"""Where OpenSim has the bodies of a model along a file of motion: run as a script, in a process without CasADi."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any


def replayed(model: Path, motion: Path, bodies: list[str]) -> dict[str, Any]:
    """Times (N,), and for each body its poses in the ground (N, 4, 4), as nested lists."""
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        command = [sys.executable, __file__, str(answer), str(model), str(motion), *bodies]
        subprocess.run(command, check=True, timeout=120, cwd=folder, capture_output=True)
        return json.loads(answer.read_text())


def main() -> None:
    import opensim

    opensim.Logger.setLevelString("Off")
    answer, file, motion, *bodies = sys.argv[1:]
    model, rows = opensim.Model(file), opensim.Storage(motion)
    state = model.initSystem()
    assert not rows.isInDegrees()
    labels, coordinates = rows.getColumnLabels(), model.getCoordinateSet()
    found: dict[str, Any] = {"times": [], "poses": {name: [] for name in bodies}}
    for k in range(rows.getSize()):
        row = rows.getStateVector(k)
        found["times"].append(row.getTime())
        for column in range(1, labels.getSize()):
            coordinates.get(labels.get(column)).setValue(state, row.getData().get(column - 1), False)
        model.realizePosition(state)
        for name in bodies:
            there = model.getBodySet().get(name).getTransformInGround(state)
            matrix, place = there.R().asMat33(), there.p()
            turned = [[*(matrix.get(i, j) for j in range(3)), place.get(i)] for i in range(3)]
            found["poses"][name].append([*turned, [0.0, 0.0, 0.0, 1.0]])
    Path(answer).write_text(json.dumps(found))
    # What OpenSim takes down at the end may crash, and nothing of it is needed.
    os._exit(0)


if __name__ == "__main__":
    main()
