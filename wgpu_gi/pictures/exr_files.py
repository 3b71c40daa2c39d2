"""Reads OpenEXR files with the OpenEXR library, which prints to the terminal and returns files that are incomplete."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import GiError


def read_exr(
    path: Path, check: Callable[[int, int, int], None]
) -> tuple[dict[str, Any], dict[str, NDArray[np.float32]]]:
    """Return header and channels of the first part of a file, each channel (height, width) in its own type.

    `check` receives width, height and the bytes of all parts before the pixels are read, and may raise GiError. Raises
    ValueError for damaged files and GiError for truncated ones.
    """
    import OpenEXR

    with _silent_c_library():
        try:
            found = OpenEXR.File(str(path), header_only=True)
            header: dict[str, Any] = found.header()
            width, height = _size(header)
            # The library reads the channels of all parts.
            parts = [part.header for part in found.parts]
            check(width, height, sum(4 * len(part["channels"]) * math.prod(_size(part)) for part in parts))
            if not OpenEXR.InputFile(str(path)).isComplete():
                raise GiError(f"{path} is truncated; download or export it again")
            with OpenEXR.File(str(path), separate_channels=True) as file:
                pixels = {name: channel.pixels for name, channel in file.channels().items()}
        except (GiError, MemoryError):
            raise
        except Exception as error:  # the library raises RuntimeError, TypeError and others
            raise ValueError(str(error)) from None
    # Subsampled channels have another size; the library leaves out those that it cannot decode.
    kept = {name: plane for name, plane in pixels.items() if plane is not None and plane.shape == (height, width)}
    if len(kept) < len(pixels) or not kept:
        raise ValueError(f"channels {', '.join(sorted(set(pixels) - set(kept))) or 'of pixels'} are missing or small")
    return header, kept


def _size(header: dict[str, Any]) -> tuple[int, int]:
    """Return width and height of a part."""
    low, high = header["dataWindow"]
    width, height = (int(b) - int(a) + 1 for a, b in zip(low, high, strict=True))
    return width, height


@contextmanager
def _silent_c_library() -> Iterator[None]:
    """Suppress what the OpenEXR library prints to file descriptors 1 and 2; its errors also arrive as exceptions."""
    sys.stdout.flush()
    sys.stderr.flush()
    saved = [(fd, os.dup(fd)) for fd in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for fd, _ in saved:
            os.dup2(nowhere, fd)
        yield
    finally:
        for fd, copy in saved:
            os.dup2(copy, fd)
            os.close(copy)
        os.close(nowhere)
