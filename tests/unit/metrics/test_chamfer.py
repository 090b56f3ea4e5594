"""Chamfer metrics against scipy's full distance matrix."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from n2n.errors import ConfigError
from n2n.metrics.chamfer import L1Chamfer, L2Chamfer, chamfer, nearest_distances


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


def test_both_directions_count_by_hand():
    # The single point is 1 away; back, the two truths are 1 and 3 away.
    prediction, truth = np.zeros((1, 3)), np.array([[1.0, 0, 0], [0, 3, 0]])
    assert chamfer(prediction, truth, p=1, combine="sum") == pytest.approx(1 + 2)
    assert chamfer(prediction, truth, p=2, combine="sum") == pytest.approx(1 + 5)
    assert chamfer(truth, prediction, p=2, combine="mean") == pytest.approx(3)


def test_registered_classes_have_their_exponent(clouds):
    assert L1Chamfer()(*clouds) == chamfer(*clouds, p=1, combine="mean")
    assert L2Chamfer("sum")(*clouds) == chamfer(*clouds, p=2, combine="sum")


def test_utm_coordinates_lose_nothing(clouds):
    offset = np.array([5e5, 5e6, 100])
    moved = chamfer(clouds[0] + offset, clouds[1] + offset, p=1)
    assert moved == pytest.approx(chamfer(*clouds, p=1), rel=1e-8)


def test_nearest_distances_are_one_sided(clouds):
    assert np.allclose(nearest_distances(*clouds), cdist(*clouds).min(axis=1))


def test_unknown_combinations_are_named():
    with pytest.raises(ConfigError, match="combine=max is not known; choose one of: mean, sum"):
        L1Chamfer("max")
