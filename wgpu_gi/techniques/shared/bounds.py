"""What passes that are left out could add at most, for the plan (`--plan`).

Let S_k be the flux that leaves all surfaces after k scatterings, and r the largest albedo. Energy conservation gives
S_(k+1) <= r S_k, so the light of more than n scatterings is at most r^n of the sum of all S_k; a furnace attains it.
The light of the environment alone, L <= L_max, is at most r L_max at any pixel, with all bounces: each path leaves the
scene once, after a first scattering that keeps at most r.
"""

from __future__ import annotations

from collections.abc import Callable

from ...upload.reflectance import brightest_sky, conserves_flux, largest_reflectance
from ...upload.scene_upload import SceneUpload
from .scene_inputs import SceneInputs

NOTHING = "nothing"
MOVES = "nothing: it moves light between pixels or frames"
SAVES = "nothing: it saves time"
ELSEWHERE = "nothing: another pass finds that light"


def left_out(albedo: float, scatterings: int) -> float:
    """Return the largest share of the reflected light that is scattered more than `scatterings` times.

    `albedo`: the largest of all surfaces, 0 to 1. The share is of the flux that leaves all surfaces of the scene, in
    the picture or not.
    """
    return float(min(max(albedo, 0.0), 1.0) ** scatterings)


def scattered_more(scene: SceneInputs, scatterings: int) -> Callable[[], str]:
    """Return a function that describes `left_out` of the scene; it takes long in large scenes."""
    return lambda: _share(left_out(_albedo(scene.upload), scatterings))


def sky_at_most(scene: SceneInputs) -> Callable[[], str]:
    """Return a function that describes the largest radiance of a pixel by the environment's light alone."""

    def describe() -> str:
        shown = scene.upload.scene
        largest = brightest_sky(shown.environment) * largest_reflectance(shown, scene.upload.diffuse)
        return NOTHING if largest <= 0.0 else f"at most {largest:.2g} W/(m2 sr) at a pixel"

    return describe


def sky_unoccluded(scene: SceneInputs) -> Callable[[], str]:
    """Return a function that describes how much of the environment's light its occlusion takes away at most."""
    return lambda: f"nothing: it takes away {sky_at_most(scene)()}"


def _albedo(upload: SceneUpload) -> float:
    """Return the largest albedo; 1 if shading normals leave flux without a bound."""
    shown = upload.scene
    return largest_reflectance(shown, upload.diffuse) if conserves_flux(shown, upload.diffuse) else 1.0


def _share(share: float) -> str:
    if share <= 0.0:
        return NOTHING
    amount = "all" if share >= 0.995 else f"{100.0 * share:.0f} %" if share >= 0.1 else f"{100.0 * share:.2g} %"
    return f"at most {amount} of the light that surfaces reflect"
