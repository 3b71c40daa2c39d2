"""A declared pass: what it binds, what it depends on, and what is remembered of its last run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from .handles import Buffer, Resource, Sampler, Slot, Uniform, View
from .reflect import Binding, EntryPoint
from .wgsl import ShaderSource

# Filled in by the executor where the params struct has them.
SPECIAL_PARAMS = ("settle_index", "first_workgroup")


@dataclass(frozen=True)
class Use:
    """A resource in a pass. `binding` is None for attachments and indirect arguments; `usage` are wgpu flags."""

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
    producers: tuple[Pass, ...] = ()
    fellows: tuple[Pass, ...] = ()  # run whenever this one runs
    culled_because: str = ""

    @property
    def where(self) -> str:
        """The beginning of each message about it."""
        return f"pass {self.name!r} ({self.source.path})"

    @cached_property
    def params_bytes(self) -> bytes:
        """The params struct, its special fields zero."""
        return b"" if self.params is None else self.params.tobytes()

    @property
    def progresses(self) -> bool:
        """True if running it again with the same inputs changes what it writes."""
        return self.settle > 1 or any(use.view.previous for use in self.uses)

    def signature(self) -> tuple:
        """All that must stay the same for its contents and its run state to stay valid."""
        return (
            self.source,
            tuple(e.name for e in self.entries),
            tuple((u.name, u.view, u.access) for u in self.uses),
            tuple(s for _, s in self.samplers),
            tuple(u for _, u in self.uniforms),
            tuple(sorted(self.constants.items())),
            self.groups,
            self.split,
            self.clear,
            self.raster,
        )

    def slots(self, writes: bool) -> set[Slot]:
        """Return the current slots that it writes, or those that it reads."""
        return {s for u in self.uses if u.writes == writes and not u.view.previous for s in u.view.slots()}

    def written(self) -> list[Resource]:
        """Return the resources that it writes, each once, in order."""
        return list(dict.fromkeys(u.view.resource for u in self.uses if u.writes))

    @property
    def bytes(self) -> int:
        """Bytes of what it writes."""
        return sum(r.bytes for r in self.written())
