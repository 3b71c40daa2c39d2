"""Speeds up cffi's lookup of C types for wgpu-py: pointers to named types, and arrays of them, skip the C parser.

At the first use of a type name, cffi parses it together with all typedefs of the library (several hundred), with a C
parser written in Python. For a first picture this takes 0.8 of 1.25 s on the main thread (Cornell box, 64x36,
`--gi none`). cffi has no public way around this, so `parse_type` of its private parser is replaced.
"""

from __future__ import annotations

import re
from typing import Any

from cffi import model

_SIMPLE = re.compile(r"(\w+) ?(\*|\[\]) ?")


def read_types_quickly(ffi: Any) -> None:
    """Replace the type lookup of a cffi.FFI. A cffi without the private attributes that this needs stays unchanged."""
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
