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


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with names")
def test_devices_and_pipes_are_refused_and_stay(tmp_path):
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "link.png").symlink_to("/dev/null")
    for path in (tmp_path / "pipe.png", tmp_path / "link.png", "/dev/null"):
        before = os.stat(path).st_mode
        with pytest.raises(GiError, match="is a device, pipe or folder; give the name of a file"):
            check_writable(path)
        with pytest.raises(GiError, match="is a device, pipe or folder"), atomic_file(path) as temporary:
            temporary.write_text("x")
        assert os.stat(path).st_mode == before
    assert sorted(os.listdir(tmp_path)) == ["link.png", "pipe.png"]


def test_a_link_stays_and_its_target_is_replaced(tmp_path):
    (tmp_path / "folder").mkdir()
    target, link, dangling = tmp_path / "folder" / "a.txt", tmp_path / "link.txt", tmp_path / "new.txt"
    target.write_text("before")
    link.symlink_to(target)
    dangling.symlink_to(tmp_path / "folder" / "b.txt")
    for path in (link, dangling):
        check_writable(path)
        with atomic_file(path) as temporary:
            temporary.write_text("after")
        assert path.is_symlink() and path.read_text() == "after"
    assert target.read_text() == "after" and sorted(os.listdir(tmp_path / "folder")) == ["a.txt", "b.txt"]
