"""`wgpu-gi render --frames`: renders a sequence, in shards on several machines; resumes a stopped run.

The animation of a scene plays: frame F shows the second F / fps, from the start again after the end. `--time` holds it.
A picture depends only on its command, not on what the process rendered before; in an animation up to rounding, since
meshes that have moved stay apart from those at rest.

Techniques with a temporal history render blocks of frames. Each block starts without history, with warm-up frames that
are not written.
"""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import GiError
from ..options import Settings
from ..pictures.exposure import exposure_text
from ..pictures.video import check_video, is_video, video_file
from ..renderer import Renderer
from ..rendering import read_pictures, with_alpha
from ..scene.files.camera_paths import CameraAt, load_camera_path, turntable
from ..scene.player import find_animation
from ..scene.pose import looped
from .common import checked_buffers, exposure_for, metadata_of, renderer_from, rendering
from .frame_files import FrameFiles, Pictures
from .messages import Messages, Report

# Frames per block, and warm-up frames before each block. The warm-up adds a quarter to the cost; 8 frames fill the
# average that the viewer uses.
BLOCK, WARM_UP = 32, 8
MOST_FPS = 1000

TimeAt = Callable[[int], float | None]  # seconds in the animation at a frame; None: the scene as it stands


@dataclass(frozen=True)
class Job:
    """The frames to render, with their cameras, times and buffers."""

    frames: range
    shard: tuple[int, int]  # (I, N), from 1
    camera_at: CameraAt
    time_at: TimeAt
    show: tuple[str, ...]
    exists: Callable[[int], bool]  # tells whether the files of a frame exist
    check: bool = False
    timings: bool = False
    denoise: bool = False

    def turn_to(self, renderer: Renderer, frame: int) -> None:
        """Set camera and time of a frame."""
        renderer.camera, renderer.time = self.camera_at(frame), self.time_at(frame)


def render_frames(arguments: Namespace, settings: Settings, shown: list[str], say: Messages) -> int:
    """Render the missing frames; return the exit code. Raises GiError for an error that the user can fix."""
    # Check the arguments before any slow step.
    layers = checked_buffers(arguments.layers.split(","), settings.gi) if arguments.layers else []
    _check(arguments, shown, settings)
    files = None if is_video(arguments.output) else FrameFiles(arguments.output, shown, layers, settings.transparent)
    path = None if arguments.camera_path is None else load_camera_path(arguments.camera_path)

    # Load the scene and list what to render.
    renderer = renderer_from(arguments, settings, say)
    renderer.moving = settings.camera.frames == 1  # pictures of more frames average jittered ones
    sequence = Job(
        frames=arguments.frames,
        shard=arguments.shard or (1, 1),
        camera_at=path or _without_path(arguments, renderer, say),
        time_at=_times(arguments, renderer),
        show=with_alpha((*shown, *layers), settings, arguments.denoise),
        exists=(lambda frame: False) if files is None else files.exist,
        check=arguments.check,
        timings=arguments.timings,
        denoise=arguments.denoise,
    )
    metadata = metadata_of(arguments, settings, renderer.adapter_name)
    if files is not None:
        files.claim(_command(arguments, shown, layers, metadata, renderer), _cameras(sequence, renderer))

    # The first frame sets the exposure of all frames.
    def measure() -> float | None:
        return _exposure(renderer, settings, sequence, arguments.output, shown[0], say)

    start = time.perf_counter()
    exposure = None
    if not all(map(sequence.exists, sequence.frames)):
        exposure = measure() if files is None else files.exposure(measure)
    if exposure is not None:
        metadata["exposure"] = exposure_text(exposure, settings.exposure is None)

    # Render and write.
    count = 0
    if files is None:
        with video_file(arguments.output, arguments.size, arguments.fps) as add:
            for _, pictures in _render(renderer, sequence, say):
                add(shown[0], pictures[shown[0]], exposure or 0.0)
                count += 1
    else:
        for frame, pictures in _render(renderer, sequence, say):
            shown_at = {} if renderer.time is None else {"time": renderer.time}
            files.add(frame, pictures, exposure, metadata | shown_at)
            count += 1

    # Print the reports and the result.
    if arguments.plan:
        print(renderer.plan())
    if arguments.timings:
        print(renderer.timings())
    told = f", exposure {metadata['exposure']}" if exposure is not None else ""
    size = "{}x{}".format(*arguments.size)
    seconds = time.perf_counter() - start
    say.result(f"{arguments.output}: {count} new frames of {size}{told}, {seconds:.1f} s on {renderer.adapter_name}")
    return 0


def _check(arguments: Namespace, shown: Sequence[str], settings: Settings) -> None:
    """Raise GiError for flags that do not go together, and for a rate out of range."""
    if not 1 <= arguments.fps <= MOST_FPS:
        raise GiError(f"--fps must lie between 1 and {MOST_FPS}, not {arguments.fps}")
    if arguments.camera_path is not None and (arguments.turntable or arguments.camera is not None):
        raise GiError("--camera-path gives the camera of every frame; leave out --turntable and --camera")
    if not is_video(arguments.output):
        return
    if arguments.shard or arguments.layers or len(shown) > 1:
        raise GiError(
            f"-o {arguments.output}: a video has one buffer, without --shard or --layers; write frames instead"
        )
    if settings.transparent:
        raise GiError(f"-o {arguments.output}: a video holds no transparency; write frames, as .png or .exr")
    check_video(arguments.output, arguments.size)


