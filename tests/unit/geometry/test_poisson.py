"""Exact counts, even spacing, on the surface, the same every time."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from n2n.errors import InputError
from n2n.geometry.poisson import poisson_disk, thin


def _gaps(points):
    return cKDTree(points).query(points, 2)[0][:, 1]


@pytest.fixture(scope="module")
def cube():
    """A cube of edge 2 whose faces are of very different sizes."""
    mesh = trimesh.creation.box((2, 2, 2)).subdivide()
    mesh = trimesh.Trimesh(*trimesh.remesh.subdivide(mesh.vertices, mesh.faces, np.arange(12)))
    return np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)


@pytest.mark.parametrize("count", [1, 7, 100, 1000, 4321])
def test_exactly_as_many_as_asked_for(cube, count):
    assert poisson_disk(*cube, count).shape == (count, 3)


def test_points_lie_on_the_surface_and_keep_their_distance(cube):
    points = poisson_disk(*cube, 2000, seed=3)
    np.testing.assert_allclose(np.abs(points).max(axis=1), 1, atol=1e-6)
    ideal = np.sqrt(24 / 2000)
    # Independent points have pairs as close as a hundredth of that.
    assert _gaps(points).min() > 0.7 * ideal and _gaps(points).max() < 1.6 * ideal
    side = np.bincount(2 * np.abs(points).argmax(axis=1) + (points.sum(axis=1) > 0), minlength=6)
    assert side.sum() == 2000


def test_every_side_of_a_cube_gets_a_sixth(cube):
    points = poisson_disk(*cube, 3000)
    axis = np.abs(points).argmax(axis=1)
    side = 2 * axis + (points[np.arange(3000), axis] > 0)
    np.testing.assert_allclose(np.bincount(side, minlength=6), 500, atol=40)


def test_seeds(cube):
    first = poisson_disk(*cube, 500, seed=0)
    assert (first == poisson_disk(*cube, 500, seed=0)).all()
    assert (first != poisson_disk(*cube, 500, seed=1)).any()
    assert poisson_disk(*cube, 500, seed=2**31 - 1).shape == (500, 3)


def test_a_mesh_without_area_is_refused():
    with pytest.raises(InputError, match="the mesh has no area"):
        poisson_disk(np.zeros((3, 3)), np.array([[0, 1, 2]]), 10)


@pytest.mark.parametrize("count", [1, 50, 1000, 4000, 7999, 8000])
def test_thinning_is_exact_without_repeats(count):
    points = np.random.default_rng(0).random((8000, 3)) * [1, 1, 0]
    rows = thin(points, count)
    assert len(np.unique(rows)) == count and (np.diff(rows) > 0).all()
    assert (rows == thin(points, count)).all()


def test_thinning_spreads_points_evenly():
    points = np.random.default_rng(0).random((20_000, 3)) * [1, 1, 0]
    kept = points[thin(points, 2000, seed=1)]
    ideal = np.sqrt(1 / 2000)
    assert _gaps(kept).min() > 0.6 * ideal
    # No hole: every point that was left out has a kept one nearby.
    assert cKDTree(kept).query(points)[0].max() < 1.6 * ideal


def test_thinning_repeated_points():
    points = np.repeat(np.random.default_rng(0).random((100, 3)), 30, axis=0)
    kept = points[thin(points, 90)]
    assert len(np.unique(kept, axis=0)) == 90


def test_thinning_more_than_there_are():
    with pytest.raises(InputError, match="11 points were asked for, but there are only 10"):
        thin(np.random.default_rng(0).random((10, 3)), 11)
