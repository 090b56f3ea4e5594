"""Earth mover's distance between point sets, exact."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from n2n.errors import ConfigError, InputError
from n2n.metrics.nearest import as_points

MAX_POINTS = 5000  # 0.2 GB of costs


def emd(prediction: NDArray[np.float64], truth: NDArray[np.float64], p: int = 1) -> float:
    """Return the mean of |x - phi(x)|^p under the one-to-one map phi for which it is smallest.

    Args:
        prediction, truth: (n, 3) each.
        p: Exponent of the distances, 1 or 2.

    Returns:
        unit^p, raw.

    Raises:
        InputError: The counts differ, or are too large for an exact solution.
        ConfigError: Another p.

    Source: Ma et al. 2023, Eq. 4. Differs: the mean is taken where the paper prints a sum.

    >>> line = np.array([[0.0, 0, 0], [1, 0, 0]])
    >>> emd(line, line[::-1] + np.array([0, 2.0, 0]))
    2.0
    """
    check_exponent(p)
    prediction, truth = as_points(prediction, "prediction"), as_points(truth, "truth")
    n, m = len(prediction), len(truth)
    if n != m:
        raise InputError(f"EMD is one-to-one and needs equal counts, got {n} and {m} points; draw equally many of each")
    if n > MAX_POINTS:
        raise InputError(
            f"EMD of {n} points needs {8 * n * n / 1e9:.1f} GB for the costs alone and time that grows as n^3; "
            f"draw at most {MAX_POINTS} points of each"
        )
    cost = cdist(prediction, truth, "sqeuclidean" if p == 2 else "euclidean")
    return float(cost[linear_sum_assignment(cost)].mean())


def check_exponent(p: int) -> None:
    """Raise ConfigError unless p is 1 or 2."""
    if p not in (1, 2):
        raise ConfigError(f"p={p} is not known; choose 1 (distances) or 2 (squared distances)")
