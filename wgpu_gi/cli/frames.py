"""`wgpu-gi render --frames`: a sequence of pictures, in parts on several machines, going on where it was stopped.

A picture depends on its command alone, not on what the same process rendered before it. Where a technique has a memory
of earlier frames, blocks of frames begin with an empty one and first render some frames that are not kept.
"""

from __future__ import annotations

import json
import re
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ..errors import GiError
from ..options import Settings
from ..pictures.atomic_file import atomic_file
from ..pictures.image import check_output, save_image
from ..pictures.video import check_video, is_video, video_file
from ..renderer import Renderer
from ..scene.files.camera_paths import CameraAt, load_camera_path, turntable
from .common import buffers_from, metadata_of, progress_bar, renderer_from

BLOCK = 32  # frames that are rendered in a row where there is a memory: chosen
WARM_UP = 8  # frames before them, to fill it: chosen
REPORT_SECONDS = 30.0  # from line to line of progress where no person watches: chosen

_NUMBER = re.compile(r"\{frame(?::(0?\d{0,2})d?)?\}")

Pictures = dict[str, NDArray]


class FrameFiles:
    """The files of a sequence: a picture for each frame, its layers beside it, and what made them."""

    def __init__(self, arguments: Namespace, shown: Sequence[str], layers: Sequence[str]) -> None:
        """Make the folder. Raises GiError for names that cannot be."""
        self.output, self.shown, self.layers = arguments.output, list(shown), list(layers)
        if len(_NUMBER.findall(Path(self.output).name)) != 1 or _NUMBER.search(str(Path(self.output).parent)):
            raise GiError(f"-o {self.output}: the names of frames hold {{frame}} once, such as f_{{frame:04d}}.exr")
        if layers and Path(self.output).suffix.lower() == ".npz":
            raise GiError(f"-o {self.output}: --layers writes .npz files of the same name; use --show here instead")
        try:
            Path(self.output).parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise GiError(f"-o {self.output}: its folder cannot be made ({error.strerror or error})") from None
        check_output(self._name(0), shown)

    def _name(self, frame: int) -> Path:
        return Path(_NUMBER.sub(lambda match: format(frame, f"{match[1] or ''}d"), self.output))

    def is_there(self, frame: int) -> bool:
        """Tell whether all files of a frame exist."""
        name = self._name(frame)
        return name.exists() and (not self.layers or name.with_suffix(".npz").exists())

    def add(self, frame: int, pictures: Pictures, exposure: float, metadata: dict[str, object]) -> None:
        """Write the files of a frame."""
        name = self._name(frame)
        if self.layers:
            save_image(name.with_suffix(".npz"), {layer: pictures[layer] for layer in self.layers})
        shown = {layer: pictures[layer] for layer in self.shown}
        save_image(name, shown, exposure=exposure, metadata={**metadata, "frame": frame})

    def claim(self, command: dict[str, object], cameras: dict[int, dict[str, object]]) -> None:
        """Write what makes the frames. Raises GiError if those that are there were made by anything else."""
        job = Path(_NUMBER.sub("job", self.output)).with_suffix(".json")
        text = json.dumps({"command": command, "cameras": cameras}, indent=1)
        if job.exists():
            try:
                before = json.loads(job.read_text(encoding="utf-8"))
                there, now = (what["command"] | {"cameras": what["cameras"]} for what in (before, json.loads(text)))
            except (OSError, ValueError, TypeError, KeyError):
                raise GiError(f"{job}: not a record of frames; move it away, or give -o another name") from None
            differing = sorted(name for name in there | now if there.get(name) != now.get(name))
            if differing:
                raise GiError(
                    f"{job}: the frames there were made by another command ({', '.join(differing)} differ);"
                    " give -o another name, or delete the frames with that file"
                )
        else:
            with atomic_file(job) as temporary:
                temporary.write_text(text, encoding="utf-8")


def render_frames(arguments: Namespace, settings: Settings, shown: list[str]) -> int:
    """Render the frames that are not there yet; return the exit code. Raises GiError for what a user can put right."""
    layers = buffers_from(Namespace(show=arguments.layers.split(",")), settings) if arguments.layers else []
    _check(arguments, shown)
    files = None if is_video(arguments.output) else FrameFiles(arguments, shown, layers)
    path = None if arguments.camera_path is None else load_camera_path(arguments.camera_path)
    renderer = renderer_from(arguments, settings)
    camera_at = path or _without_path(arguments, renderer)
    metadata = metadata_of(arguments, settings, renderer.adapter_name)
    show = tuple(dict.fromkeys((*shown, *layers)))

    start = time.perf_counter()
    count = 0
    if files is None:
        with video_file(arguments.output, arguments.size, arguments.fps) as add:
            for _, pictures in _render(renderer, arguments, camera_at, show, lambda frame: False):
                add(shown[0], pictures[shown[0]], settings.exposure)
                count += 1
    else:
        files.claim(_command(arguments, shown, layers, metadata), _cameras(arguments, camera_at))
        for frame, pictures in _render(renderer, arguments, camera_at, show, files.is_there):
            files.add(frame, pictures, settings.exposure, metadata)
            count += 1
    if arguments.plan:
        print(renderer.plan())
    if arguments.timings:
        print(renderer.timings())
    width, height = arguments.size
    seconds = time.perf_counter() - start
    print(f"{arguments.output}: {count} new frames of {width}x{height}, {seconds:.1f} s on {renderer.adapter_name}")
    return 0


