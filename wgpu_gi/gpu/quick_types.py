"""Spares wgpu the time that cffi takes to read the names of C types.

cffi has hundreds of typedefs read again by a C parser for each name that it meets first; that took 1.7 s of processor
time for one small picture, of 3.3 s in all. Pointers to named types, and arrays of them, need no parser.
"""

from __future__ import annotations

import re
from typing import Any

from cffi import model

_SIMPLE = re.compile(r"(\w+) ?(\*|\[\]) ?")


def read_types_quickly(ffi: Any) -> None:
    """Let a cffi.FFI look up what it can; without the parts of cffi that this needs, nothing changes."""
    parser = getattr(ffi, "_parser", None)
    parse, declarations = getattr(parser, "parse_type", None), getattr(parser, "_declarations", None)
    if parser is None or parse is None or declarations is None:
        return

    def parse_type(text: str) -> Any:
        match = _SIMPLE.fullmatch(text)
        found = declarations.get(f"typedef {match[1]}") if match else None
        if match is None or found is None:
            return parse(text)
        kind, qualifiers = found
        return model.PointerType(kind, qualifiers) if match[2] == "*" else model.ArrayType(kind, None)

    parser.parse_type = parse_type
