"""`wgpu-gi render --certify`: certifies the picture; Ctrl-C skips that."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence

from numpy.typing import NDArray

from ..budget.certificate import Certificate, certify, check_pixels
from ..errors import GiError
from ..renderer import Renderer
from .interrupt import handled, ignored
from .messages import Messages


def pixels_of(arguments: Namespace, shown: Sequence[str]) -> int:
    """Return how many pixels `--certify` takes, 0 without it. Raises GiError for what cannot be certified."""
    if arguments.certify is None:
        return 0
    if arguments.frames is not None:
        raise GiError("--certify states the error of one picture; leave out --frames")
    if "radiance" not in shown:
        raise GiError("--certify measures radiance, which --show leaves out; add --show radiance")
    return check_pixels(arguments.certify, "--certify")


def certificate_of(renderer: Renderer, pixels: int, picture: NDArray, say: Messages) -> Certificate | None:
    """Certify a picture (h, w, 3 or 4) of the renderer; None, with a note, if Ctrl-C is pressed or it has no error."""
    try:
        with ignored(False), say.progress("certifying") as report:
            return certify(renderer, pixels, picture=picture[..., :3], progress=report)
    except KeyboardInterrupt:
        handled()
        say.note("no certificate: interrupted")
    except GiError as error:
        say.note(f"no certificate: {error}")
    return None
