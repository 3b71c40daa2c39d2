"""`bench --attribute`: the split of errors, exchanged stages, candidates, advice, arguments. Nothing is rendered."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.__main__ import main
from wgpu_gi.measure.attribute import Attribution
from wgpu_gi.measure.attribute_raise import Raise, best, candidates
from wgpu_gi.measure.attribute_report import Entry, advice, save_json, tables
from wgpu_gi.measure.attribute_study import Bar, Part, Split, difference, split_of, without_noise
from wgpu_gi.options import TECHNIQUES, Settings
from wgpu_gi.settings import QUALITIES, apply_quality, assign
from wgpu_gi.techniques.shared.stage import Stage


def test_noise_and_squared_bias_are_told_apart():
    """Errors of mean 0.3 and variance 0.04: squared bias 0.09, noise 0.04, for any number of seeds."""
    generator = np.random.default_rng(3)
    splits = [split_of(0.3 + 0.2 * generator.standard_normal((4, 500, 3))) for _ in range(40)]
    for values, expected in (([s.noise for s in splits], 0.04), ([s.bias for s in splits], 0.09)):
        spread = np.std(values)
        assert np.mean(values) == pytest.approx(expected, abs=4 * spread / np.sqrt(len(splits)))
        assert spread < 0.1 * expected


def test_standard_errors_tell_the_spread_of_the_parts():
    generator = np.random.default_rng(5)
    # All pixels share the noise of a seed, so the spread over seeds is large.
    splits = [split_of(0.3 + 0.2 * generator.standard_normal((16, 1, 1)) * np.ones((1, 9, 3))) for _ in range(300)]
    for name, error in (("noise", "noise_error"), ("bias", "bias_error"), ("total", "error")):
        spread = np.std([getattr(s, name) for s in splits])
        told = np.sqrt(np.mean([getattr(s, error) ** 2 for s in splits]))
        assert 0.8 < told / spread < 1.3, name


def test_the_truths_noise_is_subtracted_from_the_squared_bias():
    errors = np.full((3, 4, 3), 0.5)
    assert split_of(errors, 0.05).bias == pytest.approx(0.2)
    assert split_of(errors, 0.05).noise == 0.0
    assert split_of(errors[:1]).total == pytest.approx(0.25)


@pytest.mark.parametrize("quality", QUALITIES)
def test_stages_name_settings_that_exist(quality):
    """Every text is a valid setting of the technique, and every factor a number that the technique reads."""
    for gi, technique in TECHNIQUES.items():
        settings = Settings(gi=gi)
        apply_quality(settings, quality)
        for stage in technique.stages:
            assert stage.kind in ("settings", "mean", "direct", "bounces", "visible")
            assert bool(stage.exact) == (stage.kind == "settings")
            for text in (*stage.exact, *stage.cheaper, *stage.unless, *stage.values):
                assign(settings, text)
        wanted = {text.partition("=")[0] for stage in technique.stages for text in (*stage.values, *stage.factors)}
        sections = technique.sections | {"camera"}
        assert {name.partition(".")[0] for name in wanted} <= sections | {"environment", "direct", "shadow"}


def test_candidates_differ_from_the_settings_and_stay_in_range():
    settings = Settings()
    settings.vpl.count = 16384  # the most
    stage = Stage(
        "x", factors={"vpl.count": 4.0, "gather.rays": 4.0, "gather.interleave": 0.5}, values=("bounces=none",)
    )
    assert [text for _, text in candidates(settings, [stage])] == ["gather.rays=4", "gather.interleave=2"]
    settings.gather.rays = 5
    assert "gather.rays=8" in [text for _, text in candidates(settings, [stage])]


def test_bounces_found():
    one = Settings(bounces=1)
    for gi, settings, found in (
        ("none", Settings(), 0),
        ("ssdo", Settings(), 1),
        ("ssil", Settings(), 2),
        ("ssil", one, 1),
        ("many-light", Settings(), None),
        ("many-light", one, 1),
    ):
        assert TECHNIQUES[gi].bounces_found(settings) == found, gi
    amortised = Settings()
    amortised.ssil.amortised = True
    assert TECHNIQUES["ssil"].bounces_found(amortised) is None


def entry(*raises: Raise, floor: float | None = 0.0) -> Entry:
    """Return made-up results: a single frame with 0.4 of visibility, 0.1 of reconstruction."""
    visibility, reconstruction = Split(0.3, 0.1, 0.01, 0.01, 0.01), Split(0.0, 0.08)
    whole = Split(0.3, 0.2, 0.01, 0.01, 0.01)
    stage = Stage("visibility", exact=("gather.visibility=exact",))
    parts = [
        Part("visibility", visibility, stage),
        Part("reconstruction", reconstruction),
        Part("remainder", Split(0, 0.02)),
    ]
    bars = [Bar("full", 1, whole, parts, floor), Bar("indirect", 1, whole, parts, floor)]
    return Entry(
        "cornell", "many-light", "medium", (8, 4), Attribution(bars, list(raises), 20.0, np.ones((4, 8, 3), "f4"))
    )


def test_advice_weighs_error_by_time():
    dear = Raise("gather.visibility=exact", "visibility", {1: Split(0.0, 0.1)}, 9.0)
    cheap = Raise("gather.rays=4", "visibility", {1: Split(0.1, 0.1)}, 2.0)
    useless = Raise("vpl.count=8192", "choice of lights", {1: Split(0.3, 0.19)}, 1.1)
    made = entry(dear, cheap, useless)
    assert best(made.found.raises, made.found.bars[0]) is cheap
    (sentence,) = advice(made)
    assert sentence == "a single frame: gather.rays=4 lowers relMSE from 0.5 to 0.2 for 2 times the time"
    (sentence,) = advice(entry(useless))
    assert "no setting that was tried" in sentence
    assert "visibility is 80 %" in sentence


def test_a_noisy_truth_is_told():
    assert "raise --truth-spp" in advice(entry(floor=0.2))[-1]
    assert len(advice(entry(floor=None))) == 1
    made = entry()
    made.found.hidden.append(made.found.bars.pop())
    assert advice(made)[-1].startswith("a single frame, indirect part: no error exceeds the noise of the truth")


def test_tables_and_file_hold_all_parts(tmp_path):
    made = entry(Raise("gather.rays=4", "visibility", {1: Split(0.1, 0.1)}, 2.0))
    assert [table.row_count for _, table in tables(made)] == [4, 4, 2]
    save_json(tmp_path / "out.json", {"adapter": "Fake 1"}, [made])
    text = (tmp_path / "out.json").read_text()
    assert '"name": "visibility"' in text
    assert '"setting": "gather.rays=4"' in text


def test_parts_add_up():
    whole, exact = Split(0.3, 0.2), Split(0.02, 0.1)
    parts = [difference(whole, exact), difference(exact, without_noise(exact)), without_noise(exact)]
    assert sum(p.noise for p in parts) == pytest.approx(whole.noise)
    assert sum(p.bias for p in parts) == pytest.approx(whole.bias)


@pytest.mark.parametrize(
    ("flags", "part"),
    [
        (["--moving"], "--moving"),
        (["--sweep", "vpl.count=64,128"], "--sweep"),
        (["--compare", "old.json"], "--compare"),
        (["--truth", "t.npz"], "--truth"),
        (["--gi", "path"], "path has none"),
        (["--size", "1920x1080"], "--size 1920x1080 is too large"),
    ],
)
def test_flags_that_do_not_go_with_it_are_refused(flags, part, capsys):
    assert main(["bench", "--attribute", *flags]) == 2
    assert part in capsys.readouterr().err
