"""Interrupts commands on a terminal of their own, as Ctrl-C does."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys

import pytest


def interrupted(shows: bytes, *arguments: str) -> tuple[int, bytes]:
    """Interrupt `wgpu-gi` with these arguments once it shows a pattern; return its exit code and all that it showed."""
    master, slave = pytest.importorskip("pty").openpty()
    command = [sys.executable, "-m", "wgpu_gi", *arguments]
    process = subprocess.Popen(command, stdout=slave, stderr=slave, start_new_session=True)
    os.close(slave)
    seen = b""
    while not re.search(shows, seen):
        seen += os.read(master, 4096)
    process.send_signal(signal.SIGINT)
    while True:
        try:
            seen += os.read(master, 4096)
        except OSError:  # the terminal is closed by its last user
            break
    return process.wait(timeout=30), seen
