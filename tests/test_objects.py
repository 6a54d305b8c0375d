"""Objects as arguments and results: wrong ones get a sentence, what is shown cannot be written to, what came is copied,
and everything goes to another process."""

from __future__ import annotations

import copy
import dataclasses
import importlib
import inspect
import operator
import pickle
import pkgutil
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.deformation.assemblies import assembly, moving_mass, rigid_part
from shapephase.errors import LocalFunctionError, ShapePhaseError, WrongObjectError
from shapephase.examples import cat_righting, kane_scher
from shapephase.reconstruction.reconstruction import load_motion

KINDS = ("Body", "ShapePath", "Deformation", "Motion", "PhaseSplit")
MOMENTUM = (0.01, 0.02, 0.03)
# Functions that other functions of the library call with what they have checked.
INNER = ("deformation.frames", "shape_space.body_path", "plots.plot_style", "optimal_control.task",
         "optimal_control.guesses.loops", "shape_space.shape_path.without_joints",
         "optimal_control.symbolic", "optimal_control.cost_metric", "optimal_control.nodes",
         "body.drawing", "examples.slow_deformation.first_loop",
         "shape_space.connection.connection_slopes", "plots.pages",
         "shape_space.path_samples", "shape_space.path_series", "shape_space.files.formats", "phases.split_text",
         "phases.momentum_curve", "body.engines", "shape_space.files.flight",
         "shape_space.files.inputs", "shape_space.files.times", "shape_space.files.labels",
         "shape_space.knot_crossings",
         "dynamics.moving_body", "error_bars.error_sources", "error_bars.covariance.carried_errors",
         "error_bars.covariance.moved_fit", "error_bars.result_derivatives.turns_by",
         "error_bars.result_derivatives.deformation_parts", "segments.share_bars.result_covariance",
         "plots.named_figures.figure_image",
         "shape_space.files.smoothing.check_swings",
         "deformation.deformation.deformation_along", "shape_space.curvature_field.curvature_along",
         "plots.loop_plots.draw_loop_flux", "plots.loop_plots.enclosing_pair", "plots.loop_plots.loop_flux",
         "shape_space.interpolation.circle_coefficients",
         "optimal_control.extremals.hamiltonian.checked_metric",
         "optimal_control.extremals.hamiltonian.flow", "phases.error_estimates.by_parts",
         "reconstruction.forced_motion.reconstruct_forced", "reconstruction.motion_record",
         "segments.direct_shares.articulated_parts", "segments.direct_shares.rotors_of",
         "segments.direct_shares.reduced_body", "segments.mirrored_motion",
         "optimal_control.extremals.hamiltonian.natural_scales")  # fmt: skip


@pytest.fixture(scope="module")
def objects():
    """One of each kind."""
    body, path = sp.load_body("cat_two_halves"), kane_scher(0.3, 1.0)
    deformation = sp.articulated(body, path)
    motion = sp.reconstruct(deformation, MOMENTUM)
    return {
        "Body": body,
        "ShapePath": path,
        "Deformation": deformation,
        "Motion": motion,
        "PhaseSplit": sp.split(motion),
    }


# ---- Wrong objects --------------------------------------------------------------------------------------------------


def kind_of(parameter):
    """Of the object that an argument is; one for which a family or particles will also do is that one."""
    first, *others = str(parameter.annotation).split(" | ")
    also = {f"{first}Family", "ParticleBody"}
    return first if also.issuperset(others) else str(parameter.annotation)


def public_functions():
    """Functions of public modules with arguments that are objects of ours."""
    for module in pkgutil.walk_packages(sp.__path__, "shapephase."):
        parts = module.name.split(".")
        if any(part.startswith("_") or part == "cli" for part in parts):
            continue
        for name, function in vars(importlib.import_module(module.name)).items():
            place = f"{module.name.removeprefix('shapephase.')}.{name}"
            mine = inspect.isfunction(function) and function.__module__ == module.name
            if mine and not name.startswith("_") and not place.startswith(INNER):
                signature = inspect.signature(function).parameters.values()
                found = [(p.name, kind_of(p)) for p in signature if kind_of(p) in KINDS]
                if found:
                    yield place, function, found


