"""Lobes: which surfaces throw light along the lobe of their coat (`vpl.lobes`), by virtual point lights and photons."""

from __future__ import annotations

from dataclasses import dataclass

from .inputs import ManyLightInputs


@dataclass
class Lobes:
    """Which candidates for virtual point lights have lobes: none, those on metals, or those on all coats."""

    some: bool
    metals_only: bool

    @property
    def words(self) -> int:
        """Number of words of a candidate: `vpl_words` of `wgsl/many_light/vpl/vpl.wgsl`."""
        return 4 if self.some else 2

    @property
    def constants(self) -> dict[str, bool]:
        """The constants of shaders that read or write candidates."""
        return {"HAS_LOBES": self.some}

    @property
    def reflecting(self) -> dict[str, bool]:
        """The constants of shaders that reflect light (`wgsl/many_light/vpl/reflect.wgsl`)."""
        return {"HAS_LOBES": self.some, "METALS_ONLY": self.metals_only}


def find_lobes(choice: str, scene: ManyLightInputs) -> Lobes:
    """Return the lobes of a scene; `choice`: setting vpl.lobes."""
    metals_only = choice == "metals"
    return Lobes(scene.features["HAS_METALS" if metals_only else "HAS_COATS"], metals_only)
