"""A generated scene, saved as .glb and loaded, gives the same picture."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.pictures import shoot

from wgpu_gi.measure.scenes import KINDS, make_scene
from wgpu_gi.scene.deformation import is_deformed
from wgpu_gi.scene.files.environment_files import load_environment
from wgpu_gi.scene.gltf.write import save_glb
from wgpu_gi.scene.load import load


@pytest.mark.parametrize("kind", KINDS)
def test_a_saved_scene_gives_the_same_picture(tmp_path, kind):
    """Bit for bit; if the sky was turned, a few paths in a hundred meet another texel, since the file holds no turn.

    The device poses what the file holds posed: positions differ by the rounding of float32, and so do pictures.
    """
    scene = make_scene(kind, 1)
    env = save_glb(tmp_path / "scene.glb", scene)
    loaded = load(tmp_path / "scene.glb", environment=None if env is None else load_environment(env))
    pictures = [shoot(s, (32, 18), show=("radiance",), spp=2, bounces=2)["radiance"] for s in (scene, loaded)]
    turned = scene.environment is not None and scene.environment.rotation != 0
    rounding = 1e-4 * pictures[0].mean() if any(map(is_deformed, scene.instances)) else 0
    other = np.any(np.abs(pictures[0] - pictures[1]) > rounding, axis=-1)
    assert np.mean(other) <= (0.05 if turned or rounding else 0)
