"""Readers of meshes, images, environments, cameras and lights from files and text; glTF has its own folder."""
