"""Environment maps: Radiance in all its encodings, OpenEXR, constants, and damaged files."""

import numpy as np
import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.scene.files.environment_files import load_environment, read_hdr
from wgpu_gi.scene.files.notes import Notes

HEADER = b"#?RADIANCE\n# a comment\nFORMAT=32-bit_rle_rgbe\n"


def rgbe_pixels(height=3, width=20, seed=1):
    rng = np.random.default_rng(seed)
    pixels = rng.integers(2, 256, (height, width, 4)).astype(np.uint8)
    pixels[..., 3] = rng.integers(120, 140, (height, width))
    pixels[:, width // 2 :] = pixels[:, width // 2, None]
    return pixels


def radiance(pixels):
    return pixels[..., :3] * 2.0 ** (pixels[..., 3:].astype(int) - 136)


def hdr(pixels, body, header=HEADER):
    return header + b"\n-Y %d +X %d\n" % pixels.shape[:2] + body


def new_runs(pixels):
    """Encode rows as four planes: the first half copied, the second half one run."""
    body = b""
    half = pixels.shape[1] // 2
    for row in pixels:
        body += bytes([2, 2, len(row) >> 8, len(row) & 255])
        for plane in row.T:
            body += bytes([half]) + plane[:half].tobytes() + bytes([128 + len(row) - half, plane[half]])
    return body


def old_runs(pixels):
    """Encode rows as pixels, the second half by a repeat marker."""
    half = pixels.shape[1] // 2
    return b"".join(row[: half + 1].tobytes() + bytes([1, 1, 1, len(row) - half - 1]) for row in pixels)


@pytest.mark.parametrize("encode", [new_runs, old_runs, lambda pixels: pixels.tobytes()], ids=["new", "old", "flat"])
def test_hdr_encodings(encode):
    pixels = rgbe_pixels()
    image = read_hdr(hdr(pixels, encode(pixels)), "sky.hdr")
    assert image.dtype == np.float32 and image.shape == (3, 20, 3)
    np.testing.assert_array_equal(image, radiance(pixels).astype(np.float32))


def test_hdr_long_old_runs_have_counts_to_the_base_256():
    pixels = np.broadcast_to(np.array([10, 20, 30, 128], np.uint8), (2, 600, 4))
    row = bytes([10, 20, 30, 128, 1, 1, 1, 599 & 255, 1, 1, 1, 599 >> 8])
    np.testing.assert_array_equal(read_hdr(hdr(pixels, row * 2), "x"), radiance(pixels).astype(np.float32))


@pytest.mark.parametrize("first", ["-Y", "+Y", "-X", "+X"])
@pytest.mark.parametrize("sign", ["-", "+"])
def test_hdr_orientations(first, sign):
    """`-Y 3 +X 20` are lines from the top, each from the left; a plus before Y or a minus before X reverses them."""
    pixels = rgbe_pixels()
    stored = pixels
    second = sign + ("X" if first[1] == "Y" else "Y")
    stored = stored[::-1] if "+Y" in (first, second) else stored
    stored = stored[:, ::-1] if "-X" in (first, second) else stored
    stored = stored.transpose(1, 0, 2) if first[1] == "X" else stored
    size = b"\n%s %d %s %d\n" % (first.encode(), stored.shape[0], second.encode(), stored.shape[1])
    image = read_hdr(HEADER + size + np.ascontiguousarray(stored).tobytes(), "x")
    np.testing.assert_array_equal(image, radiance(pixels).astype(np.float32))


HEADERS = [HEADER.replace(b"\n", b"\r\n"), b"#?RGBE\n", b"FORMAT=32-bit_rle_rgbe\nGAMMA=1\n"]


@pytest.mark.parametrize("header", HEADERS, ids=["CR LF", "no format", "no magic"])
def test_hdr_headers_of_other_programs(header):
    pixels = rgbe_pixels()
    good = hdr(pixels, new_runs(pixels), header)
    if b"\r" in header:
        good = good.replace(b"\r\n\n", b"\r\n\r\n").replace(b"X 20\n", b"X 20\r\n")
    np.testing.assert_array_equal(read_hdr(good, "x"), radiance(pixels).astype(np.float32))


def test_hdr_exponent_zero_is_black():
    pixels = np.array([[[128, 64, 32, 129], [9, 9, 9, 0]]], np.uint8)
    image = read_hdr(hdr(pixels, pixels.tobytes(), b"#?RGBE\n"), "x")
    np.testing.assert_array_equal(image, np.array([[[1, 0.5, 0.25], [0, 0, 0]]]))


@pytest.mark.parametrize("line", [b"EXPOSURE=2", b"EXPOSURE =          2.0", b"EXPOSURE=x"])
def test_hdr_exposure_is_noted_and_not_undone(tmp_path, line):
    """As in other readers; the format says that writers scaled the pixels by it."""
    path, notes = tmp_path / "sky.hdr", Notes()
    path.write_bytes(GOOD.replace(b"# a comment", line))
    image = load_environment(str(path), notes).image
    np.testing.assert_array_equal(image, radiance(rgbe_pixels()).astype(np.float32))
    assert any("EXPOSURE" in note and "not undone" in note for note in notes.sentences)


GOOD = hdr(rgbe_pixels(), new_runs(rgbe_pixels()))
BAD_HDR = {
    "no magic": GOOD[2:].replace(b"FORMAT", b"format"),
    "no end of header": HEADER,
    "xyz colours": GOOD.replace(b"rgbe", b"xyze"),
    "no size": HEADER + b"\n",
    "broken size": GOOD.replace(b"-Y 3", b"-Y three"),
    "one axis twice": GOOD.replace(b"+X 20", b"+Y 20"),
    "no pixels": GOOD.replace(b"-Y 3", b"-Y 0"),
    "huge": GOOD.replace(b"-Y 3 +X 20", b"-Y 100000 +X 200000"),
    "more rows than bytes": GOOD.replace(b"-Y 3 +X 20", b"-Y 8000 +X 16000"),
    "truncated": GOOD[:-3],
    "run past the row": GOOD.replace(bytes([138]), bytes([139])),
    "repeat without pixel": hdr(rgbe_pixels(), bytes([1, 1, 1, 20]) * 60),
    "endless repeat": hdr(rgbe_pixels(), bytes([9, 9, 9, 9, 1, 1, 1, 255, 1, 1, 1, 255]) * 60),
}


@pytest.mark.parametrize("case", BAD_HDR)
def test_bad_hdr_gives_one_sentence(tmp_path, case):
    path = tmp_path / "sky.hdr"
    path.write_bytes(BAD_HDR[case])
    with pytest.raises(GiError, match=r"sky\.hdr") as caught:
        load_environment(str(path))
    assert "\n" not in str(caught.value)


def test_hdr_truncated_anywhere_is_an_error():
    for length in range(0, len(GOOD) - 1):
        with pytest.raises(GiError):
            read_hdr(GOOD[:length], "x")


def write_exr(path, channels, **header):
    OpenEXR = pytest.importorskip("OpenEXR")
    settings = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage} | header
    OpenEXR.File(settings, channels).write(str(path))
    return path


