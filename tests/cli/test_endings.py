"""How commands end: exit codes, what is written where, pipes, Ctrl-C, full devices, and what is said."""

from __future__ import annotations

import io
import json
import os
import re
import shlex
import signal
import stat
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import app, main
from shapephase.cli.outcome import ExitCode
from shapephase.cli.terminal import printable
from support.long_runs import full_but
from support.places import ROOT
from support.terminals import on_a_terminal

CAT = ("split", "cat", "cat_righting")
MOVING = ("--momentum", "0", "0", "0.02")
# A command of each kind that ends well, and quickly.
COMMANDS = {
    "split": CAT,
    "check": ("check", "cat", "cat_righting"),
    "robots": ("robots",),
    "conjugate": ("conjugate", "1", "2", "3"),
    "rigid": ("rigid", "1", "2", "3", "--momentum", "1", "0", "2"),
    "orbits": ("orbits", "cat", "cat_righting", "0.02"),
    "doctor": ("doctor",),
    "torques": ("torques", "cat", "cat_righting"),
    "momentum": ("momentum", "cat", "cat_righting"),
}
ALL_COMMANDS = (
    *(*COMMANDS, "plan", "view", "explore", "plot", "compile", "reach", "loop", "audit", "contributions", "export"),
    *("sweep", "sweep status", "sweep export", "plot sweep"),
)


def ran(*arguments, **options):
    command = [sys.executable, "-m", "shapephase", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, **options)


def ended(capfd, *arguments):
    """Exit code, standard output and standard error of a command in this process."""
    code = 0
    try:
        main([str(a) for a in arguments])
    except SystemExit as stop:
        code = int(stop.code or 0)
    said = capfd.readouterr()
    assert "Traceback" not in said.err
    return code, said.out, said.err


def in_shell(line):
    """A line of a shell, with the exit codes of all parts of a pipe."""
    whole = f"set -o pipefail; {line}; echo codes ${{PIPESTATUS[@]}} >&2"
    environment = {**os.environ, "sp": f"{sys.executable} -m shapephase"}
    return subprocess.run(["bash", "-c", whole], capture_output=True, text=True, timeout=300, env=environment)


# ---- Pipes and devices ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", full_but(COMMANDS, "split"))
def test_a_reader_that_stops_early_is_no_fault(name):
    """As of any other tool: quiet, and the code of SIGPIPE."""
    done = in_shell(f"$sp {' '.join(COMMANDS[name])} --json | true")
    assert done.stderr == "codes 141 0\n" or done.stderr == "codes 0 0\n"


def test_head_gets_its_lines():
    done = in_shell("$sp robots --json | head -n 1")
    assert done.stdout == "{\n"
    assert re.fullmatch(r"codes (141|0) 0\n", done.stderr)


def test_an_error_in_a_pipe_that_nobody_reads():
    done = in_shell("($sp split dog cat_righting 2>&1; echo code $? >&3) 3>&2 | true")
    assert "Traceback" not in done.stderr
    assert re.search(r"code (141|2)\n", done.stderr)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
@pytest.mark.parametrize("name", full_but(COMMANDS, "check"))
def test_standard_output_that_is_full(name):
    with open("/dev/full", "wb") as full:
        command = [sys.executable, "-m", "shapephase", *COMMANDS[name], "--json"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=300)
    assert done.returncode == ExitCode.OUTPUT
    assert done.stderr == "shapephase: cannot write standard output: No space left on device\n"


def test_standard_output_that_is_closed():
    done = in_shell("$sp robots >&-")
    assert done.stderr == "shapephase: cannot write standard output: it is closed\ncodes 6\n"


