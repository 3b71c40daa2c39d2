"""Render for a long time and show that memory and time stay flat.

python tools/long_run.py [--gi TECHNIQUE ...] [--frames N] [--minutes M] [--loads N] [--resizes N]
    [--quality PRESET] [--json FILE]

Each technique has a process of its own and three parts: scene loads; resizes; frames in which camera, lights and
objects move. Every frame is read back. The tool samples the resident memory of the process (RSS), the bytes of all wgpu
buffers and textures, the number of wgpu objects and of Python blocks, and the processor time per frame. It prints the
growth per frame with its 95 % confidence interval, and the time at the end over the time at the start. The exit code is
1 if the growth of memory is certainly above 1 KB per frame.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from statistics import median

import numpy as np
import wgpu
from numpy.typing import NDArray

import wgpu_gi as gi
from wgpu_gi.options import TECHNIQUES
from wgpu_gi.pictures.atomic_file import atomic_file
from wgpu_gi.settings import apply_quality, assign

SIZE = (64, 36)
SHOW = ("display",)
SAMPLES = 80  # of each part
WARM_UP = 0.25  # share of a part before its fits begin: caches and the allocator's heaps fill until then
BLOCKS = 20  # a fit takes the medians of blocks of samples, since neighbours are correlated
STUDENT = 2.101  # 97.5th percentile of Student's t with BLOCKS - 2 degrees of freedom
PERIOD = 240  # frames until the motion repeats
OBJECTS = 8  # objects move in each eighth frame: the rebuilt hierarchy would take most of the time
MOST_GROWTH = 1024.0  # bytes per frame
# Memory leaks by objects and passes, not by texels: small maps show it in less time.
SMALL = (
    *("shadow.atlas=512", "shadow.sun=64", "shadow.spot=32", "shadow.point=16", "shadow.area=16", "direct.samples=2"),
    *("rsm.texels=1024", "vpl.count=64", "vpl.paths=256", "ism.resolution=16", "voxels.slices=64", "temporal.frames=8"),
)
FILES = ("cornell/cornell_area.glb", "cornell/cornell_point.glb", "leak_corridor/leak_corridor.glb")
COLUMNS = ("frame", "rss", "gpu_bytes", "gpu_objects", "python_blocks", "cpu_ms")


@dataclass
class Part:
    """The samples of frames, loads or resizes; a sample has the values of `COLUMNS`."""

    name: str
    samples: list[tuple[float, ...]] = field(default_factory=list)
    seconds: float = 0.0

    def column(self, name: str) -> NDArray[np.float64]:
        """Return one value of all samples after the warm-up."""
        index = COLUMNS.index(name)
        return np.array([s[index] for s in self.samples[int(len(self.samples) * WARM_UP) :]])

    def growth(self, name: str) -> tuple[float, float]:
        """Return the growth per frame and half the width of its 95 % confidence interval."""
        return slope(self.column("frame"), self.column(name))

    def slowdown(self) -> float:
        """Return the median time of the last fifth over that of the first fifth."""
        times = self.column("cpu_ms")
        length = max(len(times) // 5, 1)
        return float(np.median(times[-length:]) / np.median(times[:length]))


def slope(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float]:
    """Return the slope of a straight line through block medians, and half the width of its 95 % interval."""
    blocks = min(BLOCKS, len(x))
    if blocks < 3:
        return 0.0, float("inf")
    a = np.array([median(part) for part in np.array_split(x, blocks)])
    b = np.array([median(part) for part in np.array_split(y, blocks)])
    a, b = a - a.mean(), b - b.mean()
    fit = float(a @ b / (a @ a))
    rest = b - fit * a
    return fit, STUDENT * float(np.sqrt(rest @ rest / (blocks - 2) / (a @ a)))


def resident() -> int:
    """Return the resident memory of this process in bytes; 0 where the system does not tell."""
    try:
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0


def measured(frame: int, cpu_ms: float) -> tuple[float, ...]:
    """Return a sample: the values of `COLUMNS`."""
    gc.collect()  # empties Python's lists of free blocks, too
    total = wgpu.diagnostics.object_counts.get_dict()["total"]
    return frame, resident(), total["resource_mem"], total["count"], sys.getallocatedblocks(), cpu_ms


def run(name: str, number: int, step: Callable[[int], None], minutes: float = np.inf) -> Part:
    """Call `step` with 0, 1, ... and sample at intervals, for `number` calls or `minutes`."""
    part, started = Part(name), time.perf_counter()
    interval = max(number // SAMPLES, 1)
    for first in range(0, number, interval):
        if time.perf_counter() - started > minutes * 60:
            break
        before = time.process_time()
        for frame in range(first, min(first + interval, number)):
            step(frame)
        frames = min(interval, number - first)
        part.samples.append(measured(first + frames, (time.process_time() - before) * 1e3 / frames))
    part.seconds = time.perf_counter() - started
    return part


class Moving:
    """A room with a lamp, a point light, a spot, a sun and a sky, whose camera, lights and objects move."""

    def __init__(self) -> None:
        self.scene = gi.load("cornell")
        self.scene.lights = [
            gi.PointLight((2.0, 3.0, 2.0), 8.0),
            gi.SpotLight((4.0, 5.0, 1.0), (0, -1, 0.3), intensity=30.0),
            gi.DirectionalLight((0.2, -0.5, 1.0), 0.5),
        ]
        self.scene.environment = gi.Environment((0.3, 0.4, 0.5))

    def at(self, frame: int) -> gi.Camera:
        """Move everything to its place in a frame; return the camera."""
        s, c = np.sin(2 * np.pi * frame / PERIOD), np.cos(2 * np.pi * frame / PERIOD)
        point, spot, sun = self.scene.lights
        point.position = (2.8 + 1.5 * c, 3.0, 2.8 + 1.5 * s)  # type: ignore[union-attr]
        point.intensity = 8.0 + 4.0 * s
        spot.direction = (0.5 * s, -1.0, 0.5 * c)  # type: ignore[union-attr]
        sun.direction = (0.2 * c, -0.5, 1.0)  # type: ignore[union-attr]
        if frame % OBJECTS == 0:
            for name, axis, shift in (("smallbox", 0, s), ("largebox", 2, c), ("luminaire", 0, s)):
                moved = next(i for i in self.scene.instances if i.name == name)
                moved.world_from_local = np.eye(4)
                moved.world_from_local[axis, 3] = 0.3 * shift
        return gi.Camera.look_at((2.78 + s, 2.73, -2.6 + 0.5 * c), (2.78, 2.73, 2.0), yfov_deg=60)


def show(renderer: gi.Renderer) -> None:
    """Render one frame and read it back."""
    renderer.step(show=SHOW)
    renderer.read_back("display")


def settings_of(options: argparse.Namespace) -> gi.Settings:
    """Return the settings of all frames: a preset, or small maps; the path tracer takes one sample."""
    settings = gi.Settings(gi=options.gi[0], spp=1, exposure=0.0)
    apply_quality(settings, options.quality or "low")
    for text in () if options.quality else SMALL:
        assign(settings, text)
    settings.path.samples_per_run = 1
    return settings


def frames(settings: gi.Settings, number: int, minutes: float = np.inf) -> Part:
    """Render moving frames, for `minutes` at most."""
    moving = Moving()
    renderer = gi.Renderer(moving.scene, size=SIZE, camera=moving.at(0), settings=settings)

    def step(frame: int) -> None:
        renderer.camera = moving.at(frame)
        show(renderer)

    return run("frames", number, step, minutes)


def loads(settings: gi.Settings, number: int) -> Part:
    """Load files in turn, into a renderer that is itself replaced at every fourth load."""
    folder = Path(__file__).resolve().parent.parent / "scenes"
    renderer = gi.Renderer(gi.load(folder / FILES[0]), size=SIZE, settings=settings)

    def step(load: int) -> None:
        nonlocal renderer
        scene = gi.load(folder / FILES[load % len(FILES)])
        if load % 4:
            renderer.scene, renderer.camera = scene, scene.cameras[0]
        else:
            renderer = gi.Renderer(scene, size=SIZE, settings=settings)
        show(renderer)

    return run("loads", number, step)


def resizes(settings: gi.Settings, number: int) -> Part:
    """Change the size of the picture in each frame."""
    renderer = gi.Renderer(Moving().scene, size=SIZE, settings=settings)
    random = np.random.default_rng(1)

    def step(_: int) -> None:
        renderer.size = (int(random.integers(16, 128)), int(random.integers(16, 72)))
        show(renderer)

    return run("resizes", number, step)


def measure(options: argparse.Namespace) -> list[Part]:
    """Run all parts of one technique in this process."""
    parts = []
    if options.loads:
        parts.append(loads(settings_of(options), options.loads))
    if options.resizes:
        parts.append(resizes(settings_of(options), options.resizes))
    if options.frames:
        parts.append(frames(settings_of(options), options.frames, options.minutes))
    return parts


def measure_apart(options: argparse.Namespace, technique: str) -> list[Part]:
    """Run all parts of one technique in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "parts.json"
        command = [sys.executable, __file__, "--gi", technique, "--json", str(file)]
        for name in ("frames", "minutes", "loads", "resizes"):
            command += [f"--{name}", str(getattr(options, name))]
        if options.quality:
            command += ["--quality", options.quality]
        subprocess.run(command, stdout=subprocess.DEVNULL)
        return [Part(**part) for part in json.loads(file.read_text())[technique]]


