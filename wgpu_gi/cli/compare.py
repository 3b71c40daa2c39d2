"""`wgpu-gi compare`: prints the errors of a linear picture against a truth; writes an HTML page and a JSON file."""

from __future__ import annotations

import json
import re
from argparse import Namespace
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ..errors import GiError
from ..measure.compare_page import comparison_page
from ..measure.metrics import Errors, display_scale, flip_map, measure, regions
from ..pictures.atomic_file import atomic_file, check_writable
from ..pictures.image import Array, load_image
from ..version import __version__

LINEAR_FORMATS = (".npy", ".npz", ".exr")
MAIN_LAYER = "radiance"  # main layer of an .npz; that of an .exr is its channels R, G, B
MISSING = "-"


@dataclass(frozen=True)
class Picture:
    """A layer of a file, or a sum of layers, and its name for messages."""

    name: str
    values: Array  # (h, w, 3) or (h, w), finite

    @property
    def size(self) -> str:
        """Width, height and kind, in words."""
        height, width = self.values.shape[:2]
        return f"{width}x{height}, {'colour' if self.values.ndim == 3 else 'grey'}"


def compare(arguments: Namespace) -> int:
    """Run `wgpu-gi compare` and return the exit code. Raises GiError for an error that the user can fix."""
    # Read the inputs.
    _check_output("--html", arguments.html, ".html")
    _check_output("--json", arguments.json, ".json")
    image = load_picture(arguments.image, arguments.layer)
    truth = load_picture(arguments.truth, arguments.layer)
    _check_same_size(image, truth)
    if not truth.values.mean() > 0:
        raise GiError(f"{truth.name} is black, so it has no relative error; compare another layer or file")
    noise = None if arguments.noise is None else load_noise(arguments.noise, truth)
    masks = {} if arguments.mask is None else load_regions(arguments.mask, truth)

    # Measure and print.
    rows, remarks = measured(image, truth, noise, masks)
    print(f"A      {image.name}\nB      {truth.name}: the truth, {truth.size}, mean {truth.values.mean():.4g}")
    if noise is not None:
        print(f"noise  {noise.name}: its floor is subtracted from the relMSE of A")
    cells = table_cells(rows)
    print("\n" + aligned(cells))
    for remark in remarks:
        print(f"note: {remark}")

    # Write the files.
    if arguments.json is not None:
        report = json_report(image, truth, noise, arguments.mask, rows)
        _write(arguments.json, json.dumps(report, indent=2) + "\n")
        print(f"{arguments.json}: the numbers")
    if arguments.html is not None:
        pictures = (image.name, image.values), (truth.name, truth.values)
        _write(arguments.html, comparison_page(*pictures, cells, remarks))
        print(f"{arguments.html}: both pictures, their difference and a heat map; open it in a browser")
    return 0


def load_picture(text: str, default_layer: str | None = None) -> Picture:
    """Read `FILE`, `FILE:layer` or `FILE:a+b`, a sum of layers; `default_layer` applies to files with layers.

    Without a layer, an .exr gives its R, G, B and an .npz its layer `radiance`. Raises GiError for a file that is not
    a linear picture, for a missing layer, and for NaN or Inf; the message names the first such pixel.
    """
    path, layer = split_layer(text)
    suffix = path.suffix.lower()
    if suffix == ".png":
        raise GiError(f"{path}: 8-bit tone-mapped values cannot be measured; render to .exr, .npy or .npz")
    if suffix not in LINEAR_FORMATS:
        raise GiError(f"{path}: not a linear picture; compare takes {' '.join(LINEAR_FORMATS)}")
    if layer is None and suffix != ".npy":
        layer = default_layer
    if layer is None:
        layers = [_load_layer(path, MAIN_LAYER if suffix == ".npz" else None)]
    else:
        layers = [_load_layer(path, name.strip()) for name in layer.split("+")]
    for other in layers[1:]:
        if other.shape != layers[0].shape:
            raise GiError(f"{path}: layers of different shapes, {layers[0].shape} and {other.shape}, have no sum")
    name = str(path) if layer is None else f"{path}:{layer}"
    picture = Picture(name, np.asarray(np.sum(layers, axis=0, dtype=np.float64), np.float32))
    _check_finite(picture)
    return picture


