"""The zero level set as a triangle mesh, evaluated coarse to fine near the surface only.

Cells are kept and split while they may hold the surface; where it runs on into a cell that was dropped, that cell is
added again. Marching cubes then runs over the cells the surface crosses.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from n2n.errors import ConfigError, SurfaceError
from n2n.geometry.marching import march
from n2n.geometry.sparse_grid import CORNERS, SparseGrid, changes_sign, key, triple

_COARSE_CELLS = 48
_FINEST_CELLS = 4096
# |grad f| up to which no surface is missed; learned fields are distances only approximately.
_STEEPEST = 2.0
# The last split needs less: what it drops by mistake is joined to a part that was found, and comes back.
_STEEPEST_LAST = 1.0


@dataclass(frozen=True)
class IsoSurface:
    """A level set.

    Attributes:
        vertices: (v, 3) float64, coordinates of the field.
        faces: (f, 3) int64, counter-clockwise seen from outside (where f is larger).
        evaluations: Field evaluations spent.
        dense_evaluations: What the full grid would have cost.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    evaluations: int
    dense_evaluations: int


def voxel_size(lower: NDArray[np.float64], upper: NDArray[np.float64], resolution: int) -> float:
    """Return the edge of a voxel for `resolution` voxels along the longest side of a box.

    >>> voxel_size(np.zeros(3), np.array([1.0, 4.0, 2.0]), 8)
    0.5
    """
    return float(np.max(np.subtract(upper, lower))) / resolution


def extract(
    field: Callable[[Tensor], Tensor],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    voxel: float,
    *,
    iso: float = 0.0,
    polish: int = 0,
) -> IsoSurface:
    """Extract {f = iso} inside a box; where it leaves the box the mesh is open.

    Args:
        field: (n, 3) float64 positions -> (n,) values, smaller inside; called without gradients.
        lower: Lowest corner of the box.
        upper: Highest corner; the grid ends there or less than a voxel beyond.
        voxel: Edge of a finest cell, > 0.
        iso: Level.
        polish: Steps that move vertices from the linear crossing of their grid edge onto the level set, each for one
            evaluation a vertex.

    Raises:
        ConfigError: The box is empty or the voxel too small for it.
        SurfaceError: No level set, or values that are not finite; the message has the range of f and the likely cause.
    """
    lower, upper = np.asarray(lower, float), np.asarray(upper, float)
    grid = SparseGrid(field, lower, voxel, _count_cells(lower, upper, voxel), iso)
    size = 2 ** max(0, int(np.ceil(np.log2(grid.cells.max() / _COARSE_CELLS))))
    cells, values = grid.coarse(size)
    while size > 1:
        # A point of a cell is at most half its diagonal away from the nearest corner.
        reach = (_STEEPEST_LAST if size == 2 else _STEEPEST) * 0.5 * np.sqrt(3) * size * voxel
        near = (np.abs(values).min(axis=1) <= reach) | changes_sign(values)
        size //= 2
        cells, values = grid.split(cells[near], size)
    cells, values = _follow(grid, cells, values)
    if not len(cells):
        raise SurfaceError(_diagnosis(grid, iso))
    vertices, faces = march(grid, cells, values, polish)
    return IsoSurface(grid.world(vertices), faces, grid.evaluations, int(np.prod(grid.cells + 1)))


def _count_cells(lower: NDArray[np.float64], upper: NDArray[np.float64], voxel: float) -> NDArray[np.int64]:
    if not (np.isfinite([*lower, *upper]).all() and (upper > lower).all()):
        raise ConfigError(f"the box from {triple(lower)} to {triple(upper)} is empty; upper must exceed lower")
    smallest = voxel_size(lower, upper, _FINEST_CELLS)
    if not voxel >= smallest * (1 - 1e-9):
        raise ConfigError(
            f"voxel={voxel:.3g} is too small for the box; give at least {smallest:.3g} ({_FINEST_CELLS} voxels)"
        )
    # Rounding must not add a layer of cells to a box that is a whole number of voxels.
    return np.maximum(np.ceil((upper - lower) / voxel - 1e-6), 1).astype(np.int64)


def _follow(
    grid: SparseGrid, cells: NDArray[np.int64], values: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Keep the unit cells with a sign change and add neighbours the surface runs on into, until none is missing."""
    crossing = changes_sign(values)
    cells, values = cells[crossing], values[crossing]
    known, kept = np.sort(key(cells)), [(cells, values)]
    while len(cells):
        across = []
        for axis in range(3):
            for side in (0, 1):
                leaves = changes_sign(values[:, CORNERS[:, axis] == side])
                across.append(cells[leaves] + (2 * side - 1) * np.eye(3, dtype=np.int64)[axis])
        across = np.concatenate(across)
        across = across[((across >= 0) & (across < grid.cells)).all(axis=1)]
        keys, first = np.unique(key(across), return_index=True)
        missing = known[np.minimum(np.searchsorted(known, keys), len(known) - 1)] != keys
        cells = across[first[missing]]
        values = grid.at(cells[:, None] + CORNERS)
        known = np.union1d(known, keys[missing])
        kept.append((cells, values))
    return np.concatenate([c for c, _ in kept]), np.concatenate([v for _, v in kept])


def _diagnosis(grid: SparseGrid, iso: float) -> str:
    """Explain why there is no surface."""
    low, low_at, high, high_at = grid.extremes()
    name = "f" if iso == 0 else f"f - {iso:g}"
    if low == high:
        return f"the field is constant ({name} = {low:.3g}): the fit collapsed; use another seed or recipe=fast"
    sign, side = ("negative", "inside") if high < 0 else ("positive", "outside")
    return (
        f"the field is {sign} everywhere in the box (min {name} = {low:.3g} at {triple(low_at)}, max {high:.3g} at "
        f"{triple(high_at)}), so all of it is {side} and there is no surface: the fit has not converged or its sign "
        "collapsed; fit longer (iterations=...) or use recipe=fast"
    )
