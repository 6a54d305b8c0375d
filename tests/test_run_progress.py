"""Progress of a run: the share grows, the text names the phase, it ends at one, and the callback can stop it."""

from __future__ import annotations

from io import StringIO

import numpy as np
import pytest
from rich.console import Console
from rich.progress import Progress

import shapephase as sp
from shapephase import run_progress
from shapephase.cli.progress import Steps
from shapephase.errors import RunStopped

MOMENTUM = np.array([2e-4, 1e-4, 3e-4])


def cat(known: bool = True) -> sp.Deformation:
    body = sp.load_body("cat_two_halves")
    size = np.linspace(0.5, 0.8, body.n_shape)

    def swing(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.sin(2.0 * t)[:, None] * size, 2.0 * np.cos(2.0 * t)[:, None] * size

    if not known:
        return sp.articulated(body, sp.ShapePath.function(swing, 3.0))
    still = np.zeros((len(size), 1))
    return sp.articulated(body, sp.ShapePath.fourier(still[:, 0], still, size[:, None], 3.0).repeated(200))


def reports(deformation: sp.Deformation, momentum, **options) -> tuple[sp.Motion, list[tuple[float, str]]]:
    reported: list[tuple[float, str]] = []
    motion = sp.reconstruct(deformation, momentum, progress=lambda *now: reported.append(now), **options)
    return motion, reported


CASES = {
    "one momentum, many loops": (cat(), MOMENTUM),
    "at rest": (cat(), np.zeros(3)),
    "many momenta": (cat(False), 100.0 * MOMENTUM * np.linspace(0.1, 1.0, 40)[:, None]),
    "a function": (cat(False), MOMENTUM),
}


@pytest.mark.parametrize("case", CASES)
def test_the_share_grows_from_nothing_to_one_and_names_its_phases(case: str):
    deformation, momentum = CASES[case]
    motion, reported = reports(deformation, momentum)
    shares = [share for share, _ in reported]
    assert shares == sorted(shares)
    assert shares[0] == 0.0
    assert shares[-1] == 1.0
    assert len(shares) < 230
    phases = list(dict.fromkeys(text for _, text in reported))
    looked = ["looking at the path"] if case in ("many momenta", "a function") else []
    assert phases == [*looked, "sampling the body", "stepping"]
    np.testing.assert_array_equal(
        motion.final_attitude, sp.reconstruct(deformation, momentum).final_attitude, err_msg="watching changes nothing"
    )


def test_a_look_is_reported_and_is_not_repeated():
    deformation = cat(False)
    assert "looking at the path" in {text for _, text in reports(deformation, MOMENTUM)[1]}
    assert "looking at the path" not in {text for _, text in reports(deformation, MOMENTUM)[1]}


def test_steps_are_reported_while_they_are_taken(monkeypatch):
    """The steps of two hundred loops come in blocks: the share moves within the phase."""
    monkeypatch.setattr("shapephase.integrator.stepping._AT_ONCE", 10)
    reported = reports(*CASES["one momentum, many loops"])[1]
    assert sum(text == "stepping" for _, text in reported) > 10


def test_many_samples_are_taken_in_parts_and_reported(monkeypatch):
    """The parts do not change the samples."""
    from shapephase.integrator import channels

    deformation = cat(False)
    whole = sp.reconstruct(deformation, MOMENTUM)
    monkeypatch.setattr(channels, "_AT_ONCE", 7)
    motion, reported = reports(deformation, MOMENTUM)
    assert sum(text == "sampling the body" for _, text in reported) >= 5
    np.testing.assert_allclose(motion.final_attitude, whole.final_attitude, atol=1e-14)
    assert motion.evaluations == whole.evaluations


@pytest.mark.parametrize("phase", ["looking at the path", "sampling the body", "stepping"])
def test_something_true_stops_the_run_and_leaves_it_repeatable(phase: str):
    deformation = cat(False)
    reported: list[tuple[float, str]] = []

    def stop(share: float, text: str) -> bool:
        reported.append((share, text))
        return text == phase

    with pytest.raises(RunStopped, match=rf"stopped on request while {phase}, with \d+ % done"):
        sp.reconstruct(deformation, MOMENTUM, progress=stop)
    assert [text for _, text in reported].count(phase) == 1
    # Nothing watches any more, and nothing half done was kept.
    assert sp.reconstruct(deformation, MOMENTUM).error_estimate < 1e-9
    assert all(share < 1.0 for share, _ in reported)


def test_what_the_callback_raises_comes_out():
    with pytest.raises(ZeroDivisionError):
        sp.reconstruct(cat(), MOMENTUM, progress=lambda *_: 1 // 0)


def test_split_is_watched_too():
    motion = sp.reconstruct(cat(), MOMENTUM)
    reported: list[tuple[float, str]] = []
    sp.split(motion, progress=lambda *now: reported.append(now))
    assert reported[-1][0] == 1.0
    assert {text for _, text in reported[:-1]} == {"stepping"}
    with pytest.raises(RunStopped):
        sp.split(sp.reconstruct(cat(), MOMENTUM), progress=lambda *_: True)


def test_a_search_for_closed_orbits_is_watched_and_stopped():
    deformation = sp.articulated("cat_two_halves", sp.examples.kane_scher(0.0, 1.0))
    reported: list[tuple[float, str]] = []
    found = sp.phases.fixed_points(deformation, 0.005, progress=lambda *now: reported.append(now))
    shares = [share for share, _ in reported]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    # A search is some dozens of stretches: most reports come before three quarters of the bar are full.
    assert len(shares) > 10
    assert np.median(shares) < 0.75
    np.testing.assert_array_equal(found.directions, sp.phases.fixed_points(deformation, 0.005).directions)
    for search in (sp.phases.fixed_points, sp.phases.closed_orbits):
        with pytest.raises(RunStopped):
            search(deformation, 0.005, progress=lambda *_: True)


def test_stretches_fill_what_is_left():
    """By hand: 0.2 of the run for the first phase, 0.7 of that for its first stretch, and so on."""
    shares: list[float] = []
    with run_progress.watched(lambda share, _: shares.append(share)):
        run_progress.begin(run_progress.LOOKING, 4)
        run_progress.advance(2)
        run_progress.advance(2)
        run_progress.begin(run_progress.LOOKING, 1)
        run_progress.advance(1)
        run_progress.begin(run_progress.STEPPING, 1)
        run_progress.advance(1)
    first = 0.7 * 0.2
    second = first + 0.7 * (0.2 - first)
    assert shares == pytest.approx([0.0, 0.5 * first, first, second, second, second + 0.7 * 0.9 * (1.0 - second), 1.0])
    run_progress.begin(run_progress.STEPPING, 1)
    run_progress.advance(1)
    assert len(shares) == 7


def test_the_bar_moves_within_a_step_of_the_command_line():
    display = Progress(console=Console(file=StringIO()), auto_refresh=False)
    work = Steps(3, display)
    work.begin("loading and reconstructing")
    seen = []
    for share in (0.0, 0.25, 1.0):
        work.watch(share, "stepping")
        seen.append((display.tasks[0].completed, display.tasks[0].description))
    work.begin("splitting")
    seen.append((display.tasks[0].completed, display.tasks[0].description))
    work.watch(1.0, "")
    seen.append((display.tasks[0].completed, display.tasks[0].description))
    assert seen == [(0.0, "stepping"), (0.25, "stepping"), (1.0, "stepping"), (1, "splitting"), (2.0, "splitting")]
    Steps(3).watch(0.5, "stepping")
