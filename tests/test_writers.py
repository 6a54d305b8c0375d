"""Every writer under torture: killed, on full disks, where it may not write, and into whatever is no file.

The old file or the new one is there whole, a failed write leaves nothing else, one line says why, and the exit code
is 6.
"""

from __future__ import annotations

import os
import socket
import stat
import subprocess
import tempfile
import threading
from contextlib import contextmanager
from pathlib import Path

import pytest

from shapephase.cli.outcome import ExitCode
from support.writing_process import AS_NOBODY, COMMANDS, WRITERS, WritingProcess, is_whole

QUICK = ("split.npz",)
READ = (("check", "--srdf"), ("plan", "--srdf"))  # files that are options, too
AS_ROOT = pytest.mark.skipif(os.geteuid() != 0, reason="needs another user to write as")
# Standard error is a file here, too, and has to hold its line [bytes].
WHAT_IS_SAID = 512
# Of a page of memory, in which a file system without a disk counts [bytes].
PAGE = 4096


@pytest.fixture(scope="module")
def process():
    running = []

    def started():
        if not running:
            running.append(WritingProcess(*QUICK))
        return running[0]

    yield started
    for one in running:
        one.stop()


@pytest.fixture(scope="module")
def process_of_all():
    """As above, with all that any writer imports."""
    one = WritingProcess(*WRITERS)
    yield lambda: one
    one.stop()


@pytest.fixture
def place():
    """Where anyone may write: those above pytest's own folders are closed to others whenever it starts anew."""
    with tempfile.TemporaryDirectory() as made:
        os.chmod(made, 0o777)
        yield Path(made)


@pytest.fixture
def folder(place):
    """An empty one, beside another for what is said."""
    for name in ("said", "folder"):
        (place / name).mkdir()
        (place / name).chmod(0o777)
    return place / "folder"


def writers(quick=QUICK):
    """All of them, the quick ones not marked."""
    return [pytest.param(name, marks=[] if name in quick else pytest.mark.full) for name in WRITERS]


@pytest.fixture
def write(request, folder):
    """How one of the writers ends."""
    writer = request.node.callspec.params["writer"]
    fixture = "process" if writer in QUICK else "process_of_all"
    running = request.getfixturevalue(fixture)()

    def ask(target, **options):
        return running.ask(writer=writer, target=target, folder=folder.parent / "said", **options)

    return ask


def refused(answer):
    """It ended with 6, one line on standard error, and nothing on standard output."""
    assert answer["code"] == ExitCode.OUTPUT, answer
    said = answer["said"].splitlines()
    assert len(said) == 1, answer
    assert said[0].startswith("shapephase: cannot write ")
    assert answer["printed"] == ""
    return said[0]


def test_every_writer_of_the_command_line_is_tried():
    from shapephase.cli.main import app

    offered = set()
    for name in app:
        if not name.startswith("-"):
            arguments = app[name].assemble_argument_collection()
            offered |= {(name, one.name) for one in arguments if "Path" in str(one.hint)}
    # A film takes a browser, too slow to be killed hundreds of times; its file goes the way of the others, as do the
    # two files of SPICE.
    assert offered - {("view", "--video"), ("rigid", "--video"), ("export", "--ck"), *READ} == {
        (words[0], words[-1]) for words in COMMANDS.values()
    }


@pytest.mark.parametrize(
    ("writer", "trials"),
    [(QUICK[0], 6), *(pytest.param(name, 200, marks=pytest.mark.full) for name in WRITERS)],
)
def test_a_writer_that_is_killed_leaves_the_old_file_or_the_new_one(writer, trials, folder, write):
    target = folder / f"target.{writer.split('.')[1]}"
    found = write(target, trials=trials, seed=20)
    assert found["differ"]
    assert found["torn"] == 0
    assert (found["code"], found["whole"]) == (0, True)
    # Else nothing was killed while it wrote.
    assert found["interrupted"] > 0 or trials < 200


