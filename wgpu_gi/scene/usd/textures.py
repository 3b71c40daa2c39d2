"""Reads the textures of a stage: UsdUVTexture with UsdTransform2d and UsdPrimvarReader, from folders and archives."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...float_limits import LARGEST_FACTOR
from ...pictures.color import linear_from_srgb, srgb_from_linear
from ..files.polygons import Floats
from ..scene import Image, Texture, Wrap
from .stage import Stage, number

Four = tuple[float, float, float, float]

_WRAPS: dict[str, Wrap] = {"repeat": "repeat", "mirror": "mirror", "clamp": "clamp", "black": "clamp"}
_CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}
_DEEPEST = 8  # nodes between a texture and what it reads
_IDENTITY: Four = (1.0, 1.0, 1.0, 1.0)
_NOTHING: Four = (0.0, 0.0, 0.0, 0.0)


@dataclass
class Sampled:
    """An output of a texture: decoded value * scale + bias. `texture` has its place on the surface, without pixels."""

    pixels: NDArray[Any]
    name: str
    texture: Texture
    texcoords: str
    scale: Four
    bias: Four
    channel: int | None  # None: rgb
    is_srgb: bool


class Textures:
    """The textures of a stage; each picture is decoded once."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._images: dict[tuple[str, bool], Image | None] = {}
        # Textures may lie in the folders of all layers, and in the one that holds these, unless that is the whole disk.
        layers = [Path(layer.realPath).resolve().parent for layer in stage.usd.GetUsedLayers() if layer.realPath]
        shared = Path(os.path.commonpath(layers)) if len({folder.anchor for folder in layers}) == 1 else None
        self._folders = {*layers, *([shared] if shared and shared != Path(shared.anchor) else [])}

    def reader_of(self, attribute: Any) -> str | None:
        """Return the name of the primvar that a UsdPrimvarReader gives to an output; None for anything else."""
        shader = _shader_of(attribute)
        if shader is None or not str(shader.GetIdAttr().Get()).startswith("UsdPrimvarReader"):
            return None
        name = _value(shader, "varname", self._stage)
        return str(name) if name else None

    def sampled(self, output: Any, deep: bool = False) -> Sampled | None:
        """Return the texture whose output an attribute is; None, with a note if it cannot be loaded. See `image`."""
        shader = _shader_of(output)
        if shader is None or str(shader.GetIdAttr().Get()) != "UsdUVTexture":
            if shader is not None and self.reader_of(output) is None:
                self._stage.note(
                    f"{shader.GetPath()}: the node {str(shader.GetIdAttr().Get())[:60]!r} is not supported"
                )
            return None
        asset = _value(shader, "file", self._stage)
        image = self.image(asset, deep) if asset is not None else None
        if image is None:
            if asset is None:
                self._stage.damage(f"{shader.GetPath()} names no file; the plain colour is used")
            return None
        texture, name = self._placement(shader, image)
        space = str(_value(shader, "sourceColorSpace", self._stage) or "auto")
        return Sampled(
            image.pixels, image.name, texture, name,
            _four(_value(shader, "scale", self._stage), _IDENTITY),
            _four(_value(shader, "bias", self._stage), _NOTHING),
            _CHANNELS.get(output.GetName().rpartition(":")[2]), space != "raw",
        )  # fmt: skip

    def _placement(self, shader: Any, image: Image) -> tuple[Texture, str]:
        """Return a texture with wrap modes and transform, and the name of its texture coordinates."""
        wraps = []
        for name in ("wrapS", "wrapT"):
            mode = str(_value(shader, name, self._stage) or "useMetadata")
            if mode == "black":
                self._stage.note(f"{shader.GetPath()}: {name} black is shown as clamp")
            wraps.append(_WRAPS.get(mode, "repeat"))
        texture = Texture(image, wraps[0], wraps[1])
        # Follow the nodes to the reader of texture coordinates; transforms apply to what they read.
        st, matrix = _producer(shader, "st"), np.eye(3)
        for _ in range(_DEEPEST):
            node = _shader_of(st)
            if node is None or str(node.GetIdAttr().Get()) != "UsdTransform2d":
                break
            matrix = matrix @ self._transform(node)
            st = _producer(node, "in")
        self._apply(texture, matrix, shader)
        return texture, self.reader_of(st) or "st"

    def _transform(self, node: Any) -> Floats:
        """Return the matrix of a UsdTransform2d: scaled, then turned counter-clockwise, then moved; v points up."""
        angle = math.radians(number(_producer(node, "rotation"), self._stage.time, 0.0))
        (su, sv), (tu, tv) = (
            _pair(_value(node, name, self._stage), default) for name, default in (("scale", 1.0), ("translation", 0.0))
        )
        c, s = math.cos(angle), math.sin(angle)
        return np.array([[c * su, -s * sv, tu], [s * su, c * sv, tv], [0, 0, 1]])

    def _apply(self, texture: Texture, matrix: Floats, shader: Any) -> None:
        """Set a texture's transform from one of texture coordinates with v up; ours have w = 1 - v."""
        flip = np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])
        down = flip @ matrix @ flip
        if not np.abs(down).max() <= LARGEST_FACTOR:
            self._stage.damage(f"{shader.GetPath()}: its transform is out of range; it was ignored")
            return
        # A rotation times a scale, as KHR_texture_transform has it: u' = c su u + s sv w, w' = -s su u + c sv w.
        su = math.hypot(down[0, 0], down[1, 0])
        angle = math.atan2(-down[1, 0], down[0, 0])
        sv = math.sin(angle) * down[0, 1] + math.cos(angle) * down[1, 1]
        skew = math.cos(angle) * down[0, 1] - math.sin(angle) * down[1, 1]
        if abs(skew) > 1e-6 * max(abs(sv), su):
            self._stage.note(f"{shader.GetPath()}: the skew of its transforms is not shown")
        texture.scale, texture.rotation = (su, sv), angle
        texture.offset = float(down[0, 2]), float(down[1, 2])

    def image(self, asset: Any, deep: bool = False) -> Image | None:
        """Return the picture of an asset path; None, with a note, if it cannot be loaded. `deep` keeps 16 bits."""
        key = str(asset.resolvedPath or asset.path), deep
        if key not in self._images:
            self._images[key] = self._load(asset, deep)
        return self._images[key]

    def bytes_of(self, asset: Any) -> bytes | None:
        """Return the bytes of an asset in a file or archive; None, with a note, if it is missing or elsewhere."""
        from pxr import Ar

        resolved = asset.resolvedPath
        if not resolved and "\\" in asset.path:
            # Windows writes paths in its own way.
            beside = (folder / asset.path.replace("\\", "/") for folder in self._folders)
            resolved = next((str(file) for file in beside if file.is_file()), "")
        outer = str(resolved).partition("[")[0] if resolved else str(asset.path)
        folder = Path(outer).resolve().parent if resolved else None
        if folder is not None and not any(folder.is_relative_to(known) for known in self._folders):
            self._stage.damage(f"texture {asset.path[:80]!r} is outside the folders of the scene; it was left out")
            return None
        opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved)) if resolved else None
        if opened is None:
            self._stage.damage(f"texture {asset.path[:80]!r} does not exist; it was left out")
            return None
        self._stage.budget.take(opened.GetSize(), f"{self._stage.source}: {asset.path[:80]}")
        return bytes(opened.GetBuffer())

    def _load(self, asset: Any, deep: bool) -> Image | None:
        from ..files.image_files import decode_image, open_image, without_warnings  # imports Pillow

        if "<UDIM>" in asset.path:
            self._stage.note(f"texture {asset.path[:80]!r}: tiles (UDIM) are not supported; it was left out")
            return None
        data = self.bytes_of(asset)
        if data is None:
            return None
        with without_warnings():
            picture = open_image(data, self._stage.budget, f"{self._stage.source}: {asset.path[:80]}", deep)
            pixels = decode_image(picture, srgb=not deep)
        if isinstance(pixels, str) or isinstance(picture, str):
            self._stage.damage(f"texture {asset.path[:80]!r} cannot be used: {pixels}; it was left out")
            return None
        if picture.note:
            self._stage.note(f"texture {asset.path[:80]!r}: {picture.note}")
        return Image(pixels, Path(asset.path).name)


