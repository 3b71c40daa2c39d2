"""The handles of a declaration: textures, buffers, shared resources, uniforms and samplers, and views of them.

A handle is a name and a size until `Graph.compile`, which allocates what the passes use. A resource that is declared
again with the same name and shape keeps its handle and its contents.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import wgpu

from ..errors import GiError
from .formats import FORMATS, Format
from .messages import reason

VIEW_DIMENSIONS = {
    "1d": "1d",
    "2d": "2d",
    "2d_array": "2d-array",
    "3d": "3d",
    "cube": "cube",
    "cube_array": "cube-array",
}


class Resource:
    """Contents that passes read and write. `gpu` holds the wgpu object, or two with history; empty until allocated.

    `stamp` changes with each allocation, and when the contents change outside the graph. A pass is stale if the stamp
    of an input has changed since its last run. `bound` changes with the wgpu object that `object` returns; bind groups
    depend on it.
    """

    name: str
    history = False
    nonnegative = False

    def __init__(self, name: str) -> None:
        self.name = name
        self.gpu: list[Any] = []
        self.usage = 0
        self.stamp: Any = 0
        self.bound = 0  # twice the number of allocations, plus the index of the current object

    @property
    def previous(self) -> View:
        """The contents before the last run of the pass that writes them; needs `history=True`."""
        if not self.history:
            raise GiError(f"{self.name!r} has no previous contents; declare it with history=True")
        return View(self, previous=True)

    def slots(self, mip: int | None) -> Iterable[Slot]:
        """Return the parts that are tracked separately: each mip level."""
        return ((self, 0),)

    def object(self, previous: bool = False) -> Any:
        """Return the wgpu texture or buffer. Raises GiError if no active pass uses it."""
        if not self.gpu:
            raise GiError(f"{self.name!r} is not allocated: no active pass uses it")
        return self.gpu[(self.bound ^ previous) & 1]

    def swap(self) -> None:
        """Exchange current and previous contents; needs history."""
        self.bound ^= 1

    def allocate(self, device: Any, usage: int) -> None:
        """Create the wgpu objects, unless existing ones allow `usage`."""
        if self.gpu and usage | self.usage == self.usage:
            return
        self.release()
        self.usage |= usage
        self.stamp += 1
        self.bound += 2
        try:
            self.gpu = [self.create(device, label) for label in self.labels()]
        except (wgpu.GPUError, RuntimeError) as error:
            raise GiError(
                f"{self.name!r} ({self.bytes / 2**20:.1f} MiB) cannot be allocated: {reason(error).rstrip('.')};"
                " use a smaller picture"
            ) from error

    def labels(self) -> list[str]:
        """Return a label for each wgpu object."""
        return [self.name, self.name + " (history)"] if self.history else [self.name]

    def create(self, device: Any, label: str) -> Any:
        """Make one wgpu object."""
        raise NotImplementedError

    def release(self) -> None:
        """Destroy the wgpu objects now; waiting for the garbage collector would double the peak."""
        for item in self.gpu:
            item.destroy()
        self.gpu = []

    @property
    def bytes(self) -> int:
        """Bytes of video memory, with history."""
        return 0


Slot = tuple[Resource, int]


class Texture(Resource):
    """A texture of `size` (width, height) pixels; `layers` is the depth of a 3d texture.

    `spec` identifies the texture in a redeclaration: kind, format, size and so on.
    """

    def __init__(
        self,
        name: str,
        format: Format,
        size: tuple[int, int],
        layers: int = 1,
        mips: int = 1,
        history: bool = False,
        dimension: str = "2d",
    ) -> None:
        super().__init__(name)
        self.format = format
        self.size = size
        self.layers = layers
        self.mips = mips
        self.history = history
        self.dimension = dimension
        self.spec = ("texture", format.name, size, layers, mips, history, dimension)
        self._views: dict[tuple, Any] = {}

    @property
    def bytes(self) -> int:
        """Bytes of all levels and layers, with history."""
        layers = self.layers * (2 if self.history else 1)
        return sum(np.prod(self.mip_size(m), dtype=int) for m in range(self.mips)) * layers * self.format.texel_bytes

    def mip(self, level: int) -> View:
        """Return one mip level, to read or to write."""
        if not 0 <= level < self.mips:
            raise GiError(f"texture {self.name!r} has {self.mips} mip levels; there is no level {level}")
        return View(self, mip=level)

    def layer(self, index: int) -> View:
        """Return mip level 0 of one array layer."""
        if not 0 <= index < self.layers:
            raise GiError(f"texture {self.name!r} has {self.layers} layers; there is no layer {index}")
        return View(self, mip=0, layer=index)

    def mip_size(self, level: int) -> tuple[int, int]:
        """Return (width, height) of a mip level."""
        return max(1, self.size[0] >> level), max(1, self.size[1] >> level)

    def slots(self, mip: int | None) -> Iterable[Slot]:
        """Return the mip levels, or the one given."""
        return ((self, m) for m in (range(self.mips) if mip is None else (mip,)))

    def create(self, device: Any, label: str) -> Any:
        """Make one wgpu texture."""
        self._views.clear()
        return device.create_texture(
            label=label,
            size=(*self.size, self.layers),
            mip_level_count=self.mips,
            dimension="3d" if self.dimension == "3d" else "2d",
            format=self.format.name,
            usage=self.usage,
        )

    def view(self, view: View, dimension: str) -> Any:
        """Return the wgpu view of a part of the texture, with the `dimension` of the shader ("2d", "2d-array" ...)."""
        key = (view.mip, view.layer, dimension, (self.bound ^ view.previous) & 1)
        found = self._views.get(key)
        if found is None:
            layers = {} if dimension == "3d" else {"array_layer_count": 1 if dimension == "2d" else self.layers}
            found = self._views[key] = self.object(view.previous).create_view(
                label=self.name,
                dimension=dimension,
                aspect="depth-only" if self.format.is_depth else "all",
                base_mip_level=view.mip or 0,
                mip_level_count=self.mips if view.mip is None else 1,
                base_array_layer=view.layer or 0,
                **layers,
            )
        return found


class Buffer(Resource):
    """A buffer of `count` elements of a numpy dtype, structured or not.

    `width` is the number of pixels in a row if there is one element per pixel, row by row, else 0. `spec` is as for
    textures.
    """

    def __init__(self, name: str, dtype: np.dtype, count: int, history: bool = False, width: int = 0) -> None:
        super().__init__(name)
        self.dtype = dtype
        self.count = count
        self.history = history
        self.width = width
        self.spec = ("buffer", dtype, count, history, width)

    @property
    def size_bytes(self) -> int:
        """Bytes of one copy: at least one element, since WebGPU cannot bind an empty buffer."""
        return -(-max(self.count, 1) * self.dtype.itemsize // 4) * 4

    @property
    def bytes(self) -> int:
        """Bytes, with history."""
        return self.size_bytes * (2 if self.history else 1)

    def create(self, device: Any, label: str) -> Any:
        """Make one wgpu buffer."""
        return device.create_buffer(label=label, size=self.size_bytes, usage=self.usage)


class Shared(Resource):
    """A wgpu buffer, texture or texture view owned outside the graph; a new `version` means new contents."""

    def __init__(self, name: str, resource: Any, version: Any) -> None:
        super().__init__(name)
        self._views: dict[str, Any] = {}
        self.is_buffer = _is_buffer(resource)
        self.set(resource, version)

    def set(self, resource: Any, version: Any) -> None:
        """Replace the wgpu object by another of the same kind, or its version."""
        if not self.gpu or self.gpu[0] is not resource:
            self._views.clear()
            self.bound += 2
            self.gpu = [resource]
            texture = resource if hasattr(resource, "create_view") else getattr(resource, "texture", None)
            self.format = None if self.is_buffer or texture is None else FORMATS.get(texture.format)
            self.texture = texture
        self.stamp = (self.bound, version)

    def can_be(self, resource: Any) -> bool:
        """True if a wgpu object is of the same kind, buffer or texture, so that `set` takes it."""
        return self.is_buffer == _is_buffer(resource)

    def allocate(self, device: Any, usage: int) -> None:
        """Do nothing: its owner has allocated it."""

    def release(self) -> None:
        """Do nothing: its owner destroys it."""

    def view(self, view: View, dimension: str) -> Any:
        """Return a wgpu view of the object, or the object if it is a view."""
        item = self.gpu[0]
        if not hasattr(item, "create_view"):
            return item
        if dimension not in self._views:
            aspect = "depth-only" if self.format is not None and self.format.is_depth else "all"
            self._views[dimension] = item.create_view(label=self.name, dimension=dimension, aspect=aspect)
        return self._views[dimension]


def _is_buffer(resource: Any) -> bool:
    return hasattr(resource, "map_state")


@dataclass(frozen=True)
class View:
    """A part of a resource: its previous contents, a mip level, a layer; None means all of them."""

    resource: Resource
    previous: bool = False
    mip: int | None = None
    layer: int | None = None

    def slots(self) -> Iterable[Slot]:
        """Return the tracked parts it covers."""
        return self.resource.slots(self.mip)

    def __str__(self) -> str:
        parts = [".previous"] * self.previous
        parts += [f".mip({self.mip})"] * (self.mip is not None and self.layer is None)
        parts += [f".layer({self.layer})"] * (self.layer is not None)
        return self.resource.name + "".join(parts)


@dataclass(frozen=True)
class Sampler:
    """How a texture is filtered; `gpu` is the wgpu sampler, `kind` as in a bind group layout."""

    name: str
    kind: str
    gpu: Any


class Uniform:
    """A shared uniform (bind group 0); `stamp` grows when its bytes change."""

    def __init__(self, name: str, dtype: np.dtype, device: Any) -> None:
        self.name = name
        self.dtype = dtype
        size = -(-dtype.itemsize // 16) * 16
        usage = wgpu.BufferUsage.UNIFORM | wgpu.BufferUsage.COPY_DST
        self.gpu = device.create_buffer(label=f"uniform {name}", size=size, usage=usage)
        self.data = b""
        self.stamp = 0
        self.groups: dict[tuple, Any] = {}  # cached bind groups 0 whose first uniform it is


Handle = Texture | Buffer | Shared | View


def as_view(handle: Any, where: str) -> View:
    """Return a View of any handle. Raises GiError, beginning with `where`, for anything else."""
    if isinstance(handle, View):
        return handle
    if isinstance(handle, Resource):
        return View(handle)
    raise GiError(f"{where}: {handle!r} is not a texture, buffer or shared resource of this graph")