def test_letters_that_the_encoding_lacks_are_written_out(tmp_path):
    (tmp_path / "näme.urdf").write_text(
        "<robot name='r'><link name='a'><inertial><mass value='1'/>"
        "<inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link></robot>"
    )
    done = ran("check", tmp_path / "näme.urdf", env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert done.returncode == 0
    assert done.stdout.startswith("n\\xe4me: 1 kg")


def test_what_a_terminal_would_obey_is_written_out():
    assert printable("plain text, 5\u00b0") == "plain text, 5\u00b0"
    assert printable("\x1b[2Jgone\u202e\x9b\ud800") == "\\x1b[2Jgone\\u202e\\x9b\\ud800"


# ---- Files ----------------------------------------------------------------------------------------------------------


def test_what_was_written_is_said_unless_it_is_quiet(capfd, tmp_path):
    out = tmp_path / "fall.NPZ"
    code, plain, said = ended(capfd, *CAT, "--out", out)
    assert code == 0
    assert re.fullmatch(rf"wrote {re.escape(str(out))} \([0-9.]+ kB\)\n", said)
    assert sp.load_motion(out).duration == 2.0
    assert ended(capfd, *CAT, "--out", out, "--quiet") == (0, plain, "")
    code, shown, said = ended(capfd, *CAT, "--out", out, "-v")
    assert shown == plain
    assert said.splitlines()[0] == "shapephase: loading and reconstructing"


@pytest.mark.parametrize("ending", ["SVG", "Pdf", "png"])
def test_endings_in_any_case(capfd, tmp_path, ending):
    out = tmp_path / f"figure.{ending}"
    assert ended(capfd, "plot", "attitude", *CAT[1:], "--out", out)[0] == 0
    assert out.read_bytes()[:5] in (b"<?xml", b"%PDF-", b"\x89PNG\r")


@pytest.mark.parametrize(
    "command",
    [
        (*CAT, "--out"),
        (*CAT, "--html"),
        ("view", *CAT[1:], "--html"),
        ("plot", "attitude", *CAT[1:], "--out"),
        ("plan", "cat_two_halves", "--turn", "60 about x", "--out"),
        ("plan", "cat_two_halves", "--turn", "60 about x", "--html"),
        ("conjugate", "1", "2", "3", "--out"),
        ("torques", *CAT[1:], "--out"),
        ("rigid", "1", "2", "3", "--momentum", "1", "0", "2", "--out"),
        ("rigid", "1", "2", "3", "--momentum", "1", "0", "2", "--html"),
        ("reach", "cat", "--out"),
        ("loop", *CAT[1:], "--out"),
        ("explore", "cat", "--joints", "waist_pitch", "waist_yaw", "--html"),
    ],
)
def test_what_cannot_be_written_is_said_before_anything_is_computed(capfd, tmp_path, monkeypatch, command):
    def never(*_, **__):
        raise AssertionError("it was computed")

    monkeypatch.setattr("shapephase.body.loading.load_body", never)
    monkeypatch.setattr("shapephase.rigid_body.geodesics.serret_andoyer_metric", never)
    monkeypatch.setattr("shapephase.rigid_body.euler_top.EulerTop.principal", never)
    endings = {"plot": ".svg", "conjugate": ".svg", "plan": ".csv", "split": ".npz", "view": ".html"}
    of_command = endings | {"torques": ".csv", "rigid": ".svg", "reach": ".svg", "loop": ".svg"}
    ending = ".html" if command[-1] == "--html" else of_command[command[0]]
    folder = tmp_path / f"folder{ending}"
    folder.mkdir()
    for name, words in ((f"folder{ending}", "it is a folder"), ("x" * 300 + ending, "name too long")):
        code, out, said = ended(capfd, *command, tmp_path / name)
        assert (code, out) == (ExitCode.OUTPUT, "")
        assert said.count("\n") == 1
        assert words in said
    assert list(tmp_path.iterdir()) == [folder]


def test_a_folder_without_an_ending_is_a_folder(capfd, tmp_path):
    code, _, said = ended(capfd, *CAT, "--out", tmp_path)
    assert code == ExitCode.OUTPUT
    assert "it is a folder" in said


def test_a_result_goes_through_standard_output_and_the_table_aside():
    moving = ("split", "satellite", "satellite_sweep", *MOVING)
    command = [sys.executable, "-m", "shapephase", *moving, "--out", "/dev/stdout"]
    done = subprocess.run(command, capture_output=True, timeout=300)
    assert done.returncode == 0
    assert np.load(io.BytesIO(done.stdout))["spatial_momentum"].tolist() == [0.0, 0.0, 0.02]
    assert b"Montgomery phase" in done.stderr


def test_a_named_pipe_as_target(capfd, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with ThreadPoolExecutor(1) as reader:
        received = reader.submit(pipe.read_bytes)
        code, _, said = ended(capfd, *CAT, "--out", pipe)
    assert (code, said) == (0, f"wrote {pipe}\n")
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert np.load(io.BytesIO(received.result()))["spatial_momentum"].tolist() == [0.0, 0.0, 0.0]


# ---- Ctrl-C ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", full_but(range(6), 2))
def test_ctrl_c_at_any_time_is_one_line_and_130(seed, tmp_path):
    """From the first imports to the last figure of the report; no half file, whenever it comes."""
    out = tmp_path / "report.html"
    arguments = [*CAT, *MOVING, "--html", str(out)]
    begin = "from shapephase.cli.start import run\nprint('go', flush=True)\nrun()"
    source = f"import sys; sys.argv[1:] = {arguments!r}; {begin}"
    process = subprocess.Popen(
        [sys.executable, "-c", source], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, process_group=0
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "go\n"
    time.sleep(0.15 + 0.25 * seed + np.random.default_rng(seed).uniform(0.0, 0.2))
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=300)
    if process.returncode == 0:
        assert out.is_file()
        return
    assert process.returncode == ExitCode.STOPPED
    assert said == "shapephase: stopped\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("heard_ctrl_c")
def test_ctrl_c_within_a_command(capfd, monkeypatch):
    def pressed(*_, **__):
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("shapephase.cli.motion.flight", pressed)
    assert ended(capfd, *CAT) == (ExitCode.STOPPED, "", "shapephase: stopped\n")


@pytest.mark.parametrize(
    "error",
    [
        ImportError("numpy._core failed to import"),
        pytest.param(SystemError("error return"), marks=pytest.mark.full),
    ],
)
def test_ctrl_c_that_a_compiled_module_turned_into_its_own_error(error):
    """As while a command imports what it needs: the exception that comes out is not KeyboardInterrupt any more."""
    source = f"""
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
import shapephase.cli.motion as motion
from shapephase.cli.start import run

def importing(*_, **__):
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        raise {error!r} from None

motion.flight = importing
sys.argv[1:] = {list(CAT)!r}
run()
"""
    done = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout, done.stderr) == (ExitCode.STOPPED, "", "shapephase: stopped\n")


def test_ctrl_c_that_passed_through_text_that_a_compiled_module_ran(tmp_path):
    """`python -m` ends by the signal then, though the exception was caught."""
    source = f"""
import ctypes, sys
import shapephase.cli.motion as motion
from shapephase.cli.start import run

def running(*_, **__):
    ctypes.pythonapi.PyRun_String.restype = ctypes.py_object
    file_input, names = 257, ctypes.py_object({{}})
    ctypes.pythonapi.PyRun_String(b"raise KeyboardInterrupt", file_input, names, names)

motion.flight = running
sys.argv[1:] = {list(CAT)!r}
run()
"""
    (tmp_path / "pressed").with_suffix(".py").write_text(source)
    command = [sys.executable, "-m", "pressed"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (ExitCode.STOPPED, "", "shapephase: stopped\n")


# ---- Exit codes -----------------------------------------------------------------------------------------------------


def test_the_documentation_and_the_help_list_every_exit_code(capfd):
    page = (ROOT / "docs" / "howto" / "command_line.md").read_text(encoding="utf-8")
    _, help_text, _ = ended(capfd, "--help")
    for code in ExitCode:
        assert f"| {code.value} | {code.meaning} |" in page
        assert f"{code.value}: {code.meaning}" in " ".join(help_text.split())


BAD_BODY = "<robot name='r'><link name='a'>"
ROD = (
    "<robot name='rod'><link name='a'><inertial><mass value='1'/>"
    "<inertia ixx='0' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link>"
    "<link name='b'/><joint name='j' type='continuous'><parent link='a'/><child link='b'/></joint></robot>"
)


@pytest.fixture
def files(tmp_path):
    (tmp_path / "bad.urdf").write_text(BAD_BODY)
    (tmp_path / "rod.urdf").write_text(ROD)
    (tmp_path / "j.csv").write_text("time,j\n0,0\n1,1\n2,0\n")
    (tmp_path / "late.csv").write_text("time,j\n0,0\n0,1\n")
    (tmp_path / "folder.html").mkdir()
    (tmp_path / "folder.svg").mkdir()
    (tmp_path / "folder.csv").mkdir()
    return tmp_path


ENDINGS = [
    (2, "split cat"),
    (2, "split no_cat cat_righting"),
    (3, "split bad.urdf j.csv"),
    (4, "split rod.urdf late.csv"),
    (5, "split rod.urdf j.csv"),
    (6, "split cat cat_righting --html folder.html"),
    (3, "check bad.urdf"),
    (2, "orbits cat cat_righting x"),
    (5, "orbits rod.urdf j.csv 1"),
    (3, "view bad.urdf j.csv --html x.html"),
    (6, "view cat cat_righting --html folder.html"),
    (2, "plot nothing cat cat_righting --out x.svg"),
    (4, "plot attitude rod.urdf late.csv --out x.svg"),
    (6, "plot phases cat cat_righting --out folder.svg"),
    (2, "plan cat_two_halves"),
    (6, "plan cat_two_halves --turn '10 about x' --out folder.csv"),
    (2, "conjugate 1 1 2"),
    (6, "conjugate 1 2 3 --out folder.svg"),
    (6, "torques cat cat_righting --out folder.csv"),
    (6, "momentum cat cat_righting --out folder.csv"),
    (2, "momentum cat cat_righting --axes sideways"),
    (2, "rigid 1 2 3 --momentum 0 0 1 --figure orbit"),
    (6, "rigid 1 2 3 --momentum 0 0 1 --out folder.svg"),
    (2, "robots more"),
    (2, "doctor more"),
    (2, "compile more"),
    (2, "dance"),
]
"""Each code of each command that ends with it for a reason of its own."""
OF_SHARED_CODE = [
    (2, "check"),
    (2, "check no_cat"),
    (4, "check rod.urdf late.csv"),
    (3, "orbits bad.urdf j.csv 1"),
    (4, "orbits rod.urdf late.csv 1"),
    (2, "view no_cat cat_righting"),
    (4, "view rod.urdf late.csv --html x.html"),
    (5, "view rod.urdf j.csv --html x.html"),
    (3, "plot attitude bad.urdf j.csv --out x.svg"),
    (5, "plot attitude rod.urdf j.csv --out x.svg"),
    (3, "plan bad.urdf --turn '10 about x'"),
]
"""Where a command reads its files as one of those above does."""


@pytest.mark.parametrize(("code", "arguments"), full_but([*ENDINGS, *OF_SHARED_CODE], *ENDINGS))
def test_every_command_ends_with_its_code_and_one_line(capfd, files, monkeypatch, code, arguments):
    monkeypatch.chdir(files)
    before = {*files.iterdir()}
    for json_too in (False, True):
        found, out, said = ended(capfd, *shlex.split(arguments), *(["--json"] if json_too else []))
        assert found == code, said
        *doubts, last = said.splitlines()
        assert all(doubt.startswith("shapephase: warning: ") for doubt in doubts)
        assert last.startswith("shapephase: ")
        if json_too:
            assert json.loads(out)["error"]["exit_code"] == code
        else:
            assert out == ""
    assert {*files.iterdir()} == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("plan cat_two_halves --turn '60 about x' --duration -1", "--duration: a time in s above 0 is needed, got -1"),
        ("plan cat_two_halves --turn '60 about x' --duration nan", "--duration"),
        ("plan cat_two_halves --turn '60 about x' --somersaults 1", "--turn and --somersaults are two goals"),
        ("plan cat_two_halves --turn '60 about x' --half-twists 1", "--turn and --half-twists are two goals"),
        ("plan cat_two_halves --turn 'inf about x'", "--turn: degrees and an axis"),
        ("plan cat_two_halves --somersaults inf", "--somersaults: a finite number"),
        ("split cat cat_righting --smooth 0.1", "--smooth is for recorded motions"),
        ("split cat cat_righting --topic /joints", "--topic is for recorded motions"),
    ],
)
def test_options_that_do_not_fit_are_refused_at_once(capfd, arguments, words):
    code, _, said = ended(capfd, *shlex.split(arguments))
    assert code == ExitCode.USAGE
    assert words in said
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("split cat cat_righting --tolerance 1", "tolerance: a number from 1e-13"),
        ("split cat cat_righting --gauge nosuch", "unknown gauge 'nosuch'"),
        ("split cat cat_righting --gauge link:nosuch", "unknown link of cat 'nosuch'"),
        ("split cat cat_righting --attitude 0 0 0 0", "attitude: a quaternion"),
        ("split cat cat_righting --momentum nan 0 0", "momentum: entry [0] is nan"),
        ("view cat cat_righting --html x.html --trail nosuch", "unknown link of cat 'nosuch'"),
        ("view cat cat_righting --html x.html --speed -2", "--speed: seconds of motion in a second"),
        ("plot momentum cat cat_righting --out x.svg", "needs an angular momentum: give one by --momentum"),
        ("plot phases cat cat_righting --momentum 0 0 1 --gauge nosuch --out x.svg", "unknown gauge 'nosuch'"),
        ("orbits cat cat_righting 0.02 --tolerance 1", "tolerance: a number from 1e-13"),
        ("orbits cat cat_righting 0.02 --gauge nosuch", "unknown gauge 'nosuch'"),
        ("orbits cat cat_righting 0", "magnitude: a number above 0"),
    ],
)
def test_what_needs_no_motion_is_checked_before_there_is_one(capfd, tmp_path, monkeypatch, arguments, words):
    def never(*_, **__):
        raise AssertionError("it was read")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("shapephase.cli.motion.joint_motion", never)
    code, _, said = ended(capfd, *shlex.split(arguments))
    assert code == ExitCode.USAGE
    assert words in said
    assert said.count("\n") == 1


