"""Thin-plate energy of a sampled field that costs less across what is bent already than along it."""

import torch
from torch import Tensor
from torch.nn import functional

_STEPS = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
_PAIRS = ((0, 1), (0, 2), (1, 2))
_POWER, _FLOOR = 0.45, 0.2

Cells = tuple[Tensor, ...]


def hessian(values: Tensor, cells: Cells) -> Tensor:
    """Return h^2 times the Hessian at some cells, (n, 3, 3), from central differences; values repeat at the border.

    Args:
        values: (b, nx, ny, nz), h apart.
        cells: Indices along the four axes, (n,) each.
    """
    padded = functional.pad(values[:, None], (1,) * 6, mode="replicate")[:, 0]

    def at(*shift: int) -> Tensor:
        return padded[(cells[0], *(cell + 1 + s for cell, s in zip(cells[1:], shift, strict=True)))]

    here, away = at(0, 0, 0), [(at(*step), at(*(-s for s in step))) for step in _STEPS]
    xx, yy, zz = (ahead - 2 * here + behind for ahead, behind in away)
    mixed = []
    for first, second in _PAIRS:
        a, b = _STEPS[first], _STEPS[second]
        both = tuple(x + y for x, y in zip(a, b, strict=True))
        cross = tuple(x - y for x, y in zip(a, b, strict=True))
        corners = at(*both) + at(*(-s for s in both)) - at(*cross) - at(*(-s for s in cross))
        mixed.append(corners / 4)
    return _symmetric(xx, yy, zz, *mixed)


def compliant(values: Tensor, band: Tensor) -> tuple[Cells, Tensor, Tensor]:
    """Return the stiffness of every cell of a band against the bending that the values show now.

    The energy of a cell with the stiffness W is tr(W H W H), H the Hessian: of bending between directions a and b with
    factors w_a, w_b on its axes, w_a w_b times as much as that of a thin plate. W = (M / m + 0.2)^-0.45, M the mean of
    H^2 over 27 cells, m that of its trace over the band of the same shape; scaled to a mean of w^2 of 1. Across an edge
    w is small, along it and on flat parts large: noise is smoothed away there, and the edge stays as sharp as it is.

    Args:
        values: (b, nx, ny, nz).
        band: 1 in the cells that count, 0 elsewhere, same shape.

    Returns:
        Indices of the n cells of the band, W (n, 3, 3), and the least w (n,) of each.
    """
    cells = band.nonzero(as_tuple=True)
    bent = hessian(values, cells)
    squared = bent @ bent
    near = _mean_of_27(band)[cells]

    def around(entry: Tensor) -> Tensor:
        # Of 27 cells, over those of the band alone.
        return _mean_of_27(torch.zeros_like(values).index_put(cells, entry))[cells] / near

    entries = [around(squared[:, i, j]) for i, j in ((0, 0), (1, 1), (2, 2), *_PAIRS)]
    mean = _mean_of_each(torch.stack(entries[:3]).sum(dim=0), cells[0]).clamp_min(1e-30)
    size, axes = torch.linalg.eigh(_symmetric(*entries) / mean[:, None, None])
    factor = (size.clamp_min(0) + _FLOOR) ** -_POWER
    factor = factor / _mean_of_each(factor.square().mean(dim=-1), cells[0]).sqrt()[:, None]
    return cells, (axes * factor[:, None, :]) @ axes.transpose(-1, -2), factor.amin(dim=-1)


def _symmetric(xx: Tensor, yy: Tensor, zz: Tensor, xy: Tensor, xz: Tensor, yz: Tensor) -> Tensor:
    return torch.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], dim=-1).unflatten(-1, (3, 3))


def _mean_of_each(values: Tensor, group: Tensor) -> Tensor:
    """Replace every value by the mean of its group."""
    groups = int(group.max()) + 1 if len(group) else 0
    total = values.new_zeros(groups).index_add(0, group, values)
    return (total / torch.bincount(group, minlength=groups).clamp_min(1))[group]


def _mean_of_27(values: Tensor) -> Tensor:
    return functional.avg_pool3d(values[:, None], 3, stride=1, padding=1)[:, 0]
