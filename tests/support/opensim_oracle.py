"""What OpenSim has of a model at shapes: run as a script, in a process without CasADi, with JSON in and out.

Coupled coordinates are put where OpenSim's own assembly has them; rates are the slopes of its functions.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path


def asked(model: Path, base: str, shapes: list[dict[str, float]], rates: list[dict[str, float]]) -> list[dict]:
    """For each shape I and L_o about the centre of mass and poses of the bodies, axes of the base; and couplings."""
    question = {"model": str(model), "base": base, "shapes": shapes, "rates": rates}
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        command = [sys.executable, __file__, str(answer)]
        subprocess.run(
            command, input=json.dumps(question).encode(), check=True, timeout=120, cwd=folder, capture_output=True
        )
        return json.loads(answer.read_text())


def main() -> None:
    import numpy as np
    import opensim

    opensim.Logger.setLevelString("Off")
    question = json.loads(sys.stdin.read())
    model = opensim.Model(question["model"])
    state = model.initSystem()
    matter, bodies, coordinates = model.getMatterSubsystem(), model.getBodySet(), model.getCoordinateSet()
    known = {coordinates.get(k).getName(): coordinates.get(k) for k in range(coordinates.getSize())}
    couplers = {}
    for k in range(model.getConstraintSet().getSize()):
        one = opensim.CoordinateCouplerConstraint.safeDownCast(model.getConstraintSet().get(k))
        couplers[one.getDependentCoordinateName()] = one

    def three(vector):
        return [vector.get(k) for k in range(3)]

    def pose(body):
        there = body.getTransformInGround(state)
        matrix = there.R().asMat33()
        found = np.eye(4)
        found[:3, :3], found[:3, 3] = [[matrix.get(i, j) for j in range(3)] for i in range(3)], three(there.p())
        return found

    found = []
    for shape, rate in zip(question["shapes"], question["rates"], strict=True):
        for name, value in shape.items():
            known[name].setValue(state, value, False)
        model.assemble(state)
        dependent = {name: known[name].getValue(state) for name in couplers}
        # Assembly moves the independent ones, too, by what it is accurate to.
        for name, value in shape.items():
            known[name].setValue(state, value, False)
        for name, speed in rate.items():
            known[name].setSpeedValue(state, speed)
        for name, coupler in couplers.items():
            driver = coupler.getIndependentCoordinateNames().get(0)
            which, where = opensim.StdVectorInt(), opensim.Vector(1, known[driver].getValue(state))
            which.append(0)
            slope = coupler.getFunction().calcDerivative(which, where)
            known[name].setValue(state, coupler.getFunction().calcValue(where), False)
            known[name].setSpeedValue(state, slope * rate[driver])
        model.realizeVelocity(state)
        root = pose(bodies.get(question["base"]))
        turn = root[:3, :3]
        inertia, momentum = matter.calcSystemCentralInertiaInGround(state), matter.calcSystemCentralMomentum(state)
        (xx, yy, zz), (xy, xz, yz) = three(inertia.getMoments()), three(inertia.getProducts())
        poses = {bodies.get(k).getName(): np.linalg.solve(root, pose(bodies.get(k))) for k in range(bodies.getSize())}
        found.append(
            {
                "mass": matter.calcSystemMass(state),
                "inertia": (turn.T @ [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]] @ turn).tolist(),
                "momentum": (turn.T @ three(momentum.get(0))).tolist(),
                "poses": {name: one.tolist() for name, one in poses.items()},
                "assembled": dependent,
                "dependent": {name: known[name].getValue(state) for name in couplers},
            }
        )
    Path(sys.argv[1]).write_text(json.dumps(found))
    # What OpenSim takes down at the end may crash, and nothing of it is needed.
    os._exit(0)


if __name__ == "__main__":
    main()
