"""The torques of joints against MuJoCo's inverse dynamics, a closed form, and the balance of energy."""

from __future__ import annotations

import csv

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import IgnoredElementWarning, ShapeError, WrongObjectError
from support.bodies import joint, link, urdf
from support.independent import FourierLoop, random_rotation, random_vector
from support.random_chains import random_chain, wheel_chain

EPS = float(np.finfo(float).eps)
SEEDS = [seed if seed < 3 else pytest.param(seed, marks=pytest.mark.full) for seed in range(50)]


@pytest.fixture(scope="module")
def load(tmp_path_factory):
    def loaded(text: str) -> sp.Body:
        file = tmp_path_factory.mktemp("body") / "body.urdf"
        file.write_text(text)
        return sp.load_body(file)

    return loaded


def loop_of(seed: int, count: int) -> FourierLoop:
    rng = np.random.default_rng([5, seed])
    cosines, sines = rng.uniform(-0.5, 0.5, (2, count, 3)) / np.arange(1, 4)
    return FourierLoop(rng.uniform(-0.3, 0.3, count), cosines, sines, float(rng.uniform(1.0, 3.0)))


def mujoco_efforts(chain, attitude, spin, joints, rates, accelerations):
    """What MuJoCo says all joints must do, its base falling freely at the spin given; and what is left on the base."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(chain.mjcf)
    data = mujoco.MjData(model)
    data.qpos[3:7] = np.roll(sp.so3.quat_from_matrix(attitude), 1)
    rows = [model.joint(name) for name in chain.names]
    at = np.array([int(np.ravel(row.qposadr)[0]) for row in rows])
    moving = np.array([int(np.ravel(row.dofadr)[0]) for row in rows])
    data.qpos[at] = joints
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    for column, one in enumerate(np.eye(model.nv)):
        mujoco.mj_mulM(model, data, mass[column], one)
    data.qvel[3:6], data.qvel[moving] = spin, rates
    data.qvel[:3] = -np.linalg.solve(mass[:3, :3], mass[:3, 3:] @ data.qvel[3:])
    mujoco.mj_forward(model, data)
    full = np.zeros(model.nv)
    full[moving] = accelerations
    full[:6] = -np.linalg.solve(mass[:6, :6], data.qfrc_bias[:6] + mass[:6, 6:] @ full[6:])
    data.qacc[:] = full
    mujoco.mj_inverse(model, data)
    mujoco.mj_subtreeVel(model, data)
    return data.qfrc_inverse[moving].copy(), data.qfrc_inverse[:6].copy(), data.subtree_angmom[1].copy()


@pytest.mark.parametrize("seed", SEEDS)
def test_torques_are_those_of_mujoco(load, seed):
    """Slides, joints without end, followers; every third motion without momentum; MuJoCo's body falls.

    MuJoCo finds the acceleration of the base itself, from forces. What both sides round is some hundred operations.
    """
    chain = random_chain(seed)
    body = load(chain.urdf)
    loop = loop_of(seed, body.n_shape)
    momentum = np.zeros(3) if seed % 3 == 0 else random_vector(seed, 2.0)
    path = sp.ShapePath.fourier(loop.mean, loop.cosines, loop.sines, loop.duration, joint_names=body.joint_names)
    motion = sp.reconstruct(sp.articulated(body, path), momentum, random_rotation(seed))
    times = loop.duration * np.array([0.0, 0.31, 0.77, 1.0])
    found = sp.joint_torques(motion, times)
    place = [chain.names.index(name) for name in body.joint_names]
    full = np.zeros((len(chain.names), body.n_shape))
    full[place, np.arange(body.n_shape)] = 1.0
    offset = np.zeros(len(chain.names))
    if chain.factor is not None:
        full[-1, body.joint_names.index("j0")], offset[-1] = chain.factor, 0.1
    for row, t in enumerate(times):
        shape, rate, acceleration = loop.shape(t), loop.rate(t), loop.acceleration(t)
        efforts, left, carried = mujoco_efforts(
            chain, motion.attitude(t), motion.angular_velocity(t), full @ shape + offset, full @ rate,
            full @ acceleration,
        )  # fmt: skip
        size = np.abs(efforts).max()
        assert np.abs(left).max() < 1e-10 * size, "the oracle's base is free"
        np.testing.assert_allclose(carried, momentum, rtol=0, atol=1e-8)
        np.testing.assert_allclose(found.torque[row], full.T @ efforts, rtol=0, atol=1e-9 * size)
    largest = np.abs(found.torque).max()
    # Each of some hundred terms of a link's force is rounded, and may be ten times what is left of their sum.
    assert np.abs(found.base_wrench).max() < 1e4 * EPS * largest
    assert found.loads.energy_defect < 1e-9
    np.testing.assert_allclose(found.power, found.torque * np.array([loop.rate(t) for t in times]), rtol=0, atol=1e-12)


def test_two_discs_on_one_axle_take_the_torque_of_their_reduced_moment(load):
    """Elroy's beanie: without momentum the torque is I1 I2/(I1 + I2) times the acceleration of the joint."""
    body = load(
        urdf(
            link("a", 1.0, (0.3, 0.3, 0.5)),
            link("b", 2.0, (0.2, 0.2, 0.3)),
            joint("turn", "continuous", "a", "b", extra='<limit effort="0.1" velocity="0"/>'),
        )
    )
    path = sp.ShapePath.fourier([0.2], [[0.4, 0.0, 0.1]], [[0.1, -0.3, 0.0]], 1.7)
    found = sp.joint_torques(sp.reconstruct(sp.articulated(body, path), [0.0, 0.0, 0.0]))
    reduced = 0.5 * 0.3 / 0.8
    size = reduced * np.abs(path.acceleration(found.times)).max()
    np.testing.assert_allclose(found.torque, reduced * path.acceleration(found.times), rtol=0, atol=100 * EPS * size)
    loads = found.loads
    fine = path.acceleration(np.linspace(0.0, 1.7, 20001))
    assert loads.peak_torque[0] == pytest.approx(reduced * np.abs(fine).max(), rel=1e-5)
    assert loads.peak_torque[0] == pytest.approx(reduced * np.abs(path.acceleration(loads.peak_time[0]))[0], rel=1e-5)
    assert loads.effort_share[0] == pytest.approx(loads.peak_torque[0] / 0.1)
    assert loads.rate_share[0] == 0.0, "a limit of zero is not stated"
    assert np.isinf(loads.rate_limits[0])
    # Over a loop without momentum the energy comes back; what a joint does is what it takes up.
    moved = 0.5 * reduced * np.abs(np.diff(path.rate(_extremes(path))[:, 0] ** 2)).sum()
    assert loads.positive_work[0] == pytest.approx(0.5 * moved, rel=1e-9)
    assert abs(loads.work[0]) < 1e-10 * loads.positive_work[0]


