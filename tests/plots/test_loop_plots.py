"""The loop of a motion on the curvature: its fluxes against integrals by SciPy, its turn against other algorithms."""

from __future__ import annotations

import json

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.integrate import dblquad

import shapephase as sp
from shapephase import plots, so3
from shapephase.cli.main import main
from shapephase.errors import OpenPathError, ShapeError, UnknownNameError
from shapephase.examples import cat_righting, kane_scher, satellite_sweep
from shapephase.plots.loop_plots import loop_flux

JOINTS = ("waist_pitch", "waist_yaw")


@pytest.fixture(scope="module")
def cat():
    return sp.load_body("cat")


@pytest.fixture(scope="module")
def halves():
    return sp.load_body("cat_two_halves")


@pytest.fixture(scope="module")
def satellite():
    return sp.load_body("satellite")


def printed(capfd, *arguments):
    main([*arguments, "--json"])
    return json.loads(capfd.readouterr().out)


def circle(body, joints, centre, radius):
    """A circle in the plane of two joints, counterclockwise from the first axis."""
    mean, cosine, sine = body.shape(dict(zip(joints, centre))), np.zeros((body.n_shape, 1)), np.zeros((body.n_shape, 1))
    cosine[body.joint_index(joints[0])], sine[body.joint_index(joints[1])] = radius, radius
    return sp.ShapePath.fourier(mean, cosine, sine, 1.0, joint_names=body.joint_names)


def title_of(ax):
    return ax.get_legend().get_title().get_text()


def test_the_righting_of_the_cat_in_parts(capfd, cat):
    """Waist alone 110, all joints 163, in their order 180 degrees about x."""
    data = printed(capfd, "loop", "cat", "cat_righting")
    assert (data["joints"], data["component"]) == (list(JOINTS), "x")
    assert [round(data[f"{key}_deg"]) for key in ("flux_in_plane", "flux_of_cone", "turn")] == [110, 163, 180]
    parts = data["flux_in_plane_deg"] + data["other_joints_deg"] + data["order_deg"]
    assert parts == pytest.approx(data["turn_deg"], abs=1e-12)
    path = cat_righting()
    motion = sp.reconstruct(sp.articulated(cat, path), np.zeros(3))
    turn = so3.exp(np.array(data["turn_rad"]))
    assert so3.angle(turn.T @ motion.final_attitude) < 1e-8
    assert so3.angle(turn.T @ sp.stokes_holonomy(cat, path)) < 1e-8


def test_the_flux_in_the_plane_is_the_integral_of_the_curvature_over_the_disc(halves):
    centre, radius = (0.3, -0.2), 0.6
    flux = loop_flux(halves, circle(halves, JOINTS, centre, radius), JOINTS)

    def height(u):
        return np.sqrt(max(radius**2 - (u - centre[0]) ** 2, 0.0))

    disc = dblquad(
        lambda v, u: -sp.curvature_on_plane(halves, JOINTS, [u], [v])[0, 0, 0],
        *(centre[0] - radius, centre[0] + radius),
        *(lambda u: centre[1] - height(u), lambda u: centre[1] + height(u)),
        epsabs=1e-6,
    )[0]
    assert flux.in_plane[0] == pytest.approx(disc, abs=2e-6)
    assert np.abs(flux.in_plane).max() > 0.5
    # No other joint moves: the whole cone is the disc.
    assert flux.of_cone == pytest.approx(flux.in_plane, abs=1e-12)


@pytest.mark.full
def test_the_flux_of_the_cone_is_the_integral_over_its_surface(satellite):
    """By the whole curvature tensor at every point of the cone, for all ten joints and for two and three of them."""
    path = satellite_sweep().matched(satellite.joint_names, satellite.name)
    middles = (np.arange(256) + 0.5) / 256 * path.duration
    tip = path.shape(middles).mean(axis=0)

    def on_the_cone(x, t, axis, kept):
        shape, rate = path.curve(np.array([t]))
        arm, rate = (shape[0] - tip) * kept, rate[0] * kept
        return -x * arm @ sp.curvature(satellite, tip + x * arm)[..., axis] @ rate

    several = ("arm_1", "boom_extension", "arm_2")
    for joints, name in ((several[:2], "in_plane"), (several, "in_plane"), (several[:2], "of_cone")):
        kept = np.ones(10) if name == "of_cone" else satellite.shape(dict.fromkeys(joints, 1.0))
        expected = dblquad(on_the_cone, 0.0, path.duration, 0.0, 1.0, args=(2, kept), epsabs=1e-5, epsrel=1e-4)[0]
        found = getattr(loop_flux(satellite, path, joints), name)[2]
        assert abs(expected) > 0.05
        assert found == pytest.approx(expected, abs=2e-5), (joints, name)


def test_small_loops_turn_the_body_by_their_flux(halves):
    """The difference is of the third order in the size, the flux of the second."""
    off = []
    for radius in (0.2, 0.1, 0.05):
        flux = loop_flux(halves, circle(halves, JOINTS, (0.4, 0.3), radius))
        assert so3.angle(so3.exp(flux.turn).T @ sp.holonomy(halves, circle(halves, JOINTS, (0.4, 0.3), radius))) < 1e-9
        off.append(np.linalg.norm(flux.turn - flux.in_plane) / np.linalg.norm(flux.in_plane))
    assert off[0] > 1.9 * off[1] > 3.6 * off[2] > 0.0


