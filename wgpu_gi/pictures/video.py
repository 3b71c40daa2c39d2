"""Videos: pictures to an .mp4 (H.264); needs the extra [video]."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import GiError
from ..extras import install_hint
from .atomic_file import atomic_file, check_writable
from .display import display_layer

QUALITY = "18"  # constant rate factor of x264: ffmpeg's guide calls 17 or 18 visually lossless


def is_video(path: str | Path) -> bool:
    """Return whether a file name is that of a video."""
    return Path(path).suffix.lower() == ".mp4"


def check_video(path: str | Path, size: tuple[int, int]) -> None:
    """Raise GiError now if a video could not be written later."""
    _av()
    if size[0] % 2 or size[1] % 2:
        raise GiError(f"{path}: H.264 needs an even width and height, not {size[0]}x{size[1]}; change --size")
    check_writable(path)


@contextmanager
def video_file(path: str | Path, size: tuple[int, int], fps: int) -> Iterator[Callable[[str, ArrayLike, float], None]]:
    """Yield a function that appends a buffer (name, picture, exposure), displayed as in a .png.

    The video appears complete at the end of the `with` block, or not at all.
    """
    av = _av()
    with atomic_file(path) as temporary, av.open(str(temporary), "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=fps)
        stream.width, stream.height = size
        stream.pix_fmt, stream.options = "yuv420p", {"crf": QUALITY}

        def add(name: str, layer: ArrayLike, exposure: float) -> None:
            pixels = np.round(display_layer(name, layer, exposure) * 255.0).astype(np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24")))

        yield add
        container.mux(stream.encode(None))


def _av() -> Any:
    try:
        import av
    except ImportError:
        raise GiError(f"an .mp4 needs a package: {install_hint('video')}; or write frames, as .png") from None
    return av