def _check(arguments: Namespace, shown: Sequence[str]) -> None:
    """Raise GiError for flags that do not go together."""
    if arguments.camera_path is not None and (arguments.turntable or arguments.camera is not None):
        raise GiError("--camera-path gives the camera of every frame; leave out --turntable and --camera")
    if not is_video(arguments.output):
        return
    if arguments.shard or arguments.layers or len(shown) > 1:
        raise GiError(f"-o {arguments.output}: a video is made in one go, of one buffer; for more write frames first")
    check_video(arguments.output, arguments.size, arguments.fps)


def _without_path(arguments: Namespace, renderer: Renderer) -> CameraAt:
    if arguments.turntable:
        return turntable(renderer.camera, renderer.scene, arguments.frames)
    print("note: nothing moves, so all frames are the same; see --turntable and --camera-path", file=sys.stderr)
    camera = renderer.camera
    return lambda frame: camera


def _command(
    arguments: Namespace, shown: Sequence[str], layers: Sequence[str], metadata: dict[str, object]
) -> dict[str, object]:
    """Return what must not change from part to part; the adapter may."""
    frames = arguments.frames
    return {
        **{name: value for name, value in metadata.items() if name != "adapter"},
        "size": list(arguments.size),
        "frames": [frames.start, frames.stop, frames.step],
        "exposure": arguments.exposure,
        "show": list(shown),
        "layers": list(layers),
    }


def _cameras(arguments: Namespace, camera_at: CameraAt) -> dict[int, dict[str, object]]:
    """Return pose and lens of every frame, as cameras of a data set need them."""
    cameras = {}
    for frame in arguments.frames:
        camera = camera_at(frame)
        cameras[frame] = {
            "world_from_view": camera.world_from_view.tolist(),
            "yfov": camera.yfov,
            "orthographic_height": camera.orthographic_height,
        }
    return cameras


def _render(
    renderer: Renderer,
    arguments: Namespace,
    camera_at: CameraAt,
    show: tuple[str, ...],
    is_there: Callable[[int], bool],
) -> Iterator[tuple[int, Pictures]]:
    """Yield the frames of this shard that are not there yet, rendered."""
    if all(map(is_there, arguments.frames)):
        return
    # Only a declared frame tells whether it has a memory; of the frame before, motion is one.
    renderer.camera = camera_at(arguments.frames[0])
    renderer.step(show=show)
    has_memory = renderer.has_history or "motion" in show
    blocks = list(_blocks(arguments.frames, arguments.shard or (1, 1), BLOCK if has_memory else 1))
    needed = [block for block in blocks if not all(map(is_there, block))]
    rows = [_row(arguments.frames, block, is_there) if has_memory else (block[0],) for block in needed]
    with _progress(sum(map(len, rows))) as report:
        for block, row in zip(needed, rows, strict=True):
            if has_memory:
                renderer.forget()
            for frame in row:
                renderer.camera = camera_at(frame)
                pictures = _picture(renderer, arguments, show, report)
                report.frames += 1
                if frame in block and not is_there(frame):
                    yield frame, pictures


def _blocks(frames: range, shard: tuple[int, int], length: int) -> Iterator[range]:
    """Yield the blocks of `frames` that are one shard's."""
    index, count = shard
    for start in range((index - 1) * length, len(frames), count * length):
        yield frames[start : start + length]


def _row(frames: range, block: range, is_there: Callable[[int], bool]) -> tuple[int, ...]:
    """Return what must be rendered for the frames of a block that are missing: from its warm-up to the last of them."""
    start = frames.index(block[0])
    end = start + max(i for i, frame in enumerate(block) if not is_there(frame))
    return tuple(frames[max(start - WARM_UP, 0) : end + 1])


def _picture(renderer: Renderer, arguments: Namespace, show: tuple[str, ...], progress: _Progress) -> Pictures:
    """Render a frame and return its buffers."""
    options: dict[str, Any] = {"show": show, "check": arguments.check, "timings": arguments.timings}
    pictures: Pictures = {}
    if "motion" in show:
        # From the second step on, nothing has moved since the one before.
        renderer.step(**options)
        pictures["motion"] = renderer.read_back("motion")
    renderer.run(progress, **options)
    return {**{name: renderer.read_back(name) for name in show}, **pictures}


class _Progress:
    """What is told of the work: a bar to a person, else a line now and then."""

    def __init__(self, bar: Callable[[float], None] | None, total: int) -> None:
        self.frames = 0  # that are rendered
        self._bar, self._total = bar, total
        self._start = self._last = time.monotonic()

    def __call__(self, part: float) -> None:
        """Note how much of the present frame is done, 0 to 1."""
        done, now = self.frames + part, time.monotonic()
        if self._bar is not None:
            self._bar(done / self._total)
        elif now - self._last > REPORT_SECONDS and done > 0:
            self._last = now
            left = (now - self._start) * (self._total - done) / done
            print(f"{self.frames} of {self._total} frames, about {left:.0f} s left", file=sys.stderr, flush=True)


@contextmanager
def _progress(total: int) -> Iterator[_Progress]:
    with progress_bar() as bar:
        yield _Progress(bar, total)
