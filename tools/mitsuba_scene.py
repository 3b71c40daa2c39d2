"""Convert a scene to Mitsuba 3: every surface Lambert with its base colour, lights and rays as in this package.

Exact: triangles, vertex normals, instances (placed in float64), base colour factor x texture (bilinear or nearest,
without mip levels) or vertex colour, punctual lights, emission from the counter-clockwise side, environments.
Approximate: the alpha mask (bilinear alpha against the cutoff, cut on a grid finer than the texels), the spot's
fall-off (a picture of it), double-sided emitters (two sheets a hair apart), vertex normals of emitters (left out).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from world_surfaces import Floats, Surface, sheets, shines, surfaces

from wgpu_gi.camera import Camera
from wgpu_gi.errors import GiError
from wgpu_gi.pictures.color import LINEAR_OF_CODE
from wgpu_gi.scene.scene import DirectionalLight, Environment, Light, Material, PointLight, Scene, SpotLight, Texture

Words = dict[str, Any]  # what mitsuba.load_dict takes

# The spot's fall-off is a picture on a plane across its axis; wide cones would stretch it without bound.
WIDEST_SPOT = math.radians(80.0)
SPOT_PIXELS = 2048

# The mask is cut at up to 8 x 8 points a texel, as long as the picture stays below this side.
MASK_STEPS = 8
MASK_SIDE = 8192

# Distance of the two sheets of a double-sided emitter from the surface, in diagonals of the scene: far above float32
# rounding (6e-8), far below what a picture shows.
SHEET = 2e-5

PAD_MODES: dict[str, Any] = {"repeat": "wrap", "clamp": "edge", "mirror": "symmetric"}


# --------------------------------------------------------------------------------------- pictures, without Mitsuba


def linear_pixels(texture: Texture, factor: tuple[float, ...]) -> NDArray[np.float32]:
    """Return an sRGB picture decoded to linear, times `factor`, (height, width, 3)."""
    return (LINEAR_OF_CODE[texture.image.pixels[..., :3]] * np.asarray(factor[:3])).astype(np.float32)


def mask_pixels(texture: Texture, factor: float, cutoff: float) -> NDArray[np.float32]:
    """Return 1 where a picture's alpha times `factor` reaches the cutoff, else 0, on a grid inside its texels."""
    alpha = texture.image.pixels[..., 3] / 255.0
    steps = 1 if texture.filter == "nearest" else max(1, min(MASK_STEPS, MASK_SIDE // max(alpha.shape)))
    fine = np.pad(alpha, 1, mode=PAD_MODES[texture.wrap_u])
    for axis, count in enumerate(alpha.shape if texture.filter == "linear" else ()):
        # Points in texels of the padded picture, whose texel k has its centre at k.
        at = (np.arange(count * steps) + 0.5) / steps + 0.5
        low = np.floor(at).astype(np.int64)
        weight = (at - low).reshape((-1, 1) if axis == 0 else (1, -1))
        fine = np.take(fine, low, axis) * (1 - weight) + np.take(fine, low + 1, axis) * weight
    if texture.filter == "nearest":
        fine = alpha
    return (fine * factor >= cutoff).astype(np.float32)


def spot_pixels(light: SpotLight, size: int = SPOT_PIXELS) -> NDArray[np.float32]:
    """Return the fall-off of a spot on the square around its cone, on a plane across the axis, (size, size)."""
    slope = ((np.arange(size) + 0.5) / size * 2 - 1) * math.tan(light.outer_cone_angle)
    cosine = 1 / np.sqrt(1 + slope[:, None] ** 2 + slope**2)
    inner, outer = math.cos(light.inner_cone_angle), math.cos(light.outer_cone_angle)
    # KHR_lights_punctual keeps the ring between the cones at least this wide.
    return (np.clip((cosine - outer) / max(0.001, inner - outer), 0, 1) ** 2).astype(np.float32)


def environment_pixels(environment: Environment) -> NDArray[np.float32]:
    """Return the radiance of a pictured environment, (2 h + 1, w, 3).

    Mitsuba puts the first and the last row onto the poles; in this package, pixel centres are half a row off. Both
    interpolate alike with the means of neighbours between the rows, and the outer rows repeated at the poles.
    """
    assert environment.image is not None
    image = np.asarray(environment.image, np.float64) * np.asarray(environment.color, np.float64)
    rows = np.empty((2 * len(image) + 1, *image.shape[1:]))
    rows[1::2] = image
    rows[2:-1:2] = (image[1:] + image[:-1]) / 2
    rows[0], rows[-1] = image[0], image[-1]
    return rows.astype(np.float32)


# ------------------------------------------------------------------------------------------------ camera rays


def pixel_centres(size: tuple[int, int]) -> Floats:
    """Return the centres of all pixels in pixels from the top left corner, (height * width, 2), row by row."""
    rows, columns = np.mgrid[: size[1], : size[0]] + 0.5
    return np.stack([columns.ravel(), rows.ravel()], axis=-1)


def camera_rays(camera: Camera, size: tuple[int, int], points: Floats) -> tuple[Floats, Floats]:
    """Return origins and unit directions, each (n, 3), of the rays through points (n, 2) of the picture."""
    width, height = size
    x, y = (2 * points[:, :1] - width) / height, 1 - 2 * points[:, 1:] / height
    right, up, back = np.asarray(camera.world_from_view, np.float64)[:3, :3].T
    across = x * right + y * up
    if camera.orthographic_height is not None:
        origins = camera.position + across * (camera.orthographic_height / 2)
        return origins, np.broadcast_to(-back, origins.shape)
    directions = across * math.tan(camera.yfov / 2) - back
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return np.broadcast_to(camera.position, directions.shape), directions


# ------------------------------------------------------------------------------------------------ Mitsuba's words


def mitsuba_scene(mi: Any, scene: Scene, origin: Floats) -> Any:
    """Return the scene in Mitsuba's form, moved so that `origin` (world, metres) is at its origin."""
    words: Words = {"type": "scene"}
    distance = SHEET * float(np.linalg.norm(np.diff(scene.bounds(), axis=0)))
    for surface in surfaces(scene):
        material = f"{surface.material.name or 'material'} {len(words)}"
        for sheet in sheets(surface, distance):
            words[f"shape_{len(words)}"] = _mesh(mi, sheet, origin, material)
    for light in scene.lights:
        if light.intensity * max(light.color) > 0:
            words[f"light_{len(words)}"] = _light(mi, light, origin)
    environment = scene.environment
    if environment is not None and max(environment.color) > 0:
        words["environment"] = _environment(mi, environment)
    return mi.load_dict(words)


def needs_null_surfaces(scene: Scene) -> bool:
    """Tell whether rays must pass through parts of a surface, because of an alpha mask with a picture."""
    return any(m.alpha_mode == "mask" and m.base_color_texture is not None for m in scene.materials)


def _mesh(mi: Any, surface: Surface, origin: Floats, name: str) -> Any:
    """Return a mesh with three vertices per triangle: triangles may differ in the attributes of a shared corner."""
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(_bsdf(mi, surface))
    if shines(surface.material):
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": _emission(mi, surface.material)})
    count = len(surface.corners)
    mesh = mi.Mesh(
        name.replace(".", "_"),
        3 * count,
        count,
        props=properties,
        has_vertex_normals=surface.normals is not None,
        has_vertex_texcoords=surface.texcoords is not None,
    )
    values = mi.traverse(mesh)
    values["vertex_positions"] = _flat(surface.corners - origin)
    values["faces"] = np.arange(3 * count, dtype=np.uint32)
    if surface.normals is not None:
        values["vertex_normals"] = _flat(surface.normals)
    if surface.texcoords is not None:
        values["vertex_texcoords"] = _flat(surface.texcoords)
    values.update()
    if surface.colors is not None:
        tinted = surface.colors[..., :3] * np.asarray(surface.material.base_color[:3])
        mesh.add_attribute("vertex_color", 3, _flat(tinted))
    return mesh


def _flat(values: Floats) -> NDArray[np.float32]:
    return values.astype(np.float32).ravel()


def _bsdf(mi: Any, surface: Surface) -> Words:
    """Return a Lambert surface that reflects on both sides, with its holes."""
    m = surface.material
    reflectance: Words = {"type": "rgb", "value": list(m.base_color[:3])}
    if surface.colors is not None:
        reflectance = {"type": "mesh_attribute", "name": "vertex_color"}
    elif m.base_color_texture is not None:
        reflectance = _picture(mi, linear_pixels(m.base_color_texture, m.base_color), m.base_color_texture)
    bsdf: Words = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}
    if m.alpha_mode == "mask" and m.base_color_texture is not None:
        pixels = mask_pixels(m.base_color_texture, m.base_color[3], m.alpha_cutoff)
        opacity = _picture(mi, pixels, m.base_color_texture) | {"filter_type": "nearest"}
        return {"type": "mask", "opacity": opacity, "bsdf": bsdf}
    return bsdf


def _emission(mi: Any, material: Material) -> Words:
    if material.emission_texture is None:
        return _rgb(material.emission)
    return _picture(mi, linear_pixels(material.emission_texture, material.emission), material.emission_texture)


def _picture(mi: Any, pixels: NDArray[np.float32], texture: Texture) -> Words:
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(pixels),
        "raw": True,
        "filter_type": "bilinear" if texture.filter == "linear" else "nearest",
        "wrap_mode": texture.wrap_u,
    }


