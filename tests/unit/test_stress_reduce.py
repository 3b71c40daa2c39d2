"""Reduction: what is left of a scene that fails for a known reason."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.measure.stress.reduce import State, reduced, smallest
from wgpu_gi.scene.built_in.scenes import matte
from wgpu_gi.scene.built_in.shapes import grid, sphere
from wgpu_gi.scene.scene import Environment, Image, Instance, Material, PointLight, Scene, Texture


@pytest.mark.parametrize("guilty", [{3}, {0, 99}, {5, 6, 7, 50}, set(range(10))])
def test_smallest_finds_exactly_what_is_needed(guilty):
    calls = []

    def fails(kept):
        calls.append(len(kept))
        return guilty <= set(kept)

    assert set(smallest(range(100), fails)) == guilty
    assert len(calls) < 400


def test_smallest_of_what_always_fails_is_nothing():
    assert smallest([1, 2, 3], lambda kept: True) == []


def crowd():
    """Twelve objects, six lights, textures, a sky: the fault needs a metal and a blue light."""
    texture = Texture(Image(np.full((2, 2, 4), 200, np.uint8)))
    metal = Material("metal", (0.9, 0.2, 0.3, 1.0), 0.7, 0.3, base_color_texture=texture, normal_texture=texture)
    instances = [Instance(grid(4.0, 4, matte(0.4))) for _ in range(11)]
    instances.insert(5, Instance(sphere(material=metal, subdivisions=1)))
    lights = [PointLight((1.2345, 2.3456, k), 12.3456, (0.2, 0.3, 1.0 if k == 3 else 0.1)) for k in range(6)]
    return Scene(instances, lights, Environment((0.3, 0.2, 0.1)))


def test_a_scene_is_reduced_to_its_fault():
    def fails(state):
        metal = [i for i in state.scene.instances if any(m.metallic > 0.5 for m in i.mesh.materials)]
        return bool(metal) and any(light.color[2] > 0.9 for light in state.scene.lights)

    before = crowd()
    state = reduced(State(before, (64, 36)), fails)
    (instance,), (light,) = state.scene.instances, state.scene.lights
    (material,) = instance.mesh.materials
    assert fails(state) and state.size == (16, 9)
    assert len(instance.mesh.triangles) == 1 and state.scene.environment is None
    assert material.base_color_texture is None and material.normal_texture is None and material.roughness == 1.0
    assert light.intensity == 10.0 and light.position[:2] == (1.0, 2.0)
    # The scene itself stays as it was.
    assert len(before.instances) == 12 and before.instances[5].mesh.materials[0].roughness == 0.3


def test_reduction_ends_in_time():
    state = State(crowd(), (64, 36))
    assert reduced(state, lambda candidate: True, seconds=0.0) == state
