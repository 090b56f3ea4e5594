"""The released code's matching against its kernel written out as loops."""

import numpy as np
import pytest
import torch
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from n2n.transport.approximate import approximate_plan


def _pair(count=2, k=24, dtype=torch.float64):
    generator = torch.Generator().manual_seed(0)
    return [torch.rand(count, k, 3, generator=generator, dtype=dtype) for _ in range(2)]


def _released_kernel(source, target):
    """approxmatch of Fan et al. 2017 for equal counts, point by point."""
    k = len(source)
    match, left, right = np.zeros((k, k)), np.ones(k), np.ones(k)
    for j in range(7, -3, -1):
        level = 0.0 if j == -2 else -(4.0**j)
        weight = np.exp(level * cdist(source, target, "sqeuclidean"))
        share = np.zeros((k, k))
        for i in range(k):
            total = 1e-9 + sum(weight[i, m] * right[m] for m in range(k))
            for m in range(k):
                share[i, m] = weight[i, m] * right[m] / total * left[i]
        for m in range(k):
            share[:, m] *= min(right[m] / (1e-9 + share[:, m].sum()), 1.0)
        left = np.maximum(left - share.sum(axis=1), 0)
        right = np.maximum(right - share.sum(axis=0), 0)
        match += share
    return match / k


@pytest.mark.parametrize("extent", [1.0, 0.02])  # the narrowest kernel is 0.01 wide
def test_equals_the_released_kernel(extent):
    source, target = (extent * points for points in _pair(k=10))
    plan = approximate_plan(source, target).numpy()
    for i in range(2):
        assert np.allclose(plan[i], _released_kernel(source[i].numpy(), target[i].numpy()), atol=1e-9)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_nobody_gives_or_gets_more_than_an_even_share(dtype):
    plan = approximate_plan(*_pair(dtype=dtype))
    assert (plan >= 0).all()
    assert plan.sum(1).max() <= (1 + 1e-5) / 24 and plan.sum(2).max() <= (1 + 1e-5) / 24
    assert plan.sum(dim=(1, 2)) == pytest.approx([1.0, 1.0], abs=0.01)


def test_costs_at_least_the_exact_matching():
    source, target = _pair()
    plan = approximate_plan(source, target).numpy()
    for i in range(2):
        cost = cdist(source[i].numpy(), target[i].numpy())
        rows, columns = linear_sum_assignment(cost)
        exact = cost[rows, columns].mean()
        assert exact < (plan[i] * cost).sum() < 2 * exact


def test_points_far_apart_are_matched_one_to_one():
    lattice = torch.cartesian_prod(*[torch.arange(2.0)] * 3)[None]
    order = torch.randperm(8, generator=torch.Generator().manual_seed(1))
    plan = approximate_plan(lattice, lattice[:, order])
    assert torch.allclose(plan[0] * 8, torch.eye(8)[order].T, atol=1e-4)
