"""Environments: a constant radiance, or an equirectangular map from a Radiance (.hdr, .pic) or OpenEXR file.

Radiance files are read with numpy after Ward, "The RADIANCE Picture File Format": uncompressed, and with old and new
run-length encoding. OpenEXR files are read by the OpenEXR package.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError, warn_of
from ...float_limits import LARGEST_LIGHT
from ...pictures.exr_files import read_exr
from ...webgpu_limits import MAX_TEXTURE_SIDE
from ..rules import shown
from ..scene import Environment
from .memory import MAX_MEMORY, MemoryBudget
from .notes import Notes
from .read import read_file

ENVIRONMENT_EXTENSIONS = (".hdr", ".pic", ".exr")

# 16384 x 8192 is the largest map in circulation, 1.5 GiB as floats. A file that announces more is damaged or hostile.
LARGEST_SIDE = 16384
MOST_PIXELS = 16384 * 8192
MOST_HEADER = 1 << 16  # bytes of a Radiance header


# The sun's disc has a luminance of 1.6e9 cd/m2; larger values are errors, and would outshine everything else.
LARGEST_RADIANCE = 1e10
LARGEST_HALF = 65504.0  # above it, writers of 16-bit floats store infinity


def load_environment(text: str | Path, notes: Notes | None = None, *, max_memory: int = MAX_MEMORY) -> Environment:
    """Return the environment that `text` names: "R,G,B" (constant radiance, W/(m2 sr)) or a .hdr, .pic or .exr file.

    Maps are equirectangular with -Z at the left edge, +X at a quarter of the width and +Y on top. Negative and NaN
    pixels become 0, infinite ones the largest 16-bit float, 65504, or the largest finite value of the map, and radiance
    is limited to 1e10; `notes` receives sentences that say so, without `notes` a GiWarning says so. Raises GiError for
    negative, non-finite or too large colours, for missing, foreign, damaged or oversized files, and for a map that
    unpacks to more than `max_memory` bytes.
    """
    if not isinstance(text, (str, os.PathLike)):
        raise GiError(f"an environment is loaded from a path or a text R,G,B, not from {shown(text)}")
    extension = Path(text).suffix.lower()
    if extension not in ENVIRONMENT_EXTENSIONS:
        return Environment(color=_constant_color(str(text)), name="constant")
    path, budget, found = Path(text), MemoryBudget(max_memory), Notes() if notes is None else notes
    data = read_file(path, "environment map")
    image = _read_exr(path, data[:4], budget) if extension == ".exr" else read_hdr(data, str(path), budget)
    if extension != ".exr" and (exposure := _exposure_lines(data)):
        found.add(
            f"{path}: EXPOSURE {exposure} is not undone; divide by it for the radiance before the writer scaled it"
        )
    _sanitise(image, path, found)
    image = _reduced(image, path, found)
    if notes is None:
        warn_of(found.sentences, stacklevel=2)
    return Environment(image=image, name=path.stem)


def _constant_color(text: str) -> tuple[float, float, float]:
    """Parse "R,G,B", or one number for grey."""
    words = text.split(",")
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = []
    if len(values) not in (1, 3):
        formats = " ".join(ENVIRONMENT_EXTENSIONS)
        raise GiError(f"environment {text!r} is neither a file ({formats}) nor a radiance R,G,B such as 0.5,0.7,1")
    if not all(0 <= value <= LARGEST_LIGHT for value in values):
        raise GiError(f"environment {text!r}: radiance must be finite and not negative, and at most {LARGEST_LIGHT:g}")
    red, green, blue = values if len(values) == 3 else values * 3
    return red, green, blue


def _sanitise(image: NDArray[np.float32], path: Path, notes: Notes) -> None:
    """Limit infinite and absurd values, and replace others that cannot be radiance by 0, in place."""
    brightest = max(float(np.max(row, where=np.isfinite(row), initial=0.0)) for row in image)
    cap = np.float32(min(max(LARGEST_HALF, brightest), LARGEST_RADIANCE))
    bad = infinite = absurd = 0
    for row in image:
        endless = row == np.inf
        infinite += int(np.count_nonzero(endless))
        row[endless] = cap
        wrong = ~(row >= 0)
        bad += int(np.count_nonzero(wrong))
        row[wrong] = 0
        absurd += int(np.count_nonzero(row > LARGEST_RADIANCE))
        np.minimum(row, np.float32(LARGEST_RADIANCE), out=row)
    if infinite:
        notes.add(f"environment {path}: {infinite} infinite values were limited to {cap:g}; brighter light is lost")
    if absurd:
        notes.add(f"environment {path}: {absurd} values were limited to {LARGEST_RADIANCE:g}")
    if bad:
        notes.damage(f"environment {path}: {bad} negative or NaN values were set to 0")


def _reduced(image: NDArray[np.float32], path: Path, notes: Notes) -> NDArray[np.float32]:
    """Average blocks of a map that is too large for a texture; radiance keeps its mean."""
    height, width, _ = image.shape
    step = -(-max(height, width) // MAX_TEXTURE_SIDE)
    if step == 1:
        return image
    rows, columns = height // step, width // step
    notes.add(f"environment {path}: {width}x{height} pixels were averaged to {columns}x{rows}")
    total = np.zeros((rows, columns, 3), np.float32)
    for y in range(step):
        for x in range(step):
            total += image[y : rows * step : step, x : columns * step : step]
    total /= np.float32(step * step)
    return total


def _check_size(width: int, height: int, source: str) -> None:
    """Raise GiError for a map that is empty or too large, before any allocation."""
    if width < 1 or height < 1:
        raise GiError(f"environment map {source} has no pixels ({width}x{height})")
    if max(width, height) > LARGEST_SIDE or width * height > MOST_PIXELS:
        raise GiError(f"environment map {source} is {width}x{height}; use at most {LARGEST_SIDE}x{LARGEST_SIDE // 2}")


def read_hdr(data: bytes, source: str, budget: MemoryBudget | None = None) -> NDArray[np.float32]:
    """Decode a Radiance RGBE picture to (height, width, 3) float32 linear radiance; `source` names it in messages.

    EXPOSURE lines, by which writers say to have scaled the pixels, are not undone, as in other readers. Lines may end
    in CR LF. Raises GiError for XYZE data, for truncated or damaged data, and for pixels beyond the `budget`.
    """
    # Read the header: format, orientation and size.
    end = re.search(rb"\r?\n\r?\n", data[:MOST_HEADER])
    header, body = (data[: end.start()], data[end.end() :]) if end else (b"", b"")
    if not header.startswith(b"#?") and b"FORMAT=32-bit_rle_" not in header:
        raise GiError(f"{source} is not a Radiance picture: its header (#?RADIANCE) is missing")
    if b"32-bit_rle_xyze" in header:
        raise GiError(f"{source} holds CIE XYZ colours; convert it to RGBE (ra_xyze -r)")
    resolution, _, body = body.partition(b"\n")
    match = re.fullmatch(rb"([+-][XY]) +(\d{1,9}) +([+-][XY]) +(\d{1,9})\s*", resolution)
    if match is None:
        raise GiError(f"{source}: the line with the picture's size is missing or damaged")
    lines, length = int(match[2]), int(match[4])
    sideways = match[1][1:] == b"X"
    if match[1][1:] == match[3][1:]:
        raise GiError(f"{source}: the line with the picture's size names one axis twice")
    _check_size(*((lines, length) if sideways else (length, lines)), source)
    # Refuse files that are too short for their size before allocating it; the best compression leaves 8 bytes a row.
    if len(body) < 8 * lines and len(body) < 4 * length * lines:
        raise GiError(f"{source} is truncated: {len(body)} bytes cannot hold {lines} lines of {length} pixels")
    (budget or MemoryBudget()).take(16 * lines * length, f"environment map {source}")
    try:
        rgbe = _decode_rows(body, length, lines)
    except IndexError:
        raise GiError(
            f"{source} is truncated or damaged: its run lengths do not fit {lines} lines of {length} pixels"
        ) from None
    # Turn the picture so that row 0 is on top and column 0 on the left.
    along = {b"Y": slice(None, None, -1 if b"+Y" in match.groups() else 1)}
    along[b"X"] = slice(None, None, -1 if b"-X" in match.groups() else 1)
    rgbe = (rgbe.transpose(1, 0, 2) if sideways else rgbe)[along[b"Y"], along[b"X"]]
    # Decode: mantissas are 8-bit fractions, the exponent is biased by 128, and exponent 0 means black. No half step is
    # added, so that round values stay exact and maps agree with other renderers (writers truncate: up to 0.8 % dark).
    with np.errstate(over="ignore"):  # infinite radiance counts as damage
        scale = np.ldexp(1.0, np.arange(256) - 136).astype(np.float32)
    scale[0] = 0.0
    image = np.empty((*rgbe.shape[:2], 3), np.float32)
    for row, codes in zip(image, rgbe, strict=True):
        np.multiply(codes[:, :3], scale[codes[:, 3:]], out=row)
    return image


def _exposure_lines(data: bytes) -> str:
    """Return the values of a Radiance header's EXPOSURE lines, with commas between; an empty text without one."""
    header = re.split(rb"\r?\n\r?\n", data[:MOST_HEADER], maxsplit=1)[0]
    values = re.findall(rb"^EXPOSURE *= *([^\r\n]*?)\s*$", header, re.MULTILINE)
    return ", ".join(value.decode("ascii", "replace")[:20] for value in values)


