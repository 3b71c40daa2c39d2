"""Reports with made-up numbers."""

from __future__ import annotations

from wgpu_gi.measure.metrics import Errors
from wgpu_gi.measure.results import (
    Case,
    Measurement,
    MovingErrors,
    PathPoint,
    PlayedErrors,
    Reference,
    Report,
    SceneReport,
    Stats,
)

MACHINE = {"adapter": "Fake 1", "driver": "2.3", "is_cpu": False, "cores": 4, "packages": {"numpy": "2"}}


def errors(relmse: float) -> Errors:
    return Errors(pixels=8, relmse=relmse, floor=0.001, bias=-0.25, percentile=0.5, flip=None)


def case(ms: float, *names: str) -> Case:
    passes = {name: Stats(ms / len(names), ms) for name in names}
    return Case(len(names), Stats(ms + 1, ms + 2), Stats(ms, 2 * ms), passes)


def measurement(
    gi: str = "none", quality: str = "medium", ms: float = 4.0, relmse: float = 0.2, frames: int = 1
) -> Measurement:
    cases = {"still": case(0.0), "camera": case(ms / 2, "shade"), "all": case(ms, "maps", "shade")}
    layers = {"full": errors(relmse), "direct": errors(relmse / 100), "indirect": None}
    settled = {"full": errors(relmse / frames), "direct": errors(relmse / 100), "indirect": None}
    return Measurement(gi, quality, None, layers, settled, frames, cases, 3 * 2**20)


def moving(**changed: object) -> dict[str, MovingErrors | None]:
    values = {"flicker": 0.03, "lag": 7, "ghost_camera": 0.4, "ghost_object": None, "relmse": 0.05, "bias": 0.02}
    return {"full": MovingErrors(**(values | changed)), "indirect": None}  # type: ignore[arg-type]


def played() -> list[PlayedErrors]:
    return [
        PlayedErrors(1, 0.5, -0.1, None, 0.7, 0.2, None),
        PlayedErrors(8, 0.25, -0.05, 0.8, None, None, None),
    ]


def scene_report(*techniques: Measurement, scene: str = "cornell", size: tuple[int, int] = (64, 36)) -> SceneReport:
    curve = [
        PathPoint(spp, 10.0 * spp, 11.0 * spp, {"full": errors(1 / spp), "direct": None, "indirect": errors(2 / spp)})
        for spp in (1, 2, 4)
    ]
    reference = Reference(None, "path tracer, 256 spp", {"full": 0.001, "direct": None, "indirect": 0.004}, curve)
    return SceneReport(scene, None, "1,1,1", [], False, [], size, list(techniques or [measurement()]), [reference])


def report(*scenes: SceneReport, **machine: object) -> Report:
    return Report(MACHINE | machine, 20, 3, list(scenes or [scene_report()]))
