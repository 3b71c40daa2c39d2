"""`wgpu-gi report`: its JSON file, tables, page and arguments; `frame/test_report.py` measures."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from wgpu_gi.__main__ import main
from wgpu_gi.errors import GiError
from wgpu_gi.measure.adapter import clock, source_tests
from wgpu_gi.measure.adapter.budget import Budget
from wgpu_gi.measure.adapter.page import page, verdict
from wgpu_gi.measure.adapter.results import load_json, save_json
from wgpu_gi.measure.adapter.scenes import VARIANTS, cornell, pebble
from wgpu_gi.measure.adapter.tables import grids, left_out, markdown, titles
from wgpu_gi.options import TECHNIQUES
from wgpu_gi.settings import validate

from .adapter_report_data import made_report


def test_a_report_survives_its_file(tmp_path):
    report = made_report()
    save_json(tmp_path / "a.json", report)
    assert load_json(tmp_path / "a.json") == report


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d.pop("rays"),
        lambda d: d["machine"].pop("adapter"),
        lambda d: d["scenes"][0].update(size=3),
        lambda d: d["scenes"][0]["techniques"][0].update(passes_ms="fast"),
        lambda d: d["checks"][0].update(unknown=1),
        lambda d: d["checks"][0].pop("bound"),
        lambda d: d.update(schema="wgpu_gi.bench"),
        lambda d: d.update(limits=[1]),
        lambda d: d.update(seconds=None),
        lambda d: d.update(memory=float("inf")),
        lambda d: d["machine"].update(packages=["wgpu_gi"]),
        lambda d: d["scenes"][0]["techniques"][0]["passes"].update(gather="slow"),
        lambda d: d["builds"][0].update(ms=float("nan")),
        lambda d: d["tests"].update(names=3),
    ],
)
def test_a_damaged_report_is_refused_in_a_sentence(tmp_path, change):
    path = tmp_path / "a.json"
    save_json(path, made_report())
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    with pytest.raises(GiError, match="not a report of wgpu-gi report"):
        load_json(path)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"schema": 1}', "[" * 100_000])
def test_other_files_are_refused(tmp_path, text):
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(GiError, match="not a report"):
        load_json(tmp_path / "a.json")


def test_another_version_is_named(tmp_path):
    path = tmp_path / "a.json"
    save_json(path, made_report())
    path.write_text(path.read_text().replace('"version": 1', '"version": 99'))
    with pytest.raises(GiError, match="version 99"):
        load_json(path)


def test_tables_have_a_column_for_each_report():
    first, second = made_report(), made_report("B", 2.0)
    second.scenes[0].techniques[0].passes["only here"] = 1.0
    for grid in grids([first, second]):
        assert {len(row) for row in grid.rows} == {3}
        assert grid.rows[0][1:] == ["A <fast> GPU", "B"]
    rows = {row[0]: row[1:] for grid in grids([first, second]) for row in grid.rows}
    assert rows["Cornell: many-light"] == ["3.00 / 3.50, 1 MiB", "6.00 / 7.00, 1 MiB"]
    assert rows["pebble, 81,920 triangles: shadow"] == ["2 billion", "1 billion"]
    assert rows["only here"] == ["-", "1.00"]


def test_one_adapter_twice_is_told_apart_by_its_driver():
    other = made_report()
    other.machine["driver"] = "driver 2"
    assert titles([made_report(), other]) == ["A <fast> GPU, driver 1", "A <fast> GPU, driver 2"]


def test_markdown_has_rows_of_equal_length():
    text = markdown(grids([made_report(), made_report("B | C")], passes=False))
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert len(lines) > 30
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in lines} == {4}
    assert "Passes" not in text


def test_page_is_one_file_with_escaped_names():
    text = page([made_report(), made_report("B")])
    assert "A &lt;fast&gt; GPU" in text and "<fast>" not in text
    assert "the time was over" in text and "test_b" in text and "gather" in text
    assert not re.search(r"(src|href)=|https?://|\$[a-z]", text)


def test_verdict_names_failed_checks():
    assert verdict(made_report("B")) == "B: all 1 checks passed"
    assert verdict(made_report("B", passed=False)) == "B: 1 of 1 checks failed: sun, none"
    assert "FAILED: 0.5" in page([made_report(passed=False)])


def test_what_was_left_out_names_its_adapter_among_several():
    assert left_out([made_report("B")]) == ["path in Cornell: the time was over"]
    assert left_out([made_report("B"), made_report("C")])[1] == "C: path in Cornell: the time was over"


def test_budget_notes_what_does_not_fit():
    budget = Budget(1000.0)
    assert budget.allows("a short step", 1.0)
    assert not budget.allows("a long step", 2000.0)
    budget.seconds = 0.0
    assert not budget.allows("a late step")
    assert budget.left_out[0].startswith("a long step: it takes about 2000 s, and ")
    assert budget.left_out[1] == "a late step: the time was over"


def test_a_step_that_fails_is_left_out_and_the_report_goes_on():
    budget = Budget(1000.0)
    with budget.noting("error of ssil"):
        raise GiError("the shader does not compile")
    assert budget.left_out == ["error of ssil: the shader does not compile"]


def test_processor_clock_does_not_count_waiting():
    import time

    started = clock.processor_clock()
    time.sleep(0.2)
    assert clock.processor_clock() - started < 0.1
    assert clock.clock_for(False) is time.perf_counter


def test_every_technique_is_measured_with_valid_settings():
    assert {variant.gi for variant in VARIANTS} == set(TECHNIQUES)
    for variant in VARIANTS:
        validate(variant.settings())
    scene, _ = cornell()
    (maps,) = [variant for variant in VARIANTS if variant.single_light]
    assert maps.scene(scene).lights == scene.lights[:1] and maps.scene(scene).environment is None


def test_the_camera_sees_the_pebble():
    scene, camera = pebble()
    to_middle = scene.bounds().mean(0) - camera.world_from_view[:3, 3]
    assert to_middle @ -camera.world_from_view[:3, 2] > 0.99 * np.linalg.norm(to_middle)


def test_outcomes_of_the_checkouts_tests_are_read(tmp_path, monkeypatch):
    monkeypatch.setattr(source_tests, "FOLDERS", ("t",))
    monkeypatch.setattr(source_tests, "LEFT_OUT", ())
    (tmp_path / "t").mkdir()
    (tmp_path / "t" / "test_x.py").write_text(
        "import pytest\ndef test_a(): pass\n@pytest.mark.skip\ndef test_b(): pass\n"
        "@pytest.mark.parametrize('x', ['1 2'])\ndef test_c(x): assert 0\n"
    )
    run = source_tests.run_tests(tmp_path, 60.0)
    assert (run.passed, run.failed, run.skipped, run.finished) == (1, 1, 1, True)
    assert run.names == ["t/test_x.py::test_c[1 2]"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--minutes", "0"], "--minutes must lie between"),
        (["--minutes", "nan"], "--minutes must lie between"),
        (["-o", "missing/report"], "there is no folder missing"),
        (["-o", ".json"], "-o takes the name of two files"),
        (["missing.json"], "missing.json: cannot be read"),
        (["--against", "missing.json"], "missing.json: cannot be read"),
        (["a.json", "--against", "b.json"], "without --against"),
        (["-o", "a", "--against", "a.json"], "a.json would replace the report to compare with"),
        (["--sponza", "missing.glb"], "missing.glb"),
        (["--adapter", "none such"], "no adapter is called"),
    ],
)
def test_bad_arguments_are_one_sentence(tmp_path, monkeypatch, capsys, arguments, sentence):
    monkeypatch.chdir(tmp_path)
    assert main(["report", *arguments]) == 2
    captured = capsys.readouterr()
    assert sentence in captured.err and len(captured.err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_earlier_reports_become_one_page(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    save_json("a.json", made_report())
    save_json("b.json", made_report("B", 2.0, passed=False))
    assert main(["report", "a.json", "b.json", "-o", "both.html"]) == 0
    assert "B: 1 of 1 checks failed" in capsys.readouterr().out
    assert {p.name for p in tmp_path.iterdir()} == {"a.json", "b.json", "both.html"}
    assert main(["report", "a.json", "b.json", "-o", "both", "--markdown", "-q"]) == 0
    assert "| Cornell: many-light | 3.00 / 3.50, 1 MiB | 6.00 / 7.00, 1 MiB |" in capsys.readouterr().out
