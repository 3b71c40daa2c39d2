"""Writes a data set by processes that die at any moment, until it is complete: killed_writers.py OUTPUT SEED.

Three processes share the frames and run at the same time; now and then two have the same. Each run ends after a random
number of file operations, without any clean-up, or is killed from outside at a random time.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[2]), str(Path(__file__).resolve().parents[1])]

from helpers.labelled_frames import CATEGORIES, DATA, frame, record  # noqa: E402

from wgpu_gi.dataset.writers import make_writers  # noqa: E402

FRAMES, PROCESSES = 11, 3
OPTIONS = {"folder": {"files": ["png", "npz", "exr"]}, "webdataset": {"frames_per_shard": 4}, "coco": {}, "nerf": {}}
OPERATIONS = ("open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.listdir", "os.scandir", "shutil.rmtree")


def write(output: Path, frames: list[int]) -> int:
    """Write the frames that are not there, as a data set does; return how many of all are missing."""
    writers = make_writers(output, OPTIONS, FRAMES, DATA, CATEGORIES, 0.5)
    for number in frames:
        lacking = [writer for writer in writers if not writer.has(number)]
        for writer in lacking:
            writer.write(number, frame(number), record(number))
    return max(writer.finish() for writer in writers)


def die_at(operation: int) -> None:
    """End this process at a file operation, counted from 1."""
    left = operation

    def hook(event: str, arguments: tuple) -> None:
        nonlocal left
        if event in OPERATIONS:
            left -= 1
            if left == 0:
                os._exit(9)

    sys.addaudithook(hook)


def child(output: Path, frames: list[int], operation: int) -> int:
    """Start a process that writes frames and dies; return its id."""
    pid = os.fork()
    if pid:
        return pid
    code = 1
    try:
        die_at(operation)
        code = 0 if write(output, frames) == 0 else 3
    finally:
        os._exit(code)


def main() -> int:
    """Run until the data set is complete; print how many processes died."""
    output, dice = Path(sys.argv[1]), random.Random(int(sys.argv[2]))
    died, codes = 0, [9]
    while 0 not in codes:
        runs = []
        for i in range(PROCESSES):
            frames = [n for n in range(FRAMES) if n % PROCESSES == i or dice.random() < 0.2]
            dice.shuffle(frames)
            runs.append(child(output, frames, dice.randrange(1, 120)))
        if dice.random() < 0.3:
            time.sleep(dice.uniform(0.0, 0.2))
            for pid in runs:
                os.kill(pid, signal.SIGKILL)
        codes = [os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) for pid in runs]
        if 1 in codes:
            return 1
        died += sum(code in (9, -9) for code in codes)
    # What interrupted processes left behind goes with the next complete run.
    for i in range(PROCESSES):
        write(output, list(range(i, FRAMES, PROCESSES)))
    print(died)
    return 0


if __name__ == "__main__":
    sys.exit(main())
