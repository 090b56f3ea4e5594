import numpy as np
import pytest

from n2n.geometry import outliers as module
from n2n.geometry.outliers import first_of_equal, outliers, outliers_of_each
from n2n.geometry.shapes import scan


def sphere(count: int, noise: float, seed: int = 0) -> np.ndarray:
    random = np.random.default_rng(seed)
    points = random.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True) + noise * random.normal(size=(count, 3))


def in_a_box(count: int, half: float = 1.3) -> np.ndarray:
    return np.random.default_rng(9).uniform(-half, half, (count, 3))


@pytest.mark.parametrize("count", [100, 300, 3000])
@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
def test_a_scan_without_outliers_has_none(count, noise):
    assert outliers(sphere(count, noise)).mean() < 0.005
    assert outliers(scan("bracket", count, noise)).mean() < 0.005


@pytest.mark.parametrize("noise", [0.01, 0.02, 0.03])
@pytest.mark.parametrize("share", [0.01, 0.05, 0.15])
def test_uniform_outliers_are_found_and_the_surface_stays(noise, share):
    stray = in_a_box(int(4000 * share))
    # The distance from the sphere is known, so who can be told from noise is, too.
    far = np.abs(np.linalg.norm(stray, axis=1) - 1) > 8 * noise + 0.05
    found = outliers(np.concatenate([sphere(4000, noise), stray]))
    assert found[:4000].mean() < 0.005
    assert found[4000:][far].mean() > 0.9


def test_a_small_cluster_is_found():
    cluster = [0, 0, 0.3] + 0.02 * np.random.default_rng(1).normal(size=(9, 3))
    found = outliers(np.concatenate([sphere(4000, 0.01), cluster]))
    assert found[4000:].all() and found[:4000].mean() < 0.005


def test_sparser_parts_stay():
    points = sphere(6000, 0.01)
    thin = (points[:, 0] < 0) | (np.random.default_rng(0).random(6000) < 0.1)
    assert outliers(points[thin]).mean() < 0.005
    # A lidar frame is a hundred times sparser at its end than at its start.
    random = np.random.default_rng(0)
    radius = np.exp(random.uniform(0, np.log(20), 4000))
    angle = random.uniform(0, 2 * np.pi, 4000)
    frame = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0.01 * random.normal(size=4000)])
    assert outliers(frame).mean() < 0.005


def test_wires_and_a_second_sparser_sheet_stay():
    random = np.random.default_rng(0)
    wire = np.column_stack([random.uniform(1, 2, 300), np.zeros((300, 2))]) + 0.01 * random.normal(size=(300, 3))
    assert outliers(np.concatenate([sphere(3000, 0.01), wire])).mean() < 0.005
    assert outliers(np.concatenate([sphere(3000, 0.01), 0.5 * sphere(300, 0.01, 1) + [3, 0, 0]])).mean() < 0.005


def test_the_verdict_does_not_depend_on_scale_and_place():
    points = np.concatenate([sphere(2000, 0.02), in_a_box(100)])
    found = outliers(points)
    assert 50 < found.sum() < 100
    assert np.array_equal(outliers(1024 * points), found)
    assert (outliers(1024 * points + [5e5, 5e6, 100]) == found).mean() > 0.999


def test_equal_points_share_one_verdict():
    points = np.concatenate([sphere(1000, 0.01), [[0, 0, 0], [0.4, 0, 0]]])
    twice = np.repeat(points, 3, axis=0)
    found = outliers(points)
    assert found[1000:].all()
    assert np.array_equal(outliers(twice), np.repeat(found, 3))


def test_points_far_from_all_others_are_outliers():
    points = np.concatenate([sphere(1000, 0.01), [[40.0, 0, 0], [0, -60, 0], [0, 0, 5e3]]])
    assert np.flatnonzero(outliers(points)).tolist() == [1000, 1001, 1002]


@pytest.mark.parametrize("count", [0, 1, 3, 30])
def test_few_points_are_not_judged(count):
    assert not outliers(sphere(100, 0.01)[:count]).any()


def test_of_equal_points_the_first_is_kept():
    points = np.random.default_rng(0).normal(size=(200, 3))
    kept = first_of_equal(np.concatenate([points, points[:30]]))
    assert kept[:200].all() and not kept[200:].any()


def test_an_exact_plane_has_no_outliers_however_it_lies():
    random = np.random.default_rng(0)
    flat = np.column_stack([random.random(10_000) ** 3, random.random(10_000), np.zeros(10_000)])
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    assert not outliers(flat @ turn.T).any()


def test_several_clouds_are_judged_each_by_itself():
    stray = np.random.default_rng(2).uniform(-1.5, 1.5, (60, 3))
    clouds = [sphere(3000, 0.01), np.concatenate([sphere(2000, 0.02, 1), stray]), sphere(50, 0.01)]
    for found, cloud in zip(outliers_of_each(clouds), clouds, strict=True):
        assert np.array_equal(found, outliers(cloud))
    assert outliers_of_each(clouds[1:2])[0].sum() > 20


def test_what_is_searched_for_again_is_what_a_search_for_all_would_find(monkeypatch):
    """Rounds search anew only around those who left."""
    stray = np.random.default_rng(3).uniform(-1.5, 1.5, (400, 3))
    cloud = np.concatenate([sphere(4000, 0.03), stray])
    found = outliers(cloud)
    of_all = module._reach
    monkeypatch.setattr(module, "_reach", lambda tree, ranks, before, workers: of_all(tree, ranks, None, workers))
    assert found.sum() > 100 and np.array_equal(outliers(cloud), found)
