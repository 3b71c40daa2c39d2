"""Makes a data set: draws, renders and labels the frames that are missing, and gives them to the writers.

A frame depends on the configuration and its number alone, bit for bit, whatever was rendered before it, by whom, and
in which order: the renderer starts each frame from scratch. `dataset.json` in the folder of the data set holds the
configuration with hashes of its files; another configuration, or another version of wgpu_gi, is refused there.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import GiError
from ..pictures.atomic_file import atomic_file
from ..renderer import Renderer
from ..sequence.shards import ALL, Shards
from ..version import __version__
from .config import Config, load_config
from .draw import Drawer
from .labels import frame_data
from .writers import Writer, make_writers

RECORD = "dataset.json"


@dataclass(frozen=True)
class Made:
    """What a run did: frames rendered, frames that were there, frames still missing (of other shards), seconds."""

    rendered: int
    there: int
    missing: int
    seconds: float

    def sentence(self) -> str:
        """Return it for people."""
        done = f"{self.rendered} frames in {self.seconds:.1f} s, {self.there} were there"
        return (
            f"{done}; {self.missing} of other shards are missing"
            if self.missing
            else f"{done}; the data set is complete"
        )


def make(
    config: str | Path | dict[str, Any],
    output: str | Path,
    *,
    shards: Shards = ALL,
    changes: Sequence[str] = (),
    adapter: str | None = None,
    progress: Callable[[float, str], None] | None = None,
) -> Made:
    """Make the frames of `shards` that are missing in the folder `output`, and finish what is then complete.

    `config` is a TOML file, or its contents as a dictionary, see `dataset.config`; `changes` are settings such as
    "camera.frames=8". `progress` receives the fraction done and the frame. Raises GiError for anything wrong, before
    files are written where possible; complete frames stay.
    """
    start = time.perf_counter()
    chosen, folder = load_config(config, tuple(changes)), Path(output)
    writers = make_writers(folder, chosen.writers, chosen.frames, chosen.data, _names(chosen), chosen.exposure)
    _claim(folder, _record_of(chosen))
    numbers = [*shards.numbers(chosen.frames)]
    lacking = [number for number in numbers if not all(writer.has(number) for writer in writers)]
    if lacking:
        _render(chosen, lacking, writers, adapter, progress)
    missing = max(writer.finish() for writer in writers)
    return Made(len(lacking), len(numbers) - len(lacking), missing, time.perf_counter() - start)


def _names(config: Config) -> dict[int, str]:
    """Return the names of the categories by id."""
    return dict(enumerate(config.categories, 1))


def _render(
    config: Config,
    numbers: list[int],
    writers: list[Writer],
    adapter: str | None,
    progress: Callable[[float, str], None] | None,
) -> None:
    """Render frames and write them."""
    drawer, renderer = Drawer(config), None
    try:
        for done, number in enumerate(numbers):
            if progress is not None:
                progress(done / len(numbers), f"frame {number}")
            drawn = drawer.draw(number)
            settings = deepcopy(config.settings)
            settings.seed = drawn.seed
            if renderer is None:
                renderer = Renderer(
                    drawn.scene, size=config.size, camera=drawn.camera, settings=settings, adapter=adapter
                )
            renderer.release()
            renderer.scene, renderer.camera, renderer.settings = drawn.scene, drawn.camera, settings
            options: dict[str, Any] = {"category_of": drawn.category_of, "categories": _names(config)}
            if {"flow", "occlusion"} & config.data:
                options["second"] = drawn.second
            data = frame_data(renderer, config.data, **options)
            for writer in writers:
                if not writer.has(number):
                    writer.write(number, data, drawn.record)
    finally:
        if renderer is not None:
            renderer.close()


def _record_of(config: Config) -> dict[str, Any]:
    """Return what determines the frames: the configuration, hashes of its files, and the version."""
    files = {each.file for each in config.scenes} | {each.environment for each in config.scenes}
    files |= {*config.sky.files, *(file for placed in config.objects for file in placed.files)}
    hashes = {}
    for file in sorted(each for each in files if each is not None):
        path = Path(config.path(file))
        if path.is_file():
            hashes[file] = hashlib.sha256(path.read_bytes()).hexdigest()
    return json.loads(json.dumps({"wgpu_gi": __version__, "config": config.table, "sha256": hashes}, default=str))


def _claim(folder: Path, record: dict[str, Any]) -> None:
    """Write the record of the data set. Raises GiError if the folder holds another one."""
    path = folder / RECORD
    try:
        before = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise GiError(f"{folder}: the folder cannot be made ({error.strerror or error})") from None
        with atomic_file(path) as temporary:
            temporary.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
        return
    except (OSError, ValueError):
        raise GiError(f"{path}: not a record of a data set; give another folder") from None
    differing = sorted(_differing(before, record))
    if differing:
        names = ", ".join(differing)
        raise GiError(f"{path}: the frames there are of another configuration ({names} differ); give another folder")


def _differing(before: Any, now: dict[str, Any]) -> set[str]:
    """Return the names of what differs."""
    if not isinstance(before, dict):
        return {"all"}
    old, new = before.get("config", {}), now["config"]
    found = {key for key in {*old, *new} if old.get(key) != new.get(key)}
    if before.get("sha256") != now["sha256"]:
        found.add("files")
    return found | ({"the version of wgpu_gi"} if before.get("wgpu_gi") != now["wgpu_gi"] else set())
