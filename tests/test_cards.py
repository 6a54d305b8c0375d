"""What objects print of themselves and show in a notebook: short, with units, and safe whatever they are called."""

from __future__ import annotations

import dataclasses
import enum
import importlib
import inspect
import json
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import plots, so3
from shapephase.display import Card, card_html, card_text, short_repr
from shapephase.errors import ShapeError, UnknownNameError
from shapephase.examples import cat_righting, kane_scher
from shapephase.reconstruction.attitude_angles import euler_angles
from support.places import ROOT

SOURCE = ROOT / "src"
ROOMS = sorted(".".join(stub.parent.relative_to(SOURCE).parts) for stub in SOURCE.glob("shapephase/**/__init__.pyi"))
# Classes that say of themselves what they are in a line.
OWN = {"Body", "BodyFamily", "EulerTop", "FlightRecorder", "Gyrostat", "Page"}
# Of the inside of a motion; and what is made for a browser.
INSIDE = {"Interpolant", "SteppedRotation", "Sampler", "MovingScene"}
WITH_CARDS = (sp.Body, sp.ShapePath, sp.Deformation, sp.Motion, sp.phases.PhaseSplit, sp.FixedPoints,
              sp.optimal_control.Plan, sp.EulerTop)  # fmt: skip


def public_classes():
    rooms = [importlib.import_module(room) for room in ROOMS]
    found = {thing for room in rooms for name in room.__all__ if inspect.isclass(thing := getattr(room, name))}
    return sorted(found, key=lambda kind: (kind.__module__, kind.__qualname__))


def instances():
    """One of nearly every kind that takes no long search."""
    body, path = sp.load_body("cat"), cat_righting(0.5)
    deformation = sp.articulated(body, path)
    motion = sp.reconstruct(deformation, [0.05, 0.0, 0.1])
    top = sp.EulerTop.principal((1.0, 2.0, 3.0), (0.7, 0.2, 1.5))
    many = sp.reconstruct(deformation, np.eye(3))
    open_path = sp.ShapePath.spline(np.linspace(0.0, 1.0, 6), np.random.default_rng(0).normal(size=(6, 2)))
    start = sp.optimal_control.Start("converged", True, 1.0, 1e-12, 1e-9, 1e-9, 40, 0.3)
    plan = sp.optimal_control.Plan(
        body, path, motion, "kinetic", "zero", 1.0, 1e-12, 1e-5, 2, 1e-9, np.zeros((4, 3)), 40, 0.3, (start,)
    )
    return {
        "body": body, "path": path, "open path": open_path, "deformation": deformation, "motion": motion,
        "batch": many, "split": sp.split(motion), "split of a batch": sp.split(many),
        "split at rest": sp.split(sp.reconstruct(deformation, np.zeros(3))), "plan": plan, "start": start,
        "running": sp.running_phases(motion, np.linspace(0.0, 0.5, 300)),
        "arcs": sp.arc_phases(motion, [0.0, 0.2, 0.5]),
        "errors": sp.split(motion).error_estimates, "points": sp.fixed_points(sp.articulated(
            sp.load_body("cat_two_halves"), kane_scher(0.3, 1.0)), 0.02),
        "top": top, "rigid": sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), "sensitivity": motion.sensitivity,
        "summary": sp.body_summary(body), "lift": sp.horizontal_lift(body, path), "chain": body.chain,
        "certificate": sp.bounds.regime_certificate(deformation, [0.05, 0.0, 0.1]),
        "standing top": sp.EulerTop.principal((1.0, 2.0, 3.0), (0.0, 1.0, 0.0)), "orbit": top.orbit,
        "goal": sp.optimal_control.Goal(rotation=np.eye(3)), "limits": sp.optimal_control.Limits(),
        "search": sp.optimal_control.Search(), "poinsot": sp.rigid_body.Poinsot(top),
    }  # fmt: skip


@pytest.fixture(scope="module")
def things():
    return instances()


def is_short(text):
    return len(text) < 1000 and len(text.splitlines()) < 10


# ---- Text -----------------------------------------------------------------------------------------------------------


def test_every_public_class_prints_itself_in_a_few_lines():
    """By a function that is bounded whatever the object holds, as the next two tests show, or in a line of its own."""
    for kind in public_classes():
        if (
            issubclass(kind, BaseException | enum.Enum)
            or getattr(kind, "_is_protocol", False)
            or kind.__name__ in INSIDE
        ):
            continue
        printed = kind.__repr__
        plain = printed is object.__repr__ or issubclass(kind, tuple)
        assert printed in (short_repr, card_text) or kind.__name__ in OWN or plain, kind
        if dataclasses.is_dataclass(kind):
            assert not plain, kind


