"""A job: the frames of a sequence and how to render them, as plain data that can be sent to another process.

The animation of a scene plays: frame F shows the second F / fps, from the start again after the end. A time holds it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..camera import Camera
from ..options import Settings
from ..renderer import Renderer
from ..rendering import with_alpha
from ..scene.files.camera_files import camera_of
from ..scene.files.camera_paths import CameraAt, turntable
from ..scene.player import find_animation
from ..scene.pose import Pose, looped
from ..scene.scene import Scene
from .source import SceneSource


@dataclass(frozen=True)
class Job:
    """The frames to render, how, and what to read back.

    `camera` is a Camera, or the index of one in the scene, which then moves with the animation. `path` gives the camera
    of each frame instead, `turntable` moves `camera` once round the scene. `time`: seconds in an animation that does
    not play.
    """

    source: SceneSource
    camera: Camera | int
    settings: Settings
    size: tuple[int, int]
    frames: range
    shown: tuple[str, ...] = ("radiance",)
    layers: tuple[str, ...] = ()
    time: float | None = None
    animation: str | int | None = None
    fps: int = 24
    path: CameraAt | None = None
    turntable: bool = False
    adapter: str | None = None
    denoise: bool = False
    check: bool = False
    timings: bool = False

    @property
    def show(self) -> tuple[str, ...]:
        """The buffers to render."""
        return with_alpha((*self.shown, *self.layers), self.settings, self.denoise)

    def plays(self, scene: Scene) -> bool:
        """Tell whether the animation of the scene plays."""
        return bool(scene.animations) and self.source.time is None

    def renderer(self, scene: Scene) -> Renderer:
        """Return a renderer of the loaded scene."""
        camera = camera_of(scene, self.camera)
        renderer = Renderer(scene, size=self.size, camera=camera, settings=self.settings, adapter=self.adapter)
        renderer.animation = self.animation
        return renderer


def index_or_camera(scene: Scene, camera: Camera) -> Camera | int:
    """Return `camera` of a Job: the index if it is one of the scene's."""
    return next((i for i, known in enumerate(scene.cameras) if known is camera), camera)


class Timeline:
    """Camera and time of each frame of a job in its loaded scene; needs no GPU."""

    def __init__(self, job: Job, scene: Scene) -> None:
        """Raises GiError for an animation that the scene does not have."""
        self.job, self.scene = job, scene
        camera = camera_of(scene, job.camera)
        moving = turntable(camera, scene, job.frames) if job.turntable else lambda frame: camera
        self.camera_at: CameraAt = moving if job.path is None else job.path
        self.plays = job.plays(scene)
        self._duration = find_animation(scene, job.animation).duration if self.plays else 0.0

    @property
    def moves(self) -> bool:
        """Whether anything may differ between two frames."""
        return self.plays or self.job.turntable or self.job.path is not None

    def time_at(self, frame: int) -> float | None:
        """Return the seconds in the animation at a frame; None: the scene as it stands."""
        return looped(frame / self.job.fps, self._duration) if self.plays else self.job.time

    def shown_at(self, frame: int) -> dict[str, object]:
        """Return the metadata of a frame's time."""
        time = self.time_at(frame)
        return {} if time is None else {"time": time}

    def cameras(self) -> dict[int, dict[str, Any]]:
        """Return the pose and the lens of every frame, and its time, for use as the cameras of a data set."""
        pose, cameras = Pose(), {}
        for frame in self.job.frames:
            time = self.time_at(frame)
            _, camera = pose.at(self.scene, self.camera_at(frame), time, self.job.animation)
            cameras[frame] = {
                "world_from_view": camera.world_from_view.tolist(),
                "yfov": camera.yfov,
                "orthographic_height": camera.orthographic_height,
                **({} if time is None else {"time": time}),
            }
        return cameras
