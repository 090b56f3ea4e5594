"""Normal consistency by hand, in closed form, and for random directions."""

import numpy as np
import pytest

from n2n.errors import InputError
from n2n.metrics.normals import normal_consistency


@pytest.fixture
def random():
    return np.random.default_rng(0)


def test_flipped_and_scaled_normals_of_equal_clouds_are_consistent(random):
    points, normals = random.normal(size=(2, 200, 3))
    flipped = normals * random.choice([-3.0, 0.5], size=(200, 1))
    assert normal_consistency(points, flipped, points, normals) == pytest.approx(1, rel=1e-12)


def test_both_directions_count_by_hand():
    # Forth: one pair at 60 degrees. Back: that pair, and a second reference point whose normal is perpendicular.
    point = np.zeros((1, 3))
    tilted = np.array([[np.cos(np.pi / 3), np.sin(np.pi / 3), 0]])
    references, normals = np.array([[0.1, 0, 0], [5, 0, 0]]), np.array([[1.0, 0, 0], [0, 0, 1]])
    assert normal_consistency(point, tilted, references, normals) == pytest.approx(0.5 * (0.5 + 0.25))


def test_random_directions_score_as_the_specification_says(random):
    # E|cos| of independent directions is 1/2; the inflated sum is 3 E|x| E|x| = 3/4.
    points, a, b = random.normal(size=(3, 100_000, 3))
    assert normal_consistency(points, a, points, b) == pytest.approx(0.5, abs=0.005)
    assert normal_consistency(points, a, points, b, inflated=True) == pytest.approx(0.75, abs=0.005)


def test_a_tilted_plane_over_a_flat_one_is_the_cosine():
    x, y = np.meshgrid(np.linspace(0, 1, 20), np.linspace(0, 1, 20))
    flat = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    up, tilted = np.tile([0, 0, 1.0], (400, 1)), np.tile([np.sin(0.3), 0, np.cos(0.3)], (400, 1))
    assert normal_consistency(flat, tilted, flat, up) == pytest.approx(np.cos(0.3), rel=1e-12)


def test_normals_that_do_not_fit_are_named(random):
    points = random.normal(size=(5, 3))
    with pytest.raises(InputError, match="predicted normals: 4 for 5 points"):
        normal_consistency(points, points[:4], points, points)
    with pytest.raises(InputError, match="reference normals: 1 of 5 normals have length zero"):
        normal_consistency(points, points, points, points * np.arange(5)[:, None])
