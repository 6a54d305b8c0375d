"""Goals that no motion reaches are refused before anything is searched for, with the reason; all others are not."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import PlanNotFound, UnreachableGoalError
from shapephase.optimal_control import Goal, Limits, Search, plan_reorientation
from support.ball_bodies import TWO_AND_A_BALL
from support.bodies import joint, link, random_loop, urdf
from support.independent import pinocchio_motion, turn

X, Y, Z = np.eye(3)
DIAGONAL = np.ones(3) / np.sqrt(3.0)
BAR = (0.002, 0.021, 0.02)


def chain(count, *, rpy=(0.0, 0.0, 0.0), tilt=(0.0, 0.0, 0.0), finger=0.0):
    """Bars joined by hinges about z; the hinges about other axes where the first is tilted, or a finger stands out."""
    base = Rotation.from_euler("xyz", rpy)
    inertia = base.as_matrix() @ np.diag(BAR) @ base.as_matrix().T
    elements = [link("bar_0", 1.0, inertia), *(link(f"bar_{k}", 1.0, BAR, (0.25, 0.0, 0.0)) for k in range(1, count))]
    for k in range(1, count):
        turned = Rotation.from_euler("xyz", rpy if k == 1 else (0.0, 0.0, 0.0))
        place = base.apply([0.25, 0.0, 0.0]) if k == 1 else (0.5, 0.0, 0.0)
        bent = turned * Rotation.from_euler("xyz", tilt if k == 2 else (0.0, 0.0, 0.0))
        elements.append(
            joint(f"hinge_{k}", "revolute", f"bar_{k - 1}", f"bar_{k}", Z, tuple(place), bent.as_euler("xyz"))
        )
    if finger:
        elements.append(link("finger", finger, (1e-3 * finger,) * 3, (0.0, 0.1, 0.1)))
        elements.append(joint("finger", "revolute", f"bar_{count - 1}", "finger", X, (0.2, 0.0, 0.0)))
    return urdf(*elements)


def wheels(*axes):
    """Wheels on a hub, each about its axis."""
    parts = [link("hub", 1.0, (3.0, 3.5, 4.0))]
    for k, axis in enumerate(axes):
        parts.append(link(f"wheel_{k}", 0.5, 0.3 * np.eye(3) + 0.2 * np.outer(axis, axis)))
        parts.append(joint(f"spin_{k}", "continuous", "hub", f"wheel_{k}", axis))
    return urdf(*parts)


def sliders(*axes):
    """Masses that slide on a hub."""
    parts = [link("hub", 2.0, (0.3, 0.4, 0.5))]
    for k, (axis, place) in enumerate(axes):
        parts.append(link(f"mass_{k}", 1.0, (0.01, 0.01, 0.01)))
        parts.append(joint(f"slide_{k}", "prismatic", "hub", f"mass_{k}", axis, place))
    return urdf(*parts)


def gymnast():
    """Two arms, mirror images in the plane y = 0, of two hinges each."""
    parts = [link("trunk", 10.0, (0.6, 0.5, 0.2))]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        parts.append(link(f"{side}_upper", 1.0, (0.02, 0.02, 0.003), (0.0, 0.1 * sign, -0.2)))
        parts.append(link(f"{side}_lower", 0.8, (0.02, 0.02, 0.003), (0.0, 0.02 * sign, -0.2)))
        parts.append(joint(f"{side}_shoulder", "revolute", "trunk", f"{side}_upper", Y, (0.0, 0.2 * sign, 0.3)))
        place = (0.0, 0.1 * sign, -0.4)
        parts.append(joint(f"{side}_elbow", "revolute", f"{side}_upper", f"{side}_lower", Y, place))
    return urdf(*parts)


def stiff():
    """A hinge whose limits are the same."""
    hinge = joint("hinge", "revolute", "front", "rear", X).replace('lower="-10" upper="10"', 'lower="0.3" upper="0.3"')
    return urdf(link("front", 1.0, (1.0, 2.0, 2.5)), link("rear", 1.0, (1.0, 2.0, 2.5)), hinge)


WRITTEN = {
    "rotor": wheels(Z),
    "two wheels": wheels(Z, Z),
    "crossed wheels": wheels(X, Y),
    "planar 3": chain(3),
    "planar 5": chain(5),
    "tilted plane": chain(3, rpy=(0.4, -0.7, 0.2)),
    "slider": sliders((X, (0.0, 0.4, 0.0))),
    "two sliders": sliders((X, (0.0, 0.4, 0.0)), (Y, (0.3, 0.0, 0.0))),
    "lifted slider": sliders((X, (0.0, 0.4, 0.0)), (Y, (0.3, 0.0, 0.2))),
    "gymnast": gymnast(),
    "stiff": stiff(),
    "nearly planar": chain(3, tilt=(1e-4, 0.0, 0.0)),
    "with a finger": chain(2, finger=1e-4),
    "ball": TWO_AND_A_BALL,
}


@pytest.fixture
def body_of(load_urdf):
    return lambda name: load_urdf(WRITTEN[name]) if name in WRITTEN else sp.load_body(name)


@pytest.fixture
def no_search(monkeypatch):
    """A search is a failure of its own kind."""

    def searched(*_):
        raise PlanNotFound("searched")

    monkeypatch.setattr("shapephase.optimal_control.planning._searches", searched)


@dataclass(frozen=True)
class Case:
    """A goal, what is to be said, and by how much it is missed [rad]."""

    body: str
    goal: Any
    reason: str
    miss: float
    options: dict[str, Any] = field(default_factory=dict)


def beyond(rotation, axis, first=None):
    """Distance of a rotation from the turns about an axis after a first one, by SciPy [rad]."""
    rest = Rotation.from_matrix(rotation @ (np.eye(3) if first is None else first).T)
    axis = np.asarray(axis) / np.linalg.norm(axis)

    def apart(angle):
        return (Rotation.from_rotvec(-angle * axis) * rest).magnitude()

    starts = np.linspace(-np.pi, np.pi, 13)
    return min(minimize_scalar(apart, bounds=(a, a + 1.0), method="bounded").fun for a in starts)


SKEW = turn([0.4, -0.3, 0.8], 1.7)
NORMAL = Rotation.from_euler("xyz", (0.4, -0.7, 0.2)).as_matrix()[:, 2]
HALF_SPIN = {"momentum": [0.0, 0.0, 2.0]}
SHOULDERS = {"right_shoulder": ("left_shoulder", 1.0), "right_elbow": ("left_elbow", 1.0)}
ARMS = {"right_shoulder_abduction": ("left_shoulder_abduction", 1.0)}
# The wheel's share of the inertia about its axis.
WHEEL = 0.5 / 4.5

IMPOSSIBLE = [
    Case("rotor", turn(Z, 0.4), "rank 0", 0.4),
    Case("rotor", turn(X, 0.4), "rank 0", 0.4),
    Case("rotor", turn(X, 0.3), r"one axis alone, \[0, 0, 1\]", 0.3, {"end": "free"}),
    Case("rotor", turn(Z, 0.4), "way to the end", 0.4 + 1.8 * WHEEL, {"end": [1.8]}),
    Case("rotor", Goal(pointing=(X, Z)), "one axis alone", np.pi / 2, {"end": "free"}),
    Case("two wheels", turn(Z, 0.7), "rank 0", 0.7),
    Case("two wheels", turn(Y, 0.7), r"one axis alone, \[0, 0, 1\]", 0.7, {"end": "free"}),
    Case("two wheels", turn(Y, 0.7), "that of the momentum", 0.7, HALF_SPIN),
    Case("crossed wheels", turn(Z, 0.5), "spin_0", 0.5, {"joints": ["spin_0"]}),
    Case("planar 3", turn(X, 1.0), r"one axis alone, \[0, 0, 1\] \(holonomy algebra of rank 1\)", 1.0),
    Case("planar 3", SKEW, "one axis alone", beyond(SKEW, Z)),
    Case("planar 3", turn(Z, 1.0), "hinge_1", 1.0, {"joints": ["hinge_1"]}),
    Case("planar 3", Goal(pointing=(Z, [0.0, 1.0, 1.0])), "one axis alone", np.pi / 4),
    Case("planar 3", Goal(pointing=(X, [0.0, 1.0, 0.2]), link="bar_2"), "one axis", np.arctan(0.2), {"end": "free"}),
    Case("planar 3", Goal(somersaults=1, half_twists=1, twist_axis=X), "momentum", np.pi, HALF_SPIN),
    Case("planar 5", SKEW, "hinge_1, hinge_2, hinge_3, hinge_4", beyond(SKEW, Z)),
    Case("planar 5", turn(Y, 0.2), "that of the momentum", 0.2, HALF_SPIN),
    Case("planar 5", np.stack([turn(X, 1.0), turn(Y, 0.6)]), "one axis alone", 0.6),
    Case("tilted plane", turn(Z, 1.0), "one axis alone", beyond(turn(Z, 1.0), NORMAL)),
    Case("tilted plane", Goal(pointing=(NORMAL, X)), "one axis alone", np.arccos(NORMAL @ X)),
    Case("slider", turn(Z, 0.5), "rank 0", 0.5),
    Case("two sliders", turn(X, 0.5), r"one axis alone, \[0, 0, 1\]", 0.5),
    Case("gymnast", turn(X, 0.5), r"one axis alone, \[0, 1, 0\]", 0.5, {"symmetric": SHOULDERS}),
    Case("gymnast", SKEW, "one axis alone", beyond(SKEW, Y), {"symmetric": SHOULDERS, "end": "free"}),
    Case("gymnast", turn(Y, 0.5), "left_elbow", 0.5, {"joints": ["left_elbow"]}),
    Case("stiff", turn(X, 0.5), "both of their limits are the same", 0.5),
    Case("cat_untwisted", turn(Y, 1.0), r"one axis alone, \[1, 0, 0\]", 1.0),
    Case("cat_untwisted", SKEW, "one axis alone", beyond(SKEW, X)),
    Case("diver", turn(Y, 0.3), "with one freedom", 0.3, {"symmetric": ARMS}),
    Case("satellite", turn(X, 0.3), "wheel_spin", 0.3, {"joints": ["wheel_spin"]}),
    Case("cat", turn(X, 3.0), "tail_3_yaw", 3.0, {"joints": ["tail_3_yaw"]}),
    Case("astronaut", turn(X, 1.0), "right_ankle", 1.0, {"joints": ["right_ankle"]}),
]


@pytest.mark.parametrize("case", IMPOSSIBLE, ids=lambda case: f"{case.body}: {case.reason[:20]}")
@pytest.mark.usefixtures("no_search")
def test_what_no_motion_reaches_is_refused_with_its_reason(case, body_of):
    with pytest.raises(UnreachableGoalError, match=case.reason) as refused:
        plan_reorientation(body_of(case.body), case.goal, **case.options)
    missed = re.search(r"missed by ([\d.e-]+) degrees", str(refused.value))
    assert missed is not None
    assert np.radians(float(missed[1])) == pytest.approx(case.miss, rel=6e-3)
    assert re.search("--joints|choose another goal|--to free", str(refused.value))


@pytest.mark.usefixtures("no_search")
def test_a_body_whose_joints_are_locked_spins_as_its_momentum_has_it(load_urdf):
    """By 1 rad in 1 s: 4.5 kg m^2 and as many kg m^2/s about z."""
    body = load_urdf(wheels(Z).replace('type="continuous"', 'type="revolute"').replace(
        "</joint>", '<limit lower="0" upper="0" effort="1" velocity="1"/></joint>'))  # fmt: skip
    with pytest.raises(UnreachableGoalError, match="body") as refused:
        plan_reorientation(body, turn(Z, 1.5), momentum=[0.0, 0.0, 4.5], duration=1.0)
    missed = re.search(r"missed by ([\d.e-]+) degrees", str(refused.value))
    assert missed is not None
    assert np.radians(float(missed[1])) == pytest.approx(0.5, rel=1e-3)


REACHABLE = {
    "in the plane": ("planar 3", turn(Z, 2.0), {}),
    "out of a plane that is tilted by 1e-4": ("nearly planar", turn(X, 0.5), {}),
    "by a finger of a tenth of a gram": ("with a finger", turn(Y, 0.5), {}),
    "out of the plane by a momentum": ("planar 3", turn(X, 0.5), {"momentum": [0.0, 0.1, 1.0]}),
    "rank 1 at the start, 3 around it": ("diver", turn(Y, 0.5), {}),
    "two reaction wheels that bracket": ("crossed wheels", turn(Z, 0.5), {}),
    "a slider out of the plane": ("lifted slider", turn(X, 0.5), {}),
    "the axis of rank 1": ("cat_untwisted", turn(X, 3.0), {}),
    "an axis up to its symmetry": ("planar 3", Goal(rotation=turn(X, 1.0), symmetry=X), {}),
    "an axis in the plane": ("planar 3", Goal(pointing=(X, Y)), {}),
    "one of two goals": ("planar 3", np.stack([turn(X, 1.0), turn(Z, 1.0)]), {}),
    "one joint's own end": ("rotor", turn(Z, -1.8 * WHEEL), {"end": [1.8]}),
    "one joint between its limits": ("cat_two_halves", turn(X, 1.5), {"joints": ["waist_roll"], "end": "free"}),
    "rounding of a goal": ("planar 3", turn([1e-8, 0.0, 1.0], 1.0), {}),
    "no turn": ("stiff", np.eye(3), {}),
    "three turns by two hinges": ("planar 3", Goal(somersaults=3, twist_axis=X), HALF_SPIN),
    "a ball joint": ("ball", SKEW, {}),
    "elsewhere at the end": ("cat_untwisted", turn(Y, 0.3), {"end": "free"}),
}


@pytest.mark.parametrize(("name", "goal", "options"), REACHABLE.values(), ids=list(REACHABLE))
@pytest.mark.usefixtures("no_search")
def test_what_can_be_reached_is_searched_for(name, goal, options, body_of):
    with pytest.raises(PlanNotFound, match=r"^searched$"):
        plan_reorientation(body_of(name), goal, limits=Limits(rate_limits=None), **options)


@pytest.mark.parametrize("tilt", [1e-2, 1e-3, 1e-5, 1e-7])
@pytest.mark.usefixtures("no_search")
def test_a_hinge_tilted_by_ever_less_is_still_searched_for(tilt, load_urdf):
    with pytest.raises(PlanNotFound, match=r"^searched$"):
        plan_reorientation(load_urdf(chain(3, tilt=(tilt, 0.0, 0.0))), turn(X, 0.5))


@pytest.mark.usefixtures("few_guesses")
def test_particles_of_a_plane_that_lie_on_a_line_at_some_shapes_do_not_leave_it():
    """From 1 rad a triangle is a line at 0 and pi: there the way to most shapes has no attitude to carry axes along."""

    def places(shapes):
        angle, side = shapes.T
        zero, one = np.zeros((2, len(shapes)))
        one = one + 1.0
        tip = np.stack([np.cos(angle), np.sin(angle), zero], axis=-1)
        corners = np.stack([np.zeros_like(tip), np.stack([one, zero, zero], axis=-1), side[:, None] * tip], axis=1)
        slopes = np.zeros((len(shapes), 2, 3, 3))
        slopes[:, 0, 2], slopes[:, 1, 2] = side[:, None] * np.cross(Z, tip), tip
        return corners, slopes

    body = sp.particle_body([1.0, 1.0, 1.0], places, ["angle", "side"], limits={"side": (0.3, 2.0)})
    with pytest.raises(UnreachableGoalError, match="one axis alone"):
        plan_reorientation(body, turn(X, 0.2), start=[1.0, 1.0], search=Search(time_limit=0.1))


def test_a_turn_in_the_plane_is_planned(load_urdf):
    goal = turn(Z, 0.2)
    plan = plan_reorientation(load_urdf(chain(3)), goal, limits=Limits(rate_limits=None), search=Search(pieces=8))
    assert plan.goal_error < 1e-8


@pytest.mark.usefixtures("no_search")
def test_loops_of_the_untwisted_cat_turn_it_about_the_axis_that_is_named_by_pinocchio():
    body = sp.load_body("cat_untwisted")
    loop = random_loop(body, np.random.default_rng(3))
    # The third joint of the file follows the first.
    whole = SimpleNamespace(
        duration=loop.duration, shape=lambda t: loop.shape(t)[[0, 1, 0]], rate=lambda t: loop.rate(t)[[0, 1, 0]]
    )
    motion = pinocchio_motion(body.name, (*body.joint_names, "waist_pitch_again"), whole, np.zeros(3))
    turned = Rotation.from_matrix(motion.attitude[-1]).as_rotvec()
    across = turn(np.cross(turned, X) / np.linalg.norm(np.cross(turned, X)), 1.0)
    with pytest.raises(UnreachableGoalError) as refused:
        plan_reorientation(body, across, start=loop.shape(0.0))
    named = re.search(r"one axis alone, \[([^]]*)\]", str(refused.value))
    assert named is not None
    axis = np.array([float(value) for value in named[1].split(",")])
    assert np.linalg.norm(turned) > 1e-2
    assert np.linalg.norm(np.cross(turned, axis)) < 1e-6