def _extremes(path):
    """Where the rate of the energy changes its sign: zeros of rate times acceleration, by bisection, and both ends."""
    times = np.linspace(0.0, path.duration, 4001)
    found = [0.0]
    for what in (path.rate, path.acceleration):
        values = what(times)[:, 0]
        for k in np.flatnonzero(values[1:] * values[:-1] < 0.0):
            left, right = times[k], times[k + 1]
            for _ in range(60):
                middle = 0.5 * (left + right)
                left, right = (middle, right) if what(middle)[0] * what(left)[0] > 0.0 else (left, middle)
            found.append(left)
    return np.append(np.sort(found), path.duration)


def test_torques_do_not_depend_on_the_gauge_and_come_in_batches():
    cat = sp.load_body("cat_two_halves")
    deformation = sp.articulated(cat, sp.examples.kane_scher(0.3, 1.0))
    momentum = np.array([0.004, -0.002, 0.005])
    times = np.array([[0.1, 0.4], [0.5, 0.9]])
    own = sp.joint_torques(sp.reconstruct(deformation, momentum), times)
    seen = sp.joint_torques(sp.reconstruct(sp.horizontal_gauge(deformation), momentum), times)
    assert own.torque.shape == (2, 2, 3)
    size = np.abs(own.torque).max()
    # The two motions agree to their tolerance.
    np.testing.assert_allclose(seen.torque, own.torque, rtol=0, atol=1e-8 * size)
    both = sp.joint_torques(sp.reconstruct(deformation, np.stack([momentum, 2.0 * momentum])), times)
    np.testing.assert_allclose(both.torque[0], own.torque, rtol=0, atol=1e-8 * size)
    assert both.base_wrench.shape == (2, 2, 2, 6)
    assert both.loads.peak_torque.shape == both.loads.work.shape == (2, 3)
    with pytest.raises(ShapeError, match="table"):
        both.write_csv("no.csv")


