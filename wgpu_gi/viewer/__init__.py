"""The viewer, as a desktop window and in a notebook: the scene, all settings, and the passes of a frame."""
