"""The standard error that the path tracer reports is the spread of its pictures over seeds."""

from __future__ import annotations

import numpy as np
from helpers.pictures import shoot

from wgpu_gi.scene.built_in import scenes as builtin


def test_standard_error_is_the_spread_over_seeds():
    """Within a factor of 1.5, in the mean over a picture and for most pixels."""
    got = [shoot(builtin.cornell(), (16, 9), spp=64, seed=seed) for seed in range(16)]
    spread = np.stack([g["radiance"] for g in got]).std(0, ddof=1)
    reported = np.sqrt(np.mean([g["standard_error"] ** 2 for g in got], axis=0))
    assert 1 / 1.5 < np.sqrt((reported**2).mean() / (spread**2).mean()) < 1.5
    each = reported[spread > 0] / spread[spread > 0]
    assert 1 / 1.5 < np.median(each) < 1.5 and np.percentile(each, 5) > 0.5


def test_standard_error_falls_as_one_over_the_root_of_the_samples():
    few, many = (shoot(builtin.cornell(), (16, 9), spp=spp, jitter=True)["standard_error"] for spp in (32, 512))
    assert 3 < np.sqrt((few**2).mean() / (many**2).mean()) < 5


def test_standard_error_without_noise_is_zero():
    got = shoot(builtin.furnace(), (8, 8), spp=100)
    assert got["standard_error"].max() < 1e-4


def test_standard_error_of_one_sample_is_the_radiance():
    got = shoot(builtin.cornell(), (8, 8), spp=1)
    assert np.array_equal(got["standard_error"], got["radiance"])


def test_noise_is_centred_on_the_truth():
    """Against a long rendering, errors have the reported size, and their sum is within its noise."""
    truth = shoot(builtin.cornell(), (16, 9), spp=2048)["radiance"]
    got = shoot(builtin.cornell(), (16, 9), spp=64, seed=5)
    off, error = (got["radiance"] - truth)[..., 1], got["standard_error"][..., 1]
    assert 1 / 1.5 < np.sqrt((off**2).mean() / (error**2).mean()) < 1.5
    assert abs(off.sum()) < 3 * np.sqrt((error**2).sum())