@pytest.mark.parametrize("names", ["RGB", "RGBA", "Y"])
@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_exr_channels(tmp_path, names, dtype):
    planes = {name: np.full((4, 8), 0.25 * (i + 1), dtype) for i, name in enumerate(names)}
    environment = load_environment(write_exr(tmp_path / "sky.exr", planes))
    image = environment.image
    assert image.shape == (4, 8, 3) and image.dtype == np.float32 and environment.name == "sky"
    np.testing.assert_array_equal(image[0, 0], [0.25] * 3 if names == "Y" else [0.25, 0.5, 0.75])


def test_row_zero_is_the_top(tmp_path):
    rows = np.repeat(np.arange(4, dtype=np.float32)[:, None], 8, axis=1)
    image = load_environment(write_exr(tmp_path / "rows.exr", dict.fromkeys("RGB", rows))).image
    np.testing.assert_array_equal(image[:, 0, 0], [0, 1, 2, 3])


@pytest.mark.parametrize(
    "names",
    [
        ["View.R", "View.G", "View.B", "Z.V"],
        ["r", "g", "b"],
        ["a.y", "b.R", "b.G", "b.B", "b.A"],
        ["R", "x.R", "B", "G"],
    ],
)
def test_exr_channels_of_layers_and_in_lower_case(tmp_path, names):
    planes = {name: np.full((4, 8), sum(map(ord, name.upper()[-1])), np.float32) for name in names}
    image = load_environment(write_exr(tmp_path / "sky.exr", planes)).image
    np.testing.assert_array_equal(image[0, 0], [ord(name) for name in "RGB"])


