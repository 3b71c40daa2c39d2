"""What a bench shows: the JSON file there and back, tables, ratios to an earlier run, the plot."""

from __future__ import annotations

import importlib.util
import json
import os
from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console
from unit.bench_data import MACHINE, measurement, moving, played, report, scene_report

from wgpu_gi.errors import GiError
from wgpu_gi.measure import plot as bench_plot
from wgpu_gi.measure.bench_report import different_machine, load_json, ratio_table, ratios, save_json, tables
from wgpu_gi.measure.plot import frontier, save_plot
from wgpu_gi.pictures.image import load_image

needs_matplotlib = pytest.mark.skipif(importlib.util.find_spec("matplotlib") is None, reason="needs matplotlib")


def text_of(*shown) -> str:
    console = Console(file=StringIO(), width=140)
    console.print(*shown)
    return console.file.getvalue()


def test_json_round_trip(tmp_path):
    written = report(scene_report(measurement(), measurement("ism", "high", frames=64)), scene_report(scene="b.glb"))
    save_json(tmp_path / "a.json", written)
    assert load_json(tmp_path / "a.json") == written
    document = json.loads((tmp_path / "a.json").read_text())
    assert (document["schema"], document["version"]) == ("wgpu_gi.bench", 2)
    technique = document["scenes"][0]["techniques"][0]
    assert technique["cases"]["all"]["passes"]["maps"] == {"median": 2.0, "p95": 4.0}
    assert technique["errors"]["indirect"] is None
    assert os.listdir(tmp_path) == ["a.json"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "cannot be read"),
        ("", "not a report"),
        ("[1, 2]", "not a report"),
        ('{"hello": 1}', "not a report"),
        ('{"schema": "another", "version": 1}', "not a report"),
        ('{"schema": "wgpu_gi.bench", "version": 99}', "version 99"),
        ('{"schema": "wgpu_gi.bench", "version": 2, "machine": {}}', "not a report"),
        (
            '{"schema": "wgpu_gi.bench", "version": 2, "machine": {}, "frames": 1, "warm_up": 1, "scenes": [{}]}',
            "not a report",
        ),
        ("\x00\xff", "not a report"),
    ],
)
def test_bad_json_is_a_sentence(tmp_path, text, words):
    path = tmp_path / "old.json"
    if text is not None:
        path.write_bytes(text.encode("latin-1"))
    with pytest.raises(GiError, match=words):
        load_json(path)


def test_tables_show_errors_times_and_the_path_tracer():
    shown = text_of(*(part for titled in tables(report()) for part in titled))
    for words in (
        "cornell, 64x36: error, truth all bounces by path tracer, 256 spp",
        "none, medium",
        "-25.00%",
        "camera moving",
        "passes run",
        "maps",
        "3.0 MiB",
        "4.00 (8.00)",
        "the path tracer, all bounces",
    ):
        assert words in shown, words
    (line,) = [line for line in shown.splitlines() if line.split()[:1] == ["indirect"]]
    assert line.split()[1:] == ["-"] * 4


def test_settled_pictures_have_rows_of_their_own():
    shown = text_of(*(part for titled in tables(report(scene_report(measurement(frames=16)))) for part in titled))
    assert "16 frames" in shown and "0.0125" in shown and "0.2" in shown
    assert "16 frames" not in text_of(*(part for titled in tables(report()) for part in titled))


def test_moving_errors_have_a_table_and_are_in_the_file(tmp_path):
    written = report(scene_report(replace(measurement(), moving=moving()), measurement("ism")))
    save_json(tmp_path / "a.json", written)
    assert load_json(tmp_path / "a.json") == written
    document = json.loads((tmp_path / "a.json").read_text())
    assert document["scenes"][0]["techniques"][0]["moving"]["full"]["lag"] == 7
    del document["scenes"][0]["techniques"][0]["moving"]
    (tmp_path / "old.json").write_text(json.dumps(document))
    assert load_json(tmp_path / "old.json").scenes[0].techniques[0].moving is None
    (title, table), *_ = [found for found in tables(written) if "moving, against" in found[0]]
    lines = text_of(title, table).splitlines()
    assert [c.header for c in table.columns][2:4] == ["flicker", "lag, frames"]
    assert any(line.split()[-6:] == ["0.03", "7", "0.4", "-", "0.05", "+2.00%"] for line in lines)
    assert not [title for title, _ in tables(report()) if "moving, against" in title]


