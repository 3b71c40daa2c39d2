"""Which passes of SSIL run and why; filtering over frames and amortised bounces converge; settings at their limits."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.medley import at
from helpers.techniques import SCENES, make_settings

from wgpu_gi.__main__ import main
from wgpu_gi.camera import Camera
from wgpu_gi.renderer import Renderer
from wgpu_gi.settings import assign
from wgpu_gi.techniques.ssil.ssil import MOST_BOUNCES

SHOW = ("radiance",)
SURFELS = {"ssil/surfels", "ssil/vote_receivers_1"}
VOXELS = {"voxels/depth_range", "voxels/opaque", "voxels/fill"}
LIGHT = {
    "ssil/light",
    "ssil/first_senders",
    "ssil/senders_3",
    "ssil/gather_1",
    "ssil/gather_3",
    "ssil/combine",
    "ssil/indirect",
}


def make(scene, *texts, frames=1, bounces=1, size=(48, 27), **fields):
    settings = make_settings("ssil", frames, bounces=bounces, **fields)
    for text in ("ssil.start=half", *texts):
        assign(settings, text)
    return Renderer(scene, size=size, settings=settings)


def passes(renderer):
    """Step once; return the names of the passes that ran, and of those that were kept, by the plan."""
    assert renderer.step(show=SHOW)
    states = [line.split()[:2] for line in renderer.plan().splitlines()[1:]]
    return tuple({name for name, state in states if state == wanted} for wanted in ("ran", "kept"))


@pytest.fixture
def renderer():
    """Return the renderer of a room, after its first frame."""
    renderer = make(SCENES["cornell-point"](), "ssil.visibility=voxels")
    ran, _ = passes(renderer)
    assert ran >= SURFELS | VOXELS | LIGHT | {"ssil/pattern", "ssil/glossy/columns"}
    assert not renderer.step(show=SHOW)
    return renderer


def test_a_light_move_keeps_surfels_and_voxels(renderer):
    renderer.scene.lights[0].position = np.array((2.0, 4.0, 2.0))
    ran, kept = passes(renderer)
    assert ran >= LIGHT and kept >= SURFELS | VOXELS | {"ssil/pattern"}


def test_a_camera_move_keeps_the_pattern(renderer):
    renderer.camera = Camera.look_at((2.7, 2.7, -7.0), (2.7, 2.7, 0.0))
    ran, kept = passes(renderer)
    assert ran >= SURFELS | VOXELS | LIGHT and "ssil/pattern" in kept


def test_a_moved_mesh_keeps_the_pattern(renderer):
    renderer.scene.instances[0].world_from_local = at(0.0, 0.1) @ renderer.scene.instances[0].world_from_local
    ran, kept = passes(renderer)
    assert ran >= SURFELS | VOXELS | LIGHT and "ssil/pattern" in kept


@pytest.mark.parametrize(
    ("text", "fields", "name", "reason"),
    [
        ("ssil.visibility=none", {}, "voxels", "ssil.visibility is none"),
        ("ssil.samples=64", {"diffuse": True}, "ssil/glossy", "every material is Lambert"),
        ("ssil.glossy_samples=0", {}, "ssil/glossy", "ssil.glossy_samples is 0"),
        ("temporal.frames=1", {}, "temporal/accumulate", "temporal.frames is 1"),
        ("ssil.samples=64", {}, "ssil/gather_4", "its ring begins beyond the picture"),
        ("ssil.visibility=voxels", {}, "voxels/masked", "no alpha-masked material"),
    ],
)
def test_the_plan_gives_the_reason_of_a_skip(text, fields, name, reason):
    renderer = make(SCENES["cornell-point"](), text, **fields)
    renderer.step(show=SHOW)
    line = next(line for line in renderer.plan().splitlines()[1:] if line.split()[0] == name)
    assert line.split()[1] == "culled" and f"  {reason}; would add " in line


@pytest.mark.parametrize("visibility", ["voxels", "depth", "exact", "none"])
def test_every_kind_of_visibility_gives_indirect_light(visibility):
    renderer = make(SCENES["medley"](), f"ssil.visibility={visibility}", "ssil.samples=16", bounces=2)
    renderer.run(check=True)
    assert renderer.read_back("indirect").any()


@pytest.mark.slow
@pytest.mark.parametrize(
    "texts",
    [
        ("ssil.start=full", "ssil.levels=6"),
        ("ssil.start=quarter", "ssil.levels=3", "voxels.coarser=2", "voxels.slices=1024"),
        ("ssil.samples=4", "ssil.radius=1", "voxels.slices=32", "voxels.step=8", "voxels.finer=6"),
        ("ssil.form_factor=differential", "ssil.bounces=4", "ssil.visibility_bounces=all", "temporal.frames=8"),
    ],
)
@pytest.mark.parametrize("size", [(1, 1), (3, 40), (37, 21)])
def test_settings_at_their_limits_are_finite(texts, size):
    renderer = make(SCENES["medley"](), *texts, bounces=None, size=size)
    renderer.run(check=True)
    assert np.isfinite(renderer.read_back("indirect")).all()


def test_a_bounce_below_the_threshold_is_skipped():
    """The picture is that of one bounce."""
    one = make(SCENES["cornell-point"](), diffuse=True)
    dim = make(SCENES["cornell-point"](), "ssil.bounce_threshold=1", bounces=2, diffuse=True)
    two = make(SCENES["cornell-point"](), bounces=2, diffuse=True)
    for each in (one, dim, two):
        each.run()
    assert np.array_equal(one.read_back("indirect"), dim.read_back("indirect"))
    assert two.read_back("indirect").mean() > 1.1 * one.read_back("indirect").mean()


def test_light_of_a_removed_lamp_fades():
    """After a lamp is removed, less than 6 % of its light is left in three times the frames of the filter."""
    scene = SCENES["cornell-point"]()
    renderer = make(scene, "temporal.frames=8", diffuse=True)
    for _ in range(10):
        renderer.step(force=True)
    lit = renderer.read_back("indirect").mean()
    scene.lights.clear()
    left = []
    for _ in range(24):
        renderer.step(force=True)
        left.append(renderer.read_back("indirect").mean() / lit)
    assert left[0] < 1 and left[-1] < 0.06


def forced(renderer, count):
    """Return the indirect light of frames that run every pass."""
    pictures = []
    for _ in range(count):
        renderer.step(force=True)
        pictures.append(renderer.read_back("indirect"))
    return pictures


def test_moving_back_restores_the_filtered_picture():
    """After as many frames as the filter has, the mean of 16 frames is restored within its noise."""
    renderer = make(SCENES["cornell-point"](), "temporal.frames=8", diffuse=True)
    home = renderer.camera
    first = np.mean(forced(renderer, 26)[10:], 0)
    renderer.camera = Camera.look_at(
        home.position + np.array((0.3, 0.2, 0.1)), home.position - home.world_from_view[:3, 2]
    )
    forced(renderer, 3)
    renderer.camera = home
    after = np.mean(forced(renderer, 24)[8:], 0)
    assert np.abs(after - first).mean() <= 0.09 * first.mean()


def test_a_turning_camera_leaves_no_ghost():
    """When it stops, the filtered picture equals the settled one but for noise; so does its mean while it turns."""

    def blocks(picture):
        return picture.reshape(9, 6, 16, 6, 3).mean((1, 3))

    renderer = make(SCENES["cornell-point"](), "temporal.frames=4", diffuse=True, size=(96, 54))
    position, matrix = renderer.camera.position, renderer.camera.world_from_view
    pictures = []
    for k in range(16):
        turned = -matrix[:3, 2] + 0.02 * min(k, 8) * matrix[:3, 0]
        renderer.camera = Camera.look_at(position, position + turned)
        pictures += [blocks(picture) for picture in forced(renderer, 1)]
    still = make(SCENES["cornell-point"](), "camera.frames=32", "camera.jitter=false", diffuse=True, size=(96, 54))
    still.camera = renderer.camera
    still.run(show=("indirect",))
    settled = blocks(still.read_back("indirect"))
    assert np.abs(np.mean(pictures[12:], 0) - settled).mean() <= 0.1 * settled.mean()
    assert np.allclose(np.mean(pictures[8:], (1, 2, 3)), settled.mean(), rtol=0.06)


def test_a_still_camera_does_not_flicker():
    """Once the picture is complete, no pass runs."""
    renderer = make(SCENES["cornell-point"](), "temporal.frames=8", diffuse=True)
    while renderer.step(show=("indirect",)):
        pass
    first = renderer.read_back("indirect")
    assert not any(renderer.step(show=("indirect",)) for _ in range(3))
    assert np.array_equal(renderer.read_back("indirect"), first)


def test_visible_only_option_changes_only_the_path_tracer(tmp_path, capsys):
    """The path tracer loses light; for another technique, the command says that the option has no effect."""
    target = str(tmp_path / "a.npy")
    common = [
        "render",
        "cornell-point",
        "-o",
        target,
        "--size",
        "32x18",
        "--gi",
        "path",
        "--spp",
        "16",
        "--show",
        "indirect",
    ]
    means = []
    for more in ([], ["--visible-only"]):
        assert main([*common, "--bounces", "1", *more]) == 0
        means.append(np.load(target).mean())
    assert 0 < means[1] < 0.95 * means[0]
    capsys.readouterr()
    assert main([*common, "--gi", "ssil", "--set", "camera.frames=1", "--visible-only"]) == 0
    assert "--visible-only changes nothing" in capsys.readouterr().err


def settled(*texts, **fields):
    """Render until the picture has all bounces; return its indirect light and the number of steps."""
    renderer = make(SCENES["cornell-point"](), *texts, frames=8, bounces=None, diffuse=True, size=(96, 54), **fields)
    steps = 0
    while renderer.step(show=("indirect",), check=True):
        steps += 1
    assert not any(renderer.step(show=("indirect",)) for _ in range(2))
    return renderer.read_back("indirect"), steps


def test_amortised_bounces_equal_those_of_one_frame():
    """Bounces converge in the warm-up frames; then every pixel of the picture does, but for its noise."""
    all_at_once, steps = settled("ssil.bounces=12", "ssil.visibility_bounces=all", "ssil.bounce_threshold=0")
    amortised, more_steps = settled("ssil.amortised=true")
    assert amortised.mean() == pytest.approx(all_at_once.mean(), rel=0.01)
    assert np.abs(amortised - all_at_once).mean() <= 0.035 * all_at_once.mean()
    assert more_steps == steps + MOST_BOUNCES


def test_amortised_bounces_are_complete_while_the_camera_turns():
    """After the warm-up the mean of frames has all bounces, and so has every frame but for its noise."""
    shown = {}
    for name, texts in (
        ("apart", ("ssil.bounces=12", "ssil.visibility_bounces=all")),
        ("amortised", ("ssil.amortised=1",)),
    ):
        renderer = make(SCENES["cornell-point"](), *texts, bounces=None, diffuse=True, size=(96, 54))
        position, matrix = renderer.camera.position, renderer.camera.world_from_view
        means = []
        for k in range(32):
            renderer.camera = Camera.look_at(position, position - matrix[:3, 2] + 0.01 * k * matrix[:3, 0])
            renderer.step(show=("indirect",))
            means.append(renderer.read_back("indirect").mean())
        shown[name] = np.array(means)
    ratio = shown["amortised"] / shown["apart"]
    assert ratio[0] < 0.85 and np.allclose(ratio[8:], 1, atol=0.1)
    assert ratio[8:].mean() == pytest.approx(1, abs=0.03)


@pytest.mark.parametrize(
    ("text", "bounces", "reason"),
    [
        ("ssil.amortised=false", None, "ssil.amortised is off"),
        ("ssil.amortised=true", 1, "one bounce"),
        ("ssil.amortised=true", 2, "a number of bounces is given"),
    ],
)
def test_plan_says_why_bounces_are_not_amortised(text, bounces, reason):
    renderer = make(SCENES["cornell-point"](), text, bounces=bounces, diffuse=True)
    renderer.step(show=SHOW)
    line = next(line for line in renderer.plan().splitlines()[1:] if line.split()[0] == "ssil/feedback")
    assert line.split()[1] == "culled" and f"  {reason}; would add " in line


def test_amortised_light_that_passes_through_walls_stays_finite():
    """White walls and no visibility: the feedback is above 1."""
    scene = SCENES["cornell-point"]()
    for material in scene.materials:
        material.base_color = (1.0, 1.0, 1.0, 1.0)
    renderer = make(scene, "ssil.amortised=true", "ssil.visibility=none", bounces=None, diffuse=True)
    for _ in range(60):
        renderer.step(force=True, check=True)
    assert renderer.read_back("indirect").max() <= 100 * renderer.read_back("direct").max()
