"""Closest approaches of links against closed forms and dense samples, and `shapephase check --clearance`."""

from __future__ import annotations

import json

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from support.bodies import joint, link, urdf


def with_ball(name, radius=0.1, place=(0.0, 0.0, 0.0)):
    xyz = " ".join(map(str, place))
    shape = f'<collision><origin xyz="{xyz}"/><geometry><sphere radius="{radius}"/></geometry></collision>'
    return link(name, 1.0, [0.01, 0.02, 0.02]).replace("</link>", f"{shape}</link>")


@pytest.fixture
def scissors(load_urdf):
    """Two arms that turn about z in one point of a base without a shape, at rest 1 rad apart: their balls are a chord
    of the angle between them apart."""
    arms = [with_ball(name, place=(1.0, 0.0, 0.0)) for name in ("left", "right")]
    hinges = [
        joint(f"to_{name}", "continuous", "base", name, rpy=(0, 0, at)) for name, at in (("left", 0.0), ("right", 1.0))
    ]
    return load_urdf(urdf(link("base", 1.0, [0.1, 0.1, 0.1]), *arms, *hinges))


def dense(body, path, geometry, count=601):
    times = np.linspace(0.0, path.duration, count)
    distances = sp.body.link_distances(body, path.shape(times), geometry=geometry).distance
    return dict(zip(geometry.pairs, distances.min(axis=0), strict=True))


def test_the_closest_approach_of_two_arms(scissors):
    """The angle between them is 2.5 - t (3 - t), least at 1.5: the chord is 2 sin(angle / 2)."""
    path = sp.ShapePath.function(
        lambda t: (
            np.stack([np.zeros_like(t), 1.5 - t * (3.0 - t)], axis=-1),
            np.stack([np.zeros_like(t), 2.0 * t - 3.0], axis=-1),
        ),
        3.0,
        joint_names=scissors.joint_names,
    )
    (approach,) = sp.clearance(scissors, path).approaches
    assert approach.links == ("left", "right")
    assert approach.time == pytest.approx(1.5, abs=1e-4)
    assert approach.distance == pytest.approx(2.0 * np.sin(0.125) - 0.2, abs=1e-9)
    assert sp.clearance(scissors, path, below=0.0494).approaches == (approach,)[:0]
    assert len(sp.clearance(scissors, path, below=0.0496).approaches) == 1


@pytest.mark.parametrize("at", [0.2113, 0.7])
def test_a_flick_between_samples_is_not_missed(scissors, at):
    """For a thousandth of the time the arms are together; everything before and after is at rest."""
    times = [0.0, at, at + 5e-4, at + 1e-3, 1.0]
    path = sp.ShapePath.waypoints(times, [[0.0, 1.0], [0.0, 1.0], [0.0, -0.7], [0.0, 1.0], [0.0, 1.0]])
    (approach,) = sp.clearance(scissors, path, below=0.5).approaches
    assert approach.time == pytest.approx(at + 5e-4, abs=1e-7)
    assert approach.distance == pytest.approx(2.0 * np.sin(0.15) - 0.2, abs=1e-9)


@pytest.fixture
def crane(load_urdf):
    """A ball on a rail that turns about z, and a ball of the base 2 m along y."""
    links = [with_ball("base", place=(0.0, 2.0, 0.0)), link("arm", 1.0, [0.1, 0.1, 0.1]), with_ball("car")]
    hinge, rail = joint("hinge", "continuous", "base", "arm"), joint("rail", "prismatic", "arm", "car", (1, 0, 0))
    return load_urdf(urdf(*links, hinge, rail))


def test_a_path_may_come_nearest_at_its_end(crane):
    path = sp.ShapePath.spline(np.linspace(0.0, 1.0, 9), np.outer(np.linspace(0.0, 1.0, 9), [1.4, 2.0]))
    (approach,) = sp.clearance(crane, path).approaches
    end = 2.0 * np.array([np.cos(1.4), np.sin(1.4)])
    assert approach.time == 1.0
    assert approach.distance == pytest.approx(np.linalg.norm(end - [0.0, 2.0]) - 0.2, abs=1e-9)


