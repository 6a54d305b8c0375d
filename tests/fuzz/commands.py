"""Grammar of command lines: every command, its options with usual and odd values, good and fuzzed files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from random import Random

from support.odd_values import ODD_WORDS

from .bodies import mjcf, urdf
from .engine_bodies import biomod, yeadon
from .pieces import BODY, ODD_NAMES, Trial, odd_one, rarely
from .studies import GOOD_MOTION, store_files, store_trial, study_file
from .text_motions import delimited, number_text, opensim
from .trajectories import file_of
from .xacro_files import xacro

_ODD_VALUES = (*ODD_WORDS, "-", "x", "a=b", "[", "1,2,3", "@", "%s", "\n")
_SAMPLES = (".csv", ".csv", ".parquet", ".nc", ".mat", ".h5", ".CSV", "", ".xyz")
_SMALL_SEARCH = ("--pieces", "12", "--iterations", "30", "--duration", "10")
"""What a plan takes of the processor grows with the first two; in so many seconds the rates of the body suffice."""


def _number(chance: Random, usual: str) -> str:
    return odd_one(chance, usual, _ODD_VALUES, 6)


def _three(chance: Random) -> list[str]:
    count = odd_one(chance, 3, (1, 2, 4), 20)
    return [odd_one(chance, number_text(chance), _ODD_VALUES, 20) for _ in range(count)]


def _file(chance: Random, usual: str) -> list[str]:
    return [
        odd_one(
            chance,
            usual,
            ("out.xyz", "no/such/folder/x.npz", ".", "x" * 300 + ".npz", "\x01.npz", "x.NPZ", "", "motion.csv"),
            4,
        )
    ]


_RECORDING: Mapping[str, Callable[[Random], list[str]]] = {
    "--degrees": lambda _: [],
    "--radians": lambda _: [],
    "--time-unit": lambda c: [odd_one(c, "s", ("ms", "h", "", "us"), 3)],
    "--timestep": lambda c: [_number(c, "0.1")],
    "--topic": lambda c: [c.choice(("a", "", "Sheet1"))],
    "--rest": lambda c: [c.choice(("boom=1mm", "hip=nan", "hip", "=1", "x=1", "hip=1e999", "hip=1deg"))],
    "--rest-missing": lambda _: [],
    "--ignore-extra": lambda _: [],
    "--names": lambda c: [c.choice(("hip=wrist", "hip=", "nofile", "x=hip", "=", "motion.csv", "body.urdf"))],
    "--trim": lambda c: [_number(c, "0"), _number(c, "1")],
    "--resample": lambda c: [_number(c, "50")],
    "--smooth": lambda c: [_number(c, "0.01")],
    "--close": lambda c: [c.choice(("3deg", "0.1", "3deg,5mm", "-1", "nan", "x", "1e400deg", "1s"))],
    "--close-by": lambda c: [c.choice(("drift", "smooth", "geodesic", "x"))],
    "--smooth-penalty": lambda c: [_number(c, "1e-6")],
    "--base-order": lambda c: [c.choice(("zyx", "xyz", "xx", "", "zyxz"))],
    "--base-axes": lambda c: [c.choice(("x,-z,y", "x,y,z", "x,x,y", "estimate", "", "w"))],
    "--flight": lambda c: c.choice((["auto"], ["all"], [_number(c, "0"), _number(c, "1")], ["x"], ["1"])),
}
_ROOT: Mapping[str, Callable[[Random], list[str]]] = {
    "--packages": lambda c: c.choice((["packages"], ["none"], ["body.urdf"], [], [""], ["packages", "."], ["\x01"])),
    "--root": lambda c: [c.choice(("free", "fixed", ""))],
    "--root-body": lambda c: [c.choice(("base", "body0", "none", ""))],
}
_POSTURES = (
    "hip=0.1",
    "hip=5deg,wrist=0.1",
    "hip=nan",
    "none=1",
    "hip",
    "=",
    "",
    "motion.csv",
    "hip=9",
    "boom=1mm",
    "free",
)
_FLIGHT: Mapping[str, Callable[[Random], list[str]]] = {
    "--momentum": _three,
    "--attitude": lambda c: odd_one(
        c, ["0", "0", "0", "1"], (["0"] * 4, ["nan"] * 4, ["1", "1"], ["1e200"] * 4, ["1e-320"] * 4), 3
    ),
}
_UP = ("y", "-z", "x", "", "w", "--y")
_GAUGES = ("horizontal", "base", "principal", "mean_body", "link:hand", "link:", "link:none", "x", "")
_GAUGE: Mapping[str, Callable[[Random], list[str]]] = {"--gauge": lambda c: [c.choice(_GAUGES)]}
_TOLERANCE: Mapping[str, Callable[[Random], list[str]]] = {
    "--tolerance": lambda c: [odd_one(c, "1e-6", ("1e-13", "1e-15", "1", "nan", "-1", "0"), 4)]
}
_ERRORS: Mapping[str, Callable[[Random], list[str]]] = {
    "--joint-noise": lambda c: [c.choice(("0.3deg", "0.1", "nan", "-1", "x", "1e300"))],
    "--mass-error": lambda c: [_number(c, "0.05")],
    "--centre-error": lambda c: [_number(c, "0.05")],
    "--inertia-error": lambda c: [_number(c, "0.05")],
    "--momentum-error": lambda c: [_number(c, "0.05")],
    "--attitude-error": lambda c: [_number(c, "0.05")],
}
_COMMANDS: Mapping[str, Mapping[str, Callable[[Random], list[str]]]] = {
    "check": _RECORDING,
    "split": _RECORDING
    | _FLIGHT
    | _GAUGE
    | _TOLERANCE
    | _ERRORS
    | {
        "--out": lambda c: _file(c, "out.npz"),
        "--html": lambda c: _file(c, "report.html"),
        "--phases": lambda _: [],
        "--samples": lambda c: _file(c, "samples" + c.choice(_SAMPLES)),
        "--up": lambda c: [c.choice(_UP)],
    },
    "audit": {
        "--flight": _RECORDING["--flight"],
        "--tolerance": lambda c: [_number(c, "1e-3")],
        "--step": lambda c: [_number(c, "0.001") for _ in range(1 + c.randrange(2))],
        "--timestep": lambda c: [_number(c, "0.04")],
        "--names": _RECORDING["--names"],
        "--degrees": lambda _: [],
        "--rest-missing": lambda _: [],
        "--ignore-extra": lambda _: [],
        "--base-order": _RECORDING["--base-order"],
        "--base-axes": _RECORDING["--base-axes"],
        "--figure": lambda c: _file(c, "audit.svg"),
    },
    "torques": _RECORDING | _FLIGHT | _TOLERANCE | {"--out": lambda c: _file(c, "out.csv")},
    "plot": _RECORDING | _FLIGHT | _GAUGE | {"--out": lambda c: _file(c, "out.png")},
    "view": _RECORDING
    | _FLIGHT
    | {
        "--trail": lambda c: [c.choice(("hand", "none", ""))],
        "--speed": lambda c: [_number(c, "1")],
        "--video": lambda c: [c.choice(("film.webm", "", "no/such/film.gif"))],
        "--up": lambda c: [c.choice(_UP)],
    },
    "explore": {"--up": lambda c: [c.choice(_UP)]},
    "orbits": _RECORDING | _GAUGE | _TOLERANCE,
    "plan": {
        "--rotate": lambda c: [_number(c, "5")],
        "--about": lambda c: [
            c.choice(("x", "0,1,1", "0,0,0", "nan,1,1", "1e400,0,0", "w", "1e200,1e200,0", "1e-320,0,0"))
        ],
        "--momentum": _three,
        "--duration": lambda c: [_number(c, "10")],
        "--somersaults": lambda c: [_number(c, "0")],
        "--half-twists": lambda c: [_number(c, "1")],
        "--cost": lambda c: [c.choice(("kinetic", "rate", "time", "x"))],
        "--starts": lambda c: [_number(c, "1")],
        "--seed": lambda c: [_number(c, "1")],
        "--pieces": lambda c: [_number(c, "6")],
        "--iterations": lambda c: [_number(c, "3")],
        "--turn": lambda c: [
            c.choice(("5 about y", "5", "nan about x", "5 about 0,0,0", "5 about 0,1,1", "about y", ""))
        ],
        "--point": lambda c: [
            c.choice(("0 0 1", "hand 0 0 1", "none 0 0 1", "0 0 0", "nan 0 1")),
            c.choice(("0 1 0", "0 0 1e400", "x", "")),
        ],
        "--from": lambda c: [c.choice(_POSTURES)],
        "--to": lambda c: [c.choice(_POSTURES)],
        "--joints": lambda c: [c.choice(("hip", "hip,wrist", "hip,hip", "none", ""))],
        "--hold": lambda c: [c.choice(("boom", "hip,wrist,boom", "none", ""))],
        "--mirror": lambda c: [c.choice(("hip=wrist", "hip=-wrist", "hip=hip", "hip=boom", "hip=-none", "hip", ""))],
        "--workers": lambda c: [c.choice(("1", "0", "-1", "x"))],
        "--time-limit": lambda c: [_number(c, "2")],
        "--rate-limit": lambda c: [c.choice(("2", "hip=2", "none=1", "-1", "nan", "hip", "hip=", "1e400", "90deg"))],
        "--rates-at-ends": lambda c: [c.choice(("zero", "free", "x", ""))],
        "--html": lambda c: _file(c, "plan.html"),
        "--out": lambda c: _file(c, "out.csv"),
    },
    "sweep": {
        "--workers": lambda c: [odd_one(c, "1", ("0", "-1", "1.5", "x", ""), 2)],
        "--scheduler": lambda c: [c.choice(("", "x", "tcp://", "tcp://127.0.0.1:1", "http://[", "127.0.0.1:99999"))],
        "--resume": lambda _: [],
    },
    "plot sweep": {
        "--kind": lambda c: [c.choice(("histogram", "quantiles", "map", "x", ""))],
        "--along": lambda c: [
            c.choice(("momentum_x", "momentum_z", "turn", "none", "")) for _ in range(c.randrange(4))
        ],
    },
    "reach": {
        "--at": lambda c: [c.choice(_POSTURES)],
        "--pairs": lambda c: [_number(c, "3")],
        "--out": lambda c: _file(c, "reach.svg"),
    },
    "sweep status": {},
    "sweep export": {"--out": lambda c: _file(c, "table.csv")},
    "rigid": {
        "--momentum": _three,
        "--figure": lambda c: [c.choice(("polhodes", "herpolhode", "rolling", "cones", "x", ""))],
        "--time": lambda c: [_number(c, "1.5")],
        "--out": lambda c: _file(c, "out.svg"),
        "--html": lambda c: _file(c, "out.html"),
    },
    "conjugate": {"--momenta": _three, "--order": lambda c: [_number(c, "2")], "--out": lambda c: _file(c, "out.svg")},
    "robots": {},
    "doctor": {},
    "": {},
}
"""Command -> option -> its values; `compile` takes nothing in, and longer than an input may."""


_MADE: Mapping[str, Callable[[Random], Trial]] = {
    "body.xml": mjcf,
    "body.bioMod": biomod,
    "body.txt": yeadon,
    "body.xacro": xacro,
}
"""Bodies that are no URDF."""
_STORES = ("no.zarr", "", ".", "folder", "study.toml", "motion.csv", "x" * 300, "no/such/out.zarr", "\x01.zarr")


def _sweep(chance: Random, name: str) -> tuple[dict[str, bytes], list[str]]:
    """The files and the words of a study: it is new, goes on, or meets another's store."""
    made = odd_one(chance, store_trial, (study_file,), 2)(chance)
    files = dict(made.files)
    if name != "sweep":
        drawn = [odd_one(chance, "turn", ("poison", "status", "momentum_x", "turn_0", "none", ""), 2)]
        drawn = drawn if name == "plot sweep" else []
        out = {"plot sweep": ["--out", "out.png"], "sweep export": ["--out", "table.csv"]}.get(name, [])
        return files, [odd_one(chance, "out.zarr", _STORES, 5), *drawn, *out]
    if made.kind == "study" and rarely(chance, 4):
        files |= {other: data for other, data in store_files().items() if other != "study.toml"}
    study = odd_one(chance, "study.toml", ("no.toml", "motion.csv", "", "folder", "out.zarr"), 10)
    store = odd_one(chance, chance.choice(("out.zarr", "new.zarr")), _STORES, 8)
    return files, [study, "--store", store, "--workers", "1"] + ["--resume"] * chance.randrange(2)


