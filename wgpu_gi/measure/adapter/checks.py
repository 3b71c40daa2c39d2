"""The self-test of an adapter and its driver: functions of the shaders, and pictures, against closed forms.

Each check returns its deviation, which must not exceed its bound. `tests/analytic/test_self_test.py` runs them, too.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import wgpu

from ...errors import GiError
from ...options import Settings
from ..stress.studio import Studio, Trouble
from ..wgsl_evaluator import Evaluator
from . import picture_checks as pictures
from . import shader_checks as shaders
from .budget import Budget
from .results import CheckResult

SIZE = (32, 18)  # pixels of the pictures
FRAME_SECONDS = 60.0  # a picture that takes longer fails its check


@dataclass(frozen=True)
class Tools:
    """What checks work with: calls of WGSL functions, and pictures."""

    evaluate: Evaluator
    studio: Studio


@dataclass(frozen=True)
class Check:
    """A check: `run` returns the deviation that must not exceed `bound`."""

    group: str
    name: str
    sentence: str
    bound: float
    run: Callable[[Tools], float]


def _shader(name: str, bound: float, run: Callable[[Evaluator], float]) -> Check:
    return Check("shaders", name, (run.__doc__ or "").strip(), bound, lambda tools: run(tools.evaluate))


def _picture(name: str, gi: str, bound: float, run: Callable[[Studio, str], float]) -> Check:
    sentence = f"{gi}: {(run.__doc__ or '').strip()}"
    return Check("light", f"{name}, {gi}", sentence, bound, lambda tools: run(tools.studio, gi))


# The G-buffer stores square roots of colours in 10 bits, which is off by 0.1 % for an albedo of 0.5. Closed forms that
# need random samples, or the facets of a sphere, hold within 0.1 % here, too.
PACKED = 0.003
# Bounds of shaders: 0 where results are integers; elsewhere what WGSL grants its functions (section 15.7.4), and the
# rounding of float32.
CHECKS: tuple[Check, ...] = (
    _shader("hashes", 0.0, shaders.hashes),
    _shader("Sobol points", 0.0, shaders.sobol_points),
    _shader("workgroups", 0.0, shaders.workgroups),
    _shader("not finite", 0.0, shaders.not_finite),
    _shader("half floats", 2.0**-11, shaders.half_floats),
    _shader("sine and cosine", 2.0**-11, shaders.sine_and_cosine),
    _shader("octahedral codes", 3e-6, shaders.octahedral_codes),
    _shader("reciprocity", 1e-5, shaders.reciprocity),
    _shader("first hits", 1e-4, shaders.first_hits),
    _shader("any hits", 0.0, shaders.any_hits),
    *(_picture("sun", gi, PACKED, pictures.sun) for gi in pictures.TECHNIQUES),
    *(_picture("point light", gi, PACKED, pictures.point_light) for gi in ("none", "path")),
    *(_picture("white sky", gi, PACKED, pictures.white_sky) for gi in pictures.TECHNIQUES),
    _picture("closed box", "path", PACKED, pictures.closed_box),
    _picture("facing plates", "path", PACKED, pictures.facing_plates),
    *(_picture("light in a sphere", gi, 2 * PACKED, pictures.light_in_a_sphere) for gi in ("many-light", "path")),
    *(_picture("twice the light", gi, 0.0, pictures.twice_the_light) for gi in pictures.TECHNIQUES),
    *(_picture("repetition", gi, 0.0, pictures.repetition) for gi in pictures.TECHNIQUES),
)


def run_checks(budget: Budget, checks: Sequence[Check] = CHECKS, adapter: str | None = None) -> list[CheckResult]:
    """Run the checks as far as the budget reaches."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        studio = Studio(SIZE, adapter=adapter, settings=Settings(diffuse=True), frame_seconds=FRAME_SECONDS)
        tools = Tools(Evaluator(Path(folder), adapter), studio)
        for check in checks:
            if budget.allows(f"check {check.name}"):
                found.append(run_check(check, tools))
        studio.reset()
    return found


def run_check(check: Check, tools: Tools) -> CheckResult:
    """Run a check; an error of the driver is a failure."""
    started = time.perf_counter()
    deviation, note = None, ""
    try:
        deviation = float(check.run(tools))
    except Trouble as trouble:
        note = trouble.sentence
    except (GiError, wgpu.GPUError) as error:
        note = " ".join(str(error).split())
    # NaN is no deviation within the bound.
    passed = deviation is not None and deviation <= check.bound
    if deviation is not None and not abs(deviation) < float("inf"):
        deviation, note = None, "the result is not finite"
    seconds = time.perf_counter() - started
    return CheckResult(check.group, check.name, check.sentence, passed, deviation, check.bound, note, seconds)
