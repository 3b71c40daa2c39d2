"""The relations between pictures that hold without a truth: what to change, and what the picture becomes.

Bits are promised where only powers of two or nothing changes. All else changes the rounding and the hierarchy, so that
techniques draw other samples: equal means are promised, within a margin.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...camera import Camera
from ...options import TECHNIQUES
from ...scene.scene import Scene
from . import edits
from .compare import EDGES, Margin, same_bits, same_means
from .findings import Finding, skipped
from .studio import LIGHT, Layers, Studio, View

MARGIN = Margin(mean=0.002, block=0.02)
# Shadow maps have other texels after a rotation; at this size, blocks hold up to 5 % of penumbra pixels.
TEXELS = Margin(mean=0.005, block=0.05)
# Blurs weigh neighbours by noise, which differs for lights together and apart: means hold, pixels do not.
BLURS = Margin(mean=0.005, block=0.05)
HALF = Margin(mean=0.02, block=0.10)  # a half-size picture has its own texels and samples, and blurs as many pixels
WIDE = 1.8  # radians: tan(0.9) = 1.3
POWERS = 12  # relations by powers of two use 2^-12 to 2^12
SMALLEST, LARGEST = 1e-30, 1e30  # of intensities and radiances after scaling: float32 holds 1e-38 to 3e38


@dataclass(frozen=True)
class Pictures:
    """Views whose pictures, added up and mapped, are expected to equal that of `got`."""

    expected: Sequence[View]
    got: View
    map: Callable[[Layers], Layers] = lambda layers: layers


Size = tuple[int, int]
Change = Callable[[Scene, np.random.Generator, Size], Pictures | str]


@dataclass(frozen=True)
class Relation:
    """A relation: its sentence, the change (or the reason why it does not apply), and its promise."""

    sentence: str
    change: Change
    bits: bool = False
    margin: Margin = MARGIN
    edges: float | None = EDGES  # share of pixels that may see another surface; None: pixels are not compared
    without: frozenset[str] = frozenset()  # kinds of scenes that do not promise it
    screen_space: bool = True  # False: techniques that see only the picture do not promise it

    def __call__(self, studio: Studio, gi: str, scene: Scene, rng: np.random.Generator) -> Finding:
        """Take the pictures and compare them."""
        if not self.screen_space and TECHNIQUES[gi].screen_space:
            return skipped("techniques that see only the picture do not promise it")
        pictures = self.change(scene, rng, studio.size)
        if isinstance(pictures, str):
            return skipped(pictures)
        if self.bits:
            (expected,) = studio.take(gi, pictures.expected[0])
            (got,) = studio.take(gi, pictures.got)
            return same_bits(pictures.map(expected), got)

        def take(seeds: Sequence[int]) -> list[tuple[Layers, Layers]]:
            parts = [studio.take(gi, view, seeds) for view in pictures.expected]
            expected = [pictures.map(_total(layers)) for layers in zip(*parts, strict=True)]
            return list(zip(expected, studio.take(gi, pictures.got, seeds), strict=True))

        return same_means(take, self.margin, self.edges, studio.thorough)


def _total(parts: Sequence[Layers]) -> Layers:
    return {**parts[0], **{name: np.sum([part[name] for part in parts], axis=0) for name in LIGHT}}


def _times(factor: float) -> Callable[[Layers], Layers]:
    return lambda layers: {n: factor * v if n in LIGHT else v for n, v in layers.items()}


# ------------------------------------------------------------------------------------------------ Light


def _light(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    if edits.has_unlit(scene):
        return "unlit materials do not depend on the light"
    factor = _power_of_two(rng)
    values = _light_values(scene)
    if values and not (min(values) * factor > SMALLEST and max(values) * factor < LARGEST):
        return "the light would leave the range of float32"
    return Pictures([View(scene)], View(edits.brightened(scene, factor)), _times(factor))


def _light_values(scene: Scene) -> list[float]:
    """Return all positive intensities, emissions and radiances of the sky."""
    found = [light.intensity * value for light in scene.lights for value in light.color]
    found += [value for material in scene.materials for value in material.emission]
    if scene.environment is not None:
        image = scene.environment.image
        found += [v * (1.0 if image is None else float(image.max(initial=0.0))) for v in scene.environment.color]
    return [value for value in found if value > 0]


def _superposition(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    count = edits.source_count(scene)
    if count < 2 or edits.has_unlit(scene):
        return "it has fewer than two sources of light, or unlit materials"
    chosen = rng.permutation(count) < rng.integers(1, count)
    parts = [View(edits.with_sources(scene, keep.tolist())) for keep in (chosen, ~chosen)]
    return Pictures(parts, View(scene))


def _channels(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    rolled = (*LIGHT, "albedo")
    return Pictures(
        [View(scene)],
        View(edits.channels_rolled(scene)),
        lambda layers: {n: v[..., [1, 2, 0]] if n in rolled else v for n, v in layers.items()},
    )


# ------------------------------------------------------------------------------------------------ Place


def _scale(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    factor = _power_of_two(rng)
    values = [light.intensity for light in scene.lights]
    if values and not (min(v or 1.0 for v in values) * factor**2 > SMALLEST and max(values) * factor**2 < LARGEST):
        return "the light would leave the range of float32"
    matrix = np.diag([factor, factor, factor, 1.0])
    return Pictures([View(scene)], View(edits.moved(scene, matrix)), _nearer(factor))


def _nearer(factor: float) -> Callable[[Layers], Layers]:
    return lambda layers: {n: factor * v if n == "depth" else v for n, v in layers.items()}


def _translation(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    diagonal = float(np.linalg.norm(np.ptp(scene.bounds(), axis=0))) or 1.0
    matrix = np.eye(4)
    matrix[:3, 3] = rng.uniform(-100, 100, 3) * diagonal
    return Pictures([View(scene)], View(edits.moved(scene, matrix)))


def _rotation(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    pictured = scene.environment is not None and scene.environment.image is not None
    axis = 1 if pictured else int(rng.integers(3))
    matrix = np.eye(4)
    u, v = (axis + 1) % 3, (axis + 2) % 3
    matrix[[u, u, v, v], [u, v, u, v]] = 0.0, -1.0, 1.0, 0.0
    return Pictures([View(scene)], View(edits.moved(scene, matrix)))


def _mirror(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    matrix = np.diag([-1.0, 1.0, 1.0, 1.0])
    return Pictures(
        [View(scene)],
        View(edits.moved(scene, matrix)),
        lambda layers: {name: values[:, ::-1] for name, values in layers.items()},
    )


# ------------------------------------------------------------------------------------------------ Description


def _order(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    return Pictures([View(scene)], View(edits.reordered(scene, rng)))


def _cut(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    other = edits.cut(scene, rng)
    return "no mesh has two triangles" if other is None else Pictures([View(scene)], View(other))


def _subdivide(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    other = edits.subdivided(scene)
    return "no mesh is flat" if other is None else Pictures([View(scene)], View(other))


def _empty(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    return Pictures([View(scene)], View(edits.with_nothing_added(scene)))


def _hidden(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    return Pictures([View(scene)], View(edits.with_hidden_added(scene)))


# ------------------------------------------------------------------------------------------------ Motion


def _baked(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    other = edits.baked(scene)
    return "nothing deforms" if other is None else Pictures([View(scene)], View(other))


def _played(there_and_back: bool) -> Change:
    """Return a change that plays to a time from another one, or from the same one by way of another."""

    def change(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
        if not scene.animations:
            return "it has no animation"
        time, other = rng.uniform(0.0, scene.animations[0].duration, 2).tolist()
        before = (time, other) if there_and_back else (other,)
        return Pictures([View(scene.at(time))], View(scene, times=(*before, time)))

    return change


# ------------------------------------------------------------------------------------------------ Camera


def _pose(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    camera = scene.cameras[0]
    away = Camera(camera.world_from_view.copy(), camera.yfov, camera.orthographic_height)
    diagonal = float(np.linalg.norm(np.ptp(scene.bounds(), axis=0))) or 1.0
    away.world_from_view[:3, 3] += rng.uniform(-0.05, 0.05, 3) * diagonal
    return Pictures([View(scene)], View(scene, before=away))


def _half(scene: Scene, rng: np.random.Generator, size: Size) -> Pictures | str:
    width, height = max(size[0] // 2, 1), max(size[1] // 2, 1)
    camera = scene.cameras[0]
    if camera.orthographic_height is None and camera.yfov > WIDE:
        return "pixels at the edge of so wide a view are too unequal"
    view = View(scene, size=(2 * width, 2 * height), shaken=True)
    return Pictures([view], replace(view, size=(width, height)), _halved)


def _halved(layers: Layers) -> Layers:
    """Return the means of 2x2 pixels."""

    def mean(values: np.ndarray) -> np.ndarray:
        return (values[::2, ::2] + values[1::2, ::2] + values[::2, 1::2] + values[1::2, 1::2]) / 4

    return {name: mean(values) for name, values in layers.items()}


def _power_of_two(rng: np.random.Generator) -> float:
    return float(2.0 ** (int(rng.integers(1, POWERS + 1)) * int(rng.choice([-1, 1]))))


AMBIGUOUS = frozenset({"degenerate"})  # coplanar and doubled faces: which one a ray hits depends on rounding

RELATIONS: dict[str, Relation] = {
    "light": Relation("2^k times the light is 2^k times the picture", _light, bits=True),
    "scale": Relation("2^k times the size and 4^k times the intensities change nothing", _scale, bits=True),
    "empty": Relation("a mesh without triangles changes nothing", _empty, bits=True),
    "pose": Relation("a camera that has been elsewhere takes the same picture", _pose, bits=True),
    "superposition": Relation("lights A and B together are A plus B", _superposition, margin=BLURS),
    "channels": Relation("permuted colours give a permuted picture", _channels),
    "translation": Relation("a moved scene looks the same", _translation, without=AMBIGUOUS),
    "rotation": Relation("a scene turned by 90 degrees looks the same", _rotation, margin=TEXELS, without=AMBIGUOUS),
    "mirror": Relation("a mirrored scene gives a mirrored picture", _mirror, margin=TEXELS, without=AMBIGUOUS),
    "order": Relation("the order of instances, lights and triangles changes nothing", _order, without=AMBIGUOUS),
    "cut": Relation("a mesh cut into two instances looks the same", _cut, without=AMBIGUOUS),
    "subdivide": Relation("subdivided flat triangles look the same", _subdivide, without=AMBIGUOUS),
    # Screen-space techniques search within a radius relative to the size of the scene.
    "hidden": Relation(
        "a hidden object far away changes nothing", _hidden, margin=TEXELS, without=AMBIGUOUS, screen_space=False
    ),
    "baked": Relation("a deformed mesh looks like a static one of its pose", _baked),
    "played": Relation("an animation that plays to a time looks as if it started there", _played(False)),
    "back": Relation("an animation that plays to another time and back looks the same", _played(True)),
    "half": Relation("a picture of half the size has the means of 2x2 pixels", _half, margin=HALF, edges=None),
}
