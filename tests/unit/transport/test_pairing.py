"""Which points are drawn, and that a leaf's two sides come from the same region."""

import pytest
import torch

from n2n.transport.pairing import GlobalPairing, StratifiedPairing


def _generator(seed=0):
    return torch.Generator().manual_seed(seed)


def _cloud(count, seed=0):
    return torch.rand(count, 3, generator=_generator(seed))


@pytest.mark.parametrize(
    ("queries", "targets", "batch_size", "leaf_size", "shape"),
    [
        (1024, 1024, 1024, 64, (16, 64)),
        (1000, 1300, 5000, 64, (8, 125)),  # 125, not 64: leaves grow rather than leave points out
        (777, 900, 501, 64, (4, 125)),
        (127, 127, 127, 64, (1, 127)),
        (50, 70, 1000, 64, (1, 50)),
        (33, 33, 33, 1, (32, 1)),
        (37, 41, 36, 3, (8, 4)),
    ],
)
def test_leaves_are_balanced_for_any_count(queries, targets, batch_size, leaf_size, shape):
    pairing = StratifiedPairing(batch_size, leaf_size)
    first, second = pairing(_cloud(queries, 1), _cloud(targets, 2), _generator())
    assert first.shape == second.shape == shape
    assert len(first.unique()) == first.numel() and first.max() < queries
    assert len(second.unique()) == second.numel() and second.max() < targets


def test_two_clusters_never_share_a_leaf():
    # The same half of each cloud lies far away, in shuffled rows, so the first cut must fall between the clusters.
    here, there = torch.zeros(3), torch.tensor([0.0, 50.0, 0.0])
    queries = _cloud(512, 1) + torch.stack([here, there])[torch.randperm(512, generator=_generator(1)) % 2]
    targets = _cloud(512, 2) + torch.stack([here, there])[torch.randperm(512, generator=_generator(2)) % 2]
    first, second = StratifiedPairing(512, 32)(queries, targets, _generator())
    far_queries, far_targets = queries[first][..., 1] > 25, targets[second][..., 1] > 25
    assert torch.equal(far_queries.all(1), far_queries.any(1)) and torch.equal(far_targets.all(1), far_targets.any(1))
    assert torch.equal(far_queries.any(1), far_targets.any(1))
    assert far_queries.any(1).sum() == 8


def test_the_sides_of_a_leaf_are_neighbours():
    queries, targets = _cloud(4096, 1), _cloud(4096, 2)
    first, second = StratifiedPairing(4096, 64)(queries, targets, _generator())
    distance = (queries[first].mean(1) - targets[second].mean(1)).norm(dim=1)
    # A leaf is a box of a 64th of the volume, about a quarter wide; random subsets would agree to 0.05 only by chance.
    assert distance.max() < 0.15 and queries[first].std(1).max() < 0.2
    mixed = (queries[first].mean(1) - targets[second.roll(1, 0)].mean(1)).norm(dim=1)
    assert distance.median() < 0.2 * mixed.median()


def test_leaves_are_narrow_along_the_long_axis():
    cloud = _cloud(1024) * torch.tensor([1.0, 1.0, 20.0])
    _, second = StratifiedPairing(1024, 64)(cloud, cloud, _generator())
    assert cloud[second][..., 2].std(1).max() < 1.0


@pytest.mark.parametrize("count", [256, 301])
def test_same_keeps_every_query_with_the_target_it_came_from(count):
    targets = _cloud(count)
    # So much noise that queries cut on their own would end up in other leaves.
    queries = targets + torch.randn(count, 3, generator=_generator(3))
    first, second = StratifiedPairing(256, 16)(queries, targets, _generator(), same=True)
    assert torch.equal(first, second)
    free, second = StratifiedPairing(256, 16)(queries, targets, _generator())
    assert not torch.equal(free.sort(1).values, second.sort(1).values)


def test_draws_follow_the_generator():
    queries, targets = _cloud(500, 1), _cloud(500, 2)
    pairing = StratifiedPairing(128, 16)
    a, b, c = (pairing(queries, targets, _generator(seed)) for seed in (1, 1, 2))
    assert torch.equal(a[0], b[0]) and torch.equal(a[1], b[1])
    assert not torch.equal(a[0].unique(), c[0].unique()) and not torch.equal(a[1].unique(), c[1].unique())


@pytest.mark.parametrize("pairing", [GlobalPairing(32), StratifiedPairing(32, 4)])
def test_no_point_is_preferred(pairing):
    # A point drawn more often than others would pull the surface to its noise.
    queries, targets, generator = _cloud(40, 1), _cloud(80, 2), _generator()
    draws = [pairing(queries, targets, generator) for _ in range(300)]
    for index, count in ((0, 40), (1, 80)):
        often = torch.cat([draw[index].flatten() for draw in draws]).bincount(minlength=count)
        share = 32 / count
        assert (often - 300 * share).abs().max() < 5 * (300 * share * (1 - share)) ** 0.5


def test_borders_of_the_leaves_move_between_draws():
    cloud = _cloud(256)
    leaves = [
        {tuple(sorted(leaf)) for leaf in StratifiedPairing(256, 16)(cloud, cloud, _generator(seed))[1].tolist()}
        for seed in (1, 2)
    ]
    assert leaves[0] != leaves[1]


@pytest.mark.parametrize(("batch_size", "drawn"), [(64, 64), (300, 300), (5000, 400)])
def test_global_pairing_draws_one_leaf_from_all_over(batch_size, drawn):
    queries, targets = _cloud(400, 1), _cloud(600, 2)
    first, second = GlobalPairing(batch_size)(queries, targets, _generator())
    assert first.shape == second.shape == (1, drawn)
    assert len(first.unique()) == len(second.unique()) == drawn
    assert second.max() >= 400  # rows of the larger cloud are drawn, too


@pytest.mark.parametrize("same", [False, True])
def test_global_batches_are_independent(same):
    # Sec. 3 draws B targets apart from the B queries, also where both come from one cloud.
    cloud = _cloud(200)
    first, second = GlobalPairing(50)(cloud, cloud, _generator(), same=same)
    assert not torch.equal(first.unique(), second.unique())
