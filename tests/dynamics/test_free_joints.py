"""Free hinges and spinning wheels against MuJoCo's floating base, which knows of no conservation law."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import shapephase as sp
from shapephase import so3
from shapephase.errors import ShapeError, TrajectoryError, UnknownNameError
from support.bodies import joint, link, urdf
from support.independent import FourierLoop, apart, quaternion_rate, random_rotation, random_vector
from support.random_chains import random_chain, wheel_chain

TIMES = np.linspace(0.0, 1.5, 7)


def mujoco_swing(chain, loop, driven, free, start, momentum, attitude):
    """Attitudes and free joints at TIMES: forces and prescribed accelerations only; momentum enters at the start."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(chain.mjcf)
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    at = {name: int(np.ravel(model.joint(name).qposadr)[0]) for name in chain.names}
    moving = {name: int(np.ravel(model.joint(name).dofadr)[0]) for name in chain.names}
    held, loose = [moving[name] for name in driven], [moving[name] for name in free]
    count = len(free)

    def placed(t, state):
        data.qpos[3:7] = np.roll(state[:4] / np.linalg.norm(state[:4]), 1)
        data.qpos[[at[name] for name in driven]] = loop.shape(t)
        data.qpos[[at[name] for name in free]] = state[4 : 4 + count]
        data.qvel[:3], data.qvel[3:6] = state[-6:-3], state[-3:]
        data.qvel[held], data.qvel[loose] = loop.rate(t), state[4 + count : 4 + 2 * count]
        mujoco.mj_forward(model, data)
        mass = np.zeros((model.nv, model.nv))
        for row, one in zip(mass, np.eye(model.nv), strict=True):
            mujoco.mj_mulM(model, data, row, one)
        return mass

    def slope(t, state):
        mass = placed(t, state)
        unknown = [*range(6), *loose]
        known = mass[np.ix_(unknown, held)] @ loop.acceleration(t) + data.qfrc_bias[unknown]
        found = np.linalg.solve(mass[np.ix_(unknown, unknown)], -known)
        turning = quaternion_rate(state[:4], state[-3:])
        return np.concatenate([turning, state[4 + count : 4 + 2 * count], found[6:], found[:6]])

    shapes, rates = np.array(start).T
    first = np.concatenate([sp.so3.quat_from_matrix(attitude), shapes, rates, np.zeros(6)])
    mass = placed(0.0, first)
    # The spin of the base at the start, so that MuJoCo's own sum over the links is the momentum.
    moved = []
    for turn in (np.zeros(3), *np.eye(3)):
        first[-3:] = turn
        placed(0.0, first)
        first[-6:-3] = 0.0
        mujoco.mj_subtreeVel(model, data)
        moved.append(data.subtree_angmom[1].copy())
    first[-3:] = np.linalg.solve((np.array(moved[1:]) - moved[0]).T, momentum - moved[0])
    placed(0.0, first)
    first[-6:-3] = -np.linalg.solve(mass[:3, :3], mass[:3, 3:] @ data.qvel[3:])
    run = solve_ivp(slope, (0.0, TIMES[-1]), first, "DOP853", t_eval=TIMES, rtol=1e-11, atol=1e-12)
    return (
        sp.so3.matrix_from_quat(sp.so3.normalised(run.y[:4].T)),
        run.y[4 : 4 + count].T,
        run.y[4 + count : 4 + 2 * count].T,
    )


def loop_of(seed, count):
    rng = np.random.default_rng([11, seed])
    cosines, sines = rng.uniform(-0.4, 0.4, (2, count, 2)) / np.arange(1, 3)
    return FourierLoop(rng.uniform(-0.3, 0.3, count), cosines, sines, float(TIMES[-1]))


@pytest.fixture(scope="module")
def load(tmp_path_factory):
    def loaded(text):
        file = tmp_path_factory.mktemp("body") / "body.urdf"
        file.write_text(text)
        return sp.load_body(file)

    return loaded


def fourier(loop, names):
    return sp.ShapePath.fourier(loop.mean, loop.cosines, loop.sines, loop.duration, joint_names=names)


