"""What a study computes is what a plain loop over public calls gives, to the last bit, whoever is computed together."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase import study as room
from shapephase.study._evaluate import DONE, Evaluator
from support.study_functions import bend, peak_rate

ENDS = ("final_attitude", "error_estimate", "turn")
ALL = (*ENDS, "evaluations", "montgomery_phase", "solid_angle", "residual", "holonomy", "is_loop")
MOMENTUM = room.Normal([0.0, 0.0, 0.01], 0.004)


def plain_loop(study):
    """One reconstruction and one split after the other, with nothing of the study but its numbers."""
    found = {name: [] for name in ALL}
    for index in range(study.cases):
        case = study.case(index)
        body = sp.load_body(case.body)
        path = bend(**case.parameters) if case.motion is bend else sp.examples.named_motion(case.motion)
        one = one_body(body, case)
        if one is body:
            motion = sp.reconstruct(sp.articulated(body, path), case.momentum, case.attitude, tolerance=case.tolerance)
        else:
            family = sp.articulated(one, path)
            motion = sp.reconstruct(family, case.momentum, case.attitude, tolerance=case.tolerance)[0]
        parts = sp.split(motion, case.gauge)
        found["final_attitude"].append(motion.final_attitude)
        found["error_estimate"].append(motion.error_estimate)
        found["turn"].append(sp.so3.angle(motion.initial_attitude.T @ motion.final_attitude))
        found["evaluations"].append(motion.evaluations)
        for name in ALL[4:]:
            found[name].append(getattr(parts, name))
    return {name: np.array(values, dtype=float) for name, values in found.items()}


def one_body(body, case):
    """A family of one body, or the body itself."""
    parts = body.moving_parts
    masses = np.array([part.mass for part in parts])
    centres = np.array([part.centre for part in parts])
    tensors = np.array([part.inertia for part in parts])
    given = {}
    if case.centres is not None:
        traces = np.array([0.5 * np.trace(part.inertia) for part in parts])
        gyration = np.sqrt(np.divide(traces, masses, out=np.zeros_like(masses), where=masses > 0.0))
        given["centres"] = (centres + gyration[:, None] * case.centres)[None]
    if case.masses is not None:
        tensors = case.masses[:, None, None] * tensors
        given |= {"masses": (case.masses * masses)[None], "inertias": tensors[None]}
    if case.inertias is not None:
        given["inertias"] = (case.inertias[:, None, None] * tensors)[None]
    return body.with_inertias(**given) if given else body


STUDIES = {
    "momenta": ("cat_two_halves", bend, {"momentum": MOMENTUM}, {"parameters": {"depth": 0.5}}),
    "attitudes": ("cat_two_halves", bend, {"attitude": room.Normal(0.0, 0.3)}, {"parameters": {"depth": 0.5}}),
    "paths": ("cat_two_halves", bend, {"depth": room.Uniform(0.3, 0.9), "gauge": ["base", "horizontal"]}, {}),
    "own paths": (
        "cat_two_halves",
        bend,
        {"depth": room.Uniform(0.3, 0.9), "momentum": MOMENTUM, "attitude": room.Normal(0.0, 0.3)},
        {},
    ),
    "inertias": (
        "cat_two_halves",
        bend,
        {"momentum": MOMENTUM, "masses": room.LogNormal(0.1), "inertias": room.LogNormal(0.1)},
        {"parameters": {"depth": 0.5}},
    ),
    "centres": (
        "cat_two_halves",
        bend,
        {"centres": room.Normal(0.0, 0.05), "tolerance": [1e-9, 1e-7]},
        {"parameters": {"depth": 0.5}},
    ),
    "bodies": ("cat", "astronaut_leg_swing", {"body": ["astronaut", "cat"]}, {}),
}


@pytest.mark.parametrize("outputs", [ENDS, ALL], ids=["ends", "all"])
@pytest.mark.parametrize("name", [name for name in STUDIES if name != "bodies"])
def test_a_study_is_a_plain_loop_to_the_last_bit(name, outputs):
    body, motion, over, more = STUDIES[name]
    more = {"momentum": [0.0, 0.0, 0.01], **more}
    study = room.Study(body, motion, over, outputs, draws=6 // max(1, 2 * (name in ("paths", "centres"))), **more)
    found, expected = Evaluator(study).together(np.arange(study.cases)), plain_loop(study)
    assert np.all(found["status"] == DONE), found["error_text"]
    for output in outputs:
        np.testing.assert_array_equal(found[output], expected[output], err_msg=output)


@pytest.mark.parametrize("name", ["momenta", "inertias", "paths", "own paths"])
def test_cases_do_not_depend_on_those_beside_them_nor_on_their_order(name):
    body, motion, over, more = STUDIES[name]
    study = room.Study(body, motion, over, ENDS, draws=12, momentum=[0.0, 0.0, 0.01], **more)
    evaluator, every = Evaluator(study), np.arange(12)
    whole = evaluator.together(every)
    for rows in (every[::-1], every[:1], every[3:8], np.array([7, 2, 11])):
        found = Evaluator(study).together(rows)
        for output in ENDS:
            np.testing.assert_array_equal(found[output], whole[output][rows])
    np.testing.assert_array_equal(evaluator.alone(5)["turn"], whole["turn"][5:6])


@pytest.mark.full
@pytest.mark.parametrize("name", list(STUDIES)[:-1])
def test_cases_have_the_bits_of_a_plain_loop(name):
    body, motion, over, more = STUDIES[name]
    draws = 60 // (2 if name in ("paths", "centres") else 1)
    study = room.Study(body, motion, over, ENDS, draws=draws, momentum=[0.0, 0.0, 0.01], **more)
    found, expected = Evaluator(study).together(np.arange(60)), plain_loop(study)
    for output in ENDS:
        np.testing.assert_array_equal(found[output], expected[output], err_msg=output)
    for rows in (np.arange(60)[::-1], np.arange(7, 31)):
        again = Evaluator(study).together(rows)
        np.testing.assert_array_equal(again["final_attitude"], found["final_attitude"][rows])


def test_a_list_of_bodies_whose_joints_do_not_fit_is_data():
    body, motion, over, more = STUDIES["bodies"]
    found = Evaluator(room.Study(body, motion, over, ENDS, **more)).together(np.arange(2))
    assert found["status"].tolist() == [room.STATUS["done"], room.STATUS["raised"]]
    assert bytes(found["error_name"][1]).rstrip(b"\0") == b"UnknownNameError"
    assert b"unknown joint" in bytes(found["error_text"][1])
    assert np.isfinite(found["turn"][0])
    assert np.isnan(found["final_attitude"][1]).all()


def test_a_function_of_the_motion_is_an_output():
    over = {"momentum": MOMENTUM}
    output = room.Output("peak", peak_rate, unit="rad/s")
    study = room.Study("cat_two_halves", bend, over, (output, "turn"), draws=3, parameters={"depth": 0.5})
    found = Evaluator(study).together(np.arange(3))
    deformation = sp.articulated(sp.load_body("cat_two_halves"), bend(0.5))
    expected = [peak_rate(sp.reconstruct(deformation, study.case(index).momentum)) for index in range(3)]
    np.testing.assert_array_equal(found["peak"], expected)
    wrong = room.Study(
        "cat_two_halves", bend, over, (room.Output("peak", peak_rate, shape=(2,)),), parameters={"depth": 0.5}
    )
    assert Evaluator(wrong).alone(0)["status"][0] == room.STATUS["raised"]


def test_a_rigid_body_is_that_of_rigid():
    inertia = np.diag([1.0, 2.0, 2.5])
    study = room.Study(room.RigidBody(inertia, 3.0), over={"momentum": room.Directions(1.0)}, draws=20)
    found = Evaluator(study).together(np.arange(20))
    deformation = sp.rigid(inertia, 3.0)
    for index in range(20):
        one = sp.reconstruct(deformation, study.case(index).momentum)
        np.testing.assert_array_equal(found["final_attitude"][index], one.final_attitude)


def test_noise_of_the_joints_moves_the_samples_of_a_recording(tmp_path):
    """The spread of the end is that of `uncertainty`, to a quarter, with 100 draws: more than three standard errors."""
    body = sp.load_body("cat_two_halves")
    sp.write_shape_path(bend(0.5), tmp_path / "bend.csv", np.linspace(0.0, 1.0, 13))
    study = room.Study(
        "cat_two_halves", tmp_path / "bend.csv", {"joint_noise": [1e-4]}, ENDS, draws=100, tolerance=1e-6, seed=1
    )
    found = Evaluator(study).together(np.arange(100))["final_attitude"]
    path = sp.read_shape_path(tmp_path / "bend.csv", body)
    motion = sp.reconstruct(sp.articulated(body, path), np.zeros(3))
    expected = np.sqrt(np.diag(sp.uncertainty(motion, joints=1e-4).final_attitude))
    turns = sp.so3.log(found @ motion.final_attitude.T)
    np.testing.assert_allclose(turns.std(axis=0), expected, rtol=0.25)


def test_a_study_of_before_names_the_tilt_of_the_closing_as_it_did():
    """A name of an output that has another now, in study files and in the arrays of their stores."""
    study = sp.study.Study("cat_two_halves", "cat_righting", {"momentum_z": [0.1]}, outputs=("tilt", "closing_tilt"))
    former, named = study.resolved_outputs
    assert (former.name, former.shape, named.name) == ("tilt", (3, 3), "closing_tilt")
    body = sp.load_body("cat_two_halves")
    motion = sp.reconstruct(sp.articulated(body, sp.examples.kane_scher(0.3, 0.5)), [0.0, 0.01, 0.02])
    parts = sp.split(motion)
    axis = np.array([0.0, 0.01, 0.02]) / np.hypot(0.01, 0.02)
    whole = sp.so3.exp(float(parts.montgomery_phase) * axis) @ former.of(motion, parts) @ parts.holonomy
    np.testing.assert_allclose(whole, parts.total_rotation, rtol=0, atol=1e-9)
