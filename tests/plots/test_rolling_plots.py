"""The rolling ellipsoid touches its plane and does not slip there; the cones touch along the angular velocity."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from shapephase.errors import ShapeError
from shapephase.plots import column_axes, plot_cones, plot_rolling_ellipsoid
from shapephase.rigid_body import EulerTop, Poinsot

BLUE, VERMILION, GREEN, BLACK, DARK = "#0072B2", "#D55E00", "#009E73", "#000000", "#555555"
TOPS = {
    "largest": EulerTop.principal((1.0, 2.0, 3.0), (0.3, 0.5, -0.9)),
    "smallest": EulerTop.principal((3.0, 2.0, 1.0), (0.5, 0.6, -1.4)),
    "separatrix": EulerTop.principal((3.0, 6.0, 8.0), (0.5, 0.3, 1.0)),
    "oblate": EulerTop.principal((1.0, 1.0, 1.7), (0.3, 0.5, -0.8)),
    "prolate": EulerTop.principal((2.0, 2.0, 0.8), (0.3, 0.5, 0.8)),
}
# Times eps of the products that make a drawn point: three rotations and the elliptic functions.
ROUNDING = 1e-13


def solid_axes():
    return Figure(figsize=(3.4, 4.6)).add_subplot(projection="3d")


def drawn(ax, colour, width, dashed=None):
    """The points of all lines of a colour and width, (N, 3)."""
    lines = [line for line in ax.lines if (line.get_color(), line.get_linewidth()) == (colour, width)]
    lines = [line for line in lines if dashed is None or (line.get_linestyle() == "--") is dashed]
    return [np.stack(line.get_data_3d(), axis=-1) for line in lines]


def labels(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def contact_of(ax):
    (marker,) = [line for line in ax.lines if line.get_marker() == "o"]
    return np.stack(marker.get_data_3d(), axis=-1)[0]


def quadric(points):
    """The matrix Q of the ellipsoid p.Qp = 1 about the origin through points, by least squares."""
    x, y, z = points.T
    rows = np.stack([x * x, y * y, z * z, 2 * x * y, 2 * y * z, 2 * x * z], axis=-1)
    a, b, c, d, e, f = np.linalg.lstsq(rows, np.ones(len(points)), rcond=None)[0]
    return np.array([[a, d, f], [d, b, e], [f, e, c]])


@pytest.mark.parametrize("name", ["largest", "separatrix", "oblate"])
def test_the_ellipsoid_touches_its_plane_in_the_point_drawn_i1(name):
    """Read off the artists alone: the ellipses drawn lie on one quadric, whose tangent plane at the contact is flat."""
    top, time = TOPS[name], 1.3
    ax = plot_rolling_ellipsoid(solid_axes(), top, time)
    ellipses = np.concatenate(drawn(ax, DARK, 0.8) + drawn(ax, "#999999", 0.35))
    found = quadric(ellipses)
    assert np.einsum("ni,ij,nj->n", ellipses, found, ellipses) == pytest.approx(np.ones(len(ellipses)), abs=1e-12)
    # Its semi-axes are sqrt(2 E / I), by the energy of the momentum alone.
    energy = 0.5 * np.sum(top.body_momentum(0.0) ** 2 / np.diag(top.inertia))
    assert np.sqrt(1.0 / np.linalg.eigvalsh(found)) == pytest.approx(np.sqrt(2.0 * energy / top.moments), rel=1e-12)
    contact = contact_of(ax)
    assert contact @ found @ contact == pytest.approx(1.0, abs=1e-12)
    normal = found @ contact
    assert normal[:2] == pytest.approx(np.zeros(2), abs=1e-12 * abs(normal[2]))
    # And the plane is where the energy says, 2 E / |mu| below the centre.
    assert contact[2] == pytest.approx(-2.0 * energy / top.magnitude, rel=1e-13)
    # Seen from the side, the plane is a line.
    floor = plot_rolling_ellipsoid(column_axes(), top, time, view=(0.0, 0.0)).patches[0].get_xy()
    assert floor[:, 1] == pytest.approx(np.full(len(floor), contact[2]), abs=ROUNDING)
    for curve in drawn(ax, BLUE, 1.1):
        assert curve[:, 2] == pytest.approx(np.full(len(curve), contact[2]), abs=ROUNDING)


@pytest.mark.parametrize("name", ["largest", "smallest"])
def test_the_point_of_contact_does_not_slip_i2(name):
    """The drawn body's point in contact is at rest: in a short time it moves as the square of that."""
    top, time, step = TOPS[name], 0.7, 1e-4
    before, after = (plot_rolling_ellipsoid(solid_axes(), top, t) for t in (time - step, time + step))
    middle = plot_rolling_ellipsoid(solid_axes(), top, time)
    bodies = [np.concatenate(drawn(ax, DARK, 0.8)) for ax in (before, after)]
    # The rigid motion between the two pictures, from the ellipses alone.
    left, _, right = np.linalg.svd(bodies[1].T @ bodies[0])
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    contact = contact_of(middle)
    slip = np.linalg.norm(turn @ contact - contact) / (2.0 * step)
    # Of a point that is not in contact the same quotient is its velocity.
    other = np.linalg.norm(turn @ (contact[[1, 2, 0]]) - contact[[1, 2, 0]]) / (2.0 * step)
    assert slip < 1e-6
    assert other > 1e-2
    # The velocity itself, by omega of the picture across the lever that the picture has.
    omega = np.concatenate(drawn(middle, GREEN, 2.0))[-1]
    assert np.cross(omega, contact) == pytest.approx(np.zeros(3), abs=ROUNDING)


