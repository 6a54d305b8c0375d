"""Whether a store goes on with a study: only where all that its values depend on is as it was."""

from __future__ import annotations

import importlib
import sys
from functools import partial

import numpy as np
import pytest

import shapephase as sp
from shapephase import study as room
from shapephase.errors import RunStopped, StudyError, StudyStoreError
from support.study_functions import bend

SPUN = {"over": {"momentum": room.Directions(1.0)}, "draws": 4, "chunk": 2}
RIGID = room.RigidBody(np.diag([1.0, 2.0, 2.5]), 3.0)


def half(place, study):
    """Two of four cases."""
    with pytest.raises(RunStopped):
        study.run(place, workers=0, progress=lambda *_: True)


def spun(function, **more):
    return room.Study(RIGID, outputs=(room.Output("value", function),), **SPUN, **more)


def scaled(scale):
    return lambda motion: scale * float(motion.duration)


def times(motion, factor, shift=0.0):
    return factor * float(motion.duration) + shift


def with_default(factor):
    def function(motion, scale=factor):
        return scale * float(motion.duration)

    return function


class Scaled:
    """A function with a state."""

    def __init__(self, factor):
        self.factor = factor

    def __call__(self, motion):
        return self.factor * float(motion.duration)

    def method(self, motion):
        return self(motion)


def two_partials(first, second):
    pair = partial(times, factor=first), partial(times, factor=second)
    return lambda motion: pair[0](motion) - pair[1](motion)


def of_class(value):
    class Local:
        held = value

    return lambda motion: float(motion.duration * np.ma.filled(Local.held, 7.0).sum())


PAIRS = {
    "partial of two": [two_partials(1.0, 3.0), two_partials(2.0, 3.0)],
    "held of": [of_class(np.ma.array([1.0], mask=[False])), of_class(np.ma.array([1.0], mask=[True]))],
    "closure scale": [scaled(1.0), scaled(100.0)],
    "argument factor": [partial(times, factor=1.0), partial(times, factor=100.0)],
    "default scale": [with_default(1.0), with_default(100.0)],
    "closure array": [scaled(np.ones(1)[0]), scaled(np.full(1, 2.0)[0])],
    "of an object": [Scaled(1.0), Scaled(2.0)],
    "of a method": [Scaled(1.0).method, Scaled(2.0).method],
    "code": [lambda motion: motion.duration, lambda motion: -motion.duration],
}


@pytest.mark.parametrize("what", PAIRS)
def test_a_function_that_gives_other_values_is_another_study(tmp_path, what):
    first, second = (spun(function) for function in PAIRS[what])
    half(tmp_path / "out.zarr", first)
    said = what if what.startswith(("closure scale", "argument", "default", "held")) else "output value"
    with pytest.raises(StudyStoreError, match=said):
        second.run(tmp_path / "out.zarr", workers=0, resume=True)
    store = first.run(tmp_path / "out.zarr", workers=0, resume=True)
    assert len(set(store.values("value").tolist())) == 1


@pytest.mark.full
def test_a_function_that_is_made_anew_is_the_same_study(tmp_path):
    for make in (scaled, with_default, Scaled, lambda factor: partial(times, factor=factor)):
        assert spun(make(3.0)).hash == spun(make(3.0)).hash
    half(tmp_path / "out.zarr", spun(scaled(3.0)))
    store = spun(scaled(3.0)).run(tmp_path / "out.zarr", workers=1, resume=True)
    np.testing.assert_array_equal(store.values("value"), 9.0)


def imported(name):
    sys.modules.pop("study_helper", None)
    sys.modules.pop(name, None)
    sys.path_importer_cache.clear()
    importlib.invalidate_caches()
    return importlib.import_module(name)


HOW = {
    "import study_helper\ndef value(motion):\n    return study_helper.factor() * motion.duration\n",
    "from study_helper import factor\ndef value(motion):\n    return factor() * motion.duration\n",
    "def value(motion):\n    from study_helper import factor\n    return factor() * motion.duration\n",
    "import study_helper as other\ndef value(motion):\n    return getattr(other, 'fac' + 'tor')() * motion.duration\n",
}