def color_image(sampled: Sampled, stage: Stage) -> tuple[Image, tuple[float, float, float]]:
    """Return a texture of colours as an sRGB picture, and the linear factor that multiplies it."""
    scale, bias = np.array(sampled.scale[:3]), np.array(sampled.bias[:3])
    plain = not bias.any() and ((scale >= 0) & (scale <= 1)).all()
    if plain and sampled.is_srgb and sampled.channel is None:
        return Image(sampled.pixels, sampled.name), (float(scale[0]), float(scale[1]), float(scale[2]))
    # Apply scale and bias to linear values.
    stage.budget.take(sampled.pixels.size * 8, f"{stage.source}: {sampled.name}")
    values = sampled.pixels[..., :3] / 255.0
    if sampled.is_srgb:
        values = linear_from_srgb(values)
    if sampled.channel is not None:
        values = plane(sampled)[..., None].repeat(3, -1)
    else:
        values = (values * scale + bias).clip(0, 1)
    rgb = np.round(255 * srgb_from_linear(values)).astype(np.uint8)
    return Image(np.dstack([rgb, sampled.pixels[..., 3]]), sampled.name), (1.0, 1.0, 1.0)


def plane(sampled: Sampled) -> Floats:
    """Return one channel of a texture as numbers from 0 to 1, (height, width)."""
    channel = sampled.channel or 0
    values = sampled.pixels[..., channel] / 255.0
    # Numbers are stored as they are; only a file that says so has them in sRGB.
    result: Floats = (values * sampled.scale[channel] + sampled.bias[channel]).clip(0, 1)
    return result


