"""What the benchmarks stand on: the compiled peer, the attitudes in extended precision, the judged estimates."""

from __future__ import annotations

import re

import numpy as np
import pytest
from benchmarks.cases import as_function, numbered_case
from benchmarks.contestant import Contestant, Setting, WorkloadFailed
from benchmarks.estimates import judged, judged_all, read_runs, summary
from benchmarks.extended import CONSTANT, HARMONIC, Segment, Terms, TooLong, Truth, angles_between, exact_path
from benchmarks.page import PAGE, RESULTS, circumstances, section, with_results
from benchmarks.peer import NoPeer, Peer
from benchmarks.planners.rest_to_rest import Turn, hermite

import shapephase as sp
from shapephase.examples import cat_righting
from support.compiler import needs_compiler
from support.long_runs import full_but


@pytest.mark.full
@needs_compiler
@pytest.mark.parametrize("number", [0, 1, 7])
def test_the_peer_agrees_with_extended_precision_and_with_the_library(number: int):
    """A Fourier loop, the cat's righting and a spline: at 1e-11 within a hundred times that at every step."""
    case = numbered_case(number)
    exact = exact_path(case.path)
    try:
        steps = Peer(case.body, case.path, case.path.breaks, case.momentum).steps(1e-11)
    except NoPeer as missing:
        pytest.skip(str(missing))
    truth, _ = Truth(case.body).attitudes(exact, exact.breaks, case.momentum, steps.times)
    assert steps.error(truth) < 1e-9
    motion = sp.reconstruct(sp.articulated(case.body, case.path), case.momentum, tolerance=1e-10)
    assert angles_between(truth, motion.attitude(steps.times)).max() <= motion.error_estimate


@needs_compiler
def test_extended_precision_follows_segments_as_it_follows_the_whole():
    """A loop three times, with momentum and at rest, is a loop of three periods; there and back leads home at rest."""
    body = sp.load_body("cat_two_halves")
    truth, times = Truth(body), np.linspace(0.1, 3.0, 7)
    rng = np.random.default_rng(0)
    rows = [(HARMONIC, i, 0.5, 0.0, 0.0, 2.0 * np.pi, phase) for i, phase in enumerate(rng.uniform(0.0, 6.0, 3))]
    terms = Terms(3, np.array([*rows, (CONSTANT, 0, 0.3, 0.0, 0.0, 0.0, 0.0)]))
    loop = Segment(terms, np.array([0.0, 1.0]), 1.0)
    for momentum in (np.zeros(3), np.array([0.1, 0.3, -0.2])):
        whole, bound = truth.attitudes(terms, np.array([0.0, 3.0]), momentum, times)
        parts, of_parts = truth.along([loop, loop, loop], momentum, times)
        gap = np.minimum(np.abs(whole - parts).max(axis=1), np.abs(whole + parts).max(axis=1))
        # Times and frequencies are doubles; the phase of a loop is known to the rounding of its start.
        assert gap.max() < bound + of_parts + 1e-14
    back = Segment(terms, np.array([0.0, 0.6]), 0.6, origin=0.6, pace=-1.0)
    home, _ = truth.along([Segment(terms, np.array([0.0, 0.6]), 0.6), back], np.zeros(3), np.array([0.6, 1.2]))
    assert abs(float(home[1, 3])) == pytest.approx(1.0, abs=1e-16)
    assert np.abs(home[1, :3]).max() < 1e-15 < 1e-3 < np.abs(home[0, :3]).max()
    slow = Segment(terms, np.array([0.0, 5.0]), 5.0, pace=0.2)
    late, _ = truth.along([slow], np.zeros(3), 5.0 * np.array([0.3, 1.0]))
    soon, _ = truth.attitudes(terms, np.array([0.0, 1.0]), np.zeros(3), np.array([0.3, 1.0]))
    assert np.abs(late - soon).max() < 1e-15
    with pytest.raises(TooLong):
        truth.along([loop] * 50, np.array([0.1, 0.3, -0.2]), np.array([50.0]), most_steps=20)


