"""Whatever is given for an argument of a public function: a sentence says what was wanted and what came."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import ShapePhaseError, UnknownNameError, WrongObjectError
from shapephase.letters import value_text
from support.example_calls import TRUSTING, example_calls, fault_of, trusts, works, wrong_things
from support.long_runs import full_but
from test_documentation import LONG, NAMES

TRIED = [name for name in NAMES if name not in LONG and not name.removeprefix("shapephase.").startswith(TRUSTING)]
# Of these an example takes a few milliseconds, and so do the calls with something wrong.
QUICK = ("shapephase.articulated", "shapephase.reconstruct", "shapephase.momentum_from_rate", "shapephase.split",
         "shapephase.holonomy", "shapephase.base_difference", "shapephase.ShapePath",
         "shapephase.bounds.return_time_bounds", "shapephase.link_gauge", "shapephase.examples.kane_scher",
         "shapephase.load_motion", "shapephase.rigid_body.cones")  # fmt: skip
# Arguments of a study, and what each may be.
WRONG_OF_A_STUDY = {"body": ("str",), "motion": ("str", "builtin_function_or_method"), "over": (), "outputs": ("str",),
                    "draws": (), "seed": (), "chunk": (), "momentum": (), "attitude": ("NoneType", "ndarray"),
                    "tolerance": (), "gauge": (), "parameters": (), "time_limit": ("NoneType", "float")}  # fmt: skip
# A function is what is wanted, whatever it then does.
FUNCTIONS = ("Callable", "ProgressCallback", "Gauge", "Profile", "Meridian", "Stretch", "ClosedArcs", "Effort")
# What may be given as well as what the example gives.
ALSO_TAKEN = (("rigid_body.geodesics._andoyer_variables.andoyer_motion", "Motion"),
              ("shape_space.connection.curvature", "Body"),
              ("segments.momentum.segment_momentum", "Motion"))  # fmt: skip


def faults(name: str) -> list[str]:
    """Of the functions that an example calls, with each argument in turn something else."""
    found = []
    for call in filter(works, example_calls(name, NAMES[name])):
        for argument, said in call.annotations.items():
            if trusts(call, argument):
                continue
            for kind, value in wrong_things().items():
                wanted = kind == "builtin_function_or_method" and any(word in said for word in FUNCTIONS)
                if wanted or (call.place, kind) in ALSO_TAKEN or type(call.arguments[argument]) is type(value):
                    continue
                fault = fault_of(call, argument, value)
                found += [f"{call.place}({argument}) <- {kind}: {fault}"] if fault else []
    return found


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", full_but(TRIED, *QUICK))
def test_a_wrong_argument_gets_a_sentence(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert not faults(name)


@pytest.mark.parametrize("name", QUICK[:3])
def test_the_calls_of_an_example_are_found(name):
    assert name.rpartition(".")[2] in [call.place.rpartition(".")[2] for call in example_calls(name, NAMES[name])]


def test_what_came_is_shown_in_a_line():
    path = sp.examples.kane_scher(0.3, 1.0)
    assert value_text(path) == "a ShapePath"
    assert value_text(sp.EulerTop) == "the class EulerTop itself"
    assert value_text(sp.EulerTop.principal((1.0, 2.0, 3.0), (0.7, 0.2, 1.5))) == "an EulerTop"
    assert value_text("cat") == "'cat'"
    assert value_text(1.5) == "1.5"
    assert "\n" not in value_text(np.eye(9))
    assert len(value_text("x" * 5000)) <= 80


def test_a_name_that_is_none_is_shown_by_its_kind():
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0), [1.0, 0.0, 0.0])
    with pytest.raises(UnknownNameError, match="method"):
        sp.reconstruct(motion.deformation, [1.0, 0.0, 0.0], method=motion)  # type: ignore[arg-type]


@pytest.mark.parametrize("call", [sp.reconstruct, sp.split])
def test_a_wrong_first_object_is_named_before_what_is_missing(call):
    """Python's own word for a missing argument would come before ours."""
    path = sp.examples.kane_scher(0.3, 1.0)
    with pytest.raises(WrongObjectError, match="ShapePath"):
        call(path)


