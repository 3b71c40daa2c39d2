"""Data sets end to end: the same bytes in any shards and order, after interruptions; objects; wrong configurations."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import wgpu_gi as gi
from wgpu_gi.dataset.config import load_config
from wgpu_gi.dataset.draw import Drawer
from wgpu_gi.dataset.run import make
from wgpu_gi.dataset.writers.folder import FolderWriter
from wgpu_gi.sequence.shards import Shards

FRAMES = 5
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def config(tmp_path):
    (tmp_path / "crate.obj").write_text(CRATE)
    return {
        "frames": FRAMES,
        "seed": 3,
        "size": [32, 24],
        "gi": "many-light",
        "quality": "low",
        "exposure": 0.5,
        "data": ["picture", "direct", "indirect", "standard_error", "depth_z", "normal", "albedo", "category"],
        "settings": ["camera.frames=2"],
        "scenes": [{"file": "cornell-point"}],
        "cameras": {"kind": "sphere", "azimuth_deg": [160, 200], "elevation_deg": [0, 20], "distance": [6, 9]},
        "lights": {"intensity": [0.5, 2], "color": 0.3, "shift": 0.2},
        "objects": [{"files": [str(tmp_path / "crate.obj")], "count": [1, 3], "size": [0.5, 1.0]}],
        "categories": {"box": ["*box"], "crate": ["crate/*"]},
        "writers": {"folder": {}, "webdataset": {"frames_per_shard": 3}, "coco": {}, "nerf": {}},
    }


CRATE = """o crate
v 0 0 0
v 1 0 0
v 1 0 1
v 0 0 1
v 0 1 0
v 1 1 0
v 1 1 1
v 0 1 1
f 1 2 3 4
f 8 7 6 5
f 1 5 6 2
f 2 6 7 3
f 3 7 8 4
f 4 8 5 1
"""


def tree(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("technique", ["none", pytest.param("many-light", marks=pytest.mark.slow)])
def test_bytes_do_not_depend_on_shards_order_and_interruptions(tmp_path, config, monkeypatch, technique):
    config["gi"] = technique
    whole = make(config, tmp_path / "whole")
    assert (whole.rendered, whole.there, whole.missing) == (FRAMES, 0, 0) and "complete" in whole.sentence()
    # The second half first; it is interrupted while it writes its second frame, and goes on.
    write, calls = FolderWriter.write, []

    def interrupted(self, number, data, record):
        calls.append(number)
        if len(calls) == 2:
            raise KeyboardInterrupt
        write(self, number, data, record)

    monkeypatch.setattr(FolderWriter, "write", interrupted)
    with pytest.raises(KeyboardInterrupt):
        make(config, tmp_path / "parts", shards=Shards(range(2, 3), 2))
    second = make(config, tmp_path / "parts", shards=Shards(range(2, 3), 2))
    assert (second.rendered, second.there, second.missing) == (1, 1, 3)
    assert make(config, tmp_path / "parts", shards=Shards(range(1, 2), 2)).missing == 0
    whole, parts = tree(tmp_path / "whole"), tree(tmp_path / "parts")
    assert whole.keys() == parts.keys() and [name for name in whole if whole[name] != parts[name]] == []
    # All is there now: nothing is rendered again, and another configuration is refused.
    assert make(config, tmp_path / "parts").rendered == 0
    with pytest.raises(gi.GiError, match=r"another configuration \(seed, settings differ\)"):
        make({**config, "seed": 4}, tmp_path / "parts", changes=["camera.frames=3"])
    _check_contents(tmp_path / "whole")


def _check_contents(folder):
    """Check that what was drawn is what is seen."""
    for number in range(FRAMES):
        known = json.loads((folder / f"folder/{number:06d}.json").read_text())
        arrays = np.load(folder / f"folder/{number:06d}.npz")
        names = {each["id"]: each["name"] for each in known["objects"]}
        assert sum(name == "crate/crate" for name in names.values()) <= len(known["record"]["objects"]) <= 3
        for each in known["objects"]:
            kinds = np.unique(arrays["category"][arrays["instance"] == each["id"]])
            expected = 1 if each["name"].endswith("box") else 2 if each["name"] == "crate/crate" else 0
            assert each["category"] == expected and set(kinds) <= {expected}
        assert np.isfinite(arrays["picture"]).all() and arrays["picture"].mean() > 0
        assert 0.5 <= known["record"]["lights"][0]["intensity"] <= 2


def test_objects_stand_on_the_floor_apart_from_one_another(config):
    config["objects"][0] |= {"count": 3, "size": 0.6}
    drawer = Drawer(load_config(config))
    for number in range(3):
        drawn = drawer.draw(number)
        placed = [i for i in drawn.scene.instances if i.name == "crate/crate"]
        boxes = [gi.Scene([instance]).bounds() for instance in placed]
        for k, box in enumerate(boxes):
            assert (box[1] - box[0])[1] == pytest.approx(0.6)
            assert any(box[0, 1] == pytest.approx(height, abs=0.06) for height in (0.0, 1.65, 3.3))  # floor, boxes
            assert all((box[0] >= other[1]).any() or (box[1] <= other[0]).any() for other in boxes[:k])
            assert (np.abs(box.mean(0) - drawn.camera.position) > (box[1] - box[0]) / 2).any()
    counts = [len(drawer.draw(number).record["objects"]) for number in range(3)]
    again = Drawer(load_config(config))
    assert counts == [len(again.draw(number).record["objects"]) for number in reversed(range(3))][::-1]


def test_a_part_of_the_configuration_does_not_change_what_others_draw(config):
    a = Drawer(load_config(config)).draw(2)
    b = Drawer(load_config({**config, "lights": {"intensity": [3, 4]}})).draw(2)
    assert np.array_equal(a.camera.world_from_view, b.camera.world_from_view)
    assert a.record["objects"] == b.record["objects"] and a.record["lights"] != b.record["lights"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sise": [1, 1]}, "the configuration: there is no field 'sise'; did you mean 'size'?"),
        ({"frames": 0}, "frames must be a whole number from 1"),
        ({"size": [0, 1]}, "a picture has at least 1x1 pixels"),
        ({"gi": "manylight"}, "manylight"),
        ({"quality": "best"}, "there is no quality"),
        ({"data": ["dept_z"]}, "a frame has no data 'dept_z'; did you mean 'depth_z'?"),
        ({"data": ["flow"]}, "flow and occlusion need a table [motion]"),
        ({"exposure": "bright"}, "exposure must be a number of EV"),
        ({"settings": ["vpl.cuont=3"]}, "there is no setting 'vpl.cuont'"),
        ({"scenes": []}, "scenes must be a list of tables, [[scenes]], with at least one"),
        ({"scenes": [{"fil": "cornell"}]}, "scenes[0]: there is no field 'fil'; did you mean 'file'?"),
        ({"scenes": [{"file": "cornel"}]}, "scenes[0]: there is no file 'cornel', nor a built-in scene of that name"),
        ({"cameras": {"kind": "rom"}}, "cameras.kind: there is no 'rom'; did you mean 'room'?"),
        ({"lights": {"intensity": 0}}, "lights.intensity must be a number above 0, or [least, most], not 0"),
        ({"objects": [{"count": 3}]}, "objects[0]: files is missing"),
        (
            {"objects": [{"files": ["none.obj"]}]},
            "objects[0]: there is no file 'none.obj', nor a built-in scene of that name",
        ),
        ({"sky": {"files": ["none.hdr"]}}, "sky: there is no file 'none.hdr'"),
        ({"categories": {"box": "*box"}}, "categories.box must be a list of texts, not '*box'"),
        ({"writers": {"zip": {}}}, "unknown writer 'zip'"),
        ({"writers": {"nerf": {}}, "exposure": None}, "the writer nerf needs the same exposure"),
    ],
)
def test_wrong_configurations_are_refused_in_a_sentence(tmp_path, config, change, message):
    with pytest.raises(gi.GiError) as error:
        make({**config, **change}, tmp_path / "out")
    assert message in str(error.value) and "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()


def test_a_file_that_is_not_toml_is_named(tmp_path):
    (tmp_path / "a.toml").write_text("frames = ")
    with pytest.raises(gi.GiError, match=r"a\.toml is not TOML"):
        make(tmp_path / "a.toml", tmp_path / "out")
    with pytest.raises(gi.GiError, match="cannot be read"):
        make(tmp_path / "b.toml", tmp_path / "out")


def test_points_of_one_frame_land_on_the_same_surfaces_in_another(tmp_path, config):
    """By transforms.json alone, as nerfstudio documents it: depth and ids agree except at edges and behind things."""
    del config["objects"], config["lights"]
    make(
        {
            **config,
            "gi": "none",
            "frames": 2,
            "size": [64, 48],
            "data": ["instance", "depth_z"],
            "writers": {"nerf": {}, "folder": {}},
        },
        tmp_path,
    )
    file = json.loads((tmp_path / "nerf/transforms.json").read_text())
    lens, frames = file, file["frames"]
    arrays = [np.load(tmp_path / f"folder/{number:06d}.npz") for number in range(2)]
    v, u = np.mgrid[:48, :64] + 0.5
    along = np.stack([(u - lens["cx"]) / lens["fl_x"], -(v - lens["cy"]) / lens["fl_y"], -np.ones_like(u)], -1)
    matrix, inverse = np.array(frames[0]["transform_matrix"]), np.linalg.inv(frames[1]["transform_matrix"])
    seen = arrays[0]["depth_z"] > 0
    world = (along * arrays[0]["depth_z"][..., None])[seen] @ matrix[:3, :3].T + matrix[:3, 3]
    view = world @ inverse[:3, :3].T + inverse[:3, 3]
    x = lens["fl_x"] * view[:, 0] / -view[:, 2] + lens["cx"]
    y = -lens["fl_y"] * view[:, 1] / -view[:, 2] + lens["cy"]
    inside = (view[:, 2] < 0) & (x > 0) & (x < 64) & (y > 0) & (y < 48)
    columns, rows = x[inside].astype(int), y[inside].astype(int)
    same = arrays[0]["instance"][seen][inside] == arrays[1]["instance"][rows, columns]
    depth = arrays[1]["depth_z"][rows, columns]
    # Half a pixel aside, a floor seen at a flat angle is a few percent farther or nearer.
    near = np.abs(depth - -view[inside, 2]) < 0.05 * depth
    assert inside.sum() > 1500 and same.mean() > 0.85 and near.mean() > 0.8
    assert near[same].mean() > 0.9


def test_the_example_is_valid():
    config = load_config(ROOT / "scenes/dataset.toml")
    assert config.frames == 200 and len(config.scenes) == 2 and config.motion is not None
    drawn = Drawer(config).draw(3)
    assert drawn.second is not None and len(drawn.second[0].instances) == len(drawn.scene.instances)
    assert all(a.mesh is b.mesh for a, b in zip(drawn.scene.instances, drawn.second[0].instances, strict=True))