@pytest.mark.parametrize("writer", writers())
def test_a_limit_of_the_size_of_files_leaves_the_old_file(writer, folder, write):
    """As a full disk: the system refuses in the middle or at the last byte, wherever it does."""
    target = folder / f"target.{writer.split('.')[1]}"
    assert write(target)["code"] == 0
    old, size = target.read_bytes(), target.stat().st_size
    for limit in sorted({WHAT_IS_SAID, *(size * k // 9 for k in range(1, 9)), size - 100, size - 1}):
        said = refused(write(target, version=0, limit=limit))
        assert said.endswith(": File too large")
        assert target.read_bytes() == old
        assert list(folder.iterdir()) == [target]
    target.unlink()
    refused(write(target, version=0, limit=size // 2))
    assert list(folder.iterdir()) == []


@contextmanager
def small_disk(place, size):
    """A file system of so many bytes in memory; skipped where that is not allowed."""
    place.mkdir()
    mounting = ["mount", "-t", "tmpfs", "-o", f"size={size},mode=0777", "tmpfs", str(place)]
    if os.geteuid() or subprocess.run(mounting, capture_output=True).returncode:
        pytest.skip("nothing may be mounted here")
    try:
        yield place
    finally:
        subprocess.run(["umount", "--lazy", str(place)], check=True)


@pytest.mark.full
@pytest.mark.parametrize("writer", WRITERS)
def test_a_full_disk_leaves_the_old_file(writer, folder, write, place):
    target = folder / f"target.{writer.split('.')[1]}"
    assert write(target)["code"] == 0
    size = -(-target.stat().st_size // PAGE) * PAGE
    with small_disk(place / "disk", 4 * size + 64 * PAGE) as disk:
        target, filler = disk / target.name, disk / "filler"
        assert write(target)["code"] == 0
        old = target.read_bytes()
        for free in sorted({0, PAGE, size // 2 // PAGE * PAGE, size - PAGE} - {size}):
            filler.write_bytes(b"x" * (os.statvfs(disk).f_bavail * PAGE - free))
            said = refused(write(target))
            assert said.endswith(": No space left on device")
            assert target.read_bytes() == old
            assert {*disk.iterdir()} == {target, filler}
            filler.unlink()
        assert write(target, version=1)["code"] == 0
        assert list(disk.iterdir()) == [target]


@pytest.mark.parametrize("writer", writers())
def test_a_disk_that_may_only_be_read_is_refused_also_to_root(writer, write, place):
    with small_disk(place / "disk", 2**26) as disk:
        target = disk / f"target.{writer.split('.')[1]}"
        target.write_bytes(b"old")
        subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
        refused(write(target))
        refused(write(target.with_stem("new")))
        assert target.read_bytes() == b"old"
        assert list(disk.iterdir()) == [target]


@AS_ROOT
@pytest.mark.parametrize("writer", writers())
def test_what_may_not_be_written_to_stays_as_it_is(writer, folder, write):
    """Files and folders of another user, or of modes that forbid it."""
    name = f"target.{writer.split('.')[1]}"
    closed, kept, own = folder / "closed", folder / name, folder / f"own{name}"
    closed.mkdir()
    for file, mode, owner in ((closed / name, 0o666, 0), (kept, 0o644, 0), (own, 0o444, AS_NOBODY)):
        file.write_bytes(b"old")
        file.chmod(mode)
        os.chown(file, owner, owner)
    closed.chmod(0o555)
    link = folder / f"link{name}"
    link.symlink_to(closed / f"new{name}")
    for target in (closed / name, closed / f"new{name}", link, kept, own):
        refused(write(target, nobody=True))
    for file in (closed / name, kept, own):
        assert file.read_bytes() == b"old"
    assert {*folder.iterdir()} == {closed, kept, own, link}
    assert [*closed.iterdir()] == [closed / name]
    # And the same where it is allowed: another user's file that anyone may write to, in a folder where anyone may.
    kept.chmod(0o666)
    assert write(kept, nobody=True)["code"] == 0
    assert is_whole(kept.read_bytes(), writer)
    assert stat.S_IMODE(kept.stat().st_mode) == 0o666


@pytest.mark.full
@pytest.mark.parametrize("writer", WRITERS)
def test_what_is_no_file_is_refused_and_stays(writer, folder, write):
    ending = writer.split(".")[1]
    directory, loop, socketed = (folder / f"{name}.{ending}" for name in ("directory", "loop", "socket"))
    to_directory, too_long = folder / f"to_directory.{ending}", folder / f"{'x' * 300}.{ending}"
    directory.mkdir()
    loop.symlink_to(loop)
    to_directory.symlink_to(directory)
    with socket.socket(socket.AF_UNIX) as listening:
        before = Path.cwd()
        # Names of sockets are short.
        os.chdir(folder)
        listening.bind(socketed.name)
        os.chdir(before)
        for target in (directory, to_directory, loop, socketed, too_long):
            refused(write(target))
    if Path("/dev/full").exists():
        full = folder / f"full.{ending}"
        full.symlink_to("/dev/full")
        assert refused(write(full)).endswith(": No space left on device")
        full.unlink()
    assert {*folder.iterdir()} == {directory, to_directory, loop, socketed}
    assert list(directory.iterdir()) == []


@pytest.mark.parametrize("writer", writers())
def test_links_are_followed_and_pipes_get_all_bytes(writer, folder, write):
    ending = writer.split(".")[1]
    target, link, dangling = (folder / f"{name}.{ending}" for name in ("target", "link", "dangling"))
    pipe, out = folder / f"pipe.{ending}", folder / f"out.{ending}"
    target.write_bytes(b"old")
    target.chmod(0o600)
    link.symlink_to(target.name)
    dangling.symlink_to(f"made.{ending}")
    for place in (link, dangling):
        assert write(place)["code"] == 0
        assert place.is_symlink()
        assert is_whole(place.read_bytes(), writer)
    assert stat.S_IMODE(target.stat().st_mode) == 0o600
    os.mkfifo(pipe)
    received = []
    reader = threading.Thread(target=lambda: received.append(pipe.read_bytes()))
    reader.start()
    assert write(pipe)["code"] == 0
    reader.join()
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert is_whole(received[0], writer)
    out.symlink_to("/dev/stdout")
    answer = write(out)
    assert answer["code"] == 0
    assert is_whole(answer["printed"].encode("latin-1"), writer)
    assert out.is_symlink()
    assert {*folder.iterdir()} == {target, link, dangling, pipe, out, folder / f"made.{ending}"}
