"""Poses skinned meshes of a stage by their skeletons, with UsdSkel's own linear blend skinning."""

from __future__ import annotations

from .stage import Stage


def bake_skinning(stage: Stage) -> None:
    """Write the posed points of all skinned meshes into the stage's session layer, which is in memory.

    Skeletons within instances cannot be written to, and stay at rest, with a note.
    """
    from pxr import Gf, Usd, UsdSkel

    if any(prim.IsA(UsdSkel.Root) for prototype in stage.usd.GetPrototypes() for prim in Usd.PrimRange(prototype)):
        stage.note("skinned meshes within instances are shown in their rest pose")
    roots = [prim for prim in stage.usd.Traverse() if prim.IsA(UsdSkel.Root)]
    if not roots:
        return
    time = stage.time
    at = 0.0 if time.IsDefault() or time.IsEarliestTime() else time.GetValue()
    stage.usd.SetEditTarget(stage.usd.GetSessionLayer())
    for root in roots:
        if not UsdSkel.BakeSkinning(UsdSkel.Root(root), Gf.Interval(at, at)):
            stage.note(f"{root.GetPath()} is shown in its rest pose")
