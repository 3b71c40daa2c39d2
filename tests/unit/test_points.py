"""Point clouds: the shapes that show them, their default size, and files of points without faces."""

import numpy as np
import pytest
from unit.test_mesh_files import SQUARE, area, obj, ply, write

from wgpu_gi.errors import GiError
from wgpu_gi.scene.check import check_scene
from wgpu_gi.scene.files import points as module
from wgpu_gi.scene.files.memory import MemoryBudget
from wgpu_gi.scene.files.notes import Notes
from wgpu_gi.scene.files.points import default_size, points_scene
from wgpu_gi.scene.files.raw_mesh import RawPoints
from wgpu_gi.scene.load import load

GRID = np.stack(np.meshgrid(np.arange(20), np.arange(20), [0.0]), -1).reshape(-1, 3)


def shown(points, size=None, notes=None, budget=None):
    return points_scene(points, size, "cloud", "cloud", notes or Notes(), budget or MemoryBudget())


@pytest.mark.parametrize("count", [1, 10, 400, 3000, 30_000])
@pytest.mark.parametrize("normal", [None, (0.0, 0.0, 1.0), (0.6, -0.8, 0.0), (0.0, 0.0, -1.0)])
def test_shapes_have_the_area_of_spheres_and_discs(count, normal):
    """4 pi r2 and pi r2, whatever the number of corners; discs face along the normal."""
    rng = np.random.default_rng(0)
    points = RawPoints(
        rng.random((count, 3)) * 100, normals=None if normal is None else np.tile(normal, (count, 1)) * 7
    )
    scene = shown(points, size=0.5)
    check_scene(scene)
    assert area(scene) == pytest.approx(count * np.pi * 0.25**2 * (4 if normal is None else 1), rel=1e-3)
    mesh = scene.meshes[0]
    corners = mesh.positions[mesh.triangles].astype(float)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if normal is not None:
        np.testing.assert_allclose(mesh.normals, np.tile(normal, (len(mesh.normals), 1)), atol=1e-6)
    assert (np.einsum("tc,tkc->tk", faces, mesh.normals[mesh.triangles]) > 0).all()
    if normal is None:
        # Normals of spheres point away from the centre.
        per_point = len(mesh.positions) // count
        centred = mesh.positions.reshape(count, per_point, 3)
        centred = centred - centred.mean(1, keepdims=True)
        np.testing.assert_allclose(
            centred / np.linalg.norm(centred, axis=2, keepdims=True), mesh.normals.reshape(count, -1, 3), atol=2e-3
        )


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_default_size_is_twice_the_spacing(scale):
    """Inside of a square grid, four neighbours lie at its spacing, at the border three; copies count once."""
    size = default_size(np.concatenate([GRID, GRID]) * scale + 5 * scale)
    assert size == pytest.approx(2.0 * scale, rel=0.1)
    rng = np.random.default_rng(3)
    random = rng.random((40_000, 3)) * (1, 1, 0) * scale
    # Poisson points: the mean distance to the k-th neighbour is Gamma(k + 1/2) / (Gamma(k) sqrt(pi n)), 1.09 for k = 4.
    assert default_size(random) == pytest.approx(2 * 1.0938 * scale / np.sqrt(40_000), rel=0.1)


def test_default_sizes_of_a_few_points():
    assert default_size(np.ones((1, 3))) == default_size(np.ones((5, 3))) == 1.0
    assert default_size(np.array([[0, 0, 0], [3, 0, 0.0]])) == pytest.approx(6.0)


def test_colours_and_notes():
    colors = np.array([[1, 0, 0, 1], [0, 0.5, 0, 1]])
    notes = Notes()
    mesh = shown(RawPoints(np.array([[0, 0, 0], [9, 0, 0.0]]), colors), notes=notes).meshes[0]
    np.testing.assert_allclose(mesh.colors.reshape(2, -1, 4)[:, 0], colors)
    assert mesh.materials[0].base_color == (1, 1, 1, 1)
    assert notes.sentences[0].startswith("cloud: 2 points without faces are shown as spheres of 18 m, twice their")


def test_wrong_points_and_normals_cost_themselves():
    notes = Notes()
    points = RawPoints(np.array([[0, 0, 0], [np.nan, 0, 0], [1, 0, 0.0]]), normals=np.zeros((3, 3)))
    scene = shown(points, 0.1, notes)
    assert area(scene) == pytest.approx(2 * np.pi * 0.1**2, rel=1e-3)
    assert "NaN or infinite: 1" in notes.sentences[0] and "no normal" in notes.sentences[1]
    with pytest.raises(GiError, match="no finite points"):
        shown(RawPoints(np.full((4, 3), np.inf)))
    for size in (0.0, -1.0, float("nan"), 1e300):
        with pytest.raises(GiError, match="size of points"):
            shown(RawPoints(GRID), size)


def test_endless_clouds_are_thinned_and_bounded(monkeypatch):
    monkeypatch.setattr(module, "MAX_POINTS", 100)
    notes = Notes()
    scene = shown(RawPoints(GRID), 0.5, notes)
    assert area(scene) == pytest.approx(100 * np.pi * 0.5**2, rel=1e-3)
    assert "of 400 points, 100 are shown" in notes.sentences[0]
    np.testing.assert_allclose(scene.bounds()[:, 1], [-0.25, 19.25], atol=0.5)
    with pytest.raises(GiError, match="cloud as spheres: it unpacks to"):
        shown(RawPoints(GRID), budget=MemoryBudget(100_000))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.ply", ply(faces="")),
        ("a.obj", obj(*("v " + row for row in SQUARE.split("\n")[:4]))),
        ("a.off", f"OFF\n4 0 0\n{SQUARE}"),
    ],
)
def test_files_of_points(tmp_path, name, content):
    scene = load(write(tmp_path, name, content), point_size=0.1)
    assert area(scene) == pytest.approx(4 * 4 * np.pi * 0.05**2, rel=1e-3) and "as spheres of 0.1 m" in scene.notes[0]


def test_a_hundred_thousand_points(tmp_path):
    count = 100_000
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n"
    points = np.random.default_rng(0).random((count, 3)).astype("<f4")
    path = write(tmp_path, "a.ply", (header + "property float z\nend_header\n").encode() + points.tobytes())
    assert load(path).triangle_count == 8 * count
