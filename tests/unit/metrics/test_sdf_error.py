"""Errors of a signed distance that can be worked out."""

import numpy as np
import pytest

from n2n.errors import ConfigError, InputError
from n2n.metrics.sdf_error import sdf_error


def test_a_sphere_too_large_by_a_tenth():
    # Queries evenly spread over radii 0..2: |true| has mean 1/2, signs differ for radii in (1, 1.1).
    radius = (np.arange(20_000) + 0.5) / 10_000
    found = sdf_error(radius - 1.1, radius - 1, band=np.inf)
    assert found == pytest.approx((0.1, 0.2, 0.05), rel=1e-9)
    near = sdf_error(radius - 1.1, radius - 1, band=0.2)
    assert near == pytest.approx((0.1, 1.0, 0.25), rel=1e-9)


def test_zero_and_the_opposite():
    true = np.array([-1.0, 2.0, -3.0])
    assert sdf_error(true, true, 5.0) == (0, 0, 0)
    assert sdf_error(0 * true, true, 5.0) == (2, 1, 0)
    assert sdf_error(-true, true, 5.0) == (4, 2, 1)


@pytest.mark.parametrize(
    ("predicted", "true", "message"),
    [
        ([1.0], [1.0, 2.0], r"two arrays of shape \(n,\), got \(1,\), \(2,\)"),
        ([np.nan], [1.0], "some are NaN"),
        ([1.0], [9.0], "no query off the surface within band=5"),
        ([1.0], [0.0], "no query off the surface"),
    ],
)
def test_values_that_cannot_be_compared_are_named(predicted, true, message):
    with pytest.raises(InputError, match=message):
        sdf_error(np.array(predicted), np.array(true), 5.0)


def test_the_band_is_a_distance():
    with pytest.raises(ConfigError, match="band=0"):
        sdf_error(np.ones(1), np.ones(1), 0.0)
