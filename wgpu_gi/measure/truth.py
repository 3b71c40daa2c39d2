"""The truth that techniques are held against: made by the path tracer and kept in a cache, or read from a file.

The path tracer renders it twice, with half of the samples and another seed each. The mean is the truth, half of the
difference its standard error: unlike the one of the samples within a picture, this counts what stratification gains,
and there is one for each layer.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import GiError
from ..gpu.wgsl.load import load
from ..options import Settings
from ..pictures.atomic_file import atomic_file, check_writable
from ..pictures.image import Array, load_image
from ..renderer import Renderer
from ..scene.scene import Scene

Progress = Callable[[str, float], None]

# The layers that are measured, and the renderer's buffers that hold them.
LAYERS = {"full": "radiance", "direct": "direct", "indirect": "indirect"}
# Of the two halves; any will do that nobody gives to a technique.
SEEDS = (0x7275_7468, 0x7275_7469)
TRACER_SHADERS = ("reference/path.wgsl", "reference/resolve.wgsl", "reference/primary.wgsl")
FILE_FORMATS = (".npz", ".exr")
NOISE_LAYERS = {"se_full": "full", "standard_error": "full", "se_indirect": "indirect"}
FILE_LAYERS = (*LAYERS.values(), "emit", "one", "multi", *NOISE_LAYERS, "depth")
NO_MATTER = ("name", "notes", "cameras")  # fields of a scene that no picture shows


@dataclass
class Truth:
    """Linear radiance at the pixel centres, (h, w, 3) float32 by layer, and its standard error where that is known.

    `surface` (h, w) tells which pixels see one: only these are measured. `source` is for people.
    """

    source: str
    layers: dict[str, Array]
    noise: dict[str, Array]
    surface: NDArray[np.bool_]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.surface.shape[1], self.surface.shape[0]


def truth_by_path(
    scene: Scene,
    camera: Camera,
    size: tuple[int, int],
    *,
    spp: int,
    bounces: int | None = None,
    diffuse: bool = False,
    visible_only: bool = False,
    adapter: str | None = None,
    progress: Progress | None = None,
) -> Truth:
    """Return the truth with `bounces` indirect bounces (None: all) from the cache, or render it and keep it there.

    With `visible_only`, light leaves only surfaces in the picture, as techniques in screen space have it.
    Raises GiError where the cache cannot be written, before any time is spent.
    """
    folder = cache_folder()
    key = truth_key(scene, camera, size, spp=spp, bounces=bounces, diffuse=diffuse, visible_only=visible_only)
    path = folder / f"{key}.npz"
    source = f"path tracer, {spp} spp" + (", of what is visible" if visible_only else "")
    arrays = _cached(path, size)
    if arrays is None:
        _make(folder)
        check_writable(path)
        settings = Settings(gi="path", spp=-(-spp // 2), bounces=bounces, diffuse=diffuse)
        settings.camera.jitter, settings.path.visible_only = False, visible_only
        arrays = _render(Renderer(scene, size=size, camera=camera, settings=settings, adapter=adapter), progress)
        with atomic_file(path) as temporary, temporary.open("wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]
    layers = {name: arrays[name] for name in LAYERS}
    return Truth(source, layers, {name: arrays[f"noise_{name}"] for name in LAYERS}, arrays["surface"])


def truth_from_file(path: str | Path, bounces: int | None = None) -> Truth:
    """Read a truth from the layers of an .npz or .exr, which are named in one of two ways.

    As `wgpu-gi render` names them: radiance, direct, indirect, emission, standard_error, depth. Or by the number of
    scatterings: emit, direct, one, multi, and se_full, se_indirect, depth; then one bounce can be asked for. What is
    not there is not measured, but the whole picture must be. Raises GiError if it is not, or the file unreadable.
    """
    path = Path(path)
    if path.suffix.lower() not in FILE_FORMATS:
        raise GiError(f"{path}: a truth has layers; give a file of {' or '.join(FILE_FORMATS)}")
    found = {}
    for name in FILE_LAYERS:
        with suppress(GiError):
            found[name] = load_image(path, name)
    if {"emit", "direct", "one"} <= found.keys():
        indirect = found["one"] if bounces == 1 or "multi" not in found else found["one"] + found["multi"]
        layers = {"full": found["emit"] + found["direct"] + indirect, "direct": found["direct"], "indirect": indirect}
    else:
        layers = {"full": load_image(path, "radiance")}
        layers |= {layer: found[layer] for layer in ("direct", "indirect") if layer in found}
    # A file's standard errors are those of all bounces: of the first alone, most of that noise is not there.
    cut = bounces == 1 and "one" in found and "multi" in found
    noise = {} if cut else {layer: found[n] for n, layer in NOISE_LAYERS.items() if n in found}
    shape = layers["full"].shape[:2]
    surface = found["depth"] > 0 if "depth" in found else np.ones(shape, bool)
    for name, layer in [*layers.items(), *noise.items()]:
        if layer.shape != (*shape, 3) or surface.shape != shape or not np.isfinite(layer).all():
            raise GiError(f"{path}: the layers of a truth are finite colours of one size; {name!r} is not")
    return Truth(str(path), layers, noise, surface)


def cache_folder() -> Path:
    """Return where truths are kept: in WGPU_GI_CACHE, or in wgpu_gi in the user's cache folder."""
    own = os.environ.get("WGPU_GI_CACHE")
    users = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return (Path(own) if own else Path(users) / "wgpu_gi") / "truth"


