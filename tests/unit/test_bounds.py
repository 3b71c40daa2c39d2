"""What passes that are left out could add at most: the lemma on bounces, and the largest reflectance of materials."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wgpu_gi.scene.built_in.shapes import box, quad
from wgpu_gi.scene.parts import Texture
from wgpu_gi.scene.scene import Environment, Image, Instance, Material, Scene
from wgpu_gi.techniques.shared import bounds
from wgpu_gi.techniques.shared.bounds import left_out
from wgpu_gi.upload.reflectance import brightest_sky, coated_reflectance, conserves_flux, largest_reflectance


@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
@settings(max_examples=60, deadline=None)
def test_no_closed_room_exceeds_the_bound(seed, kept):
    """Flux between patches of albedos below r, S_(k+1) = A F^T S_k: the share after n scatterings is at most r^n."""
    generator = np.random.default_rng(seed)
    patches = generator.integers(2, 8)
    factors = generator.random((patches, patches)) ** generator.integers(1, 6)
    factors *= generator.random((patches, 1)) / factors.sum(1, keepdims=True)  # the rest leaves the room
    albedo = 0.95 * generator.random(patches)
    flux, total, after = albedo * generator.random(patches), 0.0, 0.0
    for k in range(1, 400):
        total += flux.sum()
        after += flux.sum() if k > kept else 0.0
        flux = albedo * (factors.T @ flux)
    assert after / total <= left_out(albedo.max(), kept) + 1e-9


@pytest.mark.parametrize(
    ("share", "text"), [(0.0, "nothing"), (0.0321, "at most 3.2 %"), (0.78, "at most 78 %"), (1.0, "at most all")]
)
def test_shares_in_words(share, text):
    assert bounds._share(share).startswith(text)


def test_a_furnace_attains_the_bound():
    flux = 0.6 ** np.arange(1, 200)
    assert flux[2:].sum() / flux.sum() == pytest.approx(left_out(0.6, 2))
    assert (left_out(0.0, 1), left_out(1.0, 3)) == (0.0, 1.0)


def scene_of(*materials: Material) -> Scene:
    return Scene([Instance(box((0, 0, 0), (1, 1, 1), material)) for material in materials], [])


def test_lambert_reflects_its_brightest_texel():
    pixels = np.full((2, 2, 4), 128, np.uint8)
    pixels[1, 0, 1] = 188  # sRGB: 0.503
    painted = Material(base_color=(0.5, 0.8, 0.2, 1.0), base_color_texture=Texture(Image(pixels)))
    assert largest_reflectance(scene_of(painted), True) == pytest.approx(0.8 * 0.503, abs=1e-3)
    assert largest_reflectance(scene_of(painted, Material(base_color=(0.1, 0.7, 0.1, 1))), True) == pytest.approx(0.7)
    unlit = Material(base_color=(1, 1, 1, 1), unlit=True)
    assert largest_reflectance(scene_of(unlit), True) == 0.0


def test_coats_reflect_more_at_grazing_angles_and_white_reflects_all():
    rough, smooth = coated_reflectance(0.5, 1.0, 1.0, False), coated_reflectance(0.5, 0.1, 0.1, False)
    assert 0.5 < rough < 0.62 < 0.85 < smooth < 1.0
    assert coated_reflectance(0.5, 0.1, 1.0, False) == pytest.approx(smooth, abs=0.02)
    assert coated_reflectance(1.0, 0.7, 0.7, True) == 1.0
    layered = Material(base_color=(0.2, 0.2, 0.2, 1.0), clearcoat=1.0)
    assert largest_reflectance(scene_of(layered), False) == 1.0
    assert largest_reflectance(scene_of(layered), True) == pytest.approx(0.2)


def test_flux_is_bounded_for_flat_normals_only():
    flat = scene_of(Material())
    assert conserves_flux(flat, False)
    mapped = Material(normal_texture=Texture(Image(np.full((1, 1, 4), 128, np.uint8))))
    assert not conserves_flux(scene_of(mapped), False)
    assert conserves_flux(scene_of(mapped), True)
    mesh = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), Material())
    mesh.normals = np.tile(np.float32([0, 0.1, 0.995]), (len(mesh.positions), 1))
    assert not conserves_flux(Scene([Instance(mesh)], []), False)


def test_the_brightest_sky_is_that_of_its_image():
    image = np.ones((2, 4, 3), np.float32)
    image[0, 1] = 1, 7, 2
    assert brightest_sky(Environment((1.0, 0.5, 2.0), image)) == pytest.approx(4.0)
    assert brightest_sky(Environment((1.0, 0.5, 2.0))) == 2.0
    assert brightest_sky(None) == 0.0
