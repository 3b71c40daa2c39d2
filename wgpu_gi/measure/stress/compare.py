"""Compares the pictures of a relation: to the bit, or in the means of regions, with confirmation by new seeds.

A relation promises bits, or equal means. Means are tested over the whole picture by channel and over a grid of blocks,
for direct and indirect light apart: differences of pairs of pictures with the same seed, Student's t, Bonferroni. A
margin takes up rounding and edges. A suspicion counts only if a set of new seeds, four times as large, makes it
`CERTAIN`, or if two sets confirm it. `STAGES` keeps the false alarms of 100,000 cases below 0.01 in expectation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .findings import PASSED, Finding, failed
from .statistics import cluster_p, family_p, mean_p
from .studio import LIGHT, Layers

GRID = (4, 6)  # blocks down and across: 9 x 11 pixels each at 64x36
# Of each stage: pairs of pictures, and the p-values of means and clusters below which the suspicion stays.
# Joint: 0.2 * 1e-4 * 1e-4 = 2e-9 for means, 0.05 * 1e-3 * 1e-3 = 5e-8 for clusters.
STAGES = ((6, 0.2, 0.05), (24, 1e-4, 1e-3), (96, 1e-4, 1e-3))
QUICK = ((12, 1e-3, 1e-3),)  # while a failing scene is reduced
CERTAIN = 1e-9  # p-value of a second stage that needs no third
CLUSTER_SHARE = 0.02  # share of pixels that must exceed |t| = 3 and the margin for a cluster to count
EDGES = 0.03  # share of pixels whose ray may see another surface after a move, by rounding

Pairs = tuple[Layers, Layers]  # expected and got


@dataclass(frozen=True)
class Margin:
    """Differences that rounding explains, relative to the mean of the picture and to the light of a block."""

    mean: float
    block: float

    def of(self, expected: Layers) -> NDArray[np.float64]:
        """Return the margins of `region_means`, for pictures of the brightness of `expected`."""
        total = expected["direct"] + expected["indirect"]
        level = float(total.mean())
        blocks = self.block * (_blocks(total) + 0.2 * level)
        return np.concatenate([np.full(3, self.mean * level), blocks] * 2)


def region_means(layers: Layers) -> NDArray[np.float64]:
    """Return the means of direct, then indirect light: of each channel, and of each block over all channels."""
    return np.concatenate(
        [part for name in ("direct", "indirect") for part in (layers[name].mean((0, 1)), _blocks(layers[name]))]
    )


def _blocks(layer: NDArray[np.float64]) -> NDArray[np.float64]:
    rows = np.array_split(layer.mean(-1), min(GRID[0], layer.shape[0]), axis=0)
    blocks = [part.mean() for row in rows for part in np.array_split(row, min(GRID[1], layer.shape[1]), axis=1)]
    return np.array(blocks)


def same_bits(expected: Layers, got: Layers, names: Sequence[str] = LIGHT) -> Finding:
    """Return a failure if a layer differs in a bit."""
    for name in names:
        if not np.array_equal(expected[name], got[name]):
            off = np.abs(expected[name] - got[name])
            share = float((off.max(-1) > 0).mean())
            level = max(float(np.abs(expected["radiance"]).mean()), 1e-300)
            size = f"{share:.1%} of the pixels differ, by up to {float(off.max()) / level:.2g} of the mean radiance"
            return failed(f"bits of {name}", f"{name} is not equal to the bit: {size}", got[name], expected[name])
    return PASSED


def other_surfaces(expected: Layers, got: Layers) -> NDArray[np.bool_]:
    """Return the pixels (h, w) whose ray hits another surface: by distance, sky, or base colour."""
    far, near = expected["depth"], got["depth"]
    moved = np.abs(far - near) > 1e-3 * np.maximum(far, near)
    return moved | (np.abs(expected["albedo"] - got["albedo"]).max(-1) > 0.02)


def same_means(
    take: Callable[[Sequence[int]], list[Pairs]], margin: Margin, edges: float | None = EDGES, thorough: bool = True
) -> Finding:
    """Test whether pictures have equal means. `take` returns a pair of expected and got picture for each seed."""
    first, finding = 0, PASSED
    for count, alpha, cluster_alpha in STAGES if thorough else QUICK:
        pairs = take(range(first, first + count))
        first += count
        finding = _tested(pairs, margin, alpha, cluster_alpha, edges)
        certain = finding.p is None or (first > STAGES[0][0] and finding.p < CERTAIN)
        if finding.verdict != "failed" or certain:
            return finding
    return finding


def _tested(pairs: list[Pairs], margin: Margin, alpha: float, cluster_alpha: float, edges: float | None) -> Finding:
    # Leave out the pixels that see something else.
    expected, got = pairs[0]
    other = np.zeros(got["depth"].shape, bool) if edges is None else other_surfaces(expected, got)
    if edges is not None and other.mean() > edges:
        sentence = f"{other.mean():.1%} of the pixels see another surface"
        return failed("other surfaces", sentence, got["radiance"], expected["radiance"])
    kept = [({n: np.where(other[..., None], 0.0, e[n]) for n in LIGHT}, g) for e, g in pairs]
    kept = [(e, {n: np.where(other[..., None], 0.0, g[n]) for n in LIGHT}) for e, g in kept]
    # Test the means of regions.
    level = _mean([e for e, _ in kept])
    bounds = margin.of(level)
    means = np.stack([region_means(g) - region_means(e) for e, g in kept])
    p = mean_p(means, bounds)
    found = family_p(p)
    if found < alpha:
        return _failure(kept, means, p, found)
    # Test for clusters of pixels.
    cluster = None if edges is None else _clusters(kept, level, margin, cluster_alpha)
    return cluster or Finding("passed", p=found)


def _failure(pairs: list[Pairs], means: NDArray, p: NDArray, found: float) -> Finding:
    """Describe the most certain deviation."""
    expected, got = (_mean([pair[k] for pair in pairs]) for k in (0, 1))
    whole, size = 3, len(p) // 2
    worst = int(np.argmin(p))
    layer = ("direct", "indirect")[worst // size]
    values = np.mean([region_means(e) for e, _ in pairs], axis=0)
    off, level = means[:, worst].mean(), values[worst]
    region = f"channel {'RGB'[worst % size]}" if worst % size < whole else f"block {worst % size - whole}"
    change = f"{off / level:+.2%}" if level > 0 else f"{off:.3g} where none is expected"
    sentence = f"the mean of {layer} light in {region} is off by {change} (p = {found:.1g}, {len(pairs)} pairs)"
    return Finding(
        "failed",
        f"mean of {layer}",
        sentence,
        {"off": float(off / level) if level > 0 else float("nan")},
        got[layer],
        expected[layer],
        found,
    )


def _clusters(pairs: list[Pairs], level: Layers, margin: Margin, alpha: float) -> Finding | None:
    """Return a failure if more pixels exceed three standard errors than chance allows."""
    total = level["direct"] + level["indirect"]
    bound = margin.block * (total.mean(-1) + 0.2 * float(total.mean())).ravel()
    for layer in ("direct", "indirect"):
        off = np.stack([(g[layer] - e[layer]).mean(-1).ravel() for e, g in pairs])
        share, p = cluster_p(off, bound)
        if share > CLUSTER_SHARE and p < alpha:
            expected, got = (_mean([pair[k] for pair in pairs]) for k in (0, 1))
            sentence = f"{share:.1%} of the pixels of {layer} light are off by more than three standard errors"
            return Finding("failed", f"clusters of {layer}", sentence, {}, got[layer], expected[layer], p)
    return None


def _mean(pictures: list[Layers]) -> Layers:
    return {name: np.mean([p[name] for p in pictures], axis=0) for name in LIGHT}
