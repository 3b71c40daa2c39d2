"""Renders small pictures for tests and compares their means with known values."""

from __future__ import annotations

import numpy as np

from wgpu_gi.camera import Camera
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.scene.scene import Instance, Scene, values_of

BOUND = 0.005  # closed forms hold within 0.5 %


def shoot(
    scene: Scene,
    size: tuple[int, int] = (16, 16),
    *,
    show: tuple[str, ...] = ("radiance", "standard_error"),
    camera: Camera | None = None,
    jitter: bool = False,
    diffuse: bool = True,
    **settings: object,
) -> dict[str, np.ndarray]:
    """Render a scene and return the buffers `show` by name as float64; `settings` are fields of Settings (gi: path)."""
    settings.setdefault("gi", "path")
    chosen = Settings(camera=CameraSettings(jitter=jitter), diffuse=diffuse, **settings)
    renderer = Renderer(scene, size=size, camera=camera, settings=chosen)
    renderer.run(show=show)
    return {name: renderer.read_back(name).astype(np.float64) for name in show}


def assert_mean(buffers: dict[str, np.ndarray], expected: object, bound: float = BOUND, where: object = ...) -> None:
    """Assert that the mean radiance over the pixels `where` is `expected` (per channel or one for all) within `bound`.

    The bound must exceed three standard errors of the mean, or the test would be meaningless.
    """
    radiance, error = buffers["radiance"][where], buffers["standard_error"][where]
    mean = radiance.reshape(-1, 3).mean(0)
    noise = np.sqrt((error.reshape(-1, 3) ** 2).sum(0)) / (error.size // 3)
    wanted = np.broadcast_to(np.asarray(expected, np.float64), 3)
    assert (3 * noise <= bound * wanted).all(), f"noise of {noise / wanted} needs more samples"
    off = mean / wanted - 1
    assert (np.abs(off) <= bound).all(), f"mean {mean}, expected {wanted}, off by {off}"


def moved(scene: Scene, matrix: np.ndarray) -> Scene:
    """Return the scene with its instances, punctual lights and cameras transformed by a similarity, a (4, 4) matrix."""
    m = np.asarray(matrix, np.float64)
    scale = np.cbrt(np.linalg.det(m[:3, :3]))
    instances = [Instance(i.mesh, m @ i.world_from_local, i.name) for i in scene.instances]
    lights = []
    for light in scene.lights:
        fields = values_of(light)
        if "position" in fields:
            fields["position"] = m[:3, :3] @ np.asarray(fields["position"], np.float64) + m[:3, 3]
        if "direction" in fields:
            fields["direction"] = m[:3, :3] @ np.asarray(fields["direction"], np.float64) / scale
        lights.append(type(light)(**fields))
    cameras = []
    for camera in scene.cameras:
        pose = m @ camera.world_from_view
        pose[:3, :3] /= scale
        height = None if camera.orthographic_height is None else camera.orthographic_height * scale
        cameras.append(Camera(pose, camera.yfov, height, camera.name))
    return Scene(instances, lights, scene.environment, cameras, scene.name)


def scaling(factor: float) -> np.ndarray:
    """Return a (4, 4) uniform scale about the origin."""
    return np.diag([factor, factor, factor, 1.0])


def translation(x: float, y: float, z: float) -> np.ndarray:
    """Return a (4, 4) translation."""
    m = np.eye(4)
    m[:3, 3] = x, y, z
    return m


def looking(direction: object, position: object = (0.0, 0.0, 0.0), height: float | None = None) -> Camera:
    """Return a camera that looks along `direction`, orthographic if `height` metres are given."""
    eye = np.asarray(position, np.float64)
    camera = Camera.look_at(eye, eye + np.asarray(direction, np.float64), yfov_deg=40.0)
    camera.orthographic_height = height
    return camera