@pytest.mark.parametrize("seed", [1, pytest.param(3, marks=pytest.mark.full), pytest.param(5, marks=pytest.mark.full)])
def test_free_hinges_swing_as_in_mujoco(load, seed):
    chain = random_chain(seed)
    body = load(chain.urdf)
    free = {"j0": (0.3, 1.1), "j1": (0.02, -0.3)}
    driven = [name for name in body.joint_names if name not in free]
    loop, momentum, attitude = loop_of(seed, len(driven)), random_vector(seed, 1.0), random_rotation(seed)
    found = sp.free_hinges(body, fourier(loop, driven), free, momentum, attitude, tolerance=1e-8)
    turned, swung, _ = mujoco_swing(chain, loop, driven, list(free), list(free.values()), momentum, attitude)
    columns = [body.joint_index(name) for name in free]
    assert apart(found.motion.attitude(TIMES), turned) < 1e-8
    np.testing.assert_allclose(found.path.shape(TIMES)[:, columns], swung, rtol=0, atol=1e-8)
    assert np.ptp(swung, axis=0).min() > 0.05, "they must swing"
    assert found.error_estimate < 1e-7
    efforts = sp.joint_torques(found.motion, TIMES[1:-1]).torque
    assert np.abs(efforts[:, columns]).max() < 1e-5 * np.abs(efforts).max(), "nothing drives them"
    parts = sp.split(found.motion)
    assert parts.residual < 1e-7


@pytest.mark.parametrize("seed", [2, pytest.param(4, marks=pytest.mark.full), pytest.param(6, marks=pytest.mark.full)])
def test_a_spinning_wheel_on_a_gimbal_turns_the_body_as_in_mujoco(load, seed):
    """A control-moment gyroscope: a hinge and a slide carry the wheel about; its momentum stays, its speed does not."""
    chain = wheel_chain(seed)
    body = load(chain.urdf)
    loop, momentum, attitude = loop_of(seed, 2), random_vector(seed, 0.5), random_rotation(seed)
    wheel = 1.3
    deformation = sp.articulated(body, fourier(loop, ["j0", "j1"]), rotors={"j2": wheel})
    motion = sp.reconstruct(deformation, momentum, attitude)
    spins = sp.dynamics.wheel_speeds(motion, TIMES)[:, 0]
    turned, _, spinning = mujoco_swing(chain, loop, ["j0", "j1"], ["j2"], [(0.0, spins[0])], momentum, attitude)
    assert apart(motion.attitude(TIMES), turned) < 1e-8
    np.testing.assert_allclose(spins, spinning[:, 0], rtol=0, atol=1e-8 * wheel / 0.05)
    assert np.ptp(spins) > 0.1
    stopped = sp.articulated(body, fourier(loop, ["j0", "j1"]), rotor_speeds={"j2": 0.0})
    still = sp.reconstruct(stopped, momentum, attitude)
    assert apart(still.attitude(TIMES), turned) > 0.1, "the wheel must matter"


