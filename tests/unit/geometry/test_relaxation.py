"""Even spreading on planes, spheres and walls, where the surface and the densest packing are known."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from n2n.geometry.relaxation import spread


def plane(points):
    """Project onto z = 0."""
    return points * [1, 1, 0], np.tile([0.0, 0.0, 1.0], (len(points), 1))


def sphere(points):
    """Project onto the unit sphere."""
    normals = points / np.linalg.norm(points, axis=1, keepdims=True)
    return normals.copy(), normals


def wall(points, half=0.002):
    """Project onto the nearer side of a wall of thickness 2 half around z = 0."""
    side = np.where(points[:, 2:] >= 0, 1.0, -1.0)
    return np.hstack([points[:, :2], half * side]), np.hstack([np.zeros((len(points), 2)), side])


def tube(points):
    """Project onto the outside of a square column |x|, |y| <= 1: flat sides and sharp edges."""
    flat = points[:, :2]
    axis = np.abs(flat).argmax(axis=1)
    rows = np.arange(len(points))
    normals = np.zeros_like(points)
    normals[rows, axis] = np.sign(flat[rows, axis])
    moved = points.copy()
    moved[rows, axis] = normals[rows, axis]
    return moved, normals


def ball_points(count, seed=0):
    return sphere(np.random.default_rng(seed).normal(size=(count, 3)))[0]


def square_points(count, seed=0):
    return np.column_stack([np.random.default_rng(seed).random((count, 2)), np.zeros(count)])


def gaps(points, area):
    """Return distances to the nearest neighbour, as multiples of that in a hexagonal packing."""
    return cKDTree(points).query(points, 2)[0][:, 1] / np.sqrt(2 / np.sqrt(3) * area / len(points))


def holes(points, probes, area):
    """Return distances from probes to the nearest point, as multiples of the square root of the area per point."""
    return cKDTree(points).query(probes)[0] / np.sqrt(area / len(points))


def test_random_points_of_a_sphere_become_as_even_as_a_poisson_disk_sample():
    points, probes = ball_points(2000), ball_points(5000, 1)
    even = spread(points, sphere)
    assert even.shape == points.shape and even.dtype == np.float64
    assert np.abs(np.linalg.norm(even, axis=1) - 1).max() < 1e-12
    before, after = gaps(points, 4 * np.pi), gaps(even, 4 * np.pi)
    # A Poisson-disk sample of the bunny has a mean of 0.79 and a 5th percentile of 0.75.
    assert before.mean() < 0.55 and np.quantile(before, 0.05) < 0.2
    assert after.mean() > 0.85 and np.quantile(after, 0.05) > 0.75 and after.min() > 0.5
    assert np.sqrt((holes(even, probes, 4 * np.pi) ** 2).mean()) < 0.44  # random 0.56, hexagonal 0.40


def test_every_point_stays_near_its_place():
    points = ball_points(2000)
    moved = np.linalg.norm(spread(points, sphere) - points, axis=1) / np.sqrt(4 * np.pi / 2000)
    assert moved.mean() < 0.8 and moved.max() < 3


def test_even_points_hardly_move():
    even = spread(ball_points(1000), sphere)
    moved = np.linalg.norm(spread(even, sphere) - even, axis=1) / np.sqrt(4 * np.pi / 1000)
    assert moved.mean() < 0.2


@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_the_unit_of_length_does_not_matter(scale):
    points = square_points(300)
    assert np.allclose(spread(scale * points, plane), scale * spread(points, plane), atol=1e-6 * scale)


def test_open_borders_neither_grow_nor_shrink():
    points, spacing = square_points(2500), 1 / 50
    even = spread(points, plane)
    outside = np.maximum(-even, even - 1)[:, :2].max(axis=1)
    assert (even[:, 2] == 0).all()
    assert outside.max() < 1.5 * spacing and (outside > 0.5 * spacing).mean() < 0.02
    probes = square_points(20_000, 1)
    strip = probes[np.minimum(probes, 1 - probes)[:, :2].min(axis=1) < spacing]
    for place in (probes, strip):
        before, after = (np.sqrt((holes(cloud, place, 1.0) ** 2).mean()) for cloud in (points, even))
        assert after < 0.85 * before
    assert gaps(even, 1.0).mean() > 0.85


def test_a_hole_in_the_cloud_is_not_filled():
    points = square_points(3000)
    points = points[np.linalg.norm(points[:, :2] - 0.5, axis=1) > 0.25]
    even, spacing = spread(points, plane), np.sqrt((1 - np.pi * 0.25**2) / len(points))
    assert np.linalg.norm(even[:, :2] - 0.5, axis=1).min() > 0.25 - 1.5 * spacing


def test_the_two_sides_of_a_wall_do_not_act_on_each_other():
    upper, lower = square_points(900) + [0, 0, 0.002], square_points(900, 1) - [0, 0, 0.002]
    even = spread(np.concatenate([upper, lower]), wall)
    assert (even[:900, 2] == 0.002).all() and (even[900:, 2] == -0.002).all()
    for side in (even[:900], even[900:]):
        assert gaps(side, 1.0).mean() > 0.85
    # Each side alone comes to the same evenness: the other one, a seventeenth of the spacing away, costs nothing.
    alone = spread(upper, wall)
    assert abs(gaps(alone, 1.0).mean() - gaps(even[:900], 1.0).mean()) < 0.03


def test_sharp_edges_are_neither_crowded_nor_left():
    random = np.random.default_rng(0)
    along, height, side = random.uniform(-1, 1, 2000), random.uniform(0, 2, 2000), random.choice([-1, 1], 2000)
    points = np.column_stack([along, side, height])
    points[::2, :2] = points[::2, 1::-1]
    even = spread(points, tube)
    assert np.array_equal(tube(even)[0], even)
    assert gaps(even, 16.0).mean() > 0.8
    near_edge = np.abs(even[:, :2]).min(axis=1) > 0.8
    assert 0.17 < near_edge.mean() < 0.23  # a fifth of the area is that near to an edge


def test_a_dense_half_is_thinned_out():
    points = ball_points(8000)
    chosen = (points[:, 2] > 0) | (np.random.default_rng(1).random(8000) < 0.25)
    points = points[chosen][:2000]
    even, probes = spread(points, sphere), ball_points(5000, 2)
    share = (points[:, 2] > 0).mean(), (even[:, 2] > 0).mean()
    assert share[0] > 0.77 and abs(share[1] - 0.5) < 0.05
    assert gaps(even, 4 * np.pi).mean() > 0.85
    worst = [np.quantile(holes(cloud, probes, 4 * np.pi), 0.99) for cloud in (points, even)]
    assert worst[0] > 1.5 and worst[1] < 1.0


def test_a_stray_point_far_away_changes_nothing():
    points = square_points(500)
    even = spread(np.vstack([points, [[300.0, 0, 0]]]), plane)
    assert np.linalg.norm(even[:500] - spread(points, plane), axis=1).mean() < 0.1 / np.sqrt(500)
    assert np.linalg.norm(even[500] - [300, 0, 0]) < 1


def test_equal_points_part():
    points = ball_points(300)
    even = spread(np.concatenate([points, points, points]), sphere)
    assert gaps(even, 4 * np.pi).min() > 0.3


def test_points_are_first_projected():
    assert np.abs(np.linalg.norm(spread(1.1 * ball_points(100), sphere), axis=1) - 1).max() < 1e-12


def test_the_input_is_not_changed_and_the_result_repeats():
    points = ball_points(200)
    before = points.copy()
    assert np.array_equal(spread(points, sphere), spread(points, sphere)) and np.array_equal(points, before)


@pytest.mark.parametrize("count", [0, 1, 3, 4, 5, 12, 30])
def test_hardly_any_points_give_finite_ones(count):
    even = spread(1.5 * ball_points(count), sphere)
    assert even.shape == (count, 3) and np.allclose(np.linalg.norm(even, axis=1), 1)


@pytest.mark.parametrize("count", [3, 40])
def test_points_in_one_place_give_finite_ones(count):
    even = spread(np.tile([[0.0, 0.0, 1.0]], (count, 1)), sphere)
    assert np.isfinite(even).all() and np.allclose(np.linalg.norm(even, axis=1), 1)


@pytest.mark.parametrize("counts", [(1500, 1500), (1000, 1400)])
def test_two_pieces_are_spread_each_by_itself(counts):
    # A flow that balanced one against the other would have no solution: nothing leads across.
    random = np.random.default_rng(3)
    centres = np.repeat([[0.0, 0, 0], [5.0, 0, 0]], counts, axis=0)
    points = random.normal(size=(sum(counts), 3))
    points = centres + points / np.linalg.norm(points, axis=1, keepdims=True)

    def project(x):
        centre = np.where(x[:, :1] < 2.5, 0.0, 5.0) * [[1, 0, 0]]
        normals = (x - centre) / np.linalg.norm(x - centre, axis=1, keepdims=True)
        return centre + normals, normals

    result = spread(points, project)
    assert np.median(np.linalg.norm(result - points, axis=1)) < np.sqrt(4 * np.pi / min(counts))
    for which, count in zip((result[:, 0] < 2.5, result[:, 0] > 2.5), counts, strict=True):
        assert which.sum() == count
        gap = cKDTree(result[which]).query(result[which], 2)[0][:, 1] / np.sqrt(2 / np.sqrt(3) * 4 * np.pi / count)
        assert np.quantile(gap, 0.05) > 0.65
