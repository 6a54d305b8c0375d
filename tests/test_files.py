"""Files are written whole or not at all, wherever they go and whenever the writer dies."""

from __future__ import annotations

import io
import os
import pty
import re
import resource
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import threading
import time
import tty
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import InputFileNotFoundError, OutputFileError
from shapephase.files import size_text, write_whole

# Writes one of two texts over and over, in small pieces; after `ready` it may die at any time.
SHORT_WRITER = """
import os, sys
from shapephase.files import write_whole
target = sys.argv[1]
print("ready", flush=True)
while True:
    for letter in (b"a", b"b"):
        write_whole(target, lambda stream: [stream.write(letter * 4096) for _ in range(64)])
"""
AS_NOBODY = 65534


def content(text: str):
    """A writer of a text."""
    return lambda stream: stream.write(text.encode())


@contextmanager
def someone_else():
    """As another user than root, for whom permissions count."""
    if os.geteuid():
        yield
        return
    os.setegid(AS_NOBODY)
    os.seteuid(AS_NOBODY)
    try:
        yield
    finally:
        os.seteuid(0)
        os.setegid(0)


@pytest.fixture
def open_folder():
    """A folder that anyone may use: those above pytest's own are closed to others whenever it starts anew."""
    with tempfile.TemporaryDirectory() as made:
        os.chmod(made, 0o777)
        yield Path(made)


@pytest.mark.parametrize("trials", [8, pytest.param(200, marks=pytest.mark.full)])
def test_killed_at_random_times_a_writer_leaves_no_half(trials: int, tmp_path: Path):
    target = tmp_path / "whole.txt"
    rng = np.random.default_rng(7)
    for _ in range(trials):
        writer = subprocess.Popen([sys.executable, "-c", SHORT_WRITER, str(target)], stdout=subprocess.PIPE)
        assert writer.stdout is not None
        assert writer.stdout.readline() == b"ready\n"
        while not target.exists() and writer.poll() is None:
            time.sleep(0.001)
        time.sleep(rng.uniform(0.0, 0.02))
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        writer.stdout.close()
        assert target.read_bytes() in (b"a" * 2**18, b"b" * 2**18)
    interrupted = set(tmp_path.iterdir()) - {target}
    assert all(re.fullmatch(r"\.[0-9a-f]{16}\.part", file.name) for file in interrupted)
    # Else no writer was killed while it wrote.
    assert interrupted or trials < 200
    write_whole(target, content("last"))
    assert target.read_text() == "last"
    assert set(tmp_path.iterdir()) == {target, *interrupted}


def test_a_writer_within_a_writer_of_the_same_file_is_whole(tmp_path: Path):
    target, inner = tmp_path / "data.csv", []

    def write(stream):
        stream.write(b"outer")
        write_whole(target, content("inner"))
        inner.append(target.read_text())

    write_whole(target, write)
    assert inner == ["inner"]
    assert target.read_text() == "outer"
    assert list(tmp_path.iterdir()) == [target]


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path: Path):
    target = tmp_path / "kept.txt"
    target.write_text("old")

    def fail(stream):
        stream.write(b"half of the new")
        raise RuntimeError("the disk is on fire")

    with pytest.raises(RuntimeError, match="fire"):
        write_whole(target, fail)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o000])
def test_permissions_are_those_of_any_new_file(tmp_path: Path, mask: int):
    plain, whole = tmp_path / "plain", tmp_path / "whole"
    before = os.umask(mask)
    try:
        plain.write_text("x")
        write_whole(whole, content("x"))
    finally:
        os.umask(before)
    assert whole.stat().st_mode == plain.stat().st_mode


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o755])
def test_a_file_that_is_replaced_keeps_its_mode(tmp_path: Path, mode: int):
    target = tmp_path / "kept"
    target.write_text("old")
    target.chmod(mode)
    write_whole(target, content("new"))
    assert target.read_text() == "new"
    assert stat.S_IMODE(target.stat().st_mode) == mode


