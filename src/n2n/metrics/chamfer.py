"""Chamfer distances between point sets."""

import numpy as np
from numpy.typing import NDArray

from n2n.errors import ConfigError
from n2n.metrics.nearest import nearest

COMBINE = {"mean": 0.5, "sum": 1.0}


def directions(
    prediction: NDArray[np.float64], truth: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the distances (n,) prediction to truth and (m,) truth to prediction, for several metrics at once."""
    return nearest(prediction, truth)[0], nearest(truth, prediction)[0]


def chamfer(prediction: NDArray[np.float64], truth: NDArray[np.float64], p: int, combine: str = "mean") -> float:
    """Return the Chamfer distance.

    Args:
        prediction, truth: (n, 3) and (m, 3), same coordinates.
        p: Exponent of the distances, 1 or 2.
        combine: `mean` or `sum` of the two directions; papers use both, so tables must say which.

    Returns:
        unit^p, raw: no factor of 10^4.

    Raises:
        ConfigError: Another p or combination.

    >>> chamfer(np.zeros((1, 3)), np.array([[3.0, 0, 4.0]]), p=1)
    5.0
    """
    return chamfer_of(*directions(prediction, truth), p, combine)


def chamfer_of(forth: NDArray[np.float64], back: NDArray[np.float64], p: int, combine: str = "mean") -> float:
    """Return the Chamfer distance from the distances of both `directions`."""
    check_chamfer(p, combine)
    return float(COMBINE[combine] * ((forth**p).mean() + (back**p).mean()))


def check_chamfer(p: int, combine: str) -> None:
    """Raise ConfigError unless exponent and combination are known."""
    if p not in (1, 2):
        raise ConfigError(f"p={p} is not known; choose 1 (distances) or 2 (squared distances)")
    if combine not in COMBINE:
        raise ConfigError(f"combine={combine} is not known; choose one of: {', '.join(COMBINE)}")
