"""Each check of the stress lab fails for a renderer with its fault, and passes without; no GPU is used."""

from __future__ import annotations

import json
import time
from collections import Counter

import numpy as np
import pytest

from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.measure.stress import studio as studio_module
from wgpu_gi.measure.stress.checks import CHECKS, SENTENCES, run_check
from wgpu_gi.measure.stress.findings import Case
from wgpu_gi.measure.stress.page import page
from wgpu_gi.measure.stress.relations import RELATIONS
from wgpu_gi.measure.stress.results import Report, save_json
from wgpu_gi.measure.stress.run import Plan, run
from wgpu_gi.measure.stress.studio import Studio
from wgpu_gi.scene.animation import Animation, Channel, Track
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import box, grid
from wgpu_gi.scene.scene import DirectionalLight, Environment, Instance, MorphTarget, Scene

SIZE = (32, 18)
MACHINE = {"adapter": "a <fake>", "driver": "1", "cores": 2}


class FakeRenderer:
    """Shows the light of the suns and the sky on grey, with noise of pixels; subclasses have one fault each."""

    has_history, is_cpu = False, True

    def __init__(self, scene, *, size, camera, settings, adapter):
        self.scene, self.size, self.camera, self.settings = scene, size, camera, settings
        self.frames = 0

    def forget(self):
        pass

    def release(self):
        pass

    def step(self, progress, *, show, check):
        if self.frames:
            self.frames = 0
            return False
        self.frames = 1
        return True

    def light(self):
        total = sum((light.intensity * np.array(light.color) for light in self.scene.lights), np.zeros(3))
        sky = self.scene.environment
        return total + (0.0 if sky is None else np.array(sky.color))

    def noise(self):
        width, height = self.size
        return np.random.default_rng(self.settings.seed).uniform(0.5, 1.5, (height, width, 1))

    def read_back(self, name):
        width, height = self.size
        if name == "depth":
            scale = abs(np.linalg.det(self.scene.instances[0].world_from_local[:3, :3])) ** (1 / 3)
            return np.full((height, width), np.float64(2.0 ** round(np.log2(scale))))
        if name == "albedo":
            return np.full((height, width, 3), 0.5)
        return self.light() * self.noise() if name in ("radiance", "direct") else np.zeros((height, width, 3))


def scene():
    """A grid and a box that is morphed, two suns, of which one gets brighter, and a sky."""
    lights = [DirectionalLight((0, -1, 0), 2.0, (1.0, 0.5, 0.25)), DirectionalLight((1, -1, 0), 3.0)]
    morphed = box((0, 0, 0), (1, 1, 1), matte(0.2))
    morphed.morph_targets = [MorphTarget(0.1 * morphed.positions)]
    instances = [Instance(grid(2.0, 2, matte(0.5))), Instance(morphed, morph_weights=(1.0,))]
    brighter = Animation("brighter", [Channel(lights[0], "intensity", Track([0.0, 1.0], [2.0, 4.0]))])
    return Scene(instances, lights, Environment((0.5, 0.25, 0.125)), [Camera()], animations=[brighter])


def found(renderer, check, kind="room", seed=3, **arguments):
    studio = Studio(SIZE, make=renderer, **arguments)
    return run_check(studio, Case(kind, seed, "many-light", check), scene())


@pytest.mark.parametrize("check", ["finite", "repeated", "renewed", *RELATIONS])
def test_a_sound_renderer_passes(check):
    result = found(FakeRenderer, check)
    assert result.verdict == "passed", result


class NotANumber(FakeRenderer):
    def read_back(self, name):
        values = super().read_back(name)
        values[2, 5] = np.nan if name == "direct" else values[2, 5]
        return values


class Infinite(FakeRenderer):
    def light(self):
        return np.array([1.0, np.inf, 1.0])


class Negative(FakeRenderer):
    def light(self):
        return super().light() - 1000.0


class Raises(FakeRenderer):
    def step(self, progress, **_):
        raise ZeroDivisionError("no light")


class Refuses(FakeRenderer):
    def step(self, progress, **_):
        raise GiError("the GPU refused the frame")


class Logs(FakeRenderer):
    def step(self, progress, **_):
        import logging

        logging.getLogger("wgpu").error("Validation error: buffer is\ntoo small")
        return False


class Slow(FakeRenderer):
    is_cpu = False

    def step(self, progress, **_):
        time.sleep(0.02)
        progress(0.5)
        return True


