"""The tests of the stress lab: p-values are uniform without a difference, tiny with one, and known pictures fail."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.measure.stress.compare import Margin, same_bits, same_means
from wgpu_gi.measure.stress.statistics import cluster_p, family_p, mean_p, student_p

SHAPE = (36, 64, 3)
MARGIN = Margin(0.002, 0.02)


def layers(direct, indirect=None):
    indirect = np.zeros_like(direct) if indirect is None else indirect
    return {
        "radiance": direct + indirect,
        "direct": direct,
        "indirect": indirect,
        "emission": np.zeros_like(direct),
        "albedo": np.full_like(direct, 0.5),
        "depth": np.ones(direct.shape[:2]),
    }


def noisy_pairs(bias=1.0, noise=0.3, where=np.s_[:], seed=0):
    """Return a function that takes pairs of pictures with noise shared by blocks and noise of pixels."""

    def picture(rng):
        shared = np.kron(rng.gamma(16.0, 1 / 16, (4, 4, 1)), np.ones((9, 16, 1)))
        return shared * (1 + noise * rng.standard_normal(SHAPE))

    def take(seeds):
        pairs = []
        for number in seeds:
            rng = np.random.default_rng([seed, number])
            expected, got = picture(rng), picture(rng)
            got[where] *= bias
            pairs.append((layers(expected), layers(got)))
        return pairs

    return take


@pytest.mark.parametrize(
    ("t", "freedom", "p"), [(0.0, 5, 1.0), (12.706205, 1, 0.05), (2.570582, 5, 0.05), (6.868827, 5, 1e-3)]
)
def test_student_p_has_the_values_of_tables(t, freedom, p):
    assert student_p(t, freedom) == pytest.approx(p, rel=1e-5)
    assert student_p(-t, freedom) == student_p(t, freedom)


def test_student_p_is_accurate_far_out():
    # Cauchy's distribution has the tail 2 / (pi t).
    assert student_p(1e8, 1) == pytest.approx(2e-8 / np.pi, rel=1e-6)
    assert student_p(np.inf, 3) == 0.0


@pytest.mark.parametrize("count", [6, 24])
def test_p_values_are_uniform_without_a_difference(count):
    """Kolmogorov-Smirnov over 2,000 sets, at 1e-4."""
    rng = np.random.default_rng(count)
    p = np.sort(np.concatenate([mean_p(rng.standard_normal((count, 50))) for _ in range(40)]))
    distance = np.abs(p - (np.arange(len(p)) + 0.5) / len(p)).max()
    assert distance < 2.23 / np.sqrt(len(p))


def test_p_values_of_rare_bright_pixels_are_conservative():
    """Differences of pictures with the same distribution are symmetric; heavy tails make small p-values rarer."""
    rng = np.random.default_rng(1)
    bright = rng.pareto(1.5, (24, 4000)) - rng.pareto(1.5, (24, 4000))
    p = mean_p(bright)
    assert (p < 0.01).mean() < 0.011 and (p < 0.5).mean() > 0.4


def test_cluster_p_is_valid_for_correlated_pixels():
    """At most one in twenty of 100 sets has p < 0.05, within the noise of that count."""
    rng = np.random.default_rng(2)
    found = [
        cluster_p(np.repeat(rng.standard_normal((12, 20)), 50, axis=1), limit=2.0, flips=199)[1] for _ in range(100)
    ]
    assert np.mean(np.array(found) < 0.05) < 0.12


def test_family_p_counts_the_tests():
    assert family_p(np.array([0.5, 0.01, 0.3])) == pytest.approx(0.03)
    assert family_p(np.array([0.9, 0.8])) == 1.0


def test_equal_means_pass():
    verdicts = [same_means(noisy_pairs(seed=seed), MARGIN).verdict for seed in range(20)]
    assert verdicts == ["passed"] * 20


def test_a_difference_within_the_margin_passes():
    assert same_means(noisy_pairs(bias=1.001, noise=0.0), MARGIN).verdict == "passed"


@pytest.mark.parametrize("bias", [0.7, 1.5])
def test_another_brightness_fails(bias):
    found = same_means(noisy_pairs(bias), MARGIN)
    assert found.failure == "mean of direct" and found.p < 1e-4 and "off by" in found.sentence


def test_a_dark_corner_fails():
    found = same_means(noisy_pairs(0.2, where=np.s_[:9, :11]), MARGIN)
    assert found.verdict == "failed" and found.sentence.count("block 0")


def test_scattered_wrong_pixels_fail_as_a_cluster():
    """Dark and bright pixels that cancel in every block."""

    def take(seeds):
        pairs = noisy_pairs(noise=0.05)(seeds)
        factor = np.where(np.arange(64) % 2, 0.5, 1.5)[:, None]
        for (expected, got), seed in zip(pairs, seeds, strict=True):
            got["direct"][:] = expected["direct"] + 0.01 * np.random.default_rng(seed).standard_normal(SHAPE)
            got["direct"][0] *= factor
            got["direct"][1] *= 2 - factor
        return pairs

    found = same_means(take, MARGIN)
    assert found.failure == "clusters of direct"


def test_other_surfaces_fail():
    def take(seeds):
        pairs = noisy_pairs()(seeds)
        for _, got in pairs:
            got["depth"][:6] *= 2
        return pairs

    assert same_means(take, MARGIN).failure == "other surfaces"


def test_one_bit_fails():
    one = layers(np.full(SHAPE, 0.25))
    other = {name: values.copy() for name, values in one.items()}
    assert same_bits(one, other).verdict == "passed"
    other["indirect"][3, 4, 1] = np.nextafter(0, 1)
    assert same_bits(one, other).failure == "bits of indirect"
