"""`wgpu-gi compare`: what it reads, prints and writes, its page, and a sentence for whatever cannot be compared."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import sys
import zlib
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from wgpu_gi.__main__ import main
from wgpu_gi.cli.compare import load_picture, split_layer
from wgpu_gi.measure.compare_page import DIVERGING, HEAT, colored, comparison_page, rounded_up
from wgpu_gi.measure.metrics import bias, display_scale, measure, noise_floor, percentile_error, relmse
from wgpu_gi.pictures.image import save_image

HEIGHT, WIDTH = 9, 12
RANDOM = np.random.default_rng(5)
TRUTH = {name: RANDOM.uniform(0.1, 1.0, (HEIGHT, WIDTH, 3)).astype(np.float32) for name in ("direct", "one", "multi")}
NOISE = np.full((HEIGHT, WIDTH, 3), 0.05, np.float32)
INDIRECT = TRUTH["one"] + TRUTH["multi"]
IMAGE = (INDIRECT * RANDOM.uniform(0.8, 1.3, INDIRECT.shape)).astype(np.float32)
LABELS = np.repeat(np.arange(HEIGHT) // 5 * 7, WIDTH).reshape(HEIGHT, WIDTH).astype(np.uint8)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A picture, its truth with layers, a mask, and a folder of one's own to write to."""
    monkeypatch.chdir(tmp_path)
    np.savez("a.npz", radiance=IMAGE, indirect=IMAGE, depth=IMAGE[..., 0])
    np.savez("b.npz", meta=np.array('{"spp": 4}'), **TRUTH, radiance=INDIRECT, se=NOISE, depth=INDIRECT[..., 0])
    np.save("a.npy", IMAGE)
    Image.fromarray(LABELS).save("mask.png")
    return tmp_path


def table(text):
    """Return the printed table as {row: {column: text}}."""
    lines = [re.split(r"\s{2,}", line.strip()) for line in text.split("\n\n")[1].splitlines()]
    header = next(line for line in lines if "relMSE" in line)
    rows = [line for line in lines if len(line) == len(header) + 1]
    return {name: dict(zip(header, cells, strict=True)) for name, *cells in rows}


