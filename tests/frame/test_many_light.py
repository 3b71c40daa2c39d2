"""Which passes of many-light a frame keeps: VPLs do not depend on the camera, surface points not on light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.medley import at
from helpers.techniques import SCENES, make_settings

from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.built_in.scenes import courtyard
from wgpu_gi.techniques.many_light import update
from wgpu_gi.techniques.many_light.gather import GatherSettings

SHOW = ("radiance",)
LIGHT = {"rsm", "vpl/light_paths", "vpl/weights", "vpl/prefix_sum", "vpl/resample", "ism/rays", "ism/fill"}
VIEW = {"gbuffer/resolve", "direct/light", "gather/cluster_bounds", "gather/light_lists", "gather", "denoise/columns"}


def passes(renderer):
    """Step once; return the names of the passes that ran, and of those that were kept, by the plan."""
    assert renderer.step(show=SHOW)
    states = [line.split()[:2] for line in renderer.plan().splitlines()[1:]]
    ran, kept = ({name for name, state in states if state == wanted} for wanted in ("ran", "kept"))
    assert ran == set(renderer.graph.last_run)
    return ran, kept


@pytest.fixture
def renderer():
    """A room rendered once, with VPLs resampled by flux alone and imperfect shadow maps of points."""
    settings = make_settings("many-light")
    settings.vpl.importance, settings.gather.visibility, settings.ism.points = "flux", "ism", 256
    renderer = Renderer(SCENES["cornell-point"](), size=(48, 27), settings=settings)
    ran, _ = passes(renderer)
    assert ran >= LIGHT | VIEW | {"points"}
    assert not renderer.step(show=SHOW)
    return renderer


def move_camera(renderer):
    renderer.camera = Camera.look_at((2.7, 2.7, -7.0), (2.7, 2.7, 0.0))


def test_a_camera_move_keeps_the_lights(renderer):
    move_camera(renderer)
    ran, kept = passes(renderer)
    assert ran >= VIEW and kept >= LIGHT | {"points", "shadow/opaque"}


def test_vpls_resampled_for_the_view_follow_it(renderer):
    """VPLs are resampled by the view; their candidates are kept."""
    renderer.settings.vpl.importance = "view"
    passes(renderer)
    move_camera(renderer)
    ran, kept = passes(renderer)
    assert ran >= VIEW | {"vpl/view_samples", "vpl/resample", "ism/rays"} and kept >= {
        "points",
        "rsm",
        "vpl/light_paths",
    }


def test_a_light_move_keeps_points_and_the_view(renderer):
    renderer.scene.lights[0].position = np.array((2.0, 4.0, 2.0))
    ran, kept = passes(renderer)
    assert ran >= LIGHT | {"shadow/opaque", "direct/light", "gather", "denoise/columns"}
    assert kept >= {"points", "gbuffer/resolve", "gather/cluster_bounds"}


def test_a_moved_mesh_keeps_nothing(renderer):
    renderer.scene.instances[0].world_from_local = at(0.0, 0.1) @ renderer.scene.instances[0].world_from_local
    ran, kept = passes(renderer)
    assert ran >= LIGHT | VIEW | {"points"} and kept == {"environment/albedo"}


def test_frames_of_a_picture_have_different_vpls(renderer):
    """VPLs differ from frame to frame; surface points are kept."""
    renderer.settings.camera.frames = 3
    passes(renderer)
    lists = [renderer.graph.read_back("vpl/table").tobytes()]
    while renderer.step(show=SHOW):
        lists.append(renderer.graph.read_back("vpl/table").tobytes())
        assert "points" not in renderer.graph.last_run
    assert len(set(lists)) == 3


def test_light_paths_from_the_sky_start_elsewhere_in_each_frame():
    """Fixed starts would leave their error in the mean of many frames."""
    settings = make_settings("many-light")
    settings.camera.frames = 3
    renderer = Renderer(courtyard(), size=(32, 18), settings=settings)
    starts = []
    while renderer.step(show=SHOW):
        starts.append(renderer.graph.read_back("vpl/sky_points").tobytes())
    assert len(set(starts)) == len(starts) == 3


def view(name, **sections):
    """Render a debug view of a small room, (27, 48, 3)."""
    settings = make_settings("many-light")
    for section, fields in sections.items():
        for field, value in fields.items():
            setattr(getattr(settings, section), field, value)
    renderer = Renderer(SCENES["cornell-point"](), size=(48, 27), settings=settings)
    renderer.step(show=(name,), check=True)
    return renderer.read_back(name)


@pytest.mark.parametrize("mode", ["splat", "pull-push"])
def test_views_of_imperfect_shadow_maps_show_distances(mode):
    """Distances are within the room's diagonal, 9.6 m; the atlas has at least the texels of its samples."""
    shown = {
        name: view(name, gather={"visibility": "ism"}, ism={"mode": mode})[..., 0]
        for name in ("ism/atlas", "ism/samples")
    }
    for distance in shown.values():
        assert distance[distance > 0].min() > 0 and distance.max() < 10
    assert 0.2 < (shown["ism/samples"] > 0).mean() <= (shown["ism/atlas"] > 0).mean()