def resampled(values: Floats, height: int, width: int) -> Floats:
    """Return a plane of another size, by its nearest pixels."""
    lines = np.arange(height) * values.shape[0] // height
    columns = np.arange(width) * values.shape[1] // width
    return values[lines[:, None], columns]


def _producer(shader: Any, name: str) -> Any:
    """Return the attribute that gives an input its value; None without one."""
    found = shader.GetInput(name)
    producers = found.GetValueProducingAttributes() if found else []
    return producers[0] if producers else None


def _value(shader: Any, name: str, stage: Stage) -> Any:
    """Return the value of an input, None without one."""
    attribute = _producer(shader, name)
    return attribute.Get(stage.time) if attribute else None


def _shader_of(attribute: Any) -> Any:
    """Return the shader whose output an attribute is; None for other attributes."""
    from pxr import UsdShade

    if attribute and UsdShade.Output.IsOutput(attribute):
        shader = UsdShade.Shader(attribute.GetPrim())
        return shader if shader and attribute.GetPrim().IsA(UsdShade.Shader) else None
    return None


def _four(value: Any, default: Four) -> Four:
    """Return four finite numbers; `default` without them."""
    return default if (found := _numbers(value, 4)) is None else (found[0], found[1], found[2], found[3])


def _pair(value: Any, default: float) -> tuple[float, float]:
    return (default, default) if (found := _numbers(value, 2)) is None else (found[0], found[1])


def _numbers(value: Any, count: int) -> list[float] | None:
    try:
        numbers = [float(each) for each in value]
    except TypeError:
        return None
    return numbers if len(numbers) == count and all(abs(n) <= LARGEST_FACTOR for n in numbers) else None
