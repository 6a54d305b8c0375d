"""Audits of what MuJoCo flies: steps, planted faults and clean runs, whose truth is what was planted."""

from __future__ import annotations

import json

import numpy as np
import pytest

import shapephase as sp
from support.flown_bodies import body_of, flown, noisy
from support.planted_faults import FAULTS, clean_run, faults_of_finding, planted, trajectory

TIGHT = 1e-6
"""Of runs without noise: their rates agree to some 1e-6 with their samples, 5 ms apart."""
THREE = ("diver", "satellite", "cat")
ORDERS = {"euler": 1.0, "implicit": 1.0, "rk4": 4.0}
STEPS = {"euler": (0.0005, 0.001, 0.002), "implicit": (0.0005, 0.001, 0.002), "rk4": (0.001, 0.002, 0.004)}


def check_order(name: str, integrator: str, duration: float, steps: tuple[float, ...]) -> None:
    runs = [
        trajectory(name, flown(name, seed=3, integrator=integrator, step=step, duration=duration), step=step)
        for step in steps
    ]
    found = sp.audit(body_of(name), runs, tolerance=1e-13)
    assert [one.name for one in found.cause] == ["integration step"], found.table()
    assert found.step_order is not None
    assert abs(found.step_order.order - ORDERS[integrator]) < 0.2


def test_the_step_is_named_with_its_order():
    check_order("diver", "rk4", 0.15, (0.001, 0.002))


@pytest.mark.full
@pytest.mark.parametrize("integrator", ORDERS)
@pytest.mark.parametrize("name", ["diver", "cat_two_halves", "satellite"])
def test_the_step_is_named_for_three_bodies(name: str, integrator: str):
    check_order(name, integrator, 0.8, STEPS[integrator])


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_named(fault: str):
    case = planted(fault, "diver", 1, 0.4)
    assert not faults_of_finding(case, sp.audit(case.body, case.trajectory, tolerance=TIGHT))


@pytest.mark.full
@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_named_in_nineteen_of_twenty(fault: str):
    bad = []
    for seed in range(20):
        case = planted(fault, THREE[seed % 3], seed)
        # A gust as strong as these may be taken for the ground; they are in the air all the time.
        found = sp.audit(case.body, case.trajectory, tolerance=TIGHT, flight="all")
        missed = faults_of_finding(case, found, 5 if fault == "mass" else 1)
        bad += [(THREE[seed % 3], seed, missed)] if missed else []
    print(f"{fault}: {20 - len(bad)} of 20", bad)
    assert len(bad) <= 1, bad


@pytest.mark.parametrize("rates", [True, False])
def test_a_clean_run_raises_no_alarm(rates: bool):
    body, run = clean_run("diver", "euler", 0, rates=rates)
    found = sp.audit(body, run)
    assert found.right, found.table()
    assert not found.hypotheses
    # Its noise is so large that without it the tolerance would not hold.
    assert found.runs[0].relative_drift > found.tolerance


@pytest.mark.full
@pytest.mark.parametrize("rates", [True, False])
def test_forty_five_clean_runs_raise_no_alarm(rates: bool):
    alarms = [
        (name, integrator, seed)
        for name in THREE
        for integrator in ORDERS
        for seed in range(5)
        if not sp.audit(*clean_run(name, integrator, seed, rates=rates)).right
    ]
    assert not alarms


def test_a_fault_is_seen_through_the_noise_and_its_rivals_are_named():
    """An arm that weighs a third more, in the noise of sensors."""
    motion = flown("diver", seed=3, step=0.001, every=5, duration=0.8, heavier={"left_arm": 1.33})
    sensors = noisy(motion, 1, turn=0.002, place=0.001, angle=0.001, rate=0.01)
    found = sp.audit(body_of("diver"), trajectory("diver", sensors))
    assert not found.right
    names = [one.name for one in found.cause]
    assert "mass of left_arm" in names
    fitted = next(one for one in found.cause if one.name == "mass of left_arm").values["mass"]
    assert abs(fitted.value - 33.0) < 4.0 * fitted.bar


def test_one_run_of_euler_is_consistent_with_a_step():
    motion = flown("diver", seed=3, integrator="euler", step=0.002, duration=0.3)
    found = sp.audit(body_of("diver"), trajectory("diver", motion, step=0.002))
    assert [one.name for one in found.cause] == ["integration step"]
    assert "consistent with" in found.cause[0].remark
    assert found.runs[0].agreement is not None
    assert found.runs[0].agreement.late == pytest.approx(0.001, rel=0.02)


def test_a_jump_is_audited_in_the_air_only():
    """On the ground the centre of mass rests; the momentum of what comes after take-off is that of the flight."""
    run = trajectory("diver", flown("diver", seed=2, step=0.001, every=5, duration=0.8))
    assert run.position is not None
    before = 60
    stand = {
        "times": np.concatenate([run.times[0] - 0.005 * np.arange(before, 0, -1), run.times]) + 0.3,
        "quaternion": np.vstack([np.tile(run.quaternion[0], (before, 1)), run.quaternion]),
        "shapes": np.vstack([np.tile(run.shapes[0], (before, 1)), run.shapes]),
        "position": np.vstack([np.tile(run.position[0], (before, 1)), run.position]),
    }
    found = sp.audit(body_of("diver"), sp.FloatingTrajectory(**stand))
    part = found.runs[0].airborne
    assert before - 2 <= part.first <= before + 20
    assert part.past == before + len(run.times)
    assert "+z" in part.how
    assert found.right, found.table()


def test_what_cannot_be_told_is_said():
    body = body_of("cat_two_halves")
    times = np.linspace(0.0, 1.0, 101)
    half = 0.5 * times
    about_z = np.column_stack([0.0 * half, 0.0 * half, np.sin(half), np.cos(half)])
    none = np.zeros((101, 3))
    spin = np.tile([0.0, 0.0, 1.0], (101, 1))
    run = sp.FloatingTrajectory(times=times, quaternion=about_z, shapes=none, rate=spin, joint_rates=none)
    notes = " ".join(sp.audit(body, run).notes)
    assert "about one axis alone" in notes
    assert "Joints" not in notes
    assert "joints change no momentum" in notes
    assert "Places are not given" in notes


def test_the_record_is_json_and_the_table_says_the_verdict():
    case = planted("mass", "diver", 1, 0.4)
    found = sp.audit(case.body, case.trajectory, tolerance=TIGHT)
    record = json.loads(json.dumps(found.record))
    assert record["cause"] == [case.cause]
    assert record["runs"][0]["samples"] == len(case.trajectory.times)
    assert found.table().endswith(found.verdict)


def test_a_recorder_in_a_running_loop_and_an_assertion():
    motion = flown("diver", seed=1, step=0.001, every=5, duration=0.3)
    recorder = sp.auditing.FlightRecorder(body_of("diver"), joint_names=motion.joint_names, step=0.001)
    for row in zip(motion.times, motion.qpos, motion.qvel, strict=True):
        recorder.add(*row)
    assert recorder.audit(tolerance=1e-5).right
    sp.auditing.assert_right_in_flight(body_of("diver"), recorder.trajectory(), tolerance=1e-5)
    case = planted("frame", "diver", 1, 0.3)
    with pytest.raises(AssertionError, match="angular velocity in world axes"):
        sp.auditing.assert_right_in_flight(case.body, case.trajectory)
    with pytest.raises(sp.errors.TrajectoryError, match="nothing was recorded"):
        sp.auditing.FlightRecorder(body_of("diver")).trajectory()
