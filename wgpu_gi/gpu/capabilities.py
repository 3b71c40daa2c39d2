"""What an adapter is capable of, and which way of working follows from it. Passes ask here, never for a vendor's name.

A CPU driver (lavapipe, SwiftShader) has few threads that each go fast, and may end loops early. A GPU needs tens of
thousands of threads, and its system resets it if a submission takes too long (2 s on Windows).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Capabilities:
    """Ways of working that suit an adapter."""

    cuts_loops: bool  # the driver may end loops after 65,535 iterations
    # Steps of traversal after which an invocation of the path tracer begins no path.
    path_steps: int
    # Dispatches of a split pass that are submitted before the first of them is awaited, and the seconds that each takes
    # at least, should take, and takes at most. An interruption waits for all of them.
    chunks_in_flight: int
    chunk_seconds: tuple[float, float, float]
    least_walks: int  # walks of light that occupy all threads
    compiles_at_dispatch: bool  # a pipeline is compiled when it is first used, on one thread; else when it is made
    serial_cells: int  # voxels that one invocation sets for a triangle, while its neighbours may have few
    multi_draw: bool = False  # one command draws a buffer of draw calls


# llvmpipe (Mesa 22) ends loops after 65,535 iterations, counted over all loops of a SIMD group of 8, which in Sponza
# takes 2 to 3 times the steps of each of its lanes; a pixel's last path may take 15,000 steps more. A chunk is long
# enough that submitting and waiting (0.1 ms) do not matter, and short enough for a prompt Ctrl-C.
CPU = Capabilities(
    cuts_loops=True,
    path_steps=6000,
    chunks_in_flight=1,
    chunk_seconds=(0.1, 0.2, 0.3),
    least_walks=1,
    compiles_at_dispatch=True,
    serial_cells=200,  # CPU time / 2 in Sponza at 640x360: 21.5 ms; with 64 or 32 voxels, 25 and 29
)
# A step waits for memory, about 1 us in a divergent group of threads, so one invocation takes up to 0.2 s. Two chunks
# take less than one of a CPU: the next is queued while one runs, so the GPU never waits for the CPU.
GPU = Capabilities(
    cuts_loops=False,
    path_steps=200_000,
    chunks_in_flight=2,
    chunk_seconds=(0.04, 0.08, 0.12),
    least_walks=32_768,
    compiles_at_dispatch=False,
    serial_cells=32,
)

# Optional features that are used where they are present, and what happens without them.
MULTI_DRAW = ("indirect-first-instance", "multi-draw-indirect-count")  # without the latter, wgpu emulates it
COSTS = {
    "timestamp-query": "timings of passes wait for the GPU before and after each one",
    "float32-filterable": "32-bit float textures cannot be filtered by hardware",
    **dict.fromkeys(MULTI_DRAW, "draws of G-buffers and shadow maps are recorded one by one"),
}


def capabilities_of(kind: str, features: Iterable[str]) -> Capabilities:
    """Return the capabilities of an adapter of a kind, such as "CPU" or "DiscreteGPU", with these features."""
    return replace(CPU if kind == "CPU" else GPU, multi_draw=set(features).issuperset(MULTI_DRAW))


def costs_of(features: Iterable[str]) -> list[str]:
    """Return a sentence for each optional feature that an adapter lacks: its name, and what that costs."""
    present = set(features)
    return [f"{name}: absent; {cost}" for name, cost in COSTS.items() if name not in present]
