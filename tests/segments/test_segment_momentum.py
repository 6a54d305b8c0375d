"""Momentum by link against MuJoCo, biorbd and OpenSim; drift in flights; bars against draws."""

from __future__ import annotations

import warnings
from importlib.util import find_spec

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import (
    IgnoredElementWarning,
    ShapeError,
    TrajectoryError,
    UnknownNameError,
    WrongObjectError,
)
from support import hinged_models, opensim_oracle, osim_models
from support.engine_files import ACROBAT
from support.flown_bodies import flown, noisy
from support.independent import BODIES, body_of, mujoco_model, random_loop, random_rotation, random_vector
from support.long_runs import full_but
from support.places import ROBOTS

TRAMPOLINE = ROBOTS / "trampoline"


def motion_of(name: str) -> sp.Motion:
    body = body_of(name)
    momentum, attitude = random_vector(61, BODIES[name]), random_rotation(62)
    return sp.reconstruct(sp.articulated(body, random_loop(63, body.n_shape).path), momentum, attitude)


def mujoco_momenta(model, qpos, qvel) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The whole by MuJoCo's own sum, and local and remote part of each body by its velocities: (2, 3)."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = qpos, qvel
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_subtreeVel(model, data)
    parts = {}
    for body in range(1, model.nbody):
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
        turn = data.ximat[body].reshape(3, 3)
        local = turn @ (model.body_inertia[body] * (turn.T @ velocity[:3]))
        speed = velocity[3:] - data.subtree_linvel[1]
        # The velocity of a body is that of its centre of mass.
        remote = model.body_mass[body] * np.cross(data.xipos[body] - data.subtree_com[1], speed)
        parts[model.body(body).name] = np.array([local, remote])
    return data.subtree_angmom[1].copy(), parts


@pytest.mark.parametrize("name", full_but(BODIES, "satellite", "cat", "diver"))
def test_links_of_a_motion_are_mujocos(name):
    motion, model = motion_of(name), mujoco_model(name)
    times = np.linspace(0.0, 2.0, 5)
    arrays = sp.exports.mujoco_arrays(motion, times, model=model)
    found = sp.segment_momentum(motion, times=times)
    scale = np.linalg.norm(found.by_link, axis=2).sum(axis=1).max()
    for k in range(len(times)):
        whole, parts = mujoco_momenta(model, arrays.qpos[k], arrays.qvel[k])
        np.testing.assert_allclose(found.whole[k], whole, rtol=0, atol=1e-11 * scale)
        ours = np.stack([found.local[k], found.remote[k]], axis=1)
        expected = np.array([parts[link] for link in found.links])
        np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-11 * scale)
    np.testing.assert_allclose(found.by_link.sum(axis=1), found.whole, rtol=0, atol=1e-13 * scale)
    np.testing.assert_allclose(found.whole, np.tile(motion.momentum, (5, 1)), rtol=0, atol=1e-13 * scale)
    assert not found.flights[0].more_than_noise


def trajectory_of(rng, body, count=8):
    """Random states, one after the other: momenta are those of each, as rates are given."""
    low, high = np.clip(body.joint_limits, -1.0, 1.0).T
    return sp.FloatingTrajectory(
        times=np.arange(float(count)),
        quaternion=Rotation.random(count, rng).as_quat(),
        shapes=rng.uniform(low, high, (count, body.n_shape)),
        rate=rng.normal(size=(count, 3)),
        joint_rates=rng.normal(size=(count, body.n_shape)),
    )


def write_biorbd_models(tmp_path) -> None:
    text = ACROBAT.replace("\tmeshfile pelvis.bvh // not there\n", "")
    # Its six digits are not a rotation to more.
    for six, exact in (("0.980067", np.cos(0.2)), ("0.198669", np.sin(0.2))):
        text = text.replace(six, repr(float(exact)))
    (tmp_path / "acrobat.bioMod").write_text(text)
    (tmp_path / "diver.bioMod").write_text(hinged_models.biomod(body_of("diver")))
    # Its meshes are elsewhere.
    lines = (TRAMPOLINE / "Model_JeCh_15DoFs.bioMod").read_text(encoding="utf-8").splitlines()
    bare = "\n".join(line for line in lines if "meshfile" not in line)
    (tmp_path / "trampolinist.bioMod").write_text(bare, encoding="utf-8")


