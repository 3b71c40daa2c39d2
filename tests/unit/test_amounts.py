"""Amounts of a budget: texts with a unit, limits, and which `--time` is a time in the animation."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.budget.amounts import LEAST_ERROR, checked_error, checked_seconds, seconds_of
from wgpu_gi.cli.argument_types import Amount, parse_amount
from wgpu_gi.cli.arguments import build_parser
from wgpu_gi.cli.budgets import Budget, budget_of, check_budget, settle_time
from wgpu_gi.errors import GiError
from wgpu_gi.scene.animation import Animation
from wgpu_gi.scene.scene import Scene


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("2s", 2), ("500ms", 0.5), ("1.5min", 90), ("1h", 3600), (" 2 s ", 2), (".5s", 0.5), ("2", None), ("-1", None)],
)
def test_a_text_with_a_unit_is_a_budget(text, seconds):
    assert seconds_of(text) == seconds


@pytest.mark.parametrize("text", ["", "s", "two", "2m", "2 weeks", "1h30min", "nans", "infs", "0x1s", "2,5s"])
def test_other_texts_are_no_times(text):
    with pytest.raises(GiError, match="a time is a number, with a unit"):
        seconds_of(text)


@pytest.mark.parametrize("text", ["0s", "-2s", "1e400h", "1e-330s"])
def test_budgets_are_finite_and_above_zero(text):
    with pytest.raises(GiError, match="a time budget must be a finite number of seconds above 0"):
        seconds_of(text)


@pytest.mark.parametrize("value", [0, -1, np.nan, np.inf, True, None, "1", 10**400, 1j, np.zeros(2)])
def test_amounts_are_finite_and_above_zero(value):
    for check in (checked_seconds, checked_error):
        with pytest.raises(GiError):
            check(value)


def test_errors_have_a_limit():
    assert checked_error(LEAST_ERROR) == LEAST_ERROR and checked_error(np.float32(0.5)) == 0.5
    with pytest.raises(GiError, match="out of reach"):
        checked_error(LEAST_ERROR / 2)


@pytest.mark.parametrize(
    ("words", "animated", "at", "budget"),
    [
        ("", True, None, None),
        ("--time 2s", True, None, Budget(2.0, None)),
        ("--time 2", True, 2.0, None),
        ("--time 2", False, None, Budget(2.0, None)),
        ("--time 2 --at 1", True, 1.0, Budget(2.0, None)),
        ("--time 2s --at 1 --error 0.01", True, 1.0, Budget(2.0, 0.01)),
        ("--time 2 --animation walk", False, 2.0, None),
        ("--time 2 --frames 0:3", False, 2.0, None),
        ("s.usda --time 2", False, 2.0, None),
        ("s.usda --time 2s", False, None, Budget(2.0, None)),
        ("--error 0.01", False, None, Budget(None, 0.01)),
    ],
)
def test_a_time_is_a_budget_or_a_time_in_the_animation(words, animated, at, budget):
    arguments = build_parser().parse_args(["render", *words.split()])
    scene = Scene(animations=[Animation("walk")] if animated else [])
    settle_time(arguments, None)
    settle_time(arguments, scene)
    assert (arguments.time, budget_of(arguments)) == (at, budget)


@pytest.mark.parametrize(
    "words",
    [
        "--time 1s --frames 0:3",
        "--error 0.1 --frames 0:3",
        "--time 1s --check",
        "--error 0.1 --timings",
        "--time 1s --show vpl",
    ],
)
def test_flags_that_do_not_go_with_a_budget(words):
    with pytest.raises(GiError, match="leave out"):
        check_budget(build_parser().parse_args(["render", *words.split()]))


def test_an_amount_of_the_command_line_knows_its_unit():
    assert parse_amount("2") == Amount(2.0, False) and parse_amount("2s") == Amount(2.0, True)