def _rgb(color: Any) -> Words:
    return {"type": "rgb", "value": [float(channel) for channel in color]}


def _light(mi: Any, light: Light, origin: Floats) -> Words:
    power = _rgb(np.asarray(light.color, np.float64) * light.intensity)
    if isinstance(light, DirectionalLight):
        return {"type": "directional", "direction": [float(x) for x in light.direction], "irradiance": power}
    position = np.asarray(light.position, np.float64) - origin
    if isinstance(light, PointLight):
        return {"type": "point", "position": position.tolist(), "intensity": power}
    if light.outer_cone_angle > WIDEST_SPOT:
        widest = f"{math.degrees(WIDEST_SPOT):.0f}"
        raise GiError(f"light {light.name!r} is a spot wider than {widest} degrees from its axis; make it narrower")
    axis = np.asarray(light.direction, np.float64) / np.linalg.norm(light.direction)
    up = (0.0, 1.0, 0.0) if abs(axis[1]) < 0.9 else (1.0, 0.0, 0.0)
    # Equal angles switch off the plugin's own ramp, which is linear in the angle; the picture is the fall-off.
    cone = math.degrees(light.outer_cone_angle)
    return {
        "type": "spot",
        "to_world": mi.ScalarTransform4f().look_at(position.tolist(), (position + axis).tolist(), up),
        "intensity": power,
        "cutoff_angle": cone,
        "beam_width": cone,
        "texture": {"type": "bitmap", "bitmap": mi.Bitmap(spot_pixels(light)), "raw": True, "wrap_mode": "clamp"},
    }


def _environment(mi: Any, environment: Environment) -> Words:
    if environment.image is None:
        return {"type": "constant", "radiance": _rgb(environment.color)}
    turn = mi.ScalarTransform4f().rotate([0, 1, 0], math.degrees(environment.rotation))
    return {"type": "envmap", "bitmap": mi.Bitmap(environment_pixels(environment)), "to_world": turn}
