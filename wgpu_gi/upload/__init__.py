"""What the GPU gets of a scene: hierarchy, tables of lights and materials, draws, textures."""
