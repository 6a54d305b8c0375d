"""The connection on the states of one angular momentum: what it is on the generator, and its exterior derivative."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3, sphere
from shapephase.errors import ShapeError
from shapephase.phases import momentum_connection, momentum_curvature, momentum_generator
from shapephase.rigid_body.lie import sphere_area_form


def states(count, seed=4):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, 3)), so3.exp(rng.normal(size=(count, 3))), rng.normal(size=(2, count, 3))


def test_one_on_the_generator_which_turns_the_body_about_the_momentum_d1_d2():
    """D1 and D2: A(generator) = 1, and the generator moves no momentum in the body."""
    momentum, attitude, _ = states(50)
    generator = momentum_generator(momentum, attitude)
    assert momentum_connection(momentum, attitude, generator) == pytest.approx(np.ones(50), abs=1e-15)
    unit = momentum / np.linalg.norm(momentum, axis=-1, keepdims=True)
    turned = so3.exp(1e-6 * unit) @ attitude
    rate = (turned - so3.exp(-1e-6 * unit) @ attitude) / 2e-6
    assert rate == pytest.approx(attitude @ so3.hat(generator), abs=1e-9)
    before, after = (so3.apply(so3.transpose(one), momentum) for one in (attitude, turned))
    assert after == pytest.approx(before, abs=1e-15 * 10.0)


def test_exterior_derivative_is_the_area_d3():
    """DA(X, Y) = X A(Y) - Y A(X) - A([X, Y]) by central differences, and dS/l^2 of the projected velocities."""
    momentum, attitude, (first, second) = states(50)
    step = 1e-5

    def along(direction, other):
        ends = (attitude @ so3.exp(sign * step * direction) for sign in (1.0, -1.0))
        ahead, behind = (momentum_connection(momentum, end, other) for end in ends)
        return (ahead - behind) / (2.0 * step)

    # Left-invariant fields: [X, Y] = X x Y.
    bracket = momentum_connection(momentum, attitude, np.cross(first, second))
    derivative = along(first, second) - along(second, first) - bracket
    curvature = momentum_curvature(momentum, attitude, first, second)
    assert curvature == pytest.approx(derivative, abs=1e-8)
    pi = so3.apply(so3.transpose(attitude), momentum)
    area = sphere_area_form(pi, np.cross(pi, first), np.cross(pi, second))
    assert curvature == pytest.approx(area / np.sum(momentum**2, axis=-1), rel=1e-12)


def test_stokes_over_a_loop_of_attitudes_d3_d6():
    """The integral of A round a closed loop of states is the solid angle of their momenta, of any size."""
    momentum, (attitude,) = np.array([0.3, -0.4, 1.2]), states(1)[1]

    def at(t):
        angles = 2.0 * np.pi * t[:, None] * np.array([1.0, 1.0, 2.0])
        return attitude @ so3.exp(np.array([0.7, 0.5, 0.3]) * np.sin(angles + np.array([0.0, 1.2, 0.4])))

    t, step = np.arange(400) / 400.0, 1e-5
    loop = at(t)
    rate = so3.log(so3.transpose(at(t - step)) @ at(t + step)) / (2.0 * step)
    turned = np.mean(momentum_connection(momentum, loop, rate))
    pi = so3.apply(so3.transpose(at(np.arange(4001) / 4000.0)), momentum) / np.linalg.norm(momentum)
    # The sum of the dynamic phase and minus the area is the phase of a loop that closes: none.
    assert so3.wrap(turned - sphere.polygon_area(pi[:-1])) == pytest.approx(0.0, abs=1e-5)


def test_along_a_motion_it_is_the_dynamic_phase_d2():
    top = sp.EulerTop(np.diag([1.0, 2.0, 3.0]), [0.3, 0.4, 1.2])
    times = np.linspace(0.0, 3.0, 11)
    rates = momentum_connection(top.momentum, top.attitude(times), top.angular_velocity(times))
    assert rates == pytest.approx(np.full(11, 2.0 * top.energy / top.magnitude), rel=1e-13)


def test_wrong_arguments_get_a_sentence():
    with pytest.raises(ShapeError, match="direction"):
        momentum_generator(np.zeros(3), np.eye(3))
    with pytest.raises(ShapeError):
        momentum_connection([1.0, 0.0, 0.0], np.eye(3), [1.0, 0.0])
    with pytest.raises(ShapeError):
        momentum_curvature([1.0, 0.0, 0.0], np.eye(2), [1.0, 0.0, 0.0], [1.0, 0.0, 0.0])
