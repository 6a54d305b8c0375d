"""One motion with momentum: table, `print(split)`, JSON, table in time, figure and report show the same numbers."""

from __future__ import annotations

import csv
import html
import json
import re
from pathlib import Path

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from shapephase.phases.split_text import CLOSED_GAP
from shapephase.plots.pages import report_page
from support.independent import BODIES, body_of, random_loop, random_vector
from support.long_runs import full_but
from support.pages import page_data

COUNT = 30
NAMES = ("cat_two_halves", "satellite", "cat")
GAUGES = ("horizontal", "base", "horizontal", "principal")
# Of the table, of the page and of its curves: what they call them.
PHASES = {
    "Montgomery phase": ("montgomery_phase", "Montgomery"),
    "dynamic phase": ("dynamic_phase", "dynamic"),
    "geometric phase": ("geometric_phase", "geometric"),
}


def command(number: int, folder) -> list[str]:
    """A random loop through samples in a file, with a random momentum."""
    name = NAMES[number % len(NAMES)]
    body = body_of(name)
    file = folder / "motion.csv"
    path = random_loop(number, body.n_shape).path
    times = np.linspace(0.0, path.duration, 41)
    shapes = path.shape(times)
    # A boom is somewhere between in and out.
    slides = np.array([unit == "m" for unit in body.joint_units])
    shapes[:, slides] = 0.9 + 0.3 * shapes[:, slides]
    named = sp.ShapePath.spline(times, shapes, joint_names=body.joint_names)
    sp.write_shape_path(named, file)
    momentum = random_vector(number + 50, BODIES[name] * (1 + number % 4))
    return ["split", name, str(file), "--momentum", *map(repr, momentum.tolist()), "--gauge", GAUGES[number % 4],
            "--radians"]  # fmt: skip


def cells(page: str) -> dict[str, tuple[str, str]]:
    """The rows of the tables of a report, without their tags: name, what is in degrees, the rest."""
    rows = re.findall(r'<tr><th>([^<]*)</th><td class="number">([^<]*)</td><td>([^<]*)</td></tr>', page)
    return {html.unescape(name): (html.unescape(degrees), html.unescape(text)) for name, degrees, text in rows}


