"""A declared pass: what it binds, what it depends on, and what is remembered of its last run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from .handles import Buffer, Resource, Sampler, Slot, Uniform, View
from .wgsl.load import ShaderSource
from .wgsl.module import Binding, EntryPoint

# Filled in by the executor where the params struct has them.
SPECIAL_PARAMS = ("settle_index", "first_workgroup")


@dataclass(frozen=True)
class Use:
    """A resource in a pass, with wgpu usage flags; `binding` is None for attachments, indices, indirect arguments."""

    name: str
    view: View
    access: str  # read or write
    usage: int
    binding: Binding | None = None
    dimension: str = ""  # of the view, for textures
    sample_type: str = ""

    @property
    def writes(self) -> bool:
        """True if the pass may change the resource."""
        return self.access == "write"


@dataclass(frozen=True)
class RasterState:
    """Targets and fixed functions of a raster pass."""

    targets: tuple[tuple[int, Use], ...]  # location and target
    depth: Use | None
    topology: str
    cull: str
    depth_compare: str
    depth_write: bool
    load: bool
    clear_color: tuple[float, ...]
    clear_depth: float
    draw: Callable[[Any], None] | tuple[int, ...]
    index: Use | None = None


@dataclass(eq=False)
class PassState:
    """What is remembered of a pass from frame to frame, as long as its declaration stays the same."""

    seen: tuple | None = None  # the versions of all inputs at its last run; None: it has not run
    serial: int = 0  # grows with each run that may have changed what it writes
    settle_index: int = 0
    runs: int = 0
    params_buffer: Any = None
    params_on_gpu: bytes = b""
    bind_groups: dict[tuple, tuple] = field(default_factory=dict)
    chunk: int = 64  # workgroups along x of the next chunk of a split pass

    def restart(self) -> None:
        """Forget that it ran."""
        self.seen = None
        self.settle_index = 0

    def release(self) -> None:
        """Destroy its buffer."""
        if self.params_buffer is not None:
            self.params_buffer.destroy()
        self.params_buffer, self.params_on_gpu = None, b""


@dataclass(eq=False)
class Pass:
    """A compute or raster pass as declared. `settle` and the values in `params` may change without a rebuild."""

    name: str
    source: ShaderSource
    entries: tuple[EntryPoint, ...]
    uses: tuple[Use, ...]
    uniforms: tuple[tuple[Binding, Uniform], ...]
    samplers: tuple[tuple[Binding, Sampler], ...]
    params: np.ndarray | None
    params_binding: Binding | None
    constants: dict[str, float]
    settle: int = 0
    groups: tuple[int, int, int] | None = None
    indirect: Buffer | None = None
    split: bool = False
    clear: tuple[Resource, ...] = ()
    raster: RasterState | None = None
    state: PassState = field(default_factory=PassState)
    pipeline: Any = None
    # Found by Graph.compile.
    active: bool = False
    producers: dict[Pass, tuple[str, ...]] = field(default_factory=dict)  # earlier ones, and the inputs each writes
    fellows: tuple[Pass, ...] = ()  # run whenever this one runs
    culled_because: str = ""

    @property
    def where(self) -> str:
        """The beginning of each message about it."""
        return f"pass {self.name!r} ({self.source.path})"

    @cached_property
    def resources(self) -> tuple[Resource, ...]:
        """The resource of each use."""
        return tuple(use.view.resource for use in self.uses)

    @cached_property
    def written(self) -> tuple[Resource, ...]:
        """The resources that it writes, each once, in order."""
        return tuple(dict.fromkeys(use.view.resource for use in self.uses if use.writes))

    @cached_property
    def read_slots(self) -> frozenset[Slot]:
        """The current slots that it reads."""
        return frozenset(s for u in self.uses if not u.writes and not u.view.previous for s in u.view.slots())

    @cached_property
    def written_slots(self) -> frozenset[Slot]:
        """The slots that it writes."""
        return frozenset(s for u in self.uses if u.writes for s in u.view.slots())

    @cached_property
    def params_bytes(self) -> bytes:
        """The params struct, its special fields zero."""
        return b"" if self.params is None else self.params.tobytes()

    @cached_property
    def special_params(self) -> tuple[str, ...]:
        """The fields of the params struct that the executor fills in."""
        names = () if self.params is None else self.params.dtype.names or ()
        return tuple(name for name in SPECIAL_PARAMS if name in names)

    @cached_property
    def reads_history(self) -> bool:
        """True if it reads previous contents."""
        return any(use.view.previous for use in self.uses)

    @property
    def progresses(self) -> bool:
        """True if running it again with the same inputs changes what it writes."""
        return self.settle > 1 or self.reads_history

    @property
    def params_before(self) -> np.ndarray | None:
        """The params struct of the last run, its special fields zero; None if there was none."""
        if self.params is None or self.state.seen is None:
            return None
        return np.frombuffer(self.state.seen[0], self.params.dtype).reshape(())

    def go_on_with(self, name: str) -> None:
        """Say, of a pass that has run, that all it has done is the same for the new value of a field of its params."""
        before = self.params_before
        assert before is not None and self.params is not None and self.state.seen is not None
        as_if = before.copy()
        as_if[name] = self.params[name]
        self.state.seen = (as_if.tobytes(), *self.state.seen[1:])

    def signature(self) -> tuple:
        """All that must stay the same for its contents and its run state to stay valid."""
        return (
            self.source,
            tuple(e.name for e in self.entries),
            tuple((u.name, u.view, u.access, u.sample_type) for u in self.uses),
            tuple(s for _, s in self.samplers),
            tuple(u for _, u in self.uniforms),
            tuple(sorted(self.constants.items())),
            self.groups,
            self.split,
            self.clear,
            self.raster,
        )

    @property
    def bytes(self) -> int:
        """Bytes of what it writes."""
        return sum(r.bytes for r in self.written)