@pytest.mark.parametrize(
    ("renderer", "failure", "words"),
    [
        (NotANumber, "NaN values", "direct has 3 NaN values, the first at x = 5, y = 2"),
        (Infinite, "infinite values", "radiance has"),
        (Negative, "negative values", "radiance has"),
        (Raises, "raised ZeroDivisionError", "no light"),
        (Refuses, "refused", "the GPU refused the frame"),
        (Logs, "validation", "Validation error: buffer is too small"),
        (Slow, "slow", "more than 0.01 s"),
    ],
)
def test_bad_pictures_fail(renderer, failure, words):
    result = found(renderer, "finite", frame_seconds=0.01)
    assert (result.verdict, result.failure) == ("failed", failure) and words in result.sentence


class Random(FakeRenderer):
    def noise(self):
        return np.random.default_rng().uniform(0.5, 1.5, (*self.size[::-1], 1))


def test_other_bits_fail():
    assert found(Random, "repeated").failure == "not deterministic"
    assert found(Random, "renewed").failure == "not deterministic"
    assert found(NotANumber, "repeated").failure == "NaN values"


class Thresholded(FakeRenderer):
    def light(self):
        return np.where(super().light() > 0.1, super().light(), 0.0) + 1e-9


class ScaleMatters(FakeRenderer):
    def light(self):
        return super().light() * np.abs(self.scene.instances[0].world_from_local[0]).sum()


class LosesLights(FakeRenderer):
    def light(self):
        return super().light() * (1.2 if len(self.scene.lights) < 2 or self.scene.environment is None else 1.0)


class RedOnly(FakeRenderer):
    def light(self):
        return super().light() * np.array([1.1, 1.0, 1.0])


class CountsInstances(FakeRenderer):
    def light(self):
        return super().light() * (1 + 0.1 * len(self.scene.instances))


class CountsTriangles(FakeRenderer):
    def light(self):
        return super().light() * (1 + 0.01 * self.scene.triangle_count)


class LeftIsDarker(FakeRenderer):
    def noise(self):
        return super().noise() * np.linspace(0.8, 1.2, self.size[0])[:, None]


class FirstInstance(FakeRenderer):
    def light(self):
        return super().light() * (1 + len(self.scene.instances[0].mesh.triangles) % 7)


class SizeMatters(FakeRenderer):
    def light(self):
        return super().light() * self.size[0]


class Drifts(FakeRenderer):
    def light(self):
        return super().light() * (1 + np.abs(self.scene.instances[0].world_from_local[:3, 3]).max())


class Directed(FakeRenderer):
    def light(self):
        return super().light() * (2 + self.scene.lights[0].direction[1])


class LosesPoses(FakeRenderer):
    def light(self):
        return super().light() * (1 + 0.1 * sum(len(i.morph_weights) for i in self.scene.instances))


class Stuck(FakeRenderer):
    """Keeps the light that a scene had when it was first seen."""

    seen: tuple[object, object] = (None, None)

    def light(self):
        if self.seen[0] is not self.scene:
            self.seen = self.scene, super().light()
        return self.seen[1]

    def step(self, progress, **arguments):
        self.light()
        return super().step(progress, **arguments)


@pytest.mark.parametrize(
    ("renderer", "check"),
    [
        (LosesPoses, "baked"),
        (Stuck, "played"),
        (Thresholded, "light"),
        (ScaleMatters, "scale"),
        (CountsInstances, "empty"),
        (CountsInstances, "cut"),
        (CountsInstances, "hidden"),
        (CountsTriangles, "subdivide"),
        (LosesLights, "superposition"),
        (RedOnly, "channels"),
        (LeftIsDarker, "mirror"),
        (Drifts, "translation"),
        (SizeMatters, "half"),
        (Random, "pose"),
    ],
)
def test_broken_relations_fail(renderer, check):
    result = found(renderer, check)
    assert result.verdict == "failed" and result.got is not None, result


def test_order_and_rotation_fail_for_some_seed():
    """A permutation of two instances may be none, and an axis may leave a direction as it is."""
    assert any(found(FirstInstance, "order", seed=seed).verdict == "failed" for seed in range(6))
    assert any(found(Directed, "rotation", seed=seed).verdict == "failed" for seed in range(6))


