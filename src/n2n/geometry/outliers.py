"""Points that belong to no surface: repeated ones, and ones far from all others."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

_NEIGHBOUR = 4
_LONELY = 30.0  # times the median: the sparse ends of a lidar frame stay, a stray point ten scans away does not


def usable(points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which points can inform a fit, (n,): the first of equal ones, and none that is far from all others.

    A single far point would otherwise set the scale of the whole frame. A point is far if its fourth neighbour is 30
    times as far away as is usual in the cloud.

    Args:
        points: (n, 3), finite.
    """
    kept = first_of_equal(points)
    chosen = np.flatnonzero(kept)
    if len(chosen) > _NEIGHBOUR:
        reach = cKDTree(points[chosen]).query(points[chosen], _NEIGHBOUR + 1)[0][:, -1]
        kept[chosen[reach > _LONELY * np.median(reach)]] = False
    return kept


def first_of_equal(points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which of (n, 3) points have no equal before them, (n,)."""
    order = np.lexsort(points.T)  # stable: equal points keep their order
    first = np.ones(len(points), bool)
    first[order[1:]] = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    return first
