"""Compare the standard error that pictures state with their spread over seeds; print a table, draw a plot.

python tools/calibrate_noise.py [--gi many-light,ssdo] [--scenes room-1,cornell] [--seeds 16] [--results noise.json]
                                [--plot scenes/errors/noise_calibration.png]

A picture's noise is its share of relMSE, as a root: sqrt(mean(v / (x^2 + 0.01 m^2))), x the mean over the seeds, m the
mean of x. Measured: v is the variance over the seeds (unbiased). Estimated: v is the mean over the seeds of the square
of the buffer `standard_error`. A scene is a name as for `wgpu-gi render`, or KIND-SEED of `wgpu_gi.measure.scenes`.
Pictures are 64x36 with the settings of medium quality but for `--frames` (16) and `--spp` (64). Rows in the file of
`--results` are taken from it, new ones are added; with no scenes to render, table and plot are made of it alone.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # also where the package is not installed

import wgpu_gi as gi
from wgpu_gi.errors import GiError
from wgpu_gi.measure.plot import COLORS, DOTS_PER_INCH, require_matplotlib
from wgpu_gi.measure.scenes import KINDS, make_scene
from wgpu_gi.pictures.noise import expected_relmse
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.scene.scene import Scene

STORED = Path(__file__).resolve().parent.parent / "scenes"
SIZE = 64, 36
TECHNIQUES = "none,ssdo,ssil,many-light,path"
# Scenes of the repository, and generated ones of many kinds.
SCENES = (
    "cornell,cornell-point,cornell-spot,courtyard,corridor,curtain,materials,leak_corridor,room-1,room-4,street-1,"
    "street-2,foliage-1,foliage-2,glossy-3,glossy-5,textured-1,textured-2,many-1,layered-1"
)
FACTOR = 1.25  # the aim: estimates within this factor of the measured noise
SHOW = ("radiance", "standard_error")


@dataclass
class Row:
    """Noise of one technique in one scene, by `noise`."""

    scene: str
    gi: str
    measured: float
    estimated: float

    @property
    def ratio(self) -> float:
        """Estimated over measured."""
        return self.estimated / self.measured


def scene_of(name: str) -> Scene:
    """Return a generated scene, one of the folder `scenes`, or one that `load` finds."""
    stored = STORED / name / f"{name}.glb"
    kind, _, seed = name.rpartition("-")
    return (
        make_scene(kind, int(seed))
        if kind in KINDS and seed.isdigit()
        else gi.load(stored if stored.exists() else name)
    )


def measure(name: str, technique: str, seeds: int, frames: int, spp: int) -> Row | None:
    """Render a scene with each seed; return None for a picture that does not vary."""
    settings = Settings(gi=technique, spp=spp)
    settings.camera.frames = frames
    pictures, variances = [], []
    with Renderer(scene_of(name), size=SIZE, settings=settings) as renderer:
        for seed in range(1, seeds + 1):
            renderer.settings.seed = seed
            renderer.run(show=SHOW)
            picture, error = (renderer.read_back(buffer).astype(np.float64) for buffer in SHOW)
            pictures.append(picture)
            variances.append(error**2)
    mean, spread = np.mean(pictures, axis=0), np.std(pictures, axis=0, ddof=1)
    measured, estimated = (expected_relmse(mean, s) ** 0.5 for s in (spread, np.sqrt(np.mean(variances, axis=0))))
    return Row(name, technique, measured, estimated) if measured else None


def table(rows: list[Row]) -> str:
    """Return the rows as a Markdown table: estimated over measured noise, a line a scene; and how many are within."""
    techniques = list(dict.fromkeys(row.gi for row in rows))
    lines = [f"| estimated / measured noise | {' | '.join(techniques)} |", "|---" * (len(techniques) + 1) + "|"]
    for scene in dict.fromkeys(row.scene for row in rows):
        found = {row.gi: f"{row.ratio:.2f}" for row in rows if row.scene == scene}
        lines.append(f"| {scene} | {' | '.join(found.get(name, '-') for name in techniques)} |")
    within = []
    for name in techniques:
        ratios = [row.ratio for row in rows if row.gi == name]
        within.append(f"{sum(1 / FACTOR <= r <= FACTOR for r in ratios)} of {len(ratios)}")
    lines.append(f"| within a factor of {FACTOR} | {' | '.join(within)} |")
    return "\n".join(lines)


def plot(path: str, rows: list[Row]) -> None:
    """Draw estimated against measured noise, a point a scene and a colour a technique."""
    require_matplotlib()
    from matplotlib.figure import Figure  # an optional package

    figure = Figure(figsize=(6.0, 5.2), layout="constrained")
    panel = figure.subplots()
    for color, name in zip(COLORS, dict.fromkeys(row.gi for row in rows), strict=False):
        points = [(row.measured, row.estimated) for row in rows if row.gi == name]
        panel.plot(*zip(*points, strict=True), "o", color=color, markersize=4.5, alpha=0.8, label=name)
    ends = np.array([0.8 * min(r.measured for r in rows), 1.25 * max(r.measured for r in rows)])
    panel.plot(ends, ends, color="0.3", linewidth=1)
    panel.fill_between(ends, ends / FACTOR, ends * FACTOR, color="0.9", label=f"within a factor of {FACTOR}")
    panel.set(xscale="log", yscale="log", xlim=ends, ylim=ends)
    panel.set(xlabel="measured noise: sqrt(relMSE) over seeds", ylabel="estimated by standard_error")
    panel.legend(frameon=False, fontsize="small")
    figure.savefig(path, dpi=DOTS_PER_INCH)


def main() -> int:
    """Measure what the results lack, then print and draw all of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gi", default=TECHNIQUES, help="techniques, by commas (default: %(default)s)")
    parser.add_argument("--scenes", default=SCENES, help="scenes, by commas; an empty text: none")
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--frames", type=int, default=16)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--results", help="a .json file of rows, which is read and extended")
    parser.add_argument("--plot", help="a .png, .svg or .pdf to draw")
    arguments = parser.parse_args()
    results = Path(arguments.results) if arguments.results else None
    rows = [Row(**row) for row in json.loads(results.read_text())] if results and results.exists() else []
    for name in filter(None, arguments.scenes.split(",")):
        for technique in arguments.gi.split(","):
            if any((row.scene, row.gi) == (name, technique) for row in rows):
                continue
            try:
                found = measure(name, technique, arguments.seeds, arguments.frames, arguments.spp)
            except GiError as error:
                print(f"calibrate_noise: error: {error}", file=sys.stderr)
                return 2
            if found is not None:
                rows.append(found)
                print(f"{name} {technique}: measured {found.measured:.4f}, ratio {found.ratio:.2f}", flush=True)
            if results:
                results.write_text(json.dumps([asdict(row) for row in rows], indent=1))
    order = arguments.gi.split(",")
    rows = sorted((row for row in rows if row.gi in order), key=lambda row: order.index(row.gi))
    print(table(rows))
    if arguments.plot:
        plot(arguments.plot, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