def test_the_umask_of_the_process_is_never_touched(tmp_path: Path):
    """Eight threads write while others make files of their own: all have the mode that the umask leaves."""
    before = os.umask(0o027)
    done = threading.Event()
    modes = set()

    def make(k: int) -> None:
        while not done.is_set():
            made = tmp_path / f"made{k}"
            made.write_text("x")
            modes.add(stat.S_IMODE(made.stat().st_mode))
            made.unlink()

    def write(k: int) -> None:
        for _ in range(30):
            write_whole(tmp_path / f"written{k}", content("x"))

    try:
        makers = [threading.Thread(target=make, args=(k,)) for k in range(2)]
        writers = [threading.Thread(target=write, args=(k,)) for k in range(8)]
        for thread in (*makers, *writers):
            thread.start()
        for thread in writers:
            thread.join()
        done.set()
        for thread in makers:
            thread.join()
        after = os.umask(before)
    finally:
        os.umask(before)
    assert after == 0o027
    assert modes == {0o640}
    assert {stat.S_IMODE((tmp_path / f"written{k}").stat().st_mode) for k in range(8)} == {0o640}


def test_a_symbolic_link_stays_and_what_it_leads_to_is_replaced(tmp_path: Path):
    folder = tmp_path / "folder"
    folder.mkdir()
    target, near, far = folder / "target.txt", tmp_path / "near", tmp_path / "far"
    target.write_text("old")
    target.chmod(0o600)
    near.symlink_to("folder/target.txt")
    far.symlink_to(near)
    write_whole(far, content("new"))
    assert far.is_symlink()
    assert near.is_symlink()
    assert target.read_text() == "new"
    assert stat.S_IMODE(target.stat().st_mode) == 0o600
    assert list(folder.iterdir()) == [target]
    dangling = tmp_path / "dangling"
    dangling.symlink_to(folder / "made.txt")
    write_whole(dangling, content("made"))
    assert dangling.is_symlink()
    assert (folder / "made.txt").read_text() == "made"
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    with pytest.raises(OutputFileError, match="loop"):
        write_whole(loop, content("x"))


def test_a_named_pipe_gets_the_bytes_and_stays_a_pipe(tmp_path: Path):
    pipe, received = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: received.append(pipe.read_bytes()))
    reader.start()
    sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), [0.1, 0.2, 0.3]).save(pipe)
    reader.join()
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert list(tmp_path.iterdir()) == [pipe]
    assert np.load(io.BytesIO(received[0]))["spatial_momentum"].tolist() == [0.1, 0.2, 0.3]


def test_a_terminal_gets_the_bytes_and_stays_a_terminal():
    reader, writer = pty.openpty()
    tty.setraw(writer)
    device = os.ttyname(writer)
    before = os.stat(device)
    write_whole(device, content("bytes for a terminal"))
    assert os.read(reader, 100) == b"bytes for a terminal"
    after = os.stat(device)
    os.close(reader)
    os.close(writer)
    assert stat.S_ISCHR(after.st_mode)
    assert (after.st_rdev, after.st_ino) == (before.st_rdev, before.st_ino)