@pytest.mark.parametrize("name", ["largest", "smallest", "separatrix"])
def test_polhode_and_herpolhode_meet_in_the_contact_i3(name):
    top, time = TOPS[name], 0.4
    ax = plot_rolling_ellipsoid(solid_axes(), top, time, periods=3.0)
    contact, size = contact_of(ax), np.linalg.norm(contact_of(ax))
    polhode, herpolhode = (np.concatenate(drawn(ax, *look)) for look in ((VERMILION, 1.8), (BLUE, 1.1)))
    for curve in (polhode, herpolhode):
        assert np.linalg.norm(curve - contact, axis=-1).min() < 0.02 * size
    ellipsoid = quadric(np.concatenate(drawn(ax, DARK, 0.8)))
    assert np.einsum("ni,ij,nj->n", polhode, ellipsoid, polhode) == pytest.approx(np.ones(len(polhode)), abs=1e-12)
    # All of the polhode has the same |I omega|: on the momentum's sphere it is the polhode, too.
    inertia = 2.0 * top.energy * ellipsoid
    assert np.linalg.norm(polhode @ inertia, axis=-1) == pytest.approx(np.full(len(polhode), top.magnitude), rel=1e-12)
    radius = np.hypot(*herpolhode.T[:2])
    inner, outer = Poinsot(top).annulus
    assert inner - 1e-12 <= radius.min() <= radius.max() <= outer + 1e-12
    assert labels(ax)[:2] == ["polhode", "herpolhode"]


@pytest.mark.parametrize("view", [(22.0, 40.0), (50.0, -70.0)])
def test_what_the_ellipsoid_hides_is_dimmed(view):
    top = TOPS["largest"]
    ax = solid_axes()
    ax.view_init(*view)
    plot_rolling_ellipsoid(ax, top, 2.0)
    elevation, azimuth = np.radians(view)
    eye = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    ellipsoid = quadric(np.concatenate(drawn(ax, DARK, 0.8)))
    lines = [line for line in ax.lines if (line.get_color(), line.get_linewidth()) == (BLUE, 1.1)]
    wrong = total = 0
    for line in lines:
        # On its way to the eye a hidden point passes through the inside.
        way = np.stack(line.get_data_3d(), axis=-1)[:, None] + np.linspace(1e-6, 3.0, 400)[:, None] * eye
        hidden = np.any(np.einsum("nki,ij,nkj->nk", way, ellipsoid, way) < 1.0, axis=-1)
        wrong += int(np.sum(hidden == (line.get_alpha() == 1.0)))
        total += len(hidden)
    # Pieces share the point of the cut, and a way that only grazes is not sampled finely enough.
    assert total > 1000
    assert wrong < 0.02 * total


