"""Figures by name, the report's numbers, progress on a terminal only, and commands that write pictures."""

from __future__ import annotations

import html
import re
import signal
import subprocess
import sys
import time
from itertools import cycle, product

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.cli import progress
from shapephase.cli.main import main
from shapephase.errors import ShapeError, UnknownNameError
from shapephase.examples import cat_righting, satellite_sweep
from shapephase.plots import FIGURES, report, write_figure
from shapephase.plots.pages.report_data import continued_rotation_vectors
from shapephase.plots.pages.report_page import figure_rows
from support.bodies import random_loop
from support.browser import furred, opened, seen
from support.long_runs import full_but
from support.pages import page_data
from support.terminals import on_a_terminal

MAGIC = {"svg": b"<?xml", "pdf": b"%PDF-", "png": b"\x89PNG"}


@pytest.fixture(scope="module")
def sweep():
    path = satellite_sweep()
    deformation = sp.articulated(sp.load_body("satellite"), path)
    return path, sp.reconstruct(deformation, [0.5, 0.2, 1.0]), sp.reconstruct(deformation, np.zeros(3))


@pytest.fixture(scope="module")
def moving_report(sweep, tmp_path_factory):
    """Folder, page and all that was said of the report of the body with angular momentum."""
    folder, told = tmp_path_factory.mktemp("moving"), []
    path, moving, _ = sweep
    options = {"shape_path": path, "title": "a <satellite>", "progress": lambda *now: told.append(now)}
    report(moving, sp.split(moving), **options).write(folder / "report.html")
    return folder, (folder / "report.html").read_text(encoding="utf-8"), told


@pytest.mark.parametrize(("kind", "ending"), full_but(product(FIGURES, MAGIC), *zip(FIGURES, cycle(MAGIC))))
def test_every_figure_is_an_image(sweep, kind, ending, tmp_path):
    path, moving, _ = sweep
    out = tmp_path / f"figure.{ending}"
    write_figure(kind, moving, out, path)
    assert out.read_bytes().startswith(MAGIC[ending])
    if ending == "svg":
        assert b"<dc:date>" not in out.read_bytes()


def test_figures_that_would_show_nothing_are_refused(sweep, tmp_path):
    path, moving, resting = sweep
    with pytest.raises(UnknownNameError, match="momentum"):
        write_figure("phase", moving, tmp_path / "figure.svg", path)
    with pytest.raises(UnknownNameError, match="svg"):
        write_figure("phases", moving, tmp_path / "figure.jpg", path)
    for kind in ("momentum", "phases", "energy"):
        with pytest.raises(ShapeError, match="momentum"):
            write_figure(kind, resting, tmp_path / "figure.svg", path)
    with pytest.raises(ShapeError, match="joints"):
        write_figure("shape", moving, tmp_path / "figure.svg")
    assert not list(tmp_path.iterdir())


def text_of(page):
    """What a reader sees, without the animation and the pictures."""
    page = re.sub(r'<script.*?</script>|src="data:[^"]*"|<style>.*?</style>', "", page, flags=re.DOTALL)
    return html.unescape(re.sub(r"<[^>]+>", " ", page))


def test_rows_of_figures_have_no_holes():
    for count in range(1, 12):
        rows = figure_rows(list(range(count)))
        assert [figure for row in rows for figure in row] == list(range(count))
        assert all(len(row) in (2, 3) for row in rows) or count == 1
        # Figures of a row of three are smaller: at most one, and not that of the momentum, which is the first.
        assert [len(row) for row in rows[:-1]] == [2] * (len(rows) - 1)
    assert figure_rows([]) == []


