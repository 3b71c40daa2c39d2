"""Deferred frames: which passes run after which change, pictures without skips, accumulation, memory, commands."""

from __future__ import annotations

import os
import re

import numpy as np
import pytest
from helpers.medley import at, medley, named
from helpers.memory import resident

from wgpu_gi.__main__ import main
from wgpu_gi.buffers import BUFFERS, buffers_of
from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.measure.wgsl_evaluator import Evaluator
from wgpu_gi.options import TECHNIQUES
from wgpu_gi.pictures.image import load_image
from wgpu_gi.renderer import CameraSettings, Renderer, Settings
from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.scene import DirectionalLight, Environment, Image, Instance, Material, PointLight, Texture
from wgpu_gi.techniques.deferred import direct as direct_module
from wgpu_gi.techniques.deferred import update as update_module
from wgpu_gi.techniques.deferred.shadow_views import ShadowSettings
from wgpu_gi.techniques.deferred.update import DeferredState
from wgpu_gi.techniques.shared.sampling import PIXEL_SEED, pixel_offset
from wgpu_gi.upload.scene_upload import SceneUpload

SIZE = (48, 27)
RASTER = {"gbuffer/opaque", "gbuffer/masked", "shadow/opaque", "shadow/masked"}
LIGHT = {"direct", "composite"}


def settings(jitter=False, **fields):
    return Settings(gi="none", camera=CameraSettings(jitter=jitter), **fields)


def completed(scene=None, show=("radiance",), **fields):
    """Return a renderer that has completed a picture."""
    renderer = Renderer(scene or one_lamp(), size=SIZE, settings=settings(**fields))
    renderer.run(show=show)
    return renderer


def one_lamp():
    """Return the medley with its point light and its sky as the only sources."""
    scene = medley()
    for material in scene.materials:
        material.emission = (0.0, 0.0, 0.0)
    return scene


def ran(renderer, show=("radiance",), **options):
    """Render a frame; return the first part of the name of every pass that ran."""
    return {name.split("/")[0] for name in renderer.graph.last_run} if renderer.step(show=show, **options) else set()


def picture(scene, **fields):
    return completed(scene, **fields).read_back()


# ------------------------------------------------------------------------------------------------ What runs


def test_everything_runs_once():
    renderer = Renderer(one_lamp(), size=SIZE, settings=settings())
    everything = {"gbuffer", "shadow", "environment", *LIGHT}
    assert ran(renderer) == everything
    for _ in range(3):
        assert ran(renderer) == set()
    assert ran(renderer, force=True) == everything
    # A forced frame gives the same results, so nothing is left to do.
    assert ran(renderer) == set()


def test_camera_move_keeps_shadows():
    renderer = completed()
    renderer.camera = Camera.look_at((1, 2, 6), (0, 1, 0))
    assert ran(renderer) == {"gbuffer", *LIGHT}
    assert ran(renderer) == set()


def test_light_move_keeps_the_gbuffer():
    scene = one_lamp()
    renderer = completed(scene)
    scene.lights[0].position = (-1, 4, 2)
    assert ran(renderer) == {"shadow", *LIGHT}
    scene.lights[0].intensity = 10.0
    assert ran(renderer) == LIGHT
    scene.lights[0].color = (1.0, 0.5, 0.5)
    assert ran(renderer) == LIGHT
    scene.lights[0].name = "other"
    assert ran(renderer) == set()


def test_added_and_removed_lights_keep_the_gbuffer():
    scene = one_lamp()
    renderer = completed(scene)
    scene.lights.append(PointLight((-2, 3, 2), 5.0))
    assert ran(renderer) >= {"shadow", *LIGHT} and not {"gbuffer/opaque"} & set(renderer.graph.last_run)
    scene.lights.clear()
    assert "shadow" not in ran(renderer) and not RASTER & set(renderer.graph.last_run)
    assert "no light casts shadows" in renderer.plan()


def test_instance_move_runs_all_but_the_environment():
    scene = one_lamp()
    renderer = completed(scene)
    for x in (-1.4, -1.3):
        named(scene, "left").world_from_local = at(x, 0.9, 0.5, (0.6, 0.9, 0.6), 0.4)
        assert ran(renderer) == {"gbuffer", "shadow", *LIGHT}
        assert ran(renderer) == set()


