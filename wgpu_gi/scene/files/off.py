"""Reads text OFF files (Geomview's Object File Format): OFF, COFF, NOFF, STOFF, 4OFF and their combinations.

Own code: trimesh reads neither polygons of five corners nor colours. Departures: colours are sRGB, as other readers
show them; an index into a colour map is not used.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ...errors import GiError
from ...pictures.color import linear_from_srgb
from .memory import MemoryBudget
from .notes import Notes
from .polygons import Floats
from .raw_mesh import Attributes, RawMesh, RawPoints, polygon_mesh
from .read import decode_text, read_file

# The counts may follow the word without a space, as in the files of ModelNet.
_MAGIC = re.compile(r"(ST)?(C)?(N)?(4)?(n)?OFF(?=[\s\d]|$)", re.IGNORECASE)


def read_off(path: Path, notes: Notes, budget: MemoryBudget) -> RawMesh | RawPoints:
    """Read an OFF file; one without faces gives points. Raises GiError for damage."""
    text = decode_text(read_file(path, "OFF file"))
    lines = [words for line in text.splitlines() if (words := line.split("#")[0].split())]
    magic = _MAGIC.match(lines[0][0]) if lines else None
    if magic is None:
        raise GiError(f"{path} is not an OFF file: it does not begin with the word OFF")
    if magic[5] or "BINARY" in lines[0]:
        raise GiError(f"{path} is an OFF file of another kind ({' '.join(lines[0])[:40]}); save it as text in 3-D")
    # The counts may follow the word on its line or below it.
    lines[0] = [word for word in (lines[0][0][magic.end() :], *lines[0][1:]) if word]
    lines = lines if lines[0] else lines[1:]
    try:
        vertex_count, face_count = int(lines[0][0]), int(lines[0][1])
        vertex_lines = lines[1 : 1 + vertex_count]
        face_lines = lines[1 + vertex_count : 1 + vertex_count + face_count]
        if vertex_count < 0 or face_count < 0 or len(vertex_lines) + len(face_lines) < vertex_count + face_count:
            raise GiError(f"{path} is truncated: {vertex_count} vertices and {face_count} faces are announced")
        counts = np.array([int(words[0]) for words in face_lines], np.int64)
        if any(len(words) <= count for words, count in zip(face_lines, counts.tolist(), strict=True)):
            raise GiError(f"{path} is damaged: a face has fewer vertices than it announces")
        ids = [word for words, count in zip(face_lines, counts.tolist(), strict=True) for word in words[1 : 1 + count]]
        vertices = _Vertices(vertex_lines, magic)
        if not face_lines:
            return RawPoints(vertices.positions, vertices.colors, vertices.normals)
        return polygon_mesh(
            vertices.positions, np.array(ids, np.int64), counts.clip(0), str(path), notes,
            vertices=Attributes(vertices.normals, vertices.texcoords, colors=vertices.colors),
            faces=None if vertices.colors is not None else Attributes(colors=_face_colors(face_lines, counts)),
        )  # fmt: skip
    except (ValueError, IndexError, OverflowError):
        raise GiError(f"{path} is not a readable OFF file: it is damaged") from None


class _Vertices:
    """The columns of the vertex lines in the order of the format: position, normal, colour, texture coordinates.

    Raises ValueError for words that are no numbers and for lines that are too short.
    """

    def __init__(self, lines: list[list[str]], magic: re.Match[str]) -> None:
        textured, colored, normal, homogeneous, _ = magic.groups()
        size = 4 if homogeneous else 3
        self.positions = _table(lines, 0, 3)
        if homogeneous:
            with np.errstate(divide="ignore", invalid="ignore"):
                self.positions = self.positions / _table(lines, 3, 4)
        self.normals = _table(lines, size, size + 3) if normal else None
        start = size + (3 if normal else 0)
        # Colours have three or four numbers.
        width = min((len(line) for line in lines), default=0) - start - (2 if textured else 0)
        self.colors = _linear(_table(lines, start, start + min(width, 4))) if colored and width >= 3 else None
        start += min(width, 4) if colored else 0
        texcoords = _table(lines, start, start + 2) if textured else None
        self.texcoords = None if texcoords is None else texcoords * (1.0, -1.0) + (0.0, 1.0)


def _table(lines: list[list[str]], start: int, stop: int) -> Floats:
    """Return columns [start, stop) as numbers."""
    return np.array([words[start:stop] for words in lines], np.float64).reshape(len(lines), stop - start)


def _face_colors(lines: list[list[str]], counts: np.ndarray) -> Floats | None:
    """Return the linear RGBA colours behind the corners of all faces; None unless each has one."""
    words = [line[1 + count :] for line, count in zip(lines, counts.tolist(), strict=True)]
    if not words or min(map(len, words)) < 3:
        return None
    width = 4 if min(map(len, words)) >= 4 else 3
    return _linear(_table(words, 0, width))


def _linear(colors: Floats) -> Floats:
    """Return linear RGBA of sRGB colours from 0 to 1, or from 0 to 255 if any is above 1."""
    if not np.isfinite(colors).all():
        raise ValueError("a colour is not finite")
    unit = (colors / 255 if (colors > 1).any() else colors).clip(0, 1)
    return np.concatenate([linear_from_srgb(unit[:, :3]), unit[:, 3:], np.ones((len(unit), 1))], 1)[:, :4]
