"""Reads the material libraries (MTL) of Wavefront OBJ files, and the textures that they name.

`Kd` is linear reflectance, as in the published Cornell boxes, and `Ke` radiance in W/(m2 sr). `map_Kd` and `map_Ke` are
sRGB and multiply them; a zero or missing factor beside a map counts as one, since exporters write it so. `Pr`, `Pm` and
`norm` are roughness, metallic and a normal map of tangent space; `Pc` and `Pcr` are clear coat and its roughness, `Ps`
sheen, `aniso` and `anisor` anisotropy and its rotation in turns (the PBR rows of Blender and Clara.io). `d` or 1 - `Tr`
is opacity. `map_d` cuts out at half opacity if it is black and white apart from edges, and else blends.

Departures: a surface without `Pr` is matte, whatever its Phong highlight (`Ks`, `Ns`) and its index of refraction
(`Ni`). A surface of opacity 0 is opaque, since exporters confuse `d` and `Tr`. Sheen has a roughness of one half. A
note tells rows that would change the picture and are not used.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

from ...float_limits import LARGEST_IOR, LARGEST_LIGHT
from ..scene import Material
from .mtl_textures import Textures
from .notes import Notes
from .raw_mesh import clay

Block = dict[str, str]  # the rows of a material by their first word in lower case

# Rows that change the picture and are not used; those of colours only if they are not black.
_UNUSED_MAPS = ("map_ks", "map_ns", "map_bump", "bump", "disp", "decal", "refl", "map_refl", "map_pr", "map_pm")
_UNUSED_COLORS = ("ks",)
_SHEEN_ROUGHNESS = 0.5  # Blender's default; the rows have none
_GREY_SHARE = 0.1  # of a cut-out's texels at most, at its edges; a picture with more of them blends
_GREY = (26, 229)  # 8-bit opacities between these are grey


def read_mtl(text: str, names: Iterable[str], textures: Textures, folder: Path | None = None) -> dict[str, Material]:
    """Read those materials of an MTL text in `folder` that have one of the `names`; notes go to those of `textures`."""
    blocks: dict[str, Block] = {}
    block: Block = {}
    for line in text.replace("\\\r\n", " ").replace("\\\n", " ").splitlines():
        key, _, rest = line.strip().replace("\t", " ").partition(" ")
        if key.lower() == "newmtl":
            block = blocks.setdefault(rest.strip(), {})
        elif key:
            block[key.lower()] = rest.strip()
    used = {name: blocks[name] for name in names if name in blocks}
    _note_unused(used, textures.notes)
    return {name: _material(name, block, textures, folder) for name, block in used.items()}


def _note_unused(blocks: dict[str, Block], notes: Notes) -> None:
    """Note once which rows are not used."""
    keys = {key for block in blocks.values() for key in _UNUSED_MAPS if block.get(key)}
    keys |= {key for block in blocks.values() for key in _UNUSED_COLORS if max(_values(block, key), default=0.0) > 0}
    if keys:
        notes.add(f"MTL rows that are not used: {' '.join(sorted(keys))}; surfaces without Pr are matte")


def _material(name: str, block: Block, textures: Textures, folder: Path | None) -> Material:
    """Return a material from the rows of its MTL block."""
    notes = textures.notes
    material = clay()
    material.name = name
    # Reflectance.
    diffuse = _color(name, "Kd", block, notes)
    material.base_color_texture = textures.of_row(block.get("map_kd"), folder)
    if diffuse is not None:
        if max(diffuse) > 1:
            notes.add(f"material {name!r}: Kd is above 1, more than a surface can reflect; it was limited to 1")
        material.base_color = (*(min(c, 1.0) for c in diffuse), 1.0)  # type: ignore[assignment]
    if material.base_color_texture and (diffuse is None or max(diffuse) == 0):
        material.base_color = (1.0, 1.0, 1.0, 1.0)
    material.roughness = _unit(name, "Pr", block, notes, 1.0)
    material.metallic = _unit(name, "Pm", block, notes, 0.0)
    material.normal_texture = textures.of_row(block.get("norm"), folder, deep=True)
    _layers(name, block, material, notes)
    # Emission.
    emission = _color(name, "Ke", block, notes)
    material.emission = emission or (0.0, 0.0, 0.0)
    material.emission_texture = textures.of_row(block.get("map_ke"), folder)
    if material.emission_texture and max(material.emission) == 0:
        material.emission = (1.0, 1.0, 1.0)
    # Transparency.
    cut_out = textures.with_mask(material.base_color_texture, block["map_d"], folder) if block.get("map_d") else None
    opacity = min(_values(block, "d"), default=1.0 - max(_values(block, "tr"), default=0.0))
    if cut_out is not None:
        material.base_color_texture = cut_out
        alpha = cut_out.image.eight_bit[..., 3]
        grey = float(((alpha > _GREY[0]) & (alpha < _GREY[1])).mean())
        material.alpha_mode = "mask" if grey <= _GREY_SHARE else "blend"
        if diffuse is None:
            material.base_color = (0.8, 0.8, 0.8, 1.0) if "map_kd" not in block else (1.0, 1.0, 1.0, 1.0)
    elif 0.0 < opacity < 1.0:
        material.alpha_mode, material.base_color = "blend", (*material.base_color[:3], opacity)
    elif opacity <= 0.0:
        notes.add(f"material {name!r}: an opacity of 0 is ignored; it is shown opaque")
    return material


def _layers(name: str, block: Block, material: Material, notes: Notes) -> None:
    """Set the material's layers from the PBR rows."""
    material.clearcoat = _unit(name, "Pc", block, notes, 0.0)
    material.clearcoat_roughness = _unit(name, "Pcr", block, notes, 0.0)
    sheen = _unit(name, "Ps", block, notes, 0.0)
    if sheen > 0:
        material.sheen_color, material.sheen_roughness = (sheen,) * 3, _SHEEN_ROUGHNESS
    material.anisotropy = _unit(name, "aniso", block, notes, 0.0)
    material.anisotropy_rotation = 2 * math.pi * _unit(name, "anisor", block, notes, 0.0)
    index = _values(block, "ni")
    if "pr" in block and len(index) == 1 and 1.0 < index[0] <= LARGEST_IOR:
        material.ior = index[0]


def _values(block: Block, key: str) -> list[float]:
    """Return the numbers of an MTL row, none if there is no such row or it is malformed."""
    try:
        return [float(word) for word in block.get(key, "").split("#")[0].split()]
    except ValueError:
        return []


def _color(name: str, key: str, block: Block, notes: Notes) -> tuple[float, float, float] | None:
    """Return an MTL colour (one number means grey); None if it is absent, or malformed, with a note."""
    if key.lower() not in block:
        return None
    values = _values(block, key.lower())
    values = values * 3 if len(values) == 1 else values
    if len(values) != 3 or not all(0.0 <= value <= LARGEST_LIGHT for value in values):
        notes.damage(f"material {name!r}: {key} {block[key.lower()][:40]!r} is not a colour; it was ignored")
        return None
    return values[0], values[1], values[2]


def _unit(name: str, key: str, block: Block, notes: Notes, default: float) -> float:
    """Return a row of one number from 0 to 1; `default` if it is absent, or malformed, with a note."""
    if key.lower() not in block:
        return default
    values = _values(block, key.lower())
    if len(values) != 1 or not 0.0 <= values[0] <= 1.0:
        notes.damage(f"material {name!r}: {key} {block[key.lower()][:40]!r} is not from 0 to 1; it was ignored")
        return default
    return values[0]
