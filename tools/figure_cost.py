"""What a walking figure costs in a moving frame: frames in which it walks, against frames in which it keeps its pose.

The door and the lamp of the built-in scene `walk` move in both. Milliseconds of processor time on two cores: the CPU
time of the process, the driver's threads included, divided by two. On a GPU they are those of the main thread.

    python tools/figure_cost.py --vertices 50000 --joints 60 --gi many-light --size 640x360
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from wgpu_gi.cli.argument_types import parse_size
from wgpu_gi.options import TECHNIQUES, Settings
from wgpu_gi.renderer import Renderer
from wgpu_gi.scene.built_in.walk import walk
from wgpu_gi.scene.player import Player
from wgpu_gi.scene.scene import Scene

WARM_UP, RATE, START = 5, 30.0, 1.0  # frames; frames per second; seconds: the door moves


def main() -> None:
    """Print the medians of both kinds of frames, and their difference."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vertices", type=int, default=50_000)
    parser.add_argument("--joints", type=int, default=60)
    parser.add_argument("--gi", choices=list(TECHNIQUES), default="many-light")
    parser.add_argument("--size", type=parse_size, default=(640, 360))
    parser.add_argument("--frames", type=int, default=20)
    arguments = parser.parse_args()

    walking = walk(arguments.vertices, arguments.joints)
    settings = Settings(gi=arguments.gi)
    settings.camera.frames, settings.camera.jitter = 1, False
    middle = START + (WARM_UP + arguments.frames / 2) / RATE
    players = [Player(walking), Player(standing(walk(arguments.vertices, arguments.joints), middle))]
    renderers = [Renderer(p.scene, size=arguments.size, camera=p.source.cameras[0], settings=settings) for p in players]
    # Frames of both kinds alternate, so that other load on the machine affects both.
    times: list[list[float]] = [[], []]
    for frame in range(WARM_UP + arguments.frames):
        for player, renderer, own in zip(players, renderers, times, strict=True):
            started = time.process_time()
            player.pose(START + frame / RATE)
            renderer.step(show=("radiance",), preview=True)
            renderer.graph.device.wait()
            if frame >= WARM_UP:
                own.append((time.process_time() - started) * 500)
    walks, stands = (float(np.median(own)) for own in times)
    difference = float(np.median(np.subtract(times[0], times[1])))  # of neighbouring frames
    figure = next(i.mesh for i in walking.instances if i.mesh.skin is not None)
    print(f"{len(figure.positions)} vertices, {len(figure.triangles)} triangles, {arguments.joints} joints")
    alone = deformation_alone(renderers[0], arguments.frames)
    print(f"deformation and refit alone {alone:.1f} ms")
    print(f"walking {walks:.1f} ms, standing {stands:.1f} ms, difference {difference:.1f} ms")


def deformation_alone(renderer: Renderer, times: int) -> float:
    """Return the median milliseconds of the device's work for a pose, by itself."""
    upload = renderer._gpu.upload
    assert upload is not None
    found = []
    for _ in range(times):
        upload.deformation.pose(True)
        started = time.process_time()
        upload.deformation.run()
        renderer.graph.device.wait()
        found.append((time.process_time() - started) * 500)
    return float(np.median(found))


def standing(scene: Scene, time: float) -> Scene:
    """Return the scene with a figure that keeps its pose of a time."""
    for instance, posed in zip(scene.instances, scene.at(time).instances, strict=True):
        if instance.mesh.skin is not None:
            instance.world_from_local, instance.joint_matrices = posed.world_from_local, posed.joint_matrices
    return replace(scene, animations=[replace(animation, skeletons=[]) for animation in scene.animations])


if __name__ == "__main__":
    main()
