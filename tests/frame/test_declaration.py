"""Changes from frame to frame compile no pipeline and read no file; unused pipelines are freed."""

from __future__ import annotations

import pytest
from helpers.techniques import make_settings, medley_under_a_sky

from wgpu_gi import load
from wgpu_gi.gpu import pipelines
from wgpu_gi.gpu.graph import Graph
from wgpu_gi.gpu.wgsl.load import load as load_shader
from wgpu_gi.options import TECHNIQUES, uses
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.settings import apply_quality, assign, describe

SIZE = (32, 18)


@pytest.fixture
def compiled(monkeypatch):
    """Return a function that takes a renderer and returns the list of the pipelines it compiles from now on."""

    def watch(renderer):
        labels, gpu = [], renderer._device.gpu

        def counting(create):
            def counted(**made_with):
                labels.append(made_with["label"])
                return create(**made_with)

            return counted

        for kind in ("create_compute_pipeline", "create_render_pipeline"):
            monkeypatch.setattr(gpu, kind, counting(getattr(gpu, kind)))
        return labels

    return watch


@pytest.fixture(params=TECHNIQUES, scope="module")
def renderer(request):
    """Return a renderer of each technique, with history, after a frame of a scene with every feature."""
    settings = make_settings(request.param)
    settings.temporal.frames = 4
    renderer = Renderer(medley_under_a_sky(), size=SIZE, settings=settings)
    renderer.step()
    return renderer


def variants(gi):
    """Yield settings of a technique: the defaults, then each with another choice, or at a limit."""
    rows = [row for row in describe(Settings()) if row.name != "gi" and uses(gi, row.name)]
    texts = [f"{row.name}={choice}" for row in rows for choice in row.choices]
    texts += [f"{row.name}={str(not row.value).lower()}" for row in rows if row.kind is bool]
    texts += [f"{row.name}={limit}" for row in rows if row.kind is int and row.range for limit in row.range]
    for text in ("", *texts):
        settings = Settings(gi=gi)
        if text:
            assign(settings, text)
        yield text, settings


@pytest.mark.parametrize("gi", TECHNIQUES)
def test_every_pass_knows_which_layers_the_scene_has(gi, monkeypatch):
    """A pass with other HAS_ constants than the rest would read the G-buffer's layers at wrong places."""
    for name, instead in (("compile", None), ("run", True), ("stale", {})):
        monkeypatch.setattr(Graph, name, lambda *_args, _instead=instead, **_named: _instead)
    features = load_shader("common/layers.wgsl").overrides
    renderer = Renderer(medley_under_a_sky(), size=SIZE)
    lacking = {}
    for text, renderer.settings in variants(gi):
        renderer.step(show=("radiance",))
        for name, p in renderer.graph.passes.items():
            found = [key for key in p.source.overrides if key in features and key not in p.constants]
            if found:
                lacking[name, text] = found
    assert lacking == {}


def owner_of(settings, path):
    """Return the section that holds a setting, and the name of the setting in it."""
    *sections, name = path.split(".")
    for section in sections:
        settings = getattr(settings, section)
    return settings, name


def other_value(row):
    """Return another value of a continuous setting, within its range."""
    value, (low, high) = (1.0 if row.value is None else row.value), row.range or (-1e30, 1e30)
    step = 0.13 * abs(value) or 0.1
    return value + step if value + step <= high else max(value - step, low)


def test_no_continuous_setting_compiles_a_pipeline(renderer, compiled):
    renderer.settings.ssil.radius = 20.0  # another radius than the default needs another number of levels
    renderer.step()
    labels, found = compiled(renderer), {}
    for row in describe(renderer.settings):
        if row.kind is not float:
            continue
        owner, name = owner_of(renderer.settings, row.name)
        for value in (other_value(row), row.value):
            setattr(owner, name, value)
            renderer.step()
        if labels:
            found[row.name] = [*labels]
            labels.clear()
    assert found == {}


def test_no_size_and_no_move_compiles_a_pipeline(renderer, compiled):
    renderer.settings.ssil.radius = None  # automatic: twice the smallest that covers the screen
    renderer.step()
    labels = compiled(renderer)
    for size in ((33, 18), (64, 36), (17, 40), SIZE):
        renderer.size = size
        renderer.step()
    renderer.scene.lights[0].intensity *= 2.0
    renderer.camera = renderer.scene.cameras[0]
    renderer.step()
    assert labels == []


@pytest.mark.parametrize("mode", ["splat", "pull-push"])
def test_no_count_of_lights_paths_or_points_compiles_a_pipeline(mode, compiled):
    settings = make_settings("many-light")
    settings.gather.visibility, settings.ism.mode, settings.ism.points = "ism", mode, 64
    renderer = Renderer(medley_under_a_sky(), size=SIZE, settings=settings)
    renderer.step()
    labels = compiled(renderer)
    for section, name, value in (
        ("rsm", "texels", 500),
        ("vpl", "count", 150),
        ("vpl", "paths", 300),
        ("vpl", "max_bounces", 3),
        ("ism", "points", 100),
    ):
        setattr(getattr(renderer.settings, section), name, value)
        assert renderer.step(check=True)
    assert labels == []


def test_no_step_reads_a_file(renderer, monkeypatch):
    renderer.settings.exposure = 0.5
    renderer.step()  # imports modules on first use

    def forbidden(path, *_, **__):
        raise AssertionError(f"{path} is read")

    for name in ("os.stat", "os.lstat", "os.open", "os.listdir", "os.scandir", "builtins.open"):
        monkeypatch.setattr(name, forbidden)
    renderer.step()
    renderer.settings.exposure = 1.0
    renderer.step()
    renderer.size = (40, 20)
    renderer.step()


def test_unused_pipelines_are_freed(monkeypatch):
    monkeypatch.setattr(pipelines, "KEPT", 3)
    renderer = Renderer(load("cornell"), size=SIZE, settings=make_settings("many-light"))
    alive = renderer._device.pipelines._pipelines
    others = {id(pipeline) for pipeline in alive.values()}

    def unused():
        used = {id(p.pipeline) for p in renderer.graph.order}
        return {id(pipeline) for pipeline in alive.values()} - used - others

    for technique in TECHNIQUES:
        for quality in ("low", "medium"):
            renderer.settings.gi = technique
            apply_quality(renderer.settings, quality)
            renderer.step(show=("radiance",))
            assert len(unused()) <= 3
    renderer.release()
    assert len(unused()) <= 3