@pytest.mark.usefixtures("no_pictures")
def test_the_report_of_a_rigid_body_does_not_speak_of_its_shape(tmp_path):
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    report(motion, sp.split(motion)).write(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "The body is rigid and turns for 4 s." in page
    assert "The shape alone" not in page
    assert "Internal momentum" not in page
    assert [row.count("<figure") for row in re.findall(r'<div class="row">(.*?)</div>', page, re.DOTALL)] == [2]


@pytest.mark.full
def test_a_report_shows_each_figure_once(moving_report):
    """Momentum, phases, attitude and joints as curves that move; the others as pictures, in full rows."""
    folder, page, _ = moving_report
    data = page_data(folder / "report.html")
    assert data["directions"] is not None
    titles = [plot["title"].split(",")[0] for plot in data["plots"]]
    assert titles[:2] == ["phases so far", "turn since the start"]
    assert "joints that turn" in titles
    drawn = re.findall(r"<figcaption>(.*?)</figcaption>", page)
    others = ("torques", "inertia", "internal_momentum", "energy", "loop")
    assert drawn == [FIGURES[kind].caption for kind in others]
    apart = ("curvature", "reach", "contributions", "segment_momentum")  # by the command line and `Motion.plot` only
    assert set(FIGURES) == {"somersault", "momentum", "phases", "attitude", "shape", *others, *apart}
    assert [row.count("<figure") for row in re.findall(r'<div class="row">(.*?)</div>', page, re.DOTALL)] == [2, 3]


@pytest.mark.full
def test_a_report_has_the_loop_of_a_path_that_closes(tmp_path):
    body = sp.load_body("cat_two_halves")
    opened_path = sp.ShapePath.waypoints([0.0, 1.0], [[0.0, 0.0, 0.0], [0.3, 0.2, 0.1]], joint_names=body.joint_names)
    for path, there in ((sp.examples.kane_scher(0.0, 0.5), True), (opened_path, False)):
        motion = sp.reconstruct(sp.articulated(body, path), [0.0, 0.0, 0.01])
        report(motion, sp.split(motion), shape_path=path).write(tmp_path / "report.html")
        page = (tmp_path / "report.html").read_text(encoding="utf-8")
        assert (FIGURES["loop"].caption in page) == there


@pytest.mark.usefixtures("no_pictures")
def test_somersault_tilt_and_twist_come_first_of_a_person(tmp_path):
    """The satellite of the test above has wings named left and right, but neither arms nor legs."""
    body = sp.load_body("diver")
    path = sp.ShapePath.fourier(np.zeros(2), 0.3 * np.ones((2, 1)), np.array([[0.2], [0.1]]), 1.0)
    motion = sp.reconstruct(sp.articulated(body, path), [0.0, 50.0, 0.0])
    report(motion, sp.split(motion), shape_path=path).write(tmp_path / "report.html")
    drawn = re.findall(r"<figcaption>(.*?)</figcaption>", (tmp_path / "report.html").read_text(encoding="utf-8"))
    assert drawn[0] == "Somersault, tilt and twist"
    assert len(drawn) == 6


def test_somersault_has_bands_of_two_standard_deviations_and_other_figures_refuse_errors(tmp_path):
    path = sp.ShapePath.fourier(np.zeros(2), 0.3 * np.ones((2, 1)), np.array([[0.2], [0.1]]), 1.0)
    motion = sp.reconstruct(sp.articulated("diver", path), [0.0, 50.0, 0.0])
    times, errors = np.linspace(0.0, 1.0, 61), {"momentum": 0.5, "attitude": 0.02}
    ax = sp.plots.plot_somersault(sp.plots.column_axes(), motion, times=times, **errors)
    bars = sp.error_bars.somersault_bars(motion, times, **errors)
    angles = motion.somersault_tilt_twist(times)
    for band, text, angle, bar in zip(ax.collections, ax.get_legend().get_texts(), angles, bars, strict=True):
        (drawn,) = band.get_paths()
        for edge in (angle - 2.0 * bar, angle + 2.0 * bar):
            for corner in np.stack([times, edge], axis=1):
                assert np.abs(drawn.vertices - corner).max(axis=1).min() < 1e-9
        assert text.get_text().endswith(f"± {2.0 * np.degrees(bar.max()):.2g}°")
    with pytest.raises(ShapeError, match="somersault"):
        sp.plots.write_figure("attitude", motion, tmp_path / "a.svg", errors=errors)


@pytest.mark.full
@pytest.mark.parametrize("momentum", [True, False])
def test_the_report_says_what_the_split_says(sweep, tmp_path, momentum, request):
    path, moving, resting = sweep
    motion = moving if momentum else resting
    result = sp.split(motion)
    if momentum:
        folder, page, told = request.getfixturevalue("moving_report")
    else:
        folder, told = tmp_path, []
        page = report(motion, result, shape_path=path, title="a <satellite>", progress=lambda *now: told.append(now))
        page.write(folder / "report.html")
        page = (folder / "report.html").read_text(encoding="utf-8")
    text = text_of(page)
    assert "a <satellite>" in text
    assert len(page) < 6e6
    assert page.count("<figure") == (5 if momentum else 4)
    shares, steps = zip(*told)
    assert shares == tuple(np.arange(len(told)) / len(told))
    assert len(steps) == page.count("<figure") + 1
    assert f"{np.degrees(so3.angle(result.total_rotation)):.6f}°" in text
    assert f"{np.degrees(so3.angle(result.holonomy)):.6f}°" in text
    assert ("none: there is no angular momentum" in text) == (not momentum)
    if momentum:
        for phase in (result.montgomery_phase, result.dynamic_phase, result.geometric_phase):
            assert re.search(rf"{float(phase):.9f} ± \d\.\de-\d+ rad", text)
    for digest in motion.deformation.inputs.values():
        assert digest in text
    # Nothing is fetched from anywhere.
    assert not re.findall(r"(?:src|href)=\"(?!data:)", page)
    assert list(folder.iterdir()) == [folder / "report.html"]


def ran(*arguments, **options):
    command = [sys.executable, "-m", "shapephase", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, **options)


def test_the_plot_command(tmp_path, capfd):
    out = tmp_path / "phases.svg"
    main(["plot", "phases", "satellite", "satellite_sweep", "--momentum", "0", "0", "1", "--out", str(out)])
    printed, said = capfd.readouterr()
    assert printed == ""
    assert re.fullmatch(rf"wrote {re.escape(str(out))} \([0-9.]+ kB\)\n", said)
    assert out.read_bytes().startswith(b"<?xml")
    for arguments, words in (
        (("plot", "phse", "satellite", "satellite_sweep", "--out", out), "Did you mean 'phases'"),
        (("plot", "phases", "satellite", "satellite_sweep", "--out", out), "needs an angular momentum"),
        (("plot", "phases", "satellite", "satellite_sweep", "--out", tmp_path / "x.gif"), r"--out: .*\.png"),
        (("split", "satellite", "satellite_sweep", "--html", tmp_path / "x.txt"), r"--html: .*\.html"),
        (("view", "satellite", "satellite_sweep", "--html", tmp_path / "none" / "x.html"), "no such folder"),
    ):
        with pytest.raises(SystemExit) as ended:
            main([str(argument) for argument in arguments])
        said = capfd.readouterr().err
        assert ended.value.code == 2
        assert re.search(words, said)
        assert said.count("\n") == 1


@pytest.mark.full
def test_the_report_command_writes_nothing_in_a_pipe_but_what_it_says(tmp_path, capfd):
    out = tmp_path / "report.html"
    done = ran("split", "satellite", "satellite_sweep", "--html", out)
    main(["split", "satellite", "satellite_sweep"])
    assert done.returncode == 0
    assert re.fullmatch(rf"wrote {re.escape(str(out))} \([0-9.]+ [kM]B\)\n", done.stderr)
    assert done.stdout == capfd.readouterr().out
    assert "satellite along satellite_sweep" in text_of(out.read_text(encoding="utf-8"))


def test_progress_is_shown_after_two_seconds_on_a_terminal_only():
    source = """
import time
from shapephase.cli import progress
progress._PATIENCE = {1}
with progress.steps(2) as work:
    work.begin("first things")
    time.sleep({0})
    work.begin("second things")
    time.sleep({0})
"""
    assert progress._PATIENCE == 2.0
    assert "things" not in on_a_terminal([sys.executable, "-c", source.format(0.05, 600.0)])
    shown = on_a_terminal([sys.executable, "-c", source.format(0.9, 0.3)])
    assert "first things" in shown or "second things" in shown
    piped = subprocess.run([sys.executable, "-c", source.format(0.7, 0.1)], capture_output=True, text=True, timeout=300)
    assert piped.stdout == piped.stderr == ""


@pytest.mark.full
def test_an_interrupt_leaves_no_file_or_a_whole_one(tmp_path):
    out = tmp_path / "report.html"
    command = [sys.executable, "-m", "shapephase", "split", "cat", "cat_righting", "--html", str(out)]
    for wait in (0.6, 1.4):
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        time.sleep(wait)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=300)
        if process.returncode == 0 or out.exists():
            assert out.read_text(encoding="utf-8").endswith("</html>")
            out.unlink()
        assert not list(tmp_path.iterdir())


