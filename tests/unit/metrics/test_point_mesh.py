"""Points against meshes: closed forms, and a constrained least squares that shares nothing with the kernel."""

import numpy as np
import pytest
import trimesh
from scipy.optimize import nnls

from n2n.errors import InputError
from n2n.metrics import box_tree
from n2n.metrics.point_mesh import closest_on_mesh, distances_to_mesh, line_distances, point_to_mesh

TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
FACE = np.array([[0, 1, 2]])


def by_least_squares(point, corners):
    """Return the distance of a point to the convex hull of corners: weights >= 0 that sum to 1."""
    heavy = 1e7  # on the sum of the weights
    system = np.vstack([corners.T, heavy * np.ones(len(corners))])
    weights, _ = nnls(system, np.append(point, heavy))
    return np.linalg.norm(weights @ corners / weights.sum() - point)


def random_mesh(seed, vertices=12, faces=15):
    random = np.random.default_rng(seed)
    return random.normal(size=(vertices, 3)), np.array([random.permutation(vertices)[:3] for _ in range(faces)])


@pytest.mark.parametrize("spread", [0.5, 3.0])
def test_both_directions_equal_a_constrained_least_squares(spread):
    vertices, faces = random_mesh(0)
    points = spread * np.random.default_rng(1).normal(size=(40, 3))
    expected = np.array([[by_least_squares(p, vertices[f]) for f in faces] for p in points])
    assert np.allclose(distances_to_mesh(points, vertices, faces), expected.min(axis=1), rtol=1e-7)
    found = point_to_mesh(points, vertices, faces)
    assert found.forward == pytest.approx((expected.min(axis=1) ** 2).mean(), rel=1e-7)
    assert found.backward == pytest.approx((expected.min(axis=0) ** 2).mean(), rel=1e-7)
    assert found.total == found.forward + found.backward


@pytest.mark.parametrize(
    ("point", "closest"),
    [
        ([0.2, 0.2, -3], [0.2, 0.2, 0]),  # over the inside
        ([-1, -1, 1], [0, 0, 0]),  # beyond each corner
        ([4, -1, 0], [1, 0, 0]),
        ([-1, 4, 0], [0, 1, 0]),
        ([0.3, -2, 1], [0.3, 0, 0]),  # beyond each edge
        ([-2, 0.3, 1], [0, 0.3, 0]),
        ([1, 1, 1], [0.5, 0.5, 0]),
    ],
)
def test_every_region_of_a_triangle(point, closest):
    point = np.array([point], float)
    assert np.allclose(closest_on_mesh(point, TRIANGLE, FACE), [closest], atol=1e-15)
    expected = np.linalg.norm(point - closest)
    assert distances_to_mesh(point, TRIANGLE, FACE) == pytest.approx(expected, rel=1e-14)
    assert point_to_mesh(point, TRIANGLE, FACE) == pytest.approx((expected**2, expected**2), rel=1e-14)


def test_a_box_in_closed_form():
    box = trimesh.creation.box([2, 2, 2])
    points = np.random.default_rng(0).uniform(-3, 3, (5000, 3))
    outside, inside = np.maximum(np.abs(points) - 1, 0), 1 - np.abs(points).max(axis=1)
    expected = np.where(inside > 0, inside, np.linalg.norm(outside, axis=1))
    assert np.allclose(distances_to_mesh(points, box.vertices, box.faces), expected, rtol=1e-12)
    closest = closest_on_mesh(points, box.vertices, box.faces)
    assert np.allclose(np.abs(closest).max(axis=1), 1, rtol=1e-12)
    assert np.allclose(np.linalg.norm(closest - points, axis=1), expected, rtol=1e-12)


def test_the_guard_takes_the_inside_of_small_faces_in_both_directions():
    point = np.array([[0.2, 0.3, 1.0]])  # the nearest edge is x = 0
    assert point_to_mesh(point, TRIANGLE, FACE, 0.5) == pytest.approx((1, 1))  # the area is 0.5: not smaller
    assert point_to_mesh(point, TRIANGLE, FACE, 0.51) == pytest.approx((1.04, 1.04))


def test_the_guard_counts_faces_not_edges():
    small, large = TRIANGLE * 0.1 + [0, 0, 5], TRIANGLE
    point = np.array([[0.02, 0.02, 4.0]])
    found = point_to_mesh(point, np.vstack([large, small]), np.array([[3, 4, 5], [0, 1, 2]]), 0.1)
    assert found.forward == pytest.approx(1 + 0.02**2)
    assert found.backward == pytest.approx((1 + 0.02**2 + 16) / 2)


def test_degenerate_faces_are_the_segments_and_points_they_cover():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    points = np.array([[1.5, 2.0, 0], [-3, 4, 0]])
    assert np.allclose(distances_to_mesh(points, vertices, FACE), [2, 5])
    assert np.allclose(
        distances_to_mesh(points, vertices, np.array([[1, 1, 1]])), np.linalg.norm(points - [1, 0, 0], axis=1)
    )


def test_blocks_change_nothing(monkeypatch):
    mesh = trimesh.creation.icosphere(subdivisions=3)
    points = np.random.default_rng(0).normal(size=(700, 3))
    whole = point_to_mesh(points, mesh.vertices, mesh.faces, 1e-3)
    monkeypatch.setattr(box_tree, "_PAIRS", 50)
    assert point_to_mesh(points, mesh.vertices, mesh.faces, 1e-3) == whole


def test_utm_coordinates_lose_little():
    vertices, faces = random_mesh(2)
    points, offset = np.random.default_rng(3).normal(size=(100, 3)), np.array([5e5, 5e6, 100])
    moved = point_to_mesh(points + offset, vertices + offset, faces)
    assert moved == pytest.approx(point_to_mesh(points, vertices, faces), rel=1e-7)


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        (np.zeros((0, 3), int), r"a mesh needs triangles, an array of shape \(f, 3\) with f > 0, got \(0, 3\)"),
        (np.array([[0, 1, 2, 0]]), r"got \(1, 4\)"),
        (np.array([[0, 1, 3]]), "vertices 0 to 3 are named, there are 3"),
        (np.array([[-1, 1, 2]]), "vertices -1 to 2"),
    ],
)
def test_meshes_that_are_none_are_named(faces, message):
    with pytest.raises(InputError, match=message):
        point_to_mesh(np.zeros((1, 3)), TRIANGLE, faces)


def test_lines_meet_the_mesh_where_geometry_says():
    """A sphere, whose crossings with a line are known: lines through the middle, and lines past it."""
    sphere = trimesh.creation.icosphere(5, radius=2.0)
    vertices, faces = np.asarray(sphere.vertices) + 100.0, np.asarray(sphere.faces)
    out = np.random.default_rng(0).normal(size=(200, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    points = 100.0 + 1.5 * out
    near = line_distances(points, -out, vertices, faces, reach=1.0)
    np.testing.assert_allclose(near, 0.5, atol=0.003)
    both = line_distances(points, out, vertices, faces, reach=4.0)  # 0.5 one way, 3.5 the other
    np.testing.assert_allclose(both, 2.0, atol=0.003)
    aside = np.cross(out, [0.0, 0.0, 1.0])
    past = line_distances(100.0 + 3.0 * out, aside / np.linalg.norm(aside, axis=1, keepdims=True), vertices, faces, 0.7)
    np.testing.assert_array_equal(past, 0.7)
    alone = line_distances(points[:1], out[:1], vertices, faces, reach=1.0)
    np.testing.assert_allclose(alone, [0.5], atol=0.003)
