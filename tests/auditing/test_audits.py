"""Audits of what MuJoCo flies: steps, planted faults and clean runs, whose truth is what was planted."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.errors import TrajectoryError
from support.ball_bodies import BALLS, ORDER, Hinges
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
    assert not found.wrong, found.table()
    assert not found.hypotheses
    # Its noise is so large that without it the tolerance would not hold.
    assert found.runs[0].relative_drift > found.tolerance
    assert not found.right
    assert found.verdict.split("; ")[-1].startswith("cannot tell")


@pytest.mark.full
@pytest.mark.parametrize("rates", [True, False])
def test_forty_five_clean_runs_raise_no_alarm(rates: bool):
    alarms = [
        (name, integrator, seed)
        for name in THREE
        for integrator in ORDERS
        for seed in range(5)
        if sp.audit(*clean_run(name, integrator, seed, rates=rates)).wrong
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
    recorder = sp.auditing.FlightRecorder(body_of("diver"), joint_names=motion.joint_names, integrator_step=0.001)
    for row in zip(motion.times, motion.qpos, motion.qvel, strict=True):
        recorder.add(*row)
    assert recorder.audit(tolerance=1e-5).right
    sp.auditing.assert_right_in_flight(body_of("diver"), recorder.trajectory(), tolerance=1e-5)
    case = planted("frame", "diver", 1, 0.3)
    with pytest.raises(AssertionError, match="world axes"):
        sp.auditing.assert_right_in_flight(case.body, case.trajectory)
    with pytest.raises(sp.errors.TrajectoryError, match="nothing"):
        sp.auditing.FlightRecorder(body_of("diver")).trajectory()


def moved_diver(times, momentum=(2.0, 12.0, 4.0)):
    """Joints of a diver, and its exact motion."""
    body = body_of("diver")
    turn = 2.0 * np.pi * times[:, None] / times[-1]
    shapes = np.array([1.2, -1.0]) + np.array([0.9, 0.6]) * np.sin(turn + np.array([0.0, 0.7]))
    path = sp.ShapePath.spline(times, shapes, periodic=False, joint_names=body.joint_names)
    return body, shapes, sp.reconstruct(sp.articulated(body, path), momentum)


def in_free_fall(times, centres):
    return centres + np.outer(3.0 * times - 0.5 * 9.81 * times**2, [0.0, 0.0, 1.0])


def test_a_body_that_walks_or_stands_is_nowhere_in_the_air():
    """Steps twice a second; and a sway of a centimetre about the feet, with arms that move."""
    body, times = body_of("diver"), np.arange(0.0, 8.0, 0.01)
    random = np.random.default_rng(0)
    arms = 0.4 * np.sin(2.0 * np.pi * times[:, None] + [0.0, 2.0]) + 1e-4 * random.normal(size=(len(times), 2))
    half = 0.05 * np.sin(2.0 * np.pi * times)
    yaw = np.column_stack([0.0 * half, 0.0 * half, np.sin(half), np.cos(half)])
    walk = np.column_stack([0.8 * times, 0.03 * np.sin(2.0 * np.pi * times), 0.9 + 0.02 * np.sin(4.0 * np.pi * times)])
    sway = 0.01 * np.column_stack([np.sin(2.0 * times), np.cos(1.3 * times), 90.0 + 0.0 * times])
    for places in (walk, sway):
        run = sp.FloatingTrajectory(times=times, quaternion=yaw, shapes=arms, position=places)
        with pytest.raises(TrajectoryError, match="nowhere"):
            sp.audit(body, run)


def test_an_engine_without_its_gyroscopic_term_is_named():
    """A rigid body whose angular velocity stays what it is, in world axes, as SciPy turns it.

    One with another centre turns so, too, where its fit comes out.
    """
    body, times, rate = body_of("cat_two_halves"), np.linspace(0.0, 1.2, 61), np.array([5.0, 0.4, 1.0])
    turned = (Rotation.from_rotvec(times[:, None] * rate) * Rotation.from_rotvec([0.3, 0.2, 0.1])).as_quat()
    still = np.tile([0.5, 0.2, 0.1], (61, 1))
    found = sp.audit(body, sp.FloatingTrajectory(times=times, quaternion=turned, shapes=still))
    causes = {one.kind: one for one in found.cause}
    assert {"engine"} <= set(causes) <= {"engine", "inertia"}
    fitted = [value.value for value in causes["engine"].values.values()]
    np.testing.assert_allclose(fitted, rate, rtol=1e-6)


def test_a_recording_of_a_person_is_held_to_what_can_be_known():
    """The centre of the trunk wanders by 6 mm, as markers on skin do: of a simulator that is wrong, of a person not."""
    times = np.linspace(0.0, 0.6, 73)
    body, shapes, motion = moved_diver(times)
    wander = 0.006 * np.sin(2.0 * np.pi * times[:, None] / 0.5 + [0.0, 1.0])
    given = {
        "times": times,
        "quaternion": so3.quat_from_matrix(motion.attitude(times)),
        "shapes": shapes + 4.0 * wander,
        "position": in_free_fall(times, motion.base_position(times)),
    }
    person = sp.audit(body, sp.FloatingTrajectory(**given, captured=True))
    assert person.right, person.table()
    assert 0.005 < person.runs[0].relative_drift < person.runs[0].tolerance
    drift = person.runs[0].momentum_drift / np.linalg.norm(motion.momentum)
    assert f"conserved within {100.0 * drift:.1g}" in person.verdict
    assert "falls with 9.8" in person.verdict
    assert not sp.audit(body, sp.FloatingTrajectory(**given)).right
    assert not sp.audit(body, sp.FloatingTrajectory(**given, captured=True), tolerance=1e-3).right


@pytest.mark.full
def test_what_no_body_can_have_is_no_hypothesis_and_a_star_leaves_a_fifth_at_most():
    """A torque of 30 N m from outside about the axis of the turn: the momentum doubles, which a trunk with a negative
    moment of inertia would explain."""
    times = np.linspace(0.0, 0.8, 73)
    body, shapes, motion = moved_diver(times, (0.0, 24.5, 0.0))
    path = sp.ShapePath.spline(times, shapes, periodic=False, joint_names=body.joint_names)
    pushed = sp.reconstruct(
        sp.articulated(body, path),
        motion.momentum,
        torque=sp.ExternalTorque(lambda _: [0.0, 30.0, 0.0], axes="space"),
    )
    run = sp.FloatingTrajectory(
        times=times, quaternion=so3.quat_from_matrix(pushed.attitude(times)), shapes=shapes, certain=("order", "units")
    )
    found = sp.audit(body, run)
    assert "torque from outside" in [one.name for one in found.cause], found.table()
    for one in found.hypotheses:
        assert one.kind != "units"
        for label, fitted in one.values.items():
            if label in ("mass", "both"):
                assert fitted.value > -100.0
    assert all(one.share <= 0.2 or one.left_over <= np.sqrt(2.0) for one in found.cause)


def test_ball_joints_are_audited(tmp_path):
    """A link that weighs a twentieth more, between ball joints."""
    (tmp_path / "balls.urdf").write_text(BALLS)
    body, times = sp.load_body(tmp_path / "balls.urdf"), np.linspace(0.0, 1.0, 61)
    angles = [0.8, 0.5, 0.7] * np.sin(times[:, None] * [6.0, 3.0, 5.0] + [[0.0, 1.0, 2.0]])
    shapes = np.hstack([Hinges.quaternions(angles), Hinges.quaternions(0.5 * angles[::-1]), 0.6 + angles[:, :1]])
    path = sp.ShapePath.spline(times, shapes, periodic=False, joint_names=ORDER)
    arm = next(part for part in body.moving_parts if part.links[0] == "arm")
    heavier = body.with_inertias(masses={"arm": 1.05 * arm.mass})
    for other, causes in ((body, []), (heavier, ["mass of arm"])):
        motion = sp.reconstruct(sp.articulated(other, path), [2.0, 5.0, 1.0], tolerance=1e-11)
        run = sp.FloatingTrajectory(
            times=times,
            quaternion=so3.quat_from_matrix(motion.attitude(times)),
            shapes=path.matched(body.joint_names, body.name).shape(times),
            position=in_free_fall(times, motion.base_position(times)),
        )
        assert [one.name for one in sp.audit(body, run).cause] == causes
