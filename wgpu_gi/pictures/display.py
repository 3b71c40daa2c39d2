"""Pictures for a screen: the tone curve, and buffers as 8-bit sRGB."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import GiError
from .color import srgb_from_linear
from .exposure import automatic_exposure, exposure_text, is_exposed

Array = NDArray[np.float32]

GOLDEN = (5**0.5 - 1) / 2  # its multiples spread well on a circle of hues


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
    """Return a buffer as sRGB-encoded values (height, width, 3) in [0, 1] for a screen; RGBA gets a straight alpha.

    normal: n/2 + 1/2, not encoded; depth: nearest white, farthest dark, no surface black; position: its bounding box
    scaled to the unit cube; instance: a colour each; alpha: as grey, not encoded; albedo: encoded without tone curve;
    all others with exposure and tone curve.
    """
    values = checked(name, layer)
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
    if name == "alpha":
        return np.clip(np.nan_to_num(values), 0.0, 1.0)
    if values.shape[2] == 4:
        # Radiance of the part of the pixel that is covered: files of 8 bits store it beside alpha, not multiplied.
        alpha = np.clip(np.nan_to_num(values[..., 3:]), 0.0, 1.0)
        straight = display_layer(name, values[..., :3] / np.maximum(alpha, 1e-6), exposure)
        return np.concatenate([np.where(alpha > 0.0, straight, 0.0), alpha], axis=-1)
    return srgb_from_linear(np.nan_to_num(values) if name == "albedo" else tone_map(values, exposure))


def bytes_of(
    name: str, layer: ArrayLike, exposure: float | None = None, texts: Mapping[str, str] | None = None
) -> tuple[NDArray[np.uint8], dict[str, str]]:
    """Return a buffer as 8-bit sRGB by `display_layer`, and `texts` with the exposure; uint8 values stay unchanged.

    `exposure` None means automatic. The text "exposure" records the value, unless `texts` has that key.
    """
    pixels, known = np.asarray(layer), dict(texts or {})
    if pixels.dtype == np.uint8:
        return pixels, known
    stops = 0.0
    if is_exposed(name):
        stops = automatic_exposure(pixels) if exposure is None else exposure
        known.setdefault("exposure", exposure_text(stops, exposure is None))
    return np.round(display_layer(name, layer, stops) * 255.0).astype(np.uint8), known


def png_bytes(
    name: str, layer: ArrayLike, exposure: float | None = None, texts: Mapping[str, str] | None = None
) -> bytes:
    """Return a buffer as a PNG, with the pixels and texts of `bytes_of`."""
    from PIL import Image, PngImagePlugin

    pixels, known = bytes_of(name, layer, exposure, texts)
    info = PngImagePlugin.PngInfo()
    for key, text in known.items():
        info.add_itxt(key, text)
    file = BytesIO()
    # Level 1 takes a third of the time of the default and makes files a sixth larger.
    Image.fromarray(pixels).save(file, format="PNG", compress_level=1, pnginfo=info)
    return file.getvalue()


def checked(name: str, layer: ArrayLike) -> Array:
    """Return a buffer as float32, or unchanged if it has bytes. Raises GiError unless it has the shape of a picture."""
    try:
        array = np.asarray(layer)
        array = array if array.dtype == np.uint8 else array.astype(np.float32, copy=False)
    except (TypeError, ValueError):
        array = np.zeros((), np.float32)
    if not array.ndim:
        raise GiError(f"layer {name!r} must be an array of numbers, not a {type(layer).__name__}")
    if array.ndim != 2 and not (array.ndim == 3 and array.shape[2] in (3, 4)):
        shapes = "(height, width, 3), (height, width, 4) or (height, width)"
        raise GiError(f"layer {name!r} has the shape {array.shape}; a picture is {shapes}")
    if array.size == 0:
        raise GiError(f"layer {name!r} is empty: {array.shape}")
    return array


def _nearest_bright(depth: Array) -> Array:
    seen = np.isfinite(depth) & (depth > 0.0)
    if not seen.any():
        return np.zeros_like(depth)
    near, far = float(depth[seen].min()), float(depth[seen].max())
    # From 1 down to 0.1, so that the farthest surface differs from no surface.
    brightness = 1.0 - 0.9 * (np.where(seen, depth, far) - near) / max(far - near, 1e-30)
    return np.where(seen, brightness, 0.0).astype(np.float32)
