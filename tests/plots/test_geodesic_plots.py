"""What is drawn of conjugate points, and listed by the command, agrees with closed forms and other algorithms."""

from __future__ import annotations

import json

import numpy as np
import pytest
from cyclopts import App
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import art3d
from scipy.interpolate import CubicSpline
from scipy.special import ellipe, ellipeinc

from shapephase import so3
from shapephase.cli.rigid_body.conjugate import conjugate_command
from shapephase.errors import InputFileNotFoundError, ShapeError, UnknownNameError
from shapephase.plots import (
    column_axes,
    plot_caustic,
    plot_conjugate_locus,
    plot_first_return,
    plot_potential,
    plot_surface_locus,
)
from shapephase.rigid_body.geodesics import (
    astroid,
    axisymmetric_metric,
    conjugate_locus,
    ellipsoid,
    left_invariant_metric,
    serret_andoyer_metric,
    surface_of_metric,
)

MOMENTS = (3.0, 2.0, 1.0)
# p, T, R, phi and theta of the first conjugate point of MOMENTS: theory.md, section 6.
TABLE = np.array(
    [
        [1.70, 11.3634614556, 3.2816745281, -0.094594, 3.565678],
        [1.60, 13.3636563838, 3.8894133371, -0.644765, 5.025759],
        [1.50, 17.0851557433, 5.0954738015, -1.152362, 7.022735],
        [1.43, 25.3967481375, 7.9511732331, -1.676710, 11.331023],
        [1.42, 30.3253866338, 9.6815243490, -1.829686, 13.924233],
    ]
)
CREST = 2.0646141015


def curves(ax, label):
    return [np.array(line.get_data()) for line in ax.lines if line.get_label() == label]