def words_of_figure(file: Path) -> list[str]:
    """The texts of a figure, which stand beside their outlines."""
    return re.findall(r"<!-- (.*?) -->", file.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.filterwarnings("ignore:.*outside its limits:shapephase.TrajectoryWarning")
@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize("number", full_but(range(COUNT), 0))
def test_everything_that_shows_a_split_shows_the_same_numbers(number, capfd, tmp_path, monkeypatch, request):
    if "full" not in request.keywords:
        # The figures of a report show no phases.
        monkeypatch.setattr(report_page, "FIGURES", {"inertia": report_page.FIGURES["inertia"]})
    arguments = command(number, tmp_path)
    files = ["--phases", str(tmp_path / "phases.csv"), "--html", str(tmp_path / "report.html")]
    main([*arguments, *files])
    text = capfd.readouterr().out
    table = {line[:24].strip(): line[24:] for line in text.splitlines()}
    main([*arguments, "--json"])
    data = json.loads(capfd.readouterr().out)

    body = sp.load_body(arguments[1])
    path = sp.read_shape_path(arguments[2], body, degrees=False)
    split = sp.split(sp.reconstruct(sp.articulated(body, path), data["momentum_kg_m2_s"]), data["gauge"])
    printed = {line[:24].strip(): line[24:] for line in str(split).splitlines()}
    with open(tmp_path / "phases.csv", newline="") as file:
        *_, last = csv.DictReader(file)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    main(["plot", "phases", *arguments[1:], "--out", str(tmp_path / "phases.svg")])
    shown, figure = cells(page), words_of_figure(tmp_path / "phases.svg")
    curves = {curve["name"]: curve["values"] for curve in page_data(tmp_path / "report.html")["plots"][0]["series"]}
    # Two ways of integrating along one motion, each far nearer to it than the motion is to the truth.
    near = 0.1 * data["error_estimate_rad"] + 1e-12
    for row, (name, curve) in PHASES.items():
        value, error = data[name], data["error_estimates"][name]
        in_degrees, in_radians = f"{np.degrees(value):.6f}", f"{value:.9f}"
        assert table[row].split() == printed[row].split() == [in_degrees, f"{error:.1e}", in_radians]
        assert shown[row[0].upper() + row[1:]][0] == f"{in_degrees}°"
        assert shown[row[0].upper() + row[1:]][1].startswith(f"{in_radians} ± {error:.1e} rad")
        assert float(last[f"{name}_deg"]) == pytest.approx(np.degrees(value), abs=np.degrees(near))
        assert float(last[f"{name}_rad"]) == pytest.approx(value, abs=near)
        assert curves[curve][-1] == pytest.approx(np.degrees(value), rel=1e-6, abs=1e-5)
        assert any(f"{np.degrees(value):z.2f}°".replace("-", "−") in words for words in figure), row
    gap, added = data["momentum_gap"], data["closing_phase"]
    story = html.unescape(" ".join(re.findall(r'<p class="story">(.*?)</p>', page)))
    assert f"Montgomery phase of {np.degrees(data['montgomery_phase']):.2f}°" in story
    closes = f"a great circle of {np.degrees(gap):.4f} deg ({gap:.6f} rad) from its end to its start closes it"
    adds = f"That adds {np.degrees(added):+.4f} deg ({added:+.6f} rad) to the geometric phase"
    in_figure = f"open by {np.degrees(gap):.2f}°; closing it adds {np.degrees(added):+.2f}°".replace("-", "−")
    in_story = f"adds {np.degrees(added):.2f}° of the geometric phase"
    said = (closes in " ".join(text.split()), adds in " ".join(text.split()), "Closing arc" in shown,
            f"direction ended {np.degrees(gap):.2f}° from where it began" in story, in_story in story,
            any(in_figure in words for words in figure))  # fmt: skip
    assert said == (gap > CLOSED_GAP,) * len(said)
    assert shown["Momentum gap"][0] == f"{table['momentum gap'].split()[0]}°" == f"{np.degrees(gap):.6f}°"
    if gap > CLOSED_GAP:
        assert shown["Closing arc"][0] == f"{table['by the closing'].split()[0]}°" == f"{np.degrees(added):.6f}°"


@pytest.mark.full
def test_a_report_says_what_it_was_made_of(capfd, tmp_path, monkeypatch):
    """Command, versions, date, files with their hashes, joints and masses, what smoothing did, and error bars."""
    monkeypatch.setattr(report_page, "FIGURES", {"inertia": report_page.FIGURES["inertia"]})
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    arguments = command(0, tmp_path)
    asked = ["--smooth", "0.2deg", "--mass-error", "0.02", "--html", str(tmp_path / "report.html")]
    main([*arguments, *asked])
    text = capfd.readouterr().out
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    shown = cells(page)
    body = sp.load_body(arguments[1])
    assert shown["Command line"][1].startswith(f"shapephase split {arguments[1]} ")
    assert "--smooth 0.2deg --mass-error 0.02" in shown["Command line"][1]
    assert shown["Date"][1] == "1970-01-02T00:00:00+00:00"
    assert "shapephase " in shown["Computed by"][1]
    assert "numpy " in shown["Computed by"][1]
    assert shown["SHA-256, body"][1] == body.sha256
    assert re.fullmatch("[0-9a-f]{64}", shown["SHA-256, path"][1])
    assert body.file is not None
    assert shown["File, body"][1] == body.file.name
    assert shown["File, joints"][1] == arguments[2]
    blocks = [html.unescape(block).strip() for block in re.findall(r"<pre>(.*?)</pre>", page, re.DOTALL)]
    assert len(blocks) == 2
    for block in blocks:
        lines = block.splitlines()
        assert len(lines) > 2
        assert all(line.strip() in text for line in lines)
    assert blocks[0].startswith("error bars: one standard deviation")
    assert "smoothed                for noise of 0.2 deg, rms" in blocks[1]
    assert all(f"<td>{name}</td>" in page for name in body.joint_names)
    masses = [part.mass for part in sp.body_summary(body).parts if part.mass > 0.0]
    assert page.count(f'<td class="number">{masses[0]:.6g}</td>') >= 1
    story = html.unescape(" ".join(re.findall(r'<p class="story">(.*?)</p>', page)))
    for words in ("The shape alone turned it by ", "the angular momentum of ", "Both together turned it by ",
                  "The numerical error of the attitude is at most ", "stand under error bars"):  # fmt: skip
        assert words in story
