"""Checks certificates: how often their 95 % intervals hold the errors of pictures whose truth is known.

For each scene, every pixel is path traced. The errors of pictures of several techniques against that truth are compared
with the intervals of `draws` certificates of each, which trace pixels of their own. The known error has a standard
error itself, of the truth's noise; the interval counts as widened by it. A scene whose truth is not known, because rare
paths carry much of its light (caustics), is named and left out.

    python tools/check_certificates.py                    # the table of tools/README.md
    python tools/check_certificates.py room-3 --draws 20
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

import wgpu_gi as gi
from wgpu_gi.budget.certificate import certify
from wgpu_gi.budget.intervals import Interval, jackknife
from wgpu_gi.measure.scenes import KINDS, make_scene
from wgpu_gi.renderer import Renderer
from wgpu_gi.settings import assign

# None of them was used to choose the statistics.
SCENES = (
    *("cornell", "cornell-spot", "walk", "plates", "furnace", "street-22", "street-31", "street-32"),
    *("foliage-23", "foliage-33", "foliage-37", "room-21", "glossy-24", "textured-25", "many-26", "glass-27"),
)
TECHNIQUES = {"none": "", "many-light": "camera.frames=4", "ssil": "camera.frames=2", "path": "spp=16"}
SPP, REPLICATES = 512, 32
KNOWN = 0.01  # greatest standard error of the truth's mean, relative


class Result(NamedTuple):
    """One certificate of a picture, against the known errors."""

    relmse: Interval
    bias: Interval
    known: tuple[float, float]
    noise: tuple[float, float]  # standard errors of `known`

    @property
    def held(self) -> tuple[bool, bool]:
        """Whether each interval holds the known error."""
        pairs = zip((self.relmse, self.bias), self.known, self.noise, strict=True)
        error, bias = (_holds(interval, value, noise) for interval, value, noise in pairs)
        return error, bias


def _holds(interval: Interval, value: float, noise: float) -> bool:
    end = interval.high if value > interval.value else interval.low
    return bool(abs(value - interval.value) <= np.hypot(end - interval.value, 1.96 * noise))


def main() -> None:
    """Print a line for each picture, then the coverage of all."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scenes", nargs="*", default=SCENES, help="built-in scenes, or KIND-SEED of generated ones")
    parser.add_argument("--size", default="64x36", help="of the pictures, default 64x36")
    parser.add_argument("--pixels", type=int, default=200, help="of a certificate, default 200")
    parser.add_argument("--draws", type=int, default=3, help="certificates of each picture, default 3")
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    found = []
    print(f"{'scene':<12} {'technique':<10} {'relMSE':>9} {'bias':>7}  held of {arguments.draws}: relMSE, bias; widths")
    for name in arguments.scenes:
        for technique, results in pictures_of(name, (width, height), arguments.pixels, arguments.draws):
            held = np.array([r.held for r in results])
            (error, bias), widths = results[0].known, np.median([_widths(r) for r in results], axis=0)
            print(
                f"{name:<12} {technique:<10} {error:9.3g} {bias:+7.1%}  {held[:, 0].sum():3d} {held[:, 1].sum():3d}"
                f"  {widths[0]:.2f} of relMSE, {widths[1]:.1%}",
                flush=True,
            )
            found.append(held)
    if found:
        share = np.mean([held.mean(0) for held in found], axis=0)
        print(f"{len(found)} pictures: relMSE held in {share[0]:.1%}, bias in {share[1]:.1%}")


def _widths(result: Result) -> tuple[float, float]:
    error, bias = result.relmse, result.bias
    return (error.high - error.low) / max(result.known[0], 1e-12), bias.high - bias.low


def pictures_of(name: str, size: tuple[int, int], pixels: int, draws: int) -> Iterator[tuple[str, list[Result]]]:
    """Yield the results of each technique for a scene."""
    kind, _, seed = name.partition("-")
    scene = make_scene(kind, int(seed)) if kind in KINDS else gi.load(name)
    with Renderer(scene, size=size, settings=gi.Settings(gi="none")) as renderer:
        y, x = np.mgrid[: size[1], : size[0]]
        everywhere = np.stack([x.ravel(), y.ravel()], axis=-1)
        truth = renderer.trace_pixels(everywhere, SPP, seed=1 << 30, replicates=REPLICATES).replicates
        means = truth.mean(axis=(0, 2))
        mean, error = means.mean(), means.std(ddof=1) / np.sqrt(REPLICATES)
        if not mean > 0 or error > KNOWN * mean:
            print(f"{name:<12} left out: its truth is known to {error / max(mean, 1e-300):.1%} only", flush=True)
            return
        for technique, text in TECHNIQUES.items():
            renderer.settings = gi.Settings(gi=technique)
            if text:
                assign(renderer.settings, text)
            renderer.run(show=("radiance",))
            picture = np.asarray(renderer.read_back(), np.float64).reshape(-1, 3)
            relative, variance = jackknife(picture, truth, 0.01 * mean**2)
            bright = float(picture.mean() / mean)
            known = float(relative.mean()), bright - 1
            noise = float(np.sqrt(variance.sum()) / len(relative)), float(bright * error / mean)
            certificates = [certify(renderer, pixels, seed=seed) for seed in range(1, draws + 1)]
            yield technique, [Result(c.relmse, c.bias, known, noise) for c in certificates]


if __name__ == "__main__":
    main()
