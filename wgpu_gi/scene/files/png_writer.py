"""Encodes pictures as PNG: with Pillow, and of 16 bits a channel, which Pillow cannot write, by the specification."""

from __future__ import annotations

import io
import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow


def encode_png(pixels: NDArray[Any]) -> bytes:
    """Return pixels (height, width, 4), uint8 or uint16, as a PNG file."""
    if pixels.dtype != np.uint16:
        file = io.BytesIO()
        Pillow.fromarray(np.ascontiguousarray(pixels, np.uint8)).save(file, "PNG")
        return file.getvalue()
    # Rows of big-endian numbers, each predicted by the row above (filter 2).
    height, width = pixels.shape[:2]
    rows = np.ascontiguousarray(pixels, ">u2").view(np.uint8).reshape(height, -1)
    rows[1:] = rows[1:] - rows[:-1]
    data = zlib.compress(np.insert(rows, 0, np.where(np.arange(height) > 0, 2, 0).astype(np.uint8), axis=1).tobytes())
    header = struct.pack(">IIBBBBB", width, height, 16, 6, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", data), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, body) for kind, body in chunks)


def _chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