def truth_key(
    scene: Scene,
    camera: Camera,
    size: tuple[int, int],
    *,
    spp: int,
    bounces: int | None,
    diffuse: bool,
    visible_only: bool = False,
) -> str:
    """Return a name for the truth that differs if any thing does that it depends on, the path tracer included."""
    tracer = [load(shader).text for shader in TRACER_SHADERS]
    return _digest([tracer, scene, camera, list(size), spp, bounces, diffuse, visible_only, list(SEEDS)], {}).hex()


def _digest(value: Any, known: dict[int, bytes]) -> bytes:
    """Hash plain data: dataclasses without their names, arrays, lists, numbers, texts. `known` is by id of object."""
    if id(value) in known:
        return known[id(value)]
    total = hashlib.blake2b(type(value).__name__.encode(), digest_size=16)
    if is_dataclass(value):
        for field in fields(value):
            if field.name not in NO_MATTER:
                total.update(field.name.encode() + _digest(getattr(value, field.name), known))
        known[id(value)] = total.digest()  # a mesh may have many instances
    elif isinstance(value, np.ndarray):
        total.update(f"{value.dtype.str}{value.shape}".encode() + value.tobytes())
    elif isinstance(value, list | tuple):
        for item in value:
            total.update(_digest(item, known))
    else:
        total.update(repr(value).encode())
    return total.digest()


def _render(renderer: Renderer, progress: Progress | None) -> dict[str, NDArray]:
    halves = []
    try:
        for part, seed in enumerate(SEEDS):

            def report(fraction: float, part: int = part) -> None:
                if progress is not None:
                    progress("truth", (part + fraction) / len(SEEDS))

            renderer.settings.seed = seed
            renderer.run(report, show=(*LAYERS.values(), "depth"))
            halves.append({layer: renderer.read_back(buffer) for layer, buffer in LAYERS.items()})
        surface = renderer.read_back("depth") > 0
    finally:
        renderer.release()
    arrays: dict[str, NDArray] = {"surface": surface}
    for layer in LAYERS:
        one, other = (half[layer] for half in halves)
        arrays[layer] = (one + other) / 2
        arrays[f"noise_{layer}"] = np.abs(one - other) / 2
    return arrays


def _cached(path: Path, size: tuple[int, int]) -> dict[str, NDArray] | None:
    """Return the arrays of a cached truth; None if there is none, or a damaged one, which will be made anew."""
    shape = (size[1], size[0], 3)
    with suppress(Exception):  # whatever a decoder makes of a damaged file
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        wanted = [arrays[name] for layer in LAYERS for name in (layer, f"noise_{layer}")]
        if arrays["surface"].shape == shape[:2] and all(a.shape == shape and np.isfinite(a).all() for a in wanted):
            return arrays
    return None


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise GiError(
            f"the cache folder {folder} cannot be made ({error.strerror}); set WGPU_GI_CACHE to another"
        ) from None
