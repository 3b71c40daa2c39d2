"""The stages of a technique, each with an exact counterpart, by which `wgpu-gi bench --attribute` explains its error.

`measure/attribute.py` exchanges one stage after another, in the order of `Technique.stages`, and keeps the exchanges
before. What the error loses by an exchange is the stage's part.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Stage:
    """A stage whose part of the error can be measured.

    name: what errs, such as "visibility".
    kind: the counterpart. settings: the technique with the settings `exact`. mean: the mean of endless frames, so the
    part is noise. direct: the truth's direct light. bounces: a truth of as many bounces as the technique finds.
    visible: a truth in which only surfaces in the picture send light. After `mean`, stages have no noise of their own.
    exact: settings as `name=value`. An exchange that changes none of them is left out.
    cheaper: settings with the same mean as `exact`, but noise; used where only the mean counts.
    unless: settings that make the stage exact, or absent, as it is.
    factors: settings that may lower the part, with the factor on each. values: the same as `name=value`.
    """

    name: str
    kind: str = "settings"
    exact: tuple[str, ...] = ()
    cheaper: tuple[str, ...] = ()
    unless: tuple[str, ...] = ()
    factors: Mapping[str, float] = field(default_factory=dict)
    values: tuple[str, ...] = ()


DIRECT_FACTORS = {"direct.rays": 4.0, "environment.rays": 4.0}
# Of every technique: direct light, whose noise is that of rays to emitters and to the environment.
DIRECT = Stage("direct light", "direct", factors=DIRECT_FACTORS, values=("shadow.point=1024", "shadow.spot=2048"))
BOUNCES = Stage("bounces left out", "bounces")
