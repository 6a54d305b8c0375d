"""What the 3-D views show against the laws of the motion, the page as a browser without a network sees it."""

from __future__ import annotations

import base64
import re
import subprocess
import sys
import threading
import time
import urllib.request

import msgspec
import numpy as np
import pytest
import zstandard
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.deformation.assemblies import assembly, moving_mass, rigid_part
from shapephase.errors import MissingExtraError, ShapeError, UnknownNameError, VisualWarning
from shapephase.examples.scenarios import cat_righting
from shapephase.plotting import _scene_drawing as scene_drawing
from shapephase.plotting import viewer
from shapephase.plotting._moving_scene import moving_scene
from shapephase.plotting.viewer import motion_page, view
from support.bodies import link, random_loop, urdf
from support.browser import furred, seen, stopped

UPSIDE_DOWN = np.diag([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def righting():
    """The cat falls upside down without momentum."""
    return sp.reconstruct(sp.articulated(sp.load_body("cat"), cat_righting()), np.zeros(3), UPSIDE_DOWN)


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
    assert not scene.articulated
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
        motion_page(several, page)
    with pytest.raises(UnknownNameError, match="tail"):
        motion_page(one, page, trail="tail")
    for speed in (0.0, -1.0, np.nan, np.inf, "fast"):
        with pytest.raises(ShapeError, match="speed"):
            motion_page(righting, page, speed=speed)
    for frames in (1, 0, -3, 2.5, True, 10**6):
        with pytest.raises(ShapeError, match="frames"):
            motion_page(righting, page, frames=frames)
    with pytest.raises(ShapeError, match="gravity"):
        motion_page(one, page, gravity=9.81)
    assert not list(tmp_path.iterdir())


def test_without_viser_the_extra_is_named(righting, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    for show in (lambda: motion_page(righting, tmp_path / "cat.html"), lambda: view(righting)):
        with pytest.raises(MissingExtraError, match=re.escape("shapephase[viz]")):
            show()
    assert not list(tmp_path.iterdir())


def test_viser_is_imported_only_when_something_is_shown():
    code = (
        "import sys, shapephase.plotting.viewer; "
        "print([m for m in ('viser', 'trimesh', 'IPython') if m in sys.modules])"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    assert told.stdout.strip() == "[]"


# ---- The page -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cat_page(righting, tmp_path_factory):
    page = tmp_path_factory.mktemp("page") / "cat.html"
    motion_page(righting, page, trail="head")
    return page


def recorded(page):
    """What a page plays, decoded as its player does: seconds, messages (second, message)."""
    (data,) = re.findall(r'__VISER_EMBED_DATA__="([^"]*)"', page.read_text(encoding="utf-8"))
    content = base64.b64decode(data)
    inner = zstandard.ZstdDecompressor().decompress(content[8:], max_output_size=int.from_bytes(content[:8], "little"))
    length = int.from_bytes(inner[:8], "little")
    record = msgspec.msgpack.decode(inner[8 : 8 + length])
    return record["durationSeconds"], record["messages"]


def pose_at(messages, name, second=np.inf):
    """The last place and wxyz of a node until a second; what is never sent stays at the origin."""
    found = {"position": [0.0, 0.0, 0.0], "wxyz": [1.0, 0.0, 0.0, 0.0]}
    assert any(message.get("name") == name for _, message in messages)
    for when, message in messages:
        if when <= second and message.get("name") == name:
            found |= {key: message[key] for key in ("position", "wxyz") if key in message}
    return np.array(found["position"]), np.array(found["wxyz"])


def test_the_page_moves_as_reconstructed(righting, cat_page):
    """The recording itself, at the start and at the end, by SciPy's quaternions."""
    seconds, messages = recorded(cat_page)
    assert 4.0 < seconds < 7.0
    for second, t in ((0.0, 0.0), (np.inf, righting.duration)):
        place, wxyz = pose_at(messages, "/body", second)
        turn = Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
        np.testing.assert_allclose(turn, righting.attitude(t), atol=1e-6)
        np.testing.assert_allclose(place, righting.base_position(t), atol=1e-6)
    place, wxyz = pose_at(messages, "/reference/trunk_front_0")
    np.testing.assert_allclose(Rotation.from_quat(np.roll(wxyz, -1)).as_matrix(), UPSIDE_DOWN, atol=1e-6)
    np.testing.assert_allclose(place, righting.base_position(0.0), atol=1e-6)
    place, _ = pose_at(messages, "/trail_now")
    body, path = righting.deformation.description.body, righting.deformation.description.path
    head = righting.final_attitude @ body.link_pose(path.shape(0.5), "head")[:3, 3] + righting.base_position(0.5)
    np.testing.assert_allclose(place, head, atol=1e-6)
    names = {message["name"] for _, message in messages if "name" in message}
    assert {"/floor", "/clock", "/trail", "/trail_now"} <= names
    assert any(name.startswith("/reference/trunk_front") for name in names)
    assert not any(name.startswith("/momentum") for name in names)
    clock = [m["updates"]["text"] for _, m in messages if m.get("name") == "/clock" and "updates" in m]
    assert clock[-1].startswith("t = 0.5 s")


def test_every_shape_of_the_body_is_in_the_page_as_it_is(righting, cat_page):
    """Sizes, colours and places in the recording are those of the URDF, in its order."""
    _, messages = recorded(cat_page)
    made = {m["name"]: m["props"] for when, m in messages if "props" in m and when == 0.0}
    number = 0
    for place, node in enumerate(moving_scene(righting, 2).nodes):
        for count, shape in enumerate(node.shapes):
            name = f"{node.name}_{place}/{shape.kind}_{count}"
            props, number = made[f"/body/{name}"], number + 1
            keys = {"box": ["dimensions"], "cylinder": ["radius", "height"], "sphere": ["radius"]}[shape.kind]
            np.testing.assert_allclose(np.hstack([props[key] for key in keys]), shape.dimensions, rtol=1e-6)
            np.testing.assert_allclose(np.array(props["color"]) / 255.0, shape.colour[:3], atol=0.002)
            assert props["opacity"] is None
            assert 0.0 < made[f"/reference/{name}"]["opacity"] < 0.5
            at, wxyz = pose_at(messages, f"/body/{name}")
            np.testing.assert_allclose(at, shape.pose[:3, 3], atol=1e-7)
            turn = Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
            np.testing.assert_allclose(turn, shape.pose[:3, :3], atol=1e-6)
    assert number == 16


def test_the_momentum_is_an_arrow_along_the_momentum(tumbling, tmp_path):
    motion_page(tumbling, tmp_path / "a.html", frames=2, ghost=False, velocity=[1.0, 0.0, 0.0])
    _, messages = recorded(tmp_path / "a.html")
    _, wxyz = pose_at(messages, "/momentum/arrow")
    direction = Rotation.from_quat(np.roll(wxyz, -1)).apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(direction, np.array([3.0, -2.0, 4.0]) / np.sqrt(29.0), atol=1e-6)
    place, still = pose_at(messages, "/momentum")
    np.testing.assert_allclose(place, [tumbling.duration, 0.0, 0.0], atol=1e-6)
    np.testing.assert_array_equal(still, [1.0, 0.0, 0.0, 0.0])
    texts = [m["props"]["text"] for _, m in messages if m.get("name") == "/momentum/label" and "props" in m]
    assert texts == ["angular momentum 5.39 kg m²/s"]
    assert not any("/reference" in message.get("name", "") for _, message in messages)


def test_speed_and_frames(righting, tmp_path):
    """Half a second at a tenth of its speed takes five, beside the pauses at both ends."""
    motion_page(righting, tmp_path / "a.html", speed=0.1, frames=11)
    seconds, messages = recorded(tmp_path / "a.html")
    times = sorted({when for when, _ in messages})
    np.testing.assert_allclose(np.diff(times)[1:], 0.5, atol=1e-12)
    assert len(times) == 11
    assert seconds - times[0] == pytest.approx(5.0 + 0.5 + 1.0, abs=1e-9)


def test_turns_too_fast_for_the_frames_are_said(tmp_path):
    """A sphere of inertia 1 turns at exactly |mu| rad/s: 20 s in 600 steps, 60 rad/s are two radians each."""
    fast = sp.reconstruct(sp.rigid(np.eye(3), 20.0), [0.0, 0.0, 60.0])
    assert moving_scene(fast, 601).largest_turn == pytest.approx(2.0, abs=1e-6)
    with pytest.warns(VisualWarning, match="115 degrees"):
        motion_page(fast, tmp_path / "a.html")
    motion_page(fast, tmp_path / "a.html", frames=601)


def test_the_page_is_small_named_and_asks_for_nothing(cat_page):
    assert cat_page.stat().st_size < 1.5e6
    text = cat_page.read_text(encoding="utf-8")
    assert "<title>cat along a path</title>" in text
    head = text[: text.index("__VISER_EMBED_DATA__")]
    assert not re.findall(r'(?:src|href)="(?!data:)[^"]+"', head)


def test_a_page_is_written_whole_or_not_at_all(righting, tmp_path, monkeypatch):
    import viser.infra

    page = tmp_path / "cat.html"
    page.write_text("old")

    def interrupted(*_args, **_more):
        raise KeyboardInterrupt

    monkeypatch.setattr(viser.infra.StateSerializer, "as_html", interrupted)
    with pytest.raises(KeyboardInterrupt):
        motion_page(righting, page, frames=2)
    assert [p.name for p in tmp_path.iterdir()] == ["cat.html"]
    assert page.read_text() == "old"


def test_nothing_is_printed(righting, tmp_path, capfd):
    motion_page(righting, tmp_path / "cat.html", frames=2)
    with view(righting, frames=2, browser=False, port=0):
        pass
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
    motion_page(motion, tmp_path / "a.html", frames=5, gravity=[0.0, 0.0, -9.81 if kind == "falling" else 0.0])
    _, messages = recorded(tmp_path / "a.html")
    _, wxyz = pose_at(messages, "/body")
    turn = Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
    np.testing.assert_allclose(turn, motion.final_attitude, atol=1e-6)
    stretches = [m for _, m in messages if "scale" in m.get("updates", {})]
    assert bool(stretches) == (kind == "falling")
    if kind == "falling":
        first, last = (np.linalg.eigvalsh(deformation.inertia(t)) for t in (0.0, 2.0))
        edges = np.sqrt((0.5 * last.sum() - last) / (0.5 * first.sum()))
        np.testing.assert_allclose(np.sort(stretches[-1]["updates"]["scale"]), np.sort(edges), rtol=1e-6)


def test_a_page_of_a_body_with_36_joints_is_small(tmp_path):
    body = sp.load_body("example:human")
    assert body.n_shape == 36
    motion = sp.reconstruct(sp.articulated(body, random_loop(body, np.random.default_rng(1))), [0.0, 0.0, 20.0])
    motion_page(motion, tmp_path / "human.html")
    assert (tmp_path / "human.html").stat().st_size < 3e6


# ---- Live -----------------------------------------------------------------------------------------------------------


def wait_until(condition):
    """Return once it holds, or after enough looks to be sure that it never will."""
    for _ in range(3000):
        if condition():
            return
        time.sleep(0.02)


def test_a_live_view_plays_scrubs_and_stops(righting, monkeypatch):
    opened = []
    monkeypatch.setattr(viewer.webbrowser, "open", opened.append)
    with view(righting, speed=0.05, port=0) as live:
        assert opened == [live.url]
        with urllib.request.urlopen(live.url, timeout=60) as answer:
            assert b"<!doctype html>" in answer.read(200).lower()
        wait_until(lambda: live._slider.value >= 0.02)
        assert 0.02 <= live._slider.value <= 0.5
        live._playing.value = False
        live._slider.value = 0.5
        body = next(handle for handle, *_ in live._drawn.moving if handle.name == "/body")
        target = righting.base_position(0.5)
        wait_until(lambda: np.allclose(body.position, target, atol=1e-9))
        np.testing.assert_allclose(body.position, target, atol=1e-9)
        turn = Rotation.from_quat(np.roll(body.wxyz, -1)).as_matrix()
        np.testing.assert_allclose(turn, righting.final_attitude, atol=1e-9)
        assert repr(live) == f"LiveView('cat along a path', {live.url})"
    with pytest.raises(OSError):
        urllib.request.urlopen(live.url, timeout=2)


def test_a_script_may_wait_for_the_end_of_a_view(righting):
    live = view(righting, frames=2, browser=False, port=0)
    events = []

    def end():
        events.append("stop")
        live.stop()

    timer = threading.Timer(0.3, end)
    timer.start()
    live.wait()
    events.append("waited")
    timer.join()
    assert events == ["stop", "waited"]


def test_in_a_notebook_the_recording_is_shown_in_the_cell(righting, monkeypatch):
    import viser.infra

    shown = []
    monkeypatch.setattr(
        viser.infra.StateSerializer, "show", lambda self, **size: shown.append((self.serialize(), size))
    )
    assert view(righting, notebook=True, frames=5) is None
    ((record, size),) = shown
    assert len(record) > 1000
    assert size == {"height": 480}


# ---- In a browser ---------------------------------------------------------------------------------------------------


def test_the_page_opens_in_a_browser_without_a_network_and_moves(cat_page, chromium):
    """Requirement 1 of the 3-D views: the scene has moved between two screenshots, and no error is on the console."""
    page = chromium.new_page()
    said, asked = [], []
    page.on("console", lambda message: said.append((message.type, message.text)))
    page.on("pageerror", lambda error: said.append(("error", str(error))))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(cat_page.as_uri())
    page.wait_for_selector("canvas", timeout=60_000)
    page.locator("input").first.wait_for()
    stopped(page, page)
    # What warns of software rendering lies over the picture.
    for notice in page.locator(".mantine-Notification-closeButton").all():
        notice.click()
    first, last = seen(page, page, 0.2), seen(page, page, 5.4)
    assert [message for message in said if message[0] == "error"] == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
    assert cat_page.stat().st_size < 6e6
    moved = np.abs(first - last).sum(axis=-1) > 60
    assert moved.mean() > 0.005
    up, down = furred(first)[:, 0], furred(last)[:, 0]
    assert min(len(up), len(down)) > 500
    # Thin legs reach further from the thick trunk: upwards on its back, downwards on its feet.
    assert np.median(up) - up.min() > 1.3 * (up.max() - np.median(up))
    assert down.max() - np.median(down) > 1.3 * (np.median(down) - down.min())
    # Nothing of the body is cut off by the frame.
    for picture in (first, last):
        places = furred(picture)
        assert places.min() > 5
        assert np.all(places.max(axis=0) < np.array(picture.shape[:2]) - 5)


@pytest.mark.parametrize(("radius", "length"), [(0.1, 0.5), (0.3, 0.01)])
def test_capsules_are_closed_and_round(radius, length):
    """A barrel of 24 sides between two half balls: closed, facing outwards, with nearly their volume."""
    import trimesh

    vertices, faces = scene_drawing._capsule(radius, length)
    drawn = trimesh.Trimesh(vertices, faces, validate=True)
    assert drawn.is_watertight
    exact = np.pi * radius**2 * length + 4.0 / 3.0 * np.pi * radius**3
    assert drawn.volume == pytest.approx(exact, rel=0.04)
    np.testing.assert_allclose(drawn.bounds[1], [radius, radius, 0.5 * length + radius], atol=1e-12)
    np.testing.assert_allclose(drawn.bounds[0], -drawn.bounds[1], atol=1e-12)


# ---- The streams of the process -------------------------------------------------------------------------------------


def test_pages_are_made_in_two_threads_and_the_streams_of_the_process_stay_as_they_are(capfd, tmp_path):
    """Nothing that a third thread prints meanwhile is lost, and nothing that viser prints is seen."""
    import rich

    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), [0.3, 0.2, 0.9])
    rich.reconfigure()
    stream, done, replaced, printed = sys.stdout, threading.Event(), [], 0

    def watch():
        while not done.is_set():
            replaced.append(sys.stdout is not stream)

    def make(k):
        for n in range(3):
            motion_page(motion, tmp_path / f"page{k}_{n}.html", frames=3)

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
    time.sleep(0.2)
    assert sys.stdout is stream
    assert not any(replaced)
    lines = capfd.readouterr().out.splitlines()
    assert lines == [f"{kind} {k}" for k in range(printed) for kind in ("line", "rich")]
    assert all((tmp_path / f"page{k}_{n}.html").stat().st_size > 10_000 for k in range(2) for n in range(3))