@pytest.mark.usefixtures("warm_engines", "kept_locale")
@pytest.mark.parametrize("name", ["acrobat", "diver", "trampolinist"])
def test_segments_of_a_trajectory_are_biorbds(name, tmp_path, rng):
    """Segments, too, by biorbd's own sum; its base turns by angles about axes that each carry the next."""
    import biorbd

    write_biorbd_models(tmp_path)
    file = tmp_path / f"{name}.bioMod"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IgnoredElementWarning)
        # The diver is read from its own file, biorbd has one written from it.
        body = body_of("diver") if name == "diver" else sp.load_body(file)
    model = biorbd.Model(str(file))
    states = rng.uniform(-1.0, 1.0, (8, 2, model.nbQ()))
    turns = Rotation.from_euler("XYZ", states[:, 0, 3:6]).as_matrix()
    spins = []
    for (q, v), turn in zip(states, turns, strict=True):
        first, second = (Rotation.from_euler("XY"[: k + 1], q[3 : 4 + k]).as_matrix() for k in range(2))
        spins.append(turn.T @ (v[3] * np.eye(3)[0] + v[4] * np.reshape(first, (3, 3))[:, 1] + v[5] * second[:, 2]))
    trajectory = sp.FloatingTrajectory(
        times=np.arange(8.0),
        quaternion=Rotation.from_matrix(turns).as_quat(),
        shapes=states[:, 0, 6:],
        rate=np.array(spins),
        joint_rates=states[:, 1, 6:],
    )
    found = sp.segment_momentum(trajectory, body)
    scale = np.linalg.norm(found.by_link, axis=2).sum(axis=1).max()
    segments = [model.segment(k) for k in range(model.nbSegment())]
    masses = np.array([segment.characteristics().mass() for segment in segments])
    # A segment is on the last of its own coordinates; without coordinates it is fixed to its parent.
    last: dict[str, int] = {}
    dofs = np.cumsum([segment.nbDof() for segment in segments]).tolist()
    for segment, count in zip(segments, dofs, strict=True):
        own, parent = segment.name().to_string(), segment.parent().to_string()
        last[own] = count - 1 if segment.nbDof() else last[parent]
    assert found.links == tuple(segment.name().to_string() for segment in segments if segment.nbDof())
    atol = (1e-10 if name == "trampolinist" else 1e-12) * scale  # frames of its file have ten digits
    for k, (q, v) in enumerate(states):
        state = biorbd.GeneralizedCoordinates(q), biorbd.GeneralizedVelocity(v)
        expected = model.angularMomentum(*state, True).to_array()
        np.testing.assert_allclose(found.whole[k], expected, rtol=0, atol=atol)
        parts = np.array([part.to_array() for part in model.CalcSegmentsAngularMomentum(*state, True)])
        # Its parts are about the centre of mass, but with velocities in the room.
        arms = np.array([place.to_array() for place in model.CoMbySegment(state[0], True)])
        arms -= model.CoM(state[0], True).to_array()
        momenta = masses[:, None] * np.cross(arms, model.CoMdot(*state, True).to_array())
        np.subtract.at(parts, list(last.values()), momenta)
        np.testing.assert_allclose(found.by_link[k], parts[sorted({*last.values()})], rtol=0, atol=atol)


OPENSIM_MODELS = {
    "acrobat": ("trunk", osim_models.ACROBAT_FREE, osim_models.acrobat),
    "gait": ("pelvis", osim_models.PELVIS, osim_models.gait),
    "cat": ("trunk_front", hinged_models.OSIM_FREE, lambda: hinged_models.osim(body_of("cat"))),
}


