"""No branch or loop depends on uniforms only, since Mesa's CPU driver would recompile the pass in every run.

Lavapipe writes the values of uniforms that decide branches into the code as constants. Mesa 22 does so each time and
keeps the copies (measured on the path tracer: 1 MiB and 10 ms per dispatch); later versions compile a variant for each
new value. `select`, `&` instead of `&&` with something that varies, or an override constant avoid it.
"""

from __future__ import annotations

import re

import pytest

from wgpu_gi.resources import resource_dir

WGSL = resource_dir("wgsl")
FILES = sorted(p.relative_to(WGSL).as_posix() for p in WGSL.rglob("*.wgsl"))
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
UNIFORM = re.compile(r"var<uniform>\s*(\w+)")
LET = re.compile(r"\blet\s+(\w+)\s*(?::[^=]*)?=([^;]*);")
# A name with its members, which is not a function, a type or a member.
NAME = re.compile(r"(?<![\w.])([A-Za-z_]\w*)\b(?!\s*[\w(]|<)")


def balanced(text, start):
    """Return the text between the parenthesis at `start` and the matching one."""
    depth = 0
    for end in range(start, len(text)):
        depth += {"(": 1, ")": -1}.get(text[end], 0)
        if depth == 0:
            return text[start + 1 : end]
    raise AssertionError("unbalanced parentheses")


def is_uniform(expression, uniforms):
    """Tell whether an expression reads uniforms, and otherwise only constants."""
    names = [n for n in NAME.findall(expression) if n not in ("true", "false")]
    return any(n in uniforms for n in names) and all(n in uniforms or n.isupper() for n in names)


def operands(condition):
    """Return the operands of && and ||, each of which is a branch, or the condition itself."""
    parts = re.split(r"&&|\|\|", condition)
    return [p.strip() for p in parts]


def conditions(text):
    """Yield all conditions of branches: of if, while and switch, and both sides of && and ||."""
    for match in re.finditer(r"\b(?:if|while|switch)\s*\(", text):
        yield from operands(balanced(text, match.end() - 1))
    for match in re.finditer(r"\b(?:if|while|switch)\s+([^({][^{]*)\{", text):
        yield from operands(match[1])
    for statement in re.split(r"[;{}]", text):
        if ("&&" in statement or "||" in statement) and not re.search(r"\b(?:if|while|switch)\b", statement):
            yield from operands(re.sub(r"^.*?(?:=(?!=)|\breturn\b)", "", statement.strip(), count=1, flags=re.DOTALL))


def violations(text, uniforms):
    text = COMMENT.sub("", text)
    uniforms = set(uniforms)
    # Names of values that depend on uniforms only are uniform, too.
    while more := {name for name, value in LET.findall(text) if is_uniform(value, uniforms)} - uniforms:
        uniforms |= more
    found = [c for c in conditions(text) if is_uniform(c, uniforms)]
    # A loop up to a uniform would be unrolled for each value.
    for match in re.finditer(r"\bfor\s*\(", text):
        for part in operands(balanced(text, match.end() - 1).split(";")[1]):
            sides = re.split(r"[<>=!]=?", part)
            found += [part.strip() for side in sides if is_uniform(side, uniforms)]
    return found


UNIFORMS = {name for file in FILES for name in UNIFORM.findall((WGSL / file).read_text())}


@pytest.mark.parametrize("file", FILES)
def test_branches_do_not_depend_on_uniforms_alone(file):
    assert violations((WGSL / file).read_text(), UNIFORMS) == []


@pytest.mark.parametrize(
    ("text", "bad"),
    [
        ("if (view.jitter != 0u) {", ["view.jitter != 0u"]),
        ("if view.jitter != 0u {", ["view.jitter != 0u"]),
        ("if (min(view.size.x, LIMIT) > 3u) {", ["min(view.size.x, LIMIT) > 3u"]),
        ("if (any(id.xy >= view.size)) {", []),
        ("if (depth < view.count || x > f(view.size)) {", []),
        ("if (depth > 1u && view.on == 0u) {", ["view.on == 0u"]),
        ("if ((depth > 1u) & (view.on == 0u)) {", []),
        ("let on = view.on > 0u; if (on) {", ["on"]),
        ("let both = depth > 0u && view.on > 0u;", ["view.on > 0u"]),
        ("return HAS_IT && view.on > 0u;", ["view.on > 0u"]),
        ("let x = select(1u, 2u, view.on > 0u);", []),
        ("for (var i = 0u; i < view.count; i += 1u) {", ["i < view.count"]),
        ("for (var i = 0u; i < 4u; i += 1u) {", []),
        ("switch (view.mode) {", ["view.mode"]),
        ("if (HAS_IT) { // if (view.on > 0u)", []),
        ("if (hit.view > 0u) {", []),
    ],
)
def test_violations_are_found(text, bad):
    assert violations(text, {"view"}) == bad
