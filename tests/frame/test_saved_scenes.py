"""A generated scene, saved as .glb and loaded, gives the same picture."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.pictures import shoot

from wgpu_gi.measure.scenes import KINDS, make_scene
from wgpu_gi.scene.files.environment_files import load_environment
from wgpu_gi.scene.gltf.write import save_glb
from wgpu_gi.scene.load import load


@pytest.mark.parametrize("kind", KINDS)
def test_a_saved_scene_gives_the_same_picture(tmp_path, kind):
    """Bit for bit; if the sky was turned, a few paths in a hundred meet another texel, since the file holds no turn."""
    scene = make_scene(kind, 1)
    env = save_glb(tmp_path / "scene.glb", scene)
    loaded = load(tmp_path / "scene.glb", environment=None if env is None else load_environment(env))
    pictures = [shoot(s, (32, 18), show=("radiance",), spp=2, bounces=2)["radiance"] for s in (scene, loaded)]
    turned = scene.environment is not None and scene.environment.rotation != 0
    assert np.mean(np.any(pictures[0] != pictures[1], axis=-1)) <= (0.05 if turned else 0)
