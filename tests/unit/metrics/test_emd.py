"""Earth mover's distance against all permutations, and where it is known."""

from itertools import permutations

import numpy as np
import pytest

from n2n.errors import ConfigError, InputError
from n2n.metrics.emd import MAX_POINTS, emd


@pytest.mark.parametrize("p", [1, 2])
def test_equals_the_best_of_all_permutations(p):
    first, second = np.random.default_rng(0).normal(size=(2, 6, 3))
    costs = [(np.linalg.norm(first - second[list(order)], axis=1) ** p).mean() for order in permutations(range(6))]
    assert emd(first, second, p) == pytest.approx(min(costs), rel=1e-12)


def test_a_small_shift_costs_the_shift():
    x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    grid = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    shuffled = np.random.default_rng(0).permutation(grid + [0.1, 0, 0.2])
    assert emd(grid, shuffled, 2) == pytest.approx(0.05, rel=1e-9)


def test_what_cannot_be_matched_is_refused():
    with pytest.raises(InputError, match="equal counts, got 3 and 2 points"):
        emd(np.zeros((3, 3)), np.zeros((2, 3)))
    many = np.zeros((100_000, 3))
    with pytest.raises(InputError, match=f"80.0 GB.*draw at most {MAX_POINTS}"):
        emd(many, many)
    with pytest.raises(ConfigError, match="p=0"):
        emd(many, many, 0)