@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_infinite_pixels_become_the_largest_half(tmp_path, dtype):
    """Or the brightest pixel of the map, which an infinite one outshines."""
    plane = np.array([[1, np.inf, 0, 2]], dtype)
    notes = Notes(strict=True)
    image = load_environment(write_exr(tmp_path / "sun.exr", dict.fromkeys("RGB", plane)), notes).image
    np.testing.assert_array_equal(image[..., 0], np.array([[1, 65504, 0, 2]], np.float32))
    (note,) = notes.sentences
    assert "3 infinite values were limited to 65504" in note
    plane = np.array([[1, np.inf, 0, 2e6]], np.float32)
    image = load_environment(write_exr(tmp_path / "sun.exr", dict.fromkeys("RGB", plane))).image
    assert image.max() == image[0, 1, 0] == np.float32(2e6)


def test_invalid_pixels_are_replaced_with_a_note(tmp_path):
    plane = np.array([[1, np.nan, np.inf, -np.inf], [-1, 1e20, 0, 2]], np.float32)
    notes = Notes()
    image = load_environment(write_exr(tmp_path / "bad.exr", dict.fromkeys("RGB", plane)), notes).image
    np.testing.assert_array_equal(image[..., 0], np.array([[1, 0, 1e10, 0], [0, 1e10, 0, 2]], np.float32))
    infinite, absurd, bad = notes.sentences
    assert "3 infinite" in infinite and "3 values were limited to 1e+10" in absurd and "9 negative or NaN" in bad
    with pytest.raises(GiError, match="9 negative or NaN"):
        load_environment(tmp_path / "bad.exr", Notes(strict=True))


@pytest.mark.parametrize(
    ("damage", "sentence"),
    [
        (lambda data: data[: len(data) // 2], "truncated"),
        (lambda data: b"#?RADIANCE" + data, "not an OpenEXR file"),
        (lambda data: data[:4] + bytes(100), "truncated or damaged"),
        (lambda data: b"", "empty"),
    ],
)
def test_bad_exr_gives_one_sentence(tmp_path, capfd, damage, sentence):
    noise = np.random.default_rng(1).random((64, 64)).astype(np.float32)
    path = write_exr(tmp_path / "sky.exr", dict.fromkeys("RGB", noise))
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(GiError, match=sentence):
        load_environment(path)
    assert capfd.readouterr() == ("", "")


def test_exr_without_colour_names_its_channels(tmp_path):
    with pytest.raises(GiError, match="Z"):
        load_environment(write_exr(tmp_path / "depth.exr", {"Z": np.ones((4, 8), np.float32)}))


def test_exr_of_absurd_size_raises_before_it_is_read(tmp_path):
    path = write_exr(tmp_path / "sky.exr", dict.fromkeys("RGB", np.ones((4, 8), np.float32)))
    data = path.read_bytes()
    window = np.array([0, 0, 7, 3], "<i4").tobytes()
    path.write_bytes(data.replace(window, np.array([0, 0, 99999, 99999], "<i4").tobytes()))
    with pytest.raises(GiError, match="100000x100000"):
        load_environment(path)


def test_constants():
    assert load_environment("0.5,0.25, 1e2").color == (0.5, 0.25, 100.0)
    assert load_environment("2").color == (2.0, 2.0, 2.0)
    assert load_environment("0,0,0").image is None


@pytest.mark.parametrize("text", ["", "1,2", "1,2,3,4", "a,b,c", "sky.png", "-1,0,0", "nan,0,0", "inf,0,0", "1;2;3"])
def test_bad_constants(text):
    with pytest.raises(GiError, match="environment"):
        load_environment(text)


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(GiError, match="does not exist"):
        load_environment(tmp_path / "none.hdr")
    (tmp_path / "folder.exr").mkdir()
    with pytest.raises(GiError, match="folder"):
        load_environment(tmp_path / "folder.exr")
