"""Every shader compiles with naga and, where chromium is installed, with Tint; errors lead to file and line."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import check_wgsl
import pytest
from check_wgsl import entry_shaders, find_chromium, naga_errors, tint_errors

from wgpu_gi.gpu.wgsl.dead_branches import without_dead_branches
from wgpu_gi.gpu.wgsl.load import load

BAD_LIBRARY = "fn twice(x: f32) -> f32 {\n  return 2 * vec3f(x);\n}\n"
BAD_SHADER = '#import "bad/library.wgsl"\n@compute @workgroup_size(8)\nfn main() { _ = twice(1.0); }\n'
# Fine for naga; WGSL demands that a barrier be reached by all of a workgroup or by none.
NOT_UNIFORM = """@group(0) @binding(0) var<storage, read_write> a: array<u32>;
@compute @workgroup_size(8)
fn main(@builtin(local_invocation_index) i: u32) {
  if a[i] > 1 {
    workgroupBarrier();
  }
}
"""


@pytest.fixture
def bad(tmp_path):
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad/library.wgsl").write_text(BAD_LIBRARY)
    (tmp_path / "bad/shader.wgsl").write_text(BAD_SHADER)
    (tmp_path / "bad/not_uniform.wgsl").write_text(NOT_UNIFORM)
    return lambda name: load(f"bad/{name}.wgsl", root=tmp_path)


@pytest.fixture(scope="module")
def chromium():
    path = find_chromium()
    if path is None:
        pytest.skip("chromium is not installed")
    return path


@pytest.mark.parametrize("path", entry_shaders())
def test_naga_compiles(path):
    assert naga_errors(load(path)) == []


@pytest.mark.parametrize("value", [False, True])
@pytest.mark.parametrize("path", entry_shaders())
def test_naga_compiles_what_the_features_leave(path, value):
    source = load(path)
    features = dict.fromkeys([name for name in source.overrides if name.startswith("HAS_")], float(value))
    code = without_dead_branches(source.text, features)
    assert naga_errors(replace(source, text=code)) == []


def test_naga_errors_name_file_and_line(bad):
    (error,) = naga_errors(bad("shader"))
    assert error.startswith("bad/library.wgsl:")


def test_tint_compiles_all(chromium):
    assert tint_errors(chromium, [load(path) for path in entry_shaders()]) == []


def test_tint_errors_name_file_and_line(chromium, bad):
    errors = tint_errors(chromium, [bad("shader"), bad("not_uniform")])
    assert any(error.startswith("bad/library.wgsl:2: error: ") for error in errors)
    assert any(error.startswith("bad/not_uniform.wgsl:5: error: ") for error in errors)


def test_command_reports_the_number_of_messages(monkeypatch, capsys):
    monkeypatch.setattr(check_wgsl, "find_chromium", lambda: None)
    monkeypatch.setattr("sys.argv", ["check_wgsl.py", *entry_shaders()[:1]])
    assert check_wgsl.main() == 0
    assert "naga: 0 messages" in capsys.readouterr().out


def test_command_runs_in_any_folder(tmp_path):
    """Without PYTHONPATH. PATH lacks chromium, whose start takes long."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | {"PATH": str(tmp_path)}
    command = [sys.executable, check_wgsl.__file__, "reference/resolve.wgsl"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "1 shaders, naga: 0 messages\n"), done.stderr
