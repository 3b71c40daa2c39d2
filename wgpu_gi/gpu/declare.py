"""The half of the graph that declares textures, buffers, shared resources, uniforms and samplers by name."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..errors import GiError
from . import transfer
from .formats import format_of
from .handles import Buffer, Handle, Resource, Sampler, Shared, Texture, Uniform, View, as_view

WRAPS = {"clamp": "clamp-to-edge", "repeat": "repeat", "mirror": "mirror-repeat"}


class Declarations:
    """All that passes can bind. What is declared as before keeps its handle and its contents."""

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
        """Declare a texture; its size is the viewport's times `scale`, rounded up, unless given.

        With `history`, `.previous` holds what was there before the last run. `nonnegative` is checked by `check=True`.
        """
        width, height = size or (math.ceil(self.size[0] * scale), math.ceil(self.size[1] * scale))
        what = f"texture {name!r}"
        limit = self.device.limits.get("max-texture-dimension-2d", 8192)
        if not (1 <= width <= limit and 1 <= height <= limit):
            raise GiError(f"{what}: {width} x {height} pixels; each side must lie between 1 and {limit}")
        if dimension not in ("2d", "3d"):
            raise GiError(f"{what}: dimension {dimension!r}; there is 2d (with 6 layers also read as a cube) and 3d")
        if layers < 1 or not 1 <= mips <= max(width, height).bit_length():
            raise GiError(f"{what}: {layers} layers and {mips} mip levels do not fit {width} x {height} pixels")
        texture = Texture(name, format_of(format, what), (int(width), int(height)), layers, mips, history, dimension)
        texture.nonnegative = nonnegative
        return self._resource(texture)

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

        If it holds an element per pixel, `width` is that of a row of pixels: `check=True` then names the pixel.
        """
        if count < 0 or width < 0:
            raise GiError(f"buffer {name!r}: {count} elements" + (f" in rows of {width}" if width else ""))
        buffer = Buffer(name, np.dtype(dtype), int(count), history, int(width))
        if buffer.dtype.itemsize == 0:
            raise GiError(f"buffer {name!r}: elements of type {buffer.dtype} have no bytes")
        limit = self.device.limits.get("max-storage-buffer-binding-size", 2**27)
        if buffer.size_bytes > limit:
            raise GiError(
                f"buffer {name!r} needs {buffer.size_bytes / 2**20:.0f} MiB; this device binds {limit / 2**20:.0f} MiB"
            )
        buffer.nonnegative = nonnegative
        return self._resource(buffer)

    def share(self, name: str, resource: Any, version: Any = 0) -> Shared:
        """Declare, or update at any time, a wgpu buffer, texture or view that someone else owns.

        Passes that read it are stale if `version` differs from that of their last run, or if the object is another.
        """
        known = self.resources.get(name) or self._old_resources.get(name)
        if isinstance(known, Shared) and known.spec == Shared(name, resource, version).spec:
            known.set(resource, version)
            self.resources[name] = known
            return known
        return self._resource(Shared(name, resource, version))

    def uniform(self, name: str, value: Any) -> Uniform:
        """Declare a uniform for bind group 0, by its WGSL variable name; `value` is a dtype or a numpy value.

        It stays until declared with another dtype, whatever `begin` does.
        """
        is_value = isinstance(value, np.generic | np.ndarray)
        dtype = value.dtype if is_value else np.dtype(value)
        if name not in self.uniforms or self.uniforms[name].dtype != dtype:
            self.uniforms[name] = Uniform(name, dtype, self.device.gpu)
        if is_value:
            self.set_uniform(name, value)
        return self.uniforms[name]

    def set_uniform(self, name: str, value: Any) -> None:
        """Set a shared uniform; only other bytes make the passes that bind it stale."""
        uniform = self.uniforms.get(name)
        if uniform is None:
            raise GiError(f"there is no shared uniform {name!r}; there is {', '.join(self.uniforms) or 'none'}")
        data = np.asarray(value, uniform.dtype).tobytes()
        if len(data) != uniform.dtype.itemsize:
            raise GiError(f"shared uniform {name!r} takes {uniform.dtype.itemsize} bytes, not {len(data)}")
        if data != uniform.data:
            uniform.data = data
            uniform.version += 1
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
        return self._resource(found) if found.name not in self.resources else found

    def _resource(self, new: Any) -> Any:
        """Add a resource, or return the one of the declaration before if it is the same."""
        if new.name in self.resources:
            raise GiError(f"two resources are called {new.name!r}; give one another name")
        old = self._old_resources.get(new.name)
        if old is not None and type(old) is type(new) and not isinstance(new, Shared) and old.spec == new.spec:
            old.nonnegative = new.nonnegative
            new = old
        self.resources[new.name] = new
        return new

    def _find(self, handle: Handle | str) -> View:
        """Return the view of a handle or of a name."""
        if isinstance(handle, str):
            if handle not in self.resources:
                raise GiError(f"there is no resource {handle!r}; there is {', '.join(self.resources) or 'none'}")
            return View(self.resources[handle])
        view = as_view(handle, "output")
        if self.resources.get(view.resource.name) is not view.resource:
            raise GiError(f"{view.resource.name!r} belongs to another declaration; declare it again after begin")
        return view
