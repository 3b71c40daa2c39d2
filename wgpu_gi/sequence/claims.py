"""Claims: commands that render the same frames at the same time share them, instead of rendering each twice.

Every command keeps a file of the blocks that it is about to render, in a folder beside the frames, and touches it while
it runs. A claim of a command that has ended, or has not touched its file for STALE seconds, does not count. Times are
those of the file system alone, so clocks of machines may differ. Two commands that claim a block all the same, after a
pause longer than STALE, write the same picture twice: files are atomic and pictures do not depend on who renders them.
"""

from __future__ import annotations

import json
import os
import platform
import secrets
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from ..errors import GiError
from ..pictures.atomic_file import atomic_file

BEAT = 10.0  # seconds between touches
STALE = 60.0  # seconds without a touch: six are missed, more than a loaded file server delays
LOCK_STALE = 10.0  # seconds after which a lock was left by a process that was killed; it is held for milliseconds


class Claim(NamedTuple):
    """What another command claims, and who it is."""

    blocks: frozenset[int]
    host: str
    process: int

    def __str__(self) -> str:
        return f"process {self.process} on {self.host}"


class Claims:
    """The claims on the blocks of a sequence whose .json is `job_file`. Use it as a context: the end drops the claims.

    Raises GiError if the folder cannot be written.
    """

    def __init__(self, job_file: str | Path) -> None:
        self._folder = Path(job_file).with_suffix(".claims")
        self._file = self._folder / f"{secrets.token_hex(8)}.json"
        self._lock = self._folder / "lock"
        self._blocks: set[int] = set()
        self._writing = threading.Lock()  # the thread that touches the file may write it, too
        self._end = threading.Event()
        self._beats = threading.Thread(target=self._beat, name="claims", daemon=True)

    def __enter__(self) -> Claims:
        self._write()
        self._beats.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self._end.set()
        self._beats.join()
        with suppress(OSError):
            self._file.unlink()
        with suppress(OSError):
            self._folder.rmdir()  # fails if others have claims

    def take(self, blocks: Iterable[int]) -> list[int]:
        """Claim those blocks that no other command claims, and return them."""
        with self._locked():
            others = self.others()
            free = [block for block in blocks if not any(block in claim.blocks for claim in others)]
            self._blocks |= set(free)
            self._write()
        return free

    def drop(self, blocks: Iterable[int]) -> None:
        """Stop claiming blocks that are done; others see the pictures, and this with the next claim."""
        self._blocks -= set(blocks)

    def give_up(self, blocks: Iterable[int]) -> None:
        """Stop claiming blocks that cannot be rendered here, and tell others, who may wait for them."""
        self.drop(blocks)
        self._write()

    def others(self) -> list[Claim]:
        """Return the claims of other commands that run."""
        now, found = self._now(), []
        for file in self._folder.glob("*.json"):
            if file == self._file:
                continue
            try:
                age, claim = now - file.stat().st_mtime, json.loads(file.read_text(encoding="utf-8"))
                ended = claim["space"] == _space() and not _runs(claim["process"], claim["started"])
                if ended or age > STALE:
                    file.unlink()
                else:
                    found.append(Claim(frozenset(claim["blocks"]), claim["host"], claim["process"]))
            except (OSError, ValueError, KeyError, TypeError):
                continue  # just deleted, or not a claim
        return found

    def _now(self) -> float:
        """Return the time of the file system, in seconds."""
        try:
            os.utime(self._file)
            return self._file.stat().st_mtime
        except OSError:
            return time.time()

    def _write(self) -> None:
        """Write the claims. Raises GiError if that is not possible."""
        process = os.getpid()
        claim = {
            "host": platform.node(),
            "process": process,
            "space": _space(),
            "started": _start_of(process),
            "blocks": sorted(self._blocks.copy()),
        }
        with self._writing:
            for again in (True, True, False):
                self._make_folder()
                try:
                    with atomic_file(self._file) as temporary:
                        temporary.write_text(json.dumps(claim), encoding="utf-8")
                    break
                except GiError:
                    if not again or self._folder.exists():  # another command may just have removed the folder
                        raise

    def _make_folder(self) -> None:
        try:
            self._folder.mkdir(exist_ok=True)
        except OSError as error:
            raise GiError(f"{self._folder}: cannot be made ({error.strerror or error}); move it away") from None

    def _beat(self) -> None:
        """Touch the file until the end; write it anew if another command took it for stale."""
        while not self._end.wait(BEAT):
            try:
                os.utime(self._file)
            except FileNotFoundError:
                with suppress(GiError):
                    self._write()
            except OSError:
                continue  # a file server that is away for a moment

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Hold the lock of the folder."""
        while True:
            try:
                self._make_folder()
                os.close(os.open(self._lock, os.O_CREAT | os.O_EXCL | os.O_WRONLY))
                break
            except (FileExistsError, FileNotFoundError):
                time.sleep(0.01)
                with suppress(OSError):
                    if self._now() - self._lock.stat().st_mtime > LOCK_STALE:
                        self._lock.unlink()
            except OSError as error:
                raise GiError(f"{self._lock}: cannot be written ({error.strerror or error})") from None
        try:
            yield
        finally:
            with suppress(OSError):
                self._lock.unlink()


def wait_for(
    claims: Claims, blocks: Iterable[int], is_done: Callable[[int], bool], tell: Callable[[list[Claim], int], None]
) -> list[int]:
    """Wait until others have rendered `blocks`, or end without; claim and return the first that they leave.

    `tell` receives who renders how many blocks, about once a second; it may raise an exception to stop.
    """
    while left := [block for block in blocks if not is_done(block)]:
        others = [claim for claim in claims.others() if claim.blocks.intersection(left)]
        if free := claims.take(left):
            return free
        tell(others, len(left))
        time.sleep(1.0)
    return []


def _space() -> str:
    """Return what names the processes of this machine, or container, apart from those of others."""
    with suppress(OSError):
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{boot} {os.readlink('/proc/self/ns/pid')}"
    return f"{platform.node()} {os.name}"


def _start_of(process: int) -> str:
    """Return when a process started, which tells it from a later one of the same number; empty if that is unknown."""
    with suppress(OSError, IndexError):
        return (
            Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()[19]
        )
    return ""


def _runs(process: int, started: str) -> bool:
    """Tell whether a process of this machine runs."""
    if started:
        return _start_of(process) == started
    if os.name != "posix":
        return True  # then its age decides
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
