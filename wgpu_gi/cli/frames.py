"""`wgpu-gi render --frames`: renders a sequence, in shards on several machines; resumes a stopped run.

`sequence` says what a frame shows, and which frames are rendered together.
"""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence

from ..camera import Camera
from ..errors import GiError
from ..options import Settings
from ..pictures.exposure import exposure_text
from ..pictures.video import check_video, is_video, video_file
from ..scene.files.camera_paths import load_camera_path
from ..scene.scene import Scene
from ..sequence.blocks import block_count, block_of
from ..sequence.claims import Claim, Claims, wait_for
from ..sequence.files import FrameFiles, Pictures
from ..sequence.job import Job, Timeline, index_or_camera
from ..sequence.render import JobRenderer, part_of
from ..sequence.shards import ALL, Shards
from .common import checked_buffers, metadata_of, noted_scene, rendering, source_of, time_of, warn_of_cpu
from .messages import Messages

FPS, MOST_FPS = 24, 1000
CLAIM_SECONDS = 5.0  # of work that a command claims at once


def render_frames(arguments: Namespace, settings: Settings, shown: list[str], say: Messages) -> int:
    """Render the missing frames; return the exit code. Raises GiError for an error that the user can fix."""
    # Check the arguments before any slow step.
    layers = layers_of(arguments, settings)
    check_sequence(arguments, shown, settings)
    files = None if is_video(arguments.output) else FrameFiles(arguments.output, shown, layers, settings.transparent)
    if files is not None:
        files.make_folder()
    make_job = job_maker(arguments, settings, shown, layers)

    # Load the scene and list what to render.
    scene, camera = noted_scene(arguments, settings, say)
    job = make_job(scene, camera)
    timeline = Timeline(job, scene)
    if not timeline.moves:
        say.note("nothing moves, so all frames are the same; see --turntable and --camera-path")
    renderer = job.renderer(scene)
    warn_of_cpu(renderer.adapter_name, renderer.is_cpu, say)
    sequence = JobRenderer(job, renderer, timeline)
    metadata = metadata_of(arguments, settings, renderer.adapter_name)
    if files is not None:
        files.claim(command_of(arguments, job, metadata, timeline), timeline.cameras())

    # The first frame sets the exposure of all frames.
    def measure() -> float | None:
        with rendering(renderer, say, "exposure of the first frame") as report:
            return sequence.exposure(arguments.output, report)

    exists = (lambda frame: False) if files is None else files.exist
    start = time.perf_counter()
    exposure = None
    if not all(map(exists, job.frames)):
        exposure = measure() if files is None else files.exposure(measure)
    if exposure is not None:
        metadata["exposure"] = exposure_text(exposure, settings.exposure is None)

    # Render and write.
    count = 0
    shards = arguments.shard or ALL
    if files is None:
        with video_file(arguments.output, arguments.size, fps_of(arguments)) as add:
            for _, pictures in _render(sequence, shards, exists, None, say):
                add(shown[0], pictures[shown[0]], exposure or 0.0)
                count += 1
    else:
        with Claims(files.job_file) as claims:
            for frame, pictures in _render(sequence, shards, exists, claims, say):
                files.add(frame, pictures, exposure, metadata | timeline.shown_at(frame))
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


def layers_of(arguments: Namespace, settings: Settings) -> list[str]:
    """Return the buffers of --layers. Raises GiError for one that the technique lacks."""
    return checked_buffers(arguments.layers.split(","), settings.gi) if arguments.layers else []


def fps_of(arguments: Namespace) -> int:
    """Return the frames per second of the animation and of a video."""
    return FPS if arguments.fps is None else int(arguments.fps)


def check_sequence(arguments: Namespace, shown: Sequence[str], settings: Settings) -> None:
    """Raise GiError for flags that do not go together, and for a rate out of range."""
    if not 1 <= fps_of(arguments) <= MOST_FPS:
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


def job_maker(
    arguments: Namespace, settings: Settings, shown: Sequence[str], layers: Sequence[str]
) -> Callable[[Scene, Camera], Job]:
    """Read the camera path of the arguments; return a function that makes the job of the loaded scene and its camera.

    Raises GiError for a wrong camera path.
    """
    path = None if arguments.camera_path is None else load_camera_path(arguments.camera_path)

    def make(scene: Scene, camera: Camera) -> Job:
        return Job(
            source=source_of(arguments, arguments.scene),
            camera=index_or_camera(scene, camera),
            settings=settings,
            size=arguments.size,
            frames=arguments.frames,
            shown=tuple(shown),
            layers=tuple(layers),
            time=time_of(arguments, arguments.scene, scene),
            animation=arguments.animation,
            fps=fps_of(arguments),
            path=path,
            turntable=arguments.turntable,
            adapter=arguments.adapter,
            denoise=arguments.denoise,
            check=arguments.check,
            timings=arguments.timings,
        )

    return make


def command_of(arguments: Namespace, job: Job, metadata: dict[str, object], timeline: Timeline) -> dict[str, object]:
    """Return what must be equal in all runs that share the frames; the adapter may differ."""
    return {
        **{name: value for name, value in metadata.items() if name != "adapter"},
        "size": list(job.size),
        "frames": [job.frames.start, job.frames.stop, job.frames.step],
        "exposure": "automatic" if arguments.exposure is None else arguments.exposure,
        "show": list(job.shown),
        "layers": list(job.layers),
        **({"fps": job.fps} if timeline.plays else {}),
    }


def _render(
    sequence: JobRenderer, shards: Shards, exists: Callable[[int], bool], claims: Claims | None, say: Messages
) -> Iterator[tuple[int, Pictures]]:
    """Yield number and pictures of the frames of these shards that do not exist yet; others may render some of them."""
    frames = sequence.job.frames
    if all(map(exists, frames)):
        return
    with rendering(sequence.renderer, say) as report:
        has_history = sequence.has_history()

        def block(number: int) -> range:
            return block_of(frames, has_history, number)

        def is_done(number: int) -> bool:
            return all(map(exists, block(number)))

        numbers = shards.numbers(block_count(frames, has_history))
        counts = {number: sequence.frames_to_render(block(number), has_history, exists) for number in numbers}
        missing = [number for number, count in counts.items() if count]
        total, done = sum(counts.values()), 0
        for number in missing if claims is None else _shared(missing, is_done, claims, say):
            yield from sequence.render(block(number), has_history, exists, part_of(report, done, total))
            done += counts[number]


def _shared(missing: list[int], is_done: Callable[[int], bool], claims: Claims, say: Messages) -> Iterator[int]:
    """Yield blocks to render, shared with other commands that render the same; end when all are done."""
    # Claim so many at once that the claims cost little, but so few that others get their share.
    taken, length, start = 0, 1, time.perf_counter()
    while taken < len(missing):
        batch = missing[taken : taken + length]
        taken += length
        for number in claims.take(batch):
            yield number
            claims.drop([number])
        length = max(1, round(taken * CLAIM_SECONDS / max(time.perf_counter() - start, 1e-3)))
    # Wait for the others, and take over what they leave.
    told = False

    def tell(others: list[Claim], count: int) -> None:
        nonlocal told
        if not told:
            say.note(f"waiting for {' and '.join(map(str, others))} to render the last {count} blocks of frames")
        told = True

    while free := wait_for(claims, missing, is_done, tell):
        yield from free
        claims.drop(free)