@pytest.mark.parametrize(
    ("function", "arguments"), [pytest.param(f, found, id=place) for place, f, found in public_functions()]
)
def test_a_wrong_object_gets_a_sentence(objects, function, arguments):
    """Instead of a body, a path, a deformation or a motion: what is needed, what came, how it is made."""
    others = {"str": "cat", "NoneType": None, "ndarray": np.eye(3), "type": sp.Body}
    needed = [p for p in inspect.signature(function).parameters.values() if p.default is p.empty]
    filled = {p.name: objects.get(kind_of(p)) for p in needed if p.kind is not p.VAR_KEYWORD}
    for name, kind in arguments:
        for came, value in [*objects.items(), *others.items()]:
            if came == kind:
                continue
            with pytest.raises(WrongObjectError) as caught:
                function(**{**filled, name: value})
            said = str(caught.value)
            assert said.startswith(f"{name}: a {kind} is needed, got ")
            assert (f" {came}; " in said) or (came == "type" and "the class Body itself; " in said)
            assert isinstance(caught.value, TypeError)


def test_the_sentence_says_how_one_is_made_of_the_other(objects):
    for function, value, words in (
        (sp.reconstruct, objects["ShapePath"], "make it with articulated(body, path)"),
        (sp.split, objects["Deformation"], "make it with reconstruct(deformation, momentum)"),
        (sp.split, objects["ShapePath"], "where articulated(body, path) makes a deformation"),
        (sp.fixed_points, objects["Motion"], "it is motion.deformation"),
        (sp.mechanical_connection, objects["Motion"], "it is motion.deformation.description.body"),
    ):
        with pytest.raises(WrongObjectError) as caught:
            function(value, [0.0, 0.0, 1.0])
        assert words in str(caught.value)


# ---- What is shown --------------------------------------------------------------------------------------------------


def shown(thing, name, depth=0, seen=None):
    """The arrays that attributes show of an object's inside, with their names; copies made for the caller left out."""
    seen = set() if seen is None else seen
    if id(thing) in seen or depth > 4:
        return
    seen.add(id(thing))
    names = {field.name for field in dataclasses.fields(thing)} if dataclasses.is_dataclass(thing) else set()
    kinds = {key: type(getattr(type(thing), key, None)).__name__ for key in dir(type(thing))}
    names |= {key for key, kind in kinds.items() if kind in ("property", "cached_property")}
    for key in sorted(key for key in names if not key.startswith("_")):
        try:
            value = getattr(thing, key)
        except ShapePhaseError:
            continue
        if isinstance(value, np.ndarray):
            if value.size and np.shares_memory(value, getattr(thing, key)):
                yield f"{name}.{key}", value
        elif type(value).__module__.startswith("shapephase"):
            yield from shown(value, f"{name}.{key}", depth + 1, seen)


@pytest.fixture(scope="module")
def inside(objects):
    spline = sp.ShapePath.spline(np.linspace(0.0, 1.0, 6), np.random.default_rng(0).normal(size=(6, 2)))
    body, deformation, motion = objects["Body"], objects["Deformation"], objects["Motion"]
    masses = [1.0, 2.0, 3.0, 4.0]
    points = np.random.default_rng(1).normal(size=(5, 4, 3))
    return {
        "path": objects["ShapePath"],
        "cat": cat_righting(),
        "spline": spline,
        "joined": spline.then(spline.reversed()).repeated(2),
        "deformation": deformation,
        "rigid": sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0),
        "particles": sp.particles(masses, (np.arange(5.0), points)),
        "horizontal": sp.horizontal_gauge(deformation),
        "motion": motion,
        "dop853": sp.reconstruct(deformation, MOMENTUM, method="dop853"),
        "sensitivity": motion.sensitivity,
        "lift": sp.horizontal_lift(body, objects["ShapePath"]),
    }


NAMED = (
    "path.breaks", "spline.sample_times", "spline.breaks", "deformation.breaks", "deformation.closure",
    "motion.momentum",
    "motion.solution.quaternions", "motion.solution.directions", "motion.solution.times", "motion.solution.steps",
    "motion.solution.interpolant.coefficients", "motion.solution.interpolant.edges", "sensitivity.by_momentum",
    "particles.description.masses",
)  # fmt: skip