def split_layer(text: str) -> tuple[Path, str | None]:
    """Split `FILE:layer` at the colon after a known extension, so that `C:\\a.npz` and odd names stay whole."""
    match = re.fullmatch(r"(.+\.(?:npy|npz|exr|png)):([^:/\\]+)", text, re.IGNORECASE)
    if match is None or Path(text).is_file():
        return Path(text), None
    return Path(match[1]), match[2]


def load_noise(text: str, truth: Picture) -> Picture:
    """Read the standard error of the truth: one layer of the same shape."""
    _, layer = split_layer(text)
    if layer is not None and "+" in layer:
        raise GiError(f"--noise {text}: standard errors cannot be added; name the one layer of the truth")
    noise = load_picture(text)
    _check_same_size(noise, truth)
    if (noise.values < 0).any():
        raise GiError(f"{noise.name} holds negative values, so it is not a standard error")
    return noise


def load_regions(text: str, truth: Picture) -> dict[str, np.ndarray]:
    """Read a mask, an 8- or 16-bit .png or a linear file; return a mask (h, w) for each distinct value."""
    path, _ = split_layer(text)
    labels = _load_png_labels(path) if path.suffix.lower() == ".png" else load_picture(text).values
    if labels.shape[:2] != truth.values.shape[:2]:
        height, width = labels.shape[:2]
        raise GiError(
            f"the mask {text} is {width}x{height}, but {truth.name} is {truth.size}; they must have the same size"
        )
    try:
        return regions(labels)
    except GiError as error:
        raise GiError(f"--mask {text}: {error}") from None


def measured(
    image: Picture, truth: Picture, noise: Picture | None, masks: dict[str, np.ndarray]
) -> tuple[dict[str, Errors | None], list[str]]:
    """Return the errors of the whole picture and of each region (None where the truth is black), and remarks."""
    remarks = []
    try:
        flip_error = flip_map(image.values, truth.values)
    except GiError as error:
        flip_error, remarks = None, [str(error)]
    standard_error = None if noise is None else noise.values
    rows: dict[str, Errors | None] = {
        "whole picture": measure(image.values, truth.values, standard_error, flip_error=flip_error)
    }
    for name, mask in masks.items():
        lit = truth.values[mask].mean() > 0
        rows[f"region {name}"] = measure(image.values, truth.values, standard_error, mask, flip_error) if lit else None
    black = [name for name, errors in rows.items() if errors is None]
    if black:
        remarks.append(f"the truth is black in {', '.join(black)}, so there is no relative error")
    near = [name for name, e in rows.items() if e is not None and e.floor is not None and e.relmse <= e.floor]
    if near:
        remarks.append(f"the relMSE is within the noise of the truth in: {', '.join(near)}; lower values mean nothing")
    return rows, remarks


def table_cells(rows: dict[str, Errors | None]) -> list[list[str]]:
    """Return header and rows of the table as text; the noise floor has a column only if a row has one."""
    with_floor = any(errors is not None and errors.floor is not None for errors in rows.values())
    header = ["", "relMSE", "noise floor", "bias", "99.9th percentile", "FLIP", "pixels"]
    cells = [header]
    for name, e in rows.items():
        if e is None:
            cells.append([name, *[MISSING] * (len(header) - 1)])
            continue
        floor = MISSING if e.floor is None else f"{e.floor:.3g}"
        flip = "not installed" if e.flip is None else f"{e.flip:.4f}"
        bias = f"{round(100.0 * e.bias, 2) + 0.0:+.2f} %"  # + 0.0 turns -0.0 into 0.0
        cells.append([name, f"{e.relmse:.3g}", floor, bias, f"{e.percentile:.3g}", flip, str(e.pixels)])
    return cells if with_floor else [line[:2] + line[3:] for line in cells]