def test_material_change_runs_shadows_only_with_masks():
    """Only alpha masks matter to shadows, so without one no raster pass runs again."""
    scene = builtin.cornell_point()
    renderer = completed(scene)
    scene.materials[0].base_color = (0.1, 0.5, 0.9, 1.0)
    assert ran(renderer) == {"gbuffer", *LIGHT} and not RASTER & set(renderer.graph.last_run)
    masked = one_lamp()
    renderer = completed(masked)
    masked.materials[0].base_color = (0.1, 0.5, 0.9, 1.0)
    assert ran(renderer) == {"gbuffer", "shadow", *LIGHT}


def test_sky_change_keeps_raster_passes():
    scene = one_lamp()
    renderer = completed(scene)
    scene.environment.color = (0.3, 0.3, 0.1)
    assert ran(renderer) == {"gbuffer", *LIGHT} and not RASTER & set(renderer.graph.last_run)


def test_size_change_keeps_shadow_maps_of_a_lamp():
    renderer = completed()
    renderer.size = (30, 41)
    assert ran(renderer) == {"gbuffer", *LIGHT}
    assert renderer.read_back().shape == (41, 30, 3)


def test_changed_settings_run_only_passes_that_use_them():
    renderer = completed()
    renderer.settings.direct.edges = False
    assert ran(renderer) == LIGHT
    renderer.settings.shadow.point = 128
    assert ran(renderer) == {"shadow", *LIGHT}
    renderer.settings.environment.ambient = False
    assert ran(renderer) == LIGHT


def test_sun_maps_follow_the_camera():
    scene = one_lamp()
    scene.lights = [DirectionalLight((-0.4, -1, -0.3), 2.0)]
    renderer = completed(scene)
    renderer.camera = Camera.look_at((0.5, 0.4, 1.0), (0, 0.3, 0))
    assert ran(renderer) >= {"gbuffer", *LIGHT}
    assert np.array_equal(renderer.read_back(), picture_from(scene, renderer.camera))


def test_a_turning_camera_sees_the_shadows_of_all_that_it_did_not_see_before():
    scene = one_lamp()
    mesh = scene.instances[3].mesh
    scene.instances += [Instance(mesh, at(0.5 * k, 0.1 * (k % 3), -1)) for k in range(-20, 20)]
    scene.lights = [DirectionalLight((-0.4, -1, -0.3), 2.0)]
    shadow = ShadowSettings(cascades=1)
    first = Camera.look_at((-6, 1, 3), (-6, 0, -1), yfov_deg=40)
    renderer = Renderer(scene, size=SIZE, camera=first, settings=settings(shadow=shadow))
    renderer.run(show=("radiance",))
    for eye, target, redraws in (((-6.02, 1, 3), (-6, 0, -1), False), ((6, 2, 3), (5, 0, -1), True)):
        renderer.camera = Camera.look_at(eye, target, yfov_deg=40)
        assert ("shadow" in ran(renderer)) == redraws
        assert np.array_equal(renderer.read_back(), picture_from(scene, renderer.camera, shadow))
    # Now all shadows are drawn.
    renderer.camera = first
    assert ran(renderer) == {"gbuffer", *LIGHT}


def picture_from(scene, camera, shadow=None):
    fields = {} if shadow is None else {"shadow": shadow}
    renderer = Renderer(scene, size=SIZE, camera=camera, settings=settings(**fields))
    renderer.run(show=("radiance",))
    return renderer.read_back()


def test_only_passes_of_shown_buffers_run():
    renderer = completed(show=("albedo",))
    assert ran(renderer, ("emission",)) == {"gbuffer"}
    assert ran(renderer, ("motion",)) == {"gbuffer"} and set(renderer.graph.last_run) == {"gbuffer/motion"}
    assert ran(renderer, ("indirect",)) == set()
    assert not renderer.read_back("indirect").any()


