"""The name of a body or of a motion in place of the object: every public function that takes either gives the same."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import ShapePhaseError
from support.example_calls import ExampleCall, example_calls
from support.long_runs import full_but
from support.public_calls import as_bytes, numbers
from test_documentation import NAMES

OBJECT = re.compile(r"(?<![\w\[])(Body|ShapePath)\b(?!\])")
# Paths of one length, of samples, of all joints but the hinges: no motion of the library is one.
NEVER_NAMED = ("boom", "path_errors", "free_hinges")
# Methods of a path, below the names of motions.
WITHOUT_NAMES = {("then", "other")}


def taking_objects() -> Iterator[tuple[str, Callable[..., Any], dict[str, str]]]:
    """Public functions and methods with the annotations of arguments that are a body or a path."""
    for name, thing in NAMES.items():
        parts = {name: thing}
        if inspect.isclass(thing):
            functions = inspect.getmembers(thing, inspect.isfunction)
            parts = {f"{name}.{key}": function for key, function in functions if not key.startswith("_")}
        for place, function in parts.items():
            if not callable(function):
                continue
            given = inspect.signature(function).parameters.values()
            found = {p.name: str(p.annotation) for p in given if OBJECT.search(str(p.annotation))}
            if found and not inspect.isclass(function):
                yield place, function, found


TAKING = {place: (function, found) for place, function, found in taking_objects()}


def test_every_public_function_of_a_body_or_a_path_takes_its_name_by_its_type():
    assert len(TAKING) > 50
    without = {
        (function.__name__, argument)
        for function, found in TAKING.values()
        for argument, said in found.items()
        if "str" not in re.split(r"\W+", said)
    }
    assert without == WITHOUT_NAMES


def named(call: ExampleCall) -> tuple[dict[str, Any], dict[str, Any]]:
    """Arguments of an example that have names, as objects and by their names, and what a figure is drawn on."""
    objects, names = ({"ax": sp.plots.column_axes()} if "ax" in call.arguments else {} for _ in range(2))
    bodies = {key: value for key, value in call.arguments.items() if isinstance(value, sp.Body)}
    for key, value in bodies.items():
        if value.name in sp.robot_names():
            objects[key], names[key] = value, value.name
    owner = next((body.name for body in bodies.values()), "cat_two_halves")
    motion = next((key for key, known in sp.examples.MOTIONS.items() if known.body == owner), "kane_scher")
    for key, value in call.arguments.items():
        if isinstance(value, sp.ShapePath) and key != "self":
            objects[key], names[key] = sp.examples.MOTIONS[motion].path(), motion
        if key == "paths":
            objects[key], names[key] = [sp.examples.named_motion("kane_scher")] * 2, ["kane_scher"] * 2
    return objects, names


def outcome(call: ExampleCall, given: dict[str, Any]) -> bytes:
    """Numbers of what a call gives, draws or writes, or its error."""
    first, value = next(iter(given.items()))
    try:
        result = replace(call, arguments={**call.arguments, **given}).with_another(first, value)
    except ShapePhaseError as error:
        return f"{type(error).__name__}: {error}".encode()
    if result is None:
        return b"".join(file.read_bytes() for file in sorted(Path.cwd().iterdir()))
    if hasattr(result, "get_lines"):
        return as_bytes([np.asarray(line.get_xydata()) for line in result.get_lines()] + [result.get_xlabel()])
    return as_bytes(result) if numbers(result) else repr(result).encode()


# Some seconds, or half a minute where machine code has to be compiled; `plan_reorientation` in tests/optimal_control.
LONG = ("shapephase.plan_reorientation", "shapephase.plots.explore", "shapephase.plots.report",
        "shapephase.auditing.audit_page")  # fmt: skip
# Their examples call them without a body and a path.
BY_HAND = ("shapephase.MinimumPerturbation.along", "shapephase.MinimumPerturbation.first_order_turn",
           "shapephase.ShapePath.circle", "shapephase.ShapePath.then", "shapephase.plots.write_figure",
           "shapephase.examples.named_motion")  # fmt: skip
QUICK = ("shapephase.articulated", "shapephase.holonomy", "shapephase.curvature", "shapephase.reachable",
         "shapephase.path_summary", "shapephase.write_shape_path",
         "shapephase.plots.plot_shape_path", "shapephase.optimal_control.path_cost", "shapephase.audit")  # fmt: skip


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("place", full_but([place for place in TAKING if place not in LONG + BY_HAND], *QUICK))
def test_a_name_gives_what_its_object_gives(place, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    function, _ = TAKING[place]
    calls = example_calls(place, NAMES.get(place) or function)
    call = next(call for call in calls if call.place.endswith(f".{function.__qualname__}"))
    objects, names = named(call)
    assert any(isinstance(value, str | list) for value in names.values())
    expected = outcome(call, objects)
    assert outcome(call, names) == expected
    assert (b"Error: " in expected[:60]) == (function.__name__ in NEVER_NAMED), expected[:200]


def test_what_examples_call_without_a_body_or_a_path_takes_names_too(tmp_path):
    joints = ("waist_pitch", "waist_yaw", 0.5)
    circles = [sp.ShapePath.circle(cat, *joints).shape(0.3) for cat in ("cat", sp.load_body("cat"))]
    assert np.array_equal(*circles)
    path = sp.examples.MOTIONS["kane_scher"].path()
    frame = sp.minimum_perturbation("cat_two_halves", np.zeros(3), 0.3, 2)
    assert np.array_equal(frame.first_order_turn("kane_scher"), frame.first_order_turn(path))
    assert np.array_equal(frame.along("kane_scher")(np.array([0.3]))[0], frame.along(path)(np.array([0.3]))[0])
    motion = sp.reconstruct(sp.articulated("cat_two_halves", path), [0.0, 0.0, 0.001])
    for file, given in (("name.png", "kane_scher"), ("path.png", path)):
        sp.plots.write_figure("shape", motion, tmp_path / file, path=given)
    assert (tmp_path / "name.png").read_bytes() == (tmp_path / "path.png").read_bytes()


def test_the_file_of_a_recording_is_a_name_of_a_path(tmp_path, monkeypatch):
    """It comes before a motion of the library, like the file of a body before the name of one."""
    monkeypatch.chdir(tmp_path)
    sp.write_shape_path("cat_righting_twist", "cat_righting.csv")
    Path("cat_righting.csv").rename("cat_righting")
    sp.write_shape_path("cat_righting_twist", "twist.csv")
    read = sp.read_shape_path("twist.csv", "cat")
    assert np.array_equal(sp.holonomy("cat", "twist.csv"), sp.holonomy("cat", read))
    with pytest.raises(sp.ShapePhaseError, match="cat_righting"):
        sp.holonomy("cat", "cat_righting")  # a file without an ending


@pytest.mark.parametrize(
    ("body", "path", "said"),
    [
        (
            "kat",
            "cat_righting",
            r"^unknown body \(no such file either\) 'kat'. Did you mean 'cat'\? Valid: astronaut, ",
        ),
        (
            "cat",
            "cat_rihting",
            r"^unknown motion \(no such file either\) 'cat_rihting'. Did you mean 'cat_righting'\? ",
        ),
        ("cat", "no.csv", r"^unknown motion \(no such file either\) 'no.csv'"),
        (
            "diver",
            "cat_righting",
            "of cat, whose joints diver does not have; of diver there is diver_twist, five_stage_dive$",
        ),
    ],
)
def test_a_wrong_name_says_the_nearest_ones(body, path, said):
    with pytest.raises(sp.ShapePhaseError, match=said):
        sp.articulated(body, path)
