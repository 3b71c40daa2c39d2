"""The half of the graph that declares: resources and passes by name, checked against their shaders."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import wgpu

from ..errors import GiError
from . import attachments, bindings, checks, transfer
from .bindings import Over
from .formats import format_of
from .handles import Buffer, Handle, Resource, Sampler, Shared, Texture, Uniform, View, as_view
from .passes import Pass, RasterState, Use
from .timing import Timing
from .wgsl.load import ShaderSource, load
from .wgsl.module import EntryPoint

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


class PassDeclarations(Declarations):
    """All passes of a frame. What is declared as before keeps what is remembered of its last run."""

    def __init__(self, device: Any, shader_root: Path | str | None = None) -> None:
        super().__init__(device)
        self.shader_root = shader_root
        self.passes: dict[str, Pass] = {}
        self.planned: dict[str, Pass | str] = {}  # all that was declared, in order: a pass, or why there is none
        self.timing = Timing(device)
        self._declaring = False
        self._old_passes: dict[str, Pass] = {}

    def compute(
        self,
        name: str,
        shader: str,
        *,
        over: Over | None = None,
        indirect: Buffer | None = None,
        reads: Mapping[str, Any] | None = None,
        writes: Mapping[str, Any] | None = None,
        params: Mapping[str, Any] | None = None,
        constants: Mapping[str, float] | None = None,
        uniforms: Mapping[str, str] | None = None,
        entry: str = "main",
        settle: int = 0,
        split: bool = False,
        clear: Iterable[Buffer] = (),
    ) -> Pass:
        """Declare a compute pass with a thread for each pixel of a texture, element of a buffer, or of `over` threads.

        The keys of `reads` and `writes` are WGSL variable names; read_write bindings go in `writes`. `uniforms` binds
        shared uniforms of other names than in the shader: {"view": "view_second"}. `settle` runs follow each change.
        With `split`, consecutive ranges of workgroups along x are dispatched one by one; the shader adds
        `params.first_workgroup` to its workgroup_id.x. `clear` are buffers zeroed before each run. `indirect` is a
        buffer of three u32 group counts, instead of `over`.
        """
        where = f"pass {name!r} ({shader})"
        source = self._load(name, shader)
        main = checks.entry_point(where, source, "compute", entry)
        assert main is not None
        more = () if indirect is None else (Use("indirect", View(indirect), "read", wgpu.BufferUsage.INDIRECT),)
        p = self._pass(name, source, (main,), reads, writes, params, constants, uniforms, settle, more)
        p.split, p.clear, p.indirect = split, tuple(clear), indirect
        if split and "first_workgroup" not in (p.params.dtype.names or () if p.params is not None else ()):
            raise GiError(f"{where}: split=True needs a field first_workgroup: u32 in params")
        for buffer in p.clear:
            if buffer not in p.written or not isinstance(buffer, Buffer):
                raise GiError(f"{where}: clear takes buffers that the pass writes")
        if (over is None) == (indirect is None):
            raise GiError(f"{where}: give either over= (a texture, a buffer or a number of threads) or indirect=")
        if split and indirect is not None:
            raise GiError(f"{where}: split=True needs over=; the size of an indirect dispatch is not known")
        if over is not None:
            p.groups = bindings.workgroups(p, over)
        return self._add(p)

    def raster(
        self,
        name: str,
        shader: str,
        *,
        draw: Callable[[Any], None] | tuple[int, ...] | int,
        index: Buffer | Shared | View | None = None,
        color: Mapping[str, Texture | View] | None = None,
        depth: Texture | View | None = None,
        reads: Mapping[str, Any] | None = None,
        writes: Mapping[str, Any] | None = None,
        params: Mapping[str, Any] | None = None,
        constants: Mapping[str, float] | None = None,
        uniforms: Mapping[str, str] | None = None,
        entry: tuple[str, str] | None = None,
        settle: int = 0,
        topology: str = "triangle-list",
        cull: str = "none",
        depth_compare: str = "greater",
        depth_write: bool = True,
        load: bool = False,
        clear_color: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
        clear_depth: float = 0.0,
    ) -> Pass:
        """Declare a raster pass; the keys of `color` are the names of the fragment shader's outputs.

        `draw` records draw calls on the render pass encoder it is given, or is (vertices, instances). Functions that
        compare equal, such as instances of a frozen dataclass, are the same to a redeclaration. `index` is a buffer of
        uint32 that is bound before; counts are then of indices. Targets are cleared unless `load`. Depth is reversed:
        1 near, cleared to 0, greater wins. `entry` is (vertex, fragment); `uniforms` as in `compute`.
        """
        where = f"pass {name!r} ({shader})"
        source = self._load(name, shader)
        vertex = checks.entry_point(where, source, "vertex", entry[0] if entry else None)
        fragment = checks.entry_point(where, source, "fragment", entry[1] if entry else None)
        if vertex is None:
            raise GiError(f"{where}: it has no vertex entry point")
        if color and fragment is None:
            raise GiError(f"{where}: it has no fragment entry point, but color targets are given")
        entries = (vertex,) if fragment is None else (vertex, fragment)
        targets = attachments.color_targets(where, fragment, color or {})
        target = attachments.depth_target(where, depth, depth_write) if depth is not None else None
        if not targets and target is None:
            raise GiError(f"{where}: it has neither color nor depth targets")
        attachments.same_size(where, [use.view for _, use in targets] + ([target.view] if target else []))
        indices = attachments.index_buffer(where, index) if index is not None else None
        more = tuple(use for _, use in targets) + tuple(use for use in (target, indices) if use is not None)
        p = self._pass(name, source, entries, reads, writes, params, constants, uniforms, settle, more)
        calls = (draw, 1) if isinstance(draw, int) else draw
        p.raster = RasterState(
            targets, target, topology, cull, depth_compare, depth_write, load, clear_color, clear_depth, calls, indices
        )
        return self._add(p)

    def skip(self, name: str, reason: str) -> None:
        """Say in the plan why a pass is not declared: "no alpha-masked material"."""
        if not self._declaring:
            raise GiError(f"pass {name!r}: skipped outside of begin ... compile")
        if name in self.planned:
            raise GiError(f"pass {name!r}: two passes have this name; give one another")
        self.planned[name] = reason

    def _load(self, name: str, shader: str) -> ShaderSource:
        try:
            return load(shader, self.shader_root)
        except GiError as error:
            raise GiError(f"pass {name!r} ({shader}): {error}") from error

    def _pass(
        self,
        name: str,
        source: ShaderSource,
        entries: tuple[EntryPoint, ...],
        reads: Mapping[str, Any] | None,
        writes: Mapping[str, Any] | None,
        params: Mapping[str, Any] | None,
        constants: Mapping[str, float] | None,
        uniforms: Mapping[str, str] | None,
        settle: int,
        more: tuple[Use, ...],
    ) -> Pass:
        """Check what compute and raster passes have in common; `more` are uses that are not bound by name."""
        where = f"pass {name!r} ({source.path})"
        if name in self.planned:
            raise GiError(f"{where}: two passes have this name; give one another")
        used = checks.bindings_used(where, source, entries)
        filters = "float32-filterable" in self.device.features
        uses, samplers = checks.resource_uses(where, source, used, reads or {}, writes or {}, filters)
        checks.check_sampling(where, source, uses, samplers)
        checks.check_counts(where, entries, uses)
        shared = bindings.shared_uniforms(where, source, used, self.uniforms, uniforms or {})
        block, binding = bindings.params_block(where, source, used, params or {})
        overrides = bindings.override_values(where, source, entries, constants or {})
        uses += more
        return Pass(
            name, source, entries, tuple(uses), tuple(shared), tuple(samplers), block, binding, overrides, settle
        )

    def _add(self, p: Pass) -> Pass:
        """Add a pass; it takes over the state of the same pass of the declaration before."""
        if not self._declaring:
            raise GiError(f"{p.where}: declared outside of begin ... compile")
        if not any(use.writes for use in p.uses):
            raise GiError(f"{p.where}: it writes nothing")
        for name, resource in ((use.view.resource.name, use.view.resource) for use in p.uses):
            if self.resources.get(name) is not resource:
                raise GiError(f"{p.where}: {name!r} is of another declaration; declare it after begin")
        checks.check_hazards(p.where, p.uses)
        old = self._old_passes.get(p.name)
        if old is not None and old.signature() == p.signature():
            p.state = old.state
            p.pipeline = old.pipeline
        else:
            self.timing.forget(p.name)
        self.passes[p.name] = self.planned[p.name] = p
        return p
