"""Polygons of mesh files cut into triangles: areas, winding, concave, crossing and damaged ones."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wgpu_gi.scene.files.notes import Notes
from wgpu_gi.scene.files.polygons import MAX_CORNERS, triangulate

L_SHAPE = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4]], float)  # area 7
DART = np.array([[0, 0], [2, 0], [0.5, 0.5], [0, 2]], float)  # area 1


def in_space(flat, normal=(1, 2, 3), offset=(5, -7, 1)):
    """Place a polygon of the plane in space; it runs counter-clockwise about `normal`."""
    normal = np.array(normal, float) / np.linalg.norm(normal)
    right = np.cross([0, 1, 0], normal)
    right /= np.linalg.norm(right)
    return flat @ np.stack([right, np.cross(normal, right)]) + offset, normal


def cut(points, counts=None, ids=None):
    notes = Notes()
    ids = np.arange(len(points)) if ids is None else np.array(ids, np.int64)
    counts = np.array([len(ids)] if counts is None else counts, np.int64)
    corners, face = triangulate(np.asarray(points, float), ids, counts, "file", notes)
    return ids[corners], face, notes.sentences


def areas(points, triangles, normal):
    """Return the signed areas of triangles about a normal."""
    a, b, c = np.asarray(points, float)[triangles].transpose(1, 0, 2)
    return np.cross(b - a, c - a) @ normal / 2


def inside(flat, point):
    """Tell by the even-odd rule whether a polygon holds a point."""
    (x, y), (px, py) = flat.T, point
    nx, ny = np.roll(x, -1), np.roll(y, -1)
    crosses = (y > py) != (ny > py)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.count_nonzero(crosses & (px < x + (py - y) / (ny - y) * (nx - x))) % 2 == 1


@pytest.mark.parametrize(("flat", "area"), [(L_SHAPE, 7.0), (DART, 1.0)])
@pytest.mark.parametrize("first", range(6))
@pytest.mark.parametrize("turn", [1, -1])
def test_concave_polygons_from_every_corner_and_side(flat, area, first, turn):
    """A fan about the wrong corner covers ground outside; the winding stays that of the polygon."""
    flat = np.roll(flat, first, axis=0)[::turn]
    points, normal = in_space(flat)
    triangles, _, notes = cut(points)
    signed = areas(points, triangles, turn * normal)
    assert len(triangles) == len(flat) - 2 and (signed > 0).all() and not notes
    assert signed.sum() == pytest.approx(area, rel=1e-12)
    assert all(inside(flat, flat[triangle].mean(0)) for triangle in triangles)


@settings(max_examples=60, deadline=None)
@given(st.integers(4, 40), st.integers(0, 10**6), st.floats(-8, 8), st.booleans())
def test_star_shaped_polygons_keep_their_area(count, seed, size, turned):
    """Radii of random length about a point give concave polygons of known area, at any scale."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    flat = rng.uniform(0.2, 1.0, count)[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1) * 10.0**size
    x, y = flat.T
    area = abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)
    points, normal = in_space(flat[::-1] if turned else flat, offset=np.zeros(3))
    triangles, _, notes = cut(points)
    signed = areas(points, triangles, -normal if turned else normal)
    assert signed.sum() == pytest.approx(area, rel=1e-9) and signed.min() >= -1e-9 * area and not notes


def test_convex_polygons_are_fans_in_the_order_of_the_file():
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 9]]
    triangles, face, _ = cut(square, [3, 4, 2, 3], [0, 1, 4, 0, 1, 2, 3, 0, 1, 2, 3, 4])
    np.testing.assert_array_equal(triangles, [[0, 1, 4], [0, 1, 2], [0, 2, 3], [2, 3, 4]])
    np.testing.assert_array_equal(face, [0, 1, 1, 3])


def test_polygons_that_are_not_flat_keep_their_corners():
    triangles, _, notes = cut([[0, 0, 0], [1, 0, 0.2], [1, 1, 0], [0, 1, 0.2]])
    assert len(triangles) == 2 and not notes


def test_a_polygon_that_crosses_itself_costs_a_note():
    """With four corners it is a fan; of more corners, what earcut finds, nothing without an area."""
    bow_tie = [[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]]
    triangles, face, notes = cut([*bow_tie, [0, 0, 1]], [4, 3], [0, 1, 2, 3, 0, 1, 4])
    np.testing.assert_array_equal(triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 4]])
    assert len(notes) == 1 and "cross themselves, with a guess at their inside: 1" in notes[0]
    eight = [[0, 0, 0], [1, 1, 0], [2, 0, 0], [2, 1, 0], [1, 0, 0], [0, 1, 0]]
    _, face, notes = cut([*eight, [0, 0, 1]], [6, 3], [0, 1, 2, 3, 4, 5, 0, 1, 6])
    assert 1 in face and "cross themselves" in notes[0]


def test_wrong_vertices_cost_their_face():
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, np.nan, 0]]
    ids = [0, 1, 2, 0, 1, 9, 0, 1, -1, 0, 1, 3, 0, 1, 2, 3]
    _, face, notes = cut(points, [3, 3, 3, 3, 4], ids)
    np.testing.assert_array_equal(face, [0])
    assert notes == [
        "file: faces left out, because a vertex does not exist: 2",
        "file: faces left out, because a vertex is NaN or infinite: 2",
    ]


def test_endless_polygons_are_left_out():
    """earcut takes time that grows with the square of the corners."""
    count = MAX_CORNERS + 1
    triangles, _, notes = cut(np.zeros((3, 3)), [count], np.arange(count) % 3)
    assert len(triangles) == 0 and "more than 65536 corners" in notes[0]
