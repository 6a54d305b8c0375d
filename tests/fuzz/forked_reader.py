"""What stands in for `run_alone`: the reading process is a fork of one that has its imports, and costs milliseconds."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import traceback
from importlib import import_module

_IMPORTED_LATE = (
    *("yaml", "h5py", "pyarrow.parquet", "openpyxl", "scipy.io", "rosbags.rosbag1", "rosbags.rosbag2", "biorbd"),
    *("xacrodoc", "shapephase.body.engines.xacro_reading", "shapephase.auditing.trajectory_audit"),
    *("yeadon", "ezc3d", "casadi", "matplotlib.pyplot", "jinja2", "pandas", "xarray", "zarr"),
    *(f"shapephase.shape_space.files.formats.{name}" for name in ("c3d", "column_tables", "hdf5", "matlab")),
    *(f"shapephase.shape_space.files.formats.{name}" for name in ("ros_motion_files", "spreadsheets")),
    *(f"shapephase.body.engines.{name}" for name in ("biorbd_reading", "yeadon_reading", "reading")),
    *("shapephase.plotting.named_figures", "shapephase.plotting.pages.motion_data", "shapephase.study.run"),
    *("shapephase.study.study_file", "shapephase.study.export"),
)
"""Modules that are imported when they are first needed."""
_CALLERS = ("body.engines.engine_tree", "shape_space.files.formats.parser_process")
"""Modules that have files read in processes of their own."""


def fork_readers() -> None:
    """Import what readers import, and let them be forks of this process from now on."""
    for name in _IMPORTED_LATE:
        import_module(name)
    for name in _CALLERS:
        import_module(f"shapephase.{name}").run_alone = forked_alone  # type: ignore[attr-defined]


def forked_alone(
    source: str, words: tuple[str, ...], data: bytes, seconds: float
) -> subprocess.CompletedProcess[bytes]:
    """As `shapephase.child_process.run_alone`, in a fork of this process."""
    with tempfile.TemporaryFile() as given, tempfile.TemporaryFile() as printed, tempfile.TemporaryFile() as said:
        given.write(data)
        given.seek(0)
        sys.stdout.flush()
        sys.stderr.flush()
        child = os.fork()
        if child == 0:
            os._exit(_read(source, words, (given.fileno(), printed.fileno(), said.fileno()), int(seconds)))
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        printed.seek(0)
        said.seek(0)
        if code == -signal.SIGALRM:
            raise subprocess.TimeoutExpired(source, seconds)
        return subprocess.CompletedProcess(source, code, printed.read(), said.read())


def _read(source: str, words: tuple[str, ...], files: tuple[int, int, int], seconds: int) -> int:
    """The exit code of the reading process."""
    for number, file in enumerate(files):
        os.dup2(file, number)
    signal.alarm(seconds)
    sys.stdin, sys.stdout, sys.stderr = open(0), open(1, "w"), open(2, "w")  # noqa: SIM115
    sys.argv = ["-c", *words]
    code = 0
    try:
        exec(source, {})
    except SystemExit as stopped:
        code = stopped.code if isinstance(stopped.code, int) else int(stopped.code is not None)
    except BaseException:
        traceback.print_exc()
        code = 1
    sys.stdout.flush()
    sys.stderr.flush()
    return code
