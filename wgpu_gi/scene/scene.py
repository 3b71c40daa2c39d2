"""The scene: everything that a frame shows, as plain data. Its parts are in `parts.py`, motion in `animation.py`."""

from __future__ import annotations

import math
from collections import Counter
from copy import copy
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..camera import Camera
from ..errors import GiError
from ..pictures.tables import html_table
from ..records import KnownAttributes
from .animation import Animation, chosen_animation
from .arrays import mesh_arrays
from .deformation import is_deformed, posed_positions
from .layers import described_materials
from .parts import (
    DirectionalLight,
    Environment,
    Filter,
    Image,
    Instance,
    Light,
    Material,
    Mesh,
    MorphTarget,
    PointLight,
    Skin,
    SpotLight,
    Texture,
    Wrap,
    values_of,
)
from .posing import Posing, retargeted
from .rules import is_number, shown

__all__ = [
    "DirectionalLight",
    "Environment",
    "Filter",
    "Image",
    "Instance",
    "Light",
    "Material",
    "Mesh",
    "MorphTarget",
    "PointLight",
    "Scene",
    "Skin",
    "SpotLight",
    "Texture",
    "Wrap",
    "values_of",
]

MATTE = (0.8, 0.8, 0.8, 1.0)  # base colour of arrays without colours: light in a closed room dies out
MOST_NAMES = 5  # of cameras, in a summary


