"""`wgpu-gi stress`: its arguments, exit codes and files, without a GPU."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from wgpu_gi.__main__ import main
from wgpu_gi.cli import stress as command
from wgpu_gi.measure.stress.checks import CHECKS
from wgpu_gi.measure.stress.findings import Case
from wgpu_gi.measure.stress.results import Record, Report
from wgpu_gi.options import TECHNIQUES

MACHINE = {"adapter": "fake", "driver": "1", "cores": 2, "is_cpu": False}


@pytest.fixture
def planned(monkeypatch):
    """Replace the run; return the plans, and the report that runs return."""
    plans, report = [], Report(MACHINE, (64, 36))

    def run(plan, studios, machine, progress):
        plans.append((plan, studios))
        for record in report.records:
            progress(record, report)
        return report

    monkeypatch.setattr(command, "run", run)
    monkeypatch.setattr(command, "machine", lambda adapter: MACHINE)
    return plans, report


def record(verdict="passed", **case):
    fields = {"kind": "room", "seed": 0, "gi": "ssil", "check": "finite", **case}
    failure = "NaN values" if verdict == "failed" else ""
    return Record(Case(**fields), verdict, failure, "a sentence", {}, None, 0.1)


def test_defaults_are_all_kinds_and_techniques_in_turns(planned):
    assert main(["stress"]) == 0
    ((plan, studios),) = planned[0]
    assert plan.seeds == range(100) and plan.checks is None and plan.minutes is None
    assert set(plan.techniques) == set(TECHNIQUES) and {"room", "extreme"} <= set(plan.kinds)
    assert [s.size for s in studios.values()] == [(64, 36)]


def test_choices_reach_the_plan(planned, tmp_path):
    words = "--kinds room,far --seeds 3:5 --gi ssil,none --checks cut,finite --minutes 2 --quality low,high"
    assert (
        main(["stress", *words.split(), "--size", "48x27", "-o", str(tmp_path / "new"), "--set", "vpl.count=64"]) == 0
    )
    ((plan, studios),) = planned[0]
    assert (plan.kinds, plan.seeds, plan.techniques) == (("room", "far"), range(3, 5), ("ssil", "none"))
    assert (plan.checks, plan.minutes, plan.qualities) == (("cut", "finite"), 2.0, ("low", "high"))
    assert [s.settings.vpl.count for s in studios.values()] == [64, 64]
    assert studios["low"].settings.camera.frames < studios["high"].settings.camera.frames
    assert (tmp_path / "new" / "index.html").exists()


def test_a_file_is_checked_instead_of_random_scenes(planned):
    assert main(["stress", "--scene", "cornell", "--checks", "all", "--seeds", "7:8"]) == 0
    ((plan, _),) = planned[0]
    assert plan.kinds == ("file",) and plan.checks == tuple(CHECKS) and plan.source == ["--scene", "cornell"]
    assert plan.make("file", 7).name == "cornell"


def test_exit_codes_and_files(planned, tmp_path, capsys):
    _, report = planned
    report.records += [record(), record("failed", seed=1), record("failed", gi="none")]
    out = tmp_path / "out.json"
    assert main(["stress", "--json", str(out), "-v"]) == 1
    shown = capsys.readouterr()
    assert "2 failures in 3 cases" in shown.out and "finite of ssil: NaN values, in 1 room; first room 1" in shown.out
    assert "room 1 ssil finite: NaN values: a sentence" in shown.err
    assert [case["verdict"] for case in json.loads(out.read_text())["cases"]] == ["passed", "failed", "failed"]
    report.interrupted = True
    assert main(["stress"]) == 130


def test_the_list_of_checks(capsys):
    assert main(["stress", "--checks", "help"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(CHECKS)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--kinds rooms", "--kinds does not know 'rooms'; did you mean room"),
        ("--gi fast", "--gi does not know 'fast'; available: none"),
        ("--checks cuts", "--checks does not know 'cuts'; did you mean cut"),
        ("--quality best", "--quality does not know 'best'"),
        ("--seeds 5", "seeds are FIRST:END"),
        ("--minutes 0", "--minutes must lie between 0 and"),
        ("--minutes nan", "--minutes must lie between 0 and"),
        ("--reduce -1", "--reduce must lie between 0 and"),
        ("--size 0x9", "a picture has at least 1x1 pixels"),
        ("--set gi=none", "stress sets gi itself"),
        ("--set vpl.count=x", "vpl.count takes a whole number"),
        ("--scene nowhere.glb", "nowhere.glb"),
        ("--env 1,1,1", "--env goes with --scene"),
        ("--json no/folder/x.json", "there is no folder no/folder"),
        ("-o /dev/null/x", "cannot be made"),
    ],
)
def test_bad_arguments_are_one_sentence(planned, capsys, words, message):
    assert main(["stress", *words.split()]) == 2
    error = capsys.readouterr().err
    assert error.startswith("wgpu-gi: error: ") and message in error and error.count("\n") == 1
    assert not planned[0]


def test_commands_name_what_differs_from_the_defaults():
    from wgpu_gi.measure.stress.run import command_of

    case = Case("room", 7, "ssil", "cut")
    assert command_of(case, (64, 36), ["--kinds", "room"]) == (
        "wgpu-gi stress --kinds room --seeds 7:8 --gi ssil --checks cut --size 64x36"
    )
    assert command_of(replace(case, quality="low"), (9, 9), ["--scene", "a b.glb"]).endswith("--quality low")
