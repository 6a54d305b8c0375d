"""The documentation site, as far as it can be checked without building it: names, equations, ways, and examples."""

from __future__ import annotations

import ast
import contextlib
import doctest
import importlib
import inspect
import json
import re
import shlex
import sys
import types
import warnings
from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from cyclopts import CycloptsError

import shapephase as sp
from support.places import ROOT

DOCS = ROOT / "docs"
STUBS = sorted((ROOT / "src" / "shapephase").rglob("__init__.pyi"))
MODULES = ("elliptic", "errors", "inertia_tensor", "so3", "sphere")
FACES = [".".join(stub.parent.relative_to(ROOT / "src").parts) for stub in STUBS] + [f"shapephase.{m}" for m in MODULES]
MOST_LINES = 8
# Examples that take a second, or half a minute where machine code has to be compiled.
LONG = (
    "shapephase.compile_steps",
    "shapephase.plan_reorientation",
    "shapephase.plots.report",
)
# Half a second, and much the same as another example does.
LIKE_ANOTHER = (
    "shapephase.ForcedSplit",
    "shapephase.auditing.write_audit_figure",
    "shapephase.auditing.audit_page",
    "shapephase.plots.explore",
)
PAGES = sorted(page for page in DOCS.rglob("*.md") if "_build" not in page.parts)


@pytest.fixture(scope="module")
def steps() -> Callable[[str], types.ModuleType]:
    """Steps of the site's build, by name."""

    def step(name: str) -> types.ModuleType:
        sys.path.insert(0, str(DOCS))
        try:
            return importlib.import_module(f"_site.{name}")
        finally:
            sys.path.remove(str(DOCS))

    return step


def exported() -> dict[str, Any]:
    """Functions and classes of all faces, each once, by its shortest name."""
    found: dict[int, tuple[str, Any]] = {}
    for face in sorted(FACES, key=lambda name: (name.count("."), name)):
        module = importlib.import_module(face)
        names = getattr(module, "__all__", None) or [
            name for name, thing in vars(module).items() if getattr(thing, "__module__", None) == face
        ]
        for name in names:
            thing = getattr(module, name)
            if (inspect.isclass(thing) or inspect.isroutine(thing)) and not name.startswith("_"):
                found.setdefault(id(thing), (f"{face}.{name}", thing))
    return dict(found.values())


NAMES = exported()


