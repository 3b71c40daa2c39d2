"""`wgpu-gi dataset`: its arguments reach `make`, its warnings are notes, its errors one sentence."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

import wgpu_gi as gi
from wgpu_gi.__main__ import main
from wgpu_gi.cli import dataset as cli_dataset
from wgpu_gi.errors import GiError, warn_of
from wgpu_gi.sequence.shards import ALL, Shards


@pytest.fixture
def asked(monkeypatch):
    """Return what the command asks of `make`, as it is called."""
    calls = []

    def make(*where, progress, **options):
        calls.append((*where, options))
        for fraction in (0.0, 0.5):
            progress(fraction, "frame 7")
            warn_of(["a lamp is approximated"], stacklevel=1)
        return SimpleNamespace(sentence=lambda: "2 frames in 1.0 s")

    monkeypatch.setattr(cli_dataset, "make", make)
    return calls


def test_arguments_reach_the_data_set(asked, capsys):
    words = [
        "rooms.toml",
        "-o",
        "here",
        "--shard",
        "2-3/8",
        "--set",
        "vpl.count=64",
        "--set",
        "seed=3",
        "--adapter",
        "a",
    ]
    assert main(["dataset", *words]) == 0
    options = {"shards": Shards(range(2, 4), 8), "changes": ["vpl.count=64", "seed=3"], "adapter": "a"}
    assert asked == [("rooms.toml", "here", options)]
    printed = capsys.readouterr()
    assert printed.out == "2 frames in 1.0 s\n" and printed.err == "note: a lamp is approximated\n"


def test_defaults_are_the_whole_in_a_folder_named_data(asked, capsys):
    assert main(["dataset", "rooms.toml", "-q"]) == 0
    assert asked == [("rooms.toml", "data", {"shards": ALL, "changes": [], "adapter": None})]
    printed = capsys.readouterr()
    assert printed.out == printed.err == ""


@pytest.mark.parametrize(
    ("words", "said"), [("", "CONFIG.toml"), ("a.toml --shard 9/8", "1/N"), ("missing.toml", "missing")]
)
def test_bad_arguments_are_one_sentence(words, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["dataset", *words.split()]) == 2
    error = capsys.readouterr().err
    assert error.startswith("wgpu-gi: error: ") and said in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_python_has_the_same_by_name():
    with pytest.raises(GiError, match="missing"):
        gi.dataset.make("missing.toml", "data")