def test_a_preview_gathers_at_half_resolution_and_no_still_picture_contains_it(monkeypatch):
    monkeypatch.setattr(update, "COARSE_PIXELS", 1)
    settings = make_settings("many-light", frames=2)
    camera = Camera.look_at((2.7, 2.7, -7.0), (2.7, 2.7, 0.0))
    scene = SCENES["cornell-point"]()
    fresh = Renderer(scene, size=(48, 27), camera=camera, settings=settings)
    fresh.run(show=SHOW)
    moved = Renderer(scene, size=(48, 27), settings=settings)
    moved.run(show=SHOW)
    moved.camera = camera
    assert moved.step(show=SHOW, preview=True)
    preview = moved.read_back()
    assert "gather/upsample" in moved.graph.last_run
    frames = 0
    while moved.step(show=SHOW, preview=True):
        assert "gather/upsample" not in moved.graph.last_run
        frames += 1
    assert frames == 2
    assert np.array_equal(moved.read_back(), fresh.read_back())
    half = Renderer(
        scene, size=(48, 27), camera=camera, settings=replace(settings, gather=GatherSettings(scale="half"))
    )
    half.step(show=SHOW)
    assert np.array_equal(preview, half.read_back())


def test_a_still_view_rejects_history_only_in_its_first_frame():
    renderer = Renderer(SCENES["cornell-point"](), size=(48, 27), settings=make_settings("many-light", frames=3))
    renderer.settings.temporal.frames, renderer.settings.camera.jitter = 4, False
    shares = []
    while renderer.step(show=("temporal/rejected",)):
        shares.append(renderer.read_back("temporal/rejected").mean())
    assert shares[0] > 0.5 and shares[-1] < 0.1


def test_a_still_picture_is_the_mean_of_its_own_frames():
    """With or without accumulation: accumulated frames are correlated, so they are not averaged."""
    pictures = []
    for history in (1, 8):
        renderer = Renderer(SCENES["cornell-point"](), size=(48, 27), settings=make_settings("many-light", frames=5))
        renderer.settings.temporal.frames = history
        renderer.run(show=SHOW)
        pictures.append(renderer.read_back())
    assert np.array_equal(*pictures)


@pytest.mark.parametrize(
    ("name", "sections"),
    [
        ("ism/atlas", {"gather": {"visibility": "exact"}}),
        ("ism/samples", {"gather": {"visibility": "none"}}),
        ("temporal/rejected", {}),
        ("gather/lists", {"gather": {"culling": "none"}}),
    ],
)
def test_an_absent_debug_view_gives_its_reason(name, sections):
    with pytest.raises(GiError, match=f"{name!r} is empty: .* need"):
        view(name, **sections)


def test_maps_larger_than_a_buffer_are_an_error_with_a_remedy(monkeypatch):
    settings = make_settings("many-light")
    settings.gather.visibility, settings.vpl.count = "ism", 16384
    renderer = Renderer(SCENES["cornell-point"](), size=(48, 27), settings=settings)
    monkeypatch.setitem(renderer.graph.device.limits, "max-storage-buffer-binding-size", 2**23)
    with pytest.raises(GiError, match=r"raise ism\.ray_spacing or lower ism\.resolution"):
        renderer.step(show=SHOW)
