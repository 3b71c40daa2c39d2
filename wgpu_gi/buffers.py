"""What can be read back and shown of a frame, by name."""

from __future__ import annotations

from dataclasses import dataclass

from .errors import GiError
from .gpu.handles import Handle

# What can be read back and shown. All but the last two are there for every technique.
BUFFERS = (
    "radiance",
    "direct",
    "indirect",
    "emission",
    "albedo",
    "normal",
    "depth",
    "position",
    "instance",
    "standard_error",  # of the path tracer
    "motion",  # of all others
)
# What a technique works with, shown over the whole picture when asked for by name.
VIEWS = {
    "many-light": (
        "rsm/position",
        "rsm/normal",
        "rsm/flux",
        "vpl/flux",
        "ism/atlas",
        "ism/drawn",
        "gather/lists",
        "temporal/rejected",
    )
}
# Why a run may have none of them, by the first part of their names.
ABSENT = {
    "rsm": "there is no reflective shadow map, because no point, spot or directional light is reflected",
    "vpl": "there are no virtual point lights, because no light is reflected",
    "ism": "there are no imperfect shadow maps; they need --set gather.visibility=ism and light that is reflected",
    "gather": "there are no lists of lights; they need --set gather.culling=tiled or clustered and light to reflect",
    "temporal": "no history is kept; it needs --set temporal.frames=2 or more and light that is reflected",
}


def views_of(gi: str) -> tuple[str, ...]:
    """Return the names of the debug views of a technique."""
    return VIEWS.get(gi, ())


def buffers_of(gi: str) -> tuple[str, ...]:
    """Return the names of what a technique can show."""
    missing = "motion" if gi == "path" else "standard_error"
    return tuple(name for name in BUFFERS if name != missing)


@dataclass(frozen=True)
class Source:
    """Where a buffer lies: a handle with four values per pixel, and which of them; without a handle it is zero."""

    handle: Handle | None
    first: int = 0
    count: int = 3


class Absent(Source):
    """A view that this run does not have: to ask for its handle raises GiError."""

    def __init__(self, name: str) -> None:
        object.__setattr__(self, "_name", name)

    @property
    def handle(self) -> Handle | None:
        """Raise GiError that says why there is none."""
        name: str = self._name  # type: ignore[attr-defined]
        raise GiError(f"--show {name}: {ABSENT[name.partition('/')[0]]}")
