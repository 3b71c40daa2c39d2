"""The configuration of a data set: a TOML file, or the same as a dictionary.

    frames = 200                    # how many
    seed = 7                        # determines, with the number of a frame, all that is drawn for it
    size = [160, 120]               # pixels
    gi = "many-light"               # the technique
    quality = "medium"
    data = ["picture", "depth_z"]   # names of `labels.WANTED`; writers add what they need
    exposure = 1.0                  # EV of pictures in 8 bits; left out: automatic for each frame
    settings = ["camera.frames=8"]  # as --set takes them

    [[scenes]]                      # each frame shows one of them, each as likely
    file = "cornell"                # a built-in scene, or a file beside the configuration
    environment = "sky.hdr"         # or "R,G,B"; left out: the scene's
    time = [0, 5]                   # seconds of its animation; left out: at rest

    [scenes.cameras]                # for this scene; left out: those below

    [cameras]                       # `cameras`: kind = "sphere", "room" or "path", and the fields of its class
    [lights]                        # `LightRanges`
    [sky]                           # `SkyRanges`
    [[objects]]                     # `Placed`: copies of files put on floors
    [motion]                        # `Motion`: what moves until the second time, for flow and occlusion
    [categories]                    # name = patterns of names of nodes, such as box = ["*box*"]; ids from 1 in order
    [writers.coco]                  # `writers`, with their options

Ranges are [least, most], or a number. Unknown fields are refused.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from ..errors import GiError, near_names
from ..options import Settings, check_size
from ..scene.built_in.scenes import BUILTIN_SCENES
from ..settings import apply_quality, assign, validate
from .cameras import Cameras, Range, cameras_from
from .labels import check_wanted
from .writers import required

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

MOST_FRAMES = 100_000_000


@dataclass(frozen=True)
class SceneFile:
    """A scene; the environment and the cameras replace its own and the configuration's.

    `time`: seconds of its first animation; None: at rest. Objects and cameras keep away from the pose at rest.
    """

    file: str
    environment: str | None = None
    time: Range | None = None
    cameras: Cameras | None = None


@dataclass(frozen=True)
class LightRanges:
    """What varies of each point, spot and directional light, each by itself."""

    intensity: Range = (1.0, 1.0)  # factors, drawn uniformly in their logarithm
    color: float = 0.0  # each channel is multiplied by a factor between 1 - color and 1 + color
    turn_deg: float = 0.0  # spots and directional lights turn by up to that much about each axis
    shift: float = 0.0  # points and spots move by up to that many metres along each axis


@dataclass(frozen=True)
class SkyRanges:
    """What varies of the environment. `files` replace it, each as likely."""

    intensity: Range = (1.0, 1.0)  # factors, drawn uniformly in their logarithm
    rotation_deg: Range = (0.0, 0.0)  # about +Y
    files: tuple[str, ...] = ()


@dataclass(frozen=True)
class Placed:
    """Copies of files put on floors at random: upright, apart from one another and from the scene."""

    files: tuple[str, ...] = ()
    count: tuple[int, int] = (1, 1)  # least and most copies, each of one of the files
    size: Range = (0.5, 0.5)  # metres: the largest side
    turn_deg: Range = (0.0, 360.0)  # about +Y


@dataclass(frozen=True)
class Motion:
    """What happens until the second time. Each is drawn between minus and plus that much, along or about each axis."""

    camera_shift: float = 0.0  # metres
    camera_turn_deg: float = 0.0
    object_shift: float = 0.0  # metres, of placed objects, level
    object_turn_deg: float = 0.0  # of placed objects, about +Y


@dataclass(frozen=True)
class Config:
    """A checked configuration. `folder` is where its files lie."""

    frames: int
    size: tuple[int, int]
    scenes: tuple[SceneFile, ...]
    cameras: Cameras | None  # of the scenes that have none
    writers: dict[str, dict[str, Any]]
    settings: Settings
    data: frozenset[str]
    folder: Path
    seed: int = 0
    exposure: float | None = None
    lights: LightRanges = LightRanges()
    sky: SkyRanges = SkyRanges()
    objects: tuple[Placed, ...] = ()
    motion: Motion | None = None
    categories: dict[str, tuple[str, ...]] = field(default_factory=dict)
    table: dict[str, Any] = field(default_factory=dict)  # as it was given, with changed settings

    def path(self, file: str) -> str:
        """Return a file by its path: beside the configuration, or a built-in name."""
        beside = self.folder / file
        return str(beside) if beside.is_file() else file


KEYS = (
    *("frames", "seed", "size", "gi", "quality", "data", "exposure", "settings"),
    *("scenes", "cameras", "lights", "sky", "objects", "motion", "categories", "writers"),
)


def load_config(source: str | Path | dict[str, Any], changes: tuple[str, ...] = ()) -> Config:
    """Return a configuration; `changes` are further settings. Raises GiError that names the first wrong field."""
    if isinstance(source, dict):
        return _checked(source, "the configuration", Path(), changes)
    path = Path(source)
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise GiError(f"{path}: the configuration cannot be read ({error.strerror or error})") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise GiError(f"{path} is not TOML: {error}") from None
    return _checked(table, str(path), path.parent, changes)


def _checked(table: dict[str, Any], where: str, folder: Path, changes: tuple[str, ...]) -> Config:
    """Return the configuration of a table."""
    for key in table:
        if key not in KEYS:
            raise GiError(f"{where}: there is no field {key!r}; {near_names(key, KEYS)}")
    for key in ("frames", "size", "scenes", "writers"):
        if key not in table:
            raise GiError(f"{where}: the field {key} is missing")
    # What to render.
    frames = _whole(table["frames"], f"{where}: frames", 1, MOST_FRAMES)
    seed = _whole(table.get("seed", 0), f"{where}: seed", 0, 2**63)
    size = table["size"]
    try:
        check_size(size)
    except GiError as error:
        raise GiError(f"{where}: {error}") from None
    exposure = table.get("exposure")
    if exposure is not None and not (type(exposure) in (int, float) and math.isfinite(exposure)):
        raise GiError(f"{where}: exposure must be a number of EV, not {exposure!r}")
    settings = _settings(table, where, changes)
    # What to write.
    writers = _table(table["writers"], f"{where}: writers")
    data = {*_texts(table.get("data", ["picture"]), f"{where}: data"), *required(writers)}
    check_wanted(data)
    if {"flow", "occlusion"} & data and "motion" not in table:
        raise GiError(f"{where}: flow and occlusion need a table [motion], which says what moves until the second time")
    # What varies.
    scenes = _tables(SceneFile, table["scenes"], f"{where}: scenes", folder)
    if not scenes:
        raise GiError(f"{where}: scenes must be a list of tables, [[scenes]], with at least one")
    cameras = None
    if "cameras" in table:
        cameras = cameras_from(_table(table["cameras"], f"{where}: cameras"), f"{where}: cameras", folder)
    elif any(scene.cameras is None for scene in scenes):
        raise GiError(f"{where}: the table cameras is missing")
    categories = _table(table.get("categories", {}), f"{where}: categories")
    config = Config(
        frames,
        tuple(size),
        scenes,
        cameras,
        {name: _table(options, f"{where}: writers.{name}") for name, options in writers.items()},
        settings,
        frozenset(data),
        folder,
        seed,
        None if exposure is None else float(exposure),
        _section(LightRanges, table.get("lights", {}), f"{where}: lights"),
        _section(SkyRanges, table.get("sky", {}), f"{where}: sky"),
        _tables(Placed, table.get("objects", []), f"{where}: objects"),
        _section(Motion, table["motion"], f"{where}: motion") if "motion" in table else None,
        {name: _texts(each, f"{where}: categories.{name}") for name, each in categories.items()},
        {**table, "settings": [*_texts(table.get("settings", []), f"{where}: settings"), *changes]},
    )
    _check_files(config, where)
    return config


def _check_files(config: Config, where: str) -> None:
    """Raise GiError for a file that does not exist."""
    scenes = [(f"scenes[{i}]", scene.file) for i, scene in enumerate(config.scenes)]
    objects = [(f"objects[{i}]", file) for i, placed in enumerate(config.objects) for file in placed.files]
    for name, file in (*scenes, *objects):
        if not Path(config.path(file)).is_file() and file not in BUILTIN_SCENES:
            raise GiError(f"{where}: {name}: there is no file {file!r}, nor a built-in scene of that name")
    for file in config.sky.files:
        if not Path(config.path(file)).is_file():
            raise GiError(f"{where}: sky: there is no file {file!r}")


def _settings(table: dict[str, Any], where: str, changes: tuple[str, ...]) -> Settings:
    """Return the settings of technique, quality and changes."""
    settings = Settings()
    try:
        apply_quality(settings, table.get("quality", "medium"))
        settings.gi = table.get("gi", settings.gi)
        for text in (*_texts(table.get("settings", []), f"{where}: settings"), *changes):
            assign(settings, text)
        validate(settings)
    except GiError as error:
        raise GiError(str(error) if str(error).startswith(where) else f"{where}: {error}") from None
    return settings


def _section(kind: type, table: Any, where: str, folder: Path = Path()) -> Any:
    """Return a section as its class."""
    types = {each.name: str(each.type) for each in fields(kind)}
    values = {}
    for name, value in _table(table, where).items():
        if name not in types:
            raise GiError(f"{where}: there is no field {name!r}; {near_names(name, types)}")
        if name == "cameras":
            values[name] = cameras_from(_table(value, f"{where}.cameras"), f"{where}.cameras", folder)
        else:
            values[name] = _value(types[name], value, f"{where}.{name}")
    if kind in (SceneFile, Placed) and not values.get("file" if kind is SceneFile else "files"):
        raise GiError(f"{where}: {'file' if kind is SceneFile else 'files'} is missing")
    return kind(**values)


def _tables(kind: type, tables: Any, where: str, folder: Path = Path()) -> tuple[Any, ...]:
    """Return a list of sections."""
    if not isinstance(tables, list):
        raise GiError(f"{where} must be a list of tables, [[...]], not {tables!r}")
    return tuple(_section(kind, table, f"{where}[{i}]", folder) for i, table in enumerate(tables))


def _value(kind: str, value: Any, where: str) -> Any:
    """Return a field of a section in the type of its class."""
    if kind.startswith("str"):
        return _texts([value], where)[0]
    if kind == "tuple[str, ...]":
        return _texts(value, where)
    numbers = value if isinstance(value, list) else [value]
    whole = kind == "tuple[int, int]"
    if not all(type(n) in ((int,) if whole else (int, float)) and math.isfinite(n) for n in numbers):
        raise GiError(f"{where} must hold {'whole' if whole else 'finite'} numbers, not {value!r}")
    if kind == "float":
        if isinstance(value, list) or value < 0:
            raise GiError(f"{where} must be a number from 0, not {value!r}")
        return float(value)
    positive = where.endswith(("intensity", "size"))
    if len(numbers) not in (1, 2) or numbers[0] > numbers[-1] or (positive and numbers[0] <= 0):
        raise GiError(f"{where} must be a number{' above 0' * positive}, or [least, most], not {value!r}")
    if whole and not 0 <= numbers[0] <= numbers[-1] <= 10_000:
        raise GiError(f"{where} must lie between 0 and 10000, not {value!r}")
    return numbers[0], numbers[-1]


def _table(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise GiError(f"{where} must be a table, not {value!r}")
    return value


def _texts(value: Any, where: str) -> tuple[str, ...]:
    if not isinstance(value, list | tuple) or not all(isinstance(each, str) for each in value):
        raise GiError(f"{where} must be a list of texts, not {value!r}")
    return tuple(value)


def _whole(value: Any, where: str, least: int, most: int) -> int:
    if type(value) is not int or not least <= value <= most:
        raise GiError(f"{where} must be a whole number from {least} to {most}, not {value!r}")
    return value
