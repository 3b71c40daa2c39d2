"""Compares what a budget of time chooses with an exhaustive search: techniques at all qualities, in 15 scenes.

    python tools/try_budgets.py curves FOLDER    # error against time of every candidate
    python tools/try_budgets.py choices FOLDER   # what `budget.refine` chooses and reaches in a new view
    python tools/try_budgets.py report FOLDER    # the table of tools/README.md, and typical figures

Results are kept in FOLDER by scene; what is there is not measured again. Names of scenes may follow. The error is that
of TRACED random pixels with PATHS paths each, less their noise. Few frames of a picture err by chance, so short budgets
have the mean over SEEDS, of the choice and of every candidate. Where the start of a picture counts, at SHORT seconds,
the presets FIXED are rendered as the choice is, one after the other in the same process. Each candidate of a curve is
rendered in a process where its pipelines exist, for at most MEASURED_SECONDS; beyond, a floor and 1 / frames continue
it.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import wgpu_gi as gi
from wgpu_gi.budget.frame_series import INDIRECT, SHOW, rendered, run_frame, shown
from wgpu_gi.budget.front import Candidate, averages_samples, candidates
from wgpu_gi.budget.refine import render_within
from wgpu_gi.budget.traced import TracedPixels
from wgpu_gi.budget.typical import TYPICAL
from wgpu_gi.measure.scenes import make_scene
from wgpu_gi.renderer import Renderer, Settings
from wgpu_gi.settings import apply_quality

TUNED = (
    *("cornell", "corridor", "courtyard", "room-11", "glossy-11", "cornell-spot", "textured-12", "street-11"),
    *("curtain", "many-12", "glass-12", "foliage-12"),
)
HELD_OUT = ("room-22", "layered-22", "foliage-22")
TECHNIQUES = ("many-light", "path", "ssdo", "ssil", "none", "ssao")
ONE_QUALITY = ("none", "ssil", "ssao")  # no quality of these came near the best
SIZE = (160, 90)
SEEDS = (5, 6, 7)
BUDGETS = {0.5: SEEDS, 2.0: SEEDS[:1], 10.0: SEEDS[:1]}  # seconds, and the seeds of the pictures
SHORT, FIXED = 0.5, ("low", "medium")  # of many-light
# Curves of the further seeds end after these seconds; techniques that are not listed have one seed.
FURTHER_SECONDS = {"many-light": 2.0, "path": 0.55, "ssdo": 0.55}
TRACED, PATHS, TRUTH_SEED = 4000, 256, 0x7472_7574
NO_PICTURE = 100.0  # relMSE of a candidate that has no frame in time
NOTED = 1.12  # frames from one noted error to the next
# A curve is measured for so many seconds; it ends before if it is flat (half of its frames leave this share of the
# error), or if it does not come within a factor of NEAR of the best.
MEASURED_SECONDS = 10.0
FLAT_FRAMES, FLAT_SECONDS, FLAT, NEAR_SECONDS, NEAR = 12, 0.5, 0.985, 0.8, 3.0

Clock = Callable[[], float]
Points = list[tuple[int, float, float]]  # frames, seconds, relMSE
CLOCKS: dict[str, Clock] = {
    "wall": time.perf_counter,
    "cpu": lambda: time.process_time() / (os.cpu_count() or 1),  # for a machine with other load, and a driver on CPUs
}


def scene_of(name: str) -> Any:
    """Return a built-in scene, a generated one ("room-11"), or that of a file."""
    kind, _, seed = name.rpartition("-")
    return make_scene(kind, int(seed)) if seed.isdigit() else gi.load(name)


class Truth:
    """Path-traced pixels of a scene; made once per folder."""

    def __init__(self, renderer: Renderer, path: Path) -> None:
        if not path.exists():
            renderer.settings, renderer.size = Settings(gi="none"), SIZE
            renderer.step(show=("radiance",))
            at = np.random.default_rng(1).permutation(SIZE[0] * SIZE[1])[:TRACED]
            found = renderer.trace_pixels(np.stack([at % SIZE[0], at // SIZE[0]], 1), PATHS, seed=TRUTH_SEED)
            np.savez(path, at=at, mean=found.mean, variance=found.squared_error)
        with np.load(path) as file:
            self.at, self.mean, self.variance = file["at"], file["mean"], file["variance"]

    def relmse(self, renderer: Renderer) -> float:
        """Return the relMSE of the renderer's picture at the traced pixels, less the noise of these."""
        picture = np.asarray(renderer.read_back("radiance"), np.float64).reshape(-1, 3)[self.at]
        squared = (picture - self.mean) ** 2 - self.variance
        return float(np.mean(squared / (self.mean**2 + 0.01 * self.mean.mean() ** 2)))


