"""Grammars of motions in texts: tables, OpenSim, ROS in YAML; and of files that say which column is which joint."""

from __future__ import annotations

import json
from random import Random
from typing import Any

from .pieces import JOINTS, ODD_NAMES, Trial, amount, ascending, entry, odd_one, rarely, sometimes_damaged, spelled

_LABELS = {
    "hip": ("hip", "hip [rad]", "hip_deg", "hip (deg)", "hip°", "hip [mrad]"),
    "wrist": ("wrist", "wrist_rad", "wrist deg"),
    "boom": ("boom", "boom [mm]", "boom [m]", "boom_cm"),
}
_TIMES = ("time", "time [s]", "t", "Time [ms]", "timestamp")
_OPTIONS: tuple[dict[str, Any], ...] = (
    {"degrees": True},
    {"degrees": False},
    {"time_unit": "s"},
    {"time_unit": "ms"},
    {"rest_missing": True},
    {"ignore_extra": True, "rest_missing": True},
    {"rest": {"boom": "5 mm"}},
    {"trim": [0.0, 0.5]},
    {"smooth": 0.01},
    {"close": "30deg,1m"},
    {"close": 0.05, "close_by": "drift"},
    {"resample": 50.0},
    {"names": {"hip": "wrist", "wrist": "hip"}},
    {"timestep": 0.1},
)


def options(chance: Random) -> dict[str, Any]:
    """Keywords of `read_recorded_motion`, mostly none."""
    return dict(odd_one(chance, {"rest_missing": True, "ignore_extra": True}, _OPTIONS, 6))


def joint_labels(chance: Random) -> list[str]:
    """Labels of columns of joints, in some order."""
    joints = list(JOINTS)
    chance.shuffle(joints)
    if rarely(chance, 5):
        joints = joints[: chance.randrange(4)]
    labels = [odd_one(chance, name, _LABELS[name], 4) for name in joints]
    if rarely(chance, 8):
        labels.append(chance.choice(("qx", "base_x_m", "omega_x_rad_s", "marker", *ODD_NAMES)))
    return [odd_one(chance, label, ODD_NAMES, 60) for label in labels]


def samples(chance: Random, columns: int) -> tuple[list[float], list[list[float]]]:
    """Times, and rows of values; some rows end where they began."""
    count = odd_one(chance, 3 + chance.randrange(4), (0, 1, 2), 20)
    rows = [[amount(chance) for _ in range(columns)] for _ in range(count)]
    if rows and rarely(chance, 3):
        rows[-1] = list(rows[0])
    return ascending(chance, count) if count else [], rows


def delimited(chance: Random) -> Trial:
    """CSV, TSV and TXT."""
    suffix = chance.choice((".csv", ".csv", ".tsv", ".txt"))
    mark = "\t" if suffix == ".tsv" else chance.choice((",", ";", "\t"))
    labels = joint_labels(chance)
    times, rows = samples(chance, len(labels))
    place = chance.randrange(len(labels) + 1) if rarely(chance, 4) else 0
    header = [*labels[:place], odd_one(chance, "time", _TIMES, 5), *labels[place:]]
    table = [[*row[:place], t, *row[place:]] for t, row in zip(times, rows, strict=True)]
    lines = [[entry(chance, value, 150) for value in row] for row in table]
    comma = mark != "," and rarely(chance, 5)
    if comma:
        lines = [[text.replace(".", ",") for text in line] for line in lines]
    if rarely(chance, 15):
        lines.insert(0, [chance.choice(("", "deg", "[rad]", "s", "(mm)", "ms", "m", "px")) for _ in header])
    if lines and rarely(chance, 40):
        lines[chance.randrange(len(lines))].append("0")
    if lines and rarely(chance, 40):
        lines[chance.randrange(len(lines))].pop()
    quote = rarely(chance, 8)
    newline = chance.choice(("\n", "\n", "\r\n", "\r"))
    written = [
        mark.join(f'"{text}"' if quote and rarely(chance, 3) else text for text in line) for line in [header, *lines]
    ]
    if rarely(chance, 20):
        written.insert(chance.randrange(len(written) + 1), chance.choice(("", "# note", mark * 3, " ", '"', "sep=;")))
    text = odd_one(chance, "", ("\ufeff", "\n", " "), 10) + newline.join(written) + odd_one(chance, newline, ("",), 5)
    data = text.encode(odd_one(chance, "utf-8", ("utf-16", "latin-1", "utf-8-sig"), 40), errors="replace")
    name = f"motion{suffix}"
    return Trial(
        kind="motion",
        source=suffix[1:].upper(),
        files={name: sometimes_damaged(chance, data, 12)},
        main=name,
        options=options(chance),
    )


