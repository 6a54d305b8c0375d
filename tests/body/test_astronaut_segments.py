"""The astronaut's file against the table of segments it was made from, row by row and column by column."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np
import pytest

from support.places import ROBOTS

MASS, STATURE = 82.2, 1.799
"""Of the astronaut [kg, m]."""
STATURE_OF_THE_TABLE = 1.741
"""Of de Leva's men [m], whose lengths the table has."""
ROUNDING = 1e-4
"""The file has four digits of a metre; a place is the sum or difference of two of them."""
HIP_BREADTH = 0.093
"""Of the stature (Dumas, Cheze and Verriest 2007)."""
HEEL_BEHIND_THE_ANKLE = 0.05
"""At 1.741 m [m], an estimate of HeiMan."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """A segment of de Leva 1996, table 4, male.

    Attributes
    ----------
    part : of the mass of the body
    centre : of mass, from the first end point, in parts of the length
    radii : of gyration about front-back, left-right and longitudinal axes, in parts of the length
    length : [m] at 1.741 m
    """

    part: float
    centre: float
    radii: tuple[float, float, float]
    length: float

    @property
    def mass(self) -> float:
        return self.part * MASS

    @property
    def scaled(self) -> float:
        return self.length * STATURE / STATURE_OF_THE_TABLE

    @property
    def moments(self) -> np.ndarray:
        return self.mass * (np.array(self.radii) * self.scaled) ** 2


# J. Biomechanics 29, 1223-1230, table 4; lengths between joint centres: the shank's is 440.3 mm from knee to ankle, not
# the 434.0 mm from knee to malleolus, since its ratios are of the former.
TABLE = {
    "head": Row(part=0.0694, centre=0.5002, radii=(0.303, 0.315, 0.261), length=0.2429),
    "upper_trunk": Row(part=0.1596, centre=0.5066, radii=(0.505, 0.320, 0.465), length=0.2421),
    "middle_trunk": Row(part=0.1633, centre=0.4502, radii=(0.482, 0.383, 0.468), length=0.2155),
    "lower_trunk": Row(part=0.1117, centre=0.6115, radii=(0.615, 0.551, 0.587), length=0.1457),
    "upper_arm": Row(part=0.0271, centre=0.5772, radii=(0.285, 0.269, 0.158), length=0.2817),
    "forearm": Row(part=0.0162, centre=0.4574, radii=(0.276, 0.265, 0.121), length=0.2689),
    "hand": Row(part=0.0061, centre=0.7900, radii=(0.628, 0.513, 0.401), length=0.0862),
    "thigh": Row(part=0.1416, centre=0.4095, radii=(0.329, 0.329, 0.149), length=0.4222),
    "shank": Row(part=0.0433, centre=0.4395, radii=(0.251, 0.246, 0.102), length=0.4403),
    "foot": Row(part=0.0137, centre=0.4415, radii=(0.257, 0.245, 0.124), length=0.2581),
}
TRUNK = ("upper_trunk", "middle_trunk", "lower_trunk")
LIMBS = tuple(name for name in TABLE if name not in TRUNK and name != "head")
LINKS = [("head", "head"), *zip(TRUNK, TRUNK), *((f"{side}_{n}", n) for n in LIMBS for side in ("left", "right"))]
NEXT = {
    "lower_trunk": "lumbar_flexion",
    "middle_trunk": "thoracic_flexion",
    "upper_trunk": "neck_flexion",
    **{f"{side}_{a}": f"{side}_{b}" for side in ("left", "right") for a, b in
       (("upper_arm", "elbow"), ("forearm", "wrist"), ("thigh", "knee"), ("shank", "ankle"))},
}  # fmt: skip
"""The joint at the far end of a link."""

ROOT = ElementTree.parse(ROBOTS / "astronaut.urdf").getroot()


def numbers(element: ElementTree.Element | None, name: str = "xyz") -> np.ndarray:
    assert element is not None
    return np.array([float(word) for word in element.get(name, "0 0 0").split()])


def inertial(link: str) -> ElementTree.Element:
    found = ROOT.find(f"link[@name='{link}']/inertial")
    assert found is not None
    return found


def joint_place(joint: str) -> np.ndarray:
    return numbers(ROOT.find(f"joint[@name='{joint}']/origin"))


def test_the_table_is_one_whole_man():
    """Mass fractions of all segments add up to 1."""
    twice = sum(TABLE[name].part for name in LIMBS)
    assert sum(row.part for row in TABLE.values()) + twice == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(("link", "segment"), LINKS)
def test_mass(link, segment):
    assert numbers(inertial(link).find("mass"), "value")[0] == pytest.approx(TABLE[segment].mass, abs=1e-9)


@pytest.mark.parametrize(("link", "segment"), LINKS)
def test_moments(link, segment):
    """Five decimals; in the foot the longitudinal axis is x and the sagittal one z."""
    file = inertial(link).find("inertia")
    assert file is not None
    want = TABLE[segment].moments[::-1] if segment == "foot" else TABLE[segment].moments
    for name, moment in zip(("ixx", "iyy", "izz"), want, strict=True):
        assert float(file.get(name, "nan")) == pytest.approx(moment, abs=5.1e-6)
    assert all(float(file.get(name, "nan")) == 0.0 for name in ("ixy", "ixz", "iyz"))


@pytest.mark.parametrize(("link", "segment"), [pair for pair in LINKS if pair[0] in NEXT])
def test_length(link, segment):
    """The next joint is one length away, along the segment."""
    place = joint_place(NEXT[link])
    assert abs(place[2]) == pytest.approx(TABLE[segment].scaled, abs=0.51 * ROUNDING)
    assert np.all(place[:2] == 0.0)


@pytest.mark.parametrize(("link", "segment"), [pair for pair in LINKS if pair[1] != "foot"])
def test_centre_of_mass(link, segment):
    """Of the trunk from its upper end, of the head from the vertex, of limbs from the joint that carries them."""
    row = TABLE[segment]
    from_above = row.centre * row.scaled
    want = row.scaled - from_above if segment in (*TRUNK, "head") else -from_above
    np.testing.assert_allclose(numbers(inertial(link).find("origin")), [0.0, 0.0, want], atol=ROUNDING, rtol=0)


def sole(side: str) -> float:
    """The height of the sole in the frame of the ankle, as drawn."""
    visual = ROOT.find(f"link[@name='{side}_foot']/visual")
    assert visual is not None
    box = numbers(visual.find("geometry/box"), "size")
    return float(numbers(visual.find("origin"))[2] - 0.5 * box[2])


@pytest.mark.parametrize("side", ["left", "right"])
def test_foot(side):
    """The centre is measured from the heel, and lies midway between ankle and sole."""
    row = TABLE["foot"]
    centre = numbers(inertial(f"{side}_foot").find("origin"))
    heel = -HEEL_BEHIND_THE_ANKLE * STATURE / STATURE_OF_THE_TABLE
    np.testing.assert_allclose(centre, [heel + row.centre * row.scaled, 0.0, 0.5 * sole(side)], atol=ROUNDING, rtol=0)
    drawn = ROOT.find(f"link[@name='{side}_foot']/visual")
    assert drawn is not None
    box, middle = numbers(drawn.find("geometry/box"), "size"), numbers(drawn.find("origin"))
    assert box[0] == pytest.approx(row.scaled, abs=0.51 * ROUNDING)
    assert middle[0] - 0.5 * box[0] == pytest.approx(heel, abs=ROUNDING)


@pytest.mark.parametrize("side", ["left", "right"])
def test_he_stands_as_tall_as_he_is(side):
    """From the sole over ankle, knee, hip and the three joints of the trunk to the vertex."""
    legs = -(joint_place(f"{side}_knee")[2] + joint_place(f"{side}_ankle")[2] + sole(side))
    trunk = sum(joint_place(NEXT[part])[2] for part in TRUNK)
    # Half of the last digit for each of seven lengths.
    assert legs + trunk + TABLE["head"].scaled == pytest.approx(STATURE, abs=7 * 0.5 * ROUNDING)


def test_hips():
    for side, sign in (("left", 1.0), ("right", -1.0)):
        np.testing.assert_allclose(
            joint_place(f"{side}_hip_flexion"), [0.0, sign * 0.5 * HIP_BREADTH * STATURE, 0.0], atol=ROUNDING, rtol=0
        )
