"""Reads textures and buffers back into numpy arrays, and makes neutral stand-ins for absent inputs."""

from __future__ import annotations

from typing import Any

import numpy as np
import wgpu

from ..errors import GiError
from .formats import FORMATS, Format
from .handles import Buffer, Shared, Texture, View

ROW_ALIGNMENT = 256  # bytes: WebGPU's row alignment of copies between textures and buffers


def read_back(gpu: Any, view: View, mip: int) -> np.ndarray:
    """Return the contents: (height, width, channels), after an axis of layers if there are several, or (count,)."""
    resource = view.resource
    item = resource.object(view.previous)
    if isinstance(resource, Buffer):
        data = gpu.queue.read_buffer(item, 0, resource.size_bytes)
        return np.frombuffer(data, resource.dtype, max(resource.count, 0)).copy()
    if isinstance(resource, Shared):
        if resource.is_buffer:
            return np.frombuffer(gpu.queue.read_buffer(item, 0, item.size), np.uint8).copy()
        texture = resource.texture
        if texture is None or resource.format is None:
            raise GiError(f"{resource.name!r} cannot be read back: its format is unknown")
        size = (max(1, texture.size[0] >> mip), max(1, texture.size[1] >> mip))
        return _read_texture(gpu, texture, resource.format, size, 0, texture.size[2], mip)
    assert isinstance(resource, Texture)
    if not 0 <= mip < resource.mips:
        raise GiError(f"texture {resource.name!r} has {resource.mips} mip levels; there is no level {mip}")
    layers = resource.layers
    if resource.dimension == "3d":
        layers = max(1, layers >> mip)
    first, count = (0, layers) if view.layer is None else (view.layer, 1)
    return _read_texture(gpu, item, resource.format, resource.mip_size(mip), first, count, mip)


def read_words(gpu: Any, buffer: Buffer, count: int) -> np.ndarray:
    """Return the first `count` u32 of a buffer."""
    return np.frombuffer(gpu.queue.read_buffer(buffer.object(), 0, 4 * count), np.uint32)


def _read_texture(
    gpu: Any, texture: Any, format: Format, size: tuple[int, int], first: int, layers: int, mip: int
) -> np.ndarray:
    width, height = size
    row = width * format.texel_bytes
    stride = -(-row // ROW_ALIGNMENT) * ROW_ALIGNMENT
    usage = wgpu.BufferUsage.COPY_DST | wgpu.BufferUsage.COPY_SRC
    buffer = gpu.create_buffer(label="read back", size=stride * height * layers, usage=usage)
    encoder = gpu.create_command_encoder(label="read back")
    aspect = "depth-only" if format.is_depth else "all"
    encoder.copy_texture_to_buffer(
        {"texture": texture, "mip_level": mip, "origin": (0, 0, first), "aspect": aspect},
        {"buffer": buffer, "offset": 0, "bytes_per_row": stride, "rows_per_image": height},
        (width, height, layers),
    )
    gpu.queue.submit([encoder.finish()])
    rows = np.frombuffer(gpu.queue.read_buffer(buffer, 0, buffer.size), np.uint8).reshape(layers, height, stride)
    buffer.destroy()
    texels = np.ascontiguousarray(rows[:, :, :row]).view(format.dtype)
    texels = texels.reshape(layers, height, width, format.channels)
    return texels[0] if layers == 1 else texels


def neutral(gpu: Any, kind: str, value: float | tuple[float, ...]) -> Shared:
    """Make a 1x1 texture of a WGSL kind such as "texture_2d<u32>", or a "buffer" of 256 zero bytes."""
    name = f"neutral {kind} {value}"
    if kind == "buffer":
        usage = wgpu.BufferUsage.STORAGE | wgpu.BufferUsage.UNIFORM | wgpu.BufferUsage.COPY_SRC
        return Shared(name, gpu.create_buffer(label=name, size=256, usage=usage), 0)
    shape, _, scalar = kind.rstrip(">").partition("<")
    if kind == "texture_depth_2d":
        # In WebGPU, only rendering can write depth, but every texture starts as zeros.
        usage = wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.RENDER_ATTACHMENT
        return Shared(name, gpu.create_texture(label=name, size=(1, 1, 1), format="depth32float", usage=usage), 0)
    formats = {"": "rgba16float", "f32": "rgba16float", "u32": "rgba32uint", "i32": "rgba32sint"}
    shapes = {"texture_2d": 1, "texture_2d_array": 1, "texture_3d": 1, "texture_cube": 6}
    if shape not in shapes or scalar not in formats:
        raise GiError(
            f"there is no neutral {kind!r}; available: buffer, texture_depth_2d, {', '.join(shapes)}, of f32, u32, i32"
        )
    format, layers = FORMATS[formats[scalar]], shapes[shape]
    texture = gpu.create_texture(
        label=name,
        size=(1, 1, layers),
        dimension="3d" if shape == "texture_3d" else "2d",
        format=format.name,
        usage=wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_DST | wgpu.TextureUsage.COPY_SRC,
    )
    texel = np.broadcast_to(np.asarray(value, format.dtype), (layers, 4))
    gpu.queue.write_texture(
        {"texture": texture}, texel.tobytes(), {"bytes_per_row": 16, "rows_per_image": 1}, (1, 1, layers)
    )
    return Shared(name, texture, 0)
