"""Jobs for other farm managers: templates of OpenJD, Slurm and OpenCue that run one command for each part of the work.

Every task runs the same command with `--shard` and its number, so it knows neither the other tasks nor the manager.
OpenJD: Open Job Description 2023-09 with its extension TASK_CHUNKING (RFC 0001), as JSON. Slurm: a script for `sbatch`.
OpenCue: a job specification for Cuebot, cjsl-1.12.
"""

from __future__ import annotations

import getpass
import json
import os
import re
import shlex
import unicodedata
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from ..errors import GiError

CHUNK_SECONDS = 300  # OpenJD groups tasks to chunks of about this time; loading a scene takes seconds
NOTIFY_SECONDS = 30  # between the request to end and the end of a cancelled task
SLURM_MOST = 1000  # tasks of an array by Slurm's default, MaxArraySize=1001
OPENCUE_MOST = 100_000  # frames of a job in Cuebot: JobSpec.MAX_FRAMES
PARAMETER_LENGTH = 1024  # characters of an OpenJD parameter

SHARD = "--shard"
_OPENCUE_DOCTYPE = (
    '<!DOCTYPE spec PUBLIC "SPI Cue Specification Language" "http://localhost:8080/spcue/dtd/cjsl-1.12.dtd">'
)


@dataclass(frozen=True)
class JobArray:
    """A command, as words, and the number of parts into which `--shard` divides its work."""

    name: str
    command: tuple[str, ...]
    parts: int

    def __post_init__(self) -> None:
        """Raise GiError for a word that cannot be written to every template: with control characters, not Unicode."""
        for word in self.command:
            if any(unicodedata.category(character) in ("Cc", "Cs") and character not in "\n\t" for character in word):
                raise GiError(
                    f"a template cannot hold {word!r}: it has control characters, or bytes that are not UTF-8"
                )


def job_name(scene: str) -> str:
    """Return a name that every manager takes: at least three letters, digits and underscores."""
    return (re.sub(r"\W+", "_", Path(scene).stem, flags=re.ASCII).strip("_") or "scene").ljust(3, "_")[:100]


def openjd_template(job: JobArray) -> str:
    """Return an OpenJD job template: tasks are parts, which a scheduler may group to chunks of consecutive ones.

    Double braces are OpenJD's references, without an escape; words that hold some are job parameters instead.
    """
    parameters: list[dict[str, object]] = []
    words = []
    for word in job.command:
        if "{{" in word or "}}" in word or "\t" in word:
            if len(word) > PARAMETER_LENGTH:
                raise GiError(f"OpenJD takes at most {PARAMETER_LENGTH} characters with double braces: {word}")
            name = f"Argument{len(parameters) + 1}"
            parameters.append({"name": name, "type": "STRING", "default": word})
            word = f"{{{{Param.{name}}}}}"
        words.append(word)
    part = {
        "name": "Part",
        "type": "CHUNK[INT]",
        "range": f"1-{job.parts}",
        "chunks": {"defaultTaskCount": 1, "targetRuntimeSeconds": CHUNK_SECONDS, "rangeConstraint": "CONTIGUOUS"},
    }
    action = {
        "command": words[0],
        "args": [*words[1:], SHARD, f"{{{{Task.Param.Part}}}}/{job.parts}"],
        "cancelation": {"mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": NOTIFY_SECONDS},
    }
    template: dict[str, object] = {
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["TASK_CHUNKING"],
        "name": job.name,
        **({"parameterDefinitions": parameters} if parameters else {}),
        "steps": [
            {
                "name": "Render",
                "parameterSpace": {"taskParameterDefinitions": [part]},
                "script": {"actions": {"onRun": action}},
            }
        ],
    }
    return json.dumps(template, indent=2, ensure_ascii=False) + "\n"


def slurm_script(job: JobArray) -> str:
    """Return a script for `sbatch`: an array of one task per part. It is a POSIX shell script."""
    command = shlex.join([*job.command, SHARD])
    limit = (
        f"# More than {SLURM_MOST} tasks: slurm.conf must have a MaxArraySize above {job.parts}.\n"
        if job.parts > SLURM_MOST
        else ""
    )
    return f"""\
#!/bin/sh
#SBATCH --job-name={job.name}
#SBATCH --array=1-{job.parts}
#SBATCH --requeue
#SBATCH --open-mode=append
# Frames that exist are skipped, so a task may run again: after a requeue, or by sbatch --array=3,7 for tasks 3 and 7.
{limit}# Other options of sbatch, such as --partition or --gres=gpu:1, go here or on its command line.
exec {command} "${{SLURM_ARRAY_TASK_ID:?is set by sbatch}}/{job.parts}"
"""


def opencue_specification(job: JobArray) -> str:
    """Return a job specification for Cuebot: a layer with one frame per part.

    SHOW and SHOT, the variables of OpenCue, give the show and the shot. Raises GiError for more frames than a job has.
    """
    if job.parts > OPENCUE_MOST:
        raise GiError(f"OpenCue takes at most {OPENCUE_MOST} tasks in a job, not {job.parts}; give a smaller --tasks")
    # Cuebot replaces tokens such as #JOB# anywhere in a command: quotes around each # keep those of the arguments.
    command = shlex.join([*job.command, SHARD]).replace("#", "'\"#\"'")
    root = ElementTree.Element("spec")
    _child(root, "show", os.environ.get("SHOW", "testing"))
    _child(root, "shot", os.environ.get("SHOT", "testing"))
    _child(root, "user", getpass.getuser())
    element = ElementTree.SubElement(root, "job", name=job.name)
    _child(element, "paused", "False")
    _child(element, "maxretries", "1")
    _child(element, "autoeat", "False")
    layer = ElementTree.SubElement(ElementTree.SubElement(element, "layers"), "layer", name="render", type="Render")
    _child(layer, "cmd", f"{command} #IFRAME#/{job.parts}")
    _child(layer, "range", f"1-{job.parts}")
    _child(layer, "chunk", "1")
    _child(ElementTree.SubElement(layer, "services"), "service", "default")
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{_OPENCUE_DOCTYPE}\n{ElementTree.tostring(root, "unicode")}\n'


def _child(parent: ElementTree.Element, name: str, text: str) -> None:
    ElementTree.SubElement(parent, name).text = text
