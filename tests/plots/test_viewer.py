"""What the 3-D views show against the laws of the motion, the page as a browser without a network sees it."""

from __future__ import annotations

import html
import re
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.deformation.assemblies import assembly, moving_mass, rigid_part
from shapephase.errors import RunStopped, ShapeError, UnknownNameError, VisualWarning
from shapephase.examples import cat_righting
from shapephase.plots import moving_scene, report, view
from shapephase.plots.pages import viewer
from shapephase.plots.pages.motion_data import up_axis
from support.bodies import link, random_loop, urdf
from support.browser import furred, opened, seen, wait_for
from support.coupled_bodies import KNOTS, LEG, TURN, couplings
from support.pages import page_data

UPSIDE_DOWN = np.diag([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def righting():
    """The cat falls upside down without momentum."""
    return sp.reconstruct(
        sp.articulated(sp.load_body("cat"), cat_righting(0.5)), np.zeros(3), UPSIDE_DOWN, tolerance=1e-10
    )


@pytest.fixture(scope="module")
def tumbling():
    """The astronaut with momentum, joints on a random loop."""
    body = sp.load_body("astronaut")
    path = random_loop(body, np.random.default_rng(8), harmonics=1)
    return sp.reconstruct(
        sp.articulated(body, path), [3.0, -2.0, 4.0], Rotation.from_rotvec([0.3, 1.0, -0.7]).as_matrix()
    )


def slope(values, step):
    """Derivative inside, by differences of order eight."""
    total = np.zeros_like(values[4:-4])
    for k, weight in enumerate((4 / 5, -1 / 5, 4 / 105, -1 / 280), start=1):
        total += weight * (values[4 + k : len(values) - 4 + k] - values[4 - k : len(values) - 4 - k])
    return total / step


def drawn_momentum(scene, body):
    """Mass centres (F, 3) and angular momentum about them (F', 3) of the links, by differences of what is drawn."""
    step = scene.times[1] - scene.times[0]
    nodes = {node.name: scene.world_pose(node) for node in scene.nodes}
    parts = [part for part in body.moving_parts if part.mass > 0.0]
    poses = [next(nodes[link] for link in part.links if link in nodes) for part in parts]
    centres = [pose[:, :3, :3] @ part.centre + pose[:, :3, 3] for pose, part in zip(poses, parts, strict=True)]
    middle = sum(part.mass * centre for part, centre in zip(parts, centres, strict=True)) / body.mass
    total = np.zeros((len(scene.times) - 8, 3))
    for part, pose, centre in zip(parts, poses, centres, strict=True):
        turn = pose[4:-4, :3, :3]
        spin = so3.vee(slope(pose[:, :3, :3], step) @ so3.transpose(turn))
        arm, speed = centre - middle, slope(centre - middle, step)
        total += part.mass * np.cross(arm[4:-4], speed)
        total += np.einsum("nij,jk,nlk,nl->ni", turn, part.inertia, turn, spin)
    return middle, total


# ---- What moves, and how --------------------------------------------------------------------------------------------


def test_the_drawn_links_have_the_momentum_of_the_motion(tumbling):
    """Differences of the drawn poses alone: the centre of mass rests, the angular momentum is the one shown."""
    scene = moving_scene(tumbling, 801)
    middle, momentum = drawn_momentum(scene, tumbling.deformation.description.body)
    np.testing.assert_allclose(middle, np.zeros((801, 3)), atol=1e-12)
    np.testing.assert_allclose(momentum, np.broadcast_to([3.0, -2.0, 4.0], momentum.shape), atol=1e-8)
    np.testing.assert_array_equal(scene.momentum, [3.0, -2.0, 4.0])
    np.testing.assert_allclose(scene.base[0, :3, :3], tumbling.initial_attitude, atol=1e-15)


def test_the_drawn_cat_turns_without_momentum(righting):
    scene = moving_scene(righting, 2001)
    middle, momentum = drawn_momentum(scene, righting.deformation.description.body)
    np.testing.assert_allclose(middle, np.zeros((2001, 3)), atol=1e-12)
    np.testing.assert_allclose(momentum, np.zeros(momentum.shape), atol=1e-9)


def test_the_cat_starts_on_its_back_and_ends_on_its_feet(righting):
    """Paws above the trunk at the start, below at the end; the head to the same side; shape closed."""
    scene = moving_scene(righting, 3)
    nodes = {node.name: scene.world_pose(node) for node in scene.nodes}
    for leg in ("front_left_lower_leg", "rear_right_lower_leg"):
        height = nodes[leg][:, 2, 3] - nodes["trunk_front"][:, 2, 3]
        assert height[0] > 0.05
        assert height[-1] < -0.05
    turn = nodes["trunk_front"][-1, :3, :3] @ nodes["trunk_front"][0, :3, :3].T
    assert so3.angle(turn) == pytest.approx(np.pi, abs=1e-6)


def test_free_fall_is_a_parabola(tumbling):
    fall = {"start": [1.0, 2.0, 3.0], "velocity": [0.5, 0.0, 2.0], "gravity": [0.0, 0.0, -9.81]}
    scene = moving_scene(tumbling, 21, **fall)
    middle, _ = drawn_momentum(scene, tumbling.deformation.description.body)
    t = scene.times[:, None]
    expected = np.array(fall["start"]) + t * fall["velocity"] + 0.5 * t**2 * np.array(fall["gravity"])
    np.testing.assert_allclose(middle, expected, atol=1e-12)
    np.testing.assert_allclose(scene.centre, expected, atol=1e-12)


@pytest.mark.parametrize("gauge", [sp.horizontal_gauge, lambda d: sp.link_gauge(sp.principal_gauge(d), "head")])
def test_a_gauge_changes_nothing_of_what_is_seen(tumbling, gauge):
    """Momentum and attitude are those of the base; the gauged motion starts from U(0)."""
    seen = gauge(tumbling.deformation)
    start = tumbling.initial_attitude @ seen.frame(0.0).T
    there = moving_scene(sp.reconstruct(seen, tumbling.momentum, start), 9, trail="head")
    here = moving_scene(tumbling, 9, trail="head")
    np.testing.assert_allclose(there.base, here.base, atol=3e-9)
    np.testing.assert_allclose(there.centre, here.centre, atol=3e-9)
    np.testing.assert_allclose(there.trail, here.trail, atol=3e-9)
    assert [node.name for node in there.nodes] == [node.name for node in here.nodes]


def test_the_trail_is_the_way_of_a_link(tumbling):
    body, path = tumbling.deformation.description.body, tumbling.deformation.description.path
    scene = moving_scene(tumbling, 5, trail="head")
    for t, base, place in zip(scene.times, scene.base, scene.trail, strict=True):
        np.testing.assert_allclose((base @ body.link_pose(path.shape(t), "head"))[:3, 3], place, atol=1e-13)
    with pytest.raises(UnknownNameError, match="haed"):
        moving_scene(tumbling, 5, trail="haed")


def test_everything_drawn_is_inside_the_bounds(righting):
    scene = moving_scene(righting, 31)
    low, high = scene.bounds
    for node in scene.nodes:
        assert np.all(scene.world_pose(node)[:, :3, 3] >= low - 1e-12)
        assert np.all(scene.world_pose(node)[:, :3, 3] <= high + 1e-12)
    # From the tip of the tail to the nose, and not much more.
    assert 0.3 < scene.reach < 0.6


@pytest.mark.parametrize(
    ("shape", "half"),
    [
        ('box size="0.2 0.4 0.6"', [0.1, 0.2, 0.3]),
        ('cylinder radius="0.1" length="0.6"', [0.1, 0.1, 0.3]),
        ('capsule radius="0.1" length="0.6"', [0.1, 0.1, 0.4]),
        ('sphere radius="0.5"', [0.5, 0.5, 0.5]),
        ('mesh filename="box.stl" scale="2 1 -1"', [0.2, 0.2, 0.3]),
    ],
)
def test_the_reach_is_that_of_the_corners_of_what_is_drawn(shape, half, tmp_path, load_urdf):
    import trimesh

    trimesh.creation.box((0.2, 0.4, 0.6)).export(tmp_path / "box.stl")
    drawn = f'<visual><origin xyz="0 0 1"/><geometry><{shape}/></geometry></visual></link>'
    body = load_urdf(urdf(link("base", 1.0, [0.1, 0.2, 0.25], (0.0, 0.0, 1.0)).replace("</link>", drawn)))
    path = sp.ShapePath.function(lambda t: (np.zeros((len(t), 0)), np.zeros((len(t), 0))), 1.0)
    scene = moving_scene(sp.reconstruct(sp.articulated(body, path), [0.0, 0.0, 0.0]), 2)
    assert scene.reach == pytest.approx(np.linalg.norm(half), rel=1e-6)
    np.testing.assert_allclose(scene.bounds, [-np.array(half), half], rtol=1e-6)


# ---- Bodies without links -------------------------------------------------------------------------------------------


def box_tensors(scene, mass):
    """Inertia of the drawn box in inertial axes: (F, 3, 3)."""
    (node,) = scene.nodes
    (cube,) = node.shapes
    assert (cube.kind, cube.dimensions) == ("box", (1.0, 1.0, 1.0))
    x, y, z = np.moveaxis(node.scales**2, -1, 0)
    moments = mass / 12.0 * np.stack([y + z, x + z, x + y], axis=-1)
    turn = scene.world_pose(node)[:, :3, :3]
    return np.einsum("nij,nj,nkj->nik", turn, moments, turn)


def stretching(times):
    angle = np.sin(2.0 * times)
    turn = so3.exp(angle[:, None] * np.array([0.2, 0.3, 0.1]))
    moments = np.stack([2.0 + 0.5 * np.sin(times), 2.2 - 0.5 * np.sin(times), 3.0 + 0.0 * times], axis=-1)
    return np.einsum("nij,nj,nkj->nik", turn, moments, turn)


@pytest.mark.parametrize("kind", ["rigid", "prescribed", "gauged", "file"])
def test_the_box_of_the_locked_inertia(kind, tmp_path):
    """Its inertia is R I R^T up to the unknown mass, and so is it through a crossing of moments and in any gauge."""
    tensor = np.array([[2.0, 0.1, -0.2], [0.1, 2.5, 0.3], [-0.2, 0.3, 3.0]])
    fixed = kind == "rigid"
    deformation = sp.rigid(tensor, 3.0) if fixed else sp.prescribed(stretching, None, 3.0)
    motion = sp.reconstruct(deformation, [1.0, 2.0, 3.0], tolerance=1e-10)
    expected = motion.attitude(np.linspace(0.0, 3.0, 41))
    expected = expected @ deformation.inertia(np.linspace(0.0, 3.0, 41)) @ so3.transpose(expected)
    if kind == "gauged":
        seen = sp.principal_gauge(deformation)
        motion = sp.reconstruct(seen, [1.0, 2.0, 3.0], seen.frame(0.0).T, tolerance=1e-10)
    if kind == "file":
        motion.save(tmp_path / "m.npz")
        motion = sp.load_motion(tmp_path / "m.npz")
    scene = moving_scene(motion, 41)
    assert scene.body is None
    (node,) = scene.nodes
    assert np.linalg.norm(node.scales[0]) == pytest.approx(1.0, rel=1e-12)
    assert scene.reach >= 0.5 * (1.0 - 1e-12)
    if fixed:
        assert scene.reach == pytest.approx(0.5, rel=1e-9)
    drawn = box_tensors(scene, 1.0)
    ratio = np.trace(expected[0]) / np.trace(drawn[0])
    np.testing.assert_allclose(ratio * drawn, expected, atol=1e-7)
    # The box turns on, it never jumps to another of its 24 positions.
    turns = so3.transpose(node.poses[:-1, :3, :3]) @ node.poses[1:, :3, :3]
    assert so3.angle(turns).max() < 0.2


def test_an_assembly_is_drawn_with_its_mass_and_centre():
    base = rigid_part(10.0, np.diag([1.0, 1.5, 2.0]), [0.1, 0.0, 0.0])
    way = sp.ShapePath.fourier([0.5, 0.0, 0.2], [[0.3], [0.0], [0.0]], [[0.0], [0.2], [0.0]], 2.0)
    deformation = assembly(base, [moving_mass(1.0, way)])
    motion = sp.reconstruct(deformation, [0.5, 0.2, 1.0])
    scene = moving_scene(motion, 21)
    attitude = motion.attitude(scene.times)
    expected = attitude @ deformation.inertia(scene.times) @ so3.transpose(attitude)
    np.testing.assert_allclose(box_tensors(scene, 11.0), expected, atol=1e-9)
    np.testing.assert_allclose(scene.world_pose(scene.nodes[0])[:, :3, 3], np.zeros((21, 3)), atol=1e-12)


def test_particles_are_balls_whose_volumes_are_as_their_masses():
    masses = np.array([1.0, 2.0, 0.5])
    points = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, -1.0, 0.5]])

    def positions(times):
        stretch = 1.0 + 0.2 * np.sin(times)[:, None, None]
        return stretch * points, 0.2 * np.cos(times)[:, None, None] * points

    motion = sp.reconstruct(sp.particles(masses, positions, 2.0), [0.1, 0.2, 0.3])
    scene = moving_scene(motion, 11)
    places = np.stack([scene.world_pose(node)[:, :3, 3] for node in scene.nodes], axis=1)
    np.testing.assert_allclose(np.einsum("m,nmi->ni", masses, places), 0.0, atol=1e-12)
    gaps = np.linalg.norm(places[:, 0] - places[:, 1], axis=-1)
    np.testing.assert_allclose(gaps, np.sqrt(2.0) * (1.0 + 0.2 * np.sin(scene.times)), rtol=1e-12)
    attitude = motion.attitude(scene.times)
    moment = np.einsum("m,nmi,nmj->nij", masses, places, places)
    inertia = np.trace(moment, axis1=1, axis2=2)[:, None, None] * np.eye(3) - moment
    expected = attitude @ motion.deformation.inertia(scene.times) @ so3.transpose(attitude)
    np.testing.assert_allclose(inertia, expected, atol=1e-12)
    radii = np.array([node.shapes[0].dimensions[0] for node in scene.nodes])
    np.testing.assert_allclose(radii**3 / radii[0] ** 3, masses, rtol=1e-12)