def test_every_exported_name_stands_on_one_page_of_the_reference(steps):
    reference = steps("reference_pages")
    placed = Counter(
        id(thing) for page in reference.questions(DOCS / "reference") for thing in page["objects"].values()
    )
    assert not [name for name, thing in NAMES.items() if placed[id(thing)] != 1]
    listed = re.findall(r"^\w+$", (DOCS / "reference" / "index.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert listed == [page["file"] for page in reference.questions(DOCS / "reference")]


def test_equations_have_one_label_each_and_all_that_are_cited_exist():
    texts = {page: page.read_text(encoding="utf-8") for page in PAGES}
    labels = Counter(
        label for text in texts.values() for label in re.findall(r"^\$\$ \(([\w-]+)\)$", text, re.MULTILINE)
    )
    assert len(labels) > 40
    assert set(labels.values()) == {1}
    cited = {label for text in texts.values() for label in re.findall(r"\{eq\}`([\w-]+)`", text)}
    sources = [file.read_text(encoding="utf-8") for file in (ROOT / "src").rglob("*.py")]
    cited |= {label for text in sources for label in re.findall(r":eq:`([\w-]+)`", text)}
    assert cited <= set(labels)


def test_every_equation_is_cited_by_a_docstring_of_the_reference(steps):
    """Then its page says which function that is, and the function's page leads to the equation."""
    equations = steps("equations")
    names = equations.citing(DOCS / "reference")
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        labels = re.findall(r"^\$\$ \(([\w-]+)\)$", text, re.MULTILINE)
        assert [label for label in labels if not names[label]] == [], page.name
        ending = equations.with_citations(text, names).removeprefix(text.rstrip())
        assert all(f"{{eq}}`{label}`" in ending for label in labels)


def commands() -> list[tuple[str, list[str]]]:
    """Command lines of the pages that stand in blocks of their own, and of the notebooks."""
    found = []
    files = [*PAGES, *sorted((ROOT / "notebooks").glob("*.ipynb"))]
    for file in files:
        text = file.read_text(encoding="utf-8")
        if file.suffix == ".ipynb":
            cells = json.loads(text)["cells"]
            text = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
        text = text.replace("\\\n", " ")
        for line in re.findall(r"^(?: {4}|\.venv/bin/)?shapephase ((?:[a-z]+)\b[^\n]*)$", text, re.MULTILINE):
            if "..." not in line:
                found.append((file.name, shlex.split(line.partition(" | ")[0])))
    return found


def test_command_lines_of_the_pages_are_understood():
    from shapephase.cli.main import app

    assert len(commands()) >= 8
    for place, tokens in commands():
        try:
            app.parse_args(tokens, exit_on_error=False, print_error=False)
        except CycloptsError as error:
            pytest.fail(f"{place}: {error}")


@pytest.mark.full
def test_command_lines_that_need_no_file_run(tmp_path, monkeypatch):
    from shapephase.cli.main import main

    monkeypatch.chdir(tmp_path)
    for page, tokens in commands():
        if "cat_righting" in tokens and page != "faq.md":  # it shows errors, too, in tests of its own
            main(tokens)


FRONT = """<article><section id="three-ways-from-here"><h2>Ways<a class="headerlink" href="#">#</a></h2>
<p><a href="a.html">1</a> <a href="b.html#there">2</a> <a href="c.html">3</a></p>{more}</section></article>"""
WAY = '<p><a href="a.html">1</a> <a href="b.html">2</a> <a href="c.html">3</a></p>'


@pytest.mark.parametrize(
    ("change", "faults"),
    [
        ({}, []),
        ({"a.html": "<article>no link</article>"}, 3 * ["a.html: no link to b.html in its text"]),
        ({"a.html": '<a href="b.html">beside the text</a>'}, 3 * ["a.html: no link to b.html in its text"]),
        ({"b.html": '<article><a href="c.html">on</a></article>'}, ["index.html: b.html#there has no such place"]),
        ({"c.html": '<article>the answer <img src="d.png"></article>'}, ["c.html: d.png leads nowhere"]),
        ({"index.html": FRONT.format(more="")}, ["index.html: 1 ways"]),
        ({"c.html": "<article>no answer</article>"}, ["index.html: a thing ('the answer') is more than 3 clicks away"]),
        (
            {"c.html": "<article>the answer <pre>&lt;Figure size 340x300 with 1 Axes&gt;</pre></article>"},
            ["c.html: a cell shows the words for a figure; draw on axes of matplotlib.pyplot"],
        ),
    ],
)
def test_links_of_the_built_site_are_followed(change, faults, tmp_path, steps, monkeypatch):
    links = steps("built_links")
    monkeypatch.setattr(links, "SOUGHT", {"a thing": "the answer"})
    site = {
        "index.html": FRONT.format(more=WAY + WAY),
        "a.html": '<article><a href="b.html">on</a> <a href="https://example.org/x">out</a></article>',
        "b.html": '<article><p id="there"></p><a href="c.html">on</a></article>',
        "c.html": "<article>the answer</article>",
    } | change
    for name, text in site.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    found = links.pages(tmp_path.resolve())
    front = tmp_path.resolve() / "index.html"
    assert [*links.broken(found), *links.lost_ways(found, front), *links.far_off(found, front)] == faults
    assert links.main(tmp_path) == len(faults)


def test_names_in_backticks_become_links_but_in_code(steps):
    names = {"split": "shapephase.split"}
    text = "# `split`\n\n`split` and `sp.split`, ``split`` and {eq}`split`, `motion`\n\n```text\n`split`\n```\n"
    linked = steps("name_links").with_names(text, names)
    assert linked.count("{py:obj}") == 2
    assert linked.startswith(
        "# `split`\n\n{py:obj}`split <shapephase.split>` and {py:obj}`sp.split <shapephase.split>`"
    )


def test_names_in_docstrings_are_code_and_link_where_the_reference_has_them(steps):
    names = steps("name_links").places(DOCS / "reference")
    text = "`split` of `path`, `Motion.save`, ``split``, :eq:`split`; `a,<b>`.\n\n>>> f(`split`)\n`split`\n\n`undo`"
    expected = (
        ":py:obj:`split <shapephase.split>` of ``path``, :py:obj:`Motion.save <shapephase.Motion.save>`, ``split``, "
        ":eq:`split`; ``a,<b>``.\n\n>>> f(`split`)\n`split`\n\n``undo``"
    )
    owner = "shapephase.optimal_control.undo"
    assert steps("name_links").with_linked_names(text, names, owner, {"path"}) == expected


@pytest.mark.parametrize(
    ("returns", "shown"),
    [
        ("(..., 3) [m], which\n    is long", "Array\n    (..., 3) [m], which\n    is long"),
        ("edges : (3,) [m], a\n    box\naxes : (3, 3)", "edges\n    (3,) [m], a\n    box\naxes\n    (3, 3)"),
        ("DataFrame\n    `attrs` has units.", "DataFrame\n    `attrs` has units."),
    ],
)
def test_what_a_docstring_says_of_returned_values_is_not_their_type(steps, returns, shown):
    made = steps("docstrings").returned_values_are_descriptions(f"A.\n\nReturns\n-------\n{returns}\n\nEnd.", "Array")
    assert made == f"A.\n\nReturns\n-------\n{shown}\n\nEnd."


def test_private_parameters_are_not_in_signatures(steps):
    signature = "(a: dict[str, tuple[int, int]], *, _b: dict[str, int] = ..., c: int = 0, _d: Any = (1, 2))"
    assert steps("docstrings").public_parameters(signature) == "(a: dict[str, tuple[int, int]], *, c: int = 0)"


def test_formulas_in_docstrings_are_text_but_in_code(steps):
    text = "H = M . B of |M|, (...) -> (..., 3).\n\n>>> f(|x|)  # a . b ...\n1 . 2\n\nThen `|Pi| . x` and |Pi|."
    shown = steps("docstrings").formulas_are_text(text)
    bars = text.split("\n")[0].replace("|", "\\|").replace(" . ", " · ").replace("...", "…").replace("->", "→")
    assert shown.split("\n") == [bars, *text.split("\n")[1:-1], "Then `|Pi| . x` and \\|Pi\\|."]


def test_signatures_name_types_that_sphinx_spells_out(steps):
    union = "~numpy._typing._a._Buffer | _S[~numpy.dtype[Any]] | str | _NestedSequence[complex | bytes | str]"
    array = "~numpy.ndarray[tuple[~typing.Any, ...], ~numpy.dtype[~numpy.float64]]"
    shown = steps("docstrings").types_by_name(f"(x: {union}, y: ~a.B = <factory>) -> tuple[{array}, {array}]")
    assert shown == "(x: ArrayLike, y: ~a.B = ...) -> tuple[Array, Array]"


def test_lines_break_in_long_names_of_tables_and_headings_and_not_in_options_or_before_a_comma(steps):
    name, formula = '<span class="pre">a_b/c.py</span>', '<span class="math notranslate nohighlight">\\(x_1.5\\)</span>'
    body = (
        f"<h2>a_b.CrownRegion<a></a></h2><p>{name} ({formula}, {formula} {formula}.</p><table><td>{name}</td></table>"
        '<span class="pre">--joint-noise</span>'
    )
    shown = steps("line_breaks").with_line_breaks(body)
    assert shown == (
        f'<h2>a_<wbr>b.<wbr>Crown<wbr>Region<a></a></h2><p>{name} <span class="unbroken">({formula},</span> {formula} '
        f'<span class="unbroken">{formula}.</span></p>'
        '<table><td><span class="pre">a_<wbr>b/<wbr>c.<wbr>py</span></td></table>'
        '<span class="pre"><span class="unbroken">--joint-noise</span></span>'
    )


def test_signatures_numbers_and_names_of_a_page_break_where_they_should(steps):
    made, parameter = steps("line_breaks"), '<em class="sig-param"><span class="pre">x</span></em>'
    words = ["[", "tuple", "[", "Any", ",", "...", "]", ",", "dtype", "[", "int64", "]", "]"]
    array = "".join(f'<span class="p"><span class="pre">{word}</span></span>' for word in words)
    kept = '<span class="math notranslate nohighlight">\\( -x 1e-9\\)</span><pre>1e-9 -x</pre>'
    signature = f'<dd>{parameter},</dd>{parameter}, <span class="pre">ndarray</span>{array}'
    assert made.with_line_breaks(f'{signature} a-b (-pi, 2e-13] <a href="b-c 1e-9">-y</a>{kept}') == (
        f'<dd>{parameter},</dd><span class="parameter">{parameter},</span> <span class="pre">Integers</span> a-b '
        '(<span class="unbroken">-pi</span>, <span class="unbroken">2e-13</span>] '
        f'<a href="b-c 1e-9">-y</a>{kept}'
    )
    assert made.contents_with_breaks('<a href="#a">body.link_poses</a>') == '<a href="#a">body.<wbr>link_<wbr>poses</a>'


def test_defaults_in_signatures_are_numbers_and_not_private_constants(steps):
    function = types.FunctionType((lambda: None).__code__, {"_SIZE": 0.25, "_BODY": object()})
    shown = steps("docstrings").defaults_by_value("(a: int = _SIZE, b: Any = _BODY, c=ZXZ)", function)
    assert shown == "(a: int = 0.25, b: Any = ..., c=ZXZ)"


def test_products_without_blanks_are_products_and_names_and_file_endings_are_not(steps):
    text = "E = Pi.I^-1 Pi/2 + n.(u x u'), (Pi x w).L_o at t.shape of a.csv; `w.mu` and so on.\n"
    shown = "E = Pi · I^-1 Pi/2 + n · (u x u'), (Pi x w) · L_o at t.shape of a.csv; `w.mu` and so on.\n"
    assert steps("docstrings").formulas_are_text(text) == shown


def test_a_name_that_several_faces_have_links_to_that_of_the_owner(steps):
    made, names = steps("name_links").with_linked_names, steps("name_links").places(DOCS / "reference")
    link = ":py:obj:`extremal <shapephase.optimal_control.extremal>` of :py:obj:`shapephase.view <shapephase.view>`"
    assert made("`extremal` of `shapephase.view`", names, "shapephase.optimal_control.shoot", {"view"}) == link
    assert made("`extremal`", names, "shapephase.Motion.save", set()) == "``extremal``"


def test_a_class_that_describes_some_of_its_fields_describes_all(steps):
    pages = steps("reference_pages").questions(DOCS / "reference")
    for found in {found for page in pages for found in page["objects"].values() if inspect.isclass(found)}:
        text = inspect.getsource(found)
        body = ast.parse(text).body[0].body
        fields = [
            (item.target.id, isinstance(below, ast.Expr) or "#:" in text.splitlines()[item.lineno - 1])
            for item, below in pairwise([*body, None])
            if isinstance(item, ast.AnnAssign) and item.target.id[0] != "_"
        ]
        assert len({described for _, described in fields}) < 2, (found, fields)


def test_every_error_of_a_docstring_has_its_reason():
    section = re.compile(r"^( *)(?:Raises|Warns)\n *-+\n((?:(?! *\"\"\").+\n)+)", re.MULTILINE)
    for file in (DOCS.parent / "src").rglob("*.py"):
        for found in section.finditer(file.read_text(encoding="utf-8")):
            for line, below in pairwise([*found[2].splitlines(), found[1]]):
                is_name = line[len(found[1])] != " "
                assert not is_name or below.startswith(f"{found[1]} "), f"{file}: {line.strip()}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_links_between_pages_lead_somewhere(page):
    for target in re.findall(r"\]\((?!https?:)([\w./-]+\.md)(?:#[\w-]+)?\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).resolve().exists(), target


def test_live_pages_are_made_where_pages_show_them(steps, tmp_path):
    live = steps("live_pages")
    shown = {
        page.parent / source
        for page in PAGES
        for source in re.findall(r'<iframe class="live" src="([^"]+)"', page.read_text(encoding="utf-8"))
    }
    assert {source.resolve() for source in shown} == {DOCS / "_static" / name for name in live.LIVE}
    live.write_live_pages(tmp_path)
    for name in live.LIVE:
        assert 100_000 < (tmp_path / name).stat().st_size < 500_000


def examples(thing: Any) -> list[doctest.Example]:
    return doctest.DocTestParser().get_examples(inspect.getdoc(thing) or "")


def ran(name: str, thing: Any) -> None:
    """The steps of an example, of which at least one prints."""
    steps = examples(thing)
    assert sum(len(step.source.splitlines()) for step in steps) <= MOST_LINES, name
    assert any(step.want for step in steps), name
    said: list[str] = []
    test = doctest.DocTest(steps, {"np": np, "sp": sp}, name, None, None, None)
    assert doctest.DocTestRunner(verbose=False).run(test, out=said.append).failed == 0, "".join(said)


@pytest.mark.parametrize("face", FACES)
def test_examples_in_docstrings_print_what_they_say(face, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name, thing in NAMES.items():
        if name.rpartition(".")[0] == face and name not in LONG + LIKE_ANOTHER and examples(thing):
            ran(name, thing)


@pytest.mark.full
@pytest.mark.parametrize("name", LONG + LIKE_ANOTHER)
def test_long_examples_print_what_they_say(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    ran(name, NAMES[name])


def _is_raised(kind: type) -> bool:
    """True for errors and warnings that say what causes them."""
    return issubclass(kind, Exception) and len(inspect.getdoc(kind) or "") > 60


def test_every_exported_function_and_class_has_an_example():
    """A result class has that of the function which makes it, "Made by `function`."; an error or warning says why."""
    assert len(NAMES) > 490
    lacking = {name: thing for name, thing in NAMES.items() if not examples(thing)}
    lacking = {name: thing for name, thing in lacking.items() if not (inspect.isclass(thing) and _is_raised(thing))}
    made = {name: re.search(r"Made by `([\w.]+)`", inspect.getdoc(thing) or "") for name, thing in lacking.items()}
    assert not [name for name, thing in lacking.items() if not inspect.isclass(thing) or made[name] is None]


SHOWN = [(DOCS / "howto" / page).read_text("utf-8").replace("\\\n", " ") for page in ("faq.md", "spacecraft.md")]
ANSWERS = [
    answer
    for text in SHOWN
    for answer in re.findall(r"^```text\n(shapephase [^\n]*)\n((?!shapephase)[^`]+)```", text, re.MULTILINE)
]
QUICK_ANSWERS = 3  # the others take a second each, or many


@pytest.mark.parametrize(
    ("command", "shown"),
    [*ANSWERS[:QUICK_ANSWERS], *(pytest.param(*answer, marks=pytest.mark.full) for answer in ANSWERS[QUICK_ANSWERS:])],
)
def test_answers_show_what_their_commands_print(command, shown, tmp_path, monkeypatch, capsys):
    from shapephase.cli.main import main

    (tmp_path / "robots").symlink_to(ROOT / "robots")
    monkeypatch.chdir(tmp_path)
    with warnings.catch_warnings(), contextlib.suppress(SystemExit):
        warnings.simplefilter("default")
        main(shlex.split(command)[1:])
    printed = _without_estimates("".join(capsys.readouterr()))
    for line in shown.splitlines():
        assert _without_estimates(line.removesuffix(", ...")) in printed, line


def _without_estimates(text: str) -> str:
    """Words with one blank between them, without error estimates, which differ between processors."""
    return " ".join(re.sub(r"\b\d\.\d+e-\d\d\b", "", text).split())


def test_there_are_25_questions_each_with_a_command():
    questions = re.findall(r"^### ([^\n]*)\n(.*?)(?=^###? |\Z)", SHOWN[0], re.MULTILINE | re.DOTALL)
    assert len(questions) >= 25
    assert not [title for title, answer in questions if "```text\nshapephase " not in answer]


def test_a_constant_has_the_text_below_its_definition(steps):
    documented = steps("reference_pages").constant_documentation("shapephase.examples.MOTIONS")
    assert documented[0].startswith("Motions that come with the library")
