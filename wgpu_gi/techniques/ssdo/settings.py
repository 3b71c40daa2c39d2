"""The settings of screen-space directional occlusion."""

from __future__ import annotations

from dataclasses import dataclass

from ...records import KnownAttributes
from ...settings import setting

MAX_LAYERS = MAX_CAMERAS = 4
# Placements of further cameras, in order.
PLACEMENTS = {"wide": ("wide", "above", "behind", "left"), "aside": ("left", "right", "above", "behind")}


@dataclass(repr=False, slots=True)
class SsdoSettings(KnownAttributes):
    """The search for light in screen space."""

    directions: int = setting(
        2, "Directions per pixel and frame.", "directions", range=(1, 64), presets={"low": 1, "high": 4}
    )
    steps: int = setting(16, "Steps along each direction.", "steps", range=(1, 64), presets={"low": 8, "high": 24})
    undecided: str = setting(
        "rays",
        "Directions that no picture decides: rays (traced through the scene), sky (open past the picture's border,"
        " occluded behind what it shows), or cameras (decided by further cameras as far as these see).",
        choices=("rays", "sky", "cameras"),
    )
    offscreen: str = setting(
        "none",
        "With undecided=rays, light of off-screen surfaces: a sample of their direct light (none), or all of"
        " it by a radiance cache in world space (cache).",
        choices=("none", "cache"),
    )
    bounce: bool = setting(True, "Add the light that the occluders reflect.")
    sampling: str = setting(
        "cosine",
        "Sampling of directions: slices of the hemisphere, one for two directions (slices), or by the cosine (cosine),"
        " both with a filtered environment; or half by importance sampling of the sharp environment (environment).",
        choices=("slices", "cosine", "environment"),
    )
    layers: int = setting(1, "Layers of depth peeling.", "layers", range=(1, MAX_LAYERS), presets={"high": 2})
    cameras: int | None = setting(
        None,
        "Further cameras that show occluders out of view; none: automatic. With undecided=cameras that is one, or three"
        " if there is an environment, because geometry above and behind the camera can occlude it; else 0.",
        "cameras",
        range=(0, MAX_CAMERAS),
        presets={"low": 0},
    )
    camera_placement: str = setting(
        "wide",
        "Placement of further cameras, in order: wide (a wide lens at the camera, above, behind, left), or aside (left,"
        " right, above, behind).",
        choices=(*PLACEMENTS,),
    )
    radius: float = setting(
        10.0,
        "Search radius for occluders, in heights of the picture at the pixel; at most the scene's diameter.",
        "heights",
        range=(0.01, 100.0),
    )
    half_resolution: bool = setting(
        True, "Search from one pixel of each 2x2, another one in each frame, and upsample.", presets={"high": False}
    )
    near_field: bool = setting(
        False,
        "With --gi many-light: find light of nearby surfaces, and its occluders, in screen space instead of by virtual"
        " point lights.",
    )
    near_field_radius: float = setting(
        0.1, "Radius of the near field, in heights of the picture at the pixel.", "heights", range=(0.001, 10.0)
    )
    blur: bool = setting(True, "Edge-aware blur over the squares of pixels that share a set of directions.")