def test_leaks_fail(monkeypatch):
    counts = Counter()

    def diagnostics():
        counts["buffers"] += 2
        return {name: {"count": counts["buffers"]} for name in ("Buffer", "Texture", "BindGroup", "TextureView")}

    monkeypatch.setattr(studio_module, "object_counts", diagnostics)
    assert found(FakeRenderer, "leaks").failure == "leak"
    monkeypatch.setattr(studio_module, "object_counts", lambda: {key: {"count": 7} for key in diagnostics()})
    assert found(FakeRenderer, "leaks").verdict == "passed"


class Dark(FakeRenderer):
    """The technique is darker than the path tracer, and absorbs light in the furnace."""

    def light(self):
        return super().light() * (1.0 if self.settings.gi == "path" else 0.8)


def test_errors_against_the_truth_and_in_the_furnace_fail():
    result = found(Dark, "truth")
    assert result.failure == "bias of direct" and result.numbers["direct bias"] == pytest.approx(-0.2, abs=0.02)
    assert found(FakeRenderer, "truth").verdict == "passed"
    assert found(Dark, "furnace").failure == "furnace"
    assert found(FakeRenderer, "furnace").verdict == "passed"


def test_every_check_has_a_sentence_and_ambiguous_kinds_are_skipped():
    assert SENTENCES.keys() == CHECKS.keys()
    assert found(FirstInstance, "order", kind="degenerate").verdict == "skipped"


# ------------------------------------------------------------------------------------------------ A whole run


def ran(renderer, tmp_path, progress=lambda record, report: None, **arguments):
    plan = Plan(("room", "street"), range(4), ("none", "ssil"), folder=tmp_path, make=lambda kind, seed: scene())
    for name, value in {"reduce_seconds": 0.5, **arguments}.items():
        setattr(plan, name, value)
    return run(plan, {"medium": Studio(SIZE, make=renderer)}, MACHINE, progress)


def test_a_run_takes_turns_and_reports(tmp_path):
    report = ran(FakeRenderer, tmp_path)
    counts = Counter(record.case.check for record in report.records)
    assert counts["repeated"] == 16
    assert sum(counts[name] for name in RELATIONS) == 16 and len(counts.keys() & RELATIONS.keys()) > 6
    assert not report.failed and not report.interrupted
    assert "no failures in" in page(report)


def test_failures_are_reduced_saved_and_shown(tmp_path):
    report = ran(NotANumber, tmp_path, checks=["finite"])
    assert len(report.failed) == 16 and len(report.failures) == 6
    failure = report.failures[0]
    assert failure.path.endswith("room-0-none-finite.glb") and "1 triangles" in failure.reduced
    assert "--gi none --checks finite" in failure.command and failure.command.startswith("wgpu-gi stress")
    text = page(report)
    assert "16 failures in 16 cases" in text and "a &lt;fake&gt;" in text and text.count("<section>") == 6
    save_json(tmp_path / "out.json", report)
    document = json.loads((tmp_path / "out.json").read_text())
    assert document["schema"] == "wgpu_gi.stress" and len(document["cases"]) == 16
    assert document["failures"][0]["class"] == "NaN values" and document["times"]["none"]["first"]["count"] > 0


def test_the_worst_picture_of_each_layer_is_kept(tmp_path):
    report = ran(Dark, tmp_path, checks=["truth"], reduce_seconds=0.0, seeds=range(1))
    (key,) = {(gi, layer) for gi, _, layer in report.worst} - {("ssil", "direct")}
    assert key == ("none", "direct") and "The worst picture" in page(report)
    text = page(report)
    assert "direct light of none, medium: room 0, relMSE" in text and "bias -20" in text.replace("-19.9", "-20")


def test_the_running_case_is_noted_for_drivers_that_end_the_process(tmp_path):
    notes = []

    class Noted(FakeRenderer):
        def forget(self):
            notes.append((tmp_path / "running.txt").read_text())

    ran(Noted, tmp_path, checks=["repeated"], seeds=range(1))
    assert notes[0].startswith("wgpu-gi stress --kinds room --seeds 0:1 --gi none --checks repeated")
    assert not (tmp_path / "running.txt").exists()


def test_a_run_ends_in_time_and_at_an_interrupt(tmp_path):
    assert ran(FakeRenderer, tmp_path, minutes=1e-9).records == []

    def interrupt(record, report):
        raise KeyboardInterrupt

    report = ran(FakeRenderer, tmp_path, interrupt)
    assert report.interrupted and len(report.records) == 1 and "interrupted" in page(report)


def test_an_empty_report_has_a_page():
    assert "no failures in 0 cases" in page(Report(MACHINE, SIZE))
