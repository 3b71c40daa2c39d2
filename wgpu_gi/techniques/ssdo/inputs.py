"""What screen-space directional occlusion needs of a scene: which layers and further cameras show it."""

from __future__ import annotations

from dataclasses import dataclass

from ..deferred.inputs import DeferredInputs


@dataclass(frozen=True)
class ScreenInputs:
    """How many depth layers and further cameras show the scene; `skipped` names the passes left out, and why."""

    layers: int
    cameras: int
    skipped: tuple[tuple[str, str], ...]


@dataclass
class SsdoInputs(DeferredInputs):
    """What SSDO needs of a scene."""

    screen: ScreenInputs

    def shape(self) -> tuple[object, ...]:
        """Return all that calls for another declaration of the passes."""
        return (*super().shape(), self.screen)