def test_orbits_takes_a_tolerance(capfd):
    code, out, _ = ended(capfd, "orbits", "cat", "cat_righting", "0.02", "--tolerance", "1e-7", "--json")
    assert code == 0
    assert json.loads(out)["tolerance_rad"] == 1e-7


@pytest.mark.parametrize("place", ["body", "motion"])
def test_a_name_that_is_too_long_is_named(capfd, place):
    for name in ("x" * 300, "x" * 300 + ".csv", "x" * 5000):
        name = name.replace(".csv", ".urdf") if place == "body" else name
        code, _, said = ended(capfd, "split", *((name, "cat_righting") if place == "body" else ("cat", name)))
        assert code == ExitCode.USAGE
        assert said.count("\n") == 1


def test_an_unknown_column_is_a_fault_of_the_motion(capfd, tmp_path):
    (tmp_path / "m.csv").write_text("time,left_shoulder_abduction,right_shoulder_abduction,tail\n0,0,0,0\n1,1,1,1\n")
    code, _, said = ended(capfd, "split", "diver", tmp_path / "m.csv")
    assert code == ExitCode.TRAJECTORY
    assert "tail" in said


def test_a_fault_of_ours_is_one_line_too(capfd, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("float division by zero")

    monkeypatch.setattr("shapephase.cli.motion.flight", broken)
    code, out, said = ended(capfd, *CAT)
    assert (code, out, said.count("\n")) == (ExitCode.INTERNAL, "", 1)
    assert "please report it" in said


@pytest.mark.full
def test_a_search_that_finds_nothing_writes_its_best_try(capfd, tmp_path):
    out = tmp_path / "plan.csv"
    small = ("--pieces", "20", "--iterations", "3")
    code, printed, said = ended(
        capfd, "plan", "cat_two_halves", "--turn", "170 about x", *small, "--out", out, "--json"
    )
    data = json.loads(printed)
    assert code == ExitCode.NOT_FOUND, said
    assert data["status"] == "not found"
    assert "no motion of the joints of cat_two_halves was found" in data["warnings"][0]
    assert out.read_text().startswith("# shapephase plan, cat_two_halves: not found; off the goal by ")
    body = sp.load_body("cat_two_halves")
    assert sp.read_shape_path(out, body).duration == 1.0


# ---- What is said ---------------------------------------------------------------------------------------------------


COUNTS = ("--every", "--about", "--starts", "--seed", "--order", "--pairs", "--pieces", "--iterations", "--workers")


def options_of(text):
    """The options in a help text, on lines wide enough for each, with their descriptions."""
    rows = [line.strip("│ ").removeprefix("*").strip() for line in text.splitlines() if line.startswith("│")]
    return {re.match(r"\S+", row)[0]: row for row in rows if re.match(r"--[a-z]|[A-Z]", row)}


def pages(option, columns):
    """The pages of help, in a process of their own: the width of a page is decided once in each."""
    source = f"""
import contextlib, io, json
from shapephase.cli.main import main
pages = {{}}
for name in {("", *ALL_COMMANDS)!r}:
    with contextlib.redirect_stdout(io.StringIO()) as page:
        main([*name.split(), {option!r}])
    pages[name] = page.getvalue()
print(json.dumps(pages))
"""
    wide = {**os.environ, "COLUMNS": str(columns)}
    done = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, env=wide, timeout=300)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def wide_pages():
    return pages("--help-all", 400)


