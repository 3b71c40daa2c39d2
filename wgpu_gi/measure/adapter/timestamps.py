"""Finds out whether timestamps around passes are right: against the time of submitting a pass and waiting for it.

Drivers may report the time of recording instead of that of running. Mesa's CPU driver before version 25 does so for
most compute passes of a frame, though not for a pass alone, so the check times a frame of many-light.
"""

from __future__ import annotations

from statistics import median

from ...gpu.device import Device
from ...options import Settings
from ...renderer import Renderer
from ...scene.load import load
from .results import Timestamps

SIZES = ((640, 360), (1920, 1080), (3840, 2160))  # the first in which enough passes are long
LONG_MS = 1.0  # a pass of this length hides submit and wait (0.1 ms)
ENOUGH = 3  # long passes; with fewer, the longest decide
ROUNDS = 3  # of which the shortest counts, since other load on the machine makes passes longer
# The share of the waiting time that right timestamps have; wrong ones have a thousandth.
RIGHT = (0.33, 3.0)


def check_timestamps(device: Device, adapter: str | None = None) -> list[Timestamps]:
    """Measure both kinds of passes, set the device's flags by the result, and return it."""
    shares: dict[str, list[float]] = {"compute": [], "raster": []}
    if "timestamp-query" in device.features:
        for size in SIZES:
            shares = _shares(device, size, adapter)
            if len(shares["compute"]) >= ENOUGH:
                break
    found = []
    for kind, values in shares.items():
        # A raster pass that is too short to be compared says nothing: keep what is known of the driver.
        known = device.compute_timestamps if kind == "compute" else device.render_timestamps
        share = median(values) if values else None
        found.append(Timestamps(kind, share, known if share is None else RIGHT[0] <= share <= RIGHT[1]))
    device.compute_timestamps, device.render_timestamps = (result.right for result in found)
    return found


def _shares(device: Device, size: tuple[int, int], adapter: str | None) -> dict[str, list[float]]:
    """Return the time by timestamps over that by waiting, of each long pass of a frame, by kind."""
    renderer = Renderer(load("cornell"), size=size, settings=Settings(gi="many-light", exposure=0.0), adapter=adapter)
    flags = device.compute_timestamps, device.render_timestamps
    times = {}
    try:
        timing = renderer.graph.timing
        renderer.step(show=("display",), force=True)
        for stamps in (False, True):
            device.compute_timestamps = device.render_timestamps = stamps
            timing.clear()
            for _ in range(ROUNDS):
                renderer.step(show=("display",), force=True, timings=True)
            times[stamps] = {name: min(samples) for name, samples in timing.samples.items()}
        raster = {p.name: p.raster is not None for p in renderer.graph.order}
    finally:
        device.compute_timestamps, device.render_timestamps = flags
        renderer.close()
    shares: dict[str, list[float]] = {"compute": [], "raster": []}
    for name, waited in times[False].items():
        if waited >= LONG_MS and name in times[True]:
            shares["raster" if raster[name] else "compute"].append(times[True][name] / waited)
    return shares
