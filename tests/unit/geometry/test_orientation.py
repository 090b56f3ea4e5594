import numpy as np
import pytest

from n2n.geometry.orientation import dipole_energy, orient, winding_number
from n2n.geometry.scaffold import Scaffold
from n2n.geometry.scale import estimate_scales
from n2n.geometry.shapes import SHAPES, sample_surface, scan


def _sphere(count, radius=1.0, seed=0):
    normals = np.random.default_rng(seed).standard_normal((count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return radius * normals, normals, np.full(count, 4 * np.pi * radius**2 / count)


def _scramble(normals, seed=1):
    return normals * np.random.default_rng(seed).choice([-1.0, 1.0], (len(normals), 1))


def test_a_sphere_points_outwards():
    points, normals, areas = _sphere(800)
    assert (orient(points, _scramble(normals), areas) * normals).sum(axis=1).min() > 0


def test_nested_spheres_point_away_from_the_material():
    outer, outer_normals, outer_areas = _sphere(900)
    inner, inner_normals, inner_areas = _sphere(500, 0.6, seed=3)
    points, areas = np.concatenate([outer, inner]), np.concatenate([outer_areas, inner_areas])
    truth = np.concatenate([outer_normals, -inner_normals])
    assert ((orient(points, _scramble(truth), areas) * truth).sum(axis=1) > 0).mean() > 0.99


def test_the_sides_of_a_thin_plate_are_opposite():
    # A closed plate, three sample spacings thick: without its rim nothing would tell its sides apart.
    half = np.array([1.0, 1.0, 0.1])
    random = np.random.default_rng(0)
    axis = random.choice([0, 1, 2], 2000, p=np.array([0.1, 0.1, 1.0]) / 1.2)
    truth = np.eye(3)[axis] * random.choice([-1.0, 1.0], (2000, 1))
    points = half * np.where(truth == 0, random.uniform(-1, 1, (2000, 3)), truth)
    oriented = orient(points, _scramble(truth), np.full(2000, 9.6 / 2000))
    assert ((oriented * truth).sum(axis=1) > 0).mean() > 0.98


def test_the_energy_is_largest_for_consistent_signs():
    points, normals, areas = _sphere(300)
    consistent = float(dipole_energy(points, normals, areas).sum())
    assert consistent > 3 * float(dipole_energy(points, _scramble(normals), areas).sum())


def test_winding_number_tells_inside_from_outside():
    points, normals, areas = _sphere(4000)
    queries = np.array([[0, 0, 0], [0.5, 0, 0], [2.0, 0, 0], [0, -1.5, 0]])
    assert winding_number(queries, points, normals, areas) == pytest.approx([1, 1, 0, 0], abs=0.05)


@pytest.mark.parametrize("shape", ["bracket", "torus"])
@pytest.mark.parametrize("noise", [0.005, 0.015])
def test_a_scaffold_of_a_noisy_scan_knows_inside_from_outside(shape, noise):
    cloud = scan(shape, 10_000, noise, seed=4)
    distance, lower, upper = SHAPES[shape]
    scaffold = Scaffold.build(cloud, estimate_scales(cloud))
    queries = np.random.default_rng(0).uniform(lower, upper, (4000, 3))
    truth = distance(queries)
    clear = np.abs(truth) > 0.04 * np.linalg.norm(np.subtract(upper, lower)) / 2
    assert (scaffold.sign(queries[clear]) == np.sign(truth[clear])).mean() > 0.995


def test_scaffold_is_deterministic_and_close_to_the_surface():
    cloud = sample_surface("torus", 5000) + 0.01 * np.random.default_rng(0).standard_normal((5000, 3))
    first = Scaffold.build(cloud, estimate_scales(cloud), seed=3)
    second = Scaffold.build(cloud, estimate_scales(cloud), seed=3)
    assert np.array_equal(first.points, second.points) and np.array_equal(first.normals, second.normals)
    assert np.sqrt((SHAPES["torus"][0](first.points) ** 2).mean()) < 0.006
