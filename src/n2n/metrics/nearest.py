"""Nearest points, and the checks that every metric begins with."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from n2n.errors import InputError

_CHUNK = 1 << 18  # queries at once; the copies scipy makes of them stay below 20 MB


def nearest(points: NDArray[np.float64], cloud: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Find the nearest cloud point of every point.

    Args:
        points, cloud: (n, 3) and (m, 3), same coordinates.

    Returns:
        Distances (n,) in the unit of the coordinates, and the index (n,) of the nearest cloud point.

    Raises:
        InputError: A cloud is empty, not (n, 3), or not finite.

    >>> nearest(np.zeros((1, 3)), np.array([[9.0, 0, 0], [3, 0, 4]]))
    (array([5.]), array([1]))
    """
    points, tree = as_points(points, "points"), cKDTree(as_points(cloud, "cloud"))
    distance, index = np.empty(len(points)), np.empty(len(points), np.int64)
    for start in range(0, len(points), _CHUNK):
        part = start + spatial_order(points[start : start + _CHUNK])
        distance[part], index[part] = tree.query(points[part], workers=-1)
    return distance, index


def spatial_order(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return an order in which neighbours follow each other: queries then find in the cache what the last one read."""
    return cKDTree(points, leafsize=64, compact_nodes=False, balanced_tree=False).indices


def as_points(array: ArrayLike, name: str) -> NDArray[np.float64]:
    """Return (n, 3) float64 points, or say what is wrong with them.

    Raises:
        InputError: Empty, not (n, 3), or not finite.
    """
    points = np.ascontiguousarray(array, np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InputError(f"{name}: a metric needs an array of shape (n, 3) with n > 0, got {points.shape}")
    bad = int((~np.isfinite(points)).any(axis=1).sum())
    if bad:
        raise InputError(f"{name}: {bad} of {len(points)} points are NaN or infinite; remove them first")
    return points
