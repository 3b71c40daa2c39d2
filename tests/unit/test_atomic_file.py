"""Files appear complete or not at all."""

from __future__ import annotations

import os

import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.pictures.atomic_file import atomic_file, check_writable


def test_file_appears_at_the_end(tmp_path):
    with atomic_file(tmp_path / "a.txt") as temporary:
        temporary.write_text("whole")
        assert not (tmp_path / "a.txt").exists()
    assert (tmp_path / "a.txt").read_text() == "whole"
    assert os.listdir(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_interruption_keeps_the_old_file(tmp_path, error):
    (tmp_path / "a.txt").write_text("before")
    with pytest.raises(error), atomic_file(tmp_path / "a.txt") as temporary:
        temporary.write_text("half")
        raise error
    assert (tmp_path / "a.txt").read_text() == "before"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_refusals_are_sentences(tmp_path):
    with pytest.raises(GiError, match="cannot be written"), atomic_file(tmp_path / "no" / "a.txt") as temporary:
        temporary.write_text("x")
    with pytest.raises(GiError, match="is a folder"):
        check_writable(tmp_path)
    with pytest.raises(GiError, match="there is no folder"):
        check_writable(tmp_path / "no" / "a.txt")
    check_writable(tmp_path / "a.txt")
    assert not os.listdir(tmp_path)
