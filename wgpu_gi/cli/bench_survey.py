"""`wgpu-gi bench SCENE` alone: measures every technique in about a minute, prints a ranking, draws a plot."""

from __future__ import annotations

import importlib.util
from argparse import Namespace

from ..errors import GiError
from ..measure.bench import machine
from ..measure.plot import PLOT_FORMATS, require_matplotlib
from ..measure.ranking import LIMITS_MS, ranked, ranking_table
from ..measure.survey import Survey, survey_scene
from ..measure.survey_plot import save_survey_plot
from ..pictures.denoise import has_denoiser
from .bench_parts import check_suffix, print_table, shown_scene
from .common import warn_of_cpu
from .messages import Messages

PLOT = "bench.png"


def survey(arguments: Namespace, say: Messages) -> int:
    """Measure the scenes of the arguments; return the exit code. Raises GiError for an error that the user can fix."""
    # Check the arguments before any slow step.
    plot = arguments.plot or (PLOT if importlib.util.find_spec("matplotlib") else None)
    if plot is not None:
        check_suffix("--plot", plot, PLOT_FORMATS)
        require_matplotlib()
    here = machine(arguments.adapter)
    warn_of_cpu(here["adapter"], here["is_cpu"], say)

    # Measure, and print each ranking as soon as it is known.
    surveys = []
    for source in dict.fromkeys(arguments.scene):
        surveys.append(_measured(arguments, source, say))
        _print(surveys[-1], say)
    print(f"on {here['adapter']}, {here['cores']} cores; times without loading and compiling")
    if plot is not None:
        save_survey_plot(plot, surveys, here["adapter"])
        say.result(f"{plot}: error against time")

    # Say what is missing.
    if arguments.plot is None and plot is None:
        say.note("a plot needs a package: pip install matplotlib")
    if not has_denoiser():
        say.note("the path tracer's pictures are not denoised, which needs a package: pip install pyoidn")
    return 0


def _measured(arguments: Namespace, source: str, say: Messages) -> Survey:
    name, scene, camera = shown_scene(arguments, source, say)
    with say.progress(name) as bar:
        try:
            return survey_scene(
                name,
                scene,
                camera,
                diffuse=arguments.diffuse,
                adapter=arguments.adapter,
                progress=lambda what, fraction: bar(fraction, f"{name}: {what}"),
            )
        except GiError as error:
            raise GiError(f"{name}: {error}") from None


def _print(survey: Survey, say: Messages) -> None:
    size = "{}x{}".format(*survey.size)
    rows = ranked(survey.points, survey.noise)
    print_table(f"{survey.scene}, {size}: truth {survey.truth}, all bounces", ranking_table(rows, survey.noise))
    for limit, text in LIMITS_MS.items():
        if rows and not any(row.point.ms <= limit for row in rows):
            say.note(f"{survey.scene}: no picture within {text}")
    if not rows:
        say.note(f"{survey.scene}: the truth is black, so there is nothing to compare")
    if survey.left_out:
        say.note(f"{survey.scene}: no time for {'; '.join(survey.left_out)}; --gi and --quality measure them")
