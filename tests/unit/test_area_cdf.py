"""The CDF of surface areas, and the layout of reflective shadow maps."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.medley import at
from helpers.scene_dtypes import DTYPES

from wgpu_gi.gpu.wgsl.load import load
from wgpu_gi.scene.built_in.shapes import box, quad
from wgpu_gi.scene.scene import Instance
from wgpu_gi.techniques.many_light.update import check_light_order
from wgpu_gi.upload.area_cdf import AreaCdf
from wgpu_gi.upload.light_table import KIND_ENVIRONMENT, KIND_SPOT, KIND_SUN, KIND_TRIANGLE
from wgpu_gi.upload.mesh_data import NONE
from wgpu_gi.upload.rsm_layout import rsm_layout
from wgpu_gi.upload.two_level_bvh import TwoLevelBvh

AREA_INSTANCE = load("many_light/points/sample.wgsl").struct_dtype("AreaInstance")
RSM_LIGHT = load("many_light/rsm/trace.wgsl").struct_dtype("RsmLight")
LIGHT = load("scene/lights.wgsl").struct_dtype("Light")


def updated(instances):
    hierarchy, table = TwoLevelBvh(DTYPES), AreaCdf(AREA_INSTANCE)
    hierarchy.update(instances, {id(m): 0 for i in instances for m in i.mesh.materials})
    table.update(instances, hierarchy)
    return table, hierarchy


def test_areas_of_instances():
    """A floor of 6 m2, and two instances of a cube of 6 m2, one of them stretched to 2 x 1 x 1."""
    floor, cube = quad((0, 0, 0), (2, 0, 0), (0, 0, 3)), box((0, 0, 0), (1, 1, 1))
    stretched = np.diag([2.0, 1.0, 1.0, 1.0])
    table, hierarchy = updated([Instance(floor), Instance(cube), Instance(cube, stretched)])
    assert table.area == pytest.approx(6 + 6 + 10)
    assert np.allclose(table.instances["share"], np.array([6, 6, 10]) / 22)
    assert np.allclose(table.instances["cumulative"], [6 / 22, 12 / 22, 1])
    assert table.instances["instance"].tolist() == [NONE, 1, 2]
    assert np.allclose(table.instances["local_area"], [6, 6, 6])
    for record in table.instances:
        shares = table.cdf[record["first"] : record["first"] + record["count"]]
        assert (np.diff(shares) > 0).all() and shares[-1] == 1
    assert len(table.cdf) == len(hierarchy.triangles)


@pytest.mark.parametrize("scale", [(2, 2, 2), (-3, 3, 3), (1e-3, 1e-3, 1e-3), (1, 5, 0.1)])
def test_area_after_a_transform(scale):
    table, _ = updated([Instance(box((0, 0, 0), (1, 1, 1)), at(1, 2, 3, scale, 0.7))])
    x, y, z = np.abs(scale)
    assert table.area == pytest.approx(2 * (x * y + y * z + z * x))


def test_scenes_without_area():
    table, _ = updated([])
    assert table.area == 0 and len(table.instances) == 1


def light_table(kinds, probabilities):
    lights = np.zeros(max(len(kinds), 1), LIGHT)
    lights["kind"][: len(kinds)], lights["probability"][: len(kinds)] = kinds, probabilities
    return lights


def test_rsm_texels_are_proportional_to_probability():
    records, texels = rsm_layout(
        light_table([KIND_SPOT, KIND_SUN, KIND_TRIANGLE], [0.1, 0.4, 0.5]), 3, 16384, RSM_LIGHT
    )
    assert records["level"].tolist() == [5, 6]  # of 3277 and 13107 texels: 32 x 32 and 64 x 64
    assert records["first"].tolist() == [0, 1024] and texels == 1024 + 4096


def test_the_order_of_lights_is_checked():
    """Punctual lights first and the environment last, as shaders of many-light index them."""
    for kinds in ([], [KIND_SUN, KIND_SPOT], [KIND_SPOT, KIND_TRIANGLE, KIND_TRIANGLE, KIND_ENVIRONMENT]):
        check_light_order(light_table(kinds, [1.0] * len(kinds)), len(kinds))
    for kinds in ([KIND_TRIANGLE, KIND_SPOT], [KIND_SPOT, KIND_ENVIRONMENT, KIND_TRIANGLE]):
        with pytest.raises(AssertionError, match="environment last"):
            check_light_order(light_table(kinds, [1.0] * len(kinds)), len(kinds))


def test_every_light_gets_an_rsm():
    records, texels = rsm_layout(light_table([KIND_SPOT] * 5000, [1 / 5000] * 5000), 5000, 4096, RSM_LIGHT)
    assert (records["level"] == 1).all() and texels == 4 * 5000
    assert rsm_layout(light_table([], []), 0, 4096, RSM_LIGHT)[1] == 0
    assert rsm_layout(light_table([KIND_TRIANGLE], [1.0]), 1, 4096, RSM_LIGHT)[1] == 0
