"""Picture files: what is written comes back, the tone curve has its known values, failure leaves nothing behind."""

import os
import stat
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image as Pillow

from wgpu_gi.errors import GiError
from wgpu_gi.pictures import writers
from wgpu_gi.pictures.color import linear_from_srgb, srgb_from_linear
from wgpu_gi.pictures.display import display_layer, tone_map
from wgpu_gi.pictures.exr_files import read_exr
from wgpu_gi.pictures.image import (
    FORMATS,
    check_output,
    load_image,
    save_image,
)
from wgpu_gi.pictures.picture import Picture
from wgpu_gi.scene.files.environment_files import load_environment


@pytest.fixture
def layers():
    random = np.random.default_rng(1)
    return {
        "radiance": random.exponential(10.0, (5, 7, 3)).astype(np.float32),
        "normal": random.uniform(-1, 1, (5, 7, 3)).astype(np.float32),
        "depth": random.uniform(1, 9, (5, 7)).astype(np.float32),
    }


@pytest.mark.parametrize("suffix", [".exr", ".npz"])
def test_layers_come_back_bit_for_bit(tmp_path, layers, suffix):
    path = tmp_path / f"picture{suffix}"
    save_image(path, layers)
    assert np.array_equal(load_image(path), layers["radiance"])
    for name, layer in layers.items():
        read = load_image(path, name)
        assert read.dtype == np.float32
        assert np.array_equal(read, layer)


@pytest.mark.parametrize("suffix", [".exr", ".npz", ".npy"])
def test_values_beyond_half_floats_and_not_finite_ones_survive(tmp_path, suffix):
    values = np.array([[[1e30, -2.0, 1e-30], [np.inf, np.nan, 0.0]]], np.float32)
    path = tmp_path / f"picture{suffix}"
    save_image(path, {"radiance": values})
    assert np.array_equal(load_image(path), values, equal_nan=True)


def test_layer_of_text_is_refused(tmp_path):
    np.savez(tmp_path / "p.npz", meta=np.array('{"spp": 4}'), one=np.ones((2, 3, 3)), seen=np.ones((2, 3), bool))
    for layer in ("meta", None):
        with pytest.raises(GiError, match=r"p\.npz:meta holds no numbers; name a layer"):
            load_image(tmp_path / "p.npz", layer)
    assert load_image(tmp_path / "p.npz", "seen").all()


def test_npy_is_float32_height_width_3(tmp_path, layers):
    save_image(tmp_path / "p.npy", {"radiance": layers["radiance"].astype(np.float64)}, exposure=3.0)
    array = np.load(tmp_path / "p.npy")
    assert array.dtype == np.float32
    assert np.array_equal(array, layers["radiance"])


def test_exr_channels_and_header(tmp_path, layers):
    import OpenEXR

    save_image(tmp_path / "p.exr", layers, metadata={"spp": 64, "scene": "cornell"})
    with OpenEXR.File(str(tmp_path / "p.exr"), separate_channels=True) as file:
        assert set(file.channels()) == {"R", "G", "B", "normal.R", "normal.G", "normal.B", "depth.Z"}
        assert file.header()["spp"] == "64"
        assert file.header()["scene"] == "cornell"


@pytest.mark.parametrize("main", ["depth", "error"])
def test_exr_with_a_single_channel_as_main_layer(tmp_path, layers, main):
    save_image(tmp_path / "p.exr", {main: layers["depth"], "normal": layers["normal"]})
    assert np.array_equal(load_image(tmp_path / "p.exr"), layers["depth"])
    assert np.array_equal(load_image(tmp_path / "p.exr", main), layers["depth"])


def test_exr_of_others_is_read(tmp_path):
    import OpenEXR

    pixels = np.full((2, 3, 3), 0.5, np.float16)
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, {"RGB": pixels}) as file:
        file.write(str(tmp_path / "p.exr"))
    assert np.array_equal(load_image(tmp_path / "p.exr"), pixels.astype(np.float32))


def test_png_has_exposure_tone_curve_and_text(tmp_path):
    from PIL import Image

    save_image(tmp_path / "p.png", {"radiance": np.full((2, 3, 3), 0.25)}, exposure=1.0, metadata={"spp": 4})
    with Image.open(tmp_path / "p.png") as picture:
        assert (picture.size, picture.mode) == ((3, 2), "RGB")
        # 0.25 * 2 = 0.5, which the curve leaves as it is.
        assert (np.asarray(picture) == int(np.round(srgb_from_linear(0.5) * 255))).all()
        assert picture.text["spp"] == "4"
    assert load_image(tmp_path / "p.png") == pytest.approx(0.5, abs=0.005)


