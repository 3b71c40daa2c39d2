"""Finds what a stage shows: geometry, lights and cameras with their transforms, in instances and point instancers.

Prims that are invisible, or that serve as proxies or guides, are left out. Prototypes of a point instancer are shown
where it places them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..transforms import Matrix
from .stage import Stage, matrix_of, whole

_PRIM_BYTES = 2048  # that a visited prim, or an instance of one, takes here: about what Python's objects do
_DEEPEST = 8  # point instancers within one another

# Kinds of geometry that are not shown.
_NOT_SHOWN = ("BasisCurves", "NurbsCurves", "NurbsPatch", "HermiteCurves", "TetMesh", "Volume", "ParticleField")


class Placed(NamedTuple):
    """A prim and where it is."""

    prim: Any
    stage_from_prim: Matrix


@dataclass
class Shown:
    """All that a stage shows, in the order of its hierarchy."""

    geometry: list[Placed] = field(default_factory=list)
    lights: list[Placed] = field(default_factory=list)
    cameras: list[Placed] = field(default_factory=list)


def find_shown(stage: Stage) -> Shown:
    """Return what the stage shows. Raises GiError for more prims and instances than the budget has bytes."""
    from pxr import Usd

    found = Shown()
    left_out: dict[str, int] = {}
    root = stage.usd.GetPseudoRoot()
    _visit(stage, Usd.PrimRange(root, Usd.TraverseInstanceProxies()), None, np.eye(4), found, left_out, 0)
    for kind, count in left_out.items():
        stage.note(f"{kind}, which are not shown: {count}")
    return found


def _visit(
    stage: Stage,
    prims: Any,
    ancestor: Any,
    base: Matrix,
    found: Shown,
    left_out: dict[str, int],
    depth: int,
) -> None:
    """Add what a range of prims shows, with transforms relative to `ancestor`, which is at `base`; None: the stage."""
    from pxr import UsdGeom, UsdLux

    iterator = iter(prims)
    for prim in iterator:
        stage.budget.take(_PRIM_BYTES, stage.source)
        # Leave out what is not part of the picture, with all below it.
        imageable = UsdGeom.Imageable(prim)
        if imageable and prim.IsA(UsdGeom.Imageable):
            if imageable.GetVisibilityAttr().Get(stage.time) == UsdGeom.Tokens.invisible:
                iterator.PruneChildren()
                continue
            if imageable.ComputePurpose() in (UsdGeom.Tokens.proxy, UsdGeom.Tokens.guide):
                iterator.PruneChildren()
                left_out["prims that are proxies or guides"] = left_out.get("prims that are proxies or guides", 0) + 1
                continue
        kind = str(prim.GetTypeName())
        if kind in _NOT_SHOWN:
            left_out[kind] = left_out.get(kind, 0) + 1
            continue
        is_instancer = prim.IsA(UsdGeom.PointInstancer)
        into = (
            found.cameras if prim.IsA(UsdGeom.Camera)
            else found.lights if prim.HasAPI(UsdLux.LightAPI) and not prim.IsA(UsdGeom.Mesh)
            else found.geometry if prim.IsA(UsdGeom.Gprim)
            else None
        )  # fmt: skip
        if into is None and not is_instancer:
            continue
        # Place it.
        if ancestor is None:
            matrix = stage.placed(prim)
        else:
            matrix = base @ matrix_of(stage.transforms.ComputeRelativeTransform(prim, ancestor)[0])
        if not np.isfinite(matrix).all():
            stage.damage(f"{prim.GetPath()} was left out: its transform is not finite")
        elif into is not None:
            into.append(Placed(prim, matrix))
        elif depth >= _DEEPEST:
            stage.damage(f"{prim.GetPath()} was left out: it is the point instancer of too many others")
        else:
            _place_prototypes(stage, prim, matrix, found, left_out, depth)
        if is_instancer:
            iterator.PruneChildren()


def _place_prototypes(
    stage: Stage, prim: Any, base: Matrix, found: Shown, left_out: dict[str, int], depth: int
) -> None:
    """Add the instances of a point instancer, which is at `base`."""
    from pxr import Usd, UsdGeom

    instancer = UsdGeom.PointInstancer(prim)
    kinds = whole(instancer.GetProtoIndicesAttr(), stage)
    exclude = UsdGeom.PointInstancer.ExcludeProtoXform
    ignore = UsdGeom.PointInstancer.IgnoreMask
    places = instancer.ComputeInstanceTransformsAtTime(stage.time, stage.time, exclude, ignore)
    mask = instancer.ComputeMaskAtTime(stage.time) or [True] * len(kinds)
    paths = instancer.GetPrototypesRel().GetForwardedTargets()
    if places is None or len(places) != len(kinds) or len(mask) != len(kinds):
        stage.damage(f"{prim.GetPath()} was left out: its positions do not fit its protoIndices")
        return
    if ((kinds < 0) | (kinds >= len(paths))).any():
        stage.damage(f"{prim.GetPath()}: instances without a prototype were left out")
    matrices = np.array(places, np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
    shown = np.array(mask, np.bool_) & np.isfinite(matrices).all((1, 2))
    # Find what each prototype shows, relative to its parent, and place it.
    predicate = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)
    for kind, path in enumerate(paths):
        chosen = matrices[(kinds == kind) & shown]
        prototype = stage.usd.GetPrimAtPath(path)
        if not len(chosen) or not prototype:
            continue
        parts = Shown()
        _visit(stage, Usd.PrimRange(prototype, predicate), prototype.GetParent(), np.eye(4), parts, left_out, depth + 1)
        for into, listed in ((found.geometry, parts.geometry), (found.lights, parts.lights)):
            stage.budget.take(_PRIM_BYTES * len(chosen) * len(listed), f"{stage.source}: {prim.GetPath()}")
            into += [Placed(part.prim, base @ matrix @ part.stage_from_prim) for part in listed for matrix in chosen]