# ---- Arguments ------------------------------------------------------------------------------------------------------


def test_what_cannot_be_shown_is_refused(righting, tmp_path):
    several = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0), np.eye(3))
    one = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0), [0.0, 0.0, 1.0])
    page = tmp_path / "page.html"
    with pytest.raises(ShapeError, match="batch"):
        view(several).write(page)
    with pytest.raises(UnknownNameError, match="tail"):
        view(one, trail="tail").write(page)
    for speed in (0.0, -1.0, np.nan, np.inf, "fast"):
        with pytest.raises(ShapeError, match="speed"):
            view(righting, speed=speed).write(page)
    for frames in (1, 0, -3, 2.5, True, 10**6):
        with pytest.raises(ShapeError, match="frames"):
            view(righting, frames=frames).write(page)
    with pytest.raises(ShapeError, match="gravity"):
        view(one, gravity=9.81).write(page)
    assert not list(tmp_path.iterdir())


def test_what_draws_is_imported_only_when_something_is_shown():
    code = (
        "import sys, shapephase.plots; "
        "print([m for m in ('jinja2', 'trimesh', 'IPython', 'http.server') if m in sys.modules])"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    assert told.stdout.strip() == "[]"


# ---- The page -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cat_page(righting, tmp_path_factory):
    page = tmp_path_factory.mktemp("page") / "cat.html"
    view(righting, trail="head").write(page)
    return page


def moved(data, frame):
    """Attitude and place of the base in a frame of a page."""
    turns, places = (data["motion"][name].reshape(-1, width) for name, width in (("turns", 4), ("places", 3)))
    return Rotation.from_quat(turns[frame]).as_matrix(), places[frame]


def test_the_page_moves_as_reconstructed(righting, cat_page):
    """What the page carries, at the start and at the end, by SciPy's quaternions."""
    data = page_data(cat_page)
    motion = data["motion"]
    for frame, t in ((0, 0.0), (-1, righting.duration)):
        turn, place = moved(data, frame)
        np.testing.assert_allclose(turn, righting.attitude(t), atol=1e-6)
        np.testing.assert_allclose(place, righting.base_position(t), atol=1e-6)
    body, path = righting.deformation.description.body, righting.deformation.description.path
    head = righting.final_attitude @ body.link_pose(path.shape(0.5), "head")[:3, 3] + righting.base_position(0.5)
    np.testing.assert_allclose(motion["trail"].reshape(-1, 3)[-1], head, atol=1e-6)
    np.testing.assert_allclose(motion["shapes"].reshape(-1, 23)[-1], path.shape(0.5), atol=1e-6)
    assert [motion[name] for name in ("duration", "frames", "momentum", "ghost")] == [0.5, 121, [0.0, 0.0, 0.0], True]
    # Nobody stands on a ground in free flight.
    assert motion["floor"] is None
    assert motion["up"] == [0.0, 0.0, 1.0]


def test_every_shape_of_the_body_is_in_the_page_as_it_is(righting, cat_page):
    """Sizes, colours and places in the page are those of the URDF, in its order."""
    drawn = page_data(cat_page)["motion"]["nodes"]
    scene = moving_scene(righting, 2)
    body = righting.deformation.description.body
    assert [node["name"] for node in drawn] == [node.name for node in scene.nodes]
    for there, node in zip(drawn, scene.nodes, strict=True):
        frame, pose = body.chain.link_frames[node.name]
        assert there["frame"] == frame
        for described, shape in zip(there["shapes"], node.shapes, strict=True):
            assert (described["kind"], described["dimensions"]) == (shape.kind, [*shape.dimensions])
            np.testing.assert_allclose(described["colour"], shape.colour, atol=1e-15)
            np.testing.assert_allclose(np.reshape(described["pose"], (4, 4)).T, pose @ shape.pose, atol=1e-15)
    assert sum(len(node["shapes"]) for node in drawn) == 16


def test_the_page_has_the_momentum_and_at_every_frame_the_attitude_of_its_motion(tumbling, tmp_path):
    """Every frame against the motion at that time; SciPy reads the quaternions."""
    view(tumbling, frames=41).write(tmp_path / "a.html")
    motion = page_data(tmp_path / "a.html")["motion"]
    assert motion["momentum"] == [3.0, -2.0, 4.0]
    expected = tumbling.attitude(np.linspace(0.0, tumbling.duration, 41))
    np.testing.assert_allclose(Rotation.from_quat(motion["turns"].reshape(-1, 4)).as_matrix(), expected, atol=1e-6)


@pytest.fixture(scope="module")
def pushed():
    """A body whose momentum doubles and turns."""
    push = sp.ExternalTorque(lambda _: [0.5, 0.0, 1.0], axes="space")
    return sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 2.0), [0.0, 0.0, 1.0], torque=push)


