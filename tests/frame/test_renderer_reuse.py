"""A reused renderer: which changes keep accumulated frames and samples, and that errors leave no trace."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.medley import at, medley

from wgpu_gi import gpu_frame
from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.options import MAX_PIXELS, TECHNIQUES, CameraSettings, Settings
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.built_in.shapes import box, grid, sphere
from wgpu_gi.scene.scene import DirectionalLight, Instance, Scene
from wgpu_gi.techniques.reference import PathSettings
from wgpu_gi.webgpu_limits import MAX_TEXTURE_SIDE

SIZE = (48, 27)
SHOWN = ("radiance", "display")


def averaged(frames=4, **fields):
    return Settings(gi="none", camera=CameraSettings(frames=frames), **fields)


def traced(spp, **fields):
    return Settings(gi="path", spp=spp, path=PathSettings(samples_per_run=8), **fields)


def fresh(scene, settings, show=SHOWN):
    """Return the pictures of a new renderer."""
    renderer = Renderer(scene, size=SIZE, settings=settings)
    renderer.run(show=show)
    return [renderer.read_back(name) for name in show]


def same(renderer, expected, show=SHOWN):
    return all(np.array_equal(renderer.read_back(name), e) for name, e in zip(show, expected, strict=True))


def steps(renderer, show=SHOWN):
    """Step until no pass runs; return the number of steps."""
    count = 0
    while renderer.step(show=show):
        count += 1
    return count


# ------------------------------------------------------------------------------------------------ Jittered frames


def test_exposure_keeps_accumulated_frames():
    scene = medley()
    renderer = Renderer(scene, size=SIZE, settings=averaged())
    for _ in range(2):
        renderer.step(show=SHOWN)
    renderer.settings.exposure = 1.5
    assert steps(renderer) == 2
    assert same(renderer, fresh(scene, averaged(exposure=1.5)))
    renderer.settings.exposure = -1.0
    assert renderer.step(show=SHOWN) and set(renderer.graph.last_run) == {"composite/display"}
    assert steps(renderer) == 0
    assert same(renderer, fresh(scene, averaged(exposure=-1.0)))


def test_settings_of_the_path_tracer_keep_accumulated_frames():
    renderer = Renderer(medley(), size=SIZE, settings=averaged())
    renderer.step(show=SHOWN)
    renderer.settings.spp, renderer.settings.path.samples_per_run = 3, 5
    assert steps(renderer) == 3
    renderer.settings.spp = 6
    assert steps(renderer) == 0


CHANGES = {
    "ambient": lambda s: setattr(s.environment, "ambient", False),
    "seed": lambda s: setattr(s, "seed", 3),
    "rays": lambda s: setattr(s.direct, "rays", 2),
    "emitters": lambda s: setattr(s.direct, "emitters", "maps"),
    "maps": lambda s: setattr(s.shadow, "point", 64),
    "edges": lambda s: setattr(s.direct, "edges", False),
    "diffuse": lambda s: setattr(s, "diffuse", True),
    "more frames": lambda s: setattr(s.camera, "frames", 6),
    "fewer frames": lambda s: setattr(s.camera, "frames", 3),
}


@pytest.mark.parametrize("done", [2, 4])
@pytest.mark.parametrize("name", CHANGES)
def test_settings_of_the_picture_restart_accumulation(name, done):
    scene, changed = medley(), averaged()
    CHANGES[name](changed)
    renderer = Renderer(scene, size=SIZE, settings=averaged())
    for _ in range(done):
        renderer.step(show=SHOWN)
    CHANGES[name](renderer.settings)
    assert steps(renderer) == changed.camera.frames
    assert same(renderer, fresh(scene, changed))


def test_jitter_off_and_on_restores_the_picture():
    """Without emitters, or with fixed samples of them, only jitter varies."""
    scene, chosen = medley(), averaged()
    chosen.direct.emitters = "maps"
    renderer = Renderer(scene, size=SIZE, settings=chosen)
    renderer.run(show=SHOWN)
    before = [renderer.read_back(name) for name in SHOWN]
    renderer.settings.camera.jitter = False
    assert steps(renderer) == 1
    renderer.settings.camera.jitter = True
    assert steps(renderer) == 4 and same(renderer, before)


# ------------------------------------------------------------------------------------------------ Path samples


@pytest.mark.parametrize(
    ("before", "done", "after", "left"),
    [
        (16, 2, 32, 2),  # all samples are kept
        (32, 1, 64, 7),
        (16, 2, 21, 1),
        (64, 2, 24, 1),  # fewer, but more than there are
        (20, 2, 32, 2),  # two full runs; the third would not have been full
        (20, 3, 32, 4),  # the third run took only four: restart
        (64, 4, 16, 2),  # more than needed: restart
    ],
)
def test_path_samples_are_kept_when_their_number_changes(before, done, after, left):
    scene, show = builtin.cornell(), ("radiance", "standard_error")
    renderer = Renderer(scene, size=SIZE, settings=traced(before))
    for _ in range(done):
        renderer.step(show=show)
    renderer.settings.spp = after
    assert steps(renderer, show) == left
    assert same(renderer, fresh(scene, traced(after), show), show)


def test_another_seed_restarts_sampling():
    scene = builtin.cornell()
    renderer = Renderer(scene, size=SIZE, settings=traced(16))
    renderer.run(show=SHOWN)
    renderer.settings.spp, renderer.settings.seed = 32, 5
    assert steps(renderer) == 4
    assert same(renderer, fresh(scene, traced(32, seed=5)))


def test_exposure_keeps_path_samples():
    scene = builtin.cornell()
    renderer = Renderer(scene, size=SIZE, settings=traced(24))
    renderer.step(show=SHOWN)
    renderer.settings.exposure = 1.0
    assert steps(renderer) == 2
    renderer.settings.exposure = 2.0
    assert renderer.step(show=SHOWN) and set(renderer.graph.last_run) == {"composite/display"}
    assert steps(renderer) == 0
    assert same(renderer, fresh(scene, traced(24, exposure=2.0)))


# ------------------------------------------------------------------------------------------------ Moving instances


@pytest.mark.parametrize("smallest", [1, 1 << 16], ids=["on the device", "by numpy"])
def test_a_deformed_mesh_looks_as_in_a_new_renderer(monkeypatch, smallest):
    """Its tree is refitted: the new mesh has the same array of triangles."""
    monkeypatch.setattr("wgpu_gi.upload.tree_builder.SMALLEST", smallest)
    ball = sphere(radius=1.0, subdivisions=3)
    scene = Scene([Instance(ball)], [DirectionalLight((-0.3, -1, -0.5), 3.0)])
    camera = Camera.look_at((0, 1, 4), (0, 0, 0))
    settings = Settings(gi="path", spp=4)
    with Renderer(scene, size=(64, 48), camera=camera, settings=settings) as renderer:
        renderer.run()
        before = renderer.read_back()
        wave = ball.positions + 0.3 * np.sin(5 * ball.positions[:, [1, 2, 0]])
        scene.instances[0].mesh = replace(ball, positions=wave.astype(np.float32))
        renderer.run()
        after = renderer.read_back()
    with Renderer(scene, size=(64, 48), camera=camera, settings=settings) as renderer:
        renderer.run()
        expected = renderer.read_back()
    assert np.abs(after - before).mean() > 0.05 * before.mean()
    assert np.allclose(after, expected, rtol=1e-4, atol=1e-4 * expected.mean())


def test_shadow_follows_its_caster():
    """A plate, one of two instances of a mesh, under a slanting sun: area and centre of its shadow on the floor."""
    plate = box((-0.2, 0.5, -0.2), (0.2, 0.52, 0.2))
    scene = Scene(
        [Instance(grid(4.0, 2)), Instance(plate, at(0, 0, 0)), Instance(plate, at(0.9, 0, 0.9))],
        [DirectionalLight((1, -1, 0), 1.0)],
        cameras=[Camera.look_at((0, 4, 0.01), (0, 0, 0))],
    )
    scene.cameras[0].orthographic_height = 4.0
    show = ("direct", "position")
    renderer = Renderer(scene, size=(64, 64), settings=Settings(gi="none", camera=CameraSettings(jitter=False)))
    for x, z in ((-1.2, -0.8), (-0.4, 0.3), (-0.4, -0.6), (-1.2, -0.8)):
        scene.instances[1].world_from_local = at(x, 0, z)
        renderer.run(show=show)
        direct, position = (renderer.read_back(name) for name in show)
        ours = (position[..., 1] < 0.1) & (np.abs(position[..., 0] - x - 0.5) < 0.45) & (position[..., 2] < 0.6)
        dark = ours & (direct.max(-1) == 0)
        # 0.4 m square, of pixels of (4 / 64 m) squared
        assert dark.sum() * (4 / 64) ** 2 == pytest.approx(0.16, rel=0.2)
        assert position[dark][:, 0].mean() == pytest.approx(x + 0.5, abs=0.03)
        assert position[dark][:, 2].mean() == pytest.approx(z, abs=0.03)
        other = Renderer(scene, size=(64, 64), settings=renderer.settings)
        other.run(show=show)
        assert np.abs(other.read_back("direct") - direct).max() < 1e-3 * direct.max()


# ------------------------------------------------------------------------------------------------ Errors


BAD = {
    "setting": (
        lambda r: setattr(r.settings.direct, "samples", 0),
        lambda r: setattr(r.settings.direct, "samples", 16),
    ),
    "frames": (lambda r: setattr(r.settings.camera, "frames", 0), lambda r: setattr(r.settings.camera, "frames", 4)),
    "size": (lambda r: setattr(r, "size", (0, 9)), lambda r: setattr(r, "size", SIZE)),
    "light": (
        lambda r: setattr(r.scene.lights[0], "intensity", -1.0),
        lambda r: setattr(r.scene.lights[0], "intensity", 9.0),
    ),
    "technique": (lambda r: setattr(r.settings, "gi", "magic"), lambda r: setattr(r.settings, "gi", "none")),
}


@pytest.mark.parametrize("name", BAD)
def test_picture_after_an_error_is_right(name):
    """The error comes during accumulation, in the step in which a light moves."""
    scene, (spoil, mend) = medley(), BAD[name]
    scene.lights[0].intensity = 9.0
    renderer = Renderer(scene, size=SIZE, settings=averaged())
    for _ in range(2):
        renderer.step(show=SHOWN)
    scene.lights[0].position = (-1, 4, 2)
    spoil(renderer)
    for _ in range(2):
        with pytest.raises(GiError):
            renderer.step(show=SHOWN)
    mend(renderer)
    assert steps(renderer) == 4
    assert same(renderer, fresh(scene, averaged()))


def test_picture_after_an_interruption_is_right():
    scene = builtin.cornell()
    renderer = Renderer(scene, size=SIZE, settings=traced(24))
    renderer.step(show=SHOWN)

    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        renderer.step(stop, show=SHOWN)
    renderer.run(show=SHOWN)
    assert same(renderer, fresh(scene, traced(24)))


@pytest.mark.parametrize(
    ("settings", "finished", "of_another_view"),
    [(traced(24), (8, 8), 0), (averaged(), (1, 2), 1)],
    ids=["path", "none"],
)
def test_interrupted_picture_is_that_of_its_finished_frames(settings, finished, of_another_view):
    """The path tracer is stopped within a run, before its picture; the other technique after a frame."""

    def stop(_):
        raise KeyboardInterrupt

    with Renderer(builtin.cornell(), size=SIZE, settings=settings) as renderer:
        assert renderer.finished == 0
        renderer.step(show=SHOWN)
        assert renderer.finished == finished[0]
        before = renderer.read_back()
        with pytest.raises(KeyboardInterrupt):
            renderer.step(stop, show=SHOWN)
        assert renderer.finished == finished[1]
        assert np.array_equal(renderer.read_back(), before) == (finished[0] == finished[1])
        renderer.camera = Camera.look_at((0, 1, 4), (0, 1, 0))
        with pytest.raises(KeyboardInterrupt):
            renderer.step(stop, show=SHOWN)
        assert renderer.finished == of_another_view


# ------------------------------------------------------------------------------------------------ Large pictures


class Declared(Exception):
    """The frame is declared."""


@pytest.mark.parametrize("gi", TECHNIQUES)
@pytest.mark.parametrize(
    "size", [(MAX_TEXTURE_SIDE, MAX_PIXELS // MAX_TEXTURE_SIDE), (MAX_PIXELS // MAX_TEXTURE_SIDE, MAX_TEXTURE_SIDE)]
)
def test_every_dispatch_reaches_the_largest_picture(gi, size, monkeypatch):
    """Checked by the declaration alone: such a picture would take gigabytes."""
    renderer = Renderer(medley(), size=SIZE, settings=Settings(gi=gi))
    declare = gpu_frame.declare_frame

    def declare_large(graph, *arguments):
        graph.size = size
        declare(graph, *arguments)
        raise Declared

    monkeypatch.setattr(gpu_frame, "declare_frame", declare_large)
    monkeypatch.setitem(renderer.graph.device.limits, "max-storage-buffer-binding-size", 2**31 - 4)
    with pytest.raises(Declared):
        renderer.run()


def test_picture_too_large_for_the_adapter_is_refused(monkeypatch):
    """When the renderer is made, and when it is resized."""
    renderer = Renderer(builtin.cornell(), size=(64, 64))
    monkeypatch.setitem(renderer.graph.device.limits, "max-storage-buffer-binding-size", 2**16)
    renderer.size = (128, 64)
    words = r"size 128x64 needs buffers of .* MiB, and .* \(max-storage-buffer-binding-size\); make the picture smaller"
    with pytest.raises(GiError, match=words + ", such as 90x45"):
        renderer.run()
    with pytest.raises(GiError, match=words):
        Renderer(builtin.cornell(), size=(128, 64))
