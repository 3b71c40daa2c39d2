"""The self-test of `wgpu-gi report` passes on this adapter, and its checks can fail."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.measure.adapter.budget import Budget
from wgpu_gi.measure.adapter.checks import CHECKS, SIZE, Tools, run_check, run_checks
from wgpu_gi.measure.adapter.picture_checks import builtin
from wgpu_gi.measure.stress.studio import Studio
from wgpu_gi.measure.wgsl_evaluator import Evaluator
from wgpu_gi.options import TECHNIQUES, Settings

QUICK = ("shaders", "sun, none", "sun, path", "point light", "closed box", "facing plates", "twice the light, none")


def is_quick(check):
    return check.group in QUICK or check.name.startswith(QUICK)


@pytest.fixture(scope="module")
def tools(tmp_path_factory):
    return Tools(Evaluator(tmp_path_factory.mktemp("wgsl")), Studio(SIZE, settings=Settings(diffuse=True)))


@pytest.mark.parametrize(
    "check", [pytest.param(c, id=c.name, marks=() if is_quick(c) else pytest.mark.slow) for c in CHECKS]
)
def test_check_passes(tools, check):
    result = run_check(check, tools)
    assert result.passed, (result.deviation, result.note)
    # The bound is not so wide that it says nothing.
    assert check.bound <= 0.01


def test_every_technique_is_checked():
    for name in ("sun", "twice the light", "repetition"):
        assert {c.name for c in CHECKS} >= {f"{name}, {gi}" for gi in TECHNIQUES}


def check_of(name):
    return next(check for check in CHECKS if check.name == name)


@pytest.mark.parametrize("name", ["plane_sun", "plane_point", "closed_box", "plates"])
def test_a_picture_that_is_one_percent_off_fails(tools, monkeypatch, name):
    """The scene has another albedo than the closed form."""
    checks = {
        "plane_sun": "sun, none",
        "plane_point": "point light, none",
        "closed_box": "closed box, path",
        "plates": "facing plates, path",
    }
    make = getattr(builtin, name)
    monkeypatch.setattr(builtin, name, lambda *values: make(*values[:-1], 1.01 * values[-1]))
    result = run_check(check_of(checks[name]), tools)
    assert not result.passed and result.deviation == pytest.approx(0.01, rel=0.3)


def test_wrong_results_of_shaders_fail(tools):
    """Each result is in the wrong place, and off by one, or by one part in a hundred and more in each call."""

    class Wrong:
        device, factor = tools.evaluate.device, 1.0

        def __call__(self, *arguments, **named):
            got = tools.evaluate(*arguments, **named)
            self.factor *= 1.01
            return got + 1 if got.dtype == np.uint32 else got[::-1] * np.float32(self.factor)

    for check in CHECKS:
        if check.group == "shaders" and check.name not in ("workgroups", "not finite"):
            assert not run_check(check, Tools(Wrong(), tools.studio)).passed, check.name


def test_nothing_runs_without_time():
    budget = Budget(0.0)
    assert run_checks(budget) == []
    assert len(budget.left_out) == len(CHECKS)
