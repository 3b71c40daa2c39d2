"""Writers of data sets: other programs' libraries read their files; their bytes do not depend on order or accidents."""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import killed_writers
from helpers.labelled_frames import CATEGORIES, DATA, frame, record

from wgpu_gi import Camera, GiError
from wgpu_gi.dataset.frame_data import FrameData, ObjectData
from wgpu_gi.dataset.matrices import matrices
from wgpu_gi.dataset.writers import make_writers
from wgpu_gi.dataset.writers.store import Parts, Store
from wgpu_gi.pictures.image import load_image

FRAMES = 7


def write(output: Path, options: dict, frames: int = FRAMES, numbers=None, exposure: float | None = 0.5) -> None:
    writers = make_writers(output, options, frames, DATA, CATEGORIES, exposure)
    for number in range(frames) if numbers is None else numbers:
        for writer in writers:
            assert not writer.has(number)
            writer.write(number, frame(number), record(number))
            assert writer.has(number)
    assert [writer.finish() for writer in writers] == [frames - len(numbers or range(frames))] * len(writers)


def tree(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are killed after os.fork, which this system lacks")
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 9))])
def test_bytes_are_those_of_an_undisturbed_run_after_any_kills(tmp_path, seed):
    assert killed_writers.write(tmp_path / "whole", list(range(killed_writers.FRAMES))) == 0
    command = [sys.executable, killed_writers.__file__, str(tmp_path / "killed"), str(seed)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=150)
    assert run.returncode == 0, run.stderr
    assert int(run.stdout) >= 5
    whole, killed = tree(tmp_path / "whole"), tree(tmp_path / "killed")
    assert whole.keys() == killed.keys()
    assert [name for name in whole if whole[name] != killed[name]] == []


def test_nothing_is_joined_before_all_frames_are_there(tmp_path):
    options = {"webdataset": {"frames_per_shard": 4}, "coco": {}, "nerf": {}}
    write(tmp_path, options, numbers=[0, 1, 2, 3, 5])
    finished = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.*") if ".work" not in path.parts}
    pictures = {
        f"{folder}/00000{i}.png" for folder in ("coco/images", "nerf/images", "nerf/depth") for i in (0, 1, 2, 3, 5)
    }
    assert finished - pictures == {"webdataset/shard-000000.tar"}


def test_a_process_that_joins_while_another_removes_the_parts_is_content(tmp_path):
    """The other has read half of the parts when they are joined and removed."""
    store = Store(tmp_path, 3)
    parts = [Parts(store, tmp_path / "all", range(3)) for _ in range(2)]
    for number in range(3):
        parts[0].add(number, b"%d" % number)

    def slowly(file, read):
        contents = read()
        file.write(next(contents))
        assert parts[1].join(lambda file, read: file.write(b"".join(read())) and None) == 0
        store.clean()
        file.write(b"".join(contents))

    assert parts[0].join(slowly) == 0
    assert (tmp_path / "all").read_bytes() == b"012"
    parts[0].add(1, b"1")  # late, by a process that had the same frame
    assert parts[0].join(slowly) == 0
    assert [path.name for path in tmp_path.rglob("*")] == ["all"]


def test_many_frames_lie_in_folders_of_a_thousand(tmp_path):
    store = Store(tmp_path, 12_000)
    assert (store.path(123), store.path(11_999), Store(tmp_path, 10_000).path(9999)) == (
        "000/000123",
        "011/011999",
        "009999",
    )
    assert Store(tmp_path, 20_000_000).path(12_345_678) == "12345/12345678"
    parts = Parts(store, tmp_path / "all", range(990, 11_010))
    for number in (990, 999, 1000, 11_009):
        parts.add(number, b"")
    assert parts.missing() == 10_020 - 4