def test_real_objects_print_themselves_in_a_few_lines(things):
    for name, thing in things.items():
        assert is_short(repr(thing)), name


@pytest.mark.parametrize("count", [1, 3, 12, 80])
def test_fields_of_any_kind_and_number_are_bounded(count):
    values = [np.zeros((200, 3)), "x" * 5000, tuple(range(500)), {"a": 1}, 10**400, np.arange(3.0), None, "a\nb",
              [["x" * 999] * 99], lambda: 0, np.float64(1e300), True, sp.load_body("cat"), ("a" * 50, "b")]  # fmt: skip
    names = [f"field_with_a_long_name_{k}" for k in range(count)]
    kind = dataclasses.make_dataclass("Result", names)
    text = short_repr(kind(*(values[k % len(values)] for k in range(count))))
    assert is_short(text)
    assert text.startswith("Result(")
    assert text.endswith(")")


def test_a_card_of_any_size_is_bounded():
    card = Card("A title\n" * 100, [("name", "value\n" * 500)] * 50)
    assert is_short(card.text())


def test_what_is_printed_of_a_motion_are_its_numbers(things):
    motion, split = things["motion"], things["split"]
    assert repr(motion).splitlines()[0] == "Motion: cat along a path"
    rows = {line[:17].strip(): line[17:].strip() for line in repr(motion).splitlines()[1:]}
    assert rows["duration"] == "0.5 s"
    assert rows["momentum"] == "(0.05 0 0.1) kg m^2/s"
    assert rows["error estimate"] == f"{motion.error_estimate:.1e} rad"
    phases = {line[:20].strip(): line[20:].strip() for line in repr(split).splitlines()[1:]}
    for row, name in (
        ("Montgomery phase", "montgomery_phase"),
        ("dynamic", "dynamic_phase"),
        ("geometric", "geometric_phase"),
    ):
        value = float(getattr(split, name))
        assert phases[row] == f"{np.degrees(value):.6f} deg ({value:.6f} rad)"


# ---- Cards ----------------------------------------------------------------------------------------------------------


def test_the_kinds_that_have_a_card():
    for kind in WITH_CARDS:
        assert kind._repr_html_ is card_html


def test_cards_are_whole_and_have_a_title_rows_and_a_picture(things):
    shown = [thing for thing in things.values() if isinstance(thing, WITH_CARDS)]
    assert len({type(thing) for thing in shown}) == len(WITH_CARDS)
    for thing in shown:
        card = thing._card()
        page = ElementTree.fromstring(thing._repr_html_())
        assert page.find(".//strong").text == card.title
        assert len(page.findall(".//tr")) == len(card.rows)
        assert len(thing._repr_html_()) < 12_000
        if card.picture:
            (picture,) = page.findall(".//{http://www.w3.org/2000/svg}svg")
            assert picture.get("aria-label")
            assert "nan" not in card.picture
    assert things["motion"]._card().picture
    assert things["body"]._card().picture


@pytest.mark.parametrize(
    "name", ["<script>alert(1)</script>", "a & b", '"><img src=x>', "line\nbreak\x1b[31m", "\u202eright"]
)
def test_names_are_letters_and_nothing_else(name):
    body = sp.load_body("cat_two_halves")
    body.name = name
    deformation = sp.articulated(body, kane_scher(0.3, 1.0))
    motion = sp.reconstruct(deformation, [0.01, 0.0, 0.02])
    for thing in (body, deformation, motion, sp.split(motion)):
        page = ElementTree.fromstring(thing._repr_html_())
        assert {part.tag.rpartition("}")[2] for part in page.iter()} <= {
            "div", "strong", "table", "tr", "th", "td", "svg", "line", "polyline", "rect", "circle"
        }  # fmt: skip
        assert page.find(".//strong").text.isprintable()
        assert all(line.isprintable() for line in repr(thing).splitlines())