def test_errors_of_an_animation_have_a_table_and_are_in_the_file(tmp_path):
    written = report(scene_report(replace(measurement(), played=played()), measurement("ism")))
    save_json(tmp_path / "report.json", written)
    assert load_json(tmp_path / "report.json") == written
    document = json.loads((tmp_path / "report.json").read_text())
    del document["scenes"][0]["techniques"][0]["played"]
    (tmp_path / "old.json").write_text(json.dumps(document))
    assert load_json(tmp_path / "old.json").scenes[0].techniques[0].played is None
    (table,) = [table for title, table in tables(written) if "while its animation plays" in title]
    rows = list(zip(*(column.cells for column in table.columns), strict=True))
    assert rows == [
        ("none, medium", "full image", "1", "0.5", "-10.00%", "-"),
        ("", "", "8", "0.25", "-5.00%", "0.8"),
        ("", "indirect", "1", "0.7", "+20.00%", "-"),
        ("", "", "8", "-", "-", "-"),
    ]
    assert not [title for title, _ in tables(report()) if "animation" in title]


def test_ratios_are_new_over_old():
    old = report(scene_report(measurement(ms=4.0, relmse=0.2), measurement("gone")))
    new = report(scene_report(measurement(ms=2.0, relmse=0.3), measurement("ism")))
    rows = ratios(old, new)
    assert list(rows) == ["cornell, 64x36, none, medium"]
    row = rows["cornell, 64x36, none, medium"]
    assert row["GPU all"] == pytest.approx(0.5)
    assert row["GPU camera"] == pytest.approx(0.5)
    assert row["wall all"] == pytest.approx(3 / 5)
    assert row["relMSE full"] == pytest.approx(1.5)
    assert row["indirect"] is None  # it was not measured
    assert row["memory"] == 1.0
    shown = text_of(ratio_table(rows))
    assert "0.50" in shown
    assert "1.50" in shown


@pytest.mark.parametrize("other", [{"scene": "corridor"}, {"size": (32, 18)}])
def test_only_equal_measurements_are_compared(other):
    assert ratios(report(scene_report(**other)), report()) == {}
    assert len(ratios(report(scene_report(**other), scene_report()), report())) == 1


def test_error_below_the_noise_has_no_ratio():
    row = ratios(report(), report(scene_report(measurement(relmse=-0.001))))["cornell, 64x36, none, medium"]
    assert row["relMSE full"] is None


def test_another_machine_is_named():
    assert different_machine(report(), MACHINE) is None
    assert different_machine(report(cores=8), MACHINE) is None  # of a GPU, whatever the rest
    assert "across machines mean nothing" in different_machine(report(adapter="Fake 2"), MACHINE)
    slow = MACHINE | {"is_cpu": True}
    assert different_machine(report(is_cpu=True), slow) is None
    assert "8 cores" in different_machine(report(is_cpu=True, cores=8), slow)


@needs_matplotlib
def test_plot_is_a_picture(tmp_path):
    qualities = [measurement(gi, q, ms, 1 / ms) for gi in ("none", "ism") for q, ms in (("low", 2.0), ("high", 8.0))]
    save_plot(tmp_path / "a.png", report(scene_report(*qualities), scene_report(scene="b.glb")))
    picture = load_image(tmp_path / "a.png")
    assert picture.shape[1] > 1000
    assert picture.std() > 0.05
    assert os.listdir(tmp_path) == ["a.png"]


def test_frontier_is_the_pareto_front():
    points = [(None, x, y) for x, y in ((3, 1), (1, 5), (2, 5), (2, 2), (4, 1), (5, 0.5))]
    assert [p[1:] for p in frontier(points)] == [(1, 5), (2, 2), (3, 1), (5, 0.5)]


@needs_matplotlib
def test_plot_of_swept_settings(tmp_path):
    swept = [replace(measurement("ism", "low", 2.0 * n, 1 / n), variant=f"vpl.count={n}") for n in (1, 2, 4)]
    save_plot(tmp_path / "a.svg", report(scene_report(*swept)))
    assert "<!-- 4 -->" in (tmp_path / "a.svg").read_text()


@needs_matplotlib
def test_plot_of_a_black_truth(tmp_path):
    lost = scene_report(measurement(relmse=-1.0))
    save_plot(tmp_path / "a.svg", report(replace(lost, references=[])))
    assert (tmp_path / "a.svg").read_text().startswith("<?xml")


def test_missing_matplotlib_is_a_sentence(tmp_path, monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(bench_plot.importlib, "import_module", missing)
    with pytest.raises(GiError, match=r"pip install matplotlib"):
        save_plot(tmp_path / "a.png", report())
    assert not os.listdir(tmp_path)