def test_folder_holds_all_arrays(tmp_path):
    write(tmp_path, {"folder": {"files": ["png", "npz", "exr"]}}, frames=2)
    data = frame(1)
    with np.load(tmp_path / "folder/000001.npz") as file:
        assert set(file.files) == set(data.arrays())
        for name, array in data.arrays().items():
            assert file[name].dtype == array.dtype and np.array_equal(file[name], array)
    for name in ("picture", "depth_z", "normal", "instance"):
        assert np.array_equal(load_image(tmp_path / "folder/000001.exr", name), data.arrays()[name])
    assert np.array_equal(load_image(tmp_path / "folder/000001.exr", "flow_y"), data.flow[..., 1])
    known = json.loads((tmp_path / "folder/000001.json").read_text())
    assert known["frame"] == 1 and known["record"]["name"] == record(1)["name"] and known["exposure"] == 0.5
    assert known["objects"][1]["amodal_box"] == list(data.objects[1].amodal_box)
    assert np.array_equal(known["cameras"]["opengl_world_from_view"], data.cameras["opengl_world_from_view"])


def test_webdataset_loads_the_shards(tmp_path):
    webdataset = pytest.importorskip("webdataset")
    write(tmp_path, {"webdataset": {"frames_per_shard": 3}})
    shards = str(tmp_path / "webdataset/shard-{000000..000002}.tar")
    samples = list(webdataset.WebDataset(shards, shardshuffle=False).decode("rgb8"))
    assert [sample["__key__"] for sample in samples] == [f"{i:06d}" for i in range(FRAMES)]
    for number, sample in enumerate(samples):
        data = frame(number)
        assert sample["picture.png"].shape == (17, 24, 3) and sample["picture.png"].dtype == np.uint8
        assert sample["frame.json"]["frame"] == number and sample["frame.json"]["record"]["seed"] == [7, number]
        for name, array in data.arrays().items():
            assert np.array_equal(sample[f"{name}.npy"], array) and sample[f"{name}.npy"].dtype == array.dtype


def test_torch_loads_batches_by_processes(tmp_path):
    torch_data = pytest.importorskip("torch.utils.data")
    webdataset = pytest.importorskip("webdataset")
    write(tmp_path, {"webdataset": {"frames_per_shard": 2}}, frames=6)
    shards = str(tmp_path / "webdataset/shard-{000000..000002}.tar")
    dataset = (
        webdataset.WebDataset(shards, shardshuffle=False)
        .decode("torchrgb")
        .to_tuple("picture.png", "depth_z.npy", "__key__")
    )
    loader = torch_data.DataLoader(dataset.batched(2), batch_size=None, num_workers=2)
    keys = []
    for pictures, depths, names in loader:
        assert pictures.shape == (2, 3, 17, 24) and np.shape(depths) == (2, 17, 24)
        assert all(np.array_equal(depth, frame(int(name)).depth_z) for depth, name in zip(depths, names, strict=True))
        keys += names
    assert sorted(keys) == [f"{i:06d}" for i in range(6)]


@pytest.fixture
def coco(tmp_path):
    module = pytest.importorskip("pycocotools.coco")
    write(tmp_path, {"coco": {}}, frames=8)
    with contextlib.redirect_stdout(io.StringIO()):
        return module.COCO(str(tmp_path / "coco/instances.json"))


def test_coco_masks_are_the_instances(coco, tmp_path):
    assert {each["id"]: each["name"] for each in coco.loadCats(coco.getCatIds())} == CATEGORIES
    assert coco.getImgIds() == list(range(8))
    known = 0
    for number in range(8):
        data = frame(number)
        image = coco.loadImgs(number)[0]
        assert (image["width"], image["height"]) == data.size and image["record"]["seed"] == [7, number]
        assert (tmp_path / "coco/images" / image["file_name"]).is_file()
        annotations = coco.loadAnns(coco.getAnnIds(imgIds=number))
        expected = [each for each in data.objects if each.category and each.visible_pixels]
        assert [each["instance_id"] for each in annotations] == [each.id for each in expected]
        for annotation, each in zip(annotations, expected, strict=True):
            mask = data.instance == each.id
            assert np.array_equal(coco.annToMask(annotation), mask)
            assert annotation["area"] == mask.sum() == each.visible_pixels
            assert tuple(annotation["bbox"]) == each.box
            assert annotation["category_id"] == each.category
            assert tuple(annotation["amodal_bbox"]) == each.amodal_box
            assert annotation["visible_fraction"] == annotation["area"] / annotation["amodal_area"]
            known += 1
    assert known > 10 and sorted(coco.getAnnIds()) == list(range(1, known + 1))


