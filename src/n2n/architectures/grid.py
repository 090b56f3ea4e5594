"""A multi-resolution grid of quadratic B-splines: linear in its parameters, value and gradient in closed form."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import torch
from torch import Tensor, nn
from torch.nn import functional

from n2n.architectures.base import SDF
from n2n.architectures.bending import Cells, compliant, hessian
from n2n.shapes import Index, Points, Values

_MAX_CELLS = 256**3


class Grid(SDF):
    """f(q) = sum_k c_k B(q / h - k): quadratic B-splines on a regular grid, continuously differentiable.

    The coefficients are a sum of grids, each twice as fine as the one before. Halving a quadratic B-spline grid is
    exact (coefficients are interpolated linearly), so the sum is evaluated on the finest grid only; the coarse grids
    make gradient descent converge in a hundred steps and carry the sign far from the data.

    Args:
        voxel: Edge length h of a cell of the finest grid, unit coordinates, > 0.
        lower, upper: Corners of the box that holds the surface. Outside, f continues as f(closest point of the box)
            plus the distance to the box.
        levels: Number of grids, >= 1; the coarsest has cells of h * 2^(levels - 1).
        radius: The field starts as a sphere of this fraction of the box's half diagonal.
        num_conditions: Shapes held by one field, each with its own coefficients.
    """

    def __init__(
        self,
        voxel: float,
        lower: Sequence[float] = (-1.2, -1.2, -1.2),
        upper: Sequence[float] = (1.2, 1.2, 1.2),
        levels: int = 4,
        radius: float = 0.5,
        num_conditions: int = 1,
    ) -> None:
        super().__init__()
        if voxel <= 0 or levels < 1:
            raise ValueError(f"voxel must be > 0 and levels >= 1, got voxel={voxel}, levels={levels}")
        extent = [b - a for a, b in zip(lower, upper, strict=True)]
        coarse = [max(2, math.ceil(e / (voxel * 2 ** (levels - 1)))) for e in extent]
        cells = math.prod(c * 2 ** (levels - 1) for c in coarse)
        if cells > _MAX_CELLS:
            raise ValueError(f"voxel={voxel:g} makes {cells:.2g} cells; at most {_MAX_CELLS:.2g}: use a larger voxel")
        self.shape = [c * 2 ** (levels - 1) for c in coarse]
        self.voxel = float(voxel)
        size = torch.tensor(self.shape, dtype=torch.float32) * voxel
        middle = torch.tensor([(a + b) / 2 for a, b in zip(lower, upper, strict=True)], dtype=torch.float32)
        self.register_buffer("lower", middle - size / 2)
        self.register_buffer("size", size)
        self.register_buffer("band", torch.zeros(num_conditions, *self.shape))
        self.levels = nn.ParameterList(
            nn.Parameter(torch.zeros(num_conditions, 1, *(c * 2**level for c in coarse))) for level in range(levels)
        )
        centres = [torch.arange(c) + 0.5 for c in coarse]
        nodes = torch.stack(torch.meshgrid(*centres, indexing="ij"), -1) * voxel * 2 ** (levels - 1) - size / 2
        with torch.no_grad():
            self.levels[0] += nodes.norm(dim=-1) - radius * float(size.norm()) / 2
        self._shared: Tensor | None = None
        self._least: Tensor | None = None
        self._stiffness: tuple[Cells, Tensor] | None = None
        self.register_load_state_dict_post_hook(_forget_adaptation)

    def coefficients(self) -> Tensor:
        """Return the coefficients of the finest grid, (num_conditions, nx, ny, nz)."""
        if self._shared is not None:
            return self._shared
        total = self.levels[0]
        for level in self.levels[1:]:
            total = _finer(total) + level
        return total.squeeze(1)

    @contextmanager
    def shared(self) -> Iterator[None]:
        """Sum the levels once for all evaluations inside the block (one optimiser step, or one task)."""
        self._shared = self.coefficients()
        try:
            yield
        finally:
            self._shared = None

    def forward(self, points: Points, condition: Index | None = None) -> Values:
        return self.value_and_gradient(points, condition)[0]

    def value_and_gradient(self, points: Points, condition: Index | None = None) -> tuple[Values, Points]:
        inside = torch.minimum(torch.maximum(points, self.lower), self.lower + self.size)
        offset = points - inside
        cell, weight, slope = self._stencil(inside)
        coefficients = self.coefficients()
        if condition is not None and coefficients.shape[0] > 1:
            cell = cell + (condition * coefficients[0].numel())[:, None]
        local = coefficients.reshape(-1)[cell].view(-1, 9, 3)
        # Contract one axis at a time: (weight, slope) of z, then y, then x.
        z = torch.bmm(local, torch.stack([weight[:, 2], slope[:, 2]], -1)).view(-1, 3, 3, 2)
        y0 = (z * weight[:, 1, None, :, None]).sum(2)
        y1 = (z[..., 0] * slope[:, 1, None, :]).sum(2)
        value = (y0[..., 0] * weight[:, 0]).sum(1)
        gradient = torch.stack(
            [(y0[..., 0] * slope[:, 0]).sum(1), (y1 * weight[:, 0]).sum(1), (y0[..., 1] * weight[:, 0]).sum(1)], -1
        )
        distance = offset.norm(dim=-1, keepdim=True)
        gradient = gradient * (offset == 0) + offset / distance.where(distance > 0, 1.0)
        return value + distance.squeeze(-1), gradient

    def _stencil(self, points: Points) -> tuple[Tensor, Tensor, Tensor]:
        """Return the 27 flat cell indices (n, 27) and the per-axis weights and slopes (n, 3 axes, 3 taps)."""
        position = (points - self.lower) / self.voxel
        limit = torch.tensor(self.shape, device=points.device)
        nearest = torch.minimum(position.floor().long().clamp_min(0), limit - 1)
        t = position - nearest - 0.5
        weight = torch.stack([0.5 * (0.5 - t).square(), 0.75 - t.square(), 0.5 * (0.5 + t).square()], -1)
        slope = torch.stack([t - 0.5, -2 * t, t + 0.5], -1) / self.voxel
        taps = nearest[..., None] + torch.arange(-1, 2, device=points.device)
        taps = torch.minimum(taps.clamp_min(0), limit[:, None] - 1)
        _, ny, nz = self.shape
        cell = (taps[:, 0, :, None, None] * ny + taps[:, 1, None, :, None]) * nz + taps[:, 2, None, None, :]
        return cell.reshape(-1, 27), weight, slope

    def start_from(self, distance: Callable[[Points], Values], condition: int = 0) -> None:
        """Set all levels but the finest to a distance: the spline coefficients of a smooth function are its values."""
        with torch.no_grad():
            total = torch.zeros_like(self.levels[0][condition : condition + 1])
            for level in self.levels[: max(1, len(self.levels) - 1)]:
                cells = level.shape[2:]
                if total.shape[2:] != cells:
                    total = _finer(total)
                centres = [(torch.arange(n, device=level.device) + 0.5) / n for n in cells]
                nodes = torch.stack(torch.meshgrid(*centres, indexing="ij"), -1) * self.size + self.lower
                value = distance(nodes.reshape(-1, 3)).to(level).reshape(cells)
                level[condition, 0] = value - total[0, 0]
                total = value[None, None]

    def set_band(self, points: Points, radius: float, condition: int = 0) -> None:
        """Mark the cells within `radius` of the points: where `roughness` counts."""
        mask = torch.zeros(self.shape, device=points.device)
        cell = ((points - self.lower) / self.voxel).floor().long()
        cell = torch.minimum(cell.clamp_min(0), torch.tensor(self.shape, device=points.device) - 1)
        mask[cell[:, 0], cell[:, 1], cell[:, 2]] = 1
        reach = max(1, round(radius / self.voxel))
        for axis in range(3):
            # A box dilation, one axis at a time.
            rows = mask.movedim(axis, -1)
            wider = functional.max_pool1d(rows.reshape(1, -1, self.shape[axis]), 2 * reach + 1, 1, reach)
            mask = wider.reshape(rows.shape).movedim(-1, axis)
        self.band[condition] = mask
        self._least = self._stiffness = None

    @torch.no_grad()
    def adapt_roughness(self) -> None:
        """Let the field bend where and in the direction in which it already does: see `bending.compliant`.

        One stiffness for the whole surface would round edges and leave noise on flat parts.
        """
        cells, stiffness, least = compliant(self.coefficients(), self.band)
        self._least = self.band.index_put(cells, least.square())
        self._stiffness = cells, stiffness

    def roughness(self, generator: torch.Generator | None = None) -> Tensor:
        """Return the thin-plate energy: the integral of ||Hessian f||^2 over the band, exact for the grid's sums.

        Where it has been adapted, that of the least stiff direction, and what other directions add to it.
        """
        x = self.coefficients()
        band = self.band if self._least is None else self._least
        energy = x.new_zeros(())
        for axis in (1, 2, 3):
            n = x.shape[axis] - 2
            bend = x.narrow(axis, 2, n) - 2 * x.narrow(axis, 1, n) + x.narrow(axis, 0, n)
            energy = energy + (band.narrow(axis, 1, n) * bend.square()).sum()
        for first, second in ((1, 2), (1, 3), (2, 3)):
            twist = x.diff(dim=first).diff(dim=second)
            inner = band.narrow(first, 0, twist.shape[first]).narrow(second, 0, twist.shape[second])
            energy = energy + 2 * (inner * twist.square()).sum()
        if self._stiffness is not None:
            cells, stiffness = self._stiffness
            bent = hessian(x, cells)
            stiff = stiffness @ bent
            more = (stiff * stiff.transpose(-1, -2)).sum((-1, -2)) - band[cells] * bent.square().sum((-1, -2))
            energy = energy + more.sum()
        # Second differences are h^2 times the derivatives; a cell has volume h^3.
        return energy / self.voxel


def _forget_adaptation(grid: Grid, _: object) -> None:
    """Weigh the energy of a loaded field evenly: the stiffness follows from the field and is not kept."""
    grid._least = grid._stiffness = None


def _finer(coefficients: Tensor) -> Tensor:
    """Halve the cells of (b, 1, nx, ny, nz) coefficients; the spline stays the same function."""
    return functional.interpolate(coefficients, scale_factor=2, mode="trilinear", align_corners=False)
