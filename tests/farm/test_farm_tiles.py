"""`wgpu-gi farm render --farm-tiles`: the file is that of one process; finished tiles outlive a run that fails."""

from __future__ import annotations

import pytest

from wgpu_gi.__main__ import main
from wgpu_gi.errors import GiError
from wgpu_gi.farm import picture

pytest.importorskip("distributed")
pytestmark = pytest.mark.usefixtures("folder")

STILL = ["cornell-point", "--size", "32x18", "--set", "camera.frames=2", "--gi", "none", "--show", "radiance"]


def farm(*arguments: str) -> int:
    return main(["farm", "render", *STILL, "--show", "depth", *arguments])


def test_the_file_is_that_of_one_process(cluster, folder, capsys):
    assert main(["render", *STILL, "--show", "depth", "--tiles", "4", "-o", "one.exr"]) == 0
    assert farm("--farm-tiles", "4", "-o", "farm.exr", "--scheduler", cluster) == 0
    assert (folder / "one.exr").read_bytes() == (folder / "farm.exr").read_bytes()
    assert sorted(path.name for path in folder.iterdir()) == ["farm.exr", "one.exr"]
    assert "4 of 4 tiles" in capsys.readouterr().out


def test_finished_tiles_are_kept_until_the_picture_is_written(cluster, folder, capsys, monkeypatch):
    good = picture.render_tile

    def failing(renderer, tile, *arguments, **options):
        if tile.corner == (16, 9):
            raise GiError("no light today")
        return good(renderer, tile, *arguments, **options)

    monkeypatch.setattr(picture, "render_tile", failing)
    assert farm("--farm-tiles", "4", "-o", "farm.exr", "--scheduler", cluster) == 1
    said = capsys.readouterr().err
    assert "not written; 3 of 4 tiles" in said and "1 tile failed, such as 4: no light today" in said
    assert not (folder / "farm.exr").exists() and len([*(folder / "farm.exr.tiles").iterdir()]) == 3
    # Tiles of other pictures and damaged ones are not taken.
    monkeypatch.setattr(picture, "render_tile", good)
    next((folder / "farm.exr.tiles").iterdir()).write_bytes(b"PK")
    assert farm("--farm-tiles", "4", "-o", "farm.exr", "--scheduler", cluster) == 0
    assert "2 of 4 tiles" in capsys.readouterr().out
    assert not (folder / "farm.exr.tiles").exists()
    assert farm("--farm-tiles", "4", "-o", "farm.exr", "--seed", "3", "--scheduler", cluster) == 0
    assert "4 of 4 tiles" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--frames", "0:3"], "--frames does not go with tiles"),
        (["--gi", "ssdo"], "ssdo cannot be rendered in tiles"),
        (["--plan"], "--plan tells of one process"),
        (["-o", "no/such.exr"], "there is no folder"),
    ],
)
def test_wrong_arguments_end_in_a_sentence(folder, capsys, arguments, said):
    assert farm("--farm-tiles", "4", *arguments) == 2
    assert said in capsys.readouterr().err
    assert not [*folder.iterdir()]
