import numpy as np
from scipy.spatial import cKDTree

from n2n.geometry.local_fit import project_to_quadric


def test_points_above_a_paraboloid_fall_onto_it():
    random = np.random.default_rng(0)
    flat = random.uniform(-1, 1, (4000, 2))
    surface = np.column_stack([flat, 0.3 * flat[:, 0] ** 2 - 0.2 * flat[:, 1] ** 2])
    queries = surface[(np.abs(flat) < 0.6).all(axis=1)][:200] + [0, 0, 0.03]
    moved, normals = project_to_quadric(cKDTree(surface), queries, 40)
    height = 0.3 * moved[:, 0] ** 2 - 0.2 * moved[:, 1] ** 2
    assert np.abs(moved[:, 2] - height).max() < 1e-3
    truth = np.column_stack([-0.6 * moved[:, 0], 0.4 * moved[:, 1], np.ones(len(moved))])
    truth /= np.linalg.norm(truth, axis=1, keepdims=True)
    assert np.abs((normals * truth).sum(axis=1)).min() > 0.999
