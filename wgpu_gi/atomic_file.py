"""Files that appear complete or not at all, whatever interrupts their writing."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import GiError


@contextmanager
def atomic_file(path: str | Path) -> Iterator[Path]:
    """Yield a name to write to; the file there becomes `path` at the end, unless anything was raised.

    Raises GiError in one sentence for what the file system refuses.
    """
    # Beside the final file, which may be a link: a rename must not cross file systems.
    final = Path(os.path.realpath(path))
    temporary = final.with_name(f".wgpu_gi-{os.getpid()}-{secrets.token_hex(4)}.tmp")
    try:
        yield temporary
        os.replace(temporary, final)
    except OSError as error:
        raise GiError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        with suppress(OSError):
            temporary.unlink()


def check_writable(path: str | Path) -> None:
    """Raise GiError now if `path` could not be written later: its folder or the rights to it."""
    path = Path(path)
    if path.is_dir():
        raise GiError(f"{path} is a folder; give a file name")
    if not path.parent.is_dir():
        raise GiError(f"{path}: there is no folder {path.parent}; make it first")
    if not os.access(path.parent, os.W_OK):
        raise GiError(f"{path}: files cannot be made in {path.parent}; choose another folder")
