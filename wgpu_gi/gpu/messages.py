"""Shortens messages of wgpu and its shader compiler to one line, and maps line numbers back to the shader's files."""

from __future__ import annotations

import re

from .wgsl.load import ShaderSource


def compiler_message(error: Exception, source: ShaderSource) -> str:
    """Turn a message about the pasted text into "file:line: what" and an excerpt with the line numbers of that file."""
    lines = str(error).splitlines()
    culprit = _culprit(lines)
    if culprit is None:
        return reason(error)
    notes = [line.strip()[2:] for line in lines if line.strip().startswith("= ")]
    headline = next((line for line in lines if line.startswith("Shader ")), lines[0])
    headline = re.sub(r"^Shader ('.*?' )?", "", headline)
    excerpt = [_renumber(line, source) for line in lines if re.match(r"\s*(\d+\s*)?[│┌]", line)]
    return f"{source.where(culprit)}: {'; '.join([headline, *notes])}\n" + "\n".join(excerpt)


def _culprit(lines: list[str]) -> int | None:
    """Return the line of the pasted text that the first caret points at."""
    number = None
    for line in lines:
        gutter = re.match(r"\s*(\d+)\s*│", line)
        if gutter:
            number = int(gutter[1])
        elif "^" in line and number is not None:
            return number
    return number


def _renumber(line: str, source: ShaderSource) -> str:
    gutter = re.match(r"(\s*)(\d+)(\s*│)", line)
    if gutter:
        own = source.where(int(gutter[2])).rpartition(":")[2]
        return gutter[1] + own.rjust(len(gutter[2])) + line[gutter.start(3) :]
    header = re.match(r"(\s*┌─ ).*?:(\d+):(\d+)$", line)
    return f"{header[1]}{source.where(int(header[2]))}:{header[3]}" if header else line


def reason(error: Exception) -> str:
    """Return a wgpu error without its headings, as one line."""
    lines = [line.strip() for line in str(error).splitlines()]
    kept = [line for line in lines if line and line not in ("Validation Error", "Caused by:") and line[:3] != "In "]
    return ": ".join(kept) or type(error).__name__
