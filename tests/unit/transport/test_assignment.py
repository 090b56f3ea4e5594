"""The exact matching against scipy and against problems whose answer is known by construction."""

import numpy as np
import pytest
import torch
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from n2n.transport import assignment
from n2n.transport.assignment import _PARALLEL_FROM, exact_assignment, matching_cost
from n2n.transport.pairing import StratifiedPairing

FEW, MANY = 3, _PARALLEL_FROM + 1  # leaves: matched one after the other, and in threads


def _generator(seed=0):
    return torch.Generator().manual_seed(seed)


def _leaves(count, k, seed=0):
    return torch.rand(count, k, 3, generator=_generator(seed), dtype=torch.float64)


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("count", [FEW, MANY])
def test_cost_is_that_of_scipy(count, p):
    source, target = _leaves(count, 24, 1), _leaves(count, 24, 2)
    phi = exact_assignment(source, target, p).numpy()
    for s, t, columns in zip(source.numpy(), target.numpy(), phi, strict=True):
        cost = cdist(s, t) ** p
        rows, best = linear_sum_assignment(cost)
        assert sorted(columns) == list(range(24))
        assert cost[rows, columns].sum() == pytest.approx(cost[rows, best].sum(), rel=1e-12)


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("count", [FEW, MANY])
def test_jittered_permutation_is_undone(count, p):
    # Points of a lattice are 1 apart, so a jitter below a quarter cannot make another map cheaper.
    lattice = torch.cartesian_prod(*[torch.arange(3.0)] * 3)
    truth = torch.stack([torch.randperm(27, generator=_generator(i)) for i in range(count)])
    source = lattice[truth] + 0.1 * (torch.rand(count, 27, 3, generator=_generator()) - 0.5)
    assert torch.equal(exact_assignment(source, lattice.expand(count, -1, -1), p), truth)


@pytest.mark.parametrize("p", [1, 2])
def test_translation_costs_its_length(p):
    source, shift = _leaves(2, 40), torch.tensor([0.3, -0.4, 1.2], dtype=torch.float64)
    target = (source + shift)[:, torch.randperm(40, generator=_generator())]
    phi = exact_assignment(source, target, p)
    cost = matching_cost(source, target, p).gather(2, phi[..., None]).mean()
    assert cost.item() == pytest.approx(1.3**p, rel=1e-9)


def test_points_on_a_line_are_matched_in_sorted_order():
    source, target = _leaves(4, 30, 1), _leaves(4, 30, 2)
    source[..., 1:], target[..., 1:] = 0, 0
    # Strictly convex cost: the monotone map is the only best one.
    phi = exact_assignment(source, target, 2)
    expected = torch.empty_like(phi).scatter_(1, source[..., 0].argsort(1), target[..., 0].argsort(1))
    assert torch.equal(phi, expected)


@pytest.mark.parametrize("count", [FEW, MANY])
def test_leaves_are_matched_alone_and_stay_in_order(count):
    source, target = _leaves(count, 12, 1), _leaves(count, 12, 2)
    alone = torch.cat([exact_assignment(source[i : i + 1], target[i : i + 1]) for i in range(count)])
    assert torch.equal(exact_assignment(source, target), alone)


@pytest.mark.parametrize("pairs", [1, 12 * 12, 5 * 12 * 12, 80 * 12 * 12])
def test_few_costs_are_held_at_once(monkeypatch, pairs):
    source, target = _leaves(MANY, 12, 1), _leaves(MANY, 12, 2)
    expected = exact_assignment(source, target)
    held = []
    monkeypatch.setattr(assignment, "_PAIRS", pairs)
    monkeypatch.setattr(assignment, "matching_cost", lambda *args: held.append(matching_cost(*args)) or held[-1])
    assert torch.equal(exact_assignment(source, target), expected)
    assert sum(map(len, held)) == MANY
    assert all(len(cost) == 1 or cost.numel() <= pairs for cost in held)


@pytest.mark.parametrize("cores", [1, 5, 100])
def test_any_number_of_cores(monkeypatch, cores):
    source, target = _leaves(MANY, 12, 1), _leaves(MANY, 12, 2)
    expected = exact_assignment(source, target)
    monkeypatch.setattr(assignment, "cpu_count", lambda: cores)
    assert torch.equal(exact_assignment(source, target), expected)


@pytest.mark.parametrize(("queries", "targets", "batch_size"), [(900, 1300, 700), (1300, 900, 5000)])
def test_a_plan_over_leaves_is_one_to_one(queries, targets, batch_size):
    queries, targets = _leaves(1, queries, 1)[0], _leaves(1, targets, 2)[0]
    first, second = StratifiedPairing(batch_size, 8)(queries, targets, _generator())
    matched = second.gather(1, exact_assignment(queries[first], targets[second]))
    assert len(first.unique()) == len(matched.unique()) == first.numel()
    assert torch.equal(matched.sort(1).values, second.sort(1).values)


def test_exponents_can_disagree():
    source = torch.tensor([[[0.0, 0, 0], [1.0, 0, 0]]])
    target = torch.tensor([[[1.0, 0, 0], [2.0, 0.5, 0]]])
    # One point already there and one long step: 0 + 2.06 against 1 + 1.12, but squared 0 + 4.25 against 1 + 1.25.
    assert exact_assignment(source, target, 1).tolist() == [[1, 0]]
    assert exact_assignment(source, target, 2).tolist() == [[0, 1]]


def test_no_gradient_and_no_change_of_the_inputs():
    source, target = _leaves(2, 8, 1).requires_grad_(), _leaves(2, 8, 2)
    before = source.detach().clone(), target.clone()
    phi = exact_assignment(source, target)
    assert phi.dtype == torch.int64 and not phi.requires_grad
    assert torch.equal(source.detach(), before[0]) and torch.equal(target, before[1])


def test_cost_matrix_is_precise_for_points_that_almost_agree():
    # The fast way through |s|^2 - 2 s.t + |t|^2 loses this difference in single precision.
    source = torch.full((1, 30, 3), 1.0)
    target = source + torch.tensor([1e-4, 0, 0])
    assert np.allclose(matching_cost(source, target, 1).numpy(), 1e-4, rtol=1e-2)