def test_under_a_torque_the_page_has_the_momentum_of_every_frame(pushed, tmp_path):
    pushed.view(frames=5).write(tmp_path / "a.html")
    motion = page_data(tmp_path / "a.html")["motion"]
    momenta = [[0.5 * t, 0.0, 1.0 + t] for t in (0.0, 0.5, 1.0, 1.5, 2.0)]
    np.testing.assert_allclose(motion["momenta"].reshape(-1, 3), momenta, atol=1e-6)
    expected = pushed.attitude(np.linspace(0.0, 2.0, 5))
    np.testing.assert_allclose(Rotation.from_quat(motion["turns"].reshape(-1, 4)).as_matrix(), expected, atol=1e-6)
    np.testing.assert_allclose(pushed.base_position(2.0, velocity=[1.0, 2.0, 3.0]), [2.0, 4.0, 6.0], atol=1e-12)


@pytest.mark.full
def test_under_a_torque_the_arrow_turns_and_grows(pushed, tmp_path, chromium):
    pushed.view(frames=5).write(tmp_path / "a.html")
    page, said, _ = opened(chromium, tmp_path / "a.html")
    lengths = []
    for t in (0.0, 0.7, 2.0):
        page.evaluate("t => page.clock.show(t)", t)
        arrow = pose(page, "page.figure.momentum.pose")
        np.testing.assert_allclose(so3.normalised(arrow[:3, 2]), so3.normalised(pushed.momentum(t)), atol=1e-6)
        lengths.append(float(np.linalg.norm(arrow[:3, 2]) / np.linalg.norm(pushed.momentum(t))))
    np.testing.assert_allclose(lengths, lengths[0], rtol=1e-6)
    assert [message for message in said if message[0] in ("error", "warning")] == []