def fails(capsys, *arguments):
    """Run a command that must fail with one sentence, and return it."""
    assert main(["compare", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith("wgpu-gi: error: ") and error.count("\n") == 1
    return error


def test_numbers_of_the_table(capsys):
    assert main(["compare", "a.npz", "b.npz:one+multi", "--noise", "b.npz:se", "--mask", "mask.png"]) == 0
    printed = capsys.readouterr().out
    assert "a.npz" in printed and "b.npz:one+multi: the truth, 12x9, colour" in printed
    rows = table(printed)
    assert list(rows) == ["whole picture", "region 0", "region 7"]
    for row, mask in zip(rows.values(), (None, LABELS == 0, LABELS == 7), strict=True):
        assert float(row["relMSE"]) == pytest.approx(relmse(IMAGE, INDIRECT, NOISE, mask), rel=0.01)
        assert float(row["noise floor"]) == pytest.approx(noise_floor(NOISE, INDIRECT, mask), rel=0.01)
        assert float(row["bias"].removesuffix(" %")) == pytest.approx(100 * bias(IMAGE, INDIRECT, mask), abs=0.006)
        assert float(row["99.9th percentile"]) == pytest.approx(percentile_error(IMAGE, INDIRECT, mask=mask), rel=0.01)
    assert [row["pixels"] for row in rows.values()] == ["108", "60", "48"]


def test_where_the_page_goes(capsys, folder):
    assert main(["compare", "a.npz", "b.npz"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("compare.html: both pictures")
    assert main(["compare", "a.npz", "b.npz", "--html", "other.html"]) == 0
    assert (folder / "compare.html").read_bytes() == (folder / "other.html").read_bytes()
    (folder / "compare.html").unlink()
    assert main(["compare", "a.npz", "b.npz", "--no-html"]) == 0
    assert not (folder / "compare.html").exists()


def test_equal_pictures(capsys):
    assert main(["compare", "b.npz", "b.npz"]) == 0
    row = table(capsys.readouterr().out)["whole picture"]
    assert (row["relMSE"], row["bias"], row["99.9th percentile"]) == ("0", "+0.00 %", "0")
    assert "noise floor" not in row


def test_error_within_the_noise_has_a_note(capsys):
    assert main(["compare", "b.npz", "b.npz", "--noise", "b.npz:se"]) == 0
    assert "within the noise of the truth in: whole picture" in capsys.readouterr().out


def test_json(capsys):
    assert main(["compare", "a.npz", "b.npz", "--layer", "depth", "--mask", "mask.png", "--json", "o.json"]) == 0
    assert "o.json: the numbers" in capsys.readouterr().out
    with open("o.json", encoding="utf-8") as file:
        report = json.load(file)
    assert (report["a"], report["b"], report["size"]) == ("a.npz:depth", "b.npz:depth", [WIDTH, HEIGHT])
    a, b = IMAGE[..., 0], INDIRECT[..., 0]
    assert report["whole"]["bias"] == pytest.approx(bias(a, b))
    assert report["regions"]["7"]["relmse"] == pytest.approx(measure(a, b, mask=LABELS == 7).relmse)
    assert report["whole"]["floor"] is None and list(report["regions"]) == ["0", "7"]


def test_missing_flip_has_a_note(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    assert main(["compare", "a.npz", "b.npz"]) == 0
    printed = capsys.readouterr().out
    assert table(printed)["whole picture"]["FLIP"] == "not installed"
    assert "pip install flip-evaluator" in printed


def test_flip_of_regions(capsys):
    pytest.importorskip("flip_evaluator")
    np.save("half.npy", np.where(LABELS[..., None] == 7, INDIRECT * 0.5, IMAGE))
    assert main(["compare", "half.npy", "b.npz", "--mask", "mask.png"]) == 0
    whole, *parts = (float(row["FLIP"]) for row in table(capsys.readouterr().out).values())
    assert 0 < parts[0] < whole < parts[1] < 1
    assert whole == pytest.approx((60 * parts[0] + 48 * parts[1]) / 108, abs=1e-4)


def test_black_region(capsys):
    truth = INDIRECT * (LABELS == 7)[..., None]
    np.savez("dark.npz", radiance=truth)
    assert main(["compare", "a.npz", "dark.npz", "--mask", "mask.png"]) == 0
    printed = capsys.readouterr().out
    assert table(printed)["region 0"]["relMSE"] == "-"
    assert "the truth is black in region 0" in printed


@pytest.mark.parametrize(
    ("text", "path", "layer"),
    [
        ("a.npz", "a.npz", None),
        ("a.npz:indirect", "a.npz", "indirect"),
        ("b.NPZ:one+multi", "b.NPZ", "one+multi"),
        (r"C:\a.npz", r"C:\a.npz", None),
        (r"C:\a.npz:one", r"C:\a.npz", "one"),
        ("a.npz:", "a.npz:", None),
    ],
)
def test_layer_after_a_colon(text, path, layer):
    found, name = split_layer(text)
    assert (str(found), name) == (path, layer)


@pytest.mark.skipif(sys.platform == "win32", reason="no colon in file names")
def test_file_with_a_colon_in_its_name():
    shutil.copy("a.npz", "a.npz:one")
    assert split_layer("a.npz:one")[1] is None


def test_which_layer_is_read(capsys):
    save_image("b.exr", {"indirect": INDIRECT, "direct": TRUTH["direct"]})
    assert np.array_equal(load_picture("b.exr").values, INDIRECT)
    assert np.array_equal(load_picture("b.exr:direct").values, TRUTH["direct"])
    assert np.array_equal(load_picture("b.exr", "direct").values, TRUTH["direct"])
    assert np.array_equal(load_picture("b.npz:one", "direct").values, TRUTH["one"])
    assert np.array_equal(load_picture("a.npy", "direct").values, IMAGE)
    assert np.array_equal(load_picture("b.npz: direct + one ").values, TRUTH["direct"] + TRUTH["one"])


@pytest.mark.parametrize("suffix", [".npz", ".exr"])
def test_mask_of_a_linear_file(capsys, suffix):
    save_image(f"m{suffix}", {"radiance": np.repeat(LABELS[..., None], 3, -1)})
    assert main(["compare", "a.npz", "b.npz", "--mask", f"m{suffix}"]) == 0
    assert list(table(capsys.readouterr().out)) == ["whole picture", "region 0", "region 7"]


def test_png_masks_are_not_decoded(capsys):
    palette = Image.fromarray(LABELS).convert("P")
    palette.putpalette([255, 0, 0] * 256)
    colors = Image.fromarray(np.stack([LABELS, LABELS, LABELS * 0], -1))
    names = []
    for mask in (palette, Image.fromarray(LABELS > 0), Image.fromarray(LABELS.astype(np.uint16) * 1000), colors):
        mask.save("m.png")
        assert main(["compare", "a.npz", "b.npz", "--mask", "m.png"]) == 0
        names.append(list(table(capsys.readouterr().out))[-1])
    assert names == ["region 7", "region 1", "region 7000", "region 7,7,0"]


def test_one_sentence_for_every_bad_input(capsys, folder):
    np.save("small.npy", IMAGE[:4])
    np.save("black.npy", np.zeros_like(IMAGE))
    np.save("four.npy", np.ones((HEIGHT, WIDTH, 4)))
    np.savez("mixed.npz", x=IMAGE, y=IMAGE[..., 0])
    (folder / "broken.npz").write_bytes(b"PK no zip")
    Image.fromarray(LABELS[:4]).save("small.png")
    holes = IMAGE.copy()
    holes[3, 5, 1] = holes[8, 0, 0] = np.nan
    np.save("holes.npy", holes)
    np.save("infinite.npy", np.where(np.arange(WIDTH)[:, None] == 2, np.inf, IMAGE))
    np.save("noise.npy", -NOISE)
    Image.fromarray(np.arange(HEIGHT * WIDTH, dtype=np.uint8).reshape(HEIGHT, WIDTH)).save("smooth.png")

    assert "gone.npz: no such file" in fails(capsys, "gone.npz", "b.npz")
    assert "8-bit tone-mapped values cannot be measured" in fails(capsys, "mask.png", "b.npz")
    assert "takes .npy .npz .exr" in fails(capsys, "a.jpg", "b.npz")
    assert "not a readable .npz" in fails(capsys, "broken.npz", "b.npz")
    missing = fails(capsys, "a.npz:indirect", "b.npz:glow")
    assert "b.npz: holds no layer glow; it has: meta, direct, one, multi" in missing and "b.npz:LAYER" in missing
    assert "holds no layer radiance; it has: x, y" in fails(capsys, "mixed.npz", "b.npz")
    assert "have no sum" in fails(capsys, "mixed.npz:x+y", "b.npz")
    assert "holds no numbers" in fails(capsys, "b.npz:meta", "b.npz")
    assert "leave out 'one'" in fails(capsys, "a.npy:one", "b.npz")
    assert "(9, 12, 4)" in fails(capsys, "four.npy", "b.npz")
    assert "12x4, colour, but b.npz is 12x9, colour" in fails(capsys, "small.npy", "b.npz")
    assert "12x9, grey, but b.npz is 12x9, colour" in fails(capsys, "a.npz:depth", "b.npz")
    assert "holes.npy: NaN at pixel x 5, y 3 (from the top left) and 1 more" in fails(capsys, "holes.npy", "b.npz")
    assert "infinite.npy: Inf at pixel x 2, y 0" in fails(capsys, "a.npz", "infinite.npy")
    assert "black.npy is black" in fails(capsys, "a.npz", "black.npy")
    assert "12x4" in fails(capsys, "a.npz", "b.npz", "--noise", "small.npy")
    assert "negative" in fails(capsys, "a.npz", "b.npz", "--noise", "noise.npy")
    assert "cannot be added" in fails(capsys, "a.npz", "b.npz", "--noise", "b.npz:se+one")
    assert "small.png is 12x4, but b.npz is 12x9" in fails(capsys, "a.npz", "b.npz", "--mask", "small.png")
    assert "108 distinct values" in fails(capsys, "a.npz", "b.npz", "--mask", "smooth.png")
    assert "gone.png: no such file" in fails(capsys, "a.npz", "b.npz", "--mask", "gone.png")
    assert "ends in .html, not 'b.npz'" in fails(capsys, "a.npz", "b.npz", "--html", "b.npz")
    assert "ends in .json" in fails(capsys, "a.npz", "b.npz", "--json", "out.txt")
    assert "there is no folder" in fails(capsys, "a.npz", "b.npz", "--html", "gone/o.html")
    (folder / "taken.html").mkdir()
    assert "is a folder" in fails(capsys, "a.npz", "b.npz", "--html", "taken.html")
    assert not list(folder.glob("*.tmp")) and not list(folder.glob(".wgpu_gi*"))


def uris(page):
    """Return the pictures that are embedded in a page, as arrays (h, w, 3)."""
    found = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    return [np.asarray(Image.open(BytesIO(base64.b64decode(text)))) for text in found]


def halves(page, name):
    text = re.search(rf'id="half-{name}">([^<]*)<', page)[1]
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), "<f2").astype(np.float32)


@pytest.mark.parametrize("grey", [False, True])
def test_page_holds_pictures_and_values(grey):
    x, t = (picture[..., 0] if grey else picture for picture in (IMAGE, INDIRECT))
    page = comparison_page(("A", x), ("B", t), [["", "relMSE"], ["whole", "0.1"]], ["a remark"])
    assert [picture.shape for picture in uris(page)] == [(HEIGHT, WIDTH, 3)] * 4
    scale = display_scale(t)
    assert np.allclose(halves(page, "a") / scale, x.ravel(), rtol=1e-3)
    assert np.allclose(halves(page, "b") / scale, t.ravel(), rtol=1e-3)
    facts = json.loads(re.search(r"const facts = (.*);", page)[1])
    assert (facts["width"], facts["height"], facts["channels"]) == (WIDTH, HEIGHT, 1 if grey else 3)
    assert facts["scale"] == scale and facts["mean"] == pytest.approx(t.mean(), rel=1e-6)
    assert "<p>a remark</p>" in page and "<td>0.1</td>" in page


def test_page_is_one_file_and_escapes_names():
    page = comparison_page(("<b>$x & y", IMAGE), ("</script>", INDIRECT), [["", "FLIP"], ["<i>", "&"]], [])
    assert "<b>" not in page and "&lt;b&gt;$x &amp; y" in page and "&lt;i&gt;" in page
    assert page.count("</script>") == page.count("<script")
    assert not re.search(r"https?://|<link|@import|fetch\(", page)


def test_colours_of_the_difference_and_the_heat_map():
    truth = np.ones((1, 4))
    image = truth + np.array([[-4.0, 0.0, 0.0011, 4.0]])
    difference, heat = uris(comparison_page(("A", image), ("B", truth), [["", ""]], []))[2:]
    # The mean size of the difference is 2, so the scale ends at 10: 4 * 2, rounded up.
    assert np.array_equal(difference[0, 1], DIVERGING[2])
    expected = colored(np.array([[0.3, 0.5, 0.5, 0.7]]), DIVERGING)[0]
    assert np.abs(difference[0].astype(float) - expected)[[0, 1, 3]].max() <= 0.5
    assert np.array_equal(heat[0, 1], HEAT[0]) and np.array_equal(heat[0, 2], HEAT[0])  # 0 and 0.001
    assert np.array_equal(heat[0, 0], HEAT[-1])  # beyond 1


@pytest.mark.parametrize("factor", [1e-12, 1.0, 1e12])
def test_page_whatever_the_intensity(factor):
    page = comparison_page(("A", IMAGE * factor), ("B", INDIRECT * factor), [["", ""]], [])
    reference = comparison_page(("A", IMAGE), ("B", INDIRECT), [["", ""]], [])
    for one, two in zip(uris(page)[:2], uris(reference)[:2], strict=True):
        assert np.abs(one.astype(int) - two).max() <= 1
    assert np.allclose(halves(page, "a"), halves(reference, "a"), rtol=2e-3)


@pytest.mark.parametrize(("value", "up"), [(1, 1), (1.1, 2), (0.3, 0.5), (51, 100), (2e-9, 2e-9), (0.2, 0.2)])
def test_scale_is_a_round_number(value, up):
    assert rounded_up(value) == pytest.approx(up)


def test_page_of_one_pixel_and_of_a_strip():
    for shape in ((1, 1), (1, 1, 3), (200, 3, 3)):
        same = np.full(shape, 0.5)
        pictures = uris(comparison_page(("A", same), ("B", same), [["", ""]], []))
        assert [picture.shape[:2] for picture in pictures] == [shape[:2]] * 4
        assert (pictures[2] == DIVERGING[2]).all() and (pictures[3] == HEAT[0]).all()


CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium to open the page with")
@pytest.mark.parametrize("grey", [False, True])
def test_page_in_a_browser(folder, grey):
    layer = ["--layer", "depth"] if grey else []
    assert main(["compare", "a.npz", "b.npz", *layer]) == 0
    page = (folder / "compare.html").read_text(encoding="utf-8")
    # Point at pixel (5, 3) of B and write the codes of the canvas at +1 EV into the title.
    probe = """<script>setTimeout(() => {
      const slider = document.getElementById("exposure"), view = document.querySelectorAll(".view")[1];
      slider.value = 1;
      slider.dispatchEvent(new Event("input"));
      const box = view.getBoundingClientRect();
      view.dispatchEvent(new MouseEvent("mousemove", {clientX: box.left + box.width * 5.5 / 12,
                                                      clientY: box.top + box.height * 3.5 / 9}));
      const pixel = view.querySelector("canvas").getContext("2d").getImageData(5, 3, 1, 1).data;
      document.title = [...pixel].join(" ");
    }, 1000)</script></body>"""
    (folder / "probe.html").write_text(page.replace("</body>", probe), encoding="utf-8")
    command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'profile'}"]
    command += ["--virtual-time-budget=3000", "--dump-dom", (folder / "probe.html").as_uri()]
    dom = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False).stdout
    truth, image = (np.atleast_1d(p[3, 5, 0] if grey else p[3, 5]) for p in (INDIRECT, IMAGE))
    linear = np.clip(truth * display_scale(INDIRECT[..., 0] if grey else INDIRECT) * 2, 0, 1)
    codes = np.broadcast_to(255 * (1.055 * linear ** (1 / 2.4) - 0.055), 3)
    shown = [int(code) for code in re.search(r"<title>([\d ]+)</title>", dom)[1].split()]
    assert np.abs(shown[:3] - codes).max() <= 1 and shown[3] == 255
    probed = re.search(r'id="probe">x 5, y 3\nA +([-\d. ]+?) +B +([-\d. ]+)\nA - B', dom)
    assert np.allclose([float(text) for text in probed[1].split()], image, rtol=6e-3)
    assert np.allclose([float(text) for text in probed[2].split()], truth, rtol=6e-3)
