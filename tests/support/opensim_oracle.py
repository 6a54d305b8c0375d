"""What OpenSim has of a model at shapes, and its own floating motions: a script for a process without CasADi.

Coupled coordinates are put where OpenSim's own assembly has them; rates are the slopes of its functions. Motions are
integrated by OpenSim, without gravity, its coordinates prescribed by sines; it knows of no conserved momentum. Where
one coordinate drives three turns of a joint, as in knees, the accelerations of OpenSim 4.6 do not conserve it, by parts
in a thousand: there its momentum, which is right, is kept by SciPy.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from math import cos, sin
from pathlib import Path
from typing import Any

_ACCURACY = 1e-11
"""Of OpenSim's integrator."""


def asked(model: Path, base: str, shapes: list[dict[str, float]], rates: list[dict[str, float]]) -> list[dict]:
    """For each shape I and L_o about the centre of mass and poses of the bodies, axes of the base; and couplings.

    Coordinates of the base among them count: `momentum` is that of the floating motion, in axes of the base, `omega`
    the base's rate in them.
    """
    return _answered({"model": str(model), "base": base, "shapes": shapes, "rates": rates})


def flown(
    model: Path,
    base: str,
    waves: dict[str, list[float]],
    start: dict[str, list[float]],
    times: list[float],
    turns: tuple[str, ...] = (),
) -> list[dict]:
    """At times the attitude of the base and the momentum in the axes of the ground, of OpenSim's own motion.

    waves : of each driven coordinate middle, amplitude, frequency [rad/s] and phase of its sine
    start : of coordinates of the base value and speed
    turns : the base's angles, where these are to keep OpenSim's momentum; none: OpenSim integrates
    """
    question = {"model": str(model), "base": base, "waves": waves, "start": start, "times": times}
    return _answered(question | {"turns": turns})


def replayed(model: Path, motion: Path, bodies: list[str]) -> dict:
    """Times (N,) of a file of motion, and for each body its poses in the ground (N, 4, 4), as nested lists."""
    return _answered({"model": str(model), "motion": str(motion), "bodies": bodies})


def _answered(question: dict) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        command = [sys.executable, __file__, str(answer)]
        subprocess.run(
            command, input=json.dumps(question).encode(), check=True, timeout=120, cwd=folder, capture_output=True
        )
        return json.loads(answer.read_text())


def main() -> None:
    import opensim

    opensim.Logger.setLevelString("Off")
    question = json.loads(sys.stdin.read())
    model = opensim.Model(question["model"])
    answering = _at_shapes if "shapes" in question else _replayed if "motion" in question else _flown
    found = answering(opensim, model, question)
    Path(sys.argv[1]).write_text(json.dumps(found))
    # What OpenSim takes down at the end may crash, and nothing of it is needed.
    os._exit(0)


def _three(vector) -> list[float]:
    return [vector.get(k) for k in range(3)]


def _turn(body, state) -> list[list[float]]:
    matrix = body.getTransformInGround(state).R().asMat33()
    return [[matrix.get(i, j) for j in range(3)] for i in range(3)]


def _follow(opensim, model, state, known) -> list[str]:
    """Put coupled coordinates where the functions have them, with their speeds; their names."""
    constraints, names = model.getConstraintSet(), []
    for k in range(constraints.getSize()):
        one = opensim.CoordinateCouplerConstraint.safeDownCast(constraints.get(k))
        drivers = [
            known[one.getIndependentCoordinateNames().get(j)]
            for j in range(one.getIndependentCoordinateNames().getSize())
        ]
        where, speed = opensim.Vector(len(drivers), 0.0), 0.0
        for j, driver in enumerate(drivers):
            where.set(j, driver.getValue(state))
        for j, driver in enumerate(drivers):
            which = opensim.StdVectorInt()
            which.append(j)
            speed += one.getFunction().calcDerivative(which, where) * driver.getSpeedValue(state)
        names.append(one.getDependentCoordinateName())
        known[names[-1]].setValue(state, one.getFunction().calcValue(where), False)
        known[names[-1]].setSpeedValue(state, speed)
    return names  # fmt: skip


def _flown(opensim, model, question) -> list[dict]:
    model.setGravity(opensim.Vec3(0.0, 0.0, 0.0))
    coordinates = model.updCoordinateSet()
    known = {coordinates.get(k).getName(): coordinates.get(k) for k in range(coordinates.getSize())}
    for name, (middle, size, frequency, phase) in question["waves"].items():
        known[name].setPrescribedFunction(opensim.Sine(size, frequency, phase, middle))
        known[name].setDefaultIsPrescribed(not question["turns"])
    state = model.initSystem()
    for name, (value, speed) in (_driven(question["waves"], 0.0) | question["start"]).items():
        known[name].setValue(state, value, False)
        known[name].setSpeedValue(state, speed)
    _follow(opensim, model, state, known)
    if question["turns"]:
        return _kept(opensim, model, state, known, question)
    manager = opensim.Manager(model)
    manager.setIntegratorAccuracy(_ACCURACY)
    manager.initialize(state)
    root, found = model.getBodySet().get(question["base"]), []
    for time in question["times"]:
        if time > 0.0:
            state = manager.integrate(time)
        model.realizeVelocity(state)
        found.append({"attitude": _turn(root, state), "momentum": _momentum(model, state)})
    return found


