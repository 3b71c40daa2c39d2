"""Arrays that a notebook displays as pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .display import png_bytes
from .image import save_image


class Certificate(Protocol):
    """What a picture errs by."""

    def sentence(self) -> str:
        """Return it for people."""

    def texts(self) -> dict[str, str]:
        """Return it for a file's metadata."""


class Outcome(Protocol):
    """How a picture of a budget was made."""

    def sentence(self) -> str:
        """Return what was chosen, what it reached, and why it ended."""


class Picture(np.ndarray):
    """A buffer `name` as a numpy array, displayed with 2^`exposure`; arrays computed from it inherit both.

    None exposes each array automatically by its own values. A number makes several arrays comparable. `certificate`
    (`budget.certificate`) states the errors of the picture if they were asked for, and `outcome` (`budget.outcome`) how
    a budget of time or error was met; arrays computed from it have neither.
    """

    name = "radiance"
    exposure: float | None = None
    certificate: Certificate | None = None
    outcome: Outcome | None = None

    def __new__(cls, values: NDArray, name: str = "radiance", exposure: float | None = None) -> Picture:
        """Return a view of the values."""
        picture = np.asarray(values).view(cls)
        picture.name, picture.exposure = name, exposure
        return picture

    def __array_finalize__(self, source: Any) -> None:
        self.name = getattr(source, "name", self.name)
        self.exposure = getattr(source, "exposure", self.exposure)

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        """Return sums and means as numbers."""
        if return_scalar:
            return array[()]
        return super().__array_wrap__(array, context, return_scalar)

    def save(self, path: str | Path, *, exposure: float | None = None) -> None:
        """Write the picture as `save_image` does, in the format of the extension; `exposure` None: its own.

        Its certificate and its outcome go into the metadata. Raises GiError if it cannot be written.
        """
        stops = self.exposure if exposure is None else exposure
        metadata = {} if self.certificate is None else self.certificate.texts()
        if self.outcome is not None:
            metadata["outcome"] = self.outcome.sentence()
        save_image(path, {self.name: self}, exposure=stops, metadata=metadata)

    def _repr_png_(self) -> bytes | None:
        """Return the array as a PNG; None if it does not have the shape of a picture."""
        grey = ("depth", "instance", "alpha")
        is_picture = (self.ndim == 3 and self.shape[2] in (3, 4)) or (self.ndim == 2 and self.name in grey)
        return png_bytes(self.name, self, self.exposure) if is_picture and self.size else None
