"""Reads and writes pictures: linear float layers (.npy .npz .exr .hdr), 8-bit sRGB (.png .jpg .webp).

Arrays are (height, width, 3) or (height, width) float32, row 0 on top; (height, width, 4) is RGBA, with colours
multiplied by alpha. Float files hold linear values without exposure or tone curve.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import GiError
from .atomic_file import atomic_file, check_writable
from .color import linear_from_srgb
from .display import checked
from .exposure import NOT_EXPOSED, automatic_exposure, is_exposed
from .exr_files import read_exr
from .writers import EXR_MAIN_NAME, WRITERS

Array = NDArray[np.float32]

FORMATS = (*WRITERS,)
ONE_LAYER_FORMATS = (".png", ".npy", ".jpg", ".jpeg", ".webp", ".hdr")
OPAQUE_FORMATS = (".jpg", ".jpeg", ".hdr")  # hold no alpha
DISPLAYED_FORMATS = (".png", ".jpg", ".jpeg", ".webp")  # 8 bits, with exposure and tone curve
LARGEST_PICTURE = 4 << 30  # bytes in memory, of all layers together


def check_output(path: str | Path, layers: Sequence[str] = ("radiance",), transparent: bool = False) -> None:
    """Raise GiError now if `layers` could not be written to `path` later: format, alpha of radiance, folder, rights."""
    check_format(path, layers, transparent)
    check_writable(path)


def check_format(path: str | Path, layers: Sequence[str] = ("radiance",), transparent: bool = False) -> None:
    """Raise GiError if the format of a file, by its name, cannot hold `layers`, or the alpha of radiance."""
    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise GiError(f"{path}: unknown picture format {path.suffix!r}; use one of {' '.join(FORMATS)}")
    if transparent and layers[0] not in NOT_EXPOSED and path.suffix.lower() in OPAQUE_FORMATS:
        raise GiError(f"{path}: {path.suffix} holds no transparency; use .png, .webp or .exr")
    if len(layers) > 1 and path.suffix.lower() in ONE_LAYER_FORMATS:
        raise GiError(f"{path}: {path.suffix} holds one buffer; for {', '.join(layers)} use .exr or .npz")


def exposure_for(path: str | Path, given: float | None, name: str, layer: ArrayLike) -> float | None:
    """Return the EV of the buffer `name` in a picture or video: `given`, or automatic.

    None for linear files and for buffers that hold no light.
    """
    if Path(path).suffix.lower() not in (*DISPLAYED_FORMATS, ".mp4") or not is_exposed(name):
        return None
    return automatic_exposure(layer) if given is None else given


def save_image(
    path: str | Path,
    layers: Mapping[str, ArrayLike] | NDArray,
    *,
    exposure: float | None = None,
    metadata: Mapping[str, object] | None = None,
) -> None:
    """Write `layers`, or a single picture, in the format of the extension. The first layer is the main one.

    `.npy` holds the layer unchanged; `.npz` every layer by name; `.exr` the main layer as R, G, B (Z for depth, Y for
    another single channel) and the others as `name.R` ... (`name.Z`, `name.V`), float32; `.hdr` the main layer with
    shared exponents, to 0.4 %; `.png`, `.webp` (lossless) and `.jpg` (quality 95) the main layer in 8-bit sRGB by
    `display_layer`, with automatic `exposure` if it is None. RGBA keeps alpha by each format's convention: `.exr`,
    `.npy` and `.npz` multiplied (associated), `.png` and `.webp` not. `metadata` goes into the EXR header, the PNG
    text, which also has the exposure, and as JSON into the array `metadata` of an .npz. The file appears complete or
    not at all. Raises GiError if it cannot be written.
    """
    path = _path(path, "saved to")
    if isinstance(layers, np.ndarray):
        layers = {getattr(layers, "name", "radiance"): layers}
    if not isinstance(layers, Mapping) or not layers:
        raise GiError(f"layers must be a picture, or a dictionary of pictures by name, not a {type(layers).__name__}")
    arrays = {name: checked(name, layer) for name, layer in layers.items()}
    main = next(iter(arrays))
    check_output(path, tuple(arrays), arrays[main].shape[2:] == (4,))
    suffix = path.suffix.lower()
    if suffix not in DISPLAYED_FORMATS:
        arrays = {name: array.astype(np.float32, copy=False) for name, array in arrays.items()}
    texts = {key: str(value) for key, value in (metadata or {}).items()}
    with atomic_file(path) as temporary:
        WRITERS[suffix](temporary, arrays, exposure, texts)


def load_image(path: str | Path, layer: str | None = None) -> Array:
    """Read a picture as linear float32, (height, width, 3) or (height, width); alpha is left out.

    `layer` names a layer of an .exr or .npz; None means the main (first) one. Files of 8 bits are decoded from sRGB.
    `load_environment` reads .hdr. Raises GiError
    for a missing, unreadable or unknown file, and for a layer that the file does not hold.
    """
    path = _path(path, "loaded from")
    suffix = path.suffix.lower()
    if suffix not in _READERS:
        raise GiError(f"{path}: unknown picture format {path.suffix!r}; use one of {' '.join(_READERS)}")
    if not path.is_file():
        raise GiError(f"{path}: no such file")
    try:
        layers = _READERS[suffix](path)
    except Exception as error:  # decoders raise anything for damaged files
        raise GiError(f"{path}: not a readable {suffix} picture ({error})") from None
    if layer is not None and suffix in ONE_LAYER_FORMATS:
        raise GiError(f"{path}: {suffix} holds one buffer, without a name; leave out {layer!r}")
    if not layers or (layer is not None and layer not in layers):
        raise GiError(f"{path}: holds no layer {layer or 'at all'}; it has: {', '.join(layers)}")
    name = next(iter(layers)) if layer is None else layer
    if layers[name].dtype.kind not in "biuf":
        raise GiError(f"{path}:{name} holds no numbers; name a layer that is a picture")
    return np.ascontiguousarray(layers[name], np.float32)


def _path(path: Any, what: str) -> Path:
    """Return a path. Raises GiError for other objects."""
    if not isinstance(path, (str, PathLike)):
        raise GiError(f"a picture is {what} a path, not {str(path)[:60] or 'nothing'}")
    return Path(path)


def _read_npy(path: Path) -> dict[str, Array]:
    return {"": np.load(path, allow_pickle=False)}


def _read_npz(path: Path) -> dict[str, Array]:
    with ZipFile(path) as archive:
        _check_bytes(sum(entry.file_size for entry in archive.infolist()))
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


def _read_8_bits(path: Path) -> dict[str, Array]:
    from PIL import Image

    with warnings.catch_warnings(), Image.open(path, formats=("PNG", "JPEG", "WEBP")) as image:
        warnings.simplefilter("ignore")  # of sizes that are refused here, and of damaged metadata
        _check_bytes(12 * image.width * image.height)
        return {"": linear_from_srgb(np.asarray(image.convert("RGB"), np.float32) / 255.0)}


def _read_exr(path: Path) -> dict[str, Array]:
    header, channels = read_exr(path, lambda width, height, size: _check_bytes(size))
    main = str(header.get(EXR_MAIN_NAME, "main"))
    grouped: dict[str, dict[str, Array]] = {}
    for full_name, pixels in channels.items():
        name, _, letter = full_name.rpartition(".")
        grouped.setdefault(name or main, {})[letter] = pixels
    layers = {
        name: np.stack([of["R"], of["G"], of["B"]], -1) if {"R", "G", "B"} <= of.keys() else next(iter(of.values()))
        for name, of in grouped.items()
    }
    return {main: layers.pop(main), **layers} if main in layers else layers


def _check_bytes(size: int) -> None:
    """Raise ValueError for a file whose header announces more than any picture has."""
    if size > LARGEST_PICTURE:
        raise ValueError(f"it would unpack to {size / 2**30:.1f} GiB")


_READERS = {".npy": _read_npy, ".npz": _read_npz, ".exr": _read_exr}
_READERS |= dict.fromkeys(DISPLAYED_FORMATS, _read_8_bits)
