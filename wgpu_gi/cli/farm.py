"""`wgpu-gi farm`: its commands, one module each."""

from __future__ import annotations

from argparse import Namespace
from importlib import import_module


def farm(arguments: Namespace) -> int:
    """Run `wgpu-gi farm render` or `wgpu-gi farm template` and return the exit code."""
    name = arguments.farm_command
    code: int = getattr(import_module(f".farm_{name}", __package__), name)(arguments)
    return code
