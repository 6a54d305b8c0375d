"""What the grammars are made of: one input, odd numbers and names, and damage to bytes.

Everything is drawn from a `random.Random`, which Hypothesis can stand in for. The last choice of a draw is the odd one,
so that Hypothesis, which shrinks towards the first, takes faults away.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any

BODY = """<robot name="small">
  <link name="base"><inertial><mass value="3.0"/>
    <inertia ixx="0.3" ixy="0" ixz="0" iyy="0.5" iyz="0" izz="0.6"/></inertial></link>
  <link name="arm"><inertial><origin xyz="0.2 0.1 0.0" rpy="0.1 0.2 0.3"/><mass value="1.0"/>
    <inertia ixx="0.02" ixy="0.0" ixz="0.0" iyy="0.03" iyz="0.0" izz="0.04"/></inertial></link>
  <link name="hand"><inertial><mass value="0.5"/>
    <inertia ixx="0.002" ixy="0.0" ixz="0.0" iyy="0.003" iyz="0.0" izz="0.004"/></inertial></link>
  <link name="sled"><inertial><mass value="0.25"/>
    <inertia ixx="0.001" ixy="0.0" ixz="0.0" iyy="0.001" iyz="0.0" izz="0.001"/></inertial></link>
  <joint name="hip" type="revolute"><parent link="base"/><child link="arm"/>
    <origin xyz="0.3 0.0 0.1" rpy="0.5 0.0 0.0"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="1" velocity="1"/></joint>
  <joint name="wrist" type="continuous"><parent link="arm"/><child link="hand"/>
    <origin xyz="0.4 0.0 0.0"/><axis xyz="1 0 1"/></joint>
  <joint name="boom" type="prismatic"><parent link="base"/><child link="sled"/><axis xyz="0 0 1"/>
    <limit lower="-0.5" upper="0.5" effort="1" velocity="1"/></joint>
</robot>
"""
"""The body whose motions are read."""
JOINTS = ("hip", "wrist", "boom")
"""Its joints: one with limits, one without, one that slides."""
ODD_NUMBERS = (
    *("nan", "inf", "-Infinity", "1e400", "-1e400", "1e-320", "4.9e-324", "1e-400", "1e308", "-1e308", "1e16", "1e7"),
    *("", " ", "-", "+", ".", "e", "1e", "1e+", "--1", "+-1", "1 2", "1_0", "0x10", "0b1", "1,5", "1,234", "1.5.5"),
    *("٣", "１", "−1", "1\u00a0", "½", "true", "None", "null", "~", "#N/A", "=1/0", "'1'", '"1"', "1d0", "1f", "1%"),
    *("1j", "(1)", "$1", "1e6", "1000001", "-0", "-0.0", "+.5", "5.", "00012", "9007199254740993", "9" * 400),
    *("1" + "0" * 5000, "0." + "1" * 5000, "1e99999999999999999999", "1:30", "2020-01-01", "\x00", "\x1f", "\u2028"),
)
"""What stands where a number is meant."""
ODD_NAMES = (
    *(
        "",
        " ",
        "hip",
        "Hip",
        "hip ",
        "time",
        "Time",
        "t",
        "qx",
        "base_qx",
        "base_x_m",
        "hip_deg",
        "hip [deg]",
        "hip (m)",
    ),
    *(
        "hip [furlong]",
        "hip°",
        "boom [mm]",
        "boom [deg]",
        "wrist_rad",
        "hip [",
        "[deg]",
        "hip\n",
        "hip,",
        'h"ip',
        "\ufeff",
    ),
    *(
        "universe",
        "root_joint",
        "world",
        "\u202e",
        "é",
        "e\u0301",
        "x" * 300,
        "x" * 70_000,
        "<b>",
        "&amp;",
        "${x}",
        "\x00",
    ),
    *("$x_$", "../..", "#", "=", "null", "1", "nan", "\u2028", "hip/value", "/jointset/a/hip/value", "a/b/speed"),
)
"""What stands where a name is meant."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Trial:
    """One input.

    Attributes
    ----------
    kind : what is done with it: "body", "motion", "trajectory", "names", "record", "study", "store" or
        "command"
    source : its format or command, under which it is counted
    files : name -> content, written to a folder of its own
    main : the name of the file that is read
    options : keywords of the function that is called, as JSON can hold them
    arguments : of the command line
    """

    kind: str
    source: str
    files: Mapping[str, bytes] = field(default_factory=dict)
    main: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    arguments: Sequence[str] = ()


def rarely(chance: Random, times: int) -> bool:
    """True once in so many times."""
    return chance.randrange(times) == times - 1


def odd_one(chance: Random, usual: Any, odd: Sequence[Any], times: int = 40) -> Any:
    """The usual value, and once in so many times an odd one."""
    return chance.choice(odd) if rarely(chance, times) else usual


def spelled(chance: Random, value: float) -> str:
    """A number, in one of the ways in which programs write it."""
    ways = (repr(value), f"{value:.6g}", f"{value:.3e}", f"{value:+.9f}", f" {value!r} ", f"{value:E}")
    return ways[chance.randrange(len(ways))]


def amount(chance: Random, most: float = 0.4) -> float:
    """A number of no special kind."""
    return most * (chance.randrange(2001) - 1000) / 1000.0


def entry(chance: Random, value: float, times: int = 60) -> str:
    """What stands in a table for a number."""
    return odd_one(chance, spelled(chance, value), ODD_NUMBERS, times)


def ascending(chance: Random, count: int) -> list[float]:
    """Times, which nearly always ascend."""
    step = chance.choice((0.1, 0.01, 1.0, 0.5, 1e-3))
    start = odd_one(chance, 0.0, (1.5, -2.0, 1e9, 1e15, -1e-320, 1e300), 6)
    times = [start + step * k for k in range(count)]
    if rarely(chance, 10):
        place = chance.randrange(count)
        factors = (0.0, -1.0, 1e-320, 1e300, 1e6, 1.0 + 1e-16, 1e-12)
        times[place] = times[place - 1] + step * chance.choice(factors)
    return times


INTERESTING = (b"\x00", b"\xff", b"\x7f", b"\x80", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\x00\x00\x00\x80")
"""Bytes that are the ends of some range."""


def damaged(chance: Random, data: bytes, most: int = 3) -> bytes:
    """Bytes with a few of them changed, lost, doubled, put in, swapped; or cut off."""
    found = bytearray(data)
    for _ in range(1 + chance.randrange(most)):
        place = chance.randrange(len(found) + 1)
        length = 1 + chance.randrange(16)
        match chance.randrange(8):
            case 0 if place < len(found):
                found[place] ^= 1 << chance.randrange(8)
            case 1 if place < len(found):
                found[place] = chance.randrange(256)
            case 2:
                del found[place : place + length]
            case 3:
                found[place:place] = found[place : place + length]
            case 4:
                found[place:place] = chance.choice(INTERESTING)
            case 5:
                with_ends = chance.choice(INTERESTING)
                found[place : place + len(with_ends)] = with_ends
            case 6:
                found[place : place + length] = bytes(reversed(found[place : place + length]))
            case _:
                del found[place:]
    return bytes(found)


def sometimes_damaged(chance: Random, data: bytes, times: int = 5) -> bytes:
    """Bytes, once in so many times damaged."""
    return damaged(chance, data) if rarely(chance, times) else data
