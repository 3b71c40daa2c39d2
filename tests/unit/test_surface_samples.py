"""Points spread over surfaces: they lie on them, by area, and are deterministic."""

from __future__ import annotations

import numpy as np
import pytest

from wgpu_gi.scene.built_in.shapes import box, grid, quad, sphere
from wgpu_gi.scene.scene import Instance, Mesh
from wgpu_gi.upload.surface_samples import SurfaceSamples
from wgpu_gi.upload.two_level_bvh import TwoLevelBvh


def samples_of(dtypes, instances, **options):
    """Return points in world space, (n, 3)."""
    hierarchy = TwoLevelBvh(dtypes)
    materials = {id(m): 0 for i in instances for m in i.mesh.materials}
    hierarchy.update(instances, materials)
    samples = SurfaceSamples()
    points = samples.draw(instances, hierarchy, **options)
    assert np.isfinite(points).all()
    for again in (samples, SurfaceSamples()):
        assert np.array_equal(again.draw(instances, hierarchy, **options), points)
    return points + hierarchy.origin


def at(x, y=0.0, z=0.0, scale=(1.0, 1.0, 1.0)):
    matrix = np.diag([*scale, 1.0])
    matrix[:3, 3] = (x, y, z)
    return matrix


def test_points_lie_on_the_surfaces(dtypes):
    instances = [Instance(quad((0, 1, 0), (0, 0, 2), (3, 0, 0))), Instance(box((5, 0, 0), (6, 1, 1)))]
    points = samples_of(dtypes, instances)
    assert len(points) == 4096
    on_quad = points[:, 0] < 4
    assert np.allclose(points[on_quad, 1], 1, atol=1e-6)
    assert (points[on_quad] >= (0, 1 - 1e-6, 0)).all() and (points[on_quad] <= (3, 1 + 1e-6, 2)).all()
    to_face = np.abs(points[~on_quad] - (5.5, 0.5, 0.5)).max(1)
    assert np.allclose(to_face, 0.5, atol=1e-6)
    # Both have an area of 6 m2.
    assert on_quad.mean() == pytest.approx(0.5, abs=2 / 4096)


@pytest.mark.parametrize("count", [64, 1000, 4096])
def test_points_are_spread_evenly(dtypes, count):
    """Each part of a floor gets points by its area, with less deviation than random points."""
    points = samples_of(dtypes, [Instance(grid(8.0, 4))], count=count)
    assert len(points) == count
    found = np.histogram2d(points[:, 0], points[:, 2], bins=8, range=[[-4, 4], [-4, 4]])[0]
    expected = count / 64
    assert np.mean((found - expected) ** 2) <= expected


def test_each_instance_has_its_share(dtypes):
    """Half equally, half by world area: three balls, one twice as large, one mirrored."""
    ball = sphere(subdivisions=2)
    scales = [(1, 1, 1), (2, 2, 2), (-1, 1, 1)]
    points = samples_of(dtypes, [Instance(ball, at(10 * k, 0, 0, scale)) for k, scale in enumerate(scales)])
    shares = np.bincount(np.round(points[:, 0] / 10).astype(int)) / len(points)
    assert shares == pytest.approx([1 / 4, 1 / 2, 1 / 4], abs=2 / len(points))
    radius = np.linalg.norm(points[points[:, 0] < 5], axis=1)
    assert (radius < 1.05).all() and (radius > 0.95).all()


def test_large_meshes_are_thinned_out(dtypes):
    """Leaving out triangles of a large mesh must not reduce its share."""
    fine, coarse = grid(2.0, 100), quad((5, 0, 5), (0, 0, 2), (2, 0, 0))
    for count in (64, 300):
        points = samples_of(dtypes, [Instance(fine), Instance(coarse)], count=count)
        of_fine = points[:, 0] < 3
        # The triangles of the fine mesh are equal, so each of them determines its area.
        assert of_fine.mean() == pytest.approx(0.5, abs=2 / count)
        quarters = np.histogram2d(points[of_fine, 0], points[of_fine, 2], bins=2)[0] / of_fine.sum()
        assert np.allclose(quarters, 0.25, atol=0.12)


def test_no_area_no_points(dtypes):
    points = np.array([(1, 0, 0), (2, 0, 0), (3, 0, 0)], np.float32)
    needle = Mesh(points, np.array([(0, 1, 2), (1, 1, 1)], np.uint32))
    for instances in ([], [Instance(needle)]):
        assert samples_of(dtypes, instances).shape == (0, 3)
    beside = samples_of(dtypes, [Instance(needle), Instance(grid(1.0), at(0, 5)), Instance(needle, at(0, 9))])
    assert np.allclose(beside[:, 1], 5)


def test_far_from_the_origin(dtypes):
    near, far = (
        samples_of(dtypes, [Instance(box((0, 0, 0), (1, 2, 3)), at(x)), Instance(grid(4.0), at(x))])
        for x in (0.0, 2.0**23)
    )
    assert np.allclose(far - (2.0**23, 0, 0), near, atol=1e-5)