def curve(
    renderer: Renderer, settings: Settings, truth: Truth, clock: Clock, limit: float, best: dict[float, float] | None
) -> Points:
    """Return the error after frames of a picture, by seconds, until `limit`; `best`: least error so far by budget.

    None: until the limit in any case.
    """
    renderer.settings, renderer.size = settings, SIZE
    points: Points = []
    frames, spent, next_noted = 0, 0.0, 1.0
    while spent < limit:
        more, seconds = run_frame(renderer, clock)
        if not more:
            break
        frames, spent = frames + 1, spent + seconds
        if frames >= next_noted:
            points.append((frames, spent, truth.relmse(renderer)))
            next_noted = max(frames + 1, frames * NOTED)
            left = points[-1][2] / max(error_at(points, spent / 2), 1e-9)
            if best is not None and spent > FLAT_SECONDS and frames > FLAT_FRAMES and left > FLAT:
                break
            if spent > NEAR_SECONDS and best and all(error_at(points, b) > NEAR * least for b, least in best.items()):
                break
    return points


def error_at(points: Points, seconds: float) -> float:
    """Return the error of a curve after so many seconds: at the last noted frame before, or beyond the end.

    Beyond, it is that of a floor and 1 / frames through the end and the half of the curve. Infinite before the start.
    """
    before = [error for _, spent, error in points if spent <= seconds]
    last = points[-1]
    if seconds < last[1] * NOTED or len(points) < 2:
        return before[-1] if before else math.inf
    half = next(p for p in reversed(points[:-1]) if p[0] <= max(last[0] / 2, 1))
    falling = max((half[2] - last[2]) / (1 / half[0] - 1 / last[0]), 0.0)
    frames = last[0] * seconds / last[1]
    return max(last[2] - falling * (1 / last[0] - 1 / frames), 0.0)


def measure_curves(name: str, folder: Path, clock: Clock) -> None:
    """Measure every candidate in a scene, and write the curves."""
    path = folder / f"{name}.json"
    if path.exists():
        return
    found: dict[str, dict[str, Any]] = {}
    with Renderer(scene_of(name), size=SIZE) as renderer:
        truth = Truth(renderer, folder / f"{name}.npz")
        for candidate, settings in candidates(Settings(), TYPICAL, TECHNIQUES).items():
            if candidate.gi in ONE_QUALITY and candidate.gi in map(_technique, found):
                continue
            # Compile in a picture of another seed.
            renderer.settings, renderer.size = replace(settings, seed=99), SIZE
            cold = sum(run_frame(renderer, clock)[1] for _ in range(2))
            best = {b: min((error_at(c["runs"][0], b) for c in found.values()), default=math.inf) for b in BUDGETS}
            further = FURTHER_SECONDS.get(candidate.gi, 0.0)
            runs: list[Points] = []
            for seed in SEEDS if further else SEEDS[:1]:
                limit, near = (further, None) if runs else (MEASURED_SECONDS, best)
                runs.append(curve(renderer, replace(settings, seed=seed), truth, clock, limit, near))
            found[str(candidate)] = {"cold": cold, "runs": runs}
            frames, spent, error = runs[0][-1]
            print(f"{name:<14}{candidate!s:<20}{frames:6} frames {spent:7.2f} s  relMSE {error:.5f}", flush=True)
    path.write_text(json.dumps(found))


