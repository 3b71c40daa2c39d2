"""Light against the path tracer: bias with its confidence interval, and relMSE without the noise of the truth.

Still pictures with all their frames are compared, since those converge. Direct light is compared for every technique;
indirect light with the bounces of the technique. Techniques that see only the picture are compared with a truth in
which only surfaces in the picture send light; a technique that does not occlude the sky is compared without a sky.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...options import TECHNIQUES
from ...scene.load import has_light
from ...scene.scene import Scene
from .findings import Finding, skipped
from .statistics import student_p
from .studio import Layers, Studio, View

PICTURES = 2  # of the technique, each the mean of its preset's frames
RUNS, SPP = 8, 64  # of the path tracer: 512 samples per pixel in all
# A mean counts as wrong beyond these bounds: errors that no user would accept.
# Keys: whether the technique sees only the picture, whose surfaces alone occlude the sky and send light.
DIRECT_BOUND = {False: 0.05, True: 0.30}
INDIRECT_BOUND = {False: 0.10, True: 0.50}
# Factor on PICTURES and RUNS, and p-value below which the suspicion stays. Joint: 1e-2 * 1e-6 = 1e-8.
STAGES = ((1, 1e-2), (4, 1e-6))
LEAST_SHARE = 1e-3  # light below this share of all light is not judged


def truth(studio: Studio, gi: str, scene: Scene, rng: np.random.Generator) -> Finding:
    """Measure bias and relMSE of direct and indirect light; fail if a mean is wrong beyond its bound."""
    technique = TECHNIQUES[gi]
    if gi == "path":
        return skipped("the path tracer is the truth")
    if not technique.occludes_sky and scene.environment is not None:
        scene = replace(scene, environment=None)
        if not has_light(scene):
            return skipped("its only light is the sky, which the technique does not occlude")
    first = int(rng.integers(2**30))
    view = View(scene, bounces=technique.bounces, visible_only=technique.screen_space, spp=SPP)
    found = Finding("passed")
    for factor, alpha in STAGES if studio.thorough else STAGES[:1]:
        truths = studio.remembered("path", view, range(first, first + factor * RUNS))
        pictures = studio.take(gi, View(scene, frames=None), range(first, first + factor * PICTURES))
        first += factor * RUNS
        found = _compared(gi, truths, pictures, alpha)
        if found.verdict != "failed":
            break
    return found


def _compared(gi: str, truths: list[Layers], pictures: list[Layers], alpha: float) -> Finding:
    """Return the errors of direct and indirect light; fail if one exceeds its bound with a p-value below `alpha`."""
    found = Finding("passed")
    screen, bounces = TECHNIQUES[gi].screen_space, TECHNIQUES[gi].bounces
    level = float(np.mean([t["direct"].mean() + t["indirect"].mean() for t in truths]))
    for layer, bound in (("direct", DIRECT_BOUND[screen]), ("indirect", INDIRECT_BOUND[screen])):
        if layer == "indirect" and bounces == 0:
            continue
        values = errors([t[layer] for t in truths], [p[layer] for p in pictures], LEAST_SHARE * level)
        if not values:
            continue
        found.numbers |= {f"{layer} {name}": value for name, value in values.items()}
        got, expected = (np.mean([p[layer] for p in taken], axis=0) for taken in (pictures, truths))
        found.compared[layer] = got, expected
        excess = max(abs(values["bias"]) - bound, 0.0)
        p = student_p(excess / max(values["bias error"], 1e-300), len(truths) - 1)
        if p < alpha and found.verdict == "passed":
            interval = f"{values['bias']:+.1%} +- {1.96 * values['bias error']:.1%} (95 %)"
            found.verdict, found.failure, found.p = "failed", f"bias of {layer}", p
            found.sentence = f"{layer} light is off by {interval} from the path tracer"
            found.got, found.expected = got, expected
    return found


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
