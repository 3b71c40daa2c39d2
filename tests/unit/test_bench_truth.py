"""The truth of a bench, with a stand-in for the renderer: cache keys, kept and damaged entries, files."""

from __future__ import annotations

import numpy as np
import pytest

import wgpu_gi as gi
from wgpu_gi.errors import GiError
from wgpu_gi.measure import truth as truth_cache
from wgpu_gi.measure.truth import LAYERS, truth_by_path, truth_from_file, truth_key
from wgpu_gi.pictures.image import save_image

SIZE = (4, 3)
OPTIONS = {"spp": 8, "bounces": None, "diffuse": False}


class FakeRenderer:
    """Renders 1 with one seed and 2 with the other, on the left half of the picture only."""

    runs = 0

    def __init__(self, scene, *, size, camera, settings, adapter):
        self.size, self.settings = size, settings

    def run(self, progress, *, show):
        FakeRenderer.runs += 1
        assert self.settings.gi == "path"
        assert not self.settings.camera.jitter
        assert self.settings.spp == 4
        progress(1.0)

    def read_back(self, name):
        width, height = self.size
        if name == "depth":
            return np.repeat(np.arange(width) < width // 2, height).reshape(width, height).T.astype(np.float32)
        value = 1.0 + truth_cache.SEEDS.index(self.settings.seed)
        return np.full((height, width, 3), value, np.float32)

    def release(self):
        pass


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setattr(truth_cache, "Renderer", FakeRenderer)
    monkeypatch.setattr(FakeRenderer, "runs", 0)
    monkeypatch.setenv("WGPU_GI_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "truth"


@pytest.fixture
def scene():
    return gi.load("cornell-point")


def key(scene, camera=None, size=SIZE, **changed):
    return truth_key(scene, camera or scene.cameras[0], size, **{**OPTIONS, **changed})


def test_key_is_equal_for_equal_scenes(scene):
    again = gi.load("cornell-point")
    again.name, again.notes, again.instances[0].name = "another", ["a remark"], "renamed"
    assert key(scene) == key(again)


def change_vertex(scene):
    scene.meshes[0].positions = scene.meshes[0].positions + np.float32(1e-3)


def change_place(scene):
    scene.instances[0].world_from_local = scene.instances[0].world_from_local @ np.diag([1, 1, 2, 1.0])


def change_material(scene):
    scene.materials[0].roughness = 0.123


def change_light(scene):
    scene.lights[0].intensity *= 2


def change_environment(scene):
    scene.environment = gi.Environment((1, 2, 3))


def change_texture(scene):
    pixels = np.zeros((2, 2, 4), np.uint8)
    scene.materials[0].base_color_texture = gi.Texture(gi.Image(pixels))


@pytest.mark.parametrize(
    "change", [change_vertex, change_place, change_material, change_light, change_environment, change_texture]
)
def test_key_depends_on_the_scene(scene, change):
    before = key(scene)
    change(scene)
    assert key(scene) != before


def test_key_depends_on_the_pixels_of_a_texture(scene):
    change_texture(scene)
    before = key(scene)
    scene.materials[0].base_color_texture.image.pixels[1, 1, 0] = 1
    assert key(scene) != before


@pytest.mark.parametrize(
    "changed",
    [{"size": (3, 4)}, {"spp": 9}, {"bounces": 0}, {"bounces": 1}, {"diffuse": True}, {"visible_only": True}],
)
def test_key_depends_on_the_settings(scene, changed):
    assert key(scene, **changed) != key(scene)


def test_key_depends_on_the_camera_and_the_tracer(scene, monkeypatch):
    before = key(scene)
    assert key(scene, gi.Camera(scene.cameras[0].world_from_view, 0.5)) != before
    real = truth_cache.load
    monkeypatch.setattr(truth_cache, "load", lambda path: type("Source", (), {"text": real(path).text + " "}))
    assert key(scene) != before


def test_truth_is_the_mean_and_its_noise_half_the_difference(scene):
    seen = []
    truth = truth_by_path(scene, scene.cameras[0], SIZE, **OPTIONS, progress=lambda what, done: seen.append(done))
    for layer in LAYERS:
        assert (truth.layers[layer] == 1.5).all()
        assert (truth.noise[layer] == 0.5).all()
    assert truth.size == SIZE
    assert truth.surface[:, :2].all()
    assert not truth.surface[:, 2:].any()
    assert seen == [0.5, 1.0]


def test_truth_is_cached(scene, cache):
    first = truth_by_path(scene, scene.cameras[0], SIZE, **OPTIONS)
    again = truth_by_path(gi.load("cornell-point"), scene.cameras[0], SIZE, **OPTIONS)
    assert FakeRenderer.runs == 2  # the two halves of the first
    assert np.array_equal(first.layers["indirect"], again.layers["indirect"])
    assert np.array_equal(first.surface, again.surface)
    assert [file.suffix for file in cache.iterdir()] == [".npz"]


@pytest.mark.parametrize("damage", ["empty", "cut", "flipped", "other"])
def test_damaged_entries_are_rendered_again(scene, cache, damage):
    expected = truth_by_path(scene, scene.cameras[0], SIZE, **OPTIONS)
    (file,) = cache.iterdir()
    data = bytearray(file.read_bytes())
    if damage == "flipped":
        data[len(data) // 2] ^= 0xFF
    elif damage == "other":
        np.savez(file, full=np.zeros((3, 4, 3)))
        data = bytearray(file.read_bytes())
    file.write_bytes({"empty": b"", "cut": bytes(data[: len(data) // 2])}.get(damage, bytes(data)))
    again = truth_by_path(scene, scene.cameras[0], SIZE, **OPTIONS)
    assert FakeRenderer.runs == 4
    assert np.array_equal(again.layers["full"], expected.layers["full"])


def test_interrupted_truth_leaves_no_entry(scene, cache, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(FakeRenderer, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        truth_by_path(scene, scene.cameras[0], SIZE, **OPTIONS)
    assert not list(cache.iterdir())


def test_folder_that_cannot_be_made_is_a_sentence(scene, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("WGPU_GI_CACHE", str(tmp_path / "file"))
    with pytest.raises(GiError, match="set WGPU_GI_CACHE"):
        truth_by_path(scene, scene.cameras[0], SIZE, **OPTIONS)
    assert FakeRenderer.runs == 0


def test_cache_folder_follows_the_environment(monkeypatch, tmp_path):
    monkeypatch.delenv("WGPU_GI_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert truth_cache.cache_folder() == tmp_path / "wgpu_gi" / "truth"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert truth_cache.cache_folder().parts[-3:] == (".cache", "wgpu_gi", "truth")


def picture(value, channels=3):
    shape = (3, 4, 3) if channels == 3 else (3, 4)
    return np.full(shape, value, np.float32)


@pytest.mark.parametrize("suffix", ["npz", "exr"])
def test_file_as_render_names_its_layers(tmp_path, suffix):
    path = tmp_path / f"truth.{suffix}"
    depth = picture(2.0, 1)
    depth[0, 0] = 0
    layers = {"radiance": picture(6), "direct": picture(2), "indirect": picture(3), "standard_error": picture(0.5)}
    save_image(path, {**layers, "depth": depth})
    truth = truth_from_file(path)
    assert {name: layer[0, 0, 0] for name, layer in truth.layers.items()} == {"full": 6, "direct": 2, "indirect": 3}
    assert {name: layer[0, 0, 0] for name, layer in truth.noise.items()} == {"full": 0.5}
    assert (~truth.surface).sum() == 1
    assert (truth.source, truth.size) == (str(path), SIZE)


@pytest.mark.parametrize(("bounces", "full", "indirect"), [(None, 15, 12), (1, 7, 4)])
def test_file_by_number_of_scatterings(tmp_path, bounces, full, indirect):
    path = tmp_path / "truth.npz"
    layers = {"emit": picture(1), "direct": picture(2), "one": picture(4), "multi": picture(8)}
    noise = {"se_full": picture(0.25), "se_indirect": picture(0.5)}
    np.savez(path, meta=np.array('{"engine": "another"}'), **layers, **noise)
    truth = truth_from_file(path, bounces)
    values = {name: layer[0, 0, 0] for name, layer in truth.layers.items()}
    assert values == {"full": full, "direct": 2, "indirect": indirect}
    noise_of_all = {"full": 0.25, "indirect": 0.5}
    assert {name: layer[0, 0, 0] for name, layer in truth.noise.items()} == (noise_of_all if bounces is None else {})
    assert truth.surface.all()


@pytest.mark.parametrize(
    ("name", "layers", "words"),
    [
        ("missing.npz", None, "no such file"),
        ("truth.png", None, "give a file of .npz or .exr"),
        ("damaged.npz", b"not a zip", "not a readable"),
        ("other.npz", {"albedo": picture(1)}, "holds no layer radiance"),
        ("sizes.npz", {"radiance": picture(1), "direct": np.ones((2, 2, 3))}, "of one size; 'direct' is not"),
        ("nan.npz", {"radiance": picture(np.nan)}, "finite colours"),
        ("grey.npz", {"radiance": picture(1, 1)}, "finite colours"),
    ],
)
def test_bad_files_are_sentences(tmp_path, name, layers, words):
    path = tmp_path / name
    if isinstance(layers, bytes):
        path.write_bytes(layers)
    elif layers is not None:
        np.savez(path, **layers)
    with pytest.raises(GiError, match=words):
        truth_from_file(path)
