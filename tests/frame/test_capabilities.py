"""The ways of working that suit a GPU give the same pictures as those that suit a CPU, on the driver at hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.techniques import SCENES, make_settings

from wgpu_gi.gpu.capabilities import CPU, GPU, MULTI_DRAW, capabilities_of, costs_of
from wgpu_gi.gpu.device import open_device
from wgpu_gi.renderer import Renderer


@pytest.mark.parametrize(
    ("gi", "scene"),
    [
        ("none", "cornell"),
        *(pytest.param(gi, "medley", marks=pytest.mark.slow) for gi in ("ssdo", "ssil", "many-light")),
    ],
)
def test_pictures_are_equal(gi, scene, monkeypatch):
    """But for the number of light paths, which `test_vpl.py` tests."""
    device, pictures = open_device(large_buffers=True), []
    for capabilities in (CPU, replace(GPU, least_walks=CPU.least_walks, multi_draw=True)):
        monkeypatch.setattr(device, "capabilities", capabilities)
        with Renderer(SCENES[scene](), size=(64, 36), settings=make_settings(gi)) as renderer:
            renderer.run()
            pictures.append(renderer.read_back())
    assert np.array_equal(*pictures)


def test_kinds_and_costs():
    assert capabilities_of("CPU", ()) == CPU
    assert capabilities_of("DiscreteGPU", ()) == capabilities_of("IntegratedGPU", MULTI_DRAW[:1]) == GPU
    assert capabilities_of("CPU", MULTI_DRAW) == replace(CPU, multi_draw=True)
    everything = ("timestamp-query", "float32-filterable", *MULTI_DRAW)
    assert not costs_of(everything)
    assert costs_of(everything[1:]) == [
        "timestamp-query: absent; timings of passes wait for the GPU before and after each one"
    ]
