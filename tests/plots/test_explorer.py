"""The page to draw loops on: its turn is the holonomy of the loop that it saves, and its curvature that of the body."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import plots, so3
from shapephase.errors import ShapeError, UnknownNameError
from shapephase.plots import explore
from shapephase.plots.loop_plots import loop_flux
from shapephase.plots.pages.plane_series import least_perturbation_turns, plane_series
from shapephase.shape_space import holonomy, mechanical_connection
from support.browser import opened

JOINTS = ("waist_pitch", "waist_yaw")


@pytest.fixture(scope="module")
def cat():
    return sp.load_body("cat")


@pytest.fixture(scope="module")
def cat_plane(cat, tmp_path_factory):
    """The page in a file, and the series that it carries, made again."""
    file = tmp_path_factory.mktemp("explore") / "cat.html"
    page = explore(cat, JOINTS)
    page.write(file)
    plane = page.data["plane"]
    series = plane_series(
        cat, tuple(cat.joint_index(name) for name in JOINTS), np.array(plane["box"]), np.array(plane["rest"])
    )
    assert plane["connection_error"] == series.error
    return file, series


@pytest.mark.full
def test_a_circle_drawn_by_the_mouse_turns_the_body_as_its_file_says(cat, cat_plane, tmp_path, chromium):
    """The loop goes by a CSV file to the library, which finds its holonomy another way."""
    file, _ = cat_plane
    page, said, asked = opened(chromium, file)
    box = page.locator("#map canvas").bounding_box()
    middle = np.array([box["x"] + 0.55 * box["width"], box["y"] + 0.45 * box["height"]])
    steps = np.linspace(0.0, 2.0 * np.pi, 40)
    points = middle + 0.22 * box["width"] * np.stack([np.cos(steps), np.sin(steps)], axis=-1)
    page.mouse.move(*points[0])
    page.mouse.down()
    for point in points[1:]:
        page.mouse.move(*point)
    page.mouse.up()
    assert page.evaluate("page.kind") == "drawn"
    turn = np.array(page.evaluate("page.result.vector"))
    stated = page.evaluate("page.result.bySteps + page.result.bySeries")
    saved = tmp_path / "loop.csv"
    saved.write_text(page.evaluate("page.csv()"))
    path = sp.read_shape_path(saved, cat)
    exact = holonomy(cat, path, tolerance=1e-11)
    difference = so3.angle(Rotation.from_rotvec(turn).as_matrix() @ exact.T)
    assert np.linalg.norm(turn) > 0.05
    assert difference < 1e-5
    assert difference < stated < 1e-5
    assert f"{np.degrees(np.linalg.norm(turn)):.5f}°" in page.locator("#turn").inner_text()
    # The body at the end of the round has turned by just that, with its centre of mass at rest.
    page.evaluate("page.clock.show(page.clock.duration)")
    base = np.reshape(page.evaluate("Array.from(page.figure.base)"), (4, 4)).T
    np.testing.assert_allclose(base[:3, :3], exact, atol=1e-5)
    np.testing.assert_allclose(base[:3, :3] @ cat.centre_of_mass(path.shape(0.0)) + base[:3, 3], 0.0, atol=1e-6)
    # With angular momentum the page turns the body as the library does, which integrates another way, at every time.
    chosen = page.evaluate("""() => {
      page.components.forEach((input, n) => { input.value = [0.6, -0.3, 0.8][n] * page.plane.largest_momentum; });
      page.components[0].dispatchEvent(new Event("input"));
      return page.momentum;
    }""")
    assert np.linalg.norm(chosen) > 0.5 * page.evaluate("page.plane.largest_momentum")
    motion = sp.reconstruct(sp.articulated(cat, path), chosen, tolerance=1e-11)
    turn = np.array(page.evaluate("page.result.vector"))
    stated = page.evaluate("page.result.bySteps + page.result.bySeries")
    difference = so3.angle(Rotation.from_rotvec(turn).as_matrix() @ motion.final_attitude.T)
    assert difference < stated < 1e-5
    assert so3.angle(exact.T @ motion.final_attitude) > 0.5
    for t in (0.25, 2.5, 4.0):
        page.evaluate("t => page.clock.show(t)", t)
        base = np.reshape(page.evaluate("Array.from(page.figure.base)"), (4, 4)).T
        np.testing.assert_allclose(base[:3, :3], motion.attitude(t), atol=1e-5)
    arrow = np.reshape(page.evaluate("Array.from(page.figure.momentum.pose)"), (4, 4)).T[:3, 2]
    np.testing.assert_allclose(so3.normalised(arrow), so3.normalised(np.array(chosen)), atol=1e-12)
    words = page.locator("#parts").inner_text()
    assert "--momentum " + " ".join(f"{value:g}" for value in chosen) in words
    split = sp.split(motion)
    assert f"added {np.degrees(so3.angle(split.dynamical_rotation)):.2f}°" in words
    page.get_by_text("no momentum", exact=True).click()
    np.testing.assert_allclose(page.evaluate("page.result.vector"), page.evaluate("page.byShape.vector"), atol=0.0)
    assert [message for message in said if message[0] in ("error", "warning")] == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []


def test_flux_pictures_files_and_sliders(cat, cat_plane, tmp_path, chromium):
    file, _ = cat_plane
    page, said, asked = opened(chromium, file)
    page.evaluate("""() => {
      const hand = Array.from({length: 90}, (_, k) => 2 * Math.PI * k / 90)
        .map(s => [-0.3 + (0.5 + 0.1 * Math.cos(3 * s)) * Math.cos(s), 0.2 + 0.6 * Math.sin(s)]);
      page.map.listeners[0](hand);
    }""")
    # The sliders stand where the drawn loop is, and move it.
    points = np.array(page.evaluate("page.points"))
    low, high = points.min(axis=0), points.max(axis=0)
    sliders = np.array(page.evaluate("[...page.centre, ...page.half].map(input => Number(input.value))")).reshape(2, 2)
    np.testing.assert_allclose(sliders, [0.5 * (low + high), 0.5 * (high - low)], atol=1e-12)
    page.evaluate("() => { page.centre[1].value = 0; page.half[1].value = 0.3; page.make(); }")
    moved = np.array(page.evaluate("page.points"))
    np.testing.assert_allclose(moved[:, 0], points[:, 0], atol=1e-12)
    np.testing.assert_allclose(moved[:, 1], (points[:, 1] - sliders[0, 1]) * 0.3 / sliders[1, 1], atol=1e-12)
    turn = np.array(page.evaluate("page.result.vector"))
    page.get_by_text("other way round", exact=True).click()
    np.testing.assert_allclose(page.evaluate("page.result.vector"), -turn, atol=1e-8)
    # The flux is that of the curvature, which the library integrates over the loop that the page saves.
    text = page.evaluate("page.csv()")
    (tmp_path / "loop.csv").write_text(text)
    flux = loop_flux(cat, sp.read_shape_path(tmp_path / "loop.csv", cat), JOINTS)
    np.testing.assert_allclose(page.evaluate("page.flux"), flux.in_plane, atol=1e-7)
    assert f"Flux of the curvature through the loop: {np.degrees(np.linalg.norm(flux.in_plane)):.2f}°" in (
        page.locator("#flux").inner_text()
    )
    # Both pictures are files; that of vectors has map, loop and words.
    drawn = ElementTree.fromstring(page.evaluate("page.svg()"))
    words = " ".join(element.text or "" for element in drawn.iter())
    assert all(word in words for word in (*JOINTS, "deg/rad²", f"{np.degrees(np.linalg.norm(turn)):.2f}°"))
    assert [element.tag.split("}")[1] for element in drawn].count("image") == 1
    start = page.evaluate("""async () => {
      const picture = await rasterised(page.svg());
      return Array.from(new Uint8Array(await picture.slice(0, 4).arrayBuffer()));
    }""")
    assert bytes(start) == b"\x89PNG"
    # A file's own loop, in degrees as well.
    saved = np.array(page.evaluate("page.points"))
    page.locator("input[type=file]").set_input_files(tmp_path / "loop.csv")
    page.wait_for_function("page.kind === 'file'")
    np.testing.assert_allclose(page.evaluate("page.points"), saved, atol=1e-9)
    rows = np.degrees(saved)
    degrees = "\n".join(["t,waist_yaw [deg],waist_pitch [deg]", *(f"{k},{y},{x}" for k, (x, y) in enumerate(rows))])
    page.evaluate("text => page.open(text)", degrees)
    np.testing.assert_allclose(page.evaluate("page.points"), saved, atol=1e-9)
    page.evaluate("page.open('a,b\\n1,2\\n')")
    assert "no loop of waist_pitch and waist_yaw in this file" in page.locator("#parts").inner_text()
    assert [message for message in said if message[0] in ("error", "warning")] == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []


def test_one_convention_of_sign_colour_and_unit(cat, cat_plane, chromium):
    """A curvature has one colour in `explore`, `plot_curvature` and `plot_loop`: blue where positive."""
    file, _ = cat_plane
    page, _, _ = opened(chromium, file)
    page.evaluate(
        "() => { page.map.component = 'x'; page.map.gauge = 'base axes'; page.map.colour(); page.explain(); }"
    )
    assert "component x in base axes, in deg/rad²" in page.locator("#scale").inner_text()
    end = float(page.locator("#ends span").last.inner_text())
    path = sp.ShapePath.fourier(
        cat.shape({"waist_pitch": -1.2}), *(0.9 * np.eye(cat.n_shape)[[cat.joint_index(n)]].T for n in JOINTS), 1.0
    )
    flat = plots.plot_curvature(plots.column_axes(), cat, JOINTS, axis="x", path=path)
    loop = plots.plot_loop(plots.column_axes(5.2), cat, path, JOINTS, axis="x")
    where = [(0.0, 0.0), (-2.0, 0.05)]
    signs = []
    for pitch, yaw in where:
        exact = np.degrees(sp.curvature_on_plane(cat, JOINTS, [pitch], [yaw])[0, 0, 0])
        signs.append(np.sign(exact))
        share = page.evaluate(
            """([u, v]) => {
              const [[a, b], [c, d]] = page.plane.shown, count = page.plane.map;
              const [x, y] = [Math.round((u - a) / (b - a) * (count - 1)), Math.round((d - v) / (d - c) * (count - 1))];
              return Array.from(page.map.picture.getContext("2d").getImageData(x, y, 1, 1).data);
            }""",
            [pitch, yaw],
        )
        colours = [np.array(share[:3]) / 255.0]
        for ax in (flat, loop):
            mesh = ax.collections[0]
            grid = np.asarray(mesh.get_coordinates())
            place = np.argmin(np.linalg.norm(grid - (pitch, yaw), axis=-1))
            value = np.asarray(mesh.get_array()).ravel()[place]
            assert value == pytest.approx(exact, rel=0.1, abs=1.0)
            colours.append(np.array(mesh.cmap(mesh.norm(value))[:3]))
        for colour in colours:
            # More blue than red, or the other way round.
            assert np.sign(colour[2] - colour[0]) == np.sign(exact), (pitch, yaw, colours)
    assert sorted(signs) == [-1.0, 1.0]
    field = np.degrees(np.array(plots.explore(cat, JOINTS).data["plane"]["curvature"]["base axes"])[..., 0])
    assert end == pytest.approx(np.abs(field).max(), rel=1e-2)
    assert "deg/rad²" in flat.figure.axes[1].get_ylabel()
    assert "deg/rad²" in loop.figure.axes[1].get_xlabel()


def test_the_series_is_the_connection_to_its_error(cat, cat_plane, rng):
    _, series = cat_plane
    places = [cat.joint_index(name) for name in JOINTS]
    shapes = np.zeros((200, cat.n_shape))
    shapes[:, places] = rng.uniform(*series.box.T, (200, 2))
    x = (2.0 * shapes[:, places] - series.box.sum(axis=1)) / np.ptp(series.box, axis=1)
    inertia, momentum = (
        np.moveaxis(np.polynomial.chebyshev.chebval2d(x[:, 0], x[:, 1], values), -1, 0)
        for values in (series.inertia, series.momentum)
    )
    exact = mechanical_connection(cat, shapes)[..., places]
    assert np.linalg.norm(np.linalg.solve(inertia, momentum) - exact, axis=1).max() <= series.error < 1e-9
    assert np.linalg.norm(inertia - cat.locked_inertia(shapes), axis=(1, 2)).max() <= series.inertia_error < 1e-12
    off = np.linalg.norm(momentum - cat.momentum_matrix(shapes)[..., places], axis=1)
    assert off.max() <= series.momentum_error < 1e-12


def test_the_frame_of_least_perturbation_is_calmer_than_the_base(cat_plane):
    """Seen from it, by differences of its turns, the connection is smaller in the mean square."""
    _, series = cat_plane
    first, second = (np.linspace(*(0.9 * ends), 61) for ends in series.box)
    turns = least_perturbation_turns(series, first, second)
    np.testing.assert_allclose(turns @ so3.transpose(turns), np.broadcast_to(np.eye(3), turns.shape), atol=1e-12)
    base = series.connection(first, second)
    calmed = turns @ base
    for k, values in enumerate((first, second)):
        slope = np.gradient(turns, values, axis=k) @ so3.transpose(turns)
        calmed[..., k] += so3.vee(0.5 * (slope - so3.transpose(slope)))
    inside = (slice(1, -1), slice(1, -1))
    assert np.square(calmed[inside]).mean() < 0.7 * np.square(base[inside]).mean()


def test_wrong_joints_are_refused(cat):
    with pytest.raises(UnknownNameError, match=re.escape("waist_pich")):
        explore(cat, ("waist_pich", "waist_yaw"))
    for joints in (("waist_yaw", "waist_yaw"), ("waist_yaw",), "waist_yaw"):
        with pytest.raises(ShapeError, match="joints"):
            explore(cat, joints)
