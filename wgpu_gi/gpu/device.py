"""Chooses the adapter, its features and its limits; works around errors of wgpu and of drivers.

Only Vulkan, Metal and Direct3D 12 are used. wgpu would fall back to OpenGL silently; there, sampling a mip view returns
wrong data without an error. Once a device exists, spawn new processes: a forked child hangs.
"""

from __future__ import annotations

import atexit
import logging
import os
import re
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from typing import Any

import wgpu
from wgpu.backends.wgpu_native import ffi, lib
from wgpu.backends.wgpu_native._api import libf
from wgpu.backends.wgpu_native.extras import set_instance_extras

from ..errors import GiError, LostDevice
from ..webgpu_limits import MAX_TEXTURE_SIDE
from .capabilities import COSTS, capabilities_of
from .messages import reason
from .pipelines import Pipelines
from .quick_types import read_types_quickly

BACKENDS = ("Vulkan", "Metal", "D3D12")
WANTED_FEATURES = {*COSTS, "rg11b10ufloat-renderable"}
# The kinds of adapter, best first; all others come last.
PREFERENCE = ("DiscreteGPU", "IntegratedGPU", "CPU")
LARGE_BUFFER = 2**31 - 4  # the largest multiple of 4 that drivers with 32-bit signed sizes accept

# The default limits of the WebGPU specification (section 3.6.2). wgpu would grant the adapter's own limits; with the
# default limits, what runs here runs on every adapter.
DEFAULT_LIMITS = {
    "max-texture-dimension-1d": MAX_TEXTURE_SIDE,
    "max-texture-dimension-2d": MAX_TEXTURE_SIDE,
    "max-texture-dimension-3d": 2048,
    "max-texture-array-layers": 256,
    "max-bind-groups": 4,
    "max-bindings-per-bind-group": 1000,
    "max-dynamic-uniform-buffers-per-pipeline-layout": 8,
    "max-dynamic-storage-buffers-per-pipeline-layout": 4,
    "max-sampled-textures-per-shader-stage": 16,
    "max-samplers-per-shader-stage": 16,
    "max-storage-buffers-per-shader-stage": 8,
    "max-storage-textures-per-shader-stage": 4,
    "max-uniform-buffers-per-shader-stage": 12,
    "max-uniform-buffer-binding-size": 65536,
    "max-storage-buffer-binding-size": 128 * 2**20,
    "min-uniform-buffer-offset-alignment": 256,
    "min-storage-buffer-offset-alignment": 256,
    "max-vertex-buffers": 8,
    "max-buffer-size": 256 * 2**20,
    "max-vertex-attributes": 16,
    "max-vertex-buffer-array-stride": 2048,
    "max-inter-stage-shader-variables": 16,
    "max-color-attachments": 8,
    "max-color-attachment-bytes-per-sample": 32,
    "max-compute-workgroup-storage-size": 16384,
    "max-compute-invocations-per-workgroup": 256,
    "max-compute-workgroup-size-x": 256,
    "max-compute-workgroup-size-y": 256,
    "max-compute-workgroup-size-z": 64,
    "max-compute-workgroups-per-dimension": 65535,
}


read_types_quickly(ffi)
# wgpu also logs a lost device; the GiError of `Device.use` says it.
logging.getLogger("wgpu").addFilter(lambda record: "device lost" not in record.getMessage().lower())


@dataclass(frozen=True)
class AdapterInfo:
    """An adapter as `wgpu-gi info` shows it; if it is not `usable`, `why_not` says why.

    `needs_newer_driver`: what a later version of its driver mends, and what that costs until then.
    """

    name: str
    backend: str
    type: str
    driver: str
    features: tuple[str, ...]
    limits: dict[str, int]
    usable: bool
    why_not: str = ""
    needs_newer_driver: tuple[str, ...] = ()


