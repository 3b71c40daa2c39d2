"""Sends materials to the GPU as records, and their images as two texture atlases: one sRGB-coded, one linear."""

from __future__ import annotations

import numpy as np
import wgpu
from numpy.typing import NDArray

from ..errors import warn_of
from ..gpu.wgsl.load import load
from ..scene.scene import Image, Material, Texture
from .light_values import emitted_radiance
from .resources import GpuResources
from .texture_atlas import Atlas, atlas_pixels, pack_atlas

CONSTANTS = load("scene/materials.wgsl").constants
DOUBLE_SIDED, UNLIT, TEXTURED, COATED = (
    int(CONSTANTS[flag]) for flag in ("DOUBLE_SIDED", "UNLIT", "TEXTURED", "COATED")
)
PRESENT, TEXCOORD_1, NEAREST, SIXTEEN_BITS = (
    int(CONSTANTS[flag]) for flag in ("PRESENT", "TEXCOORD_1", "NEAREST", "SIXTEEN_BITS")
)
WRAP_CODES = {"repeat": 0, "clamp": int(CONSTANTS["WRAP_CLAMP"]), "mirror": int(CONSTANTS["WRAP_MIRROR"])}


class MaterialUpload:
    """The resources `materials`, `atlas_srgb` and `atlas_linear`. `diffuse` treats every material as Lambert."""

    def __init__(self, resources: GpuResources, dtype: np.dtype, diffuse: bool) -> None:
        self._resources = resources
        self._dtype = dtype
        self._diffuse = diffuse
        self._images: dict[str, list[Image]] = {}
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
        gpu = self._resources.gpu
        for name, texture_format in (("atlas_srgb", "rgba8unorm-srgb"), ("atlas_linear", "rgba8unorm")):
            # Compare images by identity: they are immutable once in use.
            used = [t.image for m in materials for t in self._textures(m)[name].values()]
            images = list({id(i): i for i in used}.values())
            if name in self._images and [id(i) for i in images] == [id(i) for i in self._images[name]]:
                continue
            # Pack them and copy each to its place.
            deep = {id(m.normal_texture.image) for m in materials if m.normal_texture is not None}
            deep &= {id(image) for image in images if image.pixels.dtype == np.uint16}
            self._images[name], atlas = images, pack_atlas(images, deep)
            self._atlases[name] = atlas
            texture = gpu.create_texture(
                label=f"scene/{name}",
                size=(atlas.page, atlas.page, atlas.layers),
                format=texture_format,
                usage=wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_DST,
            )
            for image in images:
                place = atlas.places[id(image)]
                pixels = atlas_pixels(image, place, srgb=name == "atlas_srgb")
                gpu.queue.write_texture(
                    {"texture": texture, "origin": (place.x, place.y, place.layer)},
                    pixels,
                    {"bytes_per_row": 4 * place.width, "rows_per_image": len(pixels)},
                    (place.width, len(pixels), 1),
                )
                height, width = image.pixels.shape[:2]
                if (place.width, place.height) != (width, height):
                    shown = f"texture {image.name!r}" if image.name else "a texture"
                    size = f"{place.width} x {place.height}"
                    note = f"{shown}: its {width} x {height} pixels were scaled down to {size}, as textures have limits"
                    warn_of([note], stacklevel=2)
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
            flags = DOUBLE_SIDED * m.double_sided | UNLIT * m.unlit | COATED * (not self._diffuse)
            for atlas, textures in self._textures(m).items():
                for slot, texture in textures.items():
                    flags |= TEXTURED
                    _pack_texture(record["textures"][slot], texture, self._atlases[atlas])
            record["flags"] = flags
        self._resources.records("materials", packed)

    def _textures(self, m: Material) -> dict[str, dict[int, Texture]]:
        """Return the textures that shaders read, by the name of their atlas and their slot in the Material struct."""
        slots: dict[str, dict[int, Texture | None]] = {
            "atlas_srgb": {0: m.base_color_texture, 1: m.emission_texture},
            "atlas_linear": {} if self._diffuse else {2: m.metallic_roughness_texture, 3: m.normal_texture},
        }
        return {atlas: {k: t for k, t in textures.items() if t is not None} for atlas, textures in slots.items()}


def _pack_texture(slot: NDArray[np.void], texture: Texture, atlas: Atlas) -> None:
    """Fill a TextureSlot record of wgsl/scene/materials.wgsl."""
    place = atlas.places[id(texture.image)]
    slot["corner"], slot["size"], slot["layer"] = (place.x, place.y), (place.width, place.height), place.layer
    wrap = WRAP_CODES[texture.wrap_u] << 4 | WRAP_CODES[texture.wrap_v] << 6
    flags = PRESENT | TEXCOORD_1 * texture.texcoord | NEAREST * (texture.filter == "nearest")
    slot["flags"] = flags | SIXTEEN_BITS * place.deep | wrap
    # KHR_texture_transform: uv' = translation * rotation * scale * uv
    sine, cosine = np.sin(texture.rotation), np.cos(texture.rotation)
    slot["transform_u"] = (cosine * texture.scale[0], sine * texture.scale[1], texture.offset[0])
    slot["transform_v"] = (-sine * texture.scale[0], cosine * texture.scale[1], texture.offset[1])
