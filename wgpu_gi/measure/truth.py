"""The truth that techniques are compared with: path traced and cached, or read from a file.

The path tracer renders two pictures with different seeds, each with half of the samples. Their mean is the truth; half
of their difference is its standard error. Unlike the variance of the samples within one picture, this includes the gain
of stratification and exists for each layer.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .. import resources
from ..camera import Camera
from ..errors import GiError
from ..gpu.wgsl.load import load
from ..options import Settings
from ..pictures.atomic_file import atomic_file, check_writable
from ..pictures.image import Array, load_image
from ..renderer import Renderer
from ..scene.digest import digest
from ..scene.scene import Scene

Progress = Callable[[str, float], None]

# The measured layers and the renderer's buffers that hold them.
LAYERS = {"full": "radiance", "direct": "direct", "indirect": "indirect"}
# Seeds of the two halves. A technique with one of them would have the noise of the truth, so they are unlikely numbers.
SEEDS = (0x7275_7468, 0x7275_7469)
TRACER_SHADERS = ("reference/path.wgsl", "reference/resolve.wgsl", "reference/primary.wgsl")
FILE_FORMATS = (".npz", ".exr")
NOISE_LAYERS = {"se_full": "full", "standard_error": "full", "se_indirect": "indirect"}
FILE_LAYERS = (*LAYERS.values(), "emit", "one", "multi", *NOISE_LAYERS, "depth")


@dataclass
class Truth:
    """Linear radiance at the pixel centres, (h, w, 3) float32 by layer, and its standard error where known.

    `surface` (h, w) marks the pixels that see a surface; only these are measured. `source` is a short description.
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
    """Return the truth with `bounces` indirect bounces (None: all) from the cache, or render and cache it.

    With `visible_only`, only surfaces in the picture send light, as in screen-space techniques. Raises GiError before
    rendering if the cache cannot be written.
    """
    # Look in the cache.
    folder = cache_folder()
    key = truth_key(scene, camera, size, spp=spp, bounces=bounces, diffuse=diffuse, visible_only=visible_only)
    path = folder / f"{key}.npz"
    source = f"path tracer, {spp} spp" + (", visible surfaces only" if visible_only else "")
    arrays = _cached(path, size)
    if arrays is None:
        # Check that the cache is writable, then render.
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
    """Read a truth from the layers of an .npz or .exr.

    Layers have the names of `wgpu-gi render` (radiance, direct, indirect, emission, standard_error, depth) or names by
    number of scatterings (emit, direct, one, multi, se_full, se_indirect, depth); these also give a one-bounce truth.
    Missing layers are not measured. Raises GiError without a full picture, and for an unreadable file.
    """
    # Read all layers that exist.
    path = Path(path)
    if path.suffix.lower() not in FILE_FORMATS:
        raise GiError(f"{path}: a truth has layers; give a file of {' or '.join(FILE_FORMATS)}")
    found = {}
    for name in FILE_LAYERS:
        with suppress(GiError):
            found[name] = load_image(path, name)

    # Add up the layers that are measured, and choose the noise that belongs to them.
    if {"emit", "direct", "one"} <= found.keys():
        indirect = found["one"] if bounces == 1 or "multi" not in found else found["one"] + found["multi"]
        layers = {"full": found["emit"] + found["direct"] + indirect, "direct": found["direct"], "indirect": indirect}
    else:
        layers = {"full": load_image(path, "radiance")}
        layers |= {layer: found[layer] for layer in ("direct", "indirect") if layer in found}
    # The standard errors of a file include all bounces; the first bounce alone has far less noise.
    cut = bounces == 1 and "one" in found and "multi" in found
    noise = {} if cut else {layer: found[n] for n, layer in NOISE_LAYERS.items() if n in found}

    # Check that they fit together.
    shape = layers["full"].shape[:2]
    surface = found["depth"] > 0 if "depth" in found else np.ones(shape, bool)
    for name, layer in [*layers.items(), *noise.items()]:
        if layer.shape != (*shape, 3) or surface.shape != shape or not np.isfinite(layer).all():
            raise GiError(f"{path}: the layers of a truth are finite colours of one size; {name!r} is not")
    return Truth(str(path), layers, noise, surface)


def cache_folder() -> Path:
    """Return the folder of cached truths."""
    return resources.cache_folder("truth")


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
    """Return a name that depends on everything the truth depends on, the path tracer's shaders included."""
    tracer = [load(shader).text for shader in TRACER_SHADERS]
    return digest([tracer, scene, camera, list(size), spp, bounces, diffuse, visible_only, list(SEEDS)])


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
    """Return the arrays of a cached truth, None if it is missing or damaged."""
    shape = (size[1], size[0], 3)
    with suppress(Exception):  # decoders raise anything for damaged files
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