def opensim(chance: Random) -> Trial:
    """OpenSim's `.mot` and `.sto`."""
    labels = joint_labels(chance)
    labels = [label.split()[0] if label.split() else "x" for label in labels]
    if rarely(chance, 5):
        labels = [f"/jointset/j/{label}/{chance.choice(('value', 'value', 'speed'))}" for label in labels]
    times, rows = samples(chance, len(labels))
    count = f"{len(rows):018d}"
    said = [
        f"nRows={odd_one(chance, len(rows), (0, -1, 'three', '9' * 30, count, count + '999'), 15)}",
        f"{chance.choice(('nColumns', 'datacolumns'))}={odd_one(chance, len(labels) + 1, (0, 'x', 10**20), 15)}",
        f"inDegrees={odd_one(chance, chance.choice(('yes', 'no')), ('', 'maybe', 'YES', 'true'), 15)}",
    ]
    said = [line.replace("=", " ") if rarely(chance, 12) else line for line in said if not rarely(chance, 10)]
    said += [chance.choice(("DataType=double", "DataType=Quaternion", "inDegrees=no", "version=1"))] * rarely(chance, 6)
    mark = chance.choice(("\t", " ", "  "))
    lines = [mark.join(entry(chance, v, 150) for v in (t, *row)) for t, row in zip(times, rows, strict=True)]
    header = mark.join([odd_one(chance, "time", _TIMES, 10), *labels])
    text = "\n".join(
        ["Coordinates", *said, "", odd_one(chance, "endheader", ("", "EndHeader ", "end"), 20), header, *lines]
    )
    name = chance.choice(("motion.mot", "motion.sto"))
    data = sometimes_damaged(chance, (text + "\n").encode(errors="replace"), 12)
    return Trial(kind="motion", source="OpenSim", files={name: data}, main=name, options=options(chance))


def _stamp(chance: Random, seconds: float) -> str:
    nano = round(seconds * 1e9) if abs(seconds) < 1e12 else 10**30
    ways = (
        f"{{sec: {nano // 10**9}, nanosec: {nano % 10**9}}}",
        f"{{secs: {nano // 10**9}, nsecs: {nano % 10**9}}}",
        repr(seconds),
        f"{{sec: {nano // 10**9}}}",
        f"{{nanosec: {nano}}}",
    )
    odd = (
        "{}",
        "[1, 2]",
        "{sec: -1}",
        "{sec: 1.5}",
        "{sec: 1, secs: 2}",
        "-1",
        "~",
        "{sec: 0x10}",
        "1e13",
        "&a 1",
        "!!int 1",
    )
    return odd_one(chance, ways[chance.randrange(3)] if not rarely(chance, 6) else chance.choice(ways), odd, 40)


def _word(chance: Random, value: float) -> str:
    return odd_one(
        chance, entry(chance, value, 80), ("&a 1", "*a", "!!float 1", "[1]", "{a: 1}", ".nan", ".inf", "1e3", "on"), 80
    )


def ros_yaml(chance: Random) -> Trial:
    """Trajectories and joint states of ROS."""
    labels = [
        odd_one(chance, label.split()[0] if label.split() else "x", ODD_NAMES, 60) for label in joint_labels(chance)
    ]
    times, rows = samples(chance, len(labels))
    names = "[" + ", ".join(json.dumps(label) if rarely(chance, 3) else label for label in labels) + "]"
    first = times[0] if times and not rarely(chance, 5) else 0.0
    if rarely(chance, 3):
        documents = [
            f"header: {{stamp: {_stamp(chance, t)}}}\nname: {names}\n"
            f"position: [{', '.join(_word(chance, v) for v in row)}]\n"
            for t, row in zip(times, rows, strict=True)
        ]
        text = odd_one(chance, "---\n", ("...\n", "--- \n---\n", "\n"), 20).join(documents)
    else:
        points = [
            f"- {{positions: [{', '.join(_word(chance, v) for v in row)}], time_from_start: {start}}}"
            for row, start in zip(rows, [_stamp(chance, t - first) for t in times], strict=True)
        ]
        lines = [f"joint_names: {names}", "points:", *points]
        if rarely(chance, 6):
            lines.insert(
                0,
                chance.choice(("header: {stamp: 1.0}", "<<: {a: 1}", "joint_names: [hip]", "%YAML 1.1", "? [a]\n: 1")),
            )
        if rarely(chance, 6):
            lines = [chance.choice(("goal:", "trajectory:", "other:")), *("  " + line for line in lines)]
        text = "\n".join(lines) + "\n"
        if rarely(chance, 8):
            text += "---\n" + text
    data = sometimes_damaged(chance, text.encode(errors="replace"), 12)
    return Trial(kind="motion", source="YAML", files={"motion.yaml": data}, main="motion.yaml", options=options(chance))


def name_files(chance: Random) -> Trial:
    """Which column is which joint: JSON, or lines."""
    pairs = [
        (odd_one(chance, f"column{k}", ODD_NAMES, 8), odd_one(chance, "hip", ODD_NAMES, 8))
        for k in range(chance.randrange(4))
    ]
    if chance.randrange(2):
        lines = [
            f"{old}={new}" if not rarely(chance, 12) else chance.choice(("=", "a", "a=b=c", "#", ""))
            for old, new in pairs
        ]
        data, name = ("\n".join(lines) + "\n").encode(errors="replace"), "names.txt"
    else:
        odd = ("null", "1", "[]", "{}", "NaN", "1e999", "true", '"\\ud800"', "[" * 3000, '{"a": "b"}')
        said = [f"{json.dumps(old)}: {odd_one(chance, json.dumps(new), odd, 6)}" for old, new in pairs]
        text = "{" + ", ".join(said) + "}"
        data, name = odd_one(chance, text, odd, 12).encode(errors="replace"), "names.json"
    return Trial(
        kind="names",
        source="JSON" if name.endswith("json") else "lines",
        files={name: sometimes_damaged(chance, data)},
        main=name,
    )


def number_text(chance: Random) -> str:
    """A number as an argument of a command or an attribute of a file."""
    return entry(chance, amount(chance), 12) if rarely(chance, 3) else spelled(chance, amount(chance)).strip()