class Device:
    """An open adapter. `gpu` is the wgpu device; there is one per adapter and process, since wgpu leaks devices.

    All work on the GPU happens in a `with device.use():` block.
    """

    def __init__(self, adapter: Any, large_buffers: bool = False) -> None:
        info = adapter.info
        self.adapter_name: str = info["device"]
        self.backend: str = info["backend_type"]
        self.driver: str = info["description"]
        self.is_cpu: bool = info["adapter_type"] == "CPU"
        limits = dict(DEFAULT_LIMITS)
        if large_buffers:
            for name in ("max-storage-buffer-binding-size", "max-buffer-size"):
                limits[name] = max(limits[name], min(adapter.limits[name], LARGE_BUFFER))
        features = sorted(WANTED_FEATURES & set(adapter.features))
        try:
            self.gpu = adapter.request_device_sync(label="wgpu_gi", required_features=features, required_limits=limits)
        except Exception as error:  # wgpu raises RuntimeError, KeyError or GPUError, by version and driver
            raise GiError(f"adapter {self.adapter_name!r} refused a device: {reason(error)}") from error
        self.pipelines = Pipelines(self.gpu)
        self.features = set(self.gpu.features)
        self.capabilities = capabilities_of(info["adapter_type"], self.features)
        self.limits: dict[str, int] = dict(self.gpu.limits)
        self.render_timestamps = "timestamp-query" in self.features
        self.compute_timestamps = self.render_timestamps and not _compute_timestamps_lie(self.driver, self.is_cpu)
        # Nanoseconds per tick of a timestamp; wgpu-py has no name for it.
        self.timestamp_period: float = lib.wgpuQueueGetTimestampPeriod(self.gpu.queue._internal)
        self._wait_buffer = self.gpu.create_buffer(label="wait", size=4, usage=wgpu.BufferUsage.COPY_SRC)
        self._process = os.getpid()
        self._lost = False
        self._lock = threading.RLock()
        self._uses = 0  # nested `use` blocks of the thread that holds the lock
        self._discarded: deque[Callable[[], None]] = deque()
        atexit.register(self._finish)

    def _finish(self) -> None:
        """Let the driver finish at the end of the process: lavapipe crashes if it ends while a shader compiles."""
        if os.getpid() == self._process and not self._lost:
            with suppress(wgpu.GPUError):
                self.wait()

    def check(self) -> None:
        """Raise GiError in a fork of the process that opened the device."""
        if os.getpid() != self._process:
            raise GiError(
                "this process was forked from one that uses the GPU, where a GPU does not work; start processes with"
                ' multiprocessing.get_context("spawn")'
            )

    @contextmanager
    def use(self) -> Iterator[None]:
        """Wait until no other thread uses the device, and keep others waiting during the block.

        Raises GiError as `check` does, and in place of any error of wgpu within the block.
        """
        self.check()
        with self._lock:
            self._uses += 1
            try:
                yield
            except (wgpu.GPUError, GiError) as error:
                cause = error if isinstance(error, wgpu.GPUError) else error.__cause__
                if cause is error or _is_loss(cause):
                    raise self._explained(cause) from cause
                raise
            finally:
                self._uses -= 1
                self._release_discarded()

    def discard(self, *releases: Callable[[], None]) -> None:
        """Call `releases`, which free memory on the GPU: now, or when the current `use` of any thread ends.

        For `__del__`, which can interrupt any other code.
        """
        if os.getpid() != self._process:
            return
        self._discarded.extend(releases)
        if self._lock.acquire(blocking=False):
            try:
                self._release_discarded()
            finally:
                self._lock.release()

    def _release_discarded(self) -> None:
        while self._discarded and not self._uses:
            self._discarded.popleft()()

    def _explained(self, error: Any) -> GiError:
        """Return the error as a sentence. After the loss of the device, the next `open_device` opens another."""
        if _is_loss(error):
            if not self._lost:
                _open.cache_clear()
            self._lost = True
            return LostDevice(
                f"the driver of {self.adapter_name!r} has lost the device, as after a crash or a reset of the GPU;"
                " start again with a new Renderer"
            )
        if isinstance(error, wgpu.GPUOutOfMemoryError):
            return GiError(
                f"{self.adapter_name!r} has not enough memory ({reason(error)}); use a smaller picture or scene"
            )
        return GiError(f"the GPU refused the frame: {reason(error)}")

    def submit(self, commands: Any) -> Any:
        """Submit a command buffer; return its submission, for `wait`."""
        # `queue.submit` drops the index of the submission.
        return libf.wgpuQueueSubmitForIndex(
            self.gpu.queue._internal, 1, ffi.new("WGPUCommandBuffer[]", [commands._internal])
        )

    def wait(self, submission: Any = None) -> None:
        """Block until a submission and all before it are done; without one, until all submitted work is done."""
        if submission is not None:
            libf.wgpuDevicePoll(self.gpu._internal, True, ffi.new("WGPUSubmissionIndex *", submission))
            return
        # queue.on_submitted_work_done_* raises TypeError in wgpu 0.32.0 (wgpu-py issue 834).
        poll = getattr(self.gpu, "_poll_wait", None)
        if poll is not None:
            poll()
        else:
            self.gpu.queue.read_buffer(self._wait_buffer, 0, 4)


