"""Causes that an audit names, where samples are sparser than steps, noise is coloured, or two things are wrong at once.

The truth is what MuJoCo was given: its step, its bodies, and what was done to its arrays.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfiltfilt
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import ShapeError
from support.flown_bodies import body_of, flown
from support.long_runs import full_but
from support.planted_faults import trajectory


def without_step(name: str, **more) -> sp.FloatingTrajectory:
    """A run of which nobody states the step."""
    return replace(trajectory(name, flown(name, **more)), integrator_step=None)


def names(found: sp.Audit) -> list[str]:
    return [cause.name for cause in found.cause]


@pytest.mark.parametrize("rates", [True, False])
@pytest.mark.parametrize(
    ("name", "every"), full_but([("diver", 2), ("satellite", 5), ("cat_two_halves", 10)], ("cat_two_halves", 10))
)
def test_the_step_of_an_integrator_is_found_in_sparse_samples(name: str, every: int, rates: bool):
    run = without_step(name, seed=3, integrator="euler", step=0.002, every=every, duration=0.8)
    if not rates:
        run = replace(run, rate=None, velocity=None, joint_rates=None)
    found = sp.audit(body_of(name), run, tolerance=1e-4)
    assert names(found) == ["integration step"], found.table()
    assert found.cause[0].values["step"].value == pytest.approx(0.002, rel=0.02)


@pytest.mark.full
def test_a_stated_number_of_steps_has_to_be_that_of_the_drift():
    run = without_step("diver", seed=3, integrator="euler", step=0.002, every=4, duration=0.8)
    assert names(sp.audit(body_of("diver"), run, every=4)) == ["integration step"]
    assert "integration step" not in names(sp.audit(body_of("diver"), run, every=8))
    with pytest.raises(ShapeError, match="every"):
        sp.audit(body_of("diver"), run, every=0)


@pytest.mark.parametrize("velocity", full_but(["angular", "linear"], "angular"))
def test_a_wrong_frame_by_an_euler_integrator_is_two_causes(velocity: str):
    run = without_step("diver", seed=5, integrator="euler", step=0.004, every=3, duration=0.9)
    turned = Rotation.from_quat(run.quaternion)
    if velocity == "angular":
        wrong, cause = replace(run, rate=turned.apply(run.rate)), "angular velocity in world axes"
    else:
        wrong, cause = replace(run, velocity=turned.inv().apply(run.velocity)), "linear velocity in base axes"
    found = sp.audit(body_of("diver"), wrong)
    assert [set(name.split(", and ")) for name in names(found)] == [{cause, "integration step"}], found.table()


@pytest.mark.full
def test_a_wrong_mass_by_an_euler_integrator_is_two_causes():
    run = without_step(
        "diver", seed=5, integrator="euler", step=0.004, every=3, duration=0.9, heavier={"left_arm": 1.5}
    )
    found = sp.audit(body_of("diver"), run)
    assert names(found)[0] == "mass of left_arm, and integration step", found.table()
    assert found.cause[0].values["mass"].value == pytest.approx(50.0, rel=0.05)


def recorded(seed: int, colour) -> sp.FloatingTrajectory:
    """A right run at 100 Hz with noise, and without rates, of which 0.3 s at either end are left out."""
    rng = np.random.default_rng(seed)
    run = without_step("diver", seed=seed, step=0.001, every=10, duration=1.6)
    turned = Rotation.from_quat(run.quaternion) * Rotation.from_rotvec(0.003 * colour(rng.normal(size=(161, 3))))
    noisy = replace(
        run,
        quaternion=turned.as_quat(),
        shapes=run.shapes + 0.003 * colour(rng.normal(size=run.shapes.shape)),
        position=run.position + 0.001 * colour(rng.normal(size=(161, 3))),
        rate=None,
        velocity=None,
        joint_rates=None,
    )
    return noisy.part(30, 131)


@pytest.mark.parametrize("memory", full_but([0.5, 0.8, 0.95], 0.8))
def test_noise_with_memory_raises_no_alarm(memory: float):
    def colour(noise: np.ndarray) -> np.ndarray:
        return np.sqrt(1.0 - memory**2) * lfilter([1.0], [1.0, -memory], noise, axis=0)

    for seed in range(4):
        found = sp.audit(body_of("diver"), recorded(seed, colour), tolerance=1e-4)
        assert not found.wrong, found.table()


@pytest.mark.full
def test_filtered_samples_raise_no_alarm_or_are_named_with_their_cut_off():
    """In eleven of twelve: the powers of noise scatter, and once in a while they do not look like a filter's."""
    unexplained = 0
    for cut_off in (6.0, 10.0, 15.0):
        sections = butter(3, cut_off, fs=100.0, output="sos")
        for seed in range(4):
            run = recorded(seed, lambda x, by=sections: sosfiltfilt(by, x, axis=0))
            found = sp.audit(body_of("diver"), run, tolerance=1e-4)
            unexplained += found.wrong and not found.cause
            assert names(found) in ([], ["samples filtered"]), found.table()
            for cause in found.cause:
                assert cause.values["cut-off"].value == pytest.approx(cut_off, rel=0.4)
    assert unexplained <= 1


