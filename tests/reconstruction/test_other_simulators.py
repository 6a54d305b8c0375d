"""The reconstruction to 1e-9 rad against Drake and MuJoCo, to 1e-12 rad against the closed form of a rigid body (U10).

Neither simulator is told that momentum is conserved: they get forces, and the momentum as an initial velocity.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import shapephase as sp
from support.independent import (
    Array,
    FourierLoop,
    apart,
    axisymmetric_attitude,
    body_of,
    mujoco_motion,
    random_loop,
    random_rotation,
    random_vector,
)
from support.long_runs import full_but

TIMES = np.linspace(0.0, 2.0, 41)


def case(name: str, seed: int, rate: float) -> tuple[sp.Body, FourierLoop, Array, Array]:
    """Body, loop, momentum and attitude at the start.

    The momentum turns a body of the mean inertia at `rate` [rad/s]; continuous joints turn thrice in the loop.
    """
    body = body_of(name)
    loop = random_loop(seed, body.n_shape)
    loop = replace(loop, spin=np.where(body.continuous, 3 * 2.0 * np.pi / loop.duration, 0.0))
    momentum = random_vector(seed, rate * np.trace(body.locked_inertia(body.shape())) / 3.0)
    return body, loop, momentum, random_rotation(seed)


def check(truth: Array, body: sp.Body, loop: FourierLoop, momentum: Array, attitude: Array) -> None:
    assert apart(truth, attitude) > 0.1, "a motion that turns nothing shows nothing"
    motion = sp.reconstruct(sp.articulated(body, loop.path), momentum, attitude, tolerance=1e-11)
    assert apart(motion.attitude(TIMES), truth) < 1e-9


# The satellite has a sliding boom and a wheel that turns without end.
@pytest.mark.parametrize(
    ("name", "rate"),
    full_but([("example:human", 3.0), ("satellite", 2.0), ("cat", 0.0)], ("satellite", 2.0), ("cat", 0.0)),
)
def test_drake_dynamics_turn_the_same_way(name: str, rate: float):
    pytest.importorskip("pydrake", reason="Drake has no wheel for this machine")
    from support.drake_oracle import drake_motion

    body, loop, momentum, attitude = case(name, 41, rate)
    truth = drake_motion(name, body.joint_names, loop, momentum, attitude, TIMES)
    check(truth.attitude, body, loop, momentum, attitude)


# Three of the kinova's six joints turn without end.
@pytest.mark.parametrize(
    ("name", "rate"),
    full_but([("example:g1_29dof_rev_1_0", 3.0), ("example:kinova", 2.0), ("astronaut", 0.0)], ("example:kinova", 2.0)),
)
def test_mujoco_dynamics_turn_the_same_way(name: str, rate: float):
    body, loop, momentum, attitude = case(name, 42, rate)
    truth = mujoco_motion(name, body.joint_names, loop, momentum, attitude, TIMES)
    check(truth.attitude, body, loop, momentum, attitude)


# ---- Axisymmetric rigid body ----------------------------------------------------------------------------------------

DIRECTIONS = {
    "along": [0.0, 0.0, 1.0],
    "against": [0.0, 0.0, -1.0],
    "across": [1.0, 0.0, 0.0],
    "almost along": [1e-3, 0.0, 1.0],
    "almost across": [0.6, 0.8, 1e-3],
    "oblique": [1.0, 1.0, 1.0],
    "oblique back": [-0.3, 0.7, -0.9],
}
# The base axes seen from the body's own, of which the third is the symmetric one.
AXES = {"z": np.eye(3), "x": np.eye(3)[[1, 2, 0]], "y": np.eye(3)[[2, 0, 1]], "slanted": random_rotation(51)}


# Errors grow up to forty times here, so in most directions 1e-13 rad is refused: rounding might use it up.
@pytest.mark.parametrize(("across", "along"), [(2.0, 0.7), (1.1, 2.0)], ids=["prolate", "oblate"])
@pytest.mark.parametrize("axes", AXES)
@pytest.mark.parametrize("direction", DIRECTIONS)
def test_axisymmetric_rigid_body(across: float, along: float, axes: str, direction: str):
    """Three turns about the momentum; nine of the prolate body with its axis along it."""
    duration, own, attitude = 5.0, AXES[axes], random_rotation(52)
    unit = np.array(DIRECTIONS[direction]) / np.linalg.norm(DIRECTIONS[direction])
    momentum = attitude @ own.T @ unit * across * 3 * 2.0 * np.pi / duration
    inertia = own.T @ np.diag([across, across, along]) @ own
    motion = sp.reconstruct(sp.rigid(inertia, duration), momentum, attitude, tolerance=1e-12)
    times = np.linspace(0.0, duration, 41)
    truth = axisymmetric_attitude(across, along, momentum, attitude @ own.T, times) @ own
    assert apart(motion.attitude(times), truth) < 1e-12
