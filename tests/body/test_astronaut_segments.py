"""The astronauts' files against the tables of segments they were made from, row by row and column by column."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pytest

from support.places import ROBOTS

ROUNDING = 1e-4
"""The files have four digits of a metre; a place is the sum or difference of two of them."""
HIP_BREADTH = 0.093
"""Of the stature (Dumas, Cheze and Verriest 2007)."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """A segment of de Leva 1996, table 4."""

    part: float  # of the mass of the body
    centre: float  # of mass, from the first end point, in parts of the length
    radii: tuple[float, float, float]  # of gyration about front-back, left-right and longitudinal axes, likewise
    length: float  # of those who were measured [m]


@dataclass(frozen=True, kw_only=True)
class Person:
    """Whose file it is."""

    name: str  # of the file
    mass: float  # [kg]
    stature: float  # [m]
    measured: float  # stature of those who were measured [m]
    heel: float  # behind the ankle, at that stature [m]
    whole: float  # sum of the mass fractions as printed
    table: dict[str, Row]

    @cached_property
    def root(self) -> ElementTree.Element:
        return ElementTree.parse(ROBOTS / f"{self.name}.urdf").getroot()

    def length(self, segment: str) -> float:
        return self.table[segment].length * self.stature / self.measured

    def mass_of(self, segment: str) -> float:
        return self.table[segment].part * self.mass

    def moments(self, segment: str) -> np.ndarray:
        return self.mass_of(segment) * (np.array(self.table[segment].radii) * self.length(segment)) ** 2

    def inertial(self, link: str) -> ElementTree.Element:
        found = self.root.find(f"link[@name='{link}']/inertial")
        assert found is not None
        return found

    def joint_place(self, joint: str) -> np.ndarray:
        return numbers(self.root.find(f"joint[@name='{joint}']/origin"))

    def sole(self, side: str) -> float:
        """The height of the sole in the frame of the ankle, as drawn."""
        visual = self.root.find(f"link[@name='{side}_foot']/visual")
        assert visual is not None
        box = numbers(visual.find("geometry/box"), "size")
        return float(numbers(visual.find("origin"))[2] - 0.5 * box[2])


# J. Biomechanics 29, 1223-1230, table 4; lengths between joint centres: the shank's is that from knee to ankle, not the
# shorter one from knee to malleolus, since its ratios are of the former.
MAN = Person(
    name="astronaut",
    mass=82.2,
    stature=1.799,
    measured=1.741,
    heel=0.05,
    whole=1.0,
    table={
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
    },
)
WOMAN = Person(
    name="astronaut_female",
    mass=61.9,
    stature=1.735,
    measured=1.735,
    heel=0.05 * 0.2283 / 0.2581,
    whole=0.9999,
    table={
        "head": Row(part=0.0668, centre=0.4841, radii=(0.271, 0.295, 0.261), length=0.2437),
        "upper_trunk": Row(part=0.1545, centre=0.5050, radii=(0.466, 0.314, 0.449), length=0.2280),
        "middle_trunk": Row(part=0.1465, centre=0.4512, radii=(0.433, 0.354, 0.415), length=0.2053),
        "lower_trunk": Row(part=0.1247, centre=0.4920, radii=(0.433, 0.402, 0.444), length=0.1815),
        "upper_arm": Row(part=0.0255, centre=0.5754, radii=(0.278, 0.260, 0.148), length=0.2751),
        "forearm": Row(part=0.0138, centre=0.4559, radii=(0.261, 0.257, 0.094), length=0.2643),
        "hand": Row(part=0.0056, centre=0.7474, radii=(0.531, 0.454, 0.335), length=0.0780),
        "thigh": Row(part=0.1478, centre=0.3612, radii=(0.369, 0.364, 0.162), length=0.3685),
        "shank": Row(part=0.0481, centre=0.4352, radii=(0.267, 0.263, 0.092), length=0.4386),
        "foot": Row(part=0.0129, centre=0.4014, radii=(0.299, 0.279, 0.139), length=0.2283),
    },
)
# Other end points of the same segments, whose ratios the table has, too: centre of mass and length [m] from the same
# end (shank, knee to malleolus; hand, wrist to fingertip), or by the distance of the two first ends.
OTHER_END_POINTS = {
    ("astronaut", "shank"): (0.4459, 0.4340),
    ("astronaut_female", "shank"): (0.4416, 0.4323),
    ("astronaut_female", "hand"): (0.3427, 0.1701),
    ("astronaut_female", "head"): (0.5894, 0.2002),
}
TRUNK = ("upper_trunk", "middle_trunk", "lower_trunk")
LIMBS = tuple(name for name in MAN.table if name not in TRUNK and name != "head")
LINKS = [("head", "head"), *zip(TRUNK, TRUNK), *((f"{side}_{n}", n) for n in LIMBS for side in ("left", "right"))]
NEXT = {
    "lower_trunk": "lumbar_flexion",
    "middle_trunk": "thoracic_flexion",
    "upper_trunk": "neck_flexion",
    **{f"{side}_{a}": f"{side}_{b}" for side in ("left", "right") for a, b in
       (("upper_arm", "elbow"), ("forearm", "wrist"), ("thigh", "knee"), ("shank", "ankle"))},
}  # fmt: skip
"""The joint at the far end of a link."""

people = pytest.mark.parametrize("person", [MAN, WOMAN], ids=lambda person: person.name)


def numbers(element: ElementTree.Element | None, name: str = "xyz") -> np.ndarray:
    assert element is not None
    return np.array([float(word) for word in element.get(name, "0 0 0").split()])


def tensor(inertial: ElementTree.Element) -> np.ndarray:
    """(3, 3) about the centre of mass."""
    found = inertial.find("inertia")
    assert found is not None
    xx, xy, xz, yy, yz, zz = (float(found.get(name, "nan")) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@people
def test_the_table_is_one_whole_person(person):
    """Mass fractions of all segments add up to 1, but for the rounding of those of women."""
    twice = sum(person.table[name].part for name in LIMBS)
    assert sum(row.part for row in person.table.values()) + twice == pytest.approx(person.whole, abs=1e-12)


@pytest.mark.parametrize(("key", "other"), OTHER_END_POINTS.items(), ids=str)
def test_the_centres_of_mass_are_where_other_end_points_put_them(key, other):
    """The table gives several segments twice, from other end points: lengths and ratios check each other."""
    person = {each.name: each for each in (MAN, WOMAN)}[key[0]]
    row = person.table[key[1]]
    # Of ratios half of the last digit, and of both lengths.
    assert row.centre * row.length == pytest.approx(other[0] * other[1], abs=1.5e-4)


@people
@pytest.mark.parametrize(("link", "segment"), LINKS)
def test_mass(person, link, segment):
    assert numbers(person.inertial(link).find("mass"), "value")[0] == pytest.approx(person.mass_of(segment), abs=1e-9)


@people
@pytest.mark.parametrize(("link", "segment"), LINKS)
def test_moments(person, link, segment):
    """Five decimals; in the foot the longitudinal axis is x and the sagittal one z."""
    found, want = tensor(person.inertial(link)), person.moments(segment)
    np.testing.assert_allclose(np.diag(found), want[::-1] if segment == "foot" else want, rtol=0, atol=5.1e-6)
    assert np.all(found == np.diag(np.diag(found)))


@people
@pytest.mark.parametrize(("link", "segment"), [pair for pair in LINKS if pair[0] in NEXT])
def test_length(person, link, segment):
    """The next joint is one length away, along the segment."""
    place = person.joint_place(NEXT[link])
    assert abs(place[2]) == pytest.approx(person.length(segment), abs=0.51 * ROUNDING)
    assert np.all(place[:2] == 0.0)


@people
@pytest.mark.parametrize(("link", "segment"), [pair for pair in LINKS if pair[1] != "foot"])
def test_centre_of_mass(person, link, segment):
    """Of the trunk from its upper end, of the head from the vertex, of limbs from the joint that carries them."""
    from_above = person.table[segment].centre * person.length(segment)
    want = person.length(segment) - from_above if segment in (*TRUNK, "head") else -from_above
    found = numbers(person.inertial(link).find("origin"))
    np.testing.assert_allclose(found, [0.0, 0.0, want], atol=ROUNDING, rtol=0)


@people
@pytest.mark.parametrize("side", ["left", "right"])
def test_foot(person, side):
    """The centre is measured from the heel, and lies midway between ankle and sole."""
    centre, length = numbers(person.inertial(f"{side}_foot").find("origin")), person.length("foot")
    heel = -person.heel * person.stature / person.measured
    forward = heel + person.table["foot"].centre * length
    np.testing.assert_allclose(centre, [forward, 0.0, 0.5 * person.sole(side)], atol=ROUNDING, rtol=0)
    drawn = person.root.find(f"link[@name='{side}_foot']/visual")
    assert drawn is not None
    box, middle = numbers(drawn.find("geometry/box"), "size"), numbers(drawn.find("origin"))
    assert box[0] == pytest.approx(length, abs=0.51 * ROUNDING)
    assert middle[0] - 0.5 * box[0] == pytest.approx(heel, abs=ROUNDING)


@people
@pytest.mark.parametrize("side", ["left", "right"])
def test_each_stands_as_tall_as_they_are(person, side):
    """From the sole over ankle, knee, hip and the three joints of the trunk to the vertex."""
    legs = -(person.joint_place(f"{side}_knee")[2] + person.joint_place(f"{side}_ankle")[2] + person.sole(side))
    trunk = sum(person.joint_place(NEXT[part])[2] for part in TRUNK)
    # Half of the last digit for each of seven lengths.
    assert legs + trunk + person.length("head") == pytest.approx(person.stature, abs=7 * 0.5 * ROUNDING)


@people
def test_hips(person):
    for side, sign in (("left", 1.0), ("right", -1.0)):
        place, half = person.joint_place(f"{side}_hip_flexion"), 0.5 * HIP_BREADTH * person.stature
        np.testing.assert_allclose(place, [0.0, sign * half, 0.0], atol=ROUNDING, rtol=0)


def shell(mass: float, radius: float, length: float) -> np.ndarray:
    """A thin open cylinder along z."""
    along = mass * radius**2
    across = mass * (radius**2 / 2.0 + length**2 / 12.0)
    return np.diag([across, across, along])


def box(mass: float, *edges: float) -> np.ndarray:
    squares = np.square(edges)
    return mass / 12.0 * np.diag(squares.sum() - squares)


# As the file says: mass [kg], centre in the link's frame [m], inertia about it [kg m^2].
SUIT = {
    "upper_trunk": [
        (62.0, (-0.25, 0.0, 0.05), box(62.0, 0.18, 0.58, 0.81)),
        (22.0, (0.0, 0.0, 0.10), shell(22.0, 0.21, 0.45)),
        (7.0, (0.02, 0.0, 0.40), 7.0 * 0.17**2 * 2.0 / 3.0 * np.eye(3)),
    ],
    "lower_trunk": [(8.0, (0.0, 0.0, 0.075), shell(8.0, 0.19, 0.15))],
    "upper_arm": [(2.4, (0.0, 0.0, -0.1456), shell(2.4, 0.08, 0.2911))],
    "forearm": [(1.8, (0.0, 0.0, -0.139), shell(1.8, 0.065, 0.2779))],
    "hand": [(1.0, (0.0, 0.0, -0.08), shell(1.0, 0.055, 0.18))],
    "thigh": [(3.2, (0.0, 0.0, -0.2182), shell(3.2, 0.11, 0.4363))],
    "shank": [(2.6, (0.0, 0.0, -0.2275), shell(2.6, 0.09, 0.455))],
    "foot": [(1.85, (0.066, 0.0, -0.02), box(1.85, 0.32, 0.13, 0.12))],
}
SUITED = replace(MAN, name="astronaut_suited")
POUND = 0.45359237
"""[kg]"""


@pytest.mark.parametrize(("link", "segment"), LINKS)
def test_the_suited_astronaut_is_the_man_and_the_parts_of_the_suit(link, segment):
    """Mass, centre and inertia of each link are those of its parts together, by the parallel-axis theorem."""
    own = MAN.inertial(link)
    parts = [(float(numbers(own.find("mass"), "value")[0]), numbers(own.find("origin")), tensor(own))]
    parts += [(mass, np.array(centre), about) for mass, centre, about in SUIT.get(segment, [])]
    mass = sum(part[0] for part in parts)
    centre = sum(part[0] * part[1] for part in parts) / mass
    away = [part[1] - centre for part in parts]
    about = sum(part[2] + part[0] * (d @ d * np.eye(3) - np.outer(d, d)) for part, d in zip(parts, away, strict=True))
    found = SUITED.inertial(link)
    assert numbers(found.find("mass"), "value")[0] == pytest.approx(mass, abs=1e-9)
    np.testing.assert_allclose(numbers(found.find("origin")), centre, rtol=0, atol=0.51e-6)
    np.testing.assert_allclose(tensor(found), about, rtol=0, atol=0.51e-6)


def test_the_suit_is_as_heavy_as_its_maker_says_and_moves_at_the_same_joints():
    """250 to 275 lb in flight configuration; joints, places and limits are the man's."""
    pairs = ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")
    total = sum((2.0 if name in pairs else 1.0) * sum(part[0] for part in parts) for name, parts in SUIT.items())
    assert total == pytest.approx(275.0 * POUND, abs=0.05)
    assert joints(MAN) == joints(SUITED)


def joints(person: Person) -> dict[str | None, list[tuple[str, dict[str, str]]]]:
    """All but how fast and how strong they are."""
    return {
        joint.get("name"): [
            (part.tag, {name: value for name, value in part.attrib.items() if name not in ("effort", "velocity")})
            for part in joint
        ]
        for joint in person.root.findall("joint")
    }
