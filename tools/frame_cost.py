"""Measure the main thread's time per frame, without the GPU's work, and find what compiles pipelines.

python tools/frame_cost.py [TECHNIQUE ...] [--settings]

Milliseconds are processor time of the main thread alone (`time.thread_time`), medians on the built-in Cornell box at
64x36. The threads of a driver that renders on the CPU do not count; each step begins when they have finished the
previous one. `--settings` changes each number among the settings, one at a time, and lists those that compile
pipelines.
"""

from __future__ import annotations

import argparse
import builtins
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from statistics import median
from typing import Any

import numpy as np
import wgpu

import wgpu_gi as gi
from wgpu_gi.gpu.graph import Graph
from wgpu_gi.settings import Row, describe

TECHNIQUES = ("none", "many-light", "ssil", "ssdo")
SIZE = (64, 36)
STEPS = 31  # measured steps; the result is their median
SHOW = ("display",)
# wgpu's objects whose counts must not grow with the number of changes.
COUNTED = ("ComputePipeline", "RenderPipeline", "ShaderModule")


class Compiled:
    """Records the pipelines that a device creates, by the name of their pass."""

    def __init__(self, gpu: Any) -> None:
        self.names: list[str] = []
        for kind in ("create_compute_pipeline", "create_render_pipeline"):
            setattr(gpu, kind, self._counting(getattr(gpu, kind)))

    def _counting(self, create: Callable[..., Any]) -> Callable[..., Any]:
        def counted(**made_with: Any) -> Any:
            self.names.append(made_with["label"])
            return create(**made_with)

        return counted

    def take(self) -> list[str]:
        """Return the passes whose pipelines were compiled since the last call."""
        taken, self.names = self.names, []
        return taken


@contextmanager
def file_calls() -> Iterator[list[str]]:
    """Collect the paths that are opened, listed or queried during the block."""
    calls: list[str] = []

    def noting(function: Callable[..., Any]) -> Callable[..., Any]:
        def noted(path: Any = ".", *more: Any, **named: Any) -> Any:
            calls.append(str(path))
            return function(path, *more, **named)

        return noted

    # `pathlib` and `os.path` call these by their names in `os`.
    patched = [(os, name) for name in ("stat", "lstat", "open", "listdir", "scandir")] + [(builtins, "open")]
    originals = [(owner, name, getattr(owner, name)) for owner, name in patched]
    try:
        for owner, name, function in originals:
            setattr(owner, name, noting(function))
        yield calls
    finally:
        for owner, name, function in originals:
            setattr(owner, name, function)


class Stopwatch:
    """Processor time of the main thread between `Graph.begin` and the end of `Graph.compile`, milliseconds."""

    def __init__(self) -> None:
        self.declared: list[float] = []
        self._started = 0.0
        self._begin, self._compile = Graph.begin, Graph.compile
        Graph.begin = lambda graph, *arguments: self.begin(graph, *arguments)  # type: ignore[method-assign]
        Graph.compile = lambda graph, *arguments: self.compile(graph, *arguments)  # type: ignore[method-assign]

    def begin(self, graph: Graph, *arguments: Any) -> None:
        """Start the watch, then call `Graph.begin`."""
        self._started = time.thread_time()
        self._begin(graph, *arguments)

    def compile(self, graph: Graph, *arguments: Any) -> None:
        """Call `Graph.compile`, then record the time."""
        self._compile(graph, *arguments)
        self.declared.append((time.thread_time() - self._started) * 1e3)


def milliseconds(device: Any, step: Callable[[], Any]) -> float:
    """Return the main thread's processor time for a call that begins with an idle GPU."""
    device.wait()
    started = time.thread_time()
    step()
    return (time.thread_time() - started) * 1e3