@pytest.mark.full
@needs_compiler
def test_polynomials_for_the_extended_precision_follow_the_cat():
    """To the rounding of its path, whose roll is the angle of two numbers that nearly vanish together half way."""
    path = cat_righting()
    times, exact = np.linspace(0.0, path.duration, 301), exact_path(path)
    np.testing.assert_allclose(exact.shape(times), path.shape(times), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(exact.rate(times), path.rate(times), rtol=0.0, atol=1e-8)


@needs_compiler
@pytest.mark.parametrize("family", full_but(["harmonics", "mixed"], "mixed"))
def test_no_error_is_above_its_estimate(family: str, tmp_path):
    """A sample of `python -m benchmarks.estimates`, and that a file of runs is taken up where it ends."""
    kept = tmp_path / "runs"
    runs = list(judged_all(family, 12, seed=5, most=0.3, kept=kept))
    assert not [run for run in runs if run.above > 1.0]
    assert sum(run.outcome == "done" for run in runs) >= 8
    kept.write_text(kept.read_text()[:-40])
    again = list(judged_all(family, 12, seed=5, most=0.3, kept=kept))
    assert len(read_runs(kept)) == len(again) == 12
    assert {run.number: run.error for run in again} == pytest.approx({r.number: r.error for r in runs}, nan_ok=True)
    assert summary(family, again).startswith(f"{family}, seed 5: 12 runs, ")


@pytest.mark.full
@needs_compiler
@pytest.mark.parametrize("family", ["harmonics", "mixed"])
def test_no_error_of_sixty_runs_is_above_its_estimate(family: str):
    runs = [judged(family, 6, 1.0, number) for number in range(60)]
    assert not [run for run in runs if run.above > 1.0]
    assert sum(run.outcome == "done" for run in runs) >= 50


@pytest.mark.full
def test_a_contestant_reconstructs_in_its_own_process_what_is_reconstructed_here():
    """Known and as a black box, to the two estimates, and faults come back as text."""
    case, times = numbered_case(0), np.array([0.3, 1.0])
    contestant = Contestant(Setting("plain"))
    try:
        for box in (False, True):
            attitudes, estimate, evaluations = contestant("reconstructed", 0, box, 1e-9, times)
            path = as_function(case.path) if box else case.path
            motion = sp.reconstruct(sp.articulated(case.body, path), case.momentum, tolerance=1e-10)
            gap = np.linalg.norm(attitudes - motion.attitude(times), axis=(1, 2)).max() / np.sqrt(2.0)
            assert gap <= estimate + motion.error_estimate <= 1.1e-9
            assert 10 < evaluations < 1000
            assert contestant("reconstruction_seconds", 0, box, 1e-9, 1) > 0.0
        with pytest.raises(WorkloadFailed, match="plain"):
            contestant("no_such_thing")
    finally:
        contestant.close()


# ---- Plans by other programs -----------------------------------------------------------------------------------------


def test_the_peers_paths_are_the_cubics_that_they_found():
    """Three nodes of a cubic in time, where both interpolate exactly, against the cubic itself."""
    body = sp.load_body("cat_two_halves")
    turn = Turn(body, np.eye(3), 2.0, 2, 1.0)
    cubic = np.polynomial.Polynomial([0.1, -0.2, 0.05, 0.3])
    nodes, sizes = np.linspace(0.0, 2.0, 3), np.array([1.0, -0.5, 0.2])
    path = turn.path(hermite(np.outer(cubic(nodes), sizes), np.outer(cubic.deriv()(nodes), sizes), turn.step))
    times = np.linspace(0.0, 2.0, 41)
    np.testing.assert_allclose(path.shape(times), np.outer(cubic(times), sizes), rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(path.rate(times), np.outer(cubic.deriv()(times), sizes), rtol=0.0, atol=1e-14)


def test_the_peers_first_guess_rests_at_both_ends_and_its_rates_are_its_slopes():
    turn = Turn(sp.load_body("cat_two_halves"), np.eye(3), 2.0, 40, 1.0)
    places = np.linspace(0.0, 1.0, 4001)
    shapes, rates, accelerations = turn.first_guess(places)
    np.testing.assert_allclose(rates[[0, -1]], 0.0, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(shapes[[0, -1]], turn.body.shape()[None].repeat(2, axis=0), rtol=0.0, atol=1e-14)
    for values, slopes in ((shapes, rates), (rates, accelerations)):
        found = np.gradient(values, 2.0 * places, axis=0, edge_order=2)
        np.testing.assert_allclose(found, slopes, rtol=0.0, atol=1e-5 * np.abs(slopes).max())


# ---- The page -------------------------------------------------------------------------------------------------------


def test_the_page_has_the_results_that_were_kept():
    results = RESULTS.read_text(encoding="utf-8")
    page = PAGE.read_text(encoding="utf-8")
    assert with_results(page, results) == page
    assert re.search(r"^Measured on 20\d\d-\d\d-\d\d on .+, with shapephase [\d.]+, Python 3\.", page, re.MULTILINE)
    # The table, from the rows of the cases: the first ratio of ours, its medians by the kind of path.
    ratios: dict[str, list[float]] = {"loop": [], "move": [], "samples": [], "": []}
    for line in results.splitlines():
        if found := re.match(r"(.{38})known .*?(\d+\.\d\d) +\d+\.\d\d +\d+$", line):
            for kind in ratios:
                ratios[kind] += [float(found[2])] * (kind in found[1])
    assert len(ratios[""]) == 17
    medians = [f"{np.median(values):.1f}" for values in ratios.values()]
    (row,) = re.findall(r"^\| the path as it is \|(.*)\|$", page, re.MULTILINE)
    assert [cell.split()[0] for cell in row.split("|")] == medians


def test_circumstances_are_said_as_the_page_reads_them():
    said = circumstances()
    assert [line.split(":")[0] for line in said] == ["date", "machine", "versions"]
    kept = RESULTS.read_text(encoding="utf-8").splitlines()
    assert (
        section("\n".join([*said, *kept[3:]])).splitlines()[0].endswith(f"with {said[2].removeprefix('versions: ')}.")
    )