@pytest.mark.skipif(find_spec("opensim") is None, reason="needs opensim")
@pytest.mark.full
@pytest.mark.parametrize("name", OPENSIM_MODELS)
def test_the_whole_of_a_trajectory_is_opensims(name, tmp_path, rng):
    base, free, text = OPENSIM_MODELS[name]
    file = tmp_path / f"{name}.osim"
    file.write_text(text(), encoding="utf-8")
    # The cat is read from its own file, OpenSim has one written from it.
    body = body_of("cat") if name == "cat" else sp.load_body(file)
    drawn = trajectory_of(rng, body)
    values = rng.uniform(-1.0, 1.0, (2, 8, 6))
    named = [
        [dict(zip((*body.joint_names, *free), row.tolist(), strict=True)) for row in np.hstack(pair)]
        for pair in ((drawn.shapes, values[0]), (drawn.joint_rates, values[1]))
    ]
    answers = opensim_oracle.asked(file, base, *named)
    trajectory = sp.FloatingTrajectory(
        times=drawn.times,
        quaternion=drawn.quaternion,
        shapes=drawn.shapes,
        rate=np.array([answer["omega"] for answer in answers]),
        joint_rates=drawn.joint_rates,
    )
    found = sp.segment_momentum(trajectory, body)
    scale = np.linalg.norm(found.by_link, axis=2).sum(axis=1).max()
    expected = sp.so3.apply(drawn.attitude, np.array([answer["momentum"] for answer in answers]))
    np.testing.assert_allclose(found.whole, expected, rtol=0, atol=1e-12 * scale)


def pushed(push: float, every: int):
    """A cat that motors bend while a torque from outside turns it, by MuJoCo, and its momentum at each sample."""

    def torque(_: float) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(3), push * np.array([0.3, -0.2, 1.0])

    motion = flown("cat", seed=5, step=0.001, every=every, push=torque if push else None)
    truth = np.array(
        [mujoco_momenta(mujoco_model("cat"), *row)[0] for row in zip(motion.qpos, motion.qvel, strict=True)]
    )
    return motion, truth


