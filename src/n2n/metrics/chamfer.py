"""Chamfer distances between point sets: functions first, the registered classes are thin."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from n2n.errors import ConfigError

_COMBINE = {"mean": 0.5, "sum": 1.0}


def nearest_distances(points: NDArray[np.float64], cloud: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of each of (n, 3) points to the nearest of (m, 3) cloud points, (n,), same unit."""
    return cKDTree(cloud).query(points)[0]


def chamfer(prediction: NDArray[np.float64], truth: NDArray[np.float64], p: int, combine: str = "mean") -> float:
    """Return the Chamfer distance.

    Args:
        prediction, truth: (n, 3) and (m, 3), same coordinates.
        p: Exponent of the distances, 1 or 2.
        combine: `mean` or `sum` of the two directions; papers use both, so tables must say which.

    Returns:
        unit^p, raw: no factor of 10^4.

    >>> chamfer(np.zeros((1, 3)), np.array([[3.0, 0, 4.0]]), p=1)
    5.0
    """
    forth = (nearest_distances(prediction, truth) ** p).mean()
    back = (nearest_distances(truth, prediction) ** p).mean()
    return float(_COMBINE[combine] * (forth + back))


class _Chamfer:
    p: int

    def __init__(self, combine: str = "mean") -> None:
        if combine not in _COMBINE:
            raise ConfigError(f"combine={combine} is not known; choose one of: {', '.join(_COMBINE)}")
        self.combine = combine

    def __call__(self, prediction: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
        return chamfer(prediction, truth, self.p, self.combine)


class L1Chamfer(_Chamfer):
    """Both directions' mean distances, combined; see `chamfer`."""

    p = 1


class L2Chamfer(_Chamfer):
    """Both directions' mean squared distances, combined; see `chamfer`."""

    p = 2
