"""What a study is made of: grids and draws, which belong to a case, and faults that are named before anything runs."""

from __future__ import annotations

import pickle
import zlib

import numpy as np
import pytest

import shapephase as sp
from shapephase import study as room
from shapephase.errors import InputFileNotFoundError, ShapeError, StudyError, UnknownNameError
from support.study_functions import bend

CAT, LOOP = "cat_two_halves", "kane_scher"
SHAPE = {"alpha": 0.0, "beta": 0.5}
DRAWN = {"momentum": room.Normal([0.0, 0.0, 0.01], 0.003), "masses": room.LogNormal(0.1)}


def drawn(**more):
    return room.Study(CAT, LOOP, DRAWN, **{"parameters": SHAPE, "draws": 1000, "seed": 5, **more})


def test_a_draw_is_that_of_philox_with_the_index_of_the_case_in_its_counter():
    """By NumPy alone: a new generator for each case."""
    key = np.random.SeedSequence(5, spawn_key=(zlib.crc32(b"momentum"),)).generate_state(2, np.uint64)
    for index in (0, 1, 999):
        rng = np.random.Generator(np.random.Philox(counter=[0, 0, index, 0], key=key))
        expected = np.array([0.0, 0.0, 0.01]) + 0.003 * rng.standard_normal(3)
        np.testing.assert_array_equal(drawn().case(index).momentum, expected)


def test_a_draw_depends_on_seed_axis_and_index_only():
    some, other = drawn(), drawn(chunk=7, draws=999, outputs=("turn",))
    indices = np.array([700, 3, 500])
    found = other.some_cases(indices)
    for index, case in zip(indices.tolist(), found, strict=True):
        np.testing.assert_array_equal(case.momentum, some.case(index).momentum)
        np.testing.assert_array_equal(case.masses, some.case(index).masses)
    assert not np.array_equal(drawn(seed=6).case(3).momentum, some.case(3).momentum)
    without = room.Study(CAT, LOOP, {"momentum": DRAWN["momentum"]}, parameters=SHAPE, draws=10, seed=5)
    np.testing.assert_array_equal(without.case(3).momentum, some.case(3).momentum)


@pytest.mark.parametrize(
    ("distribution", "mean", "deviation"),
    [
        (room.Normal(2.0, 0.5), 2.0, 0.5),
        (room.Uniform(1.0, 4.0), 2.5, 3.0 / np.sqrt(12.0)),
        (room.LogNormal(0.2, 3.0), 3.0 * np.exp(0.02), 3.0 * np.exp(0.02) * np.sqrt(np.expm1(0.04))),
        (room.Choice([1.0, 3.0]), 2.0, 1.0),
    ],
)
def test_draws_have_the_moments_of_their_distribution(distribution, mean, deviation):
    """4,000 draws with one seed: the mean within five standard errors, the deviation within a tenth."""
    study = room.Study(CAT, LOOP, {"momentum_x": distribution}, parameters=SHAPE, draws=4000)
    values = study.axis_values(np.arange(4000))["momentum_x"]
    assert abs(values.mean() - mean) < 5.0 * deviation / np.sqrt(4000)
    assert abs(values.std() / deviation - 1.0) < 0.1


def test_directions_and_rotations_are_even():
    """Of even directions the mean of n n^T is a third of the identity; of even rotations the mean is zero."""
    over = {"momentum": room.Directions(2.0), "attitude": room.Rotations()}
    cases = room.Study(CAT, LOOP, over, parameters=SHAPE, draws=3000).some_cases(np.arange(3000))
    momenta = np.array([case.momentum for case in cases])
    np.testing.assert_allclose(np.linalg.norm(momenta, axis=-1), 2.0, rtol=1e-15)
    np.testing.assert_allclose(momenta.T @ momenta / 4.0 / 3000, np.eye(3) / 3.0, atol=0.03)
    attitudes = np.array([case.attitude for case in cases])
    np.testing.assert_allclose(
        attitudes @ np.swapaxes(attitudes, 1, 2), np.broadcast_to(np.eye(3), (3000, 3, 3)), atol=1e-14
    )
    np.testing.assert_allclose(attitudes.mean(axis=0), 0.0, atol=0.06)


def test_grids_make_all_combinations_the_last_one_fastest_and_then_the_draws():
    over = {"beta": [0.4, 0.6], "momentum_z": [0.0, 0.01, 0.02], "masses": room.LogNormal(0.1)}
    study = room.Study(CAT, LOOP, over, parameters={"alpha": 0.0}, draws=2)
    assert (study.cases, study.grid_shape) == (12, (2, 3, 2))
    found = [(case.parameters["beta"], case.momentum[2]) for case in study.some_cases(np.arange(12))]
    assert found == [(beta, z) for beta in (0.4, 0.6) for z in (0.0, 0.01, 0.02) for _ in range(2)]


