"""Finds the folders of shaders and small scenes, in an installed package and in a checkout; and the cache folder."""

import os
from importlib.resources import files
from pathlib import Path


def resource_dir(name: str) -> Path:
    """Return the folder `name`, "wgsl" or "scenes".

    A wheel has it inside the package, a checkout (editable install) beside the package. Raises FileNotFoundError if the
    installation is incomplete.
    """
    for folder in (Path(__file__).parent.parent / name, Path(str(files("wgpu_gi"))) / name):
        if folder.is_dir() and (name != "wgsl" or (folder / "common").is_dir()):
            return folder
    raise FileNotFoundError(f"the installation of wgpu_gi lacks its folder {name!r}; install it again")


def cache_folder(name: str) -> Path:
    """Return the folder `name` of what can be made again: in WGPU_GI_CACHE, or in wgpu_gi in the user's cache."""
    own = os.environ.get("WGPU_GI_CACHE")
    users = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return (Path(own) if own else Path(users) / "wgpu_gi") / name
