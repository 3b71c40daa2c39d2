"""Atomic files: a file appears complete or not at all, even if the writing is interrupted.

A symbolic link stays; the file that it leads to is replaced. Devices and pipes are refused, never replaced.
"""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import DiskFull, GiError


@contextmanager
def atomic_file(path: str | Path, within: Path | None = None) -> Iterator[Path]:
    """Yield a temporary name to write to; the file is renamed to `path` at the end, unless an exception was raised.

    The temporary file lies beside `path`, or in the folder `within`, which must be of the same file system. Raises
    GiError if the file system refuses.
    """
    final = Path(os.path.realpath(path))
    temporary = _temporary_name(within / final.name if within else final)
    try:
        with _errors_for(path):
            _refuse_special(path)
            yield temporary
            os.replace(temporary, final)
    finally:
        with suppress(OSError):
            temporary.unlink()


def check_writable(path: str | Path) -> None:
    """Raise GiError now if `path` could not be written later, for example without a folder or rights."""
    path = Path(path)
    if "\0" in str(path):
        raise GiError(f"{str(path)!r} cannot be a file name: it has a NUL character")
    if not path.parent.is_dir():
        raise GiError(f"{path}: there is no folder {path.parent}; make it first")
    with _errors_for(path):
        if path.is_dir():
            raise GiError(f"{path} is a folder; give a file name")
        _refuse_special(path)
        # Try it: names may be too long, file systems full or read-only.
        temporary = _temporary_name(Path(os.path.realpath(path)))
        try:
            temporary.touch(exist_ok=False)
        finally:
            temporary.unlink(missing_ok=True)


def _refuse_special(path: str | Path) -> None:
    """Raise GiError for a device, a pipe or a socket, which a rename would replace by a file."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise GiError(f"{path} is a device, pipe or folder; give the name of a file")


def _temporary_name(final: Path) -> Path:
    """Return a short, unused name beside the final file, since a rename must not cross file systems."""
    return final.with_name(f".wgpu_gi-{os.getpid()}-{secrets.token_hex(4)}.tmp")


@contextmanager
def _errors_for(path: str | Path) -> Iterator[None]:
    """Turn an OSError into a GiError."""
    try:
        yield
    except OSError as error:
        kind = DiskFull if error.errno in (errno.ENOSPC, errno.EDQUOT) else GiError
        raise kind(f"{path}: cannot be written ({error.strerror or error})") from None