def test_a_momentum_that_is_left_out_is_asked_for():
    with pytest.raises(TypeError, match="momentum"):
        sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0))  # type: ignore[call-overload]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("argument", WRONG_OF_A_STUDY)
def test_a_study_says_what_it_needs(argument, monkeypatch, tmp_path):
    """A study takes names and numbers: of objects of ours, and of what is no number, one line names the argument."""
    monkeypatch.chdir(tmp_path)
    good = {
        "body": "cat_two_halves",
        "motion": "kane_scher",
        "over": {"beta": [0.3, 0.4]},
        "parameters": {"alpha": 0.1},
    }
    taken = WRONG_OF_A_STUDY[argument]
    for kind, thing in {**wrong_things(), "list of objects": [object()], "dict": {1: 2.0}}.items():
        if kind in taken:
            continue
        with pytest.raises(ShapePhaseError) as caught:
            sp.study.Study(**{**good, argument: thing})
        said = str(caught.value)
        assert argument.rstrip("s") in said, said
        assert "\n" not in said, said
        assert len(said) < 500, said


@pytest.mark.parametrize(
    "call", [sp.study.open_study, sp.study.read_study, lambda it: sp.study.export_study(it, "a.csv")]
)
def test_what_is_no_store_or_file_of_a_study_is_named(call):
    with pytest.raises(WrongObjectError, match="Body"):
        call(sp.load_body("cat_two_halves"))


def test_every_function_that_hands_keywords_on_names_one_that_it_does_not_have(tmp_path):
    """The fault names the function that was called and its arguments, not one inside that never heard of it."""
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0), [1.0, 0.0, 0.0])
    pushed = sp.reconstruct(motion.deformation, [1.0, 0.0, 0.0], torque=lambda _: np.zeros(3))
    calls = {
        "ForcedMotion.view": (pushed.view,),
        "Motion.to_dataframe": (motion.to_dataframe,),
        "Motion.to_xarray": (motion.to_xarray,),
        "Motion.view": (motion.view,),
        "Motion.write_csv": (motion.write_csv, tmp_path / "m.csv"),
        "export_motion": (sp.exports.export_motion, motion, tmp_path / "m.nc"),
        "motion_dataset": (sp.exports.motion_dataset, motion),
        "mujoco_arrays": (sp.exports.mujoco_arrays, motion),
        "pinocchio_arrays": (sp.exports.pinocchio_arrays, motion),
        "moving_scene": (sp.plots.moving_scene, motion, 5),
        "view": (sp.view, motion),
        "write_bvh": (sp.exports.write_bvh, motion, tmp_path / "m.bvh"),
        "write_opensim_motion": (sp.exports.write_opensim_motion, motion, tmp_path / "m.mot"),
    }
    assert set(handing_on()) == {*calls, "contributions", "plot_somersault"}
    with pytest.raises(WrongObjectError, match="Did you mean 'lateral'"):
        sp.contributions(motion, laterel="x")
    with pytest.raises(WrongObjectError, match="Did you mean 'joints'"):
        sp.plots.plot_somersault(sp.plots.column_axes(), motion, joint=0.1)
    for place, (call, *arguments) in calls.items():
        said = rf"^unknown argument of {place.rpartition('.')[2]} 'gravitation'. Did you mean 'gravity'\? Valid: "
        with pytest.raises(WrongObjectError, match=said):
            call(*arguments, gravitation=[0.0, 0.0, -9.81])
    assert not list(tmp_path.iterdir())


def handing_on():
    """Names of the public functions and methods that take any keywords."""
    for name, thing in NAMES.items():
        inherited = {key: getattr(thing, key, None) for key in dir(thing)} if inspect.isclass(thing) else {}
        last = name.rpartition(".")[2]
        for place, function in {last: thing, **{f"{last}.{key}": value for key, value in inherited.items()}}.items():
            private = function is not thing and place.rpartition(".")[2].startswith("_")
            if not inspect.isfunction(function) or private:
                continue
            if any(part.kind is part.VAR_KEYWORD for part in inspect.signature(function).parameters.values()):
                yield place