def test_same_picture_same_bytes(tmp_path, layers):
    for suffix in (".exr", ".npz", ".png"):
        given = {"radiance": layers["radiance"]} if suffix == ".png" else layers
        for name in ("a", "b"):
            save_image(tmp_path / f"{name}{suffix}", given, metadata={"spp": 1})
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_srgb_known_values_and_round_trip():
    known = {0.0: 0.0, 0.0031308: 0.04045, 0.18: 0.46136, 0.5: 0.73536, 1.0: 1.0}
    assert srgb_from_linear(list(known)) == pytest.approx(list(known.values()), abs=1e-5)
    assert srgb_from_linear([-1.0, 2.0]) == pytest.approx([0.0, 1.0])
    x = np.linspace(0, 1, 1001, dtype=np.float32)
    assert linear_from_srgb(srgb_from_linear(x)) == pytest.approx(x, abs=1e-6)


def test_tone_map_known_values():
    # Identity up to 0.76. Above: 1 - d^2/(peak + d - 0.76).
    assert tone_map([0.04] * 3) == pytest.approx([0.04] * 3)
    assert tone_map([0.5] * 3) == pytest.approx([0.5] * 3)
    assert tone_map([0.25] * 3, 1.0) == pytest.approx([0.5] * 3)
    assert tone_map([1.0] * 3) == pytest.approx([1.0 - 0.24**2 / (1.0 + 0.24 - 0.76)] * 3, abs=1e-6)
    peak = 10.0 - 0.0
    new_peak = 1.0 - 0.24**2 / (peak + 0.24 - 0.76)
    grey = 1.0 - 1.0 / (0.15 * (peak - new_peak) + 1.0)
    assert tone_map([10.0, 0.0, 0.0]) == pytest.approx([new_peak, grey * new_peak, grey * new_peak], abs=1e-6)


def test_tone_map_stays_in_range_and_rises():
    x = np.geomspace(1e-6, 3e38, 2000).astype(np.float32)
    for exposure in (-1e4, -10.0, 0.0, 10.0, 1e4):
        curve = tone_map(np.repeat(x[:, None], 3, axis=1), exposure)[:, 0]
        assert np.isfinite(curve).all()
        assert (np.diff(curve) >= -1e-6).all()
        assert curve.min() >= 0.0
        assert curve.max() <= 1.0
    odd = tone_map([[np.nan, np.inf, -np.inf], [-1.0, 0.0, 1.0]])
    assert np.isfinite(odd).all()
    assert odd.min() >= 0.0
    assert odd.max() <= 1.0


def test_display_of_buffers():
    assert display_layer("normal", np.array([[[0.0, 1.0, -1.0]]]))[0, 0] == pytest.approx([0.5, 1.0, 0.0])
    depth = display_layer("depth", np.array([[1.0, 3.0, np.inf, 0.0]]))
    assert depth.shape == (1, 4, 3)
    assert depth[0, :, 0] == pytest.approx([1.0, 0.1, 0.0, 0.0])
    position = display_layer("position", np.array([[[0.0, 0.0, 5.0], [2.0, 1.0, 5.0], [np.nan] * 3]]))
    assert position[0, 1] == pytest.approx([1.0, 0.5, 0.0])
    assert np.isfinite(position).all()
    assert display_layer("albedo", np.full((1, 1, 3), 0.5), 4.0)[0, 0] == pytest.approx(srgb_from_linear([0.5] * 3))
    for name in ("depth", "normal", "position", "radiance"):
        nothing = np.zeros((2, 2)) if name == "depth" else np.full((2, 2, 3), np.nan)
        shown = display_layer(name, nothing)
        assert shown.shape == (2, 2, 3)
        assert np.isfinite(shown).all()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("picture.tiff", "unknown picture format '.tiff'; use one of .png .exr .npy .npz .jpg .jpeg .webp .hdr"),
        ("picture", "unknown picture format ''"),
        ("missing/picture.png", "there is no folder"),
        ("folder.png", "is a folder"),
        ("file.txt/picture.png", "there is no folder"),
        ("x" * 300 + ".png", "cannot be written"),
    ],
)
def test_check_output_refuses(tmp_path, name, words):
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "file.txt").touch()
    with pytest.raises(GiError, match=words):
        check_output(tmp_path / name)
    assert sorted(os.listdir(tmp_path)) == ["file.txt", "folder.png"]


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs a folder in which nobody may write, root included")
def test_unwritable_folder():
    with pytest.raises(GiError, match="cannot be written"):
        check_output("/proc/self/picture.png")