def test_one_link_has_its_own_draws():
    study = room.Study("cat", "cat_righting", {"masses": [1.0], "masses.head": [2.0, 3.0]})
    heads = [part.links[0] for part in sp.load_body("cat").moving_parts].index("head")
    factors = study.case(1).masses
    assert factors[heads] == 3.0
    assert np.all(np.delete(factors, heads) == 1.0)


def test_a_recipe_is_small_and_comes_back_the_same():
    study = drawn()
    sent = pickle.dumps(study)
    assert len(sent) < 2000
    assert pickle.loads(sent).hash == study.hash


def test_the_hash_tells_studies_apart():
    hashes = {
        drawn(**change).hash
        for change in ({}, {"seed": 6}, {"chunk": 7}, {"draws": 10}, {"tolerance": 1e-8}, {"outputs": ("turn",)})
    }
    assert len(hashes) == 6
    assert drawn().hash == drawn().hash


def test_a_function_is_part_of_the_hash_by_its_text():
    named = room.Study(CAT, bend, {"depth": [0.4]})
    assert named.inputs["motion support.study_functions:bend"]
    by_name = room.Study(CAT, "support.study_functions:bend", {"depth": [0.4]})
    assert by_name.inputs["motion support.study_functions:bend"] == named.inputs["motion support.study_functions:bend"]


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        ({"body": "catt"}, UnknownNameError, "cat"),
        ({"body": "nowhere.urdf"}, InputFileNotFoundError, "nowhere.urdf"),
        ({"motion": "cat_rightin"}, UnknownNameError, "cat_righting"),
        ({"motion": "nowhere.csv"}, InputFileNotFoundError, "nowhere.csv"),
        ({"motion": "no_such_module:path"}, StudyError, "no_such_module"),
        ({"motion": None}, StudyError, "motion"),
        ({"parameters": {"alpha": 0.0}}, StudyError, "beta"),
        ({"parameters": {**SHAPE, "gamma": 0.0}}, StudyError, "gamma"),
        ({"over": {"momentun": [1.0]}}, UnknownNameError, "momentum"),
        ({"over": {"masses.tail": [1.0]}}, UnknownNameError, "tail"),
        ({"over": {"momentum": [1.0, 2.0]}}, StudyError, r"\(3,\)"),
        ({"over": {"momentum_z": []}}, StudyError, "one value"),
        ({"over": {"momentum_z": [float("nan")]}}, ShapeError, "finite"),
        ({"over": {"momentum_z": 3.0}}, StudyError, "grid"),
        ({"over": {"momentum_z": ["much"]}}, ShapeError, "momentum_z"),
        ({"over": {"momentum": room.Normal(0.0, -1.0)}}, ShapeError, "deviation"),
        ({"over": {"momentum": room.Normal([0.0, 1.0], 1.0)}}, ShapeError, "mean"),
        ({"over": {"momentum": room.Rotations()}}, ShapeError, "attitudes"),
        ({"over": {"momentum": [[0.0, 0.0, 1.0]], "momentum_z": [1.0]}}, StudyError, "not both"),
        ({"over": {"tolerance": [1e-3]}}, ShapeError, "tolerance"),
        ({"over": {"gauge": ["bass"]}}, UnknownNameError, "base"),
        ({"over": {"attitude": [[1.0, 1.0, 1.0, 1.0]]}}, ShapeError, "attitude"),
        ({"outputs": ("final_atitude",)}, UnknownNameError, "final_attitude"),
        ({"outputs": ()}, StudyError, "outputs"),
        ({"outputs": ("turn", "turn")}, StudyError, "twice"),
        ({"draws": 0}, StudyError, "draws"),
        ({"draws": 10**10}, StudyError, "draws"),
        ({"chunk": 2.5}, StudyError, "chunk"),
        ({"seed": -1}, StudyError, "seed"),
        ({"time_limit": 0.0}, StudyError, "time_limit"),
        ({"gauge": "bass"}, UnknownNameError, "base"),
    ],
)
def test_faults_are_named_when_a_study_is_made(change, error, said):
    given = {"body": CAT, "motion": LOOP, "over": DRAWN, "parameters": SHAPE, **change}
    with pytest.raises(error, match=said):
        room.Study(given.pop("body"), given.pop("motion"), given.pop("over"), **given)
