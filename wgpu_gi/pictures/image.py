"""Reads and writes pictures: linear float layers (.npy .npz .exr), 8-bit sRGB (.png); has the tone curve.

Arrays are (height, width, 3) or (height, width) float32, row 0 on top. Float files hold linear values without exposure
or tone curve.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import GiError
from .atomic_file import atomic_file, check_writable
from .color import linear_from_srgb, srgb_from_linear
from .exposure import automatic_exposure, exposure_text, is_exposed
from .exr_files import read_exr

Array = NDArray[np.float32]

FORMATS = (".png", ".exr", ".npy", ".npz")
ONE_LAYER_FORMATS = (".png", ".npy")
LARGEST_PICTURE = 4 << 30  # bytes in memory, of all layers together
GOLDEN = (5**0.5 - 1) / 2  # its multiples spread well on a circle of hues

_EXR_MAIN_NAME = "wgpu_gi.main"  # header attribute: the layer that R, G, B hold


def check_output(path: str | Path, layers: Sequence[str] = ("radiance",)) -> None:
    """Raise GiError now if `layers` could not be written to `path` later: format, folder or rights."""
    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise GiError(f"{path}: unknown picture format {path.suffix!r}; use one of {' '.join(FORMATS)}")
    if len(layers) > 1 and path.suffix.lower() in ONE_LAYER_FORMATS:
        raise GiError(f"{path}: {path.suffix} holds one buffer; for {', '.join(layers)} use .exr or .npz")
    check_writable(path)


def save_image(
    path: str | Path,
    layers: Mapping[str, ArrayLike] | NDArray,
    *,
    exposure: float | None = None,
    metadata: Mapping[str, object] | None = None,
) -> None:
    """Write `layers`, or a single picture, in the format of the extension. The first layer is the main one.

    `.npy` holds the layer unchanged; `.npz` every layer by name; `.exr` the main layer as R, G, B (Z for depth, Y for
    another single channel) and the others as `name.R` ... (`name.Z`, `name.V`), float32; `.png` the main layer in
    8-bit sRGB by `display_layer`, with automatic `exposure` if it is None. `metadata` goes into the EXR header and PNG
    text, which also has the exposure. The file appears complete or not at all. Raises GiError if it cannot be written.
    """
    path = _path(path, "saved to")
    if isinstance(layers, np.ndarray):
        layers = {getattr(layers, "name", "radiance"): layers}
    if not isinstance(layers, Mapping) or not layers:
        raise GiError(f"layers must be a picture, or a dictionary of pictures by name, not a {type(layers).__name__}")
    arrays = {name: _checked(name, layer) for name, layer in layers.items()}
    check_output(path, tuple(arrays))
    texts = {key: str(value) for key, value in (metadata or {}).items()}
    with atomic_file(path) as temporary:
        _WRITERS[path.suffix.lower()](temporary, arrays, exposure, texts)


def load_image(path: str | Path, layer: str | None = None) -> Array:
    """Read a picture as linear float32, (height, width, 3) or (height, width).

    `layer` names a layer of an .exr or .npz; None means the main (first) one. PNG is decoded from sRGB. Raises GiError
    for a missing, unreadable or unknown file, and for a layer that the file does not hold.
    """
    path = _path(path, "loaded from")
    suffix = path.suffix.lower()
    if suffix not in _READERS:
        raise GiError(f"{path}: unknown picture format {path.suffix!r}; use one of {' '.join(FORMATS)}")
    if not path.is_file():
        raise GiError(f"{path}: no such file")
    try:
        layers = _READERS[suffix](path)
    except Exception as error:  # decoders raise anything for damaged files
        raise GiError(f"{path}: not a readable {suffix} picture ({error})") from None
    if layer is not None and suffix in ONE_LAYER_FORMATS:
        raise GiError(f"{path}: {suffix} holds one buffer, without a name; leave out {layer!r}")
    if not layers or (layer is not None and layer not in layers):
        raise GiError(f"{path}: holds no layer {layer or 'at all'}; it has: {', '.join(layers)}")
    name = next(iter(layers)) if layer is None else layer
    if layers[name].dtype.kind not in "biuf":
        raise GiError(f"{path}:{name} holds no numbers; name a layer that is a picture")
    return np.ascontiguousarray(layers[name], np.float32)


def tone_map(linear: ArrayLike, exposure: float = 0.0) -> Array:
    """Map linear radiance (..., 3), times 2^`exposure`, to linear [0, 1] with the Khronos PBR Neutral curve.

    The curve is the identity up to 0.76, so that base colours keep hue and value, and compresses and desaturates
    higher values. Source: Khronos Group, ToneMapping repository, PBR_Neutral/README.md (2024). Departure: no toe, which
    subtracts 0.04 for the reflection of a studio's walls and blackens indirect light. NaN becomes 0, infinity the
    largest float.
    """
    start_compression, desaturation = 0.76, 0.15
    # In float64, so that neither exposure nor sums overflow.
    color = np.nan_to_num(np.asarray(linear, np.float32)).astype(np.float64)
    color = np.maximum(color * np.exp2(np.clip(exposure, -127.0, 127.0)), 0.0)
    peak = color.max(-1, keepdims=True)
    d = 1.0 - start_compression
    new_peak = 1.0 - d * d / np.maximum(peak + d - start_compression, d)
    compressed = color * (new_peak / np.maximum(peak, start_compression))
    grey = 1.0 - 1.0 / (desaturation * np.maximum(peak - new_peak, 0.0) + 1.0)
    compressed += (new_peak - compressed) * grey
    return np.where(peak < start_compression, color, compressed).astype(np.float32)


def display_layer(name: str, layer: ArrayLike, exposure: float = 0.0) -> Array:
    """Return a buffer as sRGB-encoded values (height, width, 3) in [0, 1] for a screen.

    normal: n/2 + 1/2, not encoded; depth: nearest white, farthest dark, no surface black; position: its bounding box
    scaled to the unit cube; instance: a colour each; albedo: encoded without tone curve; all others with exposure and
    tone curve.
    """
    values = _checked(name, layer)
    if name == "normal":
        return np.clip(np.nan_to_num(values) * 0.5 + 0.5, 0.0, 1.0)
    if name == "depth":
        depth = values if values.ndim == 2 else values[..., 0]
        return np.repeat(_nearest_bright(depth)[..., None], 3, axis=-1)
    if name == "instance":
        hue = (values[..., None] * GOLDEN + np.array([0.0, 1 / 3, 2 / 3])) * 2 * np.pi
        return np.where(values[..., None] > 0, 0.55 + 0.45 * np.cos(hue), 0.0).astype(np.float32)
    if name == "position":
        seen = np.isfinite(values).all(-1, keepdims=True)
        low = values.min((0, 1), where=seen, initial=np.inf)
        extent = float((values.max((0, 1), where=seen, initial=-np.inf) - low).max())
        scaled = (np.where(seen, values, low) - low) / max(extent, 1e-30) if seen.any() else np.zeros_like(values)
        return np.clip(scaled, 0.0, 1.0).astype(np.float32)
    if values.ndim == 2:
        values = np.repeat(values[..., None], 3, axis=-1)
    return srgb_from_linear(np.nan_to_num(values) if name == "albedo" else tone_map(values, exposure))


def png_bytes(
    name: str, layer: ArrayLike, exposure: float | None = None, texts: Mapping[str, str] | None = None
) -> bytes:
    """Return a buffer as a PNG, 8-bit sRGB, by `display_layer`; uint8 values stay unchanged.

    `exposure` None means automatic. The PNG text "exposure" records the value, unless `texts` has that key.
    """
    from PIL import Image, PngImagePlugin

    pixels = np.asarray(layer)
    info = PngImagePlugin.PngInfo()
    texts = dict(texts or {})
    if pixels.dtype != np.uint8:
        stops = 0.0
        if is_exposed(name):
            stops = automatic_exposure(pixels) if exposure is None else exposure
            texts.setdefault("exposure", exposure_text(stops, exposure is None))
        pixels = np.round(display_layer(name, layer, stops) * 255.0).astype(np.uint8)
    for key, text in texts.items():
        info.add_itxt(key, text)
    file = BytesIO()
    # Level 1 takes a third of the time of the default and makes files a sixth larger.
    Image.fromarray(pixels).save(file, format="PNG", compress_level=1, pnginfo=info)
    return file.getvalue()


def _nearest_bright(depth: Array) -> Array:
    seen = np.isfinite(depth) & (depth > 0.0)
    if not seen.any():
        return np.zeros_like(depth)
    near, far = float(depth[seen].min()), float(depth[seen].max())
    # From 1 down to 0.1, so that the farthest surface differs from no surface.
    brightness = 1.0 - 0.9 * (np.where(seen, depth, far) - near) / max(far - near, 1e-30)
    return np.where(seen, brightness, 0.0).astype(np.float32)


def _path(path: Any, what: str) -> Path:
    """Return a path. Raises GiError for other objects."""
    if not isinstance(path, (str, PathLike)):
        raise GiError(f"a picture is {what} a path, not {str(path)[:60] or 'nothing'}")
    return Path(path)


def _checked(name: str, layer: ArrayLike) -> Array:
    try:
        array = np.asarray(layer, np.float32)
    except (TypeError, ValueError):
        array = np.zeros((), np.float32)
    if not array.ndim:
        raise GiError(f"layer {name!r} must be an array of numbers, not a {type(layer).__name__}")
    if array.ndim != 2 and not (array.ndim == 3 and array.shape[2] == 3):
        raise GiError(f"layer {name!r} has the shape {array.shape}; a picture is (height, width, 3) or (height, width)")
    if array.size == 0:
        raise GiError(f"layer {name!r} is empty: {array.shape}")
    return array


def _write_npy(path: Path, layers: dict[str, Array], exposure: float | None, texts: dict[str, str]) -> None:
    with path.open("wb") as file:
        np.save(file, next(iter(layers.values())))


def _write_npz(path: Path, layers: dict[str, Array], exposure: float | None, texts: dict[str, str]) -> None:
    with path.open("wb") as file:
        np.savez(file, **layers)  # type: ignore[arg-type]


def _write_png(path: Path, layers: dict[str, Array], exposure: float | None, texts: dict[str, str]) -> None:
    name, layer = next(iter(layers.items()))
    path.write_bytes(png_bytes(name, layer, exposure, texts))


def _write_exr(path: Path, layers: dict[str, Array], exposure: float | None, texts: dict[str, str]) -> None:
    import OpenEXR

    main = next(iter(layers))
    channels = {}
    for name, layer in layers.items():
        prefix = "" if name == main else f"{name}."
        if layer.ndim == 2:
            single = "Z" if name == "depth" else "V" if prefix else "Y"
            channels[prefix + single] = np.ascontiguousarray(layer)
        else:
            for i, letter in enumerate("RGB"):
                channels[prefix + letter] = np.ascontiguousarray(layer[..., i])
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, _EXR_MAIN_NAME: main}
    try:
        with OpenEXR.File({**texts, **header}, channels) as file:
            file.write(str(path))
    except RuntimeError as error:  # what OpenEXR raises for a full disk
        raise OSError(str(error)) from None


def _read_npy(path: Path) -> dict[str, Array]:
    return {"": np.load(path, allow_pickle=False)}


def _read_npz(path: Path) -> dict[str, Array]:
    with ZipFile(path) as archive:
        _check_bytes(sum(entry.file_size for entry in archive.infolist()))
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


def _read_png(path: Path) -> dict[str, Array]:
    from PIL import Image

    with warnings.catch_warnings(), Image.open(path, formats=("PNG",)) as image:
        warnings.simplefilter("ignore")  # of sizes that are refused here, and of damaged metadata
        _check_bytes(12 * image.width * image.height)
        return {"": linear_from_srgb(np.asarray(image.convert("RGB"), np.float32) / 255.0)}


def _read_exr(path: Path) -> dict[str, Array]:
    header, channels = read_exr(path, lambda width, height, size: _check_bytes(size))
    main = str(header.get(_EXR_MAIN_NAME, "main"))
    grouped: dict[str, dict[str, Array]] = {}
    for full_name, pixels in channels.items():
        name, _, letter = full_name.rpartition(".")
        grouped.setdefault(name or main, {})[letter] = pixels
    layers = {
        name: np.stack([of["R"], of["G"], of["B"]], -1) if {"R", "G", "B"} <= of.keys() else next(iter(of.values()))
        for name, of in grouped.items()
    }
    return {main: layers.pop(main), **layers} if main in layers else layers


def _check_bytes(size: int) -> None:
    """Raise ValueError for a file whose header announces more than any picture has."""
    if size > LARGEST_PICTURE:
        raise ValueError(f"it would unpack to {size / 2**30:.1f} GiB")


_WRITERS = {".npy": _write_npy, ".npz": _write_npz, ".png": _write_png, ".exr": _write_exr}
_READERS = {".npy": _read_npy, ".npz": _read_npz, ".png": _read_png, ".exr": _read_exr}
