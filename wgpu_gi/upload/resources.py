"""A scene's buffers and textures on the GPU by name, each with a version that grows with its contents."""

from __future__ import annotations

from typing import Any

import numpy as np
import wgpu
from numpy.typing import NDArray

from ..errors import GiError
from ..webgpu_limits import MAX_TEXTURE_SIDE

TABLE_WIDTH = 4096  # texels of a table in a row (wgsl/scene/geometry.wgsl)


class GpuResources:
    """Creates, fills and replaces resources; `[name]` is (wgpu object, version)."""

    def __init__(self, gpu: Any, limit: int) -> None:
        self.gpu = gpu
        self._limit = limit  # bytes of a buffer that the device can bind
        self._known: dict[str, tuple[Any, int]] = {}
        self._contents: dict[str, bytes] = {}  # bytes of the small buffers, to detect changes
        self._sent: dict[str, NDArray[np.uint64]] = {}  # the texels of each table on the GPU

    def __getitem__(self, name: str) -> tuple[Any, int]:
        return self._known[name]

    def __contains__(self, name: str) -> bool:
        return name in self._known

    def versions(self) -> dict[str, int]:
        """Return the version of each resource."""
        return {name: version for name, (_, version) in self._known.items()}

    def release(self) -> None:
        """Destroy all resources."""
        for resource, _ in self._known.values():
            resource.destroy()
        self._known = {}

    def texture(self, name: str, texture_format: str, pixels: NDArray[np.float32]) -> None:
        """Create a texture from float32 pixels (height, width, channels)."""
        height, width, channels = pixels.shape
        texture = self.gpu.create_texture(
            label=f"scene/{name}",
            size=(width, height, 1),
            format=texture_format,
            usage=wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_DST,
        )
        layout = {"bytes_per_row": 4 * channels * width, "rows_per_image": height}
        self.gpu.queue.write_texture({"texture": texture}, np.ascontiguousarray(pixels), layout, (width, height, 1))
        self.set(name, texture)

    def records(self, name: str, array: NDArray) -> None:
        """Send the records of a small buffer if any of them changed."""
        contents = array.tobytes()
        if self._contents.get(name) != contents:
            self._contents[name] = contents
            self.buffer(name, array)

    def buffer(self, name: str, array: NDArray) -> None:
        """Send a buffer: into the existing one if it has the same size, else into a new one.

        Raises GiError if the device cannot bind so many bytes.
        """
        if array.nbytes > self._limit:
            raise GiError(
                f"the scene's {name} take {array.nbytes / 2**20:.0f} MiB; this device binds at most"
                f" {self._limit / 2**20:.0f} MiB: use fewer triangles"
            )
        old, version = self._known.get(name, (None, 0))
        if old is not None and old.size == array.nbytes:
            self.gpu.queue.write_buffer(old, 0, array)
            self._known[name] = (old, version + 1)
            return
        usage = wgpu.BufferUsage.STORAGE | wgpu.BufferUsage.COPY_DST
        if name == "raster_indices":
            usage |= wgpu.BufferUsage.INDEX
        buffer = self.gpu.create_buffer(label=f"scene/{name}", size=array.nbytes, usage=usage)
        self.gpu.queue.write_buffer(buffer, 0, array)
        self.set(name, buffer)

    def part(self, name: str, first: int, rows: NDArray) -> None:
        """Send some rows of a buffer, from row `first` on."""
        buffer, version = self._known[name]
        self.gpu.queue.write_buffer(buffer, first * rows[0].nbytes, np.ascontiguousarray(rows))
        self._known[name] = (buffer, version + 1)

    def table(self, name: str, array: NDArray) -> None:
        """Send records as 16-byte texels of a texture, only from the first to the last row that changed.

        Raises GiError if the texture would have too many rows.
        """
        texels = array.nbytes // 16
        rows = -(-texels // TABLE_WIDTH)
        if rows > MAX_TEXTURE_SIDE:
            raise GiError(
                f"the scene's {name} fill {rows} rows of a texture; {MAX_TEXTURE_SIDE} are possible:"
                " use fewer triangles"
            )
        # Lay the records out in rows, and find those that changed, in words of 64 bits.
        pixels = np.zeros((rows, TABLE_WIDTH * 2), np.uint64)
        pixels.view(np.uint8).ravel()[: array.nbytes] = np.ascontiguousarray(array).view(np.uint8).ravel()
        first, last = 0, rows - 1
        if name in self._known and self._sent[name].shape == pixels.shape:
            different = np.flatnonzero((pixels != self._sent[name]).any(1))
            if not len(different):
                return
            first, last = int(different[0]), int(different[-1])
            texture, version = self._known[name]
            self._known[name] = (texture, version + 1)
        else:
            usage = wgpu.TextureUsage.STORAGE_BINDING | wgpu.TextureUsage.COPY_DST
            size = (TABLE_WIDTH, rows, 1)
            texture = self.gpu.create_texture(label=f"scene/{name}", size=size, format="rgba32uint", usage=usage)
            self.set(name, texture)
        # Send them.
        self._sent[name] = pixels
        self.gpu.queue.write_texture(
            {"texture": texture, "origin": (0, first, 0)},
            pixels[first : last + 1],
            {"bytes_per_row": TABLE_WIDTH * 16, "rows_per_image": last + 1 - first},
            (TABLE_WIDTH, last + 1 - first, 1),
        )

    def touch(self, name: str) -> None:
        """Note that the contents of a resource change on the device."""
        resource, version = self._known[name]
        self._known[name] = (resource, version + 1)

    def set(self, name: str, resource: Any) -> None:
        """Store a wgpu object under a name, and destroy the one that it replaces."""
        old, version = self._known.get(name, (None, 0))
        self._known[name] = (resource, version + 1)
        if old is not None:
            old.destroy()
