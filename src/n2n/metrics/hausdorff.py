"""Hausdorff distance between point sets."""

import numpy as np
from numpy.typing import NDArray

from n2n.metrics.chamfer import directions


def hausdorff(prediction: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    """Return the largest distance of any point, of either set, to the nearest point of the other.

    Args:
        prediction, truth: (n, 3) and (m, 3), same coordinates.

    Returns:
        Unit of the coordinates, not squared (the released code of score-denoise squares it).

    >>> hausdorff(np.zeros((1, 3)), np.array([[1.0, 0, 0], [0, 3, 0]]))
    3.0
    """
    forth, back = directions(prediction, truth)
    return float(max(forth.max(), back.max()))
