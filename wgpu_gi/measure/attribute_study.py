"""Parts of the error of a technique, found by exchanging one stage after another for its exact counterpart.

A picture x of seed k has the error mean_k((x - t)^2 / (t^2 + 0.01 m^2)), as in `metrics.relmse`. It is the sum of the
noise, from the variance over seeds, and of the squared bias, that of the mean over seeds. Both are measured before and
after each exchange (`techniques/shared/stage.py`); the difference is the stage's part. Exchanges add up: each keeps
those before, so the parts and the squared bias that is left (`remainder`) add up to the whole. The order matters where
stages interact, such as a filter that blurs less where there is less noise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..options import Settings, picture_count, technique_of
from ..renderer import Renderer
from ..settings import assign
from ..techniques.shared.stage import Stage
from .metrics import noise_floor
from .truth import Progress, Truth

LAYERS = {"full": "radiance", "indirect": "indirect"}  # of the bars, with the renderer's buffers
# Pictures of different seeds. The noise of virtual point lights is common to all pixels, so 16 give it to about 35 %.
SEEDS_SINGLE, SEEDS_STILL = 16, 3
# Frames and seeds of a picture whose squared bias alone counts; the noise that is left is subtracted.
MEAN_FRAMES, SEEDS_MEAN = 32, 3
REMAINDER = "remainder"

Stack = NDArray[np.float32]  # (seeds, height, width, 3)


@dataclass(frozen=True)
class Split:
    """Noise and squared bias of a picture, as parts of relMSE less the truth's noise, and standard errors over seeds.

    error: of the sum.
    """

    noise: float
    bias: float
    noise_error: float = 0.0
    bias_error: float = 0.0
    error: float = 0.0

    @property
    def total(self) -> float:
        """Return the relMSE."""
        return self.noise + self.bias


@dataclass(frozen=True)
class Part:
    """The part of the error that a stage causes; negative where the exchange makes the error larger."""

    name: str
    split: Split
    stage: Stage | None = None  # None: the remainder


@dataclass(frozen=True)
class Bar:
    """The error of a layer in pictures of `frames` frames, and its parts in the order of the exchanges.

    The sum of the parts is the whole; the last part is the remainder. floor: the relMSE of the truth's noise, which is
    subtracted from all others; None if it is unknown.
    """

    layer: str
    frames: int
    whole: Split
    parts: list[Part]
    floor: float | None


@dataclass(frozen=True)
class State:
    """What an exchange leaves: settings, the layer that is compared, and its truth.

    means: only means over seeds are compared. cheaper: settings with the same mean as those of the exchanges so far.
    """

    settings: Settings
    layer: str
    truth: Truth
    means: bool = False
    cheaper: tuple[str, ...] = ()


class Study:
    """The pictures and truths of an attribution, each rendered once."""

    def __init__(
        self,
        renderer: Renderer,
        settings: Settings,
        truth_of: Callable[[int | None, bool], Truth],
        report: Progress,
    ) -> None:
        self.renderer, self.settings, self.report = renderer, settings, report
        self.technique = technique_of(settings.gi)
        self._truth_of, self._truths = truth_of, dict[tuple[int | None, bool], Truth]()
        self._pictures: list[tuple[Settings, int, dict[str, Stack]]] = []
        several = replace(settings, camera=replace(settings.camera, frames=2))
        self.varies = picture_count(several, renderer.scene) > 1  # with the seed
        still = picture_count(settings, renderer.scene)
        self.counts = (1, still) if still > 1 else (1,)

    def truth(self, bounces: int | None, *, visible: bool = False) -> Truth:
        """Return a truth, from the path tracer or from before."""
        key = (bounces, visible)
        if key not in self._truths:
            self._truths[key] = self._truth_of(*key)
        return self._truths[key]

    def is_lit(self, layer: str) -> bool:
        """Return whether the truth has light in a layer, so that an error is defined."""
        truth = self.truth(self.settings.bounces)
        return bool(truth.surface.any() and truth.layers[layer][truth.surface].mean() > 0)

    def pictures(
        self, settings: Settings, frames: int, seeds: int | None = None, *, keep: bool = True
    ) -> dict[str, Stack]:
        """Return pictures of `frames` frames by layer, one for each of `seeds` seeds; `keep` them for the next call."""
        count = seeds or (SEEDS_SINGLE if frames == 1 else SEEDS_STILL)
        if not self.varies:
            frames = count = 1
        for known, drawn, stacks in self._pictures:
            if known == settings and drawn == frames and len(stacks["full"]) >= count:
                return stacks
        found: dict[str, list[Stack]] = {layer: [] for layer in LAYERS}
        for number in range(count):
            camera = replace(settings.camera, frames=frames)
            self.renderer.settings = replace(settings, seed=(settings.seed + number) % 2**32, camera=camera)
            self.renderer.run(show=tuple(LAYERS.values()))
            for layer, buffer in LAYERS.items():
                found[layer].append(np.asarray(self.renderer.read_back(buffer)))
            self.report(f"{count} pictures of {frames} frames", (number + 1) / count)
        stacks = {layer: np.stack(pictures) for layer, pictures in found.items()}
        if keep:
            self._pictures.append((deepcopy(settings), frames, stacks))
        return stacks

    def split(self, stack: Stack, layer: str, weights_of: str, truth: Truth) -> Split:
        """Return noise and squared bias of the pictures of a layer, relative to the truth of `weights_of`."""
        whole = self.truth(self.settings.bounces)
        chosen = whole.surface
        reference = whole.layers[weights_of][chosen].astype(np.float64)
        weights = 1.0 / (reference**2 + 0.01 * reference.mean() ** 2)
        target = truth.layers[layer][chosen].astype(np.float64)
        noise = truth.noise.get(layer)
        floor = 0.0 if noise is None else float(np.mean(weights * noise[chosen].astype(np.float64) ** 2))
        return split_of((stack[:, chosen] - target) * np.sqrt(weights), floor)

    def bar(self, layer: str, frames: int) -> Bar:
        """Exchange the stages of the technique one after another, and return their parts."""
        state = State(self.settings, layer, self.truth(self.settings.bounces))
        whole = before = self.split(self.pictures(self.settings, frames)[layer], layer, layer, state.truth)
        parts = []
        for stage in self.technique.stages:
            exchanged = self._exchanged(state, stage)
            if exchanged is None:
                continue
            if stage.kind == "mean":
                # The mean of endless seeds has the same squared bias.
                after = without_noise(before)
            elif not exchanged.means:
                stacks = self.pictures(exchanged.settings, frames)
                after = self.split(stacks[exchanged.layer], exchanged.layer, layer, exchanged.truth)
            else:
                stacks = self.pictures(exchanged.settings, max(frames, MEAN_FRAMES), SEEDS_MEAN)
                after = without_noise(self.split(stacks[exchanged.layer], exchanged.layer, layer, exchanged.truth))
            parts.append(Part(stage.name, difference(before, after), stage))
            state, before = exchanged, after
        parts.append(Part(REMAINDER, before))
        truth = self.truth(self.settings.bounces)
        noise = truth.noise.get(layer)
        floor = None if noise is None else noise_floor(noise, truth.layers[layer], truth.surface)
        return Bar(layer, frames, whole, parts, floor)

    def _exchanged(self, state: State, stage: Stage) -> State | None:
        """Return the state after an exchange; None if the stage is exact, or absent, already."""
        found = self.technique.bounces_found(self.settings)
        if stage.unless and _assigned(self.settings, stage.unless) == self.settings:
            return None
        if stage.kind == "direct":
            return None if state.layer == "indirect" else replace(state, layer="indirect")
        if stage.kind == "bounces":
            return None if found == self.settings.bounces else replace(state, truth=self.truth(found))
        if stage.kind == "visible":
            return replace(state, truth=self.truth(found, visible=True))
        if stage.kind == "mean":
            means = _assigned(state.settings, state.cheaper)
            return replace(state, settings=means, means=True) if self.varies else None
        changed = _assigned(state.settings, stage.exact)
        if changed == state.settings:
            return None
        return replace(state, settings=changed, cheaper=(*state.cheaper, *stage.cheaper))


def split_of(errors: NDArray[np.float64], floor: float = 0.0) -> Split:
    """Return noise and squared bias of weighted errors (seeds, ...), with standard errors by leaving out one seed each.

    `floor`: the share of the truth's own noise. A single seed counts as free of noise; fewer than three give the parts
    no standard error.
    """
    count = len(errors)
    ones = errors.reshape(count, -1)
    total, squares = ones.sum(0), (ones**2).sum(0)

    def parts(total: NDArray, squares: NDArray, number: int) -> tuple[float, float]:
        mean = total / number
        noise = float(np.mean(squares - number * mean**2)) / (number - 1) if number > 1 else 0.0
        return noise, float(np.mean(squares)) / number - noise - floor

    noise, bias = parts(total, squares, count)
    error = float((ones**2).mean(1).std(ddof=1)) / np.sqrt(count) if count > 1 else 0.0
    if count < 3:
        return Split(noise, bias, error=error)
    left_out = np.array([parts(total - one, squares - one**2, count - 1) for one in ones])
    noise_error, bias_error = (float(e) for e in np.sqrt((count - 1) * left_out.var(0)))
    return Split(noise, bias, noise_error, bias_error, error)


def without_noise(split: Split) -> Split:
    """Return the error of the mean of endless seeds: the squared bias."""
    return Split(0.0, split.bias, 0.0, split.bias_error, split.bias_error)


def difference(before: Split, after: Split) -> Split:
    """Return the part that an exchange takes away; standard errors as of independent pictures."""
    return Split(
        before.noise - after.noise,
        before.bias - after.bias,
        float(np.hypot(before.noise_error, after.noise_error)),
        float(np.hypot(before.bias_error, after.bias_error)),
        float(np.hypot(before.error, after.error)),
    )


def _assigned(settings: Settings, texts: Sequence[str]) -> Settings:
    """Return a copy of the settings with some of them changed."""
    changed = deepcopy(settings)
    for text in texts:
        assign(changed, text)
    return changed
