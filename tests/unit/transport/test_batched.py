"""All leaves in step against scipy one by one."""

import numpy as np
import pytest
import torch
from scipy.optimize import linear_sum_assignment

from n2n.transport import assignment
from n2n.transport.assignment import exact_assignment, matching_cost
from n2n.transport.batched import batched_assignment

CLOUDS = {
    "uniform": lambda draw, shape: draw(torch.rand, *shape, 3),
    # Unequal shares of both clusters: some points must cross at a thousand times the cost of the others.
    "two clusters": lambda draw, shape: 10 * draw(torch.rand, *shape, 1).round() + 0.01 * draw(torch.randn, *shape, 3),
    "lattice": lambda draw, shape: (4 * draw(torch.rand, *shape, 3)).floor(),  # ties, and some equal points
    "few places": lambda draw, shape: (2 * draw(torch.rand, *shape, 1)).floor().expand(*shape, 3),
    "thin": lambda draw, shape: draw(torch.rand, *shape, 3) * torch.tensor([1.0, 1.0, 1e-3]),
    "far away": lambda draw, shape: 1e4 + draw(torch.rand, *shape, 3),
}


def _pair(kind, count, k, seed=0):
    generator = torch.Generator().manual_seed(seed)

    def draw(sample, *shape):
        return sample(*shape, generator=generator, dtype=torch.float64)

    return [CLOUDS[kind](draw, (count, k)).double() for _ in range(2)]


def _check(cost, phi):
    """The map is one-to-one and, but for rounding, costs what scipy's does."""
    count, k, _ = cost.shape
    assert phi.dtype == torch.int64
    assert torch.equal(phi.sort(dim=1).values, torch.arange(k).expand(count, -1))
    best = [matrix[linear_sum_assignment(matrix)].sum() for matrix in cost.double().numpy()]
    found = cost.double().gather(2, phi[..., None]).sum(dim=(1, 2)).numpy()
    # Relative to the most that k pairs could cost: a float64 sum of them is no more exact than that.
    assert (np.abs(found - best) <= 1e-14 * k * cost.double().abs().amax(dim=(1, 2)).numpy()).all()


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("kind", list(CLOUDS))
@pytest.mark.parametrize(("count", "k"), [(200, 1), (200, 2), (200, 3), (40, 17), (20, 64), (4, 127)])
def test_costs_what_scipy_finds(kind, count, k, p):
    cost = matching_cost(*_pair(kind, count, k), p)
    _check(cost, batched_assignment(cost))


@pytest.mark.parametrize("scale", [1e-6, 1e6])
@pytest.mark.parametrize("p", [1, 2])
def test_any_unit_and_single_precision(scale, p):
    source, target = (scale * points.float() for points in _pair("uniform", 40, 20))
    cost = matching_cost(source, target, p)
    _check(cost, batched_assignment(cost))


def test_costs_of_very_different_size_in_one_leaf():
    generator = torch.Generator().manual_seed(0)
    cost = 10 ** (12 * torch.rand(50, 20, 20, generator=generator, dtype=torch.float64) - 6)
    _check(cost, batched_assignment(cost))


@pytest.mark.parametrize("sign", [-1, 1])
def test_costs_need_not_be_distances(sign):
    cost = sign * torch.randn(50, 12, 12, generator=torch.Generator().manual_seed(0), dtype=torch.float64).exp()
    _check(cost - 3, batched_assignment(cost - 3))


def test_equal_points_have_every_matching():
    assert torch.equal(batched_assignment(torch.zeros(3, 127, 127)).sort(1).values, torch.arange(127).expand(3, -1))


def test_leaves_do_not_see_each_other():
    # Leaves that are done early wait for the others without changing.
    hard, easy = matching_cost(*_pair("two clusters", 5, 40), 1), matching_cost(*_pair("uniform", 5, 40)[:1] * 2, 1)
    together = batched_assignment(torch.cat([easy, hard]))
    assert torch.equal(together[:5], torch.arange(40).expand(5, -1))
    assert torch.equal(together[5:], batched_assignment(hard))


@pytest.mark.parametrize("k", [1, 2, 3, 4, 5, 10, 30])
def test_the_worst_case_is_finished(k):
    # Costs i j (Machol and Wien): every search crosses all matched columns, k^2 - k turns of the k^2 there are.
    steps = torch.arange(1.0, k + 1)
    assert torch.equal(batched_assignment((steps[:, None] * steps)[None])[0], torch.arange(k).flip(0))


def test_the_costs_are_left_as_they_were():
    cost = matching_cost(*_pair("uniform", 2, 8), 1)
    before = cost.clone()
    batched_assignment(cost)
    assert torch.equal(cost, before)


@pytest.mark.parametrize("bad", [torch.nan, torch.inf])
def test_costs_that_are_no_numbers_are_refused(bad):
    cost = torch.ones(2, 3, 3)
    cost[1, 2, 0] = bad
    with pytest.raises(ValueError, match="finite"):
        batched_assignment(cost)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no NVIDIA GPU on this machine")
@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("batched_from", [0, 10**9])  # all in step on the GPU; in threads on the CPU
def test_a_gpu_finds_the_same_cost(monkeypatch, batched_from, p):
    monkeypatch.setattr(assignment, "_BATCHED_FROM", batched_from)
    for kind in CLOUDS:
        source, target = _pair(kind, 100, 64)
        phi = exact_assignment(source.cuda(), target.cuda(), p)
        assert phi.is_cuda
        _check(matching_cost(source, target, p), phi.cpu())
