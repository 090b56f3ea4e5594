"""Chamfer, Hausdorff and F-score against scipy's full distance matrix."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from n2n.errors import ConfigError, InputError
from n2n.metrics import nearest as module
from n2n.metrics.chamfer import chamfer, chamfer_of, directions
from n2n.metrics.fscore import fscore
from n2n.metrics.hausdorff import hausdorff
from n2n.metrics.nearest import nearest


@pytest.fixture
def clouds():
    random = np.random.default_rng(0)
    return random.normal(size=(80, 3)), random.normal(size=(50, 3)) + 0.3


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize(("combine", "factor"), [("mean", 0.5), ("sum", 1.0)])
def test_equals_the_full_matrix(clouds, p, combine, factor):
    distance = cdist(*clouds) ** p
    expected = factor * (distance.min(axis=1).mean() + distance.min(axis=0).mean())
    assert chamfer(*clouds, p=p, combine=combine) == pytest.approx(expected, rel=1e-12)
    assert chamfer_of(*directions(*clouds), p, combine) == chamfer(*clouds, p=p, combine=combine)


def test_both_directions_count_by_hand():
    # The single point is 1 away; back, the two truths are 1 and 3 away.
    prediction, truth = np.zeros((1, 3)), np.array([[1.0, 0, 0], [0, 3, 0]])
    assert chamfer(prediction, truth, p=1, combine="sum") == pytest.approx(1 + 2)
    assert chamfer(prediction, truth, p=2, combine="sum") == pytest.approx(1 + 5)
    assert chamfer(truth, prediction, p=2, combine="mean") == pytest.approx(3)


def test_utm_coordinates_lose_nothing(clouds):
    offset = np.array([5e5, 5e6, 100])
    moved = chamfer(clouds[0] + offset, clouds[1] + offset, p=1)
    assert moved == pytest.approx(chamfer(*clouds, p=1), rel=1e-8)


def test_nearest_is_one_sided_and_keeps_the_order_of_the_points(clouds, monkeypatch):
    monkeypatch.setattr(module, "_CHUNK", 7)
    distance, index = nearest(*clouds)
    assert np.allclose(distance, cdist(*clouds).min(axis=1), rtol=1e-13)
    assert (index == cdist(*clouds).argmin(axis=1)).all()


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((0, 3)), r"points: a metric needs an array of shape \(n, 3\) with n > 0, got \(0, 3\)"),
        (np.zeros((4, 2)), r"got \(4, 2\)"),
        (np.array([[0, 0, np.nan]]), "1 of 1 points are NaN or infinite"),
    ],
)
def test_clouds_that_cannot_be_measured_are_named(clouds, points, message):
    with pytest.raises(InputError, match=message):
        nearest(points, clouds[0])


def test_unknown_conventions_are_named(clouds):
    with pytest.raises(ConfigError, match="combine=max is not known; choose one of: mean, sum"):
        chamfer(*clouds, p=1, combine="max")
    with pytest.raises(ConfigError, match="p=3"):
        chamfer(*clouds, p=3)


def test_hausdorff_is_the_farther_direction(clouds):
    distance = cdist(*clouds)
    expected = max(distance.min(axis=1).max(), distance.min(axis=0).max())
    assert hausdorff(*clouds) == hausdorff(*clouds[::-1]) == pytest.approx(expected, rel=1e-12)
    assert hausdorff(np.zeros((1, 3)), np.array([[0.0, 0, 0], [0, 0, -5]])) == 5  # only the way back sees it


@pytest.mark.parametrize("threshold", [0.2, 0.5, 1.0])
def test_fscore_equals_the_full_matrix(clouds, threshold):
    within = cdist(*clouds) <= threshold
    precision, recall = within.any(axis=1).mean(), within.any(axis=0).mean()
    found = fscore(*directions(*clouds), threshold)
    assert found.precision == pytest.approx(precision) and found.recall == pytest.approx(recall)
    assert found.fscore == pytest.approx(2 / (1 / precision + 1 / recall))


def test_fscore_counts_the_threshold_itself_and_survives_nothing_near():
    assert fscore(np.array([0.01]), np.array([0.01]), 0.01).fscore == 1
    assert fscore(np.ones(3), np.ones(2), 0.5) == (0, 0, 0)
    with pytest.raises(ConfigError, match="threshold=0"):
        fscore(np.ones(3), np.ones(2), 0.0)
