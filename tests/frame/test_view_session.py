"""The session of the viewer, without a window: moving and still views, errors; saved files and copied commands."""

from __future__ import annotations

import math
import shlex
import shutil
import time

import numpy as np
import pytest

from wgpu_gi.__main__ import main
from wgpu_gi.camera import Camera
from wgpu_gi.gpu.pipelines import Pipelines
from wgpu_gi.gpu.wgsl import load as wgsl
from wgpu_gi.options import TECHNIQUES, CameraSettings, Settings
from wgpu_gi.pictures.exposure import automatic_exposure
from wgpu_gi.pictures.image import load_image
from wgpu_gi.pictures.noise import expected_relmse, without_noise
from wgpu_gi.renderer import Renderer
from wgpu_gi.resources import resource_dir
from wgpu_gi.scene.built_in.scenes import BUILTIN_SCENES
from wgpu_gi.scene.files.light_texts import parse_light
from wgpu_gi.settings import describe
from wgpu_gi.viewer import navigation
from wgpu_gi.viewer import refinement as refinement_module
from wgpu_gi.viewer import session as session_module
from wgpu_gi.viewer.certification import certify_view
from wgpu_gi.viewer.comparison import Comparison
from wgpu_gi.viewer.dynamic_resolution import LAST_LEVEL, DynamicResolution, pixels_at
from wgpu_gi.viewer.probe import PROBED, Probe
from wgpu_gi.viewer.refinement import Refinement
from wgpu_gi.viewer.saving import command_of, save
from wgpu_gi.viewer.session import DISPLAY, Session
from wgpu_gi.viewer.thumbnails import SIZE as THUMBNAIL
from wgpu_gi.viewer.thumbnails import sheet, thumbnails

SIZE = (64, 36)


def make_session(gi="none", scene="cornell-point", **fields):
    settings = Settings(gi=gi, spp=8, camera=CameraSettings(frames=2), **fields)
    return Session(Renderer(BUILTIN_SCENES[scene](), size=SIZE, settings=settings), source=(scene,))


def settle(session):
    """Render until there is nothing to do; return how many steps there were."""
    deadline = time.monotonic() + 100
    steps = 0
    while time.monotonic() < deadline:
        if session.step():
            steps += 1
        elif not session.moving:
            return steps
    raise AssertionError("the view does not come to rest")


def moved(session, right=0.05):
    session.camera = navigation.orbit(session.camera, session.pivot, right, 0.0)


@pytest.mark.parametrize("gi", ["none", "path"])
def test_a_view_with_an_error_is_refined_until_its_noise_is_below(monkeypatch, gi):
    renderer = Renderer(BUILTIN_SCENES["cornell"](), size=SIZE, settings=Settings(gi=gi))
    renderer.settings.path.samples_per_run = 1
    session = Session(renderer, refinement=Refinement(error=0.1 if gi == "path" else 0.01))
    settle(session)
    noise = session.refinement.noise
    picture, deviation = (np.float64(renderer.read_back(name)) for name in ("radiance", "standard_error"))
    assert session.at_rest and noise == expected_relmse(without_noise(picture, deviation), deviation)
    assert noise <= session.refinement.error and renderer.finished >= 8 and f"noise {noise:.2g}" in session.status()
    assert session.settings.camera.frames == Settings().camera.frames and session.settings.spp == Settings().spp
    # Another view begins anew; the frames before it counts as at rest would depend on the machine's speed.
    monkeypatch.setattr(session_module, "REST_SECONDS", 0.0)
    frames = renderer.finished
    moved(session)
    settle(session)
    assert session.at_rest and 8 <= renderer.finished <= 2 * frames


