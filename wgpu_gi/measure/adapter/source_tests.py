"""Runs the shader tests of a source checkout, where there is one with pytest beside the package."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from ...resources import resource_dir
from .results import TestRun

FOLDERS = ("tests/shader",)
LEFT_OUT = ("tests/shader/test_wgsl_compiles.py",)  # tests the compilers, not the adapter
MOST_NAMES = 20
OUTCOME = re.compile(r"^(\S+::.*?) (PASSED|FAILED|ERROR|SKIPPED|XFAIL|XPASS)", re.M)


def checkout() -> Path | None:
    """Return the folder of the checkout that this package runs from, None if it has no tests, or pytest is missing."""
    folder = resource_dir("wgsl").parent
    has_tests = all((folder / name).is_dir() for name in FOLDERS)
    return folder if has_tests and importlib.util.find_spec("pytest") is not None else None


def run_tests(folder: Path, seconds: float) -> TestRun:
    """Run the tests for at most `seconds`; what was finished by then counts."""
    command = [sys.executable, "-m", "pytest", "-v", "--tb=no", "--no-header", "-p", "no:cacheprovider", *FOLDERS]
    command += [f"--ignore={name}" for name in LEFT_OUT]
    # A file, since what a pipe holds is lost at the end of the time.
    with tempfile.TemporaryFile() as output:
        try:
            subprocess.run(
                command, cwd=folder, stdout=output, stderr=subprocess.STDOUT, timeout=max(seconds, 0.1), check=False
            )
            finished = True
        except subprocess.TimeoutExpired:
            finished = False
        output.seek(0)
        text = output.read().decode(errors="replace")
    outcomes = OUTCOME.findall(text)
    names = [name for name, outcome in outcomes if outcome in ("FAILED", "ERROR")]
    passed = sum(outcome in ("PASSED", "XFAIL", "XPASS") for _, outcome in outcomes)
    skipped = sum(outcome == "SKIPPED" for _, outcome in outcomes)
    return TestRun(passed, len(names), skipped, names[:MOST_NAMES], finished)
