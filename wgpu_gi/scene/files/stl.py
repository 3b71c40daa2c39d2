"""Reads STL files, binary and text (3D Systems 1989, "StereoLithography Interface Specification"), with numpy alone.

Departures: normals of facets are not used, since triangles have a side; colours in binary files are those of VisCAM
and Magics, where all facets have one.
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
from .raw_mesh import Attributes, RawMesh, polygon_mesh
from .read import read_file

_FACET = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("color", "<u2")])
_HEADER = 84  # bytes before the facets: a text of 80, and their number
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")


def read_stl(path: Path, notes: Notes, budget: MemoryBudget) -> RawMesh:
    """Read the triangles of all solids of an STL file. Raises GiError for one that is truncated or damaged."""
    data = read_file(path, "STL file")
    facet_count = int.from_bytes(data[80:_HEADER], "little")
    announced = _HEADER + _FACET.itemsize * facet_count
    # Binary files may begin with "solid", too: text has facets in words.
    text = data.lstrip(b"\xef\xbb\xbf \t\r\n")[:5].lower() == b"solid" and announced != len(data)
    if text and (b"\0" not in data or b"facet" in data[:1000].lower()):
        corners, colors = _text_corners(path, data, notes), None
    elif len(data) < _HEADER or announced > len(data):
        raise GiError(f"{path} is truncated or not an STL file: it announces {announced} bytes and has {len(data)}")
    else:
        if announced < len(data):
            notes.damage(f"{path}: {len(data) - announced} bytes follow its last facet; they were ignored")
        facets = np.frombuffer(data, _FACET, facet_count, _HEADER)
        corners, colors = facets["corners"].astype(np.float64), _colors(data[:80], facets["color"])
    count = len(corners)
    return polygon_mesh(
        corners.reshape(-1, 3),
        np.arange(3 * count),
        np.full(count, 3),
        str(path),
        notes,
        faces=Attributes(colors=colors),
    )


def _text_corners(path: Path, data: bytes, notes: Notes) -> Floats:
    """Return the corners of the facets of a text file, (m, 3, 3)."""
    text = data.lower()
    words = _VERTEX.findall(text)
    loops = text.count(b"endloop")
    if len(words) != 3 * loops or text.count(b"endfacet") != loops:
        raise GiError(f"{path} is truncated or damaged: {loops} whole facets have {len(words)} vertices")
    if re.search(rb"\bend\s*solid", text) is None:
        notes.damage(f"{path}: there is no 'endsolid' at its end; the file may be incomplete")
    solids = len(re.findall(rb"^\s*solid\b", text, re.MULTILINE))
    if solids > 1:
        notes.add(f"{path}: its {solids} solids were joined into one mesh")
    try:
        return np.array(words, np.float64).reshape(-1, 3, 3)
    except ValueError:
        raise GiError(f"{path} is damaged: a vertex is not three numbers; export it again") from None


def _colors(header: bytes, words: np.ndarray) -> Floats | None:
    """Return linear RGBA of the facets, (m, 4); None unless each has one.

    Five bits per channel: blue first and bit 15 for "valid" (VisCAM), or red first and bit 15 for "none" (Magics).
    """
    magics = b"COLOR=" in header
    if not len(words) or not ((words >> 15) == (0 if magics else 1)).all() or (magics and not words.any()):
        return None
    channels = np.stack([words >> shift & 31 for shift in ((0, 5, 10) if magics else (10, 5, 0))], 1) / 31
    return np.concatenate([linear_from_srgb(channels), np.ones((len(words), 1))], 1)
