"""The Hessian of a sampled field, and the stiffness that follows from it, against matrix functions of scipy."""

import numpy as np
import pytest
import torch
from scipy.linalg import fractional_matrix_power
from scipy.ndimage import uniform_filter

from n2n.architectures.bending import _mean_of_27, compliant, hessian


def _nodes(count=16):
    axis = (torch.arange(count, dtype=torch.float64) + 0.5) * 2 / count - 1
    return torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"), -1)


def _matrix(seed):
    matrix = torch.randn(3, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    return matrix + matrix.T


def _everywhere(values):
    """The Hessian at every cell, (b, nx, ny, nz, 3, 3)."""
    return hessian(values, torch.ones_like(values).nonzero(as_tuple=True)).view(*values.shape, 3, 3)


def _quadratic(matrix):
    """n^T A n / 2, whose Hessian is A."""
    return torch.einsum("...i,ij,...j->...", _nodes(), matrix, _nodes())[None] / 2


def _box():
    """A band away from the border, where values repeat."""
    band = torch.zeros(1, 16, 16, 16, dtype=torch.float64)
    band[:, 4:12, 5:11, 4:12] = 1
    return band


def _oracle(matrix):
    squared = (matrix @ matrix).numpy()
    stiffness = fractional_matrix_power(squared / np.trace(squared) + 0.2 * np.eye(3), -0.45)
    return stiffness / np.sqrt(np.mean(np.linalg.eigvalsh(stiffness) ** 2))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_hessian_of_a_quadratic_is_exact(seed):
    matrix = _matrix(seed)
    values = _quadratic(matrix) + _nodes() @ torch.tensor([0.3, -2.0, 1.0], dtype=torch.float64) + 7
    found = _everywhere(values)[:, 1:-1, 1:-1, 1:-1] / 0.125**2
    assert torch.allclose(found, matrix.expand_as(found), rtol=1e-8, atol=1e-9)


def test_hessian_at_some_cells_is_that_of_these_cells():
    values = torch.randn(2, 5, 6, 7, generator=torch.Generator().manual_seed(0))
    cells = (torch.rand(2, 5, 6, 7, generator=torch.Generator().manual_seed(1)) < 0.3).nonzero(as_tuple=True)
    assert torch.equal(hessian(values, cells), _everywhere(values)[cells])


def test_hessian_belongs_to_its_own_cell_and_condition():
    values = torch.zeros(2, 7, 7, 7)
    values[1, 3, 3, 3] = 1
    found = _everywhere(values)
    assert not found[0].any()
    assert torch.equal(found[1, 3, 3, 3], -2 * torch.eye(3))
    assert torch.equal(found[1, 4, 3, 3], torch.diag(torch.tensor([1.0, 0, 0])))
    assert found[1, 4, 2, 3].nonzero().tolist() == [[0, 1], [1, 0]] and found[1, 4, 2, 3, 0, 1] == -0.25
    assert not found[1, 4, 4, 4].any() and not found[1, 5, 3, 3].any()


def test_mean_of_27_is_a_box_filter_with_nothing_outside():
    values = torch.randn(2, 6, 5, 7, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    for found, one in zip(_mean_of_27(values), values, strict=True):
        assert np.allclose(found, uniform_filter(one.numpy(), 3, mode="constant"))


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_stiffness_is_a_power_of_the_squared_hessian_whatever_its_size(seed, scale):
    matrix = _matrix(seed)
    cells, found, least = compliant(scale * _quadratic(matrix), _box())
    assert len(cells[0]) == _box().sum()
    assert np.allclose(found, _oracle(matrix), rtol=1e-6)
    assert np.allclose(least, np.linalg.eigvalsh(_oracle(matrix))[0], rtol=1e-6)


def test_a_flat_part_is_stiffer_than_a_bent_one():
    bend = torch.where(_nodes()[..., 0] < 0, 1.0, 3.0)
    cells, found, _ = compliant((bend * _nodes()[..., 0] ** 2)[None] / 2, _box())
    outer = (cells[1] < 6) | (cells[1] > 9)  # away from the seam
    left, right = (found[outer & side] for side in (cells[1] < 8, cells[1] >= 8))
    assert (right[:, 0, 0].max() < left[:, 0, 0].min()) and torch.allclose(left[:, 1, 1], right[:1, 1, 1])
    assert found.diagonal(dim1=-2, dim2=-1).square().mean().item() == pytest.approx(1)


def test_an_edge_stays_stiff_along_itself():
    # The distance to the edge between the faces x = 0 and z = 0, which runs along y.
    values = torch.maximum(_nodes()[..., 0], _nodes()[..., 2])[None]
    cells, found, _ = compliant(values, _box())
    x, z = (_nodes()[cells[1:]][:, axis] for axis in (0, 2))
    edge, face = (x - z).abs() < 0.1, (x - z).abs() > 0.4
    across = torch.tensor([1.0, 0, -1], dtype=torch.float64) / 2**0.5
    soft, stiff = torch.einsum("i,nij,j->n", across, found[edge], across), found[edge][:, 1, 1]
    assert soft.max() < 0.5 * stiff.min()
    assert torch.allclose(stiff, found[face][:, 1, 1].mean())
    assert torch.allclose(found[face], stiff.mean() * torch.eye(3, dtype=torch.float64))


def test_every_condition_has_its_own_mean():
    first, second = _matrix(0), 100 * _matrix(1)
    band = torch.cat([_box(), 0 * _box(), _box(), _box()])
    flat = torch.zeros_like(_quadratic(first))
    cells, found, _ = compliant(torch.cat([_quadratic(first), flat, _quadratic(second), flat]), band)
    assert set(cells[0].tolist()) == {0, 2, 3}
    assert np.allclose(found[cells[0] == 0], _oracle(first), rtol=1e-6)
    assert np.allclose(found[cells[0] == 2], _oracle(second), rtol=1e-6)
    assert torch.allclose(found[cells[0] == 3], torch.eye(3, dtype=torch.float64))  # no bend: nothing to tell apart


def test_without_a_band_there_is_nothing():
    cells, found, _ = compliant(_quadratic(_matrix(0)), 0 * _box())
    assert not len(cells[0]) and found.shape == (0, 3, 3)