def test_what_attributes_show_of_the_inside_cannot_be_written_to(inside):
    seen: set[int] = set()
    found = {name: array for key, thing in inside.items() for name, array in shown(thing, key, seen=seen)}
    # Results made for the caller alone; and private matters of the dense output.
    own = ("motion.horizontal_lift", "motion.equation_residual", "lift.holonomy")
    writable = [name for name, array in found.items() if array.flags.writeable and not name.startswith(own)]
    assert [name for name in writable if not name.endswith("momentum_slope")] == []
    for name in NAMED:
        key, _, attributes = name.partition(".")
        assert not operator.attrgetter(attributes)(inside[key]).flags.writeable, name


def test_attitudes_that_are_shown_are_copies(objects):
    """SciPy before 1.16 makes no rotation of an array that is locked; what is written to a copy changes nothing."""
    motion = objects["Motion"]
    times = np.linspace(0.0, motion.duration, 12)
    fitted = sp.momentum_from_recording(motion.deformation, times, motion.attitude(times), noise=1e-3)
    for result, name in ((motion, "initial_attitude"), (fitted, "initial_attitude"), (fitted, "base_axes")):
        first = getattr(result, name)
        for thing in (result, copy.copy(result), pickle.loads(pickle.dumps(result)), dataclasses.replace(result)):
            shown = getattr(thing, name)
            np.testing.assert_allclose(Rotation.from_matrix(shown).as_matrix(), first, rtol=0, atol=1e-15)
            shown[...] = 0.0
            np.testing.assert_array_equal(getattr(thing, name), first)
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(result, name, first)


def test_times_of_a_path_cannot_be_scaled_in_place(inside):
    spline, motion = inside["spline"], inside["motion"]
    before, attitude = spline.shape(0.7), motion.attitude(0.3 * motion.duration)
    with pytest.raises(ValueError, match="read-only"):
        spline.sample_times[:] *= 0.5
    with pytest.raises(ValueError, match="read-only"):
        motion.solution.interpolant.coefficients[:] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        motion.momentum[0] = 7.0
    np.testing.assert_array_equal(spline.shape(0.7), before)
    np.testing.assert_array_equal(motion.attitude(0.3 * motion.duration), attitude)


def test_what_methods_return_is_fresh_and_writable(inside):
    motion, deformation, path = inside["motion"], inside["deformation"], inside["path"]
    time = 0.4 * motion.duration
    for method in (motion.attitude, motion.quat_xyzw, motion.body_momentum, motion.angular_velocity,
                   motion.base_position,
                   deformation.inertia, deformation.internal_momentum, deformation.inertia_rate, deformation.frame,
                   deformation.centre_of_mass, path.shape, path.rate):  # fmt: skip
        first = method(time)
        kept = first.copy()
        first[...] = np.nan
        np.testing.assert_array_equal(method(time), kept)


# ---- What came ------------------------------------------------------------------------------------------------------


def made_of(arrays):
    """Everything that keeps arrays of the caller, as functions that evaluate it later."""
    a = arrays
    fourier = sp.ShapePath.fourier(a["mean"], a["cosines"], a["sines"], 1.0)
    spline = sp.ShapePath.spline(a["times"], a["shapes"])
    moves = sp.ShapePath.waypoints(a["times"], a["shapes"])
    with_breaks = sp.ShapePath.function(lambda t: (np.stack([t, t], 1), np.ones((len(t), 2))), 1.0, a["breaks"])
    points = sp.particles(a["masses"], lambda t: moving_points(t), 1.0, a["breaks"])
    samples = sp.particles(a["masses"], (a["times"], a["points"]))
    rigid = sp.rigid(a["inertia"], 1.0)
    prescribed = sp.prescribed(steady, None, 1.0, a["breaks"])
    turned = sp.in_gauge(rigid, rates=lambda t: np.ones((len(t), 3)), start=a["attitude"])
    circle = sp.ShapePath.fourier(a["offset"], a["wide"], a["wide"], 1.0)
    whole = assembly(rigid_part(3.0, a["inertia"], a["offset"]), [moving_mass(1.0, circle)])
    motion = sp.reconstruct(rigid, a["momentum"], a["attitude"])
    top = sp.EulerTop(a["inertia"], a["momentum"])
    return {
        "fourier": lambda: fourier.shape(0.3),
        "spline": lambda: spline.shape(0.3),
        "waypoints": lambda: moves.shape(0.3),
        "function": lambda: with_breaks.breaks,
        "particles": lambda: points.inertia(0.3),
        "samples": lambda: samples.inertia(0.3),
        "rigid": lambda: rigid.inertia(0.3),
        "prescribed": lambda: prescribed.breaks,
        "gauge": lambda: turned.frame(0.3),
        "assembly": lambda: whole.inertia(0.3),
        "motion": lambda: np.concatenate([motion.attitude(0.3).ravel(), motion.body_momentum(0.3)]),
        "top": lambda: top.attitude(0.3),
    }