CHANGES = {
    "light": lambda s: setattr(s.lights[0], "position", (-1, 4, 2)),
    "dimmer": lambda s: setattr(s.lights[0], "intensity", 3.0),
    "more lights": lambda s: s.lights.extend([PointLight((-2, 3, 2), 5.0), DirectionalLight((-1, -1, 0), 1.0)]),
    "range": lambda s: setattr(s.lights[0], "range", 4.0),
    "instance": lambda s: setattr(named(s, "block"), "world_from_local", at(-2.2, 0.4, 2)),
    "far instance": lambda s: setattr(named(s, "left"), "world_from_local", at(-90, 0, -200, (9, 9, 9))),
    "instances": lambda s: s.instances.reverse(),
    "material": lambda s: setattr(s.materials[1], "roughness", 0.9),
    "cutoff": lambda s: setattr(material_named(s, "leaf"), "alpha_cutoff", 0.7),
    "opaque": lambda s: setattr(material_named(s, "leaf"), "alpha_mode", "opaque"),
    "emission": lambda s: setattr(material_named(s, "lamp"), "emission", (1.0, 5.0, 1.0)),
    "emission's picture": lambda s: setattr(material_named(s, "panel").emission_texture, "offset", (0.55, 0.1)),
    "emission's wrap": lambda s: setattr(material_named(s, "panel").emission_texture, "wrap_u", "clamp"),
    "other emission": lambda s: setattr(
        material_named(s, "panel"), "emission_texture", Texture(Image(np.full((1, 1, 4), 255, np.uint8)))
    ),
    "environment": lambda s: setattr(s, "environment", Environment((0.5, 0.2, 0.1))),
    "pictured": lambda s: setattr(
        s, "environment", Environment(image=np.random.default_rng(0).random((8, 16, 3)).astype(np.float32))
    ),
    "dark": lambda s: (s.lights.clear(), setattr(s, "environment", None)),
}


def material_named(scene, name) -> Material:
    return next(m for m in scene.materials if m.name == name)


@pytest.mark.parametrize("name", CHANGES)
def test_picture_after_a_change_is_that_of_the_changed_scene(name):
    scene, changed = medley(), medley()
    renderer = completed(scene, direct=ranged())
    before = renderer.read_back()
    CHANGES[name](scene), CHANGES[name](changed)
    renderer.run(show=("radiance",))
    after, fresh = renderer.read_back(), picture(changed, direct=ranged())
    if "instance" not in name:
        assert np.allclose(after, fresh, rtol=1e-4, atol=1e-4)
    else:
        # Rays hit a moved mesh in its local space, and a far move shifts the origin: rounding flips pixels at the edges
        # of a sample light's shadow.
        assert (np.abs(after - fresh).max(-1) > 0.05 * (fresh.max(-1) + 0.1)).mean() < 0.004
        assert after.mean() == pytest.approx(fresh.mean(), rel=1e-3)
    assert name == "instances" or not np.array_equal(before, after)


def ranged():
    direct = direct_module.DirectSettings()
    direct.range = True
    return direct


# ------------------------------------------------------------------------------------------------ Skipped passes


def test_plan_gives_the_reason_of_every_skip():
    renderer = completed(builtin.cornell_point(), show=None)
    rows = {line.split()[0]: line for line in renderer.plan().splitlines()[1:]}
    lacks = {
        "deform": "no mesh is skinned or morphed",
        "gbuffer/masked": "no alpha-masked material",
        "shadow/masked": "no alpha-masked material",
        "gbuffer/tint": "no thin, smooth glass",
        "shadow/see_through": "no see-through material",
        "environment/albedo": "there is no environment",
        "environment/leaves": "there is no environment",
        "environment/sum": "there is no environment",
        "environment/prefilter": "there is no environment",
        "direct/tiles": "fewer than",
        "emitters": "nothing emits light",
        "transmission": "no material transmits light",
        "composite/display": "no output needs",
        "bounces/further": "none finds no indirect light",
    }
    for name, row in rows.items():
        assert (row.split()[1] == "culled") == (name in lacks), row
        assert name not in lacks or lacks[name] in row
    assert rows.keys() >= lacks.keys() | {"gbuffer/opaque", "direct/edges", "gbuffer/motion"}
    unlit = builtin.cornell_point()
    unlit.lights.clear()
    plan = completed(unlit, show=None).plan()
    assert re.search(r"shadow/opaque +culled +no light casts shadows", plan)
    assert re.search(r"direct/edges +culled +no light casts shadows", plan)


def force_features(monkeypatch):
    """Turn all features of all scenes on, so that all code is compiled and all passes are declared."""
    update, update_draws, update_lights = SceneUpload.update, SceneUpload.update_draws, DeferredState.update

    def everything(self, scene):
        update(self, scene)
        pictured = self.features["HAS_PICTURED_ENVIRONMENT"] or scene.environment is None
        self.features = dict.fromkeys(self.features, True) | {"HAS_PICTURED_ENVIRONMENT": pictured}

    def draws(self, scene):
        found = update_draws(self, scene)
        found.masked = found.masked or ((0, 0, 0, 1),)
        return found

    def lights(self, *arguments):
        update_lights(self, *arguments)
        self.features = dict.fromkeys(self.features, True)

    monkeypatch.setattr(DeferredState, "update", lights)
    monkeypatch.setattr(SceneUpload, "update", everything)
    monkeypatch.setattr(SceneUpload, "update_draws", draws)
    monkeypatch.setattr(direct_module, "TILED_FROM", 0)
    monkeypatch.setattr(direct_module, "UNROLLED", 0)


