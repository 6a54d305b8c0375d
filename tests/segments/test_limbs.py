"""Limbs are found in the bodies that ship and in files with other names; patterns choose groups of joints."""

import numpy as np
import pytest

import shapephase as sp
from shapephase.segments import joint_groups
from support.bodies import BODIES, joint, link, urdf

SMALL = (0.01, 0.012, 0.008)
ROBOT = urdf(
    link("torso", 20.0, (0.5, 0.6, 0.3)),
    *(link(f"{side}Thigh", 5.0, SMALL, (0.0, 0.0, -0.2)) for side in "lr"),
    *(link(f"{side}Shank", 3.0, SMALL, (0.0, 0.0, -0.2)) for side in "lr"),
    *(link(f"{side}UpperArm", 2.0, SMALL, (0.0, 0.0, -0.1)) for side in "lr"),
    link("skull", 4.0, SMALL, (0.0, 0.0, 0.1)),
    *(joint(f"{s}H", "revolute", "torso", f"{s}Thigh", (0, 1, 0), (0, y, -0.3)) for s, y in (("l", 0.1), ("r", -0.1))),
    *(joint(f"{s}K", "revolute", f"{s}Thigh", f"{s}Shank", (0, 1, 0), (0, 0, -0.4)) for s in "lr"),
    *(
        joint(f"{s}S", "revolute", "torso", f"{s}UpperArm", (1, 0, 0), (0, y, 0.3))
        for s, y in (("l", 0.2), ("r", -0.2))
    ),
    joint("nod", "revolute", "torso", "skull", (0, 1, 0), (0, 0, 0.4)),
)
# Three wings of a hub, with words of no language, two of them alike.
CRAFT = urdf(
    link("hub", 50.0, (5.0, 6.0, 7.0)),
    link("zin", 3.0, SMALL, (0.3, 0.0, 0.0)),
    link("zun", 3.0, SMALL, (-0.3, 0.0, 0.0)),
    link("mot", 8.0, SMALL, (0.0, 0.4, 0.0)),
    joint("a", "revolute", "hub", "zin", (1, 0, 0), (0.5, 0, 0)),
    joint("b", "revolute", "hub", "zun", (1, 0, 0), (-0.5, 0, 0)),
    joint("c", "prismatic", "hub", "mot", (0, 1, 0), (0, 0.5, 0)),
)
# A hand of three fingers: they are light, so that the arm stays one limb.
FINGERS = urdf(
    link("chest", 30.0, (1.0, 1.1, 0.6)),
    *(link(f"bras_{side}", 3.0, SMALL, (0.0, 0.0, -0.2)) for side in "dg"),
    link("palme", 0.5, SMALL),
    *(link(f"doigt_{k}", 0.02, (1e-6, 1e-6, 1e-6)) for k in range(3)),
    *(joint(f"epaule_{s}", "revolute", "chest", f"bras_{s}", (1, 0, 0), (0, y, 0)) for s, y in (("d", -1), ("g", 1))),
    joint("poignet", "revolute", "bras_d", "palme", (0, 1, 0), (0, 0, -0.4)),
    *(joint(f"phalange_{k}", "revolute", "palme", f"doigt_{k}", (0, 1, 0), (0.01 * k, 0, -0.1)) for k in range(3)),
)  # fmt: skip


def _loaded(tmp_path, text):
    file = tmp_path / "body.urdf"
    file.write_text(text)
    return sp.load_body(file)


@pytest.mark.parametrize("name", BODIES)
def test_every_coordinate_of_a_body_belongs_to_one_limb(name):
    body = sp.load_body(name)
    columns = sorted(column for own in joint_groups(body).columns.values() for column in own)
    assert columns == list(range(body.n_shape))