def test_a_card_needs_no_matplotlib():
    code = (
        "import sys, shapephase as sp\nfrom shapephase.examples.scenarios import kane_scher\n"
        "motion = sp.reconstruct(sp.articulated(sp.load_body('cat_two_halves'), kane_scher(0.3, 1.0)), [0, 0, 0.01])\n"
        "motion._repr_html_(), sp.split(motion)._repr_html_()\n"
        "assert not {'matplotlib', 'pandas', 'viser'} & {*sys.modules}, 'loaded'"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# ---- Angles in time -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sequence", ["ZYX", "XYZ", "zxz", "YXY", "yzx"])
def test_euler_angles_are_continuous_and_compose_the_attitude(sequence, things):
    motion = things["motion"]
    times = np.linspace(0.0, 0.5, 2001)
    angles = motion.euler_angles(times, sequence)
    again = Rotation.from_euler(sequence, angles).as_matrix()
    assert so3.angle(so3.transpose(again) @ motion.attitude(times)).max() < 1e-7
    assert np.abs(np.diff(angles, axis=0)).max() < 0.5
    one = motion.euler_angles(0.3, sequence)
    np.testing.assert_allclose(one, motion.euler_angles([0.1, 0.3], sequence)[1], atol=1e-9)


def test_a_diver_s_turns_come_out_of_a_motion():
    spin = 2.0 * np.pi * 3.0
    motion = sp.reconstruct(sp.rigid(np.diag([4.0, 3.9, 0.5]), 1.0), [4.0 * spin, 0.0, 0.0])
    somersault, tilt, twist = motion.somersault_tilt_twist([0.0, 0.5, 1.0])
    np.testing.assert_allclose(somersault, [0.0, 0.5 * spin, spin], atol=1e-8)
    np.testing.assert_allclose([tilt, twist], 0.0, atol=1e-8)
    np.testing.assert_allclose(motion.rotation_vector(1.0), [spin, 0.0, 0.0], atol=1e-8)
    many = sp.reconstruct(sp.rigid(np.diag([4.0, 3.9, 0.5]), 1.0), [[4.0 * spin, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert many.rotation_vector([0.0, 1.0]).shape == (2, 2, 3)
    assert many.euler_angles(1.0).shape == (2, 3)


def test_sequences_that_there_are_not(things):
    for wrong in ("XXY", "XYz", "XY", "ABC", "", 3):
        with pytest.raises(UnknownNameError, match="sequence"):
            things["motion"].euler_angles(0.0, wrong)
        assert wrong != "ZYX"
    with pytest.raises(UnknownNameError, match="lateral"):
        things["motion"].somersault_tilt_twist(0.0, lateral="side")
    with pytest.raises(ShapeError, match="longitudinal"):
        things["motion"].somersault_tilt_twist(0.0, lateral="z", longitudinal="-z")
    assert euler_angles(np.eye(3)[None], "XYZ").shape == (1, 3)


# ---- Tables and figures ---------------------------------------------------------------------------------------------


def test_a_data_frame_is_the_file(things, tmp_path):
    pandas = pytest.importorskip("pandas")
    motion = things["motion"]
    motion.write_csv(tmp_path / "motion.csv", gravity=[0.0, 0.0, -9.81])
    pandas.testing.assert_frame_equal(
        motion.to_dataframe(gravity=[0.0, 0.0, -9.81]), pandas.read_csv(tmp_path / "motion.csv"), check_exact=True
    )
    with pytest.raises(ShapeError, match="motion"):
        things["batch"].to_dataframe()


def test_a_motion_draws_itself(things):
    motion = things["motion"]
    drawn, asked = motion.plot(), plots.plot_phases(plots.column_axes(2.8), motion)
    for one, other in zip(drawn.lines, asked.lines, strict=True):
        np.testing.assert_array_equal(one.get_xydata(), other.get_xydata())
    axes = plots.column_axes(2.0)
    assert motion.plot("attitude", ax=axes) is axes
    assert motion.plot("shape").lines
    still = sp.reconstruct(motion.deformation, np.zeros(3))
    assert len(still.plot().lines) >= 3
    with pytest.raises(UnknownNameError, match="figure"):
        motion.plot("dance")
    with pytest.raises(ShapeError, match="momentum"):
        still.plot("phases")


def test_methods_that_higher_rooms_do_are_there():
    from shapephase import offers

    for method, (module, function) in offers._OFFERS.items():
        kind, _, name = method.partition(".")
        assert callable(getattr(getattr(sp, kind), name) if name else getattr(sp.examples, kind))
        assert callable(getattr(importlib.import_module(module), function))
        assert offers.offered(method)


def test_a_split_as_a_dictionary_is_json(things):
    for name in ("split", "split of a batch", "split at rest"):
        data = json.loads(json.dumps(things[name].to_dict()))
        assert data["gauge"] == "horizontal"
        assert {*data["error_estimates"]} <= {*data}
        np.testing.assert_array_equal(data["holonomy"], things[name].holonomy)
