"""Declares resources by name: textures, buffers, uniforms, samplers, and resources owned outside the graph."""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np

from ..errors import GiError
from ..webgpu_limits import MAX_TEXTURE_SIDE
from . import transfer
from .formats import format_of
from .handles import Buffer, Handle, Resource, Sampler, Shared, Texture, Uniform, View, as_view

WRAPS = {"clamp": "clamp-to-edge", "repeat": "repeat", "mirror": "mirror-repeat"}

R = TypeVar("R", bound=Resource)


class ResourceDeclarations:
    """All that passes can bind. An unchanged resource keeps its handle and its contents."""

    def __init__(self, device: Any) -> None:
        self.device = device
        self.size = (1, 1)
        self.resources: dict[str, Resource] = {}
        self.uniforms: dict[str, Uniform] = {}
        self._old_resources: dict[str, Resource] = {}
        self._samplers: dict[tuple, Sampler] = {}
        self._neutrals: dict[tuple, Shared] = {}

    def texture(
        self,
        name: str,
        format: str,
        *,
        size: tuple[int, int] | None = None,
        scale: float = 1.0,
        layers: int = 1,
        mips: int = 1,
        history: bool = False,
        dimension: str = "2d",
        nonnegative: bool = False,
    ) -> Texture:
        """Declare a texture. Without `size`, it has the size of the viewport times `scale`, rounded up.

        With `history`, `.previous` holds the contents before the last run. `check=True` checks `nonnegative`. Raises
        GiError for a size, a format or a number of layers or mip levels that the device does not support.
        """
        # Reuse the texture of the previous declaration if it is unchanged.
        width, height = size or (math.ceil(self.size[0] * scale), math.ceil(self.size[1] * scale))
        known = self._known(name, ("texture", format, (width, height), layers, mips, history, dimension))
        if isinstance(known, Texture):
            return self._add_resource(known, nonnegative)
        # Check its size, layers and mip levels.
        what = f"texture {name!r}"
        limit = self.device.limits.get("max-texture-dimension-2d", MAX_TEXTURE_SIDE)
        if not (1 <= width <= limit and 1 <= height <= limit):
            raise GiError(f"{what}: {width} x {height} pixels; each side must lie between 1 and {limit}")
        if dimension not in ("2d", "3d"):
            raise GiError(f"{what}: dimension {dimension!r}; available: 2d (with 6 layers also read as a cube) and 3d")
        if layers < 1 or not 1 <= mips <= max(width, height).bit_length():
            raise GiError(f"{what}: {layers} layers and {mips} mip levels do not fit {width} x {height} pixels")
        texture = Texture(name, format_of(format, what), (int(width), int(height)), layers, mips, history, dimension)
        return self._add_resource(texture, nonnegative)

    def buffer(
        self,
        name: str,
        *,
        dtype: Any = np.float32,
        count: int,
        history: bool = False,
        nonnegative: bool = False,
        width: int = 0,
    ) -> Buffer:
        """Declare a storage buffer of `count` elements of a numpy dtype (structured: `ShaderSource.struct_dtype`).

        For a buffer of pixels, `width` is the length of a row: `check=True` then names the pixel. Raises GiError for a
        buffer that the device cannot bind.
        """
        dtype = np.dtype(dtype)
        known = self._known(name, ("buffer", dtype, count, history, width))
        if isinstance(known, Buffer):
            return self._add_resource(known, nonnegative)
        if count < 0 or width < 0:
            raise GiError(f"buffer {name!r}: {count} elements" + (f" in rows of {width}" if width else ""))
        buffer = Buffer(name, dtype, int(count), history, int(width))
        if dtype.itemsize == 0:
            raise GiError(f"buffer {name!r}: elements of type {dtype} have no bytes")
        limit = self.device.limits.get("max-storage-buffer-binding-size", 2**27)
        if buffer.size_bytes > limit:
            raise GiError(
                f"buffer {name!r} needs {buffer.size_bytes / 2**20:.0f} MiB; this device binds {limit / 2**20:.0f} MiB"
            )
        return self._add_resource(buffer, nonnegative)

    def share(self, name: str, resource: Any, version: Any = 0) -> Shared:
        """Declare, or update at any time, a wgpu buffer, texture or view that is owned outside the graph.

        A pass that reads it is stale if `version` or the object has changed since the pass last ran.
        """
        known = self.resources.get(name) or self._old_resources.get(name)
        if isinstance(known, Shared) and known.can_be(resource):
            known.set(resource, version)
            self.resources[name] = known
            return known
        self._check_new(name)
        return self._add_resource(Shared(name, resource, version))

    def uniform(self, name: str, value: Any) -> Uniform:
        """Declare a uniform for bind group 0, by its WGSL variable name; `value` is a dtype or a numpy value.

        It survives `begin`; only a declaration with another dtype replaces it.
        """
        is_value = isinstance(value, np.generic | np.ndarray)
        dtype = value.dtype if is_value else np.dtype(value)
        if name not in self.uniforms or self.uniforms[name].dtype != dtype:
            self.uniforms[name] = Uniform(name, dtype, self.device.gpu)
        if is_value:
            self.set_uniform(name, value)
        return self.uniforms[name]

    def set_uniform(self, name: str, value: Any) -> None:
        """Set a shared uniform; if its bytes change, the passes that bind it are stale.

        Raises GiError for an unknown name or a wrong number of bytes.
        """
        uniform = self.uniforms.get(name)
        if uniform is None:
            raise GiError(f"there is no shared uniform {name!r}; available: {', '.join(self.uniforms) or 'none'}")
        data = np.asarray(value, uniform.dtype).tobytes()
        if len(data) != uniform.dtype.itemsize:
            raise GiError(f"shared uniform {name!r} takes {uniform.dtype.itemsize} bytes, not {len(data)}")
        if data != uniform.data:
            uniform.data = data
            uniform.stamp += 1
            self.device.gpu.queue.write_buffer(uniform.gpu, 0, data.ljust(uniform.gpu.size, b"\0"))

    def sampler(self, filter: str = "linear", wrap: str = "clamp", compare: str | None = None) -> Sampler:
        """Return a sampler: `filter` linear or nearest, `wrap` clamp, repeat or mirror, `compare` such as "greater"."""
        key = (filter, wrap, compare)
        if key not in self._samplers:
            if filter not in ("linear", "nearest") or wrap not in WRAPS:
                raise GiError(f"there is no sampler {filter!r}, {wrap!r}; use linear or nearest, {', '.join(WRAPS)}")
            name = " ".join(word for word in key if word)
            modes = {f"address_mode_{axis}": WRAPS[wrap] for axis in "uvw"}
            filters = {f"{which}_filter": filter for which in ("mag", "min", "mipmap")}
            more = {"compare": compare} if compare else {}
            gpu = self.device.gpu.create_sampler(label=name, **modes, **filters, **more)
            kind = "comparison" if compare else "filtering" if filter == "linear" else "non-filtering"
            self._samplers[key] = Sampler(name, kind, gpu)
        return self._samplers[key]

    def neutral(self, kind: str = "texture_2d", value: float | tuple[float, ...] = 0.0) -> Shared:
        """Return a stand-in for an absent input: a 1x1 texture of a WGSL kind, or a "buffer" of 256 zero bytes."""
        key = (kind, value)
        if key not in self._neutrals:
            self._neutrals[key] = transfer.neutral(self.device.gpu, kind, value)
        found = self._neutrals[key]
        self.resources[found.name] = found
        return found

    def _known(self, name: str, spec: tuple) -> Resource | None:
        """Return the resource of the previous declaration if it had the same `spec`."""
        self._check_new(name)
        old = self._old_resources.get(name)
        return old if isinstance(old, Texture | Buffer) and old.spec == spec else None

    def _check_new(self, name: str) -> None:
        if name in self.resources:
            raise GiError(f"two resources are called {name!r}; give one another name")

    def _add_resource(self, resource: R, nonnegative: bool = False) -> R:
        resource.nonnegative = nonnegative
        self.resources[resource.name] = resource
        return resource

    def _find(self, handle: Handle | str) -> View:
        """Return the view of a handle or of a name."""
        if isinstance(handle, str):
            if handle not in self.resources:
                raise GiError(f"there is no resource {handle!r}; available: {', '.join(self.resources) or 'none'}")
            return View(self.resources[handle])
        view = as_view(handle, "output")
        if self.resources.get(view.resource.name) is not view.resource:
            raise GiError(f"{view.resource.name!r} belongs to another declaration; declare it again after begin")
        return view
