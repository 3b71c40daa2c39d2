"""The parts of a scene as plain data: meshes, materials, instances, lights and environment, with units.

World space is right-handed with Y up, in metres; colours are linear Rec.709; units are physical, as in glTF. Objects
may be changed between frames: `upload/` sends what changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import GiError
from ..records import KnownAttributes

Wrap = Literal["repeat", "clamp", "mirror"]
Filter = Literal["linear", "nearest"]


@dataclass(eq=False, repr=False, slots=True)
class Image(KnownAttributes):
    """Pixels (height, width, 4) RGBA, row 0 on top, uint8 or uint16. Treated as immutable once in use.

    Only normal maps keep more than 8 bits on the GPU.
    """

    pixels: NDArray[Any]
    name: str = ""

    @property
    def eight_bit(self) -> NDArray[np.uint8]:
        """The pixels as uint8, the high bytes of 16-bit ones."""
        if self.pixels.dtype == np.uint16:
            return (self.pixels >> 8).astype(np.uint8)
        return self.pixels


@dataclass(eq=False, repr=False, slots=True)
class Texture(KnownAttributes):
    """An image, its sampler and its transform on the surface (glTF texture, sampler, KHR_texture_transform).

    `filter` enlarges the image, `min_filter` (None: the same) makes it smaller, within a mip level; `mip_filter` blends
    two levels, takes the nearer, or always reads the finest ("none").
    """

    image: Image
    wrap_u: Wrap = "repeat"
    wrap_v: Wrap = "repeat"
    filter: Filter = "linear"
    min_filter: Filter | None = None
    mip_filter: Literal["linear", "nearest", "none"] = "linear"
    texcoord: Literal[0, 1] = 0
    offset: tuple[float, float] = (0.0, 0.0)
    scale: tuple[float, float] = (1.0, 1.0)
    rotation: float = 0.0  # radians, counter-clockwise, as KHR_texture_transform


@dataclass(eq=False, repr=False, slots=True)
class Material(KnownAttributes):
    """glTF metallic-roughness material with Khronos' extensions. Colours are linear; factors multiply their textures.

    `emission` is radiance in W/(m2 sr) (emissiveFactor times emissiveStrength). Emitters shine from the
    counter-clockwise side, from both when `double_sided`; all surfaces reflect on both sides.

    Alpha mode "mask" cuts out what is below `alpha_cutoff`, "blend" lets light through by 1 - alpha. Names and meanings
    of the layers are those of KHR_materials_ior, specular, clearcoat, sheen, transmission, volume and anisotropy.
    """

    name: str = ""
    base_color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    metallic: float = 0.0
    roughness: float = 1.0
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    alpha_mode: Literal["opaque", "mask", "blend"] = "opaque"
    alpha_cutoff: float = 0.5
    double_sided: bool = False
    unlit: bool = False  # KHR_materials_unlit: radiance is base_color, and no light is reflected
    normal_scale: float = 1.0
    ior: float = 1.5  # index of refraction, at least 1; 0 stands for infinity
    specular: float = 1.0  # scales the reflection of dielectrics
    specular_color: tuple[float, float, float] = (1.0, 1.0, 1.0)  # tints it at normal incidence
    clearcoat: float = 0.0  # share of the surface under a clear coat
    clearcoat_roughness: float = 0.0
    clearcoat_normal_scale: float = 1.0
    sheen_color: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sheen_roughness: float = 0.0
    transmission: float = 0.0  # share of the light past the specular reflection that passes instead of being scattered
    thickness: float = 0.0  # metres in the mesh's space; 0: a thin wall, without refraction
    attenuation_distance: float | None = None  # metres after which white light has `attenuation_color`; None: infinite
    attenuation_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    anisotropy: float = 0.0  # 0 to 1, how much the reflection is stretched along its direction
    anisotropy_rotation: float = 0.0  # radians, counter-clockwise from the tangent
    base_color_texture: Texture | None = None  # sRGB colour, linear alpha
    metallic_roughness_texture: Texture | None = None  # linear: G roughness, B metallic
    normal_texture: Texture | None = None  # linear, tangent space
    occlusion_texture: Texture | None = None  # loaded, but not used: occlusion is computed
    emission_texture: Texture | None = None  # sRGB colour
    specular_texture: Texture | None = None  # linear: A
    specular_color_texture: Texture | None = None  # sRGB colour
    clearcoat_texture: Texture | None = None  # linear: R
    clearcoat_roughness_texture: Texture | None = None  # linear: G
    clearcoat_normal_texture: Texture | None = None  # linear, tangent space
    sheen_color_texture: Texture | None = None  # sRGB colour
    sheen_roughness_texture: Texture | None = None  # linear: A
    transmission_texture: Texture | None = None  # linear: R
    thickness_texture: Texture | None = None  # linear: G; loaded, but not used: rays find the way through solids
    anisotropy_texture: Texture | None = None  # linear: RG direction, B strength


@dataclass(eq=False, repr=False, slots=True)
class MorphTarget(KnownAttributes):
    """Displacements (n, 3) float32 of a mesh's vertices, times a weight; None for what the target leaves alone."""

    positions: NDArray[np.float32] | None = None
    normals: NDArray[np.float32] | None = None
    tangents: NDArray[np.float32] | None = None
    name: str = ""


