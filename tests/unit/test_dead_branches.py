"""Branches that overrides switch off are removed from a shader, and nothing else."""

from __future__ import annotations

import pytest

from wgpu_gi.gpu.wgsl.dead_branches import without_dead_branches

VALUES = {"ON": 1.0, "OFF": 0.0}


def marks(text: str) -> str:
    return "".join(text.split())


@pytest.mark.parametrize(
    ("text", "left"),
    [
        ("if (OFF) { a(); } b();", "b();"),
        ("if (ON) { a(); } b();", "{ a(); } b();"),
        ("if (x) { a(); } b();", "if (x) { a(); } b();"),
        ("if (OFF) { a(); } else { b(); }", "{ b(); }"),
        ("if (ON) { a(); } else { b(); }", "{ a(); }"),
        ("if (OFF && x) { a(); }", ""),
        ("if (ON && x) { a(); }", "if (ON && x) { a(); }"),
        ("if (ON || x) { a(); }", "{ a(); }"),
        ("if (!ON) { a(); }", ""),
        ("if (!OFF && (ON || x)) { a(); }", "{ a(); }"),
        ("if (!(OFF || x)) { a(); }", "if (!(OFF || x)) { a(); }"),
        ("if (!ON == x) { a(); }", "if (!ON == x) { a(); }"),
        ("if (a(ON) && OFF) { b(); }", ""),
        ("if (x) { a(); } else if (OFF) { b(); }", "if (x) { a(); }"),
        ("if (x) { a(); } else if (OFF) { b(); } else { c(); }", "if (x) { a(); } else { c(); }"),
        ("if (x) { a(); } else if (ON) { b(); } else { c(); }", "if (x) { a(); } else { b(); }"),
        ("if (x) { a(); } else if (OFF) { b(); } else if (OFF) { c(); }", "if (x) { a(); }"),
        ("if (OFF) { a(); } else if (x) { b(); } else { c(); }", "if (x) { b(); } else { c(); }"),
        ("if (OFF) { a(); } else if (ON) { b(); } else if (y) { c(); } else { d(); }", "{ b(); }"),
        ("if (ON) { if (OFF) { a(); } b(); }", "{ b(); }"),
        ("fn f() { if (ON) { return a; } b(); { c(); } return d; } fn g() {}", "fn f() { { return a; } } fn g() {}"),
        ("fn f() { if (x) { if (ON) { return a; } b(); } c(); }", "fn f() { if (x) { { return a; } } c(); }"),
        ("fn f() { if (ON) { if (x) { return a; } } b(); }", "fn f() { { if (x) { return a; } } b(); }"),
        ("fn f() { if (ON) { return a; } if (OFF) { b(); } }", "fn f() { { return a; } }"),
        ("// if (OFF) {\nif (x) { a(); } // }", "if (x) { a(); }"),
        ("/* if (OFF) { */ if (OFF) { a(); }", "/* if (OFF) { */ if (OFF) { a(); }"),
        ("iff(OFF); elif (OFF) { a(); }", "iff(OFF); elif (OFF) { a(); }"),
    ],
)
def test_what_is_left(text, left):
    assert marks(without_dead_branches(text, VALUES)) == marks(left)


def test_lines_stay_in_place():
    text = "a();\nif (OFF) {\n  b();\n} else {\n  c();\n}\nd();\n"
    lines = without_dead_branches(text, VALUES).split("\n")
    assert len(lines) == len(text.split("\n"))
    assert [number for number, line in enumerate(lines) if "c()" in line or "d()" in line] == [4, 6]