@pytest.mark.parametrize("suffix", [".png", ".npy"])
def test_formats_of_one_layer_refuse_more(tmp_path, layers, suffix):
    for attempt in (lambda p: check_output(p, ("radiance", "depth")), lambda p: save_image(p, layers)):
        with pytest.raises(GiError, match=r"holds one buffer; for radiance, (depth|normal)"):
            attempt(tmp_path / f"p{suffix}")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError, OSError])
def test_failure_keeps_the_old_file_and_leaves_no_other(tmp_path, monkeypatch, error):
    path = tmp_path / "p.npy"
    path.write_bytes(b"old")

    def half_written(temporary, layers, exposure, texts):
        temporary.write_bytes(b"half")
        raise error("no more")

    monkeypatch.setitem(writers.WRITERS, ".npy", half_written)
    with pytest.raises(GiError if error is OSError else error):
        save_image(path, {"radiance": np.zeros((2, 2, 3))})
    assert os.listdir(tmp_path) == ["p.npy"]
    assert path.read_bytes() == b"old"


@pytest.mark.skipif(sys.platform == "win32", reason="file modes and links of POSIX")
def test_rights_and_links_are_those_of_an_ordinary_write(tmp_path):
    (tmp_path / "real.npy").touch()
    (tmp_path / "link.npy").symlink_to("real.npy")
    save_image(tmp_path / "link.npy", {"radiance": np.zeros((2, 2, 3))})
    assert (tmp_path / "link.npy").is_symlink()
    plain = tmp_path / "plain"
    plain.touch()
    assert stat.S_IMODE((tmp_path / "real.npy").stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("none.npy", None, "no such file"),
        ("p.gif", b"GIF", "unknown picture format"),
        ("p.npy", b"", "not a readable .npy"),
        ("p.npz", b"PK", "not a readable .npz"),
        ("p.png", b"\x89PNG\r\n", "not a readable .png"),
        ("p.exr", b"v/1\x01nothing", "not a readable .exr"),
    ],
)
def test_load_refuses_bad_files(tmp_path, name, content, words):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(GiError, match=words):
        load_image(tmp_path / name)


def test_load_refuses_unknown_layers_and_pickles(tmp_path, layers):
    save_image(tmp_path / "p.npz", layers)
    with pytest.raises(GiError, match="holds no layer albedo; it has: radiance, normal, depth"):
        load_image(tmp_path / "p.npz", "albedo")
    save_image(tmp_path / "p.npy", {"radiance": layers["radiance"]})
    with pytest.raises(GiError, match="without a name"):
        load_image(tmp_path / "p.npy", "radiance")
    np.save(tmp_path / "q.npy", np.array([object()]), allow_pickle=True)
    with pytest.raises(GiError, match=r"not a readable \.npy"):
        load_image(tmp_path / "q.npy")


@pytest.mark.parametrize("shape", [(2, 2, 5), (4,), (0, 5, 3)])
def test_layers_of_odd_shape_are_refused(tmp_path, shape):
    with pytest.raises(GiError, match="layer 'radiance'"):
        save_image(tmp_path / "p.npy", {"radiance": np.zeros(shape)})


def ramp() -> np.ndarray:
    """Return a picture (16, 24, 3) of smooth colours."""
    y, x = np.mgrid[0:16, 0:24]
    return np.stack([x / 24, y / 16, np.full(x.shape, 0.3)], -1).astype(np.float32) * 0.7


@pytest.mark.parametrize(("suffix", "most"), [(".webp", 0), (".jpg", 12), (".jpeg", 12)])
def test_pictures_of_8_bits_hold_what_png_holds(tmp_path, suffix, most):
    """WebP is lossless; JPEG loses some steps of 255."""
    for name in ("p.png", f"p{suffix}"):
        save_image(tmp_path / name, {"radiance": ramp()}, exposure=0.0)
    png, other = (srgb_from_linear(load_image(tmp_path / name)) * 255 for name in ("p.png", f"p{suffix}"))
    assert png.shape == other.shape and np.abs(png - other).max() <= most + 1e-3