def _decode_rows(body: bytes, width: int, height: int) -> NDArray[np.uint8]:
    """Decode all rows; the first bytes of a row tell its encoding. Raises IndexError if the data ends early."""
    rgbe = np.empty((height, width, 4), np.uint8)
    new_mark = bytes([2, 2, width >> 8, width & 255])
    at = 0
    for row in rgbe:
        if 8 <= width < 32768 and body[at : at + 4] == new_mark:
            at = _decode_new_row(body, at + 4, row)
        else:
            at = _decode_old_row(body, at, row)
    return rgbe


def _decode_new_row(body: bytes, at: int, row: NDArray[np.uint8]) -> int:
    """Decode a row of the new encoding, four planes of runs (count > 128: repeat a byte); return its end."""
    for channel in range(4):
        plane = bytearray()
        while len(plane) < len(row):
            count = body[at]
            if count > 128:
                plane += body[at + 1 : at + 2] * (count - 128)
                at += 2
            else:
                plane += body[at + 1 : at + 1 + count]
                at += 1 + count
        if len(plane) > len(row):
            raise IndexError
        row[:, channel] = plane
    return at


def _decode_old_row(body: bytes, at: int, row: NDArray[np.uint8]) -> int:
    """Decode a row of the old encoding, where a pixel (1, 1, 1, n) repeats the previous one; return its end."""
    # A row without repeats is copied at once.
    plain = np.frombuffer(body[at : at + row.size], np.uint8)
    if len(plain) == row.size and not (plain.reshape(row.shape)[:, :3] == 1).all(1).any():
        row[:] = plain.reshape(row.shape)
        return at + row.size
    pixels = bytearray()
    shift = 0
    while len(pixels) < row.size:
        pixel = body[at : at + 4]
        if len(pixel) < 4:
            raise IndexError
        if pixel[:3] != b"\1\1\1":
            pixels += pixel
            shift = 0
        else:
            # Consecutive repeats are the digits of one count to the base 256, the lowest first.
            repeats = pixel[3] << shift
            if not pixels or 4 * repeats > row.size - len(pixels):
                raise IndexError
            pixels += pixels[-4:] * repeats
            shift = min(shift + 8, 32)
        at += 4
    row[:] = np.frombuffer(pixels, np.uint8).reshape(row.shape)
    return at