def _technique(name: str) -> str:
    return name.split(", ")[0]


def measure_choices(name: str, folder: Path, clock: Clock, budgets: list[float]) -> None:
    """Render a scene within each budget, each time with nothing in the cache, and write what was reached."""
    path = folder / f"{name}.choices.json"
    rows = json.loads(path.read_text()) if path.exists() else []
    done = {(row["budget"], row["seed"], row["fixed"]) for row in rows}
    wanted = [(b, seed, q) for b in budgets for seed in BUDGETS[b] for q in (None, *(FIXED if b <= SHORT else ()))]
    missing = [want for want in wanted if want not in done]
    if not missing:
        return
    with Renderer(scene_of(name), size=SIZE) as renderer:
        truth = Truth(renderer, folder / f"{name}.npz")
        warm_up(renderer, max(budgets) > SHORT)
        medium = candidates(Settings(), TYPICAL)[Candidate("many-light", "medium")]
        for budget, seed, fixed in missing:
            os.environ["WGPU_GI_CACHE"] = str(folder / "cache" / f"{name}-{budget:g}-{seed}-{fixed}")
            # A picture with the same settings would go on.
            renderer.settings = replace(medium, seed=99)
            for _ in range(2):
                renderer.step(show=(*SHOW, INDIRECT))
            renderer.settings = Settings(seed=seed)
            techniques = None
            if fixed is not None:
                techniques = ("many-light",)
                apply_quality(renderer.settings, fixed)
            outcome = render_within(renderer, budget, None, techniques, quality=fixed, clock=clock)
            rows.append(
                {
                    "budget": budget,
                    "seed": seed,
                    "fixed": fixed,
                    "frames": outcome.frames,
                    "candidate": str(outcome.candidate),
                    "seconds": outcome.seconds,
                    "traced": outcome.traced_seconds,
                    "expected": outcome.estimated_relmse,
                    "relmse": truth.relmse(renderer),
                }
            )
            print(f"{name:<14}{outcome.sentence()}: {rows[-1]['relmse']:.5f}", flush=True)
            path.write_text(json.dumps(rows))


def warm_up(renderer: Renderer, everything: bool) -> None:
    """Compile the pipelines that a budget may use, so that a short one is not spent on that.

    everything: also those that a short one has no time to try.
    """
    for candidate, settings in candidates(Settings(seed=99), TYPICAL).items():
        if candidate.gi in FURTHER_SECONDS if everything else candidate.gi == "many-light":
            renderer.settings = settings
            for _ in range(2):
                renderer.step(show=shown(candidate, SHOW, has_rivals=True))
        rendered(renderer).add(candidate)
    if everything:
        TracedPixels(renderer, time.perf_counter, 0.0)


def mean_error(found: dict[str, Any], seconds: float, seeds: list[int]) -> float:
    """Return the mean error of a candidate over the seeds that it was rendered with."""
    runs = found["runs"][: len(seeds)]
    # A curve that was ended since it cannot win tells no later error of its further seeds.
    runs = [run for run in runs if run[-1][1] > 0.8 * seconds] or runs[:1]
    return float(np.mean([min(error_at(run, seconds), NO_PICTURE) for run in runs]))


