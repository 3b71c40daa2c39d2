"""The reader of WGSL: imports, tokens, bindings, structs and constants, as reflection of the shader files."""
