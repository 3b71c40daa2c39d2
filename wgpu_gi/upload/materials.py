"""Sends materials to the GPU as records, and their images as two texture atlases: one sRGB-coded, one linear."""

from __future__ import annotations

import numpy as np
import wgpu
from numpy.typing import NDArray

from ..errors import warn_of
from ..gpu.wgsl.load import load
from ..scene.layers import layers_of
from ..scene.scene import Material, Texture
from .layers import is_clear, layer_textures, pack_layers
from .light_values import emitted_radiance
from .mip_levels import Content
from .resources import GpuResources
from .see_through import transmits
from .texture_atlas import Atlas, AtlasImage, Place, atlas_rectangles, pack_atlas

CONSTANTS = load("scene/materials.wgsl").constants
DOUBLE_SIDED, UNLIT, TEXTURED, COATED, BLENDED, LAYERED, GLASS, TRANSMITTING = (
    int(CONSTANTS[flag])
    for flag in ("DOUBLE_SIDED", "UNLIT", "TEXTURED", "COATED", "BLENDED", "LAYERED", "GLASS", "TRANSMITTING")
)
PRESENT, TEXCOORD_1, SIXTEEN_BITS, TRANSFORMED = (
    int(CONSTANTS[flag]) for flag in ("PRESENT", "TEXCOORD_1", "SIXTEEN_BITS", "TRANSFORMED")
)
MAG_NEAREST, MIN_NEAREST, MIP_NEAREST = (int(CONSTANTS[flag]) for flag in ("MAG_NEAREST", "MIN_NEAREST", "MIP_NEAREST"))
WRAP_U_SHIFT, WRAP_V_SHIFT, LEVELS_SHIFT = (
    int(CONSTANTS[shift]) for shift in ("WRAP_U_SHIFT", "WRAP_V_SHIFT", "LEVELS_SHIFT")
)
WRAP_CODES = {"repeat": 0, "clamp": int(CONSTANTS["WRAP_CLAMP"]), "mirror": int(CONSTANTS["WRAP_MIRROR"])}
BASE_COLOR, EMISSION, METALLIC_ROUGHNESS, NORMAL, CLEARCOAT_NORMAL, ANISOTROPY = (
    int(CONSTANTS[f"{slot}_SLOT"])
    for slot in ("BASE_COLOR", "EMISSION", "METALLIC_ROUGHNESS", "NORMAL", "CLEARCOAT_NORMAL", "ANISOTROPY")
)
LAST_SRGB_SLOT = int(CONSTANTS["SHEEN_ROUGHNESS_SLOT"])
CONTENTS: dict[int, Content] = {NORMAL: "normal", CLEARCOAT_NORMAL: "normal"}  # of linear textures; others are data
FORMATS = {"atlas_srgb": "rgba8unorm-srgb", "atlas_linear": "rgba8unorm"}


class MaterialUpload:
    """The resources `materials`, `atlas_srgb` and `atlas_linear`. `diffuse` treats every material as Lambert."""

    def __init__(self, resources: GpuResources, dtype: np.dtype, diffuse: bool) -> None:
        self._resources = resources
        self._dtype = dtype
        self._diffuse = diffuse
        self._images: dict[str, list[AtlasImage]] = {}
        self._atlases: dict[str, Atlas] = {}

    @property
    def has_textures(self) -> bool:
        """Whether any material has a texture that shaders read."""
        return any(self._images.values())

    @property
    def has_deep_maps(self) -> bool:
        """Whether any texture has 16 bits a channel."""
        return any(place.deep for atlas in self._atlases.values() for place in atlas.places.values())

    def send_images(self, materials: list[Material]) -> None:
        """Send an atlas if the set of its images changed. A GiWarning names images that were scaled down."""
        for name in FORMATS:
            # Images are compared by identity: they are immutable once in use.
            images = list(dict.fromkeys(image for m in materials for image, _ in self._textures(m)[name].values()))
            if name not in self._images or images != self._images[name]:
                self._images[name], self._atlases[name] = images, pack_atlas(images)
                self._send_atlas(name, self._atlases[name])

    def _send_atlas(self, name: str, atlas: Atlas) -> None:
        """Create an atlas and copy each image to its place, with its mip levels."""
        gpu = self._resources.gpu
        texture = gpu.create_texture(
            label=f"scene/{name}",
            size=(atlas.page, atlas.page, atlas.layers),
            format=FORMATS[name],
            usage=wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_DST,
        )
        for image, place in atlas.places.items():
            atlas.places[image], rectangles = atlas_rectangles(image, place)
            for (layer, x, y), pixels in rectangles:
                height, width = pixels.shape[:2]
                gpu.queue.write_texture(
                    {"texture": texture, "origin": (x, y, layer)},
                    pixels,
                    {"bytes_per_row": 4 * width, "rows_per_image": height},
                    (width, height, 1),
                )
            _warn_if_scaled(image, place)
        self._resources.set(name, texture)

    def send_records(self, materials: list[Material], pdf: dict[int, float]) -> None:
        """Send the material records if any changed; call after `send_images`.

        `pdf` gives the density of light samples on emitters, 1/m2, by id(material).
        """
        packed = np.zeros(max(len(materials), 1), self._dtype)
        for record, m in zip(packed, materials, strict=False):
            record["base_color"], record["emission"] = m.base_color, emitted_radiance(m)
            record["metallic"], record["roughness"], record["normal_scale"] = m.metallic, m.roughness, m.normal_scale
            record["alpha_cutoff"] = m.alpha_cutoff if m.alpha_mode == "mask" else 0.0
            record["emitter_pdf"] = pdf.get(id(m), 0.0)
            pack_layers(record, m)
            flags = DOUBLE_SIDED * m.double_sided | UNLIT * m.unlit | COATED * (not self._diffuse)
            flags |= BLENDED * (m.alpha_mode == "blend")
            if not self._diffuse:
                flags |= LAYERED * bool(layers_of(m)) | GLASS * is_clear(m) | TRANSMITTING * transmits(m)
            for atlas, textures in self._textures(m).items():
                for slot, (image, texture) in textures.items():
                    flags |= TEXTURED
                    _pack_texture(record["textures"][slot], texture, self._atlases[atlas].places[image])
            record["flags"] = flags
            _pack_tangent(record["textures"])
        self._resources.records("materials", packed)

    def _textures(self, m: Material) -> dict[str, dict[int, tuple[AtlasImage, Texture]]]:
        """Return the textures that shaders read, by the name of their atlas and their slot in the Material struct."""
        masked = m.alpha_mode == "mask" and m.base_color[3] > 0
        cutoff = min(m.alpha_cutoff / m.base_color[3], 2.0) if masked else 0.0  # above 1, no texel passes
        base: Content = "mask" if masked else "blend" if m.alpha_mode == "blend" else "color"
        slots = {BASE_COLOR: m.base_color_texture, EMISSION: m.emission_texture}
        if not self._diffuse:
            slots |= {METALLIC_ROUGHNESS: m.metallic_roughness_texture, NORMAL: m.normal_texture}
            slots |= dict(layer_textures(m))
        found: dict[str, dict[int, tuple[AtlasImage, Texture]]] = {name: {} for name in FORMATS}
        for slot, texture in slots.items():
            if texture is not None:
                is_srgb = slot <= LAST_SRGB_SLOT
                content = base if slot == BASE_COLOR else "color" if is_srgb else CONTENTS.get(slot, "data")
                image = _image(texture, content, cutoff if slot == BASE_COLOR else 0.0)
                found["atlas_srgb" if is_srgb else "atlas_linear"][slot] = (image, texture)
        return found


