"""Limits that WebGPU promises on every device, whatever the adapter."""

MAX_TEXTURE_SIDE = 8192  # texels: maxTextureDimension2D
