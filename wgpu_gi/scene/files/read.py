"""Reads files that may be missing, foreign or hostile; an error is one clear sentence."""

from __future__ import annotations

from pathlib import Path

from ...errors import GiError


def read_file(path: Path, kind: str) -> bytes:
    """Return all bytes of a regular, non-empty file; `kind` describes it in messages ("mesh file", "camera file").

    Raises GiError if it is missing, a folder, a device, unreadable or empty.
    """
    try:
        if path.is_dir():
            raise GiError(f"{path} is a folder, not a {kind}; name the file in it")
        if not path.exists():
            raise GiError(f"{kind} {path} does not exist; check the path")
        if not path.is_file():
            raise GiError(f"{path} is not a regular file, so it cannot be a {kind}")
        data = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a NUL character in the path
        raise GiError(f"{kind} {str(path)!r} cannot be read: {error}") from None
    if not data:
        raise GiError(f"{kind} {path} is empty; export or download it again")
    return data


def path_inside(folder: Path, name: str) -> Path | None:
    """Return the path below `folder` of a `name` in a scene file; None if it leads out of the folder."""
    try:
        root = folder.resolve()
        path = (root / name.strip().replace("\\", "/")).resolve()
    except (OSError, ValueError, RuntimeError):  # NUL characters, link loops
        return None
    return path if path.is_relative_to(root) else None


def find_inside(root: Path, name: str, start: Path) -> Path | None:
    """Return the existing file that a scene file in `start` calls `name`; None unless it lies below `root`.

    Where no file has exactly that name, one that differs in capitals is taken, as on Windows.
    """
    try:
        root = root.resolve()
        path = (start / name.strip().replace("\\", "/")).resolve()
        if not path.is_relative_to(root):
            return None
        if path.is_file():
            return path
        found = root
        for part in path.relative_to(root).parts:
            exact = found / part
            if not exact.exists():
                exact = next((each for each in sorted(found.iterdir()) if each.name.lower() == part.lower()), exact)
            found = exact
        return found if found.is_file() and found.resolve().is_relative_to(root) else None
    except (OSError, ValueError, RuntimeError):  # NUL characters, link loops, no such folder
        return None


def decode_text(data: bytes) -> str:
    """Return a text in UTF-8, UTF-16 if it has that mark, or else Windows-1252, which older exporters write."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")