@pytest.mark.parametrize("name", ALL_COMMANDS)
def test_every_option_has_a_sentence_and_an_example(name, wide_pages):
    found = options_of(wide_pages[name])
    assert {"--json", "--quiet", "--verbose"} <= set(found)
    for option, line in found.items():
        words = " ".join(line.split())
        assert re.search(r"[.;] .*|[.]$", words), words
        if option not in ("--quiet", "--verbose", "--help", "--version"):
            assert "for example" in words.lower(), words
        if re.search(r"\b(FLOAT|INT)\b", words) and option not in COUNTS:
            units = r"\bin (rad|s|1/s|kg|m\b|degrees|sqrt)|[Tt]urns|turns about|fraction|quaternion|Seconds|sqrt\(kg\)"
            assert re.search(units, words), words


def test_help_is_short_and_all_options_are_in_help_all(wide_pages):
    """On a terminal of 80 columns; what `--help` does not list it counts."""
    assert {name for name in app if not name.startswith("-")} <= set(ALL_COMMANDS)
    for name, page in pages("--help", 80).items():
        assert page.count("\n") < 80, name
        counted = re.search(r"^(\d+) more options: --help-all$", page, re.MULTILINE)
        if name:
            first = {option for option in options_of(wide_pages[name]) if re.search(rf"^│ *\*? *{option} ", page, re.M)}
            assert len(options_of(wide_pages[name])) - len(first) == (int(counted[1]) if counted else 0)


