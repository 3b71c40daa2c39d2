"""A device that computes nothing and writes down what it is told: for tests of the render graph without a driver."""

from __future__ import annotations

from types import SimpleNamespace

from wgpu_gi.gpu.capabilities import CPU
from wgpu_gi.gpu.pipelines import Pipelines


class FakeObject:
    """A wgpu object: what it was made with are its attributes."""

    def __init__(self, kind, log, **made_with):
        self.kind, self.log, self.destroyed = kind, log, False
        self.__dict__.update(made_with)

    def destroy(self):
        self.destroyed = True
        self.log.append(("destroy", self.label))


class FakeBuffer(FakeObject):
    map_state = "unmapped"


class FakeTexture(FakeObject):
    def create_view(self, **made_with):
        return FakeObject("view", self.log, texture=self, **made_with)


class FakePass:
    """A pass encoder; a dispatch or draw is noted with the label of bind group 1, which is the pass of the graph.

    As in WebGPU, each group of the pipeline's layout that has entries must be set by then.
    """

    def __init__(self, log):
        self.log, self.pipeline, self.groups, self.open = log, None, {}, True

    @property
    def label(self):
        assert self.open
        for index, layout in enumerate(self.pipeline.layout.bind_group_layouts):
            assert not layout.entries or self.groups[index].layout is layout
        return self.groups[1].label

    def set_pipeline(self, pipeline):
        self.pipeline = pipeline

    def set_bind_group(self, index, group):
        self.groups[index] = group

    def dispatch_workgroups(self, *groups):
        self.log.append(("dispatch", self.label, groups))

    def dispatch_workgroups_indirect(self, buffer, offset):
        self.log.append(("dispatch", self.label, buffer.label))

    def set_index_buffer(self, buffer, index_format):
        self.log.append(("index", self.label, f"{buffer.label} {index_format}"))

    def draw(self, *counts):
        self.log.append(("draw", self.label, counts))

    def draw_indexed(self, *counts):
        self.log.append(("draw indexed", self.label, counts))

    def end(self):
        assert self.open
        self.open = False


class FakeEncoder:
    """A command encoder; as in WebGPU, one pass is open at a time and nothing is recorded beside it."""

    def __init__(self, log):
        self.log, self.last = log, None

    def begin(self):
        self.check_closed()
        self.last = FakePass(self.log)
        return self.last

    def check_closed(self):
        assert self.last is None or not self.last.open

    def begin_compute_pass(self, label, **_):
        self.log.append(("compute pass",))
        return self.begin()

    def begin_render_pass(self, label, **attachments):
        self.log.append(("targets", label, attachments))
        return self.begin()

    def clear_buffer(self, buffer):
        self.check_closed()
        self.log.append(("clear", buffer.label))

    def finish(self):
        self.check_closed()
        return self


class FakeQueue:
    def __init__(self, log):
        self.log = log

    def write_buffer(self, buffer, offset, data):
        buffer.data = bytes(data)
        self.log.append(("write", buffer.label, bytes(data)))

    def write_texture(self, *_):
        pass

    def submit(self, encoders):
        self.log.append(("submit",))


class FakeGpu:
    def __init__(self):
        self.log = []
        self.queue = FakeQueue(self.log)

    def create_command_encoder(self, label):
        return FakeEncoder(self.log)

    def create_buffer(self, **made_with):
        return FakeBuffer("buffer", self.log, **made_with)

    def create_texture(self, **made_with):
        return FakeTexture("texture", self.log, **made_with)

    def __getattr__(self, name):
        """Return a maker of any other object: create_sampler, create_compute_pipeline ..."""
        if not name.startswith("create_"):
            raise AttributeError(name)

        def create(**made_with):
            self.log.append((name, made_with.get("label")))
            return FakeObject(name.removeprefix("create_"), self.log, **made_with)

        return create


def fake_device():
    """Return what a Graph needs of a device."""
    gpu = FakeGpu()
    return SimpleNamespace(
        gpu=gpu,
        pipelines=Pipelines(gpu),
        features=set(),
        limits={},
        is_cpu=True,
        compute_timestamps=False,
        render_timestamps=False,
        capabilities=CPU,
        submit=lambda commands: gpu.queue.submit([commands]),
        wait=lambda submission=None: None,
    )
