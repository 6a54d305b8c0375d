"""Files that would crash, hang or fill the program that owns their format, and programs that are missing: all named.

For MJCF see `cli/test_hostile_files.py`: includes that loop, meshes that bomb, a hundred more.
"""

from __future__ import annotations

import subprocess
import sys
from functools import partial
from importlib.util import find_spec

import pytest

import shapephase as sp
from shapephase.body.engines import engine_tree as asking
from shapephase.body.engines.formats import FORMATS
from shapephase.body.engines.reading import MISSING, NO_MEMORY
from shapephase.errors import MissingExtraError, ModelFileError
from support.engine_files import ACROBAT, measured
from support.hostile_files import GOOD_MJCF
from support.osim_models import ARM, TRUNK, TWO, axes, axis, body, coordinate, joint, line, model, points

# ---- Engines that fail ----------------------------------------------------------------------------------------------

SOUND = model(TWO, [TRUNK, ARM])
MACROS = (
    '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="m" value="2"/><link name="l">'
    '<inertial><mass value="${m}"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>'
)
GOOD = {"mjcf": GOOD_MJCF, "biomod": ACROBAT, "opensim": SOUND, "yeadon": measured(), "xacro": MACROS}
"""A file of each format."""
ENDS = {
    "import os; os.abort()": "crashed on it, signal 6",
    "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)": "crashed on it, signal 11",
    "import time; time.sleep(60)": "took more than 0.3 s and was stopped",
    "import sys; sys.exit(1)": "does not read it: no reason given",
    "import sys; sys.exit('first\\nit broke')": "does not read it: it broke",
    f"import sys; sys.exit({NO_MEMORY})": "took more than 1024 MiB and was stopped",
}
"""What a reading process may do instead of an answer, and what is said of it."""


def bare_process(source, _, words, data, seconds):
    """Nothing but Python itself, so that it begins at once."""
    command = [sys.executable, "-I", "-S", "-c", source, *words]
    return subprocess.run(command, input=data, capture_output=True, timeout=seconds)


@pytest.mark.parametrize("kind", GOOD)
def test_an_engine_that_aborts_hangs_or_is_missing(kind, tmp_path, monkeypatch):
    assert set(GOOD) == set(FORMATS)
    path = tmp_path / "body.file"
    path.write_text(GOOD[kind])
    for source, said in ENDS.items():
        monkeypatch.setattr(asking, "_SECONDS", 0.3 if "sleep" in source else 60)
        monkeypatch.setattr(asking, "run_alone", partial(bare_process, source))
        with pytest.raises(ModelFileError, match=f"body.file:1: {FORMATS[kind].engine} {said}"):
            sp.load_body(path)
    monkeypatch.setattr(asking, "run_alone", lambda *_: subprocess.CompletedProcess([], MISSING, b"", b""))
    with pytest.raises(MissingExtraError, match=rf"pip install 'shapephase\[{FORMATS[kind].extra}\]'"):
        sp.load_body(path)


# ---- Files ----------------------------------------------------------------------------------------------------------

BOMB = (
    '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaaaaaaaa">'
    + "".join(f'<!ENTITY {chr(98 + k)} "{30 * f"&{chr(97 + k)};"}">' for k in range(8))
    + "]>"
)


def osim_chain(count: int) -> str:
    parts = [body(f"b{k}", 1.0, "0 0.1 0", "0.1 0.1 0.1 0 0 0") for k in range(count)]
    names = ["trunk", *(f"b{k}" for k in range(count))]
    hinges = [joint("PinJoint", f"j{k}", names[k], names[k + 1], [coordinate(f"q{k}")]) for k in range(count)]
    return model([TWO[0], *parts], [TRUNK, *hinges])


def osim_knots(count: int) -> str:
    spline = points("SimmSpline", range(count), [0.1] * count)
    turn, slide = axis(0, "1 0 0", line(1.0, 0.0), "bend"), axis(3, "1 0 0", spline, "bend")
    return model(TWO, [TRUNK, joint("CustomJoint", "elbow", "trunk", "arm", [coordinate("bend")],
                                    transform=axes(turn, slide))])  # fmt: skip


def biomod_chain(count: int) -> str:
    return "version 4\n" + "".join(
        f"segment s{k}\n{f'parent s{k - 1}' if k else ''}\nrotations x\nmass 1\ninertia 1 0 0 0 1 0 0 0 1\nendsegment\n"
        for k in range(count)
    )


