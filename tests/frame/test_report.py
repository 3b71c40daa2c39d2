"""`wgpu-gi report` end to end: in little time it leaves out most, and says so."""

from __future__ import annotations

import pytest

from wgpu_gi.__main__ import main
from wgpu_gi.gpu.device import open_device
from wgpu_gi.measure.adapter import passes
from wgpu_gi.measure.adapter.budget import Budget
from wgpu_gi.measure.adapter.builds import measure_build
from wgpu_gi.measure.adapter.passes import measure_scene
from wgpu_gi.measure.adapter.rays import measure_rays
from wgpu_gi.measure.adapter.results import load_json
from wgpu_gi.measure.adapter.scenes import Variant, cornell
from wgpu_gi.measure.adapter.timestamps import check_timestamps


def test_a_short_report_says_what_it_left_out(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["report", "--minutes", "0.1"]) == 0
    report = load_json("report.json")
    assert report.checks and not report.failed and report.seconds < 60
    assert any("Cornell at 1920x1080: the time was over" in sentence for sentence in report.left_out)
    assert "<h2>Self-test</h2>" in (tmp_path / "report.html").read_text()
    assert "left out: " in capsys.readouterr().out


def test_frames_are_timed_pass_by_pass(monkeypatch):
    monkeypatch.setattr(passes, "SIZE", (96, 54))
    monkeypatch.setattr(passes, "SMALL", (48, 27))
    monkeypatch.setattr(passes, "REPEAT_SECONDS", 0.0)
    monkeypatch.setattr(passes, "VARIANTS", (Variant("direct light", "none"),))
    budget = Budget(100.0)
    (times,) = measure_scene("Cornell", *cornell(), budget).techniques
    assert times.passes["direct/light"] > 0 and times.passes_ms == pytest.approx(sum(times.passes.values()))
    assert times.frame_ms > 0 and times.bytes > 0 and times.frames == 1 and not budget.left_out
    # What cannot fit is left out before it is tried.
    budget = Budget(100.0)
    monkeypatch.setattr(passes, "FRAMES_AT_LEAST", 1e9)
    assert measure_scene("Cornell", *cornell(), budget).techniques == []
    assert "it takes about" in budget.left_out[0]


def test_rays_of_each_kind_hit_what_a_closed_room_has(monkeypatch):
    monkeypatch.setattr("wgpu_gi.measure.adapter.rays.SIZES", ((64, 36),))
    scene, camera = cornell()
    device = open_device(large_buffers=True)
    build, upload = measure_build("Cornell", scene, device)
    rates = {rate.kind: rate for rate in measure_rays("Cornell", scene, camera, device, upload)}
    upload.release()
    assert build.triangles == scene.triangle_count and build.ms > 0 and build.bytes > 0
    assert all(rate.per_second > 0 for rate in rates.values())
    assert rates["camera"].hits == 1.0
    # The room is open towards the camera.
    assert 0.5 < rates["bounce"].hits < 0.9
    # The two boxes hide some points from others; a free way is not blocked by either end.
    assert 0.1 < rates["shadow"].hits < 0.8


@pytest.mark.slow
def test_timestamps_are_wrong_where_the_driver_is_known_to_be():
    device = open_device(large_buffers=True)
    flags = device.compute_timestamps, device.render_timestamps
    try:
        compute, _ = check_timestamps(device)
        if device.is_cpu and device.driver.startswith("Mesa"):
            assert compute.right == flags[0]
        assert device.compute_timestamps == compute.right
    finally:
        device.compute_timestamps, device.render_timestamps = flags