def test_a_push_from_outside_is_seen_and_its_size_is_right():
    """Nothing is presumed to be conserved; rates are those of splines, within bars."""
    motion, truth = pushed(0.02, 5)
    trajectory = sp.FloatingTrajectory.from_mujoco(
        body_of("cat"), motion.times, motion.qpos, joint_names=motion.joint_names
    )
    found = sp.segment_momentum(trajectory, body_of("cat"), flight="all")
    off = np.abs(found.whole - truth)
    assert np.all(off.max(axis=0) <= 2.0 * found.whole_bars.max(axis=0))
    assert np.sqrt(np.mean(off**2)) <= np.sqrt(np.mean(found.whole_bars**2))
    assert np.median(off) < 1e-5 * np.linalg.norm(truth, axis=1).mean()
    (flight,) = found.flights
    assert flight.more_than_noise
    times = motion.times
    slope = np.polynomial.polynomial.polyfit(times, truth, 1)[1] * (times[-1] - times[0])
    np.testing.assert_allclose(flight.change, slope, rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(
        flight.percent, 100.0 * np.linalg.norm(slope) / np.linalg.norm(truth.mean(axis=0)), rtol=1e-3
    )
    given = sp.FloatingTrajectory.from_mujoco(
        body_of("cat"), motion.times, motion.qpos, motion.qvel, joint_names=motion.joint_names
    )
    exact = sp.segment_momentum(given, body_of("cat"))
    np.testing.assert_allclose(exact.whole, truth, rtol=0, atol=1e-10 * np.abs(truth).max())


@pytest.mark.full
def test_without_a_push_noise_is_no_drift_and_bars_hold_against_draws():
    motion, truth = pushed(0.0, 10)
    body, pulls, drifts = body_of("cat"), [], []
    for seed in range(6):
        drawn = noisy(motion, seed, turn=2e-3, place=0.0, angle=2e-3, rate=0.0)
        trajectory = sp.FloatingTrajectory.from_mujoco(body, drawn.times, drawn.qpos, joint_names=drawn.joint_names)
        found = sp.segment_momentum(trajectory, body, flight="all")
        pulls.append((found.whole - truth) / found.whole_bars)
        (flight,) = found.flights
        drifts.append(flight.change / flight.change_bar)
        assert not flight.more_than_noise
        assert flight.percent < 5.0
        assert flight.relative_to == "mean"
    assert 0.7 < np.sqrt(np.mean(np.square(pulls))) < 1.4
    assert 0.5 < np.sqrt(np.mean(np.square(drifts))) < 1.6
    link_bars = np.linalg.norm(found.bars, axis=2)
    assert np.all(link_bars > 0.0)


def test_a_steady_spin_behind_noise_is_smoothed(rng):
    """Beside its mean turn nothing moves but noise, in the joints, too."""
    cat, times, noise = body_of("cat_two_halves"), np.linspace(0.0, 1.0, 101), 0.01
    turns = sp.so3.exp(np.outer(times, [0.0, 0.0, 4.0]))
    trajectory = sp.FloatingTrajectory(
        times=times,
        quaternion=Rotation.from_matrix(turns @ sp.so3.exp(noise * rng.normal(size=(101, 3)))).as_quat(),
        shapes=noise * rng.normal(size=(101, 3)),
    )
    found = sp.segment_momentum(trajectory, cat, flight="all")
    expected = cat.locked_inertia(np.zeros(3)) @ [0.0, 0.0, 4.0]
    off = found.whole - expected
    assert np.abs(off).max() < 0.1 * np.linalg.norm(expected)
    assert np.sqrt(np.mean((off / found.whole_bars) ** 2)) < 2.0
    assert not found.flights[0].more_than_noise


def test_flights_of_a_recording_are_found(tmp_path):
    cat = body_of("cat")
    motion = sp.reconstruct(sp.articulated(cat, sp.examples.cat_righting()), [0.01, 0.02, -0.05])
    fall = {"start": [0.0, 0.0, 2.0], "velocity": [0.7, 0.0, 9.81], "gravity": [0.0, 0.0, -9.81]}
    sp.export_motion(motion, tmp_path / "cat.csv", **fall)
    recorded = sp.read_recorded_motion(tmp_path / "cat.csv", cat)
    found = sp.segment_momentum(recorded, cat)
    (flight,) = found.flights
    assert found.as_recorded
    assert (flight.first_time, flight.last_time) == (0.0, 2.0)
    assert np.all(np.abs(flight.mean - motion.momentum) < 5.0 * flight.mean_bar)
    part = sp.segment_momentum(recorded, cat, flight=(0.5, 1.0))
    np.testing.assert_allclose((part.flights[0].first_time, part.flights[0].last_time), (0.5, 1.0))
    paced = sp.segment_momentum(recorded, cat, normalise="speed", stature=0.5).normalisation
    np.testing.assert_allclose((paced.speed, paced.divisor), (0.7, paced.mass * 0.5 * 0.7), rtol=1e-6)


@pytest.mark.usefixtures("warm_engines")
@pytest.mark.parametrize(("name", "conserved"), [("free_floating", True), ("implicit", False)])
def test_published_somersaults_are_flights_or_not(name, conserved):
    """Of one program: the one conserves 85.29 kg m^2/s, of the other half comes and goes, as an audit finds, too."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IgnoredElementWarning)
        body = sp.load_body(TRAMPOLINE / "Model_JeCh_15DoFs.bioMod")
        trajectory = sp.read_trajectory(TRAMPOLINE / f"{name}.npz", body)
    (flight,) = sp.segment_momentum(trajectory, body).flights
    assert flight.more_than_noise != conserved
    assert (flight.percent < 1e-4) == conserved
    if conserved:
        np.testing.assert_allclose(flight.mean, [85.2906, -0.0661, 0.7], rtol=0, atol=1e-4)
    else:
        assert flight.percent > 40.0


def test_axes_and_normalisation_are_projections_and_quotients():
    body = sp.load_body("diver")
    path = random_loop(3, body.n_shape, size=0.2).path
    motion = sp.reconstruct(sp.articulated(body, path), [3.0, 30.0, 1.0])
    plain, athlete = sp.segment_momentum(motion), sp.segment_momentum(motion, axes="athlete")
    axes = motion.athlete_axes()
    attitude = motion.attitude(plain.times)
    ways = [np.broadcast_to(axes.somersault, (201, 3)), attitude @ axes.frontal, attitude @ axes.longitudinal]
    for k, way in enumerate(ways):
        expected = np.einsum("tlc,tc->tl", plain.by_link, way)
        np.testing.assert_allclose(athlete.by_link[:, :, k], expected, rtol=0, atol=1e-12 * 30.0)
    along = sp.segment_momentum(motion, axes=[0.0, 2.0, 0.0])
    np.testing.assert_allclose(along.local[..., 0], plain.local[..., 1], rtol=0, atol=1e-12 * 30.0)
    given = sp.segment_momentum(motion, normalise="gravity", stature=1.7, gravity=9.8)
    np.testing.assert_allclose(given.normalisation.divisor, body.mass * 1.7 * np.sqrt(9.8 * 1.7), rtol=1e-14)
    np.testing.assert_allclose(given.whole * given.normalisation.divisor, plain.whole, rtol=1e-12)
    measured = sp.segment_momentum(motion, normalise="inertia").normalisation
    assert 1.4 < measured.stature < 2.3
    np.testing.assert_allclose(measured.divisor, body.mass * measured.stature**2, rtol=1e-14)


def test_the_table_and_the_columns_hold_the_numbers(tmp_path):
    motion = motion_of("cat")
    found = sp.segment_momentum(motion)
    found.write_csv(tmp_path / "m.csv")
    table = np.genfromtxt(tmp_path / "m.csv", delimiter=",", names=True)
    np.testing.assert_allclose(table["momentum_x_kg_m2_s"], found.whole[:, 0])
    np.testing.assert_allclose(table["head_remote_momentum_z_kg_m2_s"], found.remote[:, found.links.index("head"), 2])
    text = str(found)
    assert "within noise" in text
    assert all(link in text for link in found.links)
    assert (
        found.to_dict()["links"]["head"]["largest"]
        == np.linalg.norm(found.by_link[:, found.links.index("head")], axis=1).max()
    )


def test_wrong_arguments_are_named(tmp_path):
    motion, cat = motion_of("cat"), body_of("cat")
    for options, words in (
        ({"axes": "sideways"}, "inertial"),
        ({"normalise": "height"}, "speed"),
        ({"axes": [0.0, 0.0, 0.0]}, "not all zero"),
        ({"normalise": "speed", "stature": 1.0}, "--speed"),
        ({"times": [0.0]}, "three or more"),
        ({"normalise": "gravity", "stature": -1.0}, "stature"),
    ):
        with pytest.raises((ShapeError, UnknownNameError, TrajectoryError), match=words):
            sp.segment_momentum(motion, **options)
    with pytest.raises(WrongObjectError, match="FloatingTrajectory"):
        sp.segment_momentum(cat)
    rigid = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0), [0.0, 0.0, 1.0])
    with pytest.raises(WrongObjectError, match="joints along a path"):
        sp.segment_momentum(rigid)
    sp.write_shape_path(sp.examples.cat_righting(), tmp_path / "joints.csv")
    joints = sp.read_recorded_motion(tmp_path / "joints.csv", cat)
    with pytest.raises(TrajectoryError, match="attitude of the base is not recorded"):
        sp.segment_momentum(joints, cat)
    with pytest.raises(WrongObjectError, match="body"):
        sp.segment_momentum(joints)


def test_along_oblique_axes_no_size_is_larger_than_the_momentum():
    path = sp.examples.MOTIONS["diver_twist"].path()
    motion = sp.reconstruct(sp.articulated(sp.load_body("diver"), path), [0.0, 61.558831, 0.0])
    found = sp.segment_momentum(motion, axes="athlete")
    sizes = np.linalg.norm(sp.segment_momentum(motion).by_link, axis=2).max(axis=0)
    data = found.to_dict()["links"]
    assert all(data[link]["largest"] <= size * (1.0 + 1e-12) for link, size in zip(found.links, sizes, strict=True))
    (whole,) = (line.split() for line in str(found).splitlines() if line.startswith("whole"))
    assert float(whole[4]) == pytest.approx(61.56)
    assert found.to_dict()["whole"]["largest"] == pytest.approx(61.558831)
    assert "axes are oblique" in str(found)


@pytest.mark.parametrize("given", [{"flight": [0.5, 0.2]}, {"attitude_noise": 0.1}, {"joint_noise": 0.1}, {"speed": 1}])
def test_arguments_without_effect_are_refused(given):
    with pytest.raises(ShapeError, match=rf"{next(iter(given))} \(.*\): without effect"):
        sp.segment_momentum(motion_of("diver"), **given)
