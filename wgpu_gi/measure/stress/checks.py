"""The checks of one scene and technique: values, repetition, leaks, relations, truth. `CHECKS` names them all."""

from __future__ import annotations

import zlib
from collections.abc import Callable

import numpy as np

from ...scene.scene import Scene
from .compare import same_bits
from .findings import PASSED, Case, Finding, Picture, failed
from .furnace import furnace
from .relations import RELATIONS
from .studio import LIGHT, Layers, Studio, Trouble, View
from .truth import truth

Check = Callable[[Studio, str, Scene, np.random.Generator], Finding]


def finite(studio: Studio, gi: str, scene: Scene, rng: np.random.Generator) -> Finding:
    """Fail if a layer has a NaN, an infinite or a negative value; name the first pass that wrote it."""
    view, seed = View(scene), int(rng.integers(2**32))
    return _values(studio, gi, view, seed, studio.take(gi, view, [seed])[0])


def _values(studio: Studio, gi: str, view: View, seed: int, layers: Layers) -> Finding:
    for name, values in layers.items():
        wrong = bad_values(values)
        if wrong:
            sentence = f"{name} has {wrong}"
            try:
                studio.take(gi, view, [seed], check=True)
            except Trouble as trouble:
                sentence += f"; {trouble.sentence}"
            return failed(f"{wrong.split(' ', 1)[1].split(',')[0]}", sentence, layers["radiance"])
    return Finding("passed", numbers={"radiance": float(layers["radiance"].mean())})


def bad_values(values: Picture) -> str:
    """Return what is wrong with the values of a layer in words; an empty text if nothing is."""
    for what, wrong in (("NaN", np.isnan(values)), ("infinite", np.isinf(values)), ("negative", values < 0)):
        if wrong.any():
            row, column = np.argwhere(wrong)[0][:2]
            return f"{int(wrong.sum())} {what} values, the first at x = {column}, y = {row}"
    return ""


def repeated(studio: Studio, gi: str, scene: Scene, rng: np.random.Generator) -> Finding:
    """Fail if two runs of the same renderer differ in a bit, and as `finite` for the first."""
    view, seed = View(scene), int(rng.integers(2**32))
    (first,) = studio.take(gi, view, [seed])
    found = _values(studio, gi, view, seed, first)
    if found.verdict == "failed":
        return found
    (second,) = studio.take(gi, view, [seed])
    same = _equal(first, second)
    return found if same.verdict == "passed" else same


def renewed(studio: Studio, gi: str, scene: Scene, rng: np.random.Generator) -> Finding:
    """Fail if a new renderer takes another picture than one that has rendered other scenes."""
    seed = int(rng.integers(2**32))
    (first,) = studio.take(gi, View(scene), [seed])
    studio.reset()
    (second,) = studio.take(gi, View(scene), [seed])
    return _equal(first, second)


def _equal(first: Layers, second: Layers) -> Finding:
    found = same_bits(first, second, (*LIGHT, "albedo", "depth"))
    return (
        found if found.verdict == "passed" else failed("not deterministic", found.sentence, found.got, found.expected)
    )


def leaks(studio: Studio, gi: str, scene: Scene, rng: np.random.Generator) -> Finding:
    """Fail if released renderers leave more GPU objects behind each time."""
    counts = []
    for _ in range(3):
        studio.take(gi, View(scene))
        counts.append(studio.counts())
    # The first use of a technique creates objects that the process keeps.
    for name, count in counts[2].items():
        if count > counts[1][name]:
            return failed("leak", f"each use leaves {count - counts[1][name]} {name} objects behind")
    return PASSED


CHECKS: dict[str, Check] = {
    "finite": finite,
    "repeated": repeated,
    "renewed": renewed,
    "leaks": leaks,
    **RELATIONS,
    "truth": truth,
    "furnace": furnace,
}
SENTENCES = {
    "finite": "no NaN, infinite or negative value, no validation error, bounded time",
    "repeated": "as finite, and two runs are equal to the bit",
    "renewed": "a new renderer takes the same picture to the bit",
    "leaks": "GPU objects are freed",
    **{name: relation.sentence for name, relation in RELATIONS.items()},
    "truth": "direct and indirect light against the path tracer, within a bound",
    "furnace": "white spheres of all materials vanish in a white sky",
}


def run_check(studio: Studio, case: Case, scene: Scene) -> Finding:
    """Run the check of a case on its scene. Random choices depend on the seed and the name of the check only."""
    rng = np.random.default_rng([case.seed, zlib.crc32(case.check.encode())])
    relation = RELATIONS.get(case.check)
    if relation is not None and case.kind in relation.without:
        return Finding("skipped", sentence=f"{case.kind} scenes do not promise it")
    try:
        return CHECKS[case.check](studio, case.gi, scene, rng)
    except Trouble as trouble:
        return failed(trouble.kind, trouble.sentence)