def held(
    name: str, step: float, spacing: float, *, seed: int = 3, duration: float = 0.8, **more
) -> sp.FloatingTrajectory:
    """A log at times between the steps, which has the state of the last step."""
    run = without_step(name, seed=seed, step=step, duration=duration, **more)
    times = np.arange(0.0, duration + 1e-9, spacing)
    state = np.floor(times / step + 1e-6).astype(int)
    fields = ("quaternion", "shapes", "position", "rate", "velocity", "joint_rates")
    return replace(run, times=times, **{field: getattr(run, field)[state] for field in fields})


@pytest.mark.parametrize("rates", [True, False])
@pytest.mark.parametrize(
    ("name", "step", "spacing"),
    [("diver", 0.002, 0.005), ("satellite", 0.003, 0.01), ("cat", 0.002, 1.0 / 60.0), ("diver", 0.01, 0.001)],
)
def test_states_held_between_steps_are_named_with_the_step(name: str, step: float, spacing: float, rates: bool):
    run = held(name, step, spacing)
    if not rates:
        run = replace(run, rate=None, velocity=None, joint_rates=None)
    found = sp.audit(body_of(name), run)
    assert names(found) == [f"states held between steps of {1e3 * step:.4g} ms"], found.table()
    assert found.cause[0].values["step between states"].value == pytest.approx(step, rel=1e-6)


@pytest.mark.full
def test_another_cause_is_named_beside_held_states():
    step = sp.audit(body_of("diver"), held("diver", 0.002, 0.005, integrator="euler"))
    assert names(step) == ["integration step, and states held between steps of 2 ms"], step.table()
    mass = sp.audit(body_of("diver"), held("diver", 0.002, 0.005, heavier={"left_arm": 1.3}))
    assert names(mass) == ["mass of left_arm, and states held between steps of 2 ms"], mass.table()
    assert mass.cause[0].values["mass"].value == pytest.approx(30.0, rel=0.02)


@pytest.mark.parametrize("seed", range(4))
def test_states_held_in_noise_have_no_other_cause(seed: int):
    """Noise of a milliradian, while joints move by several in a step."""
    rng, run = np.random.default_rng(seed), held("diver", 0.002, 0.005, seed=seed)
    turned = Rotation.from_quat(run.quaternion) * Rotation.from_rotvec(0.001 * rng.normal(size=(len(run.times), 3)))
    noisy = replace(
        run,
        quaternion=turned.as_quat(),
        shapes=run.shapes + 0.001 * rng.normal(size=run.shapes.shape),
        rate=None,
        velocity=None,
        joint_rates=None,
    )
    assert names(sp.audit(body_of("diver"), noisy)) == ["states held between steps of 2 ms"]


def test_samples_that_are_too_sparse_for_their_rates_are_not_called_right():
    """Euler of 4 ms at every 40 ms: its drift of 0.7 % is less than differences of the samples leave."""
    run = without_step("diver", seed=3, integrator="euler", step=0.004, every=10, duration=1.8)
    found = sp.audit(body_of("diver"), replace(run, rate=None, velocity=None, joint_rates=None))
    assert not found.right, found.table()
    assert found.wrong or "the samples hide changes of the momentum below" in found.verdict


@pytest.mark.full
def test_a_step_that_is_negative_is_not_named_beside_another_cause():
    """Euler backwards in time drifts as a negative step would."""
    run = without_step(
        "diver", seed=5, integrator="euler", step=0.004, every=3, duration=0.9, heavier={"left_arm": 1.5}
    )
    fields = {
        field: sign * getattr(run, field)[::-1]
        for sign, some in ((1.0, ("quaternion", "shapes", "position")), (-1.0, ("rate", "velocity", "joint_rates")))
        for field in some
    }
    found = sp.audit(body_of("diver"), replace(run, times=run.times[-1] - run.times[::-1], **fields), flight="all")
    assert found.wrong
    assert not any("integration step" in name for name in names(found)), found.table()
