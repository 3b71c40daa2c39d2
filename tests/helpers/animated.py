"""A small animated scene: a wall that slides over a floor, a camera beside it, and a lamp that dims."""

from __future__ import annotations

import numpy as np

from wgpu_gi.camera import Camera
from wgpu_gi.scene.animation import Animation, Attachment, Channel, Node, Track
from wgpu_gi.scene.built_in.shapes import quad
from wgpu_gi.scene.scene import Instance, Material, PointLight, Scene

SLIDE, DIM = 1.0, 2.0  # seconds
WIDTH = 0.8  # metres by which the wall slides


def animated_scene() -> Scene:
    """Return the scene. "slide" moves the wall and the second camera, "rider"; "dim" halves the lamp's light."""
    floor = Instance(quad((-3, 0, 3), (6, 0, 0), (0, 0, -6), Material("floor", (0.7, 0.7, 0.7, 1.0))), name="floor")
    wall = Instance(quad((-0.3, 0, 0), (0.6, 0, 0), (0, 1, 0), Material("wall", (0.8, 0.5, 0.3, 1.0))), name="wall")
    lamp = PointLight((0.5, 2.0, 1.5), 20.0, name="lamp")
    still, rider = (Camera.look_at((0, 1, 4), (0, 1, 0), yfov_deg=50, name=name) for name in ("still", "rider"))

    rail, tripod = Node(name="rail"), Node(name="tripod")
    times = np.array([0, SLIDE])
    slide = [
        Channel(rail, "translation", Track(times, np.array([[-WIDTH / 2, 0, 0], [WIDTH / 2, 0, 0]]))),
        Channel(tripod, "translation", Track(times, np.array([[0, 0, 0], [0.5, 0, 0]]))),
    ]
    dim = Channel(lamp, "intensity", Track(np.array([0, DIM]), np.array([20.0, 10.0])))
    carried = [Attachment(wall, rail), Attachment(rider, tripod, rider.world_from_view.copy())]
    animations = [Animation("slide", slide, carried), Animation("dim", [dim])]
    return Scene([floor, wall], [lamp], None, [still, rider], "slide", animations=animations)
