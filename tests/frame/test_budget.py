"""Pictures within a budget: time, error, an interruption, and what the next picture of the view starts from."""

from __future__ import annotations

import numpy as np
import pytest

import wgpu_gi as gi
from wgpu_gi.budget.refine import render_within
from wgpu_gi.errors import GiError
from wgpu_gi.renderer import Renderer, Settings

SIZE = (32, 18)


@pytest.fixture
def renderer(tmp_path, monkeypatch):
    monkeypatch.setenv("WGPU_GI_CACHE", str(tmp_path))
    with Renderer(gi.load("cornell-point"), size=SIZE) as renderer:
        yield renderer


@pytest.fixture
def clock(monkeypatch):
    """A clock that runs 0.1 s a frame, so that times do not depend on the machine."""
    seconds = [0.0]

    def slow(own, cost):
        def method(self, *args, **kwargs):
            seconds[0] += cost
            return own(self, *args, **kwargs)

        return method

    monkeypatch.setattr(Renderer, "step", slow(Renderer.step, 0.1))
    monkeypatch.setattr(Renderer, "trace_pixels", slow(Renderer.trace_pixels, 0.1))
    return lambda: seconds[0]


def test_frames_end_with_the_time(renderer, clock):
    steps = []
    report = lambda fraction, what: steps.append((fraction, what))  # noqa: E731
    outcome = render_within(renderer, 3.0, None, ("none",), report, clock=clock)
    assert 2.7 <= outcome.seconds <= 3.15
    assert outcome.reason == "the time is over"
    assert outcome.candidate.gi == renderer.settings.gi == "none"
    assert np.asarray(renderer.read_back()).shape == (18, 32, 3)
    assert "the time is over" in outcome.sentence()
    assert steps
    assert all(0 <= fraction <= 1 for fraction, _ in steps)


def test_an_error_is_certified(renderer):
    outcome = render_within(renderer, None, 0.05, ("path",))
    assert outcome.certificate is not None
    assert outcome.certificate.relmse.value <= 0.05
    assert outcome.frames >= 4
    assert "0.05" in outcome.reason


def test_an_error_below_the_bias_ends_with_the_noise(renderer):
    """Direct light alone lacks the indirect, however many frames there are."""
    outcome = render_within(renderer, None, 0.01, ("none",), quality="low")
    assert outcome.reason == "more frames cannot reach relMSE 0.01: what is left is bias"
    assert outcome.certificate.relmse.value > 0.01
    assert outcome.candidate.quality == "low"


def test_a_refuted_candidate_gives_way_to_one_that_can(renderer):
    outcome = render_within(renderer, None, 0.02, ("none", "path"))
    assert outcome.candidate.gi == "path"
    assert outcome.certificate.relmse.value <= 0.02


def test_a_black_scene_ends_without_a_certificate():
    empty = gi.Scene(environment=gi.Environment((1.0, 1.0, 1.0)))
    picture = gi.render(empty, size=SIZE, transparent=True, gi="none", error=0.1)
    assert "no certificate: the truth is black" in picture.outcome.reason
    assert picture.certificate is None


def test_a_stop_leaves_the_picture_so_far(renderer):
    asked = iter([False, False, True])
    outcome = render_within(renderer, 1000.0, None, ("path",), stop=lambda: next(asked))
    assert outcome.reason == "stopped by the caller"
    assert np.asarray(renderer.read_back()).mean() > 0


def test_a_second_picture_starts_from_what_was_measured(renderer, clock):
    """Also from what traced pixels tell; a short time has none."""
    first = render_within(renderer, 4.0, None, ("many-light", "path"), quality="low", clock=clock)
    assert 0 < first.traced_seconds <= 1.0
    renderer.settings = Settings(seed=1)
    again = render_within(renderer, 0.5, None, ("many-light", "path"), quality="low", clock=clock)
    assert again.traced_seconds == 0
    measured = [{row[0].lstrip("> ") for row in one.table.rows if row[-1] == "measured"} for one in (first, again)]
    assert measured[0]
    assert measured[0] <= measured[1]


def test_an_error_out_of_reach_costs_little_besides_the_frames(renderer, clock):
    """Traced pixels take a share of the time so far, and the words tell that the error is out of reach."""
    told = []
    outcome = render_within(
        renderer,
        None,
        1e-7,
        ("none", "ssao"),
        lambda _, what: told.append(what),
        lambda: clock() > 4.0,
        quality="low",
        clock=clock,
    )
    assert outcome.reason == "stopped by the caller, relMSE 1e-07 is out of its reach"
    assert outcome.traced_seconds <= 0.35 * outcome.seconds
    assert told[-1].endswith("relMSE 1e-07 is out of its reach")


def test_neither_time_nor_error_is_refused(renderer):
    with pytest.raises(GiError, match="a time, an error, or both"):
        render_within(renderer, None, None)