@pytest.mark.full
def test_whole_turns_are_added_to_the_turn(cat):
    """Two rounds of the cat's righting: 360 degrees, not none."""
    path = cat_righting()
    flux = loop_flux(cat, path.repeated(2))
    assert np.degrees(np.linalg.norm(flux.turn)) == pytest.approx(360.0, abs=1e-5)
    assert flux.turn @ flux.of_cone > 0.9999 * np.linalg.norm(flux.turn) * np.linalg.norm(flux.of_cone)
    assert flux.of_cone == pytest.approx(2.0 * loop_flux(cat, path).of_cone, abs=1e-6)


def test_the_figure_shows_loop_connection_and_numbers(cat):
    path = cat_righting()
    ax = plots.plot_loop(plots.column_axes(5.2), cat, path, JOINTS, axis="x")
    places = [cat.joint_index(name) for name in JOINTS]
    (line,) = [line for line in ax.lines if line.get_label() == "path"]
    drawn = np.stack(line.get_data(), axis=-1)
    assert drawn == pytest.approx(path.shape(np.linspace(0.0, path.duration, len(drawn)))[:, places], abs=1e-12)
    for words in (
        "about x by 180.0°",
        "110.0° flux in this plane",
        "cone of all joints 163.0°",
        "+53.0° by",
        "+17.0° by",
    ):
        assert words in title_of(ax)
    numbered = {text.get_text(): text.get_position() for text in ax.texts if text.get_bbox_patch()}
    assert sorted(numbered) == list("123456")
    for place in numbered.values():
        assert np.linalg.norm(drawn - place, axis=-1).min() < 1e-12
    assert numbered["1"] == pytest.approx(tuple(drawn[0]))
    assert len(ax.child_axes) == 6
    # The arrows: turning about x by a motion along either axis, of the axes' lengths.
    (field,) = [artist for artist in ax.collections if hasattr(artist, "U")]
    mean = loop_flux(cat, path, JOINTS).centre
    sides = np.array([np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())])
    for k in (3, 40, 100):
        shape = mean.copy()
        shape[places] = field.XY[k]
        turning = -sp.mechanical_connection(cat, shape)[0, places] * sides
        assert (field.U[k], field.V[k]) == pytest.approx(tuple(turning), abs=1e-12)


@pytest.mark.full
def test_principal_directions_and_three_joints(cat, halves):
    path = cat_righting().matched(cat.joint_names, cat.name)
    ax = plots.plot_loop(plots.column_axes(5.2), cat, path, "principal", postures=0)
    assert (ax.get_xlabel(), ax.child_axes) == ("1st principal direction [deg]", [])
    (line,) = [line for line in ax.lines if line.get_label() == "path"]
    shapes = path.shape(np.linspace(0.0, path.duration, 4001))
    # The largest variances of any plane.
    widest = np.linalg.eigvalsh(np.cov(shapes.T))[::-1][:2]
    assert np.var(np.stack(line.get_data()), axis=1) == pytest.approx(widest, rel=2e-2)
    joints = (*JOINTS, "neck_yaw")
    solid = plots.plot_loop(Figure().add_subplot(projection="3d"), cat, path, joints)
    assert solid.get_zlabel() == "neck_yaw [deg]"
    assert "117.4° flux in this space" in title_of(solid)
    assert "norm" not in title_of(plots.plot_loop(plots.column_axes(), halves, kane_scher(0.0, 0.5), axis="norm"))


def test_loops_that_enclose_nothing_are_refused(cat, halves):
    ax = plots.column_axes()
    with pytest.raises(OpenPathError):
        plots.plot_loop(ax, halves, sp.ShapePath.waypoints([0.0, 1.0], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.5]]))
    nodding = sp.ShapePath.fourier([0.0, 0.0, 0.0], [[0.1], [0.0], [0.0]], [[0.1], [0.0], [0.0]], 1.0)
    with pytest.raises(ShapeError, match="two joints that move, got 1"):
        plots.plot_loop(ax, halves, nodding)
    path = cat_righting()
    for joints, words in ((("waist_yaw",), "principal"), ("waist_yaw", "principal"), (("waist_yaw",) * 2, "different")):
        with pytest.raises(ShapeError, match=words):
            plots.plot_loop(ax, cat, path, joints)
    with pytest.raises(UnknownNameError, match="waist_yaw"):
        plots.plot_loop(ax, cat, path, ("waist_pitch", "waist_jaw"))
    with pytest.raises(UnknownNameError, match="norm"):
        plots.plot_loop(ax, cat, path, axis="q")
    with pytest.raises(ShapeError, match="3d"):
        plots.plot_loop(ax, cat, path, (*JOINTS, "neck_yaw"))
    assert not ax.lines
    assert not ax.collections


def test_the_command_draws_and_refuses(capfd, tmp_path):
    out = tmp_path / "loop.svg"
    main(["loop", "cat", "cat_righting", "--joints", "waist_pitch,waist_yaw", "--component", "norm", "--out", str(out)])
    said = capfd.readouterr().out
    assert "flux through the loop of waist_pitch, waist_yaw" in said
    assert "angle" in said
    assert out.read_bytes().startswith(b"<?xml")
    for options, words in ((("--component", "q"), "norm"), (("--joints", "waist_yaw"), "two or three joints")):
        with pytest.raises(SystemExit) as ended:
            main(["loop", "cat", "cat_righting", *options])
        assert ended.value.code == 2
        assert words in capfd.readouterr().err
