"""The deferred base: direct light by shadow maps and the environment's light, from a G-buffer."""
