"""Budgets without a GPU: figures, the choice of a candidate, entries of the cache, points of an open-ended picture."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

import wgpu_gi as gi
from wgpu_gi.budget.front import (
    TYPICAL,
    Candidate,
    Choice,
    Figures,
    averages_samples,
    best,
    candidates,
    expected,
    within,
)
from wgpu_gi.budget.front_cache import FrontCache
from wgpu_gi.budget.outcome import Outcome, missed_words
from wgpu_gi.budget.probe import likely_floor, probe_sizes
from wgpu_gi.pictures.tables import Table
from wgpu_gi.renderer import Settings
from wgpu_gi.settings import apply_quality
from wgpu_gi.techniques.shared.sampling import OPEN_FRAMES, pixel_offset

MEDIUM = Candidate("many-light", "medium")
SLOW = Candidate("path", "medium")
FIGURES = {
    MEDIUM: Figures(cold=1.0, warm=0.1, fixed=0.01, per_pixel=1e-6, noise=0.02, floor=0.002, measured=True),
    SLOW: Figures(cold=0.5, warm=0.0, fixed=0.0, per_pixel=2e-6, noise=2.0, floor=1e-7, measured=True),
}
PIXELS = 40_000


def chosen(seconds, error=None):
    choices = [within(c, f, PIXELS, seconds, error, is_warm=True) for c, f in FIGURES.items()]
    return best(choices, seconds, error).candidate


def test_frames_that_fit_are_counted_with_the_start():
    choice = within(MEDIUM, FIGURES[MEDIUM], PIXELS, 1.099, None, is_warm=True)
    assert choice.frames == 19  # (1.099 - 0.1) / 0.05
    assert choice.relmse == pytest.approx(0.002 + 0.02 / 19)
    assert within(MEDIUM, FIGURES[MEDIUM], PIXELS, 0.5, None, is_warm=False).frames == 1  # at least one


def test_a_short_time_takes_the_technique_with_a_floor_and_a_long_one_the_path_tracer():
    assert chosen(1.0) == MEDIUM
    assert chosen(1000.0) == SLOW


def test_an_error_is_reached_by_the_fastest_that_can():
    assert chosen(None, 0.01) == MEDIUM
    assert chosen(None, 0.001) == SLOW  # below the other's floor
    needed = within(SLOW, FIGURES[SLOW], PIXELS, None, 0.001, is_warm=True)
    assert needed.relmse <= 0.001
    assert needed.frames == math.ceil(2.0 / (0.001 - 1e-7))
    assert within(MEDIUM, FIGURES[MEDIUM], PIXELS, None, 0.001, is_warm=True).seconds == math.inf


def test_a_candidate_that_is_late_loses_to_one_in_time():
    slow, fast = (Candidate("ssil", q) for q in ("high", "low"))
    figures = {
        slow: Figures(0.0, 0.0, 9.0, 0.0, 0.001, 0.001),
        fast: Figures(0.0, 0.0, 0.5, 0.0, 0.1, 0.1),
    }
    choices = [within(c, f, PIXELS, 1.0, None, is_warm=True) for c, f in figures.items()]
    assert best(choices, 1.0, None).candidate == fast


def test_unknown_figures_scale_with_what_is_known():
    usual = TYPICAL[MEDIUM]
    doubled = Figures(
        *(2 * v for v in (usual.cold, usual.warm, usual.fixed, usual.per_pixel, usual.noise, usual.floor))
    )
    found = expected(TYPICAL, {MEDIUM: doubled})
    assert found[MEDIUM] is doubled
    other = Candidate("many-light", "high")
    assert found[other].noise == pytest.approx(2 * TYPICAL[other].noise)
    assert found[other].frame_seconds(PIXELS) == pytest.approx(2 * TYPICAL[other].frame_seconds(PIXELS))
    assert found[SLOW].floor == TYPICAL[SLOW].floor  # the path tracer has none
    assert expected([other], {}) == {other: TYPICAL[other]}


def test_an_exact_measurement_decides_the_floor_and_a_vague_one_does_not():
    assert likely_floor(0.002, 0.01, 1e-5) == pytest.approx(0.01, rel=0.05)
    assert likely_floor(0.002, 0.0, 1.0) == pytest.approx(0.002, rel=0.05)
    assert likely_floor(0.002, -0.001, 0.0005) < 0.001


def test_candidates_keep_what_the_user_has_set():
    base = Settings(bounces=1, seed=7)
    base.vpl.count = 777
    found = candidates(base, ("many-light", "path"))
    assert [str(c) for c in found] == ["many-light, low", "many-light, medium", "many-light, high", "path"]
    assert {s.vpl.count for s in found.values()} == {777}
    assert {s.bounces for s in found.values()} == {1}
    assert found[Candidate("many-light", "low")].rsm != found[MEDIUM].rsm
    assert all(s.camera.frames == OPEN_FRAMES for c, s in found.items() if not averages_samples(c))
    assert base.gi == "many-light"
    assert base.camera.frames == 24


def test_a_quality_that_was_asked_for_is_the_only_one():
    base = Settings()
    apply_quality(base, "high")
    base.vpl.count = Settings().vpl.count  # the default is a choice, too
    found = candidates(base, ("many-light", "path", "ssao"), "high")
    assert [str(c) for c in found] == ["many-light, high", "path", "ssao, high"]
    assert {s.vpl.count for s in found.values()} == {Settings().vpl.count}


def test_equal_candidates_appear_once():
    assert list(candidates(Settings(), ("path",))) == [SLOW]
    assert len(candidates(Settings())) == len(TYPICAL)


def test_probes_have_the_shape_of_the_picture():
    small, large = probe_sizes((1920, 1080))
    assert large[0] / large[1] == pytest.approx(16 / 9, rel=0.02)
    assert small[0] * small[1] == pytest.approx(large[0] * large[1] / 4, rel=0.03)
    assert probe_sizes((3, 2))[1] == (3, 2)


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("WGPU_GI_CACHE", str(tmp_path))

    def make(**changed):
        scene = gi.load("cornell-point")
        values = {"posed_scene": scene, "posed_camera": scene.cameras[0], "settings": Settings(), "adapter_name": "one"}
        return FrontCache(SimpleNamespace(**values | changed))

    return make


def test_figures_survive_in_the_cache(cache):
    assert cache().load() == {}
    cache().store(FIGURES)
    assert cache().load() == FIGURES
    cache().store({MEDIUM: FIGURES[MEDIUM]})  # of a run with one technique
    assert cache().load() == FIGURES
    assert cache(settings=Settings(gi="ssil", seed=3)).load() == FIGURES  # what a candidate chooses has no part in it
    assert cache(settings=Settings(bounces=1)).load() == {}
    assert cache(adapter_name="other").load() == {}
    assert cache(posed_scene=gi.load("cornell-spot")).load() == {}


@pytest.mark.parametrize("text", ["", "[]", "{", '{"path, medium": 3}', '{"path, medium": {"cold": NaN}}'])
def test_a_damaged_entry_counts_as_nothing(cache, text):
    cache().store(FIGURES)
    cache().path.write_text(text)
    assert cache().load() == {}


@pytest.mark.parametrize(
    "damage", [{"per_pixel": -1.0}, {"fixed": 0, "per_pixel": 0}, {"noise": 1e308}, {"cold": 10**400}]
)
def test_an_impossible_figure_counts_as_damage(cache, damage):
    cache().store(FIGURES)
    entry = json.loads(cache().path.read_text())
    entry["path, medium"].update(damage)
    cache().path.write_text(json.dumps(entry))
    assert cache().load() == {}


@pytest.mark.parametrize("count", [8, 27, 100])
def test_any_number_of_points_of_an_open_picture_is_even(count):
    points = np.array([pixel_offset(k, 0) for k in range(count)])
    assert np.all((points > 0) & (points < 1))
    assert np.abs(points.mean(0) - 0.5).max() < 0.75 / math.sqrt(count) / 1.5
    halves = (points < 0.5).mean(0)
    assert np.abs(halves - 0.5).max() <= 2 / count + 1e-9


def test_the_sentence_says_what_took_time_and_what_would_have_been_better():
    missed = missed_words(Choice(MEDIUM, 9, 0.5, 0.0123), 0.71)
    outcome = Outcome(Settings(), Candidate("none", "low"), 3, 0.5, 0.35, None, "done", 0.0, 0.4, missed, Table(""))
    assert outcome.sentence() == (
        "none, low: 3 frames in 0.50 s, 0.4 s of them to compile and to start; expected relMSE 0.35;"
        " many-light, medium would reach 0.012, but would compile for about 0.71 s first; done"
    )