def test_speed_and_frames(righting, tmp_path):
    view(righting, speed=0.1, frames=11).write(tmp_path / "a.html")
    motion = page_data(tmp_path / "a.html")["motion"]
    assert (motion["speed"], motion["frames"], len(motion["turns"])) == (0.1, 11, 44)
    view(righting, speed=0.1).write(tmp_path / "a.html")
    assert page_data(tmp_path / "a.html")["motion"]["frames"] == 151


@pytest.mark.parametrize(("named", "axis"), [("x", [1, 0, 0]), ("-y", [0, -1, 0]), ("z", [0, 0, 1]), (None, [0, 0, 1])])
def test_the_axis_that_is_up(righting, tmp_path, named, axis):
    view(righting, frames=2, up=named).write(tmp_path / "a.html")
    assert page_data(tmp_path / "a.html")["motion"]["up"] == axis
    with pytest.raises(UnknownNameError, match="axis"):
        view(righting, frames=2, up="upwards").write(tmp_path / "a.html")


def test_with_gravity_there_is_a_floor_below_and_up_is_against_it(righting, tmp_path):
    view(righting, frames=5, gravity=[0.0, 9.81, 0.0]).write(tmp_path / "a.html")
    motion = page_data(tmp_path / "a.html")["motion"]
    assert motion["up"] == [0.0, -1.0, 0.0]
    heights = motion["floor"].reshape(-1, 3)[:, 1]
    assert np.ptp(heights) == 0.0
    assert heights[0] > moving_scene(righting, 5, gravity=[0.0, 9.81, 0.0]).corners[..., 1].max()