def steady(t):
    """An inertia that stays as it is."""
    return np.broadcast_to(np.diag([1.0, 2.0, 3.0]), (len(t), 3, 3))


def moving_points(t):
    """Four particles on circles."""
    phase = t[:, None] + np.arange(4.0)
    points = np.stack([np.cos(phase), np.sin(phase), 0.3 * np.arange(4.0) + 0.0 * phase], axis=-1)
    speeds = np.stack([-np.sin(phase), np.cos(phase), 0.0 * phase], axis=-1)
    return points, speeds


def arguments():
    rng = np.random.default_rng(5)
    return {
        "mean": rng.normal(size=2),
        "cosines": rng.normal(size=(2, 3)),
        "sines": rng.normal(size=(2, 3)),
        "times": np.arange(5.0),
        "shapes": rng.normal(size=(5, 2)),
        "breaks": np.array([0.25, 0.5]),
        "masses": np.array([1.0, 2.0, 3.0, 4.0]),
        "points": rng.normal(size=(5, 4, 3)),
        "inertia": np.diag([1.0, 2.0, 2.5]),
        "attitude": so3.exp(np.array([0.3, 0.2, -0.1])),
        "offset": np.array([0.1, 0.2, 0.3]),
        "wide": rng.normal(size=(3, 1)),
        "momentum": np.array([0.1, 0.2, 0.3]),
    }


def test_the_caller_s_arrays_are_copied_at_once():
    """Filled anew before anything is evaluated, they change nothing; and no argument has been changed or locked."""
    kept, given = arguments(), arguments()
    expected = {name: evaluate() for name, evaluate in made_of(kept).items()}
    later = made_of(given)
    for name, array in given.items():
        np.testing.assert_array_equal(array, arguments()[name])
        array[...] = 7.0
    for name, evaluate in later.items():
        np.testing.assert_array_equal(evaluate(), expected[name], err_msg=name)


def test_three_paths_of_one_array_are_three_paths():
    sines, paths = np.zeros((1, 1)), []
    for size in (1.0, 2.0, 3.0):
        sines[:] = size
        paths.append(sp.ShapePath.fourier([0.0], [[0.0]], sines, 4.0))
    np.testing.assert_allclose([path.shape(1.0)[0] for path in paths], [1.0, 2.0, 3.0])


# ---- Other processes ------------------------------------------------------------------------------------------------


def swing(times):
    ahead = np.array([0.0, 1.0, 2.0])
    return np.sin(times[:, None] + ahead), np.cos(times[:, None] + ahead)


def turned(times):
    return so3.exp(np.outer(np.sin(3.0 * times), [0.1, 0.2, 0.3]))


def turning(times):
    axis = np.array([0.1, 0.2, 0.3])
    return turned(times), np.outer(3.0 * np.cos(3.0 * times), axis)


def spinning(times):
    return np.stack([np.sin(times), np.cos(times), 0.0 * times], axis=1)


def travellers():
    body, path = sp.load_body("cat_two_halves"), kane_scher(0.3, 1.0)
    deformation = sp.articulated(body, path)
    spline = sp.ShapePath.spline(np.arange(5.0), np.sin(np.arange(15.0)).reshape(5, 3), joint_names=path.joint_names)
    function = sp.ShapePath.function(swing, 1.0, joint_names=path.joint_names)
    motion = sp.reconstruct(deformation, MOMENTUM)
    return {
        "body": body,
        "path": path,
        "spline": spline,
        "changed": spline.then(spline.reversed().stretched(0.5)).repeated(2),
        "function": function,
        "matched": function.reversed().matched(path.joint_names[::-1], "the body"),
        "deformation": deformation,
        "horizontal": sp.horizontal_gauge(deformation),
        "mean body": sp.mean_body_gauge(deformation),
        "principal": sp.principal_gauge(deformation),
        "link": sp.link_gauge(deformation, body.link_names[-1]),
        "turned": sp.in_gauge(deformation, turning),
        "turned without rates": sp.in_gauge(deformation, turned),
        "turned by rates": sp.in_gauge(deformation, rates=spinning),
        "particles": sp.particles([1.0, 2.0, 3.0, 4.0], moving_points, 1.0),
        "rigid": sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0),
        "motion": motion,
        "dop853": sp.reconstruct(deformation, MOMENTUM, method="dop853"),
        "split": sp.split(motion),
        "fixed points": sp.fixed_points(deformation, 0.02),
        "lift": sp.horizontal_lift(body, path),
        "top": sp.EulerTop(np.diag([1.0, 2.0, 3.0]), [0.1, 0.2, 0.3]),
    }


