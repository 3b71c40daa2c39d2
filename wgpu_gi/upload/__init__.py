"""What the GPU gets of a scene: acceleration structure, light and material tables, draw list, textures."""