@pytest.mark.parametrize(("name", "axis"), [("cat", 2), ("astronaut", 2), ("diver", 2), ("example:human", 1)])
def test_models_of_people_from_biomechanics_have_y_up(name, axis):
    np.testing.assert_array_equal(up_axis(None, sp.load_body(name)), np.eye(3)[axis])


def test_turns_too_fast_for_the_frames_are_said(tmp_path):
    """A sphere of inertia 1 turns at exactly |mu| rad/s: 20 s in 600 steps, 60 rad/s are two radians each."""
    fast = sp.reconstruct(sp.rigid(np.eye(3), 20.0), [0.0, 0.0, 60.0])
    assert moving_scene(fast, 601).largest_turn == pytest.approx(2.0, abs=1e-6)
    with pytest.warns(VisualWarning, match="115"):
        view(fast).write(tmp_path / "a.html")
    view(fast, frames=601).write(tmp_path / "a.html")


def test_the_page_is_small_named_and_asks_for_nothing(cat_page):
    assert cat_page.stat().st_size < 0.1e6
    text = cat_page.read_text(encoding="utf-8")
    assert "<title>cat along a path</title>" in text
    assert not re.findall(r'(?:src|href)="(?!data:)[^"]+"', text)


def test_a_page_is_written_whole_or_not_at_all(righting, tmp_path, monkeypatch):
    page = tmp_path / "cat.html"
    page.write_text("old")

    def interrupted(*_args, **_more):
        raise KeyboardInterrupt

    monkeypatch.setattr(viewer, "page_from", interrupted)
    with pytest.raises(KeyboardInterrupt):
        view(righting, frames=2).write(page)
    assert [p.name for p in tmp_path.iterdir()] == ["cat.html"]
    assert page.read_text() == "old"


def test_nothing_is_printed(righting, tmp_path, capfd):
    view(righting, frames=2).write(tmp_path / "cat.html")
    said = capfd.readouterr()
    assert said.out == said.err == ""