def aligned(cells: list[list[str]]) -> str:
    """Return the cells as lines of text, the first column flush left, the numbers flush right."""
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = []
    for first, *numbers in cells:
        padded = [f"{number:>{width}}" for number, width in zip(numbers, widths[1:], strict=True)]
        lines.append("  ".join([f"{first:<{widths[0]}}", *padded]))
    return "\n".join(lines)


def json_report(
    image: Picture, truth: Picture, noise: Picture | None, mask: str | None, rows: dict[str, Errors | None]
) -> dict[str, object]:
    """Return what `--json` writes: the inputs by name and the errors, bias as a fraction."""
    whole, *parts = ((name, None if e is None else asdict(e)) for name, e in rows.items())
    return {
        "wgpu_gi": __version__,
        "a": image.name,
        "b": truth.name,
        "noise": None if noise is None else noise.name,
        "mask": mask,
        "size": [truth.values.shape[1], truth.values.shape[0]],
        "mean": float(truth.values.mean(dtype=np.float64)),
        "display_scale": display_scale(truth.values),
        "whole": whole[1],
        "regions": {name.removeprefix("region "): errors for name, errors in parts},
    }


def _load_layer(path: Path, layer: str | None) -> Array:
    try:
        values = load_image(path, layer)
    except GiError as error:
        hint = f"; name one as {path}:LAYER" if "holds no layer" in str(error) else ""
        raise GiError(f"{error}{hint}") from None
    values = values[..., 0] if values.ndim == 3 and values.shape[2] == 1 else values
    if values.size == 0 or (values.ndim != 2 and (values.ndim != 3 or values.shape[2] != 3)):
        raise GiError(
            f"{path}: {layer or 'it'} has the shape {values.shape}, not (height, width, 3) or (height, width)"
        )
    return values


def _load_png_labels(path: Path) -> np.ndarray:
    """Return the stored numbers of a .png, without sRGB decoding and without alpha, (h, w) or (h, w, 3)."""
    from PIL import Image

    if not path.is_file():
        raise GiError(f"{path}: no such file")
    try:
        with Image.open(path, formats=("PNG",)) as image:
            plain = image if image.mode in ("1", "L", "P", "I", "I;16") else image.convert("RGB")
            return np.asarray(plain).astype(np.int64)
    except Exception as error:  # decoders raise anything for damaged files
        raise GiError(f"{path}: not a readable .png picture ({error})") from None


def _check_finite(picture: Picture) -> None:
    finite = np.isfinite(picture.values)
    bad = ~(finite.all(-1) if finite.ndim == 3 else finite)
    if not bad.any():
        return
    y, x = np.argwhere(bad)[0]
    what = "NaN" if np.isnan(picture.values[y, x]).any() else "Inf"
    count = int(bad.sum())
    others = f" and {count - 1} more" if count > 1 else ""
    raise GiError(f"{picture.name}: {what} at pixel x {x}, y {y} (from the top left){others}; it cannot be measured")


def _check_same_size(one: Picture, truth: Picture) -> None:
    if one.values.shape != truth.values.shape:
        raise GiError(
            f"{one.name} is {one.size}, but {truth.name} is {truth.size}; both must have the same size and kind"
        )


def _check_output(flag: str, path: str | None, suffix: str) -> None:
    """Raise GiError for a path that cannot be written, or for another suffix: it could overwrite a picture."""
    if path is None:
        return
    if Path(path).suffix.lower() != suffix:
        raise GiError(f"{flag} takes a file name that ends in {suffix}, not {path!r}")
    check_writable(path)


def _write(path: str, text: str) -> None:
    with atomic_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