def coloured(*arguments, **environment):
    """What a command writes to a terminal that has colours."""
    plain = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "FORCE_COLOR")}
    command = [sys.executable, "-m", "shapephase", *arguments]
    return on_a_terminal(command, {**plain, "TERM": "xterm-256color", **environment})


def test_colours_are_for_terminals_that_want_them(capfd):
    colour = re.compile(r"\x1b\[[0-9;]*(3[0-9]|9[0-7]|4[0-9])[0-9;]*m")
    assert "\x1b" not in ended(capfd, "--help")[1]
    assert not colour.search(coloured("--help", NO_COLOR="1"))
    assert "\x1b" not in coloured("robots")


def test_completion_is_offered_for_every_shell(tmp_path):
    done = ran("--install-completion", "--shell", "bash", env={**os.environ, "HOME": str(tmp_path)})
    assert done.returncode == 0, done.stderr
    written = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert any("cat_righting" in text or "--momentum" in text for text in (path.read_text() for path in written))


def test_doctor_lists_what_is_there(capfd):
    code, text, _ = ended(capfd, "doctor", "--json")
    data = json.loads(text)
    assert code == 0
    assert data["packages"]["numpy"] == np.__version__
    assert set(data["pinocchio_features"]) >= {"WITH_URDFDOM", "WITH_SDFORMAT"}
    assert {"compiler", "cache", "browser", "python", "system"} <= set(data)
    table = ended(capfd, "doctor")[1]
    assert re.search(rf"^numpy +{re.escape(np.__version__)}$", table, re.M)