@pytest.mark.parametrize("kind", ["segm", "bbox"])
def test_coco_ground_truth_has_average_precision_1(coco, kind):
    from pycocotools.cocoeval import COCOeval

    keys = ("image_id", "category_id", "segmentation", "bbox", "area")
    results = [{**{key: each[key] for key in keys}, "score": 0.9} for each in coco.loadAnns(coco.getAnnIds())]
    if kind == "bbox":
        results = [{key: each[key] for key in each if key != "segmentation"} for each in results]
    with contextlib.redirect_stdout(io.StringIO()):
        evaluation = COCOeval(coco, coco.loadRes(results), kind)
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
    assert evaluation.stats[0] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("mask", ["all", "none", "columns", "last pixel", "random"])
def test_coco_run_lengths_of_extreme_masks(mask):
    decode = pytest.importorskip("pycocotools.mask")
    from wgpu_gi.dataset.writers.coco import annotate

    instance = np.zeros((5, 9), np.int32)
    if mask == "random":
        instance[...] = np.random.default_rng(0).random((5, 9)) < 0.5
    elif mask != "none":
        instance[{"all": ..., "columns": np.s_[:, 3:5], "last pixel": np.s_[-1, -1]}[mask]] = 1
    found = annotate(0, instance, [ObjectData(1, "a", 1, int(instance.sum()))])
    assert len(found) == instance.any()
    for each in found:
        rle = decode.frPyObjects(each["segmentation"], 5, 9)
        assert np.array_equal(decode.decode(rle), instance)
        assert decode.toBbox(rle).tolist() == each["bbox"] and decode.area(rle) == each["area"]


def test_transforms_lead_points_of_one_frame_to_the_right_pixels_of_another(tmp_path):
    """A floor y = 0 seen by two cameras; read as nerfstudio documents: OpenGL cameras, +Z up, centres at +0.5."""
    from PIL import Image

    size = (40, 30)
    poses = [Camera.look_at((2, 3, 4), (0.2, 0, 0), yfov_deg=50), Camera.look_at((-3, 2, 2), (0, 0, 0.3), yfov_deg=70)]
    writer = make_writers(tmp_path, {"nerf": {}}, 2, DATA, CATEGORIES, 0.0)[0]
    for number, camera in enumerate(poses):
        depth = _depth_of_floor(camera, size)
        black = np.zeros((*depth.shape, 3), np.float32)
        data = FrameData(size, picture=black, depth_z=depth, cameras=matrices(camera, size))
        writer.write(number, data, {})
    assert writer.finish() == 0
    file = json.loads((tmp_path / "nerf/transforms.json").read_text())
    assert "fl_x" not in file and file["integer_depth_scale"] == 0.001
    first, second = file["frames"]
    millimetres = np.asarray(Image.open(tmp_path / "nerf" / first["depth_file_path"]))
    assert millimetres.dtype == np.uint16
    # From a pixel of the first frame to the world, as nerfstudio's cameras do.
    v, u = np.mgrid[: size[1], : size[0]] + 0.5
    along = np.stack([(u - first["cx"]) / first["fl_x"], -(v - first["cy"]) / first["fl_y"], -np.ones_like(u)], -1)
    view = along * (millimetres * 0.001)[..., None]
    matrix = np.array(first["transform_matrix"])
    world = (view @ matrix[:3, :3].T + matrix[:3, 3])[millimetres > 0]
    assert np.abs(world[:, 2]).max() < 0.002  # the floor is horizontal where +Z is up; depth has steps of 1 mm
    # Into the second frame; the pixels must be those of the scene's own camera.
    inverse = np.linalg.inv(second["transform_matrix"])
    seen = world @ inverse[:3, :3].T + inverse[:3, 3]
    pixels = np.stack([seen[:, 0], -seen[:, 1]], -1) / -seen[:, 2:] * second["fl_x"] + [second["cx"], second["cy"]]
    y_up = np.linalg.inv(np.vstack([file["applied_transform"], [0, 0, 0, 1]]))
    clip = (
        np.column_stack([world, np.ones(len(world))]) @ (poses[1].clip_from_world(size, np.zeros(3), 0.1, 100) @ y_up).T
    )
    expected = (clip[:, :2] / clip[:, 3:] * [0.5, -0.5] + 0.5) * size
    front = clip[:, 3] > 0
    assert front.sum() > 500 and np.allclose(pixels[front], expected[front], atol=1e-6)
    assert second["camera_angle_y"] == pytest.approx(math.radians(70))