@dataclass(eq=False, repr=False, slots=True)
class Skin(KnownAttributes):
    """Which joints move each vertex: `joints` (n, k) uint16 or uint32, `weights` (n, k) float32; rows sum to 1."""

    joints: NDArray[Any]
    weights: NDArray[np.float32]


@dataclass(eq=False, repr=False, slots=True)
class Mesh(KnownAttributes):
    """An indexed triangle mesh in its local space; its arrays are treated as immutable once in use.

    positions (n, 3) float32; triangles (m, 3) uint32; material_of_triangle (m,) uint32 into `materials`.
    normals (n, 3) float32: a zero row selects the geometric (flat) normal. tangents (n, 4) float32, w = +-1, or zero
    rows for none. texcoords (n, 2) float32, v pointing down as in glTF. colors (n, 4) float32, linear. With a skin or
    morph targets, positions, normals and tangents are those of the bind pose; `posed_mesh` moves them.
    """

    positions: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    materials: list[Material] = field(default_factory=lambda: [Material()])
    material_of_triangle: NDArray[np.uint32] | None = None  # None: all triangles have materials[0]
    normals: NDArray[np.float32] | None = None
    tangents: NDArray[np.float32] | None = None
    texcoords0: NDArray[np.float32] | None = None
    texcoords1: NDArray[np.float32] | None = None
    colors: NDArray[np.float32] | None = None
    name: str = ""
    skin: Skin | None = None
    morph_targets: list[MorphTarget] = field(default_factory=list)


@dataclass(eq=False, repr=False, slots=True)
class Instance(KnownAttributes):
    """A mesh placed in the world by an affine (4, 4) float64 matrix, which may mirror it.

    `joint_matrices` (j, 4, 4) float64, local_from_bind of each joint, pose a mesh with a skin; None: the bind pose.
    `morph_weights` has a weight for each morph target; absent ones are 0. A vertex p of the mesh stands at
    world_from_local @ sum_i weights_i joint_matrices[joints_i] @ (p + sum_t morph_weights[t] morph_targets[t]).
    """

    mesh: Mesh
    world_from_local: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    name: str = ""
    joint_matrices: NDArray[np.float64] | None = None
    morph_weights: tuple[float, ...] = ()


@dataclass(eq=False, repr=False, slots=True)
class PointLight(KnownAttributes):
    """KHR_lights_punctual point: `intensity` in candela (W/sr), times `color`. E = I cos / d2.

    `range` (metres) limits the light only if a setting asks for it, since physical light has no range.
    """

    position: Sequence[float]
    intensity: float = 1.0
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    range: float | None = None
    name: str = ""


@dataclass(eq=False, repr=False, slots=True)
class SpotLight(KnownAttributes):
    """KHR_lights_punctual spot: a point light times saturate((cos - cos_outer)/(cos_inner - cos_outer))^2."""

    position: Sequence[float]
    direction: Sequence[float]  # direction of travel, any length
    inner_cone_angle: float = 0.0  # radians, half angles
    outer_cone_angle: float = np.pi / 4
    intensity: float = 1.0
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    range: float | None = None
    name: str = ""


@dataclass(eq=False, repr=False, slots=True)
class DirectionalLight(KnownAttributes):
    """KHR_lights_punctual directional: `intensity` in lux (W/m2 on a plane facing the light), times `color`."""

    direction: Sequence[float]  # direction of travel, any length
    intensity: float = 1.0
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    name: str = ""


Light = PointLight | SpotLight | DirectionalLight


def values_of(part: Light | Texture) -> dict[str, Any]:
    """Return the values of the fields of a light or a texture by name."""
    return {field.name: getattr(part, field.name) for field in fields(part)}


@dataclass(eq=False, repr=False, slots=True)
class Environment(KnownAttributes):
    """Light from infinitely far away: radiance `color`, times an equirectangular `image` if there is one.

    `image` is (height, width, 3) float32 linear radiance, row 0 on top; u = atan2(x, -z)/2pi + rotation/2pi (so -Z is
    at the left edge, +X at 1/4), v = acos(y)/pi.
    """

    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    image: NDArray[np.float32] | None = None
    rotation: float = 0.0  # radians about +Y
    name: str = ""

    def __post_init__(self) -> None:
        if isinstance(self.color, (str, PathLike)):
            hint = f"gi.load_environment({str(self.color)!r}) reads a file"
            raise GiError(f"an Environment takes a colour and an array; {hint}")
