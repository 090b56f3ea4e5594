"""The default recipe on clouds whose truth is known; trimesh, scipy and point-cloud-utils judge."""

import numpy as np
import point_cloud_utils as pcu
import pytest
from scipy.spatial import cKDTree

import n2n


@pytest.fixture(scope="module")
def spot(peers):
    case = peers("spot_10000_1")
    return case, n2n.fit(case["noisy"])


def chamfer_sum(first, second):
    return (cKDTree(second).query(first)[0] ** 2).mean() + (cKDTree(first).query(second)[0] ** 2).mean()


def to_mesh(points, case):
    """Return the mean squared distance of points to the true mesh."""
    return (pcu.closest_points_on_mesh(np.ascontiguousarray(points), case["verts"], case["faces"])[0] ** 2).mean()


def test_one_noisy_cloud_is_denoised_as_well_as_a_trained_network_does(spot):
    case, field = spot
    clean = field.denoise(case["noisy"])
    # The supervised score-denoise network reaches 2.2454e-4 and 0.16328e-4 on this very cloud.
    assert chamfer_sum(clean, case["clean"]) < 2.25e-4
    assert to_mesh(clean, case) < 0.15e-4


def test_its_surface_is_one_closed_sheet_close_to_the_truth(spot):
    case, field = spot
    mesh = field.reconstruct(128)
    assert mesh.is_watertight and mesh.body_count == 1 and mesh.volume > 0
    assert to_mesh(mesh.vertices, case) < 0.3e-4
    reach = cKDTree(mesh.vertices).query(case["clean"])[0]
    assert reach.max() < 0.05


def test_its_signs_are_right_everywhere(spot):
    case, field = spot
    queries = np.random.default_rng(0).uniform(-1, 1, (3000, 3))
    truth = pcu.signed_distance_to_mesh(queries, case["verts"], case["faces"])[0]
    clear = np.abs(truth) > 0.03
    assert (np.sign(field.sdf_at(queries))[clear] == np.sign(truth)[clear]).all()


def test_many_observations_are_better_than_one(spot, peers):
    case, single = spot
    random = np.random.default_rng(7)
    observations = [case["noisy"]] + [case["clean"] + 0.01 * random.standard_normal((10_000, 3)) for _ in range(9)]
    several = n2n.fit(observations)
    errors = [to_mesh(field.denoise(case["noisy"]), case) for field in (single, several)]
    assert errors[1] < 0.7 * errors[0]
