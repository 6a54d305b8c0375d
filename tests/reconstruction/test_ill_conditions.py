"""Bodies far from any scale: the estimate of the error holds, against 80-bit arithmetic, or a refusal says why."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.extended import Segment, TooLong, Truth, angles_between

import shapephase as sp
from shapephase.errors import ShapePhaseError
from support.bodies import joint, link, urdf

# Such bodies are told of when they are loaded.
pytestmark = pytest.mark.filterwarnings("ignore::shapephase.UnphysicalInertiaWarning")
# Of the truth: what needs more is at the end of its 80 bits.
MOST_STEPS = 300
TIMES = np.linspace(0.0, 1.0, 7)[1:]
AXES = np.eye(3)


def box(mass, sides):
    """Moments of a box about its centre."""
    a, b, c = np.square(sides)
    return mass / 12.0 * np.array([b + c, a + c, a + b])


def tree(masses, sizes, places, slender=1.0):
    """A trunk with two arms that turn and a mass that slides; sizes [m], and how slender they are."""
    shapes = [size * np.array([1.0, slender, slender]) for size in sizes]
    links = [
        link(name, mass, box(mass, sides), (0.1 * sides[0], 0.05 * sides[1], 0.0))
        for name, mass, sides in zip(("trunk", "arm", "hand", "slider"), masses, shapes, strict=True)
    ]
    joints = [
        joint("shoulder", "continuous", "trunk", "arm", AXES[1], places[0]),
        joint("wrist", "continuous", "arm", "hand", AXES[0], places[1]),
        joint("rail", "prismatic", "trunk", "slider", AXES[2], places[2])
        .replace('"10"', '"1e5"')
        .replace('"-10"', '"-1e5"'),
    ]
    return urdf(*links, *joints)


NEAR = ((0.3, 0.1, 0.0), (0.4, 0.0, 0.1), (-0.2, 0.3, 0.1))
FAR = ((0.3, 0.1, 0.0), (0.4, 0.0, 0.1), (3000.0, -2000.0, 1000.0))
SIZES = (0.5, 0.4, 0.3, 0.2)
CASES = {
    "a slider kilometres out": (tree((10.0, 2.0, 1.0, 5.0), SIZES, FAR), 0.2),
    "micrograms": (tree(1e-9 * np.array([10.0, 2.0, 1.0, 5.0]), 1e-3 * np.array(SIZES), 1e-3 * np.array(NEAR)), 2e-4),
    "a billion kilograms": (tree((6e8, 1e8, 5e7, 3e8), 100.0 * np.array(SIZES), 100.0 * np.array(NEAR)), 20.0),
    "a milligram beside a kiloton": (tree((1e6, 1e-3, 1e-6, 1e3), (5.0, 0.1, 0.01, 1.0), NEAR), 0.2),
    "a kiloton at a gram": (tree((1e-3, 1.0, 1e6, 1e-3), (0.1, 0.4, 5.0, 0.01), NEAR), 0.2),
    "a needle": (tree((10.0, 1e-9, 1e-9, 1e-9), (1.0, 1e-2, 1e-2, 1e-2), 1e-3 * np.array(NEAR), 1e-4), 1e-4),
}  # fmt: skip


def swing(body, slide, rng=None):
    """A loop of two harmonics: radians, and so many metres on the rail."""
    rng = np.random.default_rng(11) if rng is None else rng
    size = np.array([slide if name == "rail" else 0.7 for name in body.joint_names])[:, None]
    cosines, sines = size * rng.uniform(-1.0, 1.0, (3, 2)), size * rng.uniform(-1.0, 1.0, (3, 2))
    return sp.ShapePath.fourier(0.1 * size[:, 0], cosines, sines, 1.0, joint_names=body.joint_names)


def judged(body, path, turns, tolerance, direction=(0.3, -0.5, 0.8)):
    """Error and estimate of a motion that turns about so often at most, or the refusal."""
    deformation = sp.articulated(body, path)
    least = np.linalg.eigvalsh(deformation.inertia(np.linspace(0.0, 1.0, 41))).min()
    momentum = 2.0 * np.pi * turns * least * np.array(direction) / np.linalg.norm(direction)
    try:
        motion = sp.reconstruct(deformation, momentum, tolerance=tolerance)
    except ShapePhaseError as refusal:
        return refusal
    try:
        segment = Segment(path, path.breaks, path.duration)
        exact, bound = Truth(body).along([segment], momentum, TIMES, MOST_STEPS)
    except TooLong:
        coarse, exact = (by_small_steps(body, path, momentum, count) for count in (600, 1200))
        # The error of the finer ones is a fifteenth of the difference.
        bound = 2.0 * float(np.linalg.norm((exact - coarse).astype(float), axis=1).max())
    error = float(angles_between(exact, motion.attitude(TIMES)).max())
    return error, float(motion.error_estimate), bound


def by_small_steps(body, path, momentum, count):
    """Quaternions x y z w at `TIMES` by Runge and Kutta's steps in long double, for what 80 bits do not get to 1e-17.

    Inertias and momenta come from the truth, in long double too, at shapes in double precision.
    """
    times = np.linspace(0.0, 1.0, 2 * count + 1)
    both = Truth(body).inertia_and_momentum(path.shape(times), path.rate(times))
    inertia, internal = both[:, :9].reshape(-1, 3, 3), both[:, 9:]
    a, b, c = inertia[:, 0], inertia[:, 1], inertia[:, 2]
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-1)
    inverse = cofactors / np.sum(a * cofactors[..., 0], axis=1)[:, None, None]
    spatial, step = np.asarray(momentum, dtype=np.longdouble), np.longdouble(1.0) / count
    drift = np.einsum("nij,nj->ni", inverse, internal)

    def rate(at, q):
        v, w = q[:3] / np.sqrt(q @ q), q[3] / np.sqrt(q @ q)
        # The momentum seen from the body: turned back.
        seen = spatial - 2.0 * w * np.cross(v, spatial) + 2.0 * np.cross(v, np.cross(v, spatial))
        omega = inverse[at] @ seen - drift[at]
        return 0.5 * np.append(q[3] * omega + np.cross(q[:3], omega), -(q[:3] @ omega))

    q, found = np.array([0.0, 0.0, 0.0, 1.0], dtype=np.longdouble), []
    for k in range(count):
        first = rate(2 * k, q)
        second = rate(2 * k + 1, q + 0.5 * step * first)
        third = rate(2 * k + 1, q + 0.5 * step * second)
        last = rate(2 * k + 2, q + step * third)
        q = q + step / 6.0 * (first + 2.0 * second + 2.0 * third + last)
        q = q / np.sqrt(q @ q)
        if (k + 1) % (count // len(TIMES)) == 0:
            found.append(q)
    return np.array(found)


def holds(outcome, tolerance):
    """An estimate within the tolerance that covers the error, or a refusal that says how much is left, and of what."""
    if isinstance(outcome, ShapePhaseError):
        assert any(words in str(outcome) for words in ("and rounding", "turns up to", "rad is left")), outcome
        return False
    error, estimate, bound = outcome
    assert estimate <= tolerance
    assert error <= estimate + bound
    return True


@pytest.mark.parametrize("name", CASES)
def test_the_estimate_holds_or_a_refusal_says_why(load_urdf, name):
    text, slide = CASES[name]
    body = load_urdf(text)
    assert holds(judged(body, swing(body, slide), 1.5, 1e-6), 1e-6)


@pytest.mark.full
@pytest.mark.parametrize("tolerance", [1e-8, 1e-7, 1e-6])
@pytest.mark.parametrize("name", [name for name in CASES if name != "a slider kilometres out"])
def test_it_holds_where_rounding_is_small_with_and_without_momentum(load_urdf, name, tolerance):
    text, slide = CASES[name]
    body = load_urdf(text)
    for turns in (0.0, 0.5, 1.5):
        holds(judged(body, swing(body, slide), turns, tolerance), tolerance)


def test_what_is_only_large_or_small_is_as_exact_as_any(load_urdf):
    """Units of mass and length do not matter where all of a body has them."""
    for name in ("micrograms", "a billion kilograms"):
        text, slide = CASES[name]
        body = load_urdf(text)
        assert holds(judged(body, swing(body, slide), 1.5, 1e-9), 1e-9)


@pytest.mark.full
@pytest.mark.parametrize("seed", range(60))
def test_random_bodies_of_all_scales(load_urdf, seed):
    rng = np.random.default_rng([7, seed])
    masses = 10.0 ** rng.uniform(-9.0, 9.0, 4) if seed % 2 else 10.0 ** (rng.uniform(-6.0, 6.0) + rng.uniform(-1, 1, 4))
    scale = 10.0 ** rng.uniform(-3.0, 3.0)
    sizes = scale * 10.0 ** rng.uniform(-1.5, 0.5, 4)
    places = scale * 10.0 ** rng.uniform(-1.0, 1.0, (3, 1)) * rng.normal(size=(3, 3))
    body = load_urdf(tree(masses, sizes, places, 10.0 ** rng.uniform(-4.0, 0.0)))
    path = swing(body, scale * 10.0 ** rng.uniform(-2.0, 1.0), rng)
    tolerance = float(rng.choice([1e-6, 1e-8, 1e-9, 1e-10]))
    holds(judged(body, path, float(rng.choice([0.0, 0.3, 2.0])), tolerance, rng.normal(size=3)), tolerance)
