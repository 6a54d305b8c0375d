"""What a new user and an attacker tried once, where something gave way; and the test of each row.

| what was tried | tests |
|---|---|
| a momentum of a billion turns | `reconstruction/test_reconstruction.py::test_more_turns_than_can_be_stepped_are_refused_before_memory_is_taken`, `test_rough_edges.py::test_a_momentum_of_a_billion_turns_is_one_line` |
| the reader of a pipe stops | `cli/test_endings.py::test_a_reader_that_stops_early_is_no_fault`, `cli/test_endings.py::test_an_error_in_a_pipe_that_nobody_reads` |
| Ctrl-C during imports and long runs | `cli/test_endings.py::test_ctrl_c_at_any_time_is_one_line_and_130`, `cli/test_endings.py::test_ctrl_c_within_a_command` |
| an unknown CSV column | `cli/test_endings.py::test_an_unknown_column_is_a_fault_of_the_motion` |
| `plan --duration -1` | `cli/test_endings.py::test_options_that_do_not_fit_are_refused_at_once` |
| times of 1e-320 s | `shape_space/files/test_hostile_numbers.py::test_times_whose_powers_overflow` |
| a file name of 300 characters | `cli/test_endings.py::test_a_name_that_is_too_long_is_named`, `test_files.py::test_the_longest_names_there_are_can_be_written` |
| an array that only its header has | `shape_space/files/test_hostile_numbers.py::test_an_array_that_only_its_header_has` |
| a CSV of a million rows | `test_rough_edges.py::test_a_recording_of_a_million_rows` |
| hundreds of meshes in a page | `body/test_appearance.py::test_more_triangles_than_a_page_holds_are_drawn_as_hulls`, `body/test_appearance.py::test_more_shapes_than_a_page_holds_are_drawn_as_one_hull` |
| YAML with merge keys and negative times, XML in another encoding than it says | `shape_space/files/test_hostile_numbers.py::test_yaml_that_means_something_else_than_it_seems`, `shape_space/files/test_hostile_numbers.py::test_an_encoding_that_is_said_and_not_used` |
| names of links and joints in exotic Unicode | `plots/test_hostile_names.py::test_pages_and_reports_of_models_with_unprintable_names`, `plots/test_hostile_names.py::test_in_a_browser_no_name_runs_a_script_or_asks_for_anything_and_nothing_fails`, `test_rough_edges.py::test_every_command_takes_hostile_names` |
| `check` on a torso of 60,000 kg, a link of 1e-9 kg | `body/test_plausibility.py::test_a_torso_of_sixty_tonnes`, `body/test_plausibility.py::test_a_link_of_a_microgram`, `body/test_plausibility.py::test_check_says_so_and_shows_the_parts` |
| `reconstruct(path)`, `split(deformation)` | `test_objects.py::test_a_wrong_object_gets_a_sentence` |
| `path.sample_times *= 0.5` | `test_objects.py::test_what_attributes_show_of_the_inside_cannot_be_written_to`, `test_objects.py::test_times_of_a_path_cannot_be_scaled_in_place` |
| one array filled three times | `test_objects.py::test_the_caller_s_arrays_are_copied_at_once`, `test_objects.py::test_three_paths_of_one_array_are_three_paths` |
| output to a device, a named pipe, a symbolic link, a file of mode 0600 | `test_files.py::test_a_named_pipe_gets_the_bytes_and_stays_a_pipe`, `test_files.py::test_a_terminal_gets_the_bytes_and_stays_a_terminal`, `test_files.py::test_a_symbolic_link_stays_and_what_it_leads_to_is_replaced`, `test_files.py::test_a_file_that_is_replaced_keeps_its_mode` |
| eight threads that write | `test_files.py::test_the_umask_of_the_process_is_never_touched` |
| two threads that make pages | `plots/test_viewer.py::test_pages_are_made_in_two_threads_and_the_streams_of_the_process_stay_as_they_are` |
| `--out` that is a folder, a full disk, `--json > /dev/full` | `cli/test_endings.py::test_what_cannot_be_written_is_said_before_anything_is_computed`, `cli/test_endings.py::test_standard_output_that_is_full`, `test_rough_edges.py::test_a_full_disk_is_one_line_and_leaves_the_old_file`, `test_writers.py::test_a_full_disk_leaves_the_old_file` |
| joint names such as `$x_$` in figures | `plots/test_hostile_names.py::test_a_figure_shows_the_letters_of_a_name`, `plots/test_hostile_names.py::test_every_name_has_its_line_in_the_legend` |
| `fixed_points` and `orbits` at three turns a loop | `phases/test_return_map.py::test_fixed_points_of_an_unstable_loop_close_by_another_integrator`, `cli/test_endings.py::test_orbits_takes_a_tolerance` |
| pickling gauges and motions by DOP853 | `test_objects.py::test_they_pickle_and_copy`, `test_objects.py::test_what_is_made_of_a_lambda_says_so_and_is_copied_all_the_same` |
| a recording of 200,000 rows, a report of 10,000 | `test_rough_edges.py::test_a_long_recording_takes_bounded_memory`, `plots/test_plots.py::test_long_curves_are_images_within_the_figure` |
| `x.NPZ` | `cli/test_endings.py::test_what_was_written_is_said_unless_it_is_quiet`, `cli/test_endings.py::test_endings_in_any_case` |
| `kill -9` while writing | `test_files.py::test_killed_at_random_times_a_writer_leaves_no_half`, `test_writers.py::test_a_writer_that_is_killed_leaves_the_old_file_or_the_new_one` |
| `--turn` with `--somersaults` | `cli/test_endings.py::test_options_that_do_not_fit_are_refused_at_once`, `cli/test_endings.py::test_what_needs_no_motion_is_checked_before_there_is_one` |
| files written in silence | `cli/test_endings.py::test_what_was_written_is_said_unless_it_is_quiet` |
| `plan --out` that finds nothing | `cli/test_endings.py::test_a_search_that_finds_nothing_writes_its_best_try` |
| options without help | `cli/test_endings.py::test_every_option_has_a_sentence_and_an_example` |
"""  # noqa: E501