@pytest.mark.parametrize("text", sorted(HOW))
def test_a_module_of_the_user_that_changed_is_another_study(tmp_path, monkeypatch, text):
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "study_outputs").with_suffix(".py").write_text(text)
    (tmp_path / "study_helper").with_suffix(".py").write_text("def factor():\n    return 1.0\n")
    half(tmp_path / "out.zarr", spun(imported("study_outputs").value))
    (tmp_path / "study_helper").with_suffix(".py").write_text("def factor():\n    return 100.0\n")
    with pytest.raises(StudyStoreError, match="study_helper"):
        spun(imported("study_outputs").value).run(tmp_path / "out.zarr", workers=0, resume=True)


def test_what_cannot_be_compared_is_refused_unless_a_version_is_given(tmp_path):
    with open(tmp_path / "file", "w") as handle:
        function = scaled(handle)
        with pytest.raises(StudyError, match="version="):
            spun(function)
        first, second = (spun(function, version=version) for version in "12")
    half(tmp_path / "out.zarr", first)
    with pytest.raises(StudyStoreError, match="version"):
        second.run(tmp_path / "out.zarr", workers=0, resume=True)


def test_an_object_that_refers_to_itself_is_refused_by_name():
    nested: list[object] = [1.0]
    nested.append(nested)
    with pytest.raises(StudyError, match="version="):
        spun(scaled(nested))


def test_a_function_without_a_module_is_compared():
    first, second = ({}, {})
    exec("def value(motion):\n    return motion.duration", first)
    exec("def value(motion):\n    return -motion.duration", second)
    assert spun(first["value"]).hash != spun(second["value"]).hash


ARM = '<body name="arm" pos="0 0 0.3"><joint name="arm_hinge" axis="1 0 0"/><geom size="0.1" mass="{}"/></body>'
MJCF = """<mujoco><worldbody><body name="torso"><freejoint/><geom size="0.2" mass="3"/><include file="arm.xml"/></body>
</worldbody></mujoco>"""
TENSOR = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
XACRO = f"""<robot name="two" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include filename="arm.xml"/>
<link name="base"><inertial><mass value="1"/>{TENSOR}</inertial></link>
<link name="arm"><inertial><mass value="${{mass}}"/>{TENSOR}</inertial></link>
<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="1 0 0"/></joint></robot>"""


@pytest.mark.parametrize("kind", ["mjcf", "xacro"])
def test_an_included_file_that_changed_is_another_study(tmp_path, kind):
    pytest.importorskip("mujoco" if kind == "mjcf" else "xacro")
    file = tmp_path / ("body.xml" if kind == "mjcf" else "body.urdf.xacro")
    file.write_text(MJCF if kind == "mjcf" else XACRO)
    hinge = "arm_hinge" if kind == "mjcf" else "hinge"

    def study(mass):
        arm = ARM.format(mass)
        if kind == "xacro":
            arm = f'<x xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="mass" value="{mass}"/></x>'
        else:
            arm = f"<mujocoinclude>{arm}</mujocoinclude>"
        (tmp_path / "arm.xml").write_text(arm)
        sp.write_shape_path(
            sp.ShapePath.fourier([0.0], [[0.5]], [[0.2]], 1.0, joint_names=[hinge]), tmp_path / "arm.csv"
        )
        return room.Study(file, tmp_path / "arm.csv", {"momentum_z": [0.0, 0.1, 0.2]}, chunk=1)

    half(tmp_path / "out.zarr", study(2.0))
    with pytest.raises(StudyStoreError, match="links"):
        study(6.0).run(tmp_path / "out.zarr", workers=0, resume=True)
    store = study(2.0).run(tmp_path / "out.zarr", workers=0, resume=True)
    body = sp.load_body(file)
    path = sp.read_shape_path(tmp_path / "arm.csv", body)
    loop = [
        sp.reconstruct(sp.articulated(body, path), [0.0, 0.0, z], tolerance=1e-9).final_attitude
        for z in (0.0, 0.1, 0.2)
    ]
    np.testing.assert_array_equal(store.values("final_attitude"), loop)


def test_a_motion_that_reads_a_file_of_its_own_is_known_by_its_samples(tmp_path):
    file = tmp_path / "depth.txt"

    def motion():
        return bend(float(file.read_text()))

    file.write_text("0.5")
    first = room.Study("cat_two_halves", motion, {"momentum_z": [0.0, 0.1]})
    file.write_text("0.6")
    second = room.Study("cat_two_halves", motion, {"momentum_z": [0.0, 0.1]})
    changed = {name for name in first.inputs if first.inputs[name] != second.inputs[name]}
    assert len(changed) == 1
    assert "samples" in changed.pop()
