"""Choice of adapter, limits and features, with made-up adapters."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.gpu import device as device_module
from wgpu_gi.gpu.device import DEFAULT_LIMITS, LARGE_BUFFER, list_adapters, open_device


class FakeAdapter:
    def __init__(self, name, kind, backend="Vulkan", driver="Mesa 25.0.7", features=(), **limits):
        self.info = {"device": name, "adapter_type": kind, "backend_type": backend, "description": driver}
        self.features = set(features)
        self.limits = DEFAULT_LIMITS | {"max-buffer-size": 2**40} | {k.replace("_", "-"): v for k, v in limits.items()}

    def request_device_sync(self, label, required_features, required_limits):
        if self.info["description"] == "broken":
            raise RuntimeError("Validation Error\n\nCaused by:\n  it is broken")
        self.requested = required_limits
        queue = SimpleNamespace(_internal=None, read_buffer=lambda *_: b"")
        make = SimpleNamespace(features=set(required_features), limits=required_limits, queue=queue)
        make.create_buffer = lambda **_: None
        return make


@pytest.fixture
def adapters(monkeypatch):
    """Return a function that puts adapters in the place of those of this machine."""
    device_module._open.cache_clear()
    monkeypatch.setattr(device_module, "lib", SimpleNamespace(wgpuQueueGetTimestampPeriod=lambda _: 1.0))

    def use(*found):
        monkeypatch.setattr(device_module, "_adapters", lambda: list(found))

    yield use
    device_module._open.cache_clear()


CPU = FakeAdapter("llvmpipe (LLVM 15)", "CPU", driver="Mesa 22.3.6", features=["timestamp-query", "shader-f64"])
FAST = FakeAdapter("Fast 9000", "DiscreteGPU", features=["timestamp-query", "float32-filterable"])
SMALL = FakeAdapter("Small 1", "IntegratedGPU")
OPENGL = FakeAdapter("llvmpipe (GL)", "CPU", backend="OpenGL")


def test_prefers_discrete_then_integrated_then_cpu(adapters):
    adapters(OPENGL, CPU, SMALL, FAST)
    assert open_device().adapter_name == "Fast 9000"
    adapters(CPU, SMALL)
    assert open_device().adapter_name == "Small 1"
    assert [a.name for a in list_adapters()] == ["Small 1", "llvmpipe (LLVM 15)"]


def test_by_name_and_cached(adapters):
    adapters(CPU, SMALL, FAST)
    found = open_device("LLVMPIPE")
    assert found.adapter_name == "llvmpipe (LLVM 15)" and found.is_cpu
    assert open_device("llvm") is found


def test_unknown_name_lists_what_there_is(adapters):
    adapters(OPENGL, CPU, SMALL)
    with pytest.raises(GiError, match=r"no adapter is called 'H200'; available: 'llvmpipe \(LLVM 15\)', 'Small 1'"):
        open_device("H200")


def test_no_adapter_says_what_to_install(adapters):
    adapters()
    with pytest.raises(GiError, match="install mesa-vulkan-drivers libvulkan1"):
        open_device()
    assert list_adapters() == []


def test_opengl_is_never_used(adapters):
    adapters(OPENGL)
    with pytest.raises(GiError, match=r"'llvmpipe \(GL\)' is unusable: OpenGL returns wrong data"):
        open_device()
    (info,) = list_adapters()
    assert not info.usable and "OpenGL" in info.why_not


def test_too_small_adapters_are_refused(adapters):
    adapters(FakeAdapter("old", "DiscreteGPU", max_storage_buffers_per_shader_stage=4))
    with pytest.raises(GiError, match="its max-storage-buffers-per-shader-stage is 4, and 8 is needed"):
        open_device()
    adapters(FakeAdapter("coarse", "DiscreteGPU", min_uniform_buffer_offset_alignment=512))
    assert "min-uniform-buffer-offset-alignment is 512" in list_adapters()[0].why_not


def test_limits_are_the_defaults_of_webgpu(adapters):
    adapters(FAST)
    open_device()
    assert FAST.requested == DEFAULT_LIMITS
    open_device(large_buffers=True)
    changed = {name for name in DEFAULT_LIMITS if FAST.requested[name] != DEFAULT_LIMITS[name]}
    assert changed == {"max-buffer-size"} and FAST.requested["max-buffer-size"] == LARGE_BUFFER


def test_features_by_intersection_and_timestamps_that_lie(adapters):
    adapters(CPU, FAST, SMALL, FakeAdapter("llvmpipe new", "CPU", features=["timestamp-query"]))
    old, fast, small, new = (open_device(name) for name in ("llvm 15", "fast", "small", "new"))
    assert old.features == {"timestamp-query"} and fast.features == {"timestamp-query", "float32-filterable"}
    assert [d.compute_timestamps for d in (old, fast, small, new)] == [False, True, False, True]
    assert [d.render_timestamps for d in (old, fast, small, new)] == [True, True, False, True]
    # `info` says what a newer driver would mend.
    assert [a.name for a in list_adapters() if a.needs_newer_driver] == ["llvmpipe (LLVM 15)"]


def test_refused_device(adapters):
    adapters(FakeAdapter("bad", "DiscreteGPU", driver="broken"))
    with pytest.raises(GiError, match="adapter 'bad' refused a device: it is broken"):
        open_device()


def test_wait_without_poll_reads_a_few_bytes(adapters):
    adapters(SMALL)
    open_device().wait()
