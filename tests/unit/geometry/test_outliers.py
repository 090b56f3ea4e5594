import numpy as np

from n2n.geometry.outliers import usable
from n2n.geometry.shapes import scan


def test_a_clean_scan_is_usable_whole():
    assert usable(scan("bracket", 3000, 0.02)).all()


def test_of_equal_points_the_first_is_kept():
    points = np.random.default_rng(0).normal(size=(200, 3))
    kept = usable(np.concatenate([points, points[:30]]))
    assert kept[:200].all() and not kept[200:].any()


def test_points_far_from_all_others_are_not_usable():
    points = np.concatenate([scan("sphere", 1000, 0.01), [[40.0, 0, 0], [0, -60, 0], [0, 0, 5e3]]])
    assert usable(points).sum() == 1000


def test_sparse_parts_stay():
    # A lidar frame is a hundred times sparser at its end than at its start.
    random = np.random.default_rng(0)
    radius = np.exp(random.uniform(0, np.log(20), 4000))
    angle = random.uniform(0, 2 * np.pi, 4000)
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0.01 * random.normal(size=4000)])
    assert usable(points).mean() > 0.995