def test_the_error_estimate_holds_what_a_loose_tolerance_does():
    cat = sp.load_body("cat_two_halves")
    deformation = sp.articulated(cat, sp.examples.kane_scher(0.3, 1.0))
    loose, sharp = (sp.reconstruct(deformation, [0.004, -0.002, 0.005], tolerance=tol) for tol in (1e-5, 1e-11))
    times = np.linspace(0.0, loose.duration, 33)
    found, true = sp.joint_torques(loose, times), sp.joint_torques(sharp, times)
    assert np.all(np.abs(found.torque - true.torque) <= found.error_estimate + 1e-13)
    assert found.error_estimate.max() < 1e-2 * np.abs(true.torque).max()


def test_what_has_no_joints_is_refused(tmp_path):
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0), [0.0, 0.0, 1.0])
    with pytest.raises(WrongObjectError, match="joints"):
        sp.joint_torques(motion)
    cat = sp.load_body("cat_two_halves")
    known = sp.reconstruct(sp.articulated(cat, sp.examples.kane_scher(0.3, 1.0)), [0.0, 0.0, 0.005])
    known.save(tmp_path / "motion.npz")
    with pytest.raises(WrongObjectError, match="joints"):
        sp.joint_torques(sp.load_motion(tmp_path / "motion.npz"))


