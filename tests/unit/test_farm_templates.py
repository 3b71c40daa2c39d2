"""`farm template`: jobs for OpenJD, Slurm and OpenCue run the same words that were typed, whatever they hold."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from wgpu_gi.__main__ import main
from wgpu_gi.cli.arguments import build_parser
from wgpu_gi.cli.farm_template import words_of_render

WORDS = [
    *("a b'c\"d#JOB#$HOME`x`\\é日.glb", "--light", "sun 0.3,-1,0.2 3,3,2.8", "--light", "point 0,1,2 4,5,6"),
    *("--camera", '{"position":\n[1,2,3],"none":{"a":{}}, "{{Param.X}}":\t1}', "--set", "vpl.count=64"),
    *("--relight=-1=3,2,1", "-q", "--env", "1,2,3", "--frames", "0:240", "--at", "-1.5"),
    *("-o", "#IFRAME#&<x>;/{frame:04d}.exr", "--transparent"),
]
# The order of elements in cjsl-1.12, https://github.com/AcademySoftwareFoundation/OpenCue: each at most once, but env.
OPENCUE = {
    "spec": "facility dept show shot user email uid job depends",
    "job": "paused priority maxretries autoeat localbook os env layers",
    "layers": "layer",
    "layer": "cmd range chunk cores threadable memory gpus gpu gpu_memory timeout timeout_llu tags limits env services",
    "services": "service",
}
REQUIRED = {"spec": "show shot user", "layer": "cmd range chunk", "services": "service", "job": "", "layers": "layer"}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def program(folder):
    """Return a program that prints its arguments as JSON."""
    Path("say.py").write_text("import json, sys; print(json.dumps(sys.argv[1:]))")
    return shlex.join([sys.executable, str(folder / "say.py")])


def job(manager: str, *words: str) -> str:
    file = Path("job")
    assert main(["farm", "template", "--for", manager, "--to", str(file), *words]) == 0
    return file.read_text(encoding="utf-8")


def expected(folder: Path, shard: str) -> list[str]:
    """Return the words of WORDS in the order of the parser, with files in their folder."""
    return [
        *("render", f"{folder}/{WORDS[0]}", *WORDS[5:7], "--env", "1,2,3", *WORDS[1:5], "--relight=-1=3,2,1"),
        *("--at=-1.5", "--set", "vpl.count=64", "--output", f"{folder}/#IFRAME#&<x>;/{{frame:04d}}.exr"),
        *("--transparent", "--frames", "0:240", "--quiet", "--shard", shard),
    ]


def test_slurm_script_runs_the_words(folder, program):
    text = job("slurm", "--program", program, *WORDS)
    assert "#SBATCH --array=1-8\n" in text
    assert text.startswith("#!/bin/sh\n#SBATCH ")
    printed = subprocess.run(
        ["sh", "job"], env={**os.environ, "SLURM_ARRAY_TASK_ID": "3"}, capture_output=True, check=True
    )
    assert json.loads(printed.stdout) == expected(folder, "3/8")
    without = subprocess.run(["sh", "job"], capture_output=True, text=True, check=False)
    assert without.returncode != 0 and "SLURM_ARRAY_TASK_ID" in without.stderr and without.stdout == ""


def test_opencue_command_runs_the_words(folder, program):
    root = ElementTree.fromstring(job("opencue", "--program", program, *WORDS))
    (layer,) = root.iter("layer")
    assert layer.findtext("range") == "1-8" and layer.findtext("chunk") == "1"
    # Cuebot replaces its tokens anywhere; none but the one of the shard may be there.
    command = layer.findtext("cmd")
    for token in ("FRAME", "ZFRAME", "LAYER", "JOB", "FRAMESPEC"):
        assert f"#{token}#" not in command
    assert command.count("#IFRAME#") == 1
    printed = subprocess.run(["sh", "-c", command.replace("#IFRAME#", "3").strip()], capture_output=True, check=True)
    assert json.loads(printed.stdout) == expected(folder, "3/8")


def test_opencue_specification_has_the_elements_of_the_language(monkeypatch):
    monkeypatch.setenv("SHOW", "film")
    monkeypatch.delenv("SHOT", raising=False)
    root = ElementTree.fromstring(job("opencue", "--tasks", "2", *WORDS))
    assert (root.findtext("show"), root.findtext("shot")) == ("film", "testing")
    for element in root.iter():
        names = [child.tag for child in element]
        order = OPENCUE.get(element.tag, "").split()
        assert names == [name for name in order if name in names]
        assert set(REQUIRED.get(element.tag, "").split()) <= set(names)
    assert {element.get("type") for element in root.iter("layer")} == {"Render"}


def test_openjd_template_is_valid_and_holds_the_words(folder, program):
    model = pytest.importorskip("openjd.model")
    template = json.loads(job("openjd", "--program", program, *WORDS))
    parsed = model.decode_job_template(template=template, supported_extensions=["TASK_CHUNKING"])
    values = {parameter["name"]: parameter["default"] for parameter in template["parameterDefinitions"]}
    run = template["steps"][0]["script"]["actions"]["onRun"]
    words = [run["command"], *run["args"]]
    assert words[-1] == "{{Task.Param.Part}}/8" and parsed.steps[0].parameterSpace is not None
    resolved = [values.get(word.removeprefix("{{Param.").removesuffix("}}"), word) for word in words[:-1]]
    assert resolved == [*shlex.split(program), *expected(folder, "")[:-1]]


@pytest.mark.parametrize("words", [WORDS, ["--frames", "1:9", "-o", "{frame}.png", "--gi", "none", "--visible-only"]])
def test_words_mean_the_same_to_render(words, folder):
    """Apart from the folders of files."""
    first = vars(build_parser().parse_args(["render", *words]))
    second = vars(build_parser().parse_args(["render", *words_of_render(["--for", "slurm", *words])]))
    placed = {name: str(folder / first[name]) for name in ("output", "scene") if Path(first[name]).suffix}
    assert second | {"words": None} == first | placed | {"words": None}


def test_template_goes_to_standard_output(capsys):
    assert (
        main(["farm", "template", "--for", "slurm", "-o", "{frame}.png", "--frames", "0:5000", "--tasks", "2000"]) == 0
    )
    assert "MaxArraySize above 2000" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("--for slurm", "--frames 0:240"),
        ("--for condor", "openjd"),
        ("", "--for"),
        ("--for slurm --frames 0:9 -o {frame}.png --shard 1/3", "--shard"),
        ("--for slurm --frames 0:9 -o a.mp4", "no video"),
        ("--for slurm --frames 0:9 -o a.png", "{frame}"),
        ("--for slurm --frames 0:9 -o {frame}.bmp", ".bmp"),
        ("--for slurm --frames 0:9 -o {frame}.png --tasks 10", "only 9 frames"),
        ("--for slurm --frames 0:9 -o {frame}.png --tasks 0", "number of tasks"),
        ("--for slurm --frames 0:9 -o {frame}.png --to none/job", "none"),
        ("--for slurm --frames 0:9 -o {frame}.png --program '", "--program"),
        ("--for slurm --frames 0:9 -o {frame}.png --set vpl.cuont=3", "vpl.count"),
        ("--for slurm --frames 0:9 -o {frame}.png --light moon", "moon"),
        ("--for slurm --frames 0:9 -o {frame}.png --gi none --tiles", "does not go with tiles"),
        ("--for slurm --frames 0:9 -o {frame}.png --time 2s", "--time"),
        ("--for slurm --frames 0:9 -o {frame}.png --env a\x01b.hdr", "control characters"),
        ("--for opencue --frames 0:200000 -o {frame}.png --tasks 150000", "100000"),
        ("--for openjd --frames 0:9 -o {frame}.png --camera {{%s" % ("x" * 1100), "double braces"),
    ],
)
def test_bad_arguments_are_one_sentence(arguments, words, capsys, folder):
    assert main(["farm", "template", *arguments.split()]) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("wgpu-gi: error:") and words in printed.err and printed.err.count("\n") == 1
    assert printed.out == "" and os.listdir(folder) == []
