"""Writes COCO instance annotations, as `pycocotools` and its many readers take them.

    images/000123.png   the picture: 8-bit sRGB, with exposure and tone curve
    instances.json      all annotations, once all frames are there

`instances.json` holds `info`, `licenses` (empty) and

    categories   id, name, supercategory ("")
    images       id (the number of the frame), file_name (within images/), width, height; also `exposure` in EV and
                 `record`, the values drawn for the frame
    annotations  one for each object that has a category and is seen; ids from 1, by frame, then by object
        image_id, category_id, iscrowd (0)
        segmentation   the visible pixels as uncompressed RLE: size [height, width]; counts of pixels off, on, off ...,
                       down the columns from the left
        area           number of visible pixels
        bbox           [x, y, width, height] of the visible pixels, in pixels from the top left corner
        and beyond COCO: instance_id, instance_name; amodal_bbox, the box of the whole object, which may reach beyond
        the picture, amodal_bbox_clipped, its part within; amodal_area, the pixels of the picture that the object would
        cover alone; visible_fraction = area / amodal_area. Null where unknown.

Source: T.-Y. Lin et al. 2014, "Microsoft COCO: Common Objects in Context", and cocodataset.org, "Data format".
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ..frame_data import FrameData, ObjectData
from .sample import Record, exposure_of, json_text, png
from .store import Parts, Read, Store


class CocoWriter:
    """Pictures, and one file of annotations. `categories` are names by id, from 1."""

    def __init__(self, folder: Path, frames: int, exposure: float | None, categories: dict[int, str]) -> None:
        """Raise GiError without categories, since objects without one are not annotated."""
        if not categories:
            raise GiError("the writer coco needs categories: objects without one are not annotated")
        self._store, self._exposure, self._categories = Store(folder, frames), exposure, categories
        self._parts = Parts(self._store, folder / "instances.json", range(frames))

    def has(self, frame: int) -> bool:
        """Tell whether a frame is complete."""
        return self._parts.has(frame)

    def write(self, frame: int, data: FrameData, record: Record) -> None:
        """Write the picture of a frame and keep its annotations. Raises GiError if the file system refuses."""
        if data.instance is None:
            raise GiError("the writer coco needs the data instance")
        file_name = f"{self._store.path(frame)}.png"
        self._store.write_bytes(self._store.folder / "images" / file_name, png(data, self._exposure))
        image = {
            "id": frame,
            "file_name": file_name,
            "width": data.size[0],
            "height": data.size[1],
            "exposure": exposure_of(data, self._exposure),
            "record": record,
        }
        part = {"image": image, "annotations": annotate(frame, data.instance, data.objects)}
        self._parts.add(frame, json_text(part).encode())

    def finish(self) -> int:
        """Write `instances.json` if all frames are there; return how many are missing."""
        missing = self._parts.join(self._join)
        if not missing:
            self._store.clean()
        return missing

    def _join(self, file: BinaryIO, read: Read) -> None:
        """Write the file of all frames; hold one of them at a time."""
        categories = [{"id": key, "name": name, "supercategory": ""} for key, name in sorted(self._categories.items())]
        head = {"info": {"description": "rendered by wgpu_gi"}, "licenses": [], "categories": categories}
        file.write(json_text(head)[:-1].encode() + b',"images":[')
        separator = b"\n"
        for part in read():
            file.write(separator + json_text(json.loads(part)["image"]).encode())
            separator = b",\n"
        file.write(b'],"annotations":[')
        number, separator = 0, b"\n"
        for part in read():
            for annotation in json.loads(part)["annotations"]:
                number += 1
                file.write(separator + json_text({"id": number, **annotation}).encode())
                separator = b",\n"
        file.write(b"]}\n")


def annotate(frame: int, instance: NDArray[np.int32], objects: list[ObjectData]) -> list[dict[str, Any]]:
    """Return the annotations of a frame, without their ids; `instance` (h, w) holds `ObjectData.id`."""
    found = []
    runs = _runs(instance)
    for each in sorted(objects, key=lambda each: each.id):
        starts, lengths = (part[runs[0] == each.id] for part in runs[1:])
        if not each.category or not starts.size:
            continue
        found.append(
            {
                "image_id": frame,
                "category_id": each.category,
                "segmentation": {"size": list(instance.shape), "counts": _counts(starts, lengths, instance.size)},
                "area": int(lengths.sum()),
                "bbox": _box(starts, lengths, instance.shape[0]),
                "iscrowd": 0,
                "instance_id": each.id,
                "instance_name": each.name,
                "amodal_bbox": each.amodal_box,
                "amodal_bbox_clipped": each.amodal_box_clipped,
                "amodal_area": each.amodal_pixels,
                "visible_fraction": each.visible_fraction,
            }
        )
    return found


def _runs(instance: NDArray[np.int32]) -> tuple[NDArray, NDArray, NDArray]:
    """Return the runs of equal values down the columns: their value, first pixel and length."""
    values = instance.ravel(order="F")
    starts = np.concatenate([[0], np.flatnonzero(values[1:] != values[:-1]) + 1])
    return values[starts], starts, np.diff(starts, append=values.size)


def _counts(starts: NDArray, lengths: NDArray, pixels: int) -> list[int]:
    """Return how many pixels are off, on, off ... in turn."""
    ends = starts + lengths
    off = starts - np.concatenate([[0], ends[:-1]])
    counts = np.stack([off, lengths], -1).ravel().tolist()
    rest = int(pixels - ends[-1])
    return [*counts, rest] if rest else counts


def _box(starts: NDArray, lengths: NDArray, height: int) -> list[int]:
    """Return [x, y, width, height] of runs down columns of `height` pixels."""
    lasts = starts + lengths - 1
    left, right = int(starts[0]) // height, int(lasts[-1]) // height
    if np.any(starts // height != lasts // height):  # a run that goes on in the next column reaches bottom and top
        top, bottom = 0, height - 1
    else:
        top, bottom = int((starts % height).min()), int((lasts % height).max())
    return [left, top, right - left + 1, bottom - top + 1]
