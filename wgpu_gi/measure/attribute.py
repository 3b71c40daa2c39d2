"""Says what the error of a technique is due to, and which setting lowers it at which cost (`bench --attribute`).

`attribute_study.py` finds the parts of the error, `attribute_raise.py` measures the settings of the largest parts.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import GiError
from ..options import Settings, technique_of
from ..renderer import Renderer
from ..scene.scene import Scene
from .attribute_raise import Raise, measure_raises, time_frame
from .attribute_study import LAYERS, Bar, Study
from .truth import Progress, Truth


@dataclass(frozen=True)
class Attribution:
    """The result of `attribute`: bars, settings that may lower the error, ms of a frame, and the picture of one frame.

    `picture`: radiance, (h, w, 3), W/(m2 sr). `hidden`: bars whose error the noise of the truth hides.
    """

    bars: list[Bar]
    raises: list[Raise]
    frame_ms: float
    picture: NDArray[np.float32]
    hidden: list[Bar] = field(default_factory=list)


def attribute(
    scene: Scene,
    camera: Camera,
    size: tuple[int, int],
    settings: Settings,
    truth_of: Callable[[int | None, bool], Truth],
    *,
    timed: int = 5,
    adapter: str | None = None,
    progress: Progress | None = None,
) -> Attribution:
    """Return what the error of `settings` is due to, in a single frame and in a still picture.

    `truth_of` takes a number of indirect bounces (None: all) and whether only visible surfaces send light, and returns
    that truth. `timed`: frames for each time. Raises GiError for the path tracer, for a truth that is black, and if its
    noise hides all errors.
    """
    if not technique_of(settings.gi).stages:
        raise GiError(f"--attribute exchanges the stages of a technique, and {settings.gi} has none")
    settings = deepcopy(settings)
    settings.camera.jitter = False
    with Renderer(scene, size=size, camera=camera, settings=settings, adapter=adapter) as renderer:
        study = Study(renderer, settings, truth_of, progress or (lambda what, fraction: None))
        bars = [study.bar(layer, frames) for frames in study.counts for layer in LAYERS if study.is_lit(layer)]
        if not bars:
            raise GiError("the truth is black, so there is no error to attribute")
        hidden = [bar for bar in bars if bar.whole.total <= 0.0]
        bars = [bar for bar in bars if bar.whole.total > 0.0]
        if not bars:
            raise GiError("no error exceeds the noise of the truth, so there is none to attribute; raise --truth-spp")
        frame_ms = time_frame(study, settings, timed)
        raises = measure_raises(study, bars, timed)
        return Attribution(bars, raises, frame_ms, study.pictures(settings, 1)["full"][0], hidden)
