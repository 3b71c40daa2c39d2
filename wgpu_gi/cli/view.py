"""`wgpu-gi view`: shows the scene of the arguments in a window."""

from __future__ import annotations

from argparse import Namespace

from ..errors import GiError
from ..extras import install_hint
from ..options import check_size
from ..scene.files.memory import GIB, MAX_MEMORY
from ..scene.load import is_usd
from .budgets import budget_of
from .common import QUALITY, list_names, renderer_from, settings_from
from .messages import Messages

FIRST = ("path.samples_per_run=1",)  # settings of a viewer: the path tracer shows its first sample at once


def view(arguments: Namespace) -> int:
    """Run `wgpu-gi view` and return the exit code. Raises GiError for an error that the user can fix."""
    if list_names(arguments):
        return 0
    settings = settings_from(arguments, FIRST)
    check_size(arguments.size)
    try:
        from ..viewer import app, window
        from ..viewer.refinement import Refinement
        from ..viewer.session import Session
    except ImportError as error:
        raise GiError(f"the viewer needs packages ({error.name} is missing): {install_hint('viewer')}") from None
    window.start()
    renderer = renderer_from(arguments, settings, Messages(arguments.verbose, arguments.quiet))
    # The arguments that make the scene, for the command that the viewer copies.
    source = [arguments.scene]
    for name in ("env", "adapter"):
        if getattr(arguments, name) is not None:
            source += [f"--{name}", getattr(arguments, name)]
    if arguments.max_memory != MAX_MEMORY:
        source += ["--max-memory", f"{arguments.max_memory / GIB:g}"]
    if arguments.point_size is not None:
        source += ["--point-size", f"{arguments.point_size:g}"]
    if arguments.time is not None and is_usd(arguments.scene):
        source += ["--at", f"{arguments.time:g}"]
    for light in arguments.light:
        source += ["--light", light]
    for change in arguments.relight:
        source += ["--relight", change]
    refinement = Refinement(*(budget_of(arguments) or ()))
    session = Session(renderer, arguments.quality or QUALITY, source, fps=arguments.fps, refinement=refinement)
    app.view(session, f"{arguments.scene} - wgpu_gi")
    return 0
