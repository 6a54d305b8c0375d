"""The page of Poinsot's description: what is drawn obeys the laws of the free rigid body, read off the page alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.errors import ShapeError
from shapephase.plots import rolling_ellipsoid
from shapephase.rigid_body import Poinsot
from support.browser import opened, seen
from support.pages import page_data

INERTIA = np.array([[2.0, 0.3, 0.1], [0.3, 1.5, -0.2], [0.1, -0.2, 3.0]])
MOMENTUM = np.array([3.0, -4.0, 2.0])


@pytest.fixture(scope="module")
def top():
    return sp.EulerTop(INERTIA, MOMENTUM, so3.exp([0.4, -0.2, 0.9]))


@pytest.fixture(scope="module")
def top_page(top, tmp_path_factory):
    file = tmp_path_factory.mktemp("poinsot") / "rolling.html"
    rolling_ellipsoid(top, frames=2401).write(file)
    return file


def test_the_ellipsoid_in_the_page_rolls_on_its_plane(top, top_page):
    """Laws alone: the contact is on both and both are tangent there, and how the body turns is the way to it."""
    data = page_data(top_page)
    motion, rolling = data["motion"], data["rolling"]
    turns = Rotation.from_quat(motion["turns"].reshape(-1, 4)).as_matrix()
    contact = rolling["contact"].reshape(-1, 3).astype(float)
    inertia = turns @ INERTIA @ so3.transpose(turns)
    energy = 0.5 * MOMENTUM @ contact[0]
    # 32-bit numbers of size one.
    np.testing.assert_allclose(contact @ MOMENTUM, 2.0 * energy, rtol=2e-6)
    np.testing.assert_allclose(contact @ rolling["foot"], np.dot(rolling["foot"], rolling["foot"]), rtol=2e-6)
    np.testing.assert_allclose(np.einsum("ni,nij,nj->n", contact, inertia, contact), 2.0 * energy, rtol=4e-6)
    np.testing.assert_allclose(so3.apply(inertia, contact), np.broadcast_to(MOMENTUM, contact.shape), atol=1e-5)
    # The turn from one frame to the one after the next is twice the angular velocity between, to the third order.
    step = motion["duration"] / (motion["frames"] - 1)
    spin = so3.log(turns[2:] @ so3.transpose(turns[:-2])) / (2.0 * step)
    bend = np.abs(np.diff(contact, 2, axis=0)).max()
    np.testing.assert_allclose(spin, contact[1:-1], atol=bend + 1e-6 / step)
    # The drawn ellipsoid is that of the inertia.
    (shape,) = motion["nodes"][0]["shapes"]
    axes = np.reshape(shape["pose"], (4, 4)).T[:3, :3]
    drawn = axes @ np.diag(1.0 / np.square(shape["dimensions"])) @ axes.T
    np.testing.assert_allclose(drawn, INERTIA / (2.0 * energy), atol=1e-12)
    # The polhode closes after a period, on the ellipsoid.
    polhode = rolling["polhode"].reshape(-1, 3).astype(float)
    np.testing.assert_allclose(polhode[-1], polhode[0], atol=1e-5)
    np.testing.assert_allclose(np.einsum("ni,ij,nj->n", polhode, INERTIA, polhode), 2.0 * energy, rtol=4e-6)
    assert motion["up"] == pytest.approx(-MOMENTUM / np.linalg.norm(MOMENTUM), abs=1e-12)
    assert motion["duration"] == pytest.approx(3.0 * top.period, rel=1e-12)


def test_every_regime_has_a_page(tmp_path):
    """Steady about a stable and about the intermediate axis, axisymmetric, spherical, and next to the separatrix."""
    moments = [1.0, 2.0, 3.0]
    tops = [
        sp.EulerTop.principal(moments, [0.0, 0.0, 1.0]),
        sp.EulerTop.principal(moments, [0.0, 1.0, 0.0]),
        sp.EulerTop.principal([1.0, 1.0, 1.8], [0.5, 0.0, 0.9]),
        sp.EulerTop.principal([1.0, 1.0, 1.0], [0.5, 0.0, 0.9]),
        sp.EulerTop.principal(moments, [0.5, 0.0, np.sqrt(0.75)]),
    ]
    for top in tops:
        rolling_ellipsoid(top, frames=5, duration=2.5).write(tmp_path / "a.html")
        data = page_data(tmp_path / "a.html")
        assert data["motion"]["duration"] == 2.5
        contact = data["rolling"]["contact"].reshape(-1, 3)
        np.testing.assert_allclose(contact @ top.momentum, 2.0 * top.energy, rtol=1e-6)
        assert np.isfinite(data["rolling"]["polhode"]).all()
        # A herpolhode that is a point has no curves in time, and the arrow of the momentum ends beyond the plane.
        drawn = [plot["title"].split(":")[0] for plot in data["plots"]]
        assert (
            drawn
            == ["angular velocity along the principal axes", "herpolhode", "herpolhode"][
                : 3 if Poinsot(top).annulus[1] else 1
            ]
        )
        foot = float(np.linalg.norm(data["rolling"]["foot"]))
        assert data["motion"]["arrow"] * data["motion"]["reach"] > 1.3 * foot - 1e-12
    rolling_ellipsoid(tops[1], frames=5).write(tmp_path / "a.html")
    assert page_data(tmp_path / "a.html")["motion"]["duration"] == pytest.approx(24.0 * np.pi, rel=1e-12)


def test_what_cannot_roll_is_refused(top, tmp_path):
    page = tmp_path / "a.html"
    with pytest.raises(ShapeError, match="momentum"):
        rolling_ellipsoid(sp.EulerTop(INERTIA, [0.0, 0.0, 0.0])).write(page)
    for duration in (0.0, -1.0, np.inf):
        with pytest.raises(ShapeError, match="duration"):
            rolling_ellipsoid(top, duration=duration).write(page)
    for frames in (1, 2.5, True):
        with pytest.raises(ShapeError, match="frames"):
            rolling_ellipsoid(top, frames=frames).write(page)
    with pytest.raises(ShapeError, match="speed"):
        rolling_ellipsoid(top, speed=0.0).write(page)
    assert not list(tmp_path.iterdir())


@pytest.mark.full
def test_in_a_browser_the_contact_moves_with_the_clock(top, top_page, chromium):
    """Scrubbed to any time, what is drawn is the motion at that time; curves grow, and nothing is said or asked."""
    page, said, asked = opened(chromium, top_page)
    speed = float(np.linalg.norm(top.angular_velocity(0.0)))
    step = 3.0 * top.period / 2400
    for share in (0.0, 0.37, 0.5, 1.0):
        t = share * 3.0 * top.period
        page.evaluate("t => page.clock.show(t)", t)
        attitude, velocity = top.attitude(t), top.attitude(t) @ top.angular_velocity(t)
        # Between two frames all goes straight.
        straight = (speed * step) ** 2
        base = np.reshape(page.evaluate("Array.from(page.figure.base)"), (4, 4)).T
        np.testing.assert_allclose(base[:3, :3], attitude, atol=straight + 1e-6)
        np.testing.assert_allclose(page.evaluate("page.contact"), velocity, atol=straight * speed + 1e-6)
        arrow = np.reshape(page.evaluate("Array.from(page.arrow.pose)"), (4, 4)).T
        np.testing.assert_allclose(arrow[:3, 2], velocity, atol=straight * speed + 1e-6)
        shown = page.evaluate("page.plots[0].current")
        np.testing.assert_allclose(shown, top.axes.T @ top.angular_velocity(t), atol=straight * speed + 1e-6)
        riding = np.reshape(page.evaluate("Array.from(page.riding[0].pose)"), (4, 4)).T
        np.testing.assert_allclose(riding, base, atol=0.0)
        assert page.evaluate("page.drawn.uploaded.count") == 6 * min(int(share * 2400 + 1e-6), 2399)
    # From above one sees the herpolhode grow, in its own colour.
    page.get_by_text("top", exact=True).click()
    page.get_by_text("polhode", exact=True).first.click()

    def orange(share):
        picture = seen(page, share * 3.0 * top.period)
        return np.count_nonzero((picture[..., 0] - picture[..., 2] > 120) & (picture[..., 1] > 120))

    page.evaluate("page.figure.toggle('body', false); page.figure.toggle('momentum', false)")
    assert orange(0.9) > orange(0.1) + 100
    assert [message for message in said if message[0] in ("error", "warning")] == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []


@pytest.mark.full
def test_a_film_shows_the_ellipsoid_and_nothing_else(tmp_path, chromium):
    """In each of the six pictures the blue of the ellipsoid is in the middle, and what is drawn on the plane grows."""
    from PIL import Image

    chromium.close()
    rolling_ellipsoid(sp.EulerTop.principal([1.0, 2.0, 3.0], [0.6, 0.9, 0.5])).film(
        tmp_path / "rolling.png", pixels=(320, 240)
    )
    with Image.open(tmp_path / "rolling.png") as strip:
        pictures = np.split(np.asarray(strip.convert("RGB"), dtype=int), 6, axis=1)
    orange = []
    for picture in pictures:
        blue = np.argwhere(picture[..., 2] - picture[..., 0] > 60)
        assert len(blue) > 0.02 * 320 * 240
        assert np.abs(blue.mean(axis=0) / [240, 320] - 0.5).max() < 0.25
        # The edges are empty, but for the time and the axes at the bottom.
        assert (picture[:3] > 240).all()
        orange.append(np.count_nonzero((picture[..., 0] - picture[..., 2] > 120) & (picture[..., 1] > 120)))
    assert orange[-1] > orange[0] + 50
