"""How the data of one call travels through the rooms: python tests/support/call_route.py [--moves FILE]

Runs `articulated`, `reconstruct` and `split` for the cat on a loop of its joints and follows every call of a function
of the library. A room is a folder of src/shapephase; the modules beside the folders, all of which stand on the lowest
line, are one room. Counted are

    stops    stays in a room: calls one after the other in the same room are one stop
    rooms    different ones
    climbs   moves into a room on a higher line of the layers contract in pyproject.toml
    returns  moves into a room that was left before

Another tree is measured by its own PYTHONPATH; where its modules stood elsewhere, FILE is a JSON table from old dotted
names below shapephase to today's. With --route the stops are printed too.
"""

from __future__ import annotations

import argparse
import json
import sys
import tomllib
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import FrameType

import numpy as np

import shapephase as sp

_SOURCE = Path(sp.__file__).parent
_TOP_MODULES = "top"
_REPORTS = "run_progress"
"""Told how far a run has come; no data of the call goes through it."""
_PROJECT = Path(__file__).parents[2] / "pyproject.toml"


@dataclass(frozen=True)
class Route:
    """The rooms that a call passes through, in order, and the line of each, counted from the bottom."""

    rooms: tuple[str, ...]
    lines: dict[str, int]

    @property
    def climbs(self) -> int:
        """Moves into a room on a higher line."""
        return sum(self.lines[after] > self.lines[before] for before, after in pairwise(self.rooms))

    @property
    def returns(self) -> int:
        """Moves into a room that was left before."""
        return len(self.rooms) - len(set(self.rooms))

    def __str__(self) -> str:
        counts = (len(self.rooms), len(set(self.rooms)), self.climbs, self.returns)
        return "{:4} stops {:3} rooms {:3} climbs {:3} returns".format(*counts)


def lines_of_rooms() -> dict[str, int]:
    """The line of every room in the layers contract, the lowest first."""
    contracts = tomllib.loads(_PROJECT.read_text())["tool"]["importlinter"]["contracts"]
    layers = next(contract["layers"] for contract in contracts if contract["type"] == "layers")
    return {
        room.strip(): height
        for height, layer in enumerate(reversed(layers))
        for room in layer.replace("|", ":").split(":")
    }


def route_of(call: Callable[[], object], moves: dict[str, str]) -> Route:
    """The route of one call."""
    rooms: list[str] = []

    def follow(frame: FrameType, event: str, _: object) -> None:
        file = Path(frame.f_code.co_filename)
        if event == "call" and file.is_relative_to(_SOURCE):
            module = ".".join(file.relative_to(_SOURCE).with_suffix("").parts)
            if module == _REPORTS:
                return
            room, _, inner = moves.get(module, module).partition(".")
            room = room if inner else _TOP_MODULES
            if not rooms or rooms[-1] != room:
                rooms.append(room)

    before = sys.getprofile()
    sys.setprofile(follow)
    try:
        call()
    finally:
        sys.setprofile(before)
    lines = lines_of_rooms()
    return Route(rooms=tuple(rooms), lines={room: lines.get(room, 0) for room in rooms})


def routes(moves: dict[str, str] | None = None) -> dict[str, Route]:
    """The routes of the three calls for the cat on a loop of all its joints."""
    table = moves or {}
    body, rng = sp.load_body("cat"), np.random.default_rng(0)
    shape = (body.n_shape, 2)
    path = sp.ShapePath.fourier(
        np.zeros(body.n_shape), 0.2 * rng.standard_normal(shape), 0.2 * rng.standard_normal(shape), 1.0
    )
    momentum = [0.0, 0.0, 0.1]
    # Once beforehand: functions that are built at their first use are no part of the route.
    sp.split(sp.reconstruct(sp.articulated(body, path), momentum))
    deformation = sp.articulated(body, path)
    motion = sp.reconstruct(deformation, momentum)
    return {
        "articulated": route_of(lambda: sp.articulated(body, path), table),
        "reconstruct": route_of(lambda: sp.reconstruct(deformation, momentum), table),
        "split": route_of(lambda: sp.split(motion), table),
    }


def main() -> None:
    """Print the counts."""
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser(description="How the data of one call travels through the rooms")
    parser.add_argument("--moves", type=Path, help="JSON table from old dotted module names to today's")
    parser.add_argument("--route", action="store_true", help="print the rooms too")
    options = parser.parse_args()
    moves = json.loads(options.moves.read_text()) if options.moves else None
    for name, route in routes(moves).items():
        print(f"{name:12}{route}")
        if options.route:
            print("   ", " ".join(route.rooms))


if __name__ == "__main__":
    main()