def test_the_table_has_units_in_its_names(tmp_path):
    satellite = sp.load_body("satellite")
    motion = sp.reconstruct(sp.articulated(satellite, sp.examples.antenna_deployment()), [0.0, 0.0, 12.0])
    found = sp.joint_torques(motion)
    found.write_csv(tmp_path / "torques.csv")
    with open(tmp_path / "torques.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    boom = satellite.joint_index("boom_extension")
    assert [float(row["boom_extension_force_N"]) for row in rows] == found.torque[:, boom].tolist()
    assert [float(row["boom_extension_power_W"]) for row in rows] == found.power[:, boom].tolist()
    assert "arm_1_torque_N_m" in rows[0]
    assert list(found.to_dataframe().columns) == list(rows[0])


@pytest.mark.parametrize(
    ("limit", "effort"),
    [
        ('effort="7" velocity="1"', 7.0),
        ('effort="0" velocity="1"', np.inf),
        ('velocity="1"', np.inf),
        ('effort="inf" velocity="1"', np.inf),
        ('effort="nan" velocity="1"', np.inf),
        ('effort="much" velocity="1"', np.inf),
    ],
)
def test_the_effort_of_a_file_is_a_limit_where_it_is_one(load, limit, effort):
    element = joint("turn", "continuous", "a", "b", extra=f"<limit {limit}/>")
    body = load(urdf(link("a", 1.0, (1.0, 1.0, 1.0)), link("b", 1.0, (1.0, 1.0, 1.0)), element))
    assert body.effort_limits.tolist() == [effort]


def test_a_negative_effort_is_read_as_its_size_with_a_warning(load):
    element = joint("turn", "continuous", "a", "b", extra='<limit effort="-7" velocity="1"/>')
    with pytest.warns(IgnoredElementWarning, match="effort"):
        body = load(urdf(link("a", 1.0, (1.0, 1.0, 1.0)), link("b", 1.0, (1.0, 1.0, 1.0)), element))
    assert body.effort_limits.tolist() == [7.0]


@pytest.mark.parametrize(
    ("kind", "value"), [("rotors", 1.3), ("rotors", [1.3, 0.4]), ("rotor_speeds", 9.0), ("rotor_speeds", [9.0, 2.0])]
)
@pytest.mark.parametrize("seed", [2, *(pytest.param(seed, marks=pytest.mark.full) for seed in range(3, 20))])
def test_torques_with_a_spinning_wheel_are_those_of_mujoco(load, seed, kind, value):
    """The wheel is a hinge there, its acceleration the slope of its speed; no motor turns it where it is free.

    A pair is the mean and the amplitude of a sine: the torque is then the slope of the momentum.
    """
    chain = wheel_chain(seed)
    body, loop, driven = load(chain.urdf), loop_of(seed, 2), ["j0", "j1"]
    momentum = random_vector(seed, 0.5)
    path = sp.ShapePath.fourier(loop.mean, loop.cosines, loop.sines, loop.duration, joint_names=driven)
    given, slope = value, 0.0
    if isinstance(value, list):
        given = sp.ShapePath.fourier(value[:1], [[0.0]], [value[1:]], loop.duration)
        slope = 2.0 * np.pi / loop.duration * value[1]
    deformation = sp.articulated(body, path, **{kind: {"j2": given}})
    motion = sp.reconstruct(deformation, momentum, random_rotation(seed), tolerance=1e-12)
    times = loop.duration * np.array([0.1, 0.31, 0.77, 0.9])
    found = sp.joint_torques(motion, times)
    order = [body.joint_names.index(name) for name in chain.names]
    h = 1e-3 * loop.duration
    ahead, behind, far, back = (
        sp.dynamics.wheel_speeds(motion, times + k * h)[:, 0] for k in (1, -1, 2, -2)
    )  # fmt: skip
    slopes = (8.0 * (ahead - behind) - (far - back)) / (12.0 * h)
    for row, t in enumerate(times):
        spun = sp.dynamics.wheel_speeds(motion, t)[0]
        efforts, left, carried = mujoco_efforts(
            chain, motion.attitude(t), motion.angular_velocity(t), np.append(loop.shape(t), 0.7),
            np.append(loop.rate(t), spun), np.append(loop.acceleration(t), slopes[row]),
        )  # fmt: skip
        size = np.abs(efforts).max()
        assert np.abs(left).max() < 1e-10 * size, "the oracle's base is free"
        np.testing.assert_allclose(carried, momentum, rtol=0, atol=1e-9)
        np.testing.assert_allclose(found.torque[row][order], efforts, rtol=0, atol=1e-8 * size)
        if kind == "rotors":
            wanted = slope * np.cos(2.0 * np.pi * t / loop.duration)
            assert found.torque[row, order[2]] == pytest.approx(wanted, abs=1e-12 * size)
    assert np.abs(found.base_wrench).max() < 1e-10 * np.abs(found.torque).max()
    assert found.loads.energy_defect < 1e-9
    seen = sp.joint_torques(sp.reconstruct(sp.horizontal_gauge(deformation), momentum, motion.initial_attitude), times)
    np.testing.assert_allclose(seen.torque, found.torque, rtol=0, atol=1e-6 * np.abs(found.torque).max())


def test_a_wheel_at_a_held_speed_is_the_joint_turning_evenly_and_batches_of_free_ones_are_refused(load):
    body, loop = load(wheel_chain(8).urdf), loop_of(8, 2)
    driven = sp.ShapePath.fourier(loop.mean, loop.cosines, loop.sines, loop.duration, joint_names=["j0", "j1"])

    def every(times):
        shapes, rates = loop.at(times)
        order = [("j0", "j1", "j2").index(name) for name in body.joint_names]
        shape = np.column_stack([shapes, 9.0 * times])
        return shape[:, order], np.column_stack([rates, np.full(len(times), 9.0)])[:, order]

    turning = sp.ShapePath.function(every, loop.duration, joint_names=body.joint_names)
    batch = np.array([[0.1, -0.2, 0.3], [0.0, 0.4, 0.1]])
    held = sp.articulated(body, driven, rotor_speeds={"j2": 9.0})
    times = loop.duration * np.array([0.2, 0.6])
    found, whole = (sp.joint_torques(sp.reconstruct(d, batch), times) for d in (held, sp.articulated(body, turning)))
    assert found.torque.shape == (2, 2, 3)
    np.testing.assert_allclose(found.torque, whole.torque, rtol=0, atol=1e-6 * np.abs(whole.torque).max())
    np.testing.assert_allclose(found.rate, whole.rate, rtol=0, atol=1e-12)
    with pytest.raises(ShapeError, match="2 motions"):
        sp.joint_torques(sp.reconstruct(sp.articulated(body, driven, rotors={"j2": 1.0}), batch), times)
    with pytest.raises(WrongObjectError, match="wheels"):
        sp.torque_errors(sp.joint_torques(sp.reconstruct(held, batch[0]), times), joints=1e-3)