def test_limbs_of_bodies_that_ship():
    cat = joint_groups(sp.load_body("cat"))
    assert set(cat.joints) == {
        "front left leg", "front right leg", "rear left leg", "rear right leg", "head", "tail", "waist",
    }  # fmt: skip
    assert cat.joints["tail"] == ("tail_1", "tail_2", "tail_3")
    assert cat.pairs["rear legs"] == ("rear left leg", "rear right leg")
    astronaut = joint_groups(sp.load_body("astronaut"))
    assert set(astronaut.joints) == {"left arm", "right arm", "left leg", "right leg", "head", "trunk"}
    assert set(astronaut.pairs) == {"arms", "legs"}
    assert set(joint_groups(sp.load_body("satellite")).joints) == {"arm", "boom", "left wing", "right wing", "wheel"}


@pytest.mark.filterwarnings("ignore::shapephase.IgnoredElementWarning")
def test_pairs_without_words_for_sides_are_told_by_geometry():
    jumper = joint_groups(sp.load_body("robots/trampoline/Model_JeCh_15DoFs.bioMod"))
    assert jumper.pairs == {"arms": ("BrasD", "BrasG")}
    assert jumper.joints["Thorax"] == ("Thorax",)
    assert len(jumper.columns["Thorax"]) == 3


def test_one_limb_alone_gives_joints_or_coordinates():
    assert list(joint_groups(sp.load_body("cat_two_halves")).joints) == ["waist_pitch", "waist_yaw", "waist_roll"]


def test_limbs_of_a_robot_whose_names_begin_with_one_letter_for_the_side(tmp_path):
    groups = joint_groups(_loaded(tmp_path, ROBOT))
    assert groups.joints["left leg"] == ("lH", "lK")
    assert set(groups.joints) == {"left leg", "right leg", "left arm", "right arm", "head"}
    assert set(groups.pairs) == {"arms", "legs"}


def test_limbs_of_a_craft_without_known_words(tmp_path):
    groups = joint_groups(_loaded(tmp_path, CRAFT))
    assert groups.joints == {"zin": ("a",), "zun": ("b",), "mot": ("c",)}
    assert groups.pairs == {"zin and zun": ("zin", "zun")}


def test_fingers_fork_no_trunk(tmp_path):
    groups = joint_groups(_loaded(tmp_path, FINGERS))
    assert set(groups.joints) == {"bras_d", "bras_g"}
    assert groups.joints["bras_d"] == ("epaule_d", "poignet", "phalange_0", "phalange_1", "phalange_2")


def test_patterns_choose_joints_and_the_rest_is_named():
    cat = sp.load_body("cat")
    groups = joint_groups(cat, {"waist": ["waist_*"], "tail": "tail_?"})
    assert [len(groups.columns[name]) for name in ("waist", "tail")] == [3, 6]
    assert "neck_yaw" in groups.rest
    assert len(groups.rest) == 23 - 9
    chosen = [cat.joint_names[column] for column in groups.columns["waist"]]
    assert chosen == ["waist_pitch", "waist_yaw", "waist_roll"]


def test_a_joint_in_two_groups_and_an_unknown_one_are_refused():
    cat = sp.load_body("cat")
    with pytest.raises(sp.errors.ShapeError, match=r"waist_yaw is in two groups, a and b"):
        joint_groups(cat, {"a": "waist_*", "b": "*_yaw"})
    with pytest.raises(sp.errors.UnknownNameError, match=r"group a 'wrist_\*'"):
        joint_groups(cat, {"a": "wrist_*"})
    with pytest.raises(sp.errors.UnknownNameError, match="limbs, joints"):
        joint_groups(cat, "limb")


def test_a_ball_joint_is_one_of_a_group(tmp_path):
    file = tmp_path / "ball.urdf"
    file.write_text(
        urdf(
            link("torso", 20.0, (0.5, 0.6, 0.3)),
            *(link(f"{s}_arm", 3.0, SMALL, (0.0, 0.0, -0.2)) for s in ("left", "right")),
            *(
                joint(f"{s}_shoulder", "spherical", "torso", f"{s}_arm", xyz=(0, y, 0.3))
                for s, y in (("left", 0.2), ("right", -0.2))
            ),
        )
    )
    groups = joint_groups(sp.load_body(file), {"left": "left_*"})
    assert groups.joints["left"] == ("left_shoulder",)
    assert np.array_equal(groups.columns["left"], range(4))
    assert groups.rest == ("right_shoulder",)