def _image(texture: Texture, content: Content, cutoff: float) -> AtlasImage:
    """Return the image that the atlas holds for a texture."""
    has_levels = texture.mip_filter != "none"
    return AtlasImage(texture.image, content, texture.wrap_u, texture.wrap_v, has_levels, cutoff)


def _warn_if_scaled(image: AtlasImage, place: Place) -> None:
    """Warn of an image that was scaled down."""
    height, width = image.image.pixels.shape[:2]
    if (place.width, place.height) != (width, height):
        shown = f"texture {image.image.name!r}" if image.image.name else "a texture"
        size = f"{place.width} x {place.height}"
        note = f"{shown}: its {width} x {height} pixels were scaled down to {size}, as textures have limits"
        warn_of([note], stacklevel=4)


def _pack_tangent(slots: NDArray[np.void]) -> None:
    """Give the anisotropy's slot, if it has no texture, the coordinates of the normal map: they give the tangent."""
    anisotropy, normal = slots[ANISOTROPY], slots[NORMAL]
    if not anisotropy["flags"] & PRESENT:
        is_mapped = bool(normal["flags"] & PRESENT)
        anisotropy["flags"] = normal["flags"] & TEXCOORD_1
        anisotropy["transform_u"] = normal["transform_u"] if is_mapped else (1.0, 0.0, 0.0)
        anisotropy["transform_v"] = normal["transform_v"] if is_mapped else (0.0, 1.0, 0.0)


def _pack_texture(slot: NDArray[np.void], texture: Texture, place: Place) -> None:
    """Fill a TextureSlot record of wgsl/scene/materials.wgsl."""
    chain_layer, *chain = place.chain
    pairs = ((place.x, place.y), (place.width, place.height), chain, (place.layer, chain_layer))
    slot["place"] = [low | high << 16 for low, high in pairs]
    wrap = WRAP_CODES[texture.wrap_u] << WRAP_U_SHIFT | WRAP_CODES[texture.wrap_v] << WRAP_V_SHIFT
    minification = texture.min_filter or texture.filter
    filters = MAG_NEAREST * (texture.filter == "nearest") | MIN_NEAREST * (minification == "nearest")
    filters |= MIP_NEAREST * (texture.mip_filter == "nearest")
    # KHR_texture_transform: uv' = translation * rotation * scale * uv
    sine, cosine = np.sin(texture.rotation), np.cos(texture.rotation)
    slot["transform_u"] = (cosine * texture.scale[0], sine * texture.scale[1], texture.offset[0])
    slot["transform_v"] = (-sine * texture.scale[0], cosine * texture.scale[1], texture.offset[1])
    transformed = (*slot["transform_u"], *slot["transform_v"]) != (1, 0, 0, 0, 1, 0)
    flags = PRESENT | TEXCOORD_1 * texture.texcoord | SIXTEEN_BITS * place.deep | TRANSFORMED * transformed
    slot["flags"] = flags | filters | wrap | place.levels << LEVELS_SHIFT
