"""The distances L against scipy, and their slopes against finite differences."""

import itertools

import numpy as np
import pytest
import torch
from scipy.spatial.distance import cdist

from n2n.losses.distances import EMD, Approximate, Chamfer, Sinkhorn, power_norm

DISTANCES = [EMD, Chamfer, Sinkhorn, Approximate]


def _pair(count=2, k=6):
    generator = torch.Generator().manual_seed(0)
    return [torch.rand(count, k, 3, generator=generator, dtype=torch.float64) for _ in range(2)]


def _costs(moved, target, p):
    return [cdist(m, t) ** p for m, t in zip(moved.numpy(), target.numpy(), strict=True)]


@pytest.mark.parametrize("p", [1, 2])
def test_emd_is_the_best_of_all_permutations(p):
    moved, target = _pair()
    best = [
        min(np.mean([cost[i, j] for i, j in enumerate(order)]) for order in itertools.permutations(range(6)))
        for cost in _costs(moved, target, p)
    ]
    assert EMD(p)(moved, target).item() == pytest.approx(np.mean(best))


@pytest.mark.parametrize("p", [1, 2])
def test_emd_of_a_translation_is_its_length(p):
    points, _ = _pair(k=50)
    assert EMD(p)(points, points.flip(1) + torch.tensor([2.0, 3.0, 6.0])).item() == pytest.approx(7.0**p)


@pytest.mark.parametrize("p", [1, 2])
def test_chamfer_is_the_mean_of_both_nearest_neighbour_distances(p):
    moved, target = _pair(k=40)
    both = [0.5 * (cost.min(axis=1).mean() + cost.min(axis=0).mean()) for cost in _costs(moved, target, p)]
    assert Chamfer(p)(moved, target).item() == pytest.approx(np.mean(both))


def test_chamfer_forgives_what_a_one_to_one_map_does_not():
    target = torch.tensor([[[0.0, 0, 0], [0.1, 0, 0], [5, 0, 0]]])
    moved = torch.tensor([[[0.0, 0, 0], [5, 0, 0], [5, 0, 0.1]]])
    assert Chamfer()(moved, target) < 0.04
    assert EMD()(moved, target) > 1.6


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("soft", [Sinkhorn, Approximate])
def test_soft_distances_are_the_cost_of_their_plan(soft, p):
    moved, target = _pair(k=20)
    plan = soft(p=p).match(moved, target)
    cost = [(pi * c).sum() for pi, c in zip(plan.numpy(), _costs(moved, target, p), strict=True)]
    assert soft(p=p)(moved, target).item() == pytest.approx(np.mean(cost))


@pytest.mark.parametrize("p", [1, 2])
def test_soft_distances_are_close_to_the_exact_one_from_above(p):
    moved, target = _pair(k=20)
    exact = EMD(p)(moved, target).item()
    sharp = Sinkhorn(epsilon=0.02, iterations=500, p=p)(moved, target).item()
    blurred = Sinkhorn(epsilon=0.5, iterations=500, p=p)(moved, target).item()
    assert exact < sharp < 1.1 * exact < blurred
    assert exact < Approximate(p)(moved, target).item() < 2 * exact


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("kind", DISTANCES)
def test_slopes_under_a_kept_plan_match_finite_differences(kind, p):
    moved, target = _pair()
    plan = kind(p=p).match(moved, target)
    assert torch.autograd.gradcheck(lambda points: kind(p=p)(points, target, plan), (moved.requires_grad_(),))


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("kind", [EMD, Chamfer])
def test_slopes_need_no_derivative_of_the_matching(kind, p):
    # The best plan is stationary, so matching anew for every difference gives the same slope.
    moved, target = _pair()
    moved.requires_grad_()
    (slope,) = torch.autograd.grad(kind(p=p)(moved, target), moved)
    for index in [(0, 0, 0), (1, 3, 2), (0, 5, 1)]:
        step = torch.zeros_like(moved)
        step[index] = 1e-6
        difference = kind(p=p)(moved.detach() + step, target) - kind(p=p)(moved.detach() - step, target)
        assert slope[index].item() == pytest.approx(difference.item() / 2e-6, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("kind", DISTANCES)
def test_a_kept_plan_is_not_renewed(kind):
    # Once both points have moved past each other the old plan is the dearer one.
    target = torch.tensor([[[0.0, 0, 0], [1, 0, 0]]])
    plan = kind().match(target + 0.01, target)
    swapped = target.flip(1) + 0.01
    assert kind()(swapped, target, plan) > 0.9
    assert kind()(swapped, target) < 0.1


def test_points_that_are_their_targets_have_slope_zero():
    moved = torch.zeros(2, 3, requires_grad=True)
    power_norm(moved, 1).sum().backward()
    assert torch.equal(moved.grad, torch.zeros(2, 3))


@pytest.mark.parametrize("kind", DISTANCES)
def test_exponents_other_than_1_and_2_are_refused(kind):
    with pytest.raises(ValueError, match="p must be 1 or 2, got 3"):
        kind(p=3)
