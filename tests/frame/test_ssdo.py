"""SSDO: which passes run, settings at their limits, the near field of many-light, and contact shadows."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from helpers.techniques import SCENES, make_settings, medley_under_a_sky

from wgpu_gi.camera import Camera
from wgpu_gi.measure.metrics import relmse
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.built_in import scenes as builtin
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, grid, quad
from wgpu_gi.scene.scene import DirectionalLight, Environment, Instance, Scene
from wgpu_gi.settings import assign

SIZE = (48, 27)


def renderer_of(scene, *texts, gi="ssdo", frames=1, size=SIZE, camera=None):
    settings = make_settings(gi, frames=frames)
    for text in texts:
        assign(settings, text)
    return Renderer(scene, size=size, camera=camera, settings=settings)


def render(scene, *texts, **arguments):
    renderer = renderer_of(scene, *texts, **arguments)
    renderer.run(check=True)
    return {name: renderer.read_back(name) for name in ("direct", "indirect", "radiance")}


def plan_of(renderer):
    renderer.run()
    return renderer.plan()


def test_redundant_cameras_are_skipped():
    inside = renderer_of(SCENES["cornell-point"](), "ssdo.cameras=3")
    assert "camera_2/resolve" in plan_of(inside)
    # From far away, all of the room is in the picture, and nothing behind the camera.
    outside = Camera.look_at((2.78, 2.73, -30.0), (2.78, 2.73, 2.8))
    text = plan_of(renderer_of(SCENES["cornell-point"](), "ssdo.cameras=3", camera=outside))
    assert "the picture holds the whole scene" in text and "nothing lies behind the camera" in text
    assert "camera_1/resolve" in text and "camera_2/resolve" not in text


def test_the_default_has_a_camera_above_only_under_a_sky():
    texts = ("ssdo.undecided=cameras",)
    assert "camera_2/resolve" not in plan_of(renderer_of(SCENES["cornell-point"](), *texts))
    assert "camera_2/resolve" in plan_of(renderer_of(builtin.courtyard(), *texts))
    assert "camera_2/resolve" not in plan_of(renderer_of(builtin.courtyard(), *texts, "environment.ambient=false"))
    for undecided in ("rays", "sky"):
        assert "camera_1/resolve" not in plan_of(renderer_of(builtin.courtyard(), f"ssdo.undecided={undecided}"))


def test_redundant_layers_are_skipped():
    """A floor has nothing behind it: one layer and four give the same picture."""
    text = plan_of(renderer_of(builtin.plane_sun(), "ssdo.undecided=sky", "ssdo.layers=4"))
    assert "a ray meets 1 surfaces at most" in text and "gbuffer/resolve_1" not in text
    once, more = (render(builtin.plane_sun(), "ssdo.undecided=sky", f"ssdo.layers={k}") for k in (1, 4))
    assert np.array_equal(once["radiance"], more["radiance"])
    # Rays need no layer but the first; contact shadows do.
    assert "gbuffer/resolve_1" not in plan_of(renderer_of(builtin.courtyard(), "ssdo.layers=2"))
    assert "gbuffer/resolve_1" in plan_of(renderer_of(builtin.courtyard(), "ssdo.layers=2", "direct.contacts=8"))


def test_the_plan_says_which_share_of_directions_took_a_ray():
    renderer = renderer_of(builtin.courtyard())
    row = next(line for line in str(plan_of(renderer)).splitlines() if line.startswith("ssdo/occlusion_rays "))
    share, directions = re.search(r"(\d+) % of ([\d,]+) directions", row).groups()
    undecided, searched = renderer.graph.read_back("ssdo/occlusion_undecided").ravel()[3:5]
    assert 0 < undecided < searched and int(share) == round(100 * undecided / searched)
    assert int(directions.replace(",", "")) == searched
    assert "ssdo/occlusion_rays" not in plan_of(renderer_of(builtin.courtyard(), "ssdo.undecided=sky"))


def test_where_the_picture_decides_all_no_ray_is_traced():
    """A floor seen from above, with a margin: all its directions leave the scene within the picture."""
    floor = grid(1.0, material=matte(0.5))
    camera = Camera.look_at((0, 5.0, 0), (0, 0, 0), (0, 0, -1))
    camera.orthographic_height = 8.0
    scene = Scene([Instance(floor)], [], Environment((1.0, 1.0, 1.0)), [camera])
    renderer = renderer_of(scene)
    renderer.run(check=True)
    undecided, searched = renderer.graph.read_back("ssdo/occlusion_undecided").ravel()[3:5]
    assert undecided == 0 < searched
    assert np.allclose(renderer.read_back("direct"), render(scene, gi="none")["direct"], rtol=1e-6)


def test_a_scene_without_triangles_renders():
    scene = Scene([], [], Environment((1.0, 1.0, 1.0)), [Camera.look_at((0, 1, 2), (0, 0, 0))])
    assert np.allclose(render(scene)["radiance"], 1.0)


def test_without_a_sky_or_a_bounce_passes_are_skipped():
    scene = SCENES["cornell-point"]()
    assert "ssdo/share/columns" not in plan_of(renderer_of(scene))
    text = plan_of(renderer_of(scene, "ssdo.bounce=false"))
    assert "ssdo/bounce" not in text
    direct = render(scene, gi="none")["direct"]
    assert np.array_equal(render(scene, "ssdo.bounce=false")["radiance"], render(scene, gi="none")["radiance"])
    assert np.array_equal(render(scene)["direct"], direct)


def test_a_still_picture_runs_no_pass_once_it_is_complete():
    renderer = renderer_of(builtin.courtyard(), frames=3)
    renderer.run()
    assert not renderer.step()
    # From frame to frame the search runs again; the G-buffers of further cameras are kept.
    renderer = renderer_of(builtin.courtyard(), "ssdo.undecided=cameras", frames=3)
    renderer.step()
    renderer.step()
    assert renderer.graph.last_run.keys() >= {"ssdo/occlusion"}
    assert "camera_1/resolve" not in renderer.graph.last_run


@pytest.mark.slow
@pytest.mark.parametrize("half", ["false", "true"])
def test_reprojected_history_halves_the_error_of_a_moving_camera(half):
    """Eight frames of history against one; every frame samples other directions."""
    errors = []
    for history in (1, 8):
        renderer = renderer_of(
            builtin.courtyard(),
            f"temporal.frames={history}",
            f"ssdo.half_resolution={half}",
            "ssdo.directions=1",
            size=(96, 54),
        )
        for k in range(9):
            moved = renderer.camera.world_from_view.copy()
            moved[0, 3] += 0.02
            renderer.camera, renderer.settings.seed = replace(renderer.camera, world_from_view=moved), k
            renderer.step(show=("indirect",))
        assert ("ssdo/bounce/accumulate" in renderer.plan()) == (history > 1)
        texts = (f"ssdo.half_resolution={half}", "ssdo.directions=8")
        settled = render(builtin.courtyard(), *texts, size=(96, 54), frames=16, camera=renderer.camera)
        errors.append(relmse(renderer.read_back("indirect"), settled["indirect"]))
    assert errors[1] <= 0.5 * errors[0], errors


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell-point", "courtyard"])
def test_half_resolution_has_the_same_mean(name):
    fine, coarse = (
        render(SCENES[name](), f"ssdo.half_resolution={half}", "ssdo.directions=4", frames=16, size=(192, 108))
        for half in (0, 1)
    )
    assert coarse["radiance"].mean() == pytest.approx(fine["radiance"].mean(), rel=0.01)


def test_many_unrepresented_pixels_give_the_same_picture_each_time():
    """Blades as thin as pixels: the order of the list differs from run to run, the picture does not."""
    random = np.random.default_rng(0)
    blades = [
        quad((x, 0, z), (0.02, 0, 0.01), (lean, 1.5, 0), matte(0.5))
        for x, z, lean in random.uniform((-2, -2, -0.3), (2, 2, 0.3), (2000, 3)).tolist()
    ]
    camera = Camera.look_at((0, 0.8, 4.0), (0, 0.7, 0))
    scene = Scene([Instance(blade) for blade in blades], [], Environment((1.0, 1.0, 1.0)), [camera])
    first, second = (renderer_of(scene, "ssdo.blur=false", size=(192, 108)) for _ in range(2))
    for renderer in (first, second):
        renderer.run()
    assert first.graph.read_back("ssdo/unrepresented_groups")[3] > 192 * 108 / 8
    assert np.array_equal(first.read_back("radiance"), second.read_back("radiance"))


@pytest.mark.slow
@pytest.mark.parametrize("size", [(1, 1), (2, 3), (33, 17)])
@pytest.mark.parametrize(
    "texts",
    [
        ("ssdo.directions=64", "ssdo.steps=1"),
        ("ssdo.directions=1", "ssdo.steps=64", "ssdo.radius=100", "ssdo.sampling=environment"),
        ("ssdo.radius=0.01", "ssdo.half_resolution=false", "ssdo.blur=false"),
        ("ssdo.sampling=slices", "ssdo.directions=64", "ssdo.steps=1"),
        ("ssdo.sampling=slices", "ssdo.layers=4", "ssdo.cameras=2", "ssdo.undecided=cameras"),
        ("ssdo.layers=4", "ssdo.cameras=4", "ssdo.camera_placement=aside", "temporal.frames=8"),
        ("ssdo.layers=3", "ssdo.cameras=2", "ssdo.half_resolution=false"),
        ("ssdo.undecided=cameras", "ssdo.layers=4", "ssdo.cameras=4", "ssdo.sampling=environment"),
        ("ssdo.undecided=sky", "ssdo.directions=64", "ssdo.steps=1"),
    ],
)
def test_settings_at_their_limits_are_finite(texts, size):
    """Every buffer of every pass is finite, and radiance is not negative."""
    scene = medley_under_a_sky()
    for camera in (scene.cameras[0], _parallel(scene.cameras[0])):
        got = render(scene, *texts, size=size, camera=camera)
        assert np.isfinite(got["radiance"]).all() and (got["radiance"] >= 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("size", [(1, 1), (33, 17)])
@pytest.mark.parametrize(
    "texts", [(), ("ssdo.half_resolution=false", "gather.visibility=ism"), ("ssdo.near_field_radius=10",)]
)
def test_near_field_settings_at_their_limits_are_finite(texts, size):
    scene = medley_under_a_sky()
    for camera in (scene.cameras[0], _parallel(scene.cameras[0])):
        got = render(scene, "ssdo.near_field=true", *texts, gi="many-light", size=size, camera=camera)
        assert np.isfinite(got["radiance"]).all() and (got["radiance"] >= 0).all()


def test_the_near_field_keeps_the_mean_of_coated_surfaces():
    """Coats still reflect near VPLs, and transmit the same share of near-field light as of VPL light."""
    scene = medley_under_a_sky()
    without, together = (
        render(scene, f"ssdo.near_field={near}", gi="many-light", frames=8, size=(96, 54))["indirect"].mean()
        for near in ("false", "true")
    )
    assert together == pytest.approx(without, rel=0.03)
    assert "ssdo.near_field is off" in plan_of(renderer_of(scene, gi="many-light"))


def _parallel(camera):
    return Camera(camera.world_from_view.copy(), orthographic_height=4.0)


def test_contact_shadows_restore_those_that_a_coarse_map_lost():
    """A low brick under a slanting sun, whose shadow map has texels wider than the brick is high."""
    brick = box((-0.3, 0, -0.15), (0.3, 0.05, 0.15), matte(0.5))
    camera = Camera.look_at((0.3, 0.5, 1.1), (0, 0, 0))
    sun = [DirectionalLight((0.9, -0.5, 0.3), 3.0)]
    scene = Scene([Instance(grid(8.0, material=matte(0.5))), Instance(brick)], sun, Environment((0.0,) * 3), [camera])
    # One map over the floor.
    coarse = ("direct.edges=false", "shadow.sun=64", "shadow.cascades=1")
    exact = render(scene, gi="none", size=(96, 54))["direct"]
    lost = relmse(render(scene, *coarse, gi="none", size=(96, 54))["direct"], exact)
    found = relmse(render(scene, *coarse, "direct.contacts=16", gi="none", size=(96, 54))["direct"], exact)
    assert found <= 0.5 * lost


def test_a_second_layer_ends_contact_shadows_behind_thin_objects():
    """With one layer, all behind a thin board is in shadow; with two, the sun reaches it."""
    board = box((-0.3, 0.0, -0.01), (0.3, 0.3, 0.01), matte(0.5))
    camera = Camera.look_at((0.1, 0.35, 1.1), (0.3, 0.1, 0))
    sun = [DirectionalLight((1.0, -0.3, 0.0), 3.0)]
    scene = Scene([Instance(grid(8.0, material=matte(0.5))), Instance(board)], sun, None, [camera])
    coarse = ("direct.edges=false", "shadow.sun=64", "shadow.cascades=1", "ssdo.bounce=false")
    exact = render(scene, gi="none", size=(96, 54))["direct"]
    one, two = (
        relmse(render(scene, *coarse, "direct.contacts=16", f"ssdo.layers={k}", size=(96, 54))["direct"], exact)
        for k in (1, 2)
    )
    assert two < one, (two, one)
