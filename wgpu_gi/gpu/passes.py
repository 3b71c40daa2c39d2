"""A declared pass: what it binds, what it depends on, and the state that it keeps from run to run."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from .handles import Buffer, Resource, Sampler, Shared, Slot, Uniform, View
from .wgsl.load import ShaderSource
from .wgsl.module import Binding, EntryPoint

_STAMP = attrgetter("stamp")

# Optional fields of the params struct that the executor fills in.
SPECIAL_PARAMS = ("settle_index", "first_workgroup")


@dataclass(frozen=True)
class Use:
    """A resource in a pass, with wgpu usage flags; `binding` is None for attachments, indices, indirect arguments."""

    name: str
    view: View
    access: str  # read or write
    usage: int
    binding: Binding | None = None
    dimension: str = ""  # dimension of the view, for textures
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


class Chunk(NamedTuple):
    """A dispatched range of workgroups of a split pass."""

    submission: Any  # for `Device.wait`
    size: int  # workgroups that it should have
    groups: int  # and has: fewer at the end of the pass
    submitted: float  # seconds


@dataclass(eq=False)
class PassState:
    """The state of a pass from frame to frame. A redeclaration that changes only its params keeps it."""

    seen: tuple | None = None  # `Pass.inputs` at its last run; None: it has not run
    stamp: int = 0  # number of the last run that may have changed its results
    settle_index: int = 0
    runs: int = 0
    params_buffer: Any = None
    params_on_gpu: tuple = ()  # bytes of the params, settle index and first workgroup
    bind_groups: dict[tuple, tuple] = field(default_factory=dict)  # groups 0 and 1 by the `bound` of the resources
    chunk: int = 64  # workgroups along x of the next chunk of a split pass
    in_flight: deque[Chunk] = field(default_factory=deque)  # submitted, not awaited; oldest first
    last_end: float = 0.0  # when the last awaited chunk had ended, seconds

    def restart(self) -> None:
        """Start over: the next run counts as the first."""
        self.seen = None
        self.settle_index = 0

    def release(self) -> None:
        """Destroy its buffer and drop its bind groups."""
        self.bind_groups.clear()
        if self.params_buffer is not None:
            self.params_buffer.destroy()
        self.params_buffer, self.params_on_gpu = None, ()


@dataclass(frozen=True)
class Count:
    """Where the GPU keeps two numbers for the plan: words `part` and `whole` of a buffer of u32, numbers of `of`."""

    buffer: Buffer
    part: int
    whole: int
    of: str


@dataclass(eq=False)
class Pass:
    """A compute or raster pass as declared.

    A redeclaration with the same arguments gives the same pass; only `settle` and the values in `params` may differ.
    """

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
    arguments: tuple = ()  # arguments of the declaration, without params and settle
    param_arguments: tuple = ()
    shared_bound: tuple[int, ...] = ()  # `bound` of its shared resources when it was checked
    state: PassState = field(default_factory=PassState)
    # Found by Graph.compile.
    pipeline: Any = None
    layouts: tuple[Any, Any] | None = None  # layouts of bind groups 0 and 1
    active: bool = False
    producers: dict[Pass, tuple[str, ...]] = field(default_factory=dict)  # earlier passes, and the inputs each writes
    reruns_with: tuple[Pass, ...] = ()  # passes that run whenever this one runs
    culled_because: str = ""
    clear_first: tuple[Resource, ...] = ()  # buffers of `clear` that no earlier pass uses
    clear_late: tuple[Resource, ...] = ()  # the other buffers of `clear`
    stamped: tuple[Uniform | Resource | PassState, ...] = ()  # all inputs with a stamp

    def __post_init__(self) -> None:
        self.set_params(self.params)

    def set_params(self, params: np.ndarray | None) -> None:
        """Replace the params struct; its special fields must be zero."""
        self.params = params
        self.params_bytes = b"" if params is None else params.tobytes()

    @property
    def where(self) -> str:
        """The beginning of each message about this pass."""
        return f"pass {self.name!r} ({self.source.path})"

    @cached_property
    def resources(self) -> tuple[Resource, ...]:
        """The resource of each use."""
        return tuple(use.view.resource for use in self.uses)

    @cached_property
    def shared(self) -> tuple[Shared, ...]:
        """The resources that are owned outside the graph."""
        return tuple(r for r in self.resources if isinstance(r, Shared))

    @cached_property
    def written(self) -> tuple[Resource, ...]:
        """The resources that it writes, in order, without duplicates."""
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
    def special_params(self) -> tuple[str, ...]:
        """The fields of the params struct that the executor fills in."""
        names = () if self.params is None else self.params.dtype.names or ()
        return tuple(name for name in SPECIAL_PARAMS if name in names)

    @cached_property
    def reads_history(self) -> bool:
        """True if it reads previous contents."""
        return any(use.view.previous for use in self.uses)

    def inputs(self) -> tuple:
        """Return its params and the stamps of all it depends on; it is stale if they differ from `state.seen`."""
        return (self.params_bytes, *map(_STAMP, self.stamped))

    @property
    def progresses(self) -> bool:
        """True if running it again with the same inputs changes what it writes."""
        return self.settle > 1 or self.reads_history

    @property
    def params_before(self) -> np.ndarray | None:
        """The params struct of the last run, with special fields zero; None if there was none."""
        if self.params is None or self.state.seen is None:
            return None
        return np.frombuffer(self.state.seen[0], self.params.dtype).reshape(())

    def ignore_change_of(self, name: str) -> None:
        """Keep the results although the params field `name` has changed, because they do not depend on it."""
        before = self.params_before
        assert before is not None and self.params is not None and self.state.seen is not None
        as_if = before.copy()
        as_if[name] = self.params[name]
        self.state.seen = (as_if.tobytes(), *self.state.seen[1:])

    def retire(self) -> None:
        """Drop the references to other passes, which form cycles: GPU objects must not wait for the cycle collector."""
        self.producers, self.reruns_with, self.stamped = {}, (), ()

    def signature(self) -> tuple:
        """Return what must be equal for contents and state to stay valid."""
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