def test_the_report_of_the_righting_opens_offline_and_the_cat_lands_on_its_feet(tmp_path, chromium):
    path = cat_righting()
    on_its_back = np.diag([1.0, -1.0, -1.0])
    motion = sp.reconstruct(sp.articulated(sp.load_body("cat"), path), np.zeros(3), on_its_back)
    out = tmp_path / "righting.html"
    report(motion, sp.split(motion), shape_path=path, title="The cat rights itself").write(out)
    page, said, asked = opened(chromium, out)
    page.get_by_text("side", exact=True).click()
    up, down = (furred(seen(page, time))[:, 0] for time in (0.0, path.duration))
    assert np.median(up) - up.min() > 1.3 * (up.max() - np.median(up))
    assert down.max() - np.median(down) > 1.3 * (np.median(down) - down.min())
    assert page.locator("#sphere").count() == 0
    # All pictures are there.
    broken = page.evaluate("[...document.images].filter(image => !image.complete || !image.naturalWidth).length")
    assert broken == 0
    assert [message for message in said if message[0] in ("error", "warning")] == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:", "about:"))] == []


@pytest.mark.full
def test_what_is_beside_the_body_follows_the_scrubber(tmp_path, chromium):
    """Half way, body, phases, joints and momentum are those of the motion at that time."""
    path = cat_righting()
    motion = sp.reconstruct(sp.articulated(sp.load_body("cat"), path), [0.05, 0.0, 0.1])
    result = sp.split(motion)
    out = tmp_path / "cat.html"
    report(motion, result, shape_path=path).write(out)
    assert out.stat().st_size < 3e6
    page, said, _ = opened(chromium, out)
    bar = page.locator("input.scrub")
    for half in (0.5, 1.0):
        t = half * motion.duration
        bar.evaluate("(bar, t) => { bar.value = t; bar.dispatchEvent(new Event('input')); }", t)
        assert page.evaluate("page.clock.time") == pytest.approx(t, abs=1e-12)
        page.evaluate("page.sphere.draw()")
        base = np.reshape(page.evaluate("Array.from(page.figure.base)"), (4, 4)).T
        np.testing.assert_allclose(base[:3, :3], motion.attitude(t), atol=1e-6)
        np.testing.assert_allclose(base[:3, 3], motion.base_position(t), atol=1e-6)
        seen_from = sp.horizontal_gauge(motion.deformation).frame(t) @ motion.body_momentum(t)
        marker = page.evaluate("page.sphere.current")
        np.testing.assert_allclose(marker, seen_from / np.linalg.norm(seen_from), atol=1e-6)
        phases = sp.running_phases(motion, t)
        shown = np.radians(page.evaluate("page.plots[0].current"))
        expected = [phases.montgomery_phase, phases.dynamic_phase, phases.geometric_phase]
        np.testing.assert_allclose(shown, expected, atol=1e-6)
        turn = np.radians(page.evaluate("page.plots[1].current"))
        np.testing.assert_allclose(so3.exp(turn), motion.attitude(t) @ motion.initial_attitude.T, atol=1e-6)
    # A pointer on a plot moves the clock, and with it all else.
    page.evaluate("document.querySelector('#plots').scrollIntoView()")
    box = page.locator("#plots figure > svg").first.bounding_box()
    page.mouse.click(box["x"] + (52 + 0.25 * 398) / 460 * box["width"], box["y"] + 0.4 * box["height"])
    assert page.evaluate("page.clock.time") == pytest.approx(0.25 * motion.duration, abs=0.01 * motion.duration)
    assert float(bar.input_value()) == pytest.approx(page.evaluate("page.clock.time"), abs=1e-9)
    assert [message for message in said if message[0] in ("error", "warning")] == []


