"""Labels a frame: what each pixel shows, and what is seen of each object.

Surfaces are those at the pixel centres, found by rays without random choice, so that depth, normal, albedo, ids, boxes,
flow and occlusion of a frame agree pixel by pixel. A cut-out shows what lies behind it. A blended surface or thin,
smooth glass counts as there if it lets pass at most half of the light; else the pixel shows what lies behind it. Solid
and rough glass always counts. Light (`picture`, `direct`, `indirect`) is that of the
technique, averaged over the pixel's square.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from ..errors import GiError, near_names
from ..renderer import Renderer
from ..scene.rules import shown
from .flow import Second, check_second, flow_and_occlusion
from .frame_data import ARRAYS, FrameData
from .matrices import matrices
from .objects import amodal_objects, categories_of, check_categories, visible_objects
from .rays import forward_of, pixel_rays

# Buffers of the renderer that each array is made of.
BUFFERS_OF: dict[str, tuple[str, ...]] = {
    "picture": ("radiance",),
    "direct": ("emission", "direct"),
    "indirect": ("indirect",),
    "standard_error": ("standard_error",),
    "depth_ray": ("depth",),
    "depth_z": ("depth",),
    "normal": ("normal",),
    "albedo": ("albedo",),
    "instance": ("instance",),
    "category": ("instance",),
    "flow": ("instance", "depth"),
    "occlusion": ("instance", "depth"),
}
SURFACES = ("albedo", "normal", "depth", "instance")  # not light: one frame shows them
WANTED = (*ARRAYS, "objects", "amodal")  # what a frame may have; "amodal" are objects with what lies hidden


def check_wanted(wanted: Collection[str]) -> None:
    """Raise GiError unless `wanted` is a collection of names of data."""
    if isinstance(wanted, str) or not isinstance(wanted, Collection):
        raise GiError(f"the data of a frame must be a collection of names, not {shown(wanted)}")
    for name in wanted:
        if name not in WANTED:
            near = near_names(name, WANTED) if isinstance(name, str) else f"available: {', '.join(WANTED)}"
            raise GiError(f"a frame has no data {shown(name)}; {near}")


def frame_data(
    renderer: Renderer,
    wanted: Collection[str],
    *,
    category_of: Sequence[int] | None = None,
    categories: dict[int, str] | None = None,
    second: Second | None = None,
) -> FrameData:
    """Render a frame and label it: the renderer's scene from its camera, at its time.

    `wanted`: names of arrays of FrameData, "objects" and "amodal". `category_of` has for each instance of the scene a
    key of `categories`, or 0. `second`: scene and camera at the second time, for "flow" and "occlusion"; its instances
    are those of the first time, in the same order, with the same triangles. Raises GiError for unknown names, for ids
    or instances that do not fit, and what the renderer raises.
    """
    check_wanted(wanted)
    names, scene, camera = dict(categories or {}), renderer.posed_scene, renderer.posed_camera
    kinds = check_categories(category_of, names, scene)
    moves = {"flow", "occlusion"} & {*wanted}
    other = check_second(second, scene) if moves else None
    if renderer.window is not None:
        raise GiError("the labels of a frame are those of the whole picture; set renderer.window to None")
    # Render the buffers that are needed.
    needed = {buffer for name in wanted for buffer in BUFFERS_OF.get(name, ())}
    needed |= {"instance"} if {"objects", "amodal"} & {*wanted} else set()
    light = tuple(sorted(needed - {*SURFACES}))
    if light:
        renderer.run(show=light)
    found = {name: np.asarray(renderer.read_back(name)) for name in light}
    found |= renderer.surfaces() if needed & {*SURFACES} else {}
    # Make the arrays of them.
    arrays: dict[str, Any] = {name: found[BUFFERS_OF[name][-1]] for name in {*wanted} - moves if name in BUFFERS_OF}
    if "direct" in arrays:
        arrays["direct"] = found["emission"] + found["direct"]
    if "depth_z" in arrays:
        cosine = pixel_rays(camera, renderer.size)[1] @ forward_of(camera)
        arrays["depth_z"] = (found["depth"] * cosine).astype(np.float32)
    objects = []
    if "instance" in found:
        ids = found["instance"].astype(np.int32)
        arrays |= {"instance": ids} if "instance" in wanted else {}
        arrays |= {"category": categories_of(ids, kinds)} if "category" in wanted else {}
        if "amodal" in wanted:
            objects = amodal_objects(scene, ids, kinds, renderer.amodal(), camera)
        elif "objects" in wanted:
            objects = visible_objects(scene, ids, kinds)
    if other is not None:
        flow, occlusion = flow_and_occlusion(renderer, found["instance"].astype(np.int32), found["depth"], other)
        arrays |= {name: value for name, value in (("flow", flow), ("occlusion", occlusion)) if name in moves}
    return FrameData(
        renderer.size, **arrays, objects=objects, categories=names, cameras=matrices(camera, renderer.size)
    )
