"""Reduces a failing scene: drops and simplifies parts while it still fails (Zeller and Hildebrandt 2002, ddmin)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import TypeVar

import numpy as np

from ...scene.scene import DirectionalLight, Instance, Material, Mesh, Scene, values_of
from .edits import copied, with_triangles

T = TypeVar("T")
SMALLEST = (16, 9)  # pixels
DIGITS = (1, 2, 3)  # significant digits of simplified numbers, fewest first


@dataclass(frozen=True)
class State:
    """A scene and the size of its picture."""

    scene: Scene
    size: tuple[int, int]


Fails = Callable[[State], bool]


def reduced(state: State, fails: Fails, seconds: float = 60.0) -> State:
    """Return a simpler state that still fails, after at most `seconds` and the call that is running then."""
    end = time.perf_counter() + seconds

    def fails_in_time(candidate: State) -> bool:
        return time.perf_counter() < end and fails(candidate)

    state = _smaller_picture(state, fails_in_time)
    before = None
    # Dropping one part may allow to drop another: repeat until nothing changes.
    while before is not state and time.perf_counter() < end:
        before = state
        state = _fewer_parts(state, fails_in_time)
        for candidates in (_without_sky, _simpler_materials, _rounder_lights):
            state = _first_that_fails(state, candidates, fails_in_time)
        state = _fewer_triangles(state, fails_in_time)
    return state


def smallest(items: Sequence[T], fails: Callable[[list[T]], bool]) -> list[T]:
    """Return a part of `items` that still fails, of which no single item can be dropped (ddmin without complements)."""
    kept, parts = list(items), 2
    if kept and fails([]):
        return []
    while len(kept) >= 2:
        size = -(-len(kept) // parts)
        for first in range(0, len(kept), size):
            rest = kept[:first] + kept[first + size :]
            if rest and fails(rest):
                kept, parts = rest, max(parts - 1, 2)
                break
        else:
            if parts >= len(kept):
                break
            parts = min(2 * parts, len(kept))
    return kept


def described(scene: Scene) -> str:
    """Return what a scene consists of, in words."""
    sources = [f"{scene.triangle_count} triangles in {len(scene.instances)} instances", f"{len(scene.lights)} lights"]
    emitters = sum(max(m.emission) > 0 for m in scene.materials)
    sources += [f"{emitters} emitting materials"] * bool(emitters) + ["a sky"] * (scene.environment is not None)
    return ", ".join(sources)


def _smaller_picture(state: State, fails: Fails) -> State:
    while min(state.size[0] // 2 - SMALLEST[0], state.size[1] // 2 - SMALLEST[1]) >= 0:
        smaller = replace(state, size=(state.size[0] // 2, state.size[1] // 2))
        if not fails(smaller):
            break
        state = smaller
    return state


def _with(state: State, **changes: object) -> State:
    scene = replace(state.scene, **changes)  # type: ignore[arg-type]
    return replace(state, scene=scene)


def _fewer_parts(state: State, fails: Fails) -> State:
    for name in ("instances", "lights"):
        parts = getattr(state.scene, name)

        def fails_with(kept: list[object], name: str = name, state: State = state) -> bool:
            return fails(_with(state, **{name: kept}))

        kept = smallest(parts, fails_with)
        if len(kept) < len(parts):
            state = _with(state, **{name: kept})
    return state


def _first_that_fails(state: State, candidates: Callable[[Scene], Iterator[Scene]], fails: Fails) -> State:
    """Take every simplification that still fails, each on top of those before."""
    tried = 0
    while True:
        for scene in list(candidates(state.scene))[tried:]:
            tried += 1
            if fails(replace(state, scene=scene)):
                state, tried = replace(state, scene=scene), 0
                break
        else:
            return state


def _without_sky(scene: Scene) -> Iterator[Scene]:
    if scene.environment is not None:
        yield replace(scene, environment=None)
        if scene.environment.image is not None:
            yield replace(scene, environment=replace(scene.environment, image=None, rotation=0.0))


DEFAULTS: dict[str, object] = {f.name: f.default for f in fields(Material) if f.name.endswith("_texture")}
DEFAULTS |= {
    f.name: f.default
    for f in fields(Material)
    if f.name.startswith(("ior", "specular", "clearcoat", "sheen", "transmission", "thickness", "atten", "anisotropy"))
}


def _simpler_materials(scene: Scene) -> Iterator[Scene]:
    """Yield the scene with one property of one material simplified."""
    for k, material in enumerate(scene.materials):
        changes = [{name: value} for name, value in DEFAULTS.items() if getattr(material, name) != value]
        if max(material.emission) > 0:
            changes += [{"emission": (0.0, 0.0, 0.0)}]
        if material.metallic > 0:
            changes.append({"metallic": 0.0})
        if material.roughness < 1:
            changes.append({"roughness": 1.0})
        if material.alpha_mode != "opaque":
            changes.append({"alpha_mode": "opaque"})
        if material.base_color[:3] != (0.5, 0.5, 0.5):
            changes += [{"base_color": (0.5, 0.5, 0.5, material.base_color[3])}]
        for change in changes:
            yield _with_material(scene, k, change)
    for name in ("colors", "normals", "tangents", "texcoords1", "texcoords0"):
        if any(getattr(mesh, name) is not None for mesh in scene.meshes):
            yield copied(scene, mesh=partial(_without, name))


def _without(name: str, mesh: Mesh) -> Mesh:
    return replace(mesh, **{name: None})  # type: ignore[arg-type]


def _with_material(scene: Scene, number: int, change: dict[str, object]) -> Scene:
    chosen = scene.materials[number]

    def changed(material: Material) -> Material:
        return replace(material, **change) if material is chosen else replace(material)  # type: ignore[arg-type]

    return copied(scene, material=changed)


def _rounder_lights(scene: Scene) -> Iterator[Scene]:
    """Yield the scene with the numbers of one light at few digits."""
    for k, light in enumerate(scene.lights):
        for digits in DIGITS:
            changes: dict[str, object] = {"intensity": _rounded(light.intensity, digits), "color": (1.0, 1.0, 1.0)}
            if not isinstance(light, DirectionalLight):
                changes["position"] = tuple(_rounded(v, digits) for v in light.position)
            rounder = replace(light, **changes)  # type: ignore[arg-type]
            if values_of(rounder) != values_of(light):
                yield replace(scene, lights=[*scene.lights[:k], rounder, *scene.lights[k + 1 :]])


def _rounded(value: float, digits: int) -> float:
    return float(f"{value:.{digits - 1}e}")


def _fewer_triangles(state: State, fails: Fails) -> State:
    """Drop triangles of each mesh, largest meshes first."""
    for mesh in sorted(state.scene.meshes, key=lambda m: -len(m.triangles)):

        def fails_with(kept: list[int], mesh: Mesh = mesh, state: State = state) -> bool:
            return bool(kept) and fails(_with(state, instances=_with_mesh(state.scene, mesh, kept)))

        kept = smallest(range(len(mesh.triangles)), fails_with)
        if len(kept) < len(mesh.triangles):
            state = _with(state, instances=_with_mesh(state.scene, mesh, kept))
    return state


def _with_mesh(scene: Scene, mesh: Mesh, kept: list[int]) -> list[Instance]:
    fewer = with_triangles(mesh, np.array(kept))
    return [replace(i, mesh=fewer) if i.mesh is mesh else i for i in scene.instances]
