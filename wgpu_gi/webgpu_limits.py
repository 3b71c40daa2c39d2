"""Limits that WebGPU guarantees on every device."""

MAX_TEXTURE_SIDE = 8192  # texels: maxTextureDimension2D
