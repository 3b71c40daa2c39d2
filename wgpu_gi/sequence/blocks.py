"""Blocks: runs of frames that must be rendered together, in order, by techniques with a temporal history.

Each block starts without history, with warm-up frames that are not written, so a frame does not depend on how the
blocks are shared among processes. Without a history, a block is one frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from .shards import ALL, Shards

# Frames per block, and warm-up frames before each block. The warm-up adds a quarter to the cost; 8 frames fill the
# average that the viewer uses.
BLOCK, WARM_UP = 32, 8


def block_count(frames: range, has_history: bool) -> int:
    """Return the number of blocks of `frames`."""
    return -(-len(frames) // BLOCK) if has_history else len(frames)


def block_of(frames: range, has_history: bool, number: int) -> range:
    """Return block `number`, from 0."""
    length = BLOCK if has_history else 1
    return frames[number * length : (number + 1) * length]


def blocks_of(frames: range, has_history: bool, shards: Shards = ALL) -> Iterator[range]:
    """Yield the blocks of `frames` that belong to `shards`, in order."""
    for number in shards.numbers(block_count(frames, has_history)):
        yield block_of(frames, has_history, number)


def run_of(frames: range, block: range, has_history: bool, exists: Callable[[int], bool]) -> tuple[int, ...]:
    """Return the frames to render for a block with missing ones: from its first warm-up frame to its last missing."""
    if not has_history:
        return (block[0],)
    start = frames.index(block[0])
    end = start + max(i for i, frame in enumerate(block) if not exists(frame))
    return tuple(frames[max(start - WARM_UP, 0) : end + 1])
