"""The tokens of WGSL, and the evaluation of expressions of literals and constants."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

TOKEN = re.compile(
    r"(?P<number>0[xX][0-9a-fA-F]+[iu]?|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?[iufh]?)"
    r"|(?P<name>[^\W\d]\w*)|(?P<line>\n)|(?P<space>[^\S\n]+|//[^\n]*)|(?P<comment>/\*)|(?P<mark>->|.)",
    re.DOTALL,
)
COMMENT_MARK = re.compile(r"/\*|\*/")
PRECEDENCE = ({"<<", ">>"}, {"+", "-"}, {"*", "/", "%"})


class ParseError(Exception):
    """Text that this parser does not accept as WGSL; `line` is the line of the pasted text."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


class Token(NamedTuple):
    """A word or a mark of the source; `kind` is "name", "number", "mark" or "end"."""

    kind: str
    text: str
    line: int


def tokenize(text: str) -> list[Token]:
    """Split WGSL into tokens, without comments (block comments nest)."""
    tokens: list[Token] = []
    line, at = 1, 0
    while at < len(text):
        for match in TOKEN.finditer(text, at):
            kind = match.lastgroup
            if kind == "line":
                line += 1
            elif kind == "comment":
                at = _comment_end(text, match.start(), line)
                line += text.count("\n", match.start(), at)
                break
            elif kind != "space":
                tokens.append(Token(kind or "mark", match.group(), line))
        else:
            break
    return tokens


def _comment_end(text: str, start: int, line: int) -> int:
    """Return the end of the block comment that begins at `start`."""
    depth = 0
    for mark in COMMENT_MARK.finditer(text, start):
        depth += 1 if mark.group() == "/*" else -1
        if depth == 0:
            return mark.end()
    raise ParseError("this block comment is not closed", line)


def evaluate(tokens: list[Token], constants: Mapping[str, int | float]) -> int | float | None:
    """Evaluate an expression of literals, known constants and + - * / % << >>; None if it holds more."""
    try:
        return _Expression(tokens, constants).evaluate()
    except (LookupError, ValueError, ZeroDivisionError):
        return None


class _Expression:
    """Precedence climbing over a few tokens; LookupError or ValueError means "not a constant"."""

    def __init__(self, tokens: list[Token], constants: Mapping[str, int | float]) -> None:
        self.tokens = tokens
        self.constants = constants
        self.at = 0

    def evaluate(self) -> int | float:
        value = self.binary(0)
        if self.at != len(self.tokens):
            raise ValueError
        return value

    def operator(self) -> str:
        words = [t.text for t in self.tokens[self.at : self.at + 2]]
        return "".join(words) if words in (["<", "<"], [">", ">"]) else "".join(words[:1])

    def binary(self, level: int) -> int | float:
        if level == len(PRECEDENCE):
            return self.unary()
        left = self.binary(level + 1)
        while (operator := self.operator()) in PRECEDENCE[level]:
            self.at += len(operator)
            right = self.binary(level + 1)
            left = _apply(operator, left, right)
        return left

    def unary(self) -> int | float:
        token = self.tokens[self.at]
        self.at += 1
        if token.text == "-":
            return -self.unary()
        if token.kind == "number":
            return _number(token.text)
        if token.text in ("true", "false"):
            return int(token.text == "true")
        if token.text in ("u32", "i32", "f32"):
            value = self.unary()
            return float(value) if token.text == "f32" else int(value)
        if token.text == "(":
            value = self.binary(0)
            if self.tokens[self.at].text != ")":
                raise ValueError
            self.at += 1
            return value
        return self.constants[token.text]


def _apply(operator: str, left: int | float, right: int | float) -> int | float:
    if isinstance(left, int) and isinstance(right, int):
        if operator == "<<":
            return left << right
        if operator == ">>":
            return left >> right
        if operator in "/%":  # WGSL truncates towards zero
            quotient = abs(left) // abs(right) * (1 if (left < 0) == (right < 0) else -1)
            return quotient if operator == "/" else left - right * quotient
    if operator in ("<<", ">>", "%"):
        raise ValueError
    return {"+": left + right, "-": left - right, "*": left * right}[operator] if operator != "/" else left / right


def _number(text: str) -> int | float:
    if text[:2].lower() == "0x":
        return int(text.rstrip("iu"), 16)
    digits = text.rstrip("iufh")
    is_integer = text[-1] in "iu" or (text[-1].isdigit() and digits.isdigit())
    return int(digits) if is_integer else float(digits)