@pytest.mark.parametrize("name", ["cornell-point", "cornell", "plane-sun", "furnace"])
def test_skipped_passes_change_no_buffer(name, monkeypatch):
    """In every buffer: bit for bit, or by rounding where the general dielectric lights it (`HAS_SPECULAR`)."""
    scene = builtin.builtin_scene(name)
    plain = completed(scene, show=None, diffuse=False)
    force_features(monkeypatch)
    forced = completed(scene, show=None, diffuse=False)
    culled = {line.split()[0] for line in forced.plan().splitlines()[1:] if line.split()[1] == "culled"}
    of_pictures = {"environment/leaves", "environment/sum", "environment/prefilter"} if scene.environment else set()
    always = {"deform", "bounces/further", "composite/display"}
    assert culled <= {*always, "shadow/opaque", "direct/edges", "emitters", *of_pictures}, culled
    for buffer in plain.buffers:
        rounding = 1e-5 if buffer in ("radiance", "direct") else 0.0
        # Differences of means of frames.
        absolute = 1e-6 * plain.read_back().max() if buffer == "standard_error" else 0.0
        np.testing.assert_allclose(
            forced.read_back(buffer), plain.read_back(buffer), rtol=rounding, atol=absolute, err_msg=buffer
        )
    # With layers, two words follow that of each surface.
    layered = forced.graph.read_back("gbuffer/surfaces").reshape(-1, 3, 4)
    assert np.array_equal(plain.graph.read_back("gbuffer/surfaces"), layered[:, 0])


# ------------------------------------------------------------------------------------------------ Accumulation


def test_jittered_frames_are_averaged(monkeypatch):
    """The result is the mean of the pictures at each jitter offset; then no pass runs."""
    layers = ("radiance", "direct", "emission")
    scene = medley()
    maps = direct_module.DirectSettings(emitters="maps")  # whose samples are those of a single frame
    chosen = settings(jitter=True, direct=maps)
    chosen.camera.frames, chosen.camera.footprint = 5, 0.0  # unjittered frames show textures at pixel centres
    renderer = Renderer(scene, size=SIZE, settings=chosen)
    progress = []
    assert [renderer.step(progress.append, show=layers) for _ in range(7)] == [True] * 5 + [False] * 2
    assert progress[:5] == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])
    means = {name: renderer.read_back(name) for name in layers}
    sums = dict.fromkeys(layers, 0.0)
    for frame in range(5):
        monkeypatch.setattr(update_module, "pixel_offset", lambda *_, frame=frame: pixel_offset(frame, 0))
        single = Renderer(scene, size=SIZE, settings=chosen)
        single.step(show=layers)
        for name in layers:
            sums[name] = sums[name] + single.read_back(name).astype(np.float64) / 5
    for name in layers:
        assert np.allclose(means[name], sums[name], rtol=1e-5, atol=1e-6), name


def test_accumulation_restarts_after_a_change():
    scene, moved = medley(), medley()
    chosen = settings(jitter=True)
    chosen.camera.frames = 4
    renderer = Renderer(scene, size=SIZE, settings=chosen)
    for _ in range(3):
        renderer.step(show=("radiance",))
    scene.lights[0].position = moved.lights[0].position = (-1, 4, 2)
    count = 0
    while renderer.step(show=("radiance",)):
        count += 1
    assert count == 4
    fresh = Renderer(moved, size=SIZE, settings=chosen)
    fresh.run(show=("radiance",))
    assert np.array_equal(renderer.read_back(), fresh.read_back())
    # Shadow maps are rendered once, not in every frame.
    assert "shadow/opaque" not in renderer.graph.last_run


