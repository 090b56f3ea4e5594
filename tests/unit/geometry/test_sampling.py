import pytest
import torch
from scipy.spatial import cKDTree

from n2n.errors import ConfigError
from n2n.geometry.sampling import QuerySampler, neighbour_distance


def _generator():
    return torch.Generator().manual_seed(0)


def test_observation_queries_are_the_points():
    points = torch.randn(50, 3)
    assert QuerySampler("observation")(points, _generator()) is points


def test_neighbour_queries_spread_with_the_local_spacing():
    points = torch.cat([0.01 * torch.randn(500, 3), 1.0 * torch.randn(500, 3) + 20])
    offset = QuerySampler("neighbour", neighbour=50)(points, _generator()) - points
    truth = torch.as_tensor(cKDTree(points.numpy()).query(points.numpy(), 51)[0][:, -1], dtype=torch.float32)
    assert torch.allclose(neighbour_distance(points, 50), truth)
    assert (offset / truth[:, None]).std() == pytest.approx(1.0, rel=0.1)


def test_jitter_queries_have_one_deviation():
    points = torch.randn(5000, 3)
    offset = QuerySampler("jitter", scale=0.02)(points, _generator()) - points
    assert offset.std().item() == pytest.approx(0.02, rel=0.03)


def test_unknown_kind_is_named():
    with pytest.raises(ConfigError, match=r"Unknown queries.kind 'gauss'. Known: observation, neighbour, jitter"):
        QuerySampler("gauss")
