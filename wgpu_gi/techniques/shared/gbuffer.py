"""The G-buffer: raster passes write triangle numbers, a compute pass resolves them to surfaces.

Burns and Hunt 2013, "The Visibility Buffer". Depth peeling: Everitt 2001, "Interactive Order-Independent Transparency".
Departure: the resolve intersects the pixel's ray with the triangle instead of interpolating, to match the path tracer
exactly.

Raster passes draw only the clusters that `culling` finds in view.

28 bytes per pixel (44 with emission; 4 more with instances, 32 more with layers of materials). On llvmpipe, Sponza at
640x360, CPU time over two cores: rasterising takes 24 + 7 ms and resolving 27 ms; one textured raster pass that writes
packed surfaces and emission takes 117 + 8 ms. Across the aisle, where 8 % of the clusters are in view, rasterising
takes 7 + 5 ms; without culling, 11 + 6 ms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import GiError
from ...gpu.formats import FOUR_FLOATS
from ...gpu.graph import Graph
from ...gpu.handles import Buffer, Shared, Texture
from .bounds import NOTHING
from .culling import CameraDraws, ViewCulling
from .scene_inputs import RasterInputs, declared_features

SURFACE = np.dtype((np.uint32, 4))
Pixels = tuple[tuple[int, int], ...]  # (x, y) each


@dataclass
class Gbuffer:
    """One layer of surfaces. Buffers have one element per pixel, rows from the top.

    visibility and depth have the size of the whole picture, of which passes fill the view's window.
    visibility: triangle and instance, each plus 1; 0: none. depth: reversed, near / view depth. distance: metres along
    the pixel's ray; 0: no surface. surfaces: packed as in `wgsl/shared/gbuffer/surface.wgsl`. emission:
    radiance of the surface, or of the environment without one, W/(m2 sr). seen_tiles: tiles of 8x8 pixels that show a
    surface, for `wgsl/shared/gbuffer/tiles.wgsl`. tile_groups: workgroups of a pass over them. features: HAS_
    constants of the scene, on which the layout of the surfaces depends.
    """

    visibility: Texture
    depth: Texture
    distance: Texture
    surfaces: Buffer
    emission: Buffer
    seen_tiles: Buffer
    tile_groups: Buffer
    features: dict[str, bool]

    def constants(self, shader: str) -> dict[str, bool]:
        """Return the HAS_ constants that `shader` declares."""
        return declared_features(shader, self.features)

    @property
    def tiles(self) -> dict[str, Buffer]:
        """The bindings of passes over the tiles."""
        return {"seen_tiles": self.seen_tiles, "tile_groups": self.tile_groups}


def whole_size(graph: Graph, view: str = "view") -> tuple[int, int]:
    """Return the size of the whole picture of a camera, of which the graph's is a window."""
    camera = graph.uniforms[view]
    width, height = np.frombuffer(camera.data, camera.dtype)["whole"][0].tolist()
    return width, height


def declare_gbuffer(
    graph: Graph,
    scene: RasterInputs,
    *,
    name: str = "gbuffer",
    view: str = "view",
    layers: int = 1,
    pixels: Pixels = (),
) -> list[Gbuffer]:
    """Declare the G-buffer of the camera in the uniform `view`, of the viewport's size, nearest surfaces first.

    Each further layer of `layers` holds the nearest surfaces behind the previous layer. `visibility` also has these
    `pixels` of the whole picture.
    """
    if view not in graph.uniforms:
        raise GiError(f"G-buffer {name!r}: there is no shared uniform {view!r}")
    culling = ViewCulling()
    found: list[Gbuffer] = []
    for layer in range(layers):
        suffix = f"_{layer}" if layer else ""
        nearer = found[-1].depth if found else None
        found.append(_declare_layer(graph, scene, name, suffix, view, culling, nearer, pixels))
    return found