def _word(chance: Random) -> str:
    return chance.choice(
        ("--json", "--quiet", "-q", "-v", "--", "--no-such", "-x", "extra", "--help", "", *ODD_NAMES[:8])
    )


def command(chance: Random, only: str | None = None) -> Trial:
    """A command line and the files that it names."""
    names = tuple(_COMMANDS) if only is None else (only,)
    weights = {"check": 12, "split": 6, "conjugate": 4}
    name = chance.choice([name for name in names for _ in range(weights.get(name, 1))])
    exports, name = name == "split --samples", name.partition(" --")[0]
    files: dict[str, bytes] = {}
    # A plan for the 23 joints of the cat takes longer to write down than any input may.
    known = ("cat_two_halves",) if name == "plan" else ("cat", "diver")
    body = odd_one(
        chance,
        "body.urdf",
        (*known, "nobody", "", "example:none", *_MADE, "folder", "motion.csv", "x" * 5000),
        8,
    )
    made = _MADE.get(body, urdf)(chance)
    files |= made.files
    if body == "body.urdf" and not rarely(chance, 4):
        files = {"body.urdf": BODY.encode()}
    motion = odd_one(
        chance, "motion.csv", ("circle", "cat_righting", "-", "none", "no.csv", "", ".csv", "body.urdf", "a.bvh"), 10
    )
    if name not in ("plan", "explore"):
        fuzzed = opensim(chance) if rarely(chance, 4) else delimited(chance)
        use = rarely(chance, 2) and motion == "motion.csv"
        files["motion.csv"] = GOOD_MOTION.encode()
        if use:
            files, motion = files | fuzzed.files, fuzzed.main
    words = {
        "plan": [body],
        "reach": [body],
        "conjugate": [_number(chance, "1"), _number(chance, "2"), _number(chance, "3")],
        "rigid": [_number(chance, "1"), _number(chance, "2"), _number(chance, "3"), "--momentum", *_three(chance)],
        "orbits": [body, motion, _number(chance, "0.02")],
        "plot": [
            odd_one(chance, chance.choice(("momentum", "phases", "shape", "inertia")), ("x", ""), 8),
            body,
            motion,
        ],
        "robots": [],
        "doctor": [],
        "": [],
    }.get(name, [body, motion])
    if exports:
        words += ["--samples", "samples" + chance.choice(_SAMPLES)]
    if name == "audit":
        words = [body]
        for _ in range(odd_one(chance, 1, (0, 2, 2), 5)):
            run, data = file_of(chance)
            files[run], words = data, [*words, odd_one(chance, run, ("no.npz", "", "motion.csv", "body.urdf"), 20)]
    if "sweep" in name:
        files, words = _sweep(chance, name)
    if name == "explore":
        words = [body, "--joints", "hip", odd_one(chance, "wrist", ("hip", "boom", *ODD_NAMES), 3)]
    if name in ("view", "explore"):
        words += ["--html", "page.html"]
    if name == "plot" and not rarely(chance, 5):
        words += ["--out", "out.png"]
    if name == "plan" and not rarely(chance, 5):
        words += ["--rotate", _number(chance, "5")]
    offered = _COMMANDS[name] | (_ROOT if body in words else {})
    for option in chance.sample(sorted(offered), min(len(offered), chance.randrange(3))):
        words += [option, *offered[option](chance)]
    if rarely(chance, 8):
        words.insert(chance.randrange(len(words) + 1), _word(chance))
    if words and rarely(chance, 12):
        words.pop(chance.randrange(len(words)))
    if name == "plan":
        words += [word for k, word in enumerate(_SMALL_SEARCH) if _SMALL_SEARCH[k - k % 2] not in words]
    arguments = [word.replace("\x00", "") for word in name.split() + words]
    if not rarely(chance, 4):
        arguments.append("--json")
    return Trial(kind="command", source=f"shapephase {name}".strip(), files=files, arguments=arguments)
