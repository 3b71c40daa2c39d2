"""Thousands of damaged files of every format: each gives a checked result or a GiError, in bounded time and memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

FUZZ = Path(__file__).resolve().parents[1] / "helpers" / "fuzz.py"


@pytest.mark.parametrize(
    ("seed", "count"), [(7, 25), pytest.param(8, 400, marks=[pytest.mark.slow, pytest.mark.timeout(1200)])]
)
def test_damaged_files_give_a_result_or_one_sentence(seed, count):
    """A child process loads `count` files of each format, so that a crash of a decoder is seen, too."""
    command = [sys.executable, str(FUZZ), str(seed), str(count)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace")
    lines = done.stdout.splitlines()
    faults = [line for line in lines if not line.startswith(". ")]
    assert not faults, "\n".join(faults[:20])
    assert done.returncode == 0, f"the process ended with {done.returncode} in {lines[-1]}"
    assert len(lines) > 30 * count