def measure(scene: Any, technique: str, watch: Stopwatch) -> dict[str, Any]:
    """Return the costs of one technique by action."""
    settings = gi.Settings()
    settings.gi, settings.exposure = technique, 0.0
    renderer = gi.Renderer(scene, size=SIZE, settings=settings)
    device, rest = renderer._device, renderer.camera
    compiled = Compiled(device.gpu)

    def step() -> None:
        renderer.step(show=SHOW)

    def brighten() -> None:
        settings.exposure = (settings.exposure or 0.0) + 0.01
        step()

    def move(number: int) -> None:
        angle = 0.3 * np.sin(0.2 * number)
        turn = np.eye(4)
        turn[0, 0], turn[0, 2], turn[2, 0], turn[2, 2] = np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)
        renderer.camera = gi.Camera(turn @ np.asarray(rest.world_from_view), rest.yfov)
        step()

    # A finished picture, then another exposure: only the display is new.
    renderer.run(show=SHOW)
    found: dict[str, Any] = {"compiled at first": len(compiled.take())}
    brighten()
    watch.declared.clear()
    found["exposure: step, ms"] = median(milliseconds(device, brighten) for _ in range(STEPS))
    found["exposure: declare and compile, ms"] = median(watch.declared)
    with file_calls() as calls:
        brighten()
    found["exposure: file calls"] = len(calls)

    # A moving camera: all that depends on the view runs in each frame.
    for number in range(4):
        move(number)
    found["moving: step, ms"] = median(milliseconds(device, partial(move, 4 + n)) for n in range(STEPS))
    found["moving: passes"] = len(renderer.graph.last_run)
    with file_calls() as calls:
        move(0)
    found["moving: file calls"] = len(calls)
    renderer.camera = rest

    # Other sizes of the picture.
    compiled.take()
    renderer.size = (SIZE[0] + 13, SIZE[1] + 7)
    step()
    found["new size: compiled"] = compiled.take()
    sizes = 6
    for number in range(sizes):
        renderer.size = (SIZE[0] + 2 * number, SIZE[1] + number)
        step()
    found[f"{sizes} more sizes: compiled"] = len(compiled.take())
    renderer.size = SIZE
    step()
    return found


def other_values(row: Row) -> list[float | int]:
    """Return two other values of a number setting, within its range; none for other settings."""
    if row.kind not in (int, float):
        return []
    low, high = row.range or (-1e30, 1e30)
    value = max(1, low) if row.value is None else row.value
    step = 1 if row.kind is int else 0.13 * abs(value) or 0.1
    near = [row.kind(value + k * step) for k in (1, 2, -1, -2)]
    return [v for v in near if low <= v <= high][:2]


def sweep(scene: Any, technique: str) -> tuple[int, dict[str, list[str]]]:
    """Change one number of the settings at a time; return how many there are, and which compiled which passes.

    Each number takes two other values. For an integer, only the second counts: the first may switch a feature on.
    """
    settings = gi.Settings()
    settings.gi = technique
    settings.camera.frames = 1
    renderer = gi.Renderer(scene, size=SIZE, settings=settings)
    compiled = Compiled(renderer._device.gpu)
    renderer.step()
    changed, guilty = 0, {}
    for row in describe(settings):
        values = other_values(row)
        changed += bool(values)
        section, _, name = row.name.rpartition(".")
        owner = getattr(settings, section) if section else settings
        for number, value in enumerate(values):
            compiled.take()
            setattr(owner, name, value)
            renderer.step()
            names = compiled.take()
            if names and (number or row.kind is float):
                guilty[f"{row.name} -> {value:g} ({row.kind.__name__})"] = names
        setattr(owner, name, row.value)
        renderer.step()
    return changed, guilty


def main() -> int:
    """Measure and print; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("techniques", nargs="*", metavar="TECHNIQUE", help=f"of {', '.join(TECHNIQUES)}")
    parser.add_argument("--settings", action="store_true", help="also change each number among the settings")
    options = parser.parse_args()
    techniques = options.techniques or TECHNIQUES
    scene = gi.load("cornell")
    watch = Stopwatch()
    table = {technique: measure(scene, technique, watch) for technique in techniques}
    print(f"{'':<36}" + "".join(f"{technique:>12}" for technique in techniques))
    for name in table[techniques[0]]:
        values = [table[technique][name] for technique in techniques]
        cells = [len(v) if isinstance(v, list) else round(v, 2) for v in values]
        print(f"{name:<36}" + "".join(f"{cell:>12}" for cell in cells))
    for technique in techniques:
        if options.settings:
            count, guilty = sweep(scene, technique)
            print(f"{technique}: {count} numbers among the settings; pipelines compiled by {len(guilty)} changes")
            for name, passes in guilty.items():
                print(f"  {name}: {', '.join(passes)}")
    counts = wgpu.diagnostics.object_counts.get_dict()
    print("alive: " + ", ".join(f"{counts[kind]['count']} {kind}" for kind in COUNTED))
    return 0


if __name__ == "__main__":
    sys.exit(main())