def _depth_of_floor(camera: Camera, size: tuple[int, int]) -> np.ndarray:
    """Return the distance of the plane y = 0 along the camera's axis, 0 where a pixel's ray misses it."""
    v, u = np.mgrid[: size[1], : size[0]] + 0.5
    tangent = math.tan(camera.yfov / 2)
    along = np.stack([(2 * u - size[0]) / size[1] * tangent, (1 - 2 * v / size[1]) * tangent, -np.ones_like(u)], -1)
    down = (along @ camera.world_from_view[:3, :3].T)[..., 1]
    return np.where(down < 0, camera.position[1] / -np.minimum(down, -1e-9), 0.0).astype(np.float32)


def test_transforms_name_a_common_lens_once(tmp_path):
    write(tmp_path, {"nerf": {}}, frames=2)
    file = json.loads((tmp_path / "nerf/transforms.json").read_text())
    assert (file["w"], file["h"]) == (24, 17) and file["fl_x"] == file["fl_y"]
    assert all("fl_x" not in each and each["record"]["seed"] for each in file["frames"])


def test_depth_beyond_16_bits_is_unknown():
    from PIL import Image

    from wgpu_gi.dataset.writers.nerf import depth_png

    depth = np.float32([[0, 0.0014, 1.5, 65.535, 65.6, np.inf]])
    assert np.asarray(Image.open(io.BytesIO(depth_png(depth)))).tolist() == [[0, 1, 1500, 65535, 0, 0]]


@pytest.mark.parametrize(
    ("writers", "data", "categories", "exposure", "message"),
    [
        ({"coca": {}}, DATA, CATEGORIES, 0.0, "unknown writer 'coca'; did you mean 'coco'?"),
        (
            {"folder": {"file": ["png"]}},
            DATA,
            CATEGORIES,
            0.0,
            "the writer folder has no option 'file'; did you mean 'files'?",
        ),
        ({"folder": {"files": ["jpg"]}}, DATA, CATEGORIES, 0.0, "files must be a list of png, npz, exr, not ['jpg']"),
        (
            {"webdataset": {"frames_per_shard": 0}},
            DATA,
            CATEGORIES,
            0.0,
            "frames_per_shard must be a whole number from 1, not 0",
        ),
        ({"coco": {"a": 1}}, DATA, CATEGORIES, 0.0, "the writer coco has no option 'a'; it has none"),
        ({"coco": {}}, {"picture"}, CATEGORIES, 0.0, "the writer coco needs the data amodal, instance"),
        ({"coco": {}}, DATA, {}, 0.0, "the writer coco needs categories"),
        ({"nerf": {}}, DATA, CATEGORIES, None, "the writer nerf needs the same exposure for all frames"),
    ],
)
def test_wrong_writers_are_refused_in_a_sentence(tmp_path, writers, data, categories, exposure, message):
    with pytest.raises(GiError) as error:
        make_writers(tmp_path, writers, 4, data, categories, exposure)
    assert message in str(error.value)
    assert not list(tmp_path.iterdir())


def test_an_orthographic_camera_is_refused_by_nerf(tmp_path):
    writer = make_writers(tmp_path, {"nerf": {}}, 1, DATA, CATEGORIES, 0.0)[0]
    data = FrameData((2, 1), picture=np.zeros((1, 2, 3), np.float32), cameras={"opengl_world_from_view": np.eye(4)})
    with pytest.raises(GiError, match="needs perspective cameras"):
        writer.write(0, data, {})


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "folder").write_text("a file")
    writer = make_writers(tmp_path, {"folder": {}}, 1, DATA, CATEGORIES, 0.0)[0]
    with pytest.raises(GiError, match="folder cannot be made"):
        writer.write(0, frame(0), {})