OSIM = {
    "entities that multiply": (SOUND.replace("<Open", BOMB + "<Open", 1).replace("tested", "&i;"), "OpenSim does not"),
    "a hundred thousand levels": (SOUND.replace("</Model>", 100_000 * "<a>" + 100_000 * "</a>" + "</Model>"),
                                  "opensim crashed on it, signal 11"),
    "a loop of joints": (model(TWO, [joint("PinJoint", "a", "trunk", "arm", [coordinate("p")]),
                                     joint("PinJoint", "b", "arm", "trunk", [coordinate("q")])]),
                         "hangs on two joints|one joint to the ground"),
    "a file of itself": ('<OpenSimDocument Version="40000"><Model file="body.osim"/></OpenSimDocument>',
                         "one joint to the ground is needed.* got none"),
    "joints in the file itself": (SOUND.replace('name="jointset"', 'name="jointset" file="body.osim"'), "joint"),
    "a chain of thousands": (osim_chain(2000), "opensim took more than 5 s and was stopped"),
    "a hundred thousand knots": (osim_knots(100_000), "from 2 to 10000 numbers are needed"),
    "a centre that is no number": (SOUND.replace("0.2 0 0<", "nan 0 0<"), "link 'arm': its centre of mass is .nan"),
    "a version from the past": (SOUND.replace("40000", "10000"), "OpenSim does not accept it"),
    "a joint of another class": (SOUND.replace("PinJoint", "MagicJoint"), "'{MagicJoint}' is not a registered"),
    "nothing": ('<OpenSimDocument Version="40000"/>', "OpenSim does not accept it"),
}  # fmt: skip
BIOMOD = {
    "twenty thousand segments": (biomod_chain(20_000), "biorbd took more than 5 s and was stopped"),
    "its own parent": (ACROBAT.replace("parent Pelvis", "parent Thorax"), "root segment is needed"),
    "a hundred thousand brackets": (ACROBAT.replace("mass 30", f"mass {100_000 * '('}30{100_000 * ')'}"), "bad_alloc"),
    "a sum without end": (ACROBAT.replace("mass 30", "mass " + 200_000 * "1+" + "30"), "bad_alloc|took more than"),
    "a variable of itself": (ACROBAT.replace("segment Pelvis", "variables\n$a $a\nendvariables\nsegment Pelvis"),
                             "biorbd does not accept it: stod"),
    "variables without end": (ACROBAT.replace("segment Pelvis", "variables\n$a 3\nsegment Pelvis"), "root segment"),
    "a comment without end": (ACROBAT.replace("segment Hand", "/* segment Hand"), "comment .* has no end"),
    "nine thousand hinges": (ACROBAT.replace("\tzyx", " " + 3000 * "zyx"), "biorbd took more than 5 s"),
    "a contact of nothing": (ACROBAT + "\ncontact c\nparent none\nendcontact\n", "biorbd does not accept it"),
    "a muscle of nothing": (ACROBAT + "\nmusclegroup g\nOriginParent none\nendmusclegroup\nmuscle m\nendmuscle\n",
                            "biorbd does not accept it"),
}  # fmt: skip
ALIASES = "a: &a [1,1]\n" + "".join(
    f"{chr(98 + k)}: &{chr(98 + k)} [{','.join(10 * [f'*{chr(97 + k)}'])}]\n" for k in range(9)
)
YEADON = {
    "aliases that multiply": (ALIASES + measured(), "a: a number above zero is needed"),
    "a call": (measured() + "x: !!python/object/apply:os.abort []\n", "x: a number above zero is needed"),
    "fifty thousand levels": (measured() + "x: " + 50_000 * "[" + "\n", "it is not a YAML file of measurements"),
    "a list of itself": ("measurementconversionfactor: &a [*a]\n", "a number above zero is needed"),
    "a length beyond the stars": (measured(Ls1L="1.0e+300"), r"no real body|finite|has a mass|does not accept|beyond"),
}
CALL = '<xacro:macro name="f"><xacro:f/></xacro:macro><xacro:f/>'
XACRO = {
    "an include of itself": (MACROS.replace("<link", '<xacro:include filename="body.xacro"/><link'), "recursion"),
    "a macro of itself": (MACROS.replace("<link", CALL + "<link"), "recursion"),
    "a text of gigabytes": (MACROS.replace("${m}", "${'1' * 10**10}"), "more than 1024 MiB|does not accept it"),
    "a number of hours": (MACROS.replace("${m}", "${9**9**9**9}"), "took more than 5 s"),
    "a division by zero": (MACROS.replace("${m}", "${m / 0}"), "does not accept it: .*division by zero"),
    "a name that is not there": (MACROS.replace("${m}", "${n}"), "does not accept it: .*'n'"),
    "an argument that is not given": (MACROS.replace("${m}", "$(arg n)"), "does not accept it: .*n"),
    "a package that is not there": (MACROS.replace("${m}", "$(find nowhere)"), "does not accept it: .*nowhere"),
    "a file that is opened": (MACROS.replace("${m}", "${open('/etc/passwd').read()}"), "does not accept it: "),
    "a way around the builtins": (MACROS.replace("${m}", "${().__class__.__base__}"), "does not accept it: "),
}
QUICK = (
    "a list of itself",
    "a call",
    "a comment without end",
    "a centre that is no number",
    "a macro of itself",
)
FILES = [
    pytest.param(kind, *case, id=f"{kind}: {name}", marks=() if name in QUICK else pytest.mark.full)
    for kind, cases in (("osim", OSIM), ("bioMod", BIOMOD), ("txt", YEADON), ("xacro", XACRO))
    for name, case in cases.items()
]


@pytest.mark.parametrize(("kind", "text", "said"), FILES)
def test_a_hostile_file(kind, text, said, tmp_path, monkeypatch):
    """In a real process of the real program, under its own limit of memory; the limit of time is shorter here."""
    if kind == "osim" and find_spec("opensim") is None:
        pytest.skip("needs opensim")
    if "took more" in said:
        monkeypatch.setattr(asking, "_SECONDS", 5)
    path = tmp_path / f"body.{kind}"
    path.write_text(text)
    with pytest.raises(ModelFileError, match=said) as caught:
        sp.load_body(path)
    assert str(caught.value).startswith(f"{path}:")
    assert len(str(caught.value)) < 1500


def test_there_are_enough_of_them():
    assert len(FILES) >= 25