def _plays(arguments: Namespace, renderer: Renderer) -> bool:
    return bool(renderer.scene.animations) and arguments.time is None


def _times(arguments: Namespace, renderer: Renderer) -> TimeAt:
    """Return the time of each frame: that of the animation if it plays, else that of the arguments."""
    if not _plays(arguments, renderer):
        held = renderer.time
        return lambda frame: held
    duration = find_animation(renderer.scene, arguments.animation).duration
    return lambda frame: looped(frame / arguments.fps, duration)


def _without_path(arguments: Namespace, renderer: Renderer, say: Messages) -> CameraAt:
    if arguments.turntable:
        return turntable(renderer.camera, renderer.scene, arguments.frames)
    if not _plays(arguments, renderer):
        say.note("nothing moves, so all frames are the same; see --turntable and --camera-path")
    camera = renderer.camera
    return lambda frame: camera


def _command(
    arguments: Namespace, shown: Sequence[str], layers: Sequence[str], metadata: dict[str, object], renderer: Renderer
) -> dict[str, object]:
    """Return what must be equal in all shards; the adapter may differ."""
    frames = arguments.frames
    return {
        **{name: value for name, value in metadata.items() if name != "adapter"},
        "size": list(arguments.size),
        "frames": [frames.start, frames.stop, frames.step],
        "exposure": "automatic" if arguments.exposure is None else arguments.exposure,
        "show": list(shown),
        "layers": list(layers),
        **({"fps": arguments.fps} if _plays(arguments, renderer) else {}),
    }


def _cameras(sequence: Job, renderer: Renderer) -> dict[int, dict[str, object]]:
    """Return the pose and the lens of every frame, and its time, for use as the cameras of a data set."""
    cameras: dict[int, dict[str, object]] = {}
    for frame in sequence.frames:
        sequence.turn_to(renderer, frame)
        camera = renderer.posed_camera
        cameras[frame] = {
            "world_from_view": camera.world_from_view.tolist(),
            "yfov": camera.yfov,
            "orthographic_height": camera.orthographic_height,
            **({} if renderer.time is None else {"time": renderer.time}),
        }
    return cameras


def _exposure(
    renderer: Renderer, settings: Settings, sequence: Job, output: str, name: str, say: Messages
) -> float | None:
    """Return the exposure of all frames, None if the file has none. Automatic exposure renders the first frame."""
    given = exposure_for(output, settings, name, [[0.0]])
    if given is None or settings.exposure is not None:
        return given
    sequence.turn_to(renderer, sequence.frames[0])
    with rendering(renderer, say, "exposure of the first frame") as report:
        renderer.run(report, show=sequence.show)
    return exposure_for(output, settings, name, read_pictures(renderer, (name,), settings, sequence.denoise)[name])


def _render(renderer: Renderer, sequence: Job, say: Messages) -> Iterator[tuple[int, Pictures]]:
    """Yield number and pictures of the frames of this shard that do not exist yet."""
    frames, exists = sequence.frames, sequence.exists
    if all(map(exists, frames)):
        return
    with rendering(renderer, say) as report:
        # `has_history` is known once a frame is declared. `motion` also depends on the previous frame.
        sequence.turn_to(renderer, frames[0])
        renderer.step(show=sequence.show)
        has_history = renderer.has_history or "motion" in sequence.show
        blocks = list(_blocks(frames, sequence.shard, BLOCK if has_history else 1))
        needed = [block for block in blocks if not all(map(exists, block))]
        runs = [_with_warm_up(frames, block, exists) if has_history else (block[0],) for block in needed]
        total, done = sum(map(len, runs)), 0
        for block, run in zip(needed, runs, strict=True):
            if has_history:
                renderer.forget()
            for frame in run:
                sequence.turn_to(renderer, frame)
                pictures = _pictures(renderer, sequence, _part_of(report, done, total))
                done += 1
                if frame in block and not exists(frame):
                    yield frame, pictures


def _blocks(frames: range, shard: tuple[int, int], length: int) -> Iterator[range]:
    """Yield the blocks of `frames` that belong to one shard."""
    index, count = shard
    for start in range((index - 1) * length, len(frames), count * length):
        yield frames[start : start + length]


def _with_warm_up(frames: range, block: range, exists: Callable[[int], bool]) -> tuple[int, ...]:
    """Return the frames to render for a block: from its first warm-up frame to its last missing frame."""
    start = frames.index(block[0])
    end = start + max(i for i, frame in enumerate(block) if not exists(frame))
    return tuple(frames[max(start - WARM_UP, 0) : end + 1])


def _pictures(renderer: Renderer, sequence: Job, report: Report) -> Pictures:
    """Render a frame and return its buffers."""
    show = sequence.show
    options: dict[str, Any] = {"show": show, "check": sequence.check, "timings": sequence.timings}
    pictures: Pictures = {}
    if "motion" in show and not renderer.moving:
        # Only the first step has motion: nothing changes in the later steps.
        renderer.step(**options)
        pictures["motion"] = renderer.read_back("motion")
    renderer.run(report, **options)
    return {**read_pictures(renderer, show, renderer.settings, sequence.denoise), **pictures}


def _part_of(report: Report, done: int, total: int) -> Report:
    """Return a report for one frame, after `done` of `total`, that converts its fraction to that of all frames."""

    def part(fraction: float, what: str | None = None) -> None:
        report((done + fraction) / total, what or f"frame {done + 1} of {total}")

    return part