def open_device(adapter: str | None = None, large_buffers: bool = False) -> Device:
    """Return the device of the best adapter, or of the first whose name contains `adapter` (case-insensitive).

    The environment variable WGPU_GI_ADAPTER chooses another of those by its number, from 0: so processes share the GPUs
    of a machine. Limits are WebGPU's defaults. `large_buffers` raises the limits of buffer size and storage binding
    size to the adapter's, at most 2 GiB. Raises GiError if there is no adapter, or none of that name or number, and in
    the fork of a process that has opened it.
    """
    found = _adapters()
    usable = [a for a in found if not _why_not(a)]
    if not usable:
        seen = "; ".join(f"{_name(a)!r} is unusable: {_why_not(a)}" for a in found)
        raise GiError(
            "no Vulkan, Metal or Direct3D 12 adapter found; on Debian or Ubuntu install "
            "mesa-vulkan-drivers libvulkan1, else the driver of your GPU" + (f" ({seen})" if seen else "")
        )
    matching = [a for a in usable if adapter is None or adapter.lower() in _name(a).lower()]
    if not matching:
        names = ", ".join(repr(_name(a)) for a in usable)
        raise GiError(f"no adapter is called {adapter!r}; available: {names}")
    best = sorted(matching, key=_rank)[_number(len(matching))]
    device = _open(found.index(best), large_buffers)
    device.check()
    return device


def list_adapters() -> list[AdapterInfo]:
    """Return all adapters, the choice of `open_device()` first; an empty list if there is no driver."""
    return [
        AdapterInfo(
            name=_name(a),
            backend=a.info["backend_type"],
            type=a.info["adapter_type"],
            driver=a.info["description"],
            features=tuple(sorted(a.features)),
            limits=dict(a.limits),
            usable=not _why_not(a),
            why_not=_why_not(a),
            needs_newer_driver=_mended_later(a.info["description"], a.info["adapter_type"] == "CPU"),
        )
        for a in sorted(_adapters(), key=lambda a: (bool(_why_not(a)), _rank(a)))
    ]


@cache
def _adapters() -> list[Any]:
    """List the adapters, once per process, without loading OpenGL."""
    # Mesa's device-select layer prints errors to stderr if this is unset.
    os.environ.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())
    set_instance_extras(backends=["Vulkan", "Metal", "DX12"])
    return list(wgpu.gpu.enumerate_adapters_sync())


@cache
def _open(number: int, large_buffers: bool) -> Device:
    return Device(_adapters()[number], large_buffers)


def _number(count: int) -> int:
    """Return which of `count` adapters to use."""
    text = os.environ.get("WGPU_GI_ADAPTER", "0")
    if not text.isdecimal() or int(text) >= count:
        raise GiError(f"WGPU_GI_ADAPTER is the number of an adapter, from 0 to {count - 1} here, not {text!r}")
    return int(text)


def _is_loss(error: object) -> bool:
    return isinstance(error, wgpu.GPUError) and "device is lost" in str(error).lower()


def _name(adapter: Any) -> str:
    return str(adapter.info["device"])


def _rank(adapter: Any) -> int:
    kind = adapter.info["adapter_type"]
    return PREFERENCE.index(kind) if kind in PREFERENCE else len(PREFERENCE)


def _why_not(adapter: Any) -> str:
    """Return why an adapter cannot be used, or an empty string."""
    backend = adapter.info["backend_type"]
    if backend not in BACKENDS:
        return f"{backend} returns wrong data for mip views; a Vulkan, Metal or Direct3D 12 driver is needed"
    # 0 means that the driver does not report the limit. Smaller alignments are better.
    for name, needed in DEFAULT_LIMITS.items():
        has = adapter.limits.get(name, 0)
        if has and (has > needed if name.startswith("min-") else has < needed):
            return f"its {name} is {has}, and {needed} is needed"
    return ""


def _compute_timestamps_lie(driver: str, is_cpu: bool) -> bool:
    """Return True where timestamps around compute passes are wrong: on llvmpipe before Mesa 25."""
    mesa = re.match(r"Mesa (\d+)", driver)
    return is_cpu and mesa is not None and int(mesa[1]) < 25


def _mended_later(driver: str, is_cpu: bool) -> tuple[str, ...]:
    """Return a sentence for each fault of a driver that a later version of it does not have."""
    if not _compute_timestamps_lie(driver, is_cpu):
        return ()
    return (
        "times of compute passes: its timestamps are wrong, so each pass is timed by submitting it and waiting",
        "loops of more than 65,535 steps: it ends them silently, so long paths are traced in several runs",
    )
