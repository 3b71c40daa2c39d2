"""What all writers make of a frame: the picture in 8 bits, and everything that is not an array as JSON.

The JSON object of a frame:

    frame       its number
    size        [width, height] in pixels
    exposure    EV of the picture in 8 bits; null without a picture
    cameras     matrices by name, rows first (see `dataset.matrices`)
    categories  names by id, without 0, which stands for none
    objects     a list; each object has the fields of `frame_data.ObjectData`, boxes as [x, y, width, height]
    record      all values that were drawn for this frame, such as seeds, lights and places
"""

from __future__ import annotations

import json
from dataclasses import asdict
from os import PathLike
from typing import Any

import numpy as np

from ...errors import GiError
from ...pictures.display import png_bytes
from ...pictures.exposure import automatic_exposure
from ..frame_data import FrameData

Record = dict[str, Any]


def exposure_of(data: FrameData, exposure: float | None) -> float | None:
    """Return the EV of a frame in 8 bits: `exposure`, or automatic. None without a picture."""
    if data.picture is None:
        return None
    return automatic_exposure(data.picture) if exposure is None else float(exposure)


def png(data: FrameData, exposure: float | None) -> bytes:
    """Return the picture as a PNG: 8-bit sRGB, with exposure and tone curve. Raises GiError without a picture."""
    if data.picture is None:
        raise GiError("the picture is missing; add it to the data of the data set")
    return png_bytes("picture", data.picture, exposure_of(data, exposure))


def frame_json(frame: int, data: FrameData, record: Record, exposure: float | None) -> dict[str, Any]:
    """Return the JSON object of a frame."""
    return {
        "frame": frame,
        "size": list(data.size),
        "exposure": exposure_of(data, exposure),
        "cameras": data.cameras,
        "categories": data.categories,
        "objects": [asdict(each) for each in data.objects],
        "record": record,
    }


def json_text(value: Any, indent: int | None = None) -> str:
    """Return a value as JSON; numpy arrays become lists. Raises ValueError for NaN and infinity, which JSON lacks."""
    separators = (",", ":") if indent is None else None
    return json.dumps(value, indent=indent, separators=separators, allow_nan=False, default=_plain)


def _plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, PathLike):
        return str(value)
    raise TypeError(f"{type(value).__name__} has no JSON form")
