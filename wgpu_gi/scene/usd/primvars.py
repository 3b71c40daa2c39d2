"""Reads primvars of a stage, and sorts them by what they belong to: vertices, corners or faces."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..files.polygons import Floats
from ..files.raw_mesh import Attributes
from .stage import Stage, as_rows


class Values(NamedTuple):
    """Rows (n, k) with an interpolation of USD: constant, uniform, varying, vertex or faceVarying."""

    rows: Floats
    interpolation: str


def primvar(prim: Any, name: str, stage: Stage, width: int) -> Values | None:
    """Return a primvar of a prim or its ancestors without indices; None, with a note if it is damaged."""
    from pxr import UsdGeom

    found = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    if not found or not found.HasValue():
        return None
    value = found.ComputeFlattened(stage.time)
    values = as_rows(value, stage, width)
    if values is None or not len(values):
        if value is not None and len(value):
            stage.damage(f"{prim.GetPath()}: the primvar {name!r} was left out: it is no array of {width} numbers")
        return None
    return Values(values, str(found.GetInterpolation()))


def widened(colors: Values, count: int) -> Floats | None:
    """Return colours as RGBA for each of `count` points; None if they are of another number."""
    rgb = np.repeat(colors.rows, count, axis=0) if len(colors.rows) == 1 else colors.rows
    return _rgba(rgb) if len(rgb) == count else None


def attributes_of(
    found: dict[str, Values | None], vertices: int, faces: int, corners: int, stage: Stage, where: str
) -> tuple[Attributes, Attributes, Attributes]:
    """Return the attributes of vertices, faces and corners; those of a wrong length are left out with a note."""
    places = Attributes(), Attributes(), Attributes()
    for name, values in found.items():
        if values is None:
            continue
        table, interpolation = values
        if interpolation == "constant" and len(table) == 1:
            table, interpolation = np.repeat(table, vertices, axis=0), "vertex"
        place, length = {"uniform": (1, faces), "faceVarying": (2, corners)}.get(interpolation, (0, vertices))
        if len(table) != length:
            stage.damage(f"{where}: {name} were left out: there are {len(table)} for {length} ({interpolation})")
            continue
        setattr(places[place], name, _rgba(table) if name == "colors" else table)
    return places


def _rgba(rgb: Floats) -> Floats:
    return np.concatenate([rgb, np.ones((len(rgb), 1))], 1)
