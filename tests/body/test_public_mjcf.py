"""MJCF files that public packages ship, against MuJoCo itself: mass, centre, I, L_o, momentum, whole motions.

The packages are not installed for it, only their files are read: those of an environment, or wheels unpacked in the
folder that MJCF_PACKAGES names: `pip download --no-deps dm_control gymnasium gymnasium-robotics robosuite` there, then
`unzip` each.
"""

from __future__ import annotations

import importlib.util
import os
import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import IgnoredElementWarning, UnphysicalInertiaWarning
from support.floating_mujoco import FloatingMujoco, choices
from support.independent import apart, random_loop, random_vector, simulated_motion

pytestmark = [pytest.mark.full, pytest.mark.usefixtures("warm_engines")]
PACKAGES = ("dm_control", "gymnasium", "gymnasium_robotics", "robosuite")
EXACT = 1e-12


def folder_of(package: str) -> Path | None:
    """Where the files of a package lie; None: nowhere."""
    if given := os.environ.get("MJCF_PACKAGES"):
        return Path(given) / package if (Path(given) / package).is_dir() else None
    spec = importlib.util.find_spec(package)
    return Path(spec.submodule_search_locations[0]) if spec and spec.submodule_search_locations else None


def files_of(package: str) -> list[Path]:
    folder = folder_of(package)
    if folder is None:
        pytest.skip(f"{package} is not there: its MJCF files are those of an environment or of MJCF_PACKAGES")
    return sorted(folder.rglob("*.xml"))


@cache
def loaded(path: Path) -> tuple[sp.Body, FloatingMujoco] | None:
    """The body and MuJoCo's own, or None for what is no model with joints."""
    chosen = choices(path)
    if chosen is None:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", IgnoredElementWarning)
        warnings.simplefilter("ignore", UnphysicalInertiaWarning)
        return sp.load_body(path, **chosen), FloatingMujoco(path, chosen.get("root_body"))


def differences(body: sp.Body, truth: FloatingMujoco, seed: int) -> dict[str, float]:
    """By which share of the largest terms each differs at a random pose of a random floating motion."""
    random = np.random.default_rng(seed)
    shape, rate = random.uniform(-1.0, 1.0, (2, body.n_shape))
    attitude, omega = Rotation.random(rng=random), random.normal(size=3)
    truth.put(np.zeros(3), attitude.as_quat(), shape)
    truth.move(random.normal(size=3), omega, rate)
    turn = attitude.as_matrix()
    inertia, internal = body.locked_inertia(shape), body.internal_momentum(shape, rate)
    size = truth.extent()
    reach = np.sqrt(size / truth.mass())
    fast = size * (np.abs(rate).sum() + np.linalg.norm(omega))
    return {
        "mass": abs(body.mass / truth.mass() - 1.0),
        "centre": np.abs(turn @ body.centre_of_mass(shape) - truth.centre_of_mass()).max() / reach,
        "inertia": np.abs(inertia - truth.locked_inertia()).max() / size,
        "momentum": np.abs(turn @ (inertia @ omega + internal) - truth.momentum_about_centre()).max() / fast,
    }


@pytest.mark.parametrize("package", PACKAGES)
def test_bodies_of_a_package_are_mujoco_s(package):
    """Every file that MuJoCo compiles and that has joints loads, and is the same body."""
    for path in files_of(package):
        found = loaded(path)
        if found is None:
            continue
        body, truth = found
        model = truth.model
        names = [model.joint(joint).name for joint in truth.joints]
        whole = dict.fromkeys(said.rpartition(".")[0] or said for said in body.joint_names)
        said = whole if body.ball_joints else body.joint_names
        assert all(name in ("", one) for name, one in zip(names, said, strict=True)), path
        for seed in range(3):
            off = differences(body, truth, seed)
            assert max(off.values()) < EXACT + 10.0 * truth.lack(), (path, off)


def test_enough_of_them_load():
    if any(folder_of(package) is None for package in PACKAGES):
        pytest.skip("not all packages are there")
    bodies = [found[0] for package in PACKAGES for path in files_of(package) if (found := loaded(path))]
    assert len(bodies) >= 60
    assert sum(body.n_shape >= 2 for body in bodies) >= 40


MOTIONS = (
    *(("dm_control", f"suite/{name}.xml") for name in ("cheetah", "humanoid", "walker", "fish", "quadruped", "dog")),
    *(("gymnasium", f"envs/mujoco/assets/{name}.xml") for name in ("ant", "half_cheetah")),
    ("gymnasium_robotics", "envs/assets/hand/reach.xml"),
    *(("robosuite", f"models/assets/robots/{name}/robot.xml") for name in ("panda", "baxter", "spot")),
    ("robosuite", "models/assets/grippers/robotiq_gripper_s.xml"),
)


@pytest.mark.parametrize(("package", "file"), MOTIONS)
def test_a_floating_motion_is_mujoco_s(package, file):
    """MuJoCo's floating-base dynamics know nothing of conservation; the momentum enters by the first velocity alone."""
    files_of(package)
    found = loaded((folder_of(package) or Path()) / file)
    assert found is not None
    body, truth = found
    loop = random_loop(7, body.n_shape, size=0.3)
    momentum = random_vector(7, np.trace(body.locked_inertia(body.shape())) / 3.0)
    times = np.linspace(0.0, 2.0, 11)
    expected = simulated_motion(truth, loop, momentum, None, times).attitude
    assert apart(expected, np.eye(3)) > 0.1, "a motion that turns nothing shows nothing"
    motion = sp.reconstruct(sp.articulated(body, loop.path), momentum, tolerance=1e-11)
    assert apart(motion.attitude(times), expected) < 1e-8
