"""Pages of the shares of limbs and of the momentum by segment: numbers, files, and how they run in a browser."""

from __future__ import annotations

import json
import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from support.browser import wait_for


@pytest.fixture(scope="module")
def dive() -> sp.Motion:
    path = sp.examples.MOTIONS["diver_twist"].path()
    return sp.reconstruct(sp.articulated(sp.load_body("diver"), path), [0.0, 61.558831, 0.0])


def cells(text: str) -> list[list[str]]:
    """Cells of all rows of all tables of a page."""
    rows = re.findall(r"<tr>(.*?)</tr>", text)
    return [[unescape(cell) for cell in re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row)] for row in rows]


def test_numbers_of_the_page_are_those_of_the_shares(dive: sp.Motion):
    shares = sp.contributions(dive)
    page = sp.plots.contributions_page(shares)
    rows = {row[0]: row[1:] for row in cells(page.html)}
    for name, without, alone in zip(shares.held_names, shares.without, shares.alone, strict=True):
        assert [float(cell) for cell in rows[name][:2]] == pytest.approx(
            [without / (2.0 * np.pi), alone / (2.0 * np.pi)], abs=5.1e-4
        )
    assert float(rows["all groups"][2]) == pytest.approx(shares.shared.sum() / (2.0 * np.pi), abs=5.1e-4)
    assert list(page.data["held"]) == list(shares.held_names)


def test_a_held_arm_rests_and_the_other_moves_as_it_did(dive: sp.Motion):
    page = sp.plots.contributions_page(sp.contributions(dive))
    names = list(sp.load_body("diver").joint_names)
    real, held = (np.reshape(data["shapes"], (-1, 2)) for data in (page.data["motion"], page.data["held"]["left arm"]))
    left, right = names.index("left_shoulder_abduction"), names.index("right_shoulder_abduction")
    assert np.ptp(held[:, left]) == 0.0
    assert np.array_equal(held[:, right], real[:, right])
    # Without the left arm there is no twist: the base ends elsewhere.
    assert np.abs(page.data["held"]["left arm"]["turns"] - page.data["motion"]["turns"]).max() > 0.1


def test_flights_and_links_of_the_page_are_those_of_the_momentum(dive: sp.Motion):
    found = sp.segment_momentum(dive)
    rows = {row[0]: row[1:] for row in cells(sp.plots.momentum_page(found, dive).html)}
    for k, link in enumerate(found.links):
        means = [float(cell) for cell in rows[link][:3]]
        assert means == pytest.approx(found.by_link[:, k].mean(axis=0).tolist(), rel=6e-4, abs=1e-12)
    assert "within noise" in rows["0 to 1.5 s"][1]


@pytest.mark.parametrize("command", ["contributions", "momentum"])
def test_the_command_writes_its_page_whole_and_without_addresses(command: str, tmp_path: Path):
    file = tmp_path / "page.html"
    main([command, "diver", "diver_twist", "--momentum", "0", "61.558831", "0", "--html", str(file)])
    text = file.read_text(encoding="utf-8")
    assert text.startswith("<!doctype html>")
    assert text.rstrip().endswith("</html>")
    assert not re.findall(r"(?:src|href)=\"https?:", text)
    json.loads(re.findall(r"id=\"data\">(.*?)</script>", text, re.S)[0])


@pytest.mark.parametrize("width", [1280, 400])
def test_both_scenes_run_by_one_clock(chromium, width: int, dive: sp.Motion, tmp_path: Path):
    shares, file, messages = sp.contributions(dive), tmp_path / "page.html", []
    sp.plots.contributions_page(shares).write(file)
    page = chromium.new_page()
    page.on("console", lambda message: messages.append(message.text))
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.set_viewport_size({"width": width, "height": 800})
    page.goto(file.as_uri())
    wait_for(page, "window.page !== undefined")
    page.select_option("#held", "right arm")
    page.evaluate("page.clock.show(0.6)")
    places = page.evaluate("page.figures.map(figure => figure.place)")
    assert places[0] == places[1]
    attitudes = np.array(page.evaluate("page.figures.map(figure => Array.from(figure.base))"))
    held = shares.motions()["right arm"]
    for attitude, motion in zip(attitudes, (dive, held), strict=True):
        turn = motion.attitude(0.6) @ motion.deformation.frame(0.6)
        assert attitude.reshape(4, 4).T[:3, :3] == pytest.approx(turn, abs=2e-3)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert not messages


@pytest.mark.full
@pytest.mark.parametrize("with_body", [True, False])
def test_the_page_of_the_momentum_runs(chromium, with_body: bool, dive: sp.Motion, tmp_path: Path):
    file, messages = tmp_path / "page.html", []
    sp.plots.momentum_page(sp.segment_momentum(dive), dive if with_body else None).write(file)
    page = chromium.new_page()
    page.on("console", lambda message: messages.append(message.text))
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.goto(file.as_uri())
    wait_for(page, "document.images.length === 3 && [...document.images].every(image => image.naturalWidth)")
    assert page.evaluate("document.querySelectorAll('.scene').length") == int(with_body)
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    assert not messages
