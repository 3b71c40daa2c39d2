"""Rankings of pictures by time and error, with made-up numbers, and labels beside points."""

from __future__ import annotations

import pytest
from unit.bench_data import measurement, scene_report

from wgpu_gi.measure.ranking import TRADE_OFF, Point, ms_text, points_of, ranked


def point(gi: str, ms: float, relmse: float, samples: str = "1 frame") -> Point:
    return Point(gi, "low", samples, ms, relmse, 0.0)


def verdicts(*points: Point, noise: float = 0.0) -> dict[str, str]:
    return {row.point.gi: row.verdict for row in ranked(points, noise)}


def test_each_time_has_its_best_picture():
    found = verdicts(point("a", 10, 0.5), point("b", 90, 0.2), point("c", 900, 0.1), point("d", 5000, 0.01))
    assert found == {
        "a": TRADE_OFF,
        "b": "best within 100 ms",
        "c": "best within 1 s",
        "d": "least error",
    }


def test_one_picture_may_be_best_within_both():
    assert verdicts(point("a", 10, 0.5), point("b", 2000, 0.1)) == {
        "a": "best within 100 ms and 1 s",
        "b": "least error",
    }


def test_what_is_slower_and_worse_is_not_worth_it():
    found = ranked([point("a", 10, 0.1), point("b", 20, 0.4), point("b", 30, 0.3), point("b", 5, 0.6)])
    assert [row.point.gi for row in found] == ["b", "a"]  # b's fastest picture is a trade-off
    found = ranked([point("a", 10, 0.1), point("b", 20, 0.4), point("b", 30, 0.3)])
    assert found[-1].point.relmse == 0.3
    assert found[-1].verdict == "not worth it: a, low, 1 frame takes 10 ms"


def test_small_gains_are_not_worth_more_time():
    assert verdicts(point("a", 10, 0.1), point("b", 20, 0.095))["b"].startswith("not worth it")


def test_errors_below_the_noise_of_the_truth_are_equal():
    points = point("a", 10, 1e-4), point("b", 20, -1e-4)
    assert verdicts(*points)["b"] == "best within 100 ms and 1 s"
    assert verdicts(*points, noise=1e-2)["b"].startswith("not worth it")


def test_nothing_has_no_ranking():
    assert ranked([]) == []


def test_points_of_a_bench():
    scene = scene_report(measurement("ssdo", "low", ms=4.0, relmse=0.2, frames=4))
    points = points_of(scene, scene.references[0])
    assert [(p.title, p.ms) for p in points[:2]] == [("ssdo, low, 1 frame", 5.0), ("ssdo, low, 4 frames", 20.0)]
    assert [p.samples for p in points[2:]] == ["1 spp", "2 spp", "4 spp"]


@pytest.mark.parametrize(
    ("ms", "text"), [(3.21, "3.2 ms"), (61.2, "61 ms"), (475.4, "475 ms"), (2400, "2.4 s"), (123456, "123 s")]
)
def test_times_have_two_digits(ms, text):
    assert ms_text(ms) == text


def test_labels_cover_neither_points_nor_one_another():
    figure_module = pytest.importorskip("matplotlib.figure")
    from wgpu_gi.measure.direct_labels import Label, place_labels

    figure = figure_module.Figure(figsize=(6, 4), layout="constrained")
    panel = figure.subplots()
    points = [(x / 10, y / 10) for x, y in ((2, 5), (3, 5), (4, 5), (2, 6), (3, 6))]
    panel.plot(*zip(*points, strict=True), "o")
    panel.set(xlim=(0, 1), ylim=(0, 1))
    place_labels(panel, [Label(f"technique {k}", *p, "black") for k, p in enumerate(points)], points)
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in panel.texts if text.get_text()]
    assert len(boxes) == len(points)
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
    assert not any(box.contains(*panel.transData.transform(p)) for box in boxes for p in points)
