"""The survey: how many samples its truth gets."""

from __future__ import annotations

import pytest

from wgpu_gi.measure import survey


@pytest.mark.parametrize(
    ("ms", "samples", "spp"),
    [(2000.0, 64, 512), (2000.0, 1, survey.LEAST_TRUTH_SPP), (3.0, 1024, survey.MOST_TRUTH_SPP), (20_000.0, 16, 16)],
)
def test_truth_takes_at_most_its_time(ms, samples, spp):
    """TRUTH_SECONDS at the pace of `samples` in `ms`, as a power of two."""
    assert survey._truth_spp(ms, samples) == spp