def labels(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def between(curve, x):
    """A drawn curve of ascending abscissa at x, by a spline."""
    return CubicSpline(curve[0], curve[1])(x)


def test_the_branches_pass_through_the_reference_points_and_are_mirror_images():
    ax = plot_conjugate_locus(column_axes(), MOMENTS)
    upward, downward = curves(ax, "locus, upward start")[0], curves(ax, "locus, downward start")[0]
    assert np.abs(between(upward[:, 2:], TABLE[:, 4]) - TABLE[:, 3]).max() < 3e-6
    assert np.array_equal(upward * [[1.0], [-1.0]], downward)
    assert np.abs(upward[:, 0] - [np.pi, 0.0]).max() < 1e-7
    assert np.all(np.diff(upward[1]) < 0.0)
    assert 0.0 < CREST + upward[1, -1] < 0.1
    asymptotes = sorted(
        line.get_ydata()[0] for line in ax.lines if len(set(line.get_ydata())) == 1 and len(line.get_ydata()) == 2
    )
    assert np.abs(np.array(asymptotes) - [-CREST, CREST]).max() < 1e-9


def test_the_faint_geodesics_solve_the_equations_and_touch_the_locus():
    ax = plot_conjugate_locus(column_axes(), MOMENTS, geodesics=6)
    locus = curves(ax, "locus, upward start")[0]
    faint = [np.array(line.get_data()) for line in ax.lines if line.get_linewidth() == 0.6]
    assert len(faint) == 12
    metric = serret_andoyer_metric(MOMENTS)
    for theta, phi in faint[:6]:
        assert np.abs(locus - np.array([[theta[-1]], [phi[-1]]])).max(axis=0).min() < 1e-13
        # d theta/d phi = p/sqrt(m (m - p^2)): Clairaut's p is the same wherever it is read off the curve.
        steps = np.linspace(0.0, 1.0, len(theta))
        turn, rise = np.gradient(theta, steps, edge_order=2), np.gradient(phi, steps, edge_order=2)
        m = metric.m(phi)
        p = m * turn / np.sqrt(rise**2 + m * turn**2)
        assert np.ptp(p[3:-3]) < 2e-3
    for up, down in zip(faint[:6], faint[6:], strict=True):
        assert np.array_equal(up * [[1.0], [-1.0]], down)


def test_given_momenta_are_marked_and_the_second_order_starts_on_the_other_side():
    ax = plot_conjugate_locus(column_axes(), MOMENTS, momenta=TABLE[:, 0])
    assert np.abs(curves(ax, r"of the $p_\theta$ given")[0] - TABLE[:, [4, 3]].T).max() < 1e-6
    ax = plot_conjugate_locus(column_axes(), MOMENTS, 2)
    second = curves(ax, "locus, upward start")[0]
    assert np.abs(second[:, 0] - [2.0 * np.pi, 0.0]).max() < 1e-7
    assert np.all(second[1, 1:] > 0.0)
    assert r"of the $p_\theta$ given" not in labels(ax)


@pytest.mark.parametrize("order", [1, 2])
def test_a_nearly_round_ellipsoid_shows_the_astroid(order):
    flattening = 1e-4
    ax = plot_surface_locus(column_axes(), ellipsoid(1.0 - flattening), (order,))
    x, y = curves(ax, f"order {order}: 4 cusps")[0]
    # An astroid: |x|^(2/3) + |y|^(2/3) is constant; the size grows with the order.
    radius = order * np.abs(astroid(1.0 - flattening, 0.0)[1] - np.pi)
    assert np.abs(np.abs(x / radius) ** (2 / 3) + np.abs(y / radius) ** (2 / 3) - 1.0).max() < 10.0 * flattening
    assert (x[0], y[0]) == (x[-1], y[-1])
    for values in (x, y):
        assert values.min() < -0.9 * radius
        assert values.max() > 0.9 * radius


def test_the_ellipsoid_is_drawn_with_both_orders_and_geodesics_that_touch_the_first():
    ax = plot_surface_locus(column_axes(), ellipsoid(0.5), (1, 2), geodesics=12)
    assert labels(ax) == ["geodesics", "order 1: 4 cusps", "order 2: 4 cusps", "cut locus: arc of a parallel"]
    assert ax.get_aspect() == 1.0
    x, y = curves(ax, "order 1: 4 cusps")[0]
    # The cusps on the equator: the equator's conjugate time is pi epsilon, so theta = pi/2 or, westward, 3 pi/2.
    assert abs(np.abs(x).max() - 0.5 * np.pi) < 1e-3
    faint = [np.array(line.get_data()) for line in ax.lines if line.get_linewidth() == 0.6]
    assert len(faint) == 12
    for east, north in faint:
        assert np.hypot(x[:, None] - east, y[:, None] - north).min() < 0.02
    assert max(np.abs(east[0]) for east, _ in faint) == pytest.approx(np.pi, abs=1e-14)
    for east, north in faint:
        # Clairaut: the parallel where a geodesic turns has the latitude of its direction at the start, where the
        # meridian is half as long as the angle.
        steepest = np.arctan2(0.5 * abs(north[1]), abs(east[1] - east[0]))
        assert abs(north.max() - steepest) < 1e-3
    assert {np.sign(north[1]) for _, north in faint} == {-1.0, 1.0}
    assert plot_surface_locus(column_axes(), ellipsoid(1.5), latitude=0.3, geodesics=0).lines


@pytest.mark.parametrize("aspect", [0.6, 1.4])
def test_the_cut_locus_ends_in_the_cusps(aspect):
    """An arc of the opposite parallel of an oblate ellipsoid, of the opposite meridian of a prolate one."""
    kind = "parallel" if aspect < 1.0 else "meridian"
    ax = plot_surface_locus(column_axes(), ellipsoid(aspect), latitude=0.2, geodesics=0)
    ((x, y),) = curves(ax, f"cut locus: arc of a {kind}")
    locus = curves(ax, "order 1: 4 cusps")[0]
    axis = 0 if kind == "parallel" else 1
    other = (x, y)[1 - axis]
    assert other[0] == other[1]
    assert [x, y][axis] == pytest.approx([locus[axis].min(), locus[axis].max()], abs=1e-3)


def test_a_torus_has_two_branches_that_never_meet():
    """Extremals of the outer half oscillate about its equator; the top, where m' = 0, is a separatrix."""

    def torus(x):
        return (2.0 + np.cos(x)) ** 2, -2.0 * np.sin(x) * (2.0 + np.cos(x))

    surface = surface_of_metric(torus, np.pi)
    ax = plot_surface_locus(column_axes(), surface, geodesics=4)
    branches = curves(ax, "order 1: 2 cusps") + [line for line in curves(ax, "_") if len(line[0]) == 200]
    assert len(branches) == 2
    assert np.array_equal(branches[0][1], branches[1][1][::-1])
    assert "cut locus" not in " ".join(labels(ax))
    # On the outer equator the curvature is 1/3 and the circle has the radius 3: conjugate after pi sqrt(3).
    for x, y in branches:
        assert abs(x[np.abs(y).argmin()]) == pytest.approx(np.pi - np.pi * np.sqrt(3.0) / 3.0, abs=1e-3)


def test_the_potential_is_one_where_extremals_turn():
    ax = plot_potential(column_axes(), MOMENTS)
    metric = serret_andoyer_metric(MOMENTS)
    for p in (np.sqrt(2.0), np.sqrt(2.0) + 0.4 * (np.sqrt(3.0) - np.sqrt(2.0))):
        ((phi, level),) = curves(ax, f"$p$ = {p:.4g}")
        assert np.abs(level - metric.potential(phi, p)).max() < 1e-13
        colour = next(line.get_color() for line in ax.lines if line.get_label() == f"$p$ = {p:.4g}")
        (ends,) = [line.get_xdata() for line in ax.lines if line.get_marker() == "o" and line.get_color() == colour]
        turning = metric.crest if p == np.sqrt(2.0) else float(metric.geodesics(p).amplitude)
        # Next to the separatrix phi is as the square root of p.
        assert ends == pytest.approx([-turning, turning], abs=1e-12 if p > 1.42 else 1e-6)
    rotating = plot_potential(column_axes(), MOMENTS, [1.3])
    assert not [line for line in rotating.lines if line.get_marker() == "o"]
    ((_, level),) = curves(rotating, "$p$ = 1.3")
    assert level.max() < 1.0
    ((_, level),) = curves(plot_potential(column_axes(), ellipsoid(0.8), [0.5]), "$p$ = 0.5")
    assert level.min() == pytest.approx(0.25, abs=1e-15)


def test_period_and_first_return_are_those_of_the_closed_forms():
    ax = plot_first_return(column_axes(), MOMENTS, TABLE[:, 0])
    twin = ax.figure.axes[1]
    metric = serret_andoyer_metric(MOMENTS)
    for axes, column, closed in ((ax, 1, "period"), (twin, 2, "first_return")):
        curve, marked = axes.lines
        assert np.abs(marked.get_ydata() - TABLE[:, column]).max() < 1e-9
        exact = getattr(metric.geodesics(curve.get_xdata()), closed)
        assert np.abs(curve.get_ydata() / exact - 1.0).max() < 1e-11
    assert labels(ax) == [r"period $T$ [$\sqrt{\mathrm{kg}}$ m]", "first return $R$ [rad]"]
    ax = plot_first_return(column_axes(), ellipsoid(0.8))
    (curve,) = ax.lines
    alpha2 = 0.64 + 0.36 * (1.0 - curve.get_xdata() ** 2)
    assert curve.get_ydata() == pytest.approx(4.0 * np.sqrt(alpha2) * ellipe(1.0 - 0.64 / alpha2), rel=1e-13)


@pytest.mark.parametrize(("aspect", "latitude"), [(0.5, 0.0), (1.5, 0.4)])
def test_the_ordinate_is_the_parametric_latitude(aspect, latitude):
    """The meridian's length up to it, by the elliptic integral, is the phi of the conjugate points."""
    x, y = curves(plot_surface_locus(column_axes(), ellipsoid(aspect), latitude=latitude), "order 1: 4 cusps")[0]
    points = conjugate_locus(ellipsoid(aspect), 400, 1, latitude).points
    phi = aspect * ellipeinc(y[:-1], 1.0 - 1.0 / aspect**2)
    assert np.abs(phi - points.latitude).max() < 1e-12
    assert np.abs(np.sin(x[:-1] - np.pi - points.longitude)).max() < 1e-12


@pytest.fixture
def corners(monkeypatch):
    """The corners of the meshes that a caustic is drawn with, a list of (m, 3), and the axes."""

    def drawn(moments, circles):
        made = []

        class Recorded(art3d.Poly3DCollection):
            def __init__(self, verts, **look):
                made.append(verts)
                super().__init__(verts, **look)

        monkeypatch.setattr(art3d, "Poly3DCollection", Recorded)
        ax = plot_caustic(column_axes(3.6, projection="3d"), moments, circles=circles)
        assert len(ax.collections) == len(made) == 1
        return made[0], ax

    return drawn


def test_the_caustic_of_an_axisymmetric_body_is_that_of_the_closed_form(corners):
    metric, closed = left_invariant_metric((2.0, 2.0, 1.0)), axisymmetric_metric(2.0, 1.0)
    meshes = corners((2.0, 2.0, 1.0), 16)[0]
    assert np.linalg.norm(np.concatenate(meshes), axis=-1).max() <= np.pi + 1e-12
    # Those that pass the ball's surface have corners of their own there.
    drawn = np.concatenate([mesh for mesh in meshes if np.linalg.norm(mesh, axis=-1).max() < np.pi - 1e-9])
    polar = (np.arange(16) + 0.5) * np.pi / 16
    around = np.linspace(0.0, 2.0 * np.pi, 33)
    velocity = [(np.cos(a), np.sin(a) * np.cos(b), np.sin(a) * np.sin(b)) for a in polar for b in around]
    momentum = np.array(velocity) * np.sqrt([2.0, 2.0, 1.0])
    expected = so3.log(metric.attitude(momentum, closed.conjugate_time(momentum)))
    # Next to the ball's surface the sign is rounding.
    for point in drawn[::7]:
        gaps = np.minimum(np.abs(expected - point).max(axis=1), np.abs(expected + point).max(axis=1))
        assert gaps.min() < 1e-9
    inner = expected[np.linalg.norm(expected, axis=1) < 1.2]
    for point in inner:
        assert np.abs(drawn - point).max(axis=1).min() < 1e-9


def test_meshes_of_the_caustic_are_cut_at_the_boundary_of_the_ball(corners):
    """Both halves end on the sphere, opposite to each other: as rotations the surface goes on there."""
    meshes, _ = corners(MOMENTS, 24)
    for mesh in meshes:
        assert np.linalg.norm(mesh - np.roll(mesh, 1, axis=0), axis=-1).max() < np.pi
    points = np.concatenate(meshes)
    length = np.linalg.norm(points, axis=-1)
    assert length.max() < np.pi + 1e-12
    ends = points[length > np.pi - 1e-12]
    assert len(ends) > 20
    for end in ends:
        assert np.linalg.norm(ends + end, axis=-1).min() < 1e-9
    # Hardly a mesh is left out: those that the grid does not resolve.
    assert len(meshes) > 0.95 * 23 * 48


def test_meshes_of_a_caustic_inside_the_ball_are_whole(corners):
    meshes, ax = corners((1.2, 1.1, 1.0), 10)
    quads = np.array(meshes)
    assert quads.shape == (9 * 20, 4, 3)
    assert ax.get_xlim()[1] < 1.2
    # In a convex mesh whose corners go round, the diagonals together are longer than two opposite sides.
    side = np.linalg.norm(quads - np.roll(quads, 1, axis=1), axis=-1)
    diagonals = np.linalg.norm(quads[:, 0] - quads[:, 2], axis=-1) + np.linalg.norm(quads[:, 1] - quads[:, 3], axis=-1)
    assert np.mean(diagonals > np.maximum(side[:, 0] + side[:, 2], side[:, 1] + side[:, 3])) > 0.8


def test_renaming_the_axes_turns_the_caustic(corners):
    first, turned = (np.array(corners(moments, 8)[0]) for moments in ((1.3, 1.1, 1.0), (1.0, 1.3, 1.1)))
    assert np.abs(turned[..., [1, 2, 0]] - first).max() < 1e-9


def test_the_sub_riemannian_caustic_lies_on_the_forbidden_axis(corners):
    """Where I_3 >= I_1 the geodesics of one axial momentum meet on the axis (theory.md section 7)."""
    drawn = np.concatenate(corners((1.0, 1.0, np.inf), 12)[0])
    assert np.abs(drawn[:, :2]).max() < 1e-7
    assert np.ptp(drawn[:, 2]) > 3.0


def test_figures_refuse_what_they_cannot_draw():
    flat, deep = column_axes(), column_axes(projection="3d")
    for draw in (
        lambda: plot_conjugate_locus(deep, MOMENTS),
        lambda: plot_surface_locus(deep, ellipsoid(0.5)),
        lambda: plot_surface_locus(flat, ellipsoid(0.5), latitude=2.0),
        lambda: plot_potential(flat, ellipsoid(0.5), [1.1]),
        lambda: plot_potential(deep, MOMENTS),
        lambda: plot_first_return(flat, (2.0, 2.0, 1.0)),
        lambda: plot_first_return(deep, MOMENTS),
        lambda: plot_caustic(flat, MOMENTS),
        lambda: plot_conjugate_locus(Figure(), MOMENTS),
        lambda: plot_conjugate_locus(flat, (3.0, 3.0, 1.0)),
        lambda: plot_conjugate_locus(flat, MOMENTS, 0),
        lambda: plot_conjugate_locus(flat, MOMENTS, momenta=[-1.5]),
        lambda: plot_conjugate_locus(flat, MOMENTS, momenta=[1.2]),
        lambda: plot_conjugate_locus(flat, MOMENTS, geodesics=-1),
        lambda: plot_surface_locus(flat, ellipsoid(1.0)),
        lambda: plot_surface_locus(flat, ellipsoid(0.5), ()),
        lambda: plot_surface_locus(flat, ellipsoid(0.5), geodesics=0.5),
        lambda: plot_first_return(flat, MOMENTS, [1.2]),
        lambda: plot_caustic(deep, MOMENTS, circles=1),
        lambda: plot_caustic(deep, (1.0, np.inf, np.inf)),
    ):
        with pytest.raises(ShapeError):
            draw()
    assert not flat.lines
    assert not deep.lines


def test_the_command_prints_the_reference_table():
    said = conjugate_command(MOMENTS, momenta=tuple(TABLE[:, 0]))
    rows = [[float(word) for word in line.split()] for line in said.text.splitlines()[4:9]]
    printed = np.array(rows)
    assert np.abs(printed[:, [0, 1, 2]] - TABLE[:, :3]).max() < 1e-9
    assert np.abs(printed[:, [4, 5]] - TABLE[:, 3:]).max() < 6e-7
    data = json.loads(json.dumps(said.data))
    for name, column in (("p", 0), ("period", 1), ("first_return_rad", 2), ("conjugate_time", 3), ("phi", 4)):
        assert np.abs(np.array(data[name]) - printed[:, column]).max() < 1e-9
    assert data["figure"] is None
    # At the conjugate time the Jacobi field of the geodesic is 0.
    metric = serret_andoyer_metric(MOMENTS)
    assert np.abs(metric.geodesics(data["p"]).jacobi_field(data["conjugate_time"])).max() < 1e-10


def test_the_command_chooses_momenta_and_writes_the_figure(tmp_path, capsys):
    out = tmp_path / "locus.svg"
    said = conjugate_command(MOMENTS, order=2, out=out)
    assert out.read_bytes().startswith(b"<?xml")
    assert b"<dc:date>" not in out.read_bytes()
    assert capsys.readouterr().err.startswith(f"wrote {out} (")
    assert "phi = 2.064614101" in said.text or "phi = 2.064614102" in said.text
    assert said.data["p"][0] == np.sqrt(3.0)
    assert abs(said.data["theta_rad"][0] - 2.0 * np.pi) < 1e-7
    assert np.all(np.diff(said.data["theta_rad"]) > 0.0)
    for ending in ("png", "pdf"):
        conjugate_command(MOMENTS, order=2, out=tmp_path / f"locus.{ending}")
        assert (tmp_path / f"locus.{ending}").stat().st_size > 1000
    ax = plot_conjugate_locus(column_axes(2.8), MOMENTS, 2, momenta=said.data["p"])
    ax.figure.savefig(tmp_path / "direct.png", dpi=300)
    assert (tmp_path / "direct.png").read_bytes() == (tmp_path / "locus.png").read_bytes()


def test_the_command_takes_moments_in_any_order():
    said, other = conjugate_command(MOMENTS), conjugate_command(MOMENTS[::-1])
    assert other.data["moments_kg_m2"] == list(MOMENTS[::-1])
    assert said.text.splitlines()[1:] == other.text.splitlines()[1:]


def test_the_command_is_read_from_words():
    app = App(result_action="return_value")
    app.command(conjugate_command, name="conjugate")
    said = app(["conjugate", "3", "2", "1", "--momenta", "1.5", "1.6", "--order", "1", "--json"], exit_on_error=False)
    assert said.data["p"] == [1.5, 1.6]


def test_the_command_refuses_with_a_reason(tmp_path):
    with pytest.raises(ShapeError, match=r"1\.73205"):
        conjugate_command(MOMENTS, momenta=(1.5, 1.2))
    with pytest.raises(ShapeError, match="--momenta"):
        conjugate_command(MOMENTS, momenta=(1.5, 1.8))
    with pytest.raises(ShapeError, match="moments"):
        conjugate_command((2.0, 2.0, 3.0))
    with pytest.raises(UnknownNameError, match="--out"):
        conjugate_command(MOMENTS, out=tmp_path / "locus.txt")
    with pytest.raises(InputFileNotFoundError):
        conjugate_command(MOMENTS, out=tmp_path / "nowhere" / "locus.svg")
    with pytest.raises(ShapeError, match="order"):
        conjugate_command(MOMENTS, order=0)