def report(names: list[str], folder: Path) -> None:
    """Print the table, the means of every fixed preset, and the medians of the candidates' figures."""
    curves = {name: json.loads((folder / f"{name}.json").read_text()) for name in names}
    over_best: dict[str, dict[float, list[float]]] = {}
    print(
        "| scene | " + " | ".join(f"{budget:g} s: chosen; best; quotient" for budget in BUDGETS) + " |\n|" + "---|" * 4
    )
    for name in names:
        cells = dict.fromkeys(BUDGETS, "")
        every = json.loads((folder / f"{name}.choices.json").read_text())
        for budget in BUDGETS:
            rows = [row for row in every if row["budget"] == budget and row["fixed"] is None]
            if not rows:
                continue
            seeds = [row["seed"] for row in rows]
            ends = {c: mean_error(found, budget, seeds) for c, found in curves[name].items()}
            for quality in FIXED:
                errors = [row["relmse"] for row in every if row["budget"] == budget and row["fixed"] == quality]
                if errors:
                    ends[f"many-light, {quality}"] = float(np.mean(errors))
            best = min(ends, key=ends.__getitem__)
            error = float(np.mean([row["relmse"] for row in rows]))
            for candidate, end in {"**chosen**": error, **ends}.items():
                ratio = min(end, NO_PICTURE) / max(ends[best], 1e-7)
                over_best.setdefault(candidate, {b: [] for b in BUDGETS})[budget].append(max(ratio, 1e-3))
            chosen = " or ".join(dict.fromkeys(row["candidate"] for row in rows))
            cells[budget] = f"{chosen} {error:.2g}; {best} {ends[best]:.2g}; {error / max(ends[best], 1e-7):.2f}"
        print(f"| {name} | " + " | ".join(cells.values()) + " |")
    print("\n| geometric mean, largest over the best | " + " | ".join(f"{b:g} s" for b in BUDGETS) + " | all |")
    print("|" + "---|" * 5)
    for candidate, ratios in over_best.items():
        lists = [*ratios.values(), [r for each in ratios.values() for r in each]]
        means = (f"{math.exp(np.mean(np.log(r))):.2f}, {max(r):.2f}" if r else "" for r in lists)
        print(f"| {candidate} | " + " | ".join(means) + " |")
    print("\nTypical figures: cold, warm, seconds a frame, noise, floor (medians)")
    for candidate in curves[names[0]]:
        figures = [fitted(c[candidate], candidate) for c in curves.values()]
        print(f"{candidate:<20}", *(f"{value:.3g}" for value in np.median(figures, axis=0)))


def fitted(found: dict[str, Any], name: str) -> tuple[float, ...]:
    """Return the figures of a curve: cold, warm, seconds a frame; noise and floor by least squares of the logarithm."""
    points = found["runs"][0]
    first, last = points[0], points[-1]
    frame = (last[1] - first[1]) / max(last[0] - first[0], 1)
    errors = np.array([max(error, 1e-7) for *_, error in points])
    frames = np.array([count for count, *_ in points])
    no_floor = averages_samples(Candidate(name.split(", ")[0], ""))
    floors = [1e-7] if no_floor else np.geomspace(max(errors.min(), 1e-6) / 10, errors.max(), 60)
    tried = [
        (float(np.mean((np.log(floor + noise / frames) - np.log(errors)) ** 2)), noise, floor)
        for floor in floors
        for noise in np.geomspace(1e-5, 100, 120)
    ]
    _, noise, floor = min(tried)
    return found["cold"], max(first[1] - frame, 0.0), frame, noise, floor


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=("curves", "choices", "report"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("scenes", nargs="*", help="default: " + " ".join((*TUNED, *HELD_OUT)))
    parser.add_argument("--clock", choices=CLOCKS, default="wall", help="cpu: CPU time over the number of cores")
    parser.add_argument("--budgets", type=float, nargs="+", default=[*BUDGETS], help="seconds, of `choices`")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    names = options.scenes or [*TUNED, *HELD_OUT]
    clock = CLOCKS[options.clock]
    if options.command == "report":
        report(names, options.folder)
        return
    for name in names:
        if options.command == "curves":
            measure_curves(name, options.folder, clock)
        else:
            measure_choices(name, options.folder, clock, options.budgets)


if __name__ == "__main__":
    main()
