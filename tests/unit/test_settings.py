"""Settings: declared, checked, listed, assigned from text."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import pytest

from wgpu_gi.errors import GiError
from wgpu_gi.options import Settings
from wgpu_gi.settings import QUALITIES, apply_quality, assign, describe, format_rows, setting, validate


@dataclass
class Path:
    samples_per_run: int = setting(4, "Samples per pixel in one run.", unit="samples", range=(1, 64))
    clamp: float = setting(2.5, "Largest radiance of one sample.", unit="W/(m2 sr)", range=(0.0, 1e6))
    enabled: bool = setting(True, "Whether it runs.")
    sampler: str = setting("hash", "Where random numbers come from.", choices=("hash", "sobol"))


@dataclass
class All:
    gi: Literal["path", "none"] = setting("path", "Global illumination by.")
    bounces: int | None = setting(None, "Indirect bounces.", range=(0, 1000))
    path: Path = field(default_factory=Path)
    internal: int = 7  # no setting


def test_assign_reads_every_type():
    settings = All()
    for text in ("path.samples_per_run=16", "path.clamp = 1e3", "path.enabled=false", "path.sampler=sobol", "gi=none"):
        assign(settings, text)
    assert settings.path == Path(16, 1000.0, False, "sobol")
    assert settings.gi == "none"


@pytest.mark.parametrize(("text", "value"), [("true", True), ("1", True), ("0", False), ("False", False)])
def test_assign_reads_booleans(text, value):
    settings = All()
    assign(settings, f"path.enabled={text}")
    assert settings.path.enabled is value


@pytest.mark.parametrize(("text", "value"), [("3", 3), ("none", None), ("unlimited", None)])
def test_assign_reads_optional_numbers(text, value):
    settings = All(bounces=1)
    assign(settings, f"bounces={text}")
    assert settings.bounces == value


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("path.samples_per_run", "section.name=value"),
        ("path.sample_per_run=1", "available: gi, bounces, path.samples_per_run, path.clamp"),
        ("nonsense=1", "available: gi, bounces, path.samples_per_run, path.clamp"),
        ("internal=1", "no setting 'internal'"),
        ("path=1", "no setting 'path'"),
        ("path.samples_per_run=0", "path.samples_per_run must lie between 1 and 64 samples, not 0"),
        ("path.samples_per_run=2.5", "whole number, not '2.5'"),
        ("path.samples_per_run=none", "whole number, not 'none'"),
        ("path.clamp=nan", "path.clamp takes a finite number"),
        ("path.clamp=inf", "finite number"),
        ("path.clamp=-1", "between 0 and 1e+06 W/(m2 sr), not -1"),
        ("path.enabled=maybe", "true or false, not 'maybe'"),
        ("path.sampler=halton", "one of hash, sobol, not 'halton'"),
        ("gi=magic", "one of path, none, not 'magic'"),
        ("bounces=-1", "between 0 and 1000, not -1"),
        ("bounces=many", "whole number or none, not 'many'"),
    ],
)
def test_assign_refuses(text, words):
    settings = All()
    with pytest.raises(GiError) as error:
        assign(settings, text)
    assert words in str(error.value)
    assert settings == All()


def test_validate_takes_numbers_of_numpy():
    validate(All(path=Path(np.int64(3), np.float32(0.5))))
    validate(All(path=Path(clamp=3)))


@pytest.mark.parametrize(
    ("section", "words"),
    [
        (Path(samples_per_run=65), "path.samples_per_run must lie between 1 and 64 samples, not 65"),
        (Path(samples_per_run=True), "whole number"),
        (Path(samples_per_run="4"), "whole number"),
        (Path(clamp=float("nan")), "path.clamp takes a finite number (W/(m2 sr)), not nan"),
        (Path(clamp=float("inf")), "finite number"),
        (Path(enabled=1), "true or false"),
        (Path(sampler="x"), "one of hash, sobol"),
    ],
)
def test_validate_names_section_range_and_unit(section, words):
    for check in (lambda: validate(section, "path"), lambda: validate(All(path=section))):
        with pytest.raises(GiError) as error:
            check()
        assert words in str(error.value)


def test_describe_lists_settings_in_order():
    settings = All(bounces=2)
    rows = {row.name: row for row in describe(settings)}
    assert list(rows)[:3] == ["gi", "bounces", "path.samples_per_run"]
    assert (rows["bounces"].value, rows["bounces"].default) == (2, None)
    assert rows["path.clamp"].unit == "W/(m2 sr)"
    assert rows["gi"].choices == ("path", "none")
    table = format_rows(describe(settings))
    assert "path.samples_per_run=4" in table
    assert "1 .. 64 samples" in table
    assert "Samples per pixel in one run." in table


@dataclass
class Maps:
    resolution: int = setting(512, "Texels a side.", "texels", range=(16, 4096), presets={"low": 256, "high": 1024})
    filter: str = setting("box", "Kernel.", choices=("box", "tent"), presets={"high": "tent"})
    bias: float = setting(1.5, "Against acne.", "texels")


@dataclass
class WithPresets:
    gi: str = setting("path", "Global illumination by.")
    maps: Maps = field(default_factory=Maps)


@pytest.mark.parametrize(
    ("quality", "expected"), [("low", (256, "box")), ("medium", (512, "box")), ("high", (1024, "tent"))]
)
def test_quality_sets_only_settings_with_presets(quality, expected):
    settings = WithPresets("none", Maps(17, "tent", 9.0))
    apply_quality(settings, quality)
    assert (settings.maps.resolution, settings.maps.filter) == expected
    assert (settings.gi, settings.maps.bias) == ("none", 9.0)


def test_medium_is_the_default():
    settings = WithPresets()
    apply_quality(settings, "medium")
    assert settings == WithPresets()


def test_unknown_quality_and_bad_presets_are_refused():
    @dataclass
    class Bad:
        rays: int = setting(4, "Rays.", "rays", range=(1, 8), presets={"high": 9})

    with pytest.raises(GiError, match="no quality 'ultra'; available: low, medium, high"):
        apply_quality(WithPresets(), "ultra")
    with pytest.raises(GiError, match="rays must lie between 1 and 8 rays, not 9"):
        apply_quality(Bad(), "high")


def test_table_shows_presets():
    assert "Texels a side. (low 256, high 1024)" in format_rows(describe(WithPresets()))


@pytest.mark.parametrize("quality", QUALITIES)
def test_every_preset_of_the_renderer_is_allowed(quality):
    settings = Settings()
    apply_quality(settings, quality)
    validate(settings)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("vpl.cout=3", "there is no setting 'vpl.cout'; did you mean vpl.count, "),
        ("rays=3", "gather.rays"),
        ("nonsense=1", "did you mean "),
    ],
)
def test_unknown_name_lists_the_nearest_three(text, words):
    with pytest.raises(GiError) as error:
        assign(Settings(), text)
    assert words in str(error.value)
    assert len(str(error.value).partition("did you mean ")[2].split(", ")) == 3
