"""The B-spline grid against scipy's splines, finite differences and functions it holds exactly."""

import numpy as np
import pytest
import torch
from scipy.interpolate import BSpline
from scipy.linalg import fractional_matrix_power

from n2n.architectures.grid import Grid

# The quadratic B-spline centred at zero, in units of a cell.
KERNEL = BSpline.basis_element([-1.5, -0.5, 0.5, 1.5], extrapolate=False)
SLOPE = KERNEL.derivative()


def _grid(voxel=0.25, levels=1, seed=0, **more):
    """A grid of random coefficients, in double precision."""
    grid = Grid(voxel, (-1.0, -1.0, -0.5), (1.0, 0.5, 1.0), levels, **more).double()
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for level in grid.levels:
            level.copy_(torch.randn(level.shape, generator=generator))
    return grid


def _inside(grid, count=200, seed=1):
    unit = torch.rand(count, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    return grid.lower + unit * grid.size


def _oracle(grid, point):
    """Value and gradient as a full tensor product of scipy's splines; border coefficients repeat outwards."""
    padded = np.pad(grid.coefficients()[0].detach().numpy(), 1, mode="edge")
    lower, factors = grid.lower.numpy(), []
    for axis in range(3):
        centres = lower[axis] + (np.arange(-1, grid.shape[axis] + 1) + 0.5) * grid.voxel
        t = (point[axis] - centres) / grid.voxel
        factors.append((np.nan_to_num(KERNEL(t)), np.nan_to_num(SLOPE(t)) / grid.voxel))
    value = np.einsum("ijk,i,j,k", padded, *(f[0] for f in factors))
    slopes = [np.einsum("ijk,i,j,k", padded, *(factors[b][int(a == b)] for b in range(3))) for a in range(3)]
    return value, np.array(slopes)


def _as_coefficients(function, voxel=0.125):
    """A single-level grid whose coefficients are a function's values at the cell centres."""
    grid = Grid(voxel, (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), levels=1).double()
    axes = [torch.arange(n, dtype=torch.float64) for n in grid.shape]
    nodes = (torch.stack(torch.meshgrid(*axes, indexing="ij"), -1) + 0.5) * voxel - 1
    with torch.no_grad():
        grid.levels[0].copy_(function(nodes)[None, None])
    return grid


def _sphere(radius=0.6):
    return lambda points: points.norm(dim=-1) - radius


def test_value_and_gradient_are_the_tensor_product_of_splines():
    grid = _grid()
    points = _inside(grid)
    with torch.no_grad():
        value, gradient = grid.value_and_gradient(points)
    for point, f, slope in zip(points.numpy(), value.numpy(), gradient.numpy(), strict=True):
        expected, slopes = _oracle(grid, point)
        assert f == pytest.approx(expected, abs=1e-10)
        assert np.allclose(slope, slopes, atol=1e-9)


def test_gradient_is_what_autograd_finds_inside_and_outside():
    grid = _grid(levels=3, voxel=0.125)
    points = (1.6 * _inside(grid)).requires_grad_()
    outside = ((points < grid.lower) | (points > grid.lower + grid.size)).any(1)
    assert outside.any() and not outside.all()
    value, gradient = grid.value_and_gradient(points)
    (expected,) = torch.autograd.grad(value.sum(), points)
    assert torch.allclose(gradient, expected, atol=1e-9)


def test_a_coarse_grid_stays_the_same_function_when_it_is_halved():
    coarse, fine = _grid(voxel=0.25), _grid(voxel=0.125, levels=2)
    assert coarse.shape == [n // 2 for n in fine.shape]
    with torch.no_grad():
        fine.levels[0].copy_(coarse.levels[0])
        fine.levels[1].zero_()
        points = _inside(coarse, 500)
        value, gradient = coarse.value_and_gradient(points)
        halved, slopes = fine.value_and_gradient(points)
    assert torch.allclose(halved, value, atol=1e-10) and torch.allclose(slopes, gradient, atol=1e-9)


def test_levels_add_up():
    grid, last = _grid(levels=2), _grid(levels=2)
    points = _inside(grid)
    both = grid(points)
    with torch.no_grad():
        grid.levels[1].zero_()
        last.levels[0].zero_()
    assert torch.allclose(grid(points) + last(points), both, atol=1e-10)


def test_linear_functions_are_held_exactly():
    grid = _as_coefficients(lambda nodes: nodes @ torch.tensor([1.0, -2.0, 3.0], dtype=torch.float64) + 0.5)
    points = 0.8 * _inside(grid)  # more than a cell from the border, where coefficients repeat
    value, gradient = grid.value_and_gradient(points)
    slope = torch.tensor([1.0, -2.0, 3.0], dtype=torch.float64)
    assert torch.allclose(value, points @ slope + 0.5, atol=1e-9)
    assert torch.allclose(gradient, slope.expand(200, 3), atol=1e-9)


def test_the_gradient_has_no_jump_at_cell_borders():
    grid = _grid()
    border = grid.lower + grid.voxel * torch.tensor([[2.0, 3.0, 2.0]], dtype=torch.float64)
    _, before = grid.value_and_gradient(border - 1e-9)
    _, after = grid.value_and_gradient(border + 1e-9)
    assert torch.allclose(before, after, atol=1e-5)


def test_value_is_continuous_across_the_box_and_grows_like_the_distance_outside():
    grid = _grid()
    upper = grid.lower + grid.size
    border = _inside(grid, 50)
    border[:, 1] = upper[1]
    step = torch.tensor([0.0, 1.0, 0.0], dtype=torch.float64)
    value, _ = grid.value_and_gradient(border)
    assert torch.allclose(grid(border - 1e-8 * step), value, atol=1e-6)
    assert torch.allclose(grid(border + 1e-8 * step), value, atol=1e-6)
    away, gradient = grid.value_and_gradient(border + 3 * step)
    assert torch.allclose(away, value + 3)
    assert torch.allclose(gradient[:, 1], torch.ones(50, dtype=torch.float64))


def test_beyond_a_corner_the_gradient_points_away_from_it():
    grid = _grid()
    corner = (grid.lower + grid.size)[None]
    offset = torch.tensor([[1.0, 2.0, 2.0]], dtype=torch.float64)
    value, gradient = grid.value_and_gradient(corner + offset)
    assert torch.allclose(value, grid(corner) + 3) and torch.allclose(gradient, offset / 3)


def test_a_fresh_grid_is_a_sphere():
    grid = Grid(0.1, (-1.0,) * 3, (1.0,) * 3, levels=3, radius=0.4)
    direction = torch.nn.functional.normalize(torch.randn(100, 3), dim=1)
    radius = 0.4 * float(grid.size.norm()) / 2
    assert grid(radius * direction).abs().max() < 0.1
    assert (grid(0.5 * radius * direction) < 0).all() and (grid(1.3 * radius * direction) > 0).all()


@pytest.mark.parametrize("levels", [2, 3])
def test_start_from_reproduces_the_distance_to_a_sphere(levels):
    grid = Grid(0.05, (-1.0,) * 3, (1.0,) * 3, levels=levels)
    grid.start_from(_sphere())
    points = 0.9 * (2 * torch.rand(1000, 3, generator=torch.Generator().manual_seed(0)) - 1)
    points = points[points.norm(dim=1) > 0.2]  # the centre's kink is rounded off
    with torch.no_grad():
        value, gradient = grid.value_and_gradient(points)
    # Splines of samples are too high by h^2 / 8 times the Laplacian 2 / r, h = 0.1 on the level that is set.
    assert (value - _sphere()(points)).abs().max() < 0.02
    assert (value - _sphere()(points) - 0.1**2 / 4 / points.norm(dim=1)).abs().max() < 3e-3
    assert (gradient.norm(dim=1) - 1).abs().max() < 0.1
    assert not grid.levels[-1].any()


def test_start_from_changes_its_own_shape_only():
    grid = Grid(0.05, (-0.6,) * 3, (0.6,) * 3, levels=2, num_conditions=2)
    points = torch.rand(50, 3) - 0.5
    other = grid(points, torch.zeros(50, dtype=torch.long))
    grid.start_from(_sphere(0.3), condition=1)
    assert torch.equal(grid(points, torch.zeros(50, dtype=torch.long)), other)
    assert grid(torch.zeros(1, 3), torch.ones(1, dtype=torch.long)).item() == pytest.approx(-0.3, abs=0.1)
    assert grid(torch.tensor([[0.3, 0, 0]]), torch.ones(1, dtype=torch.long)).item() == pytest.approx(0, abs=0.02)


def test_conditions_have_coefficients_of_their_own():
    grid = _grid(num_conditions=3, levels=2)
    points = _inside(grid, 30)
    codes = torch.arange(30) % 3
    mixed = grid(points, codes)
    for condition in range(3):
        alone = _grid(levels=2)
        with torch.no_grad():
            for mine, theirs in zip(alone.levels, grid.levels, strict=True):
                mine.copy_(theirs[condition : condition + 1])
        assert torch.allclose(mixed[codes == condition], alone(points[codes == condition]))
    (slope,) = torch.autograd.grad(grid(points, torch.ones(30, dtype=torch.long)).sum(), grid.levels[0])
    assert slope[1].any() and not slope[0].any() and not slope[2].any()


@pytest.mark.parametrize("seed", [0, 1])
def test_roughness_of_a_quadratic_is_its_squared_hessian_times_the_band(seed):
    matrix = torch.randn(3, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    matrix = matrix + matrix.T
    grid = _as_coefficients(lambda nodes: torch.einsum("...i,ij,...j->...", nodes, matrix, nodes))
    grid.set_band(torch.tensor([[0.1, -0.1, 0.2], [0.3, 0.0, 0.0]], dtype=torch.float64), 0.25)
    volume = grid.band.sum().item() * 0.125**3
    assert 5**3 * 0.125**3 < volume < 2 * 5**3 * 0.125**3
    assert grid.roughness().item() == pytest.approx((2 * matrix).square().sum().item() * volume, rel=1e-9)


def test_roughness_is_the_integral_of_the_spline_itself():
    # A bump several cells wide inside the band: its Hessian by differences of the gradient, summed over a lattice.
    grid = _as_coefficients(lambda nodes: torch.exp(-8 * nodes.square().sum(-1)), voxel=0.0625)
    grid.set_band(torch.zeros(1, 3, dtype=torch.float64), 0.75)
    axis = (torch.arange(25, dtype=torch.float64) + 0.5) * 0.0625 - 0.75
    points = torch.cartesian_prod(axis, axis, axis)
    energy, step = 0.0, 1e-4
    with torch.no_grad():
        for direction in step * torch.eye(3, dtype=torch.float64):
            after, before = (grid.value_and_gradient(points + s * direction)[1] for s in (1, -1))
            energy += ((after - before) / (2 * step)).square().sum().item() * 0.0625**3
    assert grid.roughness().item() == pytest.approx(energy, rel=0.05)


def test_roughness_ignores_what_lies_outside_the_band():
    grid = _as_coefficients(lambda nodes: torch.where(nodes[..., 0] > 0.5, torch.rand(nodes.shape[:3]).double(), 0.0))
    assert grid.roughness().item() == 0
    grid.set_band(torch.tensor([[-0.5, 0, 0]], dtype=torch.float64), 0.25)
    assert grid.roughness().item() == 0
    grid.set_band(torch.tensor([[0.75, 0, 0]], dtype=torch.float64), 0.25)
    assert grid.roughness().item() > 0


def _bent(matrix):
    return _as_coefficients(lambda nodes: torch.einsum("...i,ij,...j->...", nodes, matrix, nodes) / 2)


@pytest.mark.parametrize("seed", [0, 1])
def test_adapted_roughness_of_a_quadratic_is_the_formula(seed):
    matrix = torch.randn(3, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    matrix = matrix + matrix.T
    grid = _bent(matrix)
    grid.set_band(torch.tensor([[0.1, -0.1, 0.2]], dtype=torch.float64), 0.25)
    grid.adapt_roughness()
    squared = (matrix @ matrix).numpy()
    stiffness = fractional_matrix_power(squared / np.trace(squared) + 0.2 * np.eye(3), -0.45)
    stiffness /= np.sqrt(np.mean(np.linalg.eigvalsh(stiffness) ** 2))
    stiff = stiffness @ matrix.numpy()
    volume = grid.band.sum().item() * 0.125**3
    assert grid.roughness().item() == pytest.approx(np.trace(stiff @ stiff) * volume, rel=1e-6)


def test_adapted_roughness_asks_less_of_the_bend_that_is_there_than_of_another():
    along_x, along_y = (torch.diag(torch.tensor(d, dtype=torch.float64)) for d in ((2.0, 0, 0), (0, 2.0, 0)))
    grid = _bent(along_x)
    grid.set_band(torch.zeros(1, 3, dtype=torch.float64), 0.25)
    grid.adapt_roughness()
    same = grid.roughness().item()
    with torch.no_grad():
        grid.levels[0].copy_(_bent(along_y).levels[0])
    other = grid.roughness().item()
    assert other == pytest.approx(same * (1.2 / 0.2) ** 0.9, rel=1e-6)
    grid.adapt_roughness()
    assert grid.roughness().item() == pytest.approx(same, rel=1e-6)


def test_adapted_roughness_is_never_negative():
    grid = _grid(levels=2, voxel=0.125)
    grid.set_band(_inside(grid, 5), 0.25)
    grid.adapt_roughness()
    generator = torch.Generator().manual_seed(5)
    for _ in range(20):
        with torch.no_grad():
            for level in grid.levels:
                level.copy_(torch.randn(level.shape, generator=generator))
        assert grid.roughness().item() > 0


def test_a_new_band_and_a_loaded_field_start_evenly():
    matrix = torch.diag(torch.tensor([2.0, 1.0, 0.0], dtype=torch.float64))
    even, grid = _bent(matrix), _bent(matrix)
    points = torch.tensor([[-0.56, 0.06, 0.06]], dtype=torch.float64)
    for each in (even, grid):
        each.set_band(points, 0.25)
    grid.adapt_roughness()
    assert grid.roughness() != even.roughness()
    grid.load_state_dict(even.state_dict())
    assert grid.roughness() == even.roughness()
    grid.adapt_roughness()
    grid.set_band(points, 0.25)
    assert grid.roughness() == even.roughness()


def test_band_is_a_box_of_cells_around_each_point():
    grid = Grid(0.1, (-1.0,) * 3, (1.0,) * 3, levels=1, num_conditions=2)
    grid.set_band(torch.tensor([[0.05, 0.05, 0.05]]), 0.2, condition=1)
    assert grid.band[0].sum() == 0 and grid.band[1].sum() == 5**3
    assert grid.band[1][8:13, 8:13, 8:13].all()
    grid.set_band(torch.tensor([[3.0, -3.0, 0.05]]), 0.2, condition=1)  # outside: the nearest cells count
    assert grid.band[1].sum() == 3 * 3 * 5 and grid.band[1][-1, 0, 10] == 1


def test_shared_sums_the_levels_once_and_keeps_slopes(monkeypatch):
    from n2n.architectures import grid as module

    calls, halve = [], module._finer
    monkeypatch.setattr(module, "_finer", lambda x: calls.append(1) or halve(x))
    grid = _grid(levels=3, voxel=0.125)
    points = _inside(grid)
    loss = grid(points).square().sum() + grid(points.flip(1)).sum()
    expected = torch.autograd.grad(loss, list(grid.levels))
    assert len(calls) == 4
    calls.clear()
    with grid.shared():
        shared = grid(points).square().sum() + grid(points.flip(1)).sum()
    assert len(calls) == 2 and torch.allclose(shared, loss)
    for slope, other in zip(torch.autograd.grad(shared, list(grid.levels)), expected, strict=True):
        assert torch.allclose(slope, other)


def test_shared_ends_with_its_block_even_after_an_error():
    grid = _grid()
    points = _inside(grid)
    with pytest.raises(KeyError), grid.shared():
        raise KeyError
    before = grid(points)
    with torch.no_grad():
        grid.levels[0] += 1
    assert torch.allclose(grid(points), before + 1)


def test_the_box_is_covered_and_centred():
    grid = Grid(0.3, (-1.0, 0.0, 2.0), (1.0, 0.5, 3.0), levels=2)
    upper = grid.lower + grid.size
    assert (grid.lower <= torch.tensor([-1.0, 0.0, 2.0])).all() and (upper >= torch.tensor([1.0, 0.5, 3.0])).all()
    assert torch.allclose((grid.lower + upper) / 2, torch.tensor([0.0, 0.25, 2.5]))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"voxel": 0.0}, "voxel must be > 0"),
        ({"voxel": 0.1, "levels": 0}, "levels >= 1"),
        ({"voxel": 1e-3}, "use a larger voxel"),
    ],
)
def test_impossible_grids_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Grid(**arguments)
