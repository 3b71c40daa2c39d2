"""The scene inputs of screen-space directional occlusion: the layers and further cameras that show the scene."""

from __future__ import annotations

from dataclasses import dataclass

from ..deferred.inputs import DeferredInputs


@dataclass(frozen=True)
class ScreenInputs:
    """Numbers of depth layers and further cameras; `skipped`: names of the passes left out, and the reasons.

    widens: the first further camera stands at the main one, with a wider lens.
    """

    layers: int
    cameras: int
    skipped: tuple[tuple[str, str], ...]
    widens: bool = False


@dataclass
class SsdoInputs(DeferredInputs):
    """The scene inputs of SSDO."""

    screen: ScreenInputs

    def shape(self) -> tuple[object, ...]:
        """Return the values whose change forces the passes to be redeclared."""
        return (*super().shape(), self.screen)