@pytest.mark.parametrize("kind", ["rigid", "particles", "falling"])
def test_pages_of_bodies_without_links(kind, tmp_path):
    deformation = {
        "rigid": lambda: sp.rigid(np.diag([1.0, 2.0, 2.5]), 2.0),
        "falling": lambda: sp.prescribed(stretching, None, 2.0),
        "particles": lambda: sp.particles(
            [1.0, 1.0, 1.0], lambda t: (np.eye(3) * np.ones((len(t), 1, 1)), np.zeros((len(t), 3, 3))), 2.0
        ),
    }[kind]()
    motion = sp.reconstruct(deformation, [0.2, 1.0, 0.3])
    view(motion, frames=5, gravity=[0.0, 0.0, -9.81 if kind == "falling" else 0.0]).write(tmp_path / "a.html")
    data = page_data(tmp_path / "a.html")
    turn, _ = moved(data, -1)
    np.testing.assert_allclose(turn, motion.final_attitude, atol=1e-6)
    nodes = data["motion"]["nodes"]
    assert len(nodes) == (3 if kind == "particles" else 1)
    assert data["motion"]["chain"] is None
    assert (nodes[0]["scales"] is None) == (kind == "particles")
    if kind == "falling":
        first, last = (np.linalg.eigvalsh(deformation.inertia(t)) for t in (0.0, 2.0))
        edges = np.sqrt((0.5 * last.sum() - last) / (0.5 * first.sum()))
        np.testing.assert_allclose(np.sort(nodes[0]["scales"][-3:]), np.sort(edges), rtol=1e-6)


def test_a_page_of_a_body_with_36_joints_is_small(tmp_path):
    body = sp.load_body("example:human")
    assert body.n_shape == 36
    motion = sp.reconstruct(sp.articulated(body, random_loop(body, np.random.default_rng(1))), [0.0, 0.0, 20.0])
    view(motion).write(tmp_path / "human.html")
    assert (tmp_path / "human.html").stat().st_size < 1e6


# ---- Shown ----------------------------------------------------------------------------------------------------------


def test_a_page_is_opened_in_a_browser_from_a_file(righting, monkeypatch):
    opened_there = []
    monkeypatch.setattr("webbrowser.open", opened_there.append)
    page = view(righting, frames=3)
    file = page.show()
    assert opened_there == [file.as_uri()]
    assert file.read_text(encoding="utf-8") == page.html
    file.unlink()
    assert repr(page) == f"Page('cat along a path', {len(page.html) / 1e3:.0f} kB)"


def test_in_a_notebook_the_page_is_shown_in_the_cell(righting, monkeypatch):
    display = pytest.importorskip("IPython.display")
    shown = []
    monkeypatch.setattr(display, "display", shown.append)
    monkeypatch.setattr("shapephase.plots.pages.page._in_notebook", lambda: True)
    page = view(righting, frames=5)
    assert page.show() is None
    assert shown == [page]
    assert html.unescape(page._repr_html_()).count(page.html) == 1


def test_a_report_is_stopped_by_its_progress_callback(righting):
    with pytest.raises(RunStopped, match="inertia"):
        report(righting, sp.split(righting), progress=lambda share, _: share > 0.0)


def test_only_pages_of_one_motion_are_filmed(righting, tmp_path, monkeypatch):
    monkeypatch.setattr("shapephase.plots.pages.page.check_video", lambda *_: ".gif")
    page = report(righting, sp.split(righting))
    with pytest.raises(ShapeError, match="rolling_ellipsoid"):
        page.film(tmp_path / "report.gif")


# ---- In a browser ---------------------------------------------------------------------------------------------------


def pose(page, what):
    """A pose of the page's scripts, which has columns there."""
    return np.reshape(page.evaluate(f"Array.from({what})"), (4, 4)).T


def test_the_page_opens_in_a_browser_without_a_network_and_moves(righting, cat_page, chromium):
    """Bodies are drawn where the motion has them, nothing is cut off, nothing is asked for, no error is said."""
    page, said, asked = opened(chromium, cat_page)
    page.get_by_text("side", exact=True).click()
    first, last = seen(page, 0.0), seen(page, 0.5)
    up, down = furred(first)[:, 0], furred(last)[:, 0]
    assert min(len(up), len(down)) > 500
    # Thin legs reach further from the thick trunk: upwards on its back, downwards on its feet.
    assert np.median(up) - up.min() > 1.3 * (up.max() - np.median(up))
    assert down.max() - np.median(down) > 1.3 * (np.median(down) - down.min())
    for picture in (first, last):
        places = furred(picture)
        assert places.min() > 5
        assert np.all(places.max(axis=0) < np.array(picture.shape[:2]) - 5)
    # At the time of a frame the links are where Pinocchio has them.
    t = 0.5 * 49 / 120
    page.evaluate("t => page.clock.show(t)", t)
    np.testing.assert_allclose(pose(page, "page.figure.base")[:3, :3], righting.attitude(t), atol=1e-6)
    body, path = righting.deformation.description.body, righting.deformation.description.path
    shape = np.array(page.evaluate("page.figure.shapeAt(page.clock.place())"))
    np.testing.assert_allclose(shape, path.shape(t), atol=1e-6)
    there = "framePoses(page.figure.data.chain, page.figure.shapeAt(page.clock.place()))"
    poses = np.array(page.evaluate(there)).reshape(-1, 4, 4)
    for name, (frame, rest) in body.chain.link_frames.items():
        np.testing.assert_allclose(poses[frame].T @ rest, body.link_pose(shape, name), atol=1e-12, err_msg=name)
    centre = page.evaluate(f"centreOfMass(page.figure.data.chain, {there})")
    np.testing.assert_allclose(centre, body.centre_of_mass(shape), atol=1e-12)
    # Frame by frame; and by hand, with the centre of mass where it was.
    page.keyboard.press("ArrowRight")
    assert page.evaluate("page.clock.time") == pytest.approx(0.5 * 50 / 120, abs=1e-12)
    page.evaluate("page.figure.byHand = page.figure.shapeAt(page.clock.place()).map(() => 0); page.clock.changed()")
    held = pose(page, "page.figure.base")
    np.testing.assert_allclose(held[:3, :3] @ body.centre_of_mass(body.shape()) + held[:3, 3], 0.0, atol=1e-6)
    # It plays by itself, too.
    page.evaluate("page.clock.show(0); page.clock.speed = 4; page.clock.play(true)")
    wait_for(page, "page.clock.time > 0.1")
    assert [message for message in said if message[0] in ("error", "warning")] == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []


def test_joints_that_follow_others_are_drawn_where_they_are(tmp_path, chromium, load_urdf):
    """The page has the functions themselves: at shapes between knots, at one, and beyond them."""
    body = load_urdf(LEG).with_couplings(couplings(TURN["spline"][0]))
    path = sp.ShapePath.fourier([0.1, 0.0], [[0.3], [0.2]], [[0.2], [0.7]], 1.0)
    view(sp.reconstruct(sp.articulated(body, path), np.zeros(3))).write(tmp_path / "leg.html")
    page, said, _ = opened(chromium, tmp_path / "leg.html")
    for shape in ([0.3, -0.9], [0.1, -0.1], [0.2, KNOTS[2]], [-0.4, 0.5], [0.0, 1.2]):
        poses = page.evaluate("shape => framePoses(page.figure.data.chain, shape)", shape)
        for name, (frame, rest) in body.chain.link_frames.items():
            found = np.reshape(poses[frame], (4, 4)).T @ rest
            np.testing.assert_allclose(found, body.link_pose(shape, name), atol=1e-12, err_msg=name)
    assert [message for message in said if message[0] in ("error", "warning")] == []


def vermilion(picture):
    """Places (right, up) of what has the colour of the momentum's arrow, from the middle of all of it [px]."""
    red, green, blue = np.moveaxis(picture, -1, 0)
    rows, columns = np.nonzero((red - blue > 90) & (green > 0.3 * red) & (green < 0.62 * red))
    return np.stack([columns - columns.mean(), rows.mean() - rows], axis=-1)


def pointed(places):
    """The direction of an arrow of pixels, by its long axis, towards its thick end."""
    axis = np.linalg.svd(places, full_matrices=False)[2][0]
    along, across = places @ axis, np.abs(places @ [-axis[1], axis[0]])
    ends = [across[along < 0.72 * along.min()].mean(), across[along > 0.72 * along.max()].mean()]
    return axis if ends[1] > ends[0] else -axis


@pytest.mark.full
def test_the_arrow_in_the_page_is_the_momentum_of_the_motion(tumbling, tmp_path, chromium):
    """By the scripts' poses and by pixels of known views: seen from +X, right is Y and up is Z.

    Only the arrow is shown where pixels are counted. In the body's frame it is R(t)^T L. Between two frames, h apart,
    the attitude goes along the shortest arc, which is off by h^2/8 of the angular acceleration.
    """
    view(tumbling, frames=1201, trail="head").write(tmp_path / "a.html")
    page, said, _ = opened(chromium, tmp_path / "a.html")
    momentum = tumbling.momentum
    times = np.linspace(0.0, tumbling.duration, 8)
    rates = tumbling.angular_velocity(np.linspace(0.0, tumbling.duration, 2001))
    bend = np.abs(np.gradient(rates, tumbling.duration / 2000, axis=0)).max() * (tumbling.duration / 1200) ** 2
    for t in times:
        page.evaluate("t => page.clock.show(t)", float(t))
        arrow, base = pose(page, "page.figure.momentum.pose"), pose(page, "page.figure.base")
        np.testing.assert_allclose(so3.normalised(arrow[:3, 2]), so3.normalised(momentum), atol=1e-12)
        np.testing.assert_allclose(arrow[:3, 3], 0.0, atol=1e-6)
        np.testing.assert_allclose(base[:3, :3], tumbling.attitude(t), atol=bend + 1e-6)
    page.evaluate("""() => {
      const others = [...Object.keys(page.figure.groups), "trail", "inertial axes"].filter(name => name !== "momentum");
      for (const group of others) page.figure.toggle(group, false);
    }""")
    views = {"front": [[0, 1, 0], [0, 0, 1]], "side": [[1, 0, 0], [0, 0, 1]], "top": [[1, 0, 0], [0, 1, 0]]}
    for name, axes in views.items():
        page.get_by_text(name, exact=True).click()
        shown = pointed(vermilion(seen(page, float(times[3]))))
        # In perspective an arrow whose tail is beside the middle leans by a degree or two.
        assert shown @ so3.normalised(np.array(axes) @ momentum) > np.cos(np.radians(4.0)), name
    page.get_by_text("body's frame").click()
    for name, axes in views.items():
        page.get_by_text(name, exact=True).click()
        for t in times[[1, 6]]:
            flat = np.array(axes) @ tumbling.attitude(t).T @ momentum
            # Towards the eye it is too short.
            if np.linalg.norm(flat) < 0.5 * np.linalg.norm(momentum):
                continue
            shown = pointed(vermilion(seen(page, float(t))))
            assert shown @ so3.normalised(flat) > np.cos(np.radians(4.0)), (name, t)
    assert [message for message in said if message[0] in ("error", "warning")] == []


