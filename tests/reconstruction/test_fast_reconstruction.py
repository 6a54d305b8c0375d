"""Motions in machine code are those without it: the same samples and steps, attitudes to rounding."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.examples.scenarios import MOTIONS
from support.bodies import random_loop, random_shapes
from support.long_runs import full_but

pytestmark = pytest.mark.usefixtures("fast")
EPS = np.finfo(float).eps


def both(monkeypatch, compute):
    """What is computed with machine code and without."""
    found = []
    for value in ("1", "0"):
        monkeypatch.setenv("SHAPEPHASE_FAST", value)
        found.append(compute())
    return found


def same(with_it, without, *, rounding):
    """Samples, steps, attitudes, phases and estimates of two motions."""
    assert with_it.evaluations == without.evaluations
    for (rows, part), (others, other) in zip(with_it.parts, without.parts, strict=True):
        assert np.array_equal(rows, others)
        same_part(part, other, rounding=rounding)


def same_part(with_it, without, *, rounding):
    """Of motions that share samples and steps."""
    times = np.linspace(0.0, without.duration, 9)
    growth = rounding * EPS * float(np.max(without.amplification)) * (1.0 + without.solution.quaternions.shape[1])
    assert np.array_equal(with_it.solution.steps, without.solution.steps)
    assert np.abs(with_it.solution.quaternions - without.solution.quaternions).max() < growth
    assert np.abs(with_it.attitude(times) - without.attitude(times)).max() < 4.0 * growth
    assert np.abs(with_it.dynamic_phase(times) - without.dynamic_phase(times)).max() < 4.0 * growth
    # Estimates are differences of attitudes, and of the order of rounding where the tolerance is.
    gap = np.abs(np.asarray(with_it.error_estimate) - np.asarray(without.error_estimate))
    assert gap.max() < growth + 1e-6 * np.max(without.error_estimate)


def magnitude(deformation):
    """A momentum that turns the body some radians [kg m^2/s]."""
    return 4.0 / deformation.duration * float(np.trace(deformation.inertia(0.0))) / 3.0


@pytest.mark.parametrize("tolerance", full_but([1e-6, 1e-9, 1e-11], 1e-6, 1e-11))
@pytest.mark.parametrize("kind", ["loop", "three loops", "move", "function"])
def test_motions_of_all_kinds(body, rng, monkeypatch, kind, tolerance):
    if kind == "move":
        path = sp.ShapePath.waypoints([0.0, 0.4, 1.0], random_shapes(body, rng, 3))
    else:
        path = random_loop(body, rng)
    if kind == "three loops":
        path = path.repeated(3)
    if kind == "function":
        path = sp.ShapePath.function(path.curve, path.duration)
    deformation = sp.articulated(body, path)
    for momentum in (magnitude(deformation) * rng.normal(size=3), np.zeros(3)):
        same(*both(monkeypatch, lambda m=momentum: sp.reconstruct(deformation, m, tolerance=tolerance)), rounding=100.0)


@pytest.mark.parametrize("name", sorted(MOTIONS))
def test_named_motions(name, rng, monkeypatch):
    named = MOTIONS[name]
    deformation = sp.articulated(sp.load_body(named.body), named.path())
    momentum = magnitude(deformation) * rng.normal(size=3)
    same(*both(monkeypatch, lambda: sp.reconstruct(deformation, momentum)), rounding=100.0)


@pytest.mark.parametrize("count", [2, 60])
def test_many_momenta(rng, monkeypatch, count):
    """One of them zero."""
    body = sp.load_body("cat")
    deformation = sp.articulated(body, random_loop(body, rng))
    momenta = magnitude(deformation) * rng.normal(size=(count, 3))
    momenta[1] = 0.0
    same(*both(monkeypatch, lambda: sp.reconstruct(deformation, momenta)), rounding=100.0)


def test_many_turns(rng, monkeypatch):
    """Steps far below a turn, whose errors grow."""
    body = sp.load_body("satellite")
    deformation = sp.articulated(body, random_loop(body, rng))
    momentum = 100.0 * magnitude(deformation) * rng.normal(size=3)
    same(*both(monkeypatch, lambda: sp.reconstruct(deformation, momentum, tolerance=1e-7)), rounding=1000.0)


def test_what_is_refused_is_refused_in_the_same_words(rng, monkeypatch):
    body = sp.load_body("cat_two_halves")
    deformation = sp.articulated(body, random_loop(body, rng))
    said = []
    for value in ("1", "0"):
        monkeypatch.setenv("SHAPEPHASE_FAST", value)
        with pytest.raises(sp.errors.AccuracyNotReached) as raised:
            sp.reconstruct(deformation, 1e7 * magnitude(deformation) * rng.normal(size=3))
        said.append(str(raised.value).split(",")[0].split(" in ")[-1])
    assert said[0] == said[1]
