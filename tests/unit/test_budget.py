"""Budgets without a GPU: figures, the choice of a candidate, entries of the cache, points of an open-ended picture."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

import wgpu_gi as gi
from wgpu_gi.budget.choice import Choice, best, cost, rival, within
from wgpu_gi.budget.frame_series import shared_noise
from wgpu_gi.budget.front import Candidate, Figures, averages_samples, candidates
from wgpu_gi.budget.front_cache import FILLED, AdapterCache, FrontCache
from wgpu_gi.budget.outcome import Outcome, missed_words, time_words
from wgpu_gi.budget.traced import Lognormal, TracedPixels
from wgpu_gi.budget.typical import PIXELS as TYPICAL_PIXELS
from wgpu_gi.budget.typical import TYPICAL, expected
from wgpu_gi.pictures.tables import Table
from wgpu_gi.pixel_tracer import PixelTruth
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
    return best(choices, seconds).candidate


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
    assert best(choices, 1.0).candidate == fast


def test_unknown_figures_scale_with_what_is_known():
    usual = TYPICAL[MEDIUM]
    times = (2 * v for v in (usual.cold, usual.warm, usual.fixed, usual.per_pixel))
    doubled = Figures(*times, 2 * usual.noise, 2 * usual.floor, noise_spread=0.3, floor_spread=0.2, measured=True)
    found = expected(TYPICAL, {MEDIUM: doubled})
    assert found[MEDIUM] is doubled
    other = Candidate("many-light", "high")
    assert found[other].noise == pytest.approx(2 * TYPICAL[other].noise)
    assert found[other].floor == pytest.approx(2 * TYPICAL[other].floor)
    assert found[other].frame_seconds(PIXELS) == pytest.approx(2 * TYPICAL[other].frame_seconds(PIXELS))
    assert 0.3 < found[other].noise_spread < TYPICAL[other].noise_spread
    # Another technique has its own floor, and the path tracer none.
    ssdo = Candidate("ssdo", "low")
    assert (found[ssdo].floor, found[ssdo].floor_spread) == (TYPICAL[ssdo].floor, TYPICAL[ssdo].floor_spread)
    assert found[SLOW].floor == TYPICAL[SLOW].floor
    assert expected([other], {}) == {other: TYPICAL[other]}


def test_noise_of_direct_light_is_the_same_at_all_qualities():
    low = Candidate("many-light", "low")
    known = {MEDIUM: Figures(0.5, 0.0, 0.0, 1e-6, noise=0.01, floor=0.001, noise_spread=0.2, shared=1.0)}
    found = expected([low], known)[low]
    assert found.noise == pytest.approx(0.01)
    assert found.noise_spread == pytest.approx(0.2)


def test_the_share_of_direct_noise():
    rng = np.random.default_rng(2)
    noise = rng.normal(size=(2, 3, 40, 40, 3)) * np.array([0.1, 0.2])[:, None, None, None, None]
    direct, indirect = 1.0 + noise
    counts = np.arange(1, 4)[:, None, None, None]
    parts = [np.cumsum(x, 0) / counts for x in (direct + indirect, indirect)]
    means = [list(frame) for frame in zip(*parts, strict=True)]
    assert shared_noise(means) == pytest.approx(0.2, abs=0.02)


def test_relmse_of_uncertain_figures_is_a_geometric_mean():
    certain = Figures(0.0, 0.0, 0.0, 1e-6, noise=0.1, floor=0.02)
    assert certain.relmse(10) == pytest.approx(0.03)
    assert certain.log_relmse(10)[1] == pytest.approx(0.0, abs=1e-6)
    vague = Figures(0.0, 0.0, 0.0, 1e-6, noise=0.1, floor=1e-7, noise_spread=0.5)
    assert vague.relmse(10) == pytest.approx(0.01, rel=1e-3)
    assert vague.log_relmse(10)[1] == pytest.approx(0.5, rel=1e-3)


def test_what_is_known_beats_what_is_hoped():
    vague = Candidate("ssdo", "low")
    figures = FIGURES[MEDIUM], Figures(0.0, 0.0, 0.05, 0.0, noise=0.02, floor=0.0018, floor_spread=2.0)
    choices = {c: within(c, f, PIXELS, 1.0, None, is_warm=True) for c, f in zip((MEDIUM, vague), figures, strict=True)}
    assert best(choices.values(), 1.0).candidate == MEDIUM
    assert rival(choices, MEDIUM, 1.0, (), 0.0) is None


def test_a_measured_floor_gives_way_to_the_path_tracer():
    figures = FIGURES | {MEDIUM: Figures(0.0, 0.0, 0.01, 1e-6, 0.02, floor=0.05, floor_spread=0.2)}
    left = 60.0
    choices = {c: within(c, f, PIXELS, left, None, is_warm=True) for c, f in figures.items()}
    assert rival(choices, MEDIUM, left, (), 0.0) == SLOW
    assert rival(choices, SLOW, left, (), 0.0) is None


def test_a_fast_candidate_that_may_reach_an_error_comes_first():
    """It costs little to try, even if the path tracer follows."""
    hopeful = Figures(0.0, 0.0, 0.01, 1e-6, noise=0.02, floor=0.002, floor_spread=1.8)
    figures = FIGURES | {MEDIUM: hopeful}
    choices = [within(c, f, PIXELS, None, 0.001, is_warm=True) for c, f in figures.items()]
    assert 0.05 < choices[0].chance < 0.5
    assert choices[1].chance == pytest.approx(1.0)
    assert choices[0].seconds < cost(choices[0], choices) < choices[1].seconds + choices[0].seconds
    assert best(choices, None).candidate == MEDIUM


def test_frames_that_are_done_count():
    choice = within(MEDIUM, FIGURES[MEDIUM], PIXELS, 0.5, None, is_warm=True, done=7)
    assert choice.frames == 17
    assert choice.relmse == pytest.approx(0.002 + 0.02 / 17)
    assert within(MEDIUM, FIGURES[MEDIUM], PIXELS, 0.0, None, is_warm=True, done=7).frames == 7


def test_words_on_the_time_to_an_error():
    assert time_words(Choice(SLOW, 9, 7200.0, 0.01, chance=1.0), 0.01) == "about 2 h more to relMSE 0.01"
    assert time_words(Choice(SLOW, 9, 0.25, 0.01, chance=1.0), 0.01) == "about 0.25 s more to relMSE 0.01"
    assert time_words(Choice(MEDIUM, 9, math.inf, 0.01), 0.001) == "relMSE 0.001 is out of its reach"


def test_an_exact_measurement_decides_the_floor_and_a_vague_one_does_not():
    prior = Lognormal(0.002, 1.5)
    assert prior.measured(0.01, 1e-4).median == pytest.approx(0.01, rel=0.05)
    assert prior.measured(0.01, 1e-4).spread < 0.05
    vague = prior.measured(0.0, 1.0)
    assert vague.median == pytest.approx(0.002, rel=0.1)
    assert vague.spread == pytest.approx(1.5, rel=0.05)
    assert prior.measured(-0.001, 0.0005).median < 0.001


def test_two_sources_weigh_by_their_inverse_variance():
    found = Lognormal(1.0, 1.0).times(Lognormal(math.e, 1.0))
    assert found.median == pytest.approx(math.sqrt(math.e))
    assert found.spread == pytest.approx(math.sqrt(0.5))


class Tracer:
    """Traces pixels of a grey picture with noise of a known relative variance of a path."""

    size = (64, 48)
    variance = 0.5

    def trace_pixels(self, pixels, spp, *, seed, replicates):
        rng = np.random.default_rng(seed)
        scale = math.sqrt(self.variance * replicates / spp)
        return PixelTruth(1.0 + scale * rng.normal(size=(len(pixels), replicates, 3)), spp)


@pytest.mark.parametrize(("bias", "noise"), [(0.0, 0.0), (0.2, 0.0), (0.1, 0.1)])
def test_traced_pixels_tell_error_and_noise(bias, noise):
    seconds = iter(range(1000))
    traced = TracedPixels(Tracer(), lambda: next(seconds), 20.0)
    shape = (48, 64, 3)
    picture = 1.0 + bias + noise * np.random.default_rng(7).normal(size=shape)
    deviation = np.full(shape, noise)
    found = traced.compare(picture, deviation)
    # A biased picture has a part in its denominators: 5 % here.
    expected_total = (bias**2 + noise**2) / 1.01
    assert found.total == pytest.approx(expected_total, abs=0.1 * expected_total + max(4 * found.error, 1e-4))
    assert found.noise == pytest.approx(noise**2 / 1.01, rel=0.1)
    assert traced.path_noise(picture, deviation).median == pytest.approx(Tracer.variance / 1.01, rel=0.15)


def test_candidates_keep_what_the_user_has_set():
    base = Settings(bounces=1, seed=7)
    base.vpl.count = 777
    found = candidates(base, TYPICAL, ("many-light", "path"))
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
    found = candidates(base, TYPICAL, ("many-light", "path", "ssao"), "high")
    assert [str(c) for c in found] == ["many-light, high", "path", "ssao, high"]
    assert {s.vpl.count for s in found.values()} == {Settings().vpl.count}


def test_equal_candidates_appear_once():
    assert list(candidates(Settings(), TYPICAL, ("path",))) == [SLOW]
    assert len(candidates(Settings(), TYPICAL)) == len(TYPICAL)


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


def test_seconds_of_an_adapter_serve_other_scenes(cache):
    def of(**changed):
        return AdapterCache(SimpleNamespace(**{"adapter_name": "one"} | changed))

    cache()  # the folder
    first = FIGURES[MEDIUM]
    assert of().load() == {}
    of().store(FIGURES, {MEDIUM}, ())
    found = of().load()
    assert list(found) == [MEDIUM]
    assert found[MEDIUM].cold == pytest.approx(FILLED * first.cold)  # the driver's own cache is filled now
    assert found[MEDIUM].per_pixel == pytest.approx(first.per_pixel)
    assert found[MEDIUM].noise == TYPICAL[MEDIUM].noise
    # A later process tells what a start takes; one that had the pipelines does not.
    of().store(FIGURES | {MEDIUM: Figures(0.5, 0.1, 0.01, 4e-6, 0.02, 0.002)}, {MEDIUM}, ())
    of().store(FIGURES, {MEDIUM, SLOW}, {MEDIUM, SLOW})
    found = of().load()
    assert found[MEDIUM].cold == pytest.approx(0.5)
    assert found[SLOW].cold == pytest.approx(FIGURES[SLOW].cold)
    assert of(adapter_name="other").load() == {}
    # Others are expected to be faster, too.
    high = Candidate("many-light", "high")
    scale = found[MEDIUM].frame_seconds(TYPICAL_PIXELS) / TYPICAL[MEDIUM].frame_seconds(TYPICAL_PIXELS)
    guess = expected([high], {}, {MEDIUM: found[MEDIUM]})[high]
    assert guess.per_pixel == pytest.approx(scale * TYPICAL[high].per_pixel)


@pytest.mark.parametrize("text", ["", "[]", '{"path, medium": {"cold": -1}}', '{"path, best": {}}'])
def test_damaged_seconds_of_an_adapter_count_as_nothing(cache, text):
    cache()
    adapter = AdapterCache(SimpleNamespace(adapter_name="one"))
    adapter.store(FIGURES, FIGURES, ())
    assert len(adapter.load()) == 2
    adapter.path.write_text(text)
    assert adapter.load() == {}


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
