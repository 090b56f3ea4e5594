"""Entropic plans: marginals, the limit of a small blur, and a textbook implementation."""

import itertools

import numpy as np
import pytest
import torch
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from n2n.transport.sinkhorn import sinkhorn_plan


def _pair(count=3, k=20):
    generator = torch.Generator().manual_seed(0)
    return (torch.rand(count, k, 3, generator=generator, dtype=torch.float64) for _ in range(2))


def test_marginals_are_even():
    plan = sinkhorn_plan(*_pair(), epsilon=0.1, iterations=500)
    even = torch.full((3, 20), 1 / 20, dtype=torch.float64)
    assert torch.allclose(plan.sum(1), even, rtol=1e-10)
    assert torch.allclose(plan.sum(2), even, rtol=1e-6)
    assert (plan > 0).all()


@pytest.mark.parametrize("p", [1, 2])
def test_equals_the_textbook_scaling(p):
    source, target = _pair(count=1)
    cost = cdist(source[0].numpy(), target[0].numpy()) ** p
    kernel = np.exp(-cost / (0.2 * cost.mean()))
    u, v = np.ones(20), np.ones(20)
    for _ in range(300):
        u = 1 / 20 / (kernel @ v)
        v = 1 / 20 / (kernel.T @ u)
    plan = sinkhorn_plan(source, target, epsilon=0.2, iterations=300, p=p)[0].numpy()
    assert np.allclose(plan, u[:, None] * kernel * v, rtol=1e-8)


@pytest.mark.parametrize("p", [1, 2])
def test_cost_approaches_the_exact_one_as_the_blur_vanishes(p):
    source, target = _pair(count=1)
    cost = cdist(source[0].numpy(), target[0].numpy()) ** p
    rows, columns = linear_sum_assignment(cost)
    exact = cost[rows, columns].mean()
    excess = []
    for epsilon in (0.3, 0.1, 0.03, 0.01):
        plan = sinkhorn_plan(source, target, epsilon, iterations=3000, p=p)[0].numpy()
        excess.append((plan * cost).sum() / exact - 1)
    assert all(a > b for a, b in itertools.pairwise(excess))
    assert -1e-3 < excess[-1] < 0.02 and excess[0] > 0.1


def test_blur_is_relative_to_the_cost():
    source, target = _pair()
    small, large = sinkhorn_plan(source, target, 0.05), sinkhorn_plan(1000 * source, 1000 * target, 0.05)
    assert torch.allclose(small, large, rtol=1e-6)


def test_equal_points_everywhere_give_an_even_plan():
    points = torch.zeros(1, 4, 3)
    assert torch.allclose(sinkhorn_plan(points, points), torch.full((1, 4, 4), 1 / 16))
