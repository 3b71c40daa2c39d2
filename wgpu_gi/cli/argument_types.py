"""The parsers of the values of arguments: each raises ArgumentTypeError, a sentence, for text that it does not take."""

from __future__ import annotations

import math
import re
from argparse import ArgumentTypeError
from typing import NamedTuple

from ..budget.amounts import checked_error, seconds_of
from ..errors import GiError
from ..scene.files.memory import GIB
from ..sequence.shards import Shards


class Amount(NamedTuple):
    """A number of seconds, from a text with a unit of time or without one."""

    number: float
    has_unit: bool


def parse_size(text: str) -> tuple[int, int]:
    """Parse text such as 640x360 as (width, height) in pixels."""
    match = re.fullmatch(r"(\d{1,9})x(\d{1,9})", text)
    if match is None:
        raise ArgumentTypeError(f"a size is WIDTHxHEIGHT in pixels, such as 640x360, not {text!r}")
    return int(match[1]), int(match[2])


def parse_tiles(text: str) -> int | tuple[int, int]:
    """Parse a number of tiles, or their size such as 1024x1024."""
    if re.fullmatch(r"[1-9]\d{0,8}", text):
        return int(text)
    try:
        return parse_size(text)
    except ArgumentTypeError:
        message = f"tiles are their number, such as 4, or their size, such as 1024x1024, not {text!r}"
        raise ArgumentTypeError(f"{message}; write the scene before it") from None


def parse_pixels(text: str) -> int:
    """Parse a number of pixels."""
    if re.fullmatch(r"-?\d{1,9}", text) is None:
        raise ArgumentTypeError(f"a number of pixels, such as 200, not {text!r}; write the scene before it")
    return int(text)


def parse_frames(text: str) -> range:
    """Parse text such as 0:240 or 0:240:2 as frame numbers."""
    match = re.fullmatch(r"(\d{1,9}):(\d{1,9})(?::([1-9]\d{0,8}))?", text)
    frames = range(int(match[1]), int(match[2]), int(match[3] or 1)) if match else range(0)
    if not frames:
        raise ArgumentTypeError(f"frames are FIRST:END or FIRST:END:STEP, such as 0:240, not {text!r}")
    return frames


def parse_seeds(text: str) -> range:
    """Parse text such as 0:100 as seeds."""
    match = re.fullmatch(r"(\d{1,9}):(\d{1,9})", text)
    seeds = range(int(match[1]), int(match[2])) if match else range(0)
    if not seeds:
        raise ArgumentTypeError(f"seeds are FIRST:END, such as 0:100, not {text!r}")
    return seeds


def parse_shards(text: str) -> Shards:
    """Parse text such as 2/8, or 3-5/8 for parts 3 to 5."""
    match = re.fullmatch(r"(\d{1,6})(?:-(\d{1,6}))?/(\d{1,6})", text)
    first, last, count = (int(match[1]), int(match[2] or match[1]), int(match[3])) if match else (0, 0, 0)
    if not 1 <= first <= last <= count:
        raise ArgumentTypeError(f"a shard is I/N from 1/N to N/N, such as 2/8, or several, such as 3-5/8, not {text!r}")
    return Shards(range(first, last + 1), count)


def parse_count(text: str) -> int:
    """Parse a number of processes or cores."""
    if re.fullmatch(r"[1-9]\d{0,3}", text) is None:
        raise ArgumentTypeError(f"a number from 1 to 9999, not {text!r}")
    return int(text)


def parse_tasks(text: str) -> int:
    """Parse a number of tasks."""
    if re.fullmatch(r"[1-9]\d{0,5}", text) is None:
        raise ArgumentTypeError(f"a number of tasks is 1 or more, such as 100, not {text!r}")
    return int(text)


def parse_memory(text: str) -> int:
    """Parse a number of GiB as bytes."""
    try:
        size = float(text) * GIB
    except ValueError:
        size = math.nan
    if not 1 <= size <= 2**60:
        raise ArgumentTypeError(f"memory is a number of GiB above 0, such as 8, not {text!r}")
    return int(size)


def parse_length(text: str) -> float:
    """Parse a number of metres above 0."""
    try:
        length = float(text)
    except ValueError:
        length = math.nan
    if not 0 < length < math.inf:
        raise ArgumentTypeError(f"a length is a number of metres above 0, not {text!r}")
    return length


def parse_time(text: str) -> float:
    """Parse a time code, a finite number."""
    try:
        time = float(text)
    except ValueError:
        time = math.nan
    if not math.isfinite(time):
        raise ArgumentTypeError(f"a time is a number, not {text!r}")
    return time


def parse_amount(text: str) -> Amount:
    """Parse a time budget such as 2s, or a number without a unit, which may be a time in an animation."""
    try:
        seconds = seconds_of(text)
    except GiError as error:
        raise ArgumentTypeError(str(error)) from None
    return Amount(parse_time(text), False) if seconds is None else Amount(seconds, True)


def parse_error(text: str) -> float:
    """Parse an error to reach, a relMSE."""
    try:
        return checked_error(float(text), text)
    except ValueError:
        raise ArgumentTypeError(f"an error is a relMSE above 0, such as 0.01, not {text!r}") from None
    except GiError as error:
        raise ArgumentTypeError(str(error)) from None


def parse_rate(text: str) -> float:
    """Parse a rate of frames per second, from 1 to 1000."""
    try:
        rate = float(text)
    except ValueError:
        rate = math.nan
    if not 1 <= rate <= 1000:
        raise ArgumentTypeError(f"a rate is 1 to 1000 frames per second, not {text!r}")
    return rate


def parse_bounces(text: str) -> int | None:
    """Parse a number of indirect bounces; None means unlimited."""
    if text == "unlimited":
        return None
    if not text.isdecimal() or len(text) > 9:
        raise ArgumentTypeError(f"bounces are 0, 1, 2 ... or unlimited, not {text!r}")
    return int(text)


def parse_exposure(text: str) -> float | None:
    """Parse an exposure in stops; None means automatic."""
    if text in ("automatic", "auto"):
        return None
    try:
        stops = float(text)
    except ValueError:
        stops = math.nan
    if not math.isfinite(stops):
        raise ArgumentTypeError(f"an exposure is a number of stops, such as 1.5, or automatic, not {text!r}")
    return stops