@pytest.mark.full
def test_the_report_of_a_body_with_36_joints_is_small_and_says_what_was_given(tmp_path):
    body = sp.load_body("example:human")
    path = random_loop(body, np.random.default_rng(1))
    motion = sp.reconstruct(sp.articulated(body, path), [0.0, 0.0, 40.0])
    out = tmp_path / "human.html"
    bars = ("error bars: one standard deviation", "total rotation   12 ± 3 deg & <more>")
    report(motion, sp.split(motion), shape_path=path, error_bars=bars).write(out)
    assert out.stat().st_size < 4e6
    text = text_of(out.read_text(encoding="utf-8"))
    for words in (*bars, *body.joint_names, "The shape alone turned it by", f"{body.mass:.4g} kg", "36 joints"):
        assert words in text
    assert page_data(out)["motion"]["up"] == [0.0, 1.0, 0.0]


def test_rotation_vectors_go_on_through_half_a_turn():
    """A steady turn of three rounds, whose logarithm jumps three times."""
    angles = np.linspace(0.0, 6.0 * np.pi, 200)
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    found = continued_rotation_vectors(so3.exp(angles[:, None] * axis))
    np.testing.assert_allclose(found, angles[:, None] * axis, atol=1e-12)


@pytest.mark.full
@pytest.mark.usefixtures("no_pictures")
def test_no_zero_of_a_report_has_a_sign(tmp_path):
    """Joints that tremble by less than what is shown, and a phase that is rounding."""
    cat = sp.load_body("cat")
    path = random_loop(cat, np.random.default_rng(7), duration=1.0, amplitude=1e-5)
    motion = sp.reconstruct(sp.articulated(cat, path), [0.0, 0.0, 1e-9])
    report(motion, sp.split(motion), shape_path=path).write(tmp_path / "report.html")
    text = text_of((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "0.0°" in text
    assert not re.findall(r"[-−]0\.0*(?![0-9])", text)
