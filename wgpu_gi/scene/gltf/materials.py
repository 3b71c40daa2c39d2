"""Materials, textures and samplers of a glTF file: metallic-roughness, and the extensions in SUPPORTED_EXTENSIONS."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, Literal

from ...float_limits import LARGEST_FACTOR, LARGEST_LIGHT
from ..files.image_files import has_basisu
from ..scene import Filter, Image, Material, Texture, Wrap
from .accessors import Accessors
from .document import Document
from .images import Images
from .json_object import JsonObject
from .layers import CLEARCOAT_NORMAL, layer_infos, read_layers
from .specular_glossiness import SpecularGlossiness, Surface

_WRAPS: dict[int, Wrap] = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_MAG_FILTERS: dict[int, Filter] = {9728: "nearest", 9729: "linear"}
_MIN_FILTERS: dict[int, tuple[Filter, Literal["linear", "nearest", "none"]]] = {
    9728: ("nearest", "none"),
    9729: ("linear", "none"),
    9984: ("nearest", "nearest"),
    9985: ("linear", "nearest"),
    9986: ("nearest", "linear"),
    9987: ("linear", "linear"),
}
_ALPHA_MODES: dict[str, Literal["opaque", "mask", "blend"]] = {"OPAQUE": "opaque", "MASK": "mask", "BLEND": "blend"}
_SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
_SPECULAR_GLOSSINESS_TEXTURES = ("diffuseTexture", "specularGlossinessTexture")
_REFLECTION_EXTENSIONS = ("KHR_materials_ior", "KHR_materials_specular")  # excluded by specular-glossiness
_IMAGE_EXTENSIONS = ("KHR_texture_basisu", "EXT_texture_avif", "EXT_texture_webp")
_NORMALS = ("normalTexture", CLEARCOAT_NORMAL)
_DATA = (  # the others hold sRGB colours, or alpha alone
    *_NORMALS,
    "metallicRoughnessTexture",
    "occlusionTexture",
    "clearcoatTexture",
    "clearcoatRoughnessTexture",
    "transmissionTexture",
    "thicknessTexture",
    "anisotropyTexture",
)
_TEXCOORDS: dict[int, Literal[0, 1]] = {0: 0, 1: 1}


class Materials:
    """The materials of a document by index; each is read once and shared by all meshes that use it."""

    def __init__(self, document: Document, accessors: Accessors) -> None:
        self._document = document
        self._descriptions = document.array("materials")
        self._textures = document.array("textures")
        self._images = Images(document, accessors)
        self._specular_glossiness = SpecularGlossiness(document.budget)
        self._materials: dict[int | None, Material] = {}
        self._copies: list[tuple[int | None, Material]] = []

    def __len__(self) -> int:
        return len(self._descriptions)

    def load(self, indices: Iterable[int | None]) -> None:
        """Read the materials `indices`, with their images; None is glTF's default material."""
        wanted = [(index, self._descriptions[index]) for index in sorted({i for i in indices if i is not None})]
        self._load_images([material for _, material in wanted])
        # The default material (glTF 2.0, 3.9.7) is white, rough and metallic.
        self._materials[None] = Material(metallic=1.0)
        for index, description in wanted:
            self._materials[index] = self._read(description)
        names = {index: description.text("name") or f"materials[{index}]" for index, description in wanted}
        converted = [names[index] for index, description in wanted if description.extension(_SPECULAR_GLOSSINESS)]
        if converted:
            self._document.notes.add(f"Specular-glossiness was converted to metallic roughness, in {some(converted)}.")

    def _load_images(self, materials: list[JsonObject]) -> None:
        """Load the images of materials; of a texture with several, the next one where one cannot be read."""
        infos = [item for material in materials for item in _texture_infos(material).items()]
        choices = [(slot, self._choices(info)) for slot, info in infos]
        colors = {index for slot, indices in choices if slot not in _DATA for index in indices}
        normals = {index for slot, indices in choices if slot in _NORMALS for index in indices}
        missing = [indices for _, indices in choices if indices]
        while missing:
            self._images.load({indices[0] for indices in missing}, colors, normals)
            missing = [indices[1:] for indices in missing if self._images.get(indices[0]) is None and indices[1:]]

    def get(self, index: int | None) -> Material:
        """Return material `index`, which must have been loaded."""
        return self._materials[index]

    def copy_for_points(self, index: int | None) -> Material:
        """Return a new material `index` that does not glow, since each triangle of a point would be a light."""
        material = replace(self._materials[index], emission=(0.0, 0.0, 0.0), emission_texture=None)
        self._copies.append((index, material))
        return material

    def loaded(self) -> list[tuple[int, Material]]:
        """Return the index of each material of the file that was loaded, and the material; then the copies."""
        return [(i, material) for i, material in [*self._materials.items(), *self._copies] if i is not None]

    def _read(self, source: JsonObject) -> Material:
        """Return the material that a glTF material describes."""
        pbr = source.child("pbrMetallicRoughness")
        strength = source.extension_or_empty("KHR_materials_emissive_strength")
        gain = strength.number("emissiveStrength", 1.0, low=0.0, high=LARGEST_LIGHT)
        red, green, blue = source.vector("emissiveFactor", (0.0, 0.0, 0.0), low=0.0, high=LARGEST_LIGHT)
        emission = (red * gain, green * gain, blue * gain)
        if max(emission) > LARGEST_LIGHT:
            source.damage(f"emissiveFactor times emissiveStrength must be at most {LARGEST_LIGHT:g}; it was limited")
            emission = (
                min(emission[0], LARGEST_LIGHT),
                min(emission[1], LARGEST_LIGHT),
                min(emission[2], LARGEST_LIGHT),
            )
        alpha_mode = source.choice("alphaMode", _ALPHA_MODES, "OPAQUE")
        infos = _texture_infos(source)
        normal = infos.get("normalTexture", source.empty())
        textures = {slot: self._texture(info) for slot, info in infos.items()}
        extension = source.extension(_SPECULAR_GLOSSINESS)
        if extension is None:
            surface = self._metallic_roughness(pbr, textures)
        else:
            diffuse, specular = (textures.get(slot) for slot in _SPECULAR_GLOSSINESS_TEXTURES)
            surface = self._specular_glossiness.convert(extension, diffuse, specular)
            for name in _REFLECTION_EXTENSIONS:
                if source.extension(name) is not None:
                    source.damage(f"{name} excludes {_SPECULAR_GLOSSINESS}; it was left out")
        red, green, blue, alpha = surface.base_color
        return Material(
            name=source.text("name"),
            base_color=(red, green, blue, alpha),
            metallic=surface.metallic,
            roughness=surface.roughness,
            emission=emission,
            alpha_mode=alpha_mode,
            alpha_cutoff=min(source.number("alphaCutoff", 0.5, low=0.0), 2.0) if alpha_mode == "mask" else 0.5,
            double_sided=source.flag("doubleSided"),
            unlit=source.extension("KHR_materials_unlit") is not None,
            normal_scale=normal.number("scale", 1.0, -LARGEST_FACTOR, LARGEST_FACTOR),
            base_color_texture=surface.base_color_texture,
            metallic_roughness_texture=surface.metallic_roughness_texture,
            normal_texture=textures.get("normalTexture"),
            occlusion_texture=textures.get("occlusionTexture"),
            emission_texture=textures.get("emissiveTexture"),
            **read_layers(source, textures, () if extension is None else _REFLECTION_EXTENSIONS),
            **({} if surface.specular_color is None else _reflecting(surface)),
        )

    def _metallic_roughness(self, pbr: JsonObject, textures: dict[str, Texture | None]) -> Surface:
        """Return the surface that pbrMetallicRoughness describes."""
        return Surface(
            tuple(self._fractions(pbr, "baseColorFactor", pbr.vector("baseColorFactor", (1.0,) * 4, low=0.0))),
            self._fractions(pbr, "metallicFactor", [pbr.number("metallicFactor", 1.0, low=0.0)])[0],
            self._fractions(pbr, "roughnessFactor", [pbr.number("roughnessFactor", 1.0, low=0.0)])[0],
            textures.get("baseColorTexture"),
            textures.get("metallicRoughnessTexture"),
        )

    def _fractions(self, pbr: JsonObject, key: str, values: Sequence[float]) -> list[float]:
        """Return `values` limited to 1, above which a surface would reflect more light than it receives."""
        if max(values) > 1.0:
            self._document.notes.add(f"{pbr.where}: {key} is above 1; it was set to 1.")
        return [min(value, 1.0) for value in values]

    def _texture(self, info: JsonObject) -> Texture | None:
        """Return the texture of a textureInfo; None, with a note, if it cannot be used."""
        images = (self._images.get(index) for index in self._choices(info) if self._images.has(index))
        image = next((image for image in images if image is not None), None)
        if image is None:
            return None
        with self._document.leaving_out("the texture"):
            return self._texture_of(info, image)
        return None

    def _texture_of(self, info: JsonObject, image: Image) -> Texture | None:
        """Return the texture of a textureInfo and its image; None, with a note, if it cannot be used."""
        transform = info.extension_or_empty("KHR_texture_transform")
        texcoord = transform.integer("texCoord", info.integer("texCoord", 0))
        if texcoord not in _TEXCOORDS:
            self._document.notes.add(
                f"{info.where} was left out: it uses texture coordinate set {texcoord}; only 0 and 1 are supported."
            )
            return None
        offset = transform.vector("offset", (0.0, 0.0), -LARGEST_FACTOR, LARGEST_FACTOR)
        scale = transform.vector("scale", (1.0, 1.0), -LARGEST_FACTOR, LARGEST_FACTOR)
        sampler = self._sampler(self._textures[info.index("index", len(self._textures), "textures")])
        magnification = sampler.choice("magFilter", _MAG_FILTERS, 9729)
        # Without a filter for minification, the choice is ours: as for magnification, with mip levels.
        default = 9986 if magnification == "nearest" else 9987
        minification, mip_filter = sampler.choice("minFilter", _MIN_FILTERS, default)
        return Texture(
            image=image,
            wrap_u=sampler.choice("wrapS", _WRAPS, 10497),
            wrap_v=sampler.choice("wrapT", _WRAPS, 10497),
            filter=magnification,
            min_filter=None if minification == magnification else minification,
            mip_filter=mip_filter,
            texcoord=_TEXCOORDS[texcoord],
            offset=(offset[0], offset[1]),
            scale=(scale[0], scale[1]),
            rotation=transform.number("rotation", 0.0),
        )

    def _sampler(self, texture: JsonObject) -> JsonObject:
        """Return the sampler of a texture, an empty object if it has none."""
        samplers = self._document.array("samplers")
        index = texture.optional_index("sampler", len(samplers), "samplers")
        return texture.empty() if index is None else samplers[index]

    def _choices(self, info: JsonObject) -> list[int]:
        """Return the indices of the images of a textureInfo, the best first; none, with a note, if it has none."""
        with self._document.leaving_out("the texture"):
            texture = self._textures[info.index("index", len(self._textures), "textures")]
            owners = [texture.extension(name) for name in _IMAGE_EXTENSIONS] + [texture]
            if not has_basisu():
                # The texture's own image is there for readers without the extension.
                owners = owners[1:] + owners[:1]
            found = [owner for owner in owners if owner is not None and "source" in owner]
            if found:
                return [owner.index("source", len(self._images), "images") for owner in found]
            self._document.notes.add(f"{texture.where} was left out: it has no image of a known kind.")
        return []


def _reflecting(surface: Surface) -> dict[str, Any]:
    """Return the fields of a dielectric whose reflectance at normal incidence is the specular colour."""
    return {
        "ior": 0.0,
        "specular_color": surface.specular_color,
        "specular_color_texture": surface.specular_color_texture,
    }


def _texture_infos(material: JsonObject) -> dict[str, JsonObject]:
    """Return the textureInfo objects of a material by their key."""
    extension = material.extension(_SPECULAR_GLOSSINESS)
    if extension is None:
        pbr = material.child("pbrMetallicRoughness")
        keys = {"baseColorTexture": pbr, "metallicRoughnessTexture": pbr}
    else:
        keys = dict.fromkeys(_SPECULAR_GLOSSINESS_TEXTURES, extension)
    keys |= dict.fromkeys(("normalTexture", "occlusionTexture", "emissiveTexture"), material)
    return {key: owner.child(key) for key, owner in keys.items() if key in owner} | layer_infos(material)


def some(names: Sequence[str]) -> str:
    """Return the first four names, quoted, and how many more there are."""
    shown = ", ".join(repr(name[:60]) for name in names[:4])
    return shown if len(names) <= 4 else f"{shown} and {len(names) - 4} more"