def test_hdr_keeps_radiance_to_half_a_step(tmp_path):
    """The largest channel has a mantissa of 127.75 or more before it is rounded: half a step is at most 1/255 of it."""
    picture = ramp() * np.float32(1e3)
    picture[0, 0], picture[0, 1], picture[0, 2] = (0, 0, 0), (1e-30, 2e-30, 3e-30), (255.9999, 1, 0)
    picture[1, 0] = (np.nan, -1.0, 5.0)
    save_image(tmp_path / "p.hdr", {"radiance": picture})
    found = load_environment(tmp_path / "p.hdr").image
    expected = np.maximum(np.nan_to_num(picture), 0)
    assert found.shape == picture.shape and found[0, 0].tolist() == [0, 0, 0]
    assert (np.abs(found - expected) <= expected.max(-1, keepdims=True) / 255 + 1e-38).all()


def test_grey_layers_fit_into_every_format(tmp_path):
    for suffix in FORMATS:
        save_image(tmp_path / f"p{suffix}", {"depth": ramp()[..., 0]})
        assert (tmp_path / f"p{suffix}").stat().st_size > 0


def covered() -> np.ndarray:
    """Return the ramp as RGBA with colours multiplied by alpha, 0 to 1 from left to right."""
    alpha = np.broadcast_to(np.linspace(0, 1, 24, dtype=np.float32), (16, 24))[..., None]
    return np.concatenate([ramp() * alpha, alpha], -1)


@pytest.mark.parametrize("suffix", [".png", ".webp"])
def test_alpha_is_straight_in_8_bits(tmp_path, suffix):
    """So colours do not depend on alpha, but for pixels that nothing covers."""
    save_image(tmp_path / f"a{suffix}", {"radiance": covered()}, exposure=0.0)
    save_image(tmp_path / "b.png", {"radiance": ramp()}, exposure=0.0)
    with Pillow.open(tmp_path / f"a{suffix}") as a, Pillow.open(tmp_path / "b.png") as b:
        assert (a.mode, b.mode) == ("RGBA", "RGB")
        found, expected = np.asarray(a).astype(int), np.asarray(b).astype(int)
    assert np.array_equal(found[0, :, 3], np.round(np.linspace(0, 255, 24)))
    assert np.abs(found[:, 1:, :3] - expected[:, 1:]).max() <= 1 and not found[:, 0].any()


def test_alpha_is_associated_in_float_files(tmp_path):
    save_image(tmp_path / "a.exr", {"radiance": covered(), "depth": ramp()[..., 0]})
    save_image(tmp_path / "a.npy", {"radiance": covered()})
    _, channels = read_exr(tmp_path / "a.exr", lambda *_: None)
    found = np.stack([channels[letter] for letter in "RGBA"], -1)
    assert np.array_equal(found, covered()) and np.array_equal(np.load(tmp_path / "a.npy"), covered())
    assert np.array_equal(load_image(tmp_path / "a.exr"), covered()[..., :3])


@pytest.mark.parametrize("suffix", [".jpg", ".hdr"])
def test_formats_without_alpha_are_refused(tmp_path, suffix):
    with pytest.raises(GiError, match=r"holds no transparency; use \.png"):
        save_image(tmp_path / f"a{suffix}", {"radiance": covered()})
    with pytest.raises(GiError, match="holds no transparency"):
        check_output(tmp_path / f"a{suffix}", ["radiance"], transparent=True)
    check_output(tmp_path / f"a{suffix}", ["depth"], transparent=True)


def test_a_picture_is_an_array_that_saves_itself(tmp_path):
    picture = Picture(ramp(), "radiance", 1.0)
    assert isinstance(picture, np.ndarray) and type(picture.mean()) is np.float32
    picture.save(tmp_path / "a.png")
    picture.save(tmp_path / "b.png", exposure=0.0)
    (picture * 2).save(tmp_path / "c.png", exposure=0.0)
    picture[..., 0].save(tmp_path / "d.npy")
    save_image(tmp_path / "e.png", picture, exposure=1.0)
    a, b, c, e = (load_image(tmp_path / f"{name}.png") for name in "abce")
    assert np.array_equal(a, c) and np.array_equal(a, e) and a.mean() > b.mean()


def test_bytes_for_a_screen_stay_unchanged(tmp_path):
    pixels = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)
    Picture(pixels, "display").save(tmp_path / "a.png")
    with Pillow.open(tmp_path / "a.png") as image:
        assert np.array_equal(np.asarray(image), pixels)


def test_import_is_cheap():
    heavy = "('PIL', 'OpenEXR', 'wgpu', 'mapbox_earcut')"
    code = f"import sys, wgpu_gi.pictures.image; print(*[m for m in {heavy} if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == ""
