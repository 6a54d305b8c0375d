"""The page of an audit: what is drawn of a flight that lands, and how it is seen in a browser."""

from __future__ import annotations

import base64
import re
from html import unescape
from pathlib import Path

import pytest

import shapephase as sp
from support.flown_bodies import body_of, flown
from support.landings import landing
from support.long_runs import full_but
from support.planted_faults import planted, trajectory

TIGHT = 1e-6
GROUND = "opacity: 0.35"
"""Of the grey on which samples are drawn that are not audited."""


def images(page: Path) -> list[str]:
    found = re.findall(r"data:image/svg\+xml;base64,([^\"]*)", page.read_text(encoding="utf-8"))
    return [base64.b64decode(one).decode() for one in found]


def test_what_is_not_audited_is_on_grey(tmp_path: Path):
    body, page = body_of("diver"), tmp_path / "audit.html"
    lands = trajectory("diver", landing("diver", seed=3, lands=0.85, duration=0.9, step=0.001, every=5).motion)
    whole = trajectory("diver", flown("diver", seed=3, step=0.001, every=5, duration=0.4))
    for run, grey in ((lands, True), (whole, False)):
        sp.auditing.audit_page(body, run, sp.audit(body, run)).write(page)
        # Momentum and fall; what is right has no hypotheses.
        assert [GROUND in image for image in images(page)] == [grey, grey]


def test_all_runs_and_hypotheses_of_an_audit_are_on_its_page(tmp_path: Path):
    case, page = planted("mass", "diver", 1, 0.4), tmp_path / "audit.html"
    found = sp.audit(case.body, [case.trajectory, case.trajectory], tolerance=TIGHT)
    sp.auditing.audit_page(case.body, [case.trajectory, case.trajectory], found).write(page)
    text = unescape(page.read_text(encoding="utf-8"))
    assert case.cause in text
    assert found.verdict in text
    for one in found.hypotheses[:8]:
        assert f"<td>{one.name}</td>" in text
    assert len(images(page)) == 4 + 8


@pytest.mark.parametrize("width", full_but([1280, 400], 400))
def test_the_page_fits_into_its_window(chromium, width: int, tmp_path: Path):
    case, file = planted("force", "diver", 1, 0.4), tmp_path / "audit.html"
    found = sp.audit(case.body, case.trajectory, tolerance=TIGHT, flight="all")
    sp.auditing.audit_page(case.body, case.trajectory, found).write(file)
    page, messages = chromium.new_page(), []
    page.on("console", lambda message: messages.append(message.text))
    page.set_viewport_size({"width": width, "height": 800})
    page.goto(file.as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate("[...document.images].every(image => image.complete && image.naturalWidth > 0)")
    assert page.evaluate("Math.min(...[...document.images].map(image => image.clientWidth))") > 300
    assert not messages
