"""The contract n2n ships, and what is special about this distance."""

import pytest
import torch
from n2n_example_plugin.huber import HuberEMD

from n2n.losses.distances import EMD
from n2n.testing import check_distance


@pytest.mark.parametrize("delta", [0.001, 0.05, 10.0])
def test_contract(delta):
    check_distance(HuberEMD(delta))


def test_far_matches_count_linearly():
    target = torch.rand(1, 8, 3, generator=torch.Generator().manual_seed(0))
    moved = target + torch.tensor([100.0, 0, 0])
    assert torch.isclose(HuberEMD(delta=0.02)(moved, target), EMD(p=1)(moved, target) - 0.01, atol=1e-4)


def test_near_matches_count_squared():
    target = torch.rand(1, 8, 3, generator=torch.Generator().manual_seed(0))
    moved = target + torch.tensor([0.001, 0, 0])
    assert torch.isclose(HuberEMD(delta=0.5)(moved, target), EMD(p=2)(moved, target), rtol=1e-3)


def test_delta_must_be_positive():
    with pytest.raises(ValueError, match="delta must be > 0, got 0"):
        HuberEMD(0)
