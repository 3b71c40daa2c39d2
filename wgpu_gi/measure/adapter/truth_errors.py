"""Errors of every technique against the stored truths: of one frame, and of a finished still picture."""

from __future__ import annotations

from dataclasses import replace

from ...options import TECHNIQUES, Settings, picture_count
from ...renderer import Renderer
from ..bench import layer_errors, truth_bounces
from ..metrics import Errors
from ..references import SIZE, path_of, scene_of
from ..truth import Truth, truth_from_file
from .budget import Budget
from .results import TruthError

SCENES = {"cornell_spot": "Cornell, spot", "cornell_area": "Cornell, area light", "leak_corridor_a": "corridor"}
PATH_SPP = 16


def measure_errors(budget: Budget, adapter: str | None = None) -> list[TruthError]:
    """Return the errors of the full picture at medium quality, all materials Lambert, less the noise of the truth.

    SSDO is compared with one bounce, the others with all. The budget notes techniques that fail, too.
    """
    found = []
    for name, title in SCENES.items():
        scene = scene_of(name)
        renderer = Renderer(scene, size=SIZE, adapter=adapter)
        try:
            for gi in TECHNIQUES:
                what = f"error of {gi} in {title}"
                if budget.allows(what):
                    with budget.noting(what):
                        found.append(_measure(renderer, gi, name, title))
        finally:
            renderer.close()
    return found


def _measure(renderer: Renderer, gi: str, name: str, title: str) -> TruthError:
    settings = Settings(gi=gi, diffuse=True, spp=PATH_SPP)
    settings.camera.jitter = False
    bounces = truth_bounces(settings)
    truth = truth_from_file(path_of(name), 1 if bounces == 1 else None)
    frames = picture_count(settings, renderer.scene)
    one = _errors(renderer, settings, 1, truth)
    still = one if frames == 1 else _errors(renderer, settings, frames, truth)
    return TruthError(title, gi, one.relmse, one.bias, still.relmse, still.bias, frames)


def _errors(renderer: Renderer, settings: Settings, frames: int, truth: Truth) -> Errors:
    renderer.settings = replace(settings, camera=replace(settings.camera, frames=frames))
    renderer.run(show=("radiance",))
    full = Truth(truth.source, {"full": truth.layers["full"]}, truth.noise, truth.surface)
    errors = layer_errors({"full": renderer.read_back("radiance")}, full)["full"]
    assert errors is not None  # the references are not black
    return errors
