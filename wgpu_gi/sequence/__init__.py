"""Sequences of frames: what they are, which must be rendered together, how they are rendered and kept in files."""
