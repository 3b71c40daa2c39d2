"""Readers of meshes, environments, cameras and lights from files and from text; glTF has a folder of its own."""