def told(technique: str, part: Part) -> tuple[str, bool]:
    """Return a line of the table, and whether the part's memory is flat."""
    cells, flat = [], True
    for name in ("rss", "gpu_bytes", "gpu_objects", "python_blocks"):
        growth, half = part.growth(name)
        cells.append(f"{growth:+.3g} ± {half:.2g}")
        flat &= not name.endswith(("rss", "bytes")) or growth - half < MOST_GROWTH
    number, last = int(part.samples[-1][0]), part.samples[-1]
    memory = f"{last[1] / 2**20:.0f}, {last[2] / 2**20:.1f}"
    times = f"{part.slowdown():.3f}", f"{np.median(part.column('cpu_ms')):.1f}"
    return " | ".join(["", technique, f"{number} {part.name}", *cells, memory, *times, ""]).strip(), flat


def main() -> int:
    """Measure and print; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--gi", nargs="+", default=list(TECHNIQUES), choices=TECHNIQUES, metavar="TECHNIQUE")
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--minutes", type=float, default=np.inf, help="end the frames after so long")
    parser.add_argument("--loads", type=int, default=500)
    parser.add_argument("--resizes", type=int, default=500)
    parser.add_argument("--quality", choices=("low", "medium", "high"), help="a preset instead of small maps")
    parser.add_argument("--json", help="file for all samples")
    options = parser.parse_args()
    alone = len(options.gi) == 1
    print("| technique | run | RSS, B | GPU, B | GPU objects | Python blocks | RSS, GPU, MiB | time ratio | ms |")
    print("|---|---|---|---|---|---|---|---|---|")
    found, good = {}, True
    for technique in options.gi:
        found[technique] = measure(options) if alone else measure_apart(options, technique)
        for part in found[technique]:
            line, flat = told(technique, part)
            good &= flat
            print(line, flush=True)
    if options.json is not None:
        with atomic_file(options.json) as file:
            file.write_text(json.dumps({name: [asdict(p) for p in parts] for name, parts in found.items()}))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