@pytest.mark.full
def test_the_camera_goes_with_a_body_that_falls_far(tmp_path, chromium):
    """It is seen as large at the end as at the start, in the same place; the floor below it is grey."""
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.0, 0.0, 3.0 * np.pi])
    view(motion, velocity=[1.0, 0.0, 6.0], gravity=[0.0, 0.0, -9.81]).write(tmp_path / "a.html")
    page, said, _ = opened(chromium, tmp_path / "a.html")
    where = "page.scene.onScreen(page.figure.centrePlace, 520, 400)"

    def blue():
        picture = seen(page, page.evaluate("page.clock.time"))
        return np.count_nonzero(picture[..., 2] - picture[..., 0] > 90)

    page.evaluate("page.scene.draw()")
    start, size = page.evaluate(where), blue()
    page.evaluate("page.clock.show(page.clock.duration); page.scene.draw()")
    np.testing.assert_allclose(page.evaluate(where), start, rtol=0, atol=1e-9)
    assert size > 300
    # Two whole turns later it lies as it lay.
    assert blue() == pytest.approx(size, rel=0.05)
    page.get_by_text("follow").click()
    page.evaluate("page.scene.draw()")
    assert blue() < 0.05 * size
    picture = seen(page, 0.0)
    grey = (np.ptp(picture, axis=-1) < 4) & (abs(picture[..., 0] - 199) < 12)
    assert np.count_nonzero(grey) > 500
    assert [message for message in said if message[0] in ("error", "warning")] == []


@pytest.mark.full
def test_shapes_are_closed_and_of_their_size(chromium, cat_page):
    """Volumes and bounds of the triangles that the page draws, by the theorem of Gauss, against closed forms."""
    page, _, _ = opened(chromium, cat_page)
    r, length = 0.3, 0.5
    ball = 4.0 / 3.0 * np.pi * r**3
    expected = {
        "boxMesh(0.2, 0.4, 0.6)": (0.048, [0.1, 0.2, 0.3]),
        f"sphereMesh({r})": (ball, [r, r, r]),
        f"cylinderMesh({r}, {length})": (np.pi * r**2 * length, [r, r, length / 2]),
        f"capsuleMesh({r}, {length})": (np.pi * r**2 * length + ball, [r, r, length / 2 + r]),
    }
    for made, (volume, half) in expected.items():
        mesh = page.evaluate(f"[{made}].map(m => [Array.from(m.positions), Array.from(m.normals)])[0]")
        corners, normals = (np.reshape(values, (-1, 3, 3)) for values in mesh)
        a, b, c = np.moveaxis(corners, 1, 0)
        # Towards the side that the normals show.
        areas = np.cross(b - a, c - a)
        areas *= np.sign(np.einsum("ni,nki->n", areas, normals))[:, None]
        assert np.einsum("ni,ni->", areas, a) / 6.0 == pytest.approx(volume, rel=0.03)
        np.testing.assert_allclose(areas.sum(axis=0), 0.0, atol=1e-6)
        np.testing.assert_allclose(corners.reshape(-1, 3).max(axis=0), half, rtol=0.02)
        np.testing.assert_allclose(corners.reshape(-1, 3).min(axis=0), -np.array(half), rtol=0.02)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, atol=1e-6)


# ---- The streams of the process -------------------------------------------------------------------------------------


@pytest.mark.full
def test_pages_are_made_in_two_threads_and_the_streams_of_the_process_stay_as_they_are(capfd, tmp_path):
    """Nothing that a third thread prints meanwhile is lost, and nothing else is seen."""
    import rich

    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), [0.3, 0.2, 0.9])
    rich.reconfigure()
    stream, done, replaced, printed = sys.stdout, threading.Event(), [], 0

    def watch():
        while not done.is_set():
            replaced.append(sys.stdout is not stream)

    def make(k):
        for n in range(3):
            view(motion, frames=3).write(tmp_path / f"page{k}_{n}.html")

    watcher = threading.Thread(target=watch)
    makers = [threading.Thread(target=make, args=(k,)) for k in range(2)]
    for thread in (watcher, *makers):
        thread.start()
    while any(maker.is_alive() for maker in makers):
        print(f"line {printed}")
        rich.print(f"rich {printed}")
        printed += 1
        time.sleep(0.01)
    done.set()
    watcher.join()
    assert sys.stdout is stream
    assert not any(replaced)
    lines = capfd.readouterr().out.splitlines()
    assert lines == [f"{kind} {k}" for k in range(printed) for kind in ("line", "rich")]
    assert all((tmp_path / f"page{k}_{n}.html").stat().st_size > 25_000 for k in range(2) for n in range(3))