def _declare_layer(
    graph: Graph,
    scene: RasterInputs,
    name: str,
    suffix: str,
    view: str,
    culling: ViewCulling,
    nearer: Texture | None,
    pixels: Pixels,
) -> Gbuffer:
    visibility, depth = _declare_visibility(graph, scene, name, suffix, view, culling, nearer, pixels)
    width, height = graph.size
    words = 3 if scene.features["HAS_LAYERS"] else 1
    surfaces = graph.buffer(f"{name}/surfaces{suffix}", dtype=SURFACE, count=words * width * height)
    emission = graph.buffer(
        f"{name}/emission{suffix}", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True
    )
    distance = graph.texture(f"{name}/distance{suffix}", "r32float", nonnegative=True)
    tiles = graph.buffer(f"{name}/seen_tiles{suffix}", dtype=np.uint32, count=-(-width // 8) * -(-height // 8))
    tile_groups = graph.buffer(f"{name}/tile_groups{suffix}", dtype=np.uint32, count=4)
    found = Gbuffer(visibility, depth, distance, surfaces, emission, tiles, tile_groups, scene.features)
    results = {"surfaces": surfaces, "emission": emission, "distance": distance}
    sky, resolve = "shared/gbuffer/sky.wgsl", "shared/gbuffer/resolve.wgsl"
    graph.compute(
        f"{name}/sky{suffix}",
        sky,
        over=(width, -(-height // 8)),
        reads={"environment": scene.lights["environment"], "visibility": visibility},
        writes={**results, **found.tiles},
        constants=scene.constants(sky),
        uniforms={"view": view},
        clear=[tile_groups] if scene.features["HAS_EMISSION"] else [tile_groups, emission],
    )
    graph.compute(
        f"{name}/resolve{suffix}",
        resolve,
        indirect=tile_groups,
        reads={**scene.surfaces, **found.tiles, "visibility": visibility},
        writes=results,
        constants=scene.constants(resolve),
        uniforms={"view": view},
    )
    return found


def _declare_visibility(
    graph: Graph,
    scene: RasterInputs,
    name: str,
    suffix: str,
    view: str,
    culling: ViewCulling,
    nearer: Texture | None,
    pixels: Pixels,
) -> tuple[Texture, Texture]:
    """Declare the raster passes of a layer, behind the depth `nearer` if given; return visibility and depth."""
    # Without instances the second number is always 0; a one-channel texture reads as 0 there, too.
    ids = "rg32uint" if scene.features["HAS_INSTANCES"] else "r32uint"
    size = whole_size(graph, view)
    visibility = graph.texture(f"{name}/visibility{suffix}", ids, size=size)
    depth = graph.texture(f"{name}/depth{suffix}", "depth32float", size=size)
    shader = "shared/gbuffer/visibility.wgsl"
    behind = graph.neutral("texture_2d") if nearer is None else nearer
    fragment = "fragment_see_through" if scene.features["HAS_SEE_THROUGH"] else "fragment_masked"
    for part, masked in (("opaque", False), ("masked", True)):
        runs = scene.draws.masked if masked else scene.draws.opaque
        if masked and not runs:
            graph.skip(f"{name}/masked{suffix}", "no alpha-masked material, no see-through one", NOTHING)
            continue
        graph.raster(
            f"{name}/{part}{suffix}",
            shader,
            draw=CameraDraws(graph.uniforms[view], scene.upload, masked, culling, pixels),
            index=scene.raster_indices,
            color={"color": visibility},
            depth=depth,
            reads={**scene.surfaces, **scene.raster, "nearer": behind},
            constants={**scene.constants(shader), "PEEL": nearer is not None},
            uniforms={"view": view},
            entry=("vertex_masked", fragment) if masked else ("vertex", "fragment"),
            load=masked,
        )
    return visibility, depth


def declare_tint(graph: Graph, scene: RasterInputs, gbuffer: Gbuffer) -> Buffer | None:
    """Declare the factor on each pixel's light, (r, g, b, -), of glass it shows or shows through; None: 1."""
    if not scene.features["HAS_TINTS"]:
        graph.skip("gbuffer/tint", "no thin, smooth glass", NOTHING)
        return None
    width, height = graph.size
    tint = graph.buffer("gbuffer/tint", dtype=FOUR_FLOATS, count=width * height, width=width, nonnegative=True)
    shader = "shared/gbuffer/tint.wgsl"
    graph.compute(
        "gbuffer/tint",
        shader,
        over=(width, height),
        reads={**scene.surfaces, "visibility": gbuffer.visibility, "distance": gbuffer.distance},
        writes={"tint": tint},
        constants=scene.constants(shader),
    )
    return tint


def declare_motion(graph: Graph, scene: RasterInputs, gbuffer: Gbuffer, before: dict[str, Shared]) -> Buffer:
    """Declare the motion of each pixel's surface: (x, y, distance, valid) of `shared/gbuffer/motion.wgsl`.

    `before`: how instances and vertices have moved since the previous frame, by WGSL name.

    Needs the uniform `view_before`: the previous frame's view.
    """
    width, height = graph.size
    shader = "shared/gbuffer/motion.wgsl"
    motion = graph.buffer("gbuffer/motion", dtype=FOUR_FLOATS, count=width * height, width=width)
    graph.compute(
        "gbuffer/motion",
        shader,
        over=(width, height),
        reads={
            "triangles": scene.surfaces["triangles"],
            "instances": scene.surfaces["instances"],
            **before,
            "visibility": gbuffer.visibility,
            "distance": gbuffer.distance,
        },
        writes={"motion": motion},
        constants=scene.constants(shader),
    )
    return motion
