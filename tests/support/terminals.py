"""Programs whose output is a terminal."""

from __future__ import annotations

import os
import pty
import subprocess
from collections.abc import Mapping


def on_a_terminal(command: list[str], env: Mapping[str, str] | None = None) -> str:
    """What a program writes to a terminal, standard error included."""
    reader, writer = pty.openpty()
    process = subprocess.Popen(command, stdout=writer, stderr=writer, env=env, close_fds=True)
    os.close(writer)
    received = b""
    while True:
        try:
            part = os.read(reader, 65536)
        # Linux's answer when the last writer has gone.
        except OSError:
            break
        if not part:
            break
        received += part
    os.close(reader)
    process.wait(timeout=300)
    return received.decode()
