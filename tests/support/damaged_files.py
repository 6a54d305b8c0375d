"""Good body files with random damage to their structure, their numbers or their bytes; each seed is one file."""

from __future__ import annotations

import copy
import random
import re
import xml.etree.ElementTree as ElementTree

NASTY = (
    *("", " ", "--", "nan", "inf", "-1", "0", "1e400", "1e-320", "1e308", "1e5", "1e-9", "1,5", "1 2 3", "0x10"),
    *("x" * 300, "\u202e", "&", "${x}"),
    *("0 0 0", "base", "fixed", "revolute", "continuous", "prismatic", "floating", "universe", "root_joint"),
)
"""Words that are no number, numbers too large, too small or of the wrong sign, names that are none or mean something
elsewhere in a file."""


def mutated(text: bytes, seed: int) -> bytes:
    """A file with one to three random changes of its structure, numbers or bytes."""
    chance = random.Random(seed)
    if chance.random() < 0.15:
        return _mutated_bytes(text, chance)
    root = ElementTree.fromstring(text)
    for _ in range(chance.randint(1, 3)):
        _mutate_tree(root, chance)
    return ElementTree.tostring(root)


def _mutated_bytes(text: bytes, chance: random.Random) -> bytes:
    data = bytearray(text)
    for _ in range(chance.randint(1, 3)):
        at = chance.randrange(len(data))
        end = min(len(data), at + chance.randint(1, 40))
        kind = chance.randrange(5)
        if kind == 0:
            data[at] = chance.randrange(256)
        elif kind == 1:
            del data[at:end]
        elif kind == 2:
            data[at:at] = data[at:end]
        elif kind == 3:
            data[at:at] = chance.randbytes(chance.randint(1, 4))
        else:
            data[at:end] = bytes(reversed(data[at:end]))
    return bytes(data) or b"<"


def _mutate_tree(root: ElementTree.Element, chance: random.Random) -> None:
    elements = list(root.iter())
    parents = {child: parent for parent in elements for child in parent}
    element, other = chance.choice(elements), chance.choice(elements)
    kind = chance.randrange(12)
    if kind <= 5 and element.attrib:
        _mutate_attribute(element, other, chance)
    elif element is root or other is root:
        root.set("name", chance.choice(NASTY))
    elif kind == 6:
        parents[element].remove(element)
    elif kind == 7:
        parents[element].insert(chance.randrange(len(parents[element]) + 1), copy.deepcopy(element))
    elif kind == 8 and element not in set(other.iter()) and other not in set(element.iter()):
        parents[element].remove(element)
        other.append(element)
    elif kind == 9:
        element.tag = chance.choice([element.tag.upper(), element.tag + "s", other.tag, element.tag[1:] or "a"])
    elif kind == 10:
        siblings = list(parents[element])
        chance.shuffle(siblings)
        parents[element][:] = siblings
    else:
        for name in set(element.attrib) & set(other.attrib):
            element.attrib[name], other.attrib[name] = other.attrib[name], element.attrib[name]


def _mutate_attribute(element: ElementTree.Element, other: ElementTree.Element, chance: random.Random) -> None:
    name = chance.choice(sorted(element.attrib))
    words = element.attrib[name].split()
    kind = chance.randrange(6)
    if kind == 0:
        del element.attrib[name]
    elif kind == 1:
        element.attrib[name] = chance.choice(NASTY)
    elif kind == 2:
        element.attrib[chance.choice([name.upper(), name + "x", name[1:] or "a"])] = element.attrib.pop(name)
    elif kind == 3 and other.attrib:
        element.attrib[name] = chance.choice(sorted(other.attrib.values()))
    elif words and re.fullmatch(r"[-+.\deE]+", words[0]):
        place = chance.randrange(len(words))
        try:
            value = float(words[place])
        except ValueError:
            return
        words[place] = repr(
            chance.choice([-value, value * 10 ** chance.uniform(-12, 12), value + chance.gauss(0, 1), value * 1.0001])
        )
        element.attrib[name] = " ".join(words)
    else:
        element.attrib[name] = element.attrib[name][: chance.randrange(len(element.attrib[name]) + 1)]
