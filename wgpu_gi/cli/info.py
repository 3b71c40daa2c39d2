"""`wgpu-gi info`: prints versions, adapters, the adapter in use, and how to install what is missing; or a scene."""

from __future__ import annotations

import platform
import textwrap
from argparse import Namespace
from importlib import metadata
from typing import TYPE_CHECKING

from ..extras import EXTRAS
from ..gpu.capabilities import costs_of
from ..gpu.device import list_adapters
from ..resources import resource_dir
from ..scene.load import read_scene
from ..version import __version__

if TYPE_CHECKING:
    from ..gpu.device import AdapterInfo

CORE_PACKAGES = ("wgpu", "numpy", "mapbox-earcut", "Pillow", "OpenEXR", "rich")
SHOWN_LIMITS = (
    "max-texture-dimension-2d",
    "max-buffer-size",
    "max-storage-buffer-binding-size",
    "max-storage-buffers-per-shader-stage",
    "max-compute-workgroup-storage-size",
    "max-compute-invocations-per-workgroup",
    "max-compute-workgroups-per-dimension",
)
NO_ADAPTER = (
    "no usable adapter: install the Vulkan driver of your GPU, or for rendering on the CPU (Debian, Ubuntu, as root): "
    "apt-get install mesa-vulkan-drivers libvulkan1"
)


def info(arguments: Namespace) -> int:
    """Print what this machine offers; return 0 if an adapter can be used, else 2. With a scene, print its summary."""
    if arguments.scene is not None:
        print(read_scene(arguments.scene))
        return 0
    adapters = list_adapters()
    usable = [adapter for adapter in adapters if adapter.usable]
    print(f"wgpu_gi {__version__} on Python {platform.python_version()}, {platform.platform()}")
    print(_wrapped(", ".join(f"{name} {_version(name) or 'MISSING'}" for name in CORE_PACKAGES), indent=0))
    print("\nadapters")
    for adapter in adapters:
        print(describe_adapter(adapter, will_be_used=bool(usable) and adapter is usable[0]))
    if not adapters:
        print("  none")
    missing = missing_things(bool(usable))
    print("\nmissing")
    print("\n".join(_wrapped(sentence, indent=2) for sentence in missing) or "  nothing")
    return 0 if usable else 2


def describe_adapter(adapter: AdapterInfo, will_be_used: bool) -> str:
    """Return a paragraph: name, backend, driver, whether it will be used or why not, features, limits, faults."""
    fate = "will be used" if will_be_used else "can be used with --adapter" if adapter.usable else "not usable"
    lines = [f"  {adapter.name}: {adapter.backend}, {adapter.type}, {adapter.driver or 'unknown driver'}: {fate}"]
    if not adapter.usable:
        return "\n".join([*lines, _wrapped(adapter.why_not, indent=6)])
    if adapter.type == "CPU":
        lines.append("      this is a CPU, not a GPU: expect seconds where a GPU takes milliseconds")
    limits = ", ".join(f"{name} {adapter.limits[name]}" for name in SHOWN_LIMITS if name in adapter.limits)
    lines.append(_wrapped(f"features: {', '.join(adapter.features)}", indent=6))
    lines.append(_wrapped(f"limits: {limits}", indent=6))
    lines += [_wrapped(cost, indent=6) for cost in costs_of(adapter.features)]
    lines += [_wrapped(f"needs a newer driver: {sentence}", indent=6) for sentence in adapter.needs_newer_driver]
    return "\n".join(lines)


def missing_things(has_adapter: bool) -> list[str]:
    """Return a sentence with a remedy for everything that is missing."""
    sentences = [] if has_adapter else [NO_ADAPTER]
    absent = [name for name in CORE_PACKAGES if _version(name) is None]
    if absent:
        sentences.append(f"required packages {', '.join(absent)}: pip install {' '.join(absent)}")
    for purpose, packages in (extra for name, extra in EXTRAS.items() if name != "truth"):
        absent = [name for name in packages if _version(name) is None]
        if absent:
            sentences.append(f"optional, for {purpose}: pip install {' '.join(absent)}")
    try:
        resource_dir("wgsl")
        resource_dir("scenes")
    except FileNotFoundError as error:
        sentences.append(str(error))
    return sentences


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _wrapped(text: str, indent: int) -> str:
    return textwrap.fill(
        text, 118, initial_indent=" " * indent, subsequent_indent=" " * (indent + 2), break_on_hyphens=False
    )
