"""Element types of buffers, and the texture formats that a pass may write: their numpy types and allowed uses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import GiError

# vec2f, vec4f, vec2u and vec4u of WGSL, as elements of a buffer.
TWO_FLOATS = np.dtype((np.float32, 2))
FOUR_FLOATS = np.dtype((np.float32, 4))
TWO_WORDS = np.dtype((np.uint32, 2))
FOUR_WORDS = np.dtype((np.uint32, 4))


@dataclass(frozen=True)
class Format:
    """A texel is `channels` values of `dtype`; `kind` is float, unfilterable, uint, sint or depth (sample types)."""

    name: str
    channels: int
    dtype: np.dtype
    kind: str
    storage: bool = False
    normalized: bool = False

    @property
    def texel_bytes(self) -> int:
        """Bytes per texel."""
        return self.channels * self.dtype.itemsize

    @property
    def is_depth(self) -> bool:
        """True for formats that only a depth attachment writes."""
        return self.kind == "depth"

    @property
    def is_float(self) -> bool:
        """True if a texel can hold NaN or infinity."""
        return self.dtype.kind == "f" or self.name == "rg11b10ufloat"

    def floats(self, texels: np.ndarray) -> np.ndarray:
        """Return the read-back texels of a float format as floats; packed values become the last axis."""
        return unpack_rg11b10ufloat(texels[..., 0]) if self.name == "rg11b10ufloat" else texels

    @property
    def end(self) -> np.ndarray:
        """The magnitude, per channel of a float format, at which a value is out of range."""
        if self.name == "rg11b10ufloat":
            return np.array(LARGEST_RG11B10UFLOAT, np.float32)
        return np.full(self.channels, float_end(self.dtype))


def float_end(dtype: np.dtype) -> float:
    """Return the magnitude at which a value of a float type is out of range.

    For types narrower than 32 bits, this is the largest finite value: GPUs may store it in place of infinity.
    """
    return np.inf if dtype.itemsize >= 4 else float(np.finfo(dtype).max)


# Exponent 15 with all bits of the mantissa set: 6 bits for red and green, 5 for blue.
LARGEST_RG11B10UFLOAT = (65024.0, 65024.0, 64512.0)


def unpack_rg11b10ufloat(words: np.ndarray) -> np.ndarray:
    """Unpack texels to (..., 3) float32. Each channel is the top of an unsigned half float; red has the lowest bits."""
    halves = np.stack([(words & 0x7FF) << 4, (words >> 11 & 0x7FF) << 4, (words >> 22) << 5], -1)
    return halves.astype(np.uint16).view(np.float16).astype(np.float32)


def _table() -> dict[str, Format]:
    numbers = {
        "8unorm": ("u1", "float", True),
        "8snorm": ("i1", "float", True),
        "8uint": ("u1", "uint", False),
        "8sint": ("i1", "sint", False),
        "16float": ("f2", "float", False),
        "16uint": ("u2", "uint", False),
        "16sint": ("i2", "sint", False),
        "32float": ("f4", "unfilterable", False),
        "32uint": ("u4", "uint", False),
        "32sint": ("i4", "sint", False),
    }
    table = {}
    for channels, letters in ((1, "r"), (2, "rg"), (4, "rgba")):
        for suffix, (dtype, kind, normalized) in numbers.items():
            # Core WebGPU has these storage formats: all with 32 bits per channel, and rgba with fewer bits.
            storage = suffix.startswith("32") or channels == 4
            name = letters + suffix
            table[name] = Format(name, channels, np.dtype(dtype), kind, storage, normalized)
    for name in ("rgba8unorm-srgb", "bgra8unorm", "bgra8unorm-srgb"):
        table[name] = Format(name, 4, np.dtype("u1"), "float", normalized=True)
    # Packed into one word; read back as that word.
    table["rg11b10ufloat"] = Format("rg11b10ufloat", 1, np.dtype("u4"), "float")
    table["rgb10a2unorm"] = Format("rgb10a2unorm", 1, np.dtype("u4"), "float")
    table["depth32float"] = Format("depth32float", 1, np.dtype("f4"), "depth")
    table["depth16unorm"] = Format("depth16unorm", 1, np.dtype("u2"), "depth", normalized=True)
    return table


FORMATS = _table()


def format_of(name: str, what: str) -> Format:
    """Return the format `name`. Raises GiError, beginning with `what`, if there is none."""
    if name not in FORMATS:
        raise GiError(f"{what}: there is no texture format {name!r}; available: {', '.join(FORMATS)}")
    return FORMATS[name]
