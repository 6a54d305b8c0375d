"""Mass, inertia and momentum from the file's numbers alone, and bodies that differ from their file."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import shapephase as sp
from shapephase.body import Coupling, example_file, loading
from shapephase.body._cross_check import check_against_file, inertia_and_momentum
from shapephase.body.formats.urdf import urdf_tree
from shapephase.body.formats.xml_text import xml_tree
from shapephase.body.link_tree import LinkTree
from shapephase.errors import ModelFileError, ShapePhaseError
from support.bodies import EVERY_BODY, joint, link, random_shapes, urdf
from support.independent import turn, urdf_file
from support.urdf_links import UrdfLinks

EXAMPLES = Path(example_file("human")).parents[3] / "robots"
FILES = sorted(EXAMPLES.rglob("*.urdf"))
# A fragment without links, and one whose followers' leaders do not exist.
NO_BODIES = {"ur3.urdf": "no links", "alex_psyonic_hands.urdf": "mimics joint 'index_q1', which does not exist"}
WITH_FAULTS = {"tiago.urdf", "tiago_dual.urdf", "tiago_no_hand.urdf", "romeo_laas_small.urdf"}


class CheckedLinks(UrdfLinks):
    """The links of a URDF, and those among them that must be warned about."""

    def doubtful(self):
        """The links that must be warned about, by kind."""
        found = {name: (*values, np.linalg.eigvalsh(values[2])) for name, values in self.links.items()}
        floor = 1e-12 * max(moments[2] + mass * centre @ centre for mass, centre, _, moments in found.values())
        negative, triangle, units = [], [], []
        for name, (mass, _, _, (small, middle, large)) in found.items():
            if small < -floor - 1e-9 * max(large, 0.0):
                negative.append(name)
            elif large - middle - small > 1e-3 * large + floor:
                triangle.append(name)
            if mass > 1e5 or (mass > 0.0 and large > floor and not 1e-4 <= np.sqrt(large / mass) <= 10.0):
                units.append(name)
        massless = [
            j["child"]
            for j in self.joints
            if j["kind"] != "fixed" and not any(found[name][0] for name in self.hanging(j["child"]))
        ]
        hollow = [name for name, (mass, _, _, moments) in found.items() if mass == 0.0 and moments[2] > floor]
        return {
            "negative": negative,
            "triangle": triangle,
            "units": units,
            "but without mass": massless,
            "moments of inertia without mass": hollow,
        }

    def hanging(self, link):
        return [link, *(name for j in self.joints if j["parent"] == link for name in self.hanging(j["child"]))]


def named(message):
    return sorted(re.findall(r"link '([^']*)'", message))


def test_all_of_example_robot_data_is_here():
    assert len(FILES) == 69
    assert {path.name for path in FILES} >= set(NO_BODIES)


@pytest.mark.parametrize("path", [path for path in FILES if path.name not in NO_BODIES], ids=lambda path: path.stem)
def test_every_robot_is_what_its_file_says(path):
    """Mass, I and L_o to 1e-12, and warnings that name exactly the links that a look at the XML finds."""
    truth = CheckedLinks(path)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        body = sp.load_body(path, on_unphysical="warn")
    random = np.random.default_rng(len(path.name))
    shape, rate = random.uniform(-1.5, 1.5, (2, body.n_shape))
    both = [dict(zip(body.joint_names, values, strict=True)) for values in (shape, rate)]
    _, inertia, momentum, _ = truth.totals(*both)
    assert body.mass == pytest.approx(truth.masses().sum(), rel=1e-12)
    np.testing.assert_allclose(body.locked_inertia(shape), inertia, rtol=0, atol=1e-12 * np.abs(inertia).max())
    size = np.abs(inertia).max() * np.linalg.norm(rate)
    np.testing.assert_allclose(body.internal_momentum(shape, rate), momentum, rtol=0, atol=1e-12 * size)
    assert set(body.link_names) == set(truth.links)
    said = [str(warning.message) for warning in caught if warning.category is sp.UnphysicalInertiaWarning]
    expected = {kind: sorted(names) for kind, names in truth.doubtful().items() if names}
    assert len(said) == len(expected)
    for kind, names in expected.items():
        (message,) = [message for message in said if kind in message]
        assert named(message) == names
        assert re.match(rf"{re.escape(str(path))}:\d+: link ", message)
    assert ("negative" in expected) == (path.name in WITH_FAULTS)
    if path.name in WITH_FAULTS:
        with pytest.raises(sp.errors.UnphysicalInertiaError) as refused:
            sp.load_body(path)
        assert named(str(refused.value)) == expected["negative"]


@pytest.mark.parametrize("path", [path for path in FILES if path.name in NO_BODIES], ids=lambda path: path.stem)
def test_the_two_that_are_no_bodies_say_why(path):
    with pytest.raises(ModelFileError, match=rf":\d+: .*{NO_BODIES[path.name]}"):
        sp.load_body(path)


# ---- The check itself -----------------------------------------------------------------------------------------------


def tree_of(name) -> LinkTree:
    path = urdf_file(name)
    return urdf_tree(xml_tree(path.read_bytes(), str(path)))


@pytest.mark.parametrize("name", EVERY_BODY)
def test_the_library_s_own_numbers_are_those_of_the_definitions(name, rng):
    body, tree, truth = sp.load_body(name), tree_of(name), CheckedLinks(urdf_file(name))
    for shape in random_shapes(body, rng, 3):
        both = [dict(zip(body.joint_names, values, strict=True)) for values in (shape, rng.normal(size=body.n_shape))]
        _, inertia, momentum, _ = truth.totals(*both)
        found = inertia_and_momentum(tree, *both)
        np.testing.assert_allclose(found[0], inertia, rtol=0, atol=1e-13 * np.abs(inertia).max())
        np.testing.assert_allclose(
            found[1], momentum, rtol=0, atol=1e-13 * np.abs(inertia).max() * np.linalg.norm([*both[1].values()])
        )


def changed(tree, **changes):
    """One joint or link of a tree another than in the body."""
    if "link" in changes:
        name = changes.pop("link")
        return replace(tree, links={**tree.links, name: replace(tree.links[name], **changes)})
    name = changes.pop("joint")
    return replace(tree, joints=tuple(replace(j, **changes) if j.name == name else j for j in tree.joints))


SLIGHT = 1.0 + 1e-9
CAT_LINK, CAT_JOINT = "head", "neck_pitch"


def test_a_body_that_differs_from_its_file_in_anything_is_refused():
    """By a billionth, wherever a parser could go wrong."""
    body, tree = sp.load_body("cat"), tree_of("cat")
    check_against_file(body, tree, "cat.urdf")
    joint_names = [j.name for j in tree.joints if j.kind != "fixed"]
    one = next(j for j in tree.joints if j.name == joint_names[5])
    head = tree.links[one.child] if tree.links[one.child].mass else max(tree.links.values(), key=lambda each: each.mass)
    small = turn([1.0, 2.0, 3.0], 1e-9)
    differing = [
        changed(tree, link=head.name, mass=head.mass * SLIGHT),
        changed(tree, link=head.name, centre=head.centre + 1e-9),
        changed(tree, link=head.name, inertia=head.inertia * (1.0 + 1e-7)),
        changed(tree, joint=one.name, turn=one.turn @ small),
        changed(tree, joint=one.name, place=one.place + 1e-9),
        changed(tree, joint=one.name, axis=small @ one.axis),
        changed(tree, joint=one.name, axis=-one.axis),
        changed(tree, joint=one.name, after=one.after + 1e-9),
        changed(tree, joint=one.name, kind="prismatic"),
        changed(tree, joint=one.name, kind="fixed"),
        changed(tree, joint=one.name, name="another"),
        replace(tree, links={**tree.links, "lost": replace(head, name="lost", mass=0.0)}),
        replace(tree, couplings={joint_names[0]: Coupling.linear(joint_names[1], 1.0)}),
    ]
    for other in differing:
        with pytest.raises(ModelFileError, match=r"cat\.urdf"):
            check_against_file(body, other, "cat.urdf")


def test_nan_never_passes():
    body, tree = sp.load_body("cat"), tree_of("cat")
    head = max(tree.links.values(), key=lambda each: each.mass)
    spoilt = changed(tree, link=head.name, inertia=np.full((3, 3), np.nan))
    with np.errstate(invalid="ignore"), pytest.raises(ModelFileError, match="inertia"):
        check_against_file(body, spoilt, "cat.urdf")


def test_rounding_far_from_the_root_is_no_difference(load_urdf):
    """A kilometre away the moments of a small body lose digits in any sum."""
    far = urdf(
        link("base", 1.0, [1e-3, 1e-3, 1e-3], (5e3, 0, 0)),
        link("arm", 1.0, [1e-3, 1e-3, 1e-3], (0.1, 0, 0)),
        joint("hip", "revolute", "base", "arm", (0, 0, 1), (5e3, 0, 0)),
    )
    assert load_urdf(far).mass == 2.0


def test_what_pinocchio_loses_without_a_word_is_seen(load_urdf, monkeypatch):
    """Were the sanitised text wrong, the check would stand between it and the user."""
    text = urdf(
        link("base", 3.0, [0.3, 0.5, 0.6]),
        link("arm", 1.0, [0.02, 0.03, 0.04], (0.2, 0.1, 0.0)),
        joint("hip", "revolute", "base", "arm", (0, 1, 0)),
    )
    load_urdf(text)
    for old, new in (
        ('mass value="1.0"', 'mass value="1.0kg"'),
        ('izz="0.04"', ""),
        ('xyz="0.2', 'xyz="2'),
        ("hip", "hop"),
    ):

        def spoiling(root, free, old=old, new=new):
            tree = urdf_tree(root, free)
            assert old in tree.text
            return replace(tree, text=tree.text.replace(old, new))

        monkeypatch.setattr(loading, "urdf_tree", spoiling)
        with pytest.raises(ShapePhaseError, match=r"body\.urdf"):
            load_urdf(text)


def test_the_mass_of_a_rigid_body_is_compared_too(load_urdf):
    """Neither inertia nor momentum depends on it."""
    text = urdf(link("only", 2.0, [1.0, 2.0, 2.5]))
    tree = urdf_tree(xml_tree(text.encode(), "body.urdf"))
    with pytest.raises(ModelFileError, match="mass"):
        check_against_file(load_urdf(text), changed(tree, link="only", mass=2.0 * SLIGHT), "body.urdf")
