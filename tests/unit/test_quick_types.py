"""Types looked up are those that cffi's parser finds."""

from __future__ import annotations

import cffi
import pytest

from wgpu_gi.gpu.quick_types import read_types_quickly

SOURCE = (
    "typedef struct { int a; float b; } Point; typedef Point const *Place; typedef int Number; typedef void *Thing;"
)
NAMES = ["Point *", "Point[]", "Point * ", "Place *", "Place[]", "Number[]", "Thing *", "Thing[]"]


def made():
    ffi = cffi.FFI()
    ffi.cdef(SOURCE)
    return ffi


@pytest.mark.parametrize("name", [*NAMES, "Point", "int *", "char []", "Point **", "void(Point, int)"])
def test_types_are_those_of_the_parser(name):
    ffi = made()
    expected = ffi._parser.parse_type(name)
    read_types_quickly(ffi)
    assert ffi._parser.parse_type(name) == expected


def test_no_parser_runs_for_pointers(monkeypatch):
    ffi = made()
    monkeypatch.setattr(ffi._parser, "_parse", None)
    read_types_quickly(ffi)
    pair = ffi.new("Point[]", 2)
    pair[1].b = 2.5
    assert ffi.new("Point *", pair[1]).b == 2.5


def test_another_cffi_is_left_alone():
    read_types_quickly(object())


def test_unknown_name_is_an_error_as_before():
    ffi = made()
    read_types_quickly(ffi)
    with pytest.raises(cffi.CDefError):
        ffi.new("Nowhere *")
