"""F-score: how much of each point set lies within a distance of the other."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from n2n.errors import ConfigError


class FScore(NamedTuple):
    """Shares in [0, 1].

    Attributes:
        fscore: Harmonic mean of precision and recall; 0 where both are 0.
        precision: Share of the prediction within the threshold of the truth.
        recall: Share of the truth within the threshold of the prediction.
    """

    fscore: float
    precision: float
    recall: float


def fscore(forth: NDArray[np.float64], back: NDArray[np.float64], threshold: float) -> FScore:
    """Return the F-score at one threshold.

    Args:
        forth: Distances of predicted points to the truth, (n,).
        back: Distances of true points to the prediction, (m,); both from `chamfer.directions`.
        threshold: Largest distance that counts, itself included, unit of the distances.

    Raises:
        ConfigError: The threshold is not positive.

    Source: ConvONet src/eval.py:133,148-163.

    >>> fscore(np.array([0.0, 2.0]), np.array([1.0]), 1.0)
    FScore(fscore=0.6666666666666666, precision=0.5, recall=1.0)
    """
    check_threshold(threshold)
    precision, recall = float((forth <= threshold).mean()), float((back <= threshold).mean())
    total = precision + recall
    return FScore(2 * precision * recall / total if total else 0.0, precision, recall)


def check_threshold(threshold: float) -> None:
    """Raise ConfigError unless the threshold is a positive distance."""
    if not threshold > 0:
        raise ConfigError(f"threshold={threshold} must be a positive distance")