@dataclass(eq=False, repr=False, slots=True)
class Scene(KnownAttributes):
    """Everything that a frame shows. `notes` are sentences on what loading changed, assumed or left out."""

    instances: list[Instance] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    environment: Environment | None = None
    cameras: list[Camera] = field(default_factory=list)
    name: str = ""
    notes: list[str] = field(default_factory=list)
    animations: list[Animation] = field(default_factory=list)

    @classmethod
    def from_arrays(
        cls,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        colors: ArrayLike | None = None,
        normals: ArrayLike | None = None,
        uvs: ArrayLike | None = None,
        material: Material | None = None,
        name: str = "",
    ) -> Scene:
        """Return a scene of one mesh, without light: `vertices` (n, 3) in metres, `faces` (m, 3), or (m, 4) for quads.

        `colors` is one colour, or (n, 3), (n, 4) per vertex or (m, 3), (m, 4) per face: floats from 0 to 1 are linear,
        whole numbers from 0 to 255 are sRGB. `normals` (n, 3) need not have unit length; without them, shading is flat.
        `uvs` (n, 2) have v pointing down, as in glTF. Faces without area are left out. Raises GiError that names the
        first wrong row, for NaN and for indices out of range.
        """
        if material is not None and not isinstance(material, Material):
            raise GiError(f"material must be a Material, not {shown(material)}")
        arrays = mesh_arrays(vertices, faces, colors, normals, uvs)
        mesh = Mesh(
            arrays.positions,
            arrays.triangles,
            [material or Material(base_color=MATTE if colors is None else (1.0, 1.0, 1.0, 1.0))],
            normals=arrays.normals,
            texcoords0=arrays.texcoords,
            colors=arrays.colors,
            name=name,
        )
        placed = np.eye(4)
        placed[:3, 3] = arrays.centre
        notes = [f"{arrays.flat} faces without area were left out"] if arrays.flat else []
        return cls([Instance(mesh, placed, name)], name=name, notes=notes)

    @property
    def meshes(self) -> list[Mesh]:
        """The distinct meshes, in order of first use."""
        return list({id(i.mesh): i.mesh for i in self.instances}.values())

    @property
    def materials(self) -> list[Material]:
        """The distinct materials, in order of first use."""
        return list({id(m): m for mesh in self.meshes for m in mesh.materials}.values())

    @property
    def triangle_count(self) -> int:
        """Triangles of all instances."""
        return sum(len(i.mesh.triangles) for i in self.instances)

    def at(self, time: float, animation: str | int | None = None) -> Scene:
        """Return the scene at a time of an animation, in seconds, limited to [0, its duration].

        `animation` is a name or an index; None: the first. What the animation does not move is shared, meshes too.
        Raises GiError for an unknown animation, and a time that is not finite.
        """
        chosen = chosen_animation(self.animations, animation)
        if not is_number(time) or not math.isfinite(time):
            raise GiError(f"time must be a finite number of seconds, not {shown(time)}")
        posed, posing = copy(self), Posing(chosen)
        posing.take_over(self, posed)
        posing.write(min(max(float(time), 0.0), chosen.duration))
        posed.animations = [retargeted(one, posing) for one in self.animations]
        return posed

    def bounds(self) -> NDArray[np.float64]:
        """Return the world-space box of all instances in their poses, (2, 3): lower and upper corner; zeros without."""
        boxes: dict[int, NDArray[np.float64]] = {}  # the corners of each mesh
        corners = []
        for instance in self.instances:
            mesh = instance.mesh
            if len(mesh.positions) == 0:
                continue
            local = posed_positions(instance) if is_deformed(instance) else boxes.get(id(mesh))
            if local is None:
                ends = mesh.positions.min(0), mesh.positions.max(0)
                local = np.array([[ends[(k >> a) & 1][a] for a in range(3)] for k in range(8)], np.float64)
                boxes[id(mesh)] = local
            matrix = np.asarray(instance.world_from_local, np.float64)
            corners.append(local @ matrix[:3, :3].T + matrix[:3, 3])
        if not corners:
            return np.zeros((2, 3))
        points = np.concatenate(corners)
        return np.stack([points.min(0), points.max(0)])

    def __repr__(self) -> str:
        try:
            counts = f"{len(self.instances)} instances of {len(self.meshes)} meshes, {self.triangle_count} triangles"
            rest = f"{len(self.lights)} lights, {len(self.cameras)} cameras"
        except (AttributeError, TypeError):  # a list holds something else
            return super(Scene, self).__repr__()
        return f"<Scene {self.name!r}: {counts}, {rest}, {'an' if self.environment else 'no'} environment>"

    def __str__(self) -> str:
        """Return a summary, a line for each kind of part."""
        rows = [("scene", self.name or "unnamed"), *self._summary().items(), *(("note", note) for note in self.notes)]
        return "\n".join(f"{name:<22}{text}" for name, text in rows)

    def _repr_html_(self) -> str:
        """Return a summary as an HTML table, for notebooks."""
        return html_table(("scene", self.name), [*self._summary().items(), *(("note", note) for note in self.notes)])

    def _summary(self) -> dict[str, str]:
        """Return the number of parts of each kind, and the extent, in words."""
        low, high = self.bounds()
        lights = Counter(type(light).__name__ for light in self.lights)
        cameras = [camera.name or "unnamed" for camera in self.cameras]
        more = f" and {len(cameras) - MOST_NAMES} more" if len(cameras) > MOST_NAMES else ""
        return {
            "instances, of meshes": f"{len(self.instances)}, of {len(self.meshes)}",
            "triangles": f"{self.triangle_count:,}",
            "size in metres": " x ".join(f"{length:.4g}" for length in high - low),
            "centre": ", ".join(f"{value:.4g}" for value in (low + high) / 2),
            "materials": described_materials(self.materials),
            "lights": ", ".join(f"{count} {name}" for name, count in lights.items()) or "none",
            "emissive materials": str(sum(max(material.emission) > 0 for material in self.materials)),
            "environment": "none" if self.environment is None else self.environment.name or "yes",
            "cameras": ", ".join(cameras[:MOST_NAMES]) + more or "none",
            **({"animations": _listed(self.animations)} if self.animations else {}),
        }


def _listed(animations: list[Animation]) -> str:
    """Return the names and durations of animations."""
    texts = [f"{a.name or 'unnamed'} {a.duration:.4g} s" for a in animations[:MOST_NAMES]]
    more = f" and {len(animations) - MOST_NAMES} more" if len(animations) > MOST_NAMES else ""
    return ", ".join(texts) + more
