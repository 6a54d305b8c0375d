"""What `sp.<tab>` shows, in the library and in its rooms: public names that load late, and nothing else."""

from __future__ import annotations

import importlib
import inspect
import subprocess
import sys
import types
from pathlib import Path

import pytest

import shapephase as sp
from support.places import ROOT

SOURCE = ROOT / "src"
ROOMS = sorted(".".join(stub.parent.relative_to(SOURCE).parts) for stub in SOURCE.glob("shapephase/**/__init__.pyi"))


@pytest.mark.parametrize("room", ROOMS)
def test_every_public_name_of_a_room_is_there(room):
    module = importlib.import_module(room)
    assert module.__doc__
    assert set(dir(module)) <= set(module.__all__)
    assert module is sp or len(dir(module)) == len(module.__all__)
    for name in module.__all__:
        found = getattr(module, name)
        assert not name.startswith("_")
        assert isinstance(found, types.ModuleType) or getattr(found, "__doc__", None), f"{room}.{name}"


def test_the_library_shows_its_rooms_and_the_names_of_most_scripts():
    """Every other function and class that `sp.` has is listed by the room it comes from."""
    assert len(dir(sp)) <= 45
    listed = {name for room in ROOMS if room != "shapephase" for name in dir(importlib.import_module(room))}
    elsewhere = {name for name in sp.__all__ if not inspect.ismodule(getattr(sp, name))} - set(dir(sp))
    assert elsewhere - listed <= set(dir(sp.errors)) | {name for name in vars(sp.errors) if name[0].isupper()}


@pytest.mark.parametrize("room", ROOMS)
def test_no_function_hides_a_module_of_its_own_name(room):
    """Whoever imports `shapephase.room.name` as a module would turn `room.name` into it."""
    module = importlib.import_module(room)
    folder = Path(inspect.getfile(module)).parent
    files = {path.stem for path in folder.glob("*.py")}
    assert not [name for name in module.__all__ if name in files and not inspect.ismodule(getattr(module, name))]


def test_names_are_there_without_a_further_import():
    code = (
        "import shapephase as sp\n"
        "print(sp.plots.plot_phases.__name__, sp.plan_reorientation.__name__, sp.optimal_control.Plan.__name__, "
        "sp.geodesics.ellipsoid.__name__, sp.rigid_body.half_twist.__name__, sp.rigid_body.lie.so3.__name__)"
    )
    said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert said.split() == ["plot_phases", "plan_reorientation", "Plan", "ellipsoid", "half_twist", "so3"]


def test_the_rigid_body_shows_all_its_functions_and_classes():
    found = [getattr(room, name) for room in (sp.rigid_body, sp.rigid_body.lie) for name in room.__all__]
    assert sum(map(inspect.isfunction, found)) >= 112
    assert sum(map(inspect.isclass, found)) >= 26


def test_a_name_that_does_not_exist_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = sp.no_such_name


def test_a_misspelt_name_gets_the_nearest():
    with pytest.raises(AttributeError, match="no 'holonmy'; did you mean holonomy"):
        sp.holonmy  # noqa: B018
    assert not hasattr(sp, "frobnicate")
