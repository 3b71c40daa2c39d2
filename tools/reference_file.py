"""The file of a reference: layers by number of scatterings and their standard errors, as float16; the scene's hash."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wgpu_gi.errors import GiError
from wgpu_gi.measure.metrics import noise_floor
from wgpu_gi.pictures.atomic_file import atomic_file
from wgpu_gi.scene.scene import Scene, values_of

Array = NDArray[np.float32]

# Largest path depth of each rendered picture, as Mitsuba counts: 1 is emission alone, -1 no limit.
DEPTHS = {"emit": 1, "direct": 2, "one": 3, "all": -1}
# Largest rounding error of float16 (11 bits), as relMSE: far below any noise worth storing.
MOST_ROUNDING = 1e-6
ERROR_BITS = 4
FLOAT16_BITS = 11


def layers_of(pictures: dict[str, NDArray[np.float64]]) -> dict[str, Array]:
    """Return layers and their standard errors from pictures (runs, height, width, 3) by the names of DEPTHS."""
    emit, direct, one, everything = (np.asarray(pictures[name], np.float64) for name in DEPTHS)
    samples = {
        "emit": emit,
        "direct": direct - emit,
        "one": one - direct,
        "multi": everything - one,
        "indirect": everything - direct,
        "full": everything,
    }
    error = {name: runs.std(0, ddof=1) / len(runs) ** 0.5 for name, runs in samples.items()}
    layers = {name: samples[name].mean(0) for name in ("emit", "direct", "one", "multi")}
    layers |= {f"se_{name}": error[name] for name in ("direct", "one", "multi", "indirect", "full")}
    return {name: layer.astype(np.float32) for name, layer in layers.items()}


def noise_of(layers: dict[str, Array]) -> dict[str, float]:
    """Return the relMSE of a perfect picture by layer, over the pixels that hit a surface, without black layers."""
    sums = {
        "direct": layers["direct"],
        "one": layers["one"],
        "multi": layers["multi"],
        "indirect": layers["one"] + layers["multi"],
        "full": layers["emit"] + layers["direct"] + layers["one"] + layers["multi"],
    }
    hit = layers["depth"] > 0
    return {
        name: float(f"{noise_floor(layers[f'se_{name}'], layer, hit):.3g}")
        for name, layer in sums.items()
        if hit.any() and layer[hit].mean() > 0
    }


def packed(layers: dict[str, Array]) -> dict[str, NDArray[np.float16]]:
    """Return the layers as float16, standard errors to 4 bits. Raises GiError for what float16 cannot hold."""
    result = {}
    for name, layer in layers.items():
        with np.errstate(over="ignore"):
            half = layer.astype(np.float16)
        if not np.isfinite(half).all():
            raise GiError(f"layer {name!r} has values above 65504, which float16 cannot hold; make the lights dimmer")
        if name.startswith("se_"):
            dropped = FLOAT16_BITS - ERROR_BITS
            # Rounding bits to the nearest may carry into the exponent, which is right.
            bits = half.view(np.uint16) + np.uint16(1 << (dropped - 1))
            half = (bits & np.uint16(0xFFFF << dropped & 0xFFFF)).view(np.float16)
        elif layer.any() and _rounding(half, layer) > MOST_ROUNDING:
            raise GiError(f"layer {name!r} is too dim for float16; make the lights brighter")
        result[name] = half
    return result


def _rounding(half: NDArray[np.float16], layer: Array) -> float:
    x, t = half.astype(np.float64), layer.astype(np.float64)
    return float(np.mean((x - t) ** 2 / (t**2 + 0.01 * np.abs(t).mean() ** 2)))


def scene_hash(source: str, scene: Scene) -> str:
    """Return the SHA-256 of the scene file's bytes, or for a built-in scene that of its shapes, colours and lights."""
    path = Path(source)
    if path.suffix:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    digest, parts = hashlib.sha256(), list[Any]()
    for instance in scene.instances:
        mesh = instance.mesh
        parts += [instance.world_from_local, mesh.positions, mesh.triangles]
        parts += [value for m in mesh.materials for value in (m.base_color, m.emission, m.double_sided)]
    for light in scene.lights:
        parts += [value for name, value in values_of(light).items() if name not in ("name", "range")]
    if scene.environment is not None:
        parts.append(scene.environment.color)
    for part in parts:
        # Rounded, since sines and cosines differ in their last bits from one machine to the next.
        digest.update((np.round(np.asarray(part, np.float64), 4) + 0.0).astype("<f8").tobytes())
    return digest.hexdigest()


def write(path: Path, layers: dict[str, Array], meta: dict[str, Any]) -> None:
    """Write layers and a JSON text; the file appears complete or not at all. Raises GiError if it cannot be written."""
    arrays: dict[str, NDArray[Any]] = {**packed(layers), "meta": np.array(json.dumps(meta))}
    with atomic_file(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
