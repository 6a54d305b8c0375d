"""Kernels of notebooks and pages as forks of one process, which has imported what all of them import.

A kernel of its own takes four seconds of processor time before its first line. `fork_kernels` starts that process, once
for a build; each kernel is requested on a socket, whose end says that the kernel has ended.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

_MODULES = (
    "casadi",
    "ipykernel.ipkernel",
    "ipykernel.kernelapp",
    "matplotlib.backends.backend_agg",
    "matplotlib.figure",
    "mpl_toolkits.mplot3d",
    "pandas",
    "scipy.optimize",
    "scipy.spatial.transform",
    "shapephase.optimal_control",
    "shapephase.plots",
)
_INLINE = "module://matplotlib_inline.backend_inline"


def fork_kernels() -> None:
    """Start kernels as forks from now on, in this process and those that it forks."""
    from jupyter_client.provisioning import local_provisioner

    folder = tempfile.mkdtemp()
    address = str(Path(folder) / "kernels")
    path = os.pathsep.join([str(Path(__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])])
    server = subprocess.Popen(
        [sys.executable, "-m", "_site.forked_kernels", address],
        env=os.environ | {"PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": _INLINE},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert server.stdin is not None
    assert server.stdout is not None
    server.stdout.readline()
    stdin, owner = server.stdin, os.getpid()

    def stop() -> None:
        if os.getpid() == owner:
            stdin.close()
            server.wait()
            shutil.rmtree(folder)

    atexit.register(stop)
    launch: Any = local_provisioner
    launch.launch_kernel = lambda command, **given: ForkedKernel(address, command, given)


class ForkedKernel:
    """A kernel with what its manager uses of a `subprocess.Popen`."""

    stdin = stdout = stderr = None

    def __init__(self, address: str, command: list[str], given: dict[str, Any]) -> None:
        self._line = socket.socket(socket.AF_UNIX)
        self._line.connect(address)
        words = {"words": command[3:], "folder": given["cwd"] or os.getcwd(), "environment": dict(given["env"])}
        self._line.sendall(json.dumps(words).encode() + b"\n")
        self.pid = int(self._line.makefile().readline())
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """0 where the kernel has ended, None before."""
        if self.returncode is None and select.select([self._line], [], [], 0.0)[0]:
            self.returncode = 0
            self._line.close()
        return self.returncode

    def wait(self) -> int:
        """Wait for its end."""
        if self.returncode is None:
            select.select([self._line], [], [])
        return self.poll() or 0

    def send_signal(self, number: int) -> None:
        """Send a signal to a kernel that runs."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        """End it."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)


def _serve(address: str) -> None:
    """Fork a kernel for each connection until the standard input ends."""
    for name in _MODULES:
        import_module(name)
    _use_the_library()
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(address)
        listener.listen()
        print("ready", flush=True)
        while True:
            if sys.stdin in select.select([listener, sys.stdin], [], [])[0]:
                break
            line, _ = listener.accept()
            if os.fork() == 0:
                listener.close()
                _run(line)
            line.close()
    with contextlib.suppress(ChildProcessError):
        while True:
            os.wait()


def _use_the_library() -> None:
    """Load the machine code of its loops."""
    import shapephase as sp

    cat = sp.load_body("cat_two_halves")
    sp.split(sp.reconstruct(sp.articulated(cat, sp.examples.kane_scher(0.1, 0.5)), [0.0, 0.0, 0.01]))


def _run(line: socket.socket) -> NoReturn:
    """Be the kernel, in a session of its own; the line stays open as long as it lives."""
    given = json.loads(line.makefile().readline())
    os.setsid()
    line.sendall(f"{os.getpid()}\n".encode())
    os.chdir(given["folder"])
    os.environ.clear()
    os.environ.update(given["environment"], MPLBACKEND=_INLINE, OPENBLAS_NUM_THREADS="1")
    os.dup2(os.open(os.devnull, os.O_RDWR), 0)
    os.dup2(2, 1)
    from ipykernel.kernelapp import launch_new_instance

    status = 1
    try:
        launch_new_instance(argv=[*given["words"], f"--IPKernelApp.parent_handle={os.getppid()}"])
        status = 0
    finally:
        os._exit(status)


if __name__ == "__main__":
    _serve(sys.argv[1])