def test_a_view_with_a_time_is_refined_for_so_long(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(refinement_module.time, "monotonic", lambda: now[0])
    session = Session(Renderer(BUILTIN_SCENES["cornell"](), size=SIZE, settings=Settings(gi="none")))
    session.refinement = Refinement(seconds=10.0)
    for _ in range(40):
        assert session.step()
        now[0] += 0.25
    assert not session.at_rest
    assert session.step() and session.at_rest and not session.step()
    assert session.renderer.finished == 42  # the step that finds the exposure renders twice


def test_a_rate_chooses_the_resolution():
    """A frame of 0.2 s at full resolution: four frames per second need none less, 25 a fifth of the pixels."""
    levels = []
    for fps in (4.0, None, 100.0):
        resolution = DynamicResolution(fps)
        resolution.note_rest(0.2)
        levels.append(resolution.level)
    assert levels[0] == 0 < levels[1] < levels[2]


def test_a_still_view_runs_no_pass(monkeypatch):
    session = make_session()
    assert settle(session) > 0
    ran = []
    monkeypatch.setattr(Renderer, "step", lambda *a, **k: ran.append(1))
    assert not any(session.step() for _ in range(5))
    assert not ran


def test_moving_view_has_fewer_pixels_and_equal_brightness():
    session = make_session(scene="courtyard")  # without a highlight that few pixels would miss
    settle(session)
    moved(session)
    session.resolution.level = 6
    session.step()
    assert session.renderer.size == (23, 13)
    coarse = session.values().mean()
    settle(session)
    assert session.renderer.size == SIZE
    assert coarse == pytest.approx(session.values().mean(), rel=0.05)


@pytest.mark.parametrize(
    ("fixed", "pixels", "expected"),
    [
        (0.001, 0.01, (0, 0)),
        (0.001, 0.1, (3, 4)),
        (0.001, 0.03, (0, 0)),
        (0.001, 0.2, (4, 6)),
        (0.001, 1.0, (8, 9)),
        (0.001, 100.0, (LAST_LEVEL,) * 2),
        (0.1, 0.05, (0, 4)),  # fewer pixels would not help
    ],
)
def test_resolution_falls_until_frames_are_in_time(fixed, pixels, expected):
    """A frame takes `fixed` seconds plus `pixels` seconds times its share of the pixels."""
    for start in range(LAST_LEVEL + 1):
        resolution = DynamicResolution()
        resolution.level = start
        for _ in range(30):
            resolution.note(fixed + pixels * pixels_at(resolution.level))
        seen = set()
        for _ in range(10):
            resolution.note(fixed + pixels * pixels_at(resolution.level))
            seen.add(resolution.level)
        assert expected[0] <= min(seen) <= max(seen) <= expected[1], (start, seen)


def test_a_single_slow_frame_keeps_the_resolution():
    resolution = DynamicResolution()
    for seconds in (0.03, 0.03, 0.5, 0.03, 0.03):
        resolution.note(seconds)
        assert resolution.level == 0


def test_picture_after_a_move_equals_that_of_a_new_view():
    session = make_session()
    settle(session)
    session.resolution.level = 8
    for _ in range(5):
        moved(session)
        session.step()
    settle(session)
    fresh = make_session()
    fresh.renderer.camera = session.camera
    settle(fresh)
    assert np.array_equal(session.values(), fresh.values())


@pytest.mark.parametrize("gi", TECHNIQUES)
def test_every_buffer_can_be_shown(gi):
    session = make_session(gi)
    for name in session.buffers:
        session.show(name)
        session.step()
        if name.startswith(("ism/", "temporal/")):  # absent at medium quality; the message says why
            assert session.error.startswith(f"{name!r} is empty: ")
            continue
        assert not session.error, session.error
        values = session.values()
        assert values.shape[:2] == SIZE[::-1], name
    assert session.status().startswith(f"{gi}, 64x36")


@pytest.mark.slow
@pytest.mark.parametrize("gi", [name for name in TECHNIQUES if name not in ("none", "path")])
def test_only_moving_frames_accumulate_over_time(gi):
    scene = "courtyard" if gi == "ssao" else "cornell-point"  # without a sky, ssao has nothing to accumulate
    session = make_session(gi, scene)
    settle(session)
    for _ in range(4):
        moved(session, 0.01)
        session.step()
    assert session.renderer.has_history
    session.renderer.scene.lights[0].intensity *= 0.1
    session.relit()
    session.step()
    assert session.renderer.has_history
    for _ in range(2):
        moved(session, 0.01)
        session.step()
    assert session.settings.temporal.frames == 1
    settle(session)
    fresh = make_session(gi, scene)
    fresh.renderer.scene.lights[0].intensity *= 0.1
    fresh.renderer.camera = session.camera
    settle(fresh)
    assert np.allclose(session.values(), fresh.values(), rtol=1e-4, atol=1e-6)


def test_automatic_exposure_is_constant_while_the_view_moves():
    session = make_session()
    session.step()
    first = session.exposure  # known from the first frame on
    assert first == pytest.approx(automatic_exposure(session.values()), abs=0.11)
    assert session.renderer.read_back(DISPLAY).mean() > 60
    settle(session)
    session.renderer.scene.lights[0].intensity /= 8
    session.relit()
    session.step()
    assert session.moving
    assert session.exposure == first
    settle(session)
    assert session.exposure == pytest.approx(first + 3, abs=0.4)
    before = session.exposure
    session.change("gi", "path")  # techniques are compared by eye in one exposure
    session.change("bounces", 0)
    settle(session)
    assert session.exposure == before


def test_exposure_can_be_fixed_and_automatic_again():
    session = make_session()
    settle(session)
    automatic = session.exposure
    session.expose(False)
    assert session.settings.exposure == automatic
    session.change("exposure", 4.0)
    settle(session)
    assert session.exposure == 4.0
    assert settle(session) == 0
    session.expose(True)
    settle(session)
    assert session.settings.exposure is None
    assert session.exposure == pytest.approx(automatic, abs=0.4)


def test_buffer_that_another_technique_lacks_is_replaced_by_display():
    session = make_session("none")
    session.show("motion")
    session.change("gi", "path")
    assert session.shown == DISPLAY
    session.step()
    assert not session.error


@pytest.mark.parametrize("gi", ["none", "path"])
def test_copied_command_renders_the_view(gi, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    session = make_session(gi)
    moved(session, 0.3)
    session.change("exposure", 0.123456789)
    session.change("bounces", 1 if gi == "path" else None)
    session.set_quality("low")
    settle(session)
    words = shlex.split(command_of(session, "view.npy"))
    assert words[0] == "wgpu-gi"
    assert words[words.index("--exposure") + 1] == "0.123456789"
    assert main(words[1:]) == 0
    difference = np.abs(load_image("view.npy") - session.values())
    assert (difference > 1e-3).mean() < 0.01  # the command rounds the camera


def test_changed_lights_are_in_the_command_and_in_saved_files(tmp_path, monkeypatch):
    from PIL import Image

    monkeypatch.chdir(tmp_path)
    scene = BUILTIN_SCENES["courtyard"]()
    sun = ["--light", "sun 0.3,-1,0.2 1,1,1"]
    scene.lights += [parse_light(sun[1])]
    settings = Settings(gi="none", camera=CameraSettings(frames=2))
    session = Session(Renderer(scene, size=SIZE, settings=settings), source=("courtyard", *sun))
    assert "--relight" not in command_of(session)
    scene.lights[0].intensity, scene.lights[0].color = 2.5, (0.9, 0.5, 0.1)
    scene.lights[0].direction = (-0.557, -0.5, 0.663)
    scene.environment.color = (0.05, 0.1, 0.4)
    session.relit()
    settle(session)
    assert main(shlex.split(command_of(session, "view.npy"))[1:]) == 0
    found, expected = load_image("view.npy"), session.values()
    assert expected.mean() > 0.01
    assert (np.abs(found - expected) > 1e-3 * expected.max()).mean() < 0.01
    with Image.open(save(session, tmp_path)[0]) as picture:
        assert "--relight '0=2.25,1.25,0.25 " in picture.text["command"]


def test_command_names_the_buffer_and_all_settings():
    session = make_session("path")
    session.show("normal")
    names = [row.name for row in describe(session.settings) if row.kind is bool]
    for name in names:
        session.change(name, not next(row.value for row in describe(session.settings) if row.name == name))
    command = command_of(session)
    assert "--show normal" in command
    assert all(f"{name}=" in command for name in names)


def test_parallel_projection_is_in_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    session = make_session()
    camera = Camera.look_at((2.7, 2.7, -4), (2.7, 2.7, 2))
    camera.orthographic_height = 3.0
    session.camera = camera
    settle(session)
    assert main(shlex.split(command_of(session, "view.npy"))[1:]) == 0
    assert (np.abs(load_image("view.npy") - session.values()) > 1e-3).mean() < 0.01


def test_saved_files_hold_picture_camera_and_command(tmp_path):
    from PIL import Image

    session = make_session()
    settle(session)
    files = save(session, tmp_path) + save(session, tmp_path)
    assert [file.name for file in files] == [
        f"cornell-point-{number}.{suffix}" for number in ("001", "002") for suffix in ("png", "exr")
    ]
    assert np.array_equal(load_image(files[1]), session.values())
    with Image.open(files[0]) as picture:
        assert picture.text["command"].startswith("wgpu-gi render cornell-point -o cornell-point-001.png")
        assert "position" in picture.text["camera"]
    shown = session.renderer.read_back(DISPLAY).astype(int)
    assert np.abs(np.asarray(Image.open(files[0])).astype(int) - shown).max() <= 1


def test_bad_setting_is_an_error_and_changes_nothing():
    session = make_session()
    settle(session)
    session.change("spp", 0)
    assert "spp" in session.error
    assert session.settings.spp == 8
    session.change("seed", 5)
    settle(session)
    assert not session.error


def test_point_under_the_mouse_lies_on_its_ray():
    session = make_session()
    settle(session)
    point = session.point_at(0.5, 0.5)
    offset = point - session.camera.position
    forward = -session.camera.world_from_view[:3, 2]
    assert offset @ forward / np.linalg.norm(offset) > 0.999
    session.camera = navigation.look(session.camera, math.pi, 0.0)
    settle(session)
    assert session.point_at(0.5, 0.5) is None


def test_a_picture_saved_during_a_move_is_no_preview(tmp_path, monkeypatch):
    """Many-light gathers at half resolution while the view moves."""
    monkeypatch.setattr("wgpu_gi.techniques.many_light.update.COARSE_PIXELS", 1)
    session = make_session("many-light")
    settle(session)
    moved(session)
    renderer = session.renderer
    renderer.step(show=(DISPLAY,), preview=True)
    assert renderer.size == session.size and renderer.shows_preview and "gather/upsample" in renderer.graph.last_run
    save(session, tmp_path)
    assert not renderer.shows_preview and "gather/upsample" not in renderer.graph.last_run


def test_a_compiling_frame_is_abandoned_on_a_change_and_goes_on(monkeypatch):
    session = make_session()
    monkeypatch.setattr(session.renderer._device, "pipelines", Pipelines(session.renderer._device.gpu))
    heard = []

    def compiled(done, count):
        heard.append((done, count))
        if done == 2:
            session.changed()

    session.on_compile = compiled
    assert not session.step()
    done, count = heard[-1]
    assert done == 2 < count and session.interrupted
    heard.clear()
    session.on_compile = lambda *counts: heard.append(counts)
    settle(session)
    # What was compiled stays so.
    assert heard[-1][1] == count - 2 and not session.error
    assert np.isfinite(session.renderer.read_back()).all()


def test_long_frame_of_a_still_view_is_abandoned_on_a_change():
    session = make_session("path")
    ticks = []

    def tick(fraction):
        ticks.append(fraction)
        if len(ticks) == 1:
            moved(session)

    assert not session.step(tick)
    assert len(ticks) == 1
    settle(session)
    fresh = make_session("path")
    fresh.renderer.camera = session.camera
    settle(fresh)
    assert np.array_equal(session.values(), fresh.values())


def test_saved_shader_is_reloaded_and_a_broken_one_keeps_the_picture(tmp_path, monkeypatch):
    folder = tmp_path / "wgsl"
    shutil.copytree(resource_dir("wgsl"), folder)
    monkeypatch.setattr(wgsl, "resource_dir", lambda name: folder)
    for name in ("_loaded", "_outdated", "_times"):
        monkeypatch.setattr(wgsl, name, {})
    session = make_session()
    settle(session)
    before = session.renderer.read_back(DISPLAY)
    shader = folder / "shared/composite/display.wgsl"
    text = shader.read_text()
    shader.write_text(text.replace("srgb_from_linear(color), 1.0", "srgb_from_linear(color.bgr), 1.0"))
    monkeypatch.setattr(session_module, "WATCH_SECONDS", 0.0)
    assert session.watch_shaders()
    assert not session.watch_shaders()
    settle(session)
    swapped = session.renderer.read_back(DISPLAY)
    assert np.array_equal(swapped, before[..., ::-1])
    shader.write_text(text.replace("srgb_from_linear(color), 1.0", "srgb_from_linear(colour), 1.0"))
    assert session.watch_shaders()
    settle(session)
    assert "shared/composite/display.wgsl:" in session.error
    assert "colour" in session.error
    shader.write_text(text)
    assert session.watch_shaders()
    settle(session)
    assert not session.error
    assert np.array_equal(session.renderer.read_back(DISPLAY), before)
    # A syntax error, and an import that is missing at first.
    for broken in (text + "nonsense", text + '\n#import "shared/composite/missing.wgsl"\n'):
        shader.write_text(broken)
        assert session.watch_shaders()
        settle(session)
        assert "shared/composite/display.wgsl:" in session.error
    (folder / "shared/composite/missing.wgsl").write_text("")
    assert session.watch_shaders()
    settle(session)
    assert not session.error


def test_comparison_with_the_truth_measures_the_missing_light():
    session, ticks = make_session(), []
    comparison = Comparison(session)
    assert not comparison.step(ticks.append)
    comparison.mode = "split"
    settle(session)
    for _ in range(20):
        assert comparison.step(ticks.append)
    comparison.measure()
    assert comparison.ready
    assert comparison.errors.bias < -0.2  # indirect light is missing
    assert comparison.difference().shape == (*SIZE[::-1], 3)
    blue = comparison.difference()[..., 2].mean()
    assert blue > 10 * comparison.difference()[..., 0].mean()
    comparison.mode = "off"
    comparison.step(ticks.append)
    assert not comparison.ready


def test_probe_reads_the_pixel():
    session = make_session()
    probe = Probe(session)
    assert not probe.lines(0.5, 0.5)
    probe.on = True
    settle(session)
    probe.take()
    lines = probe.lines(0.5, 0.5)
    assert lines[0] == "pixel 32, 18"
    assert [line.split()[0] for line in lines[1:]] == list(PROBED)
    point = [float(word.strip(",")) for word in lines[1].split()[1:4]]
    assert point == pytest.approx(session.point_at(0.5, 0.5), rel=1e-3)
    assert not probe.lines(1.0, 0.5)
    probe.on = False
    settle(session)
    assert not probe.lines(0.5, 0.5)


def test_changed_light_changes_the_picture():
    session = make_session()
    settle(session)
    before = session.values().mean()
    session.renderer.scene.lights[0].intensity *= 2
    session.relit()
    settle(session)
    assert session.values().mean() == pytest.approx(2 * before, rel=1e-3)


@pytest.mark.parametrize("gi", TECHNIQUES)
def test_thumbnails_of_the_passes_fit_their_sheet(gi):
    session = make_session(gi)
    session.step()
    found = {resource: picture for _, resource, picture in thumbnails(session.renderer.graph)}
    for picture in found.values():
        assert picture.shape[2] == 3
        assert max(np.divide(picture.shape[:2], THUMBNAIL[::-1])) <= 1
    assert np.ptp(found["path/radiance" if gi == "path" else "direct/light"]) > 100
    assert sheet([*found.values()]).shape == (len(found) * THUMBNAIL[1], THUMBNAIL[0], 4)


def test_certificate_of_a_view_is_saved_and_ends_with_it(tmp_path):
    from PIL import Image

    session = make_session()
    certify_view(session, lambda fraction: None)
    assert session.certificate.pixels == 200
    with Image.open(save(session, tmp_path)[0]) as picture:
        assert picture.text["certificate"] == session.certificate.texts()["certificate"]
    moved(session)
    assert session.certificate is None
    # A change during the certificate ends it.
    certify_view(session, lambda fraction: session.at_rest and session.changed())
    assert session.certificate is None