@pytest.mark.parametrize(("kind", "value"), [("rotors", 1.3), ("rotor_speeds", 9.0)])
def test_the_holonomy_of_a_body_with_wheels_is_what_its_pace_does_not_change(load, kind, value):
    """What wheels store turns the body longer in a slower loop, and stands apart from what the shape does."""
    body = load(wheel_chain(2).urdf)
    path, momentum, start = fourier(loop_of(2, 2), ["j0", "j1"]), random_vector(2, 0.5), random_rotation(2)
    splits = []
    for factor, size in ((1.0, 0.0), (3.0, 0.0), (1.0, 1.0), (2.0, 1.0)):
        deformation = sp.articulated(body, path.stretched(factor), **{kind: {"j2": value}})
        splits.append(sp.split(sp.reconstruct(deformation, size * momentum, start, tolerance=1e-11)))
    alone = sp.articulated(body, path, **{kind: {"j2": 0.0}})
    assert not alone.has_wheels
    shape = sp.split(sp.reconstruct(alone, np.zeros(3), start, tolerance=1e-11))
    assert not shape.has_wheels
    np.testing.assert_array_equal(shape.wheel_rotation, np.eye(3))
    for found in (*splits, shape):
        errors = found.error_estimates
        assert apart(found.holonomy, shape.total_rotation) <= errors.holonomy + shape.error_estimates.total_rotation
        assert apart(found.dynamical_rotation @ found.holonomy, found.total_rotation) < 1e-14
        if found.has_phase:
            about = so3.exp(found.montgomery_phase * momentum / np.linalg.norm(momentum))
            assert (
                apart(about @ found.closing_tilt, found.dynamical_rotation)
                <= errors.montgomery_phase + errors.closing_tilt
            )
        else:
            assert apart(found.wheel_rotation, found.dynamical_rotation) < 1e-11
            assert found.montgomery_phase == 0.0
    turns = [float(so3.angle(found.wheel_rotation)) for found in splits]
    assert turns[0] == pytest.approx(turns[2], abs=1e-11)
    assert abs(turns[1] - turns[0]) > 0.1, "a slower loop leaves wheels more time"
    assert "the shape alone turns the body" not in str(splits[0])
    assert "stored wheel momentum" in str(splits[0])


def test_the_holonomy_of_a_body_with_wheels_is_the_turn_that_mujoco_makes_with_wheels_at_rest(load):
    chain = wheel_chain(2)
    body, loop, start = load(chain.urdf), loop_of(2, 2), random_rotation(2)
    path = fourier(loop, ["j0", "j1"])
    resting = sp.reconstruct(sp.articulated(body, path, rotors={"j2": 0.0}), np.zeros(3), start)
    speed = sp.dynamics.wheel_speeds(resting, 0.0)[0]
    turned, _, _ = mujoco_swing(chain, loop, ["j0", "j1"], ["j2"], [(0.0, speed)], np.zeros(3), start)
    moving = sp.reconstruct(sp.articulated(body, path, rotors={"j2": 1.3}), random_vector(2, 0.5), start)
    assert apart(sp.split(moving).holonomy, turned[-1] @ start.T) < 1e-8
    assert apart(sp.split(moving).total_rotation, turned[-1] @ start.T) > 0.1, "the wheel must matter"


def test_the_turn_by_wheels_alone_of_a_body_that_keeps_its_shape(tmp_path):
    """It is even, at -I^-1 p; and a motion read from a file knows it too, as does another gauge."""
    satellite = sp.load_body("satellite")
    rest = [name for name in satellite.joint_names if name != "wheel_spin"]
    still = sp.ShapePath.waypoints([0.0, 7.0], np.zeros((2, len(rest))), joint_names=rest)
    deformation = sp.articulated(satellite, still, rotors={"wheel_spin": 2.0})
    motion = sp.reconstruct(deformation, [0.3, -0.2, 0.5], tolerance=1e-11)
    motion.save(tmp_path / "motion.npz")
    wanted = so3.exp(-7.0 * np.linalg.solve(deformation.inertia(0.0), [0.0, 0.0, 2.0]))
    for found in (sp.split(motion), sp.split(sp.load_motion(tmp_path / "motion.npz"), "principal")):
        assert apart(found.wheel_rotation, wanted) < 1e-13
        assert apart(found.holonomy, np.eye(3)) < 1e-13
    seen = sp.horizontal_gauge(deformation)
    np.testing.assert_allclose(seen.closure, np.eye(3), rtol=0, atol=1e-13)
    np.testing.assert_allclose(seen.internal_momentum(3.0), [0.0, 0.0, 2.0], rtol=0, atol=1e-13)
    ends = sp.phases.running_phases(motion, 7.0)
    assert ends.montgomery_phase == pytest.approx(float(sp.split(motion).montgomery_phase), abs=1e-12)


