"""Reflection of WGSL files: imports, tokens, bindings, structs and constants."""