@pytest.mark.parametrize(("first", "frames"), [(0, 2), (0, 16), (16, 16), (96, 32), (0, 1024)])
def test_jitter_offsets_are_stratified(first, frames):
    """Of an aligned block of n = 2^k offsets, one lies in each box of area 1 / n with sides that are powers of 2."""
    offsets = np.array([pixel_offset(k, 5) for k in range(first, first + frames)])
    for columns in 2 ** np.arange(frames.bit_length()):
        boxes = np.histogram2d(*offsets.T, bins=(columns, frames // columns), range=[[0, 1], [0, 1]])[0]
        assert (boxes == 1).all(), columns


def test_jitter_offsets_are_those_of_the_shader(tmp_path):
    evaluate = Evaluator(tmp_path)
    for seed in (0, 7, 2**32 - 1):
        expression = f"sobol_2d(i, hash({seed}u ^ {PIXEL_SEED}u))"
        points = evaluate("common/random.wgsl", expression, "vec2f", count=100)
        assert np.allclose(points, [pixel_offset(k, seed) for k in range(100)], rtol=0, atol=1e-6)


def test_averaged_edges_are_antialiased():
    """A white square over black: edge pixels have intermediate values, and the covered area is right."""
    scene = builtin.plates(1.0, 1.0)
    scene.instances = scene.instances[:1]
    scene.instances[0].mesh.materials[0].unlit = True
    scene.cameras[0].orthographic_height = 2.1
    chosen = settings(jitter=True)
    chosen.camera.frames = 64
    renderer = Renderer(scene, size=(16, 16), settings=chosen)
    renderer.run(show=("radiance",))
    covered = renderer.read_back()[..., 0] / 0.5
    assert covered.mean() == pytest.approx((1 / 2.1) ** 2, rel=0.01)
    assert 0.2 < covered[4, 8] < 0.95 or 0.05 < covered[3, 8] < 0.95


# ------------------------------------------------------------------------------------------------ One renderer, reused


@pytest.mark.slow
def test_switching_techniques_keeps_their_pictures():
    """In one renderer, each technique gives the picture of a renderer of its own."""
    scene = medley()
    camera = CameraSettings(jitter=False, frames=2)
    chosen = {gi: Settings(gi=gi, spp=2, bounces=1, camera=camera) for gi in TECHNIQUES}
    alone = {}
    for gi, fields in chosen.items():
        renderer = Renderer(scene, size=SIZE, settings=fields)
        renderer.run(show=("radiance", "albedo"))
        alone[gi] = renderer.read_back()
    renderer = Renderer(scene, size=SIZE, settings=chosen["path"])
    for gi in (*TECHNIQUES, *TECHNIQUES, "none", "none", "many-light", "none"):
        renderer.settings = chosen[gi]
        renderer.run(show=("radiance", "albedo"))
        assert np.array_equal(renderer.read_back(), alone[gi]), gi
    assert set(renderer.buffers) == set(BUFFERS)


def test_changing_back_restores_the_picture():
    scene = medley()
    renderer = completed(scene)
    first, camera, position = renderer.read_back(), renderer.camera, scene.lights[0].position
    renderer.camera, scene.lights[0].position = Camera.look_at((3, 3, 3), (0, 0, 0)), (0, 5, 0)
    renderer.run(show=("radiance",))
    assert not np.array_equal(renderer.read_back(), first)
    renderer.camera, scene.lights[0].position = camera, position
    renderer.run(show=("radiance",))
    assert np.array_equal(renderer.read_back(), first)


def test_released_renderer_can_be_used_again():
    renderer = completed(medley())
    first = renderer.read_back()
    renderer.release()
    renderer.run(show=("radiance",))
    assert np.array_equal(renderer.read_back(), first)


def test_empty_scene_shows_its_sky_and_takes_geometry_later():
    empty = builtin.plane_point()
    empty.instances = []
    renderer = Renderer(empty, size=SIZE, settings=settings())
    renderer.run(check=True)
    assert not any(renderer.read_back(name).any() for name in renderer.buffers)
    empty.environment = Environment((0.25, 0.5, 1.0))
    renderer.run(check=True)
    assert (renderer.read_back() == (0.25, 0.5, 1.0)).all()
    empty.instances = builtin.plane_point().instances
    renderer.run(check=True)
    assert renderer.read_back("depth").all() and renderer.read_back("direct").all()


def test_bad_values_are_named_and_the_renderer_recovers():
    scene = medley()
    renderer = completed(scene)
    first = renderer.read_back()
    scene.lights[0].intensity = -1.0
    with pytest.raises(GiError, match="light"):
        renderer.run(show=("radiance",))
    scene.lights[0].intensity = 30.0
    renderer.run(show=("radiance",))
    assert np.array_equal(renderer.read_back(), first)
    with pytest.raises(GiError, match="no buffer 'occlusion'"):
        renderer.run(show=("occlusion",))


@pytest.mark.parametrize("count", [40, pytest.param(200, marks=pytest.mark.slow)])
def test_many_pictures_do_not_leak_memory(count):
    """With a moving camera, light and instance, at changing sizes."""
    scene = one_lamp()
    scene.lights.append(DirectionalLight((-0.4, -1, -0.3), 0.5))
    renderer = Renderer(scene, size=SIZE, settings=settings())

    def render(k):
        renderer.camera = Camera.look_at((0.3, 2.3, 6 + 0.01 * (k % 4)), (0, 0.9, 0), yfov_deg=50)
        scene.lights[0].position = (1, 4, 3 + 0.01 * (k % 5))
        named(scene, "left").world_from_local = at(-1.5, 0.9 + 0.01 * (k % 3), 0.5, (0.6, 0.9, 0.6))
        renderer.size = (SIZE[0] + (k % 20 == 0), SIZE[1])
        renderer.run(show=("radiance", "motion"))
        renderer.read_back()

    for k in range(20):
        render(k)
    before = resident()
    for k in range(count):
        render(k)
    # A leak of one small texture, buffer or command per picture would be 4 MiB and more.
    assert resident() - before < 3


# ------------------------------------------------------------------------------------------------ The command


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


TINY = ["render", "--gi", "none", "--size", "32x18"]


@pytest.mark.parametrize("suffix", ["exr", "npz"])
def test_every_buffer_in_one_file(suffix, folder):
    names = buffers_of("none")
    assert main([*TINY, "-o", f"p.{suffix}", *[argument for name in names for argument in ("--show", name)]]) == 0
    layers = {name: load_image(f"p.{suffix}", name) for name in names}
    for name, layer in layers.items():
        assert layer.shape[:2] == (18, 32) and np.isfinite(layer).all(), name
    assert np.allclose(layers["direct"] + layers["emission"], layers["radiance"], rtol=1e-4, atol=1e-5)
    assert not layers["indirect"].any() and layers["direct"].any() and not layers["motion"][..., :2].round(2).any()
    assert os.listdir(folder) == [f"p.{suffix}"]


def test_command_writes_a_png_and_prints_plan_and_timings(folder, capsys):
    assert main([*TINY, "cornell-point", "--plan", "--timings", "--check"]) == 0
    printed = capsys.readouterr().out
    assert "direct/light" in printed and "ms" in printed and "no alpha-masked material" in printed
    assert re.search(r"out\.png: 32x18, 24 frames, exposure \+[\d.]+ EV \(automatic\), [\d.]+ s on ", printed)
    assert load_image("out.png").shape == (18, 32, 3)


def test_settings_of_the_command_change_the_picture(folder):
    def made(*arguments):
        assert main([*TINY, "cornell", "-o", "p.npy", *arguments]) == 0
        return load_image("p.npy")

    plain = made()
    assert np.array_equal(plain, made())
    assert not np.array_equal(plain, made("--set", "camera.jitter=false"))
    assert not np.array_equal(plain, made("--set", "direct.rays=2"))
    assert not np.array_equal(plain, made("--seed", "3"))
    assert np.array_equal(plain, made("--spp", "7", "--set", "direct.samples=3"))
    mapped = made("--set", "direct.emitters=maps")
    assert not np.array_equal(plain, mapped)
    assert not np.array_equal(mapped, made("--set", "direct.emitters=maps", "--set", "direct.samples=3"))
    sides = ("--set", "shadow.area=16", "--set", "direct.edges=false")
    assert not np.array_equal(mapped, made("--set", "direct.emitters=maps", *sides))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("--show occlusion", "--gi none.*occlusion"),
        ("--show beauty", "beauty"),
        ("--gi path --show motion", "--gi path.*motion"),
        ("--set direct.samples=0", "direct.samples"),
        ("--set shadow.cascades=9", "shadow.cascades"),
        ("--set camera.frames=0", "camera.frames"),
    ],
)
def test_bad_arguments_are_one_sentence(arguments, words, folder, capsys):
    assert main([*TINY, "cornell-point", *arguments.split()]) == 2
    error = capsys.readouterr().err.splitlines()
    assert len(error) == 1 and error[0].startswith("wgpu-gi: error: ") and re.search(words, error[0])
    assert not os.listdir(folder)
