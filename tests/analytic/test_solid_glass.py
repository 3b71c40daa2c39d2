"""Solid glass in the path tracer: absorption, refraction of radiance, a furnace, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.pictures import looking

import wgpu_gi as gi
from wgpu_gi.scene.built_in.shapes import box
from wgpu_gi.scene.scene import Environment, Instance, Material, Scene

COLOR = np.array([0.2, 0.5, 0.8])  # what 1 m leaves


def glass(ior):
    return Material(
        metallic=0.0, roughness=0.0, transmission=1.0, thickness=1.0, ior=ior,
        attenuation_distance=1.0, attenuation_color=tuple(COLOR),
    )  # fmt: skip


def seen(sky, ior, *others):
    """Return the mean radiance of a block of glass, 0.5 m thick, seen straight on."""
    block = box((-1, -1, 0), (1, 1, 0.5), glass(ior))
    camera = looking((0, 0, -1), (0, 0, 3), height=0.2)
    scene = Scene([Instance(block), *map(Instance, others)], [], Environment((sky,) * 3), [camera])
    return np.asarray(gi.render(scene, gi="path", size=(8, 8), spp=64, bounces=16)).mean((0, 1))


def test_equal_media_only_absorb():
    assert seen(1.0, 1.0) == pytest.approx(COLOR**0.5, rel=2e-3)


def test_glass_reflects_passes_and_absorbs():
    """A slab: R + T = F + (1 - F)^2 a (1 + F a) / (1 - F^2 a^2), a the share that one crossing leaves."""
    f, a = 0.04, COLOR**0.5
    assert seen(1.0, 1.5) == pytest.approx(f + (1 - f) ** 2 * a * (1 + f * a) / (1 - f * f * a * a), rel=5e-3)


def test_radiance_leaves_glass_by_the_square_of_the_index():
    """A black lamp 0.25 m deep in the glass: L (1 - F) / n^2, absorbed once."""
    lamp = box((-0.9, -0.9, 0.1), (0.9, 0.9, 0.25), Material(base_color=(0, 0, 0, 1), specular=0.0, emission=(1, 1, 1)))
    assert seen(0.0, 1.5, lamp) == pytest.approx(COLOR**0.25 * 0.96 / 1.5**2, rel=5e-3)