def test_a_wheel_at_a_speed_is_the_joint_turning_evenly(load):
    """The other gyrostat: a motor holds the speed on the axle, and the whole path with that joint says the same."""
    chain = wheel_chain(8)
    body = load(chain.urdf)
    loop = loop_of(8, 2)
    momentum = random_vector(8, 0.5)
    given = sp.articulated(body, fourier(loop, ["j0", "j1"]), rotor_speeds={"j2": 9.0})

    def every(times):
        shapes, rates = loop.at(times)
        order = [("j0", "j1", "j2").index(name) for name in body.joint_names]
        shape = np.column_stack([shapes, 9.0 * times])
        return shape[:, order], np.column_stack([rates, np.full(len(times), 9.0)])[:, order]

    turning = sp.articulated(body, sp.ShapePath.function(every, loop.duration, joint_names=body.joint_names))
    one, other = sp.reconstruct(given, momentum), sp.reconstruct(turning, momentum)
    assert apart(one.attitude(TIMES), other.attitude(TIMES)) < 2e-9
    omega = one.angular_velocity(0.7)
    np.testing.assert_allclose(given.inertia(0.7), turning.inertia(0.7), rtol=0, atol=1e-13)
    assert given.kinetic_energy(0.7, omega) == pytest.approx(turning.kinetic_energy(0.7, omega), rel=1e-12)


def test_the_reduced_inertia_is_that_of_routh_and_its_rate_its_slope(load):
    chain = wheel_chain(10)
    body = load(chain.urdf)
    path = fourier(loop_of(10, 2), ["j0", "j1"])
    deformation = sp.articulated(body, path, rotors={"j2": 0.7})
    whole = sp.articulated(body, path, rotor_speeds={"j2": 0.0})
    assert np.linalg.eigvalsh(whole.inertia(0.4) - deformation.inertia(0.4)) == pytest.approx([0, 0, 0.05], abs=1e-13)
    h = 1e-3
    slope = (8 * (deformation.inertia(0.4 + h) - deformation.inertia(0.4 - h))
             - (deformation.inertia(0.4 + 2 * h) - deformation.inertia(0.4 - 2 * h))) / (12 * h)  # fmt: skip
    np.testing.assert_allclose(deformation.inertia_rate(0.4), slope, rtol=0, atol=1e-9)


def test_what_is_no_wheel_is_refused(load):
    body = load(
        urdf(
            link("a", 1.0, (0.3, 0.3, 0.5)),
            link("b", 2.0, (0.2, 0.3, 0.4)),
            link("c", 2.0, (0.2, 0.2, 0.3), (0.1, 0.0, 0.0)),
            link("d", 2.0, (0.2, 0.2, 0.3)),
            joint("uneven", "continuous", "a", "b"),
            joint("off", "continuous", "a", "c"),
            joint("good", "continuous", "a", "d"),
            joint("slide", "prismatic", "a", "e"),
            link("e", 1.0, (0.1, 0.1, 0.1)),
        )
    )
    still = sp.ShapePath.waypoints([0.0, 1.0], np.zeros((2, 3)))
    for name in ("uneven", "off"):
        with pytest.raises(ShapeError, match="symmetric"):
            sp.articulated(body, still, rotors={name: 1.0})
    with pytest.raises(ShapeError, match="turn"):
        sp.articulated(body, still, rotors={"slide": 1.0})
    with pytest.raises(UnknownNameError, match="bad"):
        sp.articulated(body, still, rotors={"bad": 1.0})
    with pytest.raises(ShapeError, match="both"):
        sp.articulated(body, still, rotors={"good": 1.0}, rotor_speeds={"good": 1.0})
    with pytest.raises(TrajectoryError, match="good"):
        sp.articulated(body, sp.ShapePath.waypoints([0.0, 1.0], np.zeros((2, 4))), rotors={"good": 1.0})
    assert sp.articulated(body, still, rotors={"good": 1.0}).internal_momentum(0.5).tolist() == [0.0, 0.0, 1.0]
    with pytest.raises(ShapeError, match="free"):
        sp.free_hinges(body, still, {}, [0.0, 0.0, 1.0])
    with pytest.raises(UnknownNameError, match="bad"):
        sp.free_hinges(body, still, {"bad": (0.0, 1.0)}, [0.0, 0.0, 1.0])