@pytest.mark.parametrize("name", ["oblate", "prolate"])
def test_the_cones_touch_along_the_angular_velocity_h2(name):
    top, time = TOPS[name], 0.9
    ax = plot_cones(solid_axes(), top, time)
    body, space = (np.concatenate(drawn(ax, *look)) for look in ((VERMILION, 1.8), (BLUE, 1.1)))
    omega = np.concatenate(drawn(ax, GREEN, 2.0))[-1]
    mu = np.concatenate(drawn(ax, BLACK, 1.4))[-1]
    axis = np.concatenate(drawn(ax, VERMILION, 1.4))[-1]
    omega, mu, axis = (vector / np.linalg.norm(vector) for vector in (omega, mu, axis))
    assert mu == pytest.approx(np.array([0.0, 0.0, 1.0]), abs=1e-15)
    normals = []
    for rim, centre in ((body, axis), (space, mu)):
        along = rim @ centre / np.linalg.norm(rim, axis=-1)
        # Omega is a generator of each; the normal of a cone along a generator is in the plane of it and the axis.
        assert along == pytest.approx(np.full(len(rim), omega @ centre), abs=ROUNDING)
        across = centre - (centre @ omega) * omega
        normals.append(across / np.linalg.norm(across))
    assert np.cross(*normals) == pytest.approx(np.zeros(3), abs=1e-12)
    # Oblate: both on one side of it, the space cone inside; prolate: on opposite sides.
    assert normals[0] @ normals[1] == pytest.approx(1.0 if name == "oblate" else -1.0, abs=1e-12)
    assert np.linalg.norm(body, axis=-1) == pytest.approx(np.full(len(body), np.linalg.norm(space[0])), rel=1e-13)
    title = ax.get_legend().get_title().get_text()
    assert title.startswith(name)
    # By the momentum alone: cos of the half angles.
    momentum = np.abs(top.body_momentum(0.0) @ top.axes)
    rate = momentum / top.moments
    along = {"oblate": 2, "prolate": 0}[name]
    degrees = np.degrees(np.arccos(rate[along] / np.linalg.norm(rate)))
    assert labels(ax)[0] == f"body cone, half angle {degrees:.4g}°"
    degrees = np.degrees(np.arccos(momentum @ rate / np.linalg.norm(rate) / top.magnitude))
    assert labels(ax)[1] == f"space cone, half angle {degrees:.4g}°"


def test_flat_axes_show_the_same_in_parallel_projection():
    for draw, top, view in (
        (plot_rolling_ellipsoid, TOPS["smallest"], (31.0, -50.0)),
        (plot_cones, TOPS["oblate"], (12.0, 75.0)),
    ):
        solid = solid_axes()
        solid.view_init(*view)
        draw(solid, top, 0.3)
        flat = draw(column_axes(3.6), top, 0.3, view=view)
        elevation, azimuth = np.radians(view)
        right = [-np.sin(azimuth), np.cos(azimuth), 0.0]
        up = np.cross(
            [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], right
        )
        assert len(solid.lines) == len(flat.lines)
        for one, other in zip(solid.lines, flat.lines):
            expected = np.stack(one.get_data_3d(), axis=-1) @ np.transpose([right, up])
            assert np.stack(other.get_data(), axis=-1) == pytest.approx(expected, abs=1e-13)
        flat.figure.draw_without_rendering()
        # The shade of a cone or ellipsoid is convex and holds its lines.
        assert len(flat.patches) == 2


def test_degenerate_tops_are_drawn_or_refused():
    for momentum in ((0.0, 0.0, 2.0), (0.0, 2.0, 0.0)):
        ax = plot_rolling_ellipsoid(column_axes(), EulerTop.principal((1.0, 2.0, 3.0), momentum))
        assert "herpolhode" not in labels(ax)
        ax.figure.draw_without_rendering()
    spinning = plot_cones(column_axes(), EulerTop.principal((1.0, 1.0, 2.0), (0.0, 0.0, 1.0)))
    assert labels(spinning)[:2] == ["body cone, half angle 0°", "space cone, half angle 0°"]
    spinning.figure.draw_without_rendering()
    with pytest.raises(ShapeError, match="momentum"):
        plot_rolling_ellipsoid(column_axes(), EulerTop.principal((1.0, 2.0, 3.0), (0.0, 0.0, 0.0)))
    with pytest.raises(ShapeError, match="exactly"):
        plot_cones(column_axes(), TOPS["largest"])
    with pytest.raises(ShapeError, match="periods"):
        plot_rolling_ellipsoid(column_axes(), TOPS["largest"], periods=-1.0)
    with pytest.raises(ShapeError, match="ax"):
        plot_cones(None, TOPS["oblate"])
