"""Writes pictures, a function for each extension: linear float (.exr .npy .npz .hdr), 8-bit sRGB (.png .jpg .webp)."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .display import bytes_of, png_bytes

Array = NDArray[np.float32]
Layers = dict[str, Array]
Writer = Callable[[Path, Layers, "float | None", dict[str, str]], None]  # path, layers, exposure, texts

JPEG_QUALITY = 95  # the most that Pillow's guide recommends: above, files grow without a visible gain
# Colour has full resolution (subsampling 0): coloured edges are common in rendered pictures.
EXR_MAIN_NAME = "wgpu_gi.main"  # header attribute: the layer that R, G, B hold
NPZ_METADATA = "metadata"  # array of one text: the metadata as JSON


def _write_npy(path: Path, layers: Layers, exposure: float | None, texts: dict[str, str]) -> None:
    with path.open("wb") as file:
        np.save(file, next(iter(layers.values())))


def _write_npz(path: Path, layers: Layers, exposure: float | None, texts: dict[str, str]) -> None:
    known = {NPZ_METADATA: np.array(json.dumps(texts))} if texts and NPZ_METADATA not in layers else {}
    with path.open("wb") as file:
        np.savez(file, **layers, **known)  # type: ignore[arg-type]


def _write_png(path: Path, layers: Layers, exposure: float | None, texts: dict[str, str]) -> None:
    name, layer = next(iter(layers.items()))
    path.write_bytes(png_bytes(name, layer, exposure, texts))


def _write_jpeg(path: Path, layers: Layers, exposure: float | None, texts: dict[str, str]) -> None:
    from PIL import Image

    pixels, _ = bytes_of(*next(iter(layers.items())), exposure)
    Image.fromarray(pixels).save(path, format="JPEG", quality=JPEG_QUALITY, subsampling=0)


def _write_webp(path: Path, layers: Layers, exposure: float | None, texts: dict[str, str]) -> None:
    from PIL import Image

    pixels, _ = bytes_of(*next(iter(layers.items())), exposure)
    Image.fromarray(pixels).save(path, format="WEBP", lossless=True)


def _write_hdr(path: Path, layers: Layers, exposure: float | None, texts: dict[str, str]) -> None:
    """Write a Radiance picture without compression: three mantissas of 8 bits and a common exponent (Ward 1991)."""
    layer = next(iter(layers.values()))
    color = np.repeat(layer[..., None], 3, axis=-1) if layer.ndim == 2 else layer
    color = np.clip(np.nan_to_num(color.astype(np.float64)), 0.0, 1e38)
    height, width, _ = color.shape
    largest = color.max(-1)
    _, exponent = np.frexp(largest)
    exponent += np.round(np.ldexp(largest, 8 - exponent)) > 255  # rounds up to the next power of two
    mantissas = np.round(np.ldexp(color, (8 - exponent)[..., None])).astype(np.uint8)
    black = (largest == 0.0) | (exponent < -127)
    rgbe = np.concatenate([mantissas, (exponent + 128)[..., None].clip(0, 255).astype(np.uint8)], axis=-1)
    rgbe[black] = 0
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n"
    path.write_bytes(header.encode() + rgbe.tobytes())


def _write_exr(path: Path, layers: Layers, exposure: float | None, texts: dict[str, str]) -> None:
    import OpenEXR

    main = next(iter(layers))
    channels = {}
    for name, layer in layers.items():
        prefix = "" if name == main else f"{name}."
        if layer.ndim == 2:
            single = "Z" if name == "depth" else "V" if prefix else "Y"
            channels[prefix + single] = np.ascontiguousarray(layer)
        else:
            for i, letter in enumerate("RGBA"[: layer.shape[2]]):
                channels[prefix + letter] = np.ascontiguousarray(layer[..., i])
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, EXR_MAIN_NAME: main}
    try:
        with OpenEXR.File({**texts, **header}, channels) as file:
            file.write(str(path))
    except RuntimeError as error:  # what OpenEXR raises for a full disk
        raise OSError(str(error)) from None


WRITERS: dict[str, Writer] = {
    ".png": _write_png,
    ".exr": _write_exr,
    ".npy": _write_npy,
    ".npz": _write_npz,
    ".jpg": _write_jpeg,
    ".jpeg": _write_jpeg,
    ".webp": _write_webp,
    ".hdr": _write_hdr,
}