def _driven(waves, time: float) -> dict[str, tuple[float, float]]:
    return {
        name: (middle + size * sin(frequency * time + phase), size * frequency * cos(frequency * time + phase))
        for name, (middle, size, frequency, phase) in waves.items()
    }


def _momentum(model, state) -> list[float]:
    # A part of it does not live longer than the whole.
    both = model.getMatterSubsystem().calcSystemCentralMomentum(state)
    return _three(both.get(0))


def _kept(opensim, model, state, known, question) -> list[dict]:
    """The base's angles in time at which OpenSim's momentum is what it was at the start."""
    import numpy as np
    from scipy.integrate import solve_ivp

    model.realizeVelocity(state)
    momentum, turns = np.array(_momentum(model, state)), question["turns"]

    def put(time, angles) -> None:
        driven = _driven(question["waves"], time)
        for name, value in (driven | dict(zip(turns, zip(angles, (0.0,) * 3), strict=True))).items():
            known[name].setValue(state, value[0], False)
            known[name].setSpeedValue(state, value[1])
        _follow(opensim, model, state, known)
        model.realizeVelocity(state)

    def speeds(time, angles):
        put(time, angles)
        internal, columns = np.array(_momentum(model, state)), []
        for name in turns:
            known[name].setSpeedValue(state, 1.0)
            model.realizeVelocity(state)
            columns.append(_momentum(model, state) - internal)
            known[name].setSpeedValue(state, 0.0)
        return np.linalg.solve(np.transpose(columns), momentum - internal)

    first = [question["start"][name][0] for name in turns]
    span = (0.0, question["times"][-1])
    run = solve_ivp(speeds, span, first, "DOP853", question["times"], rtol=1e-11, atol=1e-11)
    root, found = model.getBodySet().get(question["base"]), []
    for time, angles in zip(run.t, run.y.T, strict=True):
        put(time, angles)
        found.append({"attitude": _turn(root, state), "momentum": momentum.tolist()})
    return found


def _replayed(opensim, model, question) -> dict:
    rows, state = opensim.Storage(question["motion"]), model.initSystem()
    assert not rows.isInDegrees()
    labels, coordinates = rows.getColumnLabels(), model.getCoordinateSet()
    found = {"times": [], "poses": {name: [] for name in question["bodies"]}}
    for k in range(rows.getSize()):
        row = rows.getStateVector(k)
        found["times"].append(row.getTime())
        for column in range(1, labels.getSize()):
            coordinates.get(labels.get(column)).setValue(state, row.getData().get(column - 1), False)
        model.realizePosition(state)
        for name, poses in found["poses"].items():
            body = model.getBodySet().get(name)
            places = _three(body.getTransformInGround(state).p())
            rows_of_pose = [[*turned, place] for turned, place in zip(_turn(body, state), places)]
            poses.append([*rows_of_pose, [0.0, 0.0, 0.0, 1.0]])
    return found


def _at_shapes(opensim, model, question) -> list[dict]:
    import numpy as np

    state = model.initSystem()
    matter, bodies, coordinates = model.getMatterSubsystem(), model.getBodySet(), model.getCoordinateSet()
    known = {coordinates.get(k).getName(): coordinates.get(k) for k in range(coordinates.getSize())}

    def pose(body):
        found = np.eye(4)
        found[:3, :3], found[:3, 3] = _turn(body, state), _three(body.getTransformInGround(state).p())
        return found

    found = []
    for shape, rate in zip(question["shapes"], question["rates"], strict=True):
        for name, value in shape.items():
            known[name].setValue(state, value, False)
        model.assemble(state)
        assembled = {name: one.getValue(state) for name, one in known.items()}
        # Assembly moves the independent ones, too, by what it is accurate to.
        for name, value in shape.items():
            known[name].setValue(state, value, False)
        for name, speed in rate.items():
            known[name].setSpeedValue(state, speed)
        names = _follow(opensim, model, state, known)
        model.realizeVelocity(state)
        body = bodies.get(question["base"])
        root = pose(body)
        turn = root[:3, :3]
        inertia, momentum = matter.calcSystemCentralInertiaInGround(state), matter.calcSystemCentralMomentum(state)
        (xx, yy, zz), (xy, xz, yz) = _three(inertia.getMoments()), _three(inertia.getProducts())
        poses = {bodies.get(k).getName(): np.linalg.solve(root, pose(bodies.get(k))) for k in range(bodies.getSize())}
        found.append(
            {
                "mass": matter.calcSystemMass(state),
                "centre": (
                    turn.T @ (_three(matter.calcSystemMassCenterLocationInGround(state)) - root[:3, 3])
                ).tolist(),
                "inertia": (turn.T @ [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]] @ turn).tolist(),
                "momentum": (turn.T @ _three(momentum.get(0))).tolist(),
                "omega": (turn.T @ _three(body.getAngularVelocityInGround(state))).tolist(),
                "poses": {name: one.tolist() for name, one in poses.items()},
                "assembled": {name: assembled[name] for name in names},
                "dependent": {name: known[name].getValue(state) for name in names},
            }
        )
    return found


if __name__ == "__main__":
    main()