@pytest.mark.parametrize("name", ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"])
@pytest.mark.parametrize("into", ["pipe", "file"])
def test_standard_output_is_written_to_as_a_stream(tmp_path: Path, name: str, into: str):
    """Also where the shell sent it to a file, which goes on after what was there before."""
    source = f"""
import sys
from shapephase.files import write_whole
print("before", flush=True)
write_whole({name!r}, lambda stream: stream.write(b"within\\n"))
print("after", flush=True)
"""
    if name.startswith("/proc") and not Path("/proc/self/fd").is_dir():
        pytest.skip("no /proc on this system")
    out = tmp_path / "out"
    with out.open("wb") as file:
        stdout = subprocess.PIPE if into == "pipe" else file
        done = subprocess.run([sys.executable, "-c", source], stdout=stdout, check=True)
    assert (done.stdout or out.read_bytes()) == b"before\nwithin\nafter\n"


def test_a_pipe_that_nobody_reads_any_more_is_no_fault_of_the_file(tmp_path: Path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: os.close(os.open(pipe, os.O_RDONLY)))
    reader.start()
    with pytest.raises(BrokenPipeError):
        write_whole(pipe, lambda stream: stream.write(bytes(2**22)))
    reader.join()


def test_what_cannot_be_written_is_named_and_nothing_is_left(open_folder: Path):
    folder = open_folder / "folder"
    folder.mkdir()
    with pytest.raises(OutputFileError, match="folder"):
        write_whole(folder, content("x"))
    with pytest.raises(InputFileNotFoundError, match="folder"):
        write_whole(open_folder / "none" / "x", content("x"))
    with pytest.raises(OutputFileError, match="long"):
        write_whole(open_folder / ("x" * 300), content("x"))
    with pytest.raises(OutputFileError, match="null"):
        write_whole("a\0b", content("x"))
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(open_folder / "socket"))
        with pytest.raises(OutputFileError, match="neither"):
            write_whole(open_folder / "socket", content("x"))
    (open_folder / "socket").unlink()
    closed, kept = open_folder / "closed", open_folder / "kept.txt"
    closed.mkdir(mode=0o555)
    kept.write_text("old")
    kept.chmod(0o444)
    with someone_else():
        with pytest.raises(OutputFileError, match="nothing"):
            write_whole(closed / "x", content("x"))
        with pytest.raises(OutputFileError, match="written"):
            write_whole(kept, content("new"))
    assert kept.read_text() == "old"
    assert {*open_folder.iterdir()} == {folder, closed, kept}


@pytest.mark.parametrize("length", [255, 250, 240])
def test_the_longest_names_there_are_can_be_written(tmp_path: Path, length: int):
    for letter in ("x", "ä"):
        target = tmp_path / (letter * (length // len(letter.encode())))
        write_whole(target, content("whole"))
        assert target.read_text() == "whole"
        target.unlink()
    assert not list(tmp_path.iterdir())


def test_a_full_disk_leaves_the_old_file(tmp_path: Path):
    """A limit of the size of files, as a full disk gives it: the system refuses half way through."""
    target = tmp_path / "kept.txt"
    target.write_text("old")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2**16, limits[1]))
    try:
        with pytest.raises(OutputFileError, match=r"kept\.txt"):
            write_whole(target, lambda stream: [stream.write(bytes(4096)) for _ in range(100)])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_disk_that_may_only_be_read_is_refused_also_to_root(tmp_path: Path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mounting = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(disk)]
    if os.geteuid() or subprocess.run(mounting, capture_output=True).returncode:
        pytest.skip("nothing may be mounted here")
    try:
        (disk / "kept").write_text("old")
        subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
        for name in ("kept", "new"):
            with pytest.raises(OutputFileError, match=name):
                write_whole(disk / name, content("x"))
        assert (disk / "kept").read_text() == "old"
        assert [*disk.iterdir()] == [disk / "kept"]
    finally:
        subprocess.run(["umount", "--lazy", str(disk)], check=True)


def test_sizes_for_people(tmp_path: Path):
    file = tmp_path / "file"
    for size, text in (
        (0, "0 bytes"),
        (999, "999 bytes"),
        (29_400, "29.4 kB"),
        (512_000, "512 kB"),
        (1_230_000, "1.2 MB"),
    ):
        file.write_bytes(bytes(size))
        assert size_text(file) == text


def test_a_file_that_is_not_there_is_answered_by_its_neighbours(tmp_path):
    """Whatever reads it: the nearest names of its folder, or how to see them."""
    (tmp_path / "walking.csv").write_text("time\n0\n1\n")
    with pytest.raises(sp.errors.InputFileNotFoundError, match=r"walking\.csv"):
        sp.read_shape_path(tmp_path / "walkin.csv", sp.load_body("cat"))
    with pytest.raises(sp.errors.InputFileNotFoundError, match="ls"):
        sp.load_body(tmp_path / "robot.urdf")
    with pytest.raises(sp.errors.InputFileNotFoundError, match="folder"):
        sp.load_body(tmp_path / "nowhere" / "robot.urdf")
