"""Eq. 7 as a sum of its parts, and what is drawn for it."""

import pytest
import torch

from n2n.datamodules.observations import Draw
from n2n.fitting.objective import Objective
from n2n.geometry.sampling import QuerySampler
from n2n.losses.distances import EMD
from n2n.losses.regularisers import Consistency, OnSurface, ZeroLevel
from n2n.losses.state import Guide
from n2n.testing import Ball
from n2n.transport.pairing import GlobalPairing, StratifiedPairing


def _generator(seed=0):
    return torch.Generator().manual_seed(seed)


def _sphere(radius, count, seed):
    return radius * torch.nn.functional.normalize(torch.randn(count, 3, generator=_generator(seed)), dim=1)


def _objective(kind="observation", terms=None, guides=(), pairing=None):
    queries = QuerySampler(kind, scale=0.05)
    return Objective(EMD(1), pairing or StratifiedPairing(256, 32), queries, terms or {}, guides)


def _draw(same=False):
    source, target = _sphere(0.6, 300, 1), _sphere(0.5, 400, 2)
    return Draw(target, target, True, 0, 0) if same else Draw(source, target, False, None, 0)


def _loss(objective, field, block, progress=0.5):
    return objective.loss(field, block, progress, _generator(9))


def test_total_is_the_weighted_sum_of_the_parts():
    objective = _objective(terms={"regulariser": (0.3, OnSurface()), "zero_level": (2.0, ZeroLevel())})
    field = Ball(0.45)
    total, parts = _loss(objective, field, objective.begin(field, _draw(), _generator()))
    assert set(parts) == {"distance", "regulariser", "zero_level"}
    assert parts["regulariser"].item() == pytest.approx(0.05**2, rel=1e-3)
    expected = parts["distance"] + 0.3 * parts["regulariser"] + 2 * parts["zero_level"]
    assert total.item() == pytest.approx(expected.item()) and total.requires_grad
    assert not any(part.requires_grad for part in parts.values())


def test_terms_of_weight_zero_are_not_evaluated():
    def fails(state):
        raise AssertionError

    objective = _objective(terms={"regulariser": (0.0, fails)})
    _, parts = _loss(objective, Ball(), objective.begin(Ball(), _draw(), _generator()))
    assert set(parts) == {"distance"}


def test_observation_queries_of_two_clouds_are_source_and_target():
    draw = _draw()
    block = _objective().begin(Ball(), draw, _generator())
    assert torch.allclose(block.queries.norm(dim=-1), torch.tensor(0.6))
    assert torch.allclose(block.targets.norm(dim=-1), torch.tensor(0.5))


def test_a_cloud_is_not_matched_to_itself_row_by_row():
    # F = identity would be perfect if queries and targets were the same rows.
    draw = _draw(same=True)
    block = _objective(pairing=GlobalPairing(100)).begin(Ball(), draw, _generator())
    assert not torch.equal(block.queries, block.targets)


def test_jittered_queries_share_a_leaf_with_the_targets_they_came_from():
    block = _objective("jitter").begin(Ball(0.5), _draw(same=True), _generator())
    offset = block.queries - block.targets
    assert offset.std().item() == pytest.approx(0.05, rel=0.1)


def test_denoised_points_are_pulled_and_detached():
    terms = {"regulariser": (0.1, Consistency(against="larger"))}
    block = _objective(terms=terms).begin(Ball(0.4), _draw(), _generator())
    assert torch.allclose(block.denoised.norm(dim=1), torch.full((400,), 0.4), atol=1e-5)
    assert not block.denoised.requires_grad


def test_nothing_is_denoised_that_nobody_looks_at():
    terms = {"regulariser": (0.1, Consistency(against="batch"))}
    assert _objective(terms=terms).begin(Ball(0.4), _draw(), _generator()).denoised is None


def test_far_points_get_their_signed_distance_to_the_denoised_cloud():
    far = torch.tensor([[0.0, 0, 0], [1.0, 0, 0], [0, 0.9, 0]])
    signs = torch.tensor([-1.0, 1.0, 1.0])
    guide = Guide(_sphere(0.5, 10, 3), _sphere(1.0, 10, 3), far, signs, area=torch.pi)
    seen = []

    def spy(state):
        seen.append(state)
        return state.value.sum() * 0

    objective = _objective(guides=[guide], terms={"spy": (1.0, spy)})
    field = Ball(0.5)
    _loss(objective, field, objective.begin(field, _draw(), _generator()), progress=0.25)
    points, distance = seen[0].far
    assert torch.allclose(distance, points.norm(dim=1) - 0.5, atol=0.02)
    assert set(map(tuple, points.tolist())) == set(map(tuple, far.tolist()))
    assert seen[0].progress == 0.25 and seen[0].guide is guide


def test_blocks_follow_the_generator():
    objective = _objective("jitter")
    a, b, c = (objective.begin(Ball(), _draw(same=True), _generator(seed)) for seed in (1, 1, 2))
    assert torch.equal(a.queries, b.queries) and torch.equal(a.plan, b.plan)
    assert not torch.equal(a.queries, c.queries)
