"""Loads WGSL: pastes the files that `#import` names, maps lines back to files, and reflects declarations by name.

`#import "common/brdf.wgsl"` on a line of its own pastes that file there, once, depth first; paths are relative to the
shader root. There are no templates and no conditionals.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...errors import GiError
from ...resources import resource_dir
from .layout import Layout, layout_of
from .module import Binding, EntryPoint, Module, Type
from .reflect import parse
from .tokens import ParseError


@dataclass(eq=False)
class ShaderSource:
    """A shader with its imports, and what it declares. `load` returns the same object until the text changes."""

    path: str
    text: str
    lines: list[tuple[str, int]]  # file and line number of each line of `text`
    module: Module
    _layouts: dict[Type, Layout] = field(default_factory=dict)

    @property
    def bindings(self) -> dict[str, Binding]:
        """The resource variables by name."""
        return self.module.bindings

    @property
    def entry_points(self) -> dict[str, EntryPoint]:
        """The shader stages by name."""
        return self.module.entry_points

    @property
    def overrides(self) -> dict[str, int | float | bool | None]:
        """The pipeline constants with their defaults; None if there is none or it is computed."""
        return self.module.overrides

    @property
    def constants(self) -> dict[str, int | float]:
        """The module-scope constants whose value is made of literals and constants."""
        return self.module.constants

    def where(self, line: int) -> str:
        """Return "file:line" of a line (from 1) of `text`."""
        file, number = self.lines[min(max(line, 1), len(self.lines)) - 1]
        return f"{file}:{number}"

    def struct_dtype(self, name: str) -> np.dtype:
        """Return the numpy dtype of the struct `name`, padding included.

        Leaves out a runtime-sized array at its end. Matrices are arrays of columns. Raises GiError for an unknown name.
        """
        if name not in self.module.structs:
            known = ", ".join(self.module.structs) or "none"
            raise GiError(f"{self.path} declares no struct {name!r}; available: {known}")
        return self.layout(Type(name)).dtype

    def layout(self, kind: Type) -> Layout:
        """Return the memory layout of a type of this shader. Raises GiError if it has none."""
        if kind not in self._layouts:
            try:
                self._layouts[kind] = layout_of(kind, self.module.structs)
            except GiError as error:
                raise GiError(f"{self.path}: {error}") from error
        return self._layouts[kind]


_Key = tuple[str, Path | None]
_loaded: dict[_Key, tuple[ShaderSource, frozenset[Path]]] = {}  # shaders, and the files that they depend on
_outdated: dict[_Key, ShaderSource] = {}  # sources with a changed file
_times: dict[Path, int] = {}  # modification time of each file when first seen; -1: searched for, but absent
_changes = 0  # number of calls of `refresh` that found a change


def load(path: str, root: Path | str | None = None) -> ShaderSource:
    """Return the shader `path` of the package's `wgsl` folder; files under `root`, if given, come first.

    A shader is read once; after that no file is touched until `refresh`. Raises GiError with file and line for a
    missing import, an import cycle, or a declaration that cannot be read.
    """
    key = (path, Path(root) if root is not None else None)
    known = _loaded.get(key)
    if known is not None:
        return known[0]
    # Paste its files. Record them even after an error: an edit may fix it.
    files: dict[Path, int] = {}
    pasted: list[tuple[str, str, int]] = []
    try:
        _paste(path, key[1], [], files, pasted, "")
    finally:
        for file, time in files.items():
            _times.setdefault(file, time)
    # Reflect the text, unless it is unchanged.
    text = "\n".join(line for line, _, _ in pasted) + "\n"
    source = _outdated.get(key)
    if source is None or source.text != text:
        source = ShaderSource(path, text, [(file, number) for _, file, number in pasted], Module())
        try:
            source.module = parse(text)
        except ParseError as error:
            raise GiError(f"{source.where(error.line)}: {error}") from error
    _loaded[key] = (source, frozenset(files))
    _outdated.pop(key, None)
    return source


def refresh() -> int:
    """Check all files of loaded shaders; `load` reads a shader again if one of its files has changed.

    Returns how many calls of this process have found a change. If the number differs from that of an earlier call, a
    shader may have changed since.
    """
    global _changes
    changed = {file for file, time in _times.items() if _mtime(file) != time}
    for key, (source, files) in list(_loaded.items()):
        if not files.isdisjoint(changed):
            _outdated[key] = source
            del _loaded[key]
    for file in changed:
        del _times[file]
    _changes += bool(changed)
    return _changes


def _paste(
    path: str,
    root: Path | None,
    parents: list[str],
    files: dict[Path, int],
    pasted: list[tuple[str, str, int]],
    where: str,
) -> None:
    """Append the lines of `path` as (text, file, line); each import is replaced by its file."""
    if path in parents:
        raise GiError(f"{where}: import cycle {' -> '.join([*parents[parents.index(path) :], path])}")
    file = _find(path, root, files, where)
    if file in files:
        return
    files[file] = _mtime(file)
    for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
        words = line.split()
        if not words or words[0] != "#import":
            pasted.append((line, path, number))
            continue
        quoted = line.split('"')
        if len(quoted) != 3 or not quoted[1]:
            raise GiError(f'{path}:{number}: write #import "folder/file.wgsl"')
        _paste(quoted[1], root, [*parents, path], files, pasted, f"{path}:{number}")


def _find(path: str, root: Path | None, files: dict[Path, int], where: str) -> Path:
    """Return the file of a shader; record in `files` the earlier places that lack it."""
    roots = [root] if root is not None else []
    try:
        roots.append(resource_dir("wgsl"))
    except FileNotFoundError as error:
        if root is None:
            raise GiError(str(error)) from error
    for folder in roots:
        if (folder / path).is_file():
            return folder / path
        files[folder / path] = -1
    searched = " or ".join(str(folder) for folder in roots)
    raise GiError(f"{where + ': ' if where else ''}there is no shader {path!r} in {searched}")


def _mtime(file: Path) -> int:
    try:
        return file.stat().st_mtime_ns
    except OSError:
        return -1
