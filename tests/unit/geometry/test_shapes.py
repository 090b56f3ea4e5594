import numpy as np
import pytest

from n2n.geometry.shapes import SHAPES, sample_surface, scan


@pytest.mark.parametrize("shape", SHAPES)
def test_samples_lie_on_the_surface(shape):
    distance = SHAPES[shape][0]
    assert np.quantile(np.abs(distance(sample_surface(shape, 3000))), 0.99) < 1e-6


def test_sphere_samples_are_even_by_area():
    points = sample_surface("sphere", 20_000)
    # Archimedes: the height of an even sample of a sphere is uniform.
    counts, _ = np.histogram(points[:, 2], bins=10, range=(-1, 1))
    assert counts.min() > 1800 and counts.max() < 2200


def test_bracket_signs_at_hand_checked_places():
    distance = SHAPES["bracket"][0]
    inside = [[40, 20, 5], [-56, 30, 70], [-35, 0, 15], [42, 0, 20]]
    outside = [[28, 0, 5], [-56, 0, 55], [0, 0, 60], [28, 0, 40], [0, 0, -3]]
    assert (distance(np.array(inside, float)) < 0).all()
    assert (distance(np.array(outside, float)) > 0).all()


def test_scan_noise_is_relative_to_the_bounding_radius():
    clean, noisy = sample_surface("sphere", 5000, 1), scan("sphere", 5000, 0.02, 1)
    assert (noisy - clean).std() == pytest.approx(0.02, rel=0.03)
