"""The pixel probe: the values of the pixel under the mouse."""

from __future__ import annotations

from numpy.typing import NDArray

from .session import Session

PROBED = ("position", "normal", "radiance", "albedo", "depth")
UNITS = {"position": "m", "radiance": "W/(m2 sr)", "depth": "m"}


class Probe:
    """While `on`, steps at rest also compute the probed buffers, and `take` reads them back."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._on = False
        self._layers: dict[str, NDArray] = {}

    @property
    def on(self) -> bool:
        """Whether the buffers are computed."""
        return self._on

    @on.setter
    def on(self, on: bool) -> None:
        if on != self._on:
            self._on, self._layers = on, {}
            self._session.also = PROBED if on else ()
            self._session.changed()

    def take(self) -> None:
        """Read the buffers of the last step back; none while the view moves."""
        self._layers = {}
        if self._on and self._session.made_also:
            self._layers = {name: self._session.renderer.read_back(name) for name in PROBED}

    def lines(self, x: float, y: float) -> list[str]:
        """Return a line for each buffer, at a share of the picture's width and height; none outside."""
        if not self._layers or not (0 <= x < 1 and 0 <= y < 1):
            return []
        height, width = self._layers["depth"].shape
        row, column = int(y * height), int(x * width)
        found = [f"pixel {column}, {row}"]
        for name, layer in self._layers.items():
            values = ", ".join(f"{value:.4g}" for value in layer[row, column].reshape(-1))
            found.append(f"{name} {values} {UNITS.get(name, '')}".rstrip())
        return found
