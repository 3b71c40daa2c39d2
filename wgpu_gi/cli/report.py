"""`wgpu-gi report`: measures an adapter, writes a .json and a page; shows reports of several adapters side by side."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from ..errors import GiError
from ..measure.adapter.page import save_page, verdict
from ..measure.adapter.results import AdapterReport, load_json, save_json
from ..measure.adapter.run import measure_adapter
from ..measure.adapter.scenes import sponza
from ..measure.adapter.tables import grids, left_out, markdown
from ..pictures.atomic_file import check_writable
from .messages import Messages

FOUND = 1
SUFFIXES = (".json", ".html")
LEAST_MINUTES, MOST_MINUTES = 0.1, 10_000.0


def report(arguments: Namespace) -> int:
    """Run `wgpu-gi report`; return 0, or 1 if a check failed. Raises GiError for an error that the user can fix."""
    say = Messages(arguments.verbose, arguments.quiet)

    # Check the arguments before any slow step.
    if not LEAST_MINUTES <= arguments.minutes <= MOST_MINUTES:
        raise GiError(f"--minutes must lie between {LEAST_MINUTES:g} and {MOST_MINUTES:g}, not {arguments.minutes:g}")
    json_path, page_path = output_names(arguments.output)
    measures = not arguments.report
    if not measures and (arguments.against or arguments.sponza or arguments.adapter):
        raise GiError("reports that are given are shown as they are, without --against, --sponza or --adapter")
    for path in (json_path, page_path) if measures else (page_path,):
        check_writable(path)
    if any(json_path.resolve() == Path(path).resolve() for path in arguments.against):
        raise GiError(f"{json_path} would replace the report to compare with; -o NAME gives this one another name")
    others = [load_json(path) for path in (arguments.report or arguments.against)]
    scene = None if arguments.sponza is None else sponza(arguments.sponza)

    # Measure, and write the files.
    reports = others
    if measures:
        with say.progress("report") as bar:
            here = measure_adapter(60 * arguments.minutes, arguments.adapter, scene, bar)
        save_json(json_path, here)
        reports = [here, *others]
    save_page(page_path, reports)
    print_report(reports, arguments.markdown)
    say.result(" and ".join([str(json_path), str(page_path)] if measures else [str(page_path)]))
    return FOUND if measures and reports[0].failed else 0


def output_names(output: str) -> tuple[Path, Path]:
    """Return the names of the .json and of the page: `output` with either suffix."""
    path = Path(output)
    if path.suffix.lower() in SUFFIXES:
        path = path.with_suffix("")
    if path.name.lower() in ("", "..", *SUFFIXES):
        raise GiError(f"-o takes the name of two files without their suffix, such as report, not {output!r}")
    return path.with_name(path.name + ".json"), path.with_name(path.name + ".html")


def print_report(reports: list[AdapterReport], as_markdown: bool) -> None:
    """Print all tables as Markdown, or the verdict and what was left out."""
    if as_markdown:
        print(markdown(grids(reports, passes=False)))
        return
    for one in reports:
        print(verdict(one))
    for sentence in left_out(reports):
        print(f"left out: {sentence}")
