"""`wgpu-gi render --certify`: certifies the picture, prints the certificate and returns it for the file's metadata."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence

from numpy.typing import NDArray

from ..budget.certificate import certify, check_pixels
from ..errors import GiError
from ..renderer import Renderer
from .interrupt import handled
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


def certificate_texts(renderer: Renderer, pixels: int, picture: NDArray | None, say: Messages) -> dict[str, str]:
    """Certify a picture (None: the renderer's), print the certificate, return its texts; Ctrl-C skips that."""
    try:
        with say.progress("certifying") as report:
            color = None if picture is None else picture[..., :3]
            certificate = certify(renderer, pixels, picture=color, progress=report)
    except KeyboardInterrupt:
        handled()
        say.note("no certificate: interrupted")
        return {}
    except GiError as error:
        say.note(f"no certificate: {error}")
        return {}
    say.result(certificate.sentence())
    return certificate.texts()
