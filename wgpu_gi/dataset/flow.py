"""Forward optical flow and occlusion: where the second time shows the point that each pixel's centre shows, if it does.

    flow = projection of the point, moved with its instance, to the second camera - pixel centre

The point moves by its instance's matrices; on instances whose vertices move, by its triangle. The sky moves as a
direction does. Occlusion is exact per point, not per pixel: the point leaves the picture, or something blocks a ray
from the second camera to it, through the scene at the second time. Points behind the second camera have the flow 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import GiError
from ..renderer import Renderer
from ..scene.check import check_camera
from ..scene.deformation import is_deformed, posed_positions
from ..scene.rules import shown
from ..scene.scene import Instance, Scene
from .rays import forward_of, pixel_rays, project

Array = NDArray[np.float64]
Second = tuple[Scene, Camera]  # the scene and the camera at the second time


def check_second(second: Second | None, scene: Scene) -> Second:
    """Return the second time. Raises GiError unless its scene has the same instances, with the same triangles."""
    if second is None:
        raise GiError("flow and occlusion need a second time; give second=(scene, camera)")
    if not isinstance(second, tuple) or len(second) != 2 or not isinstance(second[0], Scene):
        raise GiError(f"second must be a pair (scene, camera), not {shown(second)}")
    other, camera = second
    check_camera(camera)
    if len(other.instances) != len(scene.instances):
        raise GiError(
            f"the scene of the second time has {len(other.instances)} instances, that of the first"
            f" {len(scene.instances)}; flow needs the same ones, in the same order"
        )
    for place, (one, two) in enumerate(zip(scene.instances, other.instances, strict=True)):
        if one.mesh is not two.mesh and not np.array_equal(one.mesh.triangles, two.mesh.triangles):
            raise GiError(f"instance {place} ({one.name!r}) has other triangles at the second time")
    return second


def flow_and_occlusion(
    renderer: Renderer, ids: NDArray[np.int32], depth_ray: NDArray[np.float32], second: Second
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return the flow (h, w, 2), pixels right and down, and the occlusion (h, w) of the frame that was rendered last.

    `ids`, `depth_ray`: as in FrameData.
    """
    scene, size, (other, camera) = renderer.posed_scene, renderer.size, second
    # Move the points, and project them; the sky is a direction.
    origins, directions = pixel_rays(renderer.posed_camera, size)
    points = _moved(renderer, ids, origins + directions * depth_ray[..., None].astype(np.float64), scene, other)
    sky = ids == 0
    position = np.asarray(camera.world_from_view, np.float64)[:3, 3]
    points[sky] = position + directions[sky]
    places, z = project(camera, size, points)
    centres = np.stack(np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5), -1)
    is_parallel = camera.orthographic_height is not None
    if is_parallel:
        # All pixels of the sky show the same direction: nothing moves.
        places[sky], z[sky] = centres[sky], 1.0
    inside = (z > 0) & ((places >= 0) & (places < size)).all(2)
    flow = np.where((z > 0)[..., None], places - centres, 0.0).astype(np.float32)
    # Trace rays to those that the second picture may show.
    starts = np.broadcast_to(position, points.shape)
    if is_parallel:
        second_origins, _ = pixel_rays(camera, size)
        starts = np.where(sky[..., None], second_origins, points - z[..., None] * forward_of(camera))
    ways = points - starts
    if is_parallel:
        ways[sky] = forward_of(camera)
    lengths = np.linalg.norm(ways, axis=2)
    limits = np.where(sky, np.inf, lengths)[inside]
    hidden = ~inside
    hidden[inside] = ~renderer.reaches(starts[inside], (ways / lengths[..., None])[inside], limits, other)
    return flow, hidden


def _moved(renderer: Renderer, ids: NDArray[np.int32], points: Array, scene: Scene, other: Scene) -> Array:
    """Return the points (h, w, 3) of instances `ids` where they are at the second time."""
    seen = np.unique(ids[ids > 0]).tolist()
    pairs = {number: (scene.instances[number - 1], other.instances[number - 1]) for number in seen}
    bent = {number for number, pair in pairs.items() if _changes_shape(*pair)}
    vertices, weights = renderer.corners() if bent else (np.zeros(0, np.int64), np.zeros(0))
    order = np.argsort(ids, axis=None, kind="stable")
    ends = np.searchsorted(ids.ravel()[order], [*seen, seen[-1] + 1] if seen else [])
    flat = points.reshape(-1, 3).copy()
    for number, first, last in zip(seen, ends[:-1], ends[1:], strict=True):
        one, two = pairs[number]
        chosen, target = order[first:last], np.asarray(two.world_from_local, np.float64)
        if number in bent:
            corners = posed_positions(two)[vertices.reshape(-1, 3)[chosen]]
            local = (corners * weights.reshape(-1, 3)[chosen][..., None]).sum(1)
            flat[chosen] = local @ target[:3, :3].T + target[:3, 3]
        elif not np.array_equal(one.world_from_local, target):
            moved = target @ np.linalg.inv(np.asarray(one.world_from_local, np.float64))
            flat[chosen] = flat[chosen] @ moved[:3, :3].T + moved[:3, 3]
    return flat.reshape(points.shape)


def _changes_shape(one: Instance, two: Instance) -> bool:
    """Tell whether the vertices of an instance may move within its local space."""
    return is_deformed(one) or is_deformed(two) or one.mesh.positions is not two.mesh.positions
