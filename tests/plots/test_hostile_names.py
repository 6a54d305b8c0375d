"""Names of links and joints that mean something to a browser or to Matplotlib are drawn and written as they are."""

from __future__ import annotations

import base64
import hashlib
import html
import re
import warnings
import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest

import shapephase as sp
from shapephase import plots
from shapephase.letters import printable
from shapephase.plots import report, view
from shapephase.plots._joint_styles import plain_text
from shapephase.plots.plot_style import axes_image
from support.browser import opened
from support.hostile_names import HALF_A_PAIR, MARK, OF_FILES, OF_MODELS, star_urdf, swinging

matplotlib = pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def star(tmp_path_factory):
    """A body with all names that a file may have, its swinging and its motion."""
    file = tmp_path_factory.mktemp("star") / "<b>star & co.urdf"
    file.write_text(star_urdf(OF_FILES), encoding="utf-8")
    body = sp.load_body(file)
    assert {*body.joint_names} == {*OF_FILES}
    path = swinging(body)
    return body, path, sp.reconstruct(sp.articulated(body, path), [0.0, 0.3, 1.0])


def modelled(names):
    """A body of a model, whose joints have these names."""
    model, part = pin.Model(), pin.Inertia(1.0, np.zeros(3), 0.1 * np.eye(3))
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    joints = [model.addJoint(root, pin.JointModelRX(), pin.SE3.Identity(), name) for name in names]
    for place in (root, *joints):
        model.appendBodyToJoint(place, part, pin.SE3.Identity())
    return sp.load_body(model)


# ---- Figures --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*OF_FILES, *OF_MODELS], ids=ascii)
def test_a_figure_shows_the_letters_of_a_name(name):
    """As Matplotlib itself takes the text apart, it is no formula, and what is left is the name."""
    from matplotlib.text import Text

    shown, is_formula = Text()._preprocess_math(plain_text(name))
    assert is_formula is False
    assert shown.isprintable() or shown.lstrip("\u200a").isprintable()
    letters = printable(name)
    assert shown.lstrip("\u200a") == (letters if len(letters) <= 32 else f"{letters[:16]}…{letters[-16:]}")


def test_every_name_has_its_line_in_the_legend():
    """Also names that begin with an underscore, that are equal when shortened, and that no font has letters for."""
    names = ("$x_$", "_hidden", "long" * 8 + "a" + "name" * 8, "long" * 8 + "b" + "name" * 8, "\U000f0000", "\u0301")
    path = sp.ShapePath.fourier(np.zeros(6), np.zeros((6, 1)), np.arange(1.0, 7.0)[:, None], 1.0, joint_names=names)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ax = plots.plot_shape_path(plots.column_axes(), path)
        image = axes_image(ax, "svg")
    ET.fromstring(image)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == [plain_text(name) for name in names]


@pytest.mark.parametrize("first", [0, 12, 24])
def test_planes_and_curvatures_of_joints_with_such_names(star, first):
    body, path, _ = star
    for pair in OF_FILES[first : first + 12 : 2], OF_FILES[first + 1 : first + 12 : 2]:
        ax = plots.plot_shape_plane(plots.column_axes(), path, pair[:2], body)
        ET.fromstring(axes_image(ax, "svg"))


def test_a_gauge_by_such_a_link_is_drawn(star):
    _, _, motion = star
    ax = plots.plot_momentum_curve(plots.column_axes(3.8), motion, "link:$\\foo$")
    assert ax.get_legend().get_title().get_text().startswith(r"link:\$\foo\$ gauge")
    ET.fromstring(axes_image(ax, "svg"))


# ---- Pages ----------------------------------------------------------------------------------------------------------


def policy_in(page):
    """The one policy of a page, which stands before everything that it rules."""
    (policy,) = re.findall(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', page)
    assert page.index("Content-Security-Policy") < 200
    return {words[0]: words[1:] for words in (part.split() for part in html.unescape(policy).split(";"))}


def test_the_policy_knows_the_scripts_by_their_hashes_and_lets_nothing_out(star, tmp_path):
    _, _, motion = star
    view(motion, frames=2).write(tmp_path / "star.html")
    page = (tmp_path / "star.html").read_text(encoding="utf-8")
    policy = policy_in(page)
    assert policy["default-src"] == ["'none'"]
    scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    hashed = [f"'sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()}'" for s in scripts]
    assert policy["script-src"] == hashed
    assert len(policy["style-src"]) == page.count("<style>")
    for directive, sources in policy.items():
        assert directive in ("script-src", "style-src") or set(sources) <= {"'none'", "data:"}
    assert not re.search("unsafe|blob|http|[*]", " ".join(source for sources in policy.values() for source in sources))


def test_pages_and_reports_of_models_with_unprintable_names(tmp_path):
    """Python's strings may hold half a surrogate pair, which no file can; Pinocchio's names may not."""
    body = modelled([name for name in OF_MODELS if name != HALF_A_PAIR])
    path = swinging(body)
    motion = sp.reconstruct(sp.articulated(body, path), [0.0, 0.3, 1.0])
    title = f"{HALF_A_PAIR} & \u202e swings"
    report(motion, sp.split(motion), shape_path=path, title=title).write(tmp_path / "r.html")
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "<title>\\ud800 &amp; \\u202e swings</title>" in page
    outside = re.sub(r'"[^"]*"', "", page)
    assert all(letter.isprintable() or letter == "\n" for letter in outside)


def report_of(star, folder):
    body, path, motion = star
    view(motion, frames=3, trail=OF_FILES[0]).write(folder / "page.html")
    title = f"{body.name} </h1><script>{MARK}=1</script>"
    report(motion, sp.split(motion), shape_path=path, title=title, trail="<!--").write(folder / "report.html")


def test_in_a_browser_no_name_runs_a_script_or_asks_for_anything_and_nothing_fails(star, tmp_path, chromium):
    """More than thirty hostile names, as links, joints, title and trail."""
    report_of(star, tmp_path)
    for name in ("page.html", "report.html"):
        page, said, asked = opened(chromium, tmp_path / name)
        check_in_browser(page, said, asked)
        page.close()


def check_in_browser(page, said, asked):
    page.evaluate("page.clock.step(1); page.scene.draw()")
    assert page.evaluate(MARK) is None
    assert [text for kind, text in said if kind == "error"] == []
    assert [url for url in asked if not url.startswith((page.url, "data:", "blob:", "about:"))] == []
    assert page.evaluate("[...document.images].every(image => image.complete && image.naturalWidth > 0)")
    # The policy holds: what a name might do is refused by it.
    tries = {
        "connect-src": "fetch('http://example.invalid/').catch(() => 0)",
        "img-src": "new Image().src = 'http://example.invalid/x.png'",
        "script-src-elem": "document.head.append(Object.assign(document.createElement('script'), {text: 'owned = 1'}))",
        # Some browsers look at a handler when it is set, some when it is to run.
        "script-src-attr": "document.body.insertAdjacentHTML('beforeend', '<b onclick=0>'); "
        "document.body.lastElementChild.click()",
        "frame-src": "document.body.append(Object.assign(document.createElement('iframe'), {src: 'http://a.invalid'}))",
    }
    for directive, deed in tries.items():
        listening = "document.addEventListener('securitypolicyviolation', e => done(e.effectiveDirective)"
        at_last = "setTimeout(() => done('nothing'), 60000)"
        refused = page.evaluate(f"() => new Promise(done => {{ {listening}, {{once: true}}); {at_last}; {deed}; }})")
        assert refused == directive
    assert page.evaluate(MARK) is None
