"""Upper bounds of what a scene's surfaces reflect: the largest share of light, and the brightest reflection of the sky.

Both bound `wgsl/common/base.wgsl`. The directional albedo of a material of colour c is at most

    dielectric: A(0.04) + (1 - A(0.04)) c      metal: A(c) + (1 - A(1)) <F>,  <F> = (20 c + 1) / 21

A(F0): the single-scattering albedo of the GGX lobe with Schlick's Fresnel term, integrated over visible normals (Heitz
2018, "Sampling the GGX Distribution of Visible Normals"). A metalness between 0 and 1 mixes both. Materials with more
layers count as white.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..pictures.color import LINEAR_OF_CODE
from ..scene.layers import layers_of
from ..scene.scene import Environment, Image, Material, Mesh, Scene

DIELECTRIC_F0 = 0.04
FIT_ERROR = 0.0025  # of the fits of `wgsl/common/coat_albedo.wgsl`
LEAST_ALPHA = 1e-3
ALPHAS = 12  # widths of the lobe tried between the least and the largest roughness
COSINES, DRAWS = 64, 32  # the quadrature: directions, and visible normals along each axis
FLAT = 1e-3  # length of the difference of a flat normal and that of its triangle


def largest_reflectance(scene: Scene, diffuse: bool) -> float:
    """Return the largest directional albedo of any surface, 0 to 1, over its channels, texels and directions.

    diffuse: every material counts as Lambert.
    """
    found = 0.0
    for mesh in scene.meshes:
        tint = 1.0 if mesh.colors is None or not mesh.colors.size else float(mesh.colors[:, :3].max())
        found = max([found, *(_reflectance(m, diffuse, tint) for m in mesh.materials if not m.unlit)])
    return min(found, 1.0)


def conserves_flux(scene: Scene, diffuse: bool) -> bool:
    """Return whether surfaces reflect at most their albedo of the flux that reaches them.

    Shading normals other than those of the triangles keep a surface's radiance below the albedo, but not its flux.
    """
    if not diffuse and any(m.normal_texture is not None for m in scene.materials):
        return False
    return all(map(_is_flat, scene.meshes))


def brightest_sky(environment: Environment | None) -> float:
    """Return the largest radiance of the environment, W/(m2 sr), over channels and directions; 0 without one."""
    if environment is None:
        return 0.0
    color = np.asarray(environment.color, np.float64)
    texels = 1.0 if environment.image is None else environment.image[..., :3].reshape(-1, 3).max(0)
    return float((color * texels).max())


def _reflectance(m: Material, diffuse: bool, tint: float) -> float:
    """Return the largest directional albedo of a material; `tint`: the largest vertex colour."""
    texel = 1.0 if m.base_color_texture is None else brightest_texel(m.base_color_texture.image)
    color = min(max(m.base_color[:3]) * texel * tint, 1.0)
    if diffuse:
        return color
    if layers_of(m):
        return 1.0
    # A texture may make the roughness anything below the factor, and the metalness, too.
    least = 0.0 if m.metallic_roughness_texture is not None else m.roughness
    return coated_reflectance(color, least, m.roughness, m.metallic > 0)


def brightest_texel(image: Image) -> float:
    """Return the linear value of the brightest channel of a colour texture; filters do not exceed it."""
    return float(LINEAR_OF_CODE[image.eight_bit[..., :3].max()])


def coated_reflectance(color: float, least: float, most: float, metallic: bool) -> float:
    """Return the largest directional albedo of a coated surface whose roughness lies between `least` and `most`."""
    found = 0.0
    for roughness in np.linspace(least, most, 1 if least == most else ALPHAS):
        white, edge = _lobe_albedo(max(float(roughness) ** 2, LEAST_ALPHA))
        coat = DIELECTRIC_F0 * white + (1.0 - DIELECTRIC_F0) * edge
        albedo = coat + (1.0 - coat) * color
        if metallic:
            fresnel = (20.0 * color + 1.0) / 21.0
            metal = color * white + (1.0 - color) * edge + (1.0 - white) * fresnel
            albedo = np.maximum(albedo, metal)
        found = max(found, float(albedo.max()))
    return min(found + FIT_ERROR, 1.0)


@cache
def _lobe_albedo(alpha: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the albedo of a GGX lobe by direction: of a white one, and the part of (1 - v.h)^5 alone.

    The albedo with F0 is F0 * white + (1 - F0) * edge.
    """
    cosine = ((np.arange(COSINES) + 0.5) / COSINES) ** 2  # denser towards grazing angles
    v = np.stack([np.sqrt(1.0 - cosine**2), np.zeros(COSINES), cosine], -1)[:, None, :]
    # Visible normals at the midpoints of a grid of the unit square (Heitz 2018, appendix A).
    u, w = (np.stack(np.meshgrid(*[(np.arange(DRAWS) + 0.5) / DRAWS] * 2), -1).reshape(-1, 2)).T
    stretched = v * (alpha, alpha, 1.0)
    stretched = stretched / np.linalg.norm(stretched, axis=-1, keepdims=True)
    across = np.broadcast_to((0.0, 1.0, 0.0), stretched.shape)
    along = np.cross(stretched, across)
    radius, angle = np.sqrt(u), 2.0 * np.pi * w
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    share = 0.5 * (1.0 + stretched[..., 2])
    y_ = (1.0 - share) * np.sqrt(np.maximum(1.0 - x**2, 0.0)) + share * y
    height = np.sqrt(np.maximum(1.0 - x**2 - y_**2, 0.0))
    h = x[..., None] * across + y_[..., None] * along + height[..., None] * stretched
    h = h * (alpha, alpha, 1.0)
    h[..., 2] = np.maximum(h[..., 2], 1e-9)
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    # Smith's height-correlated masking: G2 / G1.
    vh = np.clip((v * h).sum(-1), 0.0, 1.0)
    reflected = 2.0 * vh * h[..., 2] - v[..., 2]
    a, b = _masking(v[..., 2], alpha), _masking(np.maximum(reflected, 1e-9), alpha)
    weight = np.where(reflected > 0.0, (1.0 + a) / (1.0 + a + b), 0.0)
    return weight.mean(-1), (weight * (1.0 - vh) ** 5).mean(-1)


def _masking(cosine: NDArray[np.float64], alpha: float) -> NDArray[np.float64]:
    """Return Smith's Lambda of GGX."""
    tangent = (1.0 - cosine**2) / cosine**2
    return 0.5 * (np.sqrt(1.0 + alpha**2 * tangent) - 1.0)


def _is_flat(mesh: Mesh) -> bool:
    """Return whether all shading normals are those of the triangles."""
    if mesh.skin is not None or mesh.morph_targets:
        return False
    if mesh.normals is None or not mesh.normals.any():
        return True
    corners = mesh.positions[mesh.triangles].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=-1)
    given = mesh.normals[mesh.triangles[length > 0]].astype(np.float64)
    flat = (normals[length > 0] / length[length > 0, None])[:, None, :]
    scale = np.linalg.norm(given, axis=-1, keepdims=True)
    off = np.where(scale > 0, given / np.maximum(scale, 1e-30) - flat, 0.0)
    return bool((np.linalg.norm(off, axis=-1) < FLAT).all())
