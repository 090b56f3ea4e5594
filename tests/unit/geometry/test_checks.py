"""Clouds that no surface can be fitted to."""

import numpy as np
import pytest

from n2n.errors import InputError
from n2n.geometry.checks import check_cloud, count_distinct

ALONG = np.outer(np.linspace(0, 300, 500), [1, 2, 3.0])


@pytest.mark.parametrize(
    "points",
    [ALONG, ALONG.astype(np.float32).astype(np.float64), (ALONG / 7 + 1).round(4), ALONG + [5e5, 5e6, 100]],
    ids=["exact", "float32", "four digits", "utm"],
)
def test_lines_are_refused_however_they_were_stored(points):
    with pytest.raises(InputError, match="line: all points lie on one line"):
        check_cloud(points, "line")


@pytest.mark.parametrize("offset", [np.zeros(3), np.array([5e5, 5e6, 100])], ids=["origin", "utm"])
def test_narrow_strips_pass(offset):
    strip = np.random.default_rng(0).random((500, 3)) * [1000, 0.1, 0] + offset
    assert check_cloud(strip, "strip") is strip


def test_distinct_points_are_counted():
    cloud = np.random.default_rng(0).normal(size=(150, 3))
    # Equal in one or two coordinates only.
    cloud[1, :2], cloud[2, 1:] = cloud[0, :2], cloud[0, 1:]
    assert count_distinct(np.concatenate([cloud, cloud[20:50], -0.0 * cloud[:2], 0.0 * cloud[:1]]), "cloud") == 151
    with pytest.raises(InputError, match="cloud: only 99 of 198 points are distinct"):
        count_distinct(np.tile(cloud[:99], (2, 1)), "cloud")
