"""Audits of flights in which something else acts: a floor at the end, air, another gravity, joints read off zero."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

import shapephase as sp
from support.flown_bodies import body_of, flown, noisy
from support.independent import floating_urdf
from support.landings import landing
from support.long_runs import full_but
from support.planted_faults import trajectory

TIGHT = 1e-6
"""Of runs without noise."""
SENSORS = {"turn": 0.002, "place": 0.001, "angle": 0.001, "rate": 0.01}
"""Noise of sensors [rad, m, rad, rad/s]."""
LANDINGS = [
    ("diver", "rk4", 0.001, 5, 0.85),
    ("diver", "rk4", 0.001, 1, 0.893),
    ("diver", "implicit", 0.001, 10, 0.87),
    ("satellite", "rk4", 0.001, 2, 0.88),
    ("satellite", "euler", 0.001, 5, 0.895),
    ("cat", "rk4", 0.001, 5, 0.87),
    ("cat", "rk4", 0.002, 10, 0.86),
    ("astronaut", "rk4", 0.001, 5, 0.89),
    ("example:human", "rk4", 0.002, 2, 0.88),
]
"""Body, integrator, step, steps between samples, and when it lands, of 0.9 s."""


def _flight(name: str, seed: int = 1, *, duration: float = 0.6, **more) -> sp.FloatingTrajectory:
    return trajectory(name, flown(name, seed=seed, step=0.001, every=5, duration=duration, **more))


@pytest.mark.parametrize(("name", "integrator", "step", "every", "lands"), full_but(LANDINGS, *LANDINGS[2::3]))
def test_a_landing_is_audited_up_to_first_contact(name: str, integrator: str, step: float, every: int, lands: float):
    flight = landing(name, seed=3, lands=lands, duration=0.9, integrator=integrator, step=step, every=every)
    found = sp.audit(body_of(name), trajectory(name, flight.motion, step=step), tolerance=0.01)
    run = found.runs[0]
    assert run.last_time <= flight.last_free + 1e-9
    # No more is lost than what ended a flight before: a contact that is unseen below the wander of a recording.
    assert run.last_time >= flight.last_free - max(0.035, 2 * step * every)
    assert run.first_time == 0.0
    assert found.right, found.table()


def test_a_landing_within_noise_is_audited_up_to_first_contact():
    """Velocities show it where places, known to a millimetre, do not yet."""
    flight = landing("diver", seed=3, lands=0.89, duration=0.9, step=0.001, every=5)
    run = trajectory("diver", noisy(flight.motion, 1, **SENSORS))
    found = sp.audit(body_of("diver"), run)
    assert found.runs[0].last_time <= flight.last_free
    assert not found.wrong, found.table()


@pytest.mark.parametrize("name", ["diver", "satellite"])
def test_a_take_off_is_audited_from_last_contact(name: str):
    """A landing backwards in time."""
    flight = landing(name, seed=3, lands=0.88, duration=0.9, step=0.001, every=5)
    run = trajectory(name, flight.motion)
    backwards = {
        field: factor * getattr(run, field)[::-1]
        for factor, fields in ((1.0, ("quaternion", "shapes", "position")), (-1.0, ("rate", "velocity", "joint_rates")))
        for field in fields
    }
    run = replace(run, times=run.times[-1] - run.times[::-1], **backwards)
    found = sp.audit(body_of(name), run)
    assert run.times[-1] - flight.last_free - 1e-9 <= found.runs[0].first_time <= 0.1
    assert found.runs[0].last_time == run.times[-1]
    assert found.right, found.table()


@pytest.mark.parametrize(("name", "seed"), [("diver", 1), ("satellite", 2), ("cat", 3)])
def test_a_flight_without_contact_is_audited_whole(name: str, seed: int):
    for run in (_flight(name, seed), _flight(name, seed, gravity=0.0)):
        found = sp.audit(body_of(name), run)
        assert (found.runs[0].first_time, found.runs[0].last_time) == (run.times[0], run.times[-1])


@pytest.mark.parametrize("name", full_but(["diver", "satellite"], "diver"))
@pytest.mark.parametrize(("density", "viscosity"), full_but([(1.2, 0.0), (0.0, 1.0), (5.0, 1.0)], (5.0, 1.0)))
def test_a_fluid_of_mujoco_is_named_with_its_density_and_viscosity(name: str, density: float, viscosity: float):
    def fluid(model: mujoco.MjModel, _: mujoco.MjData) -> None:
        model.opt.density, model.opt.viscosity = density, viscosity

    run = _flight(name, duration=0.8, watch=fluid)
    found = sp.audit(body_of(name), run, tolerance=TIGHT, flight="all")
    assert [one.kind for one in found.cause] == ["drag"], found.table()
    values = {label: fitted.value for label, fitted in found.cause[0].values.items()}
    assert values.get("density", 0.0) == pytest.approx(density, rel=2e-3)
    assert values.get("viscosity", 0.0) == pytest.approx(viscosity, rel=2e-3, abs=1e-3)


@pytest.mark.parametrize("sensors", [pytest.param(None, marks=pytest.mark.full), SENSORS])
def test_a_force_against_the_velocity_is_named_with_its_arm(sensors: dict[str, float] | None):
    """A quarter of the weight at 5 m/s, at a point beside the centre of mass, and a torque against the turn."""
    drag, turning, arm = 0.2, 0.001, np.array([0.02, 0.0, 0.01])

    def slow(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        mujoco.mj_subtreeVel(model, data)
        velocity, turn = data.subtree_linvel[1], data.xmat[1].reshape(3, 3)
        force = -drag * np.linalg.norm(velocity) * velocity
        from_base = data.subtree_com[1] + turn @ arm - data.xipos[1]
        data.xfrc_applied[1] = np.concatenate([force, np.cross(from_base, force) - turning * turn @ data.qvel[3:6]])

    motion = flown("cat", seed=1, step=0.001, every=5, duration=0.8, watch=slow)
    run = trajectory("cat", motion if sensors is None else noisy(motion, 1, **sensors))
    found = sp.audit(body_of("cat"), run, tolerance=TIGHT, flight="all")
    assert found.cause[0].kind == "drag", found.table()
    fitted = found.cause[0].values
    # Without noise the velocity is known to some 1e-3.
    for label, truth, off in (("quadratic", drag, 2e-3), ("turn", turning, 1e-5), ("centre of pressure x", 0.02, 2e-4)):
        assert abs(fitted[label].value - truth) <= (off if sensors is None else 4.0 * fitted[label].bar)


@pytest.mark.parametrize(("name", "joint"), full_but([("diver", 1), ("cat", 3), ("satellite", 2)], ("satellite", 2)))
def test_an_offset_of_a_joint_is_named_with_its_size(name: str, joint: int):
    body, run, offset = body_of(name), _flight(name), float(np.radians(2.0))
    run = replace(run, shapes=run.shapes + offset * np.eye(body.n_shape)[joint])
    found = sp.audit(body, run, tolerance=TIGHT)
    assert [one.name for one in found.cause] == [f"offset of joint {body.joint_names[joint]}"], found.table()
    fitted = found.cause[0].values["offset"]
    assert fitted.value == pytest.approx(offset, rel=1e-3)
    assert fitted.unit == "rad"
    assert "+2 degrees" in found.cause[0].remark


@pytest.mark.full
def test_an_offset_within_noise_is_in_the_tie_with_its_bar():
    body = body_of("diver")
    motion = noisy(flown("diver", seed=1, step=0.001, every=5, duration=0.8), 1, **SENSORS)
    run = trajectory("diver", motion)
    found = sp.audit(body, replace(run, shapes=run.shapes + np.radians([0.0, 4.0])), tolerance=TIGHT)
    offsets = {one.name: one.values["offset"] for one in found.cause if one.kind == "offset"}
    fitted = offsets["offset of joint right_shoulder_abduction"]
    assert abs(fitted.value - np.radians(4.0)) < 4.0 * fitted.bar


@pytest.mark.parametrize("sensors", [None, SENSORS])
@pytest.mark.parametrize(("gravity", "right"), [(9.81, True), (9.79, True), (9.5, False), (10.0, False)])
def test_gravity_is_named_with_its_size(gravity: float, right: bool, sensors: dict[str, float] | None):
    motion = flown("diver", seed=1, step=0.001, every=5, duration=0.8, gravity=gravity)
    found = sp.audit(body_of("diver"), trajectory("diver", motion if sensors is None else noisy(motion, 1, **sensors)))
    assert found.wrong is not right, found.table()
    assert [one.name for one in found.cause] == ([] if right else ["gravity"])
    for cause in found.cause:
        assert abs(cause.values["size"].value - gravity) <= 4.0 * cause.values["size"].bar + 1e-9
        assert cause.values["tilt"].value < 0.2


@pytest.mark.parametrize("gravity", full_but([1.62, 3.7], 1.62))
def test_weak_gravity_is_named_through_noise(gravity: float):
    """On the moon a body of 1 s falls through 0.8 m, which noise of millimetres does not hide."""
    for seed in range(3):
        motion = noisy(flown("diver", seed=seed, step=0.001, every=5, duration=0.8, gravity=gravity), seed, **SENSORS)
        found = sp.audit(body_of("diver"), trajectory("diver", motion))
        assert [one.name for one in found.cause] == ["gravity"], found.table()
        assert (found.runs[0].first_time, found.runs[0].last_time) == (0.0, pytest.approx(0.8))


def test_gravity_in_another_direction_is_named():
    def tilted(model: mujoco.MjModel, _: mujoco.MjData) -> None:
        model.opt.gravity[:] = 9.81 * np.array([np.sin(0.05), 0.0, -np.cos(0.05)])

    found = sp.audit(body_of("diver"), _flight("diver", watch=tilted))
    assert found.cause[0].values["tilt"].value == pytest.approx(np.degrees(0.05), rel=1e-3)
    upwards = sp.audit(body_of("diver"), _flight("diver", gravity=-9.81))
    assert "towards +z" in upwards.cause[0].remark
    assert sp.audit(body_of("diver"), _flight("diver", gravity=0.0)).right


def _heavier(name: str, link: str, factor: float) -> mujoco.MjModel:
    """The body with one link of its file heavier, which MuJoCo merges with what it is fixed on."""
    root = ElementTree.fromstring(floating_urdf(name))
    inertial = next(one for one in root.findall("link") if one.get("name") == link).find("inertial")
    assert inertial is not None
    for element in inertial:
        for key in {"value", "ixx", "iyy", "izz", "ixy", "ixz", "iyz"}.intersection(element.keys()):
            element.set(key, str(factor * float(element.get(key, "0"))))
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))


@pytest.mark.parametrize(
    ("link", "part", "percent"),
    [
        pytest.param("dish", "boom with dish (fixed)", 10.0 * 4.0 / 7.0, marks=pytest.mark.full),
        ("left_panel_3", "left_panel_1 with left_panel_2, left_panel_3 (fixed)", 10.0 / 3.0),
    ],
)
def test_a_heavier_link_that_is_fixed_on_another_is_named_with_it(link: str, part: str, percent: float):
    run = _flight("satellite", 2, duration=0.8, model=_heavier("satellite", link, 1.1))
    found = sp.audit(body_of("satellite"), run, tolerance=TIGHT)
    assert [one.name for one in found.cause] == [f"mass, centre and inertia of {part}"], found.table()
    assert found.cause[0].values["mass"].value == pytest.approx(percent, rel=1e-4)
    assert link in found.cause[0].remark


def test_links_that_rest_against_each_other_are_one_part():
    """A joint of the arm does not move: what is beyond it cannot be told from what is before it."""
    body, times = body_of("satellite"), np.linspace(0.0, 1.0, 101)
    joint = body.joint_names.index("arm_5")
    shapes = 0.4 * np.sin(5.0 * times[:, None] + np.arange(body.n_shape)) * (np.arange(body.n_shape) != joint)
    path = sp.ShapePath.spline(times, shapes, periodic=False, joint_names=body.joint_names)
    beyond = next(part for part in body.moving_parts if part.links[0] == "arm_link_5")
    heavier = body.with_inertias(masses={"arm_link_5": 1.1 * beyond.mass}, centres={"arm_link_5": beyond.centre + 0.05})
    motion = sp.reconstruct(sp.articulated(heavier, path), [3.0, 8.0, 5.0], tolerance=1e-11)
    run = sp.FloatingTrajectory(
        times=times,
        quaternion=sp.so3.quat_from_matrix(motion.attitude(times)),
        shapes=shapes,
        certain=("order", "units"),
    )
    found = sp.audit(body, run, tolerance=1e-7)
    name = "mass, centre and inertia of arm_link_4 with arm_link_5 (fixed or at rest)"
    assert name in [one.name for one in found.cause], found.table()
