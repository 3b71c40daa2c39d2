"""The optional packages, and the sentence that tells how to install them: by their own names, which are on PyPI."""

from __future__ import annotations

from typing import NamedTuple


class Extra(NamedTuple):
    """Optional packages as in pyproject.toml, and what they are for."""

    purpose: str
    packages: tuple[str, ...]


EXTRAS = {
    "gltf": Extra("compressed glTF (Draco, meshopt, Basis Universal)", ("DracoPy", "meshoptimizer", "opengl_basisu")),
    "usd": Extra("OpenUSD files", ("usd-core",)),
    "bench": Extra("perceptual errors and plots", ("flip-evaluator", "matplotlib")),
    "video": Extra("videos (.mp4)", ("av",)),
    "viewer": Extra("wgpu-gi view", ("glfw", "imgui-bundle")),
    "jupyter": Extra("gi.show in notebooks", ("rendercanvas", "anywidget", "ipywidgets", "simplejpeg")),
    "farm": Extra("wgpu-gi farm (Dask)", ("distributed",)),
    "denoise": Extra("render --denoise (Open Image Denoise)", ("pyoidn",)),
    "truth": Extra("references for tests", ("mitsuba",)),
}


def install_hint(extra: str) -> str:
    """Return the command that installs the packages of an extra."""
    return f"pip install {' '.join(EXTRAS[extra].packages)}"