from __future__ import annotations

import ast
import json
import os
import re
import resource
import subprocess
import sys

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from shapephase.cli.outcome import ExitCode
from support.hostile_names import OF_FILES, star_urdf, swinging
from support.long_runs import full_but
from support.places import ROOT

assert __doc__ is not None
ROWS = {
    row[0].strip(): re.findall(r"`([a-z_/]+\.py)::([a-z_0-9]+)`", row[1])
    for row in re.findall(r"^\| (.*?) \| (`.*`) \|$", __doc__, re.MULTILINE)
}


def ran(*arguments, **options):
    command = [sys.executable, "-m", "shapephase", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, **options)


def most_memory_of(*arguments):
    """A command that ends well, and the most memory that it had [bytes]."""
    source = (
        "import resource, subprocess, sys\n"
        "done = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=sys.stderr)\n"
        "print(done.returncode, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    command = [sys.executable, "-c", source, sys.executable, "-m", "shapephase", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    code, kilobytes = map(int, done.stdout.split())
    return code, 1024 * kilobytes, done.stderr


@pytest.mark.parametrize("row", ROWS)
def test_every_row_has_its_tests(row):
    assert len(ROWS) == 30
    assert ROWS[row]
    for file, name in ROWS[row]:
        tree = ast.parse((ROOT / "tests" / file).read_text(encoding="utf-8"))
        assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, f"{file}::{name}"


def test_a_momentum_of_a_billion_turns_is_one_line():
    code, memory, said = most_memory_of("split", "cat", "cat_righting", "--momentum", "1e9", "0", "0")
    assert code == ExitCode.NUMERICS
    assert re.fullmatch(r"shapephase: the body turns up to \S+ times in 2 s, which takes some .*\n", said)
    assert memory < 500e6


@pytest.mark.usefixtures("warm_readers")
def test_every_command_takes_hostile_names(tmp_path, monkeypatch, capsys):
    """Names with commas and semicolons, too: the motion is an NPZ file, whose columns are no line of text."""
    (tmp_path / "star.urdf").write_text(star_urdf(OF_FILES), encoding="utf-8")
    body = sp.load_body(tmp_path / "star.urdf")
    sp.write_shape_path(swinging(body), tmp_path / "star.npz", np.linspace(0.0, 1.0, 21))
    monkeypatch.chdir(tmp_path)
    for arguments in (
        "check star.urdf star.npz --json",
        "split star.urdf star.npz --momentum 0 0.1 1 --html star.html --json",
        "plot shape star.urdf star.npz --out star.pdf --json",
    ):
        main(arguments.split())
        said = capsys.readouterr()
        data = json.loads(said.out)
        assert data["warnings"] == []
        if "body" in data and arguments.startswith("check"):
            assert {joint["name"] for joint in data["body"]["joints"]} == {*OF_FILES}
        main(re.sub(r" --html \S+| --json", "", arguments).split())
        assert all(letter.isprintable() or letter == "\n" for letter in capsys.readouterr().out)


@pytest.mark.parametrize("option", full_but(["--out", "--html"], "--out"))
def test_a_full_disk_is_one_line_and_leaves_the_old_file(tmp_path, option):
    """A limit of the size of files, as a full disk gives it: the system refuses half way through."""
    out = tmp_path / {"--out": "m.npz", "--html": "m.html"}[option]
    out.write_text("old")
    limit = {"--out": 1024, "--html": 64 * 1024}[option]
    done = ran(
        *("split", "cat", "cat_righting", option, out),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
        env={**os.environ, "MPLCONFIGDIR": str(tmp_path.parent)},
    )
    assert done.returncode == ExitCode.OUTPUT
    assert done.stderr == f"shapephase: cannot write {out}: File too large\n"
    assert out.read_text() == "old"
    assert list(tmp_path.iterdir()) == [out]


def swings(file, rows):
    """A recording of the diver's arms, a hundred samples a second."""
    times = 0.01 * np.arange(rows)
    arms = np.sin(np.outer(times, [1.0, 1.3]))
    with open(file, "w", encoding="utf-8") as stream:
        stream.write("time,left_shoulder_abduction,right_shoulder_abduction\n")
        np.savetxt(stream, np.column_stack([times, arms]), delimiter=",", fmt="%.9f")
    return file


@pytest.mark.full
@pytest.mark.parametrize("rows", [400_101, pytest.param(1_000_000, marks=pytest.mark.full)])
def test_a_recording_of_a_million_rows(tmp_path, rows):
    """It is read, and refused with what would do, in the memory that its numbers take."""
    file = tmp_path / "long.csv"
    # Arms that go up and down in a straight line, which are written quicker than a sine.
    file.write_text(
        "time,left_shoulder_abduction,right_shoulder_abduction\n"
        + "".join(f"{k // 100}.{k % 100:02}0000000,0.{k % 2}00000000,0.{k % 5}00000000\n" for k in range(rows))
    )
    code, memory, said = most_memory_of("split", "diver", file)
    assert code == ExitCode.TRAJECTORY
    assert said.count("\n") == 1
    assert f"a motion in {rows - 1} pieces" in said
    (rate,) = re.findall(r"resample=(\S+) or less", said)
    assert 0.9 * 400_000 < float(rate) * 0.01 * (rows - 1) <= 400_000
    assert memory < 200e6 + 600.0 * rows


@pytest.mark.full
@pytest.mark.parametrize(
    ("rows", "momentum"),
    [(2_000, 10), pytest.param(200_000, 0, marks=pytest.mark.full), pytest.param(200_000, 10, marks=pytest.mark.full)],
)
def test_a_long_recording_takes_bounded_memory(tmp_path, rows, momentum):
    file = swings(tmp_path / "long.csv", rows)
    # Rounding of so many samples alone comes to more than 1e-9 rad over half an hour of turning.
    tolerance = 1e-7 if rows > 100_000 and momentum else 1e-9
    options = ("--momentum", 0, 0, momentum, "--tolerance", tolerance)
    code, memory, _ = most_memory_of("split", "diver", file, *options)
    assert code == ExitCode.DONE
    assert memory < 450e6 + 30e3 * rows
