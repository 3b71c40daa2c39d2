"""What is under the mouse, in numbers."""

from __future__ import annotations

from numpy.typing import NDArray

from .session import Session

PROBED = ("position", "normal", "radiance", "albedo", "depth")
UNITS = {"position": "m", "radiance": "W/(m2 sr)", "depth": "m"}


class Probe:
    """While it is `on`, steps of a view that rests also make what it tells, and `take` reads it."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._on = False
        self._layers: dict[str, NDArray] = {}

    @property
    def on(self) -> bool:
        """Whether it is asked for."""
        return self._on

    @on.setter
    def on(self, on: bool) -> None:
        if on != self._on:
            self._on, self._layers = on, {}
            self._session.also = PROBED if on else ()
            self._session.changed()

    def take(self) -> None:
        """Read what the last step made; nothing while the view moves."""
        self._layers = {}
        if self._on and self._session.made_also:
            self._layers = {name: self._session.renderer.read_back(name) for name in PROBED}

    def lines(self, x: float, y: float) -> list[str]:
        """Return what is seen at a share of the picture's width and height."""
        if not self._layers or not (0 <= x < 1 and 0 <= y < 1):
            return []
        height, width = self._layers["depth"].shape
        row, column = int(y * height), int(x * width)
        found = [f"pixel {column}, {row}"]
        for name, layer in self._layers.items():
            values = ", ".join(f"{value:.4g}" for value in layer[row, column].reshape(-1))
            found.append(f"{name} {values} {UNITS.get(name, '')}".rstrip())
        return found
