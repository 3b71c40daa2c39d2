"""Scenes as plain data, and the readers that fill them."""