def _read_exr(path: Path, magic: bytes, budget: MemoryBudget) -> NDArray[np.float32]:
    """Read the channels R, G, B (or Y for all three) of the first part of an OpenEXR file, if need be of a layer."""
    if magic != b"\x76\x2f\x31\x01":
        raise GiError(f"{path} is not an OpenEXR file: its first bytes are wrong")

    def check(width: int, height: int, size: int) -> None:
        _check_size(width, height, str(path))
        budget.take(size + 12 * width * height, f"environment map {path}")

    try:
        _, channels = read_exr(path, check)
    except ValueError as error:
        raise GiError(f"environment map {path} is truncated or damaged ({error})") from None
    planes = _color_channels(channels)
    if planes is None:
        raise GiError(f"{path} has no channels R, G, B or Y, but {', '.join(sorted(channels))[:80]}")
    return np.stack([channels[name] for name in planes], axis=-1).astype(np.float32)


def _color_channels(names: Iterable[str]) -> tuple[str, str, str] | None:
    """Return the channels of red, green and blue, of any case, outside of layers or in the first layer with them."""
    by_layer: dict[str, dict[str, str]] = {}
    for name in sorted(names):
        layer, _, channel = name.rpartition(".")
        by_layer.setdefault(layer, {})[channel.upper()] = name
    for wanted in (("R", "G", "B"), ("RED", "GREEN", "BLUE"), ("Y", "Y", "Y")):
        for found in by_layer.values():
            if set(wanted) <= set(found):
                red, green, blue = (found[channel] for channel in wanted)
                return red, green, blue
    return None