def evaluated(thing):
    """Numbers of an object that hold only if all of it is there."""
    time = 0.37 * getattr(thing, "duration", 1.0)
    for name in ("attitude", "inertia", "shape"):
        method = getattr(thing, name, None)
        if callable(method):
            return np.asarray(method() if isinstance(thing, sp.Body) else method(time))
    return np.asarray(getattr(thing, "holonomy", getattr(thing, "directions", 0.0)))


@pytest.fixture(scope="module")
def all_travellers():
    return travellers()


def test_they_pickle_and_copy(all_travellers):
    for name, thing in all_travellers.items():
        expected = evaluated(thing)
        for again in (pickle.loads(pickle.dumps(thing)), copy.deepcopy(thing), copy.copy(thing)):
            np.testing.assert_array_equal(evaluated(again), expected, err_msg=name)
        if isinstance(thing, sp.Deformation):
            there = pickle.loads(pickle.dumps(thing))
            ends = [sp.reconstruct(either, MOMENTUM).final_attitude for either in (there, thing)]
            np.testing.assert_array_equal(*ends, err_msg=name)


def test_it_goes_to_a_new_process_and_back(all_travellers):
    # Functions of this file are not found there.
    here = ("function", "matched", "particles", "turned", "turned without rates", "turned by rates")
    things = {name: thing for name, thing in all_travellers.items() if name not in here}
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        for thing, back in zip(things.values(), pool.map(copy.copy, things.values(), timeout=300), strict=True):
            np.testing.assert_array_equal(evaluated(back), evaluated(thing))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: sp.ShapePath.function(lambda t: swing(t), 1.0), "a path made of"),
        (lambda: sp.ShapePath.function(lambda t: swing(t), 1.0).reversed(), "a path made of"),
        (lambda: sp.particles([1.0, 2.0, 3.0, 4.0], lambda t: moving_points(t), 1.0), "a deformation made of"),
        (
            lambda: sp.prescribed(lambda t: steady(t), None, 1.0),
            "a deformation made of",
        ),
        (lambda: sp.in_gauge(sp.rigid(np.eye(3), 1.0), lambda t: turning(t)), "a gauge made of"),
        (lambda: sp.in_gauge(sp.rigid(np.eye(3), 1.0), lambda t: turned(t)), "a gauge made of"),
        (lambda: sp.in_gauge(sp.rigid(np.eye(3), 1.0), rates=lambda t: spinning(t)), "a gauge made of"),
    ],
)
def test_what_is_made_of_a_lambda_says_so_and_is_copied_all_the_same(make, words):
    thing = make()
    with pytest.raises(LocalFunctionError, match=f"{words} .*<lambda>.* define it at the top of a module") as caught:
        pickle.dumps(thing)
    assert isinstance(caught.value, pickle.PicklingError)
    np.testing.assert_array_equal(evaluated(copy.deepcopy(thing)), evaluated(thing))


def test_picklers_that_take_functions_by_value_may_have_lambdas():
    cloudpickle = pytest.importorskip("cloudpickle")
    path = sp.ShapePath.function(lambda t: swing(t), 1.0)
    np.testing.assert_array_equal(pickle.loads(cloudpickle.dumps(path)).shape(0.4), path.shape(0.4))


def test_a_motion_made_of_a_lambda_is_saved_instead(tmp_path):
    deformation = sp.particles([1.0, 2.0, 3.0, 4.0], lambda t: moving_points(t), 1.0)
    motion = sp.reconstruct(deformation, [0.0, 1.0, 2.0])
    motion.save(tmp_path / "motion.npz")
    again = pickle.loads(pickle.dumps(load_motion(tmp_path / "motion.npz")))
    assert so3.angle(again.final_attitude.T @ motion.final_attitude) < 1e-12
