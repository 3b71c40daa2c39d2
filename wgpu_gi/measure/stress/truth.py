"""Light against the path tracer: bias with its confidence interval, and relMSE without the noise of the truth.

Direct light is compared for every technique; indirect light with the bounces of the technique. Techniques that see
only the picture are compared with a truth in which only surfaces in the picture send light; a technique that does not
occlude the sky is compared without a sky.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...options import TECHNIQUES
from ...scene.load import has_light
from ...scene.scene import Scene
from .findings import Finding, Picture, skipped
from .studio import Studio, View

FRAMES = 16  # of the technique
RUNS, SPP = 8, 64  # of the path tracer: 512 samples per pixel in all
# A mean counts as wrong beyond these bounds, if its interval excludes them: errors that no user would accept.
# Keys: whether the technique sees only the picture, whose surfaces alone occlude the sky and send light.
DIRECT_BOUND = {False: 0.05, True: 0.30}
INDIRECT_BOUND = {False: 0.10, True: 0.50}
SIGMAS = 5.0  # of the confidence interval that decides; the report has 95 %
LEAST_SHARE = 1e-3  # indirect light below this share of direct light is not judged


def truth(studio: Studio, gi: str, scene: Scene, rng: np.random.Generator) -> Finding:
    """Measure bias and relMSE of direct and indirect light; fail if a mean is wrong beyond its bound."""
    technique = TECHNIQUES[gi]
    if gi == "path":
        return skipped("the path tracer is the truth")
    screen = technique.screen_space
    first = int(rng.integers(2**30))
    bounces = technique.bounces
    if not technique.occludes_sky and scene.environment is not None:
        scene = replace(scene, environment=None)
        if not has_light(scene):
            return skipped("its only light is the sky, which the technique does not occlude")
    view = View(scene, bounces=bounces, visible_only=screen, spp=SPP)
    truths = studio.take("path", view, range(first, first + RUNS))
    pictures = studio.take(gi, View(scene), range(first, first + FRAMES))

    numbers: dict[str, float] = {}
    compared: dict[str, tuple[Picture, Picture]] = {}
    wrong = []
    level = np.mean([t["direct"].mean() + t["indirect"].mean() for t in truths])
    for layer, bound in (("direct", DIRECT_BOUND[screen]), ("indirect", INDIRECT_BOUND[screen])):
        if layer == "indirect" and bounces == 0:
            continue
        found = errors([t[layer] for t in truths], [p[layer] for p in pictures], LEAST_SHARE * float(level))
        numbers |= {f"{layer} {name}": value for name, value in found.items()}
        if found:
            got, expected = (np.mean([p[layer] for p in taken], axis=0) for taken in (pictures, truths))
            compared[layer] = got, expected
        if found and abs(found["bias"]) - SIGMAS * found["bias error"] > bound:
            wrong.append((layer, found["bias"], found["bias error"]))
    if not wrong:
        return Finding("passed", numbers=numbers, compared=compared)
    layer, bias, error = wrong[0]
    sentence = f"{layer} light is off by {bias:+.1%} +- {1.96 * error:.1%} (95 %) from the path tracer"
    got, expected = compared[layer]
    return Finding("failed", f"bias of {layer}", sentence, numbers, got, expected, compared=compared)


def errors(truths: list[np.ndarray], pictures: list[np.ndarray], least: float) -> dict[str, float]:
    """Return bias, its standard error and relMSE of the mean picture; nothing if the truth is below `least`.

    relMSE is corrected by the noise of the truth. Pictures are (h, w, 3), one for each seed.
    """
    t, x = np.mean(truths, axis=0), np.mean(pictures, axis=0)
    m = float(t.mean())
    if not m > least:
        return {}
    noise = np.var(truths, axis=0, ddof=1) / len(truths)
    relmse = float(np.mean(((x - t) ** 2 - noise) / (t**2 + 0.01 * m**2)))
    spread = [np.var([p.mean() for p in taken], ddof=1) / len(taken) for taken in (truths, pictures)]
    return {"bias": float(x.mean()) / m - 1, "bias error": math.sqrt(sum(spread)) / m, "relmse": relmse}