def test_the_reach_of_a_link_grows_with_its_slide(crane):
    """Far out on the rail small turns are fast; a pair a millimetre below the distance is listed."""
    swing = 0.4 * np.array([np.cos(0.26 * np.pi), np.sin(0.26 * np.pi)])
    path = sp.ShapePath.fourier([1.0, 5.0], [[swing[0]], [0.0]], [[swing[1]], [0.0]], duration=1.0)
    least = np.linalg.norm(5.0 * np.array([np.cos(1.4), np.sin(1.4)]) - [0.0, 2.0]) - 0.2
    assert sp.clearance(crane, path, below=least - 1e-3).approaches == ()
    (approach,) = sp.clearance(crane, path, below=least + 1e-3).approaches
    assert approach.time == pytest.approx(0.13, abs=1e-6)
    assert approach.distance == pytest.approx(least, abs=1e-9)


@pytest.mark.parametrize("name", ["cat", "satellite"])
def test_nothing_that_dense_samples_show_is_missed(name, rng):
    body = sp.load_body(name)
    shapes = rng.uniform(-0.8, 0.8, (6, body.n_shape))
    path = sp.ShapePath.spline(np.linspace(0.0, 2.0, 6), shapes, joint_names=body.joint_names)
    result = sp.clearance(body, path, below=0.03)
    expected = {pair: least for pair, least in dense(body, path, result.geometry).items() if least < 0.03}
    assert expected
    listed = {approach.links: approach for approach in result.approaches}
    assert set(listed) >= set(expected)
    for pair, approach in listed.items():
        exact = sp.body.link_distances(body, path.shape(approach.time), geometry=result.geometry).distance
        assert approach.distance == pytest.approx(exact[result.geometry.pairs.index(pair)], abs=1e-9)
        assert approach.distance < expected.get(pair, 0.03) + 1e-6
    assert [a.distance for a in result.approaches] == sorted(a.distance for a in result.approaches)


def test_all_loops_of_a_path_are_one(scissors):
    path = sp.ShapePath.fourier([0.0, 0.5], [[0.0], [0.9]], [[0.0], [0.0]], duration=1.0)
    once, often = sp.clearance(scissors, path), sp.clearance(scissors, path.repeated(3))
    assert often.approaches[0].distance == pytest.approx(once.approaches[0].distance, abs=1e-12)
    assert once.approaches[0].distance == pytest.approx(2.0 * np.sin(0.3) - 0.2, abs=1e-9)


def test_wrong_distances_are_refused(scissors):
    path = sp.ShapePath.waypoints([0.0, 1.0], [[0.0, 2.0], [0.0, 1.0]])
    for below in (np.nan, "2cm"):
        with pytest.raises(sp.errors.ShapeError, match="below: a distance in m is needed"):
            sp.clearance(scissors, path, below=below)


def test_check_lists_the_pairs_that_come_too_close(capsys, tmp_path):
    with pytest.raises(SystemExit) as ended:
        main(["check", "cat", "cat_righting", "--clearance", "0cm", "--json"])
    assert ended.value.code == 4
    data = json.loads(capsys.readouterr().out)["motion"]["clearance"]
    assert (data["below_m"], data["pairs_compared"], len(data["left_out"])) == (0.0, 78, 13)
    nearest = data["closer"][0]
    # Both sides come as near, and rounding says which is first.
    assert {name.replace("left", "right") for name in nearest["links"]} == {
        "front_right_upper_leg",
        "rear_right_upper_leg",
    }
    path = sp.read_shape_path(sp.body.robots_folder() / "cat_righting.csv", sp.load_body("cat"))
    geometry = sp.body.collision_geometry(sp.load_body("cat"))
    assert nearest["distance_m"] == pytest.approx(
        dense(sp.load_body("cat"), path, geometry)[tuple(nearest["links"])], abs=1e-6
    )
    srdf = tmp_path / "a.srdf"
    pairs = "".join(f'<disable_collisions link1="{a}" link2="{b}"/>' for a, b in (c["links"] for c in data["closer"]))
    srdf.write_text(f"<robot>{pairs}</robot>")
    main(["check", "cat", "cat_righting", "--clearance", "0", "--srdf", str(srdf)])
    text = capsys.readouterr().out
    assert "0 of 64 pairs of links come closer than 0 m\n" in text
    assert "13 adjacent, 14 SRDF" in text
    with pytest.raises(SystemExit):
        main(["check", "cat", "--clearance", "0.02"])
    assert "--clearance: a motion is needed" in capsys.readouterr().err
