"""The GPU data of a scene: acceleration structure, light and material tables, draw list, textures."""
