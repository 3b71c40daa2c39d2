"""Global illumination on WebGPU: load a scene, render it, read the picture.

>>> import wgpu_gi as gi
>>> scene = gi.load("cornell")                                    # or a path, a trimesh scene, (vertices, faces)
>>> picture = gi.render(scene, size=(640, 360))                   # (height, width, 3) float32 linear radiance
>>> truth = gi.render(scene, size=(640, 360), gi="path", spp=64)  # the same by path tracing
>>> gi.show(scene)                                                # in a notebook: a live canvas

Names are imported when first used, so that `import wgpu_gi` stays cheap.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .version import __version__

if TYPE_CHECKING:
    from . import dataset, farm
    from .camera import Camera
    from .errors import GiError, GiWarning
    from .pictures.image import load_image, save_image
    from .renderer import Renderer, Settings
    from .rendering import render
    from .scene.animation import Animation, Attachment, Channel, Node, Skeleton, Track
    from .scene.files.environment_files import load_environment
    from .scene.load import load
    from .scene.scene import (
        DirectionalLight,
        Environment,
        Image,
        Instance,
        Material,
        Mesh,
        MorphTarget,
        PointLight,
        Scene,
        Skin,
        SpotLight,
        Texture,
    )
    from .viewer.notebook import show


__all__ = [
    "Animation",
    "Attachment",
    "Camera",
    "Channel",
    "DirectionalLight",
    "Environment",
    "GiError",
    "GiWarning",
    "Image",
    "Instance",
    "Material",
    "Mesh",
    "MorphTarget",
    "Node",
    "PointLight",
    "Renderer",
    "Scene",
    "Settings",
    "Skeleton",
    "Skin",
    "SpotLight",
    "Texture",
    "Track",
    "__version__",
    "dataset",
    "farm",
    "load",
    "load_environment",
    "load_image",
    "render",
    "save_image",
    "show",
]

_PACKAGES = ("dataset", "farm")

_MODULE_OF_NAME = {
    "Camera": "camera",
    "GiError": "errors",
    "GiWarning": "errors",
    "load_image": "pictures.image",
    "save_image": "pictures.image",
    "Renderer": "renderer",
    "Settings": "renderer",
    "render": "rendering",
    **dict.fromkeys(("Animation", "Attachment", "Channel", "Node", "Skeleton", "Track"), "scene.animation"),
    "load": "scene.load",
    "load_environment": "scene.files.environment_files",
    "show": "viewer.notebook",
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        from .errors import near_names

        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; {near_names(name, __all__)}")
    if name in _PACKAGES:
        return import_module(f".{name}", __name__)
    value = getattr(import_module(f".{_MODULE_OF_NAME.get(name, 'scene.scene')}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
